// The network that this wheel is a station of: its verdict, its links, and what may be changed of it for all stations.

import { attribute, button, html, say } from "./dom.ts";
import type { NetworkChange, Stations } from "./protocol.ts";
import { number } from "./units.ts";

const STEPS = 1000;

/** A slider over one number of the network. */
interface Dial {
  name: string;
  key: keyof NetworkChange;
  /** The value at a place on the slider from 0 to 1, and the inverse. */
  at: (part: number) => number;
  part: (value: number) => number;
  text: (value: number) => string;
  /** Sent while it moves; else when it is released, since a certificate is made of it. */
  live: boolean;
}

const percent = (value: number) => `${number(100 * value, 2)} %`;
const linear = (most: number) => ({ at: (part: number) => part * most, part: (value: number) => value / most });
const logarithmic = (least: number, most: number) => ({
  at: (part: number) => least * (most / least) ** part,
  part: (value: number) => Math.log(value / least) / Math.log(most / least),
});

const DIALS: Dial[] = [
  { name: "latency", key: "delay_s", ...linear(0.2), text: (s) => `${number(1e3 * s, 3)} ms`, live: true },
  { name: "messages lost", key: "loss", ...linear(0.9), text: percent, live: true },
  { name: "stiffness", key: "stiffness", ...logarithmic(0.02, 2), text: (factor) => `${percent(factor)} of the file’s`, live: false },
  { name: "age_max", key: "age", ...logarithmic(0.1, 50), text: (factor) => `${percent(factor)} of the file’s`, live: false },
];

export class NetworkCard {
  private readonly root: HTMLElement;
  private readonly heading = html("h2");
  private readonly verdict = html("p", { role: "status" });
  private readonly remedies = html("div", { class: "buttons" });
  private readonly links = html("div");
  private readonly inputs: HTMLInputElement[];
  private readonly values: HTMLElement[];
  private readonly send: (change: NetworkChange) => void;
  private offered = "";
  private moving = -1;

  constructor(root: HTMLElement, send: (change: NetworkChange) => void) {
    this.root = root;
    this.send = send;
    this.values = DIALS.map(() => html("output"));
    this.inputs = DIALS.map((dial, i) => this.slider(dial, i));
    const rows = DIALS.map(({ name }, i) => html("label", {}, html("span", {}, name), this.values[i]!, this.inputs[i]!));
    root.append(this.heading, this.verdict, this.remedies, this.links, ...rows);
  }

  private slider({ key, at, text, live }: Dial, i: number): HTMLInputElement {
    const input = html("input", { type: "range", min: 0, max: STEPS, step: 1 });
    const value = () => at(Number(input.value) / STEPS);
    input.addEventListener("pointerdown", () => (this.moving = i));
    input.addEventListener("input", () => {
      say(this.values[i]!, text(value()));
      if (live) this.send({ [key]: value() });
    });
    input.addEventListener("change", () => {
      this.moving = -1;
      this.send({ [key]: value() });
    });
    return input;
  }

  /** `able`: this page has control. */
  show(network: Stations | undefined, able: boolean): void {
    this.root.hidden = network === undefined;
    if (!network) return;
    const { certified, outdated, sentence } = network;
    attribute(this.root, "class", `network ${outdated ? "" : certified ? "good" : "bad"}`.trim());
    say(this.heading, network.station === null ? "The network" : `Network: station ${network.station}`);
    const capital = `${certified ? "✓" : "✗"} ${sentence[0]!.toUpperCase()}${sentence.slice(1)}`;
    say(this.verdict, outdated ? `… A new verdict is being computed. Before the last change: ${sentence}` : capital);
    const offered = JSON.stringify(network.remedies);
    if (offered !== this.offered) {
      this.offered = offered;
      this.remedies.replaceChildren(
        ...network.remedies.map(({ text, stiffness, age }) =>
          button(text, () => this.send({ ...(stiffness !== null && { stiffness }), ...(age !== null && { age }) }), { class: "remedy" }),
        ),
      );
    }
    for (const remedy of this.remedies.querySelectorAll("button")) remedy.disabled = !able;
    while (this.links.childElementCount > network.links.length) this.links.lastElementChild!.remove();
    network.links.forEach((link, i) => {
      const row = this.links.children[i] ?? this.links.appendChild(html("p", {}, html("span"), html("meter", { min: 0, max: 2, high: 1, optimum: 0 })));
      const [words, meter] = [row.children[0]!, row.children[1] as HTMLMeterElement];
      const most = `${number(1e3 * link.age_max_s, 3)} ms`;
      const age = link.age_s === null ? "nothing comes from there" : `position ${number(1e3 * link.age_s, 2)} ms old, of ${most}`;
      const ends = link.from === undefined ? `to ${link.to}` : `${link.from}’s link to ${link.to}`;
      say(words, `${ends}: ${link.acts ? "acts" : "has let go"}; ${age}`);
      meter.value = link.age_s === null ? 2 : Math.min(2, link.age_s / link.age_max_s);
      attribute(meter, "aria-label", `age of the position from ${link.to}, as a part of the greatest at which it acts`);
    });
    DIALS.forEach(({ key, part, text }, i) => {
      const input = this.inputs[i]!;
      input.disabled = !able;
      if (this.moving === i) return;
      const value = network[key];
      input.value = String(Math.round(STEPS * Math.min(1, Math.max(0, part(value)))));
      say(this.values[i]!, text(value));
    });
  }
}
