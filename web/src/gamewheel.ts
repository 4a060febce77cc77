// The device as a game wheel: the torque that games request, the torque given, and the pedals and buttons of a simulated wheel.

import { attribute, html, say } from "./dom.ts";
import type { Controls, GameLoop, GameWheel } from "./protocol.ts";
import { number, steady } from "./units.ts";

const PEDALS = ["throttle", "brake", "clutch"];
const BUTTONS = 16;
const STEPS = 1000;
/** Half of the width of a bar. */
const HALF = 150;

/** A torque between its extremes, on the scale of the limit. */
class Bar {
  readonly root = html("p");
  private readonly value = html("output");
  private readonly span: SVGRectElement;
  private readonly needle: SVGPathElement;

  constructor(name: string) {
    const space = "http://www.w3.org/2000/svg";
    const drawing = document.createElementNS(space, "svg");
    attribute(drawing, "viewBox", `${-HALF - 5} 0 ${2 * HALF + 10} 14`);
    attribute(drawing, "aria-hidden", "true");
    const ticks = document.createElementNS(space, "path");
    attribute(ticks, "class", "ticks");
    attribute(ticks, "d", `M${-HALF} 0v14M0 0v14M${HALF} 0v14M${-HALF} 7h${2 * HALF}`);
    this.span = document.createElementNS(space, "rect");
    attribute(this.span, "class", "span");
    attribute(this.span, "y", 3);
    attribute(this.span, "height", 8);
    this.needle = document.createElementNS(space, "path");
    attribute(this.needle, "class", "needle");
    drawing.append(ticks, this.span, this.needle);
    this.root.append(html("span", {}, name), this.value, drawing);
  }

  show([low, last, high]: [number, number, number], limit: number): void {
    const place = (torque: number) => Math.max(-1, Math.min(1, torque / limit)) * HALF;
    attribute(this.span, "x", place(low));
    attribute(this.span, "width", Math.max(1, place(high) - place(low)));
    attribute(this.needle, "d", `M${place(last).toFixed(1)} 0v14`);
    say(this.value, `${steady(last, limit)} N m`);
  }
}

/** The game's own loop in words: its law, and the remedy in use. */
function loop(game: GameLoop): string {
  const { law, lacking, damping, held_back, hands_off, oddity } = game;
  const held = held_back > 0 ? `, and ${number(100 * held_back, 2)} % of the level held back` : "";
  const hands = hands_off < 1 ? ` Hands do ${number(100 * (1 - hands_off), 2)} % of it.` : "";
  const remedy = lacking > 0
    ? `Hands off it lacks ${number(lacking, 2)} N m s/rad of damping; ${number(damping, 2)} are added${held}.${hands}`
    : "The device's own damping keeps it quiet.";
  return `The game's torque follows the wheel: ${law}. ${remedy}${oddity === null ? "" : ` Note: ${oddity}.`}`;
}

export class GameWheelCard {
  private readonly root: HTMLElement;
  private readonly state = html("p", { class: "soft", role: "status" });
  private readonly asked = new Bar("asked for");
  private readonly given = new Bar("given");
  private readonly reason = html("p", { class: "reason" });
  private readonly loop = html("p", { class: "soft" });
  private readonly effects = html("table");
  private readonly controls = html("div", { class: "pressed" });
  private readonly pedals: HTMLInputElement[];
  private readonly buttons: HTMLButtonElement[];
  private readonly send: (controls: Controls) => void;
  private pressed = 0;

  constructor(root: HTMLElement, send: (controls: Controls) => void) {
    this.root = root;
    this.send = send;
    this.pedals = PEDALS.map(() => {
      const input = html("input", { type: "range", min: 0, max: STEPS, step: 1, value: 0 });
      input.addEventListener("input", () => this.tell());
      return input;
    });
    this.buttons = Array.from({ length: BUTTONS }, (_, i) => this.button(i));
    const rows = PEDALS.map((name, i) => html("label", {}, html("span", {}, name), this.pedals[i]!));
    this.controls.append(...rows, html("div", { class: "buttons", role: "group", "aria-label": "Buttons" }, ...this.buttons));
    // Keys held when the page loses the focus would stay pressed.
    addEventListener("blur", () => this.press(0));
    root.append(html("h2", {}, "Games"), this.state, this.asked.root, this.given.root, this.reason, this.loop, this.effects, this.controls);
  }

  private button(i: number): HTMLButtonElement {
    const one = html("button", { type: "button", "aria-pressed": "false", title: `button ${i + 1}; it is pressed while you hold it` }, String(i + 1));
    const down = () => this.press(this.pressed | (1 << i));
    const up = () => this.press(this.pressed & ~(1 << i));
    one.addEventListener("pointerdown", down);
    for (const end of ["pointerup", "pointercancel", "pointerleave", "blur"]) one.addEventListener(end, up);
    one.addEventListener("keydown", (event) => void (event.key === "Enter" && down()));
    one.addEventListener("keyup", (event) => void (event.key === "Enter" && up()));
    return one;
  }

  private press(buttons: number): void {
    if (buttons === this.pressed) return;
    this.pressed = buttons;
    this.buttons.forEach((one, i) => attribute(one, "aria-pressed", String((buttons & (1 << i)) !== 0)));
    this.tell();
  }

  private tell(): void {
    const [throttle, brake, clutch] = this.pedals.map((input) => Number(input.value) / STEPS) as [number, number, number];
    this.send({ pedals: [throttle, brake, clutch], buttons: this.pressed });
  }

  /** `able`: whether this page has control of a simulated wheel. */
  show(wheel: GameWheel | undefined, able: boolean): void {
    this.root.hidden = wheel === undefined;
    if (!wheel) return;
    const { effects, limit, reason } = wheel;
    const refused = wheel.refused > 0 ? `, ${wheel.refused} refused` : "";
    say(this.state, wheel.attached ? `The computer has the wheel: ${wheel.taken} reports taken${refused}.` : "The computer has detached the wheel.");
    this.asked.show(wheel.asked, limit);
    this.given.show(wheel.given, limit);
    attribute(this.root, "class", `network gamewheel ${reason === null ? "good" : "bad"}`);
    say(this.reason, reason === null ? `All that is asked is given; it takes ${number(100 * wheel.used, 2)} % of the damping.` : `Less is given: ${reason}.`);
    this.loop.hidden = wheel.game === null;
    if (wheel.game) say(this.loop, loop(wheel.game));
    while (this.effects.rows.length > Math.max(1, effects.length)) this.effects.deleteRow(-1);
    const lines = effects.length > 0 ? effects : [{ kind: "no effect plays", asked: "", given: null }];
    lines.forEach(({ kind, asked, given }, i) => {
      const row = this.effects.rows[i] ?? this.effects.insertRow();
      while (row.cells.length < 2) row.insertCell();
      say(row.cells[0]!, kind);
      say(row.cells[1]!, (given === null ? asked : `${asked}; given ${given}`).replaceAll("-", "−"));
    });
    this.controls.hidden = !able;
  }

  /** Called when the server has released the controls: control has changed, or the connection was lost. */
  release(): void {
    for (const input of this.pedals) input.value = "0";
    this.pressed = 0;
    for (const one of this.buttons) attribute(one, "aria-pressed", "false");
  }
}
