// All keys of the file in groups: the loop, each coupling, each body, the device.

import { html } from "./dom.ts";
import { Knob, type Sink } from "./knob.ts";
import type { Key, Range, World } from "./protocol.ts";

export class Knobs {
  private knobs = new Map<string, Knob>();
  private ranges = new Map<string, [number, number][]>();
  private values = new Map<string, string>();
  private shape: string | undefined;
  private readonly root: HTMLElement;
  private readonly sink: Sink;

  constructor(root: HTMLElement, sink: Sink) {
    this.root = root;
    this.sink = sink;
  }

  show(all: World): void {
    const world = { ...all, keys: all.keys.filter((key) => !key.fixed) };
    const shape = world.keys.map((key) => `${key.path} ${key.kind}`).join("\n");
    if (shape !== this.shape) this.build(world);
    this.shape = shape;
    this.forget(world.keys);
    for (const key of world.keys) this.knobs.get(key.path)?.show(key);
  }

  range({ key, certified }: Range): void {
    this.ranges.set(key, certified);
    this.knobs.get(key)?.range(certified);
  }

  /** Shows a refusal at its key; returns whether the key has a slider here. */
  refused(key: string, message: string): boolean {
    const knob = this.knobs.get(key);
    knob?.refuse(message);
    return knob !== undefined;
  }

  /** A certified range holds while every other key stays. */
  private forget(keys: Key[]): void {
    const changed = keys.filter((key) => this.values.get(key.path) !== key.written).map((key) => key.path);
    for (const key of keys) this.values.set(key.path, key.written);
    for (const path of [...this.ranges.keys()]) {
      if (changed.every((other) => other === path)) continue;
      this.ranges.delete(path);
      this.knobs.get(path)?.range(null);
    }
  }

  private build(world: World): void {
    if (world.keys.length === 0) {
      this.root.replaceChildren(html("p", { class: "soft" }, "This world stays as it is while it runs; --set changes it at the start."));
      return;
    }
    this.knobs = new Map(world.keys.map((key) => [key.path, new Knob(key, this.sink)]));
    const groups = new Map<string, Knob[]>();
    for (const key of world.keys) {
      // By the path up to the name: two springs between the same ends are two groups.
      const group = key.path.slice(0, key.path.lastIndexOf("."));
      groups.set(group, [...(groups.get(group) ?? []), this.knobs.get(key.path)!]);
    }
    // The keys that are changed most come first; the device comes last, folded.
    const rank = (group: string) => ["loop", "couplings", "compensation", "bodies", "device"].indexOf(group.split(".")[0]!);
    const ordered = [...groups].sort(([a], [b]) => rank(a) - rank(b));
    this.root.replaceChildren(
      ...ordered.map(([group, knobs], i) => {
        const inner = html("div", { class: "knobs" }, ...knobs.map((knob) => knob.root));
        return html("details", { open: i < 3 && group !== "device" }, html("summary", {}, world.keys.find((key) => key.path.startsWith(`${group}.`))?.group ?? group), inner);
      }),
    );
  }
}
