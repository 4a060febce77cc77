//! The tables of keys as a JSON schema, for editors.
//!
//! Draft 7, because the TOML editors' language server (taplo, in Even Better TOML) reads drafts 4 to 7. It has the same facts on each key
//! as [`KEYS`]. Rules on several keys at once (Coulomb or LuGre, levels without a limit) are left to the reader.
//!
//! Where one key decides what the others mean, `kind` or `motion`, the branch is an `if`, so that a mistake is shown at its
//! own key: a `oneOf` could only report that the whole table fits none. The `anyOf` next to it always holds; there editors
//! that do not follow an `if` find names and docs.

use serde_json::{Map, Value, json};

use crate::dimension::Dimension;
use crate::keys::{self, KEYS, Key, Measure, NETWORK, NUMBERS, PHYSICAL, Presence, Range, Takes};
use crate::kinds::Motion;
use crate::spelling;

/// The schema of world files and network files, as JSON. A file with `stations` is a network.
///
/// Quantities of the wrong dimension are refused where their unit is spelled plainly (`5 N m` for a stiffness); a spelling
/// with parentheses, or with one base twice, is left to [`World::read`](crate::World::read). Every world file that reads
/// fits the schema.
pub fn schema() -> String {
    let mut definitions = Map::new();
    let mut worlds = Vec::new();
    for motion in [Motion::Rotary, Motion::Linear] {
        let kinds = Kinds { kind: None, hand: None, motion };
        worlds.push((motion.name(), define(motion.name(), &mut definitions, |all| of_kind("", kinds, all))));
    }
    definitions.insert("unusual".to_string(), json!({ "type": "string", "pattern": spelling::unusual() }));
    let kinds = Kinds { kind: None, hand: None, motion: Motion::Rotary };
    let network = define(keys::NETWORK_FILE, &mut definitions, |all| of_kind(keys::NETWORK_FILE, kinds, all));
    let schema = json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "hapt world file",
        "description": "A virtual world for a haptic device, or a network of stations with such worlds. A quantity is a text of a number and a unit, or a bare number in SI.",
        "if": { "type": "object", "required": ["stations"] },
        "then": network,
        "else": choice("motion", worlds, true),
        "definitions": definitions,
    });
    // A tree of texts and numbers always prints.
    serde_json::to_string_pretty(&schema).unwrap_or_default() + "\n"
}

type Definitions = Map<String, Value>;

/// The kinds that decide the meaning of a table's keys.
#[derive(Clone, Copy)]
struct Kinds {
    /// The table's own.
    kind: Option<&'static str>,
    /// That of the hand around a `moves`.
    hand: Option<&'static str>,
    motion: Motion,
}

/// A reference to the definition `name`, which is made where it is not there yet.
fn define(name: &str, definitions: &mut Definitions, make: impl FnOnce(&mut Definitions) -> Value) -> Value {
    if !definitions.contains_key(name) {
        let made = make(definitions);
        definitions.insert(name.to_string(), made);
    }
    json!({ "$ref": format!("#/definitions/{name}") })
}

/// The table at `path` of [`KEYS`]; by its kinds, where it has some.
fn table(path: &'static str, kinds: Kinds, definitions: &mut Definitions) -> Value {
    let Some(Takes::Name(names)) = keys::rows(path).find(|row| row.name() == "kind").map(|row| row.takes) else {
        return of_kind(path, kinds, definitions);
    };
    let mut branches = Vec::new();
    for name in names {
        let kinds = Kinds { kind: Some(name), ..kinds };
        let around = kinds.hand.map_or(String::new(), |hand| format!("{hand}."));
        let what = path.replace(".*", "");
        let full = format!("{}.{what}.{around}{name}", kinds.motion.name());
        branches.push((*name, define(&full, definitions, |all| of_kind(path, kinds, all))));
    }
    choice("kind", branches, false)
}

fn of_kind(path: &'static str, kinds: Kinds, definitions: &mut Definitions) -> Value {
    let (mut properties, mut required) = (Map::new(), Vec::new());
    for row in keys::rows(path).filter(|row| row.belongs(kinds.kind, kinds.hand, kinds.motion)) {
        if row.presence == Presence::Required {
            required.push(row.name());
        }
        let mut property = property(row, kinds, definitions);
        if let (Some(kind), "kind", Some(property)) = (kinds.kind, row.name(), property.as_object_mut()) {
            property.insert("enum".to_string(), json!([kind]));
        }
        properties.insert(row.name().to_string(), property);
    }
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

/// Tables of which the key `by` picks one; without it, where that is allowed, the first.
fn choice(by: &str, branches: Vec<(&str, Value)>, first_without: bool) -> Value {
    let names: Vec<&str> = branches.iter().map(|(name, _)| *name).collect();
    let mut rules = Vec::new();
    for (index, (name, table)) in branches.iter().enumerate() {
        let must: &[&str] = if first_without && index == 0 { &[] } else { &[by] };
        let picked = json!({ "properties": { by: { "const": name } }, "required": must });
        rules.push(json!({ "if": picked, "then": table }));
    }
    let mut any: Vec<Value> = branches.into_iter().map(|(_, table)| table).collect();
    any.push(json!({}));
    let must: &[&str] = if first_without { &[] } else { &[by] };
    json!({
        "type": "object", "properties": { by: { "enum": names } }, "required": must, "allOf": rules, "anyOf": any,
    })
}

/// The values of one row, with its doc.
fn property(row: &'static Key, kinds: Kinds, definitions: &mut Definitions) -> Value {
    // The hand's kind decides the meaning of a table inside it.
    let inside = Kinds { kind: None, hand: kinds.kind, ..kinds };
    let each = KEYS.iter().chain(NETWORK).map(Key::table).find(|table| table.strip_suffix(".*") == Some(row.path));
    let mut each = || each.map_or(json!({}), |path| table(path, inside, definitions));
    let mut takes = match row.takes {
        Takes::Text => json!({ "type": "string" }),
        Takes::Name(names) => json!({ "enum": names }),
        Takes::Quantity(measure, range) if row.path.starts_with(keys::NETWORK_FILE) => {
            // The worlds of its stations have the motion, and the network itself does not.
            let [rotary, linear] =
                [Motion::Rotary, Motion::Linear].map(|motion| quantity(measure, range, None, motion, definitions));
            if rotary == linear { rotary } else { json!({ "anyOf": [rotary, linear] }) }
        }
        Takes::Quantity(measure, range) => {
            let tolerated = row.tolerance.then(|| json!({ "type": "string", "pattern": spelling::tolerated() }));
            quantity(measure, range, tolerated, kinds.motion, definitions)
        }
        Takes::QuantityOr(measure, range, word) => {
            quantity(measure, range, Some(json!({ "enum": [word] })), kinds.motion, definitions)
        }
        Takes::TimeOrSamples => {
            let samples = json!({ "type": "string", "pattern": spelling::samples() });
            quantity(Measure::Time, Range::ZeroOrMore, Some(samples), kinds.motion, definitions)
        }
        Takes::Whole { least, most, step } => {
            json!({ "type": "integer", "minimum": least, "maximum": most, "multipleOf": step })
        }
        Takes::Numbers { least, most } => {
            let number = json!({ "type": "number", "minimum": NUMBERS.start(), "maximum": NUMBERS.end() });
            json!({ "type": "array", "items": number, "minItems": least, "maxItems": most })
        }
        Takes::Ends(such) => {
            let end = json!({ "type": "string", "pattern": body_name(), "examples": such });
            json!({ "type": "array", "items": end, "minItems": 2, "maxItems": 2, "uniqueItems": true })
        }
        Takes::Table => table(row.path, inside, definitions),
        Takes::Named { most, letter_first, reserved, .. } => {
            let names = json!({ "pattern": name(letter_first), "not": { "enum": reserved } });
            json!({
                "type": "object", "additionalProperties": each(), "propertyNames": names, "maxProperties": most,
            })
        }
        Takes::List { most, .. } => json!({ "type": "array", "items": each(), "maxItems": most }),
    };
    if let Some(takes) = takes.as_object_mut() {
        takes.insert("description".to_string(), json!(description(row, kinds.motion)));
        if let Some(default) = default(row, kinds.motion) {
            takes.insert("default".to_string(), default);
        }
    }
    takes
}

/// A number in SI, a text with a unit of the right dimension, or what else the key takes.
fn quantity(
    measure: Measure,
    range: Range,
    other: Option<Value>,
    motion: Motion,
    definitions: &mut Definitions,
) -> Value {
    let wanted = measure.dimension(motion);
    let number = match range {
        Range::Any => json!({ "type": "number" }),
        Range::ZeroOrMore => json!({ "type": "number", "minimum": 0, "maximum": PHYSICAL.end() }),
        Range::Share => json!({ "type": "number", "minimum": 0, "maximum": 1 }),
        Range::Positive => json!({ "type": "number", "minimum": PHYSICAL.start(), "maximum": PHYSICAL.end() }),
    };
    let plain = || json!({ "type": "string", "pattern": spelling::plain(wanted) });
    // "a torsional stiffness (N m/rad)" is defined as torsional-stiffness.
    let called = wanted.to_string();
    let called = called.split(" (").next().and_then(|name| name.split_once(' ')).map_or("", |(_, name)| name);
    let unit = define(
        &called.replace(' ', "-"),
        definitions,
        |_| json!({ "anyOf": [plain(), { "$ref": "#/definitions/unusual" }] }),
    );
    let text = match spelling::number_in(range) {
        Some(pattern) => json!({ "allOf": [{ "type": "string", "pattern": pattern }, unit] }),
        None => unit,
    };
    let mut any = vec![text, number];
    any.extend(other);
    json!({ "anyOf": any, "examples": examples(wanted) })
}

fn examples(wanted: Dimension) -> Vec<String> {
    let mut examples = vec![wanted.example(), format!("1 {}", wanted.symbol())];
    examples.dedup();
    examples
}

/// The doc, the values, and the default.
fn description(row: &Key, motion: Motion) -> String {
    let takes = match row.takes {
        Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples | Takes::Whole { .. } => {
            let wanted = row.wanted(motion).replace("expected ", "");
            let tolerance = if row.tolerance { ", also with a tolerance, \"± 20 %\"" } else { "" };
            format!(" Takes {wanted}{tolerance}.")
        }
        _ => String::new(),
    };
    let without = match row.presence {
        Presence::Depends(words) => format!(" ({words})"),
        _ => String::new(),
    };
    format!("{}{takes}{without}", row.doc)
}

/// The default of the key, as in a file.
fn default(row: &Key, motion: Motion) -> Option<Value> {
    match (row.presence, row.takes) {
        (Presence::Name(name), _) => Some(json!(name)),
        (Presence::Number(number), takes) => Some(match takes.quantity() {
            Some((measure, _)) => json!(format!("{number} {}", measure.dimension(motion).symbol())),
            None => json!(number as u64),
        }),
        _ => None,
    }
}

/// The names of a table that the user fills.
fn name(letter_first: bool) -> &'static str {
    if letter_first { "^[A-Za-z][A-Za-z0-9_-]*$" } else { "^[A-Za-z0-9_-]+$" }
}

/// An end that is a body; `"puck"` and `"ground"` are such names too.
fn body_name() -> &'static str {
    let letter_first =
        KEYS.iter().any(|row| row.path == "bodies" && matches!(row.takes, Takes::Named { letter_first: true, .. }));
    name(letter_first)
}
