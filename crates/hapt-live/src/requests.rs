//! The session's handling of the messages of pages.

use std::time::Instant;

use hapt_host::messages::{ClientMessage, Command, ServerMessage, VERSION};
use hapt_rt::Epoch;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;
use crate::sender::Event;
use crate::session::{SharedSession, to_message};

impl SharedSession {
    /// Handles an event, except the end.
    pub(crate) fn handle_event(&mut self, event: Event) {
        match event {
            Event::Joined(client, to) => self.joined(client, to),
            Event::Left(client) => self.left(client),
            Event::Message(client, message, epoch, _ticket) => {
                self.control.message_from(client, Instant::now());
                if let Some(answer) = self.handle_message(client, message, epoch) {
                    self.send_to(client, to_message(&answer));
                }
            }
            Event::Certified(generation, answer) if generation == self.page.session.config().generation => {
                let message = to_message(&answer);
                if let ServerMessage::Range { key, .. } = answer {
                    self.ranges.insert(key, message.clone());
                } else {
                    self.verdict = Some(message.clone());
                }
                self.broadcast(&message);
            }
            // An answer on an earlier world is dropped. The next poll takes a task's result.
            Event::Certified(..) | Event::TaskDone | Event::End => {}
        }
    }

    fn joined(&mut self, client: Client, to: Sender<Message>) {
        self.clients.insert(client, to);
        if self.control.joined(client, Instant::now()) {
            self.control_changed(None);
        }
        let control = self.control.holder();
        let mut messages = vec![
            to_message(&ServerMessage::Hello { v: VERSION, client, control }),
            self.world.clone(),
            to_message(&self.page.status(self.clients.len())),
        ];
        messages.extend(self.verdict.iter().chain(self.ranges.values()).cloned());
        messages.into_iter().for_each(|message| self.send_to(client, message));
    }

    /// Removes a page that has disconnected or does not read its messages.
    pub(crate) fn left(&mut self, client: Client) {
        self.clients.remove(&client);
        if self.control.leave(client) {
            self.control_changed(Some(client));
        }
    }

    /// Handles a message; returns the answer to this client, where there is one. Messages about anything but control and certificates go to the
    /// session.
    fn handle_message(&mut self, client: Client, message: ClientMessage, epoch: Epoch) -> Option<ServerMessage> {
        let error = |sentence: &str| Some(ServerMessage::Error { message: sentence.into() });
        match message {
            // The sender has passed a stop to the loop.
            ClientMessage::Alive | ClientMessage::Command { command: Command::Stop } => None,
            ClientMessage::Take => {
                let from = self.control.holder();
                // A page that has disconnected cannot take control.
                if self.clients.contains_key(&client) && self.control.take(client, Instant::now()) {
                    self.control_changed(from);
                }
                None
            }
            ClientMessage::Hello { .. } => error("hello was sent already"),
            _ if !self.control.is_held_by(client) => error("this page has no control; take it first"),
            ClientMessage::Give => {
                self.control.leave(client);
                self.control_changed(Some(client));
                None
            }
            ClientMessage::Focus { key } => {
                self.certifier.focus(key);
                None
            }
            ClientMessage::Command { .. }
            | ClientMessage::Hand { .. }
            | ClientMessage::Set { .. }
            | ClientMessage::Sets { .. }
            | ClientMessage::Reset
            | ClientMessage::File
            | ClientMessage::Enter { .. }
            | ClientMessage::Restart
            | ClientMessage::Scenario { .. }
            | ClientMessage::Record { .. }
            | ClientMessage::Network(_)
            | ClientMessage::Controls(_) => self.page.handle(client, message, epoch),
        }
    }
}
