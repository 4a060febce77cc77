//! What runs the loop: a thread of this computer, or a board.

use hapt_core::{Request, SafetyProfile};
use hapt_log::Recorder;
use hapt_rt::{Device, End, Engine, Epoch, LoopHandle, Order, Plan, Realtime, Record, Settings};

use crate::live::Error;
use crate::state::Workbench;

/// What runs the loop. Nothing here waits for it. Dropped, it leaves no torque on.
pub(crate) trait Runner: Send {
    /// What reaches it from any thread, past all that was asked: stop, heartbeats, the withdrawal of control.
    fn handle(&self) -> LoopHandle;

    /// Asks something of the supervisor that was made in this epoch, in the order of the asking; `false`: there is no room just now.
    fn ask(&mut self, request: Request, epoch: Epoch) -> bool;

    /// From one of the next samples on the world is another, whole or not at all; its samples are those of plan `next.generation`.
    ///
    /// # Errors
    /// In a sentence, and nothing has changed.
    fn change(&mut self, next: &Workbench) -> Result<(), String>;

    /// What the pages are to know.
    fn news(&mut self) -> Option<News>;

    /// The next of the samples that it has taken.
    fn record(&mut self) -> Option<Record>;

    /// Whether it has ended: because it was asked to, or in a sentence why else.
    fn ended(&mut self) -> Option<Result<(), String>>;

    /// What the system grants the loop; `None`: another clock than this computer's keeps it.
    fn realtime(&self) -> Option<&Realtime>;

    /// A log is about to begin; `false`: there is no room just now.
    fn begin_log(&mut self) -> bool;

    /// Whether a log can begin with this sample.
    fn log_begins(&mut self, record: &Record) -> bool;

    /// Gives a log one more sample.
    fn log(&mut self, recorder: &Recorder, record: &Record);
}

/// What a runner has to say by itself; only a board has.
#[cfg_attr(not(unix), allow(dead_code))]
pub(crate) enum News {
    /// Something was asked for, and is not done; in a sentence.
    Refused(String),
    /// The world of this generation was not taken, and why: the one that runs goes on.
    Kept(u32, Box<Workbench>, String),
}

/// The loop on a thread of this computer.
pub(crate) struct Here {
    engine: Engine,
    /// The last plan that it was given.
    plan: Box<Plan>,
}

impl Here {
    /// Runs the bench's world on `device`, disarmed.
    pub fn start(
        bench: &Workbench,
        profile: SafetyProfile,
        device: Box<dyn Device>,
        settings: Settings,
    ) -> Result<Self, Error> {
        let plan = Plan::new(&bench.world, profile).map_err(|error| Error::World(error.to_string()))?;
        let engine = Engine::start_with(plan.clone(), device, settings)?;
        Ok(Here { engine, plan: Box::new(plan) })
    }
}

impl Runner for Here {
    fn handle(&self) -> LoopHandle {
        self.engine.handle().clone()
    }

    fn ask(&mut self, request: Request, epoch: Epoch) -> bool {
        self.engine.send_of(Order::Request(request), epoch).is_ok()
    }

    fn change(&mut self, next: &Workbench) -> Result<(), String> {
        let plan = Box::new(Plan::following(&next.world, &self.plan).map_err(|error| error.to_string())?);
        self.engine.send(Order::Swap(plan.clone())).map_err(|_| "the loop is busy; set it again")?;
        self.plan = plan;
        Ok(())
    }

    fn news(&mut self) -> Option<News> {
        None
    }

    fn record(&mut self) -> Option<Record> {
        self.engine.records.pop().ok()
    }

    fn ended(&mut self) -> Option<Result<(), String>> {
        self.engine.ended().map(|end| match end {
            End::Asked => Ok(()),
            End::Device(failure) => Err(failure.to_string()),
            End::Panicked => Err("the loop has ended by a defect of hapt's own".into()),
        })
    }

    fn realtime(&self) -> Option<&Realtime> {
        Some(self.engine.realtime())
    }

    fn begin_log(&mut self) -> bool {
        self.engine.snapshot()
    }

    fn log_begins(&mut self, record: &Record) -> bool {
        self.engine.snapshots.peek().is_ok_and(|snapshot| snapshot.sample <= record.sample)
    }

    fn log(&mut self, recorder: &Recorder, record: &Record) {
        recorder.follow(&mut self.engine, record);
    }
}
