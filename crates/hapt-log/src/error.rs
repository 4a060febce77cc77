//! Why a log cannot be written or read.

use std::io;

/// What is wrong with a log.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The system would not write it.
    #[error("cannot write {path}: {error}")]
    Write {
        /// The file.
        path: String,
        /// The system's, or the format's.
        error: String,
    },
    /// The system would not read it.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] io::Error),
    /// It is something else.
    #[error("{0}")]
    Foreign(String),
    /// The world that it carries is none, or cannot be compiled.
    #[error("the world in the log: {0}")]
    World(String),
    /// Nothing in it can be replayed.
    #[error("{0}")]
    NoReplay(String),
}
