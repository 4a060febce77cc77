//! The schema of a log's messages: a Protocol Buffers `FileDescriptorSet` for the world.
//!
//! A field's name is that of its column, with `_` for characters that Protocol Buffers do not allow; its JSON name is the column's own.
//! Units and descriptions are comments on the fields.

use std::collections::BTreeSet;

use crate::schema::{Column, Kind};
use crate::wire::{bytes, count, counts};

/// The message's full name.
pub(crate) const MESSAGE: &str = "hapt.Sample";

// FieldDescriptorProto.Type
const DOUBLE: u64 = 1;
const UINT64: u64 = 4;
const ENUM: u64 = 14;

/// The descriptor of a message with these columns as fields 1, 2, 3...
pub fn descriptor(columns: &[Column]) -> Vec<u8> {
    let text = |out: &mut Vec<u8>, field, text: &str| bytes(out, field, text.as_bytes());
    let mut message = Vec::new();
    let mut comments = Vec::new();
    text(&mut message, 1, "Sample");
    for ((name, column), place) in names(columns).iter().zip(columns).zip(0..) {
        let mut field = Vec::new();
        text(&mut field, 1, name);
        count(&mut field, 3, place + 1);
        // Optional, as every field of proto3 that is neither required nor repeated.
        count(&mut field, 4, 1);
        match column.kind {
            Kind::Number => count(&mut field, 5, DOUBLE),
            Kind::Count => count(&mut field, 5, UINT64),
            Kind::Choice(choice) => {
                count(&mut field, 5, ENUM);
                text(&mut field, 6, &format!(".{MESSAGE}.{}", choice.name));
            }
        }
        text(&mut field, 10, &column.name);
        bytes(&mut message, 2, &field);

        // The comment on a field of message 0, at a line of its own in a source without text.
        let mut location = Vec::new();
        counts(&mut location, 1, &[4, 0, 2, place]);
        counts(&mut location, 2, &[place, 0, 0]);
        let unit = if column.unit.is_empty() { String::new() } else { format!(", in {}", column.unit) };
        text(&mut location, 3, &format!(" {}{unit}\n", column.doc));
        bytes(&mut comments, 1, &location);
    }
    for column in columns {
        let Kind::Choice(choice) = column.kind else { continue };
        let mut enumeration = Vec::new();
        text(&mut enumeration, 1, choice.name);
        for (name, code) in choice.values {
            let mut value = Vec::new();
            // The names of all codes of a message share one namespace.
            text(&mut value, 1, &format!("{}_{name}", choice.name).to_uppercase().replace('-', "_"));
            count(&mut value, 2, *code);
            bytes(&mut enumeration, 2, &value);
        }
        bytes(&mut message, 4, &enumeration);
    }
    let mut file = Vec::new();
    text(&mut file, 1, "hapt/sample.proto");
    text(&mut file, 2, "hapt");
    bytes(&mut file, 4, &message);
    bytes(&mut file, 9, &comments);
    text(&mut file, 12, "proto3");
    let mut set = Vec::new();
    bytes(&mut set, 1, &file);
    set
}

/// The fields' names: bodies `a-b` and `a_b` stay two.
fn names(columns: &[Column]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let mut name = |column: &Column| {
        let plain = column.name.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        let further = (2..).map(|n| format!("{plain}_{n}"));
        let free = std::iter::once(plain.clone()).chain(further).find(|name| !taken.contains(name));
        let free = free.unwrap_or(plain);
        taken.insert(free.clone());
        free
    };
    columns.iter().map(&mut name).collect()
}
