// Proves that dist/ is what the sources build to: builds beside it, and compares every byte.
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { build } from "vite";

const BUDGET = 300_000;
const fresh = mkdtempSync(join(tmpdir(), "hapt-page-"));
const files = (root) =>
  readdirSync(root, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => join(entry.parentPath ?? entry.path, entry.name).slice(root.length + 1))
    .sort();

try {
  await build({ logLevel: "warn", build: { outDir: fresh, emptyOutDir: true } });
  await build({ logLevel: "warn", configFile: "vite.report.config.js", build: { outDir: join(fresh, "report"), emptyOutDir: true } });
  const dist = join(import.meta.dirname, "dist");
  const [built, kept] = [files(fresh), files(dist)];
  const problems = [
    ...built.filter((name) => !kept.includes(name)).map((name) => `dist/${name} is missing`),
    ...kept.filter((name) => !built.includes(name)).map((name) => `dist/${name} is stale`),
    ...built
      .filter((name) => kept.includes(name) && !readFileSync(join(fresh, name)).equals(readFileSync(join(dist, name))))
      .map((name) => `dist/${name} differs`),
  ];
  const size = built.reduce((sum, name) => sum + readFileSync(join(fresh, name)).length, 0);
  if (size > BUDGET) problems.push(`the page has ${size} bytes, more than ${BUDGET}`);
  if (problems.length > 0) {
    console.error(problems.join("\n") + "\nrun `npm run build` and check in dist/");
    process.exitCode = 1;
  } else {
    console.log(`dist/ is what the sources build to: ${built.length} files, ${size} bytes`);
  }
} finally {
  rmSync(fresh, { recursive: true, force: true });
}
