//! What can go wrong with a board.

use std::io;
use std::path::PathBuf;

use hapt_wire::{PROTOCOL, Refusal};

/// What can go wrong with a board.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The port cannot be opened.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// The port.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The port was there, and is no more.
    #[error("the board at {} is gone: {source}", path.display())]
    Gone {
        /// The port.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Nothing answers a hello.
    #[error(
        "nothing at {} answers in hapt's protocol: is it the board's port, and does the board run hapt's firmware?",
        path.display()
    )]
    Nobody {
        /// The port.
        path: PathBuf,
    },
    /// Something answered before, and nothing answers now.
    #[error("the board at {} has stopped answering; its own watchdog takes the torque away", path.display())]
    Silent {
        /// The port.
        path: PathBuf,
    },
    /// It began anew since it was greeted.
    #[error(
        "the board at {} has restarted: its motor is off and its world is gone. Its watchdog restarts it when its loop stops, and so do its \
         reset button and a supply that dips; run the command again once the cause is found",
        path.display()
    )]
    Restarted {
        /// The port.
        path: PathBuf,
    },
    /// The board speaks another version.
    #[error(
        "the board at {} speaks version {board} of the protocol, this hapt version {PROTOCOL}: its firmware and hapt do not fit together",
        path.display()
    )]
    Protocol {
        /// The port.
        path: PathBuf,
        /// The board's version.
        board: u16,
    },
    /// The board refuses.
    #[error("the board will not {what}: {}", why.sentence())]
    Refused {
        /// What was asked of it, such as "arm".
        what: &'static str,
        /// Why not.
        why: Refusal,
    },
    /// Something urgent came while an answer was waited for ([`super::Link::yield_to`]); whether the board has done what was asked is not known.
    #[error("interrupted while the board was asked")]
    Interrupted,
    /// The board has faulted for a reason that is newer than this hapt.
    #[error(
        "the board has faulted for a reason (code {code}) that this hapt does not know; a hapt as new as its firmware does"
    )]
    UnknownReason {
        /// As the board sends it.
        code: u8,
    },
    /// The world came, and another one is there.
    #[error("the board accepted the world, but reports that it runs another one")]
    NotVerified,
}
