// What a coupling pushes with, for its colour alone: the loop's own torque comes from the server.

import type { Coupling } from "./protocol.ts";

/** The same coupling with ground as its second end, where ground is the first: q and the torque change their signs. */
export function grounded(coupling: Coupling): Coupling {
  if (coupling.between[0] !== "ground") return coupling;
  const { kind, between, side, at, rest, phase, torque } = coupling;
  return {
    ...coupling,
    between: [between[1], between[0]],
    side: side === "below" ? "above" : "below",
    at: -(at ?? 0),
    rest: -(rest ?? 0),
    phase: -(phase ?? 0),
    torque: kind === "constant" ? -(torque ?? 0) : (torque ?? 0),
  };
}

/** On the first end, for q = first - second and its velocity; SI. Laws with a memory are shown by their sign. */
export function push(coupling: Coupling, q: number, velocity: number): number {
  const stiffness = coupling.stiffness ?? 0;
  const damping = coupling.damping ?? 0;
  const torque = coupling.torque ?? 0;
  switch (coupling.kind) {
    case "spring":
      return -stiffness * (q - (coupling.rest ?? 0));
    case "damper":
      return -damping * velocity;
    case "wall": {
      const sign = coupling.side === "below" ? -1 : 1;
      const depth = sign * (q - (coupling.at ?? 0));
      return depth > 0 ? -sign * Math.max(0, stiffness * depth + damping * sign * velocity) : 0;
    }
    case "detent":
      return coupling.pitch ? -torque * Math.sin((2 * Math.PI * (q - (coupling.phase ?? 0))) / coupling.pitch) : 0;
    case "dead-band": {
      const x = q - (coupling.rest ?? 0);
      return -stiffness * Math.sign(x) * Math.max(0, Math.abs(x) - (coupling.width ?? 0));
    }
    case "magnet": {
      const x = coupling.width ? (q - (coupling.at ?? 0)) / coupling.width : 0;
      return -torque * x * Math.exp((1 - x * x) / 2);
    }
    case "friction":
      return -torque * Math.tanh(100 * velocity);
    case "constant":
      return torque;
  }
}

/** From purple (pushes back) past grey to green (pushes on); `share` of the largest, from -1 to 1. */
export function tint(share: number): string {
  const part = Math.round(100 * Math.min(1, Math.sqrt(Math.abs(share))));
  return `color-mix(in oklab, var(--${share < 0 ? "minus" : "plus"}) ${part}%, var(--slack))`;
}
