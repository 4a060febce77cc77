import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { defineConfig } from "vite";

/** The minified script loses its comments: the licence of what it holds stands before it. */
const licence = readFileSync(new URL("node_modules/uplot/LICENSE", import.meta.url), "utf8").trim();

/** A report names its script's hash, so that a browser runs no other. */
const sum = {
  name: "sum",
  generateBundle(_, bundle) {
    const script = bundle["plots.js"];
    script.code = `/* uPlot: ${licence} */\n${script.code}`;
    if (/<\/script|<!--/i.test(script.code)) throw new Error("the script would end the element that it stands in");
    this.emitFile({ type: "asset", fileName: "plots.sha256", source: createHash("sha256").update(script.code).digest("base64") });
  },
};

// The plots of a report, which stand in its page: one script and one style, under fixed names.
export default defineConfig({
  publicDir: false,
  plugins: [sum],
  build: {
    target: "es2022",
    outDir: "dist/report",
    reportCompressedSize: false,
    cssCodeSplit: false,
    rolldownOptions: { input: "src/report.ts", output: { format: "iife", entryFileNames: "plots.js", assetFileNames: "plots[extname]" } },
  },
});
