// Eigenvalues a sample: the unit circle, and a lens near 1, where slow loops have theirs.

import { html, svg } from "./dom.ts";
import type { Judged } from "./protocol.ts";
import { number } from "./units.ts";

type Pole = readonly [number, number];

const SIZE = 100;
const CROSS = "M-4.5-4.5L4.5 4.5M-4.5 4.5L4.5-4.5";

/** The poles in words. `growth` is that of all but free shifts: motions that change no torque, at 1; `null`: there are no others. */
export function summary(poles: Pole[], growth: number | null, period: number): string {
  if (poles.length === 0) return "none";
  // Near 1 the growth resolves more than the radius's digits.
  const radius = growth === null ? 0 : Math.exp(growth * period);
  const largest = Math.max(...poles.map(([re, im]) => Math.hypot(re, im)));
  const shifts = largest > radius && (growth === null || Math.log(largest) / period > growth + 1e-9);
  const size = shifts ? (growth === null ? "" : `; beside the free shift at 1, largest |λ| ${radius.toFixed(6)}`) : `, largest |λ| ${radius.toFixed(6)}`;
  if (growth === null) return shifts ? `${poles.length}, a free shift at 1 and nothing that lasts` : `${poles.length}`;
  const course = Math.abs(growth) < 1e-9 ? "keeps its size" : `${growth > 0 ? "grows" : "decays"} by ${number(Math.abs(growth))} per s`;
  return `${poles.length}${size}, ${course}`;
}

export class Poles {
  private readonly root: HTMLElement;

  constructor(root: HTMLElement) {
    this.root = root;
  }

  /** `period`, s: the time of one multiplication by an eigenvalue. */
  show({ held, free, held_growth_per_s, free_growth_per_s, command }: Judged, period: number): void {
    if (command !== undefined) return this.root.replaceChildren(html("p", { class: "soft" }, "Not computed for what has been changed here."));
    const row = (name: string, kind: string, poles: Pole[], growth: number | null) =>
      html("li", { class: kind }, html("span", {}, name), ` ${summary(poles, growth, period)}`);
    this.root.replaceChildren(
      html("div", { class: "maps" }, this.circle(held, free), this.lens(held, free, period)),
      html("ul", { class: "key" }, row("○ held", "held", held, held_growth_per_s), row("× free", "free", free, free_growth_per_s)),
    );
  }

  private circle(held: Pole[], free: Pole[]): HTMLElement {
    const out = Math.max(1.15, ...[...held, ...free].map(([re, im]) => 1.1 * Math.max(Math.abs(re), Math.abs(im))));
    const k = SIZE / out;
    const map = this.map("whole", "Eigenvalues and the unit circle");
    map.append(
      svg("path", { class: "axis", d: `M${-SIZE} 0H${SIZE}M0 ${-SIZE}V${SIZE}` }),
      svg("circle", { class: "unit", r: k }),
      ...this.points(held, free, ([re, im]) => [re * k, -im * k]),
    );
    return html("figure", {}, html("figcaption", {}, "unit circle"), map);
  }

  /** ln λ / T: growth per second to the right, frequency upwards; the unit circle is the upright line. */
  private lens(held: Pole[], free: Pole[], period: number): HTMLElement {
    const logs = (poles: Pole[]) =>
      poles
        .map(([re, im]): Pole => [Math.log(Math.hypot(re, im)) / period, Math.atan2(im, re) / (2 * Math.PI * period)])
        .filter(([growth]) => Number.isFinite(growth));
    const [h, f] = [logs(held), logs(free)];
    // This map shows the few slowest; the other map shows the rest.
    const near = [...h, ...f].sort((a, b) => Math.hypot(...a) - Math.hypot(...b)).slice(0, 6);
    const bound = (values: number[], least: number) => 1.3 * Math.max(least, ...values.map(Math.abs));
    const top = bound(near.map(([, hz]) => hz), 0.1);
    const side = bound(near.map(([growth]) => growth).filter((growth) => Math.abs(growth) < 20 * top), top / 50);
    const map = this.map("lens", "Eigenvalues near 1: growth per second and frequency");
    map.append(
      svg("rect", { class: "bad", x: 0, y: -SIZE, width: SIZE, height: 2 * SIZE }),
      svg("path", { class: "axis", d: `M${-SIZE} 0H${SIZE}` }),
      svg("path", { class: "unit", d: `M0 ${-SIZE}V${SIZE}` }),
      ...this.points(h, f, ([growth, hz]) => [(growth / side) * SIZE, (-hz / top) * SIZE]),
    );
    const ends = html("p", { class: "ends" }, html("span", {}, `−${number(side, 2)}`), html("span", {}, `${number(side, 2)} /s`));
    return html("figure", {}, html("figcaption", {}, `near 1: ln λ/T, to ${number(top, 2)} Hz`), map, ends);
  }

  private map(kind: string, label: string): SVGSVGElement {
    return svg("svg", { class: `map ${kind}`, viewBox: `${-SIZE} ${-SIZE} ${2 * SIZE} ${2 * SIZE}`, role: "img", "aria-label": label });
  }

  private points(held: Pole[], free: Pole[], place: (pole: Pole) => [number, number]): SVGElement[] {
    const inside = ([x, y]: [number, number]) => Math.abs(x) <= SIZE && Math.abs(y) <= SIZE;
    return [
      ...free.map(place).filter(inside).map(([x, y]) => svg("path", { class: "free", d: CROSS, transform: `translate(${x.toFixed(2)} ${y.toFixed(2)})` })),
      ...held.map(place).filter(inside).map(([x, y]) => svg("circle", { class: "held", cx: x, cy: y, r: 5 })),
    ];
  }
}
