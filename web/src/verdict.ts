// The certificate in sentences, and remedies that a press applies.

import { button, html } from "./dom.ts";
import type { Sets, Verdict } from "./protocol.ts";
import { number, pretty } from "./units.ts";

const NAMES = { held: "held", free: "let go", passive: "any hand", quantisation: "encoder" } as const;

export class VerdictCard {
  private readonly root: HTMLElement;
  private readonly heading: HTMLElement;
  private readonly apply: (sets: Sets) => void;
  /** What a key is called, and what it belongs to. */
  private readonly named: (key: string) => [string, string];
  /** Folded as the visitor left it. */
  private readonly notes = html("details", { class: "notes soft" });
  private said = "";

  /** `heading` is announced by screen readers when its words change; the details beside it are not. */
  constructor(root: HTMLElement, heading: HTMLElement, apply: (sets: Sets) => void, named: (key: string) => [string, string]) {
    this.root = root;
    this.heading = heading;
    this.apply = apply;
    this.named = named;
  }

  show(verdict: Verdict): void {
    if (verdict.command !== undefined) return this.unjudged(verdict.certified, verdict.command);
    const unstable = verdict.sentences.some(({ what, ok }) => ok === false && (what === "held" || what === "free"));
    const state = verdict.certified ? "stable" : unstable ? "unstable" : "marginal";
    this.head(verdict.certified ? "Certified" : unstable ? "Not certified: unstable" : "Not certified", state);
    const summary = html("p", {}, upper((verdict.sentence ?? "").replace(/^(not )?certified[:,] /, "")));
    const sentences = html("dl");
    for (const { what, ok, text } of verdict.sentences) {
      const [mark, meaning] = ok === null ? ["~", "in between"] : ok ? ["✓", "good"] : ["✗", "bad"];
      sentences.append(
        html("dt", { class: ok === null ? "even" : ok ? "good" : "bad" }, html("span", { "aria-label": meaning, role: "img" }, mark), ` ${NAMES[what] ?? what}`),
        html("dd", {}, text),
      );
    }
    const growth = verdict.growth_per_s;
    const facts = [
      growth === null ? "" : Math.abs(growth) < 1e-9 ? "neither grows nor decays" : `${growth > 0 ? "grows" : "decays"} by ${number(Math.abs(growth))} per second`,
      verdict.ms === null ? "" : `computed in ${number(verdict.ms, 2)} ms`,
    ];
    this.notes.replaceChildren(html("summary", {}, "Notes"), ...(verdict.notes ?? []).map((note) => html("p", {}, upper(note))));
    this.notes.hidden = !verdict.notes?.length;
    this.root.replaceChildren(summary, sentences, this.notes, html("p", { class: "soft" }, upper(facts.filter(Boolean).join(", "))), this.remedies(verdict));
  }

  private head(words: string, state: string): void {
    this.heading.parentElement!.className = `verdict ${state}`;
    if (this.said !== words) this.heading.textContent = this.said = words;
  }

  /** No certificate was made of it; whether it is in a certified range may be known. */
  private unjudged(inside: boolean | null, command: string): void {
    this.head(inside === null ? "Not judged" : inside ? "In the certified range" : "Outside of the certified range", inside ? "stable" : "marginal");
    const known = inside === null ? "The certificate is of the file’s own values, and there is no server here to make another." : "That is what the painted slider says of this one change; the certificate itself is of the file’s own values.";
    this.root.replaceChildren(html("p", {}, `${known} This command makes one:`), html("p", { class: "command" }, html("code", {}, command)));
  }

  private remedies({ remedies, certified }: Verdict): HTMLElement {
    if (remedies === null) return html("p", { class: "soft" }, "Looking for remedies …");
    if (remedies.length === 0) return html("p", { class: "soft" }, certified ? "" : "No single number makes this loop certified.");
    const rows = remedies.map(({ sets, text }) => {
      if (sets.length === 0) return html("li", {}, html("code", {}, text.replace(/ {2,}#/g, "  #")));
      const title = sets.map(([key, value]) => `sets ${key} to ${value}`).join("\n");
      const line = ([key, value]: Sets[number]) => {
        const [name, group] = this.named(key);
        return `${name} ${pretty(value)} (${group})`;
      };
      const label = sets.map(line).join("\n");
      const press = button(label, () => this.apply(sets), { class: "remedy", "data-key": sets.map(([key]) => key).join(" "), title });
      return html("li", {}, press);
    });
    const title = certified ? "Certified as far as each of these, one at a time" : "Any one of these makes it certified";
    return html("div", { class: "remedies" }, html("p", {}, title), html("ul", {}, ...rows));
  }
}

/** A sentence begins with a capital. */
function upper(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
