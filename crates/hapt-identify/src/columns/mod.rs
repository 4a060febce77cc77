//! A record from a table of another program: CSV with named columns, units in the names.

mod encoding;
mod table;

use hapt_model::{Dimension, Motion, Unit};

use crate::Error;
pub use encoding::text_of;
use table::{Table, with_units};

/// Names of a time, a position, a torque, without their units; the first that a table has is taken. A log of hapt's loop in real time has the
/// supervisor's output beside the command.
const TIMES: &[&str] = &["time", "t", "timestamp"];
const POSITIONS: &[&str] = &["measured", "position", "angle", "puck", "pos", "theta"];
const TORQUES: &[&str] = &["output_Nm", "output_N", "command", "applied", "torque", "tau", "force"];

/// Which columns of a table to take; `None`: by their names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// The column's name, as in the header.
    pub time: Option<String>,
    /// The position column's name.
    pub position: Option<String>,
    /// The torque column's name.
    pub torque: Option<String>,
    /// The same, of a second torque that a sensor measured; `None`: there is none.
    pub force: Option<String>,
    /// The stiffness of the spring from the puck to ground that the loop ran, in N·m/rad (N/m); it gives the torques where the table has
    /// none.
    pub spring: Option<f64>,
    /// There is no torque: a coast-down.
    pub coasts: bool,
    /// Counts a revolution (linear: the count's size in m), for positions in `counts`.
    pub counts: Option<f64>,
    /// The motor's torque constant in N·m/A (N/A), for a torque column in A or mA, and in V or mV.
    pub torque_constant: Option<f64>,
    /// The motor's winding resistance in Ω, for a torque column in V or mV.
    pub resistance: Option<f64>,
    /// Turns of the motor for one of the handle, where the torque column is of the motor's side.
    pub ratio: Option<f64>,
}

/// The motion in a table, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Read {
    /// In s.
    pub times: Vec<f64>,
    /// In rad (m).
    pub positions: Vec<f64>,
    /// In N·m (N); for a voltage, the torque of the motor at rest.
    pub torques: Vec<f64>,
    /// A second torque, in its column's unit.
    pub forces: Option<Vec<f64>>,
    /// Whether the puck turns.
    pub motion: Motion,
    /// The damping k²/R of a motor that is driven by a voltage, at the handle, in N·m·s/rad (N·s/m); else 0. See
    /// [`crate::Known::back_damping`].
    pub back_damping: f64,
    /// Lines without a number in one of the columns that are used, and all lines. Where only the position is missing it is NaN; other lines of
    /// these are left out.
    pub missing: [usize; 2],
    /// The period of an even clock that was rounded to times of which several samples in a row have the same one; else `None`.
    pub period: Option<f64>,
}

/// The factor and the place of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The column's index, from 0.
    pub column: usize,
    /// The factor to SI.
    pub factor: f64,
}

impl Columns {
    /// From `time=NAME,position=NAME,torque=NAME,force=NAME`; any of them may be left out.
    ///
    /// # Errors
    /// For any other text.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut columns = Columns::default();
        for part in text.split(',').filter(|part| !part.trim().is_empty()) {
            let wrong = || {
                Error::Columns(format!(
                    "\"{}\" is none of time=NAME, position=NAME, torque=NAME, force=NAME",
                    part.trim()
                ))
            };
            let (what, name) = part.split_once('=').ok_or_else(wrong)?;
            let place = match what.trim() {
                "time" => &mut columns.time,
                "position" => &mut columns.position,
                "torque" => &mut columns.torque,
                "force" => &mut columns.force,
                _ => return Err(wrong()),
            };
            *place = Some(name.trim().to_string());
        }
        Ok(columns)
    }

    /// Times, positions and torques of a table in SI, and whether its puck turns: the header names the columns, with their units after the
    /// last underscore (`angle_deg`), in parentheses, in brackets or on a line of units below. Commas, semicolons, tabs or spaces separate fields; where these are
    /// not commas, numbers may have decimal commas. Lines that begin with # or % are left out, and so is a sample without a time or a
    /// torque (an empty field, NaN) or that repeats the time before it, up to a tenth of all. Where more have the same time, and
    /// differ, the times are those of an even clock that was rounded, if there is one. A position that is missing is NaN.
    ///
    /// # Errors
    /// [`Error::Columns`] with the first line that cannot be read.
    pub fn read(&self, text: &str) -> Result<([Vec<f64>; 3], Motion), Error> {
        let Read { times, positions, torques, motion, .. } = self.read_all(text)?;
        Ok(([times, positions, torques], motion))
    }

    /// The same with a second torque, and with the damping that a motor on a voltage adds. A column whose header has no unit is named with
    /// one: `angle [deg]`.
    ///
    /// # Errors
    /// The errors of [`Columns::read`].
    pub fn read_all(&self, text: &str) -> Result<Read, Error> {
        let text = with_units(text);
        let mut table = Table::new(&text)?;
        for named in [&self.time, &self.position, &self.torque, &self.force].into_iter().flatten() {
            table.give_unit(named, split(named));
        }
        let table = table;
        let names = &table.names;
        let time = self.place(&table, "time", &self.time, TIMES)?;
        let position = self.place(&table, "position", &self.position, POSITIONS)?;
        let time = scale(names, time, &[Dimension::TIME], None)?.0;
        let (position, motion) = self.position(names, position)?;
        let torque = match (self.coasts, self.spring) {
            (true, _) | (_, Some(_)) => None,
            (false, None) => {
                let place = self.place(&table, "torque", &self.torque, TORQUES)?;
                Some(self.torque(&table, place, motion)?)
            }
        };
        let force = match &self.force {
            None => None,
            Some(_) => Some(sensor(names, self.place(&table, "force", &self.force, &[])?)?),
        };
        let mut rows: [Vec<f64>; 4] = Default::default();
        let (mut missing, mut all) = (0, 0);
        for (line, number) in table.lines() {
            let fields: Vec<&str> = table.fields(line).collect();
            // Trailing empty fields are ignored.
            let filled = fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1);
            if filled > names.len() {
                return Err(Error::Columns(format!(
                    "line {number} has {filled} fields under {} names; expected as many, and numbers with decimal commas between semicolons or tabs",
                    names.len()
                )));
            }
            let value = |scale: Scale| -> Result<Option<f64>, Error> {
                let field = fields.get(scale.column).copied().unwrap_or_default().trim_matches('"');
                let shown: String = field.chars().take(40).collect();
                let name = names[scale.column];
                let wrong = || Error::Columns(format!("line {number}: {name} is {shown:?}, no finite number"));
                if field.is_empty() || field.eq_ignore_ascii_case("nan") {
                    return Ok(None);
                }
                table.number(field).filter(|value| value.is_finite()).map(|x| Some(x * scale.factor)).ok_or_else(wrong)
            };
            all += 1;
            let no = Ok(Some(0.0));
            let at = value(position)?;
            missing += usize::from(at.is_none());
            // With a spring the torque follows from the position.
            let at = at.or(self.spring.is_none().then_some(f64::NAN));
            let (Some(t), Some(at), Some(torque), Some(force)) =
                (value(time)?, at, torque.map_or(no.clone(), value)?, force.map_or(no, value)?)
            else {
                missing += usize::from(at.is_some_and(|at| !at.is_nan()));
                continue;
            };
            rows[0].push(t);
            rows[1].push(at);
            rows[2].push(self.spring.map_or(torque, |stiffness| torque - stiffness * at));
            rows[3].push(force);
        }
        let repeated = repeated(&rows);
        let mut repeats = repeated.iter().filter(|is| **is != Repeated::No).count();
        let are_rounded = MOST_LEFT_OUT * repeats > all && repeated.contains(&Repeated::Other);
        let clock = if are_rounded { even_clock(&rows[0]) } else { None };
        if let Some([first, period]) = clock {
            rows[0].iter_mut().enumerate().for_each(|(i, t)| *t = first + period * i as f64);
            repeats = 0;
        } else {
            for row in &mut rows {
                let mut repeated = repeated.iter();
                row.retain(|_| repeated.next() == Some(&Repeated::No));
            }
        }
        for (count, what) in
            [(missing, "have no number in one of the columns that are used"), (repeats, "repeat the time before")]
        {
            if MOST_LEFT_OUT * count > all {
                return Err(Error::Columns(format!(
                    "{count} of {all} lines {what}; up to a tenth of them may; {}",
                    table.listed()
                )));
            }
        }
        // Where no column changes, the error says that.
        let still = |list: &[f64]| list.windows(2).all(|pair| pair[0] == pair[1]);
        if let Some(torque) = torque.filter(|_| still(&rows[2]) && !still(&rows[1])) {
            return Err(Error::Columns(format!(
                "{} stands still at {} throughout, so it was not recorded or never changed; a torque that steps up and down is needed (or --coast for none, --spring where the loop ran one); {}",
                names[torque.column],
                rows[2][0] / torque.factor,
                table.listed()
            )));
        }
        let back_damping = match (torque, self.torque_constant, self.resistance) {
            (Some(torque), Some(constant), Some(resistance)) if is_voltage(names[torque.column]) => {
                (constant * self.ratio.unwrap_or(1.0)).powi(2) / resistance
            }
            _ => 0.0,
        };
        let [times, positions, torques, forces] = rows;
        Ok(Read {
            times,
            positions,
            torques,
            forces: force.map(|_| forces),
            motion,
            back_damping,
            missing: [missing, all],
            period: clock.map(|[_, period]| period),
        })
    }

    /// The torque's scale: a torque, or a current with its constant; at the handle.
    fn torque(&self, table: &Table<'_>, place: usize, motion: Motion) -> Result<Scale, Error> {
        let wanted = if motion == Motion::Linear { Dimension::FORCE } else { Dimension::TORQUE };
        let ratio = self.ratio.unwrap_or(1.0);
        let name = table.names[place];
        let ampere = match split(name).1 {
            "A" => Some(1.0),
            "mA" => Some(1e-3),
            _ => None,
        };
        if let Some(ampere) = ampere {
            let missing = || {
                Error::Columns(format!("column {name} is a current; --torque-constant 0.05 gives the motor's N m/A"))
            };
            let constant = self.torque_constant.ok_or_else(missing)?;
            return Ok(Scale { column: place, factor: ampere * constant * ratio });
        }
        if is_voltage(name) {
            let (Some(constant), Some(resistance)) = (self.torque_constant, self.resistance) else {
                return Err(Error::Columns(format!(
                    "column {name} is a voltage, and a motor's torque is k/R (u - k ω); --torque-constant 0.05 gives its k in N m/A, --resistance 2.3 its R in ohm"
                )));
            };
            let volt = if split(name).1 == "mV" { 1e-3 } else { 1.0 };
            return Ok(Scale { column: place, factor: volt * constant / resistance * ratio });
        }
        let scale = scale(&table.names, place, &[wanted], None)?.0;
        Ok(Scale { factor: scale.factor * ratio, ..scale })
    }

    /// The place of the column that the user named, or of the first whose name is one of `usual`, or of the only one that has one of them
    /// in its name and changes.
    fn place(&self, table: &Table<'_>, what: &str, named: &Option<String>, usual: &[&str]) -> Result<usize, Error> {
        let names = &table.names;
        let how = format!("--columns {what}=NAME names one");
        let missing = match named {
            Some(named) => {
                let is_it = |name: &&str| *name == named || split(name).0 == named;
                let mut places = (0..names.len()).filter(|i| is_it(&names[*i]));
                match (places.next(), places.next()) {
                    (Some(place), None) => return Ok(place),
                    (Some(_), Some(_)) => format!("two columns are named \"{named}\"; expected different names"),
                    (None, _) => format!("there is no column \"{named}\""),
                }
            }
            None => {
                let of = |usual: &&str| {
                    let is_it = |name: &str| name == *usual || split(name).0.eq_ignore_ascii_case(usual);
                    let places: Vec<usize> = (0..names.len()).filter(|i| is_it(names[*i])).collect();
                    (!places.is_empty()).then_some(places)
                };
                let like = || -> Vec<usize> {
                    let has = |i: &usize| {
                        usual.iter().any(|word| word.len() > 2 && split(names[*i]).0.to_lowercase().contains(word))
                    };
                    (0..names.len()).filter(has).filter(|i| could_be(names[*i], what) && table.moves(*i)).collect()
                };
                // No name matches: the only column with such a unit that changes.
                let by_unit = || -> Vec<usize> {
                    (0..names.len()).filter(|i| could_be(names[*i], what) && table.moves(*i)).collect()
                };
                let only = |places: Vec<usize>| {
                    let units = if places.is_empty() { by_unit() } else { Vec::new() };
                    if units.len() == 1 { units } else { places }
                };
                // A program may write the same time with each of its signals.
                let different = |places| if what == "time" { table.different(places) } else { places };
                match different(usual.iter().find_map(of).unwrap_or_else(|| only(like())))[..] {
                    [place] => return Ok(place),
                    [] => match different(by_unit())[..] {
                        [] => format!("no column looks like a {what}"),
                        [place] => return Ok(place),
                        ref several => format!("by their units {} columns may be the {what}", several.len()),
                    },
                    [one, other, ..] => format!("{} and {} may both be the {what}", names[one], names[other]),
                }
            }
        };
        Err(Error::Columns(format!("{missing}; {}; {how}", table.listed())))
    }

    fn position(&self, names: &[&str], place: usize) -> Result<(Scale, Motion), Error> {
        let (scale, dimension) = scale(names, place, &[Dimension::ANGLE, Dimension::LENGTH], Some(self.counts))?;
        Ok((scale, if dimension == Dimension::LENGTH { Motion::Linear } else { Motion::Rotary }))
    }
}

/// Whether a line repeats the time before it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Repeated {
    No,
    /// With all its numbers: the sample was written twice.
    Same,
    /// With other numbers: the time was rounded.
    Other,
}

fn repeated([times, rows @ ..]: &[Vec<f64>; 4]) -> Vec<Repeated> {
    let of = |i: usize| match i.checked_sub(1).filter(|before| times[*before] == times[i]) {
        None => Repeated::No,
        Some(before) if rows.iter().all(|row| row[before].to_bits() == row[i].to_bits()) => Repeated::Same,
        Some(_) => Repeated::Other,
    };
    (0..times.len()).map(of).collect()
}

/// The first time and the period of the even clock that gives these times, each of them rounded to no further than the time before or after
/// it. Least squares give it: the last time less the first one has the errors of both. `None` for few different times too.
fn even_clock(times: &[f64]) -> Option<[f64; 2]> {
    let (middle, mean) = (0.5 * (times.len() as f64 - 1.0), times.iter().sum::<f64>() / times.len() as f64);
    let all = || times.iter().enumerate().map(|(i, t)| (i as f64 - middle, t - mean));
    let period = all().map(|(i, t)| i * t).sum::<f64>() / all().map(|(i, _)| i * i).sum::<f64>();
    let first = mean - period * middle;
    let equal: Vec<&[f64]> = times.chunk_by(|a, b| a == b).collect();
    let place = |k: usize| equal.get(k).map(|equal| equal[0]);
    let mut clock = (0..times.len()).map(|i| first + period * i as f64);
    let are_near = equal.iter().enumerate().all(|(k, equal)| {
        let before = k.checked_sub(1).and_then(place).unwrap_or(f64::NEG_INFINITY);
        let after = place(k + 1).unwrap_or(f64::INFINITY);
        clock.by_ref().take(equal.len()).all(|t| before <= t && t <= after)
    });
    (equal.len() >= FEWEST_TIMES && period > 0.0 && are_near).then_some([first, period])
}

/// Fewer different times do not give an even clock to a thousandth.
const FEWEST_TIMES: usize = 200;
/// At most one line in this many may be left out.
const MOST_LEFT_OUT: usize = 10;

fn is_voltage(name: &str) -> bool {
    matches!(split(name).1, "V" | "mV")
}

/// Whether a column's unit is one of a time, a position or a torque.
fn could_be(name: &str, what: &str) -> bool {
    let unit = split(name).1;
    let is = |wanted: &[Dimension]| {
        Unit::parse(&plain(unit)).is_ok_and(|unit| wanted.iter().any(|wanted| wanted.accepts(unit.dimension())))
    };
    match what {
        "time" => is(&[Dimension::TIME]),
        "position" => is(&[Dimension::ANGLE, Dimension::LENGTH]) || is_counts(unit),
        _ => is(&[Dimension::TORQUE, Dimension::FORCE]) || matches!(unit, "A" | "mA" | "V" | "mV"),
    }
}

/// A unit with the product signs of this program's units: `N.m` is `N m`.
fn plain(unit: &str) -> String {
    unit.replace('.', " ")
}

fn is_counts(unit: &str) -> bool {
    matches!(unit, "count" | "counts" | "cts")
}

/// A column's name and its unit: the text in parentheses or brackets, or after the last underscore.
fn split(name: &str) -> (&str, &str) {
    let bracketed = name.split_once(['(', '[']).map(|(name, unit)| (name, unit.trim_end_matches([')', ']'])));
    // A column named `counts` is in counts.
    let alone = (name, if is_counts(name) { name } else { "" });
    let (name, unit) = bracketed.or_else(|| name.rsplit_once('_')).unwrap_or(alone);
    (name.trim(), unit.trim())
}

/// A sensor's column, whose factor is fitted: in a torque's unit, volts or raw numbers, and not in a motion's unit.
fn sensor(names: &[&str], column: usize) -> Result<Scale, Error> {
    let unit = Unit::parse(&plain(split(names[column]).1)).map(|unit| unit.dimension());
    let of_motion = [Dimension::TIME, Dimension::ANGLE, Dimension::LENGTH];
    match unit.ok().filter(|dimension| of_motion.contains(dimension)) {
        Some(dimension) => {
            let wants = "expected a torque, a force, or a sensor's raw numbers";
            Err(Error::Columns(format!("column {} is {dimension}; {wants}", names[column])))
        }
        None => Ok(Scale { column, factor: 1.0 }),
    }
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
    if let Some(counts) = counts.filter(|_| is_counts(unit)) {
        let missing =
            || Error::Columns(format!("column {name} is in counts; --counts N gives the counts per revolution"));
        let counts = counts.ok_or_else(missing)?;
        return Ok((Scale { column, factor: std::f64::consts::TAU / counts }, Dimension::ANGLE));
    }
    let unit = match Unit::parse(&plain(unit)) {
        Ok(unit) => unit,
        Err(_) => {
            let base = split(name).0;
            let given = match wanted {
                [Dimension::TIME] => format!("time=\"{base} [ms]\""),
                [Dimension::ANGLE, ..] => format!("position=\"{base} [deg]\""),
                _ => format!("torque=\"{base} [N m]\""),
            };
            let message = format!(
                "column {name} has no known unit; expected {wants}, such as in angle_deg, t_ms or tau_mNm; --columns {given} gives it one"
            );
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
