//! The columns of a sample: those of every run, and after them those of the loop in real time.

use hapt_core::{Phase, Reason, Request};
use hapt_model::World;
use hapt_rt::Record;
use hapt_sim::{Row, SIGNALS, Signal};

/// A column of a log: a field of its messages, a column of the CSV or Parquet file that it is converted to.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The name in the CSV's header.
    pub name: String,
    /// The unit as written in text; empty for counts and names.
    pub unit: &'static str,
    /// One line of text.
    pub doc: &'static str,
    /// Its encoding.
    pub kind: Kind,
}

/// The encoding of a column. In memory each is a double, which holds whole numbers up to 2⁵³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A double with all of its bits.
    Number,
    /// A whole number, zero or more.
    Count,
    /// A code with a name.
    Choice(&'static Choice),
}

/// The names of a column's codes.
#[derive(Debug, PartialEq)]
pub struct Choice {
    /// The name of the type: `Phase`.
    pub name: &'static str,
    /// The names with their codes; 0 is among them.
    pub values: &'static [(&'static str, u64)],
}

/// The supervisor's phase.
static PHASES: Choice = Choice {
    name: "Phase",
    values: &[("disarmed", 0), ("fading-in", 1), ("running", 2), ("fading-out", 3), ("faulted", 4)],
};

/// The supervisor's reason.
static REASONS: Choice = Choice {
    name: "Reason",
    values: &{
        let mut values = [("none", 0); Reason::ALL.len() + 1];
        let mut i = 0;
        while i < Reason::ALL.len() {
            values[i + 1] = (Reason::ALL[i].name(), Reason::ALL[i].code() as u64);
            i += 1;
        }
        values
    },
};

/// The request to the supervisor.
static REQUESTS: Choice =
    Choice { name: "Request", values: &[("none", 0), ("arm", 1), ("disarm", 2), ("stop", 3), ("clear", 4)] };

/// A column of the loop in real time.
struct Live {
    name: &'static str,
    unit: &'static str,
    doc: &'static str,
    kind: Kind,
    get: fn(&Record) -> f64,
}

/// The columns after those of the bodies, in this order.
static LIVE: [Live; 12] = [
    Live {
        name: Signal::OUTPUT.stem,
        unit: "",
        doc: Signal::OUTPUT.doc,
        kind: Kind::Number,
        get: |record| record.output,
    },
    Live {
        name: "sample",
        unit: "",
        doc: "k, counted from the loop's start, missed ones too",
        kind: Kind::Count,
        get: |record| record.sample as f64,
    },
    Live {
        name: "plan",
        unit: "",
        doc: "which world ran: 0 at the start, one more with each change",
        kind: Kind::Count,
        get: |record| f64::from(record.plan),
    },
    Live {
        name: "phase",
        unit: "",
        doc: "the supervisor's phase after the sample",
        kind: Kind::Choice(&PHASES),
        get: |record| phase_code(record.phase),
    },
    Live {
        name: "reason",
        unit: "",
        doc: "the reason of a fault",
        kind: Kind::Choice(&REASONS),
        get: |record| record.reason.map_or(0.0, |reason| f64::from(reason as u8)),
    },
    Live {
        name: "request",
        unit: "",
        doc: "the request to the supervisor at this sample",
        kind: Kind::Choice(&REQUESTS),
        get: |record| request_code(record.request),
    },
    Live {
        name: "announced",
        unit: "",
        doc: "1 where a prescribed jump of a simulated hand fell on this sample",
        kind: Kind::Count,
        get: |record| f64::from(u8::from(record.announced)),
    },
    Live {
        name: "late_s",
        unit: "s",
        doc: "the lateness of the sample, an input of the supervisor",
        kind: Kind::Number,
        get: |record| record.late,
    },
    Live {
        name: "missed",
        unit: "",
        doc: "samples missed since the last",
        kind: Kind::Count,
        get: |record| f64::from(record.missed),
    },
    Live {
        name: "silent_s",
        unit: "s",
        doc: "time since the last heartbeat",
        kind: Kind::Number,
        get: |record| record.silent,
    },
    Live {
        name: "latency_s",
        unit: "s",
        doc: "from the sample's instant to its reading",
        kind: Kind::Number,
        get: |record| f64::from(record.latency) / 1e9,
    },
    Live {
        name: "computation_s",
        unit: "s",
        doc: "from the reading to the completed write to the device; a stale reading's age counts",
        kind: Kind::Number,
        get: |record| f64::from(record.computation) / 1e9,
    },
];

/// Indices of the torques among a sample's values, the same in every log.
pub(crate) const TORQUE: usize = 5;
pub(crate) const COMMAND: usize = 6;

/// The number of columns that a loop in real time adds.
pub(crate) const LIVE_COLUMNS: usize = LIVE.len();

/// The columns of a world's log, in order; `live`: of a loop in real time; `linked`: of one at the ends of links.
pub fn columns(world: &World, live: bool, linked: bool) -> Vec<Column> {
    // The handle of a real device is not measured.
    let run = if live { hapt_sim::loop_columns(world) } else { hapt_sim::columns(world) }.into_iter();
    let run = run.map(|column| Column { name: column.name, unit: column.unit, doc: column.doc, kind: Kind::Number });
    let mut columns: Vec<Column> = run.collect();
    columns.extend(LIVE.iter().filter(|_| live).map(|&Live { name, unit, doc, kind, .. }| {
        // The output is the only torque among them: its unit is the world's.
        let output = Some(Signal::OUTPUT).filter(|output| output.stem == name);
        let own = output.map(|output| output.column(world.motion));
        own.map_or_else(
            || Column { name: name.into(), unit, doc, kind },
            |own| Column { name: own.name, unit: own.unit, doc, kind },
        )
    }));
    columns.extend(linked.then(|| link_column(world)));
    columns
}

/// The last column of a loop at the ends of links.
pub(crate) fn link_column(world: &World) -> Column {
    let column = Signal::LINK.column(world.motion);
    Column { name: column.name, unit: column.unit, doc: column.doc, kind: Kind::Number }
}

/// The values of a row of a run, in the order of the columns.
pub(crate) fn row_values(row: &Row, values: &mut Vec<f64>) {
    values.clear();
    values.extend(SIGNALS.iter().map(|signal| (signal.get)(row)));
    values.extend(row.pairs().flat_map(|(position, velocity)| [position, velocity]));
}

/// The values of a record of the loop at `time`, in a world of this many bodies.
pub(crate) fn record_values(
    record: &Record,
    time: f64,
    bodies: usize,
    linked: bool,
    row: &mut Row,
    values: &mut Vec<f64>,
) {
    row.time = time;
    (row.puck, row.puck_velocity) = (record.position, record.velocity);
    (row.measured, row.measured_velocity) = (record.measured, record.measured_velocity);
    (row.torque, row.command, row.applied) = (record.torque, record.command, record.applied);
    row.bodies.clear();
    row.bodies.extend(record.bodies.iter().take(bodies));
    row_values(row, values);
    values.extend(LIVE.iter().map(|column| (column.get)(record)));
    values.extend(linked.then_some(record.link));
}

fn phase_code(phase: Phase) -> f64 {
    match phase {
        Phase::Disarmed => 0.0,
        Phase::FadingIn => 1.0,
        Phase::Running => 2.0,
        Phase::FadingOut => 3.0,
        Phase::Faulted => 4.0,
    }
}

fn request_code(request: Option<Request>) -> f64 {
    match request {
        None => 0.0,
        Some(Request::Arm) => 1.0,
        Some(Request::Disarm) => 2.0,
        Some(Request::Stop) => 3.0,
        Some(Request::Clear) => 4.0,
    }
}

/// The request of a code.
pub(crate) fn request(code: f64) -> Option<Request> {
    match code as u64 {
        1 => Some(Request::Arm),
        2 => Some(Request::Disarm),
        3 => Some(Request::Stop),
        4 => Some(Request::Clear),
        _ => None,
    }
}
