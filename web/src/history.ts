// The last seconds of telemetry.

import type { Frame } from "./protocol.ts";
import { Samples } from "./samples.ts";

const ROOM = 1024;

export class History extends Samples {
  /** `factors`: per column, what one SI unit is shown as. */
  constructor(factors: number[]) {
    const room = () => new Float64Array(4 * ROOM);
    super(room(), factors.flatMap(() => [room(), room(), room()]), factors);
    this.end = 0;
  }

  /** Time that goes back, or leaps, begins a new history. */
  add(frame: Frame): void {
    if (this.end > 0 && (frame.time < this.last || frame.time > this.last + 0.5)) this.end = 0;
    if (this.end === this.time.length) {
      for (const array of [this.time, ...this.columns]) array.copyWithin(0, this.end - ROOM);
      this.end = ROOM;
    }
    this.time[this.end] = frame.time;
    // An axis cannot reach infinity: a loop that has run away leaves a gap.
    const shown = (value: number, factor: number) => (Number.isFinite(value) ? value * factor : Number.NaN);
    this.factors.forEach((factor, i) => {
      this.columns[3 * i]![this.end] = shown(frame.last[i]!, factor);
      this.columns[3 * i + 1]![this.end] = shown(frame.low[i]!, factor);
      this.columns[3 * i + 2]![this.end] = shown(frame.high[i]!, factor);
    });
    this.end += 1;
    this.first = Math.max(0, this.end - ROOM);
  }
}
