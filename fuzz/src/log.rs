//! A log: read as far as it goes, and what can be read is replayed.

use hapt_log::{Ending, Error, Log, replay};

use crate::messages::outcome;

/// The input is the file. Every sample has a value for each column; an error is one line or, for its world, as for others.
pub fn run(bytes: &[u8]) -> u64 {
    let mut log = match Log::read(bytes) {
        Ok(log) => log,
        Err(error) => return refused(&error),
    };
    let mut samples = 0u64;
    let end = loop {
        match log.next() {
            Ok(Some(sample)) => assert_eq!(sample.values.len(), sample.plan.columns.len()),
            Ok(None) => break 0,
            Err(error) => break refused(&error),
        }
        samples += 1;
    };
    assert!(samples > 0 || end > 0 || *log.ending() != Ending::Whole, "an empty log passes for whole");
    let again = match Log::read(bytes).and_then(|mut log| replay(&mut log)) {
        Ok(replay) => {
            assert!(replay.compared <= samples && replay.different <= replay.compared);
            outcome(&(replay.first.is_some(), replay.skipped > 0, replay.gaps.min(3)))
        }
        Err(error) => refused(&error),
    };
    let ending = match log.ending() {
        Ending::Whole => String::new(),
        Ending::Cut(_) => "cut".into(),
        Ending::Damaged(_, what) => what.chars().filter(|c| c.is_alphabetic()).collect(),
    };
    outcome(&(again, end, ending, samples.min(3)))
}

fn refused(error: &Error) -> u64 {
    let message = error.to_string();
    assert!(!message.is_empty() && message.len() < 4000, "{} bytes of message", message.len());
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "control characters in {message:?}");
    let plain: String =
        message.split('"').step_by(2).flat_map(str::chars).filter(|c| c.is_alphabetic()).take(60).collect();
    outcome(&plain)
}
