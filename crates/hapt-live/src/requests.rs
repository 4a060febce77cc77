//! How the session answers the messages of pages.

use std::time::Instant;

use hapt_core::Request;
use hapt_host::{NotTaken, Task};
use hapt_rt::Epoch;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;
use crate::protocol::{ClientMessage, Command, ServerMessage, VERSION};
use crate::sender::Event;
use crate::session::{PageSession, to_message};

impl PageSession {
    /// Handles an event, except the end.
    pub(crate) fn handle_event(&mut self, event: Event) {
        match event {
            Event::Joined(client, to) => self.joined(client, to),
            Event::Left(client) => self.left(client),
            Event::Message(client, message, epoch, _ticket) => {
                self.control.heard(client, Instant::now());
                self.handle_message(client, message, epoch);
            }
            Event::Certified(generation, answer) if generation == self.session.config().generation => {
                let message = to_message(&answer);
                match answer {
                    ServerMessage::Range { key, .. } => drop(self.ranges.insert(key, message.clone())),
                    _ => self.verdict = Some(message.clone()),
                }
                self.tell_all(&message);
            }
            // An answer on an earlier world. The task's result is taken by the next poll.
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
            to_message(&self.status()),
        ];
        messages.extend(self.verdict.iter().chain(self.ranges.values()).cloned());
        messages.into_iter().for_each(|message| self.tell(client, message));
    }

    /// A page has disconnected, or does not read.
    pub(crate) fn left(&mut self, client: Client) {
        self.clients.remove(&client);
        if self.control.leave(client) {
            self.control_changed(Some(client));
        }
    }

    fn handle_message(&mut self, client: Client, message: ClientMessage, epoch: Epoch) {
        match &message {
            ClientMessage::Alive => return,
            ClientMessage::Take => {
                let from = self.control.holder();
                // A page that has disconnected takes nothing.
                if self.clients.contains_key(&client) && self.control.take(client, Instant::now()) {
                    self.control_changed(from);
                }
                return;
            }
            // The sender has passed it to the loop.
            ClientMessage::Order { order: Command::Stop } => return,
            ClientMessage::Hello { .. } => return self.answer_error(client, "hello has been said"),
            _ if !self.control.is_held_by(client) => {
                return self.answer_error(client, "another page has control; take it first");
            }
            _ => {}
        }
        match message {
            ClientMessage::Give => {
                self.control.leave(client);
                self.control_changed(Some(client));
            }
            ClientMessage::Order { order } => {
                let request = match order {
                    Command::Arm => Request::Arm,
                    Command::Disarm => Request::Disarm,
                    Command::Clear => Request::Clear,
                    Command::Stop => Request::Stop,
                };
                match self.session.request(request, epoch) {
                    Ok(()) => {}
                    Err(NotTaken::Outdated) => {
                        let sentence = "stop was pressed, or control changed, before this was heard; say it again";
                        self.answer_error(client, sentence);
                    }
                    Err(NotTaken::Busy) => self.answer_error(client, "the loop is busy; say it again"),
                }
            }
            ClientMessage::Hand { grip, position } => self.session.move_hand(grip.then_some(position)),
            ClientMessage::Set { key, value } => {
                self.submit(client, Task::Sets { key: key.clone(), sets: vec![(key, value)] });
            }
            ClientMessage::Sets { sets } => self.submit(client, Task::Sets { key: String::new(), sets }),
            ClientMessage::Reset => self.submit(client, Task::Reset),
            ClientMessage::Restart => {
                if let Err(sentence) = self.session.restart(epoch) {
                    self.refuse(client, "", sentence);
                }
            }
            ClientMessage::Scenario { name: None } => self.session.release(),
            ClientMessage::Scenario { name: Some(name) } => {
                if let Err(sentence) = self.session.play(&name) {
                    self.refuse(client, "scenario", sentence);
                }
            }
            ClientMessage::Record { on: true } => self.submit(client, Task::Record),
            ClientMessage::Record { on: false } => self.session.end_recording(),
            ClientMessage::Focus { key } => self.certifier.focus(key),
            ClientMessage::Alive | ClientMessage::Take | ClientMessage::Hello { .. } => {}
        }
    }

    fn submit(&mut self, client: Client, task: Task) {
        let key = task.key().to_string();
        if let Err(sentence) = self.session.submit(client, task) {
            self.refuse(client, &key, sentence);
        }
    }

    fn answer_error(&mut self, client: Client, sentence: &str) {
        self.tell(client, to_message(&ServerMessage::Error { message: sentence.into() }));
    }

    fn refuse(&mut self, client: Client, key: &str, message: String) {
        self.tell(client, to_message(&ServerMessage::Refused { key: key.into(), message }));
    }
}
