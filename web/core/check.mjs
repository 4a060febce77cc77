// Runs recorded samples through the page's core: node check.mjs hapt.wasm cases. Every number must come out to the bit.
//
// A case: u32 length and a world's bytes; u32 samples; then for each f64 position, velocity, and what the core gave elsewhere:
// measured position and velocity, torque, command; at its end the bodies' positions and velocities, u32 of them before. Little-endian.
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

let cases = 0;
let samples = 0;
while (at < bytes.length) {
  const length = whole();
  new Uint8Array(core.memory.buffer, core.room(), length).set(bytes.subarray(at, at + length));
  at += length;
  const bodies = core.load(length);
  if (bodies < 0) throw new Error(`case ${cases}: refused with ${bodies}`);
  const row = new BigUint64Array(core.memory.buffer, core.row());
  const compare = (place, name, k) => {
    const wanted = bits();
    if (row[place] !== wanted) {
      throw new Error(`case ${cases}, sample ${k}: ${name} is ${row[place].toString(16)}, elsewhere ${wanted.toString(16)}`);
    }
  };
  const count = whole();
  for (let k = 0; k < count; k++) {
    core.step(number(), number());
    ["measured", "measured velocity", "torque", "command"].forEach((name, place) => compare(place, name, k));
  }
  const wanted = whole();
  if (wanted !== bodies) throw new Error(`case ${cases}: ${bodies} bodies, elsewhere ${wanted}`);
  for (let i = 0; i < 2 * bodies; i++) compare(4 + i, `body ${i >> 1}`, count);
  cases++;
  samples += count;
}
console.log(`${cases} worlds, ${samples} samples: the same bits`);
