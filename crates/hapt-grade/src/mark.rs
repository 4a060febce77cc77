//! One answer against its question.

// Values of the kinds that a match does not name are compared unchanged.
#![allow(clippy::wildcard_enum_match_arm)]

use std::path::Path;

use hapt_model::{Dimension, Source, Unit, is_network, parameters, parse_quantity, visible};
use serde_json::Value;

use crate::failure::Failure;
use crate::pack::{self, Condition, Of, Question};
use crate::value::Subject;
use hapt_analysis::proposal::number;

/// An answer with its verdict.
pub struct Marked {
    pub id: String,
    pub given: String,
    /// The right answer, for the lecturer.
    pub expected: String,
    pub right: bool,
    /// The reason that it is wrong, where that does not reveal the answer.
    pub why: String,
    pub points: u32,
}

impl Marked {
    pub fn earned(&self) -> u32 {
        if self.right { self.points } else { 0 }
    }
}

/// The reference of the answers.
pub struct Marker<'a> {
    pub starter: &'a Source,
    /// The overrides of the student.
    pub sets: &'a [String],
    /// The folder of the answers: they may name files only inside it.
    pub folder: &'a Path,
}

impl Marker<'_> {
    /// Marks the answer to one question.
    ///
    /// # Errors
    /// A question that cannot be computed.
    pub fn mark(&self, question: &Question, answer: Option<&Value>) -> Result<Marked, Failure> {
        let about = |failure: Failure| match failure {
            Failure::Input(message) => Failure::Input(format!("{}: {message}", question.id)),
            failure @ (Failure::System(_) | Failure::Closed) => failure,
        };
        let sets: Vec<String> = self.sets.iter().chain(&question.set).cloned().collect();
        let subject = Subject { source: self.starter, sets, scenario: question.scenario.as_deref() };
        let (expected, wrong) = match &question.from {
            Some(of) => self.of_value(question, &subject, of, answer),
            None => self.of_world(question, &subject, answer),
        }
        .map_err(about)?;
        Ok(Marked {
            id: question.id.clone(),
            given: answer.map_or_else(|| "-".into(), shown),
            expected,
            right: wrong.is_none(),
            why: plain(&wrong.unwrap_or_default()),
            points: question.points,
        })
    }

    /// The expected answer, and the reason that the given one is wrong: an empty text where the reason would reveal the answer.
    fn of_value(
        &self,
        question: &Question,
        subject: &Subject<'_>,
        of: &Of,
        answer: Option<&Value>,
    ) -> Result<(String, Option<String>), Failure> {
        let dimension = dimension(&question.unit)?;
        let expected = quantity(&subject.value(of)?, dimension).map_err(Failure::input)?;
        let margin =
            question.margin.as_ref().map_or(Ok(0.0), |text| parse_quantity(text, dimension)).map_err(Failure::input)?;
        let text = match &expected {
            Value::Number(x) => {
                format!("{} {}", number(x.as_f64().unwrap_or_default()), question.unit).trim().to_string()
            }
            other => shown(other),
        };
        let Some(answer) = answer else { return Ok((text, Some("no answer".into()))) };
        let wrong = match &expected {
            Value::Number(right) => match quantity(answer, dimension) {
                Ok(Value::Number(given)) => {
                    let (right, given) = (right.as_f64().unwrap_or(f64::NAN), given.as_f64().unwrap_or(f64::NAN));
                    let within = (given - right).abs() <= margin.max(question.tolerance * right.abs());
                    (!within).then(String::new)
                }
                Ok(_) => Some("a number is asked for".into()),
                Err(why) => Some(why),
            },
            right => (word(right) != word(answer)).then(String::new),
        };
        Ok((text, wrong))
    }

    /// The same for a world as an answer.
    fn of_world(
        &self,
        question: &Question,
        subject: &Subject<'_>,
        answer: Option<&Value>,
    ) -> Result<(String, Option<String>), Failure> {
        let text = "a world that fulfils the conditions".to_string();
        let (source, mut sets) = match answer {
            None => return Ok((text, Some("no answer".into()))),
            // A separate file.
            Some(Value::String(_)) if is_network(self.starter) => {
                return Ok((text, Some("a network is answered with keys and values for the starter".into())));
            }
            Some(Value::String(file)) => match pack::open(self.folder, file) {
                Ok(source) => (Some(source), Vec::new()),
                Err(failure) => return unreadable(text, failure),
            },
            Some(Value::Object(_)) => (None, subject.sets.clone()),
            Some(_) => {
                return Ok((
                    text,
                    Some("a world file's name, or keys and values for the starter, are asked for".into()),
                ));
            }
        };
        if let Some(source) = &source
            && let Err(failure) = (Subject { source, sets: Vec::new(), scenario: subject.scenario }).system()
        {
            return unreadable(text, failure);
        }
        let changes = match (answer, &source) {
            (_, Some(source)) if !question.change.is_empty() => match differences(subject, source)? {
                Ok(changes) => changes,
                Err(why) => return Ok((text, Some(why))),
            },
            (Some(keys @ Value::Object(_)), None) => flat(keys),
            _ => Vec::new(),
        };
        if !question.change.is_empty()
            && let Some((key, _)) = changes.iter().find(|(key, _)| !question.change.contains(key))
        {
            return Ok((
                text,
                Some(format!("{key} is not to be changed; the question leaves {}", question.change.join(", "))),
            ));
        }
        // An answer of keys changes the starter, and may use the starter's files.
        let source = match &source {
            Some(source) if question.change.is_empty() => source,
            Some(_) | None => self.starter,
        };
        if source == self.starter && sets.is_empty() {
            sets.clone_from(&subject.sets);
        }
        sets.extend(changes.into_iter().map(|(key, value)| format!("{key}={value}")));
        let made = Subject { source, sets, scenario: subject.scenario };
        if let Err(failure) = made.system() {
            return unreadable(text, failure);
        }
        for condition in &question.conditions {
            let value = match made.value(&condition.of) {
                Ok(value) => value,
                Err(failure) => {
                    // A value that the starter lacks too is a mistake of the pack.
                    subject.value(&condition.of)?;
                    return unreadable(text, failure);
                }
            };
            if let Some(why) = fails(condition, &value)? {
                return Ok((text, Some(why)));
            }
        }
        Ok((text, None))
    }
}

/// The row of an answer that cannot be read; the others are graded.
fn unreadable(text: String, failure: Failure) -> Result<(String, Option<String>), Failure> {
    match failure {
        // Lines below the first are meant for the file's author.
        Failure::Input(message) => {
            Ok((text, Some(format!("cannot be read: {}", message.lines().next().unwrap_or_default()))))
        }
        failure @ (Failure::System(_) | Failure::Closed) => Err(failure),
    }
}

/// The keys in which a world file differs from the starter, with its values; or the key that only one of them has.
fn differences(subject: &Subject<'_>, source: &Source) -> Result<Result<Vec<(String, String)>, String>, Failure> {
    let (starter, own) = (parameters(subject.source, &subject.sets)?, parameters(source, &[])?);
    let titled = |path: &str| path == "title";
    if let Some(missing) = starter.iter().find(|p| !titled(&p.path) && !own.iter().any(|o| o.path == p.path)) {
        return Ok(Err(format!("{} of the starter is missing", missing.path)));
    }
    let mut changes = Vec::new();
    for own in own.into_iter().filter(|own| !titled(&own.path)) {
        let Some(was) = starter.iter().find(|was| was.path == own.path) else {
            return Ok(Err(format!("{} is not in the starter", own.path)));
        };
        let same = match (was.si, own.si) {
            (Some(was), Some(own)) => was == own,
            _ => was.written == own.written,
        };
        if !same {
            changes.push((own.path, own.written));
        }
    }
    Ok(Ok(changes))
}

/// The dotted paths of a table, with their values in the form of `--set`.
fn flat(value: &Value) -> Vec<(String, String)> {
    let Value::Object(table) = value else { return vec![(String::new(), shown(value))] };
    let below = |(key, value): (&String, &Value)| -> Vec<(String, String)> {
        let join = |(path, value): (String, String)| {
            (if path.is_empty() { key.clone() } else { format!("{key}.{path}") }, value)
        };
        flat(value).into_iter().map(join).collect()
    };
    table.iter().flat_map(below).collect()
}

/// The reason that a condition does not hold.
fn fails(condition: &Condition, value: &Value) -> Result<Option<String>, Failure> {
    let name = match &condition.of {
        Of::Measure(name) | Of::Check(name) | Of::Key(name) | Of::Column { name, .. } => name.as_str(),
        Of::Value(_) | Of::Design { .. } => "the value",
    };
    if let Some(right) = &condition.is
        && word(right) != word(value)
    {
        return Ok(Some(format!("{name} is {}, and {} is asked for", shown(value), shown(right))));
    }
    let bounds = [(&condition.at_least, "at least", -1.0), (&condition.at_most, "at most", 1.0)];
    for (bound, words, sign) in bounds {
        let Some(bound) = bound else { continue };
        let si = match bound {
            Value::String(text) => hapt_model::Quantity::parse(text).map_err(Failure::input)?.value,
            other => other.as_f64().ok_or_else(|| Failure::input(format!("{name}: {bound} is no bound")))?,
        };
        let holds = value.as_f64().is_some_and(|value| sign * value <= sign * si);
        if !holds {
            return Ok(Some(format!("{name} is {} in SI, and {words} {} is asked for", shown(value), shown(bound))));
        }
    }
    Ok(None)
}

fn dimension(unit: &str) -> Result<Dimension, Failure> {
    if unit.is_empty() {
        return Ok(Dimension::NONE);
    }
    Unit::parse(unit).map(Unit::dimension).map_err(|error| Failure::input(format!("unit {unit:?}: {error}")))
}

/// A text that begins with a number, as a quantity in SI; any other value unchanged.
fn quantity(value: &Value, dimension: Dimension) -> Result<Value, String> {
    match value {
        Value::String(text) if text.trim_start().starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => {
            parse_quantity(text, dimension).map(Value::from).map_err(|error| error.to_string())
        }
        other => Ok(other.clone()),
    }
}

/// A word, yes or no, or the absence of a value, as text.
fn word(value: &Value) -> String {
    let text = shown(value).trim().to_lowercase();
    match text.as_str() {
        "yes" => "true".into(),
        "no" => "false".into(),
        _ => text,
    }
}

/// A text without control characters.
fn plain(text: &str) -> String {
    text.chars().map(visible).collect()
}

/// A value in a table, on one line and not long.
fn shown(value: &Value) -> String {
    let text = match value {
        Value::Null => "none".into(),
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        other => other.to_string(),
    };
    let text = plain(&text);
    if text.chars().count() > 60 { text.chars().take(59).chain(['…']).collect() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::Pack;
    use hapt_testing::prelude::*;
    use std::path::PathBuf;

    /// The pack of a lesson.
    fn lesson(name: &str) -> (PathBuf, Pack, Source) {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/course").join(name);
        let (pack, starter) = Pack::open(&folder).unwrap_or_else(|failure| panic!("{failure:?}"));
        (folder, pack, starter)
    }

    fn anything() -> impl Strategy<Value = Value> {
        let text = prop_oneof![
            "[-+0-9.eE]{0,6} ?[a-zA-Z°µ/^*·()²0-9-]{0,12}",
            "(\\.\\./|/|\\./|[a-z.]){0,8}",
            "\\PC{0,12}",
            Just("/dev/zero".to_string()),
            Just("\u{0}\n".to_string()),
        ];
        let leaf = prop_oneof![
            text.prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<bool>().prop_map(Value::from),
            Just(Value::Null),
        ];
        let key = prop_oneof!["(couplings|loop|device|[0-9]|stiffness|period|\\.){0,5}", "\\PC{0,8}"];
        leaf.prop_recursive(3, 8, 3, move |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..3).prop_map(Value::from),
                prop::collection::vec((key.clone(), inner), 0..3)
                    .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn no_answer_panics_and_none_that_is_random_earns_a_design(answer in anything()) {
            let (folder, pack, starter) = lesson("passivity");
            let marker = Marker { starter: &starter, sets: &[], folder: &folder };
            for question in pack.questions.iter().filter(|question| !question.conditions.is_empty()) {
                match marker.mark(question, Some(&answer)) {
                    Ok(marked) => prop_assert!(!marked.right, "{}", marked.given),
                    Err(failure) => prop_assert!(matches!(failure, Failure::Input(_)), "{failure:?}"),
                }
            }
        }

        #[test]
        fn a_number_is_right_within_its_tolerance_and_wrong_beyond(off in -0.1f64..0.1) {
            let (folder, pack, starter) = lesson("passivity");
            let marker = Marker { starter: &starter, sets: &[], folder: &folder };
            let question = pack.questions.iter().find(|question| question.id == "required").unwrap();
            // b = KT/2 of 4 N m/rad at 1 ms.
            let marked = marker.mark(question, Some(&Value::from(2e-3 * (1.0 + off)))).unwrap();
            prop_assume!((off.abs() - question.tolerance).abs() > 1e-6);
            prop_assert_eq!(marked.right, off.abs() < question.tolerance);
        }

        #[test]
        fn any_value_of_a_key_marks_or_is_refused(text in "\\PC{0,16}", answer in anything()) {
            let (folder, pack, starter) = lesson("euler");
            let marker = Marker { starter: &starter, sets: &[], folder: &folder };
            let question = pack.questions.iter().find(|question| question.id == "frequency").unwrap();
            for answer in [Value::from(text), answer] {
                prop_assert!(marker.mark(question, Some(&answer)).is_ok());
            }
        }
    }

    #[test]
    fn a_student_has_the_same_numbers_always_and_two_students_may_differ() {
        let (_, pack, starter) = lesson("wall");
        let of = |name: &str| pack.of_student(Some(name));
        assert_eq!(of("ada"), of("ada"));
        let names: Vec<String> = (0..20).map(|i| format!("student{i}")).collect();
        assert!(names.iter().any(|name| of(name) != of("ada")));
        for name in &names {
            assert!(hapt_model::World::read(&starter, &of(name)).is_ok());
        }
        assert!(pack.of_student(None).is_empty());
    }
}
