// Runs a page that ran elsewhere: node check.mjs hapt.wasm case. Every number must come out to the bit.
//
// A case, little-endian: a text (u32 length and UTF-8), the world; u32 polls. Then the polls, each a text, the page's message before it or
// nothing; f64 the time in ms; u32 numbers, and those of the frame's columns as f64.
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
const text = () => bytes.subarray((at += 4), (at += view.getUint32(at - 4, true)));
// Memory that grows moves: first the room, then the view.
const hand = (part) => {
  const room = core.room(part.length);
  new Uint8Array(core.memory.buffer, room, part.length).set(part);
};

hand(text());
if (core.load() !== 1) throw new Error(`the world is refused: ${Buffer.from(core.memory.buffer, core.message(), core.length())}`);
for (let poll = 0, polls = whole(); poll < polls; poll++) {
  const message = text();
  if (message.length > 0) {
    hand(message);
    core.send();
  }
  core.poll(number());
  const columns = whole();
  const row = new BigUint64Array(core.memory.buffer, core.columns(), columns);
  for (let column = 0; column < columns; column++) {
    const wanted = bits();
    if (row[column] !== wanted) throw new Error(`poll ${poll}, column ${column}: ${row[column].toString(16)}, elsewhere ${wanted.toString(16)}`);
  }
  while (core.next() !== 0);
}
