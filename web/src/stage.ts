// The wheel (or handle), the bodies behind it, and the couplings in between, drawn where the last frame has them.

import { attribute, html, say, svg } from "./dom.ts";
import { tint } from "./gauge.ts";
import type { Gap, Geometry } from "./geometry.ts";
import { linear, roundUp } from "./linear.ts";
import { rotary } from "./rotary.ts";
import { COLUMN, type Coupling, type Frame, type World } from "./protocol.ts";

/** Moves a part of the drawing: positions of puck and bodies, ground the last; torques of the couplings on their first ends. */
type Part = (q: Float64Array, torques: Float32Array) => void;

/** The same coupling with ground as its second end, where ground is the first: positions change their signs. */
function groundLast(coupling: Coupling): Coupling {
  const { between, side, at, rest, phase, depth } = coupling;
  if (between[0] !== "ground") return coupling;
  return {
    ...coupling,
    between: [between[1], between[0]],
    side: side === "below" ? "above" : "below",
    at: -(at ?? 0),
    rest: -(rest ?? 0),
    phase: -(phase ?? 0),
    ...(depth && { depth: depth.map((_, i) => depth[(depth.length - i) % depth.length]!) }),
  };
}

export class Stage {
  readonly svg: SVGSVGElement;
  geometry: Geometry = rotary(0);
  /** Where the puck is. */
  position = 0;
  private world: World | null = null;
  private parts: Part[] = [];
  private reach = 0.05;
  private scale = 1e-3;
  private shape = "";
  private grip: SVGPathElement | null = null;
  private intended: SVGElement | null = null;

  private readonly labels: HTMLElement;
  private readonly far: HTMLElement;
  /** A text for each wall on another turn than the end that touches it; `null` for a wall on the same turn. */
  private away: (string | null)[] = [];

  /** `labels` lies over the drawing; `far` lists the walls on other turns. */
  constructor(root: SVGSVGElement, labels: HTMLElement, far: HTMLElement) {
    this.svg = root;
    this.labels = labels;
    this.far = far;
  }

  /** The largest torque that colours show. */
  get strongest(): number {
    return this.scale;
  }

  show(world: World): void {
    const shape = JSON.stringify([world.motion, world.bodies.map((body) => body.name), world.couplings]);
    this.world = world;
    this.scale = world.limit ?? this.scale;
    if (shape === this.shape) return;
    this.shape = shape;
    const walls = world.couplings.map((coupling) => Math.abs(coupling.at ?? 0));
    this.reach = roundUp(1.3 * Math.max(0.03, ...walls));
    this.build();
  }

  frame(frame: Frame, intended: number | null): void {
    const world = this.world;
    const bodies = world?.bodies.length ?? 0;
    if (!world || frame.last.length < COLUMN.bodies + 2 * bodies) return;
    const q = new Float64Array(bodies + 2);
    q[0] = frame.last[COLUMN.puck]!;
    for (let i = 0; i < bodies; i++) q[i + 1] = frame.last[COLUMN.bodies + 2 * i]!;
    if (!q.every(Number.isFinite)) return;
    this.position = q[0]!;
    const furthest = Math.max(...q.map(Math.abs));
    if (world.motion === "linear" && furthest > this.reach) this.rescale(furthest);
    const torques = frame.last.subarray(COLUMN.bodies + 2 * bodies);
    for (const part of this.parts) part(q, torques);
    say(this.far, this.away.filter((text) => text !== null).join("; "));
    this.hand(q[0]!, intended);
  }

  private rescale(furthest: number): void {
    this.reach = roundUp(1.3 * furthest);
    this.build();
  }

  private hand(position: number, intended: number | null): void {
    if (!this.grip || !this.intended) return;
    const held = intended !== null;
    attribute(this.svg, "data-held", held);
    attribute(this.grip, "visibility", held ? "visible" : "hidden");
    attribute(this.intended, "visibility", held ? "visible" : "hidden");
    if (!held) return;
    attribute(this.grip, "d", this.geometry.arc(this.geometry.lanes[0]!.outer - 8, position, intended));
    attribute(this.intended, "transform", this.geometry.place(intended));
  }

  private build(): void {
    const world = this.world!;
    const names = world.bodies.map((body) => body.name);
    const geometry = world.motion === "rotary" ? rotary(names.length) : linear(names.length, this.reach);
    this.geometry = geometry;
    this.parts = [];
    attribute(this.svg, "viewBox", geometry.viewBox);
    attribute(this.svg, "data-motion", world.motion);
    const { ticks, labels } = geometry.scale();
    const scale = svg("g", { class: "scale" }, svg("path", { d: ticks }));
    const [left, top, width, height] = geometry.viewBox.split(" ").map(Number) as [number, number, number, number];
    // Outside the SVG: a text inside would shrink with the drawing.
    this.labels.replaceChildren(
      ...labels.map(({ x, y, text }) => {
        const label = html("span", {}, text);
        label.style.setProperty("left", `${(100 * (x - left)) / width}%`);
        // Labels keep their size at a small dial, so they are placed further out.
        const out = world.motion === "rotary" ? 22 * (x / (width / 2)) : 0;
        label.style.setProperty("transform", `translate(${-50 + out}%, -50%)`);
        label.style.setProperty("top", `${(100 * (y - top)) / height}%`);
        return label;
      }),
    );
    this.svg.replaceChildren(scale);
    this.away = [];
    const drawn = geometry.lanes.map((lane, i) => {
      const { outline, mark, detail } = geometry.body(lane, i === 0);
      const group = svg("g", { class: i === 0 ? "puck" : `body c${((i - 1) % 6) + 1}`, "data-name": names[i - 1] ?? "puck" });
      group.append(
        svg("path", { class: "outline", "fill-rule": "evenodd", d: outline }),
        svg("path", { class: "detail", d: detail }),
        svg("path", { class: "mark", d: mark }),
      );
      this.parts.push((q) => attribute(group, "transform", geometry.place(q[i]!)));
      return group;
    });
    this.svg.append(...drawn.reverse());
    if (world.motion === "rotary") this.svg.append(svg("circle", { class: "hub", r: geometry.hub - 5 }));
    world.couplings.forEach((coupling, i) => this.couple(coupling, i, names));
    const puck = geometry.lanes[0]!;
    this.grip = svg("path", { class: "grip" });
    const finger = world.motion === "rotary" ? { cx: 0, cy: -(puck.outer - 8) } : { cx: 0, cy: puck.outer + 8 };
    this.intended = svg("circle", { class: "finger", r: 9, ...finger });
    this.svg.append(this.grip, this.intended);
  }

  private couple(ofWorld: Coupling, index: number, names: string[]): void {
    const coupling = groundLast(ofWorld);
    const geometry = this.geometry;
    const ground = names.length + 1;
    const end = (name: string) => (name === "ground" ? ground : name === "puck" ? 0 : names.indexOf(name) + 1);
    const [first, second] = [end(coupling.between[0]), end(coupling.between[1])];
    // Ground is the frame outside for the puck, and the hub inside for a body.
    const framed = first + second === ground && first * second === 0;
    const depth = (end: number) => (framed && end === ground ? -1 : end);
    const [outer, inner] = depth(first) < depth(second) ? [first, second] : [second, first];
    const gap: Gap = framed
      ? [geometry.frame, geometry.lanes[0]!.outer]
      : [geometry.lanes[outer]!.inner, inner === ground ? geometry.hub : geometry.lanes[inner]!.outer];
    const element = svg("path", { class: `coupling ${coupling.kind}` });
    const group = svg("g", { class: "attached" }, element);
    this.svg.append(group);
    const draw = this.pen(coupling, gap, { element, group, outer, inner, first, second });
    // The torque is on the first end of the file.
    const sign = (first === outer ? 1 : -1) * (coupling === ofWorld ? 1 : -1);
    this.parts.push((q, torques) => {
      const given = torques[index] ?? 0;
      // A loop that diverges has no colour.
      const torque = Number.isFinite(given) ? given : 0;
      if (this.world!.limit === null) this.scale = Math.max(this.scale, Math.abs(torque));
      // The sign is that of the torque on the end at the puck's side.
      const share = ((framed ? -sign : sign) * torque) / this.scale;
      element.style.setProperty("--push", tint(share));
      attribute(element, "data-push", share.toFixed(3));
      draw(q);
    });
  }

  /** How a coupling of its kind follows its ends. */
  private pen(
    coupling: Coupling,
    gap: Gap,
    at: { element: SVGPathElement; group: SVGElement; outer: number; inner: number; first: number; second: number },
  ): (q: Float64Array) => void {
    const { element, group, outer, inner, first, second } = at;
    const geometry = this.geometry;
    // Which edge of the gap the first end has.
    const edge = first === outer ? 0 : 1;
    switch (coupling.kind) {
      case "spring":
      case "integral":
      case "dead-band": {
        const rest = coupling.rest ?? 0;
        const shift = first === outer ? rest : -rest;
        return (q) => attribute(element, "d", geometry.spring(gap, q[outer]!, q[inner]! + shift));
      }
      case "damper":
      case "assist":
      case "acceleration":
        return (q) => attribute(element, "d", geometry.damper(gap, q[outer]!, q[inner]!));
      case "wall": {
        const face = coupling.at ?? 0;
        attribute(element, "d", geometry.wall(gap, face, coupling.side === "below" ? -1 : 1));
        const nub = svg("path", { class: "nub", d: geometry.nub(gap, edge) });
        group.after(nub);
        const wall = this.away.push(null) - 1;
        return (q) => {
          const distance = face - (q[first]! - q[second]!);
          const visible = geometry.half === null || Math.abs(distance) <= geometry.half;
          attribute(group, "visibility", visible ? "visible" : "hidden");
          this.away[wall] = visible ? null : `wall ${(Math.abs(distance) / (2 * geometry.half!)).toFixed(1)} turns ${distance > 0 ? "clockwise" : "counterclockwise"}`;
          attribute(group, "transform", geometry.place(q[second]!));
          attribute(nub, "transform", geometry.place(q[first]!));
        };
      }
      case "detent": {
        const [pitch, phase] = [coupling.pitch ?? 1, coupling.phase ?? 0];
        const nub = svg("path", { class: "nub", d: geometry.nub(gap, edge) });
        group.after(nub);
        let drawn = Number.NaN;
        return (q) => {
          const nearest = Math.round((q[first]! - q[second]! - phase) / pitch);
          attribute(group, "transform", geometry.place(q[second]!));
          attribute(nub, "transform", geometry.place(q[first]!));
          if (nearest === drawn) return;
          drawn = nearest;
          const [from, to] = geometry.view(phase + nearest * pitch);
          const count = Math.min(60, Math.floor((to - from) / pitch / 2));
          let d = "";
          for (let n = nearest - count; n <= nearest + count; n++) {
            if (n === nearest + count && (to - from) / pitch === 2 * count && count > 0) break;
            d += geometry.dent(gap, phase + n * pitch, edge === 0 ? 1 : 0);
          }
          attribute(element, "d", d);
        };
      }
      case "texture": {
        // The dents are where its energy is low.
        const [pitch, phase] = [coupling.pitch ?? 1, coupling.phase ?? 0];
        const depths = coupling.depth ?? [0];
        const steps = depths.length;
        // At places that are whole steps from `phase`.
        const depth = (q: number) => {
          const step = Math.round(((q - phase) / pitch) * steps) % steps;
          return depths[step < 0 ? step + steps : step]!;
        };
        const nub = svg("path", { class: "nub", d: geometry.nub(gap, edge) });
        group.after(nub);
        let drawn = Number.NaN;
        return (q) => {
          const nearest = Math.round((q[first]! - q[second]! - phase) / pitch);
          attribute(group, "transform", geometry.place(q[second]!));
          attribute(nub, "transform", geometry.place(q[first]!));
          if (nearest === drawn) return;
          drawn = nearest;
          const [from, to] = geometry.view(phase + nearest * pitch);
          const count = Math.max(1, Math.min(40, Math.floor((to - from) / pitch / 2)));
          const positions = Array.from({ length: 2 * count * steps + 1 }, (_, i) => phase + (nearest - count + i / steps) * pitch);
          attribute(element, "d", geometry.wave(gap, positions, depth, edge === 0 ? 1 : 0));
        };
      }
      case "magnet": {
        // A dent at the position that it pulls to.
        const nub = svg("path", { class: "nub", d: geometry.nub(gap, edge) });
        group.after(nub);
        attribute(element, "d", geometry.dent(gap, coupling.at ?? 0, edge === 0 ? 1 : 0));
        return (q) => {
          attribute(group, "transform", geometry.place(q[second]!));
          attribute(nub, "transform", geometry.place(q[first]!));
        };
      }
      case "friction":
      case "constant": {
        // A shoe on the first end, opposite the marks.
        const middle = (gap[0] + gap[1]) / 2;
        const side = Math.PI * 0.75;
        const [from, to] = this.world!.motion === "rotary" ? [side - 0.16, side + 0.16] : [0.3 * this.reach, 0.42 * this.reach];
        attribute(element, "d", geometry.arc(coupling.kind === "friction" ? gap[edge] + (middle - gap[edge]) * 0.4 : middle, from, to));
        return (q) => attribute(group, "transform", geometry.place(q[coupling.kind === "friction" ? second : first]!));
      }
    }
  }
}

/** The names, marks and positions below the drawing. */
export class Legend {
  private values: HTMLElement[] = [];
  private readonly root: HTMLElement;

  constructor(root: HTMLElement) {
    this.root = root;
  }

  show(world: World): void {
    const names = ["puck", ...world.bodies.map((body) => body.name)];
    const shape = names.join(" ");
    if (this.root.dataset["shape"] === shape) return;
    this.root.dataset["shape"] = shape;
    this.values = names.map(() => html("dd"));
    this.root.replaceChildren(
      ...names.map((name, i) => html("div", {}, html("dt", { class: i === 0 ? "c0" : `c${((i - 1) % 6) + 1}` }, name), this.values[i]!)),
    );
  }

  /** Texts for puck and bodies. */
  frame(texts: string[]): void {
    texts.forEach((text, i) => this.values[i] && say(this.values[i], text));
  }
}
