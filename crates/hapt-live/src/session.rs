//! The session with the pages: passes their messages to the loop's session, and the loop's state to them.
//!
//! Its thread blocks only on its queue, for a few milliseconds at most: a page that stops reading is disconnected, certificates and changed
//! worlds are computed on other threads, and the loop does not wait for it.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use hapt_host::messages::ServerMessage;
use hapt_host::{PageSession, Session};
use hapt_rt::LoopHandle;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::certifier::Certifier;
use crate::control::{Client, Control};
use crate::sender::{Event, EventSender};

/// The longest wait for an event before the loop is polled again.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// The time between two telemetry frames.
const FRAME_PERIOD: Duration = Duration::from_micros(16_667);
/// The largest number of events handled before the loop is polled again.
const EVENTS_AT_ONCE: usize = 1024;

/// The session that several pages share.
pub struct SharedSession {
    pub(crate) page: PageSession,
    pub(crate) control: Control,
    pub(crate) clients: BTreeMap<Client, Sender<Message>>,
    pub(crate) certifier: Certifier,
    /// The last verdict, and the certified ranges of this generation by their keys, for pages that join later.
    pub(crate) verdict: Option<Message>,
    pub(crate) ranges: BTreeMap<String, Message>,
    /// The description of the world.
    pub(crate) world: Message,
    pub(crate) handle: LoopHandle,
    sender: EventSender,
    /// The client in control of the last message to the pages.
    announced: Option<Client>,
}

impl SharedSession {
    /// A session without pages.
    pub(crate) fn new(session: Session, certifier: Certifier, sender: &EventSender) -> Self {
        certifier.ask(session.config().clone());
        let handle = session.handle();
        let page = PageSession::new(session);
        SharedSession {
            world: to_message(&page.world()),
            page,
            control: Control::default(),
            clients: BTreeMap::new(),
            certifier,
            verdict: None,
            ranges: BTreeMap::new(),
            handle,
            sender: sender.clone(),
            announced: None,
        }
    }

    /// Runs until the program ends, or the loop does.
    ///
    /// # Errors
    /// The loop has failed.
    pub fn run(mut self, events: &Receiver<Event>) -> Result<(), hapt_host::Error> {
        let begin = Instant::now();
        let mut frame = begin;
        loop {
            match events.recv_timeout(POLL_PERIOD) {
                Ok(first) => {
                    for event in std::iter::once(first).chain(events.try_iter().take(EVENTS_AT_ONCE)) {
                        if matches!(event, Event::End) {
                            return Ok(());
                        }
                        self.handle_event(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let now = Instant::now();
            if !self.control.is_responsive(now) {
                self.page.session.release();
            }
            let mut messages = Vec::new();
            let ended = self.page.poll(now - begin, |to, message| messages.push((to, message)));
            for (to, message) in messages {
                self.pass_on(to, &message);
            }
            if self.control.holder() != self.announced {
                self.announced = self.control.holder();
                self.broadcast(&to_message(&ServerMessage::Control { control: self.announced }));
            }
            if now >= frame {
                frame = (frame + FRAME_PERIOD).max(now);
                if let Some(bytes) = self.page.frame() {
                    self.broadcast(&Message::Binary(bytes.into()));
                }
            }
            if let Some(status) = self.page.status_due(now - begin, self.clients.len()) {
                self.broadcast(&to_message(&status));
            }
            if let Some(outcome) = ended {
                return outcome;
            }
        }
    }

    /// Passes on a message of the session. Certificates of a changed world are recomputed.
    fn pass_on(&mut self, to: Option<Client>, message: &ServerMessage) {
        let text = to_message(message);
        if let Some(client) = to {
            return self.send_to(client, text);
        }
        if let ServerMessage::World(_) = message {
            (self.verdict, self.ranges) = (None, BTreeMap::new());
            self.certifier.ask(self.page.session.config().clone());
            self.world = text.clone();
        }
        self.broadcast(&text);
    }

    /// Handles a change of control: the hand releases the puck, and a motor's torque fades out until the next client in control arms it.
    pub(crate) fn control_changed(&mut self, from: Option<Client>) {
        self.page.session.release();
        self.page.session.cancel_tasks();
        if self.page.session.is_simulated() {
            return;
        }
        let next = self.control.holder();
        self.sender.set_controller(None);
        if from.is_some() {
            self.handle.withdraw();
        }
        if next.is_some() {
            // Its message has just arrived: it counts as a heartbeat.
            self.handle.heartbeat();
            self.sender.set_controller(next);
        }
    }

    /// Sends a message to one page; a page that does not read its messages is disconnected.
    pub(crate) fn send_to(&mut self, client: Client, message: Message) {
        let Some(to) = self.clients.get(&client) else { return };
        if to.try_send(message).is_err() {
            self.left(client);
        }
    }

    /// Sends a message to every page.
    pub(crate) fn broadcast(&mut self, message: &Message) {
        let full = |(client, to): (&Client, &Sender<Message>)| to.try_send(message.clone()).is_err().then_some(*client);
        let gone: Vec<Client> = self.clients.iter().filter_map(full).collect();
        gone.into_iter().for_each(|client| self.left(client));
    }
}

/// A message in the form of the websocket.
pub fn to_message(message: &ServerMessage) -> Message {
    Message::Text(message.json().into())
}
