// The bar at the top: phase, faults, control, recording, connection.

import { overrides } from "./changes.ts";
import { byId, say } from "./dom.ts";
import type { Key, Sets, Status, World } from "./protocol.ts";
import { micros, number, plain, pretty } from "./units.ts";

export const PHASES = { disarmed: "Disarmed", "fading-in": "Fading in", running: "Running", "fading-out": "Fading out", faulted: "Fault" };

export interface Desk {
  /** Whether there is a connection. */
  up: boolean;
  /** Whether there was a connection, or the first attempt has failed. */
  lost: boolean;
  /** Whether this page has control. */
  mine: boolean;
  /** The number of the visitor who has control. */
  control: number | null;
  status: Status | null;
  world: World | null;
}

const UNEVEN = 17;
const STOPPED = 1;
/** The factor from measured times to times that are set. */
const ROOM = 1.25;

/** The times that the certificate would have to cover for this computer to keep them: those measured and a quarter more; empty where it keeps them.
 * `settable`: whether this page can set them; a motor's, and those under a game's wheel, stay as its file has them. */
export function lateness({ status, world }: Desk): { sets: Sets; measured: number[]; settable: boolean } {
  const certified = status?.timing?.certified;
  const late = [
    { path: "loop.interval_max", longest: certified?.longest_us ?? 0, most: certified?.interval_max_us ?? Infinity },
    { path: "loop.delay_max", longest: certified?.longest_delay_us ?? 0, most: certified?.delay_max_us ?? Infinity },
  ].flatMap(({ path, longest, most }) => {
    const key = world?.keys.find((key) => key.path === path);
    return key && longest > most ? [{ key, longest }] : [];
  });
  const written = (key: Key, us: number): [string, string] => [key.path, `${plain((1e-6 * ROOM * us) / (key.factor ?? 1), 3)} ${key.unit ?? "s"}`];
  return {
    sets: late.map(({ key, longest }) => written(key, longest)),
    measured: late.map(({ longest }) => longest),
    settable: late.every(({ key }) => !key.fixed),
  };
}

export function showBar(desk: Desk): void {
  const { up, mine, control, status, world } = desk;
  const able = up && mine;
  const phase = up ? status?.phase : undefined;
  const pill = byId("phase");
  pill.dataset["phase"] = phase ?? "off";
  say(pill, phase ? PHASES[phase] : desk.lost ? "Not connected" : "Connecting");
  for (const [id, on] of [
    ["arm", phase === "disarmed"],
    ["disarm", phase === "running" || phase === "fading-in"],
    ["restart", phase !== undefined],
    ["record", phase !== undefined],
    ["clear", phase === "faulted"],
    ["reset", true],
  ] as const) {
    byId<HTMLButtonElement>(id).disabled = !able || !on;
  }
  byId<HTMLFieldSetElement>("knobs").disabled = !able;
  for (const button of document.querySelectorAll<HTMLButtonElement>("#scenarios button, button.remedy")) button.disabled = !able;
  byId("stage").setAttribute("aria-disabled", String(!able));

  const watching = byId("watching");
  watching.hidden = !up || mine;
  if (!watching.hidden) say(byId("watching-text"), control === null ? "You are watching; no visitor has control." : `You are watching; visitor ${control} has control.`);

  // A loop that has faded out by itself has a reason too, up to the next arming.
  const fault = byId("fault");
  fault.hidden = phase === undefined || (phase !== "faulted" && status?.code == null);
  byId("clear").hidden = phase !== "faulted";
  if (status && phase && !fault.hidden) {
    const what = status.code === null ? PHASES[phase] : `${PHASES[phase]} ${status.code}`;
    say(byId("fault-name"), `${what}${status.reason ? ` (${status.reason})` : ""}:`);
    say(byId("fault-text"), status.sentence ?? "");
    // A loop in the page has no stop switch, so there is no hint to release it.
    const isOwn = status.code === STOPPED && world?.device === "sim";
    say(byId("fault-clear"), isOwn ? "Clear it, then arm." : (status.clear ?? ""));
  }
  const { sets, measured, settable } = lateness(desk);
  const meets = status?.code === UNEVEN && sets.length > 0;
  byId("meet").hidden = !meets || !settable;
  byId<HTMLButtonElement>("meet").disabled = !able;
  say(byId("meet"), `Certify ${sets.map(([key, value]) => `${key.replace("loop.", "")} ${pretty(value)}`).join(", ")} (${measured.map(micros).join(" and ")} measured)`);
  byId("meet-command").hidden = !meets || settable;
  say(byId("meet-command"), `${measured.map(micros).join(" and ")} measured; the page cannot change it here: start with ${overrides(sets)}`);
  const warnings = byId("warnings");
  const texts = up && status ? [...status.warnings, ...(status.network?.warnings ?? [])] : [];
  warnings.hidden = texts.length === 0;
  if (warnings.dataset["shown"] !== texts.join("\n")) {
    warnings.dataset["shown"] = texts.join("\n");
    warnings.querySelector("ul")?.replaceChildren(...texts.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  }
  showRecording(up ? (status?.recording ?? null) : null);
  for (const button of document.querySelectorAll<HTMLButtonElement>("#scenarios button")) {
    const on = up && button.dataset["name"] === status?.scenario;
    button.setAttribute("aria-pressed", String(on));
  }
}

/** The current recording, or the last one. */
let kept: NonNullable<Status["recording"]> | null = null;

function showRecording(recording: Status["recording"]): void {
  const button = byId<HTMLButtonElement>("record");
  button.setAttribute("aria-pressed", String(recording !== null && recording.error === null));
  say(button, recording && !recording.error ? "Stop recording" : "Record");
  kept = recording ?? kept;
  const line = byId("recording");
  line.hidden = kept === null;
  if (!kept) return;
  const lost = kept.lost > 0 ? `, ${kept.lost} samples lost` : "";
  line.classList.toggle("refusal", Boolean(kept.error || kept.lost));
  say(byId("recording-text"), kept.error ?? `${recording ? "Recording" : "Recorded"} ${number(kept.seconds, 3)} s${lost}:`);
  say(byId("recording-file"), kept.error ? "" : kept.file);
  byId("copy").hidden = recording !== null || kept.error !== null || !("clipboard" in navigator);
}
