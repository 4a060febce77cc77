//! Worlds that need no file: `@notes/euler` wherever a world is wanted.

use hapt_model::{Source, did_you_mean};

use crate::failure::Failure;

macro_rules! worlds {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../worlds/", $name, ".toml")))),*]
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
};

/// The names, each with its `@`.
pub fn names() -> impl Iterator<Item = String> {
    WORLDS.iter().map(|(name, _)| format!("@{name}"))
}

/// The world called `name`, its `@` with it. Path files are looked for in the current folder.
pub fn source(name: &str) -> Result<Source, Failure> {
    match WORLDS.iter().find(|(known, _)| name.strip_prefix('@') == Some(known)) {
        Some((_, text)) => Ok(Source::from_text(name, *text)),
        None => {
            let known: Vec<String> = names().collect();
            let hint = did_you_mean(name, known.iter().map(String::as_str));
            Err(Failure::input(format!("no world {name:?} is built in{hint} (hapt worlds lists them)")))
        }
    }
}
