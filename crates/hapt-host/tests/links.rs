//! Stations on this computer whose messages go over sockets, with delay, loss and interruption.

use std::collections::VecDeque;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use hapt_analysis::check_network;
use hapt_core::{Request, Strength};
use hapt_host::links::{LinkError, LinkStatus, Links, SteppedLinks};
use hapt_host::simulated_network::SimulatedNetwork;
use hapt_host::{Backend, Error, Machine, Session, WorldConfig};
use hapt_model::{Source, System};
use hapt_rt::{Device, Failure, Outside, Plan, Position};
use hapt_wire::link::{Datagrams, Outgoing, Refusal};

const KEY: &[u8] = b"both stations know this one";
/// A time beyond which a test fails: far longer than on the slowest machine.
const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// A pair with ages long enough for a busy computer.
fn network() -> System {
    let mut source = Source::from_text(
        "pair.toml",
        r#"
        stations.left.world = "wheel.toml"
        stations.right.world = "wheel.toml"
        links = [{ kind = "spring", between = ["left", "right"], stiffness = 0.01, age_max = "400 ms" }]
        "#,
    );
    let wheel = "loop.period = '2 ms'\ndevice = { inertia = '6.4e-4 kg m^2', damping = '5 N mm s/rad' }\nsafety.stall = '10 s'\n";
    source.files.insert("wheel.toml".into(), wheel.into());
    System::read(&source, &[]).unwrap()
}

/// A free address of this computer.
fn free() -> SocketAddr {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap()
}

/// One direction of a network with delay and loss that can be interrupted.
struct DelayedPath {
    at: SocketAddr,
    cut: Arc<AtomicBool>,
    passed: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl DelayedPath {
    fn to(target: SocketAddr, delay: Duration) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.set_nonblocking(true).unwrap();
        let at = socket.local_addr().unwrap();
        let (cut, stop, passed) =
            (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
        let (cuts, stops, count) = (Arc::clone(&cut), Arc::clone(&stop), Arc::clone(&passed));
        let thread = std::thread::spawn(move || {
            let mut queue: VecDeque<(Instant, Vec<u8>)> = VecDeque::new();
            let (mut buffer, mut number) = ([0; 256], 0_u64);
            while !stops.load(Ordering::Relaxed) {
                while let Ok((length, _)) = socket.recv_from(&mut buffer) {
                    number += 1;
                    // One message of five is lost.
                    if !number.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(17).is_multiple_of(5) {
                        queue.push_back((Instant::now() + delay, buffer[..length].to_vec()));
                    }
                }
                while queue.front().is_some_and(|(due, _)| *due <= Instant::now()) {
                    let (_, bytes) = queue.pop_front().unwrap();
                    if !cuts.load(Ordering::Relaxed) {
                        count.fetch_add(1, Ordering::Relaxed);
                        let _ = socket.send_to(&bytes, target);
                    }
                }
                sleep(Duration::from_micros(200));
            }
        });
        DelayedPath { at, cut, passed, stop, thread: Some(thread) }
    }
}

impl Drop for DelayedPath {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A running, armed station.
struct Station {
    session: Session,
    links: Links,
    begin: Instant,
    /// The torque of the link in the last sample.
    link: f64,
    largest: f64,
}

impl Station {
    fn start(network: &System, at: usize, listen: SocketAddr, to: SocketAddr, key: &[u8]) -> Self {
        let (links, ports) = Links::open(network, at, listen, &[(1 - at, to)], key).unwrap();
        let station = &network.stations[at];
        let config = WorldConfig::new(station.source.clone(), station.sets.clone()).unwrap();
        let machine = Machine::simulated(&config.world).with_outside(Outside::linked(ports)).unwrap();
        let mut session = Session::start(config, machine).unwrap();
        let epoch = session.handle().epoch();
        session.request(Request::Arm, epoch).unwrap();
        Station { session, links, begin: Instant::now(), link: 0.0, largest: 0.0 }
    }

    fn poll(&mut self) -> LinkStatus {
        let Station { session, link, largest, .. } = self;
        let ended = session.poll(self.begin.elapsed(), |sample| {
            *link = sample.record.link;
            *largest = largest.max(link.abs());
        });
        assert!(ended.is_none(), "{ended:?}");
        self.links.status().remove(0)
    }
}

/// Polls both until the condition holds.
fn until(what: &str, stations: &mut [Station; 2], is_so: impl Fn(&[LinkStatus; 2], &[Station; 2]) -> bool) {
    let begin = Instant::now();
    loop {
        let status = stations.each_mut().map(Station::poll);
        if is_so(&status, stations) {
            return;
        }
        assert!(begin.elapsed() < TEST_TIMEOUT, "{what}: {status:?}");
        sleep(Duration::from_millis(5));
    }
}

fn pair(network: &System) -> ([Station; 2], [DelayedPath; 2], [SocketAddr; 2]) {
    let at = [free(), free()];
    let paths = [DelayedPath::to(at[1], Duration::from_millis(3)), DelayedPath::to(at[0], Duration::from_millis(3))];
    let stations = [0, 1].map(|station| Station::start(network, station, at[station], paths[station].at, KEY));
    (stations, paths, at)
}

#[test]
fn two_stations_release_when_the_network_is_interrupted_and_reconnect_afterwards() {
    let network = network();
    let (mut stations, paths, _) = pair(&network);
    until("both act", &mut stations, |links, _| links.iter().all(|link| link.acts));
    // The left hand turns its wheel: the right wheel follows.
    let hand = stations[0].session.hand();
    hand.move_to(Some(0.5));
    hand.send();
    until("the right feels the left", &mut stations, |_, stations| stations[1].largest > 1e-4);
    for path in &paths {
        path.cut.store(true, Ordering::Relaxed);
    }
    until("both release", &mut stations, |links, stations| {
        links.iter().all(|link| !link.acts && link.releases > 0) && stations.iter().all(|station| station.link == 0.0)
    });
    for path in &paths {
        path.cut.store(false, Ordering::Relaxed);
    }
    let hand = stations[0].session.hand();
    hand.move_to(None);
    hand.send();
    // The wheels are apart now, without a hand: they reconnect without meeting and without a torque step.
    let taken = stations.each_ref().map(|station| station.links.status()[0].taken);
    until("both receive again", &mut stations, |links, _| {
        links.iter().zip(&taken).all(|(link, taken)| link.taken > taken + 50)
    });
    let hand = stations[0].session.hand();
    hand.move_to(Some(-1.0));
    hand.send();
    until("they have met", &mut stations, |links, _| links.iter().all(|link| link.acts));
    for link in stations.each_mut().map(Station::poll) {
        assert!(link.oldest <= link.age_max && link.oldest > 6e-3, "{link:?}");
    }
    // An end that is dropped reports its release.
    let [mut left, right] = stations;
    drop(right);
    let begin = Instant::now();
    while left.poll().acts {
        assert!(begin.elapsed() < TEST_TIMEOUT);
        sleep(Duration::from_millis(5));
    }
}

#[test]
fn foreign_messages_are_counted_by_their_error_and_change_nothing() {
    let network = network();
    let (mut stations, paths, at) = pair(&network);
    until("both act", &mut stations, |links, _| links.iter().all(|link| link.acts));
    let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let say = |key: &[u8], link| {
        let outgoing = Outgoing { sampled: 0, position: 1e3, strength: Strength::WHOLE, received: None };
        hapt_wire::link::Session::new(Datagrams::new(key, link, true), 5).send(&outgoing).unwrap()
    };
    let begin = Instant::now();
    loop {
        for _ in 0..20 {
            for bytes in [&b"hello"[..], &[0; 300], &say(b"no key of these two stations", 3), &say(KEY, 3)] {
                let _ = stranger.send_to(bytes, at[1]);
            }
        }
        let link = stations.each_mut().map(Station::poll)[1].clone();
        let refused = |refusal: Refusal| link.refused[refusal.code()];
        if refused(Refusal::Size) > 100 && refused(Refusal::Key) > 50 && refused(Refusal::Link) > 50 {
            break;
        }
        assert!(begin.elapsed() < TEST_TIMEOUT, "{link:?}");
        sleep(Duration::from_millis(5));
    }
    until("both act still", &mut stations, |links, _| links.iter().all(|link| link.acts));
    assert!(stations.iter().all(|station| station.largest < 1e-3));
    assert!(paths.iter().all(|path| path.passed.load(Ordering::Relaxed) > 0));
}

#[test]
fn stations_of_networks_that_differ_have_no_link() {
    let network = network();
    let mut other = network.clone();
    other.links[0] = other.links[0].with_stiffness(0.02);
    let at = [free(), free()];
    let mut stations = [Station::start(&network, 0, at[0], at[1], KEY), Station::start(&other, 1, at[1], at[0], KEY)];
    until("both refuse", &mut stations, |links, _| links.iter().all(|link| link.refused[Refusal::Link.code()] > 20));
    until("nothing acts", &mut stations, |links, _| links.iter().all(|link| link.acted == 0 && link.taken == 0));
}

#[test]
fn an_address_that_cannot_be_opened_gives_the_reason() {
    let network = network();
    let taken = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let at = taken.local_addr().unwrap();
    let open = |listen, peers: &[_], key: &[u8]| Links::open(&network, 0, listen, peers, key).map(|_| ()).unwrap_err();
    assert!(matches!(open(at, &[(1, at)], KEY), LinkError::Listen { .. }));
    assert!(matches!(open(free(), &[(1, at)], b"short"), LinkError::Key { given: 5 }));
    assert!(matches!(open(free(), &[], KEY), LinkError::Peer { name } if name == "right"));
}

/// A device on a computer that becomes too slow for its loop.
struct Slow {
    device: Box<dyn Device>,
    is_slow: Arc<AtomicBool>,
    /// The last torque written, as bits.
    written: Arc<AtomicU64>,
}

impl Device for Slow {
    fn read(&mut self) -> Result<Position, Failure> {
        // A session without a thread misses no sample itself.
        if self.is_slow.load(Ordering::Relaxed) { Err(Failure::Slow(54)) } else { self.device.read() }
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.written.store(torque.to_bits(), Ordering::Relaxed);
        self.device.write(torque)
    }

    fn passed(&mut self, periods: u32) {
        self.device.passed(periods);
    }

    fn homed(&mut self, zero: f64) {
        self.device.homed(zero);
    }

    fn adopt(&mut self, plan: &mut Plan) {
        self.device.adopt(plan);
    }
}

/// Eleven stations on one computer: where it is too slow for them they end, with one message and no torque.
#[test]
fn a_computer_too_slow_for_its_stations_ends_them_without_a_torque() {
    let mut source = Source::from_text("chain.toml", "");
    source.text = (0..11).map(|i| format!("stations.s{i}.world = \"wheel.toml\"\n")).collect();
    for i in 0..10 {
        let between = format!("between = [\"s{i}\", \"s{}\"]", i + 1);
        source.text += &format!("[[links]]\nkind = \"spring\"\n{between}\nstiffness = 0.01\nage_max = \"50 ms\"\n");
    }
    let wheel = "loop.period = '4 ms'\ndevice = { inertia = '6.4e-4 kg m^2', damping = '5 N mm s/rad' }\n\
                 couplings = [{ kind = 'constant', between = ['puck', 'ground'], torque = 0.01 }]\n";
    source.files.insert("wheel.toml".into(), wheel.into());
    let network = System::read(&source, &[]).unwrap();
    let (links, ports) = SteppedLinks::new(&network);
    let verdict = check_network(&network).unwrap().linked();
    let (shared, ports) = SimulatedNetwork::new(network.clone(), verdict, links.channels(), ports);
    let shared = Arc::new(shared);
    let (is_slow, written) = (Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
    let mut sessions: Vec<Session> = (network.stations.iter().zip(ports).enumerate())
        .map(|(at, (station, ports))| {
            let config = WorldConfig::new(station.source.clone(), Vec::new()).unwrap();
            let mut machine = Machine::stepped(&config.world).with_outside(Outside::linked(ports)).unwrap();
            machine.network = Some(shared.view(at, links.status(at), |_| ()));
            if at == 7 {
                let Backend::Stepped { device, outside } = machine.backend else { panic!("stepped") };
                let (is_slow, written) = (Arc::clone(&is_slow), Arc::clone(&written));
                machine.backend = Backend::Stepped { device: Box::new(Slow { device, is_slow, written }), outside };
            }
            let mut session = Session::start(config, machine).unwrap();
            session.request(Request::Arm, session.handle().epoch()).unwrap();
            session
        })
        .collect();
    let torque = || f64::from_bits(written.load(Ordering::Relaxed));
    let mut now = Duration::ZERO;
    let mut pass = |seconds: f64| {
        let until = now + Duration::from_secs_f64(seconds);
        while now < until {
            now += Duration::from_millis(4);
            for (at, session) in sessions.iter_mut().enumerate() {
                if let Some(ended) = session.poll(now, |_| ()) {
                    return Some((at, ended.unwrap_err()));
                }
            }
        }
        None
    };
    assert!(pass(2.0).is_none());
    assert_eq!(torque(), 0.01);
    is_slow.store(true, Ordering::Relaxed);
    let (at, error) = pass(1.0).unwrap();
    assert!(at == 7 && matches!(error, Error::Station { failure: Failure::Slow(54), .. }), "{error:?}");
    let message = error.to_string();
    for part in ["s7: ", "too slow for the loop", "missed 5", "longer loop.period", "hapt run NETWORK --station"] {
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(torque(), 0.0);
}
