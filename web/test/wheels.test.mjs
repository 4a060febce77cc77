// The page of a report's folder with the wheels of all stations, where nothing answers but hapt's own core.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, before, test } from "node:test";
import { HAPT, extremes, number, open, quit, slide, turn, until } from "./desk.mjs";

const folder = mkdtempSync(join(tmpdir(), "hapt-wheels-"));
after(quit);
after(() => rmSync(folder, { recursive: true, force: true }));
before(() => {
  const networks = ["pair", "chain"].map((name) => join(import.meta.dirname, `../../networks/${name}.toml`));
  const said = spawnSync(HAPT, ["report", ...networks, "--out", folder], { encoding: "utf8" });
  assert.equal(said.status, 0, said.stderr);
});

const url = (name) => pathToFileURL(join(folder, "live", `${name}.html`)).href;
const station = (page, name) => page.locator(`[data-station="${name}"]`);
const place = (page, name) => async () => number(await station(page, name).locator(".legend dd").first().textContent());
const said = (page) => () => page.locator("#network p").first().textContent();
const link = (page, n) => () => page.locator("#network > div:not(.buttons) > p").nth(n).textContent();

test("two wheels in one page share one shaft, ring as the page has warned, and a button ends it", { timeout: 600_000 }, async () => {
  const { page, context, quiet } = await open(url("pair"));
  await until(said(page), (text) => text === "✓ Certified: passive for any clocks and any loss");
  for (const n of [0, 1]) await until(link(page, n), (text) => /^(left’s link to right|right’s link to left): acts; position .* of 20 ms$/.test(text));
  await turn(page, 60, '[data-station="left"] .wheel');
  await until(place(page, "right"), (angle) => Math.abs(angle - 60) < 5, 30);
  await page.mouse.up();

  await slide(page, 3, 0.9);
  await slide(page, 0, 0.375);
  await until(said(page), (text) => text.startsWith("✗ Not certified: with the links these stations have too little damping"));
  await until(link(page, 0), (text) => number(text.replace(/^.*position /, "")) > 150, 30);
  // A slow machine draws few frames, and the loops take no more than a tenth of a second for each.
  const ringing = async () => {
    const [low, high] = await extremes(page, place(page, "right"), 4);
    return high - low;
  };
  let way = -120;
  const kicked = async () => {
    if (!(await station(page, "left").locator('.phase[data-phase="running"]').count())) await page.click("#restart");
    await turn(page, (way = -way), '[data-station="left"] .wheel');
    await page.waitForTimeout(300);
    await page.mouse.up();
    return ringing();
  };
  await until(kicked, (swing) => swing > 150, 60);
  await page.locator("#network button.remedy", { hasText: "Soften every link" }).click();
  await until(said(page), (text) => text.startsWith("✓ Certified"));
  // A wheel that was too fast has faulted, and the other is far away.
  await page.click("#restart");
  for (const name of ["left", "right"]) await station(page, name).locator('.phase[data-phase="running"]').waitFor();
  await until(ringing, (swing) => swing < 3, 240);

  // Nothing arrives, and then nothing turns.
  await slide(page, 1, 1);
  await slide(page, 0, 1);
  for (const n of [0, 1]) await until(link(page, n), (text) => text.includes("has let go"));
  await page.keyboard.press("Escape");
  for (const name of ["left", "right"]) await station(page, name).locator('.phase[data-phase="faulted"]').waitFor();
  await page.click("#alone a");
  await page.click("text=Grab the wheels");
  await page.waitForSelector('.phase[data-phase="running"]');
  quiet();
  await context.close();
});

test("on a phone two fingers hold two wheels, and nothing overflows", { timeout: 60_000 }, async () => {
  const phone = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true };
  const { page, context, quiet } = await open(url("pair"), phone);
  const at = async (name) => {
    const box = await station(page, name).locator(".wheel").boundingBox();
    return { x: box.x + box.width / 2, y: box.y + 0.15 * box.height, width: box.width };
  };
  const [left, right] = [await at("left"), await at("right")];
  const touch = await context.newCDPSession(page);
  const fingers = (way) => [
    { x: left.x + way, y: left.y, id: 1 },
    { x: right.x - way, y: right.y, id: 2 },
  ];
  await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: fingers(0) });
  for (let step = 1; step <= 10; step++) {
    await touch.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: fingers((step * left.width) / 50) });
    await page.waitForTimeout(20);
  }
  // Against each other: what one pulls the other holds.
  await until(place(page, "left"), (angle) => angle > 10);
  await until(place(page, "right"), (angle) => angle < -10);
  await touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  await until(place(page, "left"), (angle) => Math.abs(angle) < 10);
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
  quiet();
  await context.close();

  const chain = await open(url("chain"), phone);
  await until(() => chain.page.locator("#network meter").count(), (count) => count === 20);
  for (let n = 0; n < 20; n++) await until(link(chain.page, n), (text) => text.includes(": acts; "));
  assert.equal(await chain.page.evaluate(() => document.documentElement.scrollWidth), 390);
  chain.quiet();
  await chain.context.close();
});
