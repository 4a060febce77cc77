//! The loop on a board. The board's clock times the samples, and its own supervisor removes the torque when heartbeats stop.
//!
//! A thread owns the link, so that no caller blocks on the line. A board changes its world only while no torque can flow (docs/wire.md):
//! an armed board fades out, loads the whole world, and is armed again unless it was disarmed or stopped meanwhile.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_log::Recorder;
use hapt_rt::{Epoch, LoopHandle, Realtime, Record};
use hapt_wire::Command;

use crate::board::{Error, Link, Refusal, TelemetryDecoder, phase};
use crate::config::WorldConfig;
use crate::runner::{Runner, RunnerEvent};
use crate::{error, packed};

/// After this time without telemetry the handshake is made again.
const MAX_SILENCE: Duration = Duration::from_secs(1);
/// The longest wait for telemetry before requests are read.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// The longest time between two heartbeats on the line, while heartbeats arrive.
const MAX_HEARTBEAT_PERIOD: Duration = Duration::from_millis(50);
/// A client counts as present for this time after its last heartbeat, in s.
const PRESENCE_S: f64 = 0.2;
/// The time limit for the acknowledgement of the last stop.
const LAST_STOP_TIMEOUT: Duration = Duration::from_millis(500);
/// Capacity of the queue of requests.
const REQUESTS: usize = 64;
/// Capacity of the queue of samples: 16 s at 1 kHz.
const RECORDS: usize = 1 << 14;

/// The loop on a board, and the thread that owns its link.
pub(crate) struct BoardLoop {
    requests: SyncSender<Message>,
    records: Receiver<Record>,
    events: Receiver<RunnerEvent>,
    handle: LoopHandle,
    profile: SafetyProfile,
    thread: Option<JoinHandle<Result<(), Error>>>,
    ended: Option<Result<(), error::Error>>,
}

/// A message to the thread.
enum Message {
    Request(Request, Epoch),
    Change(Box<Change>),
}

/// A world to load.
struct Change {
    config: WorldConfig,
    bytes: Vec<u8>,
}

impl BoardLoop {
    /// Loads the world of `config` into the board, disarmed, with telemetry every `every` s.
    ///
    /// # Errors
    /// The board does not answer, or refuses the world.
    pub fn start(
        config: &WorldConfig,
        profile: SafetyProfile,
        mut link: Link,
        every: f64,
    ) -> Result<Self, error::Error> {
        let bytes = packed(&config.world, profile).map_err(error::Error::World)?;
        let world = link.load(&bytes)?;
        let period = config.world.sampling.period;
        link.set_telemetry(period, every)?;
        // Samples from before the load belong to another session.
        while link.telemetry(Instant::now())?.is_some() {}
        let (requests, incoming) = sync_channel(REQUESTS);
        let (outgoing, records) = sync_channel(RECORDS);
        let (report, events) = channel();
        let handle = LoopHandle::default();
        let phase = link.board().phase.unwrap_or(Phase::Disarmed);
        let worker = BoardWorker {
            link,
            world,
            phase,
            every,
            heartbeat_every: heartbeat_every(config, profile),
            profile,
            decoder: TelemetryDecoder::new(config.generation, period),
            running: Box::new(config.clone()),
            wanted: None,
            changing: false,
            armed_since: None,
            sent: Arc::new(Mutex::new(handle.epoch())),
            received: handle.last_heartbeat(),
            last_heartbeat: None,
            requests: incoming,
            records: outgoing,
            events: report,
            handle: handle.clone(),
        };
        let thread = std::thread::Builder::new().name("board".into()).spawn(|| worker.run())?;
        Ok(BoardLoop { requests, records, events, handle, profile, thread: Some(thread), ended: None })
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            self.ended = Some(match thread.join() {
                Ok(outcome) => outcome.map_err(error::Error::Board),
                Err(_) => Err(error::Error::Panicked("a defect in hapt has closed the board's line")),
            });
        }
    }
}

/// The longest time between two heartbeats: a quarter of what the board's supervisor allows.
fn heartbeat_every(config: &WorldConfig, profile: SafetyProfile) -> Duration {
    let silence = config.world.limits(profile).silence(config.world.sampling.period);
    if silence.is_finite() {
        Duration::from_secs_f64(silence.max(0.0) / 4.0).min(MAX_HEARTBEAT_PERIOD)
    } else {
        MAX_HEARTBEAT_PERIOD
    }
}

impl Runner for BoardLoop {
    fn handle(&self) -> LoopHandle {
        self.handle.clone()
    }

    fn request(&mut self, request: Request, epoch: Epoch) -> bool {
        self.requests.try_send(Message::Request(request, epoch)).is_ok()
    }

    fn change(&mut self, next: &WorldConfig, _: hapt_rt::Change) -> Result<(), String> {
        // A board begins every changed world at its start, and its 0 at the puck.
        let bytes = packed(&next.world, self.profile)?;
        let change = Box::new(Change { config: next.clone(), bytes });
        self.requests.try_send(Message::Change(change)).map_err(|_| "the board is busy; set it again".into())
    }

    fn event(&mut self) -> Option<RunnerEvent> {
        self.events.try_recv().ok()
    }

    fn record(&mut self) -> Option<Record> {
        self.records.try_recv().ok()
    }

    fn ended(&mut self) -> Option<Result<(), error::Error>> {
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.join();
        }
        self.ended.take()
    }

    fn end(&mut self) {
        self.handle.end();
        self.join();
    }

    fn realtime(&self) -> Option<&Realtime> {
        None
    }

    fn begin_log(&mut self) -> bool {
        true
    }

    fn log_begins(&mut self, _record: &Record) -> bool {
        true
    }

    fn log(&mut self, recorder: &Recorder, record: &Record) {
        // The recorder counts records that find it full.
        recorder.send(record);
    }
}

impl Drop for BoardLoop {
    fn drop(&mut self) {
        self.end();
    }
}

/// The thread's state. Dropped, the link sends stop where a torque may be on.
struct BoardWorker {
    link: Link,
    /// The hash of the world on the board.
    world: u32,
    phase: Phase,
    /// The time between two samples of telemetry, in s.
    every: f64,
    heartbeat_every: Duration,
    profile: SafetyProfile,
    decoder: TelemetryDecoder,
    /// The world on the board.
    running: Box<WorldConfig>,
    /// The world to load next; a newer one replaces it.
    wanted: Option<Box<Change>>,
    /// Whether the board fades out for that world, or loads it.
    changing: bool,
    /// The epoch in which the torque was requested; `None`: no torque is requested.
    armed_since: Option<Epoch>,
    /// The last epoch that was sent to the board, the last heartbeat received, and the time of the last one sent.
    sent: Arc<Mutex<Epoch>>,
    received: u64,
    last_heartbeat: Option<Instant>,
    requests: Receiver<Message>,
    records: SyncSender<Record>,
    events: Sender<RunnerEvent>,
    handle: LoopHandle,
}

impl BoardWorker {
    /// Runs until the handle ends the loop, or the link fails.
    fn run(mut self) -> Result<(), Error> {
        // A stop, or the end, interrupts every wait for an acknowledgement.
        let (handle, sent) = (self.handle.clone(), Arc::clone(&self.sent));
        self.link.interrupt_when(move || {
            handle.is_ended() || handle.epoch() != *sent.lock().unwrap_or_else(PoisonError::into_inner)
        });
        let outcome = self.until_the_end();
        if outcome.is_ok() && self.link.may_be_armed() {
            // The stop is repeated until the board confirms it or a time limit ends; a port that is closed may drop unsent bytes.
            let until = Instant::now() + LAST_STOP_TIMEOUT;
            self.link.interrupt_when(move || Instant::now() >= until);
            let _ = self.link.stop();
        }
        outcome
    }

    fn until_the_end(&mut self) -> Result<(), Error> {
        let mut received = Instant::now();
        while !self.handle.is_ended() {
            match self.take_requests().and_then(|()| self.change()) {
                Ok(()) | Err(Error::Interrupted) => {}
                Err(error) => return Err(error),
            }
            if self.take_telemetry(Instant::now() + POLL_PERIOD)? {
                received = Instant::now();
            } else if received.elapsed() > MAX_SILENCE {
                match self.reconnect() {
                    Ok(()) => received = Instant::now(),
                    Err(Error::Interrupted) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }

    /// Repeats the handshake with a board that sends no samples. A disconnected line is an error of its own.
    fn reconnect(&mut self) -> Result<(), Error> {
        self.link.handshake()?;
        if self.link.board().world != Some(self.world) {
            return Err(self.link.restarted());
        }
        self.set_telemetry()
    }

    /// Takes the queued requests.
    fn take_requests(&mut self) -> Result<(), Error> {
        self.take_urgent()?;
        while let Ok(message) = self.requests.try_recv() {
            match message {
                Message::Request(request, epoch) => self.request(request, epoch)?,
                Message::Change(change) => self.wanted = Some(change),
            }
            self.take_urgent()?;
        }
        Ok(())
    }

    /// Handles stop, withdrawal and heartbeats, ahead of all requests.
    fn take_urgent(&mut self) -> Result<(), Error> {
        let now = self.handle.epoch();
        let before = std::mem::replace(&mut *self.sent.lock().unwrap_or_else(PoisonError::into_inner), now);
        if now != before {
            self.armed_since = None;
            match now.stopped_since(before) {
                true => self.link.stop()?,
                // A board that is already disarmed refuses; that is no error.
                false => match self.link.disarm() {
                    Err(Error::Refused { .. }) => {}
                    disarmed => disarmed?,
                },
            }
        }
        let received = self.handle.last_heartbeat();
        if received != self.received
            && self.last_heartbeat.is_none_or(|last_heartbeat| last_heartbeat.elapsed() >= self.heartbeat_every)
        {
            (self.received, self.last_heartbeat) = (received, Some(Instant::now()));
            self.link.heartbeat()?;
        }
        Ok(())
    }

    /// Waits for telemetry until that instant, and takes all that has arrived; `false` where none has.
    fn take_telemetry(&mut self, mut until: Instant) -> Result<bool, Error> {
        let mut some = false;
        while let Some(telemetry) = self.link.telemetry(until)? {
            (some, until) = (true, Instant::now());
            let before = std::mem::replace(&mut self.phase, phase(&telemetry));
            let is_new = self.phase == Phase::Faulted && before != Phase::Faulted;
            if is_new && Reason::from_code(telemetry.reason).is_none() {
                let error = Error::UnknownReason { code: telemetry.reason };
                let _ = self.events.send(RunnerEvent::Error(error.into()));
            }
            // A sample that finds the queue full is lost.
            let _ = self.records.try_send(self.decoder.record(&telemetry));
        }
        // After a fault or a lost link the board is not armed again.
        self.armed_since = self.armed_since.filter(|_| self.phase.is_active() || self.changing);
        Ok(some)
    }

    /// Sets the board's interval of telemetry.
    fn set_telemetry(&mut self) -> Result<(), Error> {
        self.link.set_telemetry(self.running.world.sampling.period, self.every)
    }

    fn request(&mut self, request: Request, epoch: Epoch) -> Result<(), Error> {
        // The request was made before a stop, or before control was withdrawn.
        if matches!(request, Request::Arm | Request::Clear) && epoch != self.handle.epoch() {
            return Ok(());
        }
        self.armed_since = match request {
            Request::Arm => Some(epoch),
            Request::Disarm | Request::Stop => None,
            Request::Clear => self.armed_since,
        };
        let done = match request {
            // The change arms it with the new world.
            Request::Arm if self.wanted.is_some() => Ok(()),
            Request::Arm => self.arm(),
            Request::Disarm => self.link.disarm(),
            Request::Stop => self.link.stop(),
            // Telemetry shows whether the cause has ended.
            Request::Clear => self.link.send(Command::Clear),
        };
        self.report_refusal(done)
    }

    fn arm(&mut self) -> Result<(), Error> {
        let before = self.link.arm(self.world)?;
        self.decoder.follows(before);
        self.phase = Phase::FadingIn;
        Ok(())
    }

    /// Reports a refusal as an event; other errors end the session.
    fn report_refusal(&self, done: Result<(), Error>) -> Result<(), Error> {
        match done {
            Err(error @ Error::Refused { .. }) => {
                let _ = self.events.send(RunnerEvent::Error(error.into()));
                Ok(())
            }
            done => done,
        }
    }

    /// Loads the wanted world once no torque can flow.
    fn change(&mut self) -> Result<(), Error> {
        let Some(wanted) = self.wanted.take() else { return Ok(()) };
        if self.phase.is_active() {
            if !std::mem::replace(&mut self.changing, true) {
                self.link.disarm()?;
            }
            self.wanted = Some(wanted);
            return Ok(());
        }
        self.changing = true;
        let generation = wanted.config.generation;
        match self.link.load(&wanted.bytes) {
            Ok(world) => {
                // Telemetry up to here belongs to the previous world.
                self.take_telemetry(Instant::now())?;
                (self.world, self.running) = (world, Box::new(wanted.config));
                self.decoder.change(generation, self.running.world.sampling.period);
                self.heartbeat_every = heartbeat_every(&self.running, self.profile);
                self.changing = false;
                self.set_telemetry()?;
            }
            // A stop comes first; the load starts again after it.
            Err(Error::Interrupted) => {
                (self.wanted, self.changing) = (Some(wanted), false);
                return Ok(());
            }
            // Another host armed the board: it fades out first.
            Err(Error::Refused { why: Refusal::Armed, .. }) => {
                self.link.handshake()?;
                self.phase = self.link.board().phase.unwrap_or(self.phase);
                (self.wanted, self.changing) = (Some(wanted), false);
                return Ok(());
            }
            Err(error @ (Error::Refused { .. } | Error::NotVerified)) => {
                let event = RunnerEvent::Rejected(generation, self.running.clone(), error.into());
                let _ = self.events.send(event);
            }
            Err(error) => return Err(error),
        }
        self.changing = false;
        // The board is armed again only if nothing has disarmed it and the controller is present.
        let again = self.armed_since == Some(self.handle.epoch()) && self.phase == Phase::Disarmed;
        if again && self.handle.since_heartbeat() < PRESENCE_S {
            let armed = self.arm();
            return self.report_refusal(armed);
        }
        Ok(())
    }
}
