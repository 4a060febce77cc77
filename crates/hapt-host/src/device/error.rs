//! The reasons that a device is not opened.

use std::io;
use std::path::PathBuf;

/// The reason that a text is no address, that a world does not run on a device, or that the device does not open.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The text is no address.
    #[error("{0}")]
    Address(String),
    /// The device is not supported on this system.
    #[error("{address}: {what} can be reached from {systems} only")]
    Unsupported {
        /// The device.
        address: String,
        /// Its kind.
        what: &'static str,
        /// The systems that support it.
        systems: &'static str,
    },
    /// The world lacks a key that a real motor needs.
    #[error("a real motor needs {key}: {why}")]
    Missing {
        /// The key.
        key: &'static str,
        /// Its meaning.
        why: &'static str,
    },
    /// The world is not certified.
    #[error("{verdict}; hapt check lists what would certify it")]
    NotCertified {
        /// The verdict, a sentence.
        verdict: String,
    },
    /// The certificate cannot be computed.
    #[error(transparent)]
    Check(#[from] hapt_analysis::Error),
    /// The core refuses the world, or the world exceeds the board's size.
    #[error("{0}")]
    World(String),
    /// A recording cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// A recording has a line that is no row of a run.
    #[error("{}, line {line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1 on.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
    /// A recording has no samples, or too many.
    #[error("{}: {message}", path.display())]
    Recording {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A log is damaged.
    #[error("{}: {error}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: hapt_log::Error,
    },
    /// A drive does not open or does not start.
    #[cfg(target_os = "linux")]
    #[error("{address}: {error}")]
    Drive {
        /// The drive.
        address: hapt_drive::Address,
        /// What went wrong.
        error: hapt_drive::Error,
    },
    /// A board runs the loop itself.
    #[error("hapt:{}: a loop on this computer cannot drive a board, which runs the loop itself", path.display())]
    NotLocal {
        /// The board's port.
        path: PathBuf,
    },
    /// A board without encoder and motor runs no loop by itself.
    #[error("the board {name} has no encoder and no motor: it waits for samples, to be tried in lockstep")]
    ExternallyClocked {
        /// The board's name.
        name: String,
    },
    /// A board does not answer.
    #[error(transparent)]
    Board(#[from] crate::board::Error),
}
