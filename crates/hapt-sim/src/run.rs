//! A run: the loop on the exact device, sample after sample.

use hapt_core::{Puck, Sample};
use hapt_model::{Scenario, Timing, World};

use crate::control::Control;
use crate::row::Row;
use crate::schedule::{Schedule, Tick};
use hapt_plant::spec::DeviceSpec;
use hapt_plant::{Hand, Script, VirtualDevice};

/// Why a run cannot start or continue.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The world cannot be compiled.
    #[error("{0}")]
    Loop(#[from] hapt_core::Error),
    /// The device cannot be simulated.
    #[error("device.{table}.{key}: {reason}")]
    Device {
        /// The table below `device`.
        table: &'static str,
        /// The key in it.
        key: &'static str,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The scenario's hand cannot be simulated on the device.
    #[error("scenarios.{scenario}.hand.{key}: {reason}")]
    Hand {
        /// The scenario's name.
        scenario: String,
        /// The key below its hand.
        key: &'static str,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The scenario's timing does not suit the loop.
    #[error("scenarios.{scenario}.timing: {reason}")]
    Timing {
        /// The scenario's name.
        scenario: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The samples of a station whose clock is fast or slow do not suit its loop.
    #[error("stations.{station}.drift: samples by this clock are uneven, and {reason}")]
    Clock {
        /// The station's name.
        station: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A number is no longer finite; the rows before it are valid.
    #[error("the run stops being finite at t = {time} s: the loop has run away")]
    NotFinite {
        /// t_k of the first row that is not finite, in s.
        time: f64,
    },
}

/// A scenario of a world, run sample by sample: a stream of [`Row`]s that takes the same memory however long it is.
///
/// Between the samples the puck is integrated exactly (no step error): inertia, viscous damping, Coulomb friction with
/// located stops and starts, the motor's held torque through any delay, and the hand.
///
/// ```
/// use hapt_model::{Source, World};
/// use hapt_sim::Simulation;
///
/// let file = r#"
/// loop.period = "1 ms"
/// device.inertia = "1 g cm^2"
/// [scenarios.push]
/// duration = "1 s"
/// hand = { kind = "torque", moves = { kind = "step", to = "1e-7 N m" } }
/// "#;
/// let world = World::read(&Source::from_text("push.toml", file), &[])?;
/// let mut run = Simulation::new(&world, world.scenario("push")?)?;
/// let mut last = 0.0;
/// while let Some(row) = run.next() {
///     last = row?.puck;
/// }
/// // A free inertia of 1e-7 kg·m² under 1e-7 N·m: t²/2.
/// assert!((last - 0.5).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Simulation {
    control: Control,
    machine: Machine,
    sample: u64,
    rows: u64,
    row: Row,
}

/// The exact device of a run, from sample to sample, even or not.
#[derive(Clone, Debug)]
pub(crate) struct Machine {
    pub device: VirtualDevice,
    period: f64,
    /// For uneven samples: their times, and delay and interval after the last one.
    uneven: Option<(Schedule, Tick)>,
}

impl Machine {
    /// The device at the first sample, and the number of samples. Errors when the scenario's timing does not suit the loop.
    pub fn new(world: &World, scenario: &Scenario, works: bool) -> Result<(Self, u64), Error> {
        let period = world.sampling.period;
        simulated(world)?;
        holdable(world, scenario)?;
        let even = scenario.timing == Timing::Even;
        if let Some((key, reason)) = scenario.timing.fault(&world.sampling, scenario.duration) {
            return Err(Error::Timing { scenario: scenario.name.clone(), reason: format!("{key}: {reason}") });
        }
        if scenario.timing == Timing::Worst {
            let reason = "kind: the worst pattern is not known here; hapt_analysis::with_worst_pattern finds it".into();
            return Err(Error::Timing { scenario: scenario.name.clone(), reason });
        }
        let spec = world.device_spec();
        // With uneven samples each command comes with its own delay.
        let spec = DeviceSpec { delay: if even { spec.delay } else { 0.0 }, ..spec };
        let mut device = if works { VirtualDevice::new(&spec) } else { VirtualDevice::without_works(&spec) };
        let schedule = Schedule::new(&scenario.timing, &world.sampling);
        let rows =
            if even { rows(scenario.duration, period) } else { schedule.clone().samples_until(scenario.duration) };
        device.begin(&mut script(scenario, period));
        let uneven = (!even).then_some((schedule, Tick { delay: 0.0, interval: period }));
        Ok((Machine { device, period, uneven }, rows))
    }

    /// The time of sample number `sample`, the first or the next one, in s.
    pub fn time(&self, sample: u64) -> f64 {
        self.uneven.as_ref().map_or(sample as f64 * self.period, |(schedule, _)| schedule.time())
    }

    /// Advances to sample number `sample`, the first or the next one, and returns its time in s. `command` is that of the sample before.
    #[inline]
    pub fn travel(&mut self, sample: u64, command: f64) -> f64 {
        if self.uneven.is_some() {
            return self.travel_uneven(sample, command);
        }
        if sample > 0 {
            self.device.travel();
        }
        self.device.time()
    }

    #[inline(never)]
    fn travel_uneven(&mut self, sample: u64, command: f64) -> f64 {
        let Some((schedule, last)) = &mut self.uneven else { return self.device.time() };
        let time = schedule.time();
        if sample > 0 {
            self.device.travel_uneven(last.interval, time, aligned(last.delay, self.period), command);
        }
        *last = schedule.advance();
        time
    }

    /// Sets the loop's command at this sample; a delayed one is passed to [`Machine::travel`].
    #[inline]
    pub fn command(&mut self, command: f64) {
        if self.uneven.as_ref().is_none_or(|(_, tick)| aligned(tick.delay, self.period) == 0.0) {
            self.device.command(command);
        }
    }
}

impl Simulation {
    /// A run of `scenario` in `world`. Errors when the loop cannot be compiled.
    pub fn new(world: &World, scenario: &Scenario) -> Result<Self, Error> {
        Self::with_works(world, scenario, true)
    }

    /// Bit-identical rows except [`Row::ledger`], which is not computed for a puck without a shaft: faster where all intervals differ.
    pub fn without_works(world: &World, scenario: &Scenario) -> Result<Self, Error> {
        Self::with_works(world, scenario, false)
    }

    fn with_works(world: &World, scenario: &Scenario, works: bool) -> Result<Self, Error> {
        let control = Control::new(&world.spec())?;
        let (machine, rows) = Machine::new(world, scenario, works)?;
        let handle = machine.device.handle();
        Ok(Simulation {
            control,
            machine,
            sample: 0,
            rows,
            row: Row {
                bodies: vec![(0.0, 0.0); world.bodies.len()],
                bristles: vec![0.0; world.couplings.len()],
                handle,
                ..Row::default()
            },
        })
    }

    /// The number of rows of the whole run: round(duration/T) + 1; with uneven samples those up to the duration.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Whether a sample is taken every period.
    pub fn is_even(&self) -> bool {
        self.machine.uneven.is_none()
    }

    fn hand(&self) -> Option<&Hand> {
        self.machine.device.script().hand()
    }

    /// The hand's last event in s, if the puck stands still, held, from then on.
    pub fn still_from(&self) -> Option<f64> {
        // While the handle is held still, the puck can swing on its shaft.
        let hand = self.hand().filter(|hand| hand.holds_still() && self.row.handle.is_none());
        hand.map(Hand::last_event)
    }

    /// The hand's last event in s: the latest of a step, a ramp's end, a path's last point and the release; 0 for a sine.
    pub fn last_event(&self) -> f64 {
        self.hand().map_or(0.0, Hand::last_event)
    }

    /// Whether the hand still prescribes the puck's position, and not a handle's, at `t`, in s.
    pub fn is_held_at(&self, t: f64) -> bool {
        self.row.handle.is_none() && self.hand().is_some_and(|hand| hand.prescribed().is_some() && !hand.is_gone(t))
    }

    /// The time of the next row's sample, in s; `None` after the last.
    pub(crate) fn next_time(&self) -> Option<f64> {
        (self.sample < self.rows).then(|| self.machine.time(self.sample))
    }

    /// The last row, with its time replaced by one of another clock.
    pub(crate) fn row_at(&mut self, time: f64) -> &Row {
        self.row.time = time;
        &self.row
    }

    /// The next row; `None` after the last. An error ends the run.
    #[allow(clippy::should_implement_trait)] // The row is borrowed: an iterator would allocate each.
    #[inline]
    pub fn next(&mut self) -> Option<Result<&Row, Error>> {
        let taken = self.take(|_, sample| sample.command)?;
        Some(taken.map(|()| &self.row))
    }

    /// The same with an external torque on the puck, a function of its measured position; `row.torque` excludes it.
    pub(crate) fn next_with(&mut self, torque: impl FnOnce(Puck<f64>) -> f64) -> Option<Result<(), Error>> {
        self.take(|control, sample| control.command(sample.torque + torque(sample.puck)))
    }

    #[inline(always)]
    fn take(&mut self, command: impl FnOnce(&Control, &Sample<f64>) -> f64) -> Option<Result<(), Error>> {
        if self.sample >= self.rows {
            return None;
        }
        let (row, machine) = (&mut self.row, &mut self.machine);
        let time = machine.travel(self.sample, row.command);
        let (position, velocity) = machine.device.puck();
        let sample = self.control.step(position, velocity, &mut row.bodies, &mut row.bristles);
        let command = command(&self.control, &sample);
        machine.command(command);
        row.time = time;
        (row.puck, row.puck_velocity) = (position, velocity);
        if row.handle.is_some() {
            row.handle = machine.device.handle();
        }
        (row.measured, row.measured_velocity) = (sample.puck.position, sample.puck.velocity);
        (row.torque, row.command, row.applied) = (sample.torque, command, machine.device.applied());
        row.ledger = machine.device.ledger();
        row.unsettled = self.control.unsettled();
        self.sample += 1;
        if !self.row.is_finite() {
            self.rows = 0;
            return Some(Err(Error::NotFinite { time }));
        }
        Some(Ok(()))
    }
}

/// Compiles the world's loop, and checks its device and the hands of its scenarios.
pub fn check(world: &World) -> Result<(), Error> {
    Control::new(&world.spec())?;
    simulated(world)?;
    world.scenarios.iter().try_for_each(|scenario| holdable(world, scenario))
}

/// Whether the scenario's hand can be simulated.
fn holdable(world: &World, scenario: &Scenario) -> Result<(), Error> {
    let fault = world.device.hand_fault(&scenario.hand, &world.sampling);
    fault.map_or(Ok(()), |(key, reason)| Err(Error::Hand { scenario: scenario.name.clone(), key, reason }))
}

/// Whether the device can be simulated.
fn simulated(world: &World) -> Result<(), Error> {
    world
        .device
        .fault(world.sampling.period)
        .map_or(Ok(()), |(table, key, reason)| Err(Error::Device { table, key, reason }))
}

/// A delay of less than a period, within 1e-6 of a whole sample that sample.
fn aligned(delay: f64, period: f64) -> f64 {
    let ratio = delay / period;
    let whole = ratio.round();
    if (ratio - whole).abs() <= 1e-6 { whole * period } else { ratio * period }
}

/// The hand of `scenario` on the samples of a loop of this period, in s, for a [`VirtualDevice`].
pub fn script(scenario: &Scenario, period: f64) -> Script {
    Script::new(&scenario.hand, scenario.duration, period)
}

/// round(duration/T) + 1
pub fn rows(duration: f64, period: f64) -> u64 {
    (duration / period).round() as u64 + 1
}
