//! The desk: the thread that owns what runs the loop. It hears what pages say, tells the loop, and tells the pages what the loop does.
//!
//! Nothing here waits on anything but its own door, and that a few milliseconds at most: pages that do not read are shown out,
//! certificates are computed elsewhere, and the loop itself runs on without the desk.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use hapt_core::{Guarding, Phase, Reason, Request};
use hapt_model::World;
use hapt_rt::{Record, Timing};
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::{Client, Control};
use crate::frames::Frames;
use crate::hand::VisitorsHand;
use crate::judge::Judge;
use crate::protocol::{Realtime, Said, Says, Status, TimingSays};
use crate::recording::Recording;
use crate::runner::Runner;
use crate::state::Workbench;

/// How long the desk listens at its door before it looks at the loop again.
const TICK: Duration = Duration::from_millis(4);
/// From one telemetry frame to the next.
const FRAME: Duration = Duration::from_micros(16_667);
/// From one status to the next, when nothing happens.
const STATUS: Duration = Duration::from_millis(200);
/// How much may wait at the door.
const WAITING: usize = 1024;

/// What comes to the desk.
pub enum Event {
    /// A page that has said hello, and where it is told.
    Joined(Client, Sender<Message>),
    /// A page has gone.
    Left(Client),
    /// A page has said something.
    Said(Client, Said),
    /// The judge has an answer on this generation.
    Judged(u32, Says),
    /// The program ends.
    End,
}

/// The desk's door, for the server.
#[derive(Clone)]
pub struct Door {
    events: SyncSender<Event>,
    stop: Arc<AtomicBool>,
}

impl Door {
    /// A door, and the desk's side of it.
    pub fn new() -> (Self, Receiver<Event>) {
        let (events, inside) = sync_channel(WAITING);
        (Door { events, stop: Arc::default() }, inside)
    }

    /// Hands something in, without waiting; `false`: the desk is gone, or overrun.
    pub fn hand_in(&self, event: Event) -> bool {
        // Stop stands in no queue.
        if let Event::Said(_, Said::Order { order: crate::protocol::Wish::Stop }) = event {
            self.stop.store(true, Ordering::Release);
            return true;
        }
        self.events.try_send(event).is_ok()
    }

    /// Hands an answer of the judge in, who may wait for it; `false`: the desk is gone.
    pub fn report(&self, generation: u32, says: Says) -> bool {
        self.events.send(Event::Judged(generation, says)).is_ok()
    }

    /// The program ends.
    pub fn end(&self) {
        let mut event = Event::End;
        while let Err(TrySendError::Full(back)) = self.events.try_send(event) {
            event = back;
            std::thread::sleep(TICK);
        }
    }
}

/// Who sits there.
pub struct Desk {
    pub(crate) bench: Workbench,
    pub(crate) runner: Box<dyn Runner>,
    pub(crate) guarding: Guarding,
    /// The worlds of the plans that the loop may still be at, by their generation.
    pub(crate) worlds: VecDeque<(u32, World)>,
    pub(crate) hand: VisitorsHand,
    /// The scenario that the hand plays, and when by the loop's time in s it is over.
    pub(crate) scenario: Option<(String, f64)>,
    pub(crate) control: Control,
    pub(crate) clients: BTreeMap<Client, Sender<Message>>,
    pub(crate) judge: Judge,
    /// The last verdict, and the ranges of this generation by their keys: for pages that come later.
    pub(crate) verdict: Option<Message>,
    pub(crate) ranges: BTreeMap<String, Message>,
    pub(crate) recording: Option<Recording>,
    pub(crate) folder: PathBuf,
    pub(crate) timing: Timing,
    /// The loop's time in s, and where it stands.
    pub(crate) time: f64,
    pub(crate) state: (Phase, Option<Reason>),
    /// What would have tripped on a real device.
    warning: Option<Reason>,
    frames: Frames,
    stop: Arc<AtomicBool>,
}

/// What the desk starts with.
pub(crate) struct Start {
    /// The world.
    pub bench: Workbench,
    /// The loop, running.
    pub runner: Box<dyn Runner>,
    /// How it is guarded.
    pub guarding: Guarding,
    /// The hand on its device.
    pub hand: VisitorsHand,
    /// Who judges.
    pub judge: Judge,
    /// Where recordings go.
    pub folder: PathBuf,
}

impl Desk {
    /// A desk with nobody before it.
    pub(crate) fn new(start: Start, door: &Door) -> Self {
        let Start { bench, runner, guarding, hand, judge, folder } = start;
        judge.ask(bench.clone());
        Desk {
            worlds: VecDeque::from([(bench.generation, bench.world.clone())]),
            bench,
            runner,
            guarding,
            hand,
            scenario: None,
            control: Control::default(),
            clients: BTreeMap::new(),
            judge,
            verdict: None,
            ranges: BTreeMap::new(),
            recording: None,
            folder,
            timing: Timing::new(),
            time: 0.0,
            state: (Phase::Disarmed, None),
            warning: None,
            frames: Frames::default(),
            stop: Arc::clone(&door.stop),
        }
    }

    /// Until the program ends, or the device does.
    ///
    /// # Errors
    /// The device is gone; in a sentence.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<(), String> {
        // A simulated device is there to be grabbed at once; a real one waits for somebody to arm it.
        if self.is_simulated() {
            self.runner.ask(Request::Arm);
        }
        let (mut frame, mut status) = (Instant::now(), Instant::now());
        let mut alive = Instant::now();
        loop {
            match events.recv_timeout(TICK) {
                Ok(first) => {
                    // Not for ever: the loop wants to be looked at.
                    for event in std::iter::once(first).chain(events.try_iter().take(WAITING)) {
                        if matches!(event, Event::End) {
                            return Ok(());
                        }
                        self.take_in(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            if self.stop.swap(false, Ordering::AcqRel) {
                self.runner.stop();
            }
            let before = self.state;
            let ended = self.runner.ended();
            self.look();
            while let Some(news) = self.runner.news() {
                self.hear(news);
            }
            let now = Instant::now();
            self.lead(now);
            // The simulated hand lets go when whoever has control is silent, and that is all there is to it. A real motor hears of him
            // himself: without him the supervisor's link is lost, and the torque fades out.
            if now >= alive && (self.is_simulated() || self.control.is_awake(now)) {
                self.runner.alive();
                alive = now + Duration::from_millis(50);
            }
            if now >= frame {
                frame = (frame + FRAME).max(now);
                if let Some(bytes) = self.frames.take() {
                    self.tell_all(&Message::Binary(bytes));
                }
            }
            if now >= status || self.state != before {
                status = now + STATUS;
                let status = self.status();
                self.tell_all(&message(&status));
            }
            if let Some(outcome) = ended {
                return outcome;
            }
        }
    }

    /// What the loop has done since.
    fn look(&mut self) {
        while let Some(record) = self.runner.record() {
            while self.worlds.len() > 1 && self.worlds.front().is_some_and(|(plan, _)| *plan < record.plan) {
                self.worlds.pop_front();
            }
            if let Some(recording) = &mut self.recording {
                recording.follow(self.runner.as_mut(), &record);
            }
            self.add(&record);
        }
    }

    fn add(&mut self, record: &Record) {
        let Some((generation, world)) = self.worlds.front() else { return };
        self.time = record.due as f64 * 1e-9;
        self.state = (record.phase, record.reason);
        self.warning = record.warning;
        // Where a real device is armed, there is the world's 0: only the loop knows the puck from there.
        let position = if self.is_simulated() { record.position } else { record.measured };
        self.frames.add(world, *generation, self.time, &Record { position, ..*record });
        self.timing.add(record);
    }

    /// The hand's next position, by the scenario or by the page that has control; who is silent lets go.
    fn lead(&mut self, now: Instant) {
        if !self.control.is_awake(now) {
            self.let_go();
        }
        if self.scenario.as_ref().is_some_and(|(_, over)| self.time > *over) {
            self.let_go();
        }
        self.hand.tell();
    }

    /// Whether nobody can be hurt.
    fn is_simulated(&self) -> bool {
        self.guarding == Guarding::Simulated
    }

    /// The hand lets go, and a scenario ends with it.
    pub(crate) fn let_go(&mut self) {
        self.scenario = None;
        self.hand.want(None);
    }

    /// Tells one page; who does not read is shown out.
    pub(crate) fn tell(&mut self, client: Client, message: Message) {
        let Some(to) = self.clients.get(&client) else { return };
        if to.try_send(message).is_err() {
            self.left(client);
        }
    }

    /// Tells every page.
    pub(crate) fn tell_all(&mut self, message: &Message) {
        let deaf = |(client, to): (&Client, &Sender<Message>)| to.try_send(message.clone()).is_err().then_some(*client);
        let gone: Vec<Client> = self.clients.iter().filter_map(deaf).collect();
        gone.into_iter().for_each(|client| self.left(client));
    }

    /// What is odd and no fault.
    fn warnings(&self) -> Vec<String> {
        let told = |reason: Reason| match self.is_simulated() {
            true => format!("On a real device it would have faulted. {}", reason.sentence()),
            false => reason.sentence().to_string(),
        };
        // Another clock's misses stand in no table of ours.
        let missed = Some(self.timing.missed()).filter(|missed| *missed > 0 && self.runner.realtime().is_none());
        let missed = missed.map(|missed| format!("The board has missed {missed} samples."));
        self.warning.map(told).into_iter().chain(missed).collect()
    }

    /// How the loop goes.
    pub(crate) fn status(&self) -> Says {
        let mut status = Status {
            phase: "",
            code: None,
            reason: None,
            sentence: None,
            clear: None,
            warnings: self.warnings(),
            scenario: self.scenario.as_ref().map(|(name, _)| name.clone()),
            recording: self.recording.as_ref().and_then(Recording::says),
            timing: self.runner.realtime().map(|_| TimingSays::of(&self.timing)),
            realtime: self.runner.realtime().map(Realtime::of),
            clients: self.clients.len(),
        };
        let (phase, reason) = self.state;
        status.explain(phase, reason);
        Says::Status(Box::new(status))
    }
}

/// As it goes over the wire.
pub fn message(says: &Says) -> Message {
    Message::Text(says.json().into())
}
