//! Drives the targets on stable for a few seconds each: `bounded --seconds 5 world core`; without names, all of them.
//!
//! Inputs are seeds and edits of them, the same in every run; an input with a new outcome is kept and edited further. The first
//! finding of a target ends it and is written to `findings/`. `--corpus DIR` writes the seeds for libFuzzer instead, and
//! `--dictionary` prints its words.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use hapt_fuzz::{Mutator, TARGETS, Target, judged, target, watch, words};

fn main() -> ExitCode {
    let (mut seconds, mut names, mut arguments) = (5.0, Vec::new(), std::env::args().skip(1));
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seconds" => seconds = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(seconds),
            "--corpus" => return corpus(&PathBuf::from(arguments.next().unwrap_or_default())),
            "--dictionary" => {
                words().iter().for_each(|word| println!("\"{}\"", escaped(word)));
                return ExitCode::SUCCESS;
            }
            name => names.push(name.to_string()),
        }
    }
    let chosen: Vec<&Target> =
        if names.is_empty() { TARGETS.iter().collect() } else { names.iter().map(|name| target(name)).collect() };
    watch(|| {
        let (target, input) = &*under_way();
        save(target, input, "it does not come back");
        std::process::exit(1);
    });
    let mut found = false;
    for target in chosen {
        found |= !drive(target, Duration::from_secs_f64(seconds));
    }
    ExitCode::from(u8::from(found))
}

/// The present input.
fn under_way() -> MutexGuard<'static, (&'static str, Vec<u8>)> {
    static INPUT: Mutex<(&str, Vec<u8>)> = Mutex::new(("", Vec::new()));
    INPUT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Drives a target with its seeds, and then for `length` with edits of them. Returns whether nothing was found.
fn drive(target: &'static Target, length: Duration) -> bool {
    let mut mutator = Mutator::new(words().into_iter().map(String::into_bytes).collect());
    let mut corpus: Vec<Vec<u8>> = Vec::new();
    let mut outcomes = HashSet::new();
    let (mut start, mut executions) = (None, 0u64);
    let mut seeds = (target.seeds)().into_iter();
    loop {
        let input = match seeds.next() {
            Some(seed) => seed,
            None if start.get_or_insert_with(Instant::now).elapsed() >= length => break,
            None => {
                let (one, other) = (mutator.below(corpus.len()), mutator.below(corpus.len()));
                mutator.mutated(&corpus[one], &corpus[other], target.longest)
            }
        };
        *under_way() = (target.name, input.clone());
        executions += 1;
        match catch_unwind(AssertUnwindSafe(|| judged(target, &input))) {
            Err(_) => {
                save(target.name, &input, "see above");
                return false;
            }
            // Long inputs are tried, but not edited further, as their edits are slow.
            Ok(outcome) => {
                if outcomes.insert(outcome) && input.len() <= target.longest || corpus.is_empty() {
                    corpus.push(input);
                }
            }
        }
    }
    println!("{:<9} {executions} executions, {} outcomes, nothing found", target.name, outcomes.len());
    true
}

/// Keeps a finding.
fn save(target: &str, input: &[u8], why: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("findings");
    let path = folder.join(format!("{target}-{}", input.len()));
    let written = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input));
    let place = written.map_or_else(|error| error.to_string(), |()| path.display().to_string());
    println!("{target:<9} FOUND something, {why}: {place}");
}

/// The seeds of each target in a folder of its own.
fn corpus(folder: &Path) -> ExitCode {
    for target in &TARGETS {
        let folder = folder.join(target.name);
        let seeds = (target.seeds)();
        let written = std::fs::create_dir_all(&folder).and_then(|()| {
            let mut few = seeds.iter().filter(|seed| seed.len() <= target.longest).enumerate();
            few.try_for_each(|(i, seed)| std::fs::write(folder.join(format!("seed-{i}")), seed))
        });
        if let Err(error) = written {
            eprintln!("{}: {error}", folder.display());
            return ExitCode::from(3);
        }
    }
    ExitCode::SUCCESS
}

/// As libFuzzer's dictionaries are written.
fn escaped(word: &str) -> String {
    let plain = |byte: u8| (byte.is_ascii_graphic() || byte == b' ') && byte != b'"' && byte != b'\\';
    word.bytes().map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("\\x{byte:02x}") }).collect()
}
