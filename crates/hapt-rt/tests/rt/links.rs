//! Two loops at the ends of a link, over a network with every fault: no torque from a position that is too old, and the right reason.

use std::collections::HashMap;

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_model::{Source, System};
use hapt_rt::{
    Cycle, Device, Failure, HandCommand, Hands, LinkWire, Moment, Outside, Plan, Position, Record, SimulatedDevice,
    link,
};
use hapt_sim::Grip;
use hapt_wire::link::{Codec, Datagrams, Frames, Number, Session};

const MS: u64 = 1_000_000;
/// The keys of both stations and of a foreign one.
const KEYS: [&[u8]; 2] = [b"the key of both stations....", b"the key of a foreign station"];
/// The link's numbers in the network file of both stations and in a foreign one.
const LINKS: [u64; 2] = [9, 10];
/// The duration of a campaign.
const END: u64 = 1500 * MS;
/// The start and the end of the fault.
const FAULT: [u64; 2] = [500 * MS, 1000 * MS];

/// Splitmix64.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Loss(f64),
    Bursts,
    /// An additional delay of the channel, in ms.
    Delay(u64),
    Reordering,
    Replays,
    Restart,
    /// The clock of one station jumps by this time, or its computer pauses for it, in ms.
    Pause(u64),
    Stop,
    /// One station has another key, or another network file.
    Stranger,
}

fn fault(rng: &mut Rng) -> Fault {
    match rng.below(12) {
        0 => Fault::Loss(0.01),
        1 => Fault::Loss(0.1),
        2 => Fault::Loss(0.5),
        3 => Fault::Loss(1.0),
        4 => Fault::Bursts,
        5 | 6 => Fault::Delay(1 + rng.below(40)),
        7 => Fault::Reordering,
        8 => Fault::Replays,
        9 => Fault::Restart,
        10 => Fault::Pause(1 + rng.below(300)),
        _ if rng.below(3) == 0 => Fault::Stranger,
        _ => Fault::Stop,
    }
}

/// The codec of an end, at the first station or not; or that of a foreign station.
fn datagrams(first: bool, strange: bool) -> Datagrams {
    Datagrams::new(KEYS[usize::from(strange)], LINKS[0], first)
}

fn frames(first: bool, strange: bool) -> Frames {
    Frames::new(Frames::RANGE, 3, LINKS[usize::from(strange)], first).unwrap()
}

struct Station<C> {
    cycle: Cycle,
    hands: Hands,
    wire: LinkWire,
    session: Session<C>,
    /// Its clock's offset from the true time.
    offset: u64,
    period: u64,
    next: u64,
    samples: u64,
    /// The number of samples that its computer missed before the next one.
    paused: u32,
    incoming: Vec<(u64, Vec<u8>)>,
    /// The number of the newest message whose sender acted or could act: the position of its torque.
    newest: Option<Number>,
    last: Option<Record>,
    arms: bool,
}

impl<C: Codec> Station<C> {
    fn new(network: &System, at: usize, codec: C, rng: &mut Rng) -> Self {
        let world = &network.stations[at].world;
        let (device, hands) = SimulatedDevice::new(world);
        let (port, wire) = link(&network.links[0], at == 0, network.end(0, at), 1e-3);
        let plan = Plan::new(world, SafetyProfile::Simulated).unwrap();
        Station {
            cycle: Cycle::new(Box::new(plan), Box::new(device)).with_outside(Outside::linked(vec![port])),
            hands,
            wire,
            session: Session::new(codec, rng.next()).paced((world.sampling.period * 1e9).round() as u64),
            offset: rng.next() >> 20,
            period: (world.sampling.period * 1e9).round() as u64,
            next: rng.below(2_000_000),
            samples: 0,
            paused: 0,
            incoming: Vec::new(),
            newest: None,
            last: None,
            arms: true,
        }
    }
}

/// The sums of events in all campaigns.
#[derive(Default)]
struct Seen {
    acted: u64,
    releases: u64,
    again: u64,
    refused: u64,
    faulted: u64,
}

fn network() -> System {
    let mut source = Source::from_text(
        "pair.toml",
        r#"
        stations.left.world = "wheel.toml"
        stations.right.world = "slow.toml"
        links = [{ kind = "spring", between = ["left", "right"], stiffness = "3 N mm/deg", age_max = "20 ms", limit = "50 N mm" }]
        "#,
    );
    let wheel = |period| {
        format!("loop.period = '{period}'\ndevice = {{ inertia = '6.4e-4 kg m^2', damping = '5 N mm s/rad' }}\n")
    };
    source.files.insert("wheel.toml".into(), wheel("1 ms"));
    source.files.insert("slow.toml".into(), wheel("2 ms"));
    System::read(&source, &[]).unwrap()
}

fn campaign<C: Codec>(network: &System, codec: fn(bool, bool) -> C, seed: u64, seen: &mut Seen) {
    let mut rng = Rng(seed);
    let fault = fault(&mut rng);
    let struck = rng.below(2) as usize;
    let (age_max, limit) = (network.links[0].age_max, network.links[0].limit.unwrap());
    let delay = MS / 10 + rng.below(3 * MS);
    let mut stations = [0, 1].map(|at| Station::new(network, at, codec(at == 0, false), &mut rng));
    let mut sent: Vec<(usize, Vec<u8>)> = Vec::new();
    let mut taken: HashMap<(u64, u64), u64> = HashMap::new();
    let (mut struck_once, mut gone) = (false, 0);
    loop {
        let at = usize::from(stations[0].next > stations[1].next);
        let time = stations[at].next;
        if time >= END {
            break;
        }
        let is_on = (FAULT[0]..FAULT[1]).contains(&time);
        if is_on && at == struck && !struck_once {
            struck_once = true;
            match fault {
                Fault::Restart => {
                    let Station { incoming, next, .. } = &mut stations[at];
                    let (incoming, next) = (std::mem::take(incoming), *next + rng.below(100) * MS);
                    stations[at] =
                        Station { incoming, next, ..Station::new(network, at, codec(at == 0, false), &mut rng) };
                    continue;
                }
                Fault::Pause(length) => {
                    let station = &mut stations[at];
                    station.paused = (length * MS / station.period) as u32;
                    station.next += u64::from(station.paused) * station.period;
                    continue;
                }
                Fault::Stranger => {
                    stations[at].session = Session::new(codec(at == 0, true), rng.next()).paced(stations[at].period);
                }
                _ => {}
            }
        }
        let station = &mut stations[at];
        let clock = |true_time: u64| station.offset + true_time;
        let now = clock(time);
        station.incoming.sort_by_key(|(when, _)| *when);
        let arrived = station.incoming.partition_point(|(when, _)| *when <= time);
        for (when, bytes) in station.incoming.drain(..arrived).collect::<Vec<_>>() {
            match station.session.receive(&bytes, now - (time - when)) {
                Ok(None) => {}
                Ok(Some(incoming)) => {
                    if station.wire.incoming.push(incoming).is_ok() && incoming.strength.acts() {
                        station.newest = Some(incoming.number);
                    }
                }
                Err(_) => seen.refused += 1,
            }
        }
        // Each station is armed as soon as it runs, and a hand moves the left wheel.
        let stops = fault == Fault::Stop && is_on && at == struck && station.arms;
        let request = match station.samples {
            _ if stops => {
                station.arms = false;
                Some(Request::Stop)
            }
            20 => Some(Request::Arm),
            _ => None,
        };
        if at == 0 && station.samples == 200 {
            let grip = Grip { stiffness: 0.5, damping: 0.01, inertia: 0.0 };
            let _ = station.hands.push(HandCommand::Grab(grip));
        }
        if at == 0 && station.samples > 200 {
            let _ = station.hands.push(HandCommand::Move(0.3 * (time as f64 * 6e-9).sin()));
        }
        let periods = if station.samples == 0 { 0 } else { 1 + std::mem::take(&mut station.paused) };
        station.cycle.pass(periods);
        let moment = Moment { due: time, now, periods, ..Moment::default() };
        let record = station.cycle.sample(&moment, request).unwrap();
        station.samples += 1;

        assert!(record.link.abs() <= limit, "{fault:?}: {record:?}");
        if record.link != 0.0 {
            let used = station.newest.unwrap();
            let age = (time - taken[&(used.session, used.sequence)]) as f64 * 1e-9 + network.stations[at].hold();
            assert!(age <= age_max * (1.0 + 1e-9), "{fault:?}: {age} at {time}");
            assert!(!matches!(record.phase, Phase::Disarmed | Phase::Faulted), "{fault:?}: {record:?}");
        }
        if let (Some(last), true) = (station.last, is_on || time > FAULT[1]) {
            gone += u64::from(last.link != 0.0 && record.link == 0.0);
        }
        match record.reason {
            None => {}
            Some(Reason::Stop) => {
                assert!(fault == Fault::Stop && at == struck, "{fault:?}: {record:?}");
                seen.faulted += u64::from(stops);
            }
            // Too many samples were missed.
            Some(Reason::Late) => assert!(matches!(fault, Fault::Pause(_)) && at == struck, "{fault:?}: {record:?}"),
            Some(reason) => panic!("{fault:?}: {reason:?}"),
        }
        station.last = Some(record);
        if time < FAULT[0] {
            seen.acted += u64::from(record.link != 0.0);
        }
        if time > END - 100 * MS {
            seen.again += u64::from(record.link != 0.0);
        }

        let mut newest = None;
        while let Ok(sample) = station.wire.samples.pop() {
            newest = Some(sample);
        }
        let newest = newest.unwrap();
        assert!(newest.age.is_infinite() || newest.age > 0.0);
        if matches!(record.phase, Phase::Disarmed | Phase::Faulted) {
            assert!(!newest.acts && !newest.outgoing.strength.acts(), "{fault:?}: {newest:?}");
        }
        let bytes = station.session.send(&newest.outgoing).unwrap().as_ref().to_vec();
        let Number { session, sequence } = station.session.own();
        taken.insert((session, sequence), time);
        station.next += station.period;
        sent.push((1 - at, bytes.clone()));
        let loss = match fault {
            Fault::Loss(loss) if is_on => loss,
            Fault::Bursts if is_on && (time / (30 * MS)).is_multiple_of(2) => 1.0,
            _ => 0.02,
        };
        let mut delay = delay + rng.below(MS);
        match fault {
            Fault::Delay(longer) if is_on => delay += longer * MS,
            Fault::Reordering if is_on => delay += rng.below(20 * MS),
            Fault::Replays => {
                for _ in 0..2 {
                    let (to, bytes) = sent[rng.below(sent.len() as u64) as usize].clone();
                    stations[to].incoming.push((time + delay, bytes));
                }
            }
            _ => {}
        }
        if rng.unit() >= loss {
            stations[1 - at].incoming.push((time + delay, bytes));
        }
    }
    seen.releases += gone;
    // A permanent loss of the link shows in the status.
    if matches!(fault, Fault::Loss(1.0) | Fault::Stop | Fault::Stranger) {
        assert!(gone > 0 || seen.acted == 0, "{fault:?}");
    }
}

fn campaigns<C: Codec>(codec: fn(bool, bool) -> C) {
    let network = network();
    let mut seen = Seen::default();
    let seeds = hapt_testing::seeds(1000);
    let n = seeds.end - seeds.start;
    for seed in seeds {
        campaign(&network, codec, seed, &mut seen);
    }
    let Seen { acted, releases, again, refused, faulted } = seen;
    println!("acted {acted}, released {releases}, acts again {again}, refused {refused}, stopped {faulted}");
    // Every kind of event occurs.
    assert!(acted > 100 * n && releases > n / 2 && again > 20 * n && refused > 10 * n && faulted > n / 50);
}

#[test]
fn no_fault_of_the_network_causes_a_torque_from_a_position_that_is_too_old() {
    campaigns(datagrams);
}

#[test]
fn no_fault_of_a_bus_causes_a_torque_from_a_position_that_is_too_old() {
    campaigns(frames);
}

/// A drive whose readings are stale, three of four.
struct Silent(SimulatedDevice);

impl Device for Silent {
    fn read(&mut self) -> Result<Position, Failure> {
        self.0.read()
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.0.write(torque)
    }

    fn missed(&self) -> u32 {
        3
    }
}

/// The failure of a station that misses three samples before some of a hundred, and pauses once.
fn fails(often: u64, is_silent: bool) -> Option<Failure> {
    let network = network();
    let world = &network.stations[0].world;
    let (port, _wire) = link(&network.links[0], true, network.end(0, 0), 1e-3);
    let plan = Plan::new(world, SafetyProfile::Simulated).unwrap();
    let (device, _hands) = SimulatedDevice::new(world);
    let device: Box<dyn Device> = if is_silent { Box::new(Silent(device)) } else { Box::new(device) };
    let mut cycle = Cycle::new(Box::new(plan), device).with_outside(Outside::linked(vec![port]));
    let mut now = 0;
    (0..20_000).find_map(|i| {
        let periods = if i == 1000 { u32::MAX / 2 } else { 1 + 3 * u32::from(i * 61 % 100 < often) };
        now += u64::from(periods) * MS;
        cycle.pass(periods);
        cycle.sample(&Moment { due: now, now, periods, ..Moment::default() }, None).err()
    })
}

/// A computer that is occasionally late, or pauses once, is fast enough; and a drive's silence is not the computer's.
#[test]
fn a_station_fails_where_its_computer_misses_more_samples_than_it_takes() {
    for often in [0, 10, 30] {
        assert_eq!(fails(often, false), None, "{often} of 100");
    }
    assert_eq!(fails(0, true), None);
    assert!(matches!(fails(40, false), Some(Failure::Slow(51..=59))));
}
