//! The tree of a world file, each node with its place.

use std::borrow::Cow;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, ErrorKind, Location};
use crate::source::{LARGEST_SOURCE, Source, too_large};
use crate::{syntax, words};

/// A world file and the overrides of its keys.
pub(crate) struct Document<'a> {
    pub source: &'a Source,
    pub sets: &'a [String],
    /// The table of keys that the top of the file is: empty for a world, [`keys::NETWORK_FILE`] for a network.
    pub top: &'static str,
    pub root: Node,
}

/// The place of a node or a key.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// The index of the override that contains it; `None`: it is in the file.
    pub set: Option<usize>,
    /// In bytes.
    pub span: Range<usize>,
}

/// A value and its place; for a table with a header, the header's.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub value: Value,
    pub place: Place,
    /// The value before an override: its tolerance is kept for a number without one.
    pub before: Option<Box<Node>>,
}

/// TOML's values; numbers as decimal text, so that nothing is rounded before its unit is known.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Text(String),
    Number(String),
    Boolean(bool),
    Date(String),
    Array(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key and its value.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: String,
    pub place: Place,
    pub node: Node,
}

impl<'a> Document<'a> {
    /// Parses the source, without overrides. `top` is the table of keys that the top of the file is.
    pub fn parse(source: &'a Source, top: &'static str) -> Result<Document<'a>, Error> {
        if source.text.len() as u64 > LARGEST_SOURCE {
            return Err(too_large(&source.name));
        }
        let table = DeTable::parse(&source.text).map_err(|error| Error {
            kind: ErrorKind::Syntax,
            key: String::new(),
            message: syntax::message(error.message(), &source.text, error.span().as_ref()),
            location: Some(Box::new(Location::new(&source.name, &source.text, error.span().unwrap_or(0..0)))),
        })?;
        let root = Node {
            value: Value::Table(entries(table.into_inner(), None)),
            place: Place { set: None, span: 0..0 },
            before: None,
        };
        Ok(Document { source, sets: &[], top, root })
    }

    /// Where the file has this key at its top, if it does.
    pub fn place(&self, key: &str) -> Option<Place> {
        let Value::Table(entries) = &self.root.value else { return None };
        entries.iter().find(|entry| entry.key == key).map(|entry| entry.place.clone())
    }

    /// The value at a path of tables.
    pub fn find(&self, path: &[&str]) -> Option<&Node> {
        path.iter().try_fold(&self.root, |node, name| match &node.value {
            Value::Table(entries) => entries.iter().find(|entry| entry.key == *name).map(|entry| &entry.node),
            _ => None,
        })
    }

    /// The text that a place is in.
    pub fn text(&self, place: &Place) -> &'a str {
        match place.set {
            None => &self.source.text,
            Some(index) => self.sets.get(index).map_or("", String::as_str),
        }
    }

    /// An error about the key `key`, shown at `place`.
    pub fn error(&self, kind: ErrorKind, key: impl Into<String>, message: impl Into<String>, place: &Place) -> Error {
        let name = if place.set.is_some() { "--set" } else { &self.source.name };
        let location = Location::new(name, self.text(place), place.span.clone());
        Error { kind, key: key.into(), message: message.into(), location: Some(Box::new(location)) }
    }
}

impl Node {
    /// From the TOML parser's tree; `offset` is where its text begins in the text of the override `set`.
    pub fn new(value: Spanned<DeValue<'_>>, set: Option<usize>, offset: usize) -> Node {
        let span = value.span();
        let place = Place { set, span: span.start + offset..span.end + offset };
        let value = match value.into_inner() {
            DeValue::String(text) => Value::Text(text.into_owned()),
            DeValue::Integer(integer) => Value::Number(match integer.radix() {
                10 => integer.as_str().to_string(),
                // TOML's integers have 64 bits; what has more than 128 is out of every range here.
                radix => i128::from_str_radix(integer.as_str(), radix).unwrap_or(i128::MAX).to_string(),
            }),
            DeValue::Float(float) => Value::Number(float.as_str().to_string()),
            DeValue::Boolean(boolean) => Value::Boolean(boolean),
            DeValue::Datetime(date) => Value::Date(date.to_string()),
            DeValue::Array(array) => Value::Array(array.into_iter().map(|item| Node::new(item, set, offset)).collect()),
            DeValue::Table(table) => Value::Table(entries_at(table, set, offset)),
        };
        Node { value, place, before: None }
    }

    /// The value here in words, for `...; expected a time (s)`.
    pub fn described(&self) -> String {
        match &self.value {
            Value::Text(text) => format!("{} is text", words::quoted(text)),
            Value::Number(text) => format!("{} is a number", shortened(text)),
            Value::Boolean(boolean) => format!("{boolean} is a boolean"),
            Value::Date(date) => format!("{date} is a date"),
            Value::Array(_) => "an array stands here".to_string(),
            Value::Table(_) => "a table stands here".to_string(),
        }
    }
}

/// A number as it was written, cut where it has hundreds of digits.
pub(crate) fn shortened(number: &str) -> Cow<'_, str> {
    match number.char_indices().nth(40) {
        None => Cow::Borrowed(number),
        Some((end, _)) => Cow::Owned(format!("{}…", &number[..end])),
    }
}

fn entries(table: DeTable<'_>, set: Option<usize>) -> Vec<Entry> {
    entries_at(table, set, 0)
}

fn entries_at(table: DeTable<'_>, set: Option<usize>, offset: usize) -> Vec<Entry> {
    let entry = |(key, value): (Spanned<Cow<'_, str>>, Spanned<DeValue<'_>>)| {
        let place = Place { set, span: key.span().start + offset..key.span().end + offset };
        Entry { key: key.into_inner().into_owned(), place, node: Node::new(value, set, offset) }
    };
    let mut entries: Vec<Entry> = table.into_iter().map(entry).collect();
    // A header that comes after its sub-table's is moved by the parser; the order of the file is part of the contract.
    entries.sort_by_key(|entry| entry.place.span.start);
    entries
}
