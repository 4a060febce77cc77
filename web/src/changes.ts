// The changes against the file: list, undo and redo, comparison with the file, saving.

import { button, html, say } from "./dom.ts";
import type { Key, Sets, World } from "./protocol.ts";
import { brief, pretty } from "./units.ts";

/** Changes of one key within this time, in ms, are one step of undo, such as those of a dragged slider. */
const TOGETHER = 1000;

/** A word quoted for a shell. */
export const quoted = (word: string) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`);

/** The overrides of a command line that set these keys. */
export const overrides = (sets: Sets) => sets.map(([key, value]) => `--set ${quoted(`${key}=${value}`)}`).join(" ");

/** A key's new value with the element that it belongs to: "stiffness 20 N·mm/° (spring, puck to wheel)"; of a new coupling its kind and ends. */
export function described(key: string, value: string, known: Key | undefined): string {
  const damper = /^\{ kind = "(.*?)", between = \["(.*?)", "(.*?)"\], damping = "(.*?)" \}$/.exec(value);
  if (damper) return `a new ${damper[1]}, ${damper[2]} to ${damper[3]}: damping ${pretty(damper[4]!)}`;
  return known ? `${known.label} ${pretty(brief(value))} (${known.group ?? ""})` : `${key} ${value}`;
}

const same = (a: Sets, b: Sets) => JSON.stringify(a) === JSON.stringify(b);

/** The states of undo and redo, and the world's place among them. */
export class Steps {
  private states: Sets[] = [[]];
  private at = 0;
  private wanted: number | null = null;
  private last: { key: string; time: number } | null = null;

  /** Records the world's present state. */
  arrived(state: Sets, time: number): void {
    const target = this.wanted;
    this.wanted = null;
    if (target !== null && same(this.states[target]!, state)) {
      [this.at, this.last] = [target, null];
      return;
    }
    const before = this.states[this.at]!;
    if (same(before, state)) return;
    const text = (sets: Sets) => new Map(sets);
    const [old, now] = [text(before), text(state)];
    const keys = [...new Set([...old.keys(), ...now.keys()])].filter((key) => old.get(key) !== now.get(key));
    const goesOn = keys.length === 1 && this.last?.key === keys[0] && time - this.last!.time < TOGETHER;
    this.states.length = this.at + 1;
    if (goesOn) this.states[this.at] = state;
    else this.at = this.states.push(state) - 1;
    this.last = keys.length === 1 ? { key: keys[0]!, time } : null;
  }

  /** The state one step back (-1) or forward (1), which becomes the requested one; `null` where there is none. */
  step(by: 1 | -1): Sets | null {
    const state = this.states[this.at + by];
    if (!state) return null;
    this.wanted = this.at + by;
    return state;
  }

  has(by: 1 | -1): boolean {
    return this.states[this.at + by] !== undefined;
  }
}

export class Changes {
  private steps = new Steps();
  private place: number | null = null;
  /** The values set when the world last differed from the file. */
  private mine: Sets = [];
  private state: Sets = [];
  private readonly undo = button("Undo", () => this.go(-1), { id: "undo" });
  private readonly redo = button("Redo", () => this.go(1), { id: "redo" });
  private readonly back = button("Mine", () => this.only(this.mine), { id: "mine", title: "What you had set, instead of the file’s own values" });
  private readonly save = button("Save as a file", () => this.ask(), { id: "save", title: "The world as it is, as a world file; files that it names are not in it" });
  private readonly copy = button("Copy as --set", () => void navigator.clipboard.writeText(overrides(this.state)), { id: "copy-sets" });
  private readonly heading = html("summary");
  private readonly list = html("ul");
  private readonly command = html("code");
  private readonly differences = html("details", { id: "differences" }, this.heading, this.list, html("p", {}, this.command));
  private readonly only: (sets: Sets) => void;
  private readonly ask: () => void;
  private readonly reset: HTMLElement;

  /** `only` sets the file's values with these over them; `ask` requests the file; `reset` sets the file's own. */
  constructor(root: HTMLElement, reset: HTMLElement, only: (sets: Sets) => void, ask: () => void) {
    [this.only, this.ask, this.reset] = [only, ask, reset];
    root.append(html("div", { class: "buttons" }, this.undo, this.redo, this.back, this.save, this.copy), this.differences);
  }

  world(world: World, time: number): void {
    if (world.place !== this.place) [this.steps, this.mine, this.place] = [new Steps(), [], world.place];
    this.state = world.changes;
    this.steps.arrived(this.state, time);
    const known = new Map(world.keys.map((key) => [key.path, key]));
    const differing = this.state.filter(([path]) => known.get(path)?.changed ?? true);
    if (differing.length > 0) this.mine = this.state;
    this.differences.hidden = differing.length === 0;
    say(this.heading, `${differing.length} ${differing.length === 1 ? "difference" : "differences"} from the file`);
    this.list.replaceChildren(
      ...differing.map(([path, value]) => {
        const key = known.get(path);
        const own = key?.own ? `, in the file ${pretty(brief(key.own))}` : "";
        const rest = this.state.filter(([other]) => other !== path && !other.startsWith(`${path}.`));
        const takeBack = button("Take back", () => this.only(rest), { "data-back": path, "aria-label": `Take back ${key?.label ?? path}` });
        return html("li", {}, html("span", {}, described(path, value, key) + own), takeBack);
      }),
    );
    say(this.command, overrides(differing));
    this.reset.setAttribute("aria-pressed", String(differing.length === 0));
    this.back.setAttribute("aria-pressed", String(differing.length > 0));
  }

  /** `able`: whether this page may change the world. */
  show(able: boolean): void {
    this.undo.disabled = !able || !this.steps.has(-1);
    this.redo.disabled = !able || !this.steps.has(1);
    this.back.disabled = !able || this.mine.length === 0;
    this.save.disabled = !able;
    this.copy.disabled = this.state.length === 0;
    for (const press of this.list.querySelectorAll("button")) press.disabled = !able;
  }

  private go(by: 1 | -1): void {
    const state = this.steps.step(by);
    if (state) this.only(state);
  }
}

/** Downloads a text or a picture as a file. */
export function download(name: string, content: BlobPart, type = "text/plain"): void {
  const link = html("a", { href: URL.createObjectURL(new Blob([content], { type })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}
