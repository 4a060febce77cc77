// One press to forward Euler, by which a swing without damping grows, and one back.

import { button } from "./dom.ts";
import type { Verdict, World } from "./protocol.ts";

const METHOD = "loop.method";
const EULER = "forward-euler";

export class Euler {
  readonly button: HTMLButtonElement;
  private method = "";
  private before = "zoh";
  private breaks = false;

  constructor(set: (key: string, value: string) => void) {
    this.button = button("", () => set(METHOD, this.method === EULER ? this.before : EULER), { id: "euler", title: "shows with the puck held: in a step, or by hand" });
    this.show();
  }

  world(world: World): void {
    const key = world.keys.find((key) => key.path === METHOD && !key.fixed);
    this.button.hidden = key === undefined;
    this.method = key?.written ?? "";
    if (key && this.method !== EULER) this.before = this.method;
    this.show();
  }

  /** It breaks what is certified and has a swing that nothing damps: under forward Euler every such swing grows. */
  verdict({ certified, held }: Verdict): void {
    if (this.method !== EULER) this.breaks = certified === true && held.some(([re, im]) => im !== 0 && Math.abs(Math.hypot(re, im) - 1) < 1e-9);
    this.show();
  }

  private show(): void {
    this.button.textContent = this.method === EULER ? `Back to ${this.before}` : `${this.breaks ? "Break it" : "Try"}: forward Euler`;
  }
}
