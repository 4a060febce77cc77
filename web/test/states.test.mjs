// The page's texts and buttons in each state, against the real server.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { HAPT, launch, open, place, quit, serve, turn, until, world } from "./desk.mjs";

after(quit);

/** A test with a server and one page on it, both gone afterwards. */
function visit(name, file, act, options) {
  test(name, { timeout: 90_000 }, async () => {
    const server = await serve(file);
    try {
      const { page, context, quiet } = await open(server.url, options);
      await act(page);
      quiet();
      await context.close();
    } finally {
      await server.end();
    }
  });
}

const phase = (page) => () => page.getAttribute("#phase", "data-phase");
const value = (page, key) => () => page.inputValue(`[data-key="${key}"] input[type=text]`);
const type = async (page, key, text) => {
  const field = page.locator(`[data-key="${key}"] input[type=text]`);
  await field.fill(text);
  await field.press("Enter");
};
/** Types a value, and waits for the world that has it. */
const set = async (page, key, text) => {
  await type(page, key, text);
  await until(() => page.getAttribute(`.knob[data-key="${key}"]`, "title"), (title) => title.includes(`${key} = ${text}`));
};

for (const [file, key] of [["hurried", "interval_max"], ["late", "delay_max"]]) {
  test(`a loop whose ${key} this computer cannot keep offers the time that it measured, and runs with it`, { timeout: 120_000 }, async () => {
    const server = await serve(world(file));
    const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 } });
    try {
      const page = await context.newPage();
      await page.goto(server.url);
      await until(phase(page), (now) => now === "disarmed");
      await until(() => page.locator("#meet").isVisible(), Boolean);
      assert.match(await page.textContent("#meet"), new RegExp(`^Certify ${key} [\\d.e-]+ (µs|ms|s) \\(.* measured\\)$`));
      // A busy machine may be later still than it was before.
      await until(async () => {
        if (await page.locator("#meet").isVisible()) await page.locator("#meet").click({ timeout: 500 }).catch(() => {});
        if (await page.isEnabled("#arm")) await page.locator("#arm").click({ timeout: 500 }).catch(() => {});
        await page.waitForTimeout(700);
        return phase(page)();
      }, (now) => now === "running", 60);
      assert.equal(await page.locator(`.knob.changed[data-key="loop.${key}"]`).count(), 1);
      assert.match(await page.textContent("#timing .certified"), new RegExp(`longest ${key === "delay_max" ? "delay" : "interval"} .* of `));
    } finally {
      await context.close();
      await server.end();
    }
  });
}

/** A page whose server's messages pass through `change`, which gives the message to show, or nothing. */
async function through(url, change, viewport = { width: 1280, height: 900 }) {
  const context = await (await launch()).newContext({ viewport });
  const page = await context.newPage();
  let say;
  await page.routeWebSocket(/\/ws$/, (socket) => {
    say = (message) => socket.send(JSON.stringify(message));
    const server = socket.connectToServer();
    server.onMessage((text) => {
      // Without telemetry, which is much and not looked at.
      const message = typeof text === "string" ? change(JSON.parse(text)) : null;
      if (message !== null) say(message);
    });
  });
  await page.goto(url);
  return { page, say: (message) => say(message), close: () => context.close() };
}

/** The supervisor's documentation of each reason: its code, its name, what happened and what to do. */
const REASONS = [...readFileSync(new URL("../../docs/safety.md", import.meta.url), "utf8").matchAll(/^- (\d+) `([a-z-]+)`: (.*?\.) (.*)$/gm)].map(([, code, name, sentence, clear]) => ({ code: Number(code), reason: name, sentence, clear }));

test("each reason is shown with what to do, with a button that clears after a fault and one that arms after a fade", { timeout: 120_000 }, async () => {
  assert.equal(REASONS.length, 17);
  let [shown, last] = [{}, null];
  const server = await serve("@notes/default");
  const { page, say, close } = await through(server.url, (message) => {
    if (message.type !== "status") return message;
    last = message;
    return { ...last, ...shown };
  });
  const show = (status) => say({ ...last, ...(shown = status) });
  const seen = () => page.evaluate(() => {
    const part = (id) => document.getElementById(id);
    const is = (id) => part(id).checkVisibility();
    const texts = Object.fromEntries(["fault-name", "fault-text", "fault-clear"].map((id) => [id, is("fault") ? part(id).textContent : ""]));
    const on = Object.fromEntries(["arm", "disarm", "stop"].map((id) => [id, !part(id).disabled]));
    return JSON.stringify({ phase: part("phase").textContent, state: part("phase").dataset.phase, ...texts, clear: is("fault") && is("clear"), ...on });
  });
  const expect = (expected) => until(seen, (now) => now === JSON.stringify(expected));
  const silent = { "fault-name": "", "fault-text": "", "fault-clear": "", clear: false };
  try {
    await until(phase(page), (now) => now === "running");
    await expect({ phase: "Running", state: "running", ...silent, arm: false, disarm: true, stop: true });
    for (const { code, reason, sentence, clear } of REASONS) {
      for (const [at, name] of [["faulted", "Fault"], ["fading-out", "Fading out"], ["disarmed", "Disarmed"]]) {
        show({ phase: at, code, reason, sentence, clear });
        const said = { "fault-name": `${name} ${code} (${reason}):`, "fault-text": sentence, "fault-clear": code === 1 ? "Clear it, then arm." : clear };
        await expect({ phase: name, state: at, ...said, clear: at === "faulted", arm: at === "disarmed", disarm: false, stop: true });
      }
    }
    // A phase that was requested needs no reason.
    for (const [at, name, arm, disarm] of [["disarmed", "Disarmed", true, false], ["fading-in", "Fading in", false, true], ["fading-out", "Fading out", false, false]]) {
      show({ phase: at, code: null, reason: null, sentence: null, clear: null });
      await expect({ phase: name, state: at, ...silent, arm, disarm, stop: true });
    }
  } finally {
    await close();
    await server.end();
  }
});

test("while a verdict is computed the page shows that, and whose the last one was", { timeout: 60_000 }, async () => {
  let lets = true;
  const server = await serve("@notes/default");
  const { page, close } = await through(server.url, (message) => (message.type === "verdict" && !lets ? null : message));
  const heading = () => page.textContent("#verdict");
  try {
    await until(heading, (text) => text === "Certified");
    lets = false;
    await page.click("#euler");
    await until(heading, (text) => text === "A new verdict is being computed");
    assert.equal(await page.textContent("#sentences"), "Before the last change: Certified.");
    assert.equal(await page.locator("#card.good").count(), 0);
    assert.equal(await page.locator("button.remedy").count(), 0, "remedies are of the world before");
    lets = true;
    await page.click("#euler");
    await until(heading, (text) => text === "Certified");
  } finally {
    await close();
    await server.end();
  }
});

test("times that the page cannot set are shown as options to start with", { timeout: 60_000 }, async () => {
  const server = await serve(world("hurried"));
  const fixed = (key) => (/_max$/.test(key.path) ? { ...key, fixed: true } : key);
  const { page, close } = await through(server.url, (message) => (message.type === "world" ? { ...message, keys: message.keys.map(fixed) } : message));
  try {
    await until(() => page.locator("#meet-command").isVisible(), Boolean);
    assert.match(await page.textContent("#meet-command"), /^.* measured; the page cannot change it here: start with --set 'loop\.interval_max=[\d.]+ ms'$/);
    assert.ok(await page.locator("#meet").isHidden());
  } finally {
    await close();
    await server.end();
  }
});

test("while it connects the page shows that, and only stop can be pressed", { timeout: 60_000 }, async () => {
  const server = await serve();
  const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 } });
  try {
    const page = await context.newPage();
    // A socket that opens, and whose server never answers.
    await page.routeWebSocket(/\/ws$/, () => {});
    await page.goto(server.url);
    await page.waitForTimeout(500);
    assert.equal(await page.textContent("#phase"), "Connecting");
    const on = await page.evaluate(() => [...document.querySelectorAll(".controls button, #scenarios button, #changes button, #reset")].filter((button) => !button.disabled && button.checkVisibility()).map((button) => button.textContent));
    assert.deepEqual(on, []);
    assert.equal(await page.locator("#knobs:disabled").count(), 1);
    assert.ok(await page.isEnabled("#stop"));
  } finally {
    await context.close();
    await server.end();
  }
});

visit("changes are listed, undone, redone, and taken back one by one", "@notes/default", async (page) => {
  assert.ok(await page.isDisabled("#undo"));
  assert.ok(await page.isDisabled("#redo"));
  assert.ok(await page.locator("#differences").isHidden());
  const [period, stiffness] = ["loop.period", "couplings.0.stiffness"];
  const before = await value(page, stiffness)();
  await set(page, period, "2 ms");
  await set(page, stiffness, "10 N mm/deg");
  await until(() => page.textContent("#differences summary"), (text) => text === "2 differences from the file");
  await page.click("#undo");
  await until(value(page, stiffness), (now) => now === before);
  assert.equal(await value(page, period)(), "2 ms");
  await page.click("#redo");
  await until(value(page, stiffness), (now) => now === "10 N mm/deg");
  await page.click("#differences summary");
  assert.match(await page.locator("#differences li").first().textContent(), /^period 2·?\s?ms \(loop\), in the file 1·?\s?ms/);
  assert.equal(await page.textContent("#differences code"), "--set 'loop.period=2 ms' --set 'couplings.0.stiffness=10 N mm/deg'");
  await page.click(`[data-back="${period}"]`);
  await until(value(page, period), (now) => now === "1 ms");
  assert.equal(await value(page, stiffness)(), "10 N mm/deg");
});

visit("the file's values and mine take turns, and the loop runs on", "@notes/default", async (page) => {
  await set(page, "couplings.0.stiffness", "10 N mm/deg");
  for (let i = 0; i < 3; i++) {
    for (const [id, wanted] of [["reset", false], ["mine", true]]) {
      await page.click(`#${id}`);
      await until(() => page.getAttribute(`#${id}`, "aria-pressed"), (on) => on === "true");
      assert.equal((await value(page, "couplings.0.stiffness")()) === "10 N mm/deg", wanted);
      assert.equal(await phase(page)(), "running");
    }
  }
});

test("between the file's values and mine a held puck feels no bump, and the wheel goes on where it is", { timeout: 90_000 }, async () => {
  const folder = mkdtempSync(join(tmpdir(), "hapt-turns-"));
  const server = await serve(world("turns"), 0, ["--log-dir", folder]);
  try {
    const { page, context } = await open(server.url);
    await set(page, "couplings.0.stiffness", "4 N mm/deg");
    await turn(page, 60);
    await until(() => place(page), (puck) => puck > 30);
    // The mouse holds the puck: the buttons are pressed by the page itself.
    const press = (id) => page.evaluate((name) => document.getElementById(name).click(), id);
    await press("record");
    await until(() => page.textContent("#recording"), (text) => /^Recording/.test(text));
    for (const id of ["reset", "mine", "reset", "mine"]) {
      await press(id);
      await until(() => page.getAttribute(`#${id}`, "aria-pressed"), (on) => on === "true");
      await page.waitForTimeout(400);
    }
    await press("record");
    await until(() => page.textContent("#recording-text"), (text) => /^Recorded/.test(text));
    const log = await page.textContent("#recording-file");
    await page.mouse.up();
    await context.close();
    const file = join(folder, "turns.csv");
    const { status, stderr } = spawnSync(HAPT, ["log", "convert", log, "--out", file], { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    const [names, ...rows] = readFileSync(file, "utf8").trim().split("\n").map((row) => row.split(","));
    const column = (name) => rows.map((row) => Number(row[names.indexOf(name)]));
    const [plan, torque, output, wheel, speed, sample] = ["plan", "torque_Nm", "output_Nm", "wheel_rad", "wheel_rad_per_s", "sample"].map(column);
    const step = (of, k) => Math.abs(of[k] - of[k - 1]);
    const changes = plan.flatMap((_, k) => (k > 0 && step(plan, k) > 0 ? [k] : []));
    assert.equal(changes.length, 4);
    // The change of the world's torque within a sample that the motion causes.
    const moves = Math.max(...torque.map((_, k) => (k === 0 || changes.includes(k) ? 0 : step(torque, k) / (sample[k] - sample[k - 1]))));
    for (const k of changes) {
      const jump = step(torque, k);
      assert.ok(jump > 0.02, `the world's own torque jumps, by ${jump} N m`);
      assert.ok(step(output, k) < 1e-9, `and the motor's does not, by ${step(output, k)} N m`);
      // It fades over in 0.1 s.
      const steps = Array.from({ length: 120 }, (_, i) => step(output, k + i) / (sample[k + i] - sample[k + i - 1]));
      assert.ok(Math.max(...steps) < 0.011 * jump + 2 * moves, `${Math.max(...steps)} N m in a sample, of ${jump} and ${moves}`);
      assert.ok(Math.abs(output[k + 120] - torque[k + 120]) < 1e-6, "and then it is the world's");
      // The wheel starts nowhere anew.
      assert.ok(Math.abs(wheel[k] - wheel[k - 1] - 1e-3 * (sample[k] - sample[k - 1]) * speed[k]) < 1e-5, `${wheel[k - 1]} to ${wheel[k]} at ${speed[k]}`);
    }
  } finally {
    await server.end();
    rmSync(folder, { recursive: true });
  }
});

visit("what is saved is the world file with what was changed, the last moment before too", "@notes/default", async (page) => {
  await type(page, "loop.period", "2 ms");
  const [file] = await Promise.all([page.waitForEvent("download"), page.click("#save")]);
  assert.equal(file.suggestedFilename(), "default.toml");
  const text = readFileSync(await file.path(), "utf8");
  assert.match(text, /^period += "2 ms"/m);
  assert.ok(text.includes("#"), "comments stay");
});

visit("a remedy that adds a coupling is one press away, and one press back", "@notes/wheel", async (page) => {
  const remedy = page.locator('button.remedy[data-key="couplings.1"]');
  await remedy.waitFor({ timeout: 60_000 });
  assert.match(await remedy.textContent(), /^a new damper, wheel to ground: damping /);
  await remedy.click();
  await until(() => page.textContent("#verdict"), (text) => text === "Certified");
  await until(() => page.locator(".coupling.damper").count(), (count) => count === 1);
  await page.click("#undo");
  await until(() => page.locator(".coupling.damper").count(), (count) => count === 0);
});

visit("breaking it sets a period at which growth is visible within seconds, and back takes the period back", "@notes/default", async (page) => {
  await page.click("#euler");
  await until(value(page, "loop.period"), (period) => period === "5 ms");
  await page.click("#euler");
  await until(value(page, "loop.period"), (period) => period === "1 ms");
  assert.equal(await page.inputValue('[data-key="loop.method"] select'), "zoh");
});

visit("after a stop on the page clearing and arming are enough", "@notes/default", async (page) => {
  await page.click("#stop");
  await until(phase(page), (now) => now === "faulted");
  await until(() => page.textContent("#fault-clear"), (text) => text === "Clear it, then arm.");
});

test("after a recording the header keeps its height, and the end of the path is seen", { timeout: 60_000 }, async () => {
  const folder = mkdtempSync(join(tmpdir(), "hapt-a-folder-with-a-name-that-is-longer-than-there-is-room-for-"));
  const server = await serve("@notes/default", 0, ["--log-dir", folder]);
  try {
    const { page, context } = await open(server.url);
    const height = () => page.locator("header").evaluate((header) => header.offsetHeight);
    const before = await height();
    await page.click("#record");
    await until(() => page.textContent("#recording-text"), (text) => /^Recording/.test(text));
    await page.click("#record");
    await until(() => page.textContent("#recording-text"), (text) => /^Recorded/.test(text));
    assert.equal(await height(), before);
    const [code, path] = await page.evaluate(() => [document.querySelector("#recording code"), document.getElementById("recording-file")].map((e) => e.getBoundingClientRect().toJSON()));
    assert.ok(path.left < code.left - 50, "the path is longer than its room");
    assert.ok(Math.abs(path.right - code.right) < 1, "and ends in it");
    assert.equal(await page.textContent("#recording-file"), join(folder, "live-0001.mcap"));
    await context.close();
  } finally {
    await server.end();
    rmSync(folder, { recursive: true });
  }
});

test("on a phone the experiments stand above their warnings, and both above the stop", { timeout: 60_000 }, async () => {
  const server = await serve("@notes/default");
  const warns = (message) => (message.type === "status" ? { ...message, warnings: ["On a real device it would have faulted. The integration method generated energy inside the world."] } : message);
  const { page, close } = await through(server.url, warns, { width: 390, height: 844 });
  try {
    await until(() => page.locator("#warnings").isVisible(), Boolean);
    const top = (selector) => page.locator(selector).evaluate((e) => e.getBoundingClientRect().top);
    const [wheel, experiments, warning, stop] = await Promise.all(["#stage", "#scenarios", "#warnings", "#stop"].map(top));
    assert.ok(wheel < experiments && experiments < warning && experiments + 40 < stop, `${[wheel, experiments, warning, stop]}`);
    await page.setViewportSize({ width: 1280, height: 900 });
    await until(async () => (await top("#warnings")) < (await top("#stage")), Boolean);
  } finally {
    await close();
    await server.end();
  }
});

for (const width of [620, 700, 1000]) {
  visit(
    `at ${width} pixels the dial's labels stand on the drawing`,
    "@notes/default",
    async (page) => {
      const [labels, drawing] = await Promise.all(["#labels", "#stage"].map((id) => page.locator(id).evaluate((e) => {
        const { left, right } = (e.id === "labels" ? e.parentElement : e).getBoundingClientRect();
        return [left, right];
      })));
      assert.ok(Math.abs(labels[0] - drawing[0]) < 1 && Math.abs(labels[1] - drawing[1]) < 1, `${labels} around ${drawing}`);
    },
    { viewport: { width, height: 900 } },
  );
}
