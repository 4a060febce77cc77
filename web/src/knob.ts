// One key of the file: a slider with the certified range painted on it and its value as text, or a choice.

import { attribute, button, html, say, svg } from "./dom.ts";
import type { Key } from "./protocol.ts";
import { brief, plain, pretty } from "./units.ts";

/** Steps of a slider. */
const STEPS = 1000;
/** Between two values sent while dragging, in ms: less than two pictures, so that the verdict follows the finger. */
const PAUSE = 20;

export interface Sink {
  set(key: string, value: string): void;
  focus(key: string): void;
}

let count = 0;

export class Knob {
  readonly root: HTMLElement;
  private key: Key;
  private readonly sink: Sink;
  private readonly name = html("label");
  private readonly text = html("input", { type: "text", autocomplete: "off", spellcheck: "false" });
  private readonly slider = html("input", { type: "range", min: 0, max: STEPS, step: 1 });
  private readonly select = html("select");
  private readonly paint = svg("svg", { class: "paint", "aria-hidden": "true", preserveAspectRatio: "none", viewBox: `0 0 ${STEPS} 1` });
  private readonly refusal = html("p", { class: "refusal", role: "alert" });
  private readonly certified = html("p", { class: "certified soft" });
  private pending = 0;
  private sent = 0;
  private wanted = "";

  constructor(key: Key, sink: Sink) {
    this.key = key;
    this.sink = sink;
    const id = `knob-${++count}`;
    this.text.id = this.select.id = id;
    this.name.htmlFor = id;
    this.slider.setAttribute("aria-label", `${key.label}, slider`);
    this.refusal.id = `${id}-refusal`;
    this.root = html("div", { class: `knob ${key.kind}`, "data-key": key.path });
    const slides = key.kind !== "choice" && this.ends() !== null;
    if (key.kind === "choice") this.root.append(this.name, this.select);
    else this.root.append(this.name, this.text, ...(slides ? [html("div", { class: "track" }, this.paint, this.slider), this.certified] : []));
    this.root.append(this.refusal);
    const words = key.choices ?? [];
    if (key.kind === "choice") this.select.append(...words.map((word) => html("option", { value: word }, word)));
    // A word in place of a number: a damper may be "compensating".
    else if (words.length > 0) this.root.append(html("div", { class: "words" }, ...words.map((word) => button(word, () => this.send(word)))));
    this.select.addEventListener("change", () => this.send(this.select.value));
    this.text.addEventListener("change", () => ![this.key.written, brief(this.key.written)].includes(this.text.value.trim()) && this.send(this.text.value.trim()));
    // The value has all digits while it is edited, and a few otherwise.
    this.text.addEventListener("focus", () => {
      if (this.text.value !== brief(this.key.written) || this.text.value === this.key.written) return;
      this.text.value = this.key.written;
      this.text.select();
    });
    this.text.addEventListener("blur", () => !this.dragged && this.text.value === this.key.written && (this.text.value = brief(this.key.written)));
    this.slider.addEventListener("input", () => this.slide());
    this.slider.addEventListener("change", () => this.flush());
    this.root.addEventListener("focusin", () => sink.focus(key.path));
    this.show(key);
  }

  get path(): string {
    return this.key.path;
  }

  get dragged(): boolean {
    return this.slider.matches(":active") || this.pending !== 0;
  }

  /** Shows the world's present value. */
  show(key: Key): void {
    this.key = key;
    this.refuse("");
    say(this.name, key.label);
    this.root.classList.toggle("changed", key.changed);
    this.root.title = `${key.doc ? `${key.doc}\n` : ""}${key.path} = ${key.written}${key.changed ? ", changed here" : ""}`;
    if (key.kind === "choice") {
      this.select.value = key.written;
      return;
    }
    if (document.activeElement !== this.text || !this.typed) this.text.value = document.activeElement === this.text ? key.written : brief(key.written);
    if (this.dragged) return;
    const place = this.place(key.value ?? 0);
    this.slider.value = String(place);
    attribute(this.slider, "aria-valuetext", pretty(brief(key.written)));
  }

  /** Shows a refusal; empty: none. */
  refuse(message: string): void {
    say(this.refusal, message);
    attribute(this.text, "aria-invalid", message ? "true" : false);
    if (message) attribute(this.text, "aria-describedby", this.refusal.id);
    else this.text.removeAttribute("aria-describedby");
    if (message && !this.dragged) this.slider.value = String(this.place(this.key.value ?? 0));
  }

  /** Shows the certified intervals in SI; `null`: not known, or no longer. */
  range(intervals: [number, number][] | null): void {
    this.root.classList.toggle("ranged", intervals !== null);
    this.root.classList.toggle("stale", intervals === null);
    if (intervals === null) return;
    this.paint.replaceChildren(
      ...intervals.map(([from, to]) => {
        const [a, b] = [this.place(from), this.place(to)];
        return svg("rect", { x: a, y: 0, width: Math.max(2, b - a), height: 1 });
      }),
    );
    this.root.classList.toggle("nowhere", intervals.length === 0);
    const ends = this.ends();
    const inWords = ([from, to]: [number, number]) => {
      const low = ends !== null && from <= ends[0] * (1 + 1e-9);
      const high = ends !== null && to >= ends[1] * (1 - 1e-9);
      if (low && high) return "everywhere here";
      return low ? `up to ${this.shown(to)}` : high ? `from ${this.shown(from)} on` : `${this.shown(from)} to ${this.shown(to)}`;
    };
    say(this.certified, intervals.length === 0 ? "certified nowhere here" : `certified ${intervals.map(inWords).join(" and ")}`);
  }

  private get typed(): boolean {
    return this.text.value !== this.key.written && document.activeElement === this.text && !this.dragged;
  }

  private ends(): [number, number] | null {
    const { min, max } = this.key;
    return typeof min === "number" && typeof max === "number" && max > min ? [min, max] : null;
  }

  /** The place of a value in SI on the slider. */
  private place(value: number): number {
    const ends = this.ends();
    if (!ends) return 0;
    const [min, max] = ends;
    const part = this.key.log && min > 0 ? Math.log(Math.max(value, min) / min) / Math.log(max / min) : (value - min) / (max - min);
    return Math.round(STEPS * Math.min(1, Math.max(0, part)));
  }

  private at(place: number): number {
    const [min, max] = this.ends()!;
    const part = place / STEPS;
    return this.key.log && min > 0 ? min * (max / min) ** part : min + (max - min) * part;
  }

  private written(value: number, digits: number): string {
    if (this.key.kind === "whole") return String(Math.round(value));
    const unit = this.key.unit ?? "";
    return `${plain(value / (this.key.factor ?? 1), digits)}${unit ? ` ${unit}` : ""}`;
  }

  private shown(value: number): string {
    return pretty(this.written(value, 3)).replace("·", " ").replace("-", "−");
  }

  private slide(): void {
    this.text.value = this.wanted = this.written(this.at(Number(this.slider.value)), 3);
    attribute(this.slider, "aria-valuetext", pretty(this.wanted));
    if (this.pending !== 0) return;
    const wait = Math.max(0, this.sent + PAUSE - performance.now());
    this.pending = setTimeout(() => this.flush(), wait);
  }

  private flush(): void {
    clearTimeout(this.pending);
    this.pending = 0;
    if (!this.wanted) return;
    this.send(this.wanted);
    this.wanted = "";
  }

  private send(value: string): void {
    this.sent = performance.now();
    this.sink.set(this.key.path, value);
  }
}
