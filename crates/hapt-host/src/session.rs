//! The session: the state machine of a loop.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::Duration;

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_model::World;
use hapt_rt::{Change, Epoch, LoopHandle, Realtime, Record, Timing};
use hapt_sim::script;

use crate::config::WorldConfig;
use crate::error::Error;
use crate::hand::VirtualHand;
use crate::machine::{Backend, Machine, StationView, WheelView};
use crate::messages::Controls;
use crate::recording::{NO_FILES, Recording, RecordingStatus};
use crate::runner::{Runner, RunnerEvent};
use crate::worker::{Done, Job, Made, Task, Worker};

/// The largest number of queued tasks.
const MAX_TASKS: usize = 32;
/// The time between two steps of a restart.
const RETRY_PERIOD: Duration = Duration::from_millis(50);

/// A session with the loop's runner. No method blocks, except [`Session::end`]; the loop does not wait for the session.
///
/// Stop, heartbeats and the withdrawal of control go through [`Session::handle`] from any thread, ahead of all requests made here.
/// Dropping it removes the torque.
pub struct Session {
    config: WorldConfig,
    runner: Box<dyn Runner>,
    handle: LoopHandle,
    profile: SafetyProfile,
    network: Option<Box<dyn StationView>>,
    wheel: Option<Box<dyn WheelView>>,
    /// The worlds of the plans that the loop may still run, with their generations.
    worlds: VecDeque<(u32, World)>,
    /// The loop's time in s at which the last change of the world has faded in.
    settled: f64,
    hand: VirtualHand,
    /// The scenario that the hand plays, and the loop's time in s at which it ends.
    scenario: Option<(String, f64)>,
    recording: Option<Recording>,
    /// Whether a recording is requested.
    records: bool,
    worker: Worker,
    /// Queued tasks, with their clients, and whether one is running.
    tasks: VecDeque<(u64, Task)>,
    working: bool,
    /// Whether the running task was cancelled.
    cancelled: bool,
    /// A restart requested in this epoch, and the instant of its next step.
    restart: Option<(Epoch, Duration)>,
    /// The folder of recordings.
    folder: PathBuf,
    timing: Timing,
    time: f64,
    state: (Phase, Option<Reason>),
    warning: Option<Reason>,
    events: VecDeque<Event>,
}

/// One sample of the loop.
pub struct Sample<'a> {
    /// The world at the sample.
    pub world: &'a World,
    /// That world's generation.
    pub generation: u32,
    /// The loop's time in s.
    pub time: f64,
    /// The puck's position in the world, in rad (linear: m): 0 where it was armed. Of a real puck it is the encoder's.
    pub position: f64,
    /// The loop's record of the sample.
    pub record: &'a Record,
}

impl Sample<'_> {
    /// Position and velocity of each body of the world.
    pub fn bodies(&self) -> &[(f64, f64)] {
        let all = &self.record.bodies;
        &all[..self.world.bodies.len().min(all.len())]
    }

    /// A torque or an energy of the world; 0 in a phase without torque. The world is then at its start, wherever the puck is, and its couplings' torque is
    /// not applied.
    pub fn made(&self, value: f64) -> f64 {
        if self.record.phase.is_active() { value } else { 0.0 }
    }
}

/// An event other than a sample.
#[derive(Debug)]
pub enum Event {
    /// Another world runs from one of the next samples on: [`Session::config`].
    Changed,
    /// A task of this client was refused.
    Refused {
        /// As given to [`Session::submit`].
        client: u64,
        /// [`Task::key`].
        key: String,
        /// In a sentence.
        message: String,
    },
    /// The world file that this client requested.
    File {
        /// As given to [`Session::submit`].
        client: u64,
        /// The file's name.
        name: String,
        /// Its text.
        text: String,
    },
    /// A board refused a request, or has faulted for an unknown reason.
    Error(Error),
    /// A board rejected a changed world, and keeps the previous one; [`Event::Changed`] follows.
    Rejected(Error),
}

/// The reason that a request was not passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotTaken {
    /// It was made before a stop or a withdrawal of control.
    #[error("the loop was stopped, or control was withdrawn, after this request")]
    Outdated,
    /// The queue is full.
    #[error("the loop is busy; try again")]
    Busy,
}

impl Session {
    /// Starts the loop, disarmed; recordings go to the current folder.
    ///
    /// # Errors
    /// The loop does not start; nothing runs then.
    pub fn start(config: WorldConfig, machine: Machine) -> Result<Self, Error> {
        Session::start_in(config, machine, PathBuf::from("."), || ())
    }

    /// The same with a folder for recordings; `ready` is called on another thread when [`Session::poll`] has something new to do.
    ///
    /// # Errors
    /// As [`Session::start`].
    pub fn start_in(
        config: WorldConfig,
        machine: Machine,
        folder: PathBuf,
        ready: impl Fn() + Send + 'static,
    ) -> Result<Self, Error> {
        let Machine { name, backend, hands, network, wheel, profile } = machine;
        let worker = match &backend {
            Backend::Stepped { .. } => {
                // Without a thread the poll itself does all work.
                drop(ready);
                Worker::AtOnce(VecDeque::new())
            }
            #[cfg(not(target_family = "wasm"))]
            Backend::Local { .. } => Worker::start(ready)?,
            #[cfg(not(target_family = "wasm"))]
            Backend::Board { .. } => Worker::start(ready)?,
        };
        let config = config.on(name, profile).map_err(Error::World)?;
        let hand = VirtualHand::new(&config.world, hands);
        let runner = backend.start(&config, profile)?;
        Ok(Session {
            worlds: VecDeque::from([(config.generation, config.world.clone())]),
            handle: runner.handle(),
            config,
            runner,
            profile,
            network,
            wheel,
            settled: 0.0,
            hand,
            scenario: None,
            recording: None,
            records: false,
            worker,
            tasks: VecDeque::new(),
            working: false,
            cancelled: false,
            restart: None,
            folder,
            timing: Timing::new(),
            time: 0.0,
            state: (Phase::Disarmed, None),
            warning: None,
            events: VecDeque::new(),
        })
    }

    /// Stop, heartbeats, withdrawal of control and the end, from any thread.
    pub fn handle(&self) -> LoopHandle {
        self.handle.clone()
    }

    /// The world that runs, or will from one of the next samples on.
    pub fn config(&self) -> &WorldConfig {
        &self.config
    }

    /// Whether there is no motor.
    pub fn is_simulated(&self) -> bool {
        self.profile == SafetyProfile::Simulated
    }

    /// The supervisor's phase, and the reason of a fault or of a fade-out.
    pub fn state(&self) -> (Phase, Option<Reason>) {
        self.state
    }

    /// The warning: a condition that would be a fault on a real device.
    pub fn warning(&self) -> Option<Reason> {
        self.warning
    }

    /// The network of which its loop is a station.
    pub fn network(&self) -> Option<&dyn StationView> {
        self.network.as_deref()
    }

    /// Its device as a game wheel.
    pub fn wheel(&self) -> Option<&dyn WheelView> {
        self.wheel.as_deref()
    }

    /// The loop's time in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The timing of the loop since the last change of its period.
    pub fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The scheduling that the system grants the loop; `None`: the loop runs on a board.
    pub fn realtime(&self) -> Option<&Realtime> {
        self.runner.realtime()
    }

    /// The scenario that the hand plays.
    pub fn scenario(&self) -> Option<&str> {
        self.scenario.as_ref().map(|(name, _)| name.as_str())
    }

    /// The present recording, or the failure of the last one.
    pub fn recording(&self) -> Option<RecordingStatus> {
        self.recording.as_ref().map(Recording::status)
    }

    /// The hand on a simulated puck.
    pub fn hand(&mut self) -> &mut VirtualHand {
        &mut self.hand
    }

    /// Sends a request, made in this epoch, to the supervisor. It cancels a restart.
    ///
    /// # Errors
    /// See [`NotTaken`].
    pub fn request(&mut self, request: Request, epoch: Epoch) -> Result<(), NotTaken> {
        self.restart = None;
        let is_outdated = epoch != self.handle.epoch();
        match request {
            Request::Stop => {
                self.handle.stop();
                return Ok(());
            }
            Request::Arm | Request::Clear if is_outdated => return Err(NotTaken::Outdated),
            Request::Disarm if !self.is_simulated() => {
                // Ahead of all queues. An outdated stop has been executed already.
                if !is_outdated {
                    self.handle.withdraw();
                }
                return Ok(());
            }
            Request::Arm if self.is_simulated() => {
                // Arming sets the world's 0 to the puck's position: a hand with another target would move the puck suddenly.
                self.release();
                self.hand.send();
            }
            Request::Arm | Request::Disarm | Request::Clear => {}
        }
        if self.runner.request(request, epoch) { Ok(()) } else { Err(NotTaken::Busy) }
    }

    /// Moves the hand on a simulated puck, in rad (linear: m), which ends a scenario; `None` releases the puck, unless a scenario holds it.
    pub fn move_hand(&mut self, position: Option<f64>) {
        if position.is_some() || self.scenario.is_none() {
            self.scenario = None;
            self.hand.move_to(position);
        }
    }

    /// Releases a simulated puck and the pedals and buttons of a game wheel, and ends a scenario.
    pub fn release(&mut self) {
        if let Some(wheel) = &self.wheel {
            wheel.press(Controls::default());
        }
        self.scenario = None;
        self.hand.move_to(None);
    }

    /// Plays a scenario of the world on the simulated puck; its hand releases the puck at the end.
    ///
    /// # Errors
    /// In a sentence: the puck is real, or there is no such scenario.
    pub fn play(&mut self, name: &str) -> Result<(), String> {
        self.release();
        if !self.hand.is_simulated() {
            return Err(format!("{} has no hand that could play it", self.config.device()));
        }
        let scenario = self.config.world.scenario(name).map_err(|error| error.to_string())?;
        if scenario.timing != hapt_model::Timing::Even {
            return Err(format!(
                "scenarios.{name}.timing: a loop in real time samples when its clock says; without `timing` it plays the scenario, and \
                 `hapt sim` plays it as it is"
            ));
        }
        self.hand.play(script(scenario, self.config.world.sampling.period));
        self.scenario = Some((name.into(), self.time + scenario.duration));
        Ok(())
    }

    /// Restarts a simulated device: the puck at rest at 0, the world at its start, and armed. A stop in between cancels it.
    ///
    /// # Errors
    /// In a sentence: the puck is real.
    pub fn restart(&mut self, epoch: Epoch) -> Result<(), String> {
        if !self.hand.is_simulated() {
            return Err(format!("{} starts where it is armed: disarm it and arm it again", self.config.device()));
        }
        self.release();
        self.restart = Some((epoch, Duration::ZERO));
        Ok(())
    }

    /// Queues a task for this client, a number that its refusals repeat. Consecutive changes of one key replace each other, and so do worlds to
    /// enter. A client waits for one file: that of its last request.
    ///
    /// # Errors
    /// In a sentence: too many tasks are queued.
    pub fn submit(&mut self, client: u64, task: Task) -> Result<(), String> {
        if task == Task::Record {
            if !self.runner.can_record() {
                return Err(NO_FILES.into());
            }
            self.records = true;
            if self.tasks.iter().any(|(_, waiting)| *waiting == Task::Record) {
                return Ok(());
            }
        }
        if let (Some((last, Task::Sets { key: before, sets, .. })), Task::Sets { key, sets: next, .. }) =
            (self.tasks.back_mut(), &task)
            && *last == client
            && !key.is_empty()
            && before == key
        {
            sets.clone_from(next);
            return Ok(());
        }
        #[cfg(not(target_family = "wasm"))]
        if let (Some((last, Task::Enter { world: before })), Task::Enter { world }) = (self.tasks.back_mut(), &task)
            && *last == client
        {
            *before = *world;
            return Ok(());
        }
        if task == Task::File {
            self.tasks.retain(|(last, waiting)| !(*last == client && *waiting == Task::File));
        }
        if self.tasks.len() >= MAX_TASKS {
            let again = match task {
                Task::File => "save it",
                Task::Record => "start the recording",
                Task::Sets { .. } | Task::Reset => "set it",
                #[cfg(not(target_family = "wasm"))]
                Task::Enter { .. } => "enter it",
            };
            return Err(format!("{MAX_TASKS} requests are waiting to be computed; {again} again when they are done"));
        }
        self.tasks.push_back((client, task));
        Ok(())
    }

    /// Drops all queued tasks, and the result of the running one.
    pub fn cancel_tasks(&mut self) {
        self.tasks.clear();
        self.cancelled = self.working;
    }

    /// Starts a recording that begins with the loop's first sample.
    pub fn record(&mut self, recording: Recording) {
        self.recording = Some(recording);
    }

    /// Ends the recording; another thread finishes it.
    pub fn end_recording(&mut self) {
        self.tasks.retain(|(_, task)| *task != Task::Record);
        self.records = false;
        if let Some(recording) = self.recording.take() {
            recording.end();
        }
    }

    /// Takes the recording out of the session, for the caller to finish.
    pub fn take_recording(&mut self) -> Option<Recording> {
        self.recording.take()
    }

    /// Passes the new samples to `each`; moves the hand, takes finished tasks and begins the next. To be called every few milliseconds, with
    /// the time since a fixed instant. Returns the loop's end once: on request, or by an error.
    pub fn poll(&mut self, now: Duration, each: impl FnMut(Sample<'_>)) -> Option<Result<(), Error>> {
        // Read first: the samples that are taken next may be the last.
        let ended = self.runner.ended();
        self.runner.advance(now);
        self.take_samples(each);
        while let Some(event) = self.runner.event() {
            self.take_event(event);
        }
        while let Some(done) = self.worker.done() {
            self.take_done(done);
        }
        if self.scenario.as_ref().is_some_and(|(_, over)| self.time > *over) {
            self.release();
        }
        self.hand.send();
        self.advance_restart(now);
        self.begin_task();
        match (ended, &self.network) {
            (Some(Err(Error::Device(failure))), Some(network)) => {
                Some(Err(Error::Station { station: network.info().station, failure }))
            }
            (ended, _) => ended,
        }
    }

    /// The next event.
    pub fn event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Ends the loop, waits until the torque is off, and passes the last samples to `each`.
    pub fn end(&mut self, each: impl FnMut(Sample<'_>)) {
        self.runner.end();
        self.take_samples(each);
    }

    fn take_samples(&mut self, mut each: impl FnMut(Sample<'_>)) {
        while let Some(record) = self.runner.record() {
            while self.worlds.len() > 1 && self.worlds.front().is_some_and(|(plan, _)| *plan < record.plan) {
                self.worlds.pop_front();
                let World { safety, sampling, .. } = &self.config.world;
                self.settled = record.due as f64 * 1e-9 + safety.fade + 2.0 * sampling.period;
            }
            if let Some(recording) = &mut self.recording
                && (!recording.waits() || self.runner.log_begins(&record))
            {
                self.runner.log(recording.take(&record), &record);
            }
            self.time = record.due as f64 * 1e-9;
            self.state = (record.phase, record.reason);
            self.warning = record.warning;
            self.timing.add(&record);
            let position = if self.is_simulated() { record.position - record.zero } else { record.measured };
            if let Some((generation, world)) = self.worlds.front() {
                each(Sample { world, generation: *generation, time: self.time, position, record: &record });
            }
        }
    }

    fn take_event(&mut self, event: RunnerEvent) {
        match event {
            RunnerEvent::Error(error) => self.events.push_back(Event::Error(error)),
            // A newer world is being changed to.
            RunnerEvent::Rejected(generation, ..) if generation != self.config.generation => {}
            RunnerEvent::Rejected(_, running, error) => {
                self.events.push_back(Event::Rejected(error));
                let mut back = *running;
                back.generation = self.config.generation.wrapping_add(1);
                if self.runner.change(&back, Change::Follows).is_ok() {
                    self.changed(back, Change::Follows);
                }
            }
        }
    }

    fn take_done(&mut self, done: Done) {
        let Done { client, task, generation, outcome } = done;
        self.working = false;
        let is_cancelled = std::mem::replace(&mut self.cancelled, false);
        // A board has returned to the previous world meanwhile.
        let is_stale = generation != self.config.generation;
        match outcome {
            Ok(Made::Recording(recording)) if is_cancelled || is_stale || !self.records => recording.end(),
            _ if is_cancelled => {}
            // The file is to be of the world that runs.
            Ok(Made::File(..)) if is_stale => self.tasks.push_front((client, task)),
            Ok(Made::File(name, text)) => self.events.push_back(Event::File { client, name, text }),
            Ok(Made::Recording(_)) if !self.runner.begin_log() => {
                self.refuse(client, &task, "the loop is busy; try again".into());
            }
            Ok(Made::Recording(recording)) => {
                if let Some(before) = self.recording.replace(recording) {
                    before.end();
                }
            }
            Ok(Made::World(_)) if is_stale => {
                let message = "the board has gone back to the world that it had; set it again";
                self.refuse(client, &task, message.into());
            }
            Ok(Made::World(next)) => {
                let change = task.change();
                if change != Change::Follows {
                    // Its 0 is elsewhere: a hand with another target would move the puck suddenly.
                    self.release();
                    self.hand.send();
                }
                match self.runner.change(&next, change) {
                    Ok(()) => self.changed(*next, change),
                    Err(message) => self.refuse(client, &task, message),
                }
            }
            Err(message) => self.refuse(client, &task, message),
        }
    }

    fn changed(&mut self, next: WorldConfig, change: Change) {
        if next.world.sampling.period != self.config.world.sampling.period {
            self.timing = Timing::new();
        }
        self.config = next;
        if let Some(network) = &self.network {
            network.change_world(&self.config.certified_world());
        }
        self.worlds.push_back((self.config.generation, self.config.world.clone()));
        if let Some(recording) = &mut self.recording {
            recording.change(self.config.generation, &self.config.world, change);
        }
        self.events.push_back(Event::Changed);
    }

    fn refuse(&mut self, client: u64, task: &Task, message: String) {
        self.events.push_back(Event::Refused { client, key: task.key().into(), message });
    }

    /// Begins the next task, where none is running.
    fn begin_task(&mut self) {
        let changes = self.tasks.front().is_some_and(|(_, task)| task.changes_world());
        if self.working || changes && !self.is_settled() {
            return;
        }
        if let Some((client, task)) = self.tasks.pop_front() {
            let (config, profile, folder) = (self.config.clone(), self.profile, self.folder.clone());
            let linked = self.runner.has_outside();
            let station = self.network.as_ref().map(|network| network.info().station);
            let job = Job { client, task: task.clone(), config, profile, folder, linked, station };
            self.working = self.worker.begin(job);
            if !self.working {
                let message = "hapt's own worker has ended by a defect; start hapt live again";
                self.refuse(client, &task, message.into());
            }
        }
    }

    /// Whether the world may change again: the torque fades over to each, and follows the new world only in part until then. Changes in
    /// quick succession would freeze a motor's torque.
    fn is_settled(&self) -> bool {
        let is_over = !self.state.0.is_active() || self.time >= self.settled;
        self.is_simulated() || self.worlds.len() == 1 && is_over
    }

    /// The next step of a restart: no torque, the puck at 0, and armed.
    fn advance_restart(&mut self, now: Duration) {
        let Some((epoch, again)) = self.restart else { return };
        if epoch != self.handle.epoch() {
            // The loop was stopped meanwhile.
            self.restart = None;
        } else if now >= again {
            let next = match self.state.0 {
                Phase::Disarmed if !self.hand.restart() => None,
                Phase::Disarmed => Some(Request::Arm),
                Phase::Faulted => Some(Request::Clear),
                Phase::FadingIn | Phase::Running => Some(Request::Disarm),
                Phase::FadingOut => None,
            };
            let done = next.is_some_and(|request| self.runner.request(request, epoch) && request == Request::Arm);
            self.restart = (!done).then_some((epoch, now + RETRY_PERIOD));
        }
    }
}
