//! The queue of events from the server and the certifier to the session.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use hapt_host::messages::{ClientMessage, Command, ServerMessage};
use hapt_rt::{Epoch, LoopHandle};
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;

/// The largest number of queued messages of one client, and of all queued events.
const MAX_OF_CLIENT: usize = 256;
const MAX_EVENTS: usize = 16384;
/// The wait of the program's end before it tries a full queue again.
const RETRY_PERIOD: Duration = Duration::from_millis(4);
/// A number that no client has.
pub(crate) const NO_CLIENT: Client = 0;

/// An event for the session.
pub enum Event {
    /// A page has said hello; its messages go to this queue.
    Joined(Client, Sender<Message>),
    /// A page has disconnected.
    Left(Client),
    /// A page has sent a message, in this epoch of the loop.
    Message(Client, ClientMessage, Epoch, Ticket),
    /// The certifier has an answer on this generation.
    Certified(u32, ServerMessage),
    /// A task of the session is done.
    TaskDone,
    /// The program ends.
    End,
}

/// The number of a client's queued messages.
#[derive(Clone, Debug, Default)]
pub struct Waiting(Arc<AtomicUsize>);

/// A queued message; dropping it decrements the number.
pub struct Ticket(Waiting);

impl Waiting {
    /// A ticket for one more message, if the limit permits it.
    fn ticket(&self) -> Option<Ticket> {
        let taken = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, |n| (n < MAX_OF_CLIENT).then_some(n + 1));
        taken.ok().map(|_| Ticket(self.clone()))
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.0.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// The server's side of the queue to the session. It never blocks, and sends urgent messages directly to the loop.
#[derive(Clone)]
pub struct EventSender {
    events: SyncSender<Event>,
    handle: LoopHandle,
    /// The client that has control of a motor; its messages are the supervisor's heartbeats.
    controller: Arc<AtomicU64>,
}

/// The queue to the session: its two ends.
pub fn events() -> (SyncSender<Event>, Receiver<Event>) {
    sync_channel(MAX_EVENTS)
}

impl EventSender {
    /// A sender into the queue `events`, with the loop's handle.
    pub fn new(events: SyncSender<Event>, handle: LoopHandle) -> Self {
        EventSender { events, handle, controller: Arc::default() }
    }

    /// Sends a client's message; `false`: the session has ended, or too many messages of this client are queued.
    ///
    /// A stop goes to the loop at once, from any client; so do the heartbeats of the client in control, and its disarming of a motor.
    pub fn send(&self, client: Client, message: ClientMessage, waiting: &Waiting) -> bool {
        if let ClientMessage::Command { command: Command::Stop } = message {
            self.handle.stop();
        }
        let epoch = self.handle.epoch();
        if self.is_in_control(client) {
            self.handle.heartbeat();
            if let ClientMessage::Command { command: Command::Disarm } = message {
                self.handle.withdraw();
            }
        }
        if let ClientMessage::Command { command: Command::Stop } | ClientMessage::Alive = message {
            // The session needs it only for the hand on a simulated puck: it may be lost.
            if let Some(ticket) = waiting.ticket() {
                let _ = self.events.try_send(Event::Message(client, ClientMessage::Alive, epoch, ticket));
            }
            return true;
        }
        let Some(ticket) = waiting.ticket() else { return false };
        self.events.try_send(Event::Message(client, message, epoch, ticket)).is_ok()
    }

    /// Sends any other event; `false`: the session has ended, or the queue is full.
    pub fn notify(&self, event: Event) -> bool {
        self.events.try_send(event).is_ok()
    }

    /// Whether this client has control of a motor.
    pub fn is_in_control(&self, client: Client) -> bool {
        self.controller.load(Ordering::Acquire) == client
    }

    /// Sets the client whose messages are heartbeats; `None`: there is none.
    pub(crate) fn set_controller(&self, client: Option<Client>) {
        self.controller.store(client.unwrap_or(NO_CLIENT), Ordering::Release);
    }

    /// The loop's handle.
    pub fn handle(&self) -> LoopHandle {
        self.handle.clone()
    }

    /// Ends the session.
    pub fn end(&self) {
        let mut event = Event::End;
        while let Err(TrySendError::Full(back)) = self.events.try_send(event) {
            event = back;
            std::thread::sleep(RETRY_PERIOD);
        }
    }
}
