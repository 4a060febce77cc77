//! What pages say to `hapt live`, one message a line, and what they set.

use hapt_live::protocol::{Said, Says};
use hapt_live::state::Workbench;
use hapt_model::Source;

use crate::messages;
use crate::set::EVERYTHING;

/// So many messages of an input are heard: each that sets a key reads a world.
const HEARD: usize = 64;

/// The messages on a world with a row of every sort.
///
/// # Panics
/// When an answer is empty or longer than a screen, or a world that was taken has no page.
pub fn run(bytes: &[u8]) -> u64 {
    let text = String::from_utf8_lossy(bytes);
    let source = Source::from_text("w.toml", EVERYTHING);
    let Ok(mut bench) = Workbench::new(source, Vec::new()) else { return 0 };
    let mut outcome = 0_u64;
    for line in text.split('\n').take(HEARD) {
        let next = match Said::read(line) {
            Ok(Said::Set { key, value }) => bench.with(&key, &value),
            Ok(Said::Sets { sets }) => bench.with_all(&sets),
            Ok(Said::Reset) => bench.reset(),
            Ok(said) => {
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&std::mem::discriminant(&said));
                continue;
            }
            Err(words) => Err(words),
        };
        match next {
            Ok(next) => {
                bench = next;
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&bench.keys().len());
            }
            Err(words) => {
                assert!(!words.is_empty() && words.len() < 4000, "{} bytes of answer", words.len());
                let letters: String = words.chars().filter(|c| c.is_alphabetic()).take(24).collect();
                outcome = outcome.wrapping_mul(31) ^ messages::outcome(&letters);
            }
        }
    }
    assert!(Says::World(Box::new(bench.says())).json().contains("\"columns\""), "no page for {:?}", bench.sets());
    outcome
}
