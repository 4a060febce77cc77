//! The messages of a link on a network that loses, delays, reorders, repeats, forges and remembers.

use hapt_core::Strength;
use hapt_wire::link::{Incoming, Number, Outgoing, Refusal, SHORTEST_KEY, SILENCE, SIZE, Session, VERSION};
use proptest::prelude::*;

const KEY: &[u8] = b"both stations know this one";
const MS: u64 = 1_000_000;

fn say(sampled: u64, position: f64, heard: Option<Number>) -> Outgoing {
    Outgoing { sampled, position, strength: Strength::NONE, heard }
}

/// Splitmix64.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A station with a clock of its own, which knows no other's.
struct Station {
    session: Session,
    period: u64,
    next: u64,
    /// Its clock shows `offset` + `rate` t at the true time t.
    offset: u64,
    rate: f64,
    heard: Option<Number>,
    /// What arrives for it: when, and the bytes.
    coming: Vec<(u64, Vec<u8>)>,
}

impl Station {
    fn new(first: bool, link: u64, random: &mut impl FnMut() -> u64) -> Self {
        Station {
            session: Session::new(KEY, link, first, random()),
            period: MS / 4 + random() % (8 * MS),
            next: random() % (8 * MS),
            offset: random() % (1 << 50),
            rate: 0.9 + 0.2 * (random() % 1000) as f64 / 1000.0,
            heard: None,
            coming: Vec::new(),
        }
    }

    fn clock(&self, time: u64) -> u64 {
        self.offset + (self.rate * time as f64) as u64
    }
}

proptest! {
    // No position is younger than it looks, whatever happens to the messages: its bound, by the receiver's clock, is never after its sample.
    #[test]
    fn a_position_is_never_older_than_its_bound(seed in any::<u64>(), loss in 0_u64..101, longest in 0_u64..200 * MS, replays in 0_u64..3) {
        let mut state = seed;
        let mut random = || random(&mut state);
        let link = random();
        let mut stations = [Station::new(true, link, &mut random), Station::new(false, link, &mut random)];
        // Each message that was ever sent, and for which station; the position is its true time.
        let mut seen: Vec<(usize, Vec<u8>)> = Vec::new();
        for _ in 0..1500 {
            let at = usize::from(stations[0].next > stations[1].next);
            let time = stations[at].next;
            let station = &mut stations[at];
            station.coming.sort_by_key(|(when, _)| *when);
            let arrived = station.coming.partition_point(|(when, _)| *when <= time);
            for (when, bytes) in station.coming.drain(..arrived).collect::<Vec<_>>() {
                let now = station.clock(when);
                let Ok(Incoming { number, since, position, .. }) = station.session.receive(&bytes, now) else { continue };
                station.heard = Some(number);
                if let Some(since) = since {
                    prop_assert!(since <= station.clock(position as u64), "sampled at {position}, dated {since} at {now}");
                }
            }
            let outgoing = say(station.clock(time), time as f64, station.heard);
            let bytes = station.session.send(&outgoing).unwrap().to_vec();
            station.next += station.period;
            let other = &mut stations[1 - at];
            seen.push((1 - at, bytes.clone()));
            if random() % 100 >= loss {
                let mut bytes = bytes;
                if random().is_multiple_of(16) {
                    let bit = random() as usize % (8 * SIZE);
                    bytes[bit / 8] ^= 1 << (bit % 8);
                }
                other.coming.push((time + random() % (longest + 1), bytes));
            }
            for _ in 0..replays {
                let (to, bytes) = seen[random() as usize % seen.len()].clone();
                // To the station it was sent to, or back to its sender.
                let to = if random().is_multiple_of(8) { 1 - to } else { to };
                stations[to].coming.push((time + random() % (longest + 1), bytes));
            }
            if random().is_multiple_of(700) {
                let again = random() as usize % 2;
                let next = stations[again].next + random() % (4 * SILENCE);
                let coming = std::mem::take(&mut stations[again].coming);
                let Station { offset, rate, period, .. } = stations[again];
                let first = again == 0;
                stations[again] = Station { next, offset, rate, period, coming, ..Station::new(first, link, &mut random) };
            }
        }
    }

    // Nothing that differs from a message in a single bit is one.
    #[test]
    fn no_bit_of_a_message_is_free(seed in any::<u64>(), bit in 0..8 * SIZE) {
        let (mut left, mut right) = (Session::new(KEY, seed, true, 1), Session::new(KEY, seed, false, 2));
        let mut bytes = left.send(&say(0, 0.25, None)).unwrap();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let refusal = right.receive(&bytes, 0).unwrap_err();
        let right = if bit < 8 { matches!(refusal, Refusal::Version(version) if version != VERSION) } else { refusal == Refusal::Key };
        prop_assert!(right, "{refusal:?}");
    }

    #[test]
    fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..2 * SIZE), key in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut session = Session::new(&key, 3, false, 4);
        prop_assert!(session.receive(&bytes, 0).is_err());
    }

    // Without loss every message after the handshake is dated, by no more than the time there and back and a sample's wait.
    #[test]
    fn what_is_on_time_is_dated_by_the_round_trip(way in 0_u64..30 * MS, period in MS..5 * MS, offset in 0_u64..1 << 60) {
        let (mut left, mut right) = (Session::new(KEY, 1, true, 10), Session::new(KEY, 1, false, 20));
        let mut heard = [None; 2];
        let mut wires: [Vec<(u64, [u8; SIZE])>; 2] = [vec![], vec![]];
        for sample in 0..400 {
            let time = sample * period;
            for (at, session) in [&mut left, &mut right].into_iter().enumerate() {
                let clock = if at == 0 { time } else { time + offset };
                let arrived = wires[at].partition_point(|(when, _)| *when <= time);
                for (when, bytes) in wires[at].drain(..arrived) {
                    let incoming = session.receive(&bytes, clock - (time - when)).unwrap();
                    heard[at] = Some(incoming.number);
                    // The handshake takes a way there and back, and what is on its way at most twice as long again.
                    if time > 4 * way + 4 * period {
                        let since = incoming.since.unwrap();
                        prop_assert!(clock - since <= 2 * way + 4 * period, "{} at {way}, {period}", clock - since);
                    }
                }
                let bytes = session.send(&say(clock, 0.0, heard[at])).unwrap();
                wires[1 - at].push((time + way, bytes));
            }
        }
    }
}

#[test]
fn each_stranger_is_told_by_name() {
    let hello = |key: &[u8], link, first, own| Session::new(key, link, first, own).send(&say(5, 1.0, None)).unwrap();
    let mut left = Session::new(KEY, 1, true, 10);
    let mut refused = |bytes: &[u8]| left.receive(bytes, 0).unwrap_err();
    assert_eq!(refused(&hello(b"another key, as long as it", 1, false, 20)), Refusal::Key);
    assert_eq!(refused(&hello(KEY, 2, false, 20)), Refusal::Link);
    assert_eq!(refused(&hello(KEY, 1, true, 20)), Refusal::SameEnd);
    assert_eq!(refused(&hello(KEY, 1, false, 10)), Refusal::SameEnd);
    let nan = Session::new(KEY, 1, false, 20).send(&say(0, f64::NAN, None)).unwrap();
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

/// The handshake: both name each other's session.
fn meet(left: &mut Session, right: &mut Session, now: u64) -> [Option<Number>; 2] {
    let mut heard = [None; 2];
    for _ in 0..3 {
        let bytes = left.send(&say(now, 0.0, heard[0])).unwrap();
        heard[1] = right.receive(&bytes, now).ok().map(|incoming| incoming.number).or(heard[1]);
        let bytes = right.send(&say(now, 0.0, heard[1])).unwrap();
        heard[0] = left.receive(&bytes, now).ok().map(|incoming| incoming.number).or(heard[0]);
    }
    heard
}

#[test]
fn a_second_sender_waits_until_the_first_is_silent() {
    let (mut left, mut right) = (Session::new(KEY, 1, true, 10), Session::new(KEY, 1, false, 20));
    let heard = meet(&mut left, &mut right, 0);
    assert!(heard.iter().all(Option::is_some));
    let mut again = Session::new(KEY, 1, false, 21);
    let hello = |again: &mut Session| again.send(&say(0, 0.0, None)).unwrap();
    assert_eq!(left.receive(&hello(&mut again), SILENCE - 1), Err(Refusal::Session));
    // The first goes on: nothing changes.
    let bytes = right.send(&say(0, 0.0, heard[1])).unwrap();
    assert!(left.receive(&bytes, SILENCE - 1).unwrap().since.is_some());
    assert_eq!(left.receive(&hello(&mut again), 2 * SILENCE - 2), Err(Refusal::Session));
    // It is silent: whoever was started anew takes its place, and the first is the second sender now.
    assert_eq!(left.receive(&hello(&mut again), 2 * SILENCE).unwrap().since, None);
    assert!(meet(&mut left, &mut again, 2 * SILENCE).iter().all(Option::is_some));
    assert_eq!(left.receive(&right.send(&say(0, 0.0, None)).unwrap(), 2 * SILENCE), Err(Refusal::Session));
}

#[test]
fn a_replayed_hello_holds_up_nobody() {
    let (mut left, mut dead) = (Session::new(KEY, 1, true, 10), Session::new(KEY, 1, false, 19));
    let replayed = dead.send(&say(0, 0.0, None)).unwrap();
    assert_eq!(left.receive(&replayed, 0).unwrap().since, None);
    let mut right = Session::new(KEY, 1, false, 20);
    for now in 1..10 {
        let _ = left.receive(&replayed, now);
        meet(&mut left, &mut right, now);
    }
    let heard = meet(&mut left, &mut right, 10);
    let bytes = right.send(&say(0, 0.5, heard[1])).unwrap();
    assert_eq!(left.receive(&bytes, 11).unwrap().since, Some(10));
}

#[test]
fn what_answers_a_message_too_long_ago_has_no_age() {
    let (mut left, mut right) = (Session::new(KEY, 1, true, 10), Session::new(KEY, 1, false, 20));
    let heard = meet(&mut left, &mut right, 0);
    let late = right.send(&say(0, 0.5, heard[1])).unwrap();
    for _ in 0..2000 {
        left.send(&say(5, 0.0, None)).unwrap();
    }
    assert_eq!(left.receive(&late, 6).unwrap().since, None);
}
