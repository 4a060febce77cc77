// A coupling's torque, only for its colour: the loop's torque comes from the server.

import type { Coupling } from "./protocol.ts";

/** The same coupling with ground as its second end, where ground is the first: q and the torque change their signs. */
export function grounded(coupling: Coupling): Coupling {
  if (coupling.between[0] !== "ground") return coupling;
  const { kind, between, side, at, rest, phase, torque, cosine } = coupling;
  return {
    ...coupling,
    between: [between[1], between[0]],
    side: side === "below" ? "above" : "below",
    at: -(at ?? 0),
    rest: -(rest ?? 0),
    phase: -(phase ?? 0),
    torque: kind === "constant" ? -(torque ?? 0) : (torque ?? 0),
    // Its torque is odd in its sines, and even in its cosines.
    ...(cosine && { cosine: cosine.map((factor) => -factor) }),
  };
}

/** On the first end, for q = first - second and its velocity; SI. Laws with a memory are shown by their sign. */
export function push(coupling: Coupling, q: number, velocity: number): number {
  const stiffness = coupling.stiffness ?? 0;
  const damping = coupling.damping ?? 0;
  const torque = coupling.torque ?? 0;
  switch (coupling.kind) {
    case "spring":
    case "integral":
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
    case "texture":
      return torque * harmonics(coupling, q).reduce((sum, { sin, cos, sine, cosine }) => sum + sine * sin + cosine * cos, 0);
    case "friction":
      return -torque * Math.tanh(100 * velocity);
    case "assist":
      return coupling.velocity ? torque * Math.max(-1, Math.min(1, velocity / coupling.velocity)) : 0;
    case "constant":
      return torque;
  }
}

/** A texture's harmonics at q: n, sine and cosine of nθ, and their factors. */
function harmonics(coupling: Coupling, q: number): { n: number; sin: number; cos: number; sine: number; cosine: number }[] {
  const angle = coupling.pitch ? (2 * Math.PI * (q - (coupling.phase ?? 0))) / coupling.pitch : 0;
  return (coupling.sine ?? []).map((sine, i) => {
    const n = i + 1;
    return { n, sin: Math.sin(n * angle), cos: Math.cos(n * angle), sine, cosine: coupling.cosine?.[i] ?? 0 };
  });
}

/** What a texture stores at q, in parts of torque · pitch/2π, up to a constant. */
export function energy(coupling: Coupling, q: number): number {
  return harmonics(coupling, q).reduce((sum, { n, sin, cos, sine, cosine }) => sum + (sine * cos - cosine * sin) / n, 0);
}

/** From purple (pushes back) past grey to green (pushes on); `share` of the largest, from -1 to 1. */
export function tint(share: number): string {
  const part = Math.round(100 * Math.min(1, Math.sqrt(Math.abs(share))));
  return `color-mix(in oklab, var(--${share < 0 ? "minus" : "plus"}) ${part}%, var(--slack))`;
}
