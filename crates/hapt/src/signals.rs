//! Signals end every command with no torque on and no unfinished file left, even while the rest of the program is blocked.
//!
//! SIGINT (Ctrl-C), SIGTERM, SIGHUP (the terminal was closed) and SIGQUIT are handled on a thread of their own, which prints nothing
//! itself and waits for no other thread, which may be blocked in a write to a terminal that was stopped (Ctrl-S), or to a full pipe.
//! On Windows Ctrl-C and Ctrl-Break are SIGINT. Windows ends a program a moment after its window is closed, in any case.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Mutex, PoisonError};
use std::thread::{sleep, spawn};
use std::time::Duration;

use crate::{messages, output};

/// The time that a command has to end in order.
const GRACE: Duration = Duration::from_secs(3);
/// The time at a second signal: enough for the loop's last sample, whose torque is 0.
const AT_ONCE: Duration = Duration::from_millis(200);
/// The time for printing the last messages.
const WORDS: Duration = Duration::from_millis(200);

/// A file that an interruption keeps, so that the work can be resumed, and the message about it.
static KEPT: Mutex<Option<String>> = Mutex::new(None);

/// Sets the message of an interruption; `None`: no message.
pub fn when_interrupted(words: Option<String>) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = words;
}

/// Whether a command handles signals by itself, and the exit code of the received signal.
static IN_ORDER: AtomicBool = AtomicBool::new(false);
static SIGNALLED: AtomicU8 = AtomicU8::new(0);

/// The function that removes the torque at a signal.
type Stop = Box<dyn Fn() + Send>;
static STOP: Mutex<Option<Stop>> = Mutex::new(None);

/// From now on the first signal shows in [`signalled`], and the program has three seconds: the command removes the torque, finishes its
/// files, and ends. A second signal ends the program at once. Messages no longer wait for a reader.
pub fn end_in_order() {
    messages::never_block();
    IN_ORDER.store(true, Ordering::SeqCst);
}

/// The first signal calls `stop`, from the signals' own thread: it sets flags, and never waits.
pub fn stop_with(stop: impl Fn() + Send + 'static) {
    let mut slot = STOP.lock().unwrap_or_else(PoisonError::into_inner);
    if signalled().is_some() {
        stop();
    }
    *slot = Some(Box::new(stop));
}

/// The exit code of the received signal.
pub fn signalled() -> Option<u8> {
    Some(SIGNALLED.load(Ordering::SeqCst)).filter(|code| *code != 0)
}

/// Ends the program with this exit code: in order at the first signal, where the command does that.
fn end(code: u8, is_repeated: bool) {
    if !IN_ORDER.load(Ordering::SeqCst) {
        exit(code);
    }
    match SIGNALLED.compare_exchange(0, code, Ordering::SeqCst, Ordering::SeqCst) {
        Ok(_) => {
            if let Some(stop) = &*STOP.lock().unwrap_or_else(PoisonError::into_inner) {
                stop();
            }
            spawn(move || {
                sleep(GRACE);
                exit(code)
            });
        }
        Err(_) if is_repeated => {}
        Err(first) => {
            sleep(AT_ONCE);
            exit(first)
        }
    }
}

fn exit(code: u8) -> ! {
    output::remove_unfinished();
    let words = KEPT.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(words) = words {
        let (done, finished) = channel();
        spawn(move || {
            messages::say(format_args!("hapt: {words}"));
            messages::settle();
            let _ = done.send(());
        });
        let _ = finished.recv_timeout(WORDS);
    }
    leave(code)
}

#[cfg(unix)]
use unix::leave;
#[cfg(unix)]
pub use unix::watch;

#[cfg(unix)]
mod unix {
    use std::sync::Arc;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;

    use super::*;

    /// Ends the program with 128 and the signal's number (SIGINT 130, SIGTERM 143, SIGHUP 129, SIGQUIT 131); unfinished files are removed.
    pub fn watch() {
        let mut ends = vec![SIGINT, SIGTERM, SIGQUIT];
        // Under nohup the program is meant to outlive its terminal.
        if !is_ignored(SIGHUP) {
            ends.push(SIGHUP);
        }
        // Without a handler signals also end the program, with their own code.
        if let Ok(mut signals) = Signals::new(ends) {
            // Both the kernel and the shell send SIGHUP when the terminal closes.
            spawn(move || signals.forever().for_each(|signal| end(128 + signal as u8, signal == SIGHUP)));
        }
        // The limit of a file's size makes a write fail, and does not end the program.
        let _ = signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
    }

    /// Without flushing: standard output may be blocked.
    pub fn leave(code: u8) -> ! {
        signal_hook::low_level::exit(code.into())
    }

    /// Whether the program was started with this signal ignored; only Linux reports it without an unsafe call.
    fn is_ignored(signal: i32) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        mask & (1 << (signal - 1)) != 0
    }
}

/// Ends the program with 130, as SIGINT does elsewhere; unfinished files are removed.
#[cfg(windows)]
pub fn watch() {
    // Without a handler they also end the program, with the system's code.
    let _ = ctrlc::set_handler(|| end(130, false));
}

/// It flushes standard output only where no thread is blocked in a write to it.
#[cfg(windows)]
fn leave(code: u8) -> ! {
    std::process::exit(code.into())
}
