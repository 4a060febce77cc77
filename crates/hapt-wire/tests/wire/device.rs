//! What a board does with what a host says.

use hapt_core::{Controller, Phase, Reading, Reason, Request, SafetyProfile};
use hapt_plant::{Grip, VirtualDevice};
use hapt_wire::device::{Measurement, Slot};
use hapt_wire::{Order, PROTOCOL, Parameter, ROOM, Refusal, Telemetry, hash};

use crate::common::{BOARD, FED, Heard, Table, WHEEL, packed, slots, world};

#[test]
fn a_loaded_world_gives_the_torques_of_the_core_itself_bit_for_bit() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let world = world(WHEEL, &[]);
    let hash = table.load(&packed(&world)).unwrap();
    assert_eq!(table.state(), (Phase::Disarmed, Some(hash)));

    let spec = world.spec();
    let limits = world.limits(SafetyProfile::Certified);
    let core = Controller::<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>::new(&spec, &limits).unwrap();
    let mut state = core.start();

    let mut device = VirtualDevice::new(&world.device_spec());
    device.hold(Some(Grip { inertia: 1e-4, damping: 0.02, stiffness: 3.0 }));
    table.send(Order::Arm { world: hash });
    let mut largest = 0.0_f32;
    for k in 0..3000_u32 {
        if k % 20 == 0 {
            device.intend(0.4 * (f64::from(k) * 2e-3).sin());
            table.keep();
        }
        let (position, velocity) = device.puck();
        table.seen = Measurement { position: position as f32, velocity: velocity as f32, ..Measurement::default() };
        let motor = table.sample();
        let reading = Reading {
            position: position as f32,
            velocity: velocity as f32,
            announced: false,
            late: 0.0,
            missed: 0,
            // In ms, since the last that was said before it.
            silent: (k % 20) as f32 * core.period(),
        };
        let request = (k == 0).then_some(Request::Arm);
        let guarded = core.step(&mut state, &reading, request);
        assert_eq!(motor.torque.to_bits(), guarded.output.to_bits(), "at {k}");
        assert_eq!(motor.on, guarded.phase.is_active());
        largest = largest.max(motor.torque.abs());
        device.command(f64::from(motor.torque));
        device.travel();
    }
    assert_eq!(table.state(), (Phase::Running, Some(hash)));
    assert!(largest > 0.1, "{largest} N m");
}

#[test]
fn no_torque_without_a_world_and_none_before_it_is_armed() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    assert_eq!(table.ask(Order::Arm { world: 0 }), Err(Refusal::NoWorld));
    table.seen.position = 1.0;
    assert_eq!(table.sample(), Default::default());
    let hash = table.load(&packed(&world(WHEEL, &[]))).unwrap();
    assert_eq!(table.ask(Order::Arm { world: hash ^ 1 }), Err(Refusal::NoWorld));
    for _ in 0..100 {
        table.seen.position += 0.001;
        assert_eq!(table.sample(), Default::default());
    }
}

#[test]
fn a_world_that_is_no_good_is_refused_by_name_and_the_one_before_it_stays() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let good = world(WHEEL, &[]);
    let hash_of_it = table.load(&packed(&good)).unwrap();
    let bytes = packed(&world(WHEEL, &["couplings.0.stiffness=2"]));

    let spoilt = |spoil: &dyn Fn(&mut hapt_model::World)| {
        let mut world = good.clone();
        spoil(&mut world);
        packed(&world)
    };
    let five = spoilt(&|world| world.bodies = vec![world.bodies[0]; 5]);
    let long = spoilt(&|world| {
        world.sampling.estimator = hapt_model::EstimatorKind::Foaw;
        world.sampling.window = 17;
    });
    let endless = spoilt(&|world| world.device.limit = None);
    let exact = spoilt(&|world| world.sampling.estimator = hapt_model::EstimatorKind::Exact);
    let slow = spoilt(&|world| world.sampling.period = 0.02);
    let fast = spoilt(&|world| world.sampling.period = 1e-6);
    let wrong = spoilt(&|world| world.bodies[0].inertia = f64::NAN);
    let heavy = spoilt(&|world| world.device.inertia = -1.0);
    let version = [&[9], &bytes[1..]].concat();
    let inside = {
        // Whole as it was announced, and yet its own checksum does not hold.
        let mut inside = bytes.clone();
        *inside.last_mut().unwrap() ^= 1;
        inside
    };
    for (what, bytes, why) in [
        ("five bodies", five, Refusal::Room),
        ("a long window", long, Refusal::Room),
        ("no limit", endless, Refusal::NoLimit),
        ("the exact estimator", exact, Refusal::Exact),
        ("a period too long", slow, Refusal::Period),
        ("a period too short", fast, Refusal::Period),
        ("a body that is no number", wrong, Refusal::World),
        ("a device that is none", heavy, Refusal::World),
        ("another version", version, Refusal::Version),
        ("a byte that is another", inside, Refusal::Bytes),
    ] {
        assert_eq!(table.load(&bytes), Err(why), "{what}");
        assert_eq!(table.state(), (Phase::Disarmed, Some(hash_of_it)), "{what}");
    }

    // Half of it, and one byte of another hash.
    table.ask(Order::Begin { length: bytes.len() as u16, hash: hash(&bytes) }).unwrap();
    table.ask(Order::Piece { at: 0, bytes: &bytes[..100] }).unwrap();
    assert_eq!(table.ask(Order::Commit), Err(Refusal::Hash));
    assert_eq!(table.ask(Order::Piece { at: 99, bytes: &bytes[99..200] }), Err(Refusal::Piece));
    table.ask(Order::Begin { length: bytes.len() as u16, hash: 1 }).unwrap();
    for (i, piece) in bytes.chunks(200).enumerate() {
        table.ask(Order::Piece { at: 200 * i as u16, bytes: piece }).unwrap();
    }
    assert_eq!(table.ask(Order::Piece { at: bytes.len() as u16, bytes: &[0] }), Err(Refusal::Piece));
    assert_eq!(table.ask(Order::Commit), Err(Refusal::Hash));
    assert_eq!(table.ask(Order::Begin { length: 1025, hash: 1 }), Err(Refusal::Room));
    assert_eq!(table.ask(Order::Commit), Err(Refusal::Hash));
    assert_eq!(table.state(), (Phase::Disarmed, Some(hash_of_it)));
    table.ask(Order::Arm { world: hash_of_it }).unwrap();
}

#[test]
fn while_there_may_be_a_torque_the_world_stays_and_afterwards_it_is_another() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let hash = table.run(WHEEL);
    let other = packed(&world(WHEEL, &["couplings.0.stiffness=2", "loop.period=2ms"]));
    assert_eq!(table.load(&other), Err(Refusal::Armed));
    assert_eq!(table.state(), (Phase::Running, Some(hash)));
    table.ask(Order::Disarm).unwrap();
    for _ in 0..101 {
        table.sample();
    }
    let hash = table.load(&other).unwrap();
    assert_eq!(table.state(), (Phase::Disarmed, Some(hash)));
    assert_eq!(table.station.period(), 2e-3);
    // As often as one likes: the two slots go to and fro.
    for stiffness in 3..20 {
        let bytes = packed(&world(WHEEL, &[&format!("couplings.0.stiffness={}", 0.1 * f64::from(stiffness))]));
        let hash = table.load(&bytes).unwrap();
        assert_eq!(table.state().1, Some(hash));
    }
}

#[test]
fn a_command_counts_once_in_its_order_and_in_its_time() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let hash = table.load(&packed(&world(WHEEL, &[]))).unwrap();
    let arm = table.framed(Order::Arm { world: hash });
    let disarm = table.framed(Order::Disarm);
    table.put(&arm);
    table.sample();
    table.put(&disarm);
    table.sample();
    table.heard.clear();
    // Both once more, the earlier one last.
    for bytes in [&disarm, &arm] {
        table.put(bytes);
        table.sample();
    }
    assert!(table.heard.iter().all(|heard| matches!(heard, Heard::Refused(_, Refusal::Sequence))), "{:?}", table.heard);
    assert_eq!(table.heard.len(), 2);
    assert_eq!(table.state().0, Phase::Disarmed);

    // One that was sent, and came after its time.
    let late = table.framed(Order::Arm { world: hash });
    for _ in 0..102 {
        table.sample();
    }
    table.heard.clear();
    table.put(&late);
    assert_eq!(table.heard, [Heard::Refused(table.sequence, Refusal::Late)]);
    // One without an end to its time, and one far ahead of its turn.
    table.heard.clear();
    let (sequence, next) = (table.sequence, table.station.next());
    let endless = table.framed_as(sequence + 1, next + 65_537, Order::Arm { world: hash });
    let ahead = table.framed_as(sequence + 5000, next + 10, Order::Arm { world: hash });
    table.put(&endless);
    table.put(&ahead);
    let refused = [Heard::Refused(sequence + 1, Refusal::Late), Heard::Refused(sequence + 5000, Refusal::Sequence)];
    assert_eq!(table.heard, refused);
    assert!(!table.sample().on);
}

#[test]
fn a_host_of_another_version_is_told_so_and_moves_nothing() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let hash = table.load(&packed(&world(WHEEL, &[]))).unwrap();
    table.heard.clear();
    table.send(Order::Hello { protocol: PROTOCOL + 1 });
    assert!(matches!(table.heard[..], [Heard::Hello { .. }]));
    assert_eq!(table.ask(Order::Arm { world: hash }), Err(Refusal::Hello));
    // Stop counts all the same.
    assert_eq!(table.ask(Order::Stop), Ok(()));
}

#[test]
fn a_host_that_falls_silent_loses_the_torque_within_the_links_deadline_the_fade_included() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    table.run(WHEEL);
    table.keep();
    // 0.3 s of link, of which the fade takes the last 0.1 s; from a puck that is pushed all the while.
    let mut off = None;
    for k in 0..600 {
        table.seen.position += 2e-4;
        let motor = table.sample();
        if !motor.on {
            off = off.or(Some(k));
            assert_eq!(motor.torque, 0.0);
        }
    }
    let off = off.unwrap();
    assert!((280..=300).contains(&off), "{off} samples");
    let hello = table.state();
    assert_eq!(hello.0, Phase::Disarmed);
    // And it does not come back by itself when the host does.
    table.keep();
    assert!(!table.sample().on);
}

#[test]
fn after_a_lost_link_a_clear_counts_only_behind_a_heartbeat() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    table.run(&WHEEL.replace("[safety]", "[safety]\nlink_lost = \"fault\""));
    table.keep();
    for _ in 0..400 {
        table.sample();
    }
    assert_eq!(table.state().0, Phase::Faulted);
    // However often it is said, without a word that somebody is there it is not done.
    for _ in 0..100 {
        assert_eq!(table.ask(Order::Clear), Err(Refusal::Phase));
    }
    table.keep();
    for _ in 0..301 {
        table.sample();
    }
    assert_eq!(table.ask(Order::Clear), Err(Refusal::Phase), "that was too long ago");
    table.keep();
    assert_eq!(table.ask(Order::Clear), Ok(()));
    assert_eq!(table.state().0, Phase::Disarmed);
}

#[test]
fn a_driver_that_has_switched_itself_off_is_told_with_no_world_and_through_a_new_one() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    table.ask(Order::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();
    table.heard.clear();
    table.seen.fault = true;
    assert_eq!(table.sample(), Default::default());
    let driver = Reason::Driver.code();
    let faulted = |telemetry: &Telemetry| (telemetry.phase, telemetry.reason) == (Phase::Faulted as u8, driver);
    assert!(matches!(&table.heard[..], [Heard::Telemetry(telemetry)] if faulted(telemetry)), "{:?}", table.heard);
    table.seen.fault = false;
    let hash = table.load(&packed(&world(WHEEL, &[]))).unwrap();
    assert_eq!(table.state().0, Phase::Faulted);
    assert_eq!(table.ask(Order::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        assert_eq!(table.sample(), Default::default());
    }
    table.ask(Order::Clear).unwrap();
    table.keep();
    table.ask(Order::Arm { world: hash }).unwrap();
}

#[test]
fn stop_takes_the_torque_at_the_next_sample_and_whatever_waits_with_it() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let hash = table.run(WHEEL);
    table.seen.position = 0.01;
    assert!(table.sample().on);
    // An old one, too: it counts with any sequence and at any time.
    table.heard.clear();
    let stop = table.framed_as(1, 0, Order::Stop);
    let disarm = table.framed(Order::Disarm);
    table.put(&disarm);
    let waiting = table.sequence;
    table.put(&stop);
    assert_eq!(table.sample(), Default::default());
    assert_eq!(table.heard, [Heard::Refused(waiting, Refusal::Late), Heard::Done(1)]);
    assert_eq!(table.state().0, Phase::Faulted);
    assert_eq!(table.ask(Order::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        table.sample();
    }
    table.ask(Order::Clear).unwrap();
    assert_eq!(table.state().0, Phase::Disarmed);
}

#[test]
fn telemetry_comes_at_a_divided_rate_and_says_what_the_supervisor_says() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    table.run(WHEEL);
    table.ask(Order::Set { parameter: Parameter::Divider as u8, value: 10 }).unwrap();
    table.heard.clear();
    let first = table.station.next();
    for _ in 0..100 {
        table.seen.position += 1e-4;
        table.station.used(77);
        table.sample();
    }
    let seen: Vec<_> = table
        .heard
        .iter()
        .map(|heard| match heard {
            Heard::Telemetry(telemetry) => *telemetry,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(seen.len(), 10);
    for (i, telemetry) in (0_u32..).zip(&seen) {
        assert_eq!((telemetry.sequence, telemetry.sample), (1 + i, first + 10 * u64::from(i)));
        assert_eq!((telemetry.phase, telemetry.reason, telemetry.used), (2, 0, 77));
        assert_eq!(telemetry.bodies.as_slice().len(), 1);
        // A spring of 1.02 N m/rad from wheel to puck.
        let spring = 1.02 * (telemetry.bodies.as_slice()[0].0 - telemetry.measured);
        assert!((telemetry.torque - spring).abs() < 2e-3, "{telemetry:?}");
    }
    assert_eq!(table.ask(Order::Set { parameter: Parameter::Divider as u8, value: 70_000 }), Err(Refusal::Parameter));
    assert_eq!(table.ask(Order::Set { parameter: Parameter::Missed as u8, value: 0 }), Err(Refusal::Parameter));
    assert_eq!(table.ask(Order::Get { parameter: 200 }), Err(Refusal::Parameter));
    table.put(b"\x05nothing of ours\0");
    table.heard.clear();
    table.send(Order::Get { parameter: Parameter::Refused as u8 });
    assert_eq!(table.heard, [Heard::Value(table.sequence, Parameter::Refused as u8, 1)]);
}

#[test]
fn a_fed_board_takes_each_sample_once_and_counts_those_between_as_missed() {
    let mut slots = slots();
    let mut table = Table::new(FED, &mut slots);
    let free = world(&WHEEL.replace("limit", "#"), &["loop.estimator=exact"]);
    let hash = table.load(&packed(&free)).unwrap();
    let feed = |sample, position| Order::Sample { sample, position, velocity: 0.0, late: 0.0, announced: false };
    let told = |table: &mut Table, sample, position| {
        table.heard.clear();
        table.send(feed(sample, position));
        match table.heard[..] {
            [Heard::Telemetry(telemetry)] => Ok((telemetry.sample, telemetry.missed, telemetry.output)),
            [Heard::Refused(_, why)] => Err(why),
            [Heard::Done(_), Heard::Telemetry(telemetry)] => Ok((telemetry.sample, telemetry.missed, telemetry.output)),
            ref other => panic!("{other:?}"),
        }
    };
    assert_eq!(told(&mut table, 0, 0.0), Ok((0, 0, 0.0)));
    assert_eq!(told(&mut table, 0, 0.0), Err(Refusal::Sample));
    assert_eq!(told(&mut table, 3, 0.0), Ok((3, 2, 0.0)));
    table.send(Order::Arm { world: hash });
    assert_eq!(told(&mut table, 4, 0.0), Ok((4, 2, 0.0)));
    // Three counts of the encoder; two hundredths of the spring's torque: the second sample of a fade over 100.
    let counts = 3.0 * std::f32::consts::TAU / 4000.0;
    let (_, _, torque) = told(&mut table, 5, counts).unwrap();
    assert!((torque + 0.02 * 1.02 * counts).abs() < 1e-6 * counts, "{torque}");
    assert_eq!(told(&mut table, 80_000, 0.0), Err(Refusal::Sample));

    let mut slots = [Slot::EMPTY, Slot::EMPTY];
    let mut table = Table::new(BOARD, &mut slots);
    assert_eq!(table.ask(feed(0, 0.0)), Err(Refusal::NotExternallyClocked));
}

#[test]
fn a_fault_of_the_encoder_is_named_and_holds_until_it_is_cleared() {
    let mut slots = slots();
    let mut table = Table::new(BOARD, &mut slots);
    let hash = table.run(WHEEL);
    table.ask(Order::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();
    table.heard.clear();
    table.seen.position += 1.0;
    assert_eq!(table.sample(), Default::default());
    assert!(
        matches!(table.heard[..], [Heard::Telemetry(telemetry)] if telemetry.reason == Reason::Jump.code() || telemetry.reason == Reason::Velocity.code()),
        "{:?}",
        table.heard
    );
    assert_eq!(table.ask(Order::Clear), Err(Refusal::Phase));
    assert_eq!(table.ask(Order::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        assert_eq!(table.sample(), Default::default());
    }
    table.ask(Order::Clear).unwrap();
    table.ask(Order::Arm { world: hash }).unwrap();
}
