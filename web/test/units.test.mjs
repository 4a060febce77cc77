// What needs no browser: frames, history, numbers.
import assert from "node:assert/strict";
import { after, test } from "node:test";
import jsQR from "jsqr";
import { createServer } from "vite";

const vite = await createServer({ server: { middlewareMode: true, hmr: false, ws: false, watch: null }, appType: "custom", logLevel: "error" });
after(() => vite.close());
const load = (name) => vite.ssrLoadModule(`/src/${name}.ts`);
const { decode } = await load("protocol");
const { History } = await load("history");
const { rotary } = await load("rotary");
const { roundUp } = await load("linear");
const { brief, joules, number, plain, steady, tick } = await load("units");
const { summary } = await load("poles");
const { ScenarioStart } = await load("scenario");
const { isReachable, modules } = await load("phone");

const random = (size) => size * (2 * Math.random() - 1);

test("a frame reads as it was written, and a truncated one is refused", () => {
  const columns = 12;
  const view = new DataView(new ArrayBuffer(16 + 12 * columns));
  view.setUint8(0, 1);
  view.setUint8(1, 1);
  view.setUint16(2, columns, true);
  view.setUint32(4, 77, true);
  view.setFloat64(8, 12.5, true);
  for (let i = 0; i < 3 * columns; i++) view.setFloat32(16 + 4 * i, i, true);
  const frame = decode(view.buffer);
  assert.deepEqual([frame.generation, frame.time], [77, 12.5]);
  assert.deepEqual([...frame.last], Array.from({ length: columns }, (_, i) => 3 * i));
  assert.deepEqual([...frame.high], Array.from({ length: columns }, (_, i) => 3 * i + 2));
  for (const length of [0, 15, 16, 16 + 12 * columns - 1]) assert.equal(decode(view.buffer.slice(0, length)), null);
  view.setUint8(0, 2);
  assert.equal(decode(view.buffer), null, "of another version");
});

test("the history keeps every extreme of its window, however long it runs, and begins anew when time goes back", () => {
  const history = new History([10]);
  const frame = (k) => ({ time: k / 60, last: [k], low: [k - 0.5], high: [k + 0.5] });
  for (let k = 0; k < 20_000; k++) history.add(frame(k));
  const [time, last, low, high] = history.window([0], history.last - 10, history.last);
  assert.ok(time.length >= 600 && time.length <= 605, `${time.length} frames in ten seconds`);
  time.forEach((t, i) => {
    const k = Math.round(t * 60);
    assert.deepEqual([last[i], low[i], high[i]], [10 * k, 10 * (k - 0.5), 10 * (k + 0.5)]);
  });
  assert.equal(time.at(-1), 19_999 / 60);
  // Any part of what is kept, with a frame or three beyond either end for the lines.
  const [from, to] = [history.last - 7, history.last - 5];
  const part = history.window([0], from, to)[0];
  assert.ok(part[0] <= from && part[0] > from - 0.1 && part.at(-1) >= to && part.at(-1) < to + 0.1, `${part[0]} to ${part.at(-1)}`);
  const rows = history.csv(["a"], from, to).trim().split("\n").slice(1).map((row) => row.split(",").map(Number));
  assert.ok(rows.length >= 120 && rows.every(([t, a]) => t > from - 1e-5 && t < to + 1e-5 && Math.abs(a - 60 * t) < 1e-3), "in SI, and nothing beyond");
  history.add(frame(3));
  assert.deepEqual([...history.window([0], -10, 1)[0]], [3 / 60]);
});

test("values that are not finite leave a gap, and no infinite axis", () => {
  const history = new History([1]);
  history.add({ time: 0, last: [1], low: [-Infinity], high: [Infinity] });
  const [, last, low, high] = history.window([0], -5, 0);
  assert.deepEqual([last[0], low[0], high[0]], [1, NaN, NaN]);
});

test("a pointer's angle is unwrapped to the turn that is next", () => {
  const { pointed, unwrap } = rotary(1);
  for (let i = 0; i < 200; i++) {
    const [near, angle] = [random(50), random(Math.PI)];
    const got = unwrap(angle, near);
    assert.ok(Math.abs(got - near) <= Math.PI + 1e-9);
    assert.ok(Math.abs(Math.sin((got - angle) / 2)) < 1e-9, "by whole turns");
  }
  assert.ok(Math.abs(pointed(1, 0) - Math.PI / 2) < 1e-12, "clockwise from the top");
});

test("numbers read back to the digits that they show", () => {
  for (let i = 0; i < 500; i++) {
    const value = Math.sign(random(1)) * 10 ** random(9);
    for (const digits of [2, 3, 6]) assert.ok(Math.abs(Number(plain(value, digits)) / value - 1) < 0.51 * 10 ** (1 - digits), `${value} as ${plain(value, digits)}`);
    const up = roundUp(Math.abs(value));
    assert.ok(up >= Math.abs(value) * (1 - 1e-8) && up <= 2.5 * Math.abs(value) * (1 + 1e-8), `${value} up to ${up}`);
  }
  assert.deepEqual([number(0), number(-1.5), number(1000), number(NaN)], ["0", "−1.5", "1000", "no number"]);
});

test("an axis of energy takes the prefix that leaves it one to three digits", () => {
  for (let power = -9; power < 12; power++) {
    for (const digits of [1, 2.5, 9.99]) {
      const largest = digits * 10 ** power;
      const { name, per } = joules(largest);
      assert.match(name, /^[pnµmkMGT]?J$/);
      assert.ok(largest * per >= 0.999 && largest * per < 1000, `${largest} mJ is ${largest * per} ${name}`);
    }
  }
  assert.deepEqual([joules(0).name, joules(5e6).name, joules(5e3).name], ["mJ", "kJ", "J"]);
  for (const value of [0, -1234567890, 1e300, -0.000012345, 123.456]) assert.ok(tick(value).length <= 9, tick(value));
});

test("a written value keeps its unit and six digits", () => {
  for (const [written, short] of [
    ["0.45031637174372346 N mm/(deg/s^2)", "0.450316 N mm/(deg/s^2)"],
    ["17.77777777777778 N mm/deg", "17.7778 N mm/deg"],
    ["1 ms", "1 ms"],
    ["1.5 samples", "1.5 samples"],
    ["compensating", "compensating"],
    ["-1.23456789e-5 N", "-1.23457e-5 N"],
    ["4000", "4000"],
  ]) assert.equal(brief(written), short);
});

test("a free shift is distinguished from the poles that the verdict is about", () => {
  const [shift, swing] = [[1, 0], [0.9999, 0.01]];
  const growth = Math.log(Math.hypot(...swing)) / 1e-3;
  assert.match(summary([shift, swing], growth, 1e-3), /free shift at 1.*(decays|grows)/);
  assert.doesNotMatch(summary([swing], growth, 1e-3), /shift/);
  assert.match(summary([shift], null, 1e-3), /free shift at 1 and nothing that lasts/);
  assert.match(summary([shift], 0, 1e-3), /keeps its size/);
});

test("a scenario starts once the loop is running again, and not after a stop", () => {
  const started = (phases, before = 0) => {
    let [now, starts] = [0, 0];
    const played = [];
    const start = new ScenarioStart(() => starts++, (name) => played.push(name), () => now);
    start.begin("step");
    now += before;
    for (const phase of phases) start.update(phase);
    assert.equal(starts, 1);
    return played;
  };
  assert.deepEqual(started(["running", "fading-out", "disarmed", "fading-in"]), []);
  assert.deepEqual(started(["running", "fading-out", "disarmed", "fading-in", "running", "running"]), ["step"]);
  assert.deepEqual(started(["faulted", "disarmed", "fading-in", "running"]), ["step"]);
  // Stopped on the way: what is armed later plays nothing.
  assert.deepEqual(started(["fading-out", "faulted", "disarmed", "fading-in", "running"]), []);
  assert.deepEqual(started(["disarmed", "running"], 5000), []);
  // A start that was too short to be reported.
  assert.deepEqual(started(["running"], 1100), ["step"]);
});

test("the position of an unstable puck is shown in a few digits", () => {
  for (const place of [-1397842711756215, 1e300, 12345678]) assert.ok(steady(place, 90).length <= 8, steady(place, 90));
  assert.equal(steady(7640.25, 90), "7640.3");
});

test("the code of a link is read by another program as that link", () => {
  const quiet = 4;
  for (const link of ["http://192.168.0.7:8080/#0123456789abcdef0123456789abcdef", "http://[fe80::1:2:3:4]:65535/#f", "http://10.0.0.1:1/"]) {
    const rows = modules(link);
    const [scale, size] = [3, 3 * (rows.length + 2 * quiet)];
    const pixels = new Uint8ClampedArray(4 * size * size).fill(255);
    rows.forEach((row, y) => row.forEach((dark, x) => {
      for (let at = 0; dark && at < scale * scale; at += 1) {
        const [px, py] = [(x + quiet) * scale + (at % scale), (y + quiet) * scale + Math.floor(at / scale)];
        pixels.fill(0, 4 * (py * size + px), 4 * (py * size + px) + 3);
      }
    }));
    assert.equal(jsQR(pixels, size, size).data, link);
  }
});

test("a page is shown to phones only where they reach it", () => {
  const at = (link) => isReachable(new URL(link));
  for (const own of ["http://127.0.0.1:8080/", "http://localhost:1/", "http://[::1]:1/", "file:///x.html"]) assert.ok(!at(own), own);
  for (const other of ["http://192.168.0.7:8080/#x", "http://[fe80::1]:1/"]) assert.ok(at(other), other);
});
