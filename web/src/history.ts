// The last seconds of telemetry, in the units that are shown, as arrays that a plot takes without copying.

import type { Frame } from "./protocol.ts";

const ROOM = 1024;

export class History {
  private length = 0;
  private readonly time = new Float64Array(4 * ROOM);
  private columns: Float64Array[] = [];
  private readonly factors: number[];

  /** `factors`: per column, what one SI unit is shown as. */
  constructor(factors: number[]) {
    this.factors = factors;
    this.columns = factors.flatMap(() => [0, 1, 2].map(() => new Float64Array(4 * ROOM)));
  }

  get last(): number {
    return this.length > 0 ? this.time[this.length - 1]! : 0;
  }

  /** Time that goes back, or leaps, begins a new history. */
  add(frame: Frame): void {
    if (this.length > 0 && (frame.time < this.last || frame.time > this.last + 0.5)) this.length = 0;
    if (this.length === this.time.length) {
      for (const array of [this.time, ...this.columns]) array.copyWithin(0, this.length - ROOM);
      this.length = ROOM;
    }
    this.time[this.length] = frame.time;
    // An axis cannot reach infinity: a loop that has run away leaves a gap.
    const shown = (value: number, factor: number) => (Number.isFinite(value) ? value * factor : Number.NaN);
    this.factors.forEach((factor, i) => {
      this.columns[3 * i]![this.length] = shown(frame.last[i]!, factor);
      this.columns[3 * i + 1]![this.length] = shown(frame.low[i]!, factor);
      this.columns[3 * i + 2]![this.length] = shown(frame.high[i]!, factor);
    });
    this.length += 1;
  }

  /** Time, then for each column asked for its last, low and high values, over the last `seconds`. */
  window(columns: number[], seconds: number): Float64Array[] {
    let from = Math.max(0, this.length - ROOM);
    while (from < this.length - 1 && this.time[from]! < this.last - seconds - 0.05) from += 1;
    const cut = (array: Float64Array) => array.subarray(from, this.length);
    return [cut(this.time), ...columns.flatMap((column) => [0, 1, 2].map((part) => cut(this.columns[3 * column + part]!)))];
  }
}
