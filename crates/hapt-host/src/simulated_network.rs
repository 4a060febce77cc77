//! All stations of a network in one program, each a loop in real time on a simulated device.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hapt_analysis::NetworkCheck;
use hapt_model::Network;
use hapt_rt::{LinkPort, LinkTuning};

use crate::links::{LinkError, LinkStatus, Links, Way, WayNumbers, random_key};
use crate::machine::StationView;
use crate::messages::{LinkInfo, NetworkChange, NetworkInfo, NetworkRemedy};

/// What a remedy leaves of the largest factor that is certified.
const MARGIN: f64 = 0.98;

/// One station's part of it.
pub struct StationEnd {
    /// The loop's ends of its links, for [`crate::Machine::beside`].
    pub ports: Vec<LinkPort>,
    /// What its pages see and change.
    pub view: Box<dyn StationView>,
}

/// What all stations share.
struct Shared {
    state: Mutex<State>,
    way: Vec<Arc<WayNumbers>>,
    /// A link's, for both of its ends.
    tuning: Vec<LinkTuning>,
    file: Network,
}

struct State {
    certified: bool,
    sentence: String,
    remedies: Vec<NetworkRemedy>,
    delay: f64,
    loss: f64,
    /// Factors on the file's numbers.
    stiffness: f64,
    age: f64,
}

struct View {
    station: String,
    links: Links,
    shared: Arc<Shared>,
}

/// Connects the stations of `network`, in their order. Their messages go over sockets of this computer, and take the time, and are lost, as the file
/// says, until a page changes that.
///
/// # Errors
/// The network has no certificate, or the system gives no socket, thread or random numbers.
pub fn connect(network: &Network) -> Result<Vec<StationEnd>, LinkError> {
    let failed = |error| LinkError::System { what: "socket", error };
    let bound = |_: &_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| Ok((socket.local_addr()?, socket)));
    let sockets = network.stations.iter().map(bound).collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let peers: Vec<(usize, SocketAddr)> = sockets.iter().map(|(address, _)| *address).enumerate().collect();
    let key = random_key()?;
    let tuning: Vec<LinkTuning> =
        network.links.iter().map(|link| LinkTuning::new(link.stiffness(), link.age_max)).collect();
    let (mut opened, mut way) = (Vec::new(), Vec::new());
    for (at, (_, socket)) in sockets.into_iter().enumerate() {
        let (links, ports) = Links::on(socket, network, at, &peers, &key, Way::AsWritten)?;
        let of_station = network.links.iter().zip(&tuning).filter(|(link, _)| link.between.contains(&at));
        let ports: Vec<LinkPort> =
            ports.into_iter().zip(of_station).map(|(port, (_, own))| port.tuned(own.clone())).collect();
        way.extend(links.ways());
        opened.push((links, ports));
    }
    let check = hapt_analysis::check_network(network).map_err(|error| LinkError::Check(error.to_string()))?;
    let first = network.links.first();
    let mut state = State {
        certified: false,
        sentence: String::new(),
        remedies: Vec::new(),
        delay: first.map_or(0.0, |link| 0.5 * (link.delay + link.delay_max_s())),
        loss: first.map_or(0.0, |link| link.loss),
        stiffness: 1.0,
        age: 1.0,
    };
    state.judge(&check);
    let shared = Arc::new(Shared { state: Mutex::new(state), way, tuning, file: network.clone() });
    let view = |(station, (links, ports)): (&hapt_model::Station, (Links, Vec<LinkPort>))| StationEnd {
        ports,
        view: Box::new(View { station: station.name.clone(), links, shared: Arc::clone(&shared) }),
    };
    Ok(network.stations.iter().zip(opened).map(view).collect())
}

impl State {
    fn judge(&mut self, check: &NetworkCheck) {
        (self.certified, self.sentence) = (check.certified, check.verdict_sentence());
        let factor = |of: Option<f64>| of.filter(|factor| !check.certified && *factor > 0.0 && *factor < 1.0);
        let percent = |factor: f64| format!("{:.0} %", 100.0 * MARGIN * factor);
        let (stiffness, age) = (self.stiffness, self.age);
        let softer = factor(check.remedies.stiffness_scale).map(|factor| NetworkRemedy {
            text: format!("Soften every link to {}", percent(factor)),
            stiffness: Some(MARGIN * factor * stiffness),
            age: None,
        });
        let shorter = factor(check.remedies.age_scale).map(|factor| NetworkRemedy {
            text: format!("Shorten age_max to {}", percent(factor)),
            stiffness: None,
            age: Some(MARGIN * factor * age),
        });
        self.remedies = softer.into_iter().chain(shorter).collect();
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StationView for View {
    fn warnings(&self) -> Vec<String> {
        let state = self.shared.state();
        let verdict = (!state.certified).then(|| format!("The network is {}.", state.sentence));
        verdict.into_iter().chain(self.links.status().iter().filter_map(LinkStatus::warning)).collect()
    }

    fn info(&self) -> NetworkInfo {
        let state = self.shared.state();
        let links = self.links.status().into_iter().map(|link| LinkInfo {
            to: link.to,
            acts: link.acts,
            age_s: Some(link.age).filter(|age| age.is_finite()),
            age_max_s: link.age_max,
        });
        NetworkInfo {
            station: self.station.clone(),
            certified: state.certified,
            sentence: state.sentence.clone(),
            remedies: state.remedies.clone(),
            delay_s: state.delay,
            loss: state.loss,
            stiffness: state.stiffness,
            age: state.age,
            links: links.collect(),
        }
    }

    fn set(&self, change: &NetworkChange) -> Result<(), String> {
        let Shared { way, tuning, file, .. } = &*self.shared;
        let mut state = self.shared.state();
        if let Some(delay) = change.delay_s {
            state.delay = delay;
            way.iter().for_each(|way| way.set_delay(delay));
        }
        if let Some(loss) = change.loss {
            state.loss = loss;
            way.iter().for_each(|way| way.set_loss(loss));
        }
        if change.stiffness.is_none() && change.age.is_none() {
            return Ok(());
        }
        let (stiffness, age) = (change.stiffness.unwrap_or(state.stiffness), change.age.unwrap_or(state.age));
        let mut network = file.clone();
        for link in &mut network.links {
            *link = link.with_stiffness(stiffness * link.stiffness());
            link.age_max *= age;
        }
        let check = hapt_analysis::check_network(&network).map_err(|error| error.to_string())?;
        (state.stiffness, state.age) = (stiffness, age);
        state.judge(&check);
        for (link, tuning) in network.links.iter().zip(tuning) {
            tuning.set(link.stiffness(), link.age_max);
        }
        Ok(())
    }
}
