//! A recording as an MCAP file.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use hapt_core::SafetyProfile;
use hapt_log::Header;
pub(crate) use hapt_log::Recorder;
use hapt_model::World;
use hapt_rt::{Change, Record};

use super::RecordingStatus;
use crate::config::WorldConfig;

/// A recording. Dropped, it is finished, and the caller waits for the disk.
pub struct Recording {
    recorder: Recorder,
    file: PathBuf,
    /// Whether it waits for the state of the loop, from which a replay can begin.
    needs_state: bool,
    /// The instant of its first sample, in ns.
    begun: Option<u64>,
    length: u64,
}

/// A new file of the next number in a folder, also where others record into it at the same time.
fn create(folder: &Path, station: Option<&str>) -> Result<(File, PathBuf), String> {
    let station = station.map(|name| format!("{name}-")).unwrap_or_default();
    for number in 1..10_000 {
        let file = folder.join(format!("live-{station}{number:04}.mcap"));
        match OpenOptions::new().write(true).create_new(true).open(&file) {
            Ok(opened) => return Ok((opened, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("cannot write {}: {error}", file.display())),
        }
    }
    Err("there are ten thousand recordings here already; --log-dir names another folder".into())
}

impl Recording {
    /// A recording by `recorder`, which writes to `file`, for a session that has taken no sample yet.
    pub fn from_the_start(recorder: Recorder, file: PathBuf) -> Self {
        Recording { recorder, file, needs_state: false, begun: None, length: 0 }
    }

    /// Creates a file that does not exist yet, which takes time. The recording begins with the loop's state at one of the samples after
    /// [`Runner::begin_log`], so that it can be replayed; a board does not report its state. `linked`: as [`Runner::has_outside`]. Its name has the
    /// station's, where the loop is one of a network.
    ///
    /// # Errors
    /// In a sentence.
    pub(crate) fn in_folder(
        folder: &Path,
        config: &WorldConfig,
        profile: SafetyProfile,
        linked: bool,
        station: Option<&str>,
    ) -> Result<Self, String> {
        let (opened, file) = create(folder, station)?;
        let check = hapt_analysis::check(&config.certified_world()).ok();
        let header = Header {
            world_text: config.source().text.clone(),
            overrides: config.sets(),
            certificate_json: check.and_then(|check| serde_json::to_string_pretty(&check).ok()),
            device: config.device().into(),
            profile,
            plan: config.generation,
            linked,
            ..Header::default()
        };
        let recorder = Recorder::start_in(opened, &file, &config.world, header).map_err(|error| {
            // A file without a log is removed.
            let _ = std::fs::remove_file(&file);
            error.to_string()
        })?;
        Ok(Recording { recorder, file, needs_state: true, begun: None, length: 0 })
    }

    /// Announces the world of the samples from `generation` on.
    pub(crate) fn change(&mut self, generation: u32, world: &World, change: Change) {
        self.recorder.plan(generation, world, change);
    }

    /// Whether it waits for the sample from which a replay can begin.
    pub(crate) fn waits(&self) -> bool {
        self.needs_state && self.begun.is_none()
    }

    /// Counts the next sample, and returns the recorder that writes it.
    pub(crate) fn take(&mut self, record: &Record) -> &Recorder {
        self.length = record.due.saturating_sub(*self.begun.get_or_insert(record.due));
        &self.recorder
    }

    /// Finishes on its own thread, so that no caller waits for a slow disk.
    pub(crate) fn end(self) {
        // Without a thread it finishes here.
        let _ = std::thread::Builder::new().name("finishing".into()).spawn(move || drop(self));
    }

    /// The recorder, to be finished by the caller.
    pub fn into_recorder(self) -> Recorder {
        self.recorder
    }

    /// The progress.
    pub fn status(&self) -> RecordingStatus {
        let state = self.recorder.state();
        RecordingStatus {
            file: std::path::absolute(&self.file).unwrap_or_else(|_| self.file.clone()),
            seconds: self.length as f64 * 1e-9,
            lost: state.lost,
            error: state.error,
        }
    }
}
