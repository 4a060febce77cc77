//! What takes long, beside the session: changed worlds with their certificates, and the files of recordings. One task at a time, so that
//! each begins with what the one before it has made.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel};

use hapt_core::SafetyProfile;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;
use crate::desk::{Event, message};
use crate::protocol::Says;
use crate::recording::Recording;
use crate::state::Workbench;

/// Why a key is not set on a real motor.
const UNCERTIFIED: &str =
    "the world would not be certified, and a motor hangs on it; hapt live --uncertified lets that be";

/// What a page wants that takes long.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Several keys with their values, all of them or none; `key` is the one that a page asked about.
    Sets { key: String, sets: Vec<(String, String)> },
    /// Every key as the file has it.
    Reset,
    /// A recording.
    Record,
}

impl Task {
    /// The key that a refusal names.
    pub fn key(&self) -> &str {
        match self {
            Task::Sets { key, .. } => key,
            Task::Reset => "",
            Task::Record => "record",
        }
    }
}

/// A task, for whom, and what it begins with.
pub(crate) struct Job {
    pub client: Client,
    pub task: Task,
    pub bench: Workbench,
    pub profile: SafetyProfile,
    pub folder: PathBuf,
}

/// What has become of it.
pub struct Done {
    pub client: Client,
    pub task: Task,
    /// Of the world that it began with.
    pub generation: u32,
    pub outcome: Result<Made, String>,
}

/// What a task makes.
pub enum Made {
    /// Another world, and what the pages are told of it.
    World(Box<Workbench>, Message),
    /// A recording that has not begun.
    Recording(Recording),
}

/// The thread. Dropped, it finishes what it is at, and ends.
pub(crate) struct Worker(Sender<Job>);

impl Worker {
    /// Answers go to `events`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(events: SyncSender<Event>) -> std::io::Result<Self> {
        let (jobs, incoming): (_, Receiver<Job>) = channel();
        std::thread::Builder::new().name("worker".into()).spawn(move || {
            for job in incoming {
                let (client, task, generation) = (job.client, job.task.clone(), job.bench.generation);
                let outcome = catch_unwind(AssertUnwindSafe(|| job.done()));
                let outcome = outcome.unwrap_or_else(|_| Err("hapt broke off over it, by a defect of its own".into()));
                if events.send(Event::Done(Box::new(Done { client, task, generation, outcome }))).is_err() {
                    break;
                }
            }
        })?;
        Ok(Worker(jobs))
    }

    /// Begins a task; `false`: the thread is gone.
    pub fn begin(&self, job: Job) -> bool {
        self.0.send(job).is_ok()
    }
}

impl Job {
    fn done(self) -> Result<Made, String> {
        let Job { task, bench, profile, folder, .. } = self;
        let next = match task {
            Task::Sets { sets, .. } => bench.with_all(&sets)?,
            Task::Reset => bench.reset()?,
            Task::Record => return Recording::start(&folder, &bench, profile).map(Made::Recording),
        };
        if profile == SafetyProfile::Certified && !hapt_analysis::is_certified(&next.judged()) {
            return Err(UNCERTIFIED.into());
        }
        let says = message(&Says::World(Box::new(next.says())));
        Ok(Made::World(Box::new(next), says))
    }
}
