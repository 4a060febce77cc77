// Numbers as text for display.

import type { World } from "./protocol.ts";

/** What a signal is shown in: `per` is how many of it one SI unit is. */
export interface Unit {
  name: string;
  per: number;
}

export interface Units {
  position: Unit;
  velocity: Unit;
  effort: Unit;
  energy: Unit;
  /** What pushes: a torque, or a force. */
  what: "torque" | "force";
}

const DEGREES = 180 / Math.PI;

/** Degrees or millimetres; the effort in the unit of the file's limit, where it has one. */
export function units(world: World): Units {
  const rotary = world.motion === "rotary";
  const limit = world.keys.find((key) => key.path === "device.limit");
  const effort =
    limit?.unit && limit.factor
      ? { name: limit.unit, per: 1 / limit.factor }
      : rotary
        ? { name: "N mm", per: 1000 }
        : { name: "N", per: 1 };
  return {
    position: rotary ? { name: "°", per: DEGREES } : { name: "mm", per: 1000 },
    velocity: rotary ? { name: "°/s", per: DEGREES } : { name: "mm/s", per: 1000 },
    effort: { ...effort, name: pretty(effort.name) },
    energy: { name: "mJ", per: 1000 },
    what: rotary ? "torque" : "force",
  };
}

const PREFIXES = ["p", "n", "µ", "m", "", "k", "M", "G", "T"];
/** An axis label of this many characters fits. */
const WIDEST = 7;

/** An energy's unit in which `largest`, in mJ, has one to three digits before its point; `per` is how many of it 1 mJ is. */
export function joules(largest: number): Unit {
  const steps = largest > 0 && Number.isFinite(largest) ? Math.floor(Math.log10(largest) / 3 + 1e-9) : 0;
  const place = Math.min(PREFIXES.length - 1, Math.max(0, PREFIXES.indexOf("m") + steps));
  return { name: `${PREFIXES[place]}J`, per: 1000 ** (PREFIXES.indexOf("m") - place) };
}

/** A number that an axis has room for. */
export function tick(value: number): string {
  const text = String(Number(value.toPrecision(6)));
  return (text.length <= WIDEST ? text : value.toExponential(2).replace(/\.?0+e/, "e").replace("e+", "e")).replace(/-/g, "−");
}

/** "N mm/deg" as "N·mm/°", with a number before it or without. */
export function pretty(unit: string): string {
  return unit.replace(/\bdeg\b/g, "°").replace(/\bum\b/g, "µm").replace(/\bus\b/g, "µs").replace(/\^2/g, "²").replace(/(?<!\d) /g, "·");
}

/** To so many significant digits, without an exponent where that is short, with a true minus. */
export function number(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "no number" : value > 0 ? "∞" : "−∞";
  return plain(value, digits).replace(/-/g, "−");
}

/** The same as a program reads it. */
export function plain(value: number, digits: number): string {
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size < -4 || size > 6) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  const places = Math.min(12, Math.max(0, digits - 1 - size));
  const fixed = value.toFixed(places);
  return places > 0 ? fixed.replace(/\.?0+$/, "") : fixed;
}

/** "0.45031637174372346 N m" as "0.450316 N m": six digits of a number that has more. */
export function brief(written: string): string {
  return written.replace(/^[-+]?[\d.]+(?:[eE][-+]?\d+)?/, (text) => (text.replace(/[eE].*|\D|^0+/g, "").length > 6 && Number.isFinite(Number(text)) ? plain(Number(text), 6) : text));
}

/** With as many decimals as `scale` needs, so that the text does not jitter. */
export function steady(value: number, scale: number): string {
  if (Math.abs(value) >= 1e7) return number(value);
  const places = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(Math.max(scale, 1e-9)))));
  const text = value.toFixed(Number.isFinite(value) ? places : 0);
  return (/^-0\.?0*$/.test(text) ? text.slice(1) : text).replace("-", "−");
}

export function micros(us: number): string {
  if (us >= 1e6) return `${number(us / 1e6)} s`;
  return us >= 1000 ? `${number(us / 1000)} ms` : `${number(us)} µs`;
}
