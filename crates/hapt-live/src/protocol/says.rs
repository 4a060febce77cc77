//! What the server says.

use serde::Serialize;

/// What the server says.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Says {
    /// The answer to a hello.
    Hello {
        /// [`super::VERSION`].
        v: u32,
        /// The client's own number.
        client: u64,
        /// Who has control.
        control: Option<u64>,
    },
    /// Control has gone to another.
    Control {
        /// Who has it.
        control: Option<u64>,
    },
    /// Something was not understood, or cannot be done.
    Error {
        /// In a sentence.
        message: String,
    },
    /// A key was not set.
    Refused {
        /// Its dotted path, or what else was asked for.
        key: String,
        /// The reader's own words.
        message: String,
    },
    /// The world as it runs.
    World(Box<WorldSays>),
    /// The certificate.
    Verdict(Box<Verdict>),
    /// Where a key's numbers are certified.
    Range {
        /// Of this generation.
        generation: u32,
        /// The key.
        key: String,
        /// Intervals in SI.
        certified: Vec<[f64; 2]>,
    },
    /// How the loop goes.
    Status(Box<Status>),
}

impl Says {
    /// As it goes over the wire.
    pub fn json(&self) -> String {
        // Maps with string keys and numbers: there is nothing that could fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// The world as it runs.
#[derive(Clone, Debug, Serialize)]
pub struct WorldSays {
    /// Counted from 0 with each change.
    pub generation: u32,
    /// Its title, or its file's name.
    pub title: String,
    /// `rotary` or `linear`.
    pub motion: &'static str,
    /// In which the telemetry is.
    pub units: Units,
    /// T.
    pub period_s: f64,
    /// Of the motor.
    pub limit: Option<f64>,
    /// `sim`, or what else `--device` said.
    pub device: String,
    /// In file order.
    pub bodies: Vec<BodySays>,
    /// In file order.
    pub couplings: Vec<serde_json::Value>,
    /// In file order.
    pub scenarios: Vec<ScenarioSays>,
    /// What can be set.
    pub keys: Vec<KeySays>,
    /// Of the telemetry.
    pub columns: Vec<ColumnSays>,
}

/// SI units by what they measure.
#[derive(Clone, Copy, Debug, Serialize)]
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
pub struct BodySays {
    /// In the file.
    pub name: String,
    /// kg m² (linear: kg).
    pub inertia: f64,
}

/// A scenario.
#[derive(Clone, Debug, Serialize)]
pub struct ScenarioSays {
    /// In the file.
    pub name: String,
    /// In s.
    pub duration_s: f64,
    /// The hand's kind.
    pub hand: &'static str,
}

/// A column of the telemetry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnSays {
    /// As in the CSV, where it is there too.
    pub name: String,
    /// As people write it.
    pub unit: &'static str,
}

/// A key that can be set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KeySays {
    /// Dotted: `couplings.0.stiffness`.
    pub path: String,
    /// What it belongs to, for people: `loop`, `spring, puck to wheel`.
    pub group: String,
    /// Its name for people.
    pub label: String,
    /// What it means.
    pub doc: &'static str,
    /// `quantity`, `choice` or `whole`.
    pub kind: &'static str,
    /// As it stands in the file or was set.
    pub written: String,
    /// In SI; of a choice, and of a damper that compensates, none.
    pub value: Option<f64>,
    /// The unit in which it is written.
    pub unit: String,
    /// How much SI one of that unit is.
    pub factor: f64,
    /// A slider's range in SI.
    pub min: f64,
    /// Its other end.
    pub max: f64,
    /// Whether the slider goes by equal ratios.
    pub log: bool,
    /// The names that it takes.
    pub choices: Vec<&'static str>,
    /// Whether it is no longer as in the file.
    pub changed: bool,
    /// Whether it cannot be set here.
    pub fixed: bool,
}

/// The certificate of one generation.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// Of which world.
    pub generation: u32,
    /// Neither held nor free unstable, and passive.
    pub certified: bool,
    /// All of it in one sentence.
    pub sentence: String,
    /// Its parts.
    pub sentences: Vec<Sentence>,
    /// Of the held world and the free loop, the larger.
    pub growth_per_s: Option<f64>,
    /// Of the held world; `None`: nothing in it moves, or only shifts that change no torque.
    pub held_growth_per_s: Option<f64>,
    /// Of the free loop; `None`: the same.
    pub free_growth_per_s: Option<f64>,
    /// Eigenvalues, puck held.
    pub held: Vec<[f64; 2]>,
    /// Eigenvalues, puck let go.
    pub free: Vec<[f64; 2]>,
    /// Of the device, so that the loop is passive.
    pub required_damping: Option<f64>,
    /// What it has.
    pub device_damping: f64,
    /// What is not proved, and what a reader of the numbers has to know.
    pub notes: Vec<String>,
    /// What would make it certified, or its margins; `None`: not yet known.
    pub remedies: Option<Vec<RemedySays>>,
    /// How long the certificate took; `None`: it was made before.
    pub ms: Option<f64>,
}

/// One claim of the certificate.
#[derive(Clone, Debug, Serialize)]
pub struct Sentence {
    /// `held`, `free`, `passive` or `quantisation`.
    pub what: &'static str,
    /// Whether it is good; `None`: marginal, or not proved.
    pub ok: Option<bool>,
    /// For people.
    pub text: String,
}

/// What would make the loop certified.
#[derive(Clone, Debug, Serialize)]
pub struct RemedySays {
    /// Keys with their values as written, to be set together; none where it takes a new coupling.
    pub sets: Vec<(String, String)>,
    /// Lines for the world file.
    pub text: String,
}

/// How the loop goes.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// `disarmed`, `fading-in`, `running`, `fading-out` or `faulted`.
    pub phase: &'static str,
    /// Of the reason of a fault.
    pub code: Option<u8>,
    /// Its name.
    pub reason: Option<&'static str>,
    /// What it means.
    pub sentence: Option<String>,
    /// How to clear it.
    pub clear: Option<String>,
    /// What is odd and no fault.
    pub warnings: Vec<String>,
    /// The scenario that runs.
    pub scenario: Option<String>,
    /// The recording under way, or how the last one failed.
    pub recording: Option<RecordingSays>,
    /// How punctual the loop is; `None` where no clock of this computer's keeps it.
    pub timing: Option<TimingSays>,
    /// What the system gives its thread.
    pub realtime: Option<Realtime>,
    /// How many pages are connected.
    pub clients: usize,
}

/// A recording.
#[derive(Clone, Debug, Serialize)]
pub struct RecordingSays {
    /// Where it goes.
    pub file: String,
    /// How long it is.
    pub seconds: f64,
    /// Samples that found no room.
    pub lost: u64,
    /// Why it has ended.
    pub error: Option<String>,
}

/// How punctual the loop is, since it began.
#[derive(Clone, Debug, Serialize)]
pub struct TimingSays {
    /// Taken.
    pub samples: u64,
    /// Whose command came after the next was due.
    pub overruns: u64,
    /// Never taken.
    pub missed: u64,
    /// From a sample's instant to when it was taken.
    pub latency_us: Quantiles,
    /// From one to the next.
    pub period_us: Quantiles,
    /// From when it was taken to the command.
    pub computation_us: Quantiles,
    /// Of the latency.
    pub histogram: Bars,
}

/// Quantiles in µs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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

/// Counts between edges, one fewer than those.
#[derive(Clone, Debug, Serialize)]
pub struct Bars {
    /// In µs, upwards.
    pub edges_us: Vec<f64>,
    /// How many samples lie between each two.
    pub latency: Vec<u64>,
}

/// What the system gives the loop's thread.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Realtime {
    /// Whether it goes before all others.
    pub fifo: bool,
    /// Whether its memory stays in place.
    pub locked: bool,
    /// What to do about it.
    pub warning: Option<String>,
}
