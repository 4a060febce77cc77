//! The supervisor on the exact device: the notes' runs pass, runaway loops are caught, signs are detected, energies agree.

use crate::common::{bare, spring, wheel};
use hapt_core::{Limits, Phase, Reading, Reason, Request, SafeOutput, SafetyProfile, SupervisorState};
use hapt_model::{Body, Coupling, Drive, End, EstimatorKind, Law, Method, Output, Shape, Source, World};
use hapt_sim::{DesktopLoop, DesktopSupervisor, Grip, Simulation, VirtualDevice, world_energy};
use hapt_testing::laws::{SIZES, goes_to_bodies, some_limited};
use hapt_testing::prelude::*;

type State = hapt_core::State<f64, 32, 64, 257>;

struct Guard {
    core: DesktopLoop,
    supervisor: DesktopSupervisor,
    state: State,
    watch: SupervisorState<f64>,
}

impl Guard {
    fn new(world: &World, profile: SafetyProfile) -> Self {
        let core = DesktopLoop::new(&world.spec()).unwrap();
        // Positions are those of the run: arming does not move the origin.
        let limits = Limits { zero_where_armed: false, ..world.limits(profile) };
        let supervisor = DesktopSupervisor::new(&limits, &world.spec()).unwrap();
        Guard { state: core.start(), core, supervisor, watch: SupervisorState::START }
    }

    fn step(&mut self, position: f64, velocity: f64, announced: bool, request: Option<Request>) -> SafeOutput<f64> {
        let reading = Reading { position, velocity, announced, late: 0.0, missed: 0, silent: 0.0 };
        self.supervisor.step(&mut self.watch, &self.core, &mut self.state, &reading, request)
    }

    /// A period of the device, whose motor gives `gain` times the torque.
    fn on(&mut self, device: &mut VirtualDevice, gain: f64, request: Option<Request>) -> SafeOutput<f64> {
        let (position, velocity) = device.puck();
        let guarded = self.step(position, velocity, false, request);
        device.command(gain * guarded.output);
        device.travel();
        guarded
    }
}

/// The Michigan wheel with its motor's limit and encoder, the notes' wheel on it.
fn michigan(method: Method, output: Output) -> World {
    let mut world = wheel(method, output);
    world.device.limit = Some(0.82225);
    world.device.encoder = Some(4000.0);
    world.sampling.estimator = EstimatorKind::Difference;
    world
}

/// The supervisor's readings are those of the runs.
#[test]
fn every_run_of_the_notes_passes_and_only_forward_euler_is_warned_of() {
    let mut warned = Vec::new();
    for entry in std::fs::read_dir("../../worlds/notes").unwrap() {
        let path = entry.unwrap().path();
        let world = World::read(&Source::from_text("w", std::fs::read_to_string(&path).unwrap()), &[]).unwrap();
        for scenario in &world.scenarios {
            let mut guard = Guard::new(&world, SafetyProfile::Simulated);
            let jump = match scenario.hand.drive {
                Drive::Position(Shape::Step { at, .. }) => Some((at / world.sampling.period).round() as u64),
                _ => None,
            };
            let mut run = Simulation::new(&world, scenario).unwrap();
            let mut sample = 0;
            while let Some(row) = run.next() {
                let row = row.unwrap();
                let request = (sample == 0).then_some(Request::Arm);
                let guarded = guard.step(row.puck, row.puck_velocity, jump == Some(sample), request);
                assert!(guarded.phase.is_active(), "{path:?} {}: {:?} at {}", scenario.name, guarded.reason, row.time);
                assert_eq!(guarded.sample.command, row.command);
                if guarded.phase == Phase::Running {
                    assert_eq!(guarded.output, row.command);
                }
                sample += 1;
            }
            if guard.watch.warning.is_some() {
                warned.push(path.file_stem().unwrap().to_string_lossy().into_owned());
            }
        }
    }
    assert_eq!(warned, ["euler"]);
}

/// Under forward Euler the released wheel gains energy that no hand supplies: the port's ledger detects it long before the wheel is fast.
#[test]
fn a_wheel_that_diverges_hands_off_is_stopped_and_stays_without_torque() {
    let mut world = michigan(Method::ForwardEuler, Output::Start);
    world.bodies[0].position = 0.2;
    world.device.damping = 1e-4;
    // On the simulated device it is stopped only where the file enables faults of the energy ledgers.
    for (profile, world_trips) in
        [(SafetyProfile::Simulated, Some(true)), (SafetyProfile::Simulated, None), (SafetyProfile::Uncertified, None)]
    {
        world.safety.world_trips = world_trips;
        let mut guard = Guard::new(&world, profile);
        let mut device = VirtualDevice::new(&world.device_spec());
        let mut caught = None;
        for sample in 0..60_000 {
            let request = (sample == 20).then_some(Request::Arm);
            let guarded = guard.on(&mut device, 1.0, request);
            if caught.is_some() {
                assert_eq!((guarded.phase, guarded.output), (Phase::Faulted, 0.0));
            } else if guarded.phase == Phase::Faulted {
                caught = guarded.reason;
                assert_eq!(guarded.output, 0.0);
            }
        }
        if (profile, world_trips) == (SafetyProfile::Simulated, None) {
            assert_eq!(caught, None);
            continue;
        }
        assert!(matches!(caught, Some(Reason::PortEnergy | Reason::WorldEnergy)), "{profile:?}: {caught:?}");
    }
}

#[test]
fn the_sign_test_distinguishes_a_reversed_motor_a_blocked_puck_and_a_correct_device() {
    let world = michigan(Method::Zoh, Output::End);
    let stiff = Grip { inertia: 0.0, damping: 1.0, stiffness: 100.0 };
    for (gain, grip, phase, reason) in [
        (1.0, None, Phase::Running, None),
        (-1.0, None, Phase::Faulted, Some(Reason::Reversed)),
        (0.0, None, Phase::Faulted, Some(Reason::Stuck)),
        (1.0, Some(stiff), Phase::Faulted, Some(Reason::Stuck)),
    ] {
        let mut guard = Guard::new(&world, SafetyProfile::Certified);
        let mut device = VirtualDevice::new(&world.device_spec());
        device.hold(grip);
        let mut farthest = 0.0_f64;
        for sample in 0..2000 {
            guard.on(&mut device, gain, (sample == 20).then_some(Request::Arm));
            farthest = farthest.max(device.puck().0.abs());
        }
        assert_eq!((guard.watch.phase, guard.watch.reason), (phase, reason), "{gain} {grip:?}");
        assert!(farthest < 0.2, "{farthest} rad");
    }
}

/// A constant torque on a free puck accelerates it beyond the speed of hands, and is removed.
#[test]
fn a_free_puck_under_constant_torque_is_stopped_at_the_overspeed_limit() {
    let mut world = bare();
    world.device.limit = Some(0.5);
    world.couplings =
        vec![Coupling { first: End::Puck, second: End::Ground, law: Law::Constant { torque: 0.4 }, limit: None }];
    let mut guard = Guard::new(&world, SafetyProfile::Certified);
    let mut device = VirtualDevice::new(&world.device_spec());
    let limits = world.limits(SafetyProfile::Certified);
    let mut fastest = 0.0_f64;
    for sample in 0..5000 {
        guard.on(&mut device, 1.0, (sample == 20).then_some(Request::Arm));
        fastest = fastest.max(device.puck().1);
    }
    assert_eq!(guard.watch.reason, Some(Reason::Overspeed));
    let step = 0.4 / world.device.inertia * world.sampling.period;
    assert!(fastest > limits.overspeed - step && fastest < limits.overspeed + 2.0 * step, "{fastest}");
}

/// A law, and its limit. The supervisor does not count the work of a constant as energy of the world.
fn law() -> impl Strategy<Value = (Law, Option<f64>)> {
    some_limited(SIZES.laws(|law| goes_to_bodies(law) && law.constant().is_none()), 0.01..0.5)
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// The supervisor's account starts at the energy stored after the first step plus the permitted energy: the core's energies are those that the
    /// laboratory computes independently.
    #[test]
    fn the_supervisors_energy_is_the_laboratorys(
        laws in proptest::collection::vec((0usize..4, law()), 1..6), puck in -0.5..0.5f64,
        starts in proptest::collection::vec((-0.5..0.5f64, -5.0..5.0f64), 2),
    ) {
        let mut world = bare();
        world.names = vec!["a".into(), "b".into()];
        world.bodies = starts.iter().map(|&(position, velocity)| Body { inertia: 5e-3, position, velocity }).collect();
        let pairs = [
            (End::Puck, End::Body(0)), (End::Body(1), End::Puck), (End::Body(0), End::Body(1)), (End::Ground, End::Puck),
        ];
        world.couplings =
            laws.iter().map(|&(pair, (law, limit))| Coupling { first: pairs[pair].0, second: pairs[pair].1, law, limit }).collect();
        let mut guard = Guard::new(&world, SafetyProfile::Simulated);
        guard.step(puck, 0.0, false, Some(Request::Arm));
        let State { now, change, .. } = guard.state;
        let bodies: Vec<(f64, f64)> =
            (0..2).map(|i| (now.position[i] + change.position[i], now.velocity[i] + change.velocity[i])).collect();
        let stored = world_energy(&world, puck, &bodies, &vec![0.0; world.couplings.len()]);
        let account = guard.watch.account() - world.limits(SafetyProfile::Simulated).energy;
        prop_assert!((account - stored).abs() < 1e-9 * (1.0 + stored), "{account} {stored}");
    }

    /// A certified spring in a hand that shakes it at a random frequency: no fault.
    #[test]
    fn a_hand_that_shakes_a_certified_wheel_causes_no_fault(
        stiffness in 0.5..5.0f64, frequency in 0.2..20.0f64, amplitude in 0.05..1.0f64, own in 0.0..1.0f64,
    ) {
        let mut world = michigan(Method::Zoh, Output::End);
        world.couplings.push(spring(End::Puck, End::Ground, own));
        let mut guard = Guard::new(&world, SafetyProfile::Certified);
        let mut device = VirtualDevice::new(&world.device_spec());
        let mut sample = 0;
        while guard.watch.phase != Phase::Running {
            guard.on(&mut device, 1.0, (sample == 20).then_some(Request::Arm));
            sample += 1;
            prop_assert!(sample < 1000);
        }
        device.hold(Some(Grip { inertia: 1e-4, damping: 0.02, stiffness }));
        let rate = std::f64::consts::TAU * frequency * world.sampling.period;
        let amplitude = amplitude.min(20.0 / (std::f64::consts::TAU * frequency));
        for k in 0..5000 {
            device.intend(amplitude * (rate * f64::from(k)).sin());
            prop_assert!(guard.on(&mut device, 1.0, None).phase == Phase::Running, "{:?}", guard.watch.reason);
        }
    }
}

/// An integral term gives energy to a hand that moves slowly to and fro. That is a property of the law and no fault: the port's ledger excludes it.
#[test]
fn a_hand_that_draws_energy_from_an_integral_term_is_no_fault() {
    let mut world = bare();
    world.device.limit = Some(0.8);
    world.sampling.estimator = EstimatorKind::Difference;
    world.safety.world_trips = Some(true);
    let integral = Law::Integral { stiffness: 1.0, time: 0.05, rest: 0.0 }.between(End::Ground, End::Puck);
    world.couplings = vec![
        Law::Spring { stiffness: 1.0, rest: 0.0 }.between(End::Puck, End::Ground),
        Coupling { limit: Some(0.3), ..integral },
    ];
    let mut guard = Guard::new(&world, SafetyProfile::Simulated);
    let (mut drawn, mut last) = (0.0, (0.0, 0.0));
    for sample in 0..20_000 {
        let position = 0.1 * (std::f64::consts::TAU * 0.5 * f64::from(sample) * 1e-3).sin();
        let guarded = guard.step(position, 0.0, false, (sample == 20).then_some(Request::Arm));
        drawn += last.1 * (position - last.0);
        last = (position, guarded.output);
    }
    let most = world.limits(SafetyProfile::Simulated).energy;
    assert!(guard.watch.reason.is_none() && drawn > 2.0 * most, "{:?} {drawn} J of {most} J", guard.watch.reason);
}

/// An assist pushes along with the hand, and so gives energy at every turn. That is a property of the law and no fault, with a delay too.
#[test]
fn a_hand_that_draws_energy_from_an_assist_is_no_fault() {
    for delay in [0.0, 1.5] {
        let mut world = bare();
        world.device.limit = Some(0.8);
        world.sampling.estimator = EstimatorKind::Difference;
        world.sampling.delay = hapt_model::Delay::Samples(delay);
        world.safety.world_trips = Some(true);
        world.couplings = vec![
            Law::Spring { stiffness: 0.5, rest: 0.0 }.between(End::Puck, End::Ground),
            Law::Assist { torque: 0.2, velocity: 0.05 }.between(End::Ground, End::Puck),
        ];
        let mut guard = Guard::new(&world, SafetyProfile::Simulated);
        let (mut drawn, mut last) = (0.0, (0.0, 0.0));
        for sample in 0..20_000 {
            let position = 0.1 * (std::f64::consts::TAU * 0.5 * f64::from(sample) * 1e-3).sin();
            let guarded = guard.step(position, 0.0, false, (sample == 20).then_some(Request::Arm));
            drawn += last.1 * (position - last.0);
            last = (position, guarded.output);
        }
        let most = world.limits(SafetyProfile::Simulated).energy;
        assert!(guard.watch.reason.is_none() && drawn > 2.0 * most, "{:?} {drawn} J of {most} J", guard.watch.reason);
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(32))]

    /// A compensation of friction, an integral term that a turn fills within a sample, and an acceleration turn over as fast as the hand does: no fault.
    #[test]
    fn a_hand_that_turns_over_a_torque_within_the_devices_friction_causes_no_fault(
        friction in 0.005..0.08f64, share in 0.1..1.0f64, velocity in 0.001..0.5f64, kind in 0..3, every in 1u32..5,
        amplitude in 0.5..6.0f64, speed in 2.0..40.0f64,
    ) {
        let mut world = bare();
        (world.device.limit, world.device.friction) = (Some(0.4), friction);
        (world.sampling.estimator, world.sampling.every) = (EstimatorKind::Difference, every);
        let most = share * friction;
        world.couplings = vec![match kind {
            0 => Law::Assist { torque: most, velocity }.between(End::Puck, End::Ground),
            1 => Coupling {
                limit: Some(most),
                ..Law::Acceleration { inertia: 1e-2, cutoff: 100.0 * velocity }.between(End::Ground, End::Puck)
            },
            _ => Coupling {
                limit: Some(most),
                ..Law::Integral { stiffness: 1.0, time: 0.01, rest: 0.0 }.between(End::Puck, End::Ground)
            },
        }];
        world.safety.pulse = Some(0.0);
        let mut guard = Guard::new(&world, SafetyProfile::Certified);
        let mut turned = 0.0_f64;
        let mut last = 0.0;
        for sample in 0..4000 {
            let position = amplitude * (speed / amplitude * f64::from(sample) * world.sampling.period).sin();
            let guarded = guard.step(position, 0.0, false, (sample == 0).then_some(Request::Arm));
            prop_assert!(guarded.reason.is_none(), "{:?} at {sample}", guarded.reason);
            turned = turned.max((guarded.output - last).abs());
            last = guarded.output;
        }
        prop_assert!(turned > 0.0);
    }
}

/// A compensation of inertia that the device's damping pays for gives energy to a hand that accelerates and takes it back: no fault, and neither ledger
/// faults with more of it.
#[test]
fn a_hand_that_shakes_a_lighter_wheel_is_no_fault() {
    for (share, cutoff) in [(0.05, 5.0), (0.5, 5.0), (0.9, 50.0)] {
        for frequency in [0.5, 3.0, 12.0] {
            let mut world = bare();
            world.device.limit = Some(0.8);
            world.sampling.estimator = EstimatorKind::Difference;
            world.safety.world_trips = Some(true);
            let inertia = share * world.device.inertia;
            world.couplings = vec![
                Law::Spring { stiffness: 0.2, rest: 0.0 }.between(End::Puck, End::Ground),
                Law::Acceleration { inertia, cutoff }.between(End::Puck, End::Ground),
            ];
            let mut guard = Guard::new(&world, SafetyProfile::Simulated);
            for sample in 0..10_000 {
                let position = 0.1 * (std::f64::consts::TAU * frequency * f64::from(sample) * 1e-3).sin();
                guard.step(position, 0.0, false, (sample == 20).then_some(Request::Arm));
            }
            assert!(guard.watch.reason.is_none(), "{share} {cutoff} {frequency}: {:?}", guard.watch.reason);
        }
    }
}
