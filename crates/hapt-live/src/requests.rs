//! What the desk does when a page says something.

use std::time::Instant;

use hapt_core::{Guarding, Request};
use hapt_rt::Timing;
use hapt_sim::script;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;
use crate::desk::{Desk, Event, message};
use crate::protocol::{Said, Says, VERSION, Wish};
use crate::recording::Recording;
use crate::runner::News;
use crate::state::Workbench;

/// Why a key is not set on a real motor.
const UNCERTIFIED: &str =
    "the world would not be certified, and a motor hangs on it; hapt live --uncertified lets that be";

impl Desk {
    /// Somebody has come, gone, said something, or the judge has an answer.
    pub(crate) fn take_in(&mut self, event: Event) {
        match event {
            Event::Joined(client, to) => self.joined(client, to),
            Event::Left(client) => self.left(client),
            Event::Said(client, said) => {
                self.control.heard(client, Instant::now());
                self.said(client, said);
            }
            Event::Judged(generation, says) if generation == self.bench.generation => {
                let message = message(&says);
                match says {
                    Says::Range { key, .. } => drop(self.ranges.insert(key, message.clone())),
                    _ => self.verdict = Some(message.clone()),
                }
                self.tell_all(&message);
            }
            // An answer on a world of before; the end is no matter of ours.
            Event::Judged(..) | Event::End => {}
        }
    }

    fn joined(&mut self, client: Client, to: Sender<Message>) {
        self.clients.insert(client, to);
        let has_control = self.control.joined(client, Instant::now());
        let control = self.control.holder();
        let mut messages = vec![
            message(&Says::Hello { v: VERSION, client, control }),
            message(&Says::World(Box::new(self.bench.says()))),
            message(&self.status()),
        ];
        messages.extend(self.verdict.iter().chain(self.ranges.values()).cloned());
        messages.into_iter().for_each(|message| self.tell(client, message));
        if has_control {
            self.tell_all(&message(&Says::Control { control }));
        }
    }

    /// A page has gone, or does not read.
    pub(crate) fn left(&mut self, client: Client) {
        self.clients.remove(&client);
        if self.control.leave(client) {
            self.control_has_gone();
        }
    }

    /// Whoever had control has it no longer: his hand lets go.
    fn control_has_gone(&mut self) {
        self.let_go();
        let control = self.control.holder();
        self.tell_all(&message(&Says::Control { control }));
    }

    fn said(&mut self, client: Client, said: Said) {
        match &said {
            Said::Alive => return,
            Said::Take => {
                if self.control.take(client, Instant::now()) {
                    self.control_has_gone();
                }
                return;
            }
            // It came by another way: stop stands in no queue.
            Said::Order { order: Wish::Stop } => return,
            Said::Hello { .. } => return self.answer_error(client, "hello has been said"),
            _ if !self.control.is_held_by(client) => {
                return self.answer_error(client, "another page has control; take it first");
            }
            _ => {}
        }
        match said {
            Said::Give => {
                self.control.leave(client);
                self.control_has_gone();
            }
            Said::Order { order } => {
                let request = match order {
                    Wish::Arm => Request::Arm,
                    Wish::Disarm => Request::Disarm,
                    Wish::Clear => Request::Clear,
                    Wish::Stop => Request::Stop,
                };
                if !self.runner.ask(request) {
                    self.answer_error(client, "the loop is busy; say it again");
                }
            }
            Said::Hand { grip, position } => {
                // Who grabs the puck ends the scenario that holds it.
                if grip || self.scenario.is_none() {
                    self.scenario = None;
                    self.hand.want(grip.then_some(position));
                }
            }
            Said::Set { key, value } => {
                let next = self.bench.with(&key, &value);
                self.change(client, &key, next);
            }
            Said::Sets { sets } => {
                let next = self.bench.with_all(&sets);
                self.change(client, "", next);
            }
            Said::Reset => {
                let next = self.bench.reset();
                self.change(client, "", next);
            }
            Said::Scenario { name } => self.run_scenario(client, name.as_deref()),
            Said::Record { on } => self.record(client, on),
            Said::Focus { key } => self.judge.focus(key),
            Said::Alive | Said::Take | Said::Hello { .. } => {}
        }
    }

    fn answer_error(&mut self, client: Client, words: &str) {
        self.tell(client, message(&Says::Error { message: words.into() }));
    }

    fn refuse(&mut self, client: Client, key: &str, words: String) {
        self.tell(client, message(&Says::Refused { key: key.into(), message: words }));
    }

    /// Runs another world in place of the present one, whole or not at all.
    fn change(&mut self, client: Client, key: &str, next: Result<Workbench, String>) {
        let changed = next.and_then(|next| {
            if self.guarding == Guarding::Certified && !hapt_analysis::is_certified(&next.world) {
                return Err(UNCERTIFIED.into());
            }
            self.runner.change(&next).map(|()| next)
        });
        match changed {
            Ok(next) => self.goes_on_with(next),
            Err(words) => self.refuse(client, key, words),
        }
    }

    /// What the loop has to say by itself.
    pub(crate) fn hear(&mut self, news: News) {
        match news {
            News::Refused(words) => self.tell_all(&message(&Says::Error { message: words })),
            // What was wanted since then is still under way.
            News::Kept(generation, ..) if generation != self.bench.generation => {}
            News::Kept(_, runs, words) => {
                self.tell_all(&message(&Says::Refused { key: String::new(), message: words }));
                let mut back = *runs;
                back.generation = self.bench.generation.wrapping_add(1);
                if self.runner.change(&back).is_ok() {
                    self.goes_on_with(back);
                }
            }
        }
    }

    fn goes_on_with(&mut self, next: Workbench) {
        if next.world.sampling.period != self.bench.world.sampling.period {
            self.timing = Timing::new();
        }
        self.bench = next;
        self.worlds.push_back((self.bench.generation, self.bench.world.clone()));
        if let Some(recording) = &mut self.recording {
            recording.goes_on_with(self.bench.generation, &self.bench.world);
        }
        (self.verdict, self.ranges) = (None, Default::default());
        self.judge.ask(self.bench.clone());
        let world = message(&Says::World(Box::new(self.bench.says())));
        self.tell_all(&world);
    }

    fn run_scenario(&mut self, client: Client, name: Option<&str>) {
        self.let_go();
        let Some(name) = name else { return };
        if !self.hand.is_there() {
            return self.refuse(client, "scenario", format!("{} has no hand that could play it", self.bench.device()));
        }
        match self.bench.world.scenario(name) {
            Ok(scenario) => {
                self.hand.play(script(scenario, self.bench.world.sampling.period));
                self.scenario = Some((name.into(), self.time + scenario.duration));
            }
            Err(error) => self.refuse(client, "scenario", error.to_string()),
        }
    }

    fn record(&mut self, client: Client, on: bool) {
        if let Some(recording) = self.recording.take() {
            recording.end();
        }
        if on {
            match Recording::start(&self.folder, &self.bench, self.guarding, self.runner.as_mut()) {
                Ok(recording) => self.recording = Some(recording),
                Err(words) => self.refuse(client, "record", words),
            }
        }
    }
}
