//! Requirements on every refusal.

use std::hash::{DefaultHasher, Hash, Hasher};

use hapt_model::Error;

/// A refusal's outcome: its message without what it quotes.
///
/// # Panics
/// When the message is empty, longer than a screen, more than a sentence and an excerpt, or would move the cursor.
pub fn judged(error: &Error) -> u64 {
    let message = error.to_string();
    assert!(!error.message.is_empty(), "a refusal without a word");
    assert!(message.len() < 4000, "{} bytes of message", message.len());
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "control characters in {message:?}");
    assert!(message.lines().count() <= 5, "more than a sentence and an excerpt: {message}");
    if let Some(location) = &error.location {
        assert!(location.line > 0 && location.column > 0 && location.width > 0, "{location:?}");
    }
    outcome(&(error.kind as u8, skeleton(&error.key), skeleton(&error.message)))
}

/// A number for an outcome.
pub fn outcome(what: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    hasher.finish()
}

/// The letters outside of quotes.
fn skeleton(text: &str) -> String {
    let unquoted = text.split('"').step_by(2);
    unquoted.flat_map(str::chars).filter(|c| c.is_alphabetic()).take(60).collect()
}
