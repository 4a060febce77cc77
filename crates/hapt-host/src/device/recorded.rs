//! The positions of a recording: a run's CSV, or a log.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use hapt_log::Log;
use hapt_model::Motion;
use hapt_rt::Position;

use super::DeviceError;

/// The largest number of positions of a recording: more than three hours at 1 kHz, about 300 MB.
const MAX_SAMPLES: usize = 12_000_000;
/// The longest line of a run: 64 bodies in full digits take a tenth of it.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// The puck's positions and velocities in a run's CSV, or in a log.
///
/// # Errors
/// The file cannot be read, or is neither.
pub(super) fn positions(path: &Path, motion: Motion) -> Result<Vec<Position>, DeviceError> {
    let unreadable = |error| DeviceError::Unreadable { path: path.into(), error };
    let mut file = BufReader::with_capacity(1 << 16, hapt_model::input::open(path).map_err(unreadable)?);
    let is_log = hapt_log::is_log(file.fill_buf().map_err(unreadable)?);
    let positions = if is_log { logged(path, file)? } else { tabled(path, file, motion)? };
    if positions.is_empty() {
        let message = if is_log { "it has no samples" } else { "it has no rows" };
        return Err(DeviceError::Recording { path: path.into(), message: message.into() });
    }
    Ok(positions)
}

/// Adds a position, up to [`MAX_SAMPLES`].
fn add(positions: &mut Vec<Position>, path: &Path, position: f64, velocity: f64) -> Result<(), DeviceError> {
    if positions.len() == MAX_SAMPLES {
        let message =
            format!("it has more than {} million samples; expected a shorter recording", MAX_SAMPLES / 1_000_000);
        return Err(DeviceError::Recording { path: path.into(), message });
    }
    positions.push(Position { position, velocity, announced: true });
    Ok(())
}

fn logged(path: &Path, file: BufReader<impl Read>) -> Result<Vec<Position>, DeviceError> {
    let wrong = |error| {
        if let hapt_log::Error::Unreadable(error) = error {
            DeviceError::Unreadable { path: path.into(), error }
        } else {
            DeviceError::Log { path: path.into(), error }
        }
    };
    let mut log = Log::read(file).map_err(wrong)?;
    let mut positions = Vec::new();
    while let Some(sample) = log.next().map_err(wrong)? {
        // Time, then the puck: the first columns of every log.
        if let [_, position, velocity, ..] = *sample.values {
            add(&mut positions, path, position, velocity)?;
        }
    }
    Ok(positions)
}

fn tabled(path: &Path, mut file: BufReader<impl Read>, motion: Motion) -> Result<Vec<Position>, DeviceError> {
    let wrong = |line: usize, message: String| DeviceError::Line { path: path.into(), line, message };
    let columns = match motion {
        Motion::Rotary => ["puck_rad", "puck_rad_per_s"],
        Motion::Linear => ["puck_m", "puck_m_per_s"],
    };
    let mut places: Option<[usize; 2]> = None;
    let mut positions = Vec::new();
    let mut text = Vec::new();
    for line in 1.. {
        text.clear();
        let read = (&mut file).take(MAX_LINE_BYTES).read_until(b'\n', &mut text);
        match read.map_err(|error| wrong(line, error.to_string()))? as u64 {
            0 => break,
            MAX_LINE_BYTES => return Err(wrong(line, "the line does not end within 1 MiB".into())),
            _ => {}
        }
        let row = std::str::from_utf8(&text).map_err(|_| wrong(line, "it is not UTF-8 text".into()))?;
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        let Some([position, velocity]) = places else {
            let place = |column: &str| {
                let missing = || wrong(line, format!("no column {column}; hapt sim --out writes such files"));
                fields.iter().position(|field| *field == column).ok_or_else(missing)
            };
            places = Some([place(columns[0])?, place(columns[1])?]);
            continue;
        };
        let number = |place: usize| {
            let field = fields.get(place).copied().unwrap_or_default();
            let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| wrong(line, format!("{field:?} is not a finite number")))
        };
        add(&mut positions, path, number(position)?, number(velocity)?)?;
    }
    Ok(positions)
}
