// Which signals stand in which plot.

import type { Panel } from "./plots.ts";
import { COLUMN, type World } from "./protocol.ts";
import type { Units } from "./units.ts";

export function panels(world: World, units: Units): Panel[] {
  const moving = (shift: 0 | 1) => [
    { name: "puck", column: COLUMN.puck + shift, colour: "c0" },
    ...world.bodies.map(({ name }, i) => ({ name, column: COLUMN.bodies + 2 * i + shift, colour: `c${(i % 6) + 1}` })),
  ];
  const limit = world.limit === null ? [] : [world.limit * units.effort.per, -world.limit * units.effort.per];
  return [
    { title: "position", unit: units.position, traces: moving(0), lines: [], least: 1 },
    { title: "velocity", unit: units.velocity, traces: moving(1), lines: [], least: 5 },
    {
      title: units.what,
      unit: units.effort,
      traces: [
        { name: "world", column: COLUMN.torque, colour: "c0" },
        { name: "motor", column: COLUMN.output, colour: "c1", dash: [6, 3] },
      ],
      lines: limit,
      least: 0.02 * (limit[0] ?? 1),
    },
    { title: "energy", unit: units.energy, traces: [{ name: "world", column: COLUMN.energy, colour: "c2" }], lines: [], least: 0.5, scales: true },
  ];
}

/** What each column of the frames is shown as, per SI unit. */
export function factors(world: World, units: Units): number[] {
  const { position, velocity, effort, energy } = units;
  const signals = [position, velocity, position, velocity, effort, effort, effort, energy].map((unit) => unit.per);
  const known = [...signals, ...world.bodies.flatMap(() => [position.per, velocity.per])];
  // Then the couplings' torques.
  return world.columns.map((_, i) => known[i] ?? effort.per);
}
