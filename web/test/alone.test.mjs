// The page without a server, in a real browser: from a report's folder, where only hapt's core runs.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, test } from "node:test";
import { extremes, HAPT, launch, number, open, place, quit, swing, turn, until, world } from "./desk.mjs";

const folder = mkdtempSync(join(tmpdir(), "hapt-report-"));
after(quit);
after(() => rmSync(folder, { recursive: true, force: true }));

/** A test on a world's page in a report. */
function visit(name, file, stem, act, options) {
  test(name, { timeout: 90_000 }, async () => {
    const said = spawnSync(HAPT, ["report", file, "--out", folder], { encoding: "utf8" });
    assert.equal(said.status, 0, said.stderr);
    const desk = await open(pathToFileURL(join(folder, "live", `${stem}.html`)).href, options);
    await act(desk.page);
    desk.quiet();
    await desk.context.close();
  });
}

const verdict = (page) => () => page.locator("#verdict").textContent();
const phase = (page) => () => page.getAttribute("#phase", "data-phase");
const trace = (page, plot, index) => async () => number(await page.locator(".plot").nth(plot).locator("b").nth(index).textContent());
const set = async (page, key, value) => {
  const field = page.locator(`[data-key="${key}"] input[type=text]`);
  await field.fill(value);
  await field.press("Enter");
};

visit("grabbed, the puck follows the hand; released, puck and wheel swing by themselves", "@notes/default", "default", async (page) => {
  const [[low, high], [least, most]] = await swing(page, trace(page, 3, 0));
  assert.ok(high - low > 5, `the wheel swings, from ${low} to ${high} degrees`);
  assert.ok(most > 0 && least >= 0, `energy is never negative, ${least} to ${most}`);
});

visit("forward Euler's torque grows up to the motor's limit, and the file's own values bring the certificate back", "@notes/default", "default", async (page) => {
  await until(verdict(page), (text) => text === "Certified");
  await page.click("#euler");
  await until(verdict(page), (text) => text === "Not judged");
  await set(page, "loop.period", "10 ms");
  await until(() => page.locator(".command").textContent(), (text) => /^hapt check @notes\/default --set 'loop\.period=10 ms' --set loop\.method=forward-euler$/.test(text));
  await page.click('#scenarios [data-name="step"]');
  const limit = 822.25;
  await until(trace(page, 2, 0), (torque) => Math.abs(torque) > limit + 5, 30);
  const [low, high] = await extremes(page, trace(page, 2, 1), 2);
  assert.ok(low > -limit - 0.5 && high < limit + 0.5, `the motor is asked for ${low} to ${high} N mm`);
  assert.ok(Math.max(-low, high) > limit - 10, `and for the limit, ${low} to ${high}`);
  await page.click("#reset");
  await until(verdict(page), (text) => text === "Certified");
  assert.equal(await page.inputValue('[data-key="loop.method"] select'), "zoh");
});

visit("one changed slider is in its certified range, or outside of it; two are judged by the command", "@notes/default", "default", async (page) => {
  const slider = page.locator('[data-key="loop.period"] input[type=range]');
  assert.ok((await page.locator('[data-key="loop.period"] .paint rect').count()) > 0);
  await slider.press("Home");
  await until(verdict(page), (text) => text === "In the certified range");
  await slider.press("End");
  await until(verdict(page), (text) => text === "Outside of the certified range");
  await set(page, "couplings.0.stiffness", "20 N mm/deg");
  await until(verdict(page), (text) => text === "Not judged");
  await set(page, "couplings.0.stiffness", "3 bananas");
  await until(() => page.locator('[data-key="couplings.0.stiffness"] .refusal').textContent(), (text) => text.includes("N mm/deg"));
});

visit("stop switches the torque off until it is cleared and armed; the link leads back to the report", "@notes/default", "default", async (page) => {
  await page.keyboard.press("Escape");
  await until(phase(page), (now) => now === "faulted");
  assert.match(await page.textContent("#fault-text"), /stop/i);
  await page.click("#clear");
  await until(phase(page), (now) => now === "disarmed");
  await page.click("#arm");
  await until(phase(page), (now) => now === "running");
  for (const gone of ["#record", ".timing"]) assert.ok(await page.locator(gone).isHidden(), `${gone} needs a server`);
  await page.click("#alone a");
  await page.click("text=Grab it");
  await page.waitForSelector('#phase[data-phase="running"]');
});

visit(
  "at 390 pixels nothing overflows, with two bodies and all that lies between them",
  world("two-bodies"),
  "two-bodies",
  async (page) => {
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
  },
  { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
);

visit("every key takes any unit, and a world brings the files that it names", world("texture"), "texture", async (page) => {
  for (const [key, value, shown] of [
    ["couplings.0.torque", "2e-3 N m", "2e-3 N m"],
    ["couplings.0.pitch", "0.2 rad", "0.2 rad"],
    ["loop.delay", "1.5 samples", "1.5 samples"],
  ]) {
    await set(page, key, value);
    await until(() => page.locator(`[data-key="${key}"] input[type=text]`).inputValue(), (text) => text === shown);
  }
  await page.selectOption('[data-key="loop.estimator"] select', "foaw");
  await until(() => page.locator('[data-key="loop.window"]').count(), (count) => count === 1);
  await until(() => page.locator(".command").textContent(), (text) => text.includes("--set loop.estimator=foaw"));
});

visit("a linear world runs there too", world("rail"), "rail", async (page) => {
  await page.locator("#stage").focus();
  await page.keyboard.down("ArrowRight");
  await until(() => place(page), (puck) => puck > 5);
  await page.keyboard.up("ArrowRight");
  assert.ok(readdirSync(join(folder, "live", "assets")).some((name) => name.startsWith("core-")));
});

test("in a notebook a world runs under its cell, and reaches nothing of the notebook", { timeout: 90_000, skip: !process.env.HAPT_PYTHON }, async () => {
  const program = "import hapt; print(hapt.load('@notes/default').widget()._repr_html_())";
  const said = spawnSync(process.env.HAPT_PYTHON, ["-c", program], { encoding: "utf8", maxBuffer: 1 << 26 });
  assert.equal(said.status, 0, said.stderr);
  const notebook = join(folder, "notebook.html");
  writeFileSync(notebook, `<!doctype html><title>A notebook</title><h1>A cell</h1>${said.stdout}`);
  const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 }, offline: true });
  const page = await context.newPage();
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
  page.on("request", (request) => request.url() !== pathToFileURL(notebook).href && complaints.push(`asked for ${request.url()}`));
  await page.goto(pathToFileURL(notebook).href);
  const cell = page.frameLocator("iframe");
  await until(() => cell.locator("#phase").getAttribute("data-phase"), (now) => now === "running");
  await until(() => cell.locator("#verdict").textContent(), (text) => text === "Certified");
  await cell.locator('[data-name="step"]').click();
  await until(async () => number(await cell.locator("#legend dd").first().textContent()), (puck) => Math.abs(puck - 45) < 0.1);
  const period = cell.locator('[data-key="loop.period"] input[type=text]');
  await period.fill("2 ms");
  await period.press("Enter");
  await until(() => cell.locator(".command").textContent(), (text) => text === 'world.set("loop.period", "2 ms").check()');
  assert.equal(await page.frames()[1].evaluate(() => { try { return String(parent.document.title); } catch { return "out of reach"; } }), "out of reach");
  assert.deepEqual(complaints, []);
  await context.close();
});
