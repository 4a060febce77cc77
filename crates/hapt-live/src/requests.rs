//! What the desk does when a page says something.

use std::time::Instant;

use hapt_core::Request;
use hapt_rt::{Epoch, Timing};
use hapt_sim::script;
use tokio::sync::mpsc::Sender;
use tokio_tungstenite::tungstenite::Message;

use crate::control::Client;
use crate::desk::{Desk, Event, message};
use crate::protocol::{Said, Says, VERSION, Wish};
use crate::runner::News;
use crate::state::Workbench;
use crate::worker::{Done, Job, Made, Task};

/// Tasks of whoever has control that may wait for those before them.
const TASKS: usize = 32;

impl Desk {
    /// Somebody has come, gone, said something, or the judge has an answer.
    pub(crate) fn take_in(&mut self, event: Event) {
        match event {
            Event::Joined(client, to) => self.joined(client, to),
            Event::Left(client) => self.left(client),
            Event::Said(client, said, epoch, _ticket) => {
                self.control.heard(client, Instant::now());
                self.said(client, said, epoch);
            }
            Event::Done(done) => self.done(*done),
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
        if self.control.joined(client, Instant::now()) {
            self.control_changed(None);
        }
        let control = self.control.holder();
        let mut messages = vec![
            message(&Says::Hello { v: VERSION, client, control }),
            self.world_says.clone(),
            message(&self.status()),
        ];
        messages.extend(self.verdict.iter().chain(self.ranges.values()).cloned());
        messages.into_iter().for_each(|message| self.tell(client, message));
    }

    /// A page has gone, or does not read.
    pub(crate) fn left(&mut self, client: Client) {
        self.clients.remove(&client);
        if self.control.leave(client) {
            self.control_changed(Some(client));
        }
    }

    fn said(&mut self, client: Client, said: Said, epoch: Epoch) {
        match &said {
            Said::Alive => return,
            Said::Take => {
                let from = self.control.holder();
                // A page that is gone takes nothing.
                if self.clients.contains_key(&client) && self.control.take(client, Instant::now()) {
                    self.control_changed(from);
                }
                return;
            }
            // It came by another way.
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
                self.control_changed(Some(client));
            }
            Said::Order { order } => {
                let request = match order {
                    Wish::Arm => Request::Arm,
                    Wish::Disarm => Request::Disarm,
                    Wish::Clear => Request::Clear,
                    Wish::Stop => Request::Stop,
                };
                self.restart = None;
                if epoch != self.handle.epoch() && matches!(request, Request::Arm | Request::Clear) {
                    let words = "stop was pressed, or control changed, before this was heard; say it again";
                    return self.answer_error(client, words);
                }
                if request == Request::Disarm && !self.is_simulated() {
                    // Past all queues, and mostly done at the door already.
                    if epoch == self.handle.epoch() {
                        self.handle.withdraw();
                    }
                    return;
                }
                if request == Request::Arm && self.is_simulated() {
                    // Where the puck is armed is 0 from then on: a hand that meant to be elsewhere would throw it.
                    self.let_go();
                    self.hand.tell();
                }
                if !self.runner.ask(request, epoch) {
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
            Said::Set { key, value } => self.wants(client, Task::Sets { key: key.clone(), sets: vec![(key, value)] }),
            Said::Sets { sets } => self.wants(client, Task::Sets { key: String::new(), sets }),
            Said::Reset => self.wants(client, Task::Reset),
            Said::Restart if self.hand.is_there() => {
                self.let_go();
                self.restart = Some((epoch, Instant::now()));
            }
            Said::Restart => {
                let words = format!("{} starts where it is armed: disarm it and arm it again", self.bench.device());
                self.refuse(client, "", words);
            }
            Said::Scenario { name } => self.run_scenario(client, name.as_deref()),
            Said::Record { on: true } => self.wants(client, Task::Record),
            Said::Record { on: false } => {
                self.tasks.retain(|(_, task)| *task != Task::Record);
                self.records = false;
                if let Some(recording) = self.recording.take() {
                    recording.end();
                }
            }
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

    /// Puts a task behind those that wait.
    fn wants(&mut self, client: Client, task: Task) {
        if task == Task::Record {
            self.records = true;
            if self.tasks.iter().any(|(_, waiting)| *waiting == Task::Record) {
                return;
            }
        }
        // Of several words on one key the last counts.
        if let (Some((last, Task::Sets { key: before, sets })), Task::Sets { key, sets: next }) =
            (self.tasks.back_mut(), &task)
            && *last == client
            && !key.is_empty()
            && before == key
        {
            sets.clone_from(next);
        } else if self.tasks.len() >= TASKS {
            let words = format!("{TASKS} changes are waiting to be computed; set it again when they are done");
            self.refuse(client, task.key(), words);
        } else {
            self.tasks.push_back((client, task));
        }
    }

    /// Begins the next task, where none is under way.
    pub(crate) fn work(&mut self) {
        let changes = self.tasks.front().is_some_and(|(_, task)| *task != Task::Record);
        if self.at_work || changes && !self.is_settled() {
            return;
        }
        if let Some((client, task)) = self.tasks.pop_front() {
            let (bench, profile, folder) = (self.bench.clone(), self.profile, self.folder.clone());
            let key = task.key().to_string();
            self.at_work = self.worker.begin(Job { client, task, bench, profile, folder });
            if !self.at_work {
                self.refuse(client, &key, "hapt's own worker has ended by a defect; start hapt live again".into());
            }
        }
    }

    /// A task is done: another world runs in place of the present one, whole or not at all, or a recording can begin.
    fn done(&mut self, done: Done) {
        let Done { client, task, generation, outcome } = done;
        self.at_work = false;
        // A board went back to the world that it had; the page that wanted this has control no longer.
        let is_stale = generation != self.bench.generation;
        if !self.control.is_held_by(client) {
            if let Ok(Made::Recording(recording)) = outcome {
                recording.end();
            }
            return;
        }
        match outcome {
            Ok(Made::Recording(recording)) if is_stale || !self.records => recording.end(),
            Ok(Made::Recording(_)) if !self.runner.begin_log() => {
                self.refuse(client, task.key(), "the loop is busy; say it again".into());
            }
            Ok(Made::Recording(recording)) => {
                if let Some(before) = self.recording.replace(recording) {
                    before.end();
                }
            }
            Ok(Made::World(..)) if is_stale => {
                let words = "the board has gone back to the world that it had; set it again".to_string();
                self.refuse(client, task.key(), words);
            }
            Ok(Made::World(next, says)) => match self.runner.change(&next) {
                Ok(()) => self.goes_on_with(*next, says),
                Err(words) => self.refuse(client, task.key(), words),
            },
            Err(words) => self.refuse(client, task.key(), words),
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
                    let says = message(&Says::World(Box::new(back.says())));
                    self.goes_on_with(back, says);
                }
            }
        }
    }

    fn goes_on_with(&mut self, next: Workbench, says: Message) {
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
        self.tell_all(&says);
        self.world_says = says;
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
}
