// The page without a server: the same messages, answered by hapt's own session as WebAssembly.

import { quoted } from "./changes.ts";
import type { Listener, Peer } from "./link.ts";
import { decode, type Frame, type FromServer, type Key, type ToServer, type Verdict, type World } from "./protocol.ts";

/** What `hapt report` writes for this page, as `window.hapt`. */
export interface Recorded {
  /** The program, in base64. */
  core: string;
  /** The world's text and the files that it names, as the program reads them. */
  world: unknown;
  verdict: { type: "verdict" } & Verdict;
  /** By key, the intervals in SI in which the world is certified while all other keys have the file's values. */
  ranges: Record<string, [number, number][]>;
  /** The world's name on the command line, with what was set there, and the report's file; `null`: under a cell of a notebook. */
  place: { command: string; report: string } | null;
}

/** The functions of web/core. */
interface Core extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  room(length: number): number;
  load(): number;
  network(): number;
  send(station: number): void;
  poll(now: number): void;
  next(station: number): number;
  message(): number;
  length(): number;
}

/** What {@link Core.next} gives. */
const [TEXT, FRAME] = [1, 2];

/** hapt's own core in this page, with a world that runs, or a network of stations; a world is station 0. */
export class Program {
  private readonly core: Core;

  /** `core`: the program in base64. */
  constructor(core: string, kind: "load" | "network", file: unknown) {
    const program = Uint8Array.from(atob(core), (letter) => letter.charCodeAt(0));
    // Small enough to be compiled at once.
    this.core = new WebAssembly.Instance(new WebAssembly.Module(program)).exports as Core;
    this.write(file);
    if (this.core[kind]() === 0) throw new Error(new TextDecoder().decode(this.message()));
  }

  /** Takes the samples that are due at `now`, in ms. */
  poll(now: number): void {
    this.core.poll(now);
  }

  send(station: number, message: ToServer): void {
    this.write(message);
    this.core.send(station);
  }

  /** Passes the program's next messages for a station to its page. */
  listen(station: number, message: (message: FromServer) => void, frame: (frame: Frame) => void): void {
    for (let kind = this.core.next(station); kind !== 0; kind = this.core.next(station)) {
      const bytes = this.message();
      if (kind === TEXT) message(JSON.parse(new TextDecoder().decode(bytes)) as FromServer);
      const next = kind === FRAME ? decode(bytes.buffer) : null;
      if (next) frame(next);
    }
  }

  private write(message: unknown): void {
    const text = new TextEncoder().encode(JSON.stringify(message));
    const room = this.core.room(text.length);
    // A new view each time: memory that grows moves.
    new Uint8Array(this.core.memory.buffer, room, text.length).set(text);
  }

  /** A copy of the program's message. */
  private message(): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.core.memory.buffer, this.core.message(), this.core.length()).slice();
  }
}

/** Whether the one key that has been changed is in its certified range; `null` where that is not known. */
function inside(changed: Key[], ranges: Recorded["ranges"]): boolean | null {
  const [key, ...others] = changed;
  const { min, max, value } = key ?? {};
  const range = key && ranges[key.path];
  if (!range || others.length > 0 || typeof value !== "number" || value < (min ?? value) * (1 - 1e-9) || value > (max ?? value) * (1 + 1e-9)) return null;
  return range.some(([from, to]) => from <= value && value <= to);
}

export class Local implements Peer {
  readonly up = true;
  private readonly program: Program;
  private readonly listener: Listener;
  private readonly recorded: Recorded;

  constructor(listener: Listener, recorded: Recorded) {
    this.listener = listener;
    this.recorded = recorded;
    this.program = new Program(recorded.core, "load", recorded.world);
    // Deferred until the page has set its handlers.
    queueMicrotask(() => {
      listener.connection(true, null);
      this.listen();
    });
    requestAnimationFrame((now) => this.frame(now));
  }

  now(): void {}

  send(message: ToServer): boolean {
    this.program.send(0, message);
    this.listen();
    return true;
  }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    this.program.poll(now);
    this.listen();
  }

  private listen(): void {
    this.program.listen(0, (message) => this.tell(message), (frame) => this.listener.frame(frame));
  }

  private tell(message: FromServer): void {
    this.listener.message(message);
    if (message.type === "world") this.judge(message);
  }

  /** The verdict on a changed world: the file's certificate; where one key has been changed, its certified range; and the command that makes
   * another certificate. */
  private judge({ generation, keys }: World): void {
    const { verdict, place, ranges } = this.recorded;
    const changed = keys.filter((key) => key.changed);
    const sets = changed.map(({ path, written }) => (place ? ` --set ${quoted(`${path}=${written}`)}` : `.set(${JSON.stringify(path)}, ${JSON.stringify(written)})`));
    const judge = { certified: inside(changed, ranges), command: place ? `hapt check ${place.command}${sets.join("")}` : `world${sets.join("")}.check()` };
    this.listener.message({ ...verdict, ...(changed.length > 0 ? judge : {}), generation });
    for (const [key, certified] of Object.entries(ranges)) {
      if (changed.every(({ path }) => path === key)) this.listener.message({ type: "range", generation, key, certified });
    }
  }
}
