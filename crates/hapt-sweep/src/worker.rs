//! One thread's share of a sweep: blocks of neighbouring cells. Runs and held loops of one body are computed in batches where possible, and
//! values that do not change from cell to cell are kept.

use std::array::from_fn;
use std::ops::Range;

use hapt_analysis::{Parameter, Variants};
use hapt_model::{Method, World};
use hapt_sim::{LANES, run_batch};

use crate::axis::{Place, Ticks};
use crate::measure::{self, Measure, OfRun};
use crate::network_worker::NetworkWorker;
use crate::sweep::{Stop, Sweep};

/// Computes cells: worlds, or networks.
pub(crate) enum Worker<'s> {
    World(Box<WorldWorker<'s>>),
    Network(NetworkWorker<'s>),
}

impl<'s> Worker<'s> {
    pub fn new(sweep: &'s Sweep, ticks: &'s Ticks<'s>, stop: &'s Stop<'s>) -> Self {
        match sweep.system.world() {
            Some(world) => Worker::World(Box::new(WorldWorker::new(sweep, world, ticks, stop))),
            None => Worker::Network(NetworkWorker::new(sweep, &sweep.system, ticks, stop)),
        }
    }

    /// Fills the rows of a block of at most [`LANES`] cells, in order.
    pub fn fill(&mut self, cells: Range<u64>, rows: &mut [Option<f64>]) {
        match self {
            Worker::World(worker) => worker.fill(cells, rows),
            Worker::Network(worker) => worker.fill(cells, rows),
        }
    }
}

/// A batch of worlds of the grid, and the last results.
pub(crate) struct WorldWorker<'s> {
    sweep: &'s Sweep,
    world: &'s World,
    ticks: &'s Ticks<'s>,
    stop: &'s Stop<'s>,
    /// `None` where the sweep measures held loops of one body only.
    worlds: Option<Box<[World; LANES]>>,
    variants: Option<Held>,
    /// The axes' values in each world.
    values: [Vec<f64>; LANES],
    /// For each measure of the loop: the axis values that it depends on, and its last value at those.
    known: Vec<Option<(Vec<f64>, Option<f64>)>>,
}

/// The held loops of a world of one body.
struct Held {
    variants: Variants<LANES>,
    /// For each axis.
    numbers: Vec<Option<Parameter>>,
    growths: [f64; LANES],
    verdicts: [f64; LANES],
}

impl Held {
    fn new(sweep: &Sweep, world: &World) -> Option<Self> {
        let variants = Variants::new(world)?;
        let numbers = sweep.grid.axes.iter().map(|axis| Parameter::of(world, &axis.key)).collect();
        Some(Held { variants, numbers, growths: [f64::NAN; LANES], verdicts: [f64::NAN; LANES] })
    }

    /// Computes the measures of the held loops.
    fn compute(&mut self, sweep: &Sweep, method: Method) {
        let loops = self.variants.loops();
        if sweep.measures.contains(&Measure::HeldGrowth) {
            loops.growths(method, &mut self.growths);
        }
        if sweep.measures.contains(&Measure::HeldVerdict) {
            loops.verdicts(method, &mut self.verdicts);
        }
    }
}

impl<'s> WorldWorker<'s> {
    fn new(sweep: &'s Sweep, world: &'s World, ticks: &'s Ticks<'s>, stop: &'s Stop<'s>) -> Self {
        let variants =
            sweep.measures.iter().any(|measure| measure.of_held_loop()).then(|| Held::new(sweep, world)).flatten();
        let others = variants.is_none() || !sweep.measures.iter().all(|measure| measure.of_held_loop());
        // NaN differs from every first value.
        let values = from_fn(|_| vec![f64::NAN; sweep.grid.axes.len()]);
        let worlds = others.then(|| Box::new(from_fn(|_| world.clone())));
        WorldWorker { sweep, world, ticks, stop, worlds, variants, values, known: vec![None; sweep.measures.len()] }
    }

    fn fill(&mut self, cells: Range<u64>, rows: &mut [Option<f64>]) {
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
            held.compute(self.sweep, self.world.sampling.method);
        }
        for (i, row) in rows.chunks_mut(self.sweep.width()).enumerate().take(count) {
            self.row(i, &runs[i], row);
        }
    }

    /// Sets the i-th world to the values of a cell.
    fn set(&mut self, i: usize, place: &Place) {
        let grid = &self.sweep.grid;
        for (j, at) in place.at.iter().enumerate() {
            let value = self.ticks.value(j, *at);
            let now = &mut self.values[i][j];
            if now.to_bits() == value.to_bits() {
                continue;
            }
            *now = value;
            if let Some(worlds) = &mut self.worlds {
                worlds[i].set_number(&grid.axes[j].key, value);
            }
            if let Some(held) = &mut self.variants
                && let Some(number) = held.numbers[j]
            {
                held.variants.set(i, number, value);
            }
        }
    }

    /// The measures of the first `count` worlds' runs.
    fn runs(&self, count: usize) -> [OfRun; LANES] {
        let none = [OfRun::default(); LANES];
        let (Some(scenario), Some(worlds)) = (self.sweep.scenario, &self.worlds) else { return none };
        let settling = self.sweep.measures.contains(&Measure::SettlingTime);
        // A batch of a few worlds takes no fewer instructions than single runs.
        let outcomes = if settling || count < LANES / 4 { None } else { run_batch(worlds, scenario, self.stop) };
        match outcomes {
            Some(outcomes) => outcomes.map(OfRun::of),
            None => from_fn(|i| {
                let world = &worlds[i];
                let run = world.scenarios.get(scenario).filter(|_| i < count);
                run.map(|scenario| measure::of_run(world, scenario, settling, self.stop)).unwrap_or_default()
            }),
        }
    }

    fn row(&mut self, i: usize, run: &OfRun, row: &mut [Option<f64>]) {
        let sweep = self.sweep;
        let (values, measured) = row.split_at_mut(sweep.grid.axes.len());
        values.iter_mut().zip(&self.values[i]).for_each(|(place, value)| *place = Some(*value));
        for ((measure, known), place) in sweep.measures.iter().zip(&mut self.known).zip(measured) {
            let value = match (measure, &self.variants, &self.worlds) {
                (measure, ..) if measure.of_a_run() => run.value(*measure),
                (Measure::HeldGrowth, Some(held), _) => Some(held.growths[i]),
                (Measure::HeldVerdict, Some(held), _) => Some(held.verdicts[i]),
                (_, _, None) => None,
                (loops, _, Some(worlds)) => {
                    let axes = sweep.grid.axes.iter().zip(&self.values[i]);
                    let seen = axes
                        .filter(|(axis, _)| loops.depends_on(&axis.key, worlds[i].device.handle.is_some()))
                        .map(|(_, value)| *value);
                    match known {
                        Some((values, value)) if seen.clone().eq(values.iter().copied()) => *value,
                        _ => {
                            let value = measure::of_loop(&worlds[i], *loops);
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
