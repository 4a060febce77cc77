//! The session with the pages: it passes their messages to the loop's session, and tells them what the loop does.
//!
//! Its thread blocks on its queue alone, for a few milliseconds at most: a page that stops reading is disconnected, certificates and changed
//! worlds are computed on other threads, and the loop runs on without it.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use hapt_core::Reason;
use hapt_host::{Event as LoopEvent, Session};
use hapt_rt::LoopHandle;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::certifier::Certifier;
use crate::control::{Client, Control};
use crate::describe::describe;
use crate::frames::Frames;
use crate::protocol::{Realtime, RecordingInfo, ServerMessage, Status, TimingInfo};
use crate::sender::{Event, EventSender};

/// The longest wait for an event before the loop is looked at again.
const TICK: Duration = Duration::from_millis(4);
/// The time between two telemetry frames.
const FRAME: Duration = Duration::from_micros(16_667);
/// The time between two status messages while nothing happens.
const STATUS: Duration = Duration::from_millis(200);
/// The most events handled before the loop is looked at again.
const AT_ONCE: usize = 1024;

/// The session with the pages.
pub struct PageSession {
    pub(crate) session: Session,
    pub(crate) control: Control,
    pub(crate) clients: BTreeMap<Client, Sender<Message>>,
    pub(crate) certifier: Certifier,
    /// The last verdict, and the certified ranges of this generation by their keys, for pages that join later.
    pub(crate) verdict: Option<Message>,
    pub(crate) ranges: BTreeMap<String, Message>,
    /// The description of the world.
    pub(crate) world: Message,
    frames: Frames,
    pub(crate) handle: LoopHandle,
    sender: EventSender,
    /// The client in control, as the pages know it.
    announced: Option<Client>,
}

impl PageSession {
    /// A session without pages.
    pub(crate) fn new(session: Session, certifier: Certifier, sender: &EventSender) -> Self {
        certifier.ask(session.config().clone());
        PageSession {
            world: to_message(&ServerMessage::World(Box::new(describe(session.config())))),
            handle: session.handle(),
            session,
            control: Control::default(),
            clients: BTreeMap::new(),
            certifier,
            verdict: None,
            ranges: BTreeMap::new(),
            frames: Frames::default(),
            sender: sender.clone(),
            announced: None,
        }
    }

    /// Runs until the program ends, or the loop does.
    ///
    /// # Errors
    /// The loop has failed.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<(), hapt_host::Error> {
        // A simulated device can be grabbed at once; a motor waits for a page to arm it.
        if self.session.is_simulated() {
            let _ = self.session.request(hapt_core::Request::Arm, self.handle.epoch());
        }
        let (mut frame, mut status) = (Instant::now(), Instant::now());
        loop {
            match events.recv_timeout(TICK) {
                Ok(first) => {
                    for event in std::iter::once(first).chain(events.try_iter().take(AT_ONCE)) {
                        if matches!(event, Event::End) {
                            return Ok(());
                        }
                        self.handle_event(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let before = self.session.state();
            let now = Instant::now();
            if !self.control.is_awake(now) {
                self.session.release();
            }
            let ended = self.session.poll(now, |sample| self.frames.add(&sample));
            while let Some(event) = self.session.event() {
                self.handle_loop_event(event);
            }
            if self.control.holder() != self.announced {
                self.announced = self.control.holder();
                self.tell_all(&to_message(&ServerMessage::Control { control: self.announced }));
            }
            if now >= frame {
                frame = (frame + FRAME).max(now);
                if let Some(bytes) = self.frames.take() {
                    self.tell_all(&Message::Binary(bytes));
                }
            }
            if now >= status || self.session.state() != before {
                status = now + STATUS;
                let status = self.status();
                self.tell_all(&to_message(&status));
            }
            if let Some(outcome) = ended {
                return outcome;
            }
        }
    }

    fn handle_loop_event(&mut self, event: LoopEvent) {
        match event {
            LoopEvent::Changed => {
                (self.verdict, self.ranges) = (None, BTreeMap::new());
                self.certifier.ask(self.session.config().clone());
                let world = to_message(&ServerMessage::World(Box::new(describe(self.session.config()))));
                self.tell_all(&world);
                self.world = world;
            }
            LoopEvent::Refused { client, key, message } => {
                self.tell(client, to_message(&ServerMessage::Refused { key, message }));
            }
            LoopEvent::Error(error) => {
                self.tell_all(&to_message(&ServerMessage::Error { message: error.to_string() }));
            }
            LoopEvent::Rejected(error) => {
                let refused = ServerMessage::Refused { key: String::new(), message: error.to_string() };
                self.tell_all(&to_message(&refused));
            }
        }
    }

    /// Control has passed on: the hand releases the puck, and a motor's torque fades out until the next client in control arms it.
    pub(crate) fn control_changed(&mut self, from: Option<Client>) {
        self.session.release();
        self.session.cancel_tasks();
        if self.session.is_simulated() {
            return;
        }
        let next = self.control.holder();
        self.sender.set_controller(None);
        if from.is_some() {
            self.handle.withdraw();
        }
        if next.is_some() {
            // Its message has just come.
            self.handle.heartbeat();
            self.sender.set_controller(next);
        }
    }

    /// Sends a message to one page; a page that does not read is disconnected.
    pub(crate) fn tell(&mut self, client: Client, message: Message) {
        let Some(to) = self.clients.get(&client) else { return };
        if to.try_send(message).is_err() {
            self.left(client);
        }
    }

    /// Sends a message to every page.
    pub(crate) fn tell_all(&mut self, message: &Message) {
        let full = |(client, to): (&Client, &Sender<Message>)| to.try_send(message.clone()).is_err().then_some(*client);
        let gone: Vec<Client> = self.clients.iter().filter_map(full).collect();
        gone.into_iter().for_each(|client| self.left(client));
    }

    /// What is unusual and no fault.
    fn warnings(&self) -> Vec<String> {
        let session = &self.session;
        let warning = |reason: Reason| match session.is_simulated() {
            true => format!("On a real device it would have faulted. {}", reason.sentence()),
            false => reason.sentence().to_string(),
        };
        // A local loop's missed samples are in the timing.
        let missed = Some(session.timing().missed()).filter(|missed| *missed > 0 && session.realtime().is_none());
        let missed = missed.map(|missed| format!("The board has missed {missed} samples."));
        session.warning().map(warning).into_iter().chain(missed).collect()
    }

    /// The state of the loop.
    pub(crate) fn status(&self) -> ServerMessage {
        let session = &self.session;
        let mut status = Status {
            phase: "",
            code: None,
            reason: None,
            sentence: None,
            clear: None,
            warnings: self.warnings(),
            scenario: session.scenario().map(Into::into),
            recording: session.recording().map(RecordingInfo::from),
            timing: session.realtime().map(|_| TimingInfo::of(session.timing())),
            realtime: session.realtime().map(Realtime::of),
            clients: self.clients.len(),
        };
        let (phase, reason) = session.state();
        status.explain(phase, reason);
        ServerMessage::Status(Box::new(status))
    }
}

/// A message as it is sent.
pub fn to_message(message: &ServerMessage) -> Message {
    Message::Text(message.json().into())
}
