//! Long tasks, on a separate thread where there is one: changed worlds with their certificates, worlds as files, and the files of
//! recordings. Tasks run one at a time, so that each begins with the result of the previous one.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
#[cfg(not(target_family = "wasm"))]
use std::sync::mpsc::{Receiver, Sender, channel};

use hapt_core::SafetyProfile;
use hapt_rt::Change;

use crate::config::{WorldConfig, stem};
use crate::recording::Recording;

/// The refusal of a key on a motor.
const UNCERTIFIED: &str = "the world would not be certified, which a motor needs; hapt live --uncertified allows it";

/// A long task.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Set several keys, all of them or none; a refusal names `key`.
    Sets {
        /// The key of a single change; empty for several.
        key: String,
        /// Keys with their values, as in the world file.
        sets: Vec<(String, String)>,
        /// Whether every other key goes back to the file's value.
        only: bool,
    },
    /// Set every key back to the file's value.
    Reset,
    /// Enter one of the session's worlds.
    #[cfg(not(target_family = "wasm"))]
    Enter {
        /// Its place.
        world: usize,
    },
    /// Start a recording.
    Record,
    /// Write the world as a file: with every change that was requested before.
    File,
}

impl Task {
    /// Whether it makes another world.
    pub fn changes_world(&self) -> bool {
        !matches!(self, Task::Record | Task::File)
    }

    /// How the world that it makes takes the place of the one before.
    pub fn change(&self) -> Change {
        match self {
            #[cfg(not(target_family = "wasm"))]
            Task::Enter { .. } => Change::Enters,
            Task::Sets { .. } | Task::Reset | Task::Record | Task::File => Change::Follows,
        }
    }

    /// The key that a refusal names.
    pub fn key(&self) -> &str {
        match self {
            Task::Sets { key, .. } => key,
            Task::Reset => "",
            #[cfg(not(target_family = "wasm"))]
            Task::Enter { .. } => "",
            Task::Record => "record",
            Task::File => "",
        }
    }
}

/// A task with its client and its initial data.
pub(crate) struct Job {
    pub client: u64,
    pub task: Task,
    pub config: WorldConfig,
    pub profile: SafetyProfile,
    pub folder: PathBuf,
    /// Whether a recording has the column of external torques.
    pub linked: bool,
    /// The name of the loop's station in a network.
    pub station: Option<String>,
}

/// A finished task.
pub(crate) struct Done {
    pub client: u64,
    pub task: Task,
    /// The generation of the world that it began with.
    pub generation: u32,
    pub outcome: Result<Made, String>,
}

/// The result of a task.
pub(crate) enum Made {
    /// A changed world.
    World(Box<WorldConfig>),
    /// A recording without samples yet.
    Recording(Recording),
    /// The world as a file: its name and its text.
    File(String, String),
}

/// Runs the tasks.
pub(crate) enum Worker {
    /// A thread. Dropped, it finishes its task and ends.
    #[cfg(not(target_family = "wasm"))]
    Thread {
        /// Queued tasks.
        jobs: Sender<Job>,
        /// Finished tasks.
        done: Receiver<Done>,
    },
    /// The caller, where there is no thread.
    AtOnce(VecDeque<Done>),
}

impl Worker {
    /// Starts the thread; `ready` is called on it after each task.
    ///
    /// # Errors
    /// The system gives no thread.
    #[cfg(not(target_family = "wasm"))]
    pub fn start(ready: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (jobs, incoming): (_, Receiver<Job>) = channel();
        let (report, done) = channel();
        std::thread::Builder::new().name("worker".into()).spawn(move || {
            for job in incoming {
                if report.send(job.done()).is_err() {
                    break;
                }
                ready();
            }
        })?;
        Ok(Worker::Thread { jobs, done })
    }

    /// Begins a task; `false`: the thread has ended.
    pub fn begin(&mut self, job: Job) -> bool {
        match self {
            #[cfg(not(target_family = "wasm"))]
            Worker::Thread { jobs, .. } => jobs.send(job).is_ok(),
            Worker::AtOnce(done) => {
                done.push_back(job.done());
                true
            }
        }
    }

    /// The next finished task.
    pub fn done(&mut self) -> Option<Done> {
        match self {
            #[cfg(not(target_family = "wasm"))]
            Worker::Thread { done, .. } => done.try_recv().ok(),
            Worker::AtOnce(done) => done.pop_front(),
        }
    }
}

impl Job {
    fn done(self) -> Done {
        let (client, task, generation) = (self.client, self.task.clone(), self.config.generation);
        let outcome = catch_unwind(AssertUnwindSafe(|| self.run()));
        let outcome = outcome.unwrap_or_else(|_| Err("hapt broke off over it, by a defect of its own".into()));
        Done { client, task, generation, outcome }
    }

    fn run(self) -> Result<Made, String> {
        let Job { task, config, profile, folder, linked, station, .. } = self;
        let next = match task {
            Task::Sets { sets, only: true, .. } => config.with_only(&sets)?,
            Task::Sets { sets, .. } => config.with_all(&sets)?,
            Task::Reset => config.reset()?,
            #[cfg(not(target_family = "wasm"))]
            Task::Enter { world } => config.entering(world)?,
            Task::Record => {
                let station = station.as_deref();
                return Recording::in_folder(&folder, &config, profile, linked, station).map(Made::Recording);
            }
            Task::File => {
                return Ok(Made::File(format!("{}.toml", stem(&config.source().name)), config.file()?));
            }
        };
        if profile == SafetyProfile::Certified && !is_certified(&next) {
            return Err(UNCERTIFIED.into());
        }
        Ok(Made::World(Box::new(next)))
    }
}

#[cfg(not(target_family = "wasm"))]
fn is_certified(config: &WorldConfig) -> bool {
    hapt_analysis::is_certified(&config.certified_world())
}

/// In a page there is no motor, and no certificate.
#[cfg(target_family = "wasm")]
fn is_certified(_: &WorldConfig) -> bool {
    false
}
