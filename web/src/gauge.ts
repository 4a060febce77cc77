// The motor's torque, in the colours of the couplings.

import { attribute, html, say, svg } from "./dom.ts";
import type { Units } from "./units.ts";
import { number, steady } from "./units.ts";

const HALF = 150;

/** From purple (pushes back) past grey to green (pushes on); `share` of the largest torque, from -1 to 1. */
export function tint(share: number): string {
  const part = Math.round(100 * Math.min(1, Math.sqrt(Math.abs(share))));
  return `color-mix(in oklab, var(--${share < 0 ? "minus" : "plus"}) ${part}%, var(--slack))`;
}

export class Gauge {
  private readonly needle = svg("path", { class: "needle", d: "M0 4l-5 -9h10z" });
  private readonly low = html("span");
  private readonly high = html("span");
  private readonly value = html("strong");
  private scale = 1;
  private per = 1;

  constructor(root: HTMLElement) {
    const stops = Array.from({ length: 33 }, (_, i) => {
      const stop = svg("stop", { offset: String(i / 32) });
      stop.style.setProperty("stop-color", tint(i / 16 - 1));
      return stop;
    });
    const gradient = svg("linearGradient", { id: "pushes" }, ...stops);
    root.append(
      svg(
        "svg",
        { viewBox: "-160 -7 320 23", "aria-hidden": "true" },
        svg("defs", {}, gradient),
        svg("rect", { class: "bar", x: -HALF, y: 4, width: 2 * HALF, height: 8, rx: 2, fill: "url(#pushes)" }),
        svg("path", { class: "ticks", d: `M${-HALF} 1v14M0 1v14M${HALF} 1v14` }),
        this.needle,
      ),
      html("p", { class: "ends" }, this.low, this.value, this.high),
    );
  }

  /** `scale`: the limit, or the largest so far, in SI. */
  show(scale: number, limited: boolean, units: Units): void {
    [this.scale, this.per] = [scale, units.effort.per];
    const text = number(scale * this.per);
    const name = limited ? "limit " : "";
    say(this.low, `−${text}`);
    say(this.high, `${name}${text}`);
  }

  frame(output: number, units: Units): void {
    const place = Math.max(-1.05, Math.min(1.05, output / this.scale)) * HALF;
    attribute(this.needle, "transform", `translate(${place.toFixed(1)} 0)`);
    say(this.value, `motor ${steady(output * this.per, this.scale * this.per)} ${units.effort.name}`);
  }
}
