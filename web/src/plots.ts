// The scrolling plots: each signal's last value as a line, its extremes since the frame before as a band.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { html, say } from "./dom.ts";
import type { History } from "./history.ts";
import { joules, steady, tick, type Unit } from "./units.ts";

export interface Trace {
  name: string;
  column: number;
  /** A colour of the theme, and dashes. */
  colour: string;
  dash?: number[];
}

export interface Panel {
  title: string;
  unit: Unit;
  traces: Trace[];
  /** Dashed lines, in the unit that is shown. */
  lines: number[];
  /** No narrower than this, in the unit that is shown. */
  least: number;
  /** An energy, whose axis takes the unit that its size asks for. */
  scales?: boolean;
}

const theme = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** With so much opacity. */
const faded = (colour: string, share: number) => `color-mix(in srgb, ${colour} ${100 * share}%, transparent)`;

class Plot {
  readonly uplot: uPlot;
  private readonly panel: Panel;
  private readonly values: HTMLElement[];
  private readonly title = html("span", { class: "name" });
  private range: [number, number];
  private unit: Unit;
  private seen = true;

  constructor(panel: Panel, root: HTMLElement, last: boolean) {
    this.panel = panel;
    this.range = [-panel.least, panel.least];
    this.unit = { name: panel.unit.name, per: 1 };
    this.values = panel.traces.map(() => html("b"));
    const names = panel.traces.map((trace, i) =>
      html("span", { class: `trace ${trace.colour}${trace.dash ? " dashed" : ""}` }, trace.name, " ", this.values[i]!),
    );
    const head = html("figcaption", {}, this.title, ...names);
    const box = html("div", { class: "canvas" });
    root.append(html("figure", { class: last ? "plot last" : "plot" }, head, box));
    this.uplot = new uPlot(this.options(box, last), [[]], box);
    new ResizeObserver(() => this.resize(box)).observe(box);
    // On a phone most plots are scrolled away.
    new IntersectionObserver((entries) => (this.seen = entries.at(-1)!.isIntersecting)).observe(box);
  }

  /** `at`: the sample that the numbers are of; the last where there is none. */
  draw(history: History, seconds: number, end: number, at: number | null): void {
    if (!this.seen) return;
    const data = history.window(this.panel.traces.map((trace) => trace.column), seconds);
    const index = at ?? data[0]!.length - 1;
    let [low, high] = [0, 0];
    this.panel.traces.forEach((_, i) => {
      for (const value of data[3 * i + 2]!) if (value < low) low = value;
      for (const value of data[3 * i + 3]!) if (value > high) high = value;
    });
    this.fit(low, high);
    const most = Math.max(...this.range.map(Math.abs));
    if (this.panel.scales) this.unit = joules(most);
    say(this.title, `${this.panel.title} (${this.unit.name})`);
    this.panel.traces.forEach((_, i) => {
      const value = data[3 * i + 1]![index];
      if (value !== undefined) say(this.values[i]!, steady(value * this.unit.per, most * this.unit.per));
    });
    this.uplot.batch(() => {
      this.uplot.setData(data as unknown as uPlot.AlignedData, false);
      this.uplot.setScale("x", { min: end - seconds, max: end });
      this.uplot.setScale("y", { min: this.range[0], max: this.range[1] });
    });
  }

  /** Grows at once, shrinks when half of it is empty: an axis that follows every sample cannot be read. */
  private fit(low: number, high: number): void {
    const { least, lines } = this.panel;
    const near = lines.filter((line) => (line > 0 ? high > 0.6 * line : low < 0.6 * line));
    const from = Math.min(low, ...near, low < 0 ? -least : 0) * 1.08;
    const to = Math.max(high, ...near, least) * 1.08;
    const [had, room] = [this.range[1] - this.range[0], to - from];
    if (from < this.range[0] || to > this.range[1] || room < 0.5 * had) this.range = [from, to];
  }

  private resize(box: HTMLElement): void {
    const { clientWidth: width, clientHeight: height } = box;
    if (width > 0 && height > 0) this.uplot.setSize({ width, height });
  }

  private options(box: HTMLElement, last: boolean): uPlot.Options {
    const [soft, grid] = [theme("soft"), theme("grid")];
    const font = "12px system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";
    const axis = { stroke: soft, font, ticks: { show: false }, grid: { stroke: grid, width: 1 } };
    return {
      width: Math.max(box.clientWidth, 50),
      height: Math.max(box.clientHeight, 50),
      legend: { show: false },
      padding: [6, 8, 0, 0],
      cursor: { sync: { key: "time" }, drag: { x: false, y: false }, points: { show: false }, y: false },
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [
        { ...axis, size: last ? 24 : 4, gap: 2, values: (_, values) => (last ? values.map((t) => (t < 0 ? "" : `${t} s`)) : values.map(() => "")) },
        { ...axis, size: 58, gap: 4, space: 24, values: (_, values) => values.map((value) => tick(value * this.unit.per)) },
      ],
      series: [
        {},
        ...this.panel.traces.flatMap((trace) => [
          { stroke: theme(trace.colour), width: 1.6, points: { show: false }, ...(trace.dash ? { dash: trace.dash } : {}) },
          { stroke: "transparent", width: 0, points: { show: false } },
          { stroke: "transparent", width: 0, points: { show: false } },
        ]),
      ],
      bands: this.panel.traces.map((trace, i) => ({
        series: [3 * i + 3, 3 * i + 2] as [number, number],
        fill: faded(theme(trace.colour), 0.25),
      })),
      hooks: { drawAxes: [(plot) => this.rule(plot, soft)] },
    };
  }

  /** Zero, and the limits. */
  private rule(plot: uPlot, colour: string): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = colour;
    for (const line of [0, ...this.panel.lines]) {
      const y = Math.round(plot.valToPos(line, "y", true)) + 0.5;
      if (!(y >= bbox.top && y <= bbox.top + bbox.height)) continue;
      ctx.globalAlpha = line === 0 ? 0.5 : 1;
      ctx.setLineDash(line === 0 ? [] : [7 * devicePixelRatio, 4 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  }
}

export class Plots {
  /** In s. */
  seconds = 5;
  paused = false;
  private plots: Plot[] = [];
  private panels: Panel[] = [];
  private readonly root: HTMLElement;

  constructor(root: HTMLElement) {
    this.root = root;
    // Canvases do not follow the theme by themselves.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.panels));
  }

  show(panels: Panel[]): void {
    this.panels = panels;
    for (const plot of this.plots) plot.uplot.destroy();
    this.root.replaceChildren();
    this.plots = panels.map((panel, i) => new Plot(panel, this.root, i === panels.length - 1));
  }

  draw(history: History, end: number): void {
    const idx = this.plots[0]?.uplot.cursor.idx ?? null;
    const at = this.plots.some((plot) => (plot.uplot.cursor.left ?? -1) >= 0) ? idx : null;
    for (const plot of this.plots) plot.draw(history, this.seconds, end, at);
  }
}
