//! The messages of pages to `hapt live`, one a line, and the keys that they set.

use hapt_host::describe;
use hapt_host::messages::{ClientMessage, ServerMessage};
use hapt_host::{WorldConfig, rule};
use hapt_model::Source;

use crate::messages;
use crate::set::EVERYTHING;

/// The most messages of an input: each one that sets a key reads a world.
const HEARD: usize = 64;

/// The messages on a world with a row of every sort.
///
/// # Panics
/// When an answer is empty or longer than a screen, or a world that was taken has no page.
pub fn run(bytes: &[u8]) -> u64 {
    let text = String::from_utf8_lossy(bytes);
    let source = Source::from_text("w.toml", EVERYTHING);
    let Ok(mut config) = WorldConfig::checked(source, Vec::new(), rule::check) else { return 0 };
    let mut outcome = 0_u64;
    for line in text.split('\n').take(HEARD) {
        let next = match ClientMessage::read(line) {
            Ok(ClientMessage::Set { key, value }) => config.with(&key, &value),
            Ok(ClientMessage::Sets { sets, only: true }) => config.with_only(&sets),
            Ok(ClientMessage::Sets { sets, only: false }) => config.with_all(&sets),
            Ok(ClientMessage::Reset) => config.reset(),
            Ok(message) => {
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&std::mem::discriminant(&message));
                continue;
            }
            Err(words) => Err(words),
        };
        match next {
            Ok(next) => {
                config = next;
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&config.keys().len());
            }
            Err(words) => {
                assert!(!words.is_empty() && words.len() < 4000, "{} bytes of answer", words.len());
                let letters: String = words.chars().filter(|c| c.is_alphabetic()).take(24).collect();
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&letters);
            }
        }
    }
    assert!(
        ServerMessage::World(Box::new(describe(&config))).json().contains("\"columns\""),
        "no page for {:?}",
        config.sets()
    );
    outcome
}
