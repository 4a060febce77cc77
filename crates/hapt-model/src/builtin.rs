//! Worlds that need no file: `@notes/euler` wherever a command takes a world.

use crate::error::{Error, ErrorKind};
use crate::source::Source;
use crate::words::did_you_mean;

macro_rules! worlds {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!(env!("WORLDS"), "/", $name, ".toml")))),*]
    };
}

/// Every file under worlds/: its path there without the ending, and its text.
const WORLDS: &[(&str, &str)] = worlds! {
    "notes/spring-mass"
    "notes/wheel"
    "notes/euler"
    "notes/damped"
    "notes/damped-to-ground"
    "notes/trapezoidal"
    "notes/default"
    "notes/released"
    "notes/resonance"
    "notes/pumped-and-damped"
    "devices/eth-wall"
    "devices/smartknob-detents"
    "devices/grating"
    "devices/magnets"
    "devices/game-wheel"
    "devices/road-wheel"
    "devices/two-rates"
    "knob/unbounded"
    "knob/bounded"
    "knob/multi-turn"
    "knob/on-off"
    "knob/return-to-center"
    "knob/fine"
    "knob/fine-detents"
    "knob/coarse-strong"
    "knob/coarse-weak"
    "knob/magnetic"
    "knob/return-with-detents"
    "knob/flywheel"
    "knob/spring-mass"
    "knob/texture"
    "knob/menu"
};

/// The names, each with its `@`.
pub fn names() -> impl Iterator<Item = String> {
    WORLDS.iter().map(|(name, _)| format!("@{name}"))
}

/// The names of a group, `@knob`: those with its name before theirs.
pub fn group(name: &str) -> impl Iterator<Item = String> {
    names().filter(move |known| known.strip_prefix(name).is_some_and(|rest| rest.starts_with('/')))
}

/// The world called `name`, its `@` with it. Path files are searched in the current folder.
///
/// # Errors
/// There is none; the message names the nearest.
pub fn source(name: &str) -> Result<Source, Error> {
    match WORLDS.iter().find(|(known, _)| name.strip_prefix('@') == Some(known)) {
        Some((_, text)) => Ok(Source::from_text(name, *text)),
        None => {
            let hint = meant(name);
            let message = format!("no world {name:?} is built in{hint} (hapt worlds lists them)");
            Err(Error { kind: ErrorKind::Name, key: String::new(), message, location: None })
        }
    }
}

/// `; did you mean "@notes/euler"?` of `@euler`, `notes/euler`, `euler.toml` or `@notes/eulr`; else nothing.
pub fn meant(name: &str) -> String {
    let plain = name.trim_start_matches('@').trim_end_matches(".toml");
    let short = |name: &str| name.rsplit('/').next().unwrap_or_default().to_string();
    let same = |known: &str| known == plain || short(known) == short(plain);
    let known: Vec<&str> = WORLDS.iter().map(|(name, _)| *name).collect();
    let near = |names: &[&str], name: &str| names.iter().position(|known| !did_you_mean(name, [*known]).is_empty());
    let shorts: Vec<String> = known.iter().map(|name| short(name)).collect();
    let shorts: Vec<&str> = shorts.iter().map(String::as_str).collect();
    let found = known.iter().position(|known| same(known)).or_else(|| near(&known, plain));
    match found.or_else(|| near(&shorts, &short(plain))) {
        Some(index) => format!("; did you mean \"@{}\"?", known[index]),
        None => String::new(),
    }
}
