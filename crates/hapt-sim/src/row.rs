//! The signals of a run at every sample, and the one table of their names and units.

use hapt_model::{Motion, World};

use hapt_plant::Ledger;

/// One sample: everything at t_k, in SI (rad, rad/s, N·m; linear m, m/s, N). Bodies show x_k.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// t_k in s: k T, or the true time where samples are uneven.
    pub time: f64,
    /// The puck's true position.
    pub puck: f64,
    /// The puck's true velocity.
    pub puck_velocity: f64,
    /// z_k, the encoder's position.
    pub measured: f64,
    /// v_k, the estimator's velocity.
    pub measured_velocity: f64,
    /// The torque of the couplings, before levels and limit.
    pub torque: f64,
    /// After levels and limit.
    pub command: f64,
    /// The torque that the motor holds, just after any change at t_k; with a lag its torque at t_k.
    pub applied: f64,
    /// Position and velocity of each body, in file order.
    pub bodies: Vec<(f64, f64)>,
    /// The bristle of each coupling in rad (linear: m); 0 where it is not LuGre friction.
    pub bristles: Vec<f64>,
    /// Position and velocity of a handle on a shaft; `None`: the puck is the handle.
    pub handle: Option<(f64, f64)>,
    /// The device's works up to here.
    pub ledger: Ledger,
    /// The number of steps of the bodies up to here whose iteration for the nonlinear torques has not converged ([`hapt_core::Contacts`]): such
    /// a step loses energy.
    pub unsettled: u32,
}

impl Row {
    /// Position and velocity of the bodies, then of a handle on a shaft: each has two columns after the signals.
    pub fn pairs(&self) -> impl Iterator<Item = (f64, f64)> {
        self.bodies.iter().copied().chain(self.handle)
    }

    /// Whether every number of the row is finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let mut a = self.puck + self.measured + self.torque;
        let mut b = self.puck_velocity + self.measured_velocity + self.command;
        match self.bodies[..] {
            // Most worlds have one body, for which a loop costs more.
            [(x, y)] => (a, b) = (a + x, b + y),
            _ => {
                for (x, y) in &self.bodies {
                    (a, b) = (a + x, b + y);
                }
            }
        }
        // A number that is not finite stays in a sum, and 0 times that is not 0: one comparison instead of one for each number. A sum that
        // overflows needs one for each.
        (0.0 * (a + b) == 0.0 && self.handle.is_none()) || self.has_finite_numbers()
    }

    /// [`Row::is_finite`], number by number.
    #[inline(never)]
    fn has_finite_numbers(&self) -> bool {
        let own = [self.puck, self.puck_velocity, self.measured, self.measured_velocity, self.torque, self.command];
        own.iter().all(|x| x.is_finite()) && self.pairs().all(|(x, y)| x.is_finite() && y.is_finite())
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
    /// J
    Energy,
}

impl Measures {
    /// The unit in text, such as N m.
    pub fn unit(self, motion: Motion) -> &'static str {
        match (self, motion) {
            (Measures::Time, _) => "s",
            (Measures::Position, Motion::Rotary) => "rad",
            (Measures::Position, Motion::Linear) => "m",
            (Measures::Velocity, Motion::Rotary) => "rad/s",
            (Measures::Velocity, Motion::Linear) => "m/s",
            (Measures::Effort, Motion::Rotary) => "N m",
            (Measures::Effort, Motion::Linear) => "N",
            (Measures::Energy, _) => "J",
        }
    }

    /// The unit as the suffix of a column's name.
    fn suffix(self, motion: Motion) -> &'static str {
        match (self, motion) {
            (Measures::Velocity, Motion::Rotary) => "rad_per_s",
            (Measures::Velocity, Motion::Linear) => "m_per_s",
            (Measures::Effort, Motion::Rotary) => "Nm",
            _ => self.unit(motion),
        }
    }
}

/// A signal of the loop: its name, unit and meaning, the same in every format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// The column's name without its unit.
    pub stem: &'static str,
    /// What it measures.
    pub measures: Measures,
    /// One line of text.
    pub doc: &'static str,
}

impl Signal {
    const fn new(stem: &'static str, measures: Measures, doc: &'static str) -> Self {
        Signal { stem, measures, doc }
    }

    /// t_k.
    pub const TIME: Signal = Signal::new("time", Measures::Time, "t_k = k T");
    /// The puck's position.
    pub const PUCK: Signal = Signal::new("puck", Measures::Position, "the puck's true position");
    /// The puck's velocity.
    pub const PUCK_VELOCITY: Signal = Signal::new("puck", Measures::Velocity, "the puck's true velocity");
    /// z_k.
    pub const MEASURED: Signal = Signal::new("measured", Measures::Position, "the encoder's position");
    /// v_k.
    pub const MEASURED_VELOCITY: Signal = Signal::new("measured", Measures::Velocity, "the estimated velocity");
    /// The world's torque.
    pub const TORQUE: Signal =
        Signal::new("torque", Measures::Effort, "from the couplings on the puck, before levels and limit");
    /// The loop's command.
    pub const COMMAND: Signal = Signal::new("command", Measures::Effort, "the motor's command, after levels and limit");
    /// The motor's torque.
    pub const APPLIED: Signal = Signal::new(
        "applied",
        Measures::Effort,
        "the torque that the motor holds, just after any change at this instant",
    );
    /// The motor's command of a supervised loop.
    pub const OUTPUT: Signal =
        Signal::new("output", Measures::Effort, "the output of the supervisor, the torque of the motor");
    /// A network's torque.
    pub const LINK: Signal = Signal::new(
        "link",
        Measures::Effort,
        "on the puck from outside of the world (links, a game), before levels and limit",
    );
    /// The world's energy.
    pub const ENERGY: Signal = Signal::new("energy", Measures::Energy, "the energy that the world stores");

    /// Its column in worlds of this motion.
    pub fn column(&self, motion: Motion) -> Column {
        // In a linear world the torque is a force, and the column is named so.
        let stem = if (*self, motion) == (Signal::TORQUE, Motion::Linear) { "force" } else { self.stem };
        column(stem, self.measures, self.doc, motion)
    }
}

/// A signal of a run, and where a row has it.
#[derive(Clone, Copy, Debug)]
pub struct RowSignal {
    /// The signal.
    pub signal: Signal,
    /// Its value in a row.
    pub get: fn(&Row) -> f64,
}

/// The signals of every run, in the order of the columns.
pub const SIGNALS: [RowSignal; 8] = [
    RowSignal { signal: Signal::TIME, get: |row| row.time },
    RowSignal { signal: Signal::PUCK, get: |row| row.puck },
    RowSignal { signal: Signal::PUCK_VELOCITY, get: |row| row.puck_velocity },
    RowSignal { signal: Signal::MEASURED, get: |row| row.measured },
    RowSignal { signal: Signal::MEASURED_VELOCITY, get: |row| row.measured_velocity },
    RowSignal { signal: Signal::TORQUE, get: |row| row.torque },
    RowSignal { signal: Signal::COMMAND, get: |row| row.command },
    RowSignal { signal: Signal::APPLIED, get: |row| row.applied },
];

/// The signals of each body, after those: its position and its velocity.
pub const BODY_SIGNALS: [(Measures, &str); 2] =
    [(Measures::Position, "the body's position"), (Measures::Velocity, "the body's velocity")];

/// The signals of a handle on a shaft, after the bodies.
const HANDLE_SIGNALS: [Signal; 2] = [
    Signal::new("handle", Measures::Position, "the handle's true position, beyond the shaft"),
    Signal::new("handle", Measures::Velocity, "the handle's true velocity"),
];

/// A column's name and unit for one world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The name in the CSV's header.
    pub name: String,
    /// The unit in text.
    pub unit: &'static str,
    /// One line of text.
    pub doc: &'static str,
}

fn column(stem: &str, measures: Measures, doc: &'static str, motion: Motion) -> Column {
    Column { name: format!("{stem}_{}", measures.suffix(motion)), unit: measures.unit(motion), doc }
}

/// The columns of a world's runs, in order.
pub fn columns(world: &World) -> Vec<Column> {
    let handle = HANDLE_SIGNALS.iter().filter(|_| world.device.handle.is_some());
    loop_columns(world).into_iter().chain(handle.map(|signal| signal.column(world.motion))).collect()
}

/// The columns that a loop on a real device has too.
pub fn loop_columns(world: &World) -> Vec<Column> {
    SIGNALS.iter().map(|row| row.signal.column(world.motion)).chain(body_columns(world)).collect()
}

/// The columns of a world's bodies, in order: two each, after the signals.
pub fn body_columns(world: &World) -> impl Iterator<Item = Column> {
    let motion = world.motion;
    let pair = move |name: &String| BODY_SIGNALS.map(|(measures, doc)| column(name, measures, doc, motion));
    world.names.iter().flat_map(pair)
}
