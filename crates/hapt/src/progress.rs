//! The progress of a long run, on standard error.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::format;
use crate::messages;

/// Rows between two looks at the clock: often enough for people, too seldom to cost.
const EVERY: u64 = 1 << 14;
/// A run that is done by then needs no bar.
const QUICK_RUN: Duration = Duration::from_secs(1);
/// The period of progress lines without a terminal.
const LINES: Duration = Duration::from_secs(5);

/// Shows the progress: a bar on a terminal, a line now and then elsewhere, nothing for a short run.
pub struct Progress {
    name: String,
    /// The name of the counted items.
    things: &'static str,
    all: u64,
    /// The number of items at the start.
    before: u64,
    started: Instant,
    last_line: Option<Instant>,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// The progress of `all` items, of which this many are done.
    pub fn new(name: &str, things: &'static str, all: u64, before: u64) -> Self {
        Progress { name: name.into(), things, all, before, started: Instant::now(), last_line: None, bar: None }
    }

    /// After row `done` of many: looks at the clock now and then only.
    pub fn at(&mut self, done: u64) {
        if done.is_multiple_of(EVERY) {
            self.reached(done);
        }
    }

    /// Shows a text before the first item is done.
    pub fn begins(&mut self, what: &str) {
        if self.started.elapsed() >= QUICK_RUN && self.last_line.is_none_or(|last| last.elapsed() > LINES) {
            self.last_line = Some(Instant::now());
            messages::say(format_args!("{}: {what}, {:.0} s so far", self.name, self.started.elapsed().as_secs_f64()));
        }
    }

    /// Sets the number of done items.
    pub fn reached(&mut self, done: u64) {
        let elapsed = self.started.elapsed();
        if elapsed < QUICK_RUN {
            return;
        }
        if stderr().is_terminal() {
            let bar = self.bar.get_or_insert_with(|| {
                let bar = ProgressBar::new(self.all).with_message(self.name.clone()).with_elapsed(elapsed);
                let things = self.things;
                let style = ProgressStyle::with_template(&format!(
                    "{{msg}} {{wide_bar}} {{percent}} % of {{human_len}} {things}, {{eta}} left"
                ));
                bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
                bar
            });
            bar.set_position(done);
        } else if self.last_line.is_none_or(|last| last.elapsed() > LINES) {
            self.last_line = Some(Instant::now());
            let percent = 100.0 * done as f64 / self.all.max(done) as f64;
            let left = elapsed.as_secs_f64() * self.all.saturating_sub(done) as f64
                / done.saturating_sub(self.before).max(1) as f64;
            messages::say(format_args!(
                "{}: {percent:.1} % of {} {}, {left:.0} s left",
                self.name,
                format::count(self.all),
                self.things
            ));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_was_thought_is_all_of_it() {
        let mut progress = Progress::new("worst", "hands", 3, 0);
        if let Some(long_ago) = Instant::now().checked_sub(2 * QUICK_RUN) {
            progress.started = long_ago;
        }
        progress.reached(4);
        assert!(progress.last_line.is_some() || progress.bar.is_some());
    }
}
