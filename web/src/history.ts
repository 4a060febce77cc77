// The last seconds of telemetry.

import type { Frame } from "./protocol.ts";
import { Samples } from "./samples.ts";

const ROOM = 1024;

export class History extends Samples {
  /** `factors`: for each column, the shown unit's number in one SI unit. */
  constructor(factors: number[]) {
    const room = () => new Float64Array(4 * ROOM);
    super(room(), factors.flatMap(() => [room(), room(), room()]), factors);
    this.end = 0;
  }

  /** Adds a frame. A time that goes back, or jumps, starts a new history. */
  add(frame: Frame): void {
    if (this.end > 0 && (frame.time < this.last || frame.time > this.last + 0.5)) this.end = 0;
    if (this.end === this.time.length) {
      for (const array of [this.time, ...this.columns]) array.copyWithin(0, this.end - ROOM);
      this.end = ROOM;
    }
    this.time[this.end] = frame.time;
    // An axis cannot reach infinity: values of a diverged loop leave a gap.
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
