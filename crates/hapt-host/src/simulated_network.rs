//! A network whose stations are all simulated in one program: the numbers that its pages change, and the network's verdict.
//!
//! The verdict is computed elsewhere, and may take long: a change makes a [`Question`], and [`SimulatedNetwork::answer`] is called with its
//! verdict. Until then the pages show the previous verdict as outdated.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hapt_analysis::Linked;
use hapt_model::{System, World};
use hapt_rt::{LinkPort, LinkTuning};

use crate::links::{ChannelNumbers, LinkStatus};
use crate::machine::StationView;
use crate::messages::{LinkInfo, NetworkChange, NetworkInfo, NetworkRemedy};

/// The part of the largest certified factor that a remedy proposes.
const MARGIN: f64 = 0.98;

/// The data that all stations share.
pub struct SimulatedNetwork {
    state: Mutex<State>,
    channels: Vec<Arc<ChannelNumbers>>,
    /// Of each link, the end at its first station, and at its second.
    tuning: Vec<[LinkTuning; 2]>,
}

struct State {
    /// The network of its file, with the worlds that pages have changed.
    network: System,
    delay: f64,
    loss: f64,
    factors: Factors,
    /// The number of the last question.
    revision: u64,
    /// The number of the question of the present verdict.
    answered: u64,
    verdict: Linked,
    remedies: Vec<NetworkRemedy>,
}

/// The factors on the file's numbers.
#[derive(Clone, Copy, Debug)]
struct Factors {
    stiffness: f64,
    age: f64,
}

/// A network whose verdict is requested.
#[derive(Clone, Debug)]
pub struct Question {
    /// The present network.
    pub network: System,
    revision: u64,
    factors: Factors,
}

impl Factors {
    const ONE: Factors = Factors { stiffness: 1.0, age: 1.0 };

    fn of(self, network: &System) -> System {
        let mut network = network.clone();
        for link in &mut network.links {
            *link = link.with_stiffness(self.stiffness * link.stiffness());
            link.age_max *= self.age;
        }
        network
    }

    fn remedies(self, verdict: &Linked) -> Vec<NetworkRemedy> {
        let factor = |of: Option<f64>| of.filter(|factor| !verdict.certified && *factor > 0.0 && *factor < 1.0);
        let percent = |factor: f64| format!("{:.0} %", 100.0 * MARGIN * factor);
        let softer = factor(verdict.stiffness_scale).map(|factor| NetworkRemedy {
            text: format!("Soften every link to {}", percent(factor)),
            stiffness: Some(MARGIN * factor * self.stiffness),
            age: None,
        });
        let shorter = factor(verdict.age_scale).map(|factor| NetworkRemedy {
            text: format!("Shorten age_max to {}", percent(factor)),
            stiffness: None,
            age: Some(MARGIN * factor * self.age),
        });
        softer.into_iter().chain(shorter).collect()
    }
}

impl SimulatedNetwork {
    /// The network of a file with its verdict. `ports` are the loops' ends, by station and in the order of its links, which are given back
    /// with numbers that follow the network's; `channels` those of its messages.
    pub fn new(
        network: System,
        verdict: Linked,
        channels: Vec<Arc<ChannelNumbers>>,
        ports: Vec<Vec<LinkPort>>,
    ) -> (Self, Vec<Vec<LinkPort>>) {
        let tuning: Vec<[LinkTuning; 2]> = (network.links.iter().enumerate())
            .map(|(at, link)| [0, 1].map(|side| LinkTuning::new(link.stiffness(), network.end(at, side))))
            .collect();
        let tuned = ports.into_iter().enumerate().map(|(station, ports)| {
            let ends = network.links.iter().zip(&tuning).filter_map(|(link, ends)| {
                let side = link.between.iter().position(|end| *end == station)?;
                Some(ends[side].clone())
            });
            ports.into_iter().zip(ends).map(|(port, tuning)| port.tuned(tuning)).collect()
        });
        let ports = tuned.collect();
        let first = network.links.first();
        let state = State {
            delay: first.map_or(0.0, |link| 0.5 * (link.delay + link.delay_max_s())),
            loss: first.map_or(0.0, |link| link.loss),
            factors: Factors::ONE,
            revision: 0,
            answered: 0,
            remedies: Factors::ONE.remedies(&verdict),
            verdict,
            network,
        };
        (SimulatedNetwork { state: Mutex::new(state), channels, tuning }, ports)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes its numbers. Returns a question where the verdict depends on the change.
    pub fn change(&self, change: &NetworkChange) -> Option<Question> {
        let mut state = self.state();
        if let Some(delay) = change.delay_s {
            state.delay = delay;
            self.channels.iter().for_each(|channel| channel.set_delay(delay));
        }
        if let Some(loss) = change.loss {
            state.loss = loss;
            self.channels.iter().for_each(|channel| channel.set_loss(loss));
        }
        if change.stiffness.is_none() && change.age.is_none() {
            return None;
        }
        let Factors { stiffness, age } = state.factors;
        state.factors = Factors { stiffness: change.stiffness.unwrap_or(stiffness), age: change.age.unwrap_or(age) };
        Some(self.question(&mut state))
    }

    /// Replaces the world of the station of this index.
    ///
    /// # Panics
    /// There is no such station.
    pub fn change_world(&self, station: usize, world: World) -> Question {
        let mut state = self.state();
        state.network.stations[station] = state.network.stations[station].with_world(world);
        self.question(&mut state)
    }

    fn question(&self, state: &mut State) -> Question {
        let network = state.factors.of(&state.network);
        for (at, (link, ends)) in network.links.iter().zip(&self.tuning).enumerate() {
            for (side, tuning) in ends.iter().enumerate() {
                tuning.set(link.stiffness(), network.end(at, side));
            }
        }
        state.revision += 1;
        Question { network, revision: state.revision, factors: state.factors }
    }

    /// Sets the verdict on a question, unless a newer one has been answered.
    pub fn answer(&self, question: &Question, verdict: Linked) {
        let mut state = self.state();
        if question.revision >= state.answered {
            state.answered = question.revision;
            state.remedies = question.factors.remedies(&verdict);
            state.verdict = verdict;
        }
    }

    /// The view of the station of this index, for its pages. `links` returns the state of its links; `ask` receives questions, which are to be
    /// answered.
    pub fn view(
        self: &Arc<Self>,
        station: usize,
        links: impl Fn() -> Vec<LinkStatus> + Send + 'static,
        ask: impl Fn(Question) + Send + 'static,
    ) -> Box<dyn StationView> {
        Box::new(View { station, network: Arc::clone(self), links: Box::new(links), ask: Box::new(ask) })
    }
}

struct View {
    station: usize,
    network: Arc<SimulatedNetwork>,
    links: Box<dyn Fn() -> Vec<LinkStatus> + Send>,
    ask: Box<dyn Fn(Question) + Send>,
}

impl StationView for View {
    fn info(&self) -> NetworkInfo {
        let links = (self.links)();
        let state = self.network.state();
        let State { verdict: Linked { certified, sentence, .. }, .. } = &*state;
        let outdated = state.answered != state.revision;
        let verdict = match (certified, outdated) {
            (true, _) => None,
            (false, false) => Some(format!("The network is {sentence}.")),
            (false, true) => Some(format!("Before the last change the network was {sentence}.")),
        };
        let link = |link: &LinkStatus| LinkInfo {
            to: link.to.clone(),
            acts: link.acts,
            age_s: Some(link.age).filter(|age| age.is_finite()),
            age_max_s: link.age_max,
        };
        NetworkInfo {
            station: state.network.stations[self.station].name.clone(),
            certified: *certified,
            sentence: sentence.clone(),
            outdated,
            remedies: state.remedies.clone(),
            delay_s: state.delay,
            loss: state.loss,
            stiffness: state.factors.stiffness,
            age: state.factors.age,
            links: links.iter().map(link).collect(),
            warnings: verdict.into_iter().chain(links.iter().filter_map(LinkStatus::warning)).collect(),
        }
    }

    fn change(&self, change: &NetworkChange) {
        self.network.change(change).into_iter().for_each(&self.ask);
    }

    fn change_world(&self, world: &World) {
        (self.ask)(self.network.change_world(self.station, world.clone()));
    }
}
