//! `hapt explain`: the meaning of a term in a message or a verdict, and what else is printed for reference.

mod licences;
mod schema;
mod shell;
mod topics;

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_model::keys::rows;
use hapt_model::{CouplingKind, did_you_mean};

use crate::args::{ExplainArgs, ReferenceCommand};
use crate::failure::Failure;
use topics::{Topic, topics};

pub fn run(args: &ExplainArgs) -> Result<ExitCode, Failure> {
    match &args.reference {
        None => {}
        Some(ReferenceCommand::Schema) => return schema::run(),
        Some(ReferenceCommand::Man(args)) => return shell::man(args),
        Some(ReferenceCommand::Completions(args)) => return shell::completions(args),
        Some(ReferenceCommand::Licences) => return licences::run(),
    }
    let text = match args.topic.as_deref().filter(|topic| !topic.trim().is_empty()) {
        None => list(),
        Some(name) => find(name)?,
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

fn list() -> String {
    let mut list = String::new();
    for topic in topics() {
        list += &format!("{:<20} {}\n", topic.name, topic.line);
    }
    list
}

/// The text of a topic; for a kind of coupling without a topic, the table's text on its keys.
fn find(name: &str) -> Result<String, Failure> {
    // Any spelling: critical period, Forward Euler.
    let plain = name.trim().to_lowercase().replace([' ', '_'], "-");
    let called = |topic: &&Topic| topic.name == plain || topic.aliases.contains(&plain.as_str());
    let topic = topics().find(called).map(|topic| topic.text.to_string());
    topic.or_else(|| Some(keys_of(CouplingKind::from_name(&plain)?))).ok_or_else(|| {
        let names = topics().flat_map(|topic| [topic.name].into_iter().chain(topic.aliases.iter().copied()));
        let hint = match did_you_mean(&plain, names) {
            hint if hint.is_empty() => mentioned(&plain),
            hint => hint,
        };
        Failure::input(format!("no topic {name:?}{hint} (hapt explain lists them)"))
    })
}

fn keys_of(kind: CouplingKind) -> String {
    let mut text = format!("A coupling of kind = {:?}, with the keys:\n\n", kind.name());
    for key in rows("couplings.*").filter(|key| key.kinds.contains(&kind.name())) {
        text += &format!("  {:<10} {}\n", key.name(), key.doc);
    }
    text + "\nSee coupling.\n"
}

/// The topics whose texts contain the word, three at most.
fn mentioned(word: &str) -> String {
    let word = word.replace('-', " ");
    let names =
        topics().filter(|topic| word.len() > 2 && topic.text.to_lowercase().contains(&word)).map(|topic| topic.name);
    match names.take(3).collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => none,
        names => format!("; it stands in: {names}"),
    }
}
