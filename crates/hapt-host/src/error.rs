//! The reasons that a loop does not run.

use std::io;

use hapt_rt::Failure;

/// The reason that a session cannot start, or has ended.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The core refuses the world, or the world exceeds the board's size.
    #[error("{0}")]
    World(String),
    /// The system gives no thread.
    #[error("the system gives no thread: {0}")]
    System(#[from] io::Error),
    /// The loop's thread does not start.
    #[error(transparent)]
    Engine(#[from] hapt_rt::Error),
    /// The device failed while it ran.
    #[error("{0}")]
    Device(Failure),
    /// The device of a network's station failed while it ran.
    #[error("{station}: {failure}")]
    Station {
        /// Its name.
        station: String,
        /// Why.
        failure: Failure,
    },
    /// The board does not answer, or refuses the world.
    #[cfg(not(target_family = "wasm"))]
    #[error(transparent)]
    Board(#[from] crate::board::Error),
    /// A thread panicked: a defect of hapt.
    #[error("{0}")]
    Panicked(&'static str),
}
