//! The compiled world as C: its types, and its numbers as one constant.

use crate::Float;
use crate::numbers::{Collected, Constant, Element};

/// The first numbers of a part of the energy, which every kind has, are in the list itself; this is their count.
pub(crate) const PART_NUMBERS: usize = 6;

/// The types and the constant, for code that uses these numbers; names with the prefix `hapt_`.
pub(crate) fn data(world: &Collected, code: &str, float: Float) -> Data {
    let mut lists = Lists { types: String::new(), fields: String::new(), values: Vec::new() };
    for constant in &world.numbers {
        if is_used(code, constant.name) {
            lists.constant(constant, float);
        }
    }
    couplings(world, &mut lists, float);
    if code.contains("world->pairs") {
        pairs(world, &mut lists, float);
    }
    if code.contains("world->parts") {
        parts(world, &mut lists, float);
    }
    let Lists { types, fields, values } = lists;
    Data {
        types: format!("{types}typedef struct {{\n{fields}}} hapt_world;\n\n"),
        constant: format!("static const hapt_world hapt_compiled = {{\n{}}};\n\n", values.concat()),
    }
}

/// The compiled world's types, and its constant.
pub(crate) struct Data {
    pub types: String,
    pub constant: String,
}

/// Whether code uses a number of the compiled world.
pub(crate) fn is_used(code: &str, name: &str) -> bool {
    [format!("world->{name}"), format!("hapt_compiled.{name}")].iter().any(|use_of| {
        code.match_indices(use_of.as_str()).any(|(at, _)| {
            let next = code[at + use_of.len()..].chars().next();
            !next.is_some_and(|next| next.is_ascii_alphanumeric() || next == '_')
        })
    })
}

struct Lists {
    types: String,
    fields: String,
    values: Vec<String>,
}

impl Lists {
    fn constant(&mut self, constant: &Constant, float: Float) {
        let about = if constant.about.is_empty() { String::new() } else { format!("    /* {} */\n", constant.about) };
        self.fields += &format!("{about}    hapt_real {}{};\n", constant.name, dimensions(constant));
        self.values.push(format!("    {}, /* {} */\n", value(constant, float), constant.name));
    }

    /// A list of structs.
    fn list(&mut self, kind: &str, name: &str, rows: &[String]) {
        self.fields += &format!("    hapt_{kind} {name}[{}];\n", rows.len());
        let rows: String = rows.iter().map(|row| format!("        {{{row}}},\n")).collect();
        self.values.push(format!("    {{ /* {name} */\n{rows}    }},\n"));
    }
}

/// A C array has one place at least.
fn dimensions(constant: &Constant) -> String {
    constant.shape.iter().map(|length| format!("[{}]", (*length).max(1))).collect()
}

fn value(constant: &Constant, float: Float) -> String {
    if constant.shape.is_empty() {
        return constant.values.first().map_or_else(String::new, |x| number(*x, float));
    }
    nested(&constant.shape, &constant.values, float)
}

fn nested(shape: &[usize], values: &[f64], float: Float) -> String {
    let Some((length, inner)) = shape.split_first() else {
        return number(values.first().copied().unwrap_or(0.0), float);
    };
    let size: usize = inner.iter().map(|length| (*length).max(1)).product();
    let rows: Vec<String> = (0..(*length).max(1))
        .map(|i| nested(inner, values.get(i * size..(i + 1) * size).unwrap_or(&[]), float))
        .collect();
    format!("{{{}}}", rows.join(", "))
}

/// A number as C writes it, to the bit.
pub(crate) fn number(x: f64, float: Float) -> String {
    if x.is_infinite() {
        return if x > 0.0 { "HAPT_INFINITY".to_owned() } else { "-HAPT_INFINITY".to_owned() };
    }
    match float {
        Float::F32 => format!("{:?}f", x as f32),
        Float::F64 => format!("{x:?}"),
    }
}

/// A struct type of whole numbers and numbers.
fn structure(name: &str, wholes: &[&str], numbers: &[&Constant]) -> String {
    let wholes: String = wholes.iter().map(|name| format!("    int32_t {name};\n")).collect();
    let numbers: String =
        numbers.iter().map(|constant| format!("    hapt_real {}{};\n", constant.name, dimensions(constant))).collect();
    format!("typedef struct {{\n{wholes}{numbers}}} hapt_{name};\n\n")
}

fn row(wholes: &[i64], numbers: &[&Constant], float: Float) -> String {
    let wholes = wholes.iter().map(ToString::to_string);
    wholes.chain(numbers.iter().map(|constant| value(constant, float))).collect::<Vec<_>>().join(", ")
}

/// The kinds of a list, each once, in the order of their first elements.
pub(crate) fn kinds(elements: &[&Element]) -> Vec<&'static str> {
    let mut kinds = Vec::new();
    for element in elements {
        if !kinds.contains(&element.kind) {
            kinds.push(element.kind);
        }
    }
    kinds
}

/// The place of an element among those of its kind.
pub(crate) fn place(elements: &[&Element], i: usize) -> usize {
    elements[..i].iter().filter(|other| other.kind == elements[i].kind).count()
}

/// The place of each.
fn places(elements: &[&Element]) -> Vec<i64> {
    (0..elements.len()).map(|i| place(elements, i) as i64).collect()
}

fn couplings(world: &Collected, lists: &mut Lists, float: Float) {
    let all: Vec<&Element> = world.list("couplings").collect();
    if all.is_empty() {
        return;
    }
    lists.types += "#define HAPT_PUCK (-1)\n#define HAPT_GROUND (-2)\n\n#define HAPT_LINEAR 0\n";
    let kinds: Vec<&str> = kinds(&all).into_iter().filter(|kind| *kind != "linear").collect();
    for (i, kind) in kinds.iter().enumerate() {
        lists.types += &format!("#define HAPT_{} {}\n", kind.to_uppercase(), i + 1);
    }
    lists.types += "\n/* A coupling: its law, its place among those of that law, the ends that take its torque and the opposite (a body,\n \
                    * HAPT_PUCK or HAPT_GROUND), and whether a step finds its torque. */\n";
    lists.types += &structure("coupling", &["law", "place", "first", "second", "found"], &[]);
    let rows: Vec<String> = all
        .iter()
        .zip(places(&all))
        .map(|(coupling, place)| {
            let law = kinds.iter().position(|kind| *kind == coupling.kind).map_or(0, |i| i as i64 + 1);
            let of = |name: &str| coupling.wholes.iter().find(|(this, _)| *this == name).map_or(0, |(_, value)| *value);
            row(&[law, place, of("first"), of("second"), of("found")], &[], float)
        })
        .collect();
    for kind in &kinds {
        of_kind(lists, &all, kind, kind, float);
    }
    lists.list("coupling", "couplings", &rows);
}

/// The type and the list of one kind's own numbers.
fn of_kind(lists: &mut Lists, all: &[&Element], kind: &str, name: &str, float: Float) {
    let of = |element: &&&Element| element.kind == kind;
    let Some(first) = all.iter().find(of).filter(|first| !first.numbers.is_empty()) else { return };
    lists.types += &structure(name, &[], &first.numbers.iter().collect::<Vec<_>>());
    let rows: Vec<String> =
        all.iter().filter(of).map(|element| row(&[], &element.numbers.iter().collect::<Vec<_>>(), float)).collect();
    lists.list(name, name, &rows);
}

fn pairs(world: &Collected, lists: &mut Lists, float: Float) {
    let all: Vec<&Element> = world.list("pairs").collect();
    let Some(first) = all.first() else { return };
    lists.types += &structure("pair_of_bodies", &["first", "second"], &first.numbers.iter().collect::<Vec<_>>());
    let rows: Vec<String> = all
        .iter()
        .map(|pair| {
            let wholes: Vec<i64> = pair.wholes.iter().map(|(_, value)| *value).collect();
            row(&wholes, &pair.numbers.iter().collect::<Vec<_>>(), float)
        })
        .collect();
    lists.list("pair_of_bodies", "pairs", &rows);
}

fn parts(world: &Collected, lists: &mut Lists, float: Float) {
    let all: Vec<&Element> = world.list("parts").collect();
    let Some(first) = all.first() else { return };
    let kinds = kinds(&all);
    for (i, kind) in kinds.iter().enumerate() {
        lists.types += &format!("#define HAPT_STORED_{} {i}\n", kind.to_uppercase());
    }
    // A law may have a number of the same name.
    let common =
        |element: &'_ Element| -> Vec<Constant> { element.numbers.iter().take(PART_NUMBERS).cloned().collect() };
    let names: Vec<&str> = ["kind", "index"].into_iter().chain(first.wholes.iter().map(|(name, _)| *name)).collect();
    lists.types += "\n/* What a coupling stores: its kind, its place among those of that kind, its place among all, the bodies at its ends. */\n";
    lists.types += &structure("part", &names, &common(first).iter().collect::<Vec<_>>());
    let rows: Vec<String> = all
        .iter()
        .zip(places(&all))
        .map(|(part, index)| {
            let kind = kinds.iter().position(|kind| *kind == part.kind).map_or(0, |i| i as i64);
            let wholes: Vec<i64> =
                [kind, index].into_iter().chain(part.wholes.iter().map(|(_, value)| *value)).collect();
            row(&wholes, &common(part).iter().collect::<Vec<_>>(), float)
        })
        .collect();
    let own: Vec<Element> = all
        .iter()
        .map(|part| Element { numbers: part.numbers.iter().skip(PART_NUMBERS).cloned().collect(), ..(*part).clone() })
        .collect();
    let own: Vec<&Element> = own.iter().collect();
    for kind in &kinds {
        of_kind(lists, &own, kind, &format!("stored_{kind}"), float);
    }
    lists.list("part", "parts", &rows);
}
