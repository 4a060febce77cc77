// How a world is laid out: every end has a lane, and couplings stand in the gaps between lanes.
//
// In a rotary world lanes are rings about one axis, and a position is an angle, clockwise from the top. In a linear world they
// are rails above each other, and a position is a distance to the right. "Depth" runs from the outer frame (ground) past the puck and
// the bodies to the hub (ground again); it is a radius there and a height here.

/** Between two lanes: the depth of the outer lane's edge and that of the inner lane's. */
export type Gap = readonly [number, number];

export interface Lane {
  outer: number;
  inner: number;
}

export interface Geometry {
  /** Of an SVG of this world. */
  readonly viewBox: string;
  /** The puck's lane, then one a body. */
  readonly lanes: readonly Lane[];
  /** Of the frame outside the puck, and of the hub inside the last body. */
  readonly frame: number;
  readonly hub: number;
  /** The transform that moves an element from 0 to a position. */
  place(position: number): string;
  /** From the outer lane at `a` to the inner one at `b`. */
  spring(gap: Gap, a: number, b: number): string;
  /** Cylinder at `a`, piston at `b`. */
  damper(gap: Gap, a: number, b: number): string;
  /** A block that begins at `at` and reaches to the side of `sign`. */
  wall(gap: Gap, at: number, sign: 1 | -1): string;
  /** A pointer at 0 from an edge (`gap[0]`, or `gap[1]`) into the gap. */
  nub(gap: Gap, from: 0 | 1): string;
  /** A dent at a position, on the edge of `gap[1]` or `gap[0]`. */
  dent(gap: Gap, at: number, on: 0 | 1): string;
  /** A line along these positions, on the edge of `gap[1]` or `gap[0]`, as deep as dents where `depth` is 1. */
  wave(gap: Gap, positions: number[], depth: (position: number) => number, on: 0 | 1): string;
  /** A line at one depth. */
  arc(depth: number, a: number, b: number): string;
  /** A lane's outline at 0, its mark, and details that show its motion. */
  body(lane: Lane, puck: boolean): { outline: string; mark: string; detail: string };
  /** The positions that dents within one view about `position` have: from, to. */
  view(position: number): [number, number];
  /** Half of the visible range about a position; `null`: everything is visible. */
  readonly half: number | null;
  /** The frame with its scale, as a path, and its labels. */
  scale(): { ticks: string; labels: { x: number; y: number; text: string }[] };
  /** The position of a pointer at these coordinates of the viewBox, up to whole turns. */
  pointed(x: number, y: number): number;
  /** The position plus the whole turns that bring it nearest to `near`. */
  unwrap(position: number, near: number): number;
  /** The displacement of an arrow key held for a second. */
  readonly pace: number;
}

const fixed = (x: number) => String(Math.round(x * 10) / 10);

/** "M x y L x y ..." */
export function polyline(points: Iterable<readonly [number, number]>): string {
  let d = "";
  for (const [x, y] of points) d += `${d ? "L" : "M"}${fixed(x)} ${fixed(y)}`;
  return d;
}

/** Depths of n bodies' lanes between the puck's inner edge and the hub, a gap before each and one after the last. */
export function nested(count: number, from: number, to: number, widest: number): Lane[] {
  const pitch = (to - from) / (count + 0.4);
  const gap = Math.sign(pitch) * Math.min(0.42 * Math.abs(pitch), widest);
  const thick = Math.sign(pitch) * Math.min(0.56 * Math.abs(pitch), 46);
  return Array.from({ length: count }, (_, i) => {
    const outer = from + i * (gap + thick) + gap;
    return { outer, inner: outer + thick };
  });
}
