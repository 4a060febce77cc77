//! The summary of a run: peaks, clipping, energy, growth, and the energy that the hands at all stations have drawn.

use hapt_model::{System, Timing, World};

use hapt_plant::Ledger;

use crate::energy::world_energy;
use crate::growth::Growth;
use crate::row::Row;
use crate::run::Simulation;
use crate::system::{Run, StationRow};

/// A station's run in a few numbers, updated row by row.
#[derive(Clone, Debug)]
pub struct Summary<'w> {
    world: &'w World,
    /// The number of rows.
    pub rows: u64,
    /// The largest |torque| of world and links in N·m (linear: N), before levels and limit.
    pub peak_torque: f64,
    /// The time of that torque, in s.
    pub peak_time: f64,
    /// The largest |command|, in the same unit.
    pub peak_command: f64,
    /// The largest |torque| of its links.
    pub peak_link: f64,
    /// The number of samples whose torque exceeds the motor's limit.
    pub clipped: u64,
    /// The first of them, k, and its time in s.
    pub first_clipped: Option<(u64, f64)>,
    /// The number of steps of the bodies whose iteration for the nonlinear torques has not converged: such a step loses energy.
    pub unsettled: u32,
    /// The device's works over the run.
    pub ledger: Ledger,
    limit: f64,
    /// The puck, bodies and bristles of the last row.
    last: (f64, Vec<(f64, f64)>, Vec<f64>),
    has_bristles: bool,
    growth: Option<Growth>,
}

impl<'w> Summary<'w> {
    /// Before the first row of `run`, a run of this world.
    pub fn new(world: &'w World, run: &Simulation) -> Self {
        Summary {
            world,
            rows: 0,
            peak_torque: 0.0,
            peak_time: 0.0,
            peak_command: 0.0,
            peak_link: 0.0,
            clipped: 0,
            first_clipped: None,
            unsettled: 0,
            ledger: Ledger::default(),
            limit: world.device.limit.unwrap_or(f64::INFINITY),
            last: (0.0, vec![(0.0, 0.0); world.bodies.len()], vec![0.0; world.couplings.len()]),
            has_bristles: world.couplings.iter().any(|coupling| coupling.law.has_bristle()),
            growth: run.still_from().filter(|_| run.is_even()).and_then(|from| Growth::new(world, from, run.rows())),
        }
    }

    /// Adds the next row.
    #[inline]
    pub fn add(&mut self, row: &Row) {
        self.add_with(row, row.torque);
    }

    /// Adds the next row, with the torque of world and links.
    #[inline]
    fn add_with(&mut self, row: &Row, torque: f64) {
        let torque = torque.abs();
        if torque > self.peak_torque {
            (self.peak_torque, self.peak_time) = (torque, row.time);
        }
        if row.command.abs() > self.peak_command {
            self.peak_command = row.command.abs();
        }
        if torque > self.limit {
            self.clipped += 1;
            self.first_clipped.get_or_insert((self.rows, row.time));
        }
        if let Some(growth) = &mut self.growth {
            growth.add(row.time, &self.last.1, &row.bodies);
        }
        self.rows += 1;
        self.last.0 = row.puck;
        self.last.1.clone_from(&row.bodies);
        if self.has_bristles {
            self.last.2.clone_from(&row.bristles);
        }
        (self.ledger, self.unsettled) = (row.ledger, row.unsettled);
    }

    /// The energy that the world stores at the last row, in J.
    pub fn final_energy(&self) -> f64 {
        if self.rows == 0 { 0.0 } else { world_energy(self.world, self.last.0, &self.last.1, &self.last.2) }
    }

    /// The exponent of the bodies' motion in 1/s, fitted to the run while the puck is held still; `None` if it is never held still, if
    /// nothing moves, or if a nonlinear coupling is at a body (then there is no single exponent).
    pub fn fitted_growth(&self) -> Option<f64> {
        self.growth.as_ref().and_then(Growth::slope)
    }
}

/// A run of a system in a few numbers, updated row by row.
#[derive(Clone, Debug)]
pub struct SystemSummary<'s> {
    /// In file order.
    pub stations: Vec<Summary<'s>>,
    /// Of a network: the largest net energy that all hands together have drawn from it up to any instant, in J; 0 where they have drawn none. Where
    /// the stations take their samples at different times its error is at most [`SystemSummary::blur`].
    pub drawn: f64,
    /// Of a network: the sum of |work| between hands and network, sample by sample, in J.
    pub exchanged: f64,
    /// For each station, the largest work of its hand within a sample, J.
    steps: Vec<f64>,
    /// For each station, the instant of its last row, s.
    times: Vec<f64>,
    /// Whether there are instants at which all stations take a sample.
    is_common: bool,
}

/// Whether all stations take a sample at each of the slowest one's.
fn is_common(system: &System) -> bool {
    let slowest = system.stations.iter().map(|station| station.world.sampling.period).fold(0.0, f64::max);
    let is_even = |scenario: &hapt_model::Scenario| scenario.timing == Timing::Even;
    system.stations.iter().all(|station| {
        let samples = slowest / station.world.sampling.period;
        station.drift == 0.0
            && station.phase == system.stations[0].phase
            && (samples - samples.round()).abs() < 1e-9
            && station.world.scenarios.iter().all(is_even)
    })
}

impl<'s> SystemSummary<'s> {
    /// Before the first row of `run`, a run of this system.
    pub fn new(system: &'s System, run: &Run) -> Self {
        let stations = system.stations.iter().zip(run.stations());
        let stations: Vec<_> = stations.map(|(station, run)| Summary::new(&station.world, run)).collect();
        SystemSummary {
            drawn: 0.0,
            exchanged: 0.0,
            steps: vec![0.0; stations.len()],
            times: vec![f64::NEG_INFINITY; stations.len()],
            is_common: is_common(system),
            stations,
        }
    }

    /// Adds the next row.
    #[inline(always)]
    pub fn add(&mut self, row: &StationRow<'_>) {
        match self.stations.as_mut_slice() {
            [station] if !row.is_linked => station.add(row.row),
            _ => self.add_linked(row),
        }
    }

    #[inline(never)]
    fn add_linked(&mut self, row: &StationRow<'_>) {
        let StationRow { station, row, link, .. } = *row;
        let of = &mut self.stations[station];
        of.peak_link = of.peak_link.max(link.abs());
        let step = (row.ledger.hand - of.ledger.hand).abs();
        of.add_with(row, row.torque + link);
        self.steps[station] = self.steps[station].max(step);
        self.times[station] = row.time;
        self.exchanged += step;
        // With common instants the sum is taken only after all stations' samples there: before, one of them is a sample behind.
        if self.is_together(row.time) {
            self.drawn = self.drawn.max(self.had());
        }
    }

    /// Whether the works of all hands are current at `time`: all stations have taken a sample then, or there are no common instants.
    pub fn is_together(&self, time: f64) -> bool {
        !self.is_common || self.times.iter().all(|of| (of - time).abs() < 1e-9)
    }

    /// The net energy that all hands together have drawn by their last samples, in J.
    pub fn had(&self) -> f64 {
        -self.stations.iter().map(|of| of.ledger.hand).sum::<f64>()
    }

    /// The largest torque of any station, N·m (linear: N).
    pub fn peak_torque(&self) -> f64 {
        self.stations.iter().map(|of| of.peak_torque).fold(0.0, f64::max)
    }

    /// A bound on the error of the energy drawn, in J, where the stations take their samples at different times.
    pub fn blur(&self) -> f64 {
        if self.is_common { 0.0 } else { self.steps.iter().sum() }
    }
}
