// A button that switches to forward Euler, under which an undamped oscillation grows, and back.

import { button } from "./dom.ts";
import type { Key, Sets, Judged, World } from "./protocol.ts";

const METHOD = "loop.method";
const EULER = "forward-euler";
const PERIOD = "loop.period";
/** The growth is w²T/2 per second: at this period it is visible within seconds. */
const COARSE = { written: "5 ms", seconds: 5e-3 };

export class Euler {
  readonly button: HTMLButtonElement;
  private method = "";
  private before = "zoh";
  /** The period before; `null` where it was not changed. */
  private period: string | null = null;
  private now: Key | undefined;
  private breaks = false;

  constructor(set: (sets: Sets) => void) {
    this.button = button("", () => set(this.press()), { id: "euler", title: "With a period of 5 ms, where it is shorter; shows with the puck held: in a step, or by hand" });
    this.show();
  }

  private press(): Sets {
    if (this.method === EULER) {
      const period = this.now && this.now.written === COARSE.written ? this.period : null;
      return [[METHOD, this.before], ...(period === null ? [] : ([[PERIOD, period]] as Sets))];
    }
    const coarser = this.now !== undefined && (this.now.value ?? COARSE.seconds) < COARSE.seconds;
    this.period = coarser ? this.now!.written : null;
    return [[METHOD, EULER], ...(coarser ? ([[PERIOD, COARSE.written]] as Sets) : [])];
  }

  world(world: World): void {
    const key = world.keys.find((key) => key.path === METHOD && !key.fixed);
    this.now = world.keys.find((key) => key.path === PERIOD && !key.fixed);
    this.button.hidden = key === undefined;
    this.method = key?.written ?? "";
    if (key && this.method !== EULER) this.before = this.method;
    this.show();
  }

  /** Whether the button applies: the world is certified and has an undamped oscillation, which forward Euler makes grow. */
  verdict({ certified, held }: Judged): void {
    if (this.method !== EULER) this.breaks = certified === true && held.some(([re, im]) => im !== 0 && Math.abs(Math.hypot(re, im) - 1) < 1e-9);
    this.show();
  }

  private show(): void {
    this.button.textContent = this.method === EULER ? `Back to ${this.before}` : `${this.breaks ? "Break it" : "Try"}: forward Euler`;
  }
}
