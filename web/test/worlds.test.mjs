// A page of several worlds, in a real browser against the real server: turning chooses, pressing enters.
import assert from "node:assert/strict";
import { copyFileSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { open, place, quit, serve, turn, until } from "./desk.mjs";

const KNOBS = join(import.meta.dirname, "../../worlds/knob");
const folder = mkdtempSync(join(tmpdir(), "hapt-knobs-"));
after(quit);
after(() => rmSync(folder, { recursive: true, force: true }));

function visit(name, worlds, act, options) {
  test(name, { timeout: 90_000 }, async () => {
    const server = await serve(worlds);
    try {
      const desk = await open(server.url, options);
      await act(desk.page);
      desk.quiet();
      await desk.context.close();
    } finally {
      await server.end();
    }
  });
}

const title = (page) => () => page.textContent("#title");
const chosen = (page) => async () => ((await page.locator("#tiles .chosen").count()) === 1 ? page.textContent("#tiles .chosen") : null);
const running = (page) => async () => ((await page.locator('#tiles [aria-pressed="true"]').count()) === 1 ? page.textContent('#tiles [aria-pressed="true"]') : null);
/** Presses the knob where its mark is, without turning it. */
async function press(page) {
  const box = await page.locator("#stage").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height * 0.15);
}

visit("the knob is pressed, turned and pressed: the menu runs meanwhile, and the world that is chosen begins at its 0 where the knob stands", "@knob", async (page) => {
  const tiles = await page.locator("#tiles button").allTextContents();
  assert.equal(tiles.length, 14);
  assert.equal(tiles[0], "Unbounded, no detents");
  assert.equal(await running(page)(), tiles[0]);
  for (const degrees of [92, -61, 183]) {
    const before = tiles.indexOf(await running(page)());
    await press(page);
    await until(title(page), (text) => text === "Knob: a menu");
    await until(chosen(page), (text) => text === tiles[before]);
    await turn(page, degrees);
    await page.mouse.up();
    // A click every 30 degrees, and at one the knob comes to rest.
    const next = tiles.at((before + Math.round(degrees / 30)) % tiles.length);
    await until(chosen(page), (text) => text === next);
    await press(page);
    await until(running(page), (text) => text === next);
    assert.equal(await page.locator("#tiles .chosen").count(), 0);
    await until(() => place(page), (puck) => Math.abs(puck) < 2);
    assert.equal(await page.getAttribute("#phase", "data-phase"), "running");
  }
});

visit("with the keyboard: Enter begins and ends a choice, arrow keys turn the knob or go from tile to tile, Back returns", "@knob", async (page) => {
  const tiles = await page.locator("#tiles button").allTextContents();
  await page.locator("#stage").focus();
  await page.keyboard.press("Enter");
  await until(title(page), (text) => text === "Knob: a menu");
  await page.keyboard.down("ArrowRight");
  await until(chosen(page), (text) => text === tiles[2]);
  await page.keyboard.up("ArrowRight");
  await page.keyboard.press("Enter");
  await until(title(page), (text) => text !== "Knob: a menu");
  const now = await running(page)();
  assert.ok(tiles.indexOf(now) >= 2, now);
  await page.click("#choose");
  await until(title(page), (text) => text === "Knob: a menu");
  await page.click("#back");
  await until(running(page), (text) => text === now);
  await page.locator("#tiles button").nth(7).focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  await until(running(page), (text) => text === tiles[8]);
  // What was set belongs to the world that it was set in.
  await page.locator('[data-key="couplings.0.torque"] input[type=text]').fill("1 N mm");
  await page.keyboard.press("Enter");
  await until(() => page.locator("#differences").isVisible(), Boolean);
  await page.click("#tiles button >> nth=0");
  await until(running(page), (text) => text === tiles[0]);
  await page.click("#tiles button >> nth=8");
  await until(running(page), (text) => text === tiles[8]);
  assert.ok(await page.locator("#differences").isHidden());
  assert.ok(await page.isDisabled("#undo"));
  await page.keyboard.press("Escape");
  await until(() => page.getAttribute("#phase", "data-phase"), (phase) => phase === "faulted");
});

for (const name of ["fine", "unbounded"]) copyFileSync(join(KNOBS, `${name}.toml`), join(folder, `${name}.toml`));

visit("a folder of worlds without a menu: the world that runs stays while the knob chooses", folder, async (page) => {
  const tiles = await page.locator("#tiles button").allTextContents();
  assert.deepEqual(tiles, ["Fine values, no detents", "Unbounded, no detents"]);
  await page.click("#choose");
  await until(chosen(page), (text) => text === tiles[0]);
  await turn(page, 33);
  await until(chosen(page), (text) => text === tiles[1]);
  await page.mouse.up();
  assert.equal(await running(page)(), tiles[0]);
  await page.click("#choose");
  await until(running(page), (text) => text === tiles[1]);
  await until(() => place(page), (puck) => Math.abs(puck) < 2);
});

visit("one world has no tiles", "@knob/fine", async (page) => {
  assert.ok(await page.locator("#worlds").isHidden());
  await press(page);
  assert.equal(await title(page)(), "Knob: fine values, no detents");
});

visit(
  "at 390 pixels the tiles stand below the wheel, and nothing overflows",
  "@knob",
  async (page) => {
    assert.ok(await page.locator("#tiles").isVisible());
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
    await page.locator("#tiles button").nth(3).tap();
    await until(title(page), (text) => text === "Knob: on and off");
  },
  { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
);
