// The protocol between page and loop (docs/live.md): messages, and frames of telemetry. Numbers are SI.

import type { FromServer, Link, Network, Verdict } from "./messages.ts";

export type * from "./messages.ts";

export const VERSION = 1;

export type Range = Extract<FromServer, { type: "range" }>;

/** A verdict; where there is no server, of a changed world only whether it is in a certified range (`null`: not known), and the command that judges it. */
export type Judged = Omit<Verdict, "certified"> & { certified: boolean | null; command?: string };

/** What a page gets: of a server, or of the program that it has in place of one. */
export type Message = Exclude<FromServer, { type: "verdict" }> | ({ type: "verdict" } & Judged);

/** A station's network, or that of all stations together, each link with the station that it is of. */
export type Stations = Omit<Network, "station" | "links"> & { station: string | null; links: (Link & { from?: string })[] };

/** Keys with their values as written, to be set together. */
export type Sets = [key: string, value: string][];

/** A binary frame: per column the last value, and the extremes since the frame before. */
export interface Frame {
  generation: number;
  time: number;
  last: Float32Array;
  low: Float32Array;
  high: Float32Array;
}

/** The columns that `world` names, in their order (crates/hapt-host/src/frames.rs); before those of the bodies, two each, position and velocity, and of the couplings, each its torque on its first end. */
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
