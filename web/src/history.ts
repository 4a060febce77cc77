// The last seconds of telemetry, in the units that are shown, as arrays that a plot takes without copying.

import type { Frame } from "./protocol.ts";

const ROOM = 1024;
/** A line goes on past the edges of what is shown, in s. */
const MARGIN = 0.05;

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

  /** The first and the last time that are kept. */
  get span(): [number, number] {
    return [this.length > 0 ? this.time[Math.max(0, this.length - ROOM)]! : 0, this.last];
  }

  /** Time, then for each column asked for its last, low and high values, from a time to a time. */
  window(columns: number[], from: number, to: number): Float64Array[] {
    let [first, end] = [Math.max(0, this.length - ROOM), this.length];
    while (first < end - 1 && this.time[first]! < from - MARGIN) first += 1;
    while (end > first + 1 && this.time[end - 1]! > to + MARGIN) end -= 1;
    const cut = (array: Float64Array) => array.subarray(first, end);
    return [cut(this.time), ...columns.flatMap((column) => [0, 1, 2].map((part) => cut(this.columns[3 * column + part]!)))];
  }

  /** What stands between two times as a table: each frame's last values, in SI as a run's file has them. */
  csv(names: string[], from: number, to: number): string {
    const all = this.factors.map((_, i) => i);
    const [times, ...parts] = this.window(all, from, to) as [Float64Array, ...Float64Array[]];
    const values = all.map((i) => ({ of: parts[3 * i]!, factor: this.factors[i]! }));
    const rows = [...times].flatMap((time, k) => (time < from || time > to ? [] : [[time, ...values.map(({ of, factor }) => of[k]! / factor)].map(six).join(",")]));
    return `${["t", ...names].join(",")}\n${rows.join("\n")}\n`;
  }
}

/** Telemetry has single precision. */
const six = (value: number) => (Number.isFinite(value) ? String(Number(value.toPrecision(9))) : "");
