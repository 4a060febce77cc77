//! The recording of a loop under way.

use std::path::{Path, PathBuf};

use hapt_core::SafetyProfile;
use hapt_log::{Header, Recorder};
use hapt_model::World;
use hapt_rt::Record;

use crate::protocol::RecordingSays;
use crate::runner::Runner;
use crate::state::Workbench;

/// A recording under way. Dropped, it is finished, and whoever drops it waits for the disk.
pub struct Recording {
    recorder: Recorder,
    file: PathBuf,
    /// Since its first sample, in ns.
    begun: Option<u64>,
    length: u64,
}

impl Recording {
    /// Starts one in this folder, in a file that is not there yet: certificate and file take their time. It begins with the loop's state at
    /// one of the next samples after [`Runner::begin_log`], so that it can be replayed; a board's state is not known, and its log is to be
    /// looked at.
    ///
    /// # Errors
    /// In a sentence.
    pub(crate) fn start(folder: &Path, bench: &Workbench, profile: SafetyProfile) -> Result<Self, String> {
        let free = |n: &u32| !folder.join(format!("live-{n:04}.mcap")).exists();
        let number = (1..10_000)
            .find(free)
            .ok_or("there are ten thousand recordings here already; --log-dir names another folder")?;
        let file = folder.join(format!("live-{number:04}.mcap"));
        let check = hapt_analysis::check(&bench.judged()).ok();
        let header = Header {
            world_text: bench.source().text.clone(),
            overrides: bench.sets(),
            certificate_json: check.and_then(|check| serde_json::to_string_pretty(&check).ok()),
            device: bench.device().into(),
            profile,
            plan: bench.generation,
            ..Header::default()
        };
        let recorder = Recorder::start(&file, &bench.world, header).map_err(|error| error.to_string())?;
        Ok(Recording { recorder, file, begun: None, length: 0 })
    }

    /// From generation `generation` on the samples are of this world.
    pub fn goes_on_with(&mut self, generation: u32, world: &World) {
        self.recorder.plan(generation, world);
    }

    /// One more sample of the loop, once a log can begin; never waits.
    pub(crate) fn follow(&mut self, runner: &mut dyn Runner, record: &Record) {
        if self.begun.is_some() || runner.log_begins(record) {
            self.length = record.due - *self.begun.get_or_insert(record.due);
            runner.log(&self.recorder, record);
        }
    }

    /// Finishes it aside: a slow disk is not waited for.
    pub fn end(self) {
        // Without a thread it is finished here and now.
        let _ = std::thread::Builder::new().name("finishing".into()).spawn(move || drop(self));
    }

    /// How it goes.
    pub fn says(&self) -> Option<RecordingSays> {
        let state = self.recorder.state();
        Some(RecordingSays {
            file: std::path::absolute(&self.file).unwrap_or_else(|_| self.file.clone()).display().to_string(),
            seconds: self.length as f64 * 1e-9,
            lost: state.lost,
            error: state.error,
        })
    }
}
