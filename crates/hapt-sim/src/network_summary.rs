//! The summary of a network's run: peaks at each station, and what the hands have had from all of it.

use hapt_model::{System, Timing};

use crate::network::NetworkRow;

/// A run of a network in a few numbers, gathered row by row.
#[derive(Clone, Debug)]
pub struct NetworkSummary {
    /// In file order.
    pub stations: Vec<StationSummary>,
    /// The most energy that all hands together have had from the network at any instant, in J; 0 where they never had any. Where the
    /// stations take their samples at different times it may be off by [`NetworkSummary::blur`].
    pub drawn: f64,
    /// All the work that has gone between hands and network, in J.
    pub exchanged: f64,
    /// Whether there are instants at which all stations take a sample.
    is_common: bool,
}

/// One station's part.
#[derive(Clone, Copy, Debug, Default)]
pub struct StationSummary {
    /// Its samples.
    pub rows: u64,
    /// The largest |torque| of its world and its links, before levels and limit, N·m (linear: N).
    pub peak_torque: f64,
    /// The largest |command|, in the same unit.
    pub peak_command: f64,
    /// The largest |torque| of its links.
    pub peak_link: f64,
    /// The work of its hand, J.
    pub hand: f64,
    /// The largest work of its hand within a sample, J.
    step: f64,
    /// The instant of its last row, s.
    time: f64,
}

/// Whether all stations take a sample at each of the slowest one's.
fn is_common(network: &System) -> bool {
    let slowest = network.stations.iter().map(|station| station.world.sampling.period).fold(0.0, f64::max);
    let is_even = |scenario: &hapt_model::Scenario| scenario.timing == Timing::Even;
    network.stations.iter().all(|station| {
        let samples = slowest / station.world.sampling.period;
        station.drift == 0.0
            && station.phase == network.stations[0].phase
            && (samples - samples.round()).abs() < 1e-9
            && station.world.scenarios.iter().all(is_even)
    })
}

impl NetworkSummary {
    /// Before the first row of a run of this network.
    pub fn new(network: &System) -> Self {
        let none = StationSummary { time: f64::NEG_INFINITY, ..StationSummary::default() };
        let stations = vec![none; network.stations.len()];
        NetworkSummary { stations, drawn: 0.0, exchanged: 0.0, is_common: is_common(network) }
    }

    /// Adds the next row.
    pub fn add(&mut self, row: &NetworkRow<'_>) {
        let NetworkRow { station, row, link } = *row;
        let of = &mut self.stations[station];
        of.rows += 1;
        of.peak_torque = of.peak_torque.max((row.torque + link).abs());
        of.peak_command = of.peak_command.max(row.command.abs());
        of.peak_link = of.peak_link.max(link.abs());
        let step = (row.ledger.hand - of.hand).abs();
        of.step = of.step.max(step);
        (of.hand, of.time) = (row.ledger.hand, row.time);
        self.exchanged += step;
        // Stations that take their samples together are looked at when all have: else one of them is a sample behind.
        if self.is_together(row.time) {
            self.drawn = self.drawn.max(self.had());
        }
    }

    /// Whether the works of all hands are known at an instant: all stations have taken a sample then, or there are no such instants.
    pub fn is_together(&self, time: f64) -> bool {
        !self.is_common || self.stations.iter().all(|of| (of.time - time).abs() < 1e-9)
    }

    /// What all hands together have had by their last samples, in J.
    pub fn had(&self) -> f64 {
        -self.stations.iter().map(|of| of.hand).sum::<f64>()
    }

    /// The largest torque of any station, N·m (linear: N).
    pub fn peak_torque(&self) -> f64 {
        self.stations.iter().map(|of| of.peak_torque).fold(0.0, f64::max)
    }

    /// How much of the energy drawn may be missing, or too much, because the stations take their samples at different times, J.
    pub fn blur(&self) -> f64 {
        if self.is_common { 0.0 } else { self.stations.iter().map(|of| of.step).sum() }
    }
}
