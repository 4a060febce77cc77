// What a game plays on the wheel, on its page: crates/hapt-live/examples/wheel_page.rs is the computer that has the wheel.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, test } from "node:test";
import { WHEEL, number, open, quit, until } from "./desk.mjs";

after(quit);

test("the card shows what a game plays, the torque that it requests and gets, and presses pedals and buttons", { timeout: 120_000, skip: process.platform !== "linux" }, async () => {
  const folder = mkdtempSync(join(tmpdir(), "hapt-wheel-"));
  const child = spawn(WHEEL, [folder], { stdio: ["pipe", "pipe", "inherit"] });
  try {
    const lines = createInterface({ input: child.stdout });
    const [url] = await once(lines, "line");
    let pressed = "";
    lines.on("line", (line) => (pressed = line));
    const plays = (line) => child.stdin.write(`${line}\n`);
    const desk = await open(url);
    const { page } = desk;
    const card = page.locator("#gamewheel");
    const rows = () => card.locator("tr").allTextContents();
    const torque = (bar) => async () => number(await card.locator("output").nth(bar).textContent());
    const reason = () => card.locator(".reason").textContent();

    // The simulated wheel has armed itself, and nothing plays.
    await until(() => card.isVisible(), (visible) => visible);
    assert.deepEqual(await rows(), ["no effect plays"]);
    assert.match(await reason(), /^All that is asked is given; it takes 0 % of the damping\.$/);
    assert.equal(await page.locator("#knobs input:enabled").count(), 0, "the world stays as it is");

    // From the right of the host's numbers: half of 5 N m to the left, against the wheel's stop.
    plays("torque 0.5");
    await until(rows, (texts) => texts.length === 1 && texts[0].startsWith("torque"));
    for (const bar of [0, 1]) await until(torque(bar), (now) => Math.abs(now + 2.5) < 0.01);
    plays("spring 1");
    plays("damper 0.5");
    plays("sine 0.2");
    await until(rows, (texts) => texts.map((text) => text.match(/^[a-z]+/)[0].replace(/torque.*/, "torque")).join(" ") === "torque spring damper torque");
    assert.match((await rows())[1], /^spring0\.637 N m\/rad, at most 5\.00 N m$/);
    // On a wheel that was fast before it played, the damper requests more than the limit for a moment.
    await until(() => card.getAttribute("class"), (name) => /good/.test(name));
    if (process.env.SHOTS) await page.screenshot({ path: join(process.env.SHOTS, "plays.png"), fullPage: true });

    // A spring that adds energy is not given, and the card shows why.
    plays("spring -1");
    await until(reason, (text) => text === "Less is given: a negative coefficient would drive the wheel by itself, and counts as 0.");
    assert.match(await card.getAttribute("class"), /bad/);
    assert.match((await rows())[4], /driving/);
    if (process.env.SHOTS) await page.screenshot({ path: join(process.env.SHOTS, "less.png"), fullPage: true });

    // A recording has the torque of the effects.
    await page.click("#record");
    await until(() => page.locator("#record").getAttribute("aria-pressed"), (on) => on === "true");
    await page.waitForTimeout(300);
    await page.click("#record");
    await until(() => readFileSync(join(folder, "live-0001.mcap")).includes("link_Nm"), (has) => has);

    // The computer sees pedals and buttons, as long as they are held.
    await card.locator("input[type=range]").first().evaluate((input) => {
      input.value = input.max;
      input.dispatchEvent(new Event("input"));
    });
    const third = card.locator("button").nth(2);
    await third.hover();
    await page.mouse.down();
    await until(() => pressed, (line) => line === "pressed 32767 0 0 4");
    assert.equal(await third.getAttribute("aria-pressed"), "true");
    await page.mouse.up();
    await until(() => pressed, (line) => line === "pressed 32767 0 0 0");

    plays("free");
    await until(rows, (texts) => texts.join() === "no effect plays");
    await until(torque(1), (now) => now === 0);
    plays("unplug");
    await until(() => card.locator("[role=status]").textContent(), (text) => text === "The computer has detached the wheel.");
    desk.quiet();
    await desk.context.close();
  } finally {
    child.stdin.end();
    if (child.exitCode === null) await once(child, "exit");
    rmSync(folder, { recursive: true });
  }
});
