// The scrolling plots: each signal's last value as a line, its extremes since the frame before as a band.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { attribute, html, say } from "./dom.ts";
import type { Samples } from "./samples.ts";
import { joules, steady, tick, type Unit } from "./units.ts";

export interface Trace {
  name: string;
  column: number;
  /** A colour of the theme, and dashes. */
  colour: string;
  dash?: number[];
  /** A prediction, to which no axis fits itself. */
  guide?: boolean;
}

export interface Panel {
  title: string;
  unit: Unit;
  traces: Trace[];
  /** Dashed lines, in the unit that is shown. */
  lines: number[];
  /** No narrower than this, in the unit that is shown. */
  least: number;
  /** An energy, whose axis takes a unit that fits its size. */
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

  /** Plots of one `group` have one cursor. */
  constructor(panel: Panel, root: HTMLElement, last: boolean, group: string) {
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
    this.uplot = new uPlot(this.options(box, last, group), [[]], box);
    new ResizeObserver(() => this.resize(box)).observe(box);
    // Plots that are not visible are not drawn: on a phone most are not.
    new IntersectionObserver((entries) => (this.seen = entries.at(-1)!.isIntersecting)).observe(box);
  }

  /** `at`: the sample that the numbers are of; the last in sight where there is none. `close`: the axis fits what is in sight, without its 0. */
  draw(history: Samples, [from, to]: Span, at: number | null, close: boolean): void {
    if (!this.seen) return;
    const data = history.window(this.panel.traces.map((trace) => trace.column), from, to);
    const index = at ?? data[0]!.length - 1;
    let [low, high] = close ? [Infinity, -Infinity] : [0, 0];
    this.panel.traces.forEach(({ guide }, i) => {
      if (guide) return;
      for (const value of data[3 * i + 2]!) if (value < low) low = value;
      for (const value of data[3 * i + 3]!) if (value > high) high = value;
    });
    if (close && low <= high) this.enclose(low, high);
    else this.fit(Math.min(low, 0), Math.max(high, 0));
    const most = Math.max(...this.range.map(Math.abs));
    if (this.panel.scales) this.unit = joules(most);
    say(this.title, `${this.panel.title} (${this.unit.name})`);
    this.panel.traces.forEach((_, i) => {
      const value = data[3 * i + 1]![index];
      if (value !== undefined) say(this.values[i]!, steady(value * this.unit.per, most * this.unit.per));
    });
    this.uplot.batch(() => {
      this.uplot.setData(data as unknown as uPlot.AlignedData, false);
      this.uplot.setScale("x", { min: from, max: to });
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

  private enclose(low: number, high: number): void {
    const room = Math.max(0.08 * (high - low), 1e-3 * this.panel.least);
    this.range = [low - room, high + room];
  }

  /** What stands above it: its title, and each trace's name with its line. */
  words(): { text: string; colour: string; strong: boolean; line: number[] | null }[] {
    const traces = this.panel.traces.map(({ name, colour, dash }) => ({ text: name, colour, strong: false, line: dash ?? [] }));
    return [{ text: this.title.textContent ?? "", colour: "ink", strong: true, line: null }, ...traces];
  }

  private resize(box: HTMLElement): void {
    const { clientWidth: width, clientHeight: height } = box;
    if (width > 0 && height > 0) this.uplot.setSize({ width, height });
  }

  private options(box: HTMLElement, last: boolean, group: string): uPlot.Options {
    const [soft, grid] = [theme("soft"), theme("grid")];
    const font = "12px system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";
    const axis = { stroke: soft, font, ticks: { show: false }, grid: { stroke: grid, width: 1 } };
    return {
      width: Math.max(box.clientWidth, 50),
      height: Math.max(box.clientHeight, 50),
      legend: { show: false },
      padding: [6, 15, 0, 0],
      cursor: { sync: { key: group }, drag: { x: false, y: false }, points: { show: false }, y: false },
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

/** From a time to a time, in s. */
type Span = [from: number, to: number];

/** The shortest time that a plot spreads, in s. */
const SHORTEST = 0.02;
/** One press of a key or a button, and one notch of a mouse's wheel. */
export const STEP = 1.5;
/** The part of what is in sight by which an arrow key goes. */
const PACE = 0.1;

/** So that each of them has a cursor of its own. */
let count = 0;

export class Plots {
  /** In s. */
  seconds = 5;
  private held = false;
  /** What is looked at while paused. */
  private view: Span | null = null;
  private plots: Plot[] = [];
  private panels: Panel[] = [];
  private history: Samples | null = null;
  private readonly root: HTMLElement;
  private readonly group = `time ${count++}`;
  /** On a page that is read the mouse's wheel scrolls, and spreads the plots with Ctrl. */
  private readonly scrolls: boolean;

  constructor(root: HTMLElement, scrolls = false) {
    [this.root, this.scrolls] = [root, scrolls];
    root.classList.add("plots");
    // Canvases do not follow the theme by themselves.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.panels));
    root.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    root.addEventListener("pointerdown", (event) => this.drag(event));
    root.addEventListener("dblclick", () => this.follow());
    root.addEventListener("keydown", (event) => this.key(event));
  }

  get paused(): boolean {
    return this.held;
  }

  /** While paused, the plots can be moved and spread; they take the keyboard then. */
  set paused(on: boolean) {
    this.held = on;
    this.root.classList.toggle("held", on);
    if (on) attribute(this.root, "tabindex", "0");
    else this.root.removeAttribute("tabindex");
    this.follow();
  }

  /** The time in sight. */
  get span(): Span {
    const last = this.history?.last ?? 0;
    return this.view ?? [last - this.seconds, last];
  }

  /** The last seconds, as many as are chosen. */
  follow(): void {
    this.view = null;
    this.redraw();
  }

  show(panels: Panel[]): void {
    this.panels = panels;
    this.view = null;
    for (const plot of this.plots) plot.uplot.destroy();
    this.root.replaceChildren();
    this.plots = panels.map((panel, i) => new Plot(panel, this.root, i === panels.length - 1, this.group));
  }

  draw(history: Samples): void {
    this.history = history;
    this.redraw();
  }

  /** Spreads by so much about a time; the middle where there is none. Only while paused. */
  zoom(by: number, about?: number): void {
    const [from, to] = this.span;
    const at = about ?? (from + to) / 2;
    const width = Math.max(SHORTEST, (to - from) / by);
    const part = (at - from) / (to - from);
    this.look([at - part * width, at + (1 - part) * width]);
  }

  /** All plots as one picture, as they are seen. */
  async picture(): Promise<Blob | null> {
    const canvases = this.plots.map(({ uplot }) => uplot.ctx.canvas);
    const ratio = devicePixelRatio;
    const head = Math.round(22 * ratio);
    const height = canvases.reduce((sum, canvas) => sum + canvas.height + head, 0);
    const sheet = Object.assign(document.createElement("canvas"), { width: Math.max(1, ...canvases.map((canvas) => canvas.width)), height });
    const ink = sheet.getContext("2d");
    if (!ink) return null;
    ink.fillStyle = theme("paper");
    ink.fillRect(0, 0, sheet.width, sheet.height);
    ink.textBaseline = "middle";
    let y = 0;
    this.plots.forEach((plot, i) => {
      let x = 8 * ratio;
      for (const { text, colour, strong, line } of plot.words()) {
        ink.font = `${strong ? 600 : 400} ${13 * ratio}px system-ui, sans-serif`;
        if (line) {
          ink.strokeStyle = theme(colour);
          ink.lineWidth = 2 * ratio;
          ink.setLineDash(line.map((dash) => (dash * ratio) / 2));
          ink.beginPath();
          ink.moveTo(x, y + head / 2);
          ink.lineTo(x + 16 * ratio, y + head / 2);
          ink.stroke();
          x += 20 * ratio;
        }
        ink.fillStyle = theme(strong ? "ink" : "soft");
        ink.fillText(text, x, y + head / 2);
        x += ink.measureText(text).width + 14 * ratio;
      }
      ink.drawImage(canvases[i]!, 0, y + head);
      y += head + canvases[i]!.height;
    });
    return new Promise((done) => sheet.toBlob(done, "image/png"));
  }

  /** The sample under the cursor. */
  private get index(): number | null {
    return this.plots.some(({ uplot }) => (uplot.cursor.left ?? -1) >= 0) ? (this.plots[0]?.uplot.cursor.idx ?? null) : null;
  }

  /** The time under the cursor. */
  get cursor(): number | null {
    const index = this.index;
    return index === null ? null : (this.plots[0]?.uplot.data[0]?.[index] ?? null);
  }

  private redraw(): void {
    if (!this.history) return;
    const at = this.index;
    for (const plot of this.plots) plot.draw(this.history, this.span, at, this.view !== null);
  }

  /** Shows this time, as far as there is any. */
  private look([from, to]: Span): void {
    if (!this.held || !this.history) return;
    const [first, last] = this.history.span;
    const width = Math.min(to - from, Math.max(last - first, this.seconds));
    const start = Math.max(Math.min(from, last - width), Math.min(first, last - width));
    this.view = [start, start + width];
    this.redraw();
  }

  /** The time at a place of the screen. */
  private at(clientX: number): number {
    const [from, to] = this.span;
    const box = this.plots[0]?.uplot.over.getBoundingClientRect();
    return box && box.width > 0 ? from + ((clientX - box.left) / box.width) * (to - from) : (from + to) / 2;
  }

  private wheel(event: WheelEvent): void {
    if (!this.held || (this.scrolls && !event.ctrlKey && !event.metaKey)) return;
    event.preventDefault();
    this.zoom(STEP ** (-event.deltaY / 120), this.at(event.clientX));
  }

  private drag(down: PointerEvent): void {
    if (!this.held || down.button !== 0) return;
    const [from, to] = this.span;
    const scale = (to - from) / Math.max(1, this.plots[0]?.uplot.over.clientWidth ?? 1);
    const move = (event: PointerEvent) => this.look([from - scale * (event.clientX - down.clientX), to - scale * (event.clientX - down.clientX)]);
    const end = () => {
      removeEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) removeEventListener(name, end);
    };
    addEventListener("pointermove", move);
    for (const name of ["pointerup", "pointercancel"]) addEventListener(name, end);
  }

  private key(event: KeyboardEvent): void {
    if (!this.held) return;
    const [from, to] = this.span;
    const go = (direction: number) => this.look([from + direction * PACE * (to - from), to + direction * PACE * (to - from)]);
    const act = { ArrowLeft: () => go(-1), ArrowRight: () => go(1), "+": () => this.zoom(STEP), "-": () => this.zoom(1 / STEP), "0": () => this.follow() }[event.key];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }
}
