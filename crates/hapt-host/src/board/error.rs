//! The errors of a board.

use std::io;
use std::path::PathBuf;

use hapt_wire::{PROTOCOL, Refusal};

/// The error of a board.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The port cannot be opened.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// The port.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The port was removed.
    #[error("the board at {} is gone: {source}", path.display())]
    Gone {
        /// The port.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// There is no answer to a hello.
    #[error(
        "nothing at {} answers in hapt's protocol: is it the board's port, and does the board run hapt's firmware?",
        path.display()
    )]
    NoAnswer {
        /// The port.
        path: PathBuf,
    },
    /// The board does not answer any more.
    #[error("the board at {} has stopped answering; its own watchdog removes the torque", path.display())]
    Silent {
        /// The port.
        path: PathBuf,
    },
    /// It has restarted since the handshake.
    #[error(
        "the board at {} has restarted: its motor is off and its world is gone. Its watchdog restarts it when its loop stops, and so do its \
         reset button and a supply that dips; run the command again once the cause is found",
        path.display()
    )]
    Restarted {
        /// The port.
        path: PathBuf,
    },
    /// The board has another version of the protocol.
    #[error(
        "the board at {} has version {board} of the protocol, this hapt version {PROTOCOL}: install firmware and hapt of the same release",
        path.display()
    )]
    Protocol {
        /// The port.
        path: PathBuf,
        /// The board's version.
        board: u16,
    },
    /// The board refuses a command.
    #[error("the board refuses to {what}: {}", why.sentence())]
    Refused {
        /// The refused command, such as "arm".
        what: &'static str,
        /// The reason.
        why: Refusal,
    },
    /// Something urgent has interrupted the wait for an acknowledgement ([`super::Link::interrupt_when`]); whether the board has executed the
    /// command is unknown.
    #[error("interrupted while waiting for the board's acknowledgement")]
    Interrupted,
    /// The board has faulted for a reason that this version does not define.
    #[error(
        "the board has faulted for a reason (code {code}) that this hapt does not have; a hapt of its firmware's release names it"
    )]
    UnknownReason {
        /// As the board sends it.
        code: u8,
    },
    /// The board reports another world after a load.
    #[error("the board accepted the world, but reports that it runs another one")]
    NotVerified,
}
