//! The links of a station over UDP or CAN: a thread between the loop's rings and a socket.
//!
//! The loop never waits for it. Between stations of one program the messages can have the delay and loss of the network's file
//! ([`Transport::AsWritten`]), which simulates a network. The messages and their authentication are in [`hapt_wire::link`].

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use hapt_model::{System, World};
use hapt_rt::{LinkPort, link};
use hapt_wire::link::{Datagrams, Frames, SHORTEST_KEY, Session, number};

use super::channel::InFlight;
use super::ends::{End, Medium, run};
use super::udp::Udp;
use super::{ChannelNumbers, Counters, LinkStatus};

/// The reason that links do not start.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The address to listen at is not available.
    #[error("{address}: cannot listen there: {error}")]
    Listen {
        /// As given.
        address: SocketAddr,
        /// The system's.
        error: io::Error,
    },
    /// The key is too short.
    #[error(
        "the key has {given} bytes, and needs {SHORTEST_KEY} or more, as random as those of `head -c 32 /dev/urandom`"
    )]
    Key {
        /// Its length.
        given: usize,
    },
    /// A station at the other end of a link has no address.
    #[error("the link to {name} has no address")]
    Peer {
        /// The station.
        name: String,
    },
    /// The CAN interface or adapter is not available.
    #[error("{address}: cannot open it: {error}")]
    Bus {
        /// As given.
        address: String,
        /// The system's.
        error: io::Error,
    },
    /// A CAN bus does not carry the network.
    #[error(transparent)]
    Limit(#[from] CanLimit),
    /// The certificate cannot be computed.
    #[error("{0}")]
    Check(String),
    /// The system gives no random numbers, or no thread.
    #[error("the system gives no {what}: {error}")]
    System {
        /// The missing resource.
        what: &'static str,
        /// Why.
        error: io::Error,
    },
}

/// The reason that a CAN bus does not carry the links of a network.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CanLimit {
    /// A CAN bus has identifiers for a limited number of links.
    #[error("over CAN a network has at most {} links, and this one has {count}", Frames::LINKS)]
    Many {
        /// Of the network.
        count: usize,
    },
    /// More messages within `age_max` than the numbers of frames distinguish.
    #[error(
        "the link to {name} sends {messages:.0} messages within its age_max, and over CAN {most} may be unanswered; give it a period of \
         {:.2} ms or more", 1e3 * .period
    )]
    Fast {
        /// The station at its other end.
        name: String,
        /// The number of messages in `age_max`.
        messages: f64,
        /// The largest number that may be unanswered.
        most: u64,
        /// The shortest time between two messages, in s.
        period: f64,
    },
    /// The links send more than the bus carries.
    #[error(
        "the links of the network send up to {:.0} kbit/s, and the bus carries {:.0} kbit/s; give them a longer period, or the adapter a \
         higher rate", 1e-3 * .sent, 1e-3 * .rate
    )]
    Busy {
        /// In bit/s.
        sent: f64,
        /// In bit/s.
        rate: f64,
    },
}

/// The transport of this station's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// The real network, without a simulated delay or loss.
    Real,
    /// With the links' `delay`, `delay_max` and `loss`, before the messages are sent to the network.
    AsWritten,
}

/// The links of a station. Dropping them reports the release to the other stations.
pub struct Links {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    links: Vec<Arc<Counters>>,
    channels: Vec<Arc<ChannelNumbers>>,
}

/// All numbers of a network on which the certificate of any of its stations depends, as text.
fn text(network: &System) -> String {
    let mut text = String::new();
    for station in &network.stations {
        let world = World { scenarios: Vec::new(), title: None, ..station.world.clone() };
        text += &format!("{}\n{}\n", station.name, world.to_toml());
    }
    for link in &network.links {
        text += &format!("{link:?}\n");
    }
    text
}

/// A key for stations of one program.
///
/// # Errors
/// The system gives no random numbers.
pub fn random_key() -> Result<[u8; 32], LinkError> {
    let mut key = [0; 32];
    fill(&mut key)?;
    Ok(key)
}

fn fill(bytes: &mut [u8]) -> Result<(), LinkError> {
    getrandom::fill(bytes).map_err(|error| LinkError::System { what: "random numbers", error: io::Error::other(error) })
}

impl Links {
    /// Over UDP: listens at `listen`, and links the station of this index with those of `peers`, each with its index and its address. The second
    /// are the loop's ends.
    ///
    /// # Errors
    /// See [`LinkError`]. Peers without a link are none.
    pub fn open(
        network: &System,
        station: usize,
        listen: SocketAddr,
        peers: &[(usize, SocketAddr)],
        key: &[u8],
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        if key.len() < SHORTEST_KEY {
            return Err(LinkError::Key { given: key.len() });
        }
        let socket = UdpSocket::bind(listen).map_err(|error| LinkError::Listen { address: listen, error })?;
        Links::on(socket, network, station, peers, key, Transport::Real)
    }

    /// The same on a socket that listens.
    ///
    /// # Errors
    /// As [`Links::open`].
    pub fn on(
        socket: UdpSocket,
        network: &System,
        station: usize,
        peers: &[(usize, SocketAddr)],
        key: &[u8],
        transport: Transport,
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        if key.len() < SHORTEST_KEY {
            return Err(LinkError::Key { given: key.len() });
        }
        socket.set_nonblocking(true).map_err(|error| LinkError::System { what: "socket that does not wait", error })?;
        Links::start(Udp(socket), network, station, transport, |at, first, number| {
            let other = network.links[at].between[usize::from(first)];
            let to = peers.iter().find(|(peer, _)| *peer == other).map(|(_, to)| *to);
            let to = to.ok_or_else(|| LinkError::Peer { name: network.stations[other].name.clone() })?;
            Ok((Datagrams::new(key, number, first), to))
        })
    }

    /// Starts the links of this station over `medium`. `end` gives the codec of an end, and where the other is, for the link's place in the
    /// network, whether it is the link's first end, and the link's number.
    pub(super) fn start<M: Medium>(
        medium: M,
        network: &System,
        station: usize,
        transport: Transport,
        end: impl Fn(usize, bool, u64) -> Result<(M::Codec, M::To), LinkError>,
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        let text = text(network);
        let own = &network.stations[station];
        let (mut ends, mut ports, mut links, mut channels) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (at, joint) in network.links.iter().enumerate() {
            let Some(side) = joint.between.iter().position(|end| *end == station) else { continue };
            let other = joint.between[1 - side];
            let (codec, to) = end(at, side == 0, number(&text, at))?;
            let sample = own.world.sampling.period;
            // The period of the other end's messages, as its session is paced.
            let tick = joint.between_messages(network.stations[other].world.sampling.period);
            let (port, wire) = link(joint, side == 0, network.end(at, side), tick);
            let mut random = [0; 8];
            fill(&mut random)?;
            let pace = joint.between_messages(sample);
            let session = Session::new(codec, u64::from_le_bytes(random)).paced((1e9 * pace) as u64);
            let period = joint.period.map_or(0.0, |_| pace - 0.5 * sample);
            let counters = Arc::new(Counters::new(&network.stations[other].name, joint.age_max));
            links.push(Arc::clone(&counters));
            ports.push(port);
            let in_flight = (transport == Transport::AsWritten).then(|| InFlight::new(joint, side));
            channels.extend(in_flight.iter().map(InFlight::numbers));
            ends.push(End {
                wire,
                session,
                to,
                period: (period * 1e9) as u64,
                next: 0,
                last: None,
                in_flight,
                counters,
            });
        }
        let stop = Arc::new(AtomicBool::new(false));
        // Several readings per sample, so that a message waits only for a small part of one.
        let nap = Duration::from_secs_f64((0.125 * own.world.sampling.period).clamp(50e-6, 500e-6));
        let stops = Arc::clone(&stop);
        let thread = std::thread::Builder::new().name("links".into()).spawn(move || {
            raise_priority();
            run(medium, ends, &stops, nap);
        });
        let thread = thread.map_err(|error| LinkError::System { what: "thread", error })?;
        Ok((Links { stop, thread: Some(thread), links, channels }, ports))
    }

    /// The simulated channels of the messages, one for each end; none on a real network.
    pub fn channels(&self) -> impl Iterator<Item = Arc<ChannelNumbers>> {
        self.channels.iter().map(Arc::clone)
    }

    /// The status of each link.
    pub fn status(&self) -> Vec<LinkStatus> {
        self.links.iter().map(|counters| counters.status()).collect()
    }
}

/// Raises the thread's priority above pages and browsers, where the system permits it: the age of a position includes the wait for its message.
fn raise_priority() {
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(-10);
}

impl Drop for Links {
    fn drop(&mut self) {
        self.end();
    }
}

impl Links {
    /// Reports the release to the other stations, and returns the status of each link.
    pub fn end(&mut self) -> Vec<LinkStatus> {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.status()
    }
}
