//! One thread's share of a sweep: blocks of neighbouring cells, their runs side by side where these fit, and what does not change
//! from cell to cell kept.

use std::array::from_fn;
use std::ops::Range;

use hapt_model::World;
use hapt_sim::{SIDE, side_by_side};

use crate::measure::{self, Measure, OfRun};
use crate::sweep::Sweep;

/// Worlds of the grid, as many as run side by side, and the last answers.
pub(crate) struct Worker<'s> {
    sweep: &'s Sweep,
    worlds: Box<[World; SIDE]>,
    /// The axes' values in each world.
    values: [Vec<f64>; SIDE],
    /// Of each measure of the loop: the values of the axes that it looks at, and what it then was.
    known: Vec<Option<(Vec<f64>, Option<f64>)>>,
}

impl<'s> Worker<'s> {
    pub fn new(sweep: &'s Sweep) -> Self {
        let worlds = Box::new(from_fn(|_| sweep.world.clone()));
        // No value yet is like another one.
        let values = from_fn(|_| vec![f64::NAN; sweep.grid.axes.len()]);
        Worker { sweep, worlds, values, known: vec![None; sweep.measures.len()] }
    }

    /// The rows of a block of at most [`SIDE`] cells.
    pub fn rows(&mut self, cells: Range<u64>) -> Vec<Vec<Option<f64>>> {
        let count = (cells.end - cells.start) as usize;
        for i in 0..SIDE {
            // Lanes without a cell do what the last one does.
            self.set(i, (cells.start + i as u64).min(cells.end - 1));
        }
        let runs = self.runs(count);
        (0..count).map(|i| self.row(i, &runs[i])).collect()
    }

    /// Makes the i-th world that of the cell.
    fn set(&mut self, i: usize, cell: u64) {
        let grid = &self.sweep.grid;
        for ((axis, now), value) in grid.axes.iter().zip(&mut self.values[i]).zip(grid.values(cell)) {
            if now.to_bits() != value.to_bits() {
                self.worlds[i].set_number(&axis.key, value);
                *now = value;
            }
        }
    }

    /// What the first `count` worlds' runs are asked.
    fn runs(&self, count: usize) -> [OfRun; SIDE] {
        let Some(scenario) = self.sweep.scenario else { return [OfRun::default(); SIDE] };
        let settling = self.sweep.measures.contains(&Measure::SettlingTime);
        // A few are no fewer instructions side by side.
        let outcomes = if settling || count < SIDE / 4 { None } else { side_by_side(&self.worlds, scenario) };
        match outcomes {
            Some(outcomes) => outcomes.map(OfRun::of),
            None => from_fn(|i| {
                let world = &self.worlds[i];
                let run = world.scenarios.get(scenario).filter(|_| i < count);
                run.map(|scenario| measure::of_run(world, scenario, settling)).unwrap_or_default()
            }),
        }
    }

    fn row(&mut self, i: usize, run: &OfRun) -> Vec<Option<f64>> {
        let sweep = self.sweep;
        let mut row = Vec::with_capacity(sweep.grid.axes.len() + sweep.measures.len());
        row.extend(self.values[i].iter().copied().map(Some));
        for (measure, known) in sweep.measures.iter().zip(&mut self.known) {
            let value = match measure {
                Measure::PeakTorque => run.peak_torque,
                Measure::FinalEnergy => run.final_energy,
                Measure::SettlingTime => run.settling_time,
                loops => {
                    let axes = sweep.grid.axes.iter().zip(&self.values[i]);
                    let seen = axes.filter(|(axis, _)| loops.depends_on(&axis.key)).map(|(_, value)| *value);
                    match known {
                        Some((values, value)) if seen.clone().eq(values.iter().copied()) => *value,
                        _ => {
                            let value = measure::of_loop(&self.worlds[i], *loops);
                            *known = Some((seen.collect(), value));
                            value
                        }
                    }
                }
            };
            row.push(value.filter(|value| value.is_finite()));
        }
        row
    }
}
