// The worlds of a session as tiles. One runs; another is chosen by turning the puck and entered by pressing it, or by a press on its tile.

import { attribute, button, html, say } from "./dom.ts";
import type { World } from "./protocol.ts";

/** The world of this name runs while somebody chooses; without one the world that runs stays. */
const MENU = "menu";
/** From one choice to the next where no menu has a pitch, in rad or m. */
const PITCH = { rotary: Math.PI / 6, linear: 0.01 };
/** Of a pitch, more than half: between two choices it is the one before. */
const FURTHER = 0.6;
const STEPS: Record<string, number> = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** How many characters of all titles are the same, up to a colon: "Knob: ". */
function shared(titles: string[]): number {
  const length = titles[0]!.indexOf(": ") + 2;
  return length > 1 && titles.every((title) => title.startsWith(titles[0]!.slice(0, length))) ? length : 0;
}

export class Worlds {
  private readonly tiles = html("div", { id: "tiles", role: "group", "aria-label": "The worlds" });
  private readonly go = button("Choose by turning", () => this.press(), { id: "choose" });
  private readonly back = button("Back", () => this.leave(), { id: "back", title: "To the world that ran before" });
  private readonly root: HTMLElement;
  private readonly choice: HTMLElement;
  private readonly send: (place: number) => void;
  private shape = "";
  private titles: string[] = [];
  /** The worlds that are no menu, by their places, and the menu's. */
  private order: number[] = [];
  private menu: number | null = null;
  private buttons: HTMLButtonElement[] = [];
  private world: World | null = null;
  /** The place of the last world that is no menu. */
  private last = 0;
  /** Which of the order is chosen; `null`: no choice is under way. */
  private chosen: number | null = null;
  /** Where the puck stood at the choice `first`, and how many further it is. */
  private from: number | null = null;
  private first = 0;
  private turned = 0;
  private entering = false;
  private able = false;

  /** `choice`, beside the knob, says what is chosen; `enter` asks for the world at a place. */
  constructor(root: HTMLElement, choice: HTMLElement, enter: (place: number) => void) {
    [this.root, this.choice, this.send] = [root, choice, enter];
    root.append(html("div", { class: "tools" }, html("h2", { id: "worlds-title" }, "Worlds"), this.back, this.go), this.tiles);
    this.tiles.addEventListener("keydown", (event) => this.key(event));
  }

  /** Whether there is more than one. */
  get several(): boolean {
    return this.order.length > 1;
  }

  show(world: World): void {
    const { worlds, place } = world;
    const menu = worlds.findIndex(({ name }) => name === MENU);
    this.menu = menu < 0 || worlds.length < 3 ? null : menu;
    this.order = worlds.map((_, at) => at).filter((at) => at !== this.menu);
    this.build(worlds.map(({ title }) => title));
    const isOther = this.world?.generation !== world.generation;
    this.world = world;
    if (place !== this.menu) this.last = place;
    if (place === this.menu) this.begin();
    else if (this.menu !== null || (this.entering && isOther)) this.chosen = null;
    this.entering &&= !isOther;
    this.mark();
  }

  /** The puck's position, by the world of this generation. */
  frame(generation: number, position: number): void {
    if (this.chosen === null || this.world?.generation !== generation) return;
    this.from ??= position;
    const pitch = this.pitch();
    const way = (position - this.from) / pitch;
    while (way - this.turned > FURTHER) this.turned += 1;
    while (way - this.turned < -FURTHER) this.turned -= 1;
    this.choose(this.first + this.turned);
  }

  /** The knob is pressed: a choice begins, or what is chosen is entered. */
  press(): void {
    if (!this.several || !this.able) return;
    if (this.chosen !== null) this.enter(this.order[this.chosen]!);
    else if (this.menu !== null) this.enter(this.menu);
    else this.begin();
  }

  /** `able`: this page has control. */
  allow(able: boolean): void {
    this.able = able;
    if (!able && this.menu === null) this.chosen = null;
    this.mark();
  }

  private leave(): void {
    if (this.menu !== null) return this.enter(this.last);
    this.chosen = null;
    this.mark();
  }

  private enter(place: number): void {
    this.entering = true;
    this.send(place);
  }

  private begin(): void {
    if (this.chosen !== null) return;
    [this.first, this.turned, this.from] = [Math.max(0, this.order.indexOf(this.last)), 0, null];
    this.chosen = this.first;
    this.mark();
  }

  private choose(index: number): void {
    const count = this.order.length;
    const chosen = ((index % count) + count) % count;
    if (chosen === this.chosen) return;
    this.chosen = chosen;
    this.mark();
  }

  private pitch(): number {
    const { couplings, motion, place } = this.world!;
    const detent = place === this.menu ? couplings.find(({ kind }) => kind === "detent") : undefined;
    return detent?.pitch ?? PITCH[motion];
  }

  private key(event: KeyboardEvent): void {
    const step = STEPS[event.key];
    const at = this.buttons.indexOf(event.target as HTMLButtonElement);
    if (step === undefined || at < 0) return;
    event.preventDefault();
    const next = (at + step + this.buttons.length) % this.buttons.length;
    this.buttons[next]!.focus();
    if (this.chosen === null) return;
    // From here on the puck counts as turned.
    this.first += next - this.chosen;
    this.choose(next);
  }

  private build(titles: string[]): void {
    this.root.hidden = this.choice.hidden = !this.several;
    const shape = JSON.stringify([titles, this.menu]);
    if (shape === this.shape || !this.several) return;
    this.shape = shape;
    const cut = shared(titles);
    this.titles = this.order.map((place) => {
      const title = titles[place]!.slice(cut);
      return title.charAt(0).toUpperCase() + title.slice(1);
    });
    this.buttons = this.order.map((place, at) => button(this.titles[at]!, () => this.able && this.enter(place), { "data-place": place }));
    this.tiles.replaceChildren(...this.buttons);
  }

  private mark(): void {
    if (!this.several || !this.world) return;
    const { place, device } = this.world;
    this.buttons.forEach((tile, at) => {
      tile.disabled = !this.able;
      attribute(tile, "aria-pressed", String(this.order[at] === place));
      tile.classList.toggle("chosen", at === this.chosen);
    });
    const title = this.chosen === null ? null : this.titles[this.chosen]!;
    this.go.disabled = this.back.disabled = !this.able;
    this.back.hidden = title === null;
    say(this.go, title === null ? "Choose by turning" : "Enter");
    const press = device === "sim" ? "press the knob (click it without turning it), or Enter" : "the button Choose, or Enter, and then turn the knob";
    this.choice.classList.toggle("soft", title === null);
    say(this.choice, title === null ? `Another world: ${press}.` : `${title}: press to enter`);
  }
}
