// Signals over time in the shown units, the data of plots and tables: arrays that a plot takes without copying.

export class Samples {
  protected readonly time: Float64Array;
  /** For each signal its last, low and high values, one array after the other. */
  protected readonly columns: Float64Array[];
  /** Per signal, what one SI unit is shown as. */
  protected readonly factors: number[];
  /** What is kept lies from the first of these to before the second. */
  protected first = 0;
  protected end: number;

  constructor(time: Float64Array, columns: Float64Array[], factors: number[]) {
    [this.time, this.columns, this.factors, this.end] = [time, columns, factors, time.length];
  }

  get last(): number {
    return this.end > this.first ? this.time[this.end - 1]! : 0;
  }

  /** The first and the last time that are kept. */
  get span(): [number, number] {
    return [this.end > this.first ? this.time[this.first]! : 0, this.last];
  }

  /** Times, then the last, low and high values of each requested column, between two times and up to the next sample beyond either. */
  window(columns: number[], from: number, to: number): Float64Array[] {
    let { first, end } = this;
    while (first < end - 1 && this.time[first + 1]! <= from) first += 1;
    while (end > first + 1 && this.time[end - 2]! >= to) end -= 1;
    const cut = (array: Float64Array) => array.subarray(first, end);
    return [cut(this.time), ...columns.flatMap((column) => [0, 1, 2].map((part) => cut(this.columns[3 * column + part]!)))];
  }

  /** What stands between two times as a table: the last values of the named signals, in SI as a run's file has them. */
  csv(names: string[], from: number, to: number): string {
    const all = names.map((_, i) => i);
    const [times, ...parts] = this.window(all, from, to) as [Float64Array, ...Float64Array[]];
    const values = all.map((i) => ({ of: parts[3 * i]!, factor: this.factors[i]! }));
    const rows = [...times].flatMap((time, k) => (time < from || time > to ? [] : [[time, ...values.map(({ of, factor }) => of[k]! / factor)].map(nine).join(",")]));
    return `${["t", ...names].join(",")}\n${rows.join("\n")}\n`;
  }
}

/** Telemetry has single precision. */
const nine = (value: number) => (Number.isFinite(value) ? String(Number(value.toPrecision(9))) : "");
