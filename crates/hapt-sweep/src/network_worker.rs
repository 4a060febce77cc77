//! One thread's share of a sweep over a network: cell after cell, each as `check` and a run alone have it.

use std::ops::Range;

use hapt_analysis::{NetworkCheck, check_network};
use hapt_model::System;
use hapt_sim::{NetworkRun, NetworkSummary};

use crate::axis::{Place, Ticks};
use crate::measure::{Measure, STRETCH};
use crate::sweep::{Stop, Sweep};

/// A network of the grid.
pub(crate) struct NetworkWorker<'s> {
    sweep: &'s Sweep,
    ticks: &'s Ticks<'s>,
    stop: &'s Stop<'s>,
    network: System,
}

/// A run in numbers.
struct OfRun {
    summary: NetworkSummary,
    let_go: u64,
}

impl<'s> NetworkWorker<'s> {
    pub fn new(sweep: &'s Sweep, network: &System, ticks: &'s Ticks<'s>, stop: &'s Stop<'s>) -> Self {
        NetworkWorker { sweep, ticks, stop, network: network.clone() }
    }

    pub fn fill(&mut self, cells: Range<u64>, rows: &mut [Option<f64>]) {
        let Sweep { grid, measures, .. } = self.sweep;
        let mut place = Place::new(grid, cells.start);
        let of_check = measures.iter().any(|measure| !measure.of_a_run());
        let of_run = measures.iter().any(|measure| measure.of_a_run());
        for row in rows.chunks_mut(self.sweep.width()).take((cells.end - cells.start) as usize) {
            let (values, measured) = row.split_at_mut(grid.axes.len());
            for (j, (at, value)) in place.at.iter().zip(values).enumerate() {
                let number = self.ticks.value(j, *at);
                self.network.set_number(&grid.axes[j].key, number);
                *value = Some(number);
            }
            let check = if of_check && !(self.stop)() { check_network(&self.network).ok() } else { None };
            let run = if of_run { self.run() } else { None };
            for (measure, place) in measures.iter().zip(measured) {
                let value = of_a_run(run.as_ref(), *measure).or_else(|| of_the_check(check.as_ref(), *measure));
                *place = value.filter(|value| value.is_finite());
            }
            place.advance(grid);
        }
    }

    /// Runs the scenario once; `None` of a run that cannot start, stops being finite or is stopped.
    fn run(&self) -> Option<OfRun> {
        let names = self.network.scenarios();
        let mut run = NetworkRun::new(&self.network, names.get(self.sweep.scenario?)?).ok()?;
        let mut summary = NetworkSummary::new(&self.network);
        let mut rows = 0_u64;
        while let Some(row) = run.next() {
            summary.add(&row.ok()?);
            rows += 1;
            if rows.is_multiple_of(STRETCH) && (self.stop)() {
                return None;
            }
        }
        Some(OfRun { summary, let_go: run.let_go().flatten().sum() })
    }
}

fn of_a_run(run: Option<&OfRun>, measure: Measure) -> Option<f64> {
    let OfRun { summary, let_go } = run?;
    match measure {
        Measure::PeakTorque => Some(summary.peak_torque()),
        Measure::EnergyDrawn => Some((summary.drawn - summary.blur()).max(0.0)),
        Measure::LetGo => Some(*let_go as f64),
        Measure::FinalEnergy
        | Measure::SettlingTime
        | Measure::HeldGrowth
        | Measure::FreeGrowth
        | Measure::HeldVerdict
        | Measure::FreeVerdict
        | Measure::RequiredDamping
        | Measure::Certified
        | Measure::DampingMargin
        | Measure::StiffnessScale
        | Measure::FixedPassive => None,
    }
}

fn of_the_check(check: Option<&NetworkCheck>, measure: Measure) -> Option<f64> {
    let check = check?;
    match measure {
        Measure::Certified => Some(f64::from(u8::from(check.certified))),
        Measure::DampingMargin => {
            let margins = check.stations.iter().map(|station| Some(station.device_damping - station.required_damping?));
            margins.collect::<Option<Vec<f64>>>()?.into_iter().min_by(f64::total_cmp)
        }
        Measure::StiffnessScale => check.remedies.as_ref()?.stiffness_scale,
        Measure::FixedPassive => check.fixed.passive.map(|passive| f64::from(u8::from(passive))),
        Measure::PeakTorque
        | Measure::FinalEnergy
        | Measure::SettlingTime
        | Measure::HeldGrowth
        | Measure::FreeGrowth
        | Measure::HeldVerdict
        | Measure::FreeVerdict
        | Measure::RequiredDamping
        | Measure::EnergyDrawn
        | Measure::LetGo => None,
    }
}
