//! The messages of a link on a network with loss, delay, reordering, repetition, forgery and replay.

use hapt_core::Strength;
use hapt_testing::prelude::*;
use hapt_wire::link::{
    Codec, Datagrams, Frames, Incoming, Number, Outgoing, Refusal, SHORTEST_KEY, SILENCE, SIZE, Session, VERSION,
};

const KEY: &[u8] = b"both stations know this one";
const MS: u64 = 1_000_000;
/// In ns.
const SECONDS: f64 = 1e9;

fn say(sampled: u64, position: f64, received: Option<Number>) -> Outgoing {
    Outgoing { sampled, position, strength: Strength::NONE, received }
}

/// Splitmix64.
pub fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn datagrams(link: u64, first: bool) -> Datagrams {
    Datagrams::new(KEY, link, first)
}

fn frames(link: u64, first: bool) -> Frames {
    Frames::new(Frames::RANGE, 5, link, first).unwrap()
}

/// An end under the test's key.
fn end(link: u64, first: bool, own: u64) -> Session<Datagrams> {
    Session::new(datagrams(link, first), own)
}

/// A station with its own clock.
struct Station<C> {
    session: Session<C>,
    period: u64,
    next: u64,
    /// Its clock shows `offset` + `rate` t at the true time t.
    offset: u64,
    rate: f64,
    received: Option<Number>,
    /// The messages to it: times of arrival, and bytes.
    incoming: Vec<(u64, Vec<u8>)>,
}

impl<C: Codec> Station<C> {
    fn new(codec: C, random: &mut impl FnMut() -> u64) -> Self {
        Station {
            session: Session::new(codec, random()),
            period: MS / 4 + random() % (8 * MS),
            next: random() % (8 * MS),
            offset: random() % (1 << 50),
            rate: 0.9 + 0.2 * (random() % 1000) as f64 / 1000.0,
            received: None,
            incoming: Vec::new(),
        }
    }

    fn clock(&self, time: u64) -> u64 {
        self.offset + (self.rate * time as f64) as u64
    }
}

/// An adversary's effect on messages: it loses `loss` of 100, delays each by up to `longest`, and replays `replays` earlier ones at every message.
struct Adversary {
    loss: u64,
    longest: u64,
    replays: u64,
}

/// For every treatment of the messages the bound on a position's sampling time, by the receiver's clock, is never after its sample. Returns the number of
/// bounded positions.
fn dated<C: Codec>(codec: fn(u64, bool) -> C, seed: u64, adversary: &Adversary) -> u64 {
    let Adversary { loss, longest, replays } = *adversary;
    let mut state = seed;
    let mut random = || random(&mut state);
    let link = random();
    let mut stations = [true, false].map(|first| Station::new(codec(link, first), &mut random));
    // Each message that was ever sent, and for which station; the position is its true time.
    let mut seen: Vec<(usize, Vec<u8>)> = Vec::new();
    let mut dated = 0;
    for _ in 0..1500 {
        let at = usize::from(stations[0].next > stations[1].next);
        let time = stations[at].next;
        let station = &mut stations[at];
        station.incoming.sort_by_key(|(when, _)| *when);
        let arrived = station.incoming.partition_point(|(when, _)| *when <= time);
        for (when, bytes) in station.incoming.drain(..arrived).collect::<Vec<_>>() {
            let now = station.clock(when);
            let Ok(Some(Incoming { number, since, position, .. })) = station.session.receive(&bytes, now) else {
                continue;
            };
            station.received = Some(number);
            if let Some(since) = since {
                dated += 1;
                let sampled = position * SECONDS;
                // The position of a frame is rounded.
                let clock = station.clock((sampled + 0.5 * SECONDS / f64::from(1 << 22)) as u64);
                assert!(since <= clock, "{seed}: sampled at {sampled}, dated {since} at {now}");
            }
        }
        let outgoing = say(station.clock(time), time as f64 / SECONDS, station.received);
        let bytes = station.session.send(&outgoing).unwrap().as_ref().to_vec();
        station.next += station.period;
        seen.push((1 - at, bytes.clone()));
        if random() % 100 >= loss {
            let mut bytes = bytes;
            if random() % 16 == 0 {
                let bit = random() as usize % (8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            stations[1 - at].incoming.push((time + random() % (longest + 1), bytes));
        }
        for _ in 0..replays {
            let (to, bytes) = seen[random() as usize % seen.len()].clone();
            // To its receiver, or back to its sender.
            let to = if random() % 8 == 0 { 1 - to } else { to };
            stations[to].incoming.push((time + random() % (longest + 1), bytes));
        }
        if random() % 700 == 0 {
            let again = random() as usize % 2;
            let next = stations[again].next + random() % (4 * SILENCE);
            let incoming = std::mem::take(&mut stations[again].incoming);
            let Station { offset, rate, period, .. } = stations[again];
            stations[again] =
                Station { next, offset, rate, period, incoming, ..Station::new(codec(link, again == 0), &mut random) };
        }
    }
    dated
}

#[test]
fn a_position_is_never_older_than_its_bound() {
    let (mut state, mut sums) = (1, [0, 0]);
    for seed in hapt_testing::seeds(256) {
        let [loss, longest, replays] = [101, 200 * MS, 3].map(|most| random(&mut state) % most);
        let adversary = Adversary { loss, longest, replays };
        sums[0] += dated(datagrams, seed, &adversary);
        sums[1] += dated(frames, seed, &adversary);
    }
    // There are many messages with a bounded age, of both codecs.
    assert!(sums.iter().all(|sum| *sum > 2000), "{sums:?}");
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    // A message with one changed bit is refused.
    #[test]
    fn every_bit_of_a_message_is_checked(seed in any::<u64>(), bit in 0..8 * SIZE) {
        let (mut left, mut right) = (end(seed, true, 1), end(seed, false, 2));
        let mut bytes = left.send(&say(0, 0.25, None)).unwrap();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let refusal = right.receive(&bytes, 0).unwrap_err();
        let right = if bit < 8 { matches!(refusal, Refusal::Version(version) if version != VERSION) } else { refusal == Refusal::Key };
        prop_assert!(right, "{refusal:?}");
    }

    #[test]
    fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..2 * SIZE), key in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut session = Session::new(Datagrams::new(&key, 3, false), 4);
        prop_assert!(session.receive(&bytes, 0).is_err());
    }

    #[test]
    fn messages_on_time_are_dated_by_the_round_trip(travel_time in 0_u64..30 * MS, period in MS..5 * MS, offset in 0_u64..1 << 60) {
        is_dated_by_the_round_trip(datagrams, travel_time, period, offset);
        is_dated_by_the_round_trip(frames, travel_time, period, offset);
    }
}

/// Without loss every message after the handshake is dated, by at most the round-trip time and a sample's wait.
fn is_dated_by_the_round_trip<C: Codec>(codec: fn(u64, bool) -> C, travel_time: u64, period: u64, offset: u64) {
    let mut left = Session::new(codec(1, true), 10);
    let mut right = Session::new(codec(1, false), 20);
    let mut received = [None; 2];
    let mut wires: [Vec<(u64, C::Bytes)>; 2] = [vec![], vec![]];
    for sample in 0..400 {
        let time = sample * period;
        for (at, session) in [&mut left, &mut right].into_iter().enumerate() {
            let clock = if at == 0 { time } else { time + offset };
            let arrived = wires[at].partition_point(|(when, _)| *when <= time);
            for (when, bytes) in wires[at].drain(..arrived) {
                let incoming = session.receive(bytes.as_ref(), clock - (time - when)).unwrap();
                received[at] = incoming.map(|incoming| incoming.number).or(received[at]);
                // The handshake takes one round trip, an introduction another one, and messages in flight at most twice as long again.
                if time > 6 * (travel_time + period) {
                    let since = incoming.unwrap().since.unwrap();
                    assert!(
                        clock - since <= 2 * travel_time + 4 * period,
                        "{} at {travel_time}, {period}",
                        clock - since
                    );
                }
            }
            let bytes = session.send(&say(clock, 0.0, received[at])).unwrap();
            wires[1 - at].push((time + travel_time, bytes));
        }
    }
}

#[test]
fn each_foreign_message_is_refused_by_name() {
    let hello = |key: &[u8], link, first, own| {
        Session::new(Datagrams::new(key, link, first), own).send(&say(5, 1.0, None)).unwrap()
    };
    let mut left = end(1, true, 10);
    let mut refused = |bytes: &[u8]| left.receive(bytes, 0).unwrap_err();
    assert_eq!(refused(&hello(b"another key, as long as it", 1, false, 20)), Refusal::Key);
    assert_eq!(refused(&hello(KEY, 2, false, 20)), Refusal::Link);
    assert_eq!(refused(&hello(KEY, 1, true, 20)), Refusal::SameEnd);
    assert_eq!(refused(&hello(KEY, 1, false, 10)), Refusal::SameEnd);
    let nan = end(1, false, 20).send(&say(0, f64::NAN, None)).unwrap();
    assert_eq!(refused(&nan), Refusal::Content);
    let mut older = hello(KEY, 1, false, 20);
    older[0] = VERSION + 1;
    assert_eq!(refused(&older), Refusal::Version(VERSION + 1));
    assert_eq!(refused(&older[1..]), Refusal::Size);
    for (place, refusal) in Refusal::ALL.into_iter().enumerate() {
        assert_eq!(refusal.code(), place);
    }
    assert!(KEY.len() >= SHORTEST_KEY);
}

/// The handshake: each acknowledges the other's session.
fn meet<C: Codec>(left: &mut Session<C>, right: &mut Session<C>, now: u64) -> [Option<Number>; 2] {
    let mut received = [None; 2];
    for _ in 0..3 {
        let bytes = left.send(&say(now, 0.0, received[0])).unwrap();
        received[1] = right.receive(bytes.as_ref(), now).ok().flatten().map(|incoming| incoming.number).or(received[1]);
        let bytes = right.send(&say(now, 0.0, received[1])).unwrap();
        received[0] = left.receive(bytes.as_ref(), now).ok().flatten().map(|incoming| incoming.number).or(received[0]);
    }
    received
}

#[test]
fn a_second_sender_waits_until_the_first_is_silent() {
    let (mut left, mut right) = (end(1, true, 10), end(1, false, 20));
    let received = meet(&mut left, &mut right, 0);
    assert!(received.iter().all(Option::is_some));
    let mut again = end(1, false, 21);
    let hello = |again: &mut Session<Datagrams>| again.send(&say(0, 0.0, None)).unwrap();
    assert_eq!(left.receive(&hello(&mut again), SILENCE - 1), Err(Refusal::Session));
    // The first sender continues: nothing changes.
    let bytes = right.send(&say(0, 0.0, received[1])).unwrap();
    assert!(left.receive(&bytes, SILENCE - 1).unwrap().unwrap().since.is_some());
    assert_eq!(left.receive(&hello(&mut again), 2 * SILENCE - 2), Err(Refusal::Session));
    // The first sender is silent: the restarted station replaces it, and the first is now the second sender.
    assert_eq!(left.receive(&hello(&mut again), 2 * SILENCE).unwrap().unwrap().since, None);
    assert!(meet(&mut left, &mut again, 2 * SILENCE).iter().all(Option::is_some));
    assert_eq!(left.receive(&right.send(&say(0, 0.0, None)).unwrap(), 2 * SILENCE), Err(Refusal::Session));
}

#[test]
fn a_replayed_hello_does_not_block_a_peer() {
    let (mut left, mut dead) = (end(1, true, 10), end(1, false, 19));
    let replayed = dead.send(&say(0, 0.0, None)).unwrap();
    assert_eq!(left.receive(&replayed, 0).unwrap().unwrap().since, None);
    let mut right = end(1, false, 20);
    for now in 1..10 {
        let _ = left.receive(&replayed, now);
        meet(&mut left, &mut right, now);
    }
    let received = meet(&mut left, &mut right, 10);
    let bytes = right.send(&say(0, 0.5, received[1])).unwrap();
    assert_eq!(left.receive(&bytes, 11).unwrap().unwrap().since, Some(10));
}

#[test]
fn an_answer_to_a_message_too_long_ago_has_no_age() {
    let (mut left, mut right) = (end(1, true, 10), end(1, false, 20));
    let received = meet(&mut left, &mut right, 0);
    let late = right.send(&say(0, 0.5, received[1])).unwrap();
    for _ in 0..2000 {
        left.send(&say(5, 0.0, None)).unwrap();
    }
    assert_eq!(left.receive(&late, 6).unwrap().unwrap().since, None);
}

proptest! {
    // The remote velocity is a displacement over the time that the numbers of its messages encode: (T64) assumes that the time is at most 9/8 of that.
    #[test]
    fn numbers_encode_the_time_between_samples(pace in 1_u64..5 * MS, waits in prop::collection::vec(0..20 * MS, 1..200)) {
        let mut session = Session::new(datagrams(1, true), 10).paced(pace);
        let (mut now, mut before) = (1000, None);
        for wait in waits {
            now += wait;
            session.send(&say(now, 0.0, None)).unwrap();
            let number = session.own().sequence;
            if let Some((then, last)) = before {
                let stated = (number - last) * pace;
                prop_assert!(number > last && 8 * (now - then) <= 9 * stated.max(pace) + 8, "{} of {stated}", now - then);
                prop_assert!(stated <= (now - then) + pace, "{stated} of {}", now - then);
            }
            before = Some((now, number));
        }
    }
}
