//! A record from a table of another program: CSV with named columns, units in the names.

use hapt_model::{Dimension, Motion, Unit};

use crate::Error;

/// Names that mean a time, a position, a torque, without their units; the first that a table has counts.
const TIMES: &[&str] = &["time", "t", "timestamp"];
const POSITIONS: &[&str] = &["measured", "position", "angle", "puck", "pos", "theta"];
const TORQUES: &[&str] = &["command", "applied", "torque", "tau", "force"];

/// Which columns of a table to take; `None`: by their names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// The column's name, as it stands in the header.
    pub time: Option<String>,
    /// The same.
    pub position: Option<String>,
    /// The same.
    pub torque: Option<String>,
    /// A spring from the puck to ground that the loop ran, in N·m/rad (N/m): the torques where the table has none.
    pub spring: Option<f64>,
    /// There is no torque: a coast-down.
    pub coasts: bool,
    /// Counts a revolution (linear: the count's size in m), for positions in `counts`.
    pub counts: Option<f64>,
}

/// What a column's numbers are multiplied by, and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// From 0.
    pub column: usize,
    /// To SI.
    pub factor: f64,
}

impl Columns {
    /// From `time=NAME,position=NAME,torque=NAME`; any of them may be left out.
    ///
    /// # Errors
    /// What is no such list.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut columns = Columns::default();
        for part in text.split(',').filter(|part| !part.trim().is_empty()) {
            let wrong =
                || Error::Columns(format!("\"{}\" is none of time=NAME, position=NAME, torque=NAME", part.trim()));
            let (what, name) = part.split_once('=').ok_or_else(wrong)?;
            let place = match what.trim() {
                "time" => &mut columns.time,
                "position" => &mut columns.position,
                "torque" => &mut columns.torque,
                _ => return Err(wrong()),
            };
            *place = Some(name.trim().to_string());
        }
        Ok(columns)
    }

    /// Times, positions and torques of a table in SI, and whether its puck turns: the header names the columns, with their units behind
    /// the last underscore (`angle_deg`), in parentheses or in brackets. Commas, semicolons or tabs between them; lines that begin with
    /// # are left out.
    ///
    /// # Errors
    /// [`Error::Columns`] with the line where it can be read no further.
    pub fn read(&self, text: &str) -> Result<([Vec<f64>; 3], Motion), Error> {
        let mut lines = text.trim_start_matches('\u{feff}').lines().zip(1..).filter(|(line, _)| is_content(line));
        let (header, _) = lines.next().ok_or_else(|| Error::Columns("the file is empty".into()))?;
        let separator = [',', ';', '\t'].into_iter().max_by_key(|c| header.matches(*c).count()).unwrap_or(',');
        let names: Vec<&str> = header.split(separator).map(|name| name.trim().trim_matches('"')).collect();
        let time = self.place(&names, "time", &self.time, TIMES)?;
        let position = self.place(&names, "position", &self.position, POSITIONS)?;
        let time = scale(&names, time, &[Dimension::TIME], None)?.0;
        let (position, motion) = self.position(&names, position)?;
        let torque = match (self.coasts, self.spring) {
            (true, _) | (_, Some(_)) => None,
            (false, None) => {
                let place = self.place(&names, "torque", &self.torque, TORQUES)?;
                let wanted = if motion == Motion::Linear { Dimension::FORCE } else { Dimension::TORQUE };
                Some(scale(&names, place, &[wanted], None)?.0)
            }
        };
        let mut rows: [Vec<f64>; 3] = Default::default();
        for (line, number) in lines {
            let fields: Vec<&str> = line.split(separator).collect();
            let value = |scale: Scale| -> Result<f64, Error> {
                let field = fields.get(scale.column).copied().unwrap_or_default().trim();
                let value = field.parse::<f64>().ok().filter(|value| value.is_finite());
                let shown: String = field.chars().take(40).collect();
                let name = names[scale.column];
                let wrong = || Error::Columns(format!("line {number}: {name} is {shown:?}, no finite number"));
                value.map(|value| value * scale.factor).ok_or_else(wrong)
            };
            rows[0].push(value(time)?);
            rows[1].push(value(position)?);
            let spring = self.spring.unwrap_or(0.0);
            let at = rows[1].last().copied().unwrap_or_default();
            rows[2].push(torque.map_or(Ok(0.0 - spring * at), value)?);
        }
        Ok((rows, motion))
    }

    /// Where the column stands that somebody has named, or the first whose name is one of `usual`.
    fn place(&self, names: &[&str], what: &str, named: &Option<String>, usual: &[&str]) -> Result<usize, Error> {
        let found = match named {
            Some(named) => names.iter().position(|name| name == named),
            None => usual.iter().find_map(|usual| {
                let is_it = |name: &&str| split(name).0.eq_ignore_ascii_case(usual);
                names.iter().position(is_it)
            }),
        };
        found.ok_or_else(|| {
            let mut there: Vec<String> = names.iter().take(12).map(|name| name.chars().take(40).collect()).collect();
            there.resize(there.len().max(1), String::new());
            let missing = named
                .as_ref()
                .map_or(format!("no column looks like a {what}"), |named| format!("there is no column \"{named}\""));
            let how = format!("--columns {what}=NAME names one");
            Error::Columns(format!("{missing}; the columns are {}; {how}", there.join(", ")))
        })
    }

    fn position(&self, names: &[&str], place: usize) -> Result<(Scale, Motion), Error> {
        let (scale, dimension) = scale(names, place, &[Dimension::ANGLE, Dimension::LENGTH], Some(self.counts))?;
        Ok((scale, if dimension == Dimension::LENGTH { Motion::Linear } else { Motion::Rotary }))
    }
}

fn is_content(line: &&str) -> bool {
    !line.trim().is_empty() && !line.trim_start().starts_with('#')
}

/// A column's name and its unit: what stands in parentheses or brackets, or behind the last underscore.
fn split(name: &str) -> (&str, &str) {
    let bracketed = name.split_once(['(', '[']).map(|(name, unit)| (name, unit.trim_end_matches([')', ']'])));
    let (name, unit) = bracketed.or_else(|| name.rsplit_once('_')).unwrap_or((name, ""));
    (name.trim(), unit.trim())
}

/// The scale of a column by its unit, which must be of one of the `wanted` dimensions; `counts`: the column may be in counts.
fn scale(
    names: &[&str],
    column: usize,
    wanted: &[Dimension],
    counts: Option<Option<f64>>,
) -> Result<(Scale, Dimension), Error> {
    let (name, unit) = (names[column], split(names[column]).1);
    let wants = wanted.iter().map(Dimension::to_string).collect::<Vec<_>>().join(" or ");
    if let (Some(counts), "count" | "counts" | "cts") = (counts, unit) {
        let missing =
            || Error::Columns(format!("column {name} is in counts; --counts N gives the counts per revolution"));
        let counts = counts.ok_or_else(missing)?;
        return Ok((Scale { column, factor: std::f64::consts::TAU / counts }, Dimension::ANGLE));
    }
    let unit = match Unit::parse(unit) {
        Ok(unit) => unit,
        Err(_) => {
            let message =
                format!("column {name} has no known unit; expected {wants}, such as in angle_deg, t_ms or tau_mNm");
            return Err(Error::Columns(message));
        }
    };
    let dimension = unit.dimension();
    if !wanted.iter().any(|wanted| wanted.accepts(dimension)) {
        return Err(Error::Columns(format!("column {name} is {dimension}; expected {wants}")));
    }
    let factor = unit.factor() * 10f64.powi(unit.decimal_exponent() as i32);
    Ok((Scale { column, factor }, dimension))
}
