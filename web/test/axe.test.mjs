// Every view against the rules of WCAG that a program can check (axe-core), at three widths, dark and light.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";
import axe from "axe-core";
import { HAPT, WHEEL, launch, open, quit, serve, until, world } from "./desk.mjs";

const WIDTHS = [390, 720, 1280];
const folder = mkdtempSync(join(tmpdir(), "hapt-axe-"));
after(async () => {
  await quit();
  rmSync(folder, { recursive: true });
});

/** Fails with each rule that the view breaks, and the elements that do. */
async function accessible(page, view) {
  const found = [];
  for (const width of WIDTHS) {
    for (const colorScheme of ["dark", "light"]) {
      await page.setViewportSize({ width, height: 900 });
      await page.emulateMedia({ colorScheme });
      // Colours change over some time, and have to be the new ones.
      await page.evaluate(() => Promise.allSettled(document.getAnimations().filter((a) => a instanceof CSSTransition).map((a) => a.finished)));
      // The source is evaluated outside of the page's scripts: the page's policy lets no other script in.
      await page.evaluate(axe.source);
      const { violations, passes } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
      assert.ok(passes.length > 10, `${view}: axe saw ${passes.length} rules hold`);
      found.push(...violations.map(({ id, nodes }) => `${width} ${colorScheme} ${id}: ${nodes.map((node) => node.target.join(" ")).join(", ")}`));
    }
  }
  assert.deepEqual(found, [], view);
}

/** The views of a live page, each after what leads to it. */
function live(name, file, views) {
  test(`the page of ${name} breaks no rule`, { timeout: 180_000 }, async () => {
    const server = await serve(file);
    try {
      const { page, context } = await open(server.url);
      for (const [view, act] of Object.entries(views)) {
        await act(page);
        await accessible(page, `${name}, ${view}`);
      }
      await context.close();
    } finally {
      await server.end();
    }
  });
}

const phase = (page, wanted) => until(() => page.getAttribute("#phase", "data-phase"), (now) => now === wanted);
const press = (id) => (page) => page.evaluate((name) => document.getElementById(name).click(), id);

live("a world", "@notes/default", {
  running: (page) => until(() => page.textContent("#verdict"), (text) => text === "Certified"),
  changed: async (page) => {
    await press("euler")(page);
    await until(() => page.locator("#differences").isVisible(), Boolean);
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
  },
  faulted: async (page) => {
    await press("stop")(page);
    await phase(page, "faulted");
  },
  disarmed: async (page) => {
    await press("clear")(page);
    await phase(page, "disarmed");
  },
});

live("a world that asks for a remedy", "@notes/wheel", { running: (page) => page.locator("button.remedy").first().waitFor() });
live("a network", join(import.meta.dirname, "../../networks/pair.toml"), { running: (page) => until(() => page.textContent("#verdict"), Boolean) });
live("a rail", world("rail"), { running: () => {} });
live("several worlds", "@knob", {
  running: (page) => until(() => page.textContent("#verdict"), (text) => text === "Certified"),
  choosing: async (page) => {
    await press("choose")(page);
    await page.locator("#tiles .chosen").waitFor();
  },
});

test("the page of a wheel for games breaks no rule", { timeout: 180_000, skip: process.platform !== "linux" }, async () => {
  const child = spawn(WHEEL, [mkdtempSync(join(folder, "wheel-"))], { stdio: ["pipe", "pipe", "inherit"] });
  try {
    const [url] = await once(createInterface({ input: child.stdout }), "line");
    const { page, context } = await open(url);
    child.stdin.write("torque 0.5\n");
    await until(() => page.locator("#gamewheel tr").count(), (count) => count >= 1);
    await accessible(page, "a game plays");
    await context.close();
  } finally {
    child.stdin.end();
    await once(child, "exit");
  }
});

for (const [of, stem] of [["@notes/default", "default"], ["@notes/wheel", "wheel"]]) {
  test(`the report of ${of} breaks no rule`, { timeout: 180_000 }, async () => {
    const { status, stderr } = spawnSync(HAPT, ["report", of, "--out", folder], { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    const context = await (await launch()).newContext({ offline: true });
    const page = await context.newPage();
    await page.goto(pathToFileURL(join(folder, `${stem}.html`)).href);
    await accessible(page, of);
    await context.close();
  });
}
