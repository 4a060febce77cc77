//! The messages of the server.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::config::WorldName;
use crate::keys::SettableKey;

/// A message of the server.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "FromServer"))]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ServerMessage {
    /// The answer to a hello.
    Hello {
        /// [`super::VERSION`].
        v: u32,
        /// The client's own number.
        client: u64,
        /// The client in control.
        control: Option<u64>,
    },
    /// Control has changed.
    Control {
        /// The client in control.
        control: Option<u64>,
    },
    /// A message was not understood, or a request cannot be fulfilled.
    Error {
        /// In a sentence.
        message: String,
    },
    /// A key was not set.
    Refused {
        /// Its dotted path, or another name of what was refused.
        key: String,
        /// In a sentence.
        message: String,
    },
    /// The world that runs.
    World(Box<WorldInfo>),
    /// The certificate.
    Verdict(Box<VerdictMessage>),
    /// The certified values of a key.
    Range {
        /// The generation of the world.
        generation: u32,
        /// The key's dotted path.
        key: String,
        /// Intervals in SI.
        certified: Vec<[f64; 2]>,
    },
    /// The world that runs, as a file.
    File {
        /// The name of its file, without folders.
        name: String,
        /// Its text.
        text: String,
    },
    /// The state of the loop.
    Status(Box<Status>),
}

impl ServerMessage {
    /// The message as JSON.
    pub fn json(&self) -> String {
        // Maps with string keys, and numbers: this does not fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// The world that runs.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "World"))]
pub struct WorldInfo {
    /// Counts the changes, from 0.
    pub generation: u32,
    /// Its title, or its file's name.
    pub title: String,
    /// The worlds that can be entered, itself among them.
    pub worlds: Vec<WorldName>,
    /// Its place among them, from 0.
    pub place: usize,
    /// `rotary` or `linear`.
    #[cfg_attr(test, ts(type = "Motion"))]
    pub motion: &'static str,
    /// The units of the telemetry.
    pub units: Units,
    /// The loop's period in s.
    pub period_s: f64,
    /// The bodies' step in s, over which the eigenvalues of the verdict are.
    pub step_s: f64,
    /// The motor's limit, in N·m (linear: N).
    pub limit: Option<f64>,
    /// The device as `--device` names it.
    pub device: String,
    /// The bodies, in file order.
    pub bodies: Vec<BodyInfo>,
    /// The couplings, in file order.
    pub couplings: Vec<CouplingInfo>,
    /// The scenarios, in file order.
    pub scenarios: Vec<ScenarioInfo>,
    /// The keys that can be set.
    pub keys: Vec<SettableKey>,
    /// The keys set over the file, in the form of `sets`.
    pub changes: Vec<(String, String)>,
    /// The columns of the telemetry.
    pub columns: Vec<ColumnInfo>,
}

/// SI units by dimension.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Units {
    /// rad or m.
    pub position: &'static str,
    /// rad/s or m/s.
    pub velocity: &'static str,
    /// N m or N.
    pub effort: &'static str,
}

/// A body.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Body"))]
pub struct BodyInfo {
    /// Its name in the file.
    pub name: String,
    /// Its inertia in kg m² (linear: kg).
    pub inertia: f64,
}

/// A coupling, as a page draws it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Coupling"))]
pub struct CouplingInfo {
    /// Its kind in the file.
    #[cfg_attr(test, ts(type = "Kind"))]
    pub kind: &'static str,
    /// The names of its ends.
    pub between: [String; 2],
    /// Its table in the file: `couplings.0`.
    pub key: String,
    /// The numbers of its law.
    #[serde(flatten)]
    pub numbers: LawNumbers,
    /// Of a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional, type = "Side"))]
    pub side: Option<&'static str>,
    /// Of a texture: how low its stored energy is at equal intervals of one pitch from `phase` on, from 0 (highest) to 1 (lowest).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub depth: Option<Vec<f64>>,
}

/// Numbers of a law in SI, by the names of their keys.
#[derive(Clone, Debug, Serialize)]
#[serde(transparent)]
pub struct LawNumbers(pub BTreeMap<&'static str, f64>);

/// A scenario.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Scenario"))]
pub struct ScenarioInfo {
    /// Its name in the file.
    pub name: String,
    /// Its duration in s.
    pub duration_s: f64,
    /// The hand's kind.
    pub hand: &'static str,
}

/// A column of the telemetry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Column"))]
pub struct ColumnInfo {
    /// The name in the CSV, where the CSV has the column.
    pub name: String,
    /// The unit as it is written.
    pub unit: &'static str,
}

/// The certificate of one generation.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Verdict"))]
pub struct VerdictMessage {
    /// The generation of the world.
    pub generation: u32,
    /// Whether the loop is stable held and free, and passive.
    pub certified: bool,
    /// The verdict in one sentence.
    pub sentence: String,
    /// One sentence for each claim.
    pub sentences: Vec<Sentence>,
    /// The larger growth of the held world and the free loop, per s.
    pub growth_per_s: Option<f64>,
    /// The growth of the held world, per s; `None`: nothing in it moves, or only shifts that change no torque.
    pub held_growth_per_s: Option<f64>,
    /// The growth of the free loop, per s; `None`: likewise.
    pub free_growth_per_s: Option<f64>,
    /// The eigenvalues with the puck held.
    pub held: Vec<[f64; 2]>,
    /// The eigenvalues with the puck free.
    pub free: Vec<[f64; 2]>,
    /// The device damping that makes the loop passive, in SI.
    pub required_damping: Option<f64>,
    /// The device's damping, in SI.
    pub device_damping: f64,
    /// The claims that are not proved, and notes on the numbers.
    pub notes: Vec<String>,
    /// Changes that would certify the world, or its margins; `None`: not yet computed.
    pub remedies: Option<Vec<RemedyInfo>>,
    /// The time of the computation in ms; `None`: it was computed before.
    pub ms: Option<f64>,
}

/// One claim of the certificate.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Sentence {
    /// `held`, `free`, `passive`, `uneven` or `quantisation`.
    #[cfg_attr(test, ts(type = "\"held\" | \"free\" | \"passive\" | \"uneven\" | \"quantisation\""))]
    pub what: &'static str,
    /// Whether the claim holds; `None`: marginal, or not proved.
    pub ok: Option<bool>,
    /// The sentence.
    pub text: String,
}

/// A change that would certify the loop.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Remedy"))]
pub struct RemedyInfo {
    /// Keys with their values as written, to be set together; empty where a coupling is to be added.
    pub sets: Vec<(String, String)>,
    /// Lines for the world file.
    pub text: String,
}

/// The state of the loop.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Status {
    /// `disarmed`, `fading-in`, `running`, `fading-out` or `faulted`.
    #[cfg_attr(test, ts(type = "Phase"))]
    pub phase: &'static str,
    /// The code of the reason of a fault.
    pub code: Option<u8>,
    /// The name of the reason.
    pub reason: Option<&'static str>,
    /// What happened.
    pub sentence: Option<String>,
    /// How to clear it.
    pub clear: Option<String>,
    /// Warnings: conditions that are no fault.
    pub warnings: Vec<String>,
    /// The scenario that runs.
    pub scenario: Option<String>,
    /// The present recording, or the failure of the last one.
    pub recording: Option<RecordingInfo>,
    /// The timing of a loop on this computer.
    pub timing: Option<TimingInfo>,
    /// The scheduling that the system grants its thread.
    pub realtime: Option<Realtime>,
    /// The network of which the loop is a station.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub network: Option<NetworkInfo>,
    /// The device as a game wheel.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub wheel: Option<WheelInfo>,
    /// The number of pages connected.
    pub clients: usize,
}

/// A device as a game wheel, since the last of these messages. Torques in N·m, on the puck.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "GameWheel"))]
pub struct WheelInfo {
    /// Whether it is attached to the computer.
    pub attached: bool,
    /// The effects that play.
    pub effects: Vec<EffectInfo>,
    /// The requested torque: smallest, last, largest.
    pub asked: [f64; 3],
    /// The given torque: smallest, last, largest.
    pub given: [f64; 3],
    /// The largest torque.
    pub limit: f64,
    /// The part of the device's damping for effects that is in use, 0 to 1.
    pub used: f64,
    /// The reason that less is given than requested.
    pub reason: Option<&'static str>,
    /// The loop that the game closes over the wheel, once it is estimated.
    pub game: Option<GameInfo>,
    /// Reports of the computer that were taken.
    pub taken: u64,
    /// And refused.
    pub refused: u64,
}

/// The loop that a game closes: its torque follows the wheel's position with a delay.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "GameLoop"))]
pub struct GameInfo {
    /// N·m/rad, positive where the torque pulls back.
    pub stiffness: f64,
    /// Least and most.
    pub stiffness_range: [f64; 2],
    /// From a position to the level that belongs to it, s.
    pub lateness: f64,
    /// Least and most.
    pub lateness_range: [f64; 2],
    /// From one level to the next, s.
    pub hold: f64,
    /// The damping that it lacks hands-off, N·m·s/rad.
    pub lacking: f64,
    /// The part of it that is added now.
    pub damping: f64,
    /// The part of the level that is held back now, 0 to 1.
    pub held_back: f64,
    /// The part of the remedy that the damping of the hands does not supply, 0 to 1.
    pub hands_off: f64,
    /// The law in a sentence.
    pub law: String,
    /// A peculiarity of it, in a sentence.
    pub oddity: Option<&'static str>,
}

/// An effect that plays.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Effect"))]
pub struct EffectInfo {
    /// `spring`, `damper`, `friction`, `inertia` or `torque`.
    pub kind: &'static str,
    /// The request, with units.
    pub asked: String,
    /// The given value, where it is less.
    pub given: Option<String>,
}

/// The network of which a loop is a station.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Network"))]
pub struct NetworkInfo {
    /// The station's name.
    pub station: String,
    /// Whether the whole network is certified.
    pub certified: bool,
    /// The verdict.
    pub sentence: String,
    /// Whether the verdict is from before the last change: the next one is being computed.
    pub outdated: bool,
    /// Changes that would make it certified.
    pub remedies: Vec<NetworkRemedy>,
    /// The delay of a message, s.
    pub delay_s: f64,
    /// The part of the messages that is lost.
    pub loss: f64,
    /// A factor on the file's stiffness of every link.
    pub stiffness: f64,
    /// A factor on the file's `age_max` of every link.
    pub age: f64,
    /// This station's links.
    pub links: Vec<LinkInfo>,
    /// Warnings: it is not certified, or a link of this station has released.
    pub warnings: Vec<String>,
}

/// A change that makes a network certified.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct NetworkRemedy {
    /// The change in words.
    pub text: String,
    /// As in [`super::NetworkChange`].
    pub stiffness: Option<f64>,
    /// As in [`super::NetworkChange`].
    pub age: Option<f64>,
}

/// A link at its station.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Link"))]
pub struct LinkInfo {
    /// The station at the other end.
    pub to: String,
    /// Whether its torque acts.
    pub acts: bool,
    /// The age of the other's position at the end of the hold, s; `None`: there is none.
    pub age_s: Option<f64>,
    /// The largest age at which it acts, s.
    pub age_max_s: f64,
}

/// A recording.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Recording"))]
pub struct RecordingInfo {
    /// The file.
    pub file: String,
    /// Its length in s.
    pub seconds: f64,
    /// Samples lost for lack of room.
    pub lost: u64,
    /// The error that ended it.
    pub error: Option<String>,
}

/// The loop's timing, since it began.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Punctuality"))]
pub struct TimingInfo {
    /// Samples taken.
    pub samples: u64,
    /// Samples whose command came after the next sample was due.
    pub overruns: u64,
    /// Samples missed.
    pub missed: u64,
    /// From a sample's instant to its start.
    pub latency_us: Quantiles,
    /// From one sample to the next.
    pub period_us: Quantiles,
    /// From its start to the command.
    pub computation_us: Quantiles,
    /// The histogram of the latency.
    pub histogram: Bars,
    /// Whether the loop kept the times of its certificate; null where the file states none.
    pub certified: Option<CertifiedInfo>,
}

/// The times of the certificate, and the number of samples that kept them, of those with a torque before them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Certified"))]
pub struct CertifiedInfo {
    /// The samples.
    pub samples: u64,
    /// The samples that were in time and followed a command in time.
    pub inside: u64,
    /// The longest time from a sample to the next.
    pub longest_us: f64,
    /// The longest that the certificate covers; null where the file states none.
    pub interval_max_us: Option<f64>,
    /// The longest time from a sample to the completed write to the device.
    pub longest_delay_us: f64,
    /// The longest that the certificate covers; null where the file states none.
    pub delay_max_us: Option<f64>,
}

/// Quantiles in µs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Quantiles {
    /// 50 %.
    pub p50: f64,
    /// 90 %.
    pub p90: f64,
    /// 99 %.
    pub p99: f64,
    /// 99.9 %.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

/// A histogram: edges, and one count fewer.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Bars {
    /// In µs, ascending.
    pub edges_us: Vec<f64>,
    /// The number of samples between each two edges.
    pub latency: Vec<u64>,
}

/// The scheduling that the system grants the loop's thread.
#[derive(Clone, Debug, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Realtime {
    /// Whether it runs under SCHED_FIFO.
    pub fifo: bool,
    /// Whether its memory is locked.
    pub locked: bool,
    /// The setting that was not granted, and the remedy.
    pub warning: Option<String>,
}
