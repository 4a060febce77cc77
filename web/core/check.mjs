// Runs a page that ran elsewhere: node check.mjs hapt.wasm case. Every number must come out to the bit.
//
// A case, little-endian: u32 length and a world's bytes; the same of its setup; f64 the hand's inertia, damping, stiffness; u32 deeds,
// samples, columns. Then the deeds, each u32 sample, slot (the last number there is: a scenario begins), index, f64 value, u32 whether it
// was done elsewhere. Then the samples, each f64 where the hand means to be (-Infinity: it lets go; Infinity: it leaves the puck to the
// scenario) and the frame's columns.
import { readFileSync } from "node:fs";

const [, , program, file] = process.argv;
const { instance } = await WebAssembly.instantiate(readFileSync(program), {});
const core = instance.exports;
const bytes = readFileSync(file);
const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);

let at = 0;
const whole = () => view.getUint32((at += 4) - 4, true);
const number = () => view.getFloat64((at += 8) - 8, true);
const bits = () => view.getBigUint64((at += 8) - 8, true);
const part = () => bytes.subarray((at += 4), (at += view.getUint32(at - 4, true)));

const [world, setup] = [part(), part()];
const room = core.room(world.length + setup.length);
const place = new Uint8Array(core.memory.buffer, room, world.length + setup.length);
place.set(world);
place.set(setup, world.length);
const bodies = core.load(world.length);
if (bodies < 0) throw new Error("the world is refused");
const grip = [number(), number(), number()];
const [count, samples, columns] = [whole(), whole(), whole()];
if (columns !== 8 + 2 * bodies) throw new Error(`${bodies} bodies, elsewhere ${columns} columns`);
const deeds = Array.from({ length: count }, () => ({ sample: whole(), slot: whole(), index: whole(), value: number(), done: whole() }));

core.order(1);
let holds = false;
for (let sample = 0; sample < samples; sample++) {
  for (const { slot, index, value, done } of deeds.filter((deed) => deed.sample === sample)) {
    const here = slot === 0xffffffff ? core.begin(index) : core.set(slot, index, value);
    if (here !== done) throw new Error(`sample ${sample}, slot ${slot}: ${here}, elsewhere ${done}`);
  }
  const intended = number();
  if (Number.isFinite(intended)) {
    if (!holds) core.hold(...grip);
    core.intend(intended);
  } else if (intended < 0 && holds) core.release();
  holds = Number.isFinite(intended);
  core.run(1);
  const row = new BigUint64Array(core.memory.buffer, core.frame(), columns);
  for (let column = 0; column < columns; column++) {
    const wanted = bits();
    if (row[column] !== wanted) throw new Error(`sample ${sample}, column ${column}: ${row[column].toString(16)}, elsewhere ${wanted.toString(16)}`);
  }
}
