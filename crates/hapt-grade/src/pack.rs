//! A pack of questions: a folder with `pack.toml` and a starter world.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path};

use hapt_model::Source;
use serde::Deserialize;
use serde_json::Value;
use toml::de::{DeTable, DeValue};

use crate::failure::Failure;

/// The largest number of questions of a pack.
const MAX_QUESTIONS: usize = 200;

/// The content of `pack.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pack {
    pub title: String,
    /// The starter, a world or a network file of the pack's folder.
    #[serde(default = "starter")]
    pub world: String,
    /// Keys of the starter whose values differ from student to student, each with the values to choose from.
    #[serde(default)]
    pub student: BTreeMap<String, Vec<String>>,
    pub questions: Vec<Question>,
}

/// One question. Either `from` computes its answer, or `conditions` judge the world that answers it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    pub id: String,
    pub text: String,
    #[serde(default = "one")]
    pub points: u32,
    /// The SI unit of a quantity; absent for words, yes or no, and plain numbers.
    #[serde(default)]
    pub unit: String,
    /// Of the expected number, as a fraction.
    #[serde(default = "percent")]
    pub tolerance: f64,
    /// The same as a quantity, for expected numbers near 0; the larger one holds.
    #[serde(default)]
    pub margin: Option<String>,
    /// Overrides of the starter for this question.
    #[serde(default)]
    pub set: Vec<String>,
    #[serde(default)]
    pub scenario: Option<String>,
    #[serde(default)]
    pub from: Option<Of>,
    /// The keys of the starter that a world as an answer may change; empty: all.
    #[serde(default)]
    pub change: Vec<String>,
    #[serde(default)]
    pub conditions: Vec<Condition>,
}

/// The source of a value.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Of {
    /// Mathematics on paper: a quantity, a word, true or false.
    Value(Value),
    /// A measure of `hapt sweep`.
    Measure(String),
    /// A field of `hapt check --json`, as a JSON pointer: `/passivity/required_damping`, or of a network `/links/0/stiffness_max`.
    Check(String),
    /// A number that the world file has under this key, in SI.
    Key(String),
    /// A statistic of a column of a run; of a network, of this station's.
    Column {
        name: String,
        take: Take,
        #[serde(default)]
        station: Option<String>,
    },
    /// A field of `hapt design --json`.
    Design { travel: String, torque: String, frequency: String, period: String, gives: String },
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Take {
    First,
    Last,
    Least,
    Largest,
    /// The largest magnitude.
    Peak,
    Mean,
    Rms,
}

/// A condition that a world as an answer has to fulfil.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    pub of: Of,
    #[serde(default)]
    pub is: Option<Value>,
    #[serde(default)]
    pub at_least: Option<Value>,
    #[serde(default)]
    pub at_most: Option<Value>,
}

fn starter() -> String {
    "starter.toml".into()
}

const fn one() -> u32 {
    1
}

const fn percent() -> f64 {
    0.01
}

impl Pack {
    /// Reads the pack in this folder.
    pub fn open(folder: &Path) -> Result<(Pack, Source), Failure> {
        let path = folder.join("pack.toml");
        let name = path.display().to_string();
        let tree = tree(&open(folder, "pack.toml")?)?;
        let pack: Pack = serde_json::from_value(tree).map_err(|error| Failure::input(format!("{name}: {error}")))?;
        pack.check().map_err(|error| Failure::input(format!("{name}: {error}")))?;
        let source = open(folder, &pack.world)?;
        Ok((pack, source))
    }

    fn check(&self) -> Result<(), String> {
        if self.questions.is_empty() || self.questions.len() > MAX_QUESTIONS {
            return Err(format!("{} questions; a pack has 1 to {MAX_QUESTIONS}", self.questions.len()));
        }
        if let Some((key, _)) = self.student.iter().find(|(_, values)| values.is_empty()) {
            return Err(format!("student.\"{key}\" has no values; give those to choose from"));
        }
        let mut seen = BTreeSet::new();
        for Question { id, from, conditions, tolerance, .. } in &self.questions {
            if !seen.insert(id) {
                return Err(format!("the question {id:?} stands twice; every id is given once"));
            }
            if from.is_some() != conditions.is_empty() {
                return Err(format!("the question {id:?} needs either `from` or `conditions`"));
            }
            if !(tolerance.is_finite() && *tolerance >= 0.0) {
                return Err(format!("the tolerance of {id:?} must be a fraction, 0 or more"));
            }
            let bounded = |c: &Condition| c.is.is_some() || c.at_least.is_some() || c.at_most.is_some();
            if !conditions.iter().all(bounded) {
                return Err(format!("a condition of {id:?} needs `is`, `at_least` or `at_most`"));
            }
        }
        Ok(())
    }

    /// The overrides of the starter for a student: of each key one value, chosen by the name.
    pub fn of_student(&self, name: Option<&str>) -> Vec<String> {
        let Some(name) = name else { return Vec::new() };
        let chosen = |(key, values): (&String, &Vec<String>)| {
            let length = u64::try_from(values.len()).ok().filter(|length| *length > 0)?;
            let at = usize::try_from(hash(name, key) % length).ok()?;
            Some(format!("{key}={}", values.get(at)?))
        };
        self.student.iter().filter_map(chosen).collect()
    }
}

/// FNV-1a of both texts (64 bits), its high half folded in: the same on every machine.
fn hash(name: &str, key: &str) -> u64 {
    let bytes = name.bytes().chain([0]).chain(key.bytes());
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    hash ^ (hash >> 32)
}

/// Opens a regular file of a folder or below it; other files and links are refused.
pub fn open(folder: &Path, file: &str) -> Result<Source, Failure> {
    let refused = |why: &str| {
        Failure::input(format!("{file:?} {why}; give a file beside this one or below, by its relative path"))
    };
    let path = Path::new(file);
    if file.is_empty() || !path.components().all(|part| matches!(part, Component::Normal(_))) {
        return Err(refused("leads out of the folder"));
    }
    let mut at = folder.to_path_buf();
    for part in path.components() {
        at.push(part);
        let there = fs::symlink_metadata(&at)
            .map_err(|error| Failure::input(format!("cannot read {}: {error}", at.display())))?;
        if there.is_symlink() {
            return Err(refused("is or passes through a symbolic link"));
        }
    }
    // Opening a file that is not regular might block.
    if !at.is_file() {
        return Err(refused("is not a file"));
    }
    Ok(Source::open(&at)?)
}

/// A TOML file as a tree of JSON values. Its depth is the parser's own limit.
pub fn tree(source: &Source) -> Result<Value, Failure> {
    let table = DeTable::parse(&source.text).map_err(|error| {
        let before = error.span().and_then(|span| source.text.get(..span.start)).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        Failure::input(format!("{}:{line}: not TOML: {}", source.name, error.message()))
    })?;
    Ok(of_table(table.into_inner()))
}

fn of_table(table: DeTable<'_>) -> Value {
    Value::Object(
        table.into_iter().map(|(key, value)| (key.into_inner().into_owned(), json(value.into_inner()))).collect(),
    )
}

fn json(value: DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::String(text.into_owned()),
        DeValue::Integer(number) => {
            i64::from_str_radix(number.as_str(), number.radix()).map_or(Value::Null, Value::from)
        }
        DeValue::Float(number) => number.as_str().parse::<f64>().map_or(Value::Null, Value::from),
        DeValue::Boolean(is) => Value::Bool(is),
        DeValue::Datetime(at) => Value::String(at.to_string()),
        DeValue::Array(items) => items.into_iter().map(|item| json(item.into_inner())).collect(),
        DeValue::Table(table) => of_table(table),
    }
}
