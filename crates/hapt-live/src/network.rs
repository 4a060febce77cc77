//! All stations of a network in one program: their links over sockets of this computer, and the network's certificate on its own thread.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use hapt_analysis::{Error, Linked, NetworkCheck, check_network};
use hapt_host::StationView;
use hapt_host::links::{LinkError, Links, Transport, random_key};
use hapt_host::simulated_network::{Question, SimulatedNetwork};
use hapt_model::System;
use hapt_rt::LinkPort;

use crate::certifier::{BROKEN, Latest, VERDICTS, lower_priority};

/// One station's part of a network.
pub struct StationEnd {
    /// The loop's ends of its links, for [`hapt_host::Machine::with_outside`].
    pub ports: Vec<LinkPort>,
    /// The network's view for its pages.
    pub view: Box<dyn StationView>,
}

/// Connects the stations of `network`, in their order. Their messages go over sockets of this computer, with the delay and loss of the file until a page
/// changes them. The verdict follows the pages' changes of the links and of each station's world.
///
/// # Errors
/// The network has no certificate, or the system gives no socket, thread or random numbers.
pub fn connect(network: &System) -> Result<Vec<StationEnd>, LinkError> {
    connect_by(network, check_network)
}

/// The same with certificates computed by the caller.
///
/// # Errors
/// As [`connect`].
pub fn connect_by(
    network: &System,
    certify: impl Fn(&System) -> Result<NetworkCheck, Error> + Send + 'static,
) -> Result<Vec<StationEnd>, LinkError> {
    let failed = |error| LinkError::System { what: "socket", error };
    let bound = |_: &_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| Ok((socket.local_addr()?, socket)));
    let sockets = network.stations.iter().map(bound).collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let peers: Vec<(usize, SocketAddr)> = sockets.iter().map(|(address, _)| *address).enumerate().collect();
    let key = random_key()?;
    let (mut all, mut ports, mut channels) = (Vec::new(), Vec::new(), Vec::new());
    for (at, (_, socket)) in sockets.into_iter().enumerate() {
        let (links, own) = Links::on(socket, network, at, &peers, &key, Transport::AsWritten)?;
        channels.extend(links.channels());
        all.push(links);
        ports.push(own);
    }
    let check = certify(network).map_err(|error| LinkError::Check(error.to_string()))?;
    let (shared, ports) = SimulatedNetwork::new(network.clone(), check.linked(), channels, ports);
    let shared = Arc::new(shared);
    let certifier = Arc::new(NetworkCertifier::start(Arc::clone(&shared), certify)?);
    let ends = all.into_iter().zip(ports).enumerate().map(|(station, (links, ports))| {
        let certifier = Arc::clone(&certifier);
        StationEnd {
            ports,
            view: shared.view(station, move || links.status(), move |question| certifier.ask(question)),
        }
    });
    Ok(ends.collect())
}

/// The thread that answers questions about a network, the newest first. Dropped, it finishes its computation, and ends.
struct NetworkCertifier(Arc<Latest<Question>>);

impl NetworkCertifier {
    fn start(
        network: Arc<SimulatedNetwork>,
        certify: impl Fn(&System) -> Result<NetworkCheck, Error> + Send + 'static,
    ) -> Result<Self, LinkError> {
        let latest: Arc<Latest<Question>> = Arc::default();
        let questions = Arc::clone(&latest);
        let work = move || {
            lower_priority(VERDICTS);
            while let Some(question) = questions.take() {
                let checked = catch_unwind(AssertUnwindSafe(|| certify(&question.network)));
                let verdict = match checked {
                    Ok(Ok(check)) => check.linked(),
                    Ok(Err(error)) => Linked::refused(&error.to_string()),
                    Err(_) => Linked::refused(BROKEN),
                };
                network.answer(&question, verdict);
            }
        };
        let thread = std::thread::Builder::new().name("network".into()).spawn(work);
        thread.map_err(|error| LinkError::System { what: "thread", error })?;
        Ok(NetworkCertifier(latest))
    }

    fn ask(&self, question: Question) {
        self.0.put(question);
    }
}

impl Drop for NetworkCertifier {
    fn drop(&mut self) {
        self.0.end();
    }
}
