//! The steps of `cargo xtask test`: run side by side, each counted and timed.

use std::collections::VecDeque;
use std::fmt;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Instant;

use anyhow::{Context, Result, anyhow};

use crate::spent;

/// Steps that run at the same time: one more than two cores, for many wait for a browser, an emulator, a line, or another's build.
const LANES: usize = 3;
/// Steps that took less than this, in s, share a row of the table.
const SHOWN: f64 = 1.0;
/// The exit code of a program of tests of which some failed.
const FAILED_TESTS: i32 = 101;

/// A step in the queue.
pub struct Step {
    name: String,
    run: Box<dyn FnOnce() -> Outcome + Send>,
}

/// The result of a step.
struct Outcome {
    passed: u64,
    failed: u64,
    /// Its output before its line.
    text: String,
    /// Why it failed, in its line.
    error: Option<String>,
    /// Its failed tests by themselves, to be run when all other steps have ended; they are not counted before.
    again: Option<Step>,
}

impl Step {
    /// A check, which counts as one test.
    pub fn check(name: impl Into<String>, check: impl FnOnce() -> Result<()> + Send + 'static) -> Self {
        let run = move || match check() {
            Ok(()) => Outcome { passed: 1, failed: 0, text: String::new(), error: None, again: None },
            Err(error) => Outcome::failed(&error),
        };
        Step { name: name.into(), run: Box::new(run) }
    }

    /// A check of programs that wait for each other by the clock: a browser, a board, a drive. One that fails runs again as the tests of
    /// [`program`](Self::program) do.
    pub fn by_the_clock(name: impl Into<String>, check: impl Fn() -> Result<()> + Send + 'static) -> Self {
        let name = name.into();
        let again = by_itself(&name);
        let run = move || match check() {
            Ok(()) => Outcome { passed: 1, failed: 0, text: String::new(), error: None, again: None },
            Err(error) => {
                // Not in the words that count a failed test.
                let text = format!("{error:#}\n").replace("not ok", "failed").replace("FAILED", "failed");
                Outcome { passed: 0, failed: 0, text, error: None, again: Some(Step::check(again, check)) }
            }
        };
        Step { name, run: Box::new(run) }
    }

    /// Tests, each counted; a test program that fails without a count is one failure.
    pub fn tests(name: impl Into<String>, mut command: Command) -> Self {
        let run = move || tests(&mut command).map_or_else(|error| Outcome::failed(&error), |(outcome, _)| outcome);
        Step { name: name.into(), run: Box::new(run) }
    }

    /// The tests of a program, each counted. Those that fail run again by themselves when all other steps have ended, with the same random
    /// numbers, and only then count: a board or a drive answers late where other steps take the processors for longer than it may wait, and
    /// what depends on no clock fails again.
    pub fn program(name: impl Into<String>, mut command: Command) -> Self {
        let name = name.into();
        let again = by_itself(&name);
        let run = move || match tests(&mut command) {
            Ok((outcome, failed)) if failed.is_empty() => outcome,
            Ok((mut outcome, failed)) => {
                outcome.failed = 0;
                outcome.text = outcome.text.replace("... FAILED", "... failed, and runs again by itself");
                let run = move || match tests(&mut chosen(&command, &failed)) {
                    Ok((outcome, _)) if outcome.passed + outcome.failed == failed.len() as u64 => outcome,
                    Ok(_) => Outcome::failed(&anyhow!("of {failed:?} not every one ran again")),
                    Err(error) => Outcome::failed(&error),
                };
                outcome.again = Some(Step { name: again, run: Box::new(run) });
                outcome
            }
            Err(error) => Outcome::failed(&error),
        };
        Step { name, run: Box::new(run) }
    }
}

impl Outcome {
    fn failed(error: &anyhow::Error) -> Self {
        Outcome { passed: 0, failed: 1, text: String::new(), error: Some(format!("{error:#}")), again: None }
    }
}

/// The name of what runs again at the end.
fn by_itself(name: &str) -> String {
    format!("{name}, by itself")
}

/// The same program with these tests.
fn chosen(command: &Command, names: &[String]) -> Command {
    let mut chosen = Command::new(command.get_program());
    chosen.args(names).arg("--exact").envs(command.get_envs().filter_map(|(key, value)| Some((key, value?))));
    if let Some(folder) = command.get_current_dir() {
        chosen.current_dir(folder);
    }
    chosen
}

/// The outcome, and the names of the tests that failed; none where the program ended by anything else than failed tests.
fn tests(command: &mut Command) -> Result<(Outcome, Vec<String>)> {
    let output = command.stdin(Stdio::null()).output()?;
    let mut outcome = Outcome { passed: 0, failed: 0, text: String::new(), error: None, again: None };
    let mut failed = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if let Some(result) = line.strip_prefix("test result: ") {
            outcome.passed += counted(result, "passed")?;
            outcome.failed += counted(result, "failed")?;
        } else if let Some(name) = line.strip_prefix("test ").and_then(|line| line.strip_suffix(" ... FAILED")) {
            failed.push(name.trim_end_matches(" - should panic").to_owned());
            outcome.text += &format!("{line}\n");
        } else if !line.is_empty() && !line.ends_with("... ok") && !line.starts_with("running ") {
            outcome.text += &format!("{line}\n");
        }
    }
    if !output.status.success() {
        outcome.text += &String::from_utf8_lossy(&output.stderr);
        outcome.failed = outcome.failed.max(1);
    }
    if output.status.code() != Some(FAILED_TESTS) || outcome.failed != failed.len() as u64 {
        failed.clear();
    }
    Ok((outcome, failed))
}

/// The number before `word` in "ok. 5 passed; 0 failed; ...".
fn counted(result: &str, word: &str) -> Result<u64> {
    let before = result.split(word).next().context("no count")?;
    Ok(before.split_whitespace().next_back().context("no count")?.parse()?)
}

/// The passed and failed tests so far, and the time of each step.
pub struct Tally {
    passed: u64,
    failed: u64,
    since: Instant,
    rows: Vec<(String, f64)>,
    /// Failed tests that run again at the end.
    again: Vec<Step>,
    /// The lines of the steps that failed, printed once more at the end, as they are far above it.
    failures: Vec<String>,
}

impl Tally {
    pub fn new() -> Self {
        Tally { passed: 0, failed: 0, since: Instant::now(), rows: Vec::new(), again: Vec::new(), failures: Vec::new() }
    }

    /// Runs steps in this order, as many at a time as there are lanes, until all have ended.
    pub fn run(&mut self, steps: Vec<Step>) {
        self.run_after(None, None, steps);
    }

    /// The same once `first` has ended. `quiet`, which leaves the processor to others, begins together with it.
    pub fn run_after(&mut self, first: Option<Step>, quiet: Option<Step>, steps: Vec<Step>) {
        let queue = Mutex::new(VecDeque::from(steps));
        let tally = Mutex::new(self);
        // A step that panics has failed the whole run: the scope passes it on.
        let take = |Step { name, run }: Step| {
            let since = Instant::now();
            let outcome = run();
            let took = since.elapsed().as_secs_f64();
            tally.lock().unwrap_or_else(PoisonError::into_inner).add(name, took, outcome);
        };
        let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
        let rest = || {
            while let Some(step) = next() {
                take(step);
            }
        };
        let (running, ended) = mpsc::channel::<()>();
        let ended = Mutex::new(ended);
        // Nothing is sent: the wait ends with the sender.
        let wait = || {
            let _ = ended.lock().unwrap_or_else(PoisonError::into_inner).recv();
        };
        std::thread::scope(|scope| {
            let (take, rest, wait) = (&take, &rest, &wait);
            scope.spawn(move || {
                first.into_iter().for_each(take);
                drop(running);
                rest();
            });
            scope.spawn(move || {
                quiet.into_iter().for_each(take);
                wait();
                rest();
            });
            for _ in 2..LANES {
                scope.spawn(move || {
                    wait();
                    rest();
                });
            }
        });
    }

    fn add(&mut self, name: String, took: f64, outcome: Outcome) {
        let Outcome { passed, failed, text, error, again } = outcome;
        self.passed += passed;
        self.failed += failed;
        let verdict = match (failed, &again) {
            (0, None) => "ok    ",
            (0, Some(_)) => "again ",
            _ => "FAILED",
        };
        let counts = if passed + failed == 1 { String::new() } else { format!(": {passed} passed, {failed} failed") };
        let error = error.map(|error| format!(": {error}")).unwrap_or_default();
        let line = format!("{verdict} {took:4.0} s  {name}{counts}{error}");
        print!("{text}");
        println!("{line}");
        // A test that fails only beside others is named at the end too.
        if failed > 0 || again.is_some() {
            self.failures.push(line);
        }
        self.again.extend(again);
        self.rows.push((name, took));
    }

    /// Runs failed tests again, one program at a time, and prints the times and the counts. Whether all has passed.
    pub fn end(mut self) -> bool {
        for step in std::mem::take(&mut self.again) {
            self.run(vec![step]);
        }
        println!("\n{self}");
        self.failed == 0
    }
}

/// The slowest first. Steps run at the same time: their times add up to more than the whole.
impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows: Vec<_> = self.rows.iter().collect();
        rows.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let (shown, rest): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(_, took)| *took >= SHOWN);
        writeln!(f, "The steps, {LANES} at a time, in s:")?;
        for (name, took) in shown {
            writeln!(f, "{took:8.1}   {name}")?;
        }
        writeln!(f, "{:8.1}   {} others", rest.iter().map(|(_, took)| took).sum::<f64>(), rest.len())?;
        let processor = spent::processor().map(|took| format!(", {took:.0} s of processor time")).unwrap_or_default();
        writeln!(f, "{:.0} s{processor}", self.since.elapsed().as_secs_f64())?;
        for failure in &self.failures {
            writeln!(f, "{failure}")?;
        }
        // The count is the last line.
        write!(f, "{} passed, {} failed", self.passed, self.failed)
    }
}
