//! The loop of this computer: on a thread of its own, or sample by sample.

use std::time::Duration;

use hapt_core::{Request, SafetyProfile};
#[cfg(not(target_family = "wasm"))]
use hapt_rt::Settings;
use hapt_rt::{
    Change, Device, End, Engine, Epoch, Failure, LoopCommand, LoopHandle, Outside, Plan, Realtime, Record, Stepper,
};

use crate::config::WorldConfig;
use crate::error::Error;
use crate::recording::Recorder;
use crate::runner::{Runner, RunnerEvent};

/// The longest time that a loop without a thread catches up at once; in a longer pause its time stops.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);

/// The loop of this computer.
pub(crate) struct LocalLoop {
    engine: Engine,
    /// The last plan sent.
    plan: Box<Plan>,
    /// Without a thread.
    steps: Option<Steps>,
    has_outside: bool,
}

/// Takes the samples without a thread.
struct Steps {
    stepper: Stepper,
    /// The last instant of the caller's clock, and the loop's time until which samples are due.
    now: Option<Duration>,
    until: Duration,
    failed: Option<Failure>,
}

impl Steps {
    /// Takes the next sample, if it is due.
    fn step(&mut self) {
        if self.failed.is_none() && u128::from(self.stepper.due()) <= self.until.as_nanos() {
            self.failed = self.stepper.step().err();
        }
    }
}

impl LocalLoop {
    /// Runs the world of `config` on `device`, disarmed.
    #[cfg(not(target_family = "wasm"))]
    pub fn start(
        config: &WorldConfig,
        profile: SafetyProfile,
        device: Box<dyn Device>,
        settings: Settings,
        outside: Outside,
    ) -> Result<Self, Error> {
        let plan = Plan::new(&config.world, profile).map_err(|error| Error::World(error.to_string()))?;
        let has_outside = !outside.is_none();
        let engine = Engine::start_with_outside(plan.clone(), device, settings, outside)?;
        Ok(LocalLoop { engine, plan: Box::new(plan), steps: None, has_outside })
    }

    /// The same without a thread.
    pub fn stepped(
        config: &WorldConfig,
        profile: SafetyProfile,
        device: Box<dyn Device>,
        outside: Outside,
    ) -> Result<Self, Error> {
        let plan = Plan::new(&config.world, profile).map_err(|error| Error::World(error.to_string()))?;
        let (engine, stepper) = Engine::stepped(plan.clone(), device, outside)?;
        let steps = Steps { stepper, now: None, until: Duration::ZERO, failed: None };
        Ok(LocalLoop { engine, plan: Box::new(plan), steps: Some(steps), has_outside: false })
    }
}

impl Runner for LocalLoop {
    fn handle(&self) -> LoopHandle {
        self.engine.handle().clone()
    }

    fn request(&mut self, request: Request, epoch: Epoch) -> bool {
        self.engine.send_of(LoopCommand::Request(request), epoch).is_ok()
    }

    fn change(&mut self, next: &WorldConfig, change: Change) -> Result<(), String> {
        let plan = Plan::replacing(&next.world, &self.plan, change).map_err(|error| error.to_string())?;
        let plan = Box::new(plan);
        self.engine.send(LoopCommand::Swap(plan.clone())).map_err(|_| "the loop is busy; set it again")?;
        self.plan = plan;
        Ok(())
    }

    fn event(&mut self) -> Option<RunnerEvent> {
        None
    }

    fn advance(&mut self, now: Duration) {
        if let Some(steps) = &mut self.steps {
            let before = steps.now.replace(now).unwrap_or(now);
            steps.until += now.saturating_sub(before).min(MAX_CATCH_UP);
        }
    }

    fn record(&mut self) -> Option<Record> {
        if let Some(steps) = &mut self.steps {
            steps.step();
        }
        self.engine.records.pop().ok()
    }

    fn ended(&mut self) -> Option<Result<(), Error>> {
        if let Some(failure) = self.steps.as_ref().and_then(|steps| steps.failed) {
            return Some(Err(Error::Device(failure)));
        }
        self.engine.ended().map(|end| match end {
            End::Stopped => Ok(()),
            End::Device(failure) => Err(Error::Device(failure)),
            End::Panicked => Err(Error::Panicked("the loop has ended by a defect of hapt's own")),
        })
    }

    fn end(&mut self) {
        self.engine.end();
    }

    fn realtime(&self) -> Option<&Realtime> {
        self.steps.is_none().then(|| self.engine.realtime())
    }

    fn can_record(&self) -> bool {
        self.steps.is_none()
    }

    fn has_outside(&self) -> bool {
        self.has_outside
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
