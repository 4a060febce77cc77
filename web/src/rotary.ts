// A rotary world: rings about one axis, angles clockwise from the top.

import { nested, polyline, type Geometry, type Lane } from "./geometry.ts";

const TURN = 2 * Math.PI;
const FRAME = 230;
const PUCK: Lane = { outer: 202, inner: 166 };
const HUB = 16;
const NOTCHES = 40;
/** The windings of a spring at rest. */
const WINDINGS = 3;

const at = (radius: number, angle: number): [number, number] => [radius * Math.sin(angle), -radius * Math.cos(angle)];

function* sweep(radius: (part: number) => number, from: number, to: number, step = 0.09): Generator<[number, number]> {
  const steps = Math.min(400, Math.max(1, Math.ceil(Math.abs(to - from) / step)));
  for (let i = 0; i <= steps; i++) yield at(radius(i / steps), from + ((to - from) * i) / steps);
}

const ring = (radius: number) => polyline(sweep(() => radius, 0, TURN, 0.05)) + "Z";

/** Part of a ring between two radii and two angles. */
function sector(r: number, R: number, from: number, to: number): string {
  return polyline([...sweep(() => r, from, to), ...sweep(() => R, to, from)]) + "Z";
}

function rim(): string {
  const depth = (part: number) => PUCK.outer - 3.5 * (0.5 - 0.5 * Math.cos(part * NOTCHES * TURN)) ** 3;
  return polyline(sweep(depth, 0, TURN, TURN / NOTCHES / 9)) + "Z";
}

export function rotary(bodies: number): Geometry {
  const lanes = [PUCK, ...nested(bodies, PUCK.inner, HUB, 40)];
  return {
    viewBox: "-268 -268 536 536",
    lanes,
    frame: FRAME,
    hub: HUB,
    pace: TURN / 3,
    place: (position) => `rotate(${((position * 360) / TURN).toFixed(2)})`,
    spring([outer, inner], a, b) {
      // A spiral spring, wound tighter or looser as it is twisted; many turns are drawn as few.
      const twist = Math.max(-WINDINGS + 0.25, Math.min(6, (b - a) / TURN)) * TURN;
      const [from, to] = [outer - Math.sign(outer - inner) * 2, inner + Math.sign(outer - inner) * 2];
      const end = b - (WINDINGS * TURN + twist);
      const pin = (radius: number, angle: number) => polyline(sweep(() => radius, angle - 1.2 / radius, angle + 1.2 / radius));
      return pin(from, end) + polyline(sweep((part) => from + (to - from) * part, end, b, 0.08)) + pin(to, b);
    },
    damper([outer, inner], a, b) {
      const [middle, half] = [(outer + inner) / 2, Math.min(Math.abs(outer - inner) * 0.26, 7)];
      const [low, high] = [middle - half, middle + half];
      const [base, reach] = [a + Math.PI, 0.42];
      const plate = base + Math.max(-reach + 0.06, Math.min(reach - 0.06, b - a));
      const cylinder = polyline([...sweep(() => low, base + reach, base - reach), ...sweep(() => high, base - reach, base + reach)]);
      const foot = polyline([at(outer, base - reach * 0.9), at(middle, base - reach)]);
      const rod = polyline([...sweep(() => middle, plate, plate + reach * 1.5), at(inner, plate + reach * 1.5)]);
      return cylinder + foot + rod + polyline([at(low + 1.5, plate), at(high - 1.5, plate)]);
    },
    wall: ([outer, inner], start, sign) => sector(Math.min(outer, inner) + 1, Math.max(outer, inner) - 1, start, start + sign * 0.4),
    nub(gap, from) {
      const [edge, tip] = [gap[from], gap[from] + (gap[1 - from]! - gap[from]) * 0.66];
      return polyline([at(edge, -0.035), at(tip, 0), at(edge, 0.035)]) + "Z";
    },
    dent(gap, position, on) {
      const [edge, tip] = [gap[on], gap[on] + (gap[1 - on]! - gap[on]) * 0.42];
      return polyline([at(edge, position - 0.04), at(tip, position), at(edge, position + 0.04)]);
    },
    wave(gap, positions, depth, on) {
      const reach = (gap[1 - on]! - gap[on]) * 0.42;
      return polyline(positions.map((position) => at(gap[on] + reach * depth(position), position)));
    },
    arc: (depth, a, b) => polyline(sweep(() => depth, a, Math.max(a - TURN, Math.min(a + TURN, b)))),
    body({ outer, inner }, puck) {
      const thick = outer - inner;
      const middle = (outer + inner) / 2;
      const holes = Array.from({ length: 5 }, (_, i) => {
        const centre = (i + 0.5) * (TURN / 5);
        const span = Math.min(0.36, 0.3 + 4 / middle);
        return sector(middle - thick * 0.24, middle + thick * 0.24, centre - span, centre + span);
      });
      const grooves = Array.from({ length: NOTCHES }, (_, i) => {
        const angle = ((i + 0.5) * TURN) / NOTCHES;
        return polyline([at(outer - 5, angle), at(outer - 11, angle)]);
      });
      const width = Math.min(0.045, 5 / middle);
      return {
        outline: (puck ? rim() : ring(outer)) + ring(inner),
        mark: sector(inner + 1.5, outer - 1.5, -width, width),
        detail: puck ? grooves.join("") : thick > 10 ? holes.join("") : "",
      };
    },
    half: Math.PI,
    view: (position) => [position - Math.PI, position + Math.PI],
    scale() {
      let ticks = "";
      const labels = [];
      for (let degrees = -180; degrees < 180; degrees += 5) {
        const angle = (degrees * TURN) / 360;
        const long = degrees % 45 === 0 ? 9 : degrees % 15 === 0 ? 6 : 3;
        ticks += polyline([at(FRAME, angle), at(FRAME + long, angle)]);
        if (degrees % 45 === 0 && degrees !== -180) {
          const [x, y] = at(FRAME + 22, angle);
          // At ±90° the number fits only above its tick.
          labels.push({ x, y: Math.abs(degrees) === 90 ? y - 14 : y, text: `${degrees}°`.replace("-", "−") });
        }
      }
      return { ticks: ring(FRAME) + ticks, labels };
    },
    pointed: (x, y) => Math.atan2(x, -y),
    unwrap: (position, near) => position + TURN * Math.round((near - position) / TURN),
  };
}
