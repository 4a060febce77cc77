// The certificate in sentences, and remedies that a press applies.

import { button, html, say } from "./dom.ts";
import type { Sets, Judged } from "./protocol.ts";
import { number } from "./units.ts";

/** As `hapt check` has them. */
const NAMES = { held: "held", free: "free", passive: "passive", uneven: "uneven", quantisation: "counts" } as const;

/** What each of them is about. */
const ABOUT = {
  held: "while a hand holds the puck still",
  free: "hands-off",
  passive: "in every passive hand",
  uneven: "for all times and tolerances that the file allows",
  quantisation: "with the counts of the encoder",
} as const;

/** "Waiting" is shown only once a verdict has not come within this time after its world, in ms. */
const SOON = 250;

/** Mark and meaning of a claim that neither holds nor fails: its sentence begins with "marginal", or it is not proved. */
const undecided = (text: string): [string, string] => text.startsWith("marginal") ? ["=", "marginal"] : ["?", "not proved"];

export class VerdictCard {
  private readonly root: HTMLElement;
  private readonly heading: HTMLElement;
  /** The heading again, where a phone always shows it. */
  private readonly strip: HTMLElement;
  private readonly apply: (sets: Sets) => void;
  /** A change in words. */
  private readonly describe: (key: string, value: string) => string;
  /** Folded as the visitor left them. */
  private readonly reasons = html("details", { class: "reasons", open: matchMedia("(min-height: 1000px) and (min-width: 761px)").matches });
  private readonly margins = html("details", { class: "margins" });
  private said = "";
  private waiting: number | null = null;

  /** `heading` is announced by screen readers when its words change; the details next to it are not. */
  constructor(root: HTMLElement, heading: HTMLElement, strip: HTMLElement, apply: (sets: Sets) => void, describe: (key: string, value: string) => string) {
    this.root = root;
    this.heading = heading;
    this.strip = strip;
    this.apply = apply;
    this.describe = describe;
  }

  /** The world has changed: what stands here is of the one before, up to the next verdict. */
  outdated(): void {
    if (this.said === "") return;
    // Remedies of the earlier world need not certify this one.
    for (const press of this.root.querySelectorAll<HTMLButtonElement>("button.remedy")) press.disabled = true;
    this.waiting ??= setTimeout(() => {
      const before = this.said;
      this.head("A new verdict is being computed", "even");
      this.root.replaceChildren(html("p", {}, `Before the last change: ${before}.`));
    }, SOON);
  }

  show(verdict: Judged): void {
    if (this.waiting !== null) clearTimeout(this.waiting);
    this.waiting = null;
    if (verdict.command !== undefined) return this.unjudged(verdict.certified, verdict.command);
    const unstable = verdict.sentences.some(({ what, ok }) => ok === false && (what === "held" || what === "free"));
    this.head(verdict.certified ? "Certified" : unstable ? "Not certified: unstable" : "Not certified", verdict.certified ? "good" : "bad");
    // The heading has its beginning: "Not certified: ...".
    const summary = html("p", {}, upper((verdict.sentence ?? "").replace(/^.*?: /, "")));
    const marks = html("p", { class: "marks" });
    const sentences = html("dl");
    for (const { what, ok, text } of verdict.sentences) {
      const [mark, meaning, kind] = ok === null ? [...undecided(text), "even"] : ok ? ["✓", "good", "good"] : ["✗", "bad", "bad"];
      // A sentence that is neither good nor bad has its meaning as a word.
      const word = ok === null ? ` ${NAMES[what] ?? what}: ${meaning}` : ` ${NAMES[what] ?? what}`;
      const named = () => [html("span", ok === null ? { "aria-hidden": "true" } : { "aria-label": meaning, role: "img" }, mark!), word];
      marks.append(html("span", { class: kind, title: ABOUT[what] }, ...named()));
      sentences.append(html("dt", { class: kind, title: ABOUT[what] }, ...named()), html("dd", {}, text));
    }
    const notes = (verdict.notes ?? []).map((note) => html("p", {}, upper(note)));
    const time = verdict.ms === null ? [] : [html("p", { class: "soft" }, `Computed in ${number(verdict.ms, 2)} ms`)];
    this.reasons.replaceChildren(html("summary", {}, notes.length > 0 ? "Why, and notes" : "Why"), sentences, ...notes, ...time);
    this.root.replaceChildren(summary, marks, this.reasons, this.remedies(verdict));
  }

  private head(words: string, state: string): void {
    this.heading.parentElement!.className = `verdict ${state}`;
    this.strip.className = `strip ${state}`;
    say(this.strip, `${state === "good" ? "✓ " : state === "bad" ? "✗ " : ""}${words}`);
    if (this.said !== words) this.heading.textContent = this.said = words;
  }

  /** No certificate was made of it; whether it is in a certified range may be known. */
  private unjudged(inside: boolean | null, command: string): void {
    this.head(inside === null ? "Not judged" : inside ? "In the certified range" : "Outside of the certified range", inside === null ? "even" : inside ? "good" : "bad");
    const known = inside === null ? "The certificate is of the file’s own values, and there is no server here to make another." : "That is what the painted slider says of this one change; the certificate itself is of the file’s own values.";
    this.root.replaceChildren(html("p", {}, `${known} This command makes one:`), html("p", { class: "command" }, html("code", {}, command)));
  }

  private remedies({ remedies, certified }: Judged): HTMLElement {
    if (remedies === null) return html("p", { class: "soft" }, "Looking for remedies …");
    if (remedies.length === 0) return html("p", { class: "soft" }, certified ? "" : "No single number makes this loop certified.");
    const rows = remedies.map(({ sets, text }) => {
      if (sets.length === 0) return html("li", {}, html("code", {}, text.replace(/ {2,}#/g, "  #")));
      const title = sets.map(([key, value]) => `sets ${key} to ${value}`).join("\n");
      const label = sets.map(([key, value]) => this.describe(key, value)).join("\n");
      const press = button(label, () => this.apply(sets), { class: "remedy", "data-key": sets.map(([key]) => key).join(" "), title });
      return html("li", {}, press);
    });
    if (!certified) return html("div", { class: "remedies" }, html("p", {}, "Any one of these makes it certified"), html("ul", {}, ...rows));
    // A margin, not a remedy: the button sets the key to the end of its certified range.
    this.margins.replaceChildren(html("summary", {}, "Go to the edge"), html("p", { class: "soft" }, "The loop stays certified as far as each of these, one at a time."), html("ul", {}, ...rows));
    return this.margins;
  }
}

/** A sentence begins with a capital. */
function upper(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
