// The page without a server: the same messages, answered by hapt's own core as WebAssembly.

import type { Listener, Peer } from "./link.ts";
import { COLUMN, VERSION, type Frame, type Key, type Phase, type Sets, type Status, type ToServer, type Verdict, type World } from "./protocol.ts";

/** What `hapt report` writes beside the page, as `window.hapt`. */
export interface Recorded {
  /** In base64: the program, a world's bytes, its setup's. */
  core: string;
  bytes: string;
  setup: string;
  world: World;
  verdict: Verdict;
  /** By key, what can be changed here: the core's number for it, of which coupling or body, and the number for a word in its place. */
  slots: Record<string, [number, number, number | null]>;
  /** By key, where it is certified while every other stays as in the file, in SI. */
  ranges: Record<string, [number, number][]>;
  /** The supervisor's reasons by their codes. */
  reasons: Record<number, { name: string; sentence: string; clear: string }>;
  /** The visitor's hand. */
  grip: { inertia: number; damping: number; stiffness: number };
  /** What the world is called on the command line, with what was set there. */
  command: string;
  /** The report's file. */
  report: string;
}

/** The functions of web/core. */
interface Core extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  room(length: number): number;
  load(world: number): number;
  run(samples: number): void;
  frame(): number;
  columns(): number;
  order(code: number): void;
  phase(): number;
  output(): number;
  hold(inertia: number, damping: number, stiffness: number): void;
  intend(position: number): void;
  release(): void;
  restart(): void;
  begin(scenario: number): number;
  held(): number;
  set(slot: number, index: number, value: number): number;
}

const PHASES: Phase[] = ["disarmed", "fading-in", "running", "fading-out", "faulted"];
const ORDERS = ["", "arm", "disarm", "stop", "clear"];
const CLIENT = 1;
/** What a frame that comes late catches up at most, and after how long the page was asleep, so that the hand lets go; in s. */
const LONGEST = 0.1;
const ASLEEP = 0.3;
/** From one status to the next, when nothing happens, in ms. */
const STATUS = 200;

const bytes = (text: string): Uint8Array<ArrayBuffer> => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** A number of the core's, of which coupling or body, and what it is to be. */
type Told = [slot: number, index: number, value: number];

/** As a shell takes it. */
const quoted = (word: string) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`);

/** Whether the one key that has been changed is in its certified range; `null` where nobody knows. */
function inside(changed: Key[], ranges: Recorded["ranges"]): boolean | null {
  const [key, ...others] = changed;
  const { min, max, value } = key ?? {};
  const range = key && ranges[key.path];
  if (!range || others.length > 0 || typeof value !== "number" || value < (min ?? value) * (1 - 1e-9) || value > (max ?? value) * (1 + 1e-9)) return null;
  return range.some(([from, to]) => from <= value && value <= to);
}

export class Local implements Peer {
  readonly up = true;
  private readonly core: Core;
  private readonly listener: Listener;
  private readonly recorded: Recorded;
  private world: World;
  private holding = false;
  private scenario: string | null = null;
  private last: number | null = null;
  private due = 0;
  private time = 0;
  private told = 0;
  private phase = -1;

  constructor(listener: Listener, recorded: Recorded) {
    this.listener = listener;
    this.recorded = recorded;
    this.world = this.asWritten();
    // Small enough to be compiled at once.
    this.core = new WebAssembly.Instance(new WebAssembly.Module(bytes(recorded.core))).exports as Core;
    this.load();
    // When the page has wired what listens.
    queueMicrotask(() => {
      listener.connection(true, null);
      listener.message({ type: "hello", v: VERSION, client: CLIENT, control: CLIENT });
      this.tell();
    });
    requestAnimationFrame((now) => this.frame(now));
  }

  now(): void {}

  send(message: ToServer): boolean {
    switch (message.type) {
      case "order":
        this.core.order(ORDERS.indexOf(message.order));
        break;
      case "hand":
        this.hand(message.grip, message.position);
        break;
      case "scenario":
        this.begin(message.name);
        break;
      case "set":
        this.set([[message.key, message.value]]);
        break;
      case "sets":
        this.set(message.sets);
        break;
      case "restart":
        this.core.restart();
        [this.holding, this.scenario] = [false, null];
        this.core.order(ORDERS.indexOf("arm"));
        break;
      case "reset":
        this.reset();
        break;
    }
    return true;
  }

  /** The world as the file has it; the keys that only a server can change are fixed. */
  private asWritten(generation = 0): World {
    const { world, slots } = this.recorded;
    const keys = world.keys.map((key) => ({ ...key, fixed: !(key.path in slots) }));
    return { ...structuredClone(world), keys, generation };
  }

  private load(): void {
    const [world, setup] = [bytes(this.recorded.bytes), bytes(this.recorded.setup)];
    const room = this.core.room(world.length + setup.length);
    const view = new Uint8Array(this.core.memory.buffer, room, world.length + setup.length);
    view.set(world);
    view.set(setup, world.length);
    if (this.core.load(world.length) < 0) throw new Error("the page's world and its core are of different versions");
    this.core.order(ORDERS.indexOf("arm"));
  }

  private hand(grip: boolean, position: number): void {
    if (grip && !this.holding) {
      const { inertia, damping, stiffness } = this.recorded.grip;
      this.core.hold(inertia, damping, stiffness);
      this.scenario = null;
    }
    if (!grip && this.holding) this.core.release();
    if (grip) this.core.intend(position);
    this.holding = grip;
  }

  private begin(name: string | null): void {
    const index = this.world.scenarios.findIndex((scenario) => scenario.name === name);
    this.core.release();
    this.holding = false;
    this.scenario = index >= 0 && this.core.begin(index) ? name : null;
  }

  /** All of them, or none. */
  private set(sets: Sets): void {
    const numbers = sets.map(([path, value]) => this.number(path, value.trim()));
    const refused = numbers.findIndex((number) => typeof number === "string");
    if (refused >= 0) return this.refuse(sets[refused]![0], numbers[refused] as string);
    const failed = numbers.findIndex((number) => !this.core.set(...(number as Told)));
    if (failed >= 0) {
      // Those before it are as they were.
      for (const [path] of sets.slice(0, failed)) this.core.set(...(this.number(path, this.key(path)!.written) as Told));
      return this.refuse(sets[failed]![0], `This loop cannot take ${sets[failed]![1]}.`);
    }
    this.world = { ...this.world, generation: this.world.generation + 1, keys: this.world.keys.map((key) => ({ ...key })), couplings: this.world.couplings.map((coupling) => ({ ...coupling })) };
    for (const [i, [path, value]] of sets.entries()) {
      const key = this.key(path)!;
      const isNumber = !key.choices?.includes(value.trim());
      this.write(path, value.trim(), isNumber ? (numbers[i] as Told)[2] : null);
    }
    this.follow();
    // A method may have brought its output along.
    const output = this.key("loop.output")?.choices?.[this.core.output()];
    if (output) this.write("loop.output", output, null);
    this.tell();
  }

  /** A delay in samples is as long as the period makes it. */
  private follow(): void {
    const delay = this.key("loop.delay");
    if (!delay || !/^samples?$/.test(delay.unit ?? "") || delay.factor === this.world.period_s) return;
    delay.factor = this.world.period_s;
    const told = this.number(delay.path, delay.written);
    if (typeof told === "string") return;
    delay.value = told[2];
    this.core.set(...told);
  }

  private key(path: string): Key | undefined {
    return this.world.keys.find((key) => key.path === path);
  }

  /** What the core is told, or why it is not. */
  private number(path: string, value: string): Told | string {
    const key = this.key(path);
    const slot = this.recorded.slots[path];
    if (!key || !slot) return "Only `hapt live` can change this one.";
    const [number, index, word] = slot;
    const choice = key.choices?.indexOf(value) ?? -1;
    if (choice >= 0 && key.kind === "choice") return [number, index, choice];
    if (choice >= 0 && word !== null) return [word, index, 0];
    const [, digits, unit] = /^([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*)$/.exec(value) ?? [];
    const si = Number(digits) * (key.factor ?? 1);
    if (key.kind === "quantity" && unit === key.unit && Number.isFinite(si)) return [number, index, si];
    return key.unit ? `Without a server this takes a number and ${key.unit}, and no other unit.` : `This takes ${key.choices?.join(", ")}.`;
  }

  /** What has been set, where the page looks for it. */
  private write(path: string, written: string, value: number | null): void {
    const key = this.world.keys.find((key) => key.path === path);
    if (!key) return;
    const own = this.recorded.world.keys.find((key) => key.path === path);
    Object.assign(key, { written, value, changed: written !== own?.written });
    const [, index, name] = /^couplings\.(\d+)\.(\w+)$/.exec(path) ?? [];
    if (name) Object.assign(this.world.couplings[Number(index)]!, { [name]: value });
    if (path === "loop.period" && value !== null) this.world.period_s = value;
  }

  private reset(): void {
    this.world = this.asWritten(this.world.generation + 1);
    this.load();
    this.holding = false;
    this.scenario = null;
    this.tell();
  }

  private refuse(key: string, message: string): void {
    this.listener.message({ type: "refused", key, message });
  }

  /** The world, and what is known of it: the file's certificate; where one key has been changed, its certified range; and the command that
   * makes another certificate. */
  private tell(): void {
    const { generation, keys } = this.world;
    const { verdict, command, ranges } = this.recorded;
    const changed = keys.filter((key) => key.changed);
    this.listener.message(this.world);
    const sets = changed.map((key) => ` --set ${quoted(`${key.path}=${key.written}`)}`);
    const judge = { certified: inside(changed, ranges), command: `hapt check ${command}${sets.join("")}` };
    this.listener.message({ ...verdict, ...(changed.length > 0 ? judge : {}), generation });
    for (const [key, certified] of Object.entries(ranges)) {
      if (changed.every(({ path }) => path === key)) this.listener.message({ type: "range", generation, key, certified });
    }
  }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const passed = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    if (passed > ASLEEP) this.begin(null);
    const period = this.world.period_s;
    this.due += Math.min(passed, LONGEST);
    const samples = Math.floor(this.due / period);
    if (samples > 0) {
      this.core.run(samples);
      this.due -= samples * period;
      this.time += samples * period;
      this.listener.frame(this.seen());
    }
    const phase = this.core.phase();
    if (phase === this.phase && now - this.told < STATUS) return;
    [this.phase, this.told] = [phase, now];
    if (this.scenario !== null && !this.core.held()) this.scenario = null;
    this.listener.message(this.status());
  }

  private seen(): Frame {
    const room = this.core.columns();
    // Anew each time: memory that grows moves.
    const all = new Float64Array(this.core.memory.buffer, this.core.frame(), 3 * room);
    const columns = COLUMN.bodies + 2 * this.world.bodies.length;
    const part = (row: number) => Float32Array.from(all.subarray(row * room, row * room + columns));
    return { generation: this.world.generation, time: this.time, last: part(0), low: part(1), high: part(2) };
  }

  private status(): Status {
    const [phase, code, warning] = [this.phase & 255, (this.phase >> 8) & 255, this.phase >> 16];
    const { reasons } = this.recorded;
    const reason = reasons[code];
    return {
      type: "status",
      phase: PHASES[phase] ?? "faulted",
      code: code || null,
      reason: reason?.name ?? null,
      sentence: reason?.sentence ?? null,
      clear: reason?.clear ?? null,
      warnings: reasons[warning] ? [`On a real device it would have faulted. ${reasons[warning].sentence}`] : [],
      scenario: this.scenario,
      recording: null,
      timing: null,
      realtime: null,
      clients: 1,
    };
  }
}
