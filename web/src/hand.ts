// The visitor's hand: pointer or arrow keys to an intended position, at most once a drawn frame.

import type { Peer } from "./link.ts";
import type { Stage } from "./stage.ts";

const TURNING: Record<string, number> = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 };

/** The least time between two messages, in ms. */
const PAUSE = 15;
/** A press is shorter than this, in ms, and moves the pointer by less, in pixels. */
const [BRIEF, STILL] = [400, 4];

export class Hand {
  /** The intended position; nothing while the hand does not hold the puck. */
  intended: number | null = null;
  /** Whether this page may grab. */
  allowed = false;
  private readonly stage: Stage;
  private readonly link: Peer;
  private readonly pressed: () => void;
  /** Place and time at which the pointer was pressed; `null` once it has turned the puck. */
  private began: { x: number; y: number; time: number } | null = null;
  private pointer: number | null = null;
  private offset = 0;
  private sent: number | null = null;
  private keys = new Map<string, number>();
  private kept = false;
  private then = 0;
  private sentAt = 0;

  /** `pressed` is called when the puck was pressed and not turned. */
  constructor(stage: Stage, link: Peer, pressed: () => void = () => {}) {
    [this.stage, this.link, this.pressed] = [stage, link, pressed];
    const svg = stage.svg;
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      svg.addEventListener(end, (event) => {
        if (event.pointerId !== this.pointer) return;
        const isPress = end === "pointerup" && this.began !== null && event.timeStamp - this.began.time < BRIEF;
        this.release();
        if (isPress) this.pressed();
      });
    }
    svg.addEventListener("keydown", (event) => this.key(event));
    svg.addEventListener("keyup", (event) => this.keys.delete(event.key) && this.keys.size === 0 && !this.kept && this.release());
    svg.addEventListener("blur", () => this.pointer === null && this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
  }

  release(): void {
    this.keys.clear();
    this.kept = false;
    if (this.pointer !== null) {
      const pointer = this.pointer;
      this.pointer = null;
      if (this.stage.svg.hasPointerCapture(pointer)) this.stage.svg.releasePointerCapture(pointer);
    }
    if (this.intended === null) return;
    this.link.send({ type: "hand", grip: false, position: this.intended });
    this.intended = this.sent = null;
  }

  /** Once a drawn frame, at `now` in ms. */
  frame(now: number): void {
    const seconds = Math.min(0.1, (now - this.then) / 1000);
    this.then = now;
    if (!this.allowed) this.release();
    if (this.intended === null) return;
    for (const speed of this.keys.values()) this.intended += speed * this.stage.geometry.pace * seconds;
    // A fast screen draws more often than positions need to be sent.
    if (this.intended === this.sent || now - this.sentAt < PAUSE) return;
    this.sentAt = now;
    this.sent = this.intended;
    this.link.send({ type: "hand", grip: true, position: this.intended });
  }

  private grab(): void {
    if (this.intended === null) this.intended = this.stage.position;
  }

  private point(event: PointerEvent): number | null {
    const matrix = this.stage.svg.getScreenCTM();
    if (!matrix) return null;
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    return this.stage.geometry.pointed(x, y);
  }

  private down(event: PointerEvent): void {
    if (!this.allowed || this.pointer !== null || event.button !== 0) return;
    const place = this.point(event);
    if (place === null) return;
    this.grab();
    this.pointer = event.pointerId;
    this.began = { x: event.clientX, y: event.clientY, time: event.timeStamp };
    // A grab does not move the wheel: the offset to the finger is kept.
    this.offset = this.intended! - place;
    this.stage.svg.setPointerCapture(event.pointerId);
  }

  private move(event: PointerEvent): void {
    if (event.pointerId !== this.pointer || this.intended === null) return;
    if (this.began && Math.hypot(event.clientX - this.began.x, event.clientY - this.began.y) > STILL) this.began = null;
    const place = this.point(event);
    if (place !== null) this.intended = this.stage.geometry.unwrap(place + this.offset, this.intended);
  }

  private key(event: KeyboardEvent): void {
    if (!this.allowed || event.ctrlKey || event.altKey || event.metaKey) return;
    const direction = TURNING[event.key];
    if (direction !== undefined) {
      event.preventDefault();
      this.grab();
      this.keys.set(event.key, direction * (event.shiftKey ? 0.25 : 1));
    } else if (event.key.toLowerCase() === "h" && !event.repeat) {
      this.kept = !this.kept;
      if (this.kept) this.grab();
      else this.release();
    }
  }
}
