// A linear world: handle and bodies on rails above each other, positions to the right.

import { nested, polyline, type Geometry, type Lane } from "./geometry.ts";
import { number } from "./units.ts";

const HALF = 205;
const PUCK: Lane = { outer: -92, inner: -40 };
const FRAME = -132;
const HUB = 132;
const COILS = 7;

/** `reach`: the length that the rail shows on each side of 0, in m. */
export function linear(bodies: number, reach: number): Geometry {
  const lanes = [PUCK, ...nested(bodies, PUCK.inner, HUB, 56)];
  const x = (position: number) => Math.max(-400, Math.min(400, (position / reach) * HALF));
  const box = (left: number, right: number, top: number, bottom: number) =>
    `${polyline([[left, top], [right, top], [right, bottom], [left, bottom]])}Z`;
  return {
    viewBox: "-254 -160 508 320",
    lanes,
    frame: FRAME,
    hub: HUB,
    pace: reach / 2,
    place: (position) => `translate(${x(position).toFixed(2)} 0)`,
    spring([outer, inner], a, b) {
      const [from, to] = [x(a), x(b)];
      const [dx, dy] = [to - from, inner - outer];
      const length = Math.hypot(dx, dy) || 1;
      const [nx, ny] = [(-dy / length) * 7, (dx / length) * 7];
      const points: [number, number][] = [[from, outer]];
      for (let i = 0; i <= 2 * COILS; i++) {
        const part = 0.12 + (0.76 * i) / (2 * COILS);
        const side = i === 0 || i === 2 * COILS ? 0 : i % 2 ? 1 : -1;
        points.push([from + dx * part + nx * side, outer + dy * part + ny * side]);
      }
      return polyline([...points, [to, inner]]);
    },
    damper([outer, inner], a, b) {
      const middle = (outer + inner) / 2;
      const [base, half, reach] = [x(a) + 46, Math.min(6, Math.abs(inner - outer) * 0.28), 30];
      const plate = base + Math.max(-reach + 4, Math.min(reach - 4, x(b) - x(a)));
      return (
        polyline([[base + reach, middle - half], [base - reach, middle - half], [base - reach, middle + half], [base + reach, middle + half]]) +
        polyline([[base - reach, outer], [base - reach, middle]]) +
        polyline([[plate, middle - half + 1], [plate, middle + half - 1]]) +
        polyline([[plate, middle], [plate + reach + 8, middle], [plate + reach + 8, inner]])
      );
    },
    wall: ([outer, inner], at, sign) => box(x(at), x(at) + sign * 34, Math.min(outer, inner) + 1, Math.max(outer, inner) - 1),
    nub(gap, from) {
      const [edge, tip] = [gap[from], gap[from] + (gap[1 - from]! - gap[from]) * 0.66];
      return `${polyline([[-6, edge], [0, tip], [6, edge]])}Z`;
    },
    dent(gap, at, on) {
      const [edge, tip] = [gap[on], gap[on] + (gap[1 - on]! - gap[on]) * 0.42];
      return polyline([[x(at) - 6, edge], [x(at), tip], [x(at) + 6, edge]]);
    },
    wave(gap, positions, depth, on) {
      const reach = (gap[1 - on]! - gap[on]) * 0.42;
      return polyline(positions.map((position): [number, number] => [x(position), gap[on] + reach * depth(position)]));
    },
    arc: (depth, a, b) => polyline([[x(a), depth], [x(b), depth]]),
    body({ outer, inner }, puck) {
      const half = puck ? 34 : 40;
      const grooves = [-20, -14, -8, 8, 14, 20].map((g) => polyline([[g, outer + 10], [g, inner - 10]]));
      return {
        outline: box(-half, half, outer, inner),
        mark: box(-2.5, 2.5, outer + 1.5, inner - 1.5),
        detail: puck ? grooves.join("") : "",
      };
    },
    half: null,
    view: (position) => [position - 2 * reach, position + 2 * reach],
    scale() {
      let ticks = polyline([[-250, FRAME], [250, FRAME]]);
      const labels = [];
      for (let i = -10; i <= 10; i++) {
        const [place, long] = [(i / 10) * HALF, i % 5 === 0 ? 9 : 5];
        ticks += polyline([[place, FRAME], [place, FRAME - long]]);
        if (i % 5 === 0) labels.push({ x: place, y: FRAME - 17, text: `${number((i / 10) * reach * 1000)} mm` });
      }
      ticks += polyline([[-250, HUB], [250, HUB]]);
      for (let place = -250; place < 250; place += 12) ticks += polyline([[place, HUB + 9], [place + 9, HUB]]);
      // The rails.
      for (const lane of lanes) ticks += polyline([[-250, lane.inner], [250, lane.inner]]);
      return { ticks, labels };
    },
    pointed: (place) => (place / HALF) * reach,
    unwrap: (position) => position,
  };
}

/** 1, 2 or 5 times a power of ten, at least `value`. */
export function roundUp(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([1, 2, 5, 10].find((n) => n * power >= value * (1 - 1e-9)) ?? 10);
}
