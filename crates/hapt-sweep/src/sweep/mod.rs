//! A grid of a world with the measures of its cells.

pub mod table;

mod measure;
mod worker;

use std::ops::Range;

use hapt_model::{Source, System};
use hapt_sim::LANES;
use rayon::prelude::*;

use crate::axis::{Grid, Place, Ticks};
use crate::error::Error;
use table::Text;
use worker::Worker;

pub use measure::Measure;

/// The largest number of samples of a run with a settling time, which are kept until its end.
const MAX_KEPT_SAMPLES: f64 = 1e8;

/// The number of pieces of a stretch of cells for each thread, so that no thread waits long for the last one.
const PIECES: u64 = 8;
/// The largest number of cells of a piece, whose text is written in one call.
const MAX_PIECE_CELLS: u64 = 1024;
/// The approximate size of a number's text, in bytes.
const NUMBER_BYTES: usize = 20;

/// Whether the work is to stop; called repeatedly from all threads.
pub(crate) type Stop<'a> = dyn Fn() -> bool + Sync + 'a;

/// A world or network, a grid of its numbers, and measures.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The grid.
    pub grid: Grid,
    /// The measures, in the order of the columns.
    pub measures: Vec<Measure>,
    /// The world or network at the grid's first cell.
    pub system: System,
    /// The index of the scenario, where a measure needs a run.
    pub(crate) scenario: Option<usize>,
}

impl Sweep {
    /// A sweep of the world or network in `source` with the overrides `sets`, over `axes`, each `KEY=FROM..TO:N[:log]`. Measures of a run
    /// need a scenario: the one named, or the only one there is.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn new(
        source: &Source,
        sets: &[String],
        axes: &[String],
        measures: &[Measure],
        scenario: Option<&str>,
    ) -> Result<Self, Error> {
        let (grid, system) = Grid::new(source, sets, axes)?;
        Sweep::of_grid(grid, system, measures, scenario)
    }

    /// The same over a grid, which may be one of listed values, and the world or network at its first cell.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn of_grid(grid: Grid, system: System, measures: &[Measure], scenario: Option<&str>) -> Result<Self, Error> {
        if measures.is_empty() {
            let names: Vec<&str> = Measure::of(&system).map(Measure::name).collect();
            return Err(Error::Measure(format!("nothing to measure: --measure takes {}", names.join(", "))));
        }
        if let Some(measure) = measures.iter().find(|measure| !Measure::of(&system).any(|of| of == **measure)) {
            let names: Vec<&str> = Measure::of(&system).map(Measure::name).collect();
            let message = format!(
                "{} is no measure of a {}; its measures are {}",
                measure.name(),
                system.kind(),
                names.join(", ")
            );
            return Err(Error::Measure(message));
        }
        let scenario = chosen(&system, measures, scenario)?;
        let sweep = Sweep { grid, measures: measures.to_vec(), system, scenario };
        if measures.contains(&Measure::SettlingTime) {
            sweep.fits_memory()?;
        }
        Ok(sweep)
    }

    /// Whether the longest run at a corner can be kept.
    fn fits_memory(&self) -> Result<(), Error> {
        let Some(world) = self.system.world() else { return Ok(()) };
        let Some(scenario) = self.scenario.and_then(|i| world.scenarios.get(i)) else { return Ok(()) };
        let longest = |key: &str, now: f64, pick: fn(f64, f64) -> f64| {
            let axis = self.grid.axes.iter().find(|axis| axis.key == key);
            axis.map_or(now, |axis| pick(axis.from, axis.to))
        };
        let duration = longest(&format!("scenarios.{}.duration", scenario.name), scenario.duration, f64::max);
        let period = longest("loop.period", world.sampling.period, f64::min);
        let samples = duration / period;
        if samples > MAX_KEPT_SAMPLES {
            let message =
                format!("settling_time keeps every sample of a run: {samples:.0} are more than {MAX_KEPT_SAMPLES:.0}");
            return Err(Error::Measure(message));
        }
        Ok(())
    }

    /// The number of rows of the table.
    pub fn cells(&self) -> u64 {
        self.grid.cells
    }

    /// The number of columns.
    pub(crate) fn width(&self) -> usize {
        self.grid.axes.len() + self.measures.len()
    }

    /// The rows of these cells, in their order, on rayon's current pool: the axes' values, then the measures; `None` for a
    /// measure without a value. A cell's result does not depend on its thread or on other cells, so it is bit-identical for any number of
    /// threads.
    pub fn rows(&self, cells: Range<u64>) -> Rows {
        Rows { width: self.width(), values: self.values(cells, &|| false) }
    }

    /// As [`Sweep::rows`]; `stop` is called repeatedly, and ends the work when true: `None`.
    pub fn rows_until(&self, cells: Range<u64>, stop: &Stop<'_>) -> Option<Rows> {
        let values = self.values(cells, stop);
        (!stop()).then(|| Rows { width: self.width(), values })
    }

    /// The same rows as lines of CSV, and the number of rows without a value, for each measure. `ticks` are those of the sweep's grid.
    pub fn lines(&self, ticks: &Ticks<'_>, cells: Range<u64>) -> Lines {
        let count = cells.end - cells.start;
        // Pieces are whole batches; in a short stretch they are small, so that all threads have work.
        let share = count / (PIECES * rayon::current_num_threads() as u64);
        let piece = share.clamp(1, MAX_PIECE_CELLS).next_multiple_of(LANES as u64);
        let stop = || false;
        let pieces = (0..count.div_ceil(piece)).into_par_iter().map_init(
            || (Worker::new(self, ticks, &stop), vec![None; self.width() * LANES]),
            |(worker, rows), i| {
                let first = cells.start + i * piece;
                self.piece(ticks, first..(first + piece).min(cells.end), worker, rows)
            },
        );
        let (text, missing): (Vec<_>, Vec<_>) = pieces.unzip();
        let mut sum = vec![0; self.measures.len()];
        for counts in missing {
            sum.iter_mut().zip(counts).for_each(|(sum, count): (&mut u64, u64)| *sum += count);
        }
        Lines { text, missing: sum }
    }

    /// The lines of neighbouring cells, by one worker.
    fn piece(
        &self,
        ticks: &Ticks<'_>,
        cells: Range<u64>,
        worker: &mut Worker<'_>,
        rows: &mut [Option<f64>],
    ) -> (String, Vec<u64>) {
        let (axes, width) = (self.grid.axes.len(), self.width());
        let mut text = String::with_capacity((cells.end - cells.start) as usize * width * NUMBER_BYTES);
        let mut missing = vec![0; self.measures.len()];
        let mut columns = vec![Text::default(); self.measures.len()];
        let mut place = Place::new(&self.grid, cells.start);
        for first in cells.clone().step_by(LANES) {
            let last = (first + LANES as u64).min(cells.end);
            let rows = &mut rows[..(last - first) as usize * width];
            worker.fill(first..last, rows);
            for row in rows.chunks_exact(width) {
                for (j, at) in place.at.iter().enumerate() {
                    ticks.write(j, *at, &mut text);
                    text.push(',');
                }
                for (i, (value, column)) in row[axes..].iter().zip(&mut columns).enumerate() {
                    missing[i] += u64::from(value.is_none());
                    column.write(*value, &mut text);
                    text.push(if i + 1 < missing.len() { ',' } else { '\n' });
                }
                place.advance(&self.grid);
            }
        }
        (text, missing)
    }

    fn values(&self, cells: Range<u64>, stop: &Stop<'_>) -> Vec<Option<f64>> {
        let (width, count) = (self.width(), (cells.end - cells.start) as usize);
        let (mut values, ticks) = (vec![None; width * count], Ticks::new(&self.grid));
        values.par_chunks_mut(width * LANES).enumerate().for_each_init(
            || Worker::new(self, &ticks, stop),
            |worker, (block, rows)| {
                if stop() {
                    return;
                }
                let first = cells.start + (block * LANES) as u64;
                worker.fill(first..first + (rows.len() / width) as u64, rows);
            },
        );
        values
    }
}

/// The index of the scenario that is named, or needed by a measure of a run.
fn chosen(system: &System, measures: &[Measure], scenario: Option<&str>) -> Result<Option<usize>, Error> {
    let names = system.scenarios();
    if let Some(name) = scenario {
        system.find_scenario(name)?;
        return Ok(names.iter().position(|known| *known == name));
    }
    let Some(measure) = measures.iter().find(|measure| measure.of_a_run()).map(|measure| measure.name()) else {
        return Ok(None);
    };
    match names.len() {
        0 => Err(Error::Measure(format!("{measure} is of a run, and the {} has no scenario", system.kind()))),
        1 => Ok(Some(0)),
        _ => Err(Error::Measure(format!("{measure} is of a run: --scenario takes one of {}", names.join(", ")))),
    }
}

/// Rows of a sweep's table as lines of CSV.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Pieces of the text, one after the other.
    pub text: Vec<String>,
    /// For each measure, the number of rows without its value.
    pub missing: Vec<u64>,
}

/// Rows of a sweep's table.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    width: usize,
    values: Vec<Option<f64>>,
}

impl Rows {
    /// One row after the other.
    pub fn iter(&self) -> std::slice::ChunksExact<'_, Option<f64>> {
        self.values.chunks_exact(self.width)
    }
}

impl<'a> IntoIterator for &'a Rows {
    type Item = &'a [Option<f64>];
    type IntoIter = std::slice::ChunksExact<'a, Option<f64>>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl std::ops::Index<usize> for Rows {
    type Output = [Option<f64>];

    /// The row of cell i of the requested ones.
    fn index(&self, row: usize) -> &Self::Output {
        &self.values[row * self.width..][..self.width]
    }
}
