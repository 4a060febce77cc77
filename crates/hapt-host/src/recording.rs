//! The recording of a session.

use std::path::PathBuf;

#[cfg(not(target_family = "wasm"))]
mod file;
#[cfg(target_family = "wasm")]
#[path = "recording/none.rs"]
mod file;

pub(crate) use file::Recorder;
pub use file::Recording;

/// The refusal of a recording.
pub(crate) const NO_FILES: &str = "a page without a server writes no files; hapt live WORLD records";

/// The progress of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingStatus {
    /// The file, with an absolute path where the system gives one.
    pub file: PathBuf,
    /// Its length in s.
    pub seconds: f64,
    /// Samples lost for lack of room.
    pub lost: u64,
    /// The error that ended it early.
    pub error: Option<String>,
}
