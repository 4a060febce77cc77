// The messages of the websocket, version 1 (docs/live.md). Numbers are SI.
// Made from crates/hapt-host/src/messages: HAPT_BLESS=1 cargo test -p hapt-host --lib typescript

export type Phase = "disarmed" | "fading-in" | "running" | "fading-out" | "faulted";
export type Motion = "rotary" | "linear";
export type Side = "above" | "below";
export type Kind = "spring" | "damper" | "wall" | "detent" | "dead-band" | "magnet" | "texture" | "friction" | "integral" | "assist" | "acceleration" | "constant";
export type LawNumber = "at" | "bristle_damping" | "bristle_stiffness" | "coulomb" | "cutoff" | "damping" | "inertia" | "limit" | "phase" | "pitch" | "rest" | "stiffness" | "stribeck" | "stribeck_velocity" | "time" | "torque" | "velocity" | "viscous" | "width";

/** A histogram: edges, and one count fewer. */
export type Bars = {
/** In µs, ascending. */
edges_us: Array<number>,
/** The number of samples between each two edges. */
latency: Array<number>, };

/** A body. */
export type Body = {
/** Its name in the file. */
name: string,
/** Its inertia in kg m² (linear: kg). */
inertia: number, };

/** The times of the certificate, and the number of samples that kept them, of those with a torque before them. */
export type Certified = {
/** The samples. */
samples: number,
/** The samples that were in time and followed a command in time. */
inside: number,
/** The longest time from a sample to the next. */
longest_us: number,
/** The longest that the certificate covers; null where the file states none. */
interval_max_us: number | null,
/** The longest time from a sample to the completed write to the device. */
longest_delay_us: number,
/** The longest that the certificate covers; null where the file states none. */
delay_max_us: number | null, };

/** A column of the telemetry. */
export type Column = {
/** The name in the CSV, where the CSV has the column. */
name: string,
/** The unit as it is written. */
unit: string, };

/** The pedals and buttons of a wheel for games. */
export type Controls = {
/** Throttle, brake and clutch, 0 to 1. */
pedals: [number, number, number],
/** The first in the lowest bit. */
buttons: number, };

/** A coupling, as a page draws it. */
export type Coupling = {
/** Its kind in the file. */
kind: Kind,
/** The names of its ends. */
between: [string, string],
/** Its table in the file: `couplings.0`. */
key: string,
/** Of a wall. */
side?: Side,
/** Of a texture: how low its stored energy is at equal intervals of one pitch from `phase` on, from 0 (highest) to 1 (lowest). */
depth?: Array<number>, } & Partial<Record<LawNumber, number>>;

/** An effect that plays. */
export type Effect = {
/** `spring`, `damper`, `friction`, `inertia` or `torque`. */
kind: string,
/** The request, with units. */
asked: string,
/** The given value, where it is less. */
given: string | null, };

/** A message of the server. */
export type FromServer = { "type": "hello",
/** [`super::VERSION`]. */
v: number,
/** The client's own number. */
client: number,
/** The client in control. */
control: number | null, } | { "type": "control",
/** The client in control. */
control: number | null, } | { "type": "error",
/** In a sentence. */
message: string, } | { "type": "refused",
/** Its dotted path, or another name of what was refused. */
key: string,
/** In a sentence. */
message: string, } | { "type": "world" } & World | { "type": "verdict" } & Verdict | { "type": "range",
/** The generation of the world. */
generation: number,
/** The key's dotted path. */
key: string,
/** Intervals in SI. */
certified: Array<[number, number]>, } | { "type": "file",
/** The name of its file, without folders. */
name: string,
/** Its text. */
text: string, } | { "type": "status" } & Status;

/** The loop that a game closes: its torque follows the wheel's position with a delay. */
export type GameLoop = {
/** N·m/rad, positive where the torque pulls back. */
stiffness: number,
/** Least and most. */
stiffness_range: [number, number],
/** From a position to the level that belongs to it, s. */
lateness: number,
/** Least and most. */
lateness_range: [number, number],
/** From one level to the next, s. */
hold: number,
/** The damping that it lacks hands-off, N·m·s/rad. */
lacking: number,
/** The part of it that is added now. */
damping: number,
/** The part of the level that is held back now, 0 to 1. */
held_back: number,
/** The part of the remedy that the damping of the hands does not supply, 0 to 1. */
hands_off: number,
/** The law in a sentence. */
law: string,
/** A peculiarity of it, in a sentence. */
oddity: string | null, };

/** A device as a game wheel, since the last of these messages. Torques in N·m, on the puck. */
export type GameWheel = {
/** Whether it is attached to the computer. */
attached: boolean,
/** The effects that play. */
effects: Array<Effect>,
/** The requested torque: smallest, last, largest. */
asked: [number, number, number],
/** The given torque: smallest, last, largest. */
given: [number, number, number],
/** The largest torque. */
limit: number,
/** The part of the device's damping for effects that is in use, 0 to 1. */
used: number,
/** The reason that less is given than requested. */
reason: string | null,
/** The loop that the game closes over the wheel, once it is estimated. */
game: GameLoop | null,
/** Reports of the computer that were taken. */
taken: number,
/** And refused. */
refused: number, };

/** A key that can be set while the loop runs. Serialised, it is part of the page's protocol (docs/live.md). */
export type Key = {
/** Dotted: `couplings.0.stiffness`. */
path: string,
/** What it belongs to: `loop`, `spring, puck to wheel`. */
group: string,
/** Its name for display. */
label: string,
/** What it means. */
doc: string,
/** `quantity`, `choice` or `whole`. */
kind: "quantity" | "choice" | "whole",
/** The value as written in the file or set. */
written: string,
/** The value in SI; `None` for a choice and for a compensating damper. */
value: number | null,
/** The unit in which it is written. */
unit: string,
/** The size of that unit in SI. */
factor: number,
/** The lower end of a slider, in SI. */
min: number,
/** The upper end of a slider, in SI. */
max: number,
/** Whether the slider is logarithmic. */
log: boolean,
/** The names that it takes. */
choices: Array<string>,
/** The value as the file has it; `None` in a coupling that the file does not have. */
own: string | null,
/** Whether it differs from the file. */
changed: boolean,
/** Whether it cannot be set with the attached motor. */
fixed: boolean, };

/** A link at its station. */
export type Link = {
/** The station at the other end. */
to: string,
/** Whether its torque acts. */
acts: boolean,
/** The age of the other's position at the end of the hold, s; `None`: there is none. */
age_s: number | null,
/** The largest age at which it acts, s. */
age_max_s: number, };

/** The network of which a loop is a station. */
export type Network = {
/** The station's name. */
station: string,
/** Whether the whole network is certified. */
certified: boolean,
/** The verdict. */
sentence: string,
/** Whether the verdict is from before the last change: the next one is being computed. */
outdated: boolean,
/** Changes that would make it certified. */
remedies: Array<NetworkRemedy>,
/** The delay of a message, s. */
delay_s: number,
/** The part of the messages that is lost. */
loss: number,
/** A factor on the file's stiffness of every link. */
stiffness: number,
/** A factor on the file's `age_max` of every link. */
age: number,
/** This station's links. */
links: Array<Link>,
/** Warnings: it is not certified, or a link of this station has released. */
warnings: Array<string>, };

/** A change of a simulated network, for all of its links. Omitted numbers stay. */
export type NetworkChange = {
/** The delay of a message, 0 to 1 s. */
delay_s?: number,
/** The part of the messages that is lost, 0 to 1. */
loss?: number,
/** A factor on the file's stiffness, 0.001 to 10. */
stiffness?: number,
/** A factor on the file's `age_max`, 0.001 to 100. */
age?: number, };

/** A change that makes a network certified. */
export type NetworkRemedy = {
/** The change in words. */
text: string,
/** As in [`super::NetworkChange`]. */
stiffness: number | null,
/** As in [`super::NetworkChange`]. */
age: number | null, };

/** A command to the supervisor. */
export type Order = "arm" | "disarm" | "stop" | "clear";

/** The loop's timing, since it began. */
export type Punctuality = {
/** Samples taken. */
samples: number,
/** Samples whose command came after the next sample was due. */
overruns: number,
/** Samples missed. */
missed: number,
/** From a sample's instant to its start. */
latency_us: Quantiles,
/** From one sample to the next. */
period_us: Quantiles,
/** From its start to the command. */
computation_us: Quantiles,
/** The histogram of the latency. */
histogram: Bars,
/** Whether the loop kept the times of its certificate; null where the file states none. */
certified: Certified | null, };

/** Quantiles in µs. */
export type Quantiles = {
/** 50 %. */
p50: number,
/** 90 %. */
p90: number,
/** 99 %. */
p99: number,
/** 99.9 %. */
p999: number,
/** The largest. */
max: number, };

/** The scheduling that the system grants the loop's thread. */
export type Realtime = {
/** Whether it runs under SCHED_FIFO. */
fifo: boolean,
/** Whether its memory is locked. */
locked: boolean,
/** The setting that was not granted, and the remedy. */
warning: string | null, };

/** A recording. */
export type Recording = {
/** The file. */
file: string,
/** Its length in s. */
seconds: number,
/** Samples lost for lack of room. */
lost: number,
/** The error that ended it. */
error: string | null, };

/** A change that would certify the loop. */
export type Remedy = {
/** Keys with their values as written, to be set together; empty where a coupling is to be added. */
sets: Array<[string, string]>,
/** Lines for the world file. */
text: string, };

/** A scenario. */
export type Scenario = {
/** Its name in the file. */
name: string,
/** Its duration in s. */
duration_s: number,
/** The hand's kind. */
hand: string, };

/** One claim of the certificate. */
export type Sentence = {
/** `held`, `free`, `passive`, `uneven` or `quantisation`. */
what: "held" | "free" | "passive" | "uneven" | "quantisation",
/** Whether the claim holds; `None`: marginal, or not proved. */
ok: boolean | null,
/** The sentence. */
text: string, };

/** The state of the loop. */
export type Status = {
/** `disarmed`, `fading-in`, `running`, `fading-out` or `faulted`. */
phase: Phase,
/** The code of the reason of a fault. */
code: number | null,
/** The name of the reason. */
reason: string | null,
/** What happened. */
sentence: string | null,
/** How to clear it. */
clear: string | null,
/** Warnings: conditions that are no fault. */
warnings: Array<string>,
/** The scenario that runs. */
scenario: string | null,
/** The present recording, or the failure of the last one. */
recording: Recording | null,
/** The timing of a loop on this computer. */
timing: Punctuality | null,
/** The scheduling that the system grants its thread. */
realtime: Realtime | null,
/** The network of which the loop is a station. */
network?: Network,
/** The device as a game wheel. */
wheel?: GameWheel,
/** The number of pages connected. */
clients: number, };

/** A message of a page. */
export type ToServer = { "type": "hello",
/** [`VERSION`]. */
v: number,
/** From the link's fragment. */
token?: string, } | { "type": "take" } | { "type": "give" } | { "type": "order",
/** The command. */
order: Order, } | { "type": "hand",
/** Whether the hand holds the puck. */
grip: boolean,
/** Its position in rad (linear: m); required with the grip. */
position: number, } | { "type": "set",
/** Its dotted path. */
key: string,
/** As it would stand in the world file: `20 N mm/deg`. */
value: string, } | { "type": "sets",
/** Keys with values, as in `Set`. */
sets: Array<[string, string]>,
/** Whether every other key goes back to the file's value. */
only?: boolean, } | { "type": "file" } | { "type": "reset" } | { "type": "enter",
/** Its place, from 0. */
world: number, } | { "type": "restart" } | { "type": "scenario",
/** Its name. Only `null` ends a scenario, and no misspelt field. */
name: string | null, } | { "type": "record",
/** Whether to record. */
on: boolean, } | { "type": "focus",
/** Its dotted path. */
key: string, } | { "type": "network" } & NetworkChange | { "type": "controls" } & Controls | { "type": "alive" };

/** SI units by dimension. */
export type Units = {
/** rad or m. */
position: string,
/** rad/s or m/s. */
velocity: string,
/** N m or N. */
effort: string, };

/** The certificate of one generation. */
export type Verdict = {
/** The generation of the world. */
generation: number,
/** Whether the loop is stable held and free, and passive. */
certified: boolean,
/** The verdict in one sentence. */
sentence: string,
/** One sentence for each claim. */
sentences: Array<Sentence>,
/** The larger growth of the held world and the free loop, per s. */
growth_per_s: number | null,
/** The growth of the held world, per s; `None`: nothing in it moves, or only shifts that change no torque. */
held_growth_per_s: number | null,
/** The growth of the free loop, per s; `None`: likewise. */
free_growth_per_s: number | null,
/** The eigenvalues with the puck held. */
held: Array<[number, number]>,
/** The eigenvalues with the puck free. */
free: Array<[number, number]>,
/** The device damping that makes the loop passive, in SI. */
required_damping: number | null,
/** The device's damping, in SI. */
device_damping: number,
/** The claims that are not proved, and notes on the numbers. */
notes: Array<string>,
/** Changes that would certify the world, or its margins; `None`: not yet computed. */
remedies: Array<Remedy> | null,
/** The time of the computation in ms; `None`: it was computed before. */
ms: number | null, };

/** The world that runs. */
export type World = {
/** Counts the changes, from 0. */
generation: number,
/** Its title, or its file's name. */
title: string,
/** The worlds that can be entered, itself among them. */
worlds: Array<WorldName>,
/** Its place among them, from 0. */
place: number,
/** `rotary` or `linear`. */
motion: Motion,
/** The units of the telemetry. */
units: Units,
/** The loop's period in s. */
period_s: number,
/** The bodies' step in s, over which the eigenvalues of the verdict are. */
step_s: number,
/** The motor's limit, in N·m (linear: N). */
limit: number | null,
/** The device as `--device` names it. */
device: string,
/** The bodies, in file order. */
bodies: Array<Body>,
/** The couplings, in file order. */
couplings: Array<Coupling>,
/** The scenarios, in file order. */
scenarios: Array<Scenario>,
/** The keys that can be set. */
keys: Array<Key>,
/** The keys set over the file, in the form of `sets`. */
changes: Array<[string, string]>,
/** The columns of the telemetry. */
columns: Array<Column>, };

/** One of the worlds of a session. */
export type WorldName = {
/** Its file's, without folders and ending. */
name: string,
/** Its title, or its file's name. */
title: string, };
