//! The links of a station over UDP: a thread between the loop's rings and a socket.
//!
//! The loop never waits for it. Between stations of one program the messages can take as long, and be lost as often, as the network's file says
//! ([`Way::AsWritten`]): what a person feels then is what a network does. What the messages are, and whom they are taken from, is [`hapt_wire::link`].

use std::collections::VecDeque;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::Strength;
use hapt_model::{Link, Network, World};
use hapt_rt::{LinkPort, LinkSample, LinkWire, link};
use hapt_sim::uniform;
use hapt_wire::link::{Outgoing, Refusal, SHORTEST_KEY, SIZE, Session, number};

/// Messages that are read at a time. More is a flood, and waits in the socket or is lost there.
const AT_ONCE: usize = 64;
/// How often an end says at its end that it has let go: a message may be lost.
const FAREWELLS: usize = 3;

/// Why links do not start.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The address to listen at is not to be had.
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
    /// The certificate cannot be computed.
    #[error("{0}")]
    Check(String),
    /// The system gives no random numbers, or no thread.
    #[error("the system gives no {what}: {error}")]
    System {
        /// What it does not give.
        what: &'static str,
        /// Why.
        error: io::Error,
    },
}

/// What happens to the messages of this station on their way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Whatever the network does.
    Real,
    /// They take the time of the links' `delay` and `delay_max`, and are lost as their `loss` says, before the network has them.
    AsWritten,
}

/// What a link has done so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkStatus {
    /// The station at its other end.
    pub to: String,
    /// The greatest age of a position at any time that its torque acts, in s.
    pub age_max: f64,
    /// Samples of this loop.
    pub samples: u64,
    /// Those of them in which the link's torque acted.
    pub acted: u64,
    /// Whether it acted in the last one.
    pub acts: bool,
    /// How often this end has let go.
    pub let_go: u64,
    /// The age of the other's position at the end of the last sample's hold, in s; infinite without one.
    pub age: f64,
    /// The greatest such age that has acted.
    pub oldest: f64,
    /// Messages taken.
    pub taken: u64,
    /// Messages refused, by [`Refusal::code`].
    pub refused: [u64; Refusal::ALL.len()],
}

/// The same while it changes.
#[derive(Default)]
struct Counters {
    samples: AtomicU64,
    acted: AtomicU64,
    acts: AtomicBool,
    let_go: AtomicU64,
    age: AtomicU64,
    age_max: AtomicU64,
    oldest: AtomicU64,
    taken: AtomicU64,
    refused: [AtomicU64; Refusal::ALL.len()],
}

/// The links of a station. Dropped, it tells the others that this end has let go.
pub struct Links {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    links: Vec<(String, Arc<Counters>)>,
    ways: Vec<Arc<WayNumbers>>,
}

/// One link's end.
struct End {
    wire: LinkWire,
    session: Session,
    to: SocketAddr,
    /// Between two messages, in ns; half a sample less, since samples are late now and then.
    period: u64,
    /// When the next message is due, in ns by the loop's clock.
    next: u64,
    last: Option<Outgoing>,
    /// Between their way out and the socket, in the order of their sending: when each is to go, by the thread's clock, and the message.
    held: Option<Held>,
    counters: Arc<Counters>,
}

/// How long the messages of an end take, and how many are lost.
#[derive(Debug)]
pub struct WayNumbers {
    /// In ns, shortest and longest.
    delay: [AtomicU64; 2],
    loss: AtomicU64,
}

impl WayNumbers {
    /// From now on every message takes this long, in s.
    pub fn set_delay(&self, delay: f64) {
        self.delay.iter().for_each(|end| end.store((delay * 1e9) as u64, Ordering::Relaxed));
    }

    /// From now on this part of them is lost.
    pub fn set_loss(&self, loss: f64) {
        self.loss.store(loss.to_bits(), Ordering::Relaxed);
    }
}

/// The way of a simulated network.
struct Held {
    numbers: Arc<WayNumbers>,
    random: u64,
    messages: VecDeque<(u64, [u8; SIZE])>,
}

impl Held {
    fn new(link: &Link, side: usize) -> Self {
        let random = u64::from(link.seed) << 1 | side as u64;
        let delay = [link.delay, link.delay_max_s()].map(|delay| AtomicU64::new((delay * 1e9) as u64));
        let numbers = Arc::new(WayNumbers { delay, loss: AtomicU64::new(link.loss.to_bits()) });
        Held { numbers, random, messages: VecDeque::new() }
    }

    fn take(&mut self, now: u64, bytes: [u8; SIZE]) {
        let [least, most] = self.numbers.delay.each_ref().map(|end| end.load(Ordering::Relaxed));
        if uniform(&mut self.random) >= f64::from_bits(self.numbers.loss.load(Ordering::Relaxed)) {
            let way = least + (uniform(&mut self.random) * most.saturating_sub(least) as f64) as u64;
            self.messages.push_back((now + way, bytes));
        }
    }

    /// Sends what is due. Messages overtake each other.
    fn send(&mut self, now: u64, socket: &UdpSocket, to: SocketAddr) {
        self.messages.retain(|(due, bytes)| {
            if *due <= now {
                let _ = socket.send_to(bytes, to);
            }
            *due > now
        });
    }
}

/// All numbers of a network on which the certificate of any of its stations depends, as text.
fn text(network: &Network) -> String {
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

impl LinkStatus {
    /// That the link has let go, and why, where it has.
    pub fn warning(&self) -> Option<String> {
        let LinkStatus { to, acts, age, age_max, samples, .. } = self;
        let oldest = 1e3 * age_max;
        match (acts, age) {
            (true, _) => None,
            (false, _) if *samples == 0 => None,
            (false, age) if age.is_infinite() => {
                Some(format!("The link to {to} has let go: nothing comes from there."))
            }
            (false, age) if age > age_max => Some(format!(
                "The link to {to} has let go: its position is {:.0} ms old, and {oldest:.0} ms are allowed.",
                1e3 * age
            )),
            (false, _) => {
                Some(format!("The link to {to} has let go. It takes hold when the other station is ready, too."))
            }
        }
    }
}

impl Links {
    /// Listens at `listen`, and links the station of this index with those of `peers`, each with its index and its address. The second are
    /// the loop's ends.
    ///
    /// # Errors
    /// See [`LinkError`]. Peers without a link are none.
    pub fn open(
        network: &Network,
        station: usize,
        listen: SocketAddr,
        peers: &[(usize, SocketAddr)],
        key: &[u8],
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        if key.len() < SHORTEST_KEY {
            return Err(LinkError::Key { given: key.len() });
        }
        let socket = UdpSocket::bind(listen).map_err(|error| LinkError::Listen { address: listen, error })?;
        Links::on(socket, network, station, peers, key, Way::Real)
    }

    /// The same on a socket that listens.
    ///
    /// # Errors
    /// As [`Links::open`].
    pub fn on(
        socket: UdpSocket,
        network: &Network,
        station: usize,
        peers: &[(usize, SocketAddr)],
        key: &[u8],
        way: Way,
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        if key.len() < SHORTEST_KEY {
            return Err(LinkError::Key { given: key.len() });
        }
        socket.set_nonblocking(true).map_err(|error| LinkError::System { what: "socket that does not wait", error })?;
        let text = text(network);
        let own = &network.stations[station];
        let (mut ends, mut ports, mut links, mut ways) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (at, joint) in network.links.iter().enumerate() {
            let Some(side) = joint.between.iter().position(|end| *end == station) else { continue };
            let other = joint.between[1 - side];
            let name = &network.stations[other].name;
            let to = peers.iter().find(|(peer, _)| *peer == other).map(|(_, to)| *to);
            let to = to.ok_or_else(|| LinkError::Peer { name: name.clone() })?;
            let (port, wire) = link(joint, side == 0, network.end(at, side));
            let mut random = [0; 8];
            fill(&mut random)?;
            let session = Session::new(key, number(&text, at), side == 0, u64::from_le_bytes(random));
            let sample = own.world.sampling.period;
            let period = joint.period.map_or(0.0, |period| period - 0.5 * sample);
            let counters = Arc::new(Counters::default());
            counters.age.store(f64::INFINITY.to_bits(), Ordering::Relaxed);
            counters.age_max.store(joint.age_max.to_bits(), Ordering::Relaxed);
            links.push((name.clone(), Arc::clone(&counters)));
            ports.push(port);
            let held = (way == Way::AsWritten).then(|| Held::new(joint, side));
            ways.extend(held.iter().map(|held: &Held| Arc::clone(&held.numbers)));
            ends.push(End { wire, session, to, period: (period * 1e9) as u64, next: 0, last: None, held, counters });
        }
        let stop = Arc::new(AtomicBool::new(false));
        // Several looks a sample: a message is to wait for a small part of one only.
        let nap = Duration::from_secs_f64((0.125 * own.world.sampling.period).clamp(50e-6, 500e-6));
        let stops = Arc::clone(&stop);
        let thread = std::thread::Builder::new().name("links".into()).spawn(move || run(&socket, ends, &stops, nap));
        let thread = thread.map_err(|error| LinkError::System { what: "thread", error })?;
        Ok((Links { stop, thread: Some(thread), links, ways }, ports))
    }

    /// What happens to the messages of each end; none on a real network.
    pub fn ways(&self) -> impl Iterator<Item = Arc<WayNumbers>> {
        self.ways.iter().map(Arc::clone)
    }

    /// What each link has done so far.
    pub fn status(&self) -> Vec<LinkStatus> {
        let number = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let one = |(to, counters): &(String, Arc<Counters>)| LinkStatus {
            to: to.clone(),
            age_max: f64::from_bits(number(&counters.age_max)),
            samples: number(&counters.samples),
            acted: number(&counters.acted),
            acts: counters.acts.load(Ordering::Relaxed),
            let_go: number(&counters.let_go),
            age: f64::from_bits(number(&counters.age)),
            oldest: f64::from_bits(number(&counters.oldest)),
            taken: number(&counters.taken),
            refused: std::array::from_fn(|code| number(&counters.refused[code])),
        };
        self.links.iter().map(one).collect()
    }
}

impl Drop for Links {
    fn drop(&mut self) {
        self.end();
    }
}

impl Links {
    /// Tells the other stations that this end has let go, and what each link has done.
    pub fn end(&mut self) -> Vec<LinkStatus> {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.status()
    }
}

fn run(socket: &UdpSocket, mut ends: Vec<End>, stop: &AtomicBool, nap: Duration) {
    let begin = Instant::now();
    // One byte more than a message: what is longer is seen to be.
    let mut buffer = [0; SIZE + 1];
    while !stop.load(Ordering::Relaxed) {
        let now = u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
        for _ in 0..AT_ONCE {
            match socket.recv_from(&mut buffer) {
                Ok((length, _)) => receive(&mut ends, &buffer[..length], now),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // That an earlier message found nobody, or was cut to the buffer: nothing for any link.
                Err(_) => {}
            }
        }
        for end in &mut ends {
            end.send(socket, now);
        }
        std::thread::sleep(nap);
    }
    for end in &mut ends {
        end.send(socket, 0);
        let Some(last) = end.last else { continue };
        for _ in 0..FAREWELLS {
            if let Some(bytes) = end.session.send(&Outgoing { strength: Strength::NONE, ..last }) {
                let _ = socket.send_to(&bytes, end.to);
            }
        }
    }
}

/// Gives a message to the link whose it is. One that is of none is counted at the one that knows best why.
fn receive(ends: &mut [End], bytes: &[u8], now: u64) {
    let mut refused: Option<(usize, Refusal)> = None;
    for (at, end) in ends.iter_mut().enumerate() {
        match end.session.receive(bytes, now) {
            Ok(incoming) => {
                end.counters.taken.fetch_add(1, Ordering::Relaxed);
                // Without room the loop stands still, and has no use for it.
                let _ = end.wire.incoming.push(incoming);
                return;
            }
            Err(refusal) => {
                if refused.is_none_or(|(_, before)| before == Refusal::Link) {
                    refused = Some((at, refusal));
                }
            }
        }
    }
    if let Some((at, refusal)) = refused {
        ends[at].counters.refused[refusal.code()].fetch_add(1, Ordering::Relaxed);
    }
}

impl End {
    /// Counts what the loop's samples have made of the link, and sends the newest of them where one is due.
    fn send(&mut self, socket: &UdpSocket, now: u64) {
        if let Some(held) = &mut self.held {
            held.send(now, socket, self.to);
        }
        let mut newest = None;
        while let Ok(sample) = self.wire.samples.pop() {
            self.count(&sample);
            newest = Some(sample.outgoing);
        }
        let Some(outgoing) = newest else { return };
        self.last = Some(outgoing);
        if outgoing.sampled < self.next {
            return;
        }
        self.next = outgoing.sampled + self.period;
        let Some(bytes) = self.session.send(&outgoing) else { return };
        match &mut self.held {
            Some(held) => held.take(now, bytes),
            None => {
                // A network that is down loses messages, and the link lets go.
                let _ = socket.send_to(&bytes, self.to);
            }
        }
    }

    fn count(&self, sample: &LinkSample) {
        let Counters { samples, acted, acts, let_go, age, age_max, oldest, .. } = &*self.counters;
        age_max.store(sample.age_max.to_bits(), Ordering::Relaxed);
        samples.fetch_add(1, Ordering::Relaxed);
        acts.store(sample.acts, Ordering::Relaxed);
        let_go.store(sample.let_go, Ordering::Relaxed);
        age.store(sample.age.to_bits(), Ordering::Relaxed);
        if sample.acts {
            acted.fetch_add(1, Ordering::Relaxed);
            // Of numbers that are not negative the bits are in their order.
            oldest.fetch_max(sample.age.to_bits(), Ordering::Relaxed);
        }
    }
}
