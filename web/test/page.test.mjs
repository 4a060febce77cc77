// The page in a real browser, against the real server.
import assert from "node:assert/strict";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { isAbsolute } from "node:path";
import { after, test } from "node:test";
import { extremes, launch, number, open, place, quit, serve, swing, turn, until, world } from "./desk.mjs";

after(quit);

/** A test with a server and one page on it, both gone afterwards. */
function visit(name, file, act, options, away) {
  test(name, { timeout: 90_000 }, async () => {
    const server = await serve(file);
    try {
      const desk = await open(server.url, options, away);
      await act(desk.page, server, desk);
      desk.quiet();
      await desk.context.close();
    } finally {
      await server.end();
    }
  });
}

const verdict = (page) => () => page.locator("#verdict").textContent();
const phase = (page) => () => page.getAttribute("#phase", "data-phase");
const trace = (page, plot, index) => async () => number(await page.locator(".plot").nth(plot).locator("b").nth(index).textContent());
const locked = async (page) => (await page.locator("#knobs:disabled").count()) > 0;
const set = async (page, key, value) => {
  const field = page.locator(`[data-key="${key}"] input[type=text]`);
  await field.fill(value);
  await field.press("Enter");
};

visit("grabbed, the puck follows the hand; released, puck and wheel swing by themselves", undefined, async (page) => {
  const [[low, high], [least, most]] = await swing(page, trace(page, 3, 0));
  assert.ok(high - low > 5, `the wheel swings, from ${low} to ${high} degrees`);
  assert.equal(await page.getAttribute("#stage", "data-held"), null);
  assert.ok(most > 0 && least >= 0, `energy is never negative, ${least} to ${most}`);
});

visit("an experiment begins at rest, however far the puck has turned before", "@notes/default", async (page) => {
  await turn(page, 90);
  await page.mouse.up();
  await until(() => place(page), (puck) => Math.abs(puck) > 60);
  await page.click('#scenarios [data-name="step"]');
  await until(() => place(page), (puck) => Math.abs(puck - 45) < 0.1);
  // 45 degrees of the spring are 800 N mm, and nothing else pulls.
  const [low, high] = await extremes(page, trace(page, 2, 0), 2);
  assert.ok(low > -805 && high < 805, `${low} to ${high} N mm`);
});

visit("forward Euler is judged unstable, and its torque grows up to the motor's limit", "@notes/default", async (page) => {
  await page.click("#euler");
  await until(verdict(page), (text) => text === "Not certified: unstable");
  // Growth is w²T/2 a second: at 10 ms ten times that of the notes.
  await set(page, "loop.period", "10 ms");
  await page.click('#scenarios [data-name="step"]');
  const limit = 822.25;
  await until(trace(page, 2, 0), (torque) => Math.abs(torque) > limit + 5, 30);
  const [low, high] = await extremes(page, trace(page, 2, 1), 2);
  assert.ok(low > -limit - 0.5 && high < limit + 0.5, `the motor is asked for ${low} to ${high} N mm`);
  assert.ok(Math.max(-low, high) > limit - 10, `and for the limit, ${low} to ${high}`);
  await page.click("#euler");
  await until(() => page.inputValue('[data-key="loop.method"] select'), (method) => method === "zoh");
});

visit("a slider moved out of its certified range changes the verdict, and back into it restores the verdict", "@notes/default", async (page) => {
  await until(verdict(page), (text) => text === "Certified");
  const slider = page.locator('[data-key="loop.period"] input[type=range]');
  await slider.focus();
  await page.waitForSelector('[data-key="loop.period"].ranged', { timeout: 20_000 });
  const certified = await page.locator('[data-key="loop.period"] .certified').textContent();
  assert.match(certified, /^certified .*ms/);
  assert.ok((await page.locator('[data-key="loop.period"] .paint rect').count()) > 0);
  await slider.press("End");
  await until(verdict(page), (text) => text.startsWith("Not certified"));
  // The certified range of a key does not depend on where that key stands.
  assert.equal(await page.locator('[data-key="loop.period"] .certified').textContent(), certified);
  await page.click("#reset");
  await until(verdict(page), (text) => text === "Certified");
});

visit("a remedy is one press away", "@notes/wheel", async (page) => {
  await until(verdict(page), (text) => text.startsWith("Not certified"));
  await page.locator("button.remedy").first().click();
  await until(verdict(page), (text) => text === "Certified");
});

visit("a remedy of several keys is one press away, and one change", world("two-bodies"), async (page) => {
  // It is not certified at its own period either, and has other remedies there.
  await until(verdict(page), (text) => text.startsWith("Not certified"));
  await set(page, "loop.period", "4 ms");
  await page.locator('.knob.changed[data-key="loop.period"]').waitFor();
  const several = page.locator('button.remedy[data-key*=" "]').first();
  await several.waitFor();
  const keys = (await several.getAttribute("data-key")).split(" ");
  assert.ok(keys.length >= 2 && (await several.textContent()).split("\n").length === keys.length, `a line for each of ${keys}`);
  await several.click();
  await until(verdict(page), (text) => text === "Certified");
  for (const key of keys) assert.equal(await page.locator(`.knob.changed[data-key="${key}"]`).count(), 1, key);
});

visit("an invalid value shows its error next to the field, and changes nothing", undefined, async (page) => {
  const before = await page.inputValue('[data-key="couplings.0.stiffness"] input[type=text]');
  await set(page, "couplings.0.stiffness", "3 bananas");
  await until(() => page.locator('[data-key="couplings.0.stiffness"] .refusal').textContent(), (text) => text.includes("bananas"));
  assert.equal(await page.getAttribute('[data-key="couplings.0.stiffness"] input[type=text]', "aria-invalid"), "true");
  await set(page, "loop.period", "2 ms");
  await until(() => page.locator(".knob.changed").count(), (changed) => changed === 1);
  assert.equal(await page.inputValue('[data-key="couplings.0.stiffness"] input[type=text]'), before);
});

visit("a reload releases the hand and comes back to the same running loop", undefined, async (page) => {
  await set(page, "loop.period", "2 ms");
  await turn(page, 60);
  await until(() => place(page), (puck) => puck > 40);
  await page.reload();
  await page.waitForSelector('#phase[data-phase="running"]');
  await until(() => locked(page), (off) => !off);
  assert.equal(await page.inputValue('[data-key="loop.period"] input[type=text]'), "2 ms");
  await page.mouse.up();
  const [low, high] = await extremes(page, () => place(page), 3);
  // A busy computer reloads late, when the swing has decayed; a held puck stays where it is.
  assert.ok(high - low > 1, `the puck is hands-off: it goes from ${low} to ${high} degrees`);
});

test("of two tabs one has control; the other watches, may stop, and may take it", { timeout: 90_000 }, async () => {
  const server = await serve();
  try {
    const first = await open(server.url);
    const second = await open(server.url);
    await until(() => second.page.locator("#watching").isVisible(), Boolean);
    assert.ok(await locked(second.page));
    assert.ok(await first.page.isEnabled("#disarm"));
    await turn(second.page, 60);
    await second.page.mouse.up();
    assert.ok(Math.abs(await place(first.page)) < 1, "who watches moves nothing");
    await second.page.click("#take");
    await until(() => first.page.locator("#watching").isVisible(), Boolean);
    await until(() => locked(second.page), (off) => !off);
    await turn(second.page, 60);
    await until(() => place(first.page), (puck) => puck > 40);
    await second.page.mouse.up();
    await first.page.click("#stop");
    await until(phase(second.page), (now) => now === "faulted");
    for (const desk of [first, second]) {
      desk.quiet();
      await desk.context.close();
    }
  } finally {
    await server.end();
  }
});

visit(
  "without the server a banner shows it and controls are off; with it again they are on",
  undefined,
  async (page, server) => {
    await server.end("SIGKILL");
    await until(() => page.locator("#lost").isVisible(), Boolean);
    assert.ok(await locked(page));
    assert.ok(await page.isDisabled("#disarm"));
    assert.ok(await page.isVisible("#stop"));
    const again = await serve(undefined, server.port);
    try {
      await until(() => page.locator("#lost").isHidden(), Boolean, 15);
      await until(() => locked(page), (off) => !off);
      await turn(page, 60);
      await until(() => place(page), (puck) => puck > 40);
      await page.mouse.up();
    } finally {
      await again.end();
    }
  },
  {},
  { down: true },
);

visit("Space and Escape stop wherever the focus is; a text field keeps its spaces", undefined, async (page) => {
  const again = async () => {
    await page.click("#clear");
    await until(phase(page), (now) => now === "disarmed");
    await page.click("#arm");
    await until(phase(page), (now) => now === "running");
  };
  for (const [key, focus] of [
    ["Space", "body"],
    ["Space", "#record"],
    ["Space", '[data-key="loop.period"] input[type=range]'],
    ["Space", '[data-key="loop.method"] select'],
    ["Escape", "#stage"],
    ["Escape", '[data-key="loop.period"] input[type=text]'],
  ]) {
    await page.locator(focus).focus();
    await page.keyboard.press(key);
    await until(phase(page), (now) => now === "faulted");
    assert.ok(await page.isVisible("#fault-text"));
    assert.ok((await page.textContent("#fault-clear")).length > 0, "how to clear it");
    assert.equal(await page.getAttribute("#record", "aria-pressed"), "false", "Space presses nothing else");
    await again();
  }
  const field = page.locator('[data-key="loop.period"] input[type=text]');
  await field.focus();
  await page.keyboard.press("End");
  await page.keyboard.press("Space");
  assert.equal(await field.inputValue(), "1 ms ");
  assert.equal(await phase(page)(), "running");
});

test("a loop that fades out by itself shows why, and until when", { timeout: 90_000 }, async () => {
  const server = await serve(world("hurried"));
  const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 } });
  try {
    const page = await context.newPage();
    await page.goto(server.url);
    await until(phase(page), (now) => now === "disarmed");
    await until(() => page.locator("#fault").isVisible(), Boolean);
    assert.match(await page.textContent("#fault"), /Disarmed 17 \(uneven\): A sample or a command came later than the certificate covers\..*safety\.late/s);
    assert.ok(await page.locator("#clear").isHidden(), "there is no fault to clear");
    assert.ok(await page.isEnabled("#arm"));
  } finally {
    await context.close();
    await server.end();
  }
});

visit("without a torque none is shown, and no energy, wherever the puck is turned; what starts over begins with its own", "@notes/default", async (page) => {
  const nothing = async () => {
    for (const plot of [2, 3]) assert.deepEqual(await extremes(page, trace(page, plot, 0), 0.3), [0, 0]);
    const pushes = await page.evaluate(() => [...document.querySelectorAll("[data-push]")].map((coupling) => Number(coupling.dataset.push)));
    assert.ok(pushes.length > 0 && pushes.every((push) => push === 0), `${pushes}`);
  };
  for (const [end, at] of [["disarm", "disarmed"], ["stop", "faulted"]]) {
    await turn(page, 60);
    await until(() => place(page), (puck) => puck > 40);
    await page.mouse.up();
    await page.click(`#${end}`);
    await until(phase(page), (now) => now === at);
    // The phase is shown at once, plots and places some frames later.
    for (const plot of [2, 3]) await until(trace(page, plot, 0), (shown) => shown === 0);
    await nothing();
    const body = await place(page, 1);
    await turn(page, 120);
    await page.mouse.up();
    await nothing();
    assert.equal(await place(page, 1), body, "the wheel stays where its torque ended");
    await page.click("#restart");
    await until(phase(page), (now) => now === "running");
    await until(() => place(page, 1), (wheel) => wheel === 0);
  }
});

visit("a warning goes with the world that it is of", "@notes/default", async (page) => {
  await page.click("#euler");
  await until(() => page.inputValue('[data-key="loop.method"] select'), (method) => method === "forward-euler");
  await set(page, "loop.period", "10 ms");
  await page.click('#scenarios [data-name="step"]');
  await until(() => page.textContent("#warnings"), (text) => text.includes("integration method"), 30);
  await page.click("#reset");
  await until(verdict(page), (text) => text === "Certified");
  await until(() => page.locator("#warnings").isHidden(), Boolean);
  await page.waitForTimeout(1000);
  assert.ok(await page.locator("#warnings").isHidden(), await page.textContent("#warnings"));
});

visit("with the keyboard: an arrow turns the puck, H keeps hold of it, Tab reaches everything", undefined, async (page) => {
  await page.locator("#stage").focus();
  await page.keyboard.down("ArrowRight");
  await until(() => place(page), (puck) => puck > 30);
  await page.keyboard.press("h");
  await page.keyboard.up("ArrowRight");
  // A busy machine may show a jump of the hand late: it comes to rest all the same.
  await until(() => extremes(page, () => place(page), 0.5), ([low, high]) => high - low < 20 && low > 20);
  await page.keyboard.press("h");
  await until(() => page.getAttribute("#stage", "data-held"), (held) => held === null);
  const reached = new Set();
  await page.locator("body").focus();
  for (let i = 0; i < 80; i++) {
    await page.keyboard.press("Tab");
    const { id, ring } = await page.evaluate(() => {
      const element = document.activeElement;
      if (element === document.body) return { id: "", ring: "" };
      const knob = element.closest("[data-key]");
      return { id: element.id || (knob && `${knob.dataset.key} ${element.type}`) || element.textContent, ring: getComputedStyle(element).outlineStyle };
    });
    if (id !== "") assert.notEqual(ring, "none", `${id} shows that it has the focus`);
    reached.add(id);
  }
  for (const id of ["stop", "disarm", "record", "stage", "pause", "euler", "reset", "loop.period range"]) assert.ok(reached.has(id), `Tab reaches ${id}`);
});

visit(
  "at 390 pixels nothing overflows, and stop lies on top wherever the page is scrolled",
  world("two-bodies"),
  async (page) => {
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    const overflow = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((e) => e.getBoundingClientRect().right > innerWidth + 0.5 && !e.closest("svg, .canvas")).map((e) => e.outerHTML.slice(0, 90)));
    assert.deepEqual(overflow, []);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
    const height = await page.evaluate(() => document.documentElement.scrollHeight);
    for (let y = 0; y < height; y += 400) {
      const top = await page.evaluate((y) => {
        scrollTo(0, y);
        const box = document.getElementById("stop").getBoundingClientRect();
        return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2).closest("button")?.id;
      }, y);
      assert.equal(top, "stop");
    }
    const small = await page.evaluate(() => [...document.querySelectorAll("button, select, input[type=text]")].filter((e) => e.checkVisibility() && e.getBoundingClientRect().height < 24).map((e) => e.outerHTML));
    assert.deepEqual(small, [], "WCAG 2.5.8: targets of at least 24 pixels");
  },
  { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
);

visit(
  "on a phone the verdict stays in view while the page is scrolled, and tabs show one part at a time",
  world("two-bodies"),
  async (page) => {
    const seen = (selector) => page.locator(selector).isVisible();
    for (const [tab, part, other] of [["Signals", ".signals", ".stage"], ["Verdict", "#card", ".signals"], ["Settings", ".settings", "#card"], ["Wheel", ".stage", ".settings"]]) {
      await page.click(`#tabs button:text-is("${tab}")`);
      assert.deepEqual([await seen(part), await seen(other)], [true, false], tab);
    }
    await page.click('#tabs button:text-is("Settings")');
    await page.evaluate(() => scrollTo(0, document.documentElement.scrollHeight));
    const strip = await page.locator("#strip").boundingBox();
    assert.ok(strip.y >= 0 && strip.y + strip.height < 844, `the strip is at ${strip.y}`);
    assert.equal((await page.textContent("#strip")).replace(/^. /, ""), await page.textContent("#verdict"));
    await page.click("#strip");
    assert.ok(await seen("#card"));
  },
  { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
);

for (const [width, height] of [[1280, 900], [1920, 1080], [390, 844]]) {
  visit(
    `at ${width} by ${height} text has four sizes at most, none below 12 pixels`,
    "@devices/smartknob-detents",
    async (page) => {
      await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
      const sizes = new Set();
      for (let tab = 0; tab < (width < 760 ? 4 : 1); tab++) {
        if (width < 760) await page.locator("#tabs button").nth(tab).click();
        const found = await page.evaluate(() => {
          const texts = (e) => [...e.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim()) || e.matches("input[type=text], select");
          return [...document.querySelectorAll("body *")].filter((e) => e.checkVisibility() && texts(e)).map((e) => [e instanceof SVGElement ? "inside of a drawing" : "", parseFloat(getComputedStyle(e).fontSize)]);
        });
        for (const [inside, size] of found) sizes.add(inside || size);
      }
      assert.ok(sizes.size <= 4 && [...sizes].every((size) => size >= 12), [...sizes].join(", "));
    },
    { viewport: { width, height } },
  );
}

visit("the world that opens by itself is certified, its method is in view, and one press breaks it", undefined, async (page) => {
  await until(verdict(page), (text) => text === "Certified");
  const method = await page.locator('[data-key="loop.method"] select').boundingBox();
  assert.ok(method.y + method.height < 900, `the method is at ${method.y}`);
  assert.equal(await page.textContent("#euler"), "Break it: forward Euler");
  await page.click("#euler");
  await until(verdict(page), (text) => text === "Not certified: unstable");
  // What is not certified has the colour of what is bad, as in the report.
  const colours = await page.evaluate(() => ["#verdict", "#strip"].map((id) => getComputedStyle(document.querySelector(id)).color));
  await page.click("#euler");
  await until(verdict(page), (text) => text === "Certified");
  assert.equal(colours[0], colours[1]);
  const bad = await page.evaluate(() => getComputedStyle(document.documentElement).getPropertyValue("--bad").trim());
  assert.equal(colours[0], `rgb(${[1, 3, 5].map((i) => parseInt(bad.slice(i, i + 2), 16)).join(", ")})`);
});

visit("poles and verdict agree: a free loop that decays does not keep its size", undefined, async (page) => {
  await until(verdict(page), (text) => text === "Certified");
  assert.match(await page.locator("#poles .key .free").textContent(), /free shift.*decays by 0\.0261 per s/);
  assert.match(await page.locator("#poles .key .held").textContent(), /keeps its size/);
});

visit("a fault stays in view wherever the page is scrolled", undefined, async (page) => {
  await page.click("#stop");
  await until(phase(page), (now) => now === "faulted");
  await page.evaluate(() => scrollTo(0, document.documentElement.scrollHeight));
  const banner = await page.locator("#fault").boundingBox();
  assert.ok(banner.y >= 0 && banner.y + banner.height < 300, `the banner is at ${banner.y}`);
});

visit("a value with many digits is shown with six, and whole where it is edited", undefined, async (page) => {
  const field = page.locator('[data-key="bodies.wheel.inertia"] input[type=text]');
  await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
  assert.equal(await field.inputValue(), "0.450316 N mm/(deg/s^2)");
  await field.focus();
  assert.equal(await field.inputValue(), "0.45031637174372346 N mm/(deg/s^2)");
  await page.locator("#stage").focus();
  assert.equal(await field.inputValue(), "0.450316 N mm/(deg/s^2)");
  assert.equal(await page.locator(".knob.changed").count(), 0);
});

visit("a wall two turns away is named in words, and not drawn within the first turn", world("two-turns"), async (page) => {
  await until(() => page.textContent("#far"), (text) => text === "wall 2.0 turns clockwise");
  const drawn = await page.evaluate(() => [...document.querySelectorAll(".coupling.wall")].map((wall) => getComputedStyle(wall).visibility));
  assert.deepEqual(drawn.sort(), ["hidden", "visible"]);
});

visit("margins go to the edge, and are no remedies", "@notes/default", async (page) => {
  await until(() => page.locator(".margins summary").count(), (count) => count === 1);
  assert.equal(await page.locator(".margins summary").textContent(), "Go to the edge");
  assert.equal(await page.locator(".remedies").count(), 0);
});

visit("a recording shows where its file is, also when it has ended", undefined, async (page) => {
  await page.click("#record");
  await until(() => page.textContent("#recording"), (text) => /^Recording/.test(text));
  await page.waitForTimeout(300);
  await page.click("#record");
  await until(() => page.textContent("#recording-text"), (text) => /^Recorded/.test(text));
  const file = await page.textContent("#recording-file");
  assert.ok(isAbsolute(file) && /live-\d+\.mcap$/.test(file), file);
  await until(async () => existsSync(file), Boolean);
  rmSync(file);
});

visit("paused plots are spread, moved and saved, and running ones leave the wheel to the page", "@notes/default", async (page) => {
  const saved = async (id) => {
    const [file] = await Promise.all([page.waitForEvent("download"), page.click(id)]);
    return readFileSync(await file.path());
  };
  const table = async () => (await saved("#as-csv")).toString().trim().split("\n").map((row) => row.split(","));
  const span = (rows) => Number(rows.at(-1)[0]) - Number(rows[1][0]);
  assert.equal(await page.isVisible("#as-csv"), false);
  await page.click('#scenarios [data-name="step"]');
  await until(() => place(page), (puck) => Math.abs(puck - 45) < 0.1);
  // A machine that stands still for half a second begins the plots anew.
  let whole;
  const seconds = async () => {
    await page.waitForTimeout(5000);
    await page.click("#pause");
    whole = await table();
    if (span(whole) < 4) await page.click("#pause");
    return span(whole);
  };
  await until(seconds, (s) => s >= 4);
  assert.deepEqual(whole[0].slice(0, 3), ["t", "puck_rad", "puck_rad_per_s"]);
  assert.ok(Math.abs(Number(whole.at(-1)[1]) - Math.PI / 4) < 1e-3, "45 degrees");
  // Twice 1.5, about the middle: up to a frame at either end, which a busy machine makes long.
  for (let i = 0; i < 2; i++) await page.click("#zoom-in");
  const spread = await table();
  assert.ok(span(spread) <= 5 / 2.25 + 1e-6 && span(spread) < span(whole), `${span(spread)} s of ${span(whole)} s`);
  assert.ok(Number(spread.at(-1)[0]) < Number(whole.at(-1)[0]) && Number(spread[1][0]) > Number(whole[1][0]));
  const box = await page.locator("#plots").boundingBox();
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 80);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.9 * box.width, box.y + 80, { steps: 4 });
  await page.mouse.up();
  const moved = await table();
  assert.ok(Number(moved[1][0]) < Number(spread[1][0]), "a drag to the right shows what was before");
  const scrolled = () => page.evaluate(() => scrollY);
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 80);
  await page.mouse.wheel(0, -240);
  await until(async () => span(await table()), (width) => width < span(moved));
  assert.equal(await scrolled(), 0);
  await page.locator("#plots").focus();
  await page.keyboard.press("0");
  assert.equal((await table()).at(-1)[0], whole.at(-1)[0]);
  const picture = await saved("#as-png");
  assert.deepEqual([...picture.subarray(0, 8)], [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  assert.ok(picture.readUInt32BE(16) > 300 && picture.readUInt32BE(20) > 500, "as large as the plots");
  await page.click("#pause");
  assert.equal(await page.isVisible("#as-csv"), false);
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 80);
  await page.mouse.wheel(0, 200);
  await until(scrolled, (y) => y > 0);
});

visit("a window that becomes narrow takes the page with it, and a wide one gives it room again", world("two-bodies"), async (page) => {
  const width = () => page.evaluate(() => document.documentElement.scrollWidth);
  const canvas = () => page.evaluate(() => document.querySelector("#plots canvas").clientWidth);
  const before = await canvas();
  await page.setViewportSize({ width: 390, height: 844 });
  await until(width, (now) => now === 390);
  await until(canvas, (now) => now <= 390);
  await page.setViewportSize({ width: 1280, height: 900 });
  await until(canvas, (now) => now === before);
});

visit("a finger grabs the wheel", undefined, async (page) => {
    const box = await page.locator("#stage").boundingBox();
    const [x, y, radius] = [box.x + box.width / 2, box.y + box.height / 2, box.width * 0.35];
    const touch = await page.context().newCDPSession(page);
    const send = (type, angle) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x: x + radius * Math.sin(angle), y: y - radius * Math.cos(angle) }] });
    await send("touchStart", 0);
    for (let i = 1; i <= 20; i++) {
      await send("touchMove", i / 20);
      await page.waitForTimeout(15);
    }
    await until(() => place(page), (puck) => puck > 35);
    await send("touchEnd");
    await until(() => page.getAttribute("#stage", "data-held"), (held) => held === null);
}, { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });

visit("end stops stand where the file has them: a hand whose intended position is beyond stays there", "@devices/smartknob-detents", async (page) => {
  await turn(page, 100);
  await until(() => page.locator(".coupling.wall").first().getAttribute("data-push"), (push) => Number(push) < 0);
  await until(() => place(page), (puck) => puck > 55 && puck < 98);
  await page.mouse.up();
});

visit("a linear world is a handle on a rail, in millimetres and newtons", world("rail"), async (page) => {
  const box = await page.locator("#stage").boundingBox();
  const y = box.y + box.height * 0.3;
  await page.mouse.move(box.x + box.width / 2, y);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 40, y, { steps: 10 });
  await until(() => place(page), (puck) => puck > 5);
  assert.match(await page.locator("#legend dd").first().textContent(), /mm$/);
  assert.match(await page.locator(".plot .name").nth(2).textContent(), /^force \(N\)$/);
  await page.mouse.up();
});

visit(
  "with reduced motion the plots are drawn four times a second",
  undefined,
  async (page) => {
    const count = () =>
      page.evaluate(
        () =>
          new Promise((done) => {
            let changes = 0;
            const observer = new MutationObserver(() => (changes += 1));
            observer.observe(document.getElementById("legend"), { subtree: true, childList: true, characterData: true });
            setTimeout(() => (observer.disconnect(), done(changes)), 2000);
          }),
      );
    await turn(page, 60);
    await page.mouse.up();
    const reduced = await count();
    assert.ok(reduced > 2 && reduced <= 9, `${reduced} in two seconds`);
  },
  { reducedMotion: "reduce" },
);
