//! A table of another program, before its columns are interpreted.

use std::borrow::Cow;

use super::could_be;
use crate::Error;

/// The most columns that a message lists.
const LISTED: usize = 24;
/// The longest name in a message, in characters.
const NAME: usize = 40;

/// The header, and the lines below it.
pub(crate) struct Table<'a> {
    pub names: Vec<&'a str>,
    separator: char,
    below: Vec<(&'a str, usize)>,
}

impl<'a> Table<'a> {
    pub fn new(text: &'a str) -> Result<Self, Error> {
        let lines = text.lines().zip(1..).filter(|(line, _)| is_content(line));
        let mut below: Vec<(&str, usize)> = lines.collect();
        if below.is_empty() {
            return Err(Error::Columns("the file is empty".into()));
        }
        let (header, _) = below.remove(0);
        let separator = separator(header, below.first().map(|(line, _)| *line));
        let names: Vec<&str> = fields(header, separator).map(|name| name.trim_matches('"')).collect();
        if names.iter().all(|name| name.replace(',', ".").parse::<f64>().is_ok()) {
            return Err(Error::Columns(
                "the first line is numbers; expected a line of names with units above them, such as time_s,position_rad,torque_Nm".into(),
            ));
        }
        if let [name] = names[..]
            && name.split_whitespace().count() > 1
        {
            return Err(Error::Columns(format!(
                "the first line, {:?}, is one name; expected commas, semicolons, tabs or spaces between columns",
                name.chars().take(NAME).collect::<String>()
            )));
        }
        Ok(Table { names, separator, below })
    }

    /// Renames the only column of a base name to the name with a unit that the user gave it, where the header has none of that name.
    pub fn give_unit(&mut self, named: &'a str, (base, unit): (&str, &str)) {
        if unit.is_empty() || self.names.contains(&named) {
            return;
        }
        let mut places = (0..self.names.len()).filter(|i| self.names[*i] == base);
        if let (Some(place), None) = (places.next(), places.next()) {
            self.names[place] = named;
        }
    }

    pub fn lines(&self) -> impl Iterator<Item = (&'a str, usize)> + '_ {
        self.below.iter().copied()
    }

    /// The fields of a line, without spaces around them.
    pub fn fields(&self, line: &'a str) -> impl Iterator<Item = &'a str> {
        fields(line, self.separator)
    }

    /// A number, with a decimal comma where fields are not separated by commas.
    pub fn number(&self, field: &str) -> Option<f64> {
        match self.separator {
            ',' => field.parse().ok(),
            _ => field.replacen(',', ".", 1).parse().ok(),
        }
    }

    /// The least and the largest number of a column; `None` without any.
    fn range(&self, column: usize) -> Option<(f64, f64)> {
        let values = self.below.iter().filter_map(|(line, _)| self.number(self.fields(line).nth(column)?));
        values.filter(|x| x.is_finite()).fold(None, |range, x| match range {
            None => Some((x, x)),
            Some((low, high)) => Some((x.min(low), x.max(high))),
        })
    }

    pub fn moves(&self, column: usize) -> bool {
        self.range(column).is_some_and(|(low, high)| low < high)
    }

    /// Of columns with the same fields the first.
    pub fn different(&self, columns: Vec<usize>) -> Vec<usize> {
        if columns.len() < 2 {
            return columns;
        }
        let of = |column: usize| -> Vec<&str> {
            self.below.iter().map(|(line, _)| self.fields(line).nth(column).unwrap_or_default()).collect()
        };
        let mut known: Vec<Vec<&str>> = Vec::new();
        let mut is_new = |column: &usize| {
            let fields = of(*column);
            let is_new = !known.contains(&fields);
            if is_new {
                known.push(fields);
            }
            is_new
        };
        columns.into_iter().filter(|column| is_new(column)).collect()
    }

    /// The columns with their ranges, and the quantities that each may be.
    pub fn listed(&self) -> String {
        let of = |(i, name): (usize, &&str)| {
            let name: String = name.chars().take(NAME).collect();
            let may: Vec<&str> =
                ["time", "position", "torque"].into_iter().filter(|what| could_be(&name, what)).collect();
            match self.range(i) {
                None => format!("{name} (no numbers)"),
                Some((low, high)) if low == high => format!("{name} (stands still at {})", short(low)),
                Some((low, high)) if may.is_empty() => format!("{name} ({} to {})", short(low), short(high)),
                Some((low, high)) => {
                    format!("{name} ({} to {}: may be a {})", short(low), short(high), may.join(" or "))
                }
            }
        };
        let mut all: Vec<String> = self.names.iter().enumerate().take(LISTED).map(of).collect();
        if self.names.len() > LISTED {
            all.push(format!("{} more", self.names.len() - LISTED));
        }
        format!("the columns are {}", all.join(", "))
    }
}

/// The character between the fields of a header; spaces where the line below has as many words.
fn separator(header: &str, below: Option<&str>) -> char {
    let count = |c: &char| header.matches(*c).count();
    let separator = [',', ';', '\t'].into_iter().filter(|c| count(c) > 0).max_by_key(count);
    let words = |line: &str| line.split_whitespace().count();
    let are_columns = words(header) > 1 && below.is_some_and(|line| words(line) == words(header));
    separator.unwrap_or(if are_columns { ' ' } else { ',' })
}

/// The text with the units of a line of units below the header behind its names, as in `angle [deg]`. The line stays as a comment, so that
/// lines keep their numbers.
pub(super) fn with_units(text: &str) -> Cow<'_, str> {
    let text = text.trim_start_matches('\u{feff}');
    let joined = || {
        let mut content = text.lines().enumerate().filter(|(_, line)| is_content(line));
        let ((at, header), (below, units)) = (content.next()?, content.next()?);
        let separator = separator(header, Some(units));
        let names: Vec<&str> = fields(header, separator).map(|name| name.trim_matches('"')).collect();
        let plain = |unit: &str| unit.trim_matches(|c| "[]()\"".contains(c)).trim().to_string();
        let units: Vec<String> = fields(units, separator).map(plain).collect();
        let is_unit =
            |unit: &String| ["time", "position", "torque"].iter().any(|what| could_be(&format!("x [{unit}]"), what));
        // A line with a number in it is a sample.
        let are_units =
            units.iter().any(is_unit) && units.iter().all(|unit| unit.replace(',', ".").parse::<f64>().is_err());
        if units.len() != names.len() || !are_units {
            return None;
        }
        let named = names.iter().zip(&units).map(|(name, unit)| match unit.as_str() {
            "" | "-" => (*name).to_string(),
            unit => format!("{name} [{unit}]"),
        });
        // Names with spaces are between tabs then.
        let between = if separator == ' ' { "\t" } else { &separator.to_string() };
        let header = named.collect::<Vec<String>>().join(between);
        let line = |(i, line): (usize, &str)| match i {
            i if i == at => header.clone(),
            i if i == below => format!("# {line}"),
            _ if separator == ' ' => line.split_whitespace().collect::<Vec<&str>>().join("\t"),
            _ => line.to_string(),
        };
        Some(text.lines().enumerate().map(line).collect::<Vec<String>>().join("\n"))
    };
    joined().map_or(Cow::Borrowed(text), Cow::Owned)
}

/// The fields of a line; one that begins or ends with spaces has no more of them for it.
fn fields(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let line = if separator == ' ' { line.trim() } else { line };
    line.split(separator).map(str::trim).filter(move |field| separator != ' ' || !field.is_empty())
}

/// A number of six digits at most.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

fn is_content(line: &&str) -> bool {
    !line.trim().is_empty() && !line.trim_start().starts_with(['#', '%'])
}
