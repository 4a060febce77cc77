//! The signals of a run at every sample, and the one table of their names and units.

use hapt_model::{Motion, World};

use hapt_plant::Ledger;

/// One sample: everything at t_k, in SI (rad, rad/s, N·m; linear m, m/s, N). Bodies show x_k.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// t_k = k T in s.
    pub time: f64,
    /// The puck's true position.
    pub puck: f64,
    /// The puck's true velocity.
    pub puck_velocity: f64,
    /// z_k, the encoder's position.
    pub measured: f64,
    /// v_k, the estimator's velocity.
    pub measured_velocity: f64,
    /// From the couplings, before levels and limit.
    pub torque: f64,
    /// After levels and limit.
    pub command: f64,
    /// The torque that the motor holds, just after any change at t_k.
    pub applied: f64,
    /// Position and velocity of each body, in file order.
    pub bodies: Vec<(f64, f64)>,
    /// The bristle of each coupling in rad (linear: m); 0 where it is not LuGre friction.
    pub bristles: Vec<f64>,
    /// The device's works up to here.
    pub ledger: Ledger,
}

impl Row {
    /// Whether every number of the row is finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let own =
            [(self.puck, self.puck_velocity), (self.measured, self.measured_velocity), (self.torque, self.command)];
        // 0 · x is 0 or NaN, and a NaN stays in a sum: one test instead of one for each number.
        let (a, b) = own.iter().chain(&self.bodies).fold((0.0, 0.0), |(a, b), (x, y)| (a + 0.0 * x, b + 0.0 * y));
        a + b == 0.0
    }
}

/// What a signal measures; the unit follows from the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measures {
    /// s
    Time,
    /// rad, or m
    Position,
    /// rad/s, or m/s
    Velocity,
    /// N·m, or N
    Effort,
}

impl Measures {
    /// The unit as people write it.
    pub fn unit(self, motion: Motion) -> &'static str {
        match (self, motion) {
            (Measures::Time, _) => "s",
            (Measures::Position, Motion::Rotary) => "rad",
            (Measures::Position, Motion::Linear) => "m",
            (Measures::Velocity, Motion::Rotary) => "rad/s",
            (Measures::Velocity, Motion::Linear) => "m/s",
            (Measures::Effort, Motion::Rotary) => "N m",
            (Measures::Effort, Motion::Linear) => "N",
        }
    }

    /// The unit as it ends a column's name.
    fn suffix(self, motion: Motion) -> &'static str {
        match (self, motion) {
            (Measures::Velocity, Motion::Rotary) => "rad_per_s",
            (Measures::Velocity, Motion::Linear) => "m_per_s",
            (Measures::Effort, Motion::Rotary) => "Nm",
            _ => self.unit(motion),
        }
    }
}

/// A signal of the loop: one column of every format.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// The column's name without its unit.
    pub stem: &'static str,
    /// What it measures.
    pub measures: Measures,
    /// One line for people.
    pub doc: &'static str,
    /// Its value in a row.
    pub get: fn(&Row) -> f64,
}

/// The signals of every run, in the order of the columns.
pub const SIGNALS: [Signal; 8] = [
    Signal { stem: "time", measures: Measures::Time, doc: "t_k = k T", get: |row| row.time },
    Signal { stem: "puck", measures: Measures::Position, doc: "the puck's true position", get: |row| row.puck },
    Signal {
        stem: "puck",
        measures: Measures::Velocity,
        doc: "the puck's true velocity",
        get: |row| row.puck_velocity,
    },
    Signal { stem: "measured", measures: Measures::Position, doc: "the encoder's position", get: |row| row.measured },
    Signal {
        stem: "measured",
        measures: Measures::Velocity,
        doc: "the estimated velocity",
        get: |row| row.measured_velocity,
    },
    Signal {
        stem: "torque",
        measures: Measures::Effort,
        doc: "from the couplings on the puck, before levels and limit",
        get: |row| row.torque,
    },
    Signal {
        stem: "command",
        measures: Measures::Effort,
        doc: "the motor's command, after levels and limit",
        get: |row| row.command,
    },
    Signal {
        stem: "applied",
        measures: Measures::Effort,
        doc: "the torque that the motor holds, just after any change at this instant",
        get: |row| row.applied,
    },
];

/// The signals of each body, after those: its position and its velocity.
pub const BODY_SIGNALS: [(Measures, &str); 2] =
    [(Measures::Position, "the body's position"), (Measures::Velocity, "the body's velocity")];

/// A column's name and unit for one world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// As in the CSV's header.
    pub name: String,
    /// As people write it.
    pub unit: &'static str,
    /// One line for people.
    pub doc: &'static str,
}

/// The columns of a world's runs, in order.
pub fn columns(world: &World) -> Vec<Column> {
    let motion = world.motion;
    let column = |stem: &str, measures: Measures, doc| {
        // In a linear world the torque is a force, and the column's name says so.
        let stem = if (stem, motion) == ("torque", Motion::Linear) { "force" } else { stem };
        Column { name: format!("{stem}_{}", measures.suffix(motion)), unit: measures.unit(motion), doc }
    };
    let own = SIGNALS.iter().map(|signal| column(signal.stem, signal.measures, signal.doc));
    let bodies =
        world.names.iter().flat_map(|name| BODY_SIGNALS.iter().map(|&(measures, doc)| column(name, measures, doc)));
    own.chain(bodies).collect()
}
