//! The frames of a link on a CAN bus: numbers of 8 bits, introduced sessions, and foreign frames.

use hapt_core::Strength;
use hapt_testing::prelude::*;
use hapt_wire::link::{Codec, Frames, Incoming, Known, Message, Number, Outgoing, Refusal, SILENCE, Session};

use crate::link::random;

const MS: u64 = 1_000_000;
/// The rounding error of a position: half a step.
const ROUNDED: f64 = 0.5 / (1 << 22) as f64;

type End = Session<Frames>;

fn end(at: usize, link: u64, first: bool, own: u64) -> End {
    Session::new(Frames::new(Frames::RANGE, at, link, first).unwrap(), own)
}

fn pair() -> [End; 2] {
    [end(0, 1, true, 10), end(0, 1, false, 20)]
}

/// Two stations that send every ms, without loss and delay.
struct Bus {
    ends: [End; 2],
    received: [Option<Number>; 2],
    now: u64,
}

impl Bus {
    /// Two stations after their handshake.
    fn met() -> Self {
        let mut bus = Bus { ends: pair(), received: [None; 2], now: 0 };
        for _ in 0..4 {
            bus.turn();
        }
        let received = bus.turn();
        assert!(
            received.iter().all(|received| received.is_some_and(|received| received.since.is_some())),
            "{received:?}"
        );
        bus
    }

    fn send(&mut self, at: usize) -> [u8; 12] {
        let say = Outgoing {
            sampled: self.now,
            position: self.now as f64 * 1e-9,
            strength: Strength::WHOLE,
            received: self.received[at],
        };
        self.ends[at].send(&say).unwrap()
    }

    fn receive(&mut self, at: usize, bytes: &[u8]) -> Option<Incoming> {
        let incoming = self.ends[at].receive(bytes, self.now).ok().flatten();
        self.received[at] = incoming.map(|incoming| incoming.number).or(self.received[at]);
        incoming
    }

    /// Each sends, and receives the other's message.
    fn turn(&mut self) -> [Option<Incoming>; 2] {
        self.now += MS;
        [0, 1].map(|at| {
            let bytes = self.send(1 - at);
            self.receive(at, &bytes)
        })
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(1000))]

    // The omitted bits of the numbers are restored, as long as the numbers are within the bounds that sessions keep.
    #[test]
    fn a_frame_reads_back_as_it_was_written(
        link in any::<u64>(), sessions in (1_u64..1 << 28, 1_u64..1 << 28), newest in 0_u64..1 << 40, step in -128_i64..128,
        answered in 0_u64..1 << 40, (echo, sent) in (0_u64..128).prop_flat_map(|sent| (0..=sent, Just(sent))),
        steps in any::<i32>(), strength in any::<u8>(), at in 0..Frames::LINKS, range in 1_u16..512,
    ) {
        let [left, right] = [true, false].map(|first| Frames::new(range, at, link, first).unwrap());
        let sequence = newest.saturating_add_signed(step).max(1);
        let message = Message {
            from: Number { session: sessions.0, sequence },
            to: Number { session: sessions.1, sequence: answered + echo },
            position: f64::from(steps) / f64::from(1 << 22),
            strength: Strength(strength),
        };
        let known = Known {
            own: Number { sequence: answered + sent, ..message.to },
            answered,
            other: Number { sequence: newest, ..message.from },
        };
        prop_assume!(steps > i32::MIN);
        let bytes = left.write(&message).unwrap();
        let [mask, bits] = Frames::filter(range);
        let id = u32::from_le_bytes(bytes[..4].try_into().unwrap());
        prop_assert!(id >> 29 == 0 && id & bits == mask && left.is_of_link(id));
        let read = right.read(&bytes, &known);
        prop_assert_eq!(read, if sequence > newest { Ok(message) } else { Err(Refusal::Old) });
        prop_assert_eq!(left.read(&bytes, &known), Err(Refusal::SameEnd));
        // In another session it is refused.
        let other = Known { own: Number { session: sessions.1 ^ 1, ..known.own }, ..known };
        prop_assert_eq!(right.read(&bytes, &other), Err(Refusal::Old));
    }

    #[test]
    fn an_introduction_reads_back_and_is_of_one_network_only(
        link in any::<u64>(), from in 1_u64..1 << 28, to in 0_u64..1 << 28, known_other in any::<bool>(),
    ) {
        let [left, right] = [true, false].map(|first| Frames::new(7, 3, link, first).unwrap());
        let [from, to] = [from, to].map(|session| Number { session, sequence: 0 });
        let message = Message { from, to, position: 0.0, strength: Strength::NONE };
        let other = Number { session: u64::from(known_other) * from.session, sequence: 300 };
        let known = Known { own: Number { session: 5, sequence: 9 }, answered: 3, other };
        let bytes = left.write(&message).unwrap();
        prop_assert_eq!(right.read(&bytes, &known), Ok(message));
        let stranger = Frames::new(7, 3, link ^ 1, false).unwrap();
        prop_assert_eq!(stranger.read(&bytes, &known), Err(Refusal::Link));
        let elsewhere = Frames::new(7, 4, link, false).unwrap();
        prop_assert_eq!(elsewhere.read(&bytes, &known), Err(Refusal::Link));
    }

    #[test]
    fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..24)) {
        let mut session = end(0, 3, false, 4);
        prop_assert!(session.receive(&bytes, 0).is_err());
    }

    #[test]
    fn a_position_is_rounded_to_a_quarter_of_a_millionth_and_refused_out_of_range(position in -600.0..600.0) {
        let mut bus = Bus::met();
        let say = Outgoing { sampled: bus.now, position, strength: Strength::NONE, received: bus.received[0] };
        match bus.ends[0].send(&say) {
            Some(bytes) => {
                let received = bus.receive(1, &bytes).unwrap();
                prop_assert!((received.position - position).abs() <= ROUNDED, "{position}: {}", received.position);
            }
            None => prop_assert!(position.abs() > 511.9, "{position}"),
        }
    }
}

#[test]
fn a_position_that_cannot_be_encoded_is_not_sent() {
    for position in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let mut bus = Bus::met();
        let say = Outgoing { sampled: bus.now, position, strength: Strength::WHOLE, received: bus.received[0] };
        assert_eq!(bus.ends[0].send(&say), None, "{position}");
    }
}

#[test]
fn identifiers_have_a_range_and_links_a_number() {
    for (range, at) in [(0, 0), (512, 0), (1, Frames::LINKS)] {
        assert!(Frames::new(range, at, 1, true).is_none(), "{range} {at}");
    }
    // The lowest identifier is above those of moteus drives, of 16 bits.
    let [lowest, _] = Frames::filter(*Frames::RANGES.start());
    assert!(lowest > 0xffff);
}

/// A frame that is delayed for any number of turns, with or without the following ones, is refused or has its true age.
#[test]
fn a_frame_of_an_older_turn_is_never_taken_for_a_new_one() {
    for held in (0..4).chain(125..131).chain(253..259).chain([300, 511, 512, 513]) {
        let mut bus = Bus::met();
        bus.now += MS;
        let late = bus.send(1);
        for _ in 0..held {
            bus.turn();
        }
        assert_eq!(bus.receive(0, &late).is_some(), held == 0, "{held}");
    }
    for silent in [1, 100, 126, 127, 128, 200, 255, 256, 257, 512, 1000] {
        let mut bus = Bus::met();
        bus.now += MS;
        let late: Vec<_> = [(); 3].map(|()| bus.send(1)).into();
        let sampled = bus.now;
        for _ in 0..silent {
            bus.now += MS;
            bus.send(0);
        }
        for bytes in late {
            let taken = bus.receive(0, &bytes);
            // 127 may be unanswered. In the same session it has its true age; in another it is refused.
            assert_eq!(taken.is_some(), silent <= 126, "{silent}");
            assert!(taken.and_then(|taken| taken.since).is_none_or(|since| since < sampled), "{silent}");
        }
        // The pair reconnects.
        assert!(
            (0..8).any(|_| bus.turn().iter().all(|received| received.is_some_and(|received| received.since.is_some()))),
            "{silent}"
        );
    }
}

#[test]
fn a_flood_of_repeated_and_random_frames_does_not_block_the_link() {
    let mut state = 3;
    let mut bus = Bus::met();
    let mut seen: Vec<[u8; 12]> = Vec::new();
    for _ in 0..2000 {
        for at in [0, 1] {
            for _ in 0..5 {
                let mut bytes = [random(&mut state), random(&mut state)].map(u64::to_le_bytes).concat();
                bytes.truncate(12);
                // Of this link, from either end.
                (bytes[1], bytes[2], bytes[3]) = (bytes[1] & 0x7f, 0, 0x10);
                assert!(bus.ends[at].receive(&bytes, bus.now).is_err());
                if let Some(bytes) = seen.get(random(&mut state) as usize % seen.len().max(1)) {
                    assert!(bus.ends[at].receive(bytes, bus.now).is_err());
                }
            }
        }
        bus.now += MS;
        for at in [0, 1] {
            let bytes = bus.send(1 - at);
            seen.push(bytes);
            let received = bus.receive(at, &bytes).unwrap();
            assert!(bus.now - received.since.unwrap() <= 2 * MS);
        }
    }
}

#[test]
fn a_restarted_station_reconnects_and_a_second_one_is_refused() {
    let mut bus = Bus::met();
    // A second program as the same station introduces itself, and is refused.
    let mut second = end(0, 1, false, 1 << 20);
    let hello = |session: &mut End| {
        session.send(&Outgoing { sampled: 0, position: 0.0, strength: Strength::NONE, received: None }).unwrap()
    };
    for _ in 0..300 {
        let bytes = hello(&mut second);
        assert_eq!(bus.ends[0].receive(&bytes, bus.now), Err(Refusal::Session));
        assert!(bus.turn().iter().all(Option::is_some));
    }
    // The first has ended. Unanswered messages end the session, and the second one connects.
    bus.ends[1] = second;
    bus.received[1] = None;
    let met = (0..200)
        .position(|_| bus.turn().iter().all(|received| received.is_some_and(|received| received.since.is_some())));
    assert!(met.is_some_and(|turns| turns as u64 * MS < SILENCE), "{met:?}");
    // Of the other end, or of a network with other numbers.
    let bytes = hello(&mut end(0, 1, true, 30));
    assert_eq!(bus.ends[0].receive(&bytes, bus.now), Err(Refusal::SameEnd));
    let bytes = hello(&mut end(0, 2, false, 30));
    assert_eq!(bus.ends[0].receive(&bytes, bus.now), Err(Refusal::Link));
}
