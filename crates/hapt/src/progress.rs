//! The progress of a long run, on standard error.

use std::io::{IsTerminal, Write, stderr};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use terminal_size::terminal_size;

use crate::format;
use crate::messages;

/// Rows between two readings of the clock: often enough for people, and rare enough to take no time.
const EVERY: u64 = 1 << 14;
/// A run that ends by then needs no bar.
const QUICK_RUN: Duration = Duration::from_secs(1);
/// The period of progress lines without a terminal, and with one.
const LINES: Duration = Duration::from_secs(5);
const REDRAWN: Duration = Duration::from_millis(200);

/// Shows the progress: a line that is written anew on a terminal, a line now and then elsewhere, nothing for a short run.
pub struct Progress {
    name: String,
    /// The name of the counted items.
    things: &'static str,
    all: u64,
    /// The number of items at the start.
    before: u64,
    started: Instant,
    last_line: Option<Instant>,
    /// The characters of the terminal's line that is to be replaced.
    shown: usize,
}

impl Progress {
    /// The progress of `all` items, of which this many are done.
    pub fn new(name: &str, things: &'static str, all: u64, before: u64) -> Self {
        Progress { name: name.into(), things, all, before, started: Instant::now(), last_line: None, shown: 0 }
    }

    /// After row `done` of many: reads the clock only now and then.
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
        let terminal = stderr().is_terminal();
        let period = if terminal { REDRAWN } else { LINES };
        if self.last_line.is_some_and(|last| last.elapsed() <= period) {
            return;
        }
        self.last_line = Some(Instant::now());
        let percent = 100.0 * done as f64 / self.all.max(done) as f64;
        let left = elapsed.as_secs_f64() * self.all.saturating_sub(done) as f64
            / done.saturating_sub(self.before).max(1) as f64;
        let all = format::count(self.all);
        let line = format!("{}: {percent:.1} % of {all} {}, {left:.0} s left", self.name, self.things);
        if terminal {
            self.replace(&line);
        } else {
            messages::say(line);
        }
    }

    /// Writes this over the terminal's line.
    fn replace(&mut self, line: &str) {
        let columns = terminal_size().map_or(80, |(columns, _)| usize::from(columns.0));
        let line = fitting(line, columns);
        let _ = stderr().write_all(over(&line, self.shown).as_bytes());
        self.shown = line.chars().count();
    }
}

/// Does work whose items cannot be counted; a line every few seconds says how long it has taken.
pub fn during<T>(name: &str, what: &str, work: impl FnOnce() -> T) -> T {
    std::thread::scope(|scope| {
        // Nothing is sent: the wait ends with the sender, also where the work panics.
        let (_working, ended) = channel::<()>();
        let progress = Progress::new(name, "", 0, 0);
        scope.spawn(move || {
            let mut progress = progress;
            while ended.recv_timeout(LINES) == Err(RecvTimeoutError::Timeout) {
                progress.begins(what);
            }
        });
        work()
    })
}

/// The part of a line that a terminal of this many columns shows on one line.
fn fitting(line: &str, columns: usize) -> String {
    line.chars().take(columns.saturating_sub(1)).collect()
}

/// The characters that replace a line of `shown` characters; the cursor is at its beginning, before and after.
fn over(line: &str, shown: usize) -> String {
    format!("\r{line:<shown$}\r")
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown > 0 {
            self.replace("");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_covers_a_longer_one_and_fits_into_the_terminal() {
        assert_eq!(over("worst: 9 s left", 16), "\rworst: 9 s left \r");
        assert_eq!(over("", 3), "\r   \r");
        assert_eq!(fitting("Größe: 1 %", 6), "Größe");
        assert_eq!(fitting("Größe", 80), "Größe");
        assert_eq!(fitting("Größe", 0), "");
    }

    #[test]
    fn more_than_was_thought_is_all_of_it() {
        let mut progress = Progress::new("worst", "hands", 3, 0);
        if let Some(long_ago) = Instant::now().checked_sub(2 * QUICK_RUN) {
            progress.started = long_ago;
        }
        progress.reached(4);
        assert!(progress.last_line.is_some());
    }
}
