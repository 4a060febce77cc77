// The messages of the websocket, version 1 (docs/live.md). Numbers are SI.

export const VERSION = 1;

export type Order = "arm" | "disarm" | "clear" | "stop";

/** Keys with their values as written, to be set together. */
export type Sets = [key: string, value: string][];

export type ToServer =
  | { type: "hello"; v: number; token?: string }
  | { type: "take" | "give" | "reset" | "restart" | "file" | "alive" }
  | { type: "order"; order: Order }
  | { type: "hand"; grip: boolean; position: number }
  | { type: "set"; key: string; value: string }
  | { type: "sets"; sets: Sets; only?: boolean }
  | { type: "enter"; world: number }
  | { type: "scenario"; name: string | null }
  | { type: "record"; on: boolean }
  | { type: "focus"; key: string }
  | ({ type: "controls" } & Controls)
  | ({ type: "network" } & NetworkChange);

export interface Coupling {
  kind: "spring" | "damper" | "wall" | "detent" | "dead-band" | "magnet" | "texture" | "friction" | "integral" | "assist" | "constant";
  between: [string, string];
  key: string;
  at?: number | null;
  side?: "above" | "below" | null;
  rest?: number | null;
  pitch?: number | null;
  phase?: number | null;
  width?: number | null;
  sine?: number[] | null;
  cosine?: number[] | null;
  torque?: number | null;
  stiffness?: number | null;
  damping?: number | null;
  velocity?: number | null;
}

/** One of the file's keys that can be changed here. `factor` is SI per `unit`; `min` and `max` are SI. */
export interface Key {
  path: string;
  /** What it belongs to: "loop", "spring, puck to wheel". */
  group?: string;
  label: string;
  /** What it means. */
  doc?: string;
  kind: "quantity" | "choice" | "whole";
  written: string;
  value?: number | null;
  unit?: string | null;
  factor?: number | null;
  min?: number | null;
  max?: number | null;
  log?: boolean | null;
  choices?: string[] | null;
  /** As the file has it; nothing in a coupling that the file does not have. */
  own?: string | null;
  changed: boolean;
  /** It can only be looked at. */
  fixed?: boolean;
}

export interface World {
  type: "world";
  generation: number;
  title: string;
  /** The worlds that can be entered, by the names of their files, and the place of this one. */
  worlds: { name: string; title: string }[];
  place: number;
  motion: "rotary" | "linear";
  units: { position: string; velocity: string; effort: string };
  period_s: number;
  /** Over which the eigenvalues of the verdict are. */
  step_s: number;
  limit: number | null;
  device: string;
  bodies: { name: string; inertia: number }[];
  couplings: Coupling[];
  scenarios: { name: string; duration_s: number; hand: string }[];
  keys: Key[];
  /** What has been set over the file. */
  changes: Sets;
  columns: { name: string; unit: string }[];
}

export interface Verdict {
  type: "verdict";
  generation: number;
  /** With a `command`, which judges it, only whether it is in a certified range; `null`: not known. */
  certified: boolean | null;
  command?: string;
  /** All of it in one. */
  sentence?: string;
  sentences: { what: "held" | "free" | "passive" | "uneven" | "quantisation"; ok: boolean | null; text: string }[];
  growth_per_s: number | null;
  /** Without the shifts, which change no torque; `null`: nothing else is there. */
  held_growth_per_s: number | null;
  free_growth_per_s: number | null;
  held: [number, number][];
  free: [number, number][];
  required_damping: number | null;
  device_damping: number;
  notes?: string[];
  /** Without sets it takes what the attached motor does not let change. */
  remedies: { sets: Sets; text: string }[] | null;
  ms: number | null;
}

export interface Range {
  type: "range";
  generation: number;
  key: string;
  certified: [number, number][];
}

export interface Quantiles {
  p50: number;
  p90: number;
  p99: number;
  p999: number;
  max: number;
}

/** Of the samples with a torque before them: how many kept the file's times, and the longest ones; `null`: the file states none. */
export interface Certified {
  samples: number;
  inside: number;
  /** From a sample to the next. */
  longest_us: number;
  interval_max_us: number | null;
  /** From a sample to its command. */
  longest_delay_us: number;
  delay_max_us: number | null;
}

export interface Punctuality {
  samples: number;
  overruns: number;
  missed: number;
  latency_us: Quantiles;
  period_us: Quantiles;
  computation_us: Quantiles;
  histogram: { edges_us: number[]; latency: number[] };
  certified: Certified | null;
}

export type Phase = "disarmed" | "fading-in" | "running" | "fading-out" | "faulted";

/** Whether a torque is possible. */
export const isLive = (phase: Phase | undefined): boolean => phase !== undefined && phase !== "disarmed" && phase !== "faulted";

export interface Status {
  type: "status";
  phase: Phase;
  code: number | null;
  reason: string | null;
  sentence: string | null;
  clear: string | null;
  warnings: string[];
  scenario: string | null;
  recording: { file: string; seconds: number; lost: number; error: string | null } | null;
  /** `null`: there is no clock to keep here. */
  timing: Punctuality | null;
  realtime: { fifo: boolean; locked: boolean; warning: string | null } | null;
  /** Where the loop is a station of one. */
  network?: Network;
  /** Where games have the device. */
  wheel?: GameWheel;
  clients: number;
}

/** The wheel that games see of the device; torques in N m: least, last and most since the status before. */
export interface GameWheel {
  attached: boolean;
  effects: { kind: string; asked: string; given: string | null }[];
  asked: [number, number, number];
  given: [number, number, number];
  limit: number;
  used: number;
  reason: string | null;
  game: GameLoop | null;
  taken: number;
  refused: number;
}

/** The loop that a game closes: its torque follows the wheel's position, late. SI units. */
export interface GameLoop {
  stiffness: number;
  stiffness_range: [number, number];
  lateness: number;
  lateness_range: [number, number];
  hold: number;
  lacking: number;
  damping: number;
  held_back: number;
  hands_off: number;
  law: string;
  oddity: string | null;
}

/** Pedals from 0 to 1, and buttons, the first in the lowest bit. */
export interface Controls {
  pedals: [number, number, number];
  buttons: number;
}

export interface Network {
  /** Whose page it is; `null`: every station's. */
  station: string | null;
  certified: boolean;
  sentence: string;
  /** The verdict is the one from before the last change, and the next is being computed. */
  outdated: boolean;
  remedies: { text: string; stiffness: number | null; age: number | null }[];
  delay_s: number;
  loss: number;
  /** Factors on the file's numbers. */
  stiffness: number;
  age: number;
  links: { from?: string; to: string; acts: boolean; age_s: number | null; age_max_s: number }[];
  warnings: string[];
}

/** What it leaves out stays. */
export type NetworkChange = Partial<Pick<Network, "delay_s" | "loss" | "stiffness" | "age">>;

export type FromServer =
  | { type: "hello"; v: number; client: number; control: number | null }
  | { type: "control"; control: number | null }
  | { type: "refused"; key?: string | null; message: string }
  | { type: "error"; message: string }
  | { type: "file"; name: string; text: string }
  | World
  | Verdict
  | Range
  | Status;

/** A binary frame: per column the last value, and the extremes since the frame before. */
export interface Frame {
  generation: number;
  time: number;
  last: Float32Array;
  low: Float32Array;
  high: Float32Array;
}

/** The columns that `world` names, in their order (crates/hapt-host/src/frames.rs); before those of the bodies, which take two each: position and velocity. */
export const COLUMN = {
  puck: 0,
  puckVelocity: 1,
  measured: 2,
  measuredVelocity: 3,
  torque: 4,
  command: 5,
  output: 6,
  energy: 7,
  bodies: 8,
} as const;

const HEADER = 16;

/** Nothing where the bytes are no frame of this version. */
export function decode(bytes: ArrayBuffer): Frame | null {
  const view = new DataView(bytes);
  if (bytes.byteLength < HEADER || view.getUint8(0) !== VERSION || view.getUint8(1) !== 1) return null;
  const columns = view.getUint16(2, true);
  if (bytes.byteLength !== HEADER + 12 * columns) return null;
  const frame: Frame = {
    generation: view.getUint32(4, true),
    time: view.getFloat64(8, true),
    last: new Float32Array(columns),
    low: new Float32Array(columns),
    high: new Float32Array(columns),
  };
  for (let i = 0; i < columns; i++) {
    frame.last[i] = view.getFloat32(HEADER + 12 * i, true);
    frame.low[i] = view.getFloat32(HEADER + 12 * i + 4, true);
    frame.high[i] = view.getFloat32(HEADER + 12 * i + 8, true);
  }
  return frame;
}
