//! Reads the CSV of a run, for figures.

use std::io::BufRead;

use hapt_model::Motion;

use crate::extremes::Point;
use crate::traces::Traces;

/// An error of a CSV, and its line.
#[derive(Debug, thiserror::Error)]
pub enum CsvError {
    /// It cannot be read.
    #[error("line {line}: {error}")]
    Unreadable {
        /// From 1.
        line: u64,
        /// The error of the system.
        error: std::io::Error,
    },
    /// The motor's limit has the wrong unit for this motion.
    #[error("{0}")]
    Limit(String),
    /// It is not the CSV of a run.
    #[error("line {line}: {message}")]
    Wrong {
        /// From 1.
        line: u64,
        /// The content of the line, and what is expected.
        message: String,
    },
}

/// The meaning of the columns.
struct Columns {
    motion: Motion,
    count: usize,
    time: usize,
    states: Vec<(usize, usize)>,
    names: Vec<String>,
    commanded: usize,
    applied: usize,
}

/// The longest accepted line: 64 bodies in full digits take a tenth of it.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// Reads the CSV of `hapt sim --out`, a line at a time; `limit` returns the motor's limit in SI, which a CSV lacks, once the motion is
/// known. Rows outside of `window`, in s, are read and omitted.
///
/// # Errors
/// The first invalid line: the header, a missing or surplus field, a number that is not finite, decreasing time, or no rows.
pub fn read_csv(
    mut from: impl BufRead,
    limit: impl Fn(Motion) -> Result<Option<f64>, String>,
    window: (f64, f64),
) -> Result<Traces, CsvError> {
    let mut text = Vec::new();
    let mut line = 0u64;
    let mut run: Option<(Columns, Traces)> = None;
    let mut last = f64::NEG_INFINITY;
    let mut numbers = Vec::new();
    loop {
        line += 1;
        text.clear();
        let mut bounded = std::io::Read::take(&mut from, MAX_LINE_BYTES);
        let length = bounded.read_until(b'\n', &mut text).map_err(|error| CsvError::Unreadable { line, error })?;
        let wrong = |message: String| CsvError::Wrong { line, message };
        if length == 0 {
            break;
        }
        if length as u64 == MAX_LINE_BYTES {
            return Err(wrong("the line does not end within 1 MiB".into()));
        }
        let row =
            std::str::from_utf8(&text).map_err(|_| wrong("not UTF-8 text".into()))?.trim_end_matches(['\n', '\r']);
        let Some((columns, traces)) = &mut run else {
            let columns = Columns::new(row).map_err(wrong)?;
            let limit = limit(columns.motion).map_err(CsvError::Limit)?;
            let traces = Traces::new(columns.motion, columns.names.get(1..).unwrap_or_default(), limit).within(window);
            run = Some((columns, traces));
            continue;
        };
        numbers.clear();
        for (field, column) in row.split(',').zip(1..) {
            match field.trim().parse::<f64>() {
                Ok(number) if number.is_finite() => numbers.push(number),
                _ => return Err(wrong(format!("field {column} is {}, no finite number", shown(field)))),
            }
        }
        if numbers.len() != columns.count {
            return Err(wrong(format!("{} fields; the header has {}", numbers.len(), columns.count)));
        }
        let at = |column: usize| numbers.get(column).copied().unwrap_or(0.0);
        let time = at(columns.time);
        if time <= last {
            return Err(wrong(format!("time_s is {time} after {last}; it must increase")));
        }
        last = time;
        let states = columns.states.iter().map(|&(x, v)| -> Point { (at(x), at(v)) });
        traces.add(time, states, at(columns.commanded), at(columns.applied));
    }
    let wrong = |line, message: &str| CsvError::Wrong { line, message: message.into() };
    match run {
        None => Err(wrong(1, "no header; a run's begins with time_s,puck_rad or time_s,puck_m")),
        Some(_) if last == f64::NEG_INFINITY => Err(wrong(2, "no rows")),
        Some((_, traces)) => Ok(traces),
    }
}

fn shown(field: &str) -> String {
    let short: String = field.chars().take(40).collect();
    format!("{short:?}")
}

impl Columns {
    fn new(header: &str) -> Result<Self, String> {
        let names: Vec<&str> = header.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
        let find = |name: &str| {
            names.iter().position(|&column| column == name).ok_or_else(|| {
                format!("the header has no column {name}; expected the columns that hapt sim --out writes")
            })
        };
        let time = find("time_s")?;
        let rotary = names.contains(&"puck_rad");
        if !rotary && !names.contains(&"puck_m") {
            return Err(
                "the header has neither puck_rad nor puck_m; expected the columns that hapt sim --out writes".into()
            );
        }
        let (motion, position, velocity, commanded, applied) = match rotary {
            true => (Motion::Rotary, "_rad", "_rad_per_s", "torque_Nm", "applied_Nm"),
            false => (Motion::Linear, "_m", "_m_per_s", "force_N", "applied_N"),
        };
        let mut states = vec![(find(&format!("puck{position}"))?, find(&format!("puck{velocity}"))?)];
        let mut bodies = vec!["puck".to_string()];
        for (column, name) in names.iter().enumerate() {
            let Some(body) = name.strip_suffix(position) else { continue };
            if body != "puck" && body != "measured" {
                states.push((column, find(&format!("{body}{velocity}"))?));
                bodies.push(body.to_string());
            }
        }
        Ok(Columns {
            motion,
            count: names.len(),
            time,
            states,
            names: bodies,
            commanded: find(commanded)?,
            applied: find(applied)?,
        })
    }
}
