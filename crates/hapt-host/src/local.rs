//! The loop on a thread of this computer.

use hapt_core::{Request, SafetyProfile};
use hapt_log::Recorder;
use hapt_rt::{Device, End, Engine, Epoch, LoopHandle, Order, Plan, Realtime, Record, Settings};

use crate::config::WorldConfig;
use crate::machine::Error;
use crate::runner::{Runner, RunnerEvent};

/// The loop on a thread of this computer.
pub(crate) struct LocalLoop {
    engine: Engine,
    /// The last plan sent.
    plan: Box<Plan>,
}

impl LocalLoop {
    /// Runs the world of `config` on `device`, disarmed.
    pub fn start(
        config: &WorldConfig,
        profile: SafetyProfile,
        device: Box<dyn Device>,
        settings: Settings,
    ) -> Result<Self, Error> {
        let plan = Plan::new(&config.world, profile).map_err(|error| Error::World(error.to_string()))?;
        let engine = Engine::start_with(plan.clone(), device, settings)?;
        Ok(LocalLoop { engine, plan: Box::new(plan) })
    }
}

impl Runner for LocalLoop {
    fn handle(&self) -> LoopHandle {
        self.engine.handle().clone()
    }

    fn request(&mut self, request: Request, epoch: Epoch) -> bool {
        self.engine.send_of(Order::Request(request), epoch).is_ok()
    }

    fn change(&mut self, next: &WorldConfig) -> Result<(), String> {
        let plan = Box::new(Plan::following(&next.world, &self.plan).map_err(|error| error.to_string())?);
        self.engine.send(Order::Swap(plan.clone())).map_err(|_| "the loop is busy; set it again")?;
        self.plan = plan;
        Ok(())
    }

    fn event(&mut self) -> Option<RunnerEvent> {
        None
    }

    fn record(&mut self) -> Option<Record> {
        self.engine.records.pop().ok()
    }

    fn ended(&mut self) -> Option<Result<(), Error>> {
        self.engine.ended().map(|end| match end {
            End::Asked => Ok(()),
            End::Device(failure) => Err(Error::Device(failure)),
            End::Panicked => Err(Error::Panicked("the loop has ended by a defect of hapt's own")),
        })
    }

    fn end(&mut self) {
        self.engine.end();
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
