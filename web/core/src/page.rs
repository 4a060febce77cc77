//! A world's session with the one page that there is.

use std::collections::VecDeque;
use std::time::Duration;

use hapt_host::messages::{ClientMessage, ServerMessage, VERSION, WorldFile};
use hapt_host::{Machine, PageSession, Session, WorldConfig};

/// The number of the one client.
const CLIENT: u64 = 1;
/// After a longer time between two polls the page was suspended: its hand releases the puck.
pub(crate) const ASLEEP: Duration = Duration::from_millis(300);
/// The refusal of another world at a station: the page has only the certificates of the file's worlds.
const FIXED: &str = "on a page of a network without a server its worlds stay as they are; hapt live NETWORK sets their keys, and certifies them anew";

/// A running world, and the messages to its page.
pub struct Page {
    session: PageSession,
    messages: VecDeque<Message>,
    /// The instant of the last poll.
    now: Duration,
    columns: Vec<[f64; 3]>,
}

/// A message to the page, as a websocket carries it.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// JSON.
    Text(String),
    /// Telemetry: [`hapt_host::frames`].
    Frame(Vec<u8>),
}

impl Page {
    /// The world of a [`WorldFile`] in JSON, armed. Its first messages are hello and world.
    ///
    /// # Errors
    /// In a sentence: the text is no world, or the world cannot run in a page.
    pub fn new(world: &str) -> Result<Self, String> {
        let file: WorldFile = serde_json::from_str(world).map_err(|error| error.to_string())?;
        let config = file.config()?;
        let machine = Machine::stepped(&config.world);
        Page::on(config, machine)
    }

    /// The same on this machine.
    pub(crate) fn on(config: WorldConfig, machine: Machine) -> Result<Self, String> {
        let session = PageSession::new(Session::start(config, machine).map_err(|error| error.to_string())?);
        let hello = ServerMessage::Hello { v: VERSION, client: CLIENT, control: Some(CLIENT) };
        let messages = [hello, session.world()].map(|message| Message::Text(message.json()));
        Ok(Page { session, messages: messages.into(), now: Duration::ZERO, columns: Vec::new() })
    }

    /// Takes a message of the page, in JSON.
    pub fn send(&mut self, text: &str) {
        let epoch = self.session.session.handle().epoch();
        let answer = match ClientMessage::read(text) {
            Ok(ClientMessage::Set { .. } | ClientMessage::Sets { .. } | ClientMessage::Reset)
                if self.session.session.network().is_some() =>
            {
                Some(ServerMessage::Refused { key: String::new(), message: FIXED.into() })
            }
            Ok(message) => self.session.handle(CLIENT, message, epoch),
            Err(message) => Some(ServerMessage::Error { message }),
        };
        self.tell(answer);
    }

    /// Takes the samples that are due at `now`, the time since any instant that stays the same; then telemetry and status, where they are due.
    pub fn poll(&mut self, now: Duration) {
        if now.saturating_sub(self.now) > ASLEEP {
            self.release();
        }
        self.advance(now);
        self.show();
    }

    /// The hand releases the puck.
    pub(crate) fn release(&mut self) {
        self.session.session.release();
        self.session.session.hand().send();
    }

    /// Takes the samples that are due at `now`.
    pub(crate) fn advance(&mut self, now: Duration) {
        self.now = now;
        let messages = &mut self.messages;
        // A simulated device does not fail: the loop does not end.
        let _ = self.session.poll(now, |_, message| messages.push_back(Message::Text(message.json())));
    }

    /// Telemetry of these samples, and status, where they are due.
    pub(crate) fn show(&mut self) {
        self.columns.clear();
        self.columns.extend(self.session.columns());
        self.messages.extend(self.session.frame().map(Message::Frame));
        let status = self.session.status_due(self.now, 1);
        self.tell(status);
    }

    /// The next message to the page.
    pub fn next_message(&mut self) -> Option<Message> {
        self.messages.pop_front()
    }

    /// The columns of the last poll's frame, before they were rounded: last, smallest, largest of each. Empty where there was no sample.
    pub fn columns(&self) -> &[[f64; 3]] {
        &self.columns
    }

    fn tell(&mut self, message: Option<ServerMessage>) {
        self.messages.extend(message.map(|message| Message::Text(message.json())));
    }
}
