// How well the loop keeps its clock: a histogram of lateness, and quantiles.

import { attribute, html, say, svg } from "./dom.ts";
import type { Quantiles, Status } from "./protocol.ts";
import { micros } from "./units.ts";

const [WIDTH, HEIGHT] = [320, 84];
const SHOWN: (keyof Quantiles)[] = ["p50", "p90", "p99", "p999", "max"];
const NAMES = ["50 %", "90 %", "99 %", "99.9 %", "max"];
const ROWS = [
  ["latency", "latency_us"],
  ["period", "period_us"],
  ["computation", "computation_us"],
] as const;

/** Under its place on the axis: the first to its right, the last to its left. */
function place(label: HTMLElement, part: number): HTMLElement {
  label.style.setProperty("left", `${100 * part}%`);
  label.style.setProperty("transform", `translateX(${part < 0.02 ? 0 : part > 0.94 ? -100 : -50}%)`);
  return label;
}

const meter = (what: string) => html("meter", { min: 0, max: 2, high: 1, optimum: 0, "aria-label": `Longest ${what}, as a part of the longest that the certificate covers` });

/** Shows the longest time of a kind against the one that is certified, and returns it in words; nothing where the file states none. */
function bound(meter: HTMLMeterElement, what: string, longest: number, most: number | null): string {
  meter.hidden = most === null;
  if (most === null) return "";
  meter.value = most > 0 ? longest / most : 2;
  return `; longest ${what} ${micros(longest)} of ${micros(most)}`;
}

export class Timing {
  private readonly bars = svg("path", { class: "bars" });
  private readonly labels = html("p", { class: "edges" });
  private readonly counts = html("p", { class: "soft" });
  private readonly interval = meter("interval");
  private readonly delay = meter("delay");
  private readonly kept = html("p", { class: "soft" });
  private readonly certified = html("div", { class: "certified", hidden: "" }, this.interval, this.delay, this.kept);
  private readonly warning = html("p", { class: "warning" });
  private readonly cells: HTMLElement[][];
  private edges = "";

  constructor(root: HTMLElement) {
    this.cells = ROWS.map(() => SHOWN.map(() => html("td")));
    const table = html(
      "table",
      {},
      html("thead", {}, html("tr", {}, html("th", { scope: "col" }, "quantile"), ...NAMES.map((name) => html("th", { scope: "col" }, name)))),
      html("tbody", {}, ...ROWS.map(([name], i) => html("tr", {}, html("th", { scope: "row" }, name), ...this.cells[i]!))),
    );
    const drawing = svg(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT + 1}`, class: "histogram", role: "img", "aria-label": "Histogram of the loop's latency; its quantiles are in the table" },
      svg("path", { class: "axis", d: `M0 ${HEIGHT}H${WIDTH}` }),
      this.bars,
    );
    root.append(html("p", { class: "soft" }, "How late samples are taken (counts on a logarithmic scale)"), drawing, this.labels, table, this.counts, this.certified, this.warning);
  }

  show({ timing, realtime }: Status): void {
    if (!timing || !realtime) return;
    ROWS.forEach(([, key], row) => {
      SHOWN.forEach((quantile, i) => say(this.cells[row]![i]!, micros(timing[key][quantile])));
    });
    const { latency, edges_us: edges } = timing.histogram;
    const most = Math.log1p(Math.max(1, ...latency));
    const step = WIDTH / Math.max(1, latency.length);
    let d = "";
    latency.forEach((count, i) => {
      const height = (Math.log1p(count) / most) * (HEIGHT - 4);
      if (count > 0) d += `M${(i * step + 0.5).toFixed(1)} ${HEIGHT}v${(-height).toFixed(1)}h${Math.max(0.5, step - 1).toFixed(1)}V${HEIGHT}z`;
    });
    attribute(this.bars, "d", d);
    if (String(edges) !== this.edges) {
      this.edges = String(edges);
      const every = Math.max(1, Math.ceil(edges.length / 6));
      this.labels.replaceChildren(
        ...edges.flatMap((edge, i) =>
          i % every === 0 ? [place(html("span", {}, micros(edge)), (i * step) / WIDTH)] : [],
        ),
      );
    }
    const grouped = (count: number) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");
    say(this.counts, `${grouped(timing.samples)} samples, ${grouped(timing.overruns)} overruns, ${grouped(timing.missed)} missed; ${realtime.fifo ? "FIFO scheduling" : "ordinary scheduling"}, memory ${realtime.locked ? "locked" : "not locked"}`);
    const { certified } = timing;
    this.certified.hidden = certified === null;
    if (certified) {
      const { samples, inside, longest_us: interval, interval_max_us, longest_delay_us: delay, delay_max_us } = certified;
      const longest = [bound(this.interval, "interval", interval, interval_max_us), bound(this.delay, "delay", delay, delay_max_us)];
      say(this.kept, `inside the certificate for ${grouped(inside)} of ${grouped(samples)} samples with torque${longest.join("")}`);
    }
    say(this.warning, realtime.warning ?? "");
  }
}
