//! A run as columns.

use hapt_model::World;
use hapt_sim::{BODY_SIGNALS, Row, SIGNALS, Simulation, Summary, columns};
use serde_json::{Value, json};

use crate::interrupt::Stop;

/// So many rows between two looks at whether the call has been interrupted.
const CHUNK: u64 = 4096;

/// A run: its columns in the order of the CSV, its summary, and why it ended early.
pub struct Columns {
    /// The columns' names.
    pub names: Vec<String>,
    /// The columns, of equal lengths.
    pub values: Vec<Vec<f64>>,
    /// The numbers that `hapt sim` prints.
    pub summary: Value,
    /// Why the run stops before its end.
    pub ended: Option<String>,
}

/// Why there is no run.
pub enum Failure {
    /// The world or the scenario.
    Input(String),
    /// So many bytes.
    Memory(u64),
}

/// Takes the scenario `name` to its end.
pub fn simulate(world: &World, name: &str, stop: &Stop) -> Result<Columns, Failure> {
    let input = |error: &dyn std::fmt::Display| Failure::Input(error.to_string());
    let scenario = world.scenario(name).map_err(|error| input(&error))?;
    let scenario = hapt_analysis::with_worst_pattern(world, scenario).map_err(|error| input(&error))?;
    let mut run = Simulation::new(world, &scenario).map_err(|error| input(&error))?;
    let names: Vec<String> = columns(world).into_iter().map(|column| column.name).collect();
    let bytes = run.rows().saturating_mul(8 * names.len() as u64);
    let mut values = room(run.rows(), names.len()).ok_or(Failure::Memory(bytes))?;
    let mut summary = Summary::new(world, &run);
    let mut ended = None;
    let mut left = CHUNK;
    while let Some(row) = run.next() {
        match row {
            Ok(row) => {
                summary.add(row);
                push(&mut values, row);
            }
            Err(error) => ended = Some(error.to_string()),
        }
        left -= 1;
        if left == 0 {
            left = CHUNK;
            if stop.is_set() {
                break;
            }
        }
    }
    let ledger = summary.ledger;
    let summary = json!({
        "rows": summary.rows,
        "peak_torque": summary.peak_torque,
        "peak_time_s": summary.peak_time,
        "clipped": summary.clipped,
        "first_clipped_s": summary.first_clipped.map(|(_, time)| time),
        "final_energy": summary.final_energy(),
        "growth_per_s": summary.fitted_growth(),
        "hand_energy": ledger.hand,
        "motor_energy": ledger.motor,
        "damping_energy": ledger.damping,
        "friction_energy": ledger.friction,
        "shaft_energy": ledger.shaft,
    });
    Ok(Columns { names, values, summary, ended })
}

/// Columns with room for all rows; `None` where there is not so much memory, for all of them together.
fn room(rows: u64, columns: usize) -> Option<Vec<Vec<f64>>> {
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

fn push(values: &mut [Vec<f64>], row: &Row) {
    let (own, pairs) = values.split_at_mut(SIGNALS.len());
    for (column, signal) in own.iter_mut().zip(&SIGNALS) {
        column.push((signal.get)(row));
    }
    for (pair, (position, velocity)) in pairs.chunks_exact_mut(BODY_SIGNALS.len()).zip(row.pairs()) {
        pair[0].push(position);
        pair[1].push(velocity);
    }
}
