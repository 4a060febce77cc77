//! Lines on standard error and standard output.

use std::fmt::Display;
use std::io::{self, Write, stderr, stdout};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::spawn;
use std::time::Duration;

/// The queue to a thread that prints: a stopped terminal or a full pipe blocks that thread and no other.
static QUEUE: OnceLock<SyncSender<Message>> = OnceLock::new();
/// The most messages that wait; further ones are dropped.
const WAITING: usize = 1024;
/// The time that the program waits at its end for messages to be printed.
const PRINT_TIMEOUT: Duration = Duration::from_secs(1);

enum Message {
    Line(String),
    /// All messages before it have been printed.
    Settled(SyncSender<()>),
}

/// From now on [`say`] never blocks: the motor may hold a torque.
pub fn never_block() {
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
        // A panic of the loop's thread is reported so too: that thread removes the torque first.
        std::panic::set_hook(Box::new(|defect| say(defect)));
    }
}

/// Prints a line on standard error. A closed one is ignored.
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

/// Prints the notes on the opening of a device.
pub fn notes(notes: &[String]) {
    for note in notes {
        say(format_args!("note: {note}"));
    }
}

/// Waits until the messages have been printed, for a second at most.
pub fn settle() {
    let (settled, printed) = sync_channel(1);
    if QUEUE.get().is_some_and(|queue| queue.try_send(Message::Settled(settled)).is_ok()) {
        let _ = printed.recv_timeout(PRINT_TIMEOUT);
    }
}

/// Prints on standard output without blocking; the outcome arrives at the receiver.
pub fn print(text: String) -> Receiver<io::Result<()>> {
    let (printed, outcome) = channel();
    spawn(move || {
        let mut out = stdout().lock();
        let _ = printed.send(out.write_all(text.as_bytes()).and_then(|()| out.flush()));
    });
    outcome
}
