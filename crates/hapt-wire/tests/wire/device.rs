//! A board's reactions to the messages of a host.

use hapt_core::{CertifiedTime, Controller, Phase, Reading, Reason, Request, SafetyProfile, WhenLate};
use hapt_plant::{Grip, VirtualDevice};
use hapt_wire::device::{Measurement, WorldStorage};
use hapt_wire::{Command, PROTOCOL, Parameter, ROOM, Refusal, Telemetry, hash};

use crate::common::{BOARD, EXTERNALLY_CLOCKED, Received, TestHost, WHEEL, packed, storage, world};

#[test]
fn the_torques_of_a_loaded_world_are_bit_identical_to_the_cores() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let world = world(WHEEL, &[]);
    let hash = host.load(&packed(&world)).unwrap();
    assert_eq!(host.state(), (Phase::Disarmed, Some(hash)));

    let spec = world.spec();
    let limits = world.limits(SafetyProfile::Certified);
    let core = Controller::<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>::new(&spec, &limits).unwrap();
    let mut state = core.start();

    let mut device = VirtualDevice::new(&world.device_spec());
    device.hold(Some(Grip { inertia: 1e-4, damping: 0.02, stiffness: 3.0 }));
    host.send(Command::Arm { world: hash });
    let mut largest = 0.0_f32;
    for k in 0..3000_u32 {
        if k % 20 == 0 {
            device.intend(0.4 * (f64::from(k) * 2e-3).sin());
            host.heartbeat();
        }
        let (position, velocity) = device.puck();
        host.seen = Measurement { position: position as f32, velocity: velocity as f32, ..Measurement::default() };
        let motor = host.sample();
        let reading = Reading {
            position: position as f32,
            velocity: velocity as f32,
            announced: false,
            late: 0.0,
            missed: 0,
            // In ms, since the previous message.
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
    assert_eq!(host.state(), (Phase::Running, Some(hash)));
    assert!(largest > 0.1, "{largest} N m");
}

#[test]
fn no_torque_without_a_world_and_none_before_it_is_armed() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    assert_eq!(host.ask(Command::Arm { world: 0 }), Err(Refusal::NoWorld));
    host.seen.position = 1.0;
    assert_eq!(host.sample(), Default::default());
    let hash = host.load(&packed(&world(WHEEL, &[]))).unwrap();
    assert_eq!(host.ask(Command::Arm { world: hash ^ 1 }), Err(Refusal::NoWorld));
    for _ in 0..100 {
        host.seen.position += 0.001;
        assert_eq!(host.sample(), Default::default());
    }
}

#[test]
fn an_invalid_world_is_refused_by_name_and_the_previous_one_stays() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let good = world(WHEEL, &[]);
    let hash_of_it = host.load(&packed(&good)).unwrap();
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
        // Complete with the announced hash, but with a wrong checksum in it.
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
        assert_eq!(host.load(&bytes), Err(why), "{what}");
        assert_eq!(host.state(), (Phase::Disarmed, Some(hash_of_it)), "{what}");
    }

    // Half of it, and one byte of another hash.
    host.ask(Command::Begin { length: bytes.len() as u16, hash: hash(&bytes) }).unwrap();
    host.ask(Command::Piece { at: 0, bytes: &bytes[..100] }).unwrap();
    assert_eq!(host.ask(Command::Commit), Err(Refusal::Hash));
    assert_eq!(host.ask(Command::Piece { at: 99, bytes: &bytes[99..200] }), Err(Refusal::Piece));
    // A repeated piece is accepted, because its acknowledgement may be lost; other bytes in its place are not.
    host.ask(Command::Piece { at: 0, bytes: &bytes[..100] }).unwrap();
    assert_eq!(host.ask(Command::Piece { at: 0, bytes: &[0xa5; 100] }), Err(Refusal::Piece));
    host.ask(Command::Begin { length: bytes.len() as u16, hash: 1 }).unwrap();
    for (i, piece) in bytes.chunks(200).enumerate() {
        host.ask(Command::Piece { at: 200 * i as u16, bytes: piece }).unwrap();
    }
    assert_eq!(host.ask(Command::Piece { at: bytes.len() as u16, bytes: &[0] }), Err(Refusal::Piece));
    assert_eq!(host.ask(Command::Commit), Err(Refusal::Hash));
    assert_eq!(host.ask(Command::Begin { length: 1025, hash: 1 }), Err(Refusal::Room));
    assert_eq!(host.ask(Command::Commit), Err(Refusal::Hash));
    assert_eq!(host.state(), (Phase::Disarmed, Some(hash_of_it)));
    host.ask(Command::Arm { world: hash_of_it }).unwrap();
}

#[test]
fn while_there_may_be_a_torque_the_world_cannot_change_and_afterwards_it_can() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let hash = host.run(WHEEL);
    let other = packed(&world(WHEEL, &["couplings.0.stiffness=2", "loop.period=2ms"]));
    assert_eq!(host.load(&other), Err(Refusal::Armed));
    assert_eq!(host.state(), (Phase::Running, Some(hash)));
    host.ask(Command::Disarm).unwrap();
    for _ in 0..101 {
        host.sample();
    }
    let hash = host.load(&other).unwrap();
    assert_eq!(host.state(), (Phase::Disarmed, Some(hash)));
    assert_eq!(host.endpoint.period(), 2e-3);
    // Repeatedly: the two storages alternate.
    for stiffness in 3..20 {
        let bytes = packed(&world(WHEEL, &[&format!("couplings.0.stiffness={}", 0.1 * f64::from(stiffness))]));
        let hash = host.load(&bytes).unwrap();
        assert_eq!(host.state().1, Some(hash));
    }
}

#[test]
fn a_command_is_executed_once_in_its_order_and_in_its_time() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let hash = host.load(&packed(&world(WHEEL, &[]))).unwrap();
    let arm = host.framed(Command::Arm { world: hash });
    let disarm = host.framed(Command::Disarm);
    host.put(&arm);
    host.sample();
    host.put(&disarm);
    host.sample();
    host.received.clear();
    // Both are repeated, the earlier one last.
    for bytes in [&disarm, &arm] {
        host.put(bytes);
        host.sample();
    }
    assert!(
        host.received.iter().all(|received| matches!(received, Received::Refused(_, Refusal::Sequence))),
        "{:?}",
        host.received
    );
    assert_eq!(host.received.len(), 2);
    assert_eq!(host.state().0, Phase::Disarmed);

    // A command that arrives after its last valid sample.
    let late = host.framed(Command::Arm { world: hash });
    for _ in 0..102 {
        host.sample();
    }
    host.received.clear();
    host.put(&late);
    assert_eq!(host.received, [Received::Refused(host.sequence, Refusal::Late)]);
    // A command without an end of validity, and one with a sequence far ahead.
    host.received.clear();
    let (sequence, next) = (host.sequence, host.endpoint.next());
    let endless = host.framed_as(sequence + 1, next + 65_537, Command::Arm { world: hash });
    let ahead = host.framed_as(sequence + 5000, next + 10, Command::Arm { world: hash });
    host.put(&endless);
    host.put(&ahead);
    let refused =
        [Received::Refused(sequence + 1, Refusal::Late), Received::Refused(sequence + 5000, Refusal::Sequence)];
    assert_eq!(host.received, refused);
    assert!(!host.sample().on);
}

#[test]
fn a_host_of_another_version_is_refused_and_moves_nothing() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let hash = host.load(&packed(&world(WHEEL, &[]))).unwrap();
    host.received.clear();
    host.send(Command::Hello { protocol: PROTOCOL + 1 });
    assert!(matches!(host.received[..], [Received::Hello { .. }]));
    assert_eq!(host.ask(Command::Arm { world: hash }), Err(Refusal::Hello));
    // Stop is accepted nevertheless.
    assert_eq!(host.ask(Command::Stop), Ok(()));
}

#[test]
fn without_heartbeats_the_torque_ends_within_the_links_deadline_the_fade_included() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    host.run(WHEEL);
    host.heartbeat();
    // A link time of 0.3 s, of which the fade takes the last 0.1 s, with a puck that is pushed throughout.
    let mut off = None;
    for k in 0..600 {
        host.seen.position += 2e-4;
        let motor = host.sample();
        if !motor.on {
            off = off.or(Some(k));
            assert_eq!(motor.torque, 0.0);
        }
    }
    let off = off.unwrap();
    assert!((280..=300).contains(&off), "{off} samples");
    let hello = host.state();
    assert_eq!(hello.0, Phase::Disarmed);
    // The torque does not return when the heartbeats do.
    host.heartbeat();
    assert!(!host.sample().on);
}

#[test]
fn after_a_lost_link_a_clear_counts_only_after_a_heartbeat() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    host.run(&WHEEL.replace("[safety]", "[safety]\nlink_lost = \"fault\""));
    host.heartbeat();
    for _ in 0..400 {
        host.sample();
    }
    assert_eq!(host.state().0, Phase::Faulted);
    // Repeated arming without a heartbeat does not help.
    for _ in 0..100 {
        assert_eq!(host.ask(Command::Clear), Err(Refusal::Phase));
    }
    host.heartbeat();
    for _ in 0..301 {
        host.sample();
    }
    assert_eq!(host.ask(Command::Clear), Err(Refusal::Phase), "that was too long ago");
    host.heartbeat();
    assert_eq!(host.ask(Command::Clear), Ok(()));
    assert_eq!(host.state().0, Phase::Disarmed);
}

#[test]
fn a_driver_fault_is_reported_without_a_world_and_after_a_new_one() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();
    host.received.clear();
    host.seen.fault = true;
    assert_eq!(host.sample(), Default::default());
    let driver = Reason::Driver.code();
    let faulted = |telemetry: &Telemetry| (telemetry.phase, telemetry.reason) == (Phase::Faulted as u8, driver);
    assert!(
        matches!(&host.received[..], [Received::Telemetry(telemetry)] if faulted(telemetry)),
        "{:?}",
        host.received
    );
    host.seen.fault = false;
    let hash = host.load(&packed(&world(WHEEL, &[]))).unwrap();
    assert_eq!(host.state().0, Phase::Faulted);
    assert_eq!(host.ask(Command::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        assert_eq!(host.sample(), Default::default());
    }
    host.ask(Command::Clear).unwrap();
    host.heartbeat();
    host.ask(Command::Arm { world: hash }).unwrap();
}

#[test]
fn a_stop_removes_the_torque_at_the_next_sample_and_voids_queued_commands() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let hash = host.run(WHEEL);
    host.seen.position = 0.01;
    assert!(host.sample().on);
    // An old stop too: it is valid with any sequence and at any time.
    host.received.clear();
    let stop = host.framed_as(1, 0, Command::Stop);
    let disarm = host.framed(Command::Disarm);
    host.put(&disarm);
    let waiting = host.sequence;
    host.put(&stop);
    assert_eq!(host.sample(), Default::default());
    assert_eq!(host.received, [Received::Refused(waiting, Refusal::Late), Received::Done(1)]);
    assert_eq!(host.state().0, Phase::Faulted);
    assert_eq!(host.ask(Command::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        host.sample();
    }
    host.ask(Command::Clear).unwrap();
    assert_eq!(host.state().0, Phase::Disarmed);
}

#[test]
fn telemetry_has_a_divided_rate_and_the_supervisors_state() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    host.run(WHEEL);
    host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 10 }).unwrap();
    host.received.clear();
    let first = host.endpoint.next();
    for _ in 0..100 {
        host.seen.position += 1e-4;
        host.endpoint.used(77);
        host.sample();
    }
    let seen: Vec<_> = host
        .received
        .iter()
        .map(|received| match received {
            Received::Telemetry(telemetry) => *telemetry,
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
    assert_eq!(host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 70_000 }), Err(Refusal::Parameter));
    assert_eq!(host.ask(Command::Set { parameter: Parameter::Missed as u8, value: 0 }), Err(Refusal::Parameter));
    assert_eq!(host.ask(Command::Get { parameter: 200 }), Err(Refusal::Parameter));
    host.put(b"\x05nothing of ours\0");
    host.received.clear();
    host.send(Command::Get { parameter: Parameter::Refused as u8 });
    assert_eq!(host.received, [Received::Value(host.sequence, Parameter::Refused as u8, 1)]);
}

#[test]
fn an_externally_clocked_board_takes_each_sample_once_and_counts_gaps_as_missed() {
    let mut storage = storage();
    let mut host = TestHost::new(EXTERNALLY_CLOCKED, &mut storage);
    let free = world(&WHEEL.replace("limit", "#"), &["loop.estimator=exact"]);
    let hash = host.load(&packed(&free)).unwrap();
    let feed = |sample, position| Command::Sample { sample, position, velocity: 0.0, late: 0.0, announced: false };
    let taken = |host: &mut TestHost, sample, position| {
        host.received.clear();
        host.send(feed(sample, position));
        match host.received[..] {
            [Received::Telemetry(telemetry)] => Ok((telemetry.sample, telemetry.missed, telemetry.output)),
            [Received::Refused(_, why)] => Err(why),
            [Received::Done(_), Received::Telemetry(telemetry)] => {
                Ok((telemetry.sample, telemetry.missed, telemetry.output))
            }
            ref other => panic!("{other:?}"),
        }
    };
    assert_eq!(taken(&mut host, 0, 0.0), Ok((0, 0, 0.0)));
    assert_eq!(taken(&mut host, 0, 0.0), Err(Refusal::Sample));
    assert_eq!(taken(&mut host, 3, 0.0), Ok((3, 2, 0.0)));
    host.send(Command::Arm { world: hash });
    assert_eq!(taken(&mut host, 4, 0.0), Ok((4, 2, 0.0)));
    // Three counts of the encoder; two hundredths of the spring's torque: the second sample of a fade over 100.
    let counts = 3.0 * std::f32::consts::TAU / 4000.0;
    let (_, _, torque) = taken(&mut host, 5, counts).unwrap();
    assert!((torque + 0.02 * 1.02 * counts).abs() < 1e-6 * counts, "{torque}");
    assert_eq!(taken(&mut host, 80_000, 0.0), Err(Refusal::Sample));

    let mut storage = [WorldStorage::EMPTY, WorldStorage::EMPTY];
    let mut host = TestHost::new(BOARD, &mut storage);
    assert_eq!(host.ask(feed(0, 0.0)), Err(Refusal::NotExternallyClocked));
}

#[test]
fn a_fault_of_the_encoder_is_named_and_holds_until_it_is_cleared() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let hash = host.run(WHEEL);
    host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();
    host.received.clear();
    host.seen.position += 1.0;
    assert_eq!(host.sample(), Default::default());
    assert!(
        matches!(host.received[..], [Received::Telemetry(telemetry)] if telemetry.reason == Reason::Jump.code() || telemetry.reason == Reason::Velocity.code()),
        "{:?}",
        host.received
    );
    assert_eq!(host.ask(Command::Clear), Err(Refusal::Phase));
    assert_eq!(host.ask(Command::Arm { world: hash }), Err(Refusal::Phase));
    for _ in 0..20 {
        assert_eq!(host.sample(), Default::default());
    }
    host.ask(Command::Clear).unwrap();
    host.ask(Command::Arm { world: hash }).unwrap();
}

/// Samples 1.3 periods apart, commands late by up to 0.4 ms.
const TIMES: &str = "\n[loop]\ninterval_max = \"1.3 ms\"\ndelay_max = \"0.4 ms\"";

#[test]
fn a_board_enforces_the_times_that_the_world_states_and_a_late_sample_is_a_fault_there() {
    let text = WHEEL.replacen("\n[loop]", TIMES, 1);
    let late = Measurement { late: 0.31e-3, ..Measurement::default() };
    let missed = Measurement { missed: 1, ..Measurement::default() };
    let in_time = Measurement::default();
    let all = [(late, 0.4e-3), (missed, 0.4e-3), (in_time, 0.41e-3)];
    for ((late, delay), when) in
        all.into_iter().flat_map(|late| [None, Some("fault"), Some("fade"), Some("count")].map(|when| (late, when)))
    {
        let mut storage = storage();
        let mut host = TestHost::new(BOARD, &mut storage);
        let sets = when.map(|when| format!("safety.late={when}"));
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        host.run_world(&board_packed(&world(&text, &sets)));
        host.send(Command::Set { parameter: Parameter::Divider as u8, value: 1 });
        host.seen = Measurement { late: 0.29e-3, ..host.seen };
        for _ in 0..10 {
            host.heartbeat();
            host.endpoint.commanded(0.4e-3);
            assert!(host.sample().on, "within the bounds");
        }
        host.seen = Measurement { late: 0.0, ..host.seen };
        host.sample();
        assert_eq!(outside(&mut host), 0);
        host.received.clear();
        host.seen = late;
        host.endpoint.commanded(delay);
        let motor = host.sample();
        host.seen = Measurement::default();
        let taken = host.received.iter().find_map(|received| match received {
            Received::Telemetry(telemetry) => Some((telemetry.phase, telemetry.reason, telemetry.warning)),
            _ => None,
        });
        let (phase, reason, warning, on) = match when {
            None | Some("fault") => (Phase::Faulted, Reason::Uneven.code(), 0, false),
            Some("fade") => (Phase::FadingOut, Reason::Uneven.code(), 0, true),
            _ => (Phase::Running, 0, Reason::Uneven.code(), true),
        };
        assert_eq!((taken, motor.on), (Some((phase as u8, reason, warning)), on), "{late:?} {delay} {when:?}");
        assert_eq!(outside(&mut host), 1);
        if when != Some("count") {
            for _ in 0..150 {
                host.heartbeat();
                host.sample();
            }
            assert!(!host.motor.on, "not armed again");
        }
    }
}

/// The board's own count.
fn outside(host: &mut TestHost<'_>) -> u32 {
    host.received.clear();
    host.send(Command::Get { parameter: Parameter::Outside as u8 });
    match host.received[..] {
        [Received::Value(_, 4, value)] => value,
        ref other => panic!("{other:?}"),
    }
}

fn board_packed(world: &hapt_model::World) -> Vec<u8> {
    let limits = world.board_limits(SafetyProfile::Certified);
    hapt_wire::pack(&world.spec(), &limits, &mut [0; 1024]).unwrap().to_vec()
}

#[test]
fn a_world_without_stated_times_keeps_its_bytes_and_one_with_them_is_another_version() {
    let plain = world(WHEEL, &[]);
    assert_eq!(board_packed(&plain), packed(&plain), "nothing to enforce");
    assert_eq!(packed(&plain)[0], 1);
    for when in WhenLate::ALL {
        let stated = world(WHEEL, &["loop.interval_max=1.5 ms", &format!("safety.late={}", when.name())]);
        let bytes = board_packed(&stated);
        assert_eq!((bytes[0], bytes.len()), (2, packed(&plain).len() + 17));
        let (limits, stored) = hapt_wire::unpack::<4, 8>(&bytes).unwrap();
        assert_eq!(limits.time, CertifiedTime { interval: 1.5e-3, delay: f64::INFINITY, when_late: when });
        assert_eq!(stored.spec(), stated.spec());
        // A board that reads only version 1 refuses the other version as a whole, and the reverse.
        for version in [0, 1, 3, 255] {
            assert!(hapt_wire::unpack::<4, 8>(&[&[version], &bytes[1..]].concat()).is_err(), "{version}");
        }
        assert!(hapt_wire::unpack::<4, 8>(&[&[2], &packed(&plain)[1..]].concat()).is_err());
    }
}

#[test]
fn a_world_whose_origin_slips_is_another_version() {
    let plain = world(WHEEL, &["device.friction=5 N mm"]);
    for more in [vec![], vec!["loop.interval_max=1.5 ms"]] {
        let slips = world(WHEEL, &[&["device.friction=5 N mm", "loop.recentre=0.7 s"], &more[..]].concat());
        let bytes = packed(&slips);
        assert_eq!((bytes[0], bytes.len()), (3, packed(&plain).len() + 25));
        let (limits, stored) = hapt_wire::unpack::<4, 8>(&bytes).unwrap();
        assert_eq!(limits, slips.limits(SafetyProfile::Certified));
        assert_eq!((limits.recentre, stored.spec()), (0.7, slips.spec()));
        for version in [0, 1, 2, 4, 255] {
            assert!(hapt_wire::unpack::<4, 8>(&[&[version], &bytes[1..]].concat()).is_err(), "{version}");
        }
    }
}
