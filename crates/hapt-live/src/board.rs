//! A board as what runs the loop: it keeps the clock, and its own watch over the link takes the torque away when the page is silent.
//!
//! A thread holds the line, so that nothing else waits for it. A board changes its world only while no torque can flow
//! (docs/wire.md): where it is armed, a change fades out, is loaded whole, and arms again, unless somebody has meant otherwise meanwhile.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::{Phase, Request, SafetyProfile};
use hapt_link::{Error, Link, Refusal};
use hapt_log::Recorder;
use hapt_rt::{Epoch, LoopHandle, Realtime, Record};
use hapt_wire::Order;

use crate::runner::{News, Runner};
use crate::shown::{Shown, phase};
use crate::state::Workbench;
use crate::{live, packed};

/// How often the board shows a sample, in s, where the line carries it: no peak of a loop at 1 kHz is lost.
const SHOWN: f64 = 1e-3;
/// A board that shows no sample for so long has stopped.
const SILENT: Duration = Duration::from_secs(1);
/// How long the thread listens to the line before it hears the desk again.
const TICK: Duration = Duration::from_millis(4);
/// A page that was heard so lately, in s, is there.
const THERE: f64 = 0.2;
/// What may wait for the line.
const ASKS: usize = 64;
/// Samples that may wait for the desk: 16 s at 1 kHz.
const RECORDS: usize = 1 << 14;

/// A board, and the thread that holds its line.
pub(crate) struct Board {
    asks: SyncSender<Ask>,
    records: Receiver<Record>,
    news: Receiver<News>,
    handle: LoopHandle,
    profile: SafetyProfile,
    thread: Option<JoinHandle<Result<(), String>>>,
}

/// What reaches the thread.
enum Ask {
    Request(Request, Epoch),
    Change(Box<Wanted>),
}

/// A world that the board is to run.
struct Wanted {
    bench: Workbench,
    bytes: Vec<u8>,
}

impl Board {
    /// Has the board run the bench's world, disarmed.
    ///
    /// # Errors
    /// It does not answer, or does not take that world.
    pub fn start(bench: &Workbench, profile: SafetyProfile, mut link: Link) -> Result<Self, live::Error> {
        let bytes = packed(&bench.world, profile).map_err(live::Error::World)?;
        let world = link.load(&bytes)?;
        link.show(bench.world.sampling.period, SHOWN)?;
        let (asks, incoming) = sync_channel(ASKS);
        let (outgoing, records) = sync_channel(RECORDS);
        let (says, news) = channel();
        let handle = LoopHandle::default();
        let phase = link.board().phase.unwrap_or(Phase::Disarmed);
        let holder = Holder {
            link,
            world,
            phase,
            shown: Shown::new(bench.generation, bench.world.sampling.period),
            runs: Box::new(bench.clone()),
            wanted: None,
            changing: false,
            wants: None,
            told: Arc::new(Mutex::new(handle.epoch())),
            heard: handle.heard(),
            asks: incoming,
            records: outgoing,
            news: says,
            handle: handle.clone(),
        };
        let thread = std::thread::Builder::new().name("board".into()).spawn(|| holder.run())?;
        Ok(Board { asks, records, news, handle, profile, thread: Some(thread) })
    }
}

impl Runner for Board {
    fn handle(&self) -> LoopHandle {
        self.handle.clone()
    }

    fn ask(&mut self, request: Request, epoch: Epoch) -> bool {
        self.asks.try_send(Ask::Request(request, epoch)).is_ok()
    }

    fn change(&mut self, next: &Workbench) -> Result<(), String> {
        let bytes = packed(&next.world, self.profile)?;
        let wanted = Box::new(Wanted { bench: next.clone(), bytes });
        self.asks.try_send(Ask::Change(wanted)).map_err(|_| "the board is busy; set it again".into())
    }

    fn news(&mut self) -> Option<News> {
        self.news.try_recv().ok()
    }

    fn record(&mut self) -> Option<Record> {
        self.records.try_recv().ok()
    }

    fn ended(&mut self) -> Option<Result<(), String>> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(match thread.join() {
            Ok(outcome) => outcome,
            Err(_) => Err("the board's line has been let go by a defect of hapt's own".into()),
        })
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
        // What finds no room is counted by it.
        recorder.send(record);
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.handle.end();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Who holds the line. Dropped, the link says stop where a torque may be on.
struct Holder {
    link: Link,
    /// The hash of the world that the board runs.
    world: u32,
    phase: Phase,
    shown: Shown,
    /// The world that the board runs.
    runs: Box<Workbench>,
    /// The one that it is to run; of several the last counts.
    wanted: Option<Box<Wanted>>,
    /// It fades out for that one, or takes it.
    changing: bool,
    /// Somebody wants the torque on, since this epoch.
    wants: Option<Epoch>,
    /// The epoch that the board has been told of, and the last heartbeat.
    told: Arc<Mutex<Epoch>>,
    heard: u64,
    asks: Receiver<Ask>,
    records: SyncSender<Record>,
    news: Sender<News>,
    handle: LoopHandle,
}

impl Holder {
    /// Until it is to end, or the line does.
    fn run(mut self) -> Result<(), String> {
        // A stop waits for no answer of the board's, nor does the end.
        let (handle, told) = (self.handle.clone(), Arc::clone(&self.told));
        self.link.yield_to(move || {
            handle.is_ended() || handle.epoch() != *told.lock().unwrap_or_else(PoisonError::into_inner)
        });
        let mut heard = Instant::now();
        while !self.handle.is_ended() {
            match self.hear().and_then(|()| self.change()) {
                Ok(()) | Err(Error::Interrupted) => {}
                Err(error) => return Err(error.to_string()),
            }
            if self.look(Instant::now() + TICK).map_err(|error| error.to_string())? {
                heard = Instant::now();
            } else if heard.elapsed() > SILENT {
                // A line that is cut says so by itself; one that says nothing is asked.
                match self.link.greet() {
                    Err(Error::Interrupted) => continue,
                    greeted => greeted.map_err(|error| error.to_string())?,
                };
                if self.link.board().world != Some(self.world) {
                    return Err("the board has begun anew, without its world and without a torque".into());
                }
                match self.show() {
                    Err(Error::Interrupted) => continue,
                    shown => shown.map_err(|error| error.to_string())?,
                }
                heard = Instant::now();
            }
        }
        Ok(())
    }

    /// What the desk asks.
    fn hear(&mut self) -> Result<(), Error> {
        self.hear_at_once()?;
        while let Ok(ask) = self.asks.try_recv() {
            match ask {
                Ask::Request(request, epoch) => self.ask(request, epoch)?,
                Ask::Change(wanted) => self.wanted = Some(wanted),
            }
            self.hear_at_once()?;
        }
        Ok(())
    }

    /// What waits for nothing that was asked.
    fn hear_at_once(&mut self) -> Result<(), Error> {
        let now = self.handle.epoch();
        let before = std::mem::replace(&mut *self.told.lock().unwrap_or_else(PoisonError::into_inner), now);
        if now != before {
            self.wants = None;
            match now.stopped_since(before) {
                true => self.link.stop()?,
                // Where it is disarmed already it refuses, and that is right.
                false => match self.link.disarm() {
                    Err(Error::Refused { .. }) => {}
                    disarmed => disarmed?,
                },
            }
        }
        let heard = self.handle.heard();
        if heard != self.heard {
            self.heard = heard;
            self.link.keep()?;
        }
        Ok(())
    }

    /// Takes what is shown, waiting for the first of it; `false` where none has come until that instant.
    fn look(&mut self, mut until: Instant) -> Result<bool, Error> {
        let mut some = false;
        while let Some(telemetry) = self.link.telemetry(until)? {
            (some, until) = (true, Instant::now());
            self.phase = phase(&telemetry);
            // Whoever does not take the records loses them.
            let _ = self.records.try_send(self.shown.record(&telemetry));
        }
        // A fault, or a link that was lost, is nothing to arm again after.
        self.wants = self.wants.filter(|_| self.phase.is_active() || self.changing);
        Ok(some)
    }

    /// Has the board show its samples.
    fn show(&mut self) -> Result<(), Error> {
        self.link.show(self.runs.world.sampling.period, SHOWN)
    }

    fn ask(&mut self, request: Request, epoch: Epoch) -> Result<(), Error> {
        // Of before a stop, or of who has control no longer.
        if matches!(request, Request::Arm | Request::Clear) && epoch != self.handle.epoch() {
            return Ok(());
        }
        self.wants = match request {
            Request::Arm => Some(epoch),
            Request::Disarm | Request::Stop => None,
            Request::Clear => self.wants,
        };
        let asked = match request {
            // With the world that is wanted.
            Request::Arm if self.wanted.is_some() => Ok(()),
            Request::Arm => self.arm(),
            Request::Disarm => self.link.disarm(),
            Request::Stop => self.link.stop(),
            // Whether the cause is gone shows in the telemetry.
            Request::Clear => self.link.tell(Order::Clear),
        };
        self.unless_refused(asked)
    }

    fn arm(&mut self) -> Result<(), Error> {
        let before = self.link.arm(self.world)?;
        self.shown.follows(before);
        self.phase = Phase::FadingIn;
        Ok(())
    }

    /// A refusal is told, and the line goes on.
    fn unless_refused(&self, asked: Result<(), Error>) -> Result<(), Error> {
        match asked {
            Err(error @ Error::Refused { .. }) => {
                let _ = self.news.send(News::Refused(error.to_string()));
                Ok(())
            }
            asked => asked,
        }
    }

    /// Has the board run what is wanted, once no torque can flow.
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
        let generation = wanted.bench.generation;
        match self.link.load(&wanted.bytes) {
            Ok(world) => {
                // What was shown before is of the world before.
                self.look(Instant::now())?;
                (self.world, self.runs) = (world, Box::new(wanted.bench));
                self.shown.goes_on(generation, self.runs.world.sampling.period);
                self.changing = false;
                self.show()?;
            }
            // Once the stop has been told, from the beginning.
            Err(Error::Interrupted) => {
                (self.wanted, self.changing) = (Some(wanted), false);
                return Ok(());
            }
            // It was armed by another word than was seen here: its fade has to be waited for.
            Err(Error::Refused { why: Refusal::Armed, .. }) => {
                self.link.greet()?;
                self.phase = self.link.board().phase.unwrap_or(self.phase);
                (self.wanted, self.changing) = (Some(wanted), false);
                return Ok(());
            }
            Err(error @ (Error::Refused { .. } | Error::NotVerified)) => {
                let _ = self.news.send(News::Kept(generation, self.runs.clone(), error.to_string()));
            }
            Err(error) => return Err(error),
        }
        self.changing = false;
        // Nobody is armed behind his back.
        let again = self.wants == Some(self.handle.epoch()) && self.phase == Phase::Disarmed;
        if again && self.handle.silent() < THERE {
            let armed = self.arm();
            return self.unless_refused(armed);
        }
        Ok(())
    }
}
