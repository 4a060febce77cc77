//! In a page there are no files: these types have no values. The signatures are those of file.rs.
#![allow(dead_code)]

use std::path::Path;

use hapt_core::SafetyProfile;
use hapt_model::World;
use hapt_rt::{Change, Engine, Record};

use super::RecordingStatus;
use crate::config::WorldConfig;

/// No recording.
pub enum Recording {}

/// No log.
pub(crate) enum Recorder {}

impl Recording {
    pub(crate) fn in_folder(
        _: &Path,
        _: &WorldConfig,
        _: SafetyProfile,
        _: bool,
        _: Option<&str>,
    ) -> Result<Self, String> {
        Err(super::NO_FILES.into())
    }

    pub(crate) fn change(&mut self, _: u32, _: &World, _: Change) {
        match *self {}
    }

    pub(crate) fn waits(&self) -> bool {
        match *self {}
    }

    pub(crate) fn take(&mut self, _: &Record) -> &Recorder {
        match *self {}
    }

    pub(crate) fn end(self) {
        match self {}
    }

    /// The progress.
    pub fn status(&self) -> RecordingStatus {
        match *self {}
    }
}

impl Recorder {
    pub fn follow(&self, _: &mut Engine, _: &Record) {
        match *self {}
    }
}
