//! Lines that lose, duplicate, reorder, corrupt and cut frames never cause a torque.

use hapt_core::Phase;
use hapt_testing::prelude::*;
use hapt_wire::{Command, PROTOCOL, Parameter, hash};
use proptest::collection::vec;
use proptest::sample::Index;

use crate::common::{BOARD, Received, TestHost, WHEEL, packed, storage, world};

/// The effect of a bad line on a frame.
#[derive(Clone, Debug)]
enum Fate {
    Whole,
    Lost,
    Flipped(Index, u8),
    Cut(Index),
    /// With noise before it.
    Late(Vec<u8>),
}

fn fates() -> impl Strategy<Value = Fate> {
    prop_oneof![
        4 => Just(Fate::Whole),
        1 => Just(Fate::Lost),
        1 => (any::<Index>(), 1..=255_u8).prop_map(|(at, bits)| Fate::Flipped(at, bits)),
        1 => any::<Index>().prop_map(Fate::Cut),
        1 => vec(any::<u8>(), 0..40).prop_map(Fate::Late),
    ]
}

impl Fate {
    fn of(&self, frame: &[u8]) -> Vec<u8> {
        let mut frame = frame.to_vec();
        match self {
            Fate::Whole => frame,
            Fate::Lost => Vec::new(),
            Fate::Flipped(at, bits) => {
                let at = at.index(frame.len());
                frame[at] ^= bits;
                frame
            }
            // Losing only the last 0 loses no frame: the end of the next frame replaces it.
            Fate::Cut(at) => frame[..at.index(frame.len() - 1)].to_vec(),
            Fate::Late(noise) => [noise.clone(), vec![0], frame].concat(),
        }
    }
}

/// Any host message except to arm, chosen by these numbers.
fn harmless(choice: u8, number: u32) -> Command<'static> {
    match choice % 8 {
        0 => Command::Heartbeat,
        1 => Command::Disarm,
        2 => Command::Clear,
        3 => Command::Commit,
        4 => Command::Begin { length: number as u16, hash: number },
        5 => Command::Piece { at: number as u16, bytes: b"a piece of something" },
        6 => Command::Set { parameter: Parameter::Divider as u8, value: number % 4 },
        _ => Command::Hello { protocol: PROTOCOL },
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(400))]

    /// The puck turns, a world is loaded, and only the command to arm is missing.
    #[test]
    fn nothing_but_arm_makes_a_torque(
        spoken in vec((any::<u8>(), any::<u32>(), fates(), vec(any::<u8>(), 0..60)), 1..40),
    ) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        host.load(&packed(&world(WHEEL, &[]))).unwrap();
        for (choice, number, fate, noise) in spoken {
            let frame = host.framed(harmless(choice, number));
            host.put(&fate.of(&frame));
            host.put(&noise);
            for _ in 0..3 {
                host.seen.position += 3e-3;
                prop_assert_eq!(host.sample(), Default::default());
            }
        }
        host.put(&[0]);
        prop_assert_ne!(host.state().0, Phase::Running);
    }

    /// A session that arms and disarms, its frames in any order, any number of times, in any state.
    #[test]
    fn an_arm_counts_at_most_once_and_never_after_a_later_command(
        delivered in vec((0..9_usize, fates(), 0..30_u8), 1..60),
    ) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        let bytes = packed(&world(WHEEL, &[]));
        let world = host.load(&bytes).unwrap();
        let commands = [
            Command::Heartbeat,
            Command::Arm { world },
            Command::Heartbeat,
            Command::Set { parameter: Parameter::Divider as u8, value: 3 },
            Command::Disarm,
            Command::Begin { length: bytes.len() as u16, hash: hash(&bytes) },
            Command::Heartbeat,
            Command::Stop,
            Command::Hello { protocol: PROTOCOL },
        ];
        let first = host.sequence + 1;
        let frames: Vec<Vec<u8>> = commands.iter().map(|command| host.framed(*command)).collect();
        let (arm, stop) = (1, 7);
        // Whether an arm arrived complete; whether a later command, or a stop, arrived before it.
        let (mut sent, mut over, mut rises, mut was_on) = (false, false, 0, false);
        for (which, fate, samples) in delivered {
            host.received.clear();
            // An earlier cut frame may have started this one.
            host.put(&[0]);
            host.put(&fate.of(&frames[which]));
            let whole = matches!(fate, Fate::Whole | Fate::Late(_));
            sent |= whole && which == arm && !over;
            over |= whole && which > arm && which != 8;
            let stopped = whole && which == stop;
            for _ in 0..samples.max(1) {
                host.seen.position += 1e-4;
                let motor = host.sample();
                prop_assert!(motor.on || motor.torque == 0.0);
                prop_assert!(!motor.on || sent, "not armed");
                prop_assert!(!(motor.on && stopped), "it was stopped");
                rises += u32::from(motor.on && !was_on);
                was_on = motor.on;
            }
        }
        prop_assert!(rises <= 1, "armed {} times by one word of sequence {}", rises, first + 1);
    }

    /// A session that arms, stops and clears over a bad line, with a driver fault: from then on there is no torque before a clear and then
    /// an arm have arrived whole.
    #[test]
    fn a_drivers_fault_ends_the_torque_until_a_clear_and_an_arm(
        delivered in vec((0..6_u8, fates(), 1..40_u8, prop::bool::weighted(0.1)), 1..80),
    ) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        let world = host.load(&packed(&world(WHEEL, &[]))).unwrap();
        let (mut cleared, mut armed) = (true, false);
        for (which, fate, samples, fault) in delivered {
            let command = match which {
                0 | 1 => Command::Arm { world },
                2 => Command::Clear,
                3 => Command::Disarm,
                4 => Command::Hello { protocol: PROTOCOL },
                _ => Command::Heartbeat,
            };
            let frame = host.framed(command);
            host.put(&[0]);
            host.put(&fate.of(&frame));
            let whole = matches!(fate, Fate::Whole | Fate::Late(_));
            host.seen.fault = fault;
            if fault {
                (cleared, armed) = (false, false);
            } else {
                cleared |= whole && which == 2;
                armed |= whole && which < 2 && cleared;
            }
            for _ in 0..samples {
                host.seen.position += 1e-4;
                let motor = host.sample();
                prop_assert!(!motor.on && motor.torque == 0.0 || armed, "{which} {fate:?}");
                prop_assert!(!(motor.on && host.seen.fault), "in the sample of the fault");
                host.seen.fault = false;
            }
        }
    }

    #[test]
    fn after_any_noise_and_a_zero_the_next_command_is_done(noise in vec(any::<u8>(), 0..600)) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        host.put(&noise);
        host.put(&[0]);
        host.received.clear();
        host.heartbeat();
        prop_assert_eq!(&host.received, &[Received::Done(host.sequence)]);
    }

    /// Lost, doubled and corrupted pieces: either the uploaded world runs, or the previous one.
    #[test]
    fn a_world_over_a_bad_line_is_the_one_that_was_sent_or_none(
        fates in vec(fates(), 12), twice in vec(any::<bool>(), 12),
    ) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        let before = host.load(&packed(&world(WHEEL, &[]))).unwrap();
        let bytes = packed(&world(WHEEL, &["couplings.0.stiffness=3"]));
        let mut commands = vec![Command::Begin { length: bytes.len() as u16, hash: hash(&bytes) }];
        commands.extend(bytes.chunks(60).enumerate().map(|(i, bytes)| Command::Piece { at: 60 * i as u16, bytes }));
        commands.push(Command::Commit);
        let mut all_well = true;
        for ((command, fate), twice) in commands.iter().zip(&fates).zip(twice) {
            let frame = host.framed(*command);
            all_well &= matches!(fate, Fate::Whole | Fate::Late(_));
            for _ in 0..=u8::from(twice) {
                host.put(&[0]);
                host.put(&fate.of(&frame));
            }
        }
        host.put(&[0]);
        let (phase, runs) = host.state();
        prop_assert_eq!(phase, Phase::Disarmed);
        prop_assert_eq!(runs, Some(if all_well { hash(&bytes) } else { before }));
    }

    /// A command is valid up to its last sample and not after it.
    #[test]
    fn a_command_is_refused_exactly_when_its_sample_is_over(within in 0..200_u64, comes in 0..200_u64) {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        let world = host.load(&packed(&world(WHEEL, &[]))).unwrap();
        let not_after = host.endpoint.next() + within;
        let arm = host.framed_as(host.sequence + 1, not_after, Command::Arm { world });
        for _ in 0..comes {
            host.sample();
        }
        host.put(&arm);
        prop_assert_eq!(host.sample().on, comes <= within);
    }
}
