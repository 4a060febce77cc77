//! One table of the file, checked against the table of keys: its keys' names, types, dimensions and ranges.

use crate::counts::{self, InCounts};
use crate::document::{Document, Entry, Node, Place, Value, shortened};
use crate::error::{Error, ErrorKind};
use crate::keys::{self, Key, Measure, NUMBERS, PHYSICAL, Presence, Range, Takes};
use crate::kinds::Motion;
use crate::quantity::{QuantityError, parse_in_unit, parse_with_unit, percent, split_tolerance, tolerance};
use crate::sampling::Delay;
use crate::unit::Unit;
use crate::words;

/// The place of a table, and the facts that decide the meaning of its keys.
#[derive(Clone)]
pub(crate) struct Context<'a> {
    pub document: &'a Document<'a>,
    pub motion: Motion,
    /// The table's path in [`keys::KEYS`]: `couplings.*`.
    pub pattern: &'static str,
    /// Its path in the file: `couplings.0`.
    pub path: String,
    /// The kind of hand around a `moves`.
    pub hand: Option<&'static str>,
}

/// A checked table. It is queried by names of the rows; its values have their types and ranges.
pub(crate) struct Fields<'a> {
    context: Context<'a>,
    place: Place,
    /// The keys that the table may have.
    rows: Vec<&'static Key>,
    /// The table's own `kind`, where it has one.
    pub kind: Option<&'static str>,
    found: Vec<(&'static str, Place, CheckedValue<'a>)>,
}

/// A checked value.
enum CheckedValue<'a> {
    Text(String),
    Name(&'static str),
    Number(f64),
    /// A number in SI and its tolerance, a fraction of it.
    Within(f64, f64),
    Whole(u64),
    Samples(f64),
    Numbers(Vec<f64>),
    Ends([(&'a str, &'a Place); 2]),
    Node(&'a Node),
}

/// The dotted path of an entry, as far as its tables hold one key each.
fn own_path(entry: &Entry) -> String {
    match &entry.node.value {
        Value::Table(inner) if inner.len() == 1 => format!("{}.{}", shortened(&entry.key), own_path(&inner[0])),
        _ => shortened(&entry.key).into_owned(),
    }
}

impl<'a> Fields<'a> {
    /// Checks the table `node`, key by key in the file's order; an absent table is an empty one at the file's start.
    pub fn new(context: Context<'a>, node: Option<&'a Node>) -> Result<Fields<'a>, Error> {
        let place = node.map_or(Place { set: None, span: 0..0 }, |node| node.place.clone());
        let entries: &[Entry] = match node.map(|node| &node.value) {
            None => &[],
            Some(Value::Table(entries)) => entries,
            Some(_) => {
                let given = node.map(Node::described).unwrap_or_default();
                let message = format!("{given}; expected a table of keys");
                return Err(context.document.error(ErrorKind::Value, context.path, message, &place));
            }
        };
        let rows: Vec<_> = keys::rows(context.pattern).collect();
        let mut fields = Fields { context, place, rows, kind: None, found: Vec::new() };
        if let Some(row) = fields.rows.iter().find(|row| row.name() == "kind") {
            match entries.iter().find(|entry| entry.key == "kind") {
                None => return Err(fields.missing("kind")),
                Some(entry) => {
                    if let CheckedValue::Name(kind) = fields.check(row, &entry.node)? {
                        fields.kind = Some(kind);
                    }
                }
            }
        }
        for entry in entries {
            let row = fields.row(&entry.key).ok_or_else(|| fields.unknown(entry))?;
            let value = fields.check(row, &entry.node)?;
            fields.found.push((row.name(), entry.node.place.clone(), value));
        }
        // A table at the top that is absent is missed by its own required keys, which say more.
        let by_its_keys = |row: &Key| row.takes == Takes::Table && row.table().is_empty();
        let required = |row: &&&Key| row.presence == Presence::Required && !by_its_keys(row);
        let rows = fields.rows.iter().filter(|row| fields.belongs(row));
        if let Some(row) = rows.filter(required).find(|row| fields.found(row.name()).is_none()) {
            return Err(fields.missing(row.name()));
        }
        Ok(fields)
    }

    /// The context of the table `name` in this one, its keys listed under `pattern`.
    pub fn inner(&self, name: &str, pattern: &'static str) -> Context<'a> {
        let hand = if pattern.ends_with(".moves") { self.kind } else { None };
        Context { pattern, path: self.path(name), hand, ..self.context.clone() }
    }

    /// A quantity in SI or a whole number; the row's default when absent.
    pub fn number(&self, name: &str) -> Result<f64, Error> {
        self.optional_number(name)?.ok_or_else(|| self.missing(name))
    }

    /// The same, `None` when absent and without a default.
    pub fn optional_number(&self, name: &str) -> Result<Option<f64>, Error> {
        match self.found(name) {
            Some(CheckedValue::Number(number) | CheckedValue::Within(number, _)) => Ok(Some(*number)),
            Some(CheckedValue::Whole(whole)) => Ok(Some(*whole as f64)),
            _ => Ok(match self.row(name).map(|row| row.presence) {
                Some(Presence::Number(default)) => Some(default),
                _ => None,
            }),
        }
    }

    /// The tolerance of a quantity, as a fraction of it; 0 without one.
    pub fn tolerance(&self, name: &str) -> f64 {
        if let Some(CheckedValue::Within(_, tolerance)) = self.found(name) { *tolerance } else { 0.0 }
    }

    /// A time in s, or a number of samples; the row's default when absent.
    pub fn delay(&self, name: &str) -> Result<Delay, Error> {
        match self.found(name) {
            Some(CheckedValue::Samples(samples)) => Ok(Delay::Samples(*samples)),
            _ => Ok(Delay::Seconds(self.number(name)?)),
        }
    }

    /// The same, `None` when absent.
    pub fn optional_delay(&self, name: &str) -> Result<Option<Delay>, Error> {
        if self.has(name) { self.delay(name).map(Some) } else { Ok(None) }
    }

    /// A whole number that its row bounds to 32 bits; the row's default when absent.
    pub fn whole(&self, name: &str) -> Result<u32, Error> {
        self.optional_whole(name)?.ok_or_else(|| self.missing(name))
    }

    /// The same, `None` when absent and without a default.
    pub fn optional_whole(&self, name: &str) -> Result<Option<u32>, Error> {
        Ok(self.optional_number(name)?.map(|whole| whole as u32))
    }

    /// One of the row's names; its default when absent; `None` without one, and for a quantity in its place.
    pub fn name(&self, name: &str) -> Option<&'static str> {
        match (self.found(name), self.row(name).map(|row| row.presence)) {
            (Some(CheckedValue::Name(found)), _) => Some(found),
            (None, Some(Presence::Name(default))) => Some(default),
            _ => None,
        }
    }

    /// A text, `None` when absent.
    pub fn text(&self, name: &str) -> Option<String> {
        match self.found(name) {
            Some(CheckedValue::Text(text)) => Some(text.clone()),
            _ => None,
        }
    }

    /// An array of plain numbers; `None` when absent.
    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.found(name) {
            Some(CheckedValue::Numbers(numbers)) => Some(numbers),
            _ => None,
        }
    }

    /// The two names of a pair of ends, with their places.
    pub fn ends(&self, name: &str) -> Result<[(&'a str, &'a Place); 2], Error> {
        match self.found(name) {
            Some(CheckedValue::Ends(ends)) => Ok(*ends),
            _ => Err(self.missing(name)),
        }
    }

    /// A table or an array of tables, unread.
    pub fn node(&self, name: &str) -> Option<&'a Node> {
        match self.found(name) {
            Some(CheckedValue::Node(node)) => Some(node),
            _ => None,
        }
    }

    /// Whether the key is in the file.
    pub fn has(&self, name: &str) -> bool {
        self.found(name).is_some()
    }

    /// The key is absent and should not be: shown at the table's header.
    pub fn missing(&self, name: &str) -> Error {
        let wanted = self.row(name).map(|row| row.wanted(self.context.motion)).unwrap_or_default();
        self.context.document.error(ErrorKind::Name, self.path(name), format!("missing; {wanted}"), &self.place)
    }

    /// An error about the key `name`, shown at its value; at the table's header when it is absent.
    pub fn error(&self, kind: ErrorKind, name: &str, message: impl Into<String>) -> Error {
        let place = self.found.iter().find(|(found, ..)| *found == name).map_or(&self.place, |(_, place, _)| place);
        self.context.document.error(kind, self.path(name), message, place)
    }

    /// An error about the key `name`, shown at `place`.
    pub fn error_at(&self, kind: ErrorKind, name: &str, message: impl Into<String>, place: &Place) -> Error {
        self.context.document.error(kind, self.path(name), message, place)
    }

    /// The table's path in the file.
    pub fn table_path(&self) -> &str {
        &self.context.path
    }

    fn path(&self, name: &str) -> String {
        let table = &self.context.path;
        if table.is_empty() { name.to_string() } else { format!("{table}.{name}") }
    }

    fn found(&self, name: &str) -> Option<&CheckedValue<'a>> {
        self.found.iter().find(|(found, ..)| *found == name).map(|(_, _, value)| value)
    }

    fn belongs(&self, row: &Key) -> bool {
        row.belongs(self.kind, self.context.hand, self.context.motion)
    }

    fn row(&self, name: &str) -> Option<&'static Key> {
        self.rows.iter().copied().find(|row| row.name() == name && self.belongs(row))
    }

    fn unknown(&self, entry: &Entry) -> Error {
        let pattern = self.context.pattern;
        let here = || keys::rows(pattern).filter(|row| self.belongs(row)).map(Key::name);
        let takes = || {
            let table = if self.context.path.is_empty() { "the top of the file" } else { &self.context.path };
            format!("{table} takes {}", here().collect::<Vec<_>>().join(", "))
        };
        let others: Vec<&str> = keys::rows(pattern)
            .filter(|row| row.name() == entry.key)
            .flat_map(|row| row.kinds.iter().copied())
            .collect();
        let elsewhere = keys::KEYS.iter().find(|row| row.name() == entry.key);
        let message = match (self.kind, elsewhere) {
            (Some(kind), _) if !others.is_empty() => {
                let keys = here().collect::<Vec<_>>().join(", ");
                format!("not a key of kind {kind:?} but of {}; {kind:?} takes {keys}", words::alternatives(others))
            }
            (_, Some(row)) if pattern == keys::NETWORK_FILE && row.table().is_empty() => {
                format!("unknown key here; a station's own is stations.NAME.{}; {}", own_path(entry), takes())
            }
            (_, Some(row)) => match row.table() {
                "" => format!("unknown key here; it stands at the top of the file; {}", takes()),
                table => format!("unknown key here; it belongs in {table}; {}", takes()),
            },
            (_, None) => match words::did_you_mean(&entry.key, here()) {
                hint if hint.is_empty() => format!("unknown key; {}", takes()),
                hint => format!("unknown key{hint}"),
            },
        };
        let key = self.path(&entry.key).chars().take(100).collect::<String>();
        self.context.document.error(ErrorKind::Name, key, message, &entry.place)
    }

    /// The middle of a quantity with a tolerance, where it is another text than the value, and the tolerance, where there is one; or the
    /// whole message.
    fn tolerated(
        &self,
        row: &Key,
        measure: Measure,
        range: Range,
        node: &Node,
    ) -> Result<(Option<Value>, Option<f64>), String> {
        let split = |node: &'_ Node| match &node.value {
            Value::Text(text) => {
                split_tolerance(text).map(|(middle, width)| (text.clone(), middle.to_string(), width.to_string()))
            }
            _ => None,
        };
        // A number that is overridden without a tolerance keeps the one before.
        let own = split(node);
        let before = if own.is_none() && row.tolerance { node.before.as_deref().and_then(split) } else { None };
        let is_own = own.is_some();
        let Some((text, middle, width)) = own.or(before) else { return Ok((None, None)) };
        let text = words::quoted(&text);
        if !row.tolerance {
            let takers: Vec<&str> = keys::KEYS.iter().filter(|key| key.tolerance).map(|key| key.path).collect();
            return Err(format!("{text} has a tolerance, which only these take: {}", takers.join(", ")));
        }
        let wanted = measure.dimension(self.context.motion);
        let example = wanted.example();
        let Some((middle, tolerance)) = tolerance(&middle, &width, wanted) else {
            // A mistake in the number itself is reported before one in its tolerance.
            if let (true, Err(message)) =
                (width.ends_with('%'), quantity(measure, self.context.motion, &Value::Text(middle)))
            {
                return Err(message);
            }
            return Err(format!(
                "{text} has a tolerance that does not read; expected one such as \"{example} ± 20 %\""
            ));
        };
        let percent = || format!("{} %", percent(tolerance));
        if tolerance < 0.0 {
            Err(format!("{text} has the negative tolerance {}; expected 0 to 100 %", percent()))
        } else if tolerance > 1.0 || tolerance.is_nan() {
            Err(format!("{text} has a tolerance beyond 100 %: the number could be negative"))
        } else if range == Range::Positive && tolerance == 1.0 {
            Err(format!("{text} has a tolerance of 100 %: the number could be 0; expected less"))
        } else {
            Ok((is_own.then_some(Value::Text(middle)), Some(tolerance)))
        }
    }

    /// A quantity in SI, or the whole message; counts are of the file's encoder.
    fn quantity(&self, measure: Measure, value: &Value) -> Result<f64, String> {
        let motion = self.context.motion;
        let in_counts = match value {
            Value::Text(text) => InCounts::find(text, motion),
            _ => None,
        };
        let Some(in_counts) = in_counts else { return quantity(measure, motion, value) };
        let size = counts::size(self.context.document, motion).ok_or_else(|| {
            format!("{} is in counts, and the file has no device.encoder, which gives their size", written(value))
        })?;
        in_counts.value(size, measure.dimension(motion)).map_err(|error| named(measure, motion, &error))
    }

    /// Checks a value against its row.
    fn check(&self, row: &'static Key, node: &'a Node) -> Result<CheckedValue<'a>, Error> {
        let motion = self.context.motion;
        let fail = |kind: ErrorKind, message: String| {
            Err(self.context.document.error(kind, self.path(row.name()), message, &node.place))
        };
        let given = |what: String| fail(ErrorKind::Value, format!("{what}; {}", row.wanted(motion)));
        let samples = match (row.takes, &node.value) {
            (Takes::TimeOrSamples, Value::Text(text)) => keys::in_samples(text),
            _ => None,
        };
        if let Some(samples) = samples {
            return match Range::ZeroOrMore.contains(samples) {
                true => Ok(CheckedValue::Samples(samples)),
                false => given(format!("{} {}", written(&node.value), fault(Range::ZeroOrMore, samples))),
            };
        }
        if row.path == "safety.late" && quantity(Measure::Time, motion, &node.value).is_ok() {
            return given(format!("{} is a time, which safety.stall takes", written(&node.value)));
        }
        match (row.takes, &node.value) {
            (Takes::Text, Value::Text(text)) => Ok(CheckedValue::Text(text.clone())),
            // A text such as 1984 in an override needs no quotes inside the shell's quotes.
            (Takes::Text, _) if node.place.set.is_some() => {
                let text = self.context.document.text(&node.place).get(node.place.span.clone());
                Ok(CheckedValue::Text(text.unwrap_or_default().to_string()))
            }
            (Takes::Name(names), Value::Text(text)) => match names.iter().find(|name| **name == text.as_str()) {
                Some(name) => Ok(CheckedValue::Name(name)),
                None => match words::did_you_mean(text, names.iter().copied()) {
                    hint if hint.is_empty() => given(format!("{} is not known here", words::quoted(text))),
                    hint => fail(ErrorKind::Value, format!("{} is not known here{hint}", words::quoted(text))),
                },
            },
            (Takes::QuantityOr(_, _, word), Value::Text(text)) if text == word => Ok(CheckedValue::Name(word)),
            (Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples, Value::Text(_) | Value::Number(_)) => {
                let (measure, range) = row.takes.quantity().unwrap_or((Measure::Ratio, Range::Any));
                let (value, tolerance) = match self.tolerated(row, measure, range, node) {
                    Ok(parts) => parts,
                    Err(message) => return fail(ErrorKind::Value, message),
                };
                match self.quantity(measure, value.as_ref().unwrap_or(&node.value)) {
                    Ok(value) if range.contains(value) && tolerance.is_some() => {
                        Ok(CheckedValue::Within(value, tolerance.unwrap_or(0.0)))
                    }
                    Ok(value) if range.contains(value) => Ok(CheckedValue::Number(value)),
                    Ok(value) => given(format!("{} {}", written(&node.value), fault(range, value))),
                    Err(_) if matches!(&node.value, Value::Text(text) if keys::in_samples(text).is_some()) => {
                        given(format!("{} is in samples, which a delay alone can be", written(&node.value)))
                    }
                    Err(message) => match (row.takes, &node.value) {
                        (Takes::TimeOrSamples, Value::Text(text)) => {
                            let unit = text.trim_start_matches(|c: char| !c.is_alphabetic());
                            match words::did_you_mean(unit, [keys::SAMPLES]) {
                                hint if hint.is_empty() || keys::SAMPLES.starts_with(unit) => {
                                    fail(ErrorKind::Value, message)
                                }
                                hint => fail(
                                    ErrorKind::Value,
                                    format!("{} has the unknown unit {unit:?}{hint}", written(&node.value)),
                                ),
                            }
                        }
                        _ => fail(ErrorKind::Value, message),
                    },
                }
            }
            (Takes::Whole { least, most, step }, Value::Number(text)) => match whole(text) {
                None => given(format!("{} is not a whole number", shortened(text))),
                Some(whole) if whole < i128::from(least) || whole > i128::from(most) => {
                    given(format!("{} is out of range", shortened(text)))
                }
                Some(whole) if whole % i128::from(step) != 0 => given(format!("{} is odd", shortened(text))),
                // Between u64s by the arm above.
                Some(whole) => Ok(CheckedValue::Whole(whole as u64)),
            },
            (Takes::Numbers { least, most }, Value::Array(items)) => {
                if !(least..=most).contains(&items.len()) {
                    return given(format!("an array of {} stands here", items.len()));
                }
                let read = |item: &Node| {
                    let found = parse_in_unit(number(&item.value), Unit::ONE).filter(|x| NUMBERS.contains(x));
                    let given = match &item.value {
                        Value::Number(text) => format!("{} is out of range", shortened(text)),
                        _ => item.described(),
                    };
                    let fault = || format!("{given}; {}", row.wanted(motion));
                    found.ok_or_else(|| self.error_at(ErrorKind::Value, row.name(), fault(), &item.place))
                };
                Ok(CheckedValue::Numbers(items.iter().map(read).collect::<Result<_, _>>()?))
            }
            (Takes::Ends(_), Value::Array(items)) => match items.as_slice() {
                [
                    Node { value: Value::Text(first), place: at_first, .. },
                    Node { value: Value::Text(second), place: at_second, .. },
                ] => Ok(CheckedValue::Ends([(first, at_first), (second, at_second)])),
                [_, _] => given("an end is text in quotes".to_string()),
                items => given(format!("an array of {} stands here", items.len())),
            },
            (Takes::Table, Value::Table(_)) => Ok(CheckedValue::Node(node)),
            (Takes::Named { most, what, letter_first, reserved }, Value::Table(entries)) => {
                let wrong =
                    entries.iter().find_map(|entry| Some((entry, no_name(&entry.key, letter_first, reserved)?)));
                if entries.len() > most {
                    fail(ErrorKind::Combination, too_many(entries.len(), most, what))
                } else if let Some((entry, why)) = wrong {
                    let message = format!("{} cannot name a {what}: {why}", words::quoted(&entry.key));
                    Err(self.context.document.error(ErrorKind::Name, self.path(row.name()), message, &entry.place))
                } else {
                    Ok(CheckedValue::Node(node))
                }
            }
            (Takes::List { most, what }, Value::Array(items)) if items.len() > most => {
                fail(ErrorKind::Combination, too_many(items.len(), most, what))
            }
            (Takes::List { .. }, Value::Array(_)) => Ok(CheckedValue::Node(node)),
            _ => given(node.described()),
        }
    }
}

fn too_many(count: usize, most: usize, what: &str) -> String {
    let plural = if what == "body" { "bodies".to_string() } else { format!("{what}s") };
    format!("{count} {plural} are too many: the limit is {most}")
}

/// Why a table of the user's cannot have this name; `None`: it can.
fn no_name(name: &str, letter_first: bool, reserved: &[&str]) -> Option<String> {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
    let first = name.bytes().next().is_some_and(|byte| !letter_first || byte.is_ascii_alphabetic());
    if reserved.contains(&name) {
        let others = words::all_of(reserved.iter().copied().filter(|taken| *taken != name));
        Some(format!("it is taken, as are {others}"))
    } else if first && name.bytes().all(plain) {
        None
    } else if letter_first {
        Some("a letter and then letters, digits, _ and - can".to_string())
    } else {
        Some("letters, digits, _ and - can".to_string())
    }
}

/// A quantity in SI, or the whole message.
fn quantity(measure: Measure, motion: Motion, value: &Value) -> Result<f64, String> {
    let wanted = measure.dimension(motion);
    match value {
        Value::Text(text) => parse_with_unit(text, wanted).map_err(|error| named(measure, motion, &error)),
        // The parser's floats include inf and nan, and what a double cannot hold.
        _ => {
            let text = number(value);
            let message = || {
                format!("{} is not a finite number; expected {wanted}, such as {:?}", shortened(text), wanted.example())
            };
            parse_in_unit(text, Unit::ONE).ok_or_else(message)
        }
    }
}

/// The message with the name of the measure: the dimension of an energy has the name of a torque.
fn named(measure: Measure, motion: Motion, error: &QuantityError) -> String {
    error.to_string().replace(&measure.dimension(motion).to_string(), &measure.described(motion))
}

fn number(value: &Value) -> &str {
    if let Value::Number(text) = value { text } else { "" }
}

/// A quantity as the file has it.
fn written(value: &Value) -> String {
    match value {
        Value::Text(text) => words::quoted(text),
        other => shortened(number(other)).into_owned(),
    }
}

/// A whole number, also where it is written as a float, `2048.0`.
fn whole(text: &str) -> Option<i128> {
    if let Ok(whole) = text.parse::<i128>() {
        return Some(whole);
    }
    // Saturates, so that 1e300 is out of every range.
    let float = text.parse::<f64>().ok()?;
    (float.is_finite() && float.fract() == 0.0).then_some(float as i128)
}

/// The fault of a number outside its range.
fn fault(range: Range, value: f64) -> String {
    let (least, most) = (PHYSICAL.start(), PHYSICAL.end());
    match range {
        Range::Share if value > 1.0 => "is above 1".to_string(),
        _ if value > *most => format!("is beyond anything physical, {most:e} in SI"),
        _ if value > 0.0 => format!("is below anything physical, {least:e} in SI"),
        Range::Positive => "is not above 0".to_string(),
        Range::ZeroOrMore | Range::Share | Range::Any => "is negative".to_string(),
    }
}

/// The one of `all` whose name the key has; `None` where the file has no such key, nor the table a default for it. A name that the table of
/// keys takes and none of these has is an error, and does not count as another one.
pub(crate) fn one_of<T: Copy>(
    fields: &Fields<'_>,
    key: &str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<Option<T>, Error> {
    let Some(given) = fields.name(key) else { return Ok(None) };
    let found = all.iter().copied().find(|one| name(*one) == given);
    found.map(Some).ok_or_else(|| fields.error(ErrorKind::Unsupported, key, nothing_reads(given)))
}

/// The table's kind. As [`one_of`].
pub(crate) fn kind<K>(fields: &Fields<'_>, from_name: fn(&str) -> Option<K>) -> Result<K, Error> {
    let given = fields.kind.ok_or_else(|| fields.missing("kind"))?;
    from_name(given).ok_or_else(|| fields.error(ErrorKind::Unsupported, "kind", nothing_reads(given)))
}

fn nothing_reads(name: &str) -> String {
    format!("this version of hapt does not know what {} means", words::quoted(name))
}

/// The entries of a table; none where there is no such table.
pub(crate) fn entries<'a>(fields: &Fields<'a>, name: &str) -> &'a [Entry] {
    match fields.node(name) {
        Some(Node { value: Value::Table(entries), .. }) => entries,
        _ => &[],
    }
}

/// The items of an array; none where there is no such array.
pub(crate) fn items<'a>(fields: &Fields<'a>, name: &str) -> &'a [Node] {
    match fields.node(name) {
        Some(Node { value: Value::Array(items), .. }) => items,
        _ => &[],
    }
}
