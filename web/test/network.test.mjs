// Two wheels of a network, each on its own page in its own browser, and one course of events that both show.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, test } from "node:test";
import { HAPT, extremes, number, open, place, quit, slide, turn, until } from "./desk.mjs";

after(quit);

const PAIR = join(import.meta.dirname, "../../networks/pair.toml");
const said = (page) => () => page.locator("#network p").first().textContent();
const link = (page) => () => page.locator("#network p").nth(1).textContent();

/** Without loss and with a constant delay most of `age_max` is left for a busy machine's pauses. The pictures are of the file as it is. */
const STEADY = process.env.PICTURES ? [] : ["--set", "links.0.loss=0", "--set", "links.0.delay_max=0.3ms"];

/** With PICTURES, the folder for the pictures of docs/links.md: `npm run pictures`. */
async function picture(page, name) {
  const folder = process.env.PICTURES;
  if (folder) await page.screenshot({ path: join(folder, `${name}.png`), clip: { x: 0, y: 0, width: 1280, height: 800 } });
}

test("two pages share one shaft, both warn before it rings, and a button ends it", { timeout: 300_000 }, async () => {
  const child = spawn(HAPT, ["live", PAIR, "--port", "0", ...STEADY], { stdio: ["ignore", "pipe", "inherit"] });
  try {
    const lines = createInterface({ input: child.stdout });
    const urls = [];
    for await (const line of lines) {
      assert.match(line, /^(left|right) +http:/);
      if (urls.push(line.split(/ +/)[1]) === 2) break;
    }
    const desks = [await open(urls[0]), await open(urls[1])];
    const [left, right] = desks.map(({ page }) => page);
    for (const page of [left, right]) {
      await until(said(page), (text) => text.startsWith("✓ Certified: passive for any clocks"));
      await until(link(page), (text) => text.includes("acts; position") && text.includes("of 20 ms"), 30);
    }
    assert.match(await left.locator("#network h2").textContent(), /station left$/);
    // The verdict follows a station's own settings too, on both pages.
    const damping = async (value) => {
      await right.evaluate(() => document.querySelectorAll("#knobs details").forEach((details) => (details.open = true)));
      const field = right.locator('[data-key="device.damping"] input[type=text]');
      await field.fill(value);
      await field.press("Enter");
    };
    await damping("1 N mm s/rad");
    for (const page of [left, right]) await until(said(page), (text) => text.startsWith("✗ Not certified: with the links these stations have too little damping"));
    await right.click("#reset");
    for (const page of [left, right]) await until(said(page), (text) => text.startsWith("✓ Certified: passive for any clocks"));

    // The other wheel is pulled along, and is no hand on this page. Where a busy machine has made the link release, it takes hold softly, and
    // draws the other wheel along.
    let way = 60;
    const pulled = async () => {
      await turn(left, way);
      let most = 0;
      for (let look = 0; look < 20 && most <= 40; look += 1) {
        await left.waitForTimeout(200);
        most = Math.max(most, Math.abs(await place(right)));
      }
      await left.mouse.up();
      way = way > 0 ? -120 : 120;
      return most;
    };
    await until(pulled, (angle) => angle > 40, 90);
    await picture(right, "pair-shaft");

    // A long delay, and an `age_max` that allows it: both pages warn before any hand turns a wheel.
    await slide(left, 3, 0.9);
    await slide(left, 0, 0.375);
    for (const page of [left, right]) {
      await until(said(page), (text) => text.startsWith("✗ Not certified: with the links"));
      await until(link(page), (text) => number(text.replace(/^.*position /, "")) > 120, 30);
      assert.match(await page.locator("#network output").first().textContent(), /^75 ms$/);
      assert.match(await page.locator("#warnings").textContent(), /The network is not certified/);
    }
    const ringing = async () => {
      const [low, high] = await extremes(right, () => place(right), 2);
      return high - low;
    };
    // It rings ever more, up to the fault of a wheel that is too fast, which may have come before a busy machine looks.
    const armed = async (page) => {
      const phase = () => page.getAttribute("#phase", "data-phase");
      if ((await phase()) === "running") return;
      if ((await phase()) === "faulted") await page.click("#clear");
      await until(phase, (now) => now === "disarmed");
      await page.click("#arm");
      await until(phase, (now) => now === "running");
    };
    // A busy machine may stand still for longer than a position is valid: the link releases, and the wheel is turned once more.
    way = 120;
    const kicked = async () => {
      for (const page of [left, right]) await armed(page);
      await turn(left, way);
      await left.waitForTimeout(300);
      await left.mouse.up();
      way = way > 0 ? -240 : 240;
      return ringing();
    };
    await until(kicked, (swing) => swing > 90, 60);
    await picture(right, "pair-rings");

    // The remedy on the other page.
    await right.locator("#network button.remedy", { hasText: "Soften every link" }).click();
    for (const page of [left, right]) await until(said(page), (text) => text.startsWith("✓ Certified"));
    await until(ringing, (swing) => swing < 10, 60);
    await picture(right, "pair-quiet");

    // Every position is older than the link allows: both ends release, and show why.
    await slide(right, 3, 0);
    await slide(right, 0, 1);
    for (const page of [left, right]) {
      await until(link(page), (text) => text.includes("has let go"), 30);
      await until(() => page.locator("#warnings").textContent(), (text) => /The link to (left|right) has let go/.test(text));
    }
    for (const desk of desks) desk.quiet();
  } finally {
    child.kill("SIGTERM");
    if (child.exitCode === null && child.signalCode === null) await once(child, "exit");
  }
});
