//! The desk: the thread that owns what runs the loop. It hears what pages say, tells the loop, and tells the pages what the loop does.
//!
//! Nothing here waits on anything but its own door, and that a few milliseconds at most: pages that do not read are shown out,
//! certificates are computed elsewhere, and the loop itself runs on without the desk.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_model::World;
use hapt_rt::{Epoch, LoopHandle, Record, Timing};
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::{Client, Control};
use crate::frames::Frames;
use crate::hand::VisitorsHand;
use crate::judge::Judge;
use crate::protocol::{Realtime, Said, Says, Status, TimingSays, Wish};
use crate::recording::Recording;
use crate::runner::Runner;
use crate::state::Workbench;
use crate::worker::{Done, Task, Worker};

/// How long the desk listens at its door before it looks at the loop again.
const TICK: Duration = Duration::from_millis(4);
/// From one telemetry frame to the next.
const FRAME: Duration = Duration::from_micros(16_667);
/// From one status to the next, when nothing happens.
const STATUS: Duration = Duration::from_millis(200);
/// How much of one client may wait at the door, and of all of them.
const OF_ONE: usize = 256;
const WAITING: usize = 16384;
/// How much is taken in before the loop is looked at again.
const AT_ONCE: usize = 1024;
/// From one step of a start from the beginning to the next try of it.
const AGAIN: Duration = Duration::from_millis(50);
/// Nobody's number.
const NOBODY: Client = 0;

/// What comes to the desk.
pub enum Event {
    /// A page that has said hello, and where it is told.
    Joined(Client, Sender<Message>),
    /// A page has gone.
    Left(Client),
    /// A page has said something, in this epoch of the loop.
    Said(Client, Said, Epoch, Ticket),
    /// The judge has an answer on this generation.
    Judged(u32, Says),
    /// The worker has done a task.
    Done(Box<Done>),
    /// The program ends.
    End,
}

/// A client's messages that wait at the door.
#[derive(Clone, Debug, Default)]
pub struct Waiting(Arc<AtomicUsize>);

/// One of them. Dropped, it waits no longer.
pub struct Ticket(Waiting);

impl Waiting {
    /// A place for one more, if there is one.
    fn ticket(&self) -> Option<Ticket> {
        let taken = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, |n| (n < OF_ONE).then_some(n + 1));
        taken.ok().map(|_| Ticket(self.clone()))
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.0.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// The desk's door, for the server.
#[derive(Clone)]
pub struct Door {
    events: SyncSender<Event>,
    handle: LoopHandle,
    /// Who has control of a motor: his messages are the supervisor's heartbeats.
    holder: Arc<AtomicU64>,
}

/// The way in, and the desk's side of it.
pub fn events() -> (SyncSender<Event>, Receiver<Event>) {
    sync_channel(WAITING)
}

impl Door {
    /// A door to the desk at the other end of `events`, and to the loop of this handle.
    pub fn new(events: SyncSender<Event>, handle: LoopHandle) -> Self {
        Door { events, handle, holder: Arc::default() }
    }

    /// Hands in what a client says, without waiting; `false`: the desk is gone, or overrun by this client.
    ///
    /// A stop goes from here to the loop, and stands in no queue; and so does the word that whoever has control is there, and his that a
    /// motor is to be disarmed.
    pub fn hand_in(&self, client: Client, said: Said, waiting: &Waiting) -> bool {
        if let Said::Order { order: Wish::Stop } = said {
            self.handle.stop();
        }
        let epoch = self.handle.epoch();
        if self.is_held_by(client) {
            self.handle.heartbeat();
            if let Said::Order { order: Wish::Disarm } = said {
                self.handle.withdraw();
            }
        }
        if let Said::Order { order: Wish::Stop } | Said::Alive = said {
            // The hand on a simulated puck wants to hear of it too, and does where there is room.
            if let Some(ticket) = waiting.ticket() {
                let _ = self.events.try_send(Event::Said(client, Said::Alive, epoch, ticket));
            }
            return true;
        }
        let Some(ticket) = waiting.ticket() else { return false };
        self.events.try_send(Event::Said(client, said, epoch, ticket)).is_ok()
    }

    /// A page has come, or gone; `false`: the desk is gone, or overrun.
    pub fn tell(&self, event: Event) -> bool {
        self.events.try_send(event).is_ok()
    }

    /// Whether this client has control of a motor.
    pub fn is_held_by(&self, client: Client) -> bool {
        self.holder.load(Ordering::Acquire) == client
    }

    /// The loop's handle.
    pub fn handle(&self) -> LoopHandle {
        self.handle.clone()
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
    pub(crate) profile: SafetyProfile,
    /// The worlds of the plans that the loop may still be at, by their generation.
    pub(crate) worlds: VecDeque<(u32, World)>,
    /// The loop's time in s at which the last change of the world has faded over.
    pub(crate) settled: f64,
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
    /// What takes long, who does it, for whom it waits, and whether one is under way.
    pub(crate) worker: Worker,
    pub(crate) tasks: VecDeque<(Client, Task)>,
    pub(crate) at_work: bool,
    /// A recording is wanted.
    pub(crate) records: bool,
    /// What the pages are told of the world.
    pub(crate) world_says: Message,
    /// A start from the beginning that was asked for in this epoch, and when it is tried again.
    pub(crate) restart: Option<(Epoch, Instant)>,
    pub(crate) folder: PathBuf,
    pub(crate) timing: Timing,
    /// The loop's time in s, and where it stands.
    pub(crate) time: f64,
    pub(crate) state: (Phase, Option<Reason>),
    /// What would have tripped on a real device.
    warning: Option<Reason>,
    frames: Frames,
    pub(crate) handle: LoopHandle,
    holder: Arc<AtomicU64>,
    /// Who has control, as the pages have been told.
    told: Option<Client>,
}

/// What the desk starts with.
pub(crate) struct Start {
    /// The world.
    pub bench: Workbench,
    /// The loop, running.
    pub runner: Box<dyn Runner>,
    /// How it is guarded.
    pub profile: SafetyProfile,
    /// The hand on its device.
    pub hand: VisitorsHand,
    /// Who judges.
    pub judge: Judge,
    /// Who does what takes long.
    pub worker: Worker,
    /// Where recordings go.
    pub folder: PathBuf,
}

impl Desk {
    /// A desk with nobody before it.
    pub(crate) fn new(start: Start, door: &Door) -> Self {
        let Start { bench, runner, profile, hand, judge, worker, folder } = start;
        judge.ask(bench.clone());
        Desk {
            worlds: VecDeque::from([(bench.generation, bench.world.clone())]),
            world_says: message(&Says::World(Box::new(bench.says()))),
            settled: 0.0,
            bench,
            runner,
            profile,
            hand,
            scenario: None,
            control: Control::default(),
            clients: BTreeMap::new(),
            judge,
            verdict: None,
            ranges: BTreeMap::new(),
            recording: None,
            worker,
            tasks: VecDeque::new(),
            at_work: false,
            records: false,
            restart: None,
            folder,
            timing: Timing::new(),
            time: 0.0,
            state: (Phase::Disarmed, None),
            warning: None,
            frames: Frames::default(),
            handle: door.handle.clone(),
            holder: Arc::clone(&door.holder),
            told: None,
        }
    }

    /// Until the program ends, or the device does.
    ///
    /// # Errors
    /// The device is gone; in a sentence.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<(), String> {
        // A simulated device is there to be grabbed at once; a real one waits for somebody to arm it.
        if self.is_simulated() {
            let epoch = self.handle.epoch();
            self.runner.ask(Request::Arm, epoch);
        }
        let (mut frame, mut status) = (Instant::now(), Instant::now());
        loop {
            match events.recv_timeout(TICK) {
                Ok(first) => {
                    // Not for ever: the loop wants to be looked at.
                    for event in std::iter::once(first).chain(events.try_iter().take(AT_ONCE)) {
                        if matches!(event, Event::End) {
                            return Ok(());
                        }
                        self.take_in(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let before = self.state;
            let ended = self.runner.ended();
            self.look();
            while let Some(news) = self.runner.news() {
                self.hear(news);
            }
            let now = Instant::now();
            self.lead(now);
            self.work();
            if self.control.holder() != self.told {
                self.told = self.control.holder();
                self.tell_all(&message(&Says::Control { control: self.told }));
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
                let World { safety, sampling, .. } = &self.bench.world;
                self.settled = record.due as f64 * 1e-9 + safety.fade + 2.0 * sampling.period;
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
        // Where it is armed, there is the world's 0. Of a real puck only the loop knows it from there.
        let position = if self.is_simulated() { record.position - record.zero } else { record.measured };
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
        self.start_over(now);
    }

    /// One more step of a start from the beginning: no torque, the puck at 0, and armed.
    fn start_over(&mut self, now: Instant) {
        let Some((epoch, again)) = self.restart else { return };
        if epoch != self.handle.epoch() {
            // Somebody has pressed stop.
            self.restart = None;
        } else if now >= again {
            let next = match self.state.0 {
                Phase::Disarmed if !self.hand.restart() => None,
                Phase::Disarmed => Some(Request::Arm),
                Phase::Faulted => Some(Request::Clear),
                Phase::FadingIn | Phase::Running => Some(Request::Disarm),
                Phase::FadingOut => None,
            };
            let done = next.is_some_and(|request| self.runner.ask(request, epoch) && request == Request::Arm);
            self.restart = (!done).then_some((epoch, now + AGAIN));
        }
    }

    /// Control is another's, or nobody's: the hand lets go, and a motor's torque with it. Whoever has control next arms it himself.
    pub(crate) fn control_changed(&mut self, from: Option<Client>) {
        self.let_go();
        self.tasks.clear();
        if self.is_simulated() {
            return;
        }
        let next = self.control.holder();
        self.holder.store(NOBODY, Ordering::Release);
        if from.is_some() {
            self.handle.withdraw();
        }
        if let Some(next) = next {
            // He has just been heard.
            self.handle.heartbeat();
            self.holder.store(next, Ordering::Release);
        }
    }

    /// Whether nobody can be hurt.
    pub(crate) fn is_simulated(&self) -> bool {
        self.profile == SafetyProfile::Simulated
    }

    /// Whether another world may follow: the torque fades over to each, and follows the world only in part until it has. Worlds in quicker
    /// succession would hold a motor's torque where it was.
    pub(crate) fn is_settled(&self) -> bool {
        let is_over = !self.state.0.is_active() || self.time >= self.settled;
        self.is_simulated() || self.worlds.len() == 1 && is_over
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
