// The plots of a report, which hapt writes and a browser opens from its folder.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";
import { HAPT, launch, number, quit, until } from "./desk.mjs";

const folder = mkdtempSync(join(tmpdir(), "hapt-report-"));
after(async () => {
  await quit();
  rmSync(folder, { recursive: true });
});

/** A test with a world's report open in a browser that is offline and reports no error. */
function reads(name, world, stem, act, options = {}) {
  test(name, { timeout: 120_000 }, async () => {
    const { status, stderr } = spawnSync(HAPT, ["report", world, "--out", folder], { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 }, offline: true, ...options });
    const page = await context.newPage();
    const complaints = [];
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
    const own = pathToFileURL(join(folder, `${stem}.html`)).href;
    page.on("request", (request) => !request.url().startsWith("blob:") && request.url() !== own && complaints.push(`asked for ${request.url()}`));
    await page.goto(own);
    await act(page);
    assert.deepEqual(complaints, []);
    await context.close();
  });
}

const ticks = (page) => page.locator(".tools p").first().textContent();
/** The value above a plot of the first run. */
const value = async (page, plot, index) => number(await page.locator(".plot").nth(plot).locator("b").nth(index).textContent());
const point = (page, plot, x) => page.locator(".plot .u-over").nth(plot).hover({ position: { x, y: 60 } });

reads("one cursor reads all panels, zooming spreads them, and what is seen is saved", "@notes/default", "default", async (page) => {
  assert.equal(await page.locator(".plots canvas").count(), 4);
  assert.equal(await page.locator(".run figure:not(.plot):visible").count(), 0, "the still figures have given way");
  await page.locator(".plots").scrollIntoViewIfNeeded();
  // The wheel swings from 0 to 90 degrees about the held puck, once a second.
  const times = [];
  for (const x of [100, 300]) {
    await point(page, 0, x);
    const time = Number(/^At ([\d.]+) s$/.exec(await until(() => ticks(page), (text) => text.startsWith("At ")))[1]);
    times.push(time);
    const wheel = 45 - 45 * Math.cos(2 * Math.PI * time);
    await until(() => value(page, 0, 1), (shown) => Math.abs(shown - wheel) < 1);
    const torque = -17.7778 * (45 - wheel);
    assert.ok(Math.abs((await value(page, 2, 0)) - torque) < 20, `${await value(page, 2, 0)} N mm, of ${torque}`);
    await page.mouse.move(5, 5);
    await until(() => ticks(page), (text) => text.startsWith("Drag"));
  }
  // 754 px, ten seconds: half as wide after zooming by 1.5 twice and a little more.
  const before = times[1] - times[0];
  for (let i = 0; i < 2; i++) await page.getByRole("button", { name: "Zoom in" }).click();
  const at = async (x) => {
    await point(page, 3, x);
    return Number(/^At ([\d.]+) s$/.exec(await until(() => ticks(page), (text) => text.startsWith("At ")))[1]);
  };
  const [first, second] = [await at(100), await at(300)];
  assert.ok(Math.abs(before / (second - first) - 2.25) < 0.05, `${before} and ${second - first}`);
  const [table] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save as CSV" }).click()]);
  assert.equal(table.suggestedFilename(), "default-step.csv");
  const [names, ...rows] = readFileSync(await table.path(), "utf8").trim().split("\n").map((row) => row.split(","));
  assert.deepEqual(names.slice(0, 5), ["t", "puck_rad", "wheel_rad", "puck_rad_per_s", "wheel_rad_per_s"]);
  assert.ok(rows.length > 300 && rows.every(([t]) => t > 2.7 && t < 7.3), `${rows.length} rows of what is seen`);
  for (const row of rows) {
    const [t, puck, wheel] = row.map(Number);
    assert.ok(Math.abs(puck - Math.PI / 4) < 1e-6 && Math.abs(wheel - (Math.PI / 4) * (1 - Math.cos(2 * Math.PI * t))) < 0.01, row.join());
  }
  const [picture] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save as PNG" }).click()]);
  assert.equal(picture.suggestedFilename(), "default-step.png");
  assert.equal(readFileSync(await picture.path()).toString("latin1", 1, 4), "PNG");
  await page.getByRole("button", { name: "All" }).click();
  assert.ok(Math.abs((await at(300)) - (await at(100)) - before) < 0.05);
  // With Ctrl the mouse's wheel spreads, without it the page scrolls.
  const top = await page.evaluate(() => scrollY);
  await page.mouse.wheel(0, -50);
  await until(() => page.evaluate(() => scrollY), (now) => now < top);
  await page.locator(".plots").scrollIntoViewIfNeeded();
  await point(page, 3, 200);
  await page.keyboard.down("Control");
  await page.mouse.wheel(0, -240);
  await page.keyboard.up("Control");
  await until(async () => (await at(300)) - (await at(100)), (span) => span < before / 1.5);
  // On paper there are the still figures.
  await page.emulateMedia({ media: "print" });
  assert.ok((await page.locator(".run figure:not(.plot) svg:visible").count()) >= 2);
  assert.equal(await page.locator(".plots:visible").count(), 0);
});

reads(
  "without JavaScript the figures stand still",
  "@notes/euler",
  "euler",
  async (page) => {
    assert.equal(await page.locator("canvas").count(), 0);
    assert.equal(await page.locator(".run figure svg.hapt:visible").count(), 2);
  },
  { javaScriptEnabled: false },
);

reads("each station of a network has plots of its own, on a phone too", new URL("../../networks/pair.toml", import.meta.url).pathname, "pair", async (page) => {
  assert.deepEqual(await page.locator(".run h3").allTextContents(), ["pair-push-left", "pair-push-right"]);
  assert.equal(await page.locator(".plots canvas").count(), 6);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
}, { viewport: { width: 390, height: 844 } });

for (const world of ["@notes/default", "@notes/euler"]) {
  test(`the report of ${world} stays under a megabyte`, () => {
    assert.equal(spawnSync(HAPT, ["report", world, "--out", folder]).status, 0);
    assert.ok(readFileSync(join(folder, `${world.split("/")[1]}.html`)).length < 1_000_000);
  });
}
