import { readFileSync } from "node:fs";
import { defineConfig } from "vite";

/** The minified script loses its comments: uPlot's licence goes beside it. */
const licence = {
  name: "licence",
  generateBundle() {
    const source = readFileSync(new URL("node_modules/uplot/LICENSE", import.meta.url), "utf8");
    this.emitFile({ type: "asset", fileName: "assets/uPlot-LICENSE.txt", source });
  },
};

// The server sends a Content-Security-Policy without inline scripts, styles or fonts: everything is a file of its own.
export default defineConfig({
  base: "./",
  plugins: [licence],
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: false,
    reportCompressedSize: false,
  },
  // For developing: `hapt live` behind Vite, which rewrites the page's Origin to the server's own.
  server: {
    proxy: {
      "/ws": { target: process.env.HAPT_URL ?? "http://127.0.0.1:4278", ws: true, changeOrigin: true, rewriteWsOrigin: true },
    },
  },
});
