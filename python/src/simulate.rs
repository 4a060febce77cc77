//! The run of a scenario as columns.

use std::ops::ControlFlow;

use hapt_model::System;
use hapt_sim::{BODY_SIGNALS, SIGNALS, StationRow, SystemSummary, station_columns};

/// The number of rows between two checks of whether the call has been interrupted.
const CHUNK: u64 = 4096;
/// The number of rows that are copied to their columns at once.
const BLOCK: usize = 64;

/// A run: each station's columns, in the order of the CSV, and summary.
pub struct Run {
    /// The stations' parts, in file order.
    pub stations: Vec<StationRun>,
    /// The reason for an end before the scenario's duration, if it ends there.
    pub ended: Option<String>,
}

/// One station's part of a run.
pub struct StationRun {
    /// The columns' names.
    pub names: Vec<String>,
    /// The columns, of equal lengths.
    pub values: Vec<Vec<f64>>,
    /// The number of rows.
    pub rows: u64,
    /// The number of samples beyond the motor's limit.
    pub clipped: u64,
    /// The numbers that `hapt sim` prints.
    pub summary: [(&'static str, Option<f64>); 12],
}

/// The reason why a run cannot start.
pub enum Failure {
    /// An invalid system or scenario.
    Input(String),
    /// Not enough memory for this many bytes.
    Memory(u64),
}

/// Runs a scenario to its end, or until `is_over` returns true.
pub fn simulate(system: &System, scenario: &str, is_over: &mut dyn FnMut() -> bool) -> Result<Run, Failure> {
    let mut run = hapt_sim::Run::new(system, scenario).map_err(|error| Failure::Input(error.to_string()))?;
    let mut tables = Vec::new();
    for (at, station) in run.stations().enumerate() {
        let (rows, columns) = (station.rows(), station_columns(system, at).len());
        let bytes = rows.saturating_mul(8 * columns as u64);
        tables.push(Table::with_room(rows, columns).ok_or(Failure::Memory(bytes))?);
    }
    let mut summary = SystemSummary::new(system, &run);
    let mut left = CHUNK;
    let ended = run.try_for_each(|row| {
        summary.add(row);
        tables[row.station].add(row);
        left -= 1;
        if left == 0 {
            left = CHUNK;
            if is_over() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    let ended = ended.err().map(|error| error.to_string());
    let stations = summary.stations.iter().zip(tables).enumerate().map(|(at, (summary, table))| {
        let ledger = summary.ledger;
        StationRun {
            names: station_columns(system, at).into_iter().map(|column| column.name).collect(),
            values: table.finish(),
            rows: summary.rows,
            clipped: summary.clipped,
            summary: [
                ("peak_torque", Some(summary.peak_torque)),
                ("peak_time_s", Some(summary.peak_time)),
                ("first_clipped_s", summary.first_clipped.map(|(_, time)| time)),
                ("final_energy", Some(summary.final_energy())),
                ("growth_per_s", summary.fitted_growth()),
                ("hand_energy", Some(ledger.hand)),
                ("motor_energy", Some(ledger.motor)),
                ("damping_energy", Some(ledger.damping)),
                ("friction_energy", Some(ledger.friction)),
                ("shaft_energy", Some(ledger.shaft)),
                ("stops_energy", Some(ledger.stops)),
                ("field_energy", Some(ledger.field)),
            ],
        }
    });
    Ok(Run { stations: stations.collect(), ended })
}

/// The message for a run that needs this many bytes.
pub fn too_large(bytes: u64) -> String {
    format!(
        "the run's columns take {:.1} GiB, more than the free memory: a shorter duration or a longer period has fewer rows",
        bytes as f64 / f64::from(1 << 30)
    )
}

/// Empty columns with room for all rows; `None` where the memory is not enough for all columns together.
fn columns_with_room(rows: u64, columns: usize) -> Option<Vec<Vec<f64>>> {
    let rows = usize::try_from(rows).ok()?;
    let mut whole = Vec::<f64>::new();
    whole.try_reserve_exact(rows.checked_mul(columns)?).ok()?;
    drop(whole);
    let column = || {
        let mut column = Vec::new();
        column.try_reserve_exact(rows).ok()?;
        Some(column)
    };
    (0..columns).map(|_| column()).collect()
}

/// Columns that grow by a block of rows at a time.
struct Table {
    columns: Vec<Vec<f64>>,
    /// The last rows, which are not in the columns yet, column by column.
    block: Vec<[f64; BLOCK]>,
    filled: usize,
}

impl Table {
    /// An empty table with room for all rows; `None` where the memory is not enough for all columns together.
    fn with_room(rows: u64, columns: usize) -> Option<Self> {
        let all = columns_with_room(rows, columns)?;
        Some(Table { columns: all, block: vec![[0.0; BLOCK]; columns], filled: 0 })
    }

    #[inline]
    fn add(&mut self, StationRow { row, link, is_linked, .. }: &StationRow<'_>) {
        let (own, pairs) = self.block.split_at_mut(SIGNALS.len());
        let place = self.filled;
        for (column, value) in own.iter_mut().zip(SIGNALS.map(|signal| (signal.get)(row))) {
            column[place] = value;
        }
        for (pair, (position, velocity)) in pairs.chunks_exact_mut(BODY_SIGNALS.len()).zip(row.pairs()) {
            pair[0][place] = position;
            pair[1][place] = velocity;
        }
        if let Some(column) = self.block.last_mut().filter(|_| *is_linked) {
            column[place] = *link;
        }
        self.filled += 1;
        if self.filled == BLOCK {
            self.empty_block();
        }
    }

    fn empty_block(&mut self) {
        for (column, block) in self.columns.iter_mut().zip(&self.block) {
            column.extend_from_slice(&block[..self.filled]);
        }
        self.filled = 0;
    }

    fn finish(mut self) -> Vec<Vec<f64>> {
        self.empty_block();
        self.columns
    }
}
