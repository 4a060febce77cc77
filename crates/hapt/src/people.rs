//! Numbers as people read them, and lines for them to read.

use std::fmt::Display;
use std::io::{self, Write, stderr, stdout};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::spawn;
use std::time::Duration;

pub use hapt_analysis::proposal::number;
use hapt_model::Motion;

/// Messages on their way to a thread that prints them: a terminal that was stopped, or a full pipe, blocks that thread and no other.
static QUEUE: OnceLock<SyncSender<Message>> = OnceLock::new();
/// Messages that may wait; those beyond are dropped.
const WAITING: usize = 1024;
/// So long the end of the program waits for messages to be read.
const PATIENCE: Duration = Duration::from_secs(1);

enum Message {
    Line(String),
    /// All before it have been printed.
    Settled(SyncSender<()>),
}

/// From now on [`say`] waits for nobody: something holds a torque, and has no time for whoever reads.
pub fn wait_for_nobody() {
    if QUEUE.get().is_some() {
        return;
    }
    let (queue, messages) = sync_channel(WAITING);
    let printer = std::thread::Builder::new().name("messages".into()).spawn(move || {
        for message in messages {
            match message {
                Message::Line(line) => {
                    let _ = writeln!(stderr(), "{line}");
                }
                Message::Settled(settled) => {
                    let _ = settled.send(());
                }
            }
        }
    });
    if printer.is_ok() && QUEUE.set(queue).is_ok() {
        // A defect in the loop's thread is said so, too: that thread has a torque to take off first.
        std::panic::set_hook(Box::new(|defect| say(defect)));
    }
}

/// A line on standard error. Who has closed it wants no lines, and the command goes on.
pub fn say(line: impl Display) {
    match QUEUE.get() {
        Some(queue) => {
            let _ = queue.try_send(Message::Line(line.to_string()));
        }
        None => {
            let _ = writeln!(stderr(), "{line}");
        }
    }
}

/// Waits until the messages have been printed, or a second where nobody reads them.
pub fn settle() {
    let (settled, printed) = sync_channel(1);
    if QUEUE.get().is_some_and(|queue| queue.try_send(Message::Settled(settled)).is_ok()) {
        let _ = printed.recv_timeout(PATIENCE);
    }
}

/// Prints on standard output, and waits for nobody: how that went comes by itself.
pub fn print(text: String) -> Receiver<io::Result<()>> {
    let (printed, outcome) = channel();
    spawn(move || {
        let mut out = stdout().lock();
        let _ = printed.send(out.write_all(text.as_bytes()).and_then(|()| out.flush()));
    });
    outcome
}

/// A torque in N mm up to 10 N m, as such devices are spoken of; or a force in N.
pub fn effort(x: f64, motion: Motion) -> String {
    match motion {
        Motion::Rotary if x.abs() < 10.0 => format!("{} N mm", number(1e3 * x)),
        Motion::Rotary => format!("{} N m", number(x)),
        Motion::Linear => format!("{} N", number(x)),
    }
}

/// A time in the unit that suits it.
pub fn time(x: f64) -> String {
    match x.abs() {
        size if size == 0.0 || size >= 1.0 => format!("{} s", number(x)),
        size if size >= 0.9995e-3 => format!("{} ms", number(1e3 * x)),
        _ => format!("{} us", number(1e6 * x)),
    }
}

/// An energy in the unit that suits it; below 10 fJ it is rounding.
pub fn energy(x: f64) -> String {
    let x = if x.abs() < 1e-14 { 0.0 } else { x };
    if x == 0.0 || x.abs() >= 1.0 { format!("{} J", number(x)) } else { format!("{} mJ", number(1e3 * x)) }
}

/// A count with its digits in groups of three.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_six_digits_and_no_more() {
        for (x, text) in [
            (822.25, "822.25"),
            (0.019738764, "0.0197388"),
            (1.0, "1"),
            (100000.0, "100000"),
            (1234567.0, "1234567"),
            (-0.25, "-0.25"),
            (1e-9, "1e-9"),
            (0.0, "0"),
        ] {
            assert_eq!(number(x), text);
        }
        assert_eq!(time(1e-3), "1 ms");
        assert_eq!(count(10001), "10 001");
        assert_eq!(count(7), "7");
    }
}
