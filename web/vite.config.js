import { readFileSync } from "node:fs";
import { defineConfig } from "vite";

/** The minified script loses its comments: the licences of what it holds go beside it. */
const licence = {
  name: "licence",
  generateBundle() {
    for (const [name, folder] of [["uPlot", "uplot"], ["uqr", "uqr"]]) {
      const source = readFileSync(new URL(`node_modules/${folder}/LICENSE`, import.meta.url), "utf8");
      this.emitFile({ type: "asset", fileName: `assets/${name}-LICENSE.txt`, source });
    }
  },
};

/** A page that is opened from a folder may load no modules, and nothing by CORS: one script as browsers have always known them. */
const classic = {
  name: "classic",
  apply: "build",
  transformIndexHtml: {
    order: "post",
    handler: (html) => html.replace(/<script type="module" crossorigin /g, "<script defer ").replace(/<link rel="stylesheet" crossorigin /g, '<link rel="stylesheet" '),
  },
};

// The server sends a Content-Security-Policy without inline scripts, styles or fonts: everything is a file of its own.
export default defineConfig({
  base: "./",
  plugins: [licence, classic],
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: false,
    reportCompressedSize: false,
    // One script, and the style beside it: by default it would be put into the script.
    cssCodeSplit: false,
    rolldownOptions: { output: { format: "iife" } },
  },
  // For developing: `hapt live` behind Vite, which rewrites the page's Origin to the server's own.
  server: {
    proxy: {
      "/ws": { target: process.env.HAPT_URL ?? "http://127.0.0.1:4278", ws: true, changeOrigin: true, rewriteWsOrigin: true },
    },
  },
});
