//! The variables of an FMU: one list, from which the model description is written and which every call looks up.

use std::fmt;

use hapt_model::keys::{KEYS, Key, PHYSICAL, Range, Takes};
use hapt_model::{Coupling, Error, Motion, Parameter, Source, World, parameters};
use hapt_sim::{BODY_SIGNALS, Column, Measures, Row, SIGNALS, columns, loop_columns};
use serde::{Deserialize, Serialize};

use crate::Kind;

/// A value of a variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// In SI.
    Real(f64),
    /// A whole number.
    Whole(i64),
    /// One of the names that a key allows.
    Text(String),
}

impl Value {
    /// The type's name in FMI 2.0.
    pub fn type_name(&self) -> &'static str {
        match self {
            Value::Real(_) => "Real",
            Value::Whole(_) => "Integer",
            Value::Text(_) => "String",
        }
    }

    /// Whether both are of one type.
    pub fn is_like(&self, other: &Value) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// As a value of TOML.
    pub fn to_toml(&self) -> String {
        match self {
            Value::Real(value) => format!("{value:?}"),
            Value::Whole(value) => value.to_string(),
            // JSON strings are TOML strings.
            Value::Text(text) => serde_json::Value::from(text.as_str()).to_string(),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Real(value) => write!(f, "{value:?}"),
            Value::Whole(value) => write!(f, "{value}"),
            Value::Text(text) => f.write_str(text),
        }
    }
}

/// The role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The independent variable.
    Time,
    /// The input of this index.
    Input(usize),
    /// A signal of the loop, by its index in [`SIGNALS`].
    Signal(usize),
    /// A signal of a body, or of the handle after all bodies: which of them, and the index in [`BODY_SIGNALS`].
    Body(usize, usize),
    /// A key that may be set until the end of the initialisation.
    Fixed,
    /// A key that may be set between two steps too.
    Tunable,
}

/// A variable. Its value reference is its index in the list.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// A column's name, or the dotted path of a key.
    pub name: String,
    /// Its role.
    pub role: Role,
    /// The SI unit of a real number in hapt's spelling; empty for others.
    pub unit: String,
    /// Its meaning.
    pub doc: String,
    /// The start value; of an output, one of its type.
    pub start: Value,
    /// The smallest value of a real number, where there is one.
    pub min: Option<f64>,
}

impl Variable {
    /// Whether the FMU computes its values.
    pub fn is_output(&self) -> bool {
        match self.role {
            Role::Signal(_) | Role::Body(..) => true,
            Role::Time | Role::Input(_) | Role::Fixed | Role::Tunable => false,
        }
    }

    /// Whether it is a key of the world file.
    pub fn is_parameter(&self) -> bool {
        match self.role {
            Role::Fixed | Role::Tunable => true,
            Role::Time | Role::Input(_) | Role::Signal(_) | Role::Body(..) => false,
        }
    }

    /// The output's value in a row; NaN for any other variable.
    pub fn read(&self, row: &Row) -> f64 {
        match self.role {
            Role::Signal(index) => SIGNALS.get(index).map_or(f64::NAN, |signal| (signal.get)(row)),
            Role::Body(body, index) => match (row.pairs().nth(body), index) {
                (Some((position, _)), 0) => position,
                (Some((_, velocity)), _) => velocity,
                (None, _) => f64::NAN,
            },
            Role::Time | Role::Input(_) | Role::Fixed | Role::Tunable => f64::NAN,
        }
    }
}

/// The puck's signals, the inputs of a loop without its device.
pub const PUCK: [usize; 2] = [1, 2];
/// The device's torque; a loop without its device lacks it.
const APPLIED: usize = 7;

/// All variables of an FMU of this world: time, inputs, outputs, parameters.
///
/// # Errors
/// As [`World::read`].
pub fn variables(kind: Kind, world: &World, source: &Source) -> Result<Vec<Variable>, Error> {
    let list = match kind {
        Kind::Loop => loop_columns(world),
        Kind::Whole => columns(world),
    };
    let mut all = Vec::new();
    let mut push = |column: &Column, role| all.push(of_column(column, role));
    if let Some(time) = list.first() {
        push(time, Role::Time);
    }
    match kind {
        Kind::Loop => {
            for (input, signal) in PUCK.into_iter().enumerate() {
                push(&list[signal], Role::Input(input));
            }
        }
        Kind::Whole => push(&hand(world), Role::Input(0)),
    }
    for (signal, column) in list.iter().enumerate().take(SIGNALS.len()).skip(1) {
        if kind == Kind::Whole || !(PUCK.contains(&signal) || signal == APPLIED) {
            push(column, Role::Signal(signal));
        }
    }
    for (index, column) in list.iter().skip(SIGNALS.len()).enumerate() {
        push(column, Role::Body(index / BODY_SIGNALS.len(), index % BODY_SIGNALS.len()));
    }
    for parameter in parameters(source, &[])? {
        all.extend(of_parameter(kind, world, &parameter));
    }
    Ok(all)
}

fn of_column(column: &Column, role: Role) -> Variable {
    let (name, unit, doc) = (column.name.clone(), column.unit.to_string(), column.doc.to_string());
    Variable { name, role, unit, doc, start: Value::Real(0.0), min: None }
}

/// The hand's torque on the puck, or on its handle, as a column.
fn hand(world: &World) -> Column {
    let motion = world.motion;
    let name = match motion {
        Motion::Rotary => "hand_torque_Nm",
        Motion::Linear => "hand_force_N",
    };
    let doc = match world.device.handle {
        None => "the hand's torque on the puck, held over the communication step",
        Some(_) => "the hand's torque on the handle, held over the communication step",
    };
    Column { name: name.into(), unit: Measures::Effort.unit(motion), doc }
}

/// The variable of a key; `None` for one that changes the FMU's variables, is no scalar, or has no effect in it.
fn of_parameter(kind: Kind, world: &World, parameter: &Parameter) -> Option<Variable> {
    let row = row(world, &parameter.path)?;
    let role = role(kind, row, &parameter.path)?;
    let start = value(row, parameter)?;
    let min = match row.takes.quantity().map(|(_, range)| range) {
        Some(Range::ZeroOrMore | Range::Share) => Some(0.0),
        Some(Range::Positive) => Some(*PHYSICAL.start()),
        Some(Range::Any) | None => None,
    };
    let (name, doc) = (parameter.path.clone(), parameter.doc.to_string());
    Some(Variable { name, role, unit: parameter.unit.clone(), doc, start, min })
}

/// A key's present value; `None` for a word in a quantity's place, and for a value that is no scalar.
pub fn value(row: &Key, parameter: &Parameter) -> Option<Value> {
    match row.takes {
        Takes::Name(_) => Some(Value::Text(parameter.written.clone())),
        Takes::Whole { .. } => parameter.written.parse().ok().map(Value::Whole),
        Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples => parameter.si.map(Value::Real),
        Takes::Text
        | Takes::Numbers { .. }
        | Takes::Ends(_)
        | Takes::Table
        | Takes::Named { .. }
        | Takes::List { .. } => None,
    }
}

/// Whether, and until when, a key may be set in this kind of FMU.
fn role(kind: Kind, row: &Key, path: &str) -> Option<Role> {
    let names: Vec<&str> = path.split('.').collect();
    let only_whole = |role| (kind == Kind::Whole).then_some(role);
    match names[..] {
        ["loop", "delay"] => only_whole(Role::Fixed),
        ["loop", "acceleration" | "cutoff" | "every" | "filter" | "window"] => Some(Role::Tunable),
        ["loop", _] => Some(Role::Fixed),
        ["device", "inertia" | "damping" | "friction" | "friction_backward"] => only_whole(Role::Tunable),
        ["device", "friction_by_position" | "handle" | "stribeck" | "stops", _] => only_whole(Role::Tunable),
        ["device", "lag"] | ["device", "cogging" | "gravity", _] => only_whole(Role::Fixed),
        ["device", "limit"] => Some(Role::Tunable),
        ["device", "encoder" | "levels"] => Some(Role::Fixed),
        ["bodies", _, "inertia"] => Some(Role::Tunable),
        ["bodies", _, _] => Some(Role::Fixed),
        ["couplings", _, "kind"] => None,
        ["couplings", _, _] if matches!(row.takes, Takes::Name(_)) => Some(Role::Fixed),
        ["couplings", _, _] | ["compensation", _, "share" | "velocity" | "cutoff"] => Some(Role::Tunable),
        _ => None,
    }
}

/// The row of the table of keys for a path of this world.
pub fn row(world: &World, path: &str) -> Option<&'static Key> {
    let names: Vec<&str> = path.split('.').collect();
    let kind = |coupling: &Coupling| coupling.law.kind().name();
    let (pattern, kind) = match names[..] {
        ["loop" | "device", _]
        | ["device", "cogging" | "friction_by_position" | "gravity" | "handle" | "stribeck" | "stops", _] => {
            (path.to_string(), None)
        }
        ["compensation", _, name] => (format!("compensation.*.{name}"), None),
        ["bodies", _, name] => (format!("bodies.*.{name}"), None),
        ["couplings", index, name] => {
            (format!("couplings.*.{name}"), Some(kind(world.couplings.get(index.parse::<usize>().ok()?)?)))
        }
        _ => return None,
    };
    KEYS.iter().find(|key| key.path == pattern && key.belongs(kind, None, world.motion))
}
