//! The loop without a clock: the same numbers as the simulation, and changes of its world.

use hapt_core::{Phase, Reason, Request, SafetyProfile, WhenLate};
use hapt_model::World;
use hapt_rt::{Cycle, Failure, HandCommand, Moment, Plan, Position, Replay, SimulatedDevice, Timing};
use hapt_sim::{Simulation, script};
use hapt_testing::prelude::*;

use crate::common::{ScriptedDevice, armed, constant, sample, spring, wheel};

/// What a device returns at a sample.
type Read = Result<(f64, f64), Failure>;

fn on(world: &World, device: Box<dyn hapt_rt::Device>) -> Cycle {
    Cycle::new(Box::new(Plan::new(world, SafetyProfile::Simulated).unwrap()), device)
}

fn text(name: &'static str, options: &'static [&'static str]) -> impl Strategy<Value = String> {
    prop::sample::select(options)
        .prop_map(move |option| if option.is_empty() { String::new() } else { format!("{name} = \"{option}\"\n") })
}

/// A wheel at rest on a spring, on a device with delay, friction, counts, limit and levels, in any hand that begins where the puck is.
fn random_world() -> impl Strategy<Value = World> {
    let hand = prop::sample::select(
        &[
            "{ kind = \"step\", to = \"0.3 rad\", at = \"12.3 ms\" }",
            "{ kind = \"step\", to = \"0.3 rad\", at = \"12 ms\", release = \"80 ms\" }",
            "{ kind = \"ramp\", to = \"-0.4 rad\", at = \"5 ms\", over = \"40.4 ms\", release = \"70.7 ms\" }",
            "{ kind = \"sine\", amplitude = \"0.2 rad\", frequency = \"7 Hz\" }",
            "{ kind = \"torque\", moves = { kind = \"sine\", amplitude = \"80 N mm\", frequency = \"11 Hz\" } }",
            "{ kind = \"torque\", moves = { kind = \"step\", to = \"50 N mm\", at = \"3.3 ms\" }, release = \"50 ms\" }",
            "{ kind = \"grip\", inertia = 1e-4, damping = 0.01, stiffness = 2, moves = { kind = \"ramp\", to = 0.4, over = \"60 ms\" } }",
            "{ kind = \"grip\", inertia = 1e-4, damping = 0.01, stiffness = 2, hold = \"30 ms\", open = \"20.5 ms\", \
               moves = { kind = \"sine\", amplitude = 0.4, frequency = 4 } }",
        ][..],
    );
    let device = (
        text("friction", &["", "5 N mm", "30 N mm"]),
        text("limit", &["0.3 N m", "1 N m"]),
        prop::sample::select(&["", "encoder = 4000\n"][..]),
        prop::sample::select(&["", "levels = 256\n"][..]),
    );
    let sampling = (
        text("delay", &["", "1 ms", "0.4 ms", "2.7 ms"]),
        text("estimator", &["exact", "difference"]),
        text("method", &["forward-euler", "zoh", "trapezoidal", "rk4", "tustin", "foh"]),
    );
    (hand, device, sampling, 0.2_f64..3.0).prop_map(|(hand, device, sampling, stiffness)| {
        let (friction, limit, encoder, levels) = device;
        let (delay, estimator, method) = sampling;
        crate::common::world(&format!(
            "[loop]\nperiod = \"1 ms\"\n{delay}{estimator}{method}[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n{friction}{limit}{encoder}\
             {levels}[bodies.wheel]\ninertia = 0.0258\n{}{}[scenarios.test]\nduration = \"0.15 s\"\nhand = {hand}\n",
            spring("puck", "wheel", stiffness),
            "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nat = 0.2\nstiffness = 3\n",
        ))
    })
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    #[test]
    fn the_loop_with_a_scenarios_hand_on_its_device_is_the_simulation_to_the_bit(world in random_world()) {
        let (device, mut hands) = SimulatedDevice::new(&world);
        let mut cycle = on(&world, Box::new(device));
        armed(&mut cycle);
        let scenario = &world.scenarios[0];
        hands.push(HandCommand::Scenario(Box::new(script(scenario, world.sampling.period)))).unwrap();
        let mut run = Simulation::new(&world, scenario).unwrap();
        while let Some(row) = run.next() {
            let row = row.unwrap();
            let record = sample(&mut cycle, false, None);
            prop_assert_eq!((record.phase, record.reason), (Phase::Running, None));
            let live = [record.position, record.velocity, record.measured, record.measured_velocity, record.torque, record.command];
            let simulated = [row.puck, row.puck_velocity, row.measured, row.measured_velocity, row.torque, row.command];
            prop_assert_eq!(live, simulated, "at {} s", row.time);
            prop_assert_eq!((record.output, record.applied), (row.command, row.applied));
            prop_assert_eq!(record.bodies[0], row.bodies[0]);
        }
    }

    #[test]
    fn a_motor_without_a_measured_torque_is_recorded_with_the_command_of_one_delay_ago(
        delay in 0.0_f64..5.0,
        whole in any::<bool>(),
        missed in prop::collection::vec(0_u32..4, 100),
    ) {
        let delay = if whole { delay.floor() } else { delay };
        let mut world = wheel("1 ms", &spring("puck", "ground", 1.0));
        world.sampling.delay = hapt_model::Delay::Seconds(delay * 1e-3);
        let mut cycle = on(&world, ScriptedDevice::new(|k| -> Read { Ok(((0.1 * k as f64).sin(), 0.0)) }).0);
        armed(&mut cycle);
        let mut commands: Vec<(u64, f64)> = Vec::new();
        for missed in missed {
            let moment = hapt_rt::Moment { periods: 1 + missed, ..Default::default() };
            cycle.pass(moment.periods);
            let record = cycle.sample(&moment, None).unwrap();
            prop_assert!(record.output != 0.0 || record.position == 0.0);
            commands.push((record.sample, record.output));
            let arrived = commands.iter().rev().find(|(sample, _)| *sample as f64 + delay <= record.sample as f64 + 1e-6);
            // At first the motor holds the commands before these.
            if let Some((_, torque)) = arrived {
                prop_assert_eq!(record.applied, *torque, "at {}", record.sample);
            }
        }
    }

    #[test]
    fn a_swap_to_the_same_world_changes_nothing(world in random_world(), at in 1_u32..100) {
        let moves = |k: u64| -> Read { Ok((0.1 * (0.05 * k as f64).sin(), 0.1 * 0.05e3 * (0.05 * k as f64).cos())) };
        let mut plain = on(&world, ScriptedDevice::new(moves).0);
        let mut swapped = on(&world, ScriptedDevice::new(moves).0);
        armed(&mut plain);
        armed(&mut swapped);
        let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
        for k in 0..150 {
            if k == at {
                swapped.swap(Box::new(Plan::following(&world, &plan).unwrap()));
            }
            let (one, other) = (sample(&mut plain, false, None), sample(&mut swapped, false, None));
            prop_assert_eq!((one.torque, one.command, one.bodies[0]), (other.torque, other.command, other.bodies[0]), "at {}", k);
        }
    }

    #[test]
    fn no_swap_steps_the_torque(from in 0.1_f64..1.0, to in 0.1_f64..20.0, limit in 0.5_f64..3.0) {
        let world = |stiffness| {
            let mut world = wheel("1 ms", &spring("puck", "ground", stiffness));
            world.device.limit = Some(limit);
            world
        };
        let mut cycle = on(&world(from), ScriptedDevice::new(|_| -> Read { Ok((0.5, 0.0)) }).0);
        let mut last = armed(&mut cycle);
        let wanted = -(0.5 * to).min(limit);
        cycle.swap(Box::new(Plan::following(&world(to), &Plan::new(&world(from), SafetyProfile::Simulated).unwrap()).unwrap()));
        // A linear fade over a tenth of a second changes by a hundredth per sample; the fade may be twice as steep.
        let steepest = 0.02 * (wanted - last.output).abs() + 1e-12;
        for _ in 0..300 {
            let next = sample(&mut cycle, false, None);
            prop_assert!((next.output - last.output).abs() <= steepest, "{} after {}", next.output, last.output);
            prop_assert!(next.output.abs() <= limit && next.plan == 1);
            last = next;
        }
        prop_assert!((last.output - wanted).abs() < 1e-12);
    }
}

#[test]
fn the_notes_wheel_released_in_real_time_is_the_simulation_to_its_last_row() {
    let text = format!(
        "limit = 0.82225\n[bodies.wheel]\ninertia = 0.0258\n{}[scenarios.let-go]\nduration = \"3 s\"\n\
         hand = {{ kind = \"ramp\", to = \"45 deg\", over = \"0.2 s\", release = \"0.5 s\" }}\n",
        spring("puck", "wheel", 1.018592)
    );
    let world = wheel("1 ms", &text);
    let (device, mut hands) = SimulatedDevice::new(&world);
    let mut cycle = on(&world, Box::new(device));
    armed(&mut cycle);
    hands.push(HandCommand::Scenario(Box::new(script(&world.scenarios[0], 1e-3)))).unwrap();
    let mut run = Simulation::new(&world, &world.scenarios[0]).unwrap();
    let mut rows = 0;
    while let Some(row) = run.next() {
        let (row, record) = (row.unwrap(), sample(&mut cycle, false, None));
        assert_eq!((record.phase, record.reason), (Phase::Running, None), "at {} s", row.time);
        assert_eq!((record.position, record.velocity, record.output), (row.puck, row.puck_velocity, row.command));
        assert_eq!(record.bodies[0], row.bodies[0]);
        rows += 1;
    }
    assert_eq!(rows, 3001);
}

#[test]
fn bodies_continue_by_their_names_and_others_start_at_their_initial_state() {
    let bodies = |names: [&str; 2], rest: &str| {
        let body = |name: &str| {
            format!(
                "[bodies.{name}]\ninertia = 0.01\nposition = {}.0\n",
                names.iter().position(|n| *n == name).unwrap()
            )
        };
        wheel("1 ms", &format!("{}{}{}{rest}", body(names[0]), body(names[1]), spring(names[0], names[1], 1.0)))
    };
    let (before, after) = (bodies(["a", "b"], ""), bodies(["b", "c"], ""));
    let mut cycle = on(&before, ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) }).0);
    let (mut one_before, mut last) = (armed(&mut cycle), sample(&mut cycle, false, None));
    for _ in 0..50 {
        (one_before, last) = (last, sample(&mut cycle, false, None));
    }
    assert!(last.bodies[1].1.abs() > 1e-3, "b moves");
    cycle.swap(Box::new(Plan::following(&after, &Plan::new(&before, SafetyProfile::Simulated).unwrap()).unwrap()));
    let next = sample(&mut cycle, false, None);
    // b, now the first, continues its motion; c is new.
    let (was, is) = (last.bodies[1], next.bodies[0]);
    let step = last.bodies[1].0 - one_before.bodies[1].0;
    assert!((is.0 - was.0 - step).abs() < 0.1 * step.abs(), "{was:?} {is:?} {step}");
    assert!((is.1 - was.1).abs() < 0.2);
    assert_eq!(next.bodies[1], (1.0, 0.0));
}

#[test]
fn a_bristle_continues_with_its_coupling() {
    let lugre = "[[couplings]]\nkind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ncoulomb = 0.02\nstribeck = 0.03\n\
                 stribeck_velocity = 0.1\nbristle_stiffness = 10\nbristle_damping = 0.01\nviscous = 0.01\n";
    let (before, after) = (wheel("1 ms", lugre), wheel("1 ms", &format!("{}{lugre}", spring("puck", "ground", 0.0))));
    // Displaced by less than the bristle's break-away, and held there.
    let device = || {
        ScriptedDevice::new(|k| -> Read { Ok((1e-3 * (k as f64 * 1e-2).min(1.0), if k < 100 { 1e-2 } else { 0.0 })) }).0
    };
    let mut cycle = on(&before, device());
    let mut last = armed(&mut cycle);
    for _ in 0..200 {
        last = sample(&mut cycle, false, None);
    }
    cycle.swap(Box::new(Plan::following(&after, &Plan::new(&before, SafetyProfile::Simulated).unwrap()).unwrap()));
    let next = sample(&mut cycle, false, None);
    assert!(last.torque.abs() > 1e-3, "{last:?}");
    assert_eq!(next.torque, last.torque);
}

#[test]
fn a_change_of_the_period_changes_the_devices_period_too() {
    let world = |period: &str| wheel(period, &constant(0.01));
    let (slow, fast) = (world("1 ms"), world("0.25 ms"));
    let (device, _hands) = SimulatedDevice::new(&slow);
    let mut cycle = on(&slow, Box::new(device));
    let start = armed(&mut cycle);
    for _ in 0..100 {
        sample(&mut cycle, false, None);
    }
    // Periods before a swap are those of the previous plan.
    cycle.pass(1);
    cycle.swap(Box::new(Plan::following(&fast, &Plan::new(&slow, SafetyProfile::Simulated).unwrap()).unwrap()));
    let mut seconds = 101e-3;
    let mut last = cycle.sample(&Default::default(), None).unwrap();
    for _ in 0..400 {
        last = sample(&mut cycle, false, None);
        seconds += 0.25e-3;
    }
    // J v̇ = torque - damping v, throughout.
    let (tau, end) = (6.4e-4 / 1.2e-3, 0.01 / 1.2e-3);
    let velocity = end + (start.velocity - end) * f64::exp(-seconds / tau);
    assert!((last.velocity - velocity).abs() < 1e-9, "{} {velocity}", last.velocity);
    assert_eq!(cycle.period(), 0.25e-3);
}

#[test]
fn a_simulation_that_diverges_is_a_fault_that_can_be_cleared() {
    let world = wheel("1 ms", &constant(1e305));
    let (device, _hands) = SimulatedDevice::new(&world);
    let mut cycle = on(&world, Box::new(device));
    let mut moment = hapt_rt::Moment::default();
    let mut request = Some(Request::Arm);
    let mut phases = Vec::new();
    for k in 0..10_000 {
        if phases.last() == Some(&Phase::Faulted) && k % 50 == 0 {
            request = Some(Request::Clear);
        }
        let record = cycle.sample(&moment, request.take()).unwrap();
        moment.periods = 1;
        if phases.last() != Some(&record.phase) {
            phases.push(record.phase);
        }
        match record.phase {
            Phase::Faulted => assert_eq!((record.reason, record.output), (Some(Reason::NotFinite), 0.0)),
            Phase::Disarmed if phases.len() > 2 => return,
            _ => {}
        }
        // Long enough for the motion under a torque of 10³⁰⁵ to overflow.
        cycle.pass(1_000);
    }
    panic!("never cleared: {phases:?}");
}

#[test]
fn the_position_of_a_simulated_puck_at_arming_is_the_worlds_zero_without_a_torque() {
    let world = wheel("1 ms", &spring("puck", "ground", 1.0));
    let (device, mut hands) = SimulatedDevice::new(&world);
    let mut cycle = on(&world, Box::new(device));
    armed(&mut cycle);
    for turns in [4.35, -3.0, 0.7] {
        // Disarmed, a hand turns the puck and holds it there.
        let mut record = sample(&mut cycle, false, Some(Request::Disarm));
        while record.phase != Phase::Disarmed {
            record = sample(&mut cycle, false, None);
        }
        hands.push(HandCommand::Grab(hapt_sim::Grip { inertia: 1e-3, damping: 0.2, stiffness: 8.0 })).unwrap();
        hands.push(HandCommand::Move(turns)).unwrap();
        for _ in 0..2000 {
            record = sample(&mut cycle, false, None);
        }
        assert!((record.position - record.zero - turns).abs() < 1e-6, "{record:?}");
        // Armed there, the spring is slack, and the hand keeps its position.
        sample(&mut cycle, false, Some(Request::Arm));
        for _ in 0..2000 {
            record = sample(&mut cycle, false, None);
            assert!(record.output.abs() < 1e-6, "thrown by {} N m", record.output);
        }
        assert_eq!(record.phase, Phase::Running);
        assert!((record.position - record.zero).abs() < 1e-6);
        // From then on the hand's target counts from the world's new 0.
        hands.push(HandCommand::Move(0.1)).unwrap();
        for _ in 0..2000 {
            record = sample(&mut cycle, false, None);
        }
        assert!((record.position - record.zero - 0.1 * 8.0 / 9.0).abs() < 1e-3, "{record:?}");
        hands.push(HandCommand::Release).unwrap();
    }
    // Restarted, the puck is at rest at 0.
    hands.push(HandCommand::Restart).unwrap();
    let record = sample(&mut cycle, false, None);
    assert_eq!(record.position - record.zero, 0.0);
}

/// Gravity is taken back by the device's own position, wherever the puck was armed.
#[test]
fn a_compensation_of_gravity_holds_a_lever_wherever_it_was_armed() {
    let world = crate::common::world(
        "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\nlimit = 1\n\
         [device.gravity]\ntorque = 0.1\nphase = 0.3\n[[compensation]]\nof = \"gravity\"\n",
    );
    let (device, mut hands) = SimulatedDevice::new(&world);
    let mut cycle = on(&world, Box::new(device));
    for turned in [2.5, -1.0, 0.4] {
        hands.push(HandCommand::Grab(hapt_sim::Grip { inertia: 1e-3, damping: 0.2, stiffness: 8.0 })).unwrap();
        hands.push(HandCommand::Move(turned)).unwrap();
        let mut record = sample(&mut cycle, false, None);
        for _ in 0..2000 {
            record = sample(&mut cycle, false, None);
        }
        let at = record.position;
        sample(&mut cycle, false, Some(Request::Arm));
        hands.push(HandCommand::Move(at)).unwrap();
        for _ in 0..2000 {
            record = sample(&mut cycle, false, None);
        }
        assert_eq!(record.phase, Phase::Running);
        assert!((record.output + 0.1 * (record.position + 0.3).sin()).abs() < 1e-12, "{record:?}");
        // Let go, the lever stays where it is but for the delay of the loop.
        hands.push(HandCommand::Release).unwrap();
        let before = record.position;
        for _ in 0..500 {
            record = sample(&mut cycle, false, None);
        }
        assert!((record.position - before).abs() < 0.05, "{before} {record:?}");
        sample(&mut cycle, false, Some(Request::Disarm));
        while record.phase != Phase::Disarmed {
            record = sample(&mut cycle, false, None);
        }
    }
}

#[test]
fn a_replay_returns_each_recorded_position_at_its_time_and_then_ends() {
    let at = |k: u32| Position { position: f64::from(k) * 0.01, velocity: 0.5, announced: true };
    let world = wheel("1 ms", &spring("puck", "ground", 1.0));
    let mut cycle = on(&world, Box::new(Replay::new((0..10).map(at).collect())));
    assert_eq!(sample(&mut cycle, true, None).position, 0.0);
    assert_eq!(sample(&mut cycle, false, None).position, 0.01);
    // Two samples missed: the recording has advanced.
    cycle.pass(3);
    let record = cycle.sample(&hapt_rt::Moment { periods: 3, ..Default::default() }, None).unwrap();
    assert_eq!((record.sample, record.missed, record.position), (4, 2, 0.04));
    cycle.pass(6);
    assert_eq!(cycle.sample(&Default::default(), None), Err(Failure::Ended));
}

#[test]
fn no_torque_stays_on_when_a_loop_is_dropped() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut cycle = on(&wheel("1 ms", &constant(0.3)), device);
    armed(&mut cycle);
    assert_eq!(torque.get(), 0.3);
    drop(cycle);
    assert_eq!(torque.get(), 0.0);

    let (device, torque) = ScriptedDevice::new(|k| -> Read {
        if k < 1_000 { Ok((0.0, 0.0)) } else { Err(Failure::Gone) }
    });
    let mut cycle = on(&wheel("1 ms", &constant(0.3)), device);
    armed(&mut cycle);
    while cycle.sample(&Default::default(), None).is_ok() {
        assert_eq!(torque.get(), 0.3);
    }
    assert_eq!(torque.get(), 0.0, "the device has failed");
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// A loop at the instants of a clock that is occasionally late: the records show the number of samples inside the certificate, and the
    /// torque is removed, where the world enables that, at the first sample outside.
    #[test]
    fn the_times_that_a_world_states_are_kept_or_the_torque_is_removed(
        pattern in prop::collection::vec((0.0..0.3f64, prop::option::weighted(0.02, 0.3..0.999f64), 0u32..900_000), 1..400),
        when in 0usize..3, stated in any::<bool>(),
    ) {
        let when_late = WhenLate::ALL[when];
        let times = if stated { "interval_max = \"1.3 ms\"\ndelay_max = \"0.895 ms\"\n" } else { "" };
        let rest = format!("{}[safety]\nlate = \"{}\"\nfade = \"20 ms\"\n", constant(0.3), when_late.name());
        let world = wheel(&format!("1 ms\"\n{times}estimator = \"difference"), &rest);
        let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
        let mut cycle = on(&world, device);
        armed(&mut cycle);
        let mut timing = Timing::new();
        let (mut last, mut first, mut outside, mut under_torque, mut slowest) = ((0.0, 0), None, 0, 0, 0);
        let (mut was_active, mut before) = (None, 0);
        for (k, (late, later, command)) in pattern.iter().enumerate() {
            let late = later.unwrap_or(*late);
            let moment = Moment { due: k as u64 * 1_000_000, late: 1e-3 * late, periods: 1, ..Moment::default() };
            cycle.pass(1);
            let mut record = cycle.sample(&moment, None).unwrap();
            record.computation = *command;
            cycle.commanded(*command);
            let is_outside = stated && (late - last.0 > 0.3 + 1e-9 || last.1 > 895_000);
            let certainly = (late - last.0 - 0.3).abs() > 1e-6;
            let counted = record.outside > before;
            before = record.outside;
            if was_active.unwrap_or(true) && certainly {
                prop_assert_eq!(counted, is_outside, "{}", k);
            }
            if counted {
                first = first.or(Some(k));
            }
            match (first, when_late) {
                (None, _) | (Some(_), WhenLate::Count) => prop_assert_eq!(torque.get(), 0.3),
                (Some(_), WhenLate::Fault) => prop_assert_eq!((torque.get(), record.reason), (0.0, Some(Reason::Uneven))),
                (Some(first), WhenLate::Fade) => {
                    let left = 0.3 * (1.0 - (k - first + 1) as f64 / 20.0).max(0.0);
                    prop_assert!((torque.get() - left).abs() < 1e-9, "{} {left}", torque.get());
                    prop_assert_eq!(record.reason, Some(Reason::Uneven));
                }
            }
            // The first record has no predecessor.
            if was_active == Some(true) {
                under_torque += 1;
                outside += u64::from(counted);
                slowest = slowest.max(u64::from(last.1));
            }
            was_active = Some(record.phase.is_active());
            last = (late, *command);
            timing.add(&record);
        }
        let certified = timing.certified();
        prop_assert_eq!((certified.samples, certified.inside), (under_torque, under_torque - outside));
        prop_assert!(certified.longest <= timing.longest_gap());
        prop_assert_eq!(certified.longest_delay, slowest);
    }
}
