//! One thread's share of a sweep: blocks of neighbouring cells. Runs of worlds and held loops of one body are computed in batches where
//! possible, and values that do not change from cell to cell are kept.

use std::array::from_fn;
use std::ops::Range;

use hapt_analysis::{Parameter, Variants};
use hapt_model::System;
use hapt_sim::{LANES, run_batch};

use super::measure::{self, Checked, Measure, OfRun};
use super::{Stop, Sweep};
use crate::axis::{Place, Ticks};

/// Systems of neighbouring cells, and the last results.
pub(crate) struct Worker<'s> {
    sweep: &'s Sweep,
    ticks: &'s Ticks<'s>,
    stop: &'s Stop<'s>,
    /// `None` where the sweep measures held loops of one body only.
    systems: Option<Box<[System; LANES]>>,
    variants: Option<HeldLoops>,
    /// The axes' values in each system.
    values: [Vec<f64>; LANES],
    /// For each measure of the loop: the axis values that it depends on, and its last value at those.
    known: Vec<Option<(Vec<f64>, Option<f64>)>>,
}

/// The held loops of a world of one body.
struct HeldLoops {
    variants: Variants<LANES>,
    /// For each axis.
    numbers: Vec<Option<Parameter>>,
    growths: [f64; LANES],
    verdicts: [f64; LANES],
}

impl HeldLoops {
    fn new(sweep: &Sweep) -> Option<Self> {
        let world = sweep.system.world()?;
        let variants = Variants::new(world)?;
        let numbers = sweep.grid.axes.iter().map(|axis| Parameter::of(world, &axis.key)).collect();
        Some(HeldLoops { variants, numbers, growths: [f64::NAN; LANES], verdicts: [f64::NAN; LANES] })
    }

    /// Computes the measures of the held loops.
    fn compute(&mut self, sweep: &Sweep) {
        let (loops, method) = (self.variants.loops(), sweep.system.stations[0].world.sampling.method);
        if sweep.measures.contains(&Measure::HeldGrowth) {
            loops.growths(method, &mut self.growths);
        }
        if sweep.measures.contains(&Measure::HeldVerdict) {
            loops.verdicts(method, &mut self.verdicts);
        }
    }
}

impl<'s> Worker<'s> {
    pub fn new(sweep: &'s Sweep, ticks: &'s Ticks<'s>, stop: &'s Stop<'s>) -> Self {
        let variants =
            sweep.measures.iter().any(|measure| measure.of_held_loop()).then(|| HeldLoops::new(sweep)).flatten();
        let others = variants.is_none() || !sweep.measures.iter().all(|measure| measure.of_held_loop());
        // NaN differs from every first value.
        let values = from_fn(|_| vec![f64::NAN; sweep.grid.axes.len()]);
        let systems = others.then(|| Box::new(from_fn(|_| sweep.system.clone())));
        Worker { sweep, ticks, stop, systems, variants, values, known: vec![None; sweep.measures.len()] }
    }

    /// Fills the rows of a block of at most [`LANES`] cells, in order.
    pub fn fill(&mut self, cells: Range<u64>, rows: &mut [Option<f64>]) {
        let count = (cells.end - cells.start) as usize;
        let mut place = Place::new(&self.sweep.grid, cells.start);
        for i in 0..LANES {
            // Lanes beyond the last cell repeat it.
            if (1..count).contains(&i) {
                place.advance(&self.sweep.grid);
            }
            self.set(i, &place);
        }
        let runs = self.runs(count);
        if let Some(held) = &mut self.variants {
            held.compute(self.sweep);
        }
        for (i, row) in rows.chunks_mut(self.sweep.width()).enumerate().take(count) {
            self.row(i, &runs[i], row);
        }
    }

    /// Sets the i-th system to the values of a cell.
    fn set(&mut self, i: usize, place: &Place) {
        let grid = &self.sweep.grid;
        for (j, at) in place.at.iter().enumerate() {
            let value = self.ticks.value(j, *at);
            let now = &mut self.values[i][j];
            if now.to_bits() == value.to_bits() {
                continue;
            }
            *now = value;
            if let Some(systems) = &mut self.systems {
                systems[i].set_number(&grid.axes[j].key, value);
            }
            if let Some(held) = &mut self.variants
                && let Some(number) = held.numbers[j]
            {
                held.variants.set(i, number, value);
            }
        }
    }

    /// The measures of the first `count` systems' runs.
    fn runs(&self, count: usize) -> [OfRun; LANES] {
        let none = [OfRun::default(); LANES];
        let (Some(scenario), Some(systems)) = (self.sweep.scenario, &self.systems) else { return none };
        let settling = self.sweep.measures.contains(&Measure::SettlingTime);
        // A batch has one world per lane; for few worlds it needs no fewer instructions than single runs.
        let in_batch = self.sweep.system.world().is_some() && !settling && count >= LANES / 4;
        let worlds = || systems.each_ref().map(|system| &system.stations[0].world);
        match in_batch.then(|| run_batch(&worlds(), scenario, self.stop)).flatten() {
            Some(outcomes) => outcomes.map(OfRun::of),
            None => from_fn(|i| {
                let system = Some(&systems[i]).filter(|_| i < count);
                system.map(|system| measure::of_run(system, scenario, settling, self.stop)).unwrap_or_default()
            }),
        }
    }

    fn row(&mut self, i: usize, run: &OfRun, row: &mut [Option<f64>]) {
        let sweep = self.sweep;
        let checked = self.systems.as_ref().map(|systems| Checked::new(&systems[i], self.stop));
        let (values, measured) = row.split_at_mut(sweep.grid.axes.len());
        values.iter_mut().zip(&self.values[i]).for_each(|(place, value)| *place = Some(*value));
        for ((measure, known), place) in sweep.measures.iter().zip(&mut self.known).zip(measured) {
            let value = match (measure, &self.variants, &checked) {
                (measure, ..) if measure.of_a_run() => run.value(*measure),
                (Measure::HeldGrowth, Some(held), _) => Some(held.growths[i]),
                (Measure::HeldVerdict, Some(held), _) => Some(held.verdicts[i]),
                (_, _, None) => None,
                (measure, _, Some(checked)) => {
                    let axes = sweep.grid.axes.iter().zip(&self.values[i]);
                    let seen =
                        axes.filter(|(axis, _)| measure.depends_on(&axis.key, checked.system)).map(|(_, value)| *value);
                    match known {
                        Some((values, value)) if seen.clone().eq(values.iter().copied()) => *value,
                        _ => {
                            let value = checked.value(*measure);
                            *known = Some((seen.collect(), value));
                            value
                        }
                    }
                }
            };
            *place = value.filter(|value| value.is_finite());
        }
    }
}
