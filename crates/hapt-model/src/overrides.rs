//! Overrides of single keys: `--set loop.period=2ms`.

use std::ops::Range;

use toml::de::DeValue;

use crate::document::{Document, Entry, Node, Place, Value};
use crate::error::{Error, ErrorKind};
use crate::keys;
use crate::quantity::split_tolerance;
use crate::source::Source;
use crate::words;

/// The list that an override may lengthen.
const COUPLINGS: &str = "couplings";
/// The most overrides of one world: each takes a search through the tables of its path.
const MOST_SETS: usize = 1000;

impl<'a> Document<'a> {
    /// Parses a world's source and applies the overrides; the last one of a key holds.
    pub fn new(source: &'a Source, sets: &'a [String]) -> Result<Document<'a>, Error> {
        Document::within("", source, sets)
    }

    /// The same of a file whose top is the table of keys `top`.
    pub fn within(top: &'static str, source: &'a Source, sets: &'a [String]) -> Result<Document<'a>, Error> {
        let document = Document::parse(source, top)?;
        if sets.len() > MOST_SETS {
            let message = format!("--set: {} overrides are too many: the limit is {MOST_SETS}", sets.len());
            return Err(Error { kind: ErrorKind::Combination, key: String::new(), message, location: None });
        }
        let mut document = Document { sets, ..document };
        for (index, set) in sets.iter().enumerate() {
            apply(&mut document, index, set)?;
        }
        Ok(document)
    }
}

/// An override by its parts.
pub(crate) struct Override<'a> {
    /// The names of its path.
    pub names: Vec<&'a str>,
    /// The text of its value.
    pub value: &'a str,
}

impl<'a> Override<'a> {
    /// The parts of `KEY=VALUE`.
    pub fn split(set: &'a str) -> Option<Self> {
        let (path, value) = set.split_once('=')?;
        Some(Override { names: steps(path).map(|(name, _)| name).collect(), value: value.trim() })
    }
}

/// Puts the value of `set`, which is `sets[index]`, into the tree. A key that is absent is added, and a coupling behind the last; a body or a
/// scenario is not.
fn apply(document: &mut Document<'_>, index: usize, set: &str) -> Result<(), Error> {
    let place = |span: Range<usize>| Place { set: Some(index), span };
    let Some((path, _)) = set.split_once('=') else {
        let message = format!("{} is not KEY=VALUE, such as loop.period=2ms", words::quoted(set));
        return Err(document.error(ErrorKind::Syntax, "", message, &place(0..set.len())));
    };
    // A tree of a thousand levels would be dropped by recursion, with each level on the stack.
    let (names, deepest) = (path.split('.').count(), keys::deepest());
    if names > deepest {
        let message = format!("{} has {names} names; no key has more than {deepest}", words::quoted(path));
        return Err(document.error(ErrorKind::Name, "", message, &place(0..path.len())));
    }
    let value = value(set, path.len() + 1, index);
    let steps: Vec<Step> = steps(path).map(|(name, span)| Step { name, place: place(span) }).collect();

    // The tree is changed apart from the document, which shows the errors.
    let mut root =
        std::mem::replace(&mut document.root, Node { value: Value::Boolean(false), place: place(0..0), before: None });
    let put = put(&mut root, document.top, &steps, value);
    document.root = root;
    put.map_err(|(depth, kind, message)| {
        let known = &steps[..steps.len().min(depth + 1)];
        let key = known.iter().map(|step| step.name).collect::<Vec<_>>().join(".");
        let at = known.last().map_or_else(|| place(0..0), |step| step.place.clone());
        document.error(kind, key, message, &at)
    })
}

/// One name of a dotted path.
struct Step<'a> {
    name: &'a str,
    place: Place,
}

/// The names between the points, blanks around them left out, and where they stand.
fn steps(path: &str) -> impl Iterator<Item = (&str, Range<usize>)> {
    let mut start = 0;
    path.split('.').map(move |part| {
        let begin = start + (part.len() - part.trim_start().len());
        start += part.len() + 1;
        let name = part.trim();
        (name, begin..begin + name.len())
    })
}

/// The text from `start` on as a TOML value; text that is not a value is a string.
fn value(set: &str, start: usize, index: usize) -> Node {
    let text = set.get(start..).unwrap_or_default();
    let start = start + (text.len() - text.trim_start().len());
    let text = text.trim();
    let plain = || Node {
        value: Value::Text(text.to_string()),
        place: Place { set: Some(index), span: start..start + text.len() },
        before: None,
    };
    match DeValue::parse(text) {
        Ok(value) if value.span() == (0..text.len()) => Node::new(value, Some(index), start),
        _ => plain(),
    }
}

/// Puts `value` at the path; on failure returns the index of the step that fails, and the reason.
fn put(root: &mut Node, top: &str, steps: &[Step<'_>], value: Node) -> Result<(), (usize, ErrorKind, String)> {
    let mut node = root;
    let mut pattern = top.to_string();
    for (depth, step) in steps.iter().enumerate() {
        let fail = |message: String| Err((depth, ErrorKind::Name, message));
        if step.name.is_empty() {
            return fail("a name is missing between the points of the key".to_string());
        }
        match &mut node.value {
            Value::Array(items) => {
                let count = items.len();
                // Another coupling, whole.
                if pattern == COUPLINGS && depth + 1 == steps.len() && step.name == count.to_string() {
                    if !matches!(value.value, Value::Table(_)) {
                        return fail("another coupling is a table, such as {kind=\"damper\",between=[\"puck\",\"ground\"],damping=0.001}".into());
                    }
                    items.push(value);
                    return Ok(());
                }
                let index = step.name.parse::<usize>().ok().filter(|&index| index < count);
                let Some(item) = index.and_then(|index| items.get_mut(index)) else {
                    return fail(match count {
                        0 => "there is none to number".to_string(),
                        1 => format!("{} is not 0, the only one there is", words::quoted(step.name)),
                        _ => format!("{} is not a whole number from 0 to {}", words::quoted(step.name), count - 1),
                    });
                };
                node = item;
                pattern.push_str(".*");
            }
            Value::Table(entries) => {
                let what = keys::named_by_the_user(&pattern);
                let position = match (entries.iter().position(|entry| entry.key == step.name), what) {
                    (Some(position), _) => position,
                    (None, Some(what)) => {
                        let known = entries.iter().map(|entry| entry.key.as_str());
                        return fail(match entries.len() {
                            0 => format!("the world has no {what}"),
                            _ => format!(
                                "the world has no {what} {}{}",
                                words::quoted(step.name),
                                words::did_you_mean(step.name, known)
                            ),
                        });
                    }
                    (None, None) => {
                        let is_list = pattern.is_empty() && step.name == COUPLINGS && depth + 2 == steps.len();
                        let value = if is_list { Value::Array(Vec::new()) } else { Value::Table(Vec::new()) };
                        let node = Node { value, place: step.place.clone(), before: None };
                        entries.push(Entry { key: step.name.to_string(), place: step.place.clone(), node });
                        entries.len() - 1
                    }
                };
                let Some(entry) = entries.get_mut(position) else { return Ok(()) };
                if depth + 1 == steps.len() {
                    entry.place = step.place.clone();
                }
                node = &mut entry.node;
                let name = if what.is_some() { "*" } else { step.name };
                if !pattern.is_empty() {
                    pattern.push('.');
                }
                pattern.push_str(name);
            }
            _ => {
                let holder = depth.checked_sub(1).and_then(|above| steps.get(above)).map_or("", |step| step.name);
                return fail(format!("{} has no keys below it", words::quoted(holder)));
            }
        }
    }
    let before = std::mem::replace(node, value);
    // Of several overrides of a key the last with a tolerance counts, so one text before is enough.
    node.before = match (&before.value, before.before) {
        (Value::Text(text), older) if split_tolerance(text).is_none() => older,
        (Value::Text(_), _) => Some(Box::new(Node { before: None, ..before })),
        (Value::Number(_), older) => older,
        (Value::Boolean(_) | Value::Date(_) | Value::Array(_) | Value::Table(_), _) => None,
    };
    Ok(())
}
