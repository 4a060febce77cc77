//! The supervisor on readings made by hand: every limit, every way back, both ledgers in closed form, for f32 and f64.

mod stuck;

use crate::reference::waveform;
use hapt_core::{
    Body, Coupling, Damping, End, Estimator, Heat, Law, Limits, Loop, Method, Output, Phase, Reading, Real, Reason,
    Request, SafeOutput, Side, Spec, State, Supervisor, SupervisorState,
};
use proptest::prelude::*;
use stuck::{a_dead_encoder_can_be_cleared_and_is_found_again, five_short_pushes_find_a_dead_encoder};

const T: f64 = 1e-3;
const K: f64 = 1.0;

const LIMITS: Limits = Limits {
    fade: 0.01,
    velocity: 100.0,
    jump: 0.026,
    overspeed: 50.0,
    stuck: f64::INFINITY,
    stuck_torque: 0.1,
    torque: 0.8,
    slew: f64::INFINITY,
    motor: Heat { rms: f64::INFINITY, time: 30.0 },
    driver: Heat { rms: f64::INFINITY, time: 1.0 },
    late: 5e-3,
    link: 0.3,
    link_faults: false,
    energy: 0.04,
    world_trips: true,
    port_trips: true,
    pulse: 0.0,
    brake: 0.0,
    zero_where_armed: false,
    announcements: true,
    inertia: 6.4e-4,
    damping: 1.2e-3,
    friction: 5e-3,
    delay: 0.0,
};

const SPRING: &[Coupling] =
    &[Coupling { first: End::Puck, second: End::Ground, law: Law::Spring { stiffness: K, rest: 0.0 }, limit: None }];

const WORLD: Spec = Spec {
    period: T,
    method: Method::Zoh,
    output: Output::End,
    advance: 0,
    estimator: Estimator::Difference,
    count: None,
    limit: Some(0.8),
    levels: None,
    bodies: &[],
    couplings: SPRING,
};

fn reading<F: Real>(position: f64) -> Reading<F> {
    let zero = F::ZERO;
    Reading { position: F::from_f64(position), velocity: zero, announced: false, late: zero, missed: 0, silent: zero }
}

/// A loop, its supervisor, and what both remember.
struct Guard<F> {
    world: Loop<F, 4, 8, 17>,
    supervisor: Supervisor<F, 4, 8>,
    state: State<F, 4, 8, 17>,
    watch: SupervisorState<F>,
}

impl<F: Real> Guard<F> {
    fn new(limits: &Limits, spec: &Spec) -> Self {
        let world = Loop::new(spec).unwrap();
        let supervisor = Supervisor::new(limits, spec).unwrap();
        Guard { state: world.start(), world, supervisor, watch: SupervisorState::START }
    }

    fn step(&mut self, reading: &Reading<F>, request: Option<Request>) -> SafeOutput<F> {
        self.supervisor.step(&mut self.watch, &self.world, &mut self.state, reading, request)
    }

    /// At a position, without a request.
    fn at(&mut self, position: f64) -> SafeOutput<F> {
        self.step(&reading(position), None)
    }

    /// Running, the puck at rest at `position`.
    fn running(limits: &Limits, spec: &Spec, position: f64) -> Self {
        let mut guard = Self::new(limits, spec);
        for _ in 0..20 {
            guard.at(position);
        }
        guard.step(&reading(position), Some(Request::Arm));
        for _ in 0..(2.0 * limits.fade / T) as u32 {
            guard.at(position);
        }
        assert_eq!(guard.watch.phase, Phase::Running, "{:?}", guard.watch.reason);
        guard
    }
}

/// For f32 and f64.
macro_rules! for_both {
    ($($name:ident)*) => {
        mod single { $(#[test] fn $name() { super::$name::<f32>(); })* }
        mod double { $(#[test] fn $name() { super::$name::<f64>(); })* }
    };
}

for_both! {
    the_torque_rises_and_falls_by_equal_parts
    what_cannot_be_faults_at_once_for_its_own_reason
    a_reading_within_the_limits_is_no_fault
    a_cause_that_stands_cannot_be_cleared
    heat_trips_when_the_first_order_model_says
    a_puck_that_stands_still_under_torque_is_stuck
    five_short_pushes_find_a_dead_encoder
    a_dead_encoder_can_be_cleared_and_is_found_again
    the_torque_is_off_within_the_links_time_of_the_last_heartbeat_the_fade_included
    a_lost_link_fades_out_or_faults
    a_swap_does_not_step_the_torque
    a_stop_within_a_fade_brakes_no_longer_than_the_fade_would_have_taken
    the_position_where_a_real_device_is_armed_is_zero
    a_pulse_tells_the_motors_sign
    braking_opposes_the_motion_and_ends
    a_step_that_a_simulated_hand_announces_is_no_fault
    rocking_a_spring_takes_what_the_hold_leaks
}

fn the_torque_rises_and_falls_by_equal_parts<F: Real>() {
    let mut guard = Guard::<F>::new(&LIMITS, &WORLD);
    assert_eq!(guard.at(0.5).output, F::ZERO);
    let mut last = guard.step(&reading(0.5), Some(Request::Arm)).output.to_f64();
    for k in 2..=10 {
        let guarded = guard.at(0.5);
        let output = guarded.output.to_f64();
        assert!((output - last + 0.05).abs() < 1e-6, "{k}: {output}");
        assert_eq!(guarded.phase == Phase::Running, k == 10);
        last = output;
    }
    guard.step(&reading(0.5), Some(Request::Disarm));
    for k in 2..=10 {
        let guarded = guard.at(0.5);
        assert!((guarded.output.to_f64() + 0.5 - 0.05 * f64::from(k)).abs() < 1e-6, "{k}: {:?}", guarded.output);
        assert_eq!(guarded.phase == Phase::Disarmed, k == 10);
    }
    assert_eq!(guard.watch.output, F::ZERO);
}

/// What is wrong, and the reason for it.
fn faults<F: Real>() -> [(&'static str, Reading<F>, Reason); 10] {
    let f = F::from_f64;
    let still = reading::<F>(0.1);
    let nan = f(f64::NAN);
    [
        ("no position", Reading { position: nan, ..still }, Reason::NotFinite),
        ("no velocity", Reading { velocity: f(f64::INFINITY), ..still }, Reason::NotFinite),
        ("no time", Reading { late: nan, ..still }, Reason::NotFinite),
        ("a jump", reading(0.13), Reason::Jump),
        ("a jump back", reading(0.07), Reason::Jump),
        ("too far in two samples", Reading { missed: 1, ..reading(0.31) }, Reason::Velocity),
        ("too fast in two samples", Reading { missed: 1, ..reading(0.21) }, Reason::Overspeed),
        ("too late", Reading { late: f(5.1e-3), ..still }, Reason::Late),
        ("too early", Reading { late: f(-5.1e-3), ..still }, Reason::Late),
        ("too many missed", Reading { missed: 6, ..still }, Reason::Late),
    ]
}

fn what_cannot_be_faults_at_once_for_its_own_reason<F: Real>() {
    for (what, wrong, reason) in faults::<F>() {
        let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
        let guarded = guard.step(&wrong, None);
        assert_eq!((guarded.phase, guarded.reason), (Phase::Faulted, Some(reason)), "{what}");
        for _ in 0..100 {
            assert_eq!(guarded.output, F::ZERO, "{what}");
            assert_eq!(guard.step(&reading(0.1), Some(Request::Arm)).output, F::ZERO, "{what}");
        }
        assert_eq!(guard.watch.reason, Some(reason), "{what}");
        // And back: clear, then arm.
        assert_eq!(guard.step(&reading(0.1), Some(Request::Clear)).phase, Phase::Disarmed, "{what}");
        assert_eq!(guard.at(0.1).output, F::ZERO, "{what}");
        assert_eq!(guard.step(&reading(0.1), Some(Request::Arm)).phase, Phase::FadingIn, "{what}");
    }
}

fn a_reading_within_the_limits_is_no_fault<F: Real>() {
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    for good in [
        reading(0.125),
        Reading { missed: 4, ..reading(0.125) },
        Reading { late: F::from_f64(4.9e-3), ..reading(0.125) },
        Reading { silent: F::from_f64(0.28), ..reading(0.125) },
    ] {
        assert_eq!(guard.step(&good, None).phase, Phase::Running, "{good:?}");
    }
    // Faster than hands, but with no more torque than friction: nothing drives it.
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.0);
    for k in 0..9 {
        let speed = 6e-3 * f64::from(k);
        guard.watch.output = F::ZERO;
        assert_eq!(guard.at(speed * f64::from(k)).phase, Phase::Running);
    }
}

fn a_cause_that_stands_cannot_be_cleared<F: Real>() {
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    let late = Reading { late: F::from_f64(1.0), ..reading(0.1) };
    for _ in 0..30 {
        guard.step(&late, Some(Request::Clear));
        assert_eq!(guard.watch.phase, Phase::Faulted);
    }
    // Gone only when it has been gone for a while.
    for k in 1..=16 {
        let phase = guard.step(&reading(0.1), Some(Request::Clear)).phase;
        assert_eq!(phase, if k < 16 { Phase::Faulted } else { Phase::Disarmed }, "{k}");
    }
    // Armed while something is wrong it says so, and gives no torque.
    assert_eq!(guard.step(&late, Some(Request::Arm)).reason, Some(Reason::Late));
    assert_eq!(guard.watch.output, F::ZERO);
    // A stop that is held is a cause that stands.
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    for _ in 0..30 {
        assert_eq!(guard.step(&reading(0.1), Some(Request::Stop)).reason, Some(Reason::Stop));
    }
    assert_eq!(guard.step(&reading(0.1), Some(Request::Clear)).phase, Phase::Faulted);
}

fn heat_trips_when_the_first_order_model_says<F: Real>() {
    for (limits, reason) in [
        (Limits { motor: Heat { rms: 0.3, time: 2.0 }, ..LIMITS }, Reason::Heat),
        (Limits { driver: Heat { rms: 0.3, time: 2.0 }, ..LIMITS }, Reason::DriverHeat),
    ] {
        // 0.5 N·m held: τ² (1 - e^{-t/2 s}) reaches rms² at t = -2 s ln(1 - 0.36).
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let mut samples = 15;
        while guard.at(0.5).phase == Phase::Running {
            samples += 1;
        }
        assert_eq!(guard.watch.reason, Some(reason));
        let expected = -2.0 * (1.0_f64 - 0.36).ln() / T;
        assert!((f64::from(samples) - expected).abs() < 5.0, "{samples} {expected}");
        // It cools to half of what it bears in 2 s ln 2.
        let cooling = (2.0 * 2.0_f64.ln() / T) as u32;
        for _ in 0..cooling - 5 {
            assert_eq!(guard.step(&reading(0.5), Some(Request::Clear)).phase, Phase::Faulted);
        }
        for _ in 0..10 {
            guard.step(&reading(0.5), Some(Request::Clear));
        }
        assert_eq!(guard.watch.phase, Phase::Disarmed);
    }
}

fn a_puck_that_stands_still_under_torque_is_stuck<F: Real>() {
    let limits = Limits { stuck: 0.2, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
    let mut samples = 20;
    while guard.at(0.5).phase == Phase::Running {
        samples += 1;
    }
    assert_eq!(guard.watch.reason, Some(Reason::Stuck));
    assert!((199..=205).contains(&samples), "{samples}");
    // One that moves a little every now and then is held by a hand, and one without torque may rest for ever.
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
    for k in 0..1000 {
        assert_eq!(guard.at(if k / 100 % 2 == 0 { 0.5 } else { 0.501 }).phase, Phase::Running);
    }
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.05);
    for _ in 0..1000 {
        assert_eq!(guard.at(0.05).phase, Phase::Running);
    }
}

fn a_lost_link_fades_out_or_faults<F: Real>() {
    let silent = Reading { silent: F::from_f64(0.31), ..reading(0.5) };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.5);
    let mut last = guard.watch.output.abs();
    for _ in 0..10 {
        let guarded = guard.step(&silent, None);
        assert!(guarded.output.abs() < last);
        assert_eq!(guarded.reason, Some(Reason::Link));
        last = guarded.output.abs();
    }
    assert_eq!((guard.watch.phase, guard.watch.output), (Phase::Disarmed, F::ZERO));
    assert_eq!(guard.step(&silent, Some(Request::Arm)).phase, Phase::Disarmed);
    assert_eq!(guard.step(&reading(0.5), Some(Request::Arm)).phase, Phase::FadingIn);
    assert_eq!(guard.watch.reason, None);

    let mut guard = Guard::<F>::running(&Limits { link_faults: true, ..LIMITS }, &WORLD, 0.5);
    let guarded = guard.step(&silent, None);
    assert_eq!((guarded.phase, guarded.reason, guarded.output), (Phase::Faulted, Some(Reason::Link), F::ZERO));
    assert_eq!(guard.step(&silent, Some(Request::Clear)).phase, Phase::Faulted);
    assert_eq!(guard.step(&reading(0.5), Some(Request::Clear)).phase, Phase::Disarmed);
}

fn the_torque_is_off_within_the_links_time_of_the_last_heartbeat_the_fade_included<F: Real>() {
    for (link, fade, delay, faults, brake) in [
        (0.3, 0.1, 0.0, false, 0.0),
        (0.15, 0.1, 0.004, false, 0.0),
        (0.3, 0.0123, 0.0025, false, 0.0),
        (0.05, 0.04, 0.0, false, 0.0),
        (0.05, 0.1, 0.001, true, 0.0),
        (0.3, 0.1, 0.0, false, 1e-3),
        // What brakes after the fault is a torque too.
        (0.3, 0.1, 0.001, true, 1e-3),
    ] {
        let limits = Limits { link, fade, delay, link_faults: faults, brake, ..LIMITS };
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let off = (1..1000).find(|k| {
            let silent = F::from_f64(T * f64::from(*k));
            guard.step(&Reading { silent, ..reading(0.5 + 1e-3 * f64::from(*k)) }, None).output == F::ZERO
        });
        let off = T * f64::from(off.unwrap()) + delay;
        assert!(off <= link + 1e-6, "off after {off} s of {link} s");
        // And no sooner than it has to be.
        assert!(off > link - 3.5 * T, "off after {off} s of {link} s");
    }
    // No fade fits in there.
    let spec = Limits { link: 0.1, fade: 0.1, ..LIMITS };
    let error = Supervisor::<F, 1, 1>::new(&spec, &WORLD).unwrap_err().to_string();
    assert!(error.contains("link") && error.contains("fade"), "{error}");
}

fn a_swap_does_not_step_the_torque<F: Real>() {
    let soft = [Coupling { law: Law::Spring { stiffness: 0.2 * K, rest: 0.0 }, ..SPRING[0] }];
    let spec = Spec { couplings: &soft, ..WORLD };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.5);
    let next = Guard::<F>::new(&LIMITS, &spec);
    let mut last = guard.watch.output;
    (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
    guard.watch.swap(guard.world.period(), guard.world.period());
    for k in 0..12 {
        let output = guard.at(0.5).output;
        let step = (output - last).to_f64();
        // From -0.5 to -0.1 in the ten samples of a fade, after one without a change.
        let expected = if (1..=10).contains(&k) { 0.04 } else { 0.0 };
        assert!((step - expected).abs() < 1e-6, "{k}: {step}");
        last = output;
    }
    assert_eq!(guard.watch.phase, Phase::Running);
}

/// The torque fades out for whatever reason, and then somebody presses stop.
fn a_stop_within_a_fade_brakes_no_longer_than_the_fade_would_have_taken<F: Real>() {
    let limits = Limits { brake: 1e-3, ..LIMITS };
    for pressed in 1..9 {
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let off = (0..30).find(|k| {
            let request = match *k {
                0 => Some(Request::Disarm),
                k if k == pressed => Some(Request::Stop),
                _ => None,
            };
            guard.step(&reading(0.5 + 1e-3 * f64::from(*k)), request).output == F::ZERO
        });
        assert_eq!(guard.watch.reason, Some(Reason::Stop));
        assert!(off.unwrap() <= (limits.fade / T) as u32, "off after {off:?} samples");
    }
}

fn the_position_where_a_real_device_is_armed_is_zero<F: Real>() {
    let limits = Limits { zero_where_armed: true, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 3.0);
    assert_eq!(guard.watch.output, F::ZERO);
    assert!((guard.at(3.02).sample.puck.position.to_f64() - 0.02).abs() < 1e-6);
    assert_eq!(guard.watch.offset.to_f64(), 3.0);
}

/// Arms on a free puck that feels `motor` times the torque and is seen `encoder` times as far; how it ends.
fn armed<F: Real>(motor: f64, encoder: f64) -> (Phase, Option<Reason>, f64) {
    let limits = Limits { pulse: 0.05, friction: 0.0, zero_where_armed: true, ..LIMITS };
    let count = std::f64::consts::TAU / 4000.0;
    let mut guard = Guard::<F>::new(&limits, &Spec { count: Some(count), ..WORLD });
    let (mut position, mut velocity, mut farthest) = (0.0_f64, 0.0, 0.0_f64);
    for k in 0..2000 {
        let seen = encoder * (position / count).round() * count;
        let guarded = guard.step(&reading(seen), (k == 30).then_some(Request::Arm));
        if matches!(guarded.phase, Phase::Running | Phase::Faulted) {
            return (guarded.phase, guarded.reason, farthest);
        }
        velocity += T * motor * guarded.output.to_f64() / limits.inertia;
        position += T * velocity;
        farthest = farthest.max(position.abs());
    }
    unreachable!("it never ended");
}

fn a_pulse_tells_the_motors_sign<F: Real>() {
    let (phase, reason, farthest) = armed::<F>(1.0, 1.0);
    assert_eq!((phase, reason), (Phase::Running, None));
    assert!(farthest < 0.1, "{farthest} rad");
    for (motor, encoder) in [(-1.0, 1.0), (1.0, -1.0)] {
        assert_eq!(armed::<F>(motor, encoder).1, Some(Reason::Reversed));
    }
    // No motor, no encoder, or a hand in the way: no answer.
    for (motor, encoder) in [(0.0, 1.0), (1.0, 0.0), (0.05, 1.0)] {
        assert_eq!(armed::<F>(motor, encoder).1, Some(Reason::Stuck));
    }
}

fn braking_opposes_the_motion_and_ends<F: Real>() {
    for (brake, brakes) in [(1e-2, true), (0.0, false)] {
        let mut guard = Guard::<F>::running(&Limits { brake, ..LIMITS }, &WORLD, 0.1);
        guard.at(0.11);
        guard.at(0.12);
        let mut position = 0.12;
        for k in 0..30 {
            position += 0.01;
            let guarded = guard.step(&reading(position), (k == 0).then_some(Request::Stop));
            assert_eq!(guarded.phase, Phase::Faulted);
            let torque = guarded.output.to_f64();
            assert_eq!(torque < 0.0, brakes && k < 9, "{k}: {torque}");
            assert!(torque.abs() <= 10.0 * brake, "{k}: {torque}");
        }
        // A reading that is wrong ends it.
        let mut guard = Guard::<F>::running(&Limits { brake, ..LIMITS }, &WORLD, 0.1);
        guard.at(0.11);
        guard.step(&reading(0.12), Some(Request::Stop));
        assert_eq!(guard.at(0.5).output, F::ZERO);
        assert_eq!(guard.at(0.51).output, F::ZERO);
    }
}

fn a_step_that_a_simulated_hand_announces_is_no_fault<F: Real>() {
    let step = Reading { announced: true, ..reading(0.7) };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.0);
    assert_eq!(guard.step(&step, None).phase, Phase::Running);
    assert_eq!(guard.at(0.7).phase, Phase::Running);
    let mut guard = Guard::<F>::running(&Limits { announcements: false, ..LIMITS }, &WORLD, 0.0);
    assert_eq!(guard.step(&step, None).reason, Some(Reason::Jump));
}

/// To d and back: out for nothing, against the torque held before, and back with K d held. Without damping the hand gets K d² each
/// time, and no more of them than the ledger lets pass.
fn rocking_a_spring_takes_what_the_hold_leaks<F: Real>() {
    let (d, most) = (0.02, 0.0101);
    let limits = Limits { damping: 0.0, energy: most, jump: 1.0, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.0);
    let mut times = 0;
    loop {
        guard.at(d);
        if guard.at(0.0).phase == Phase::Faulted {
            break;
        }
        times += 1;
        let left = guard.watch.account().to_f64();
        assert!((left - (most - K * d * d * f64::from(times))).abs() < 1e-6, "{times}: {left}");
    }
    assert_eq!((times, guard.watch.reason), ((most / (K * d * d)) as i32, Some(Reason::PortEnergy)));
}

/// Held still, forward Euler's energy is (1 + x²)^k of the first, and all of it is made.
#[test]
fn forward_eulers_growth_is_the_ledgers_residual() {
    let angle = 0.1_f64;
    let inertia = K * (T / angle).powi(2);
    let bodies = [Body { inertia, position: 0.3, velocity: 0.0 }];
    let couplings = [Coupling { second: End::Body(0), ..SPRING[0] }];
    let spec =
        Spec { method: Method::ForwardEuler, output: Output::Start, bodies: &bodies, couplings: &couplings, ..WORLD };
    let mut guard = Guard::<f64>::new(&Limits { energy: 10.0, world_trips: false, ..LIMITS }, &spec);
    guard.step(&reading(0.0), Some(Request::Arm));
    let first = 0.5 * K * 0.3 * 0.3;
    // The ledger is opened with the first sample, whose step is already taken.
    for k in 2..300 {
        guard.at(0.0);
        let expected = first * ((1.0 + angle * angle).powi(k) - (1.0 + angle * angle));
        let made = guard.watch.made() - first * angle * angle;
        assert!((made - expected).abs() < 1e-9 * expected, "{k}: {made} {expected}");
    }
    // Where it may make less, it warns or trips.
    for (world_trips, phase) in [(false, Phase::Running), (true, Phase::Faulted)] {
        let mut guard = Guard::<f64>::new(&Limits { world_trips, ..LIMITS }, &spec);
        guard.step(&reading(0.0), Some(Request::Arm));
        while guard.watch.warning.is_none() && guard.watch.phase != Phase::Faulted {
            guard.at(0.0);
        }
        let over = guard.watch.made();
        assert!(over > LIMITS.energy && over < 1.05 * LIMITS.energy, "{over}");
        for _ in 0..20 {
            guard.at(0.0);
        }
        assert_eq!(guard.watch.phase, phase);
        assert_eq!(guard.watch.reason, world_trips.then_some(Reason::WorldEnergy));
    }
}

/// A body on the puck and one on ground, with all that couples them.
fn network() -> impl Strategy<Value = (Vec<Body>, Vec<Coupling>)> {
    let body = (1e-4..1e-2, -0.5..0.5, -5.0..5.0).prop_map(|(inertia, position, velocity)| Body {
        inertia,
        position,
        velocity,
    });
    let pairs = [
        (End::Puck, End::Body(0)),
        (End::Body(0), End::Body(1)),
        (End::Body(1), End::Ground),
        (End::Puck, End::Ground),
    ];
    let free = prop_oneof![
        (0.1..20.0, -0.2..0.2).prop_map(|(stiffness, rest)| Law::Spring { stiffness, rest }),
        (0.0..0.02).prop_map(|damping| Law::Damper { damping: Damping::Fixed(damping) }),
        (0.1..20.0, -0.2..0.2, 0.0..0.01).prop_map(|(stiffness, at, damping)| Law::Wall {
            side: hapt_core::Side::Above,
            at,
            stiffness,
            damping
        }),
        (0.01..0.2, 0.3..2.0).prop_map(|(torque, pitch)| Law::Detent { torque, pitch, phase: 0.1 }),
        (0.1..20.0, -0.2..0.2, 0.0..0.2).prop_map(|(stiffness, rest, width)| Law::DeadBand { stiffness, rest, width }),
        (0.01..0.2, 0.1..1.0, -0.2..0.2).prop_map(|(torque, width, at)| Law::Magnet { torque, width, at }),
        (0.01..0.1, 0.3..2.0, waveform()).prop_map(|(torque, pitch, waveform)| Law::Texture {
            torque,
            pitch,
            phase: 0.1,
            waveform
        }),
        (-0.1..0.1).prop_map(|torque| Law::Constant { torque }),
        (0.0..0.05).prop_map(|torque| Law::Coulomb { torque }),
    ];
    let law = prop_oneof![
        9 => free.prop_map(|law| (law, None)),
        1 => (0.1..20.0, 0.01..0.5).prop_map(|(stiffness, limit)| (Law::Spring { stiffness, rest: 0.0 }, Some(limit))),
    ];
    let couplings = proptest::collection::vec((0usize..4, law), 2..8).prop_map(move |all| {
        all.into_iter()
            .map(|(pair, (law, limit))| Coupling { first: pairs[pair].0, second: pairs[pair].1, law, limit })
            .collect()
    });
    (proptest::collection::vec(body, 2), couplings)
}

proptest! {
    /// What the methods that find torques make is nothing, whatever is coupled and however the puck moves.
    #[test]
    fn an_exact_step_makes_no_energy(
        (bodies, couplings) in network(),
        method in proptest::sample::select([Method::Zoh, Method::Trapezoidal, Method::BackwardEuler].to_vec()),
        steps in proptest::collection::vec(-0.02..0.02f64, 300),
    ) {
        let spec = Spec { method, limit: None, bodies: &bodies, couplings: &couplings, ..WORLD };
        let mut guard = Guard::<f64>::new(&Limits { jump: 1.0, torque: f64::INFINITY, energy: 1e9, ..LIMITS }, &spec);
        let mut position = 0.0;
        guard.step(&reading(position), Some(Request::Arm));
        for step in steps {
            position += step;
            guard.at(position);
            prop_assert!(guard.watch.made() < 1e-9, "{}", guard.watch.made());
        }
        prop_assert!(guard.watch.phase == Phase::Running);
    }

    /// The energy theorem in the ledger's own numbers: springs to the puck under the exact hold, b no less than half of K T, and the
    /// account stays where it began, wherever the puck is taken.
    #[test]
    fn a_theorem_world_never_draws_on_its_account(
        inertia in 1e-4..1e-2f64, stiffness in 0.1..20.0f64, own in 0.0..20.0f64,
        steps in proptest::collection::vec(-0.02..0.02f64, 300),
    ) {
        let bodies = [Body { inertia, position: 0.3, velocity: -2.0 }];
        let spring = |second, stiffness| Coupling { first: End::Puck, second, law: Law::Spring { stiffness, rest: 0.0 }, limit: None };
        let couplings = [spring(End::Body(0), stiffness), spring(End::Ground, own)];
        let spec = Spec { bodies: &bodies, couplings: &couplings, ..WORLD };
        let damping = 0.5 * (stiffness + own) * T;
        let limits = Limits { damping, jump: 1.0, slew: f64::INFINITY, ..LIMITS };
        let mut guard = Guard::<f64>::new(&limits, &spec);
        let mut position = 0.0;
        guard.step(&reading(position), Some(Request::Arm));
        for step in steps {
            position += step;
            prop_assert!(guard.at(position).phase != Phase::Faulted);
            prop_assert!(guard.watch.account() > limits.energy * (1.0 - 1e-9));
        }
    }

    /// The same of a spring behind a delay, whole or not, on the least damping that makes it passive: what the delay has under way is
    /// not taken off the account.
    #[test]
    fn a_passive_spring_behind_a_delay_never_draws_on_its_account(
        stiffness in 0.1..20.0f64, delay in prop_oneof![0.0..12.0f64, (0..12u8).prop_map(f64::from)], energy in 1e-9..1e-3f64,
        ways in proptest::collection::vec((-0.02..0.02f64, 1..20u8), 60),
    ) {
        let couplings = [Coupling { law: Law::Spring { stiffness, rest: 0.0 }, ..SPRING[0] }];
        let spec = Spec { couplings: &couplings, limit: Some(1e3), ..WORLD };
        let damping = (0.5 + delay) * stiffness * T;
        let limits = Limits { damping, energy, delay: delay * T, torque: 1e3, jump: 1.0, slew: f64::INFINITY, ..LIMITS };
        let mut guard = Guard::<f64>::new(&limits, &spec);
        let mut position = 0.0;
        guard.step(&reading(position), Some(Request::Arm));
        for (step, samples) in ways {
            for _ in 0..samples {
                position += step;
                prop_assert!(guard.at(position).phase != Phase::Faulted, "{:?}", guard.watch.reason);
                prop_assert!(guard.watch.account() > energy * (1.0 - 1e-9) - 1e-12);
            }
        }
    }

    /// A sample that is like the last takes a shorter way than one that is announced, and an announcement that nobody believes sends
    /// it the other: what is made of it, and all that is remembered, is the same.
    #[test]
    fn an_announcement_that_is_not_believed_changes_nothing(
        samples in proptest::collection::vec((any::<u64>(), 0u8..8, -1.0..1.0f64, 0u32..20, 0u8..200), 600),
        (energy, heat, slew) in (1e-4..1e-2f64, 0.1..0.8f64, 0.003..0.03f64),
        (delay, brake, trips) in (0.0..3e-3f64, 0.0..1e-2f64, any::<(bool, bool, bool)>()),
    ) {
        let bodies = [Body { inertia: 1e-3, position: 0.1, velocity: 0.0 }];
        let couplings = [SPRING[0], Coupling { second: End::Body(0), ..SPRING[0] }];
        let soft = [Coupling { law: Law::Spring { stiffness: 0.2 * K, rest: 0.0 }, ..SPRING[0] }];
        let spec = Spec { method: Method::ForwardEuler, output: Output::Start, bodies: &bodies, couplings: &couplings, ..WORLD };
        let limits = Limits {
            energy, slew, delay, brake, stuck: 5e-3, jump: 0.009, overspeed: 9.0,
            motor: Heat { rms: heat, time: 0.1 }, announcements: false,
            link_faults: trips.0, world_trips: trips.1, port_trips: trips.2, ..LIMITS
        };
        let next = Guard::<f32>::new(&limits, &Spec { couplings: &soft, ..spec });
        let mut guards = [(); 2].map(|()| Guard::<f32>::new(&limits, &spec));
        let (mut position, mut speed) = (0.0, 0.0);
        for (bits, how, by, missed, asked) in samples {
            speed = 0.9 * speed + 2e-3 * by;
            // Now and then it rests.
            position += if how == 7 { 0.0 } else { speed };
            let mut now = Reading { missed: u32::from(missed == 2), velocity: (speed / T) as f32, ..reading(position) };
            let wild = f32::from_bits(bits as u32);
            match how {
                0 if bits % 13 == 0 => now.position = wild,
                1 if bits % 13 == 0 => now.late = wild,
                2 if bits % 13 == 0 => now.silent = wild,
                3 if bits % 13 == 0 => now.velocity = wild,
                _ => {}
            }
            let request = match asked {
                0 => Some(Request::Stop),
                1 => Some(Request::Disarm),
                2..=40 => Some(Request::Arm),
                41..=60 => Some(Request::Clear),
                _ => None,
            };
            let [short, long] = [false, true].map(|announced| {
                let guard = &mut guards[usize::from(announced)];
                if asked == 100 {
                    (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
                    guard.watch.swap(guard.world.period(), guard.world.period());
                }
                (guard.step(&Reading { announced, ..now }, request), guard.watch, guard.state)
            });
            // As text what is no number is equal to itself.
            prop_assert!(short == long || format!("{short:?}") == format!("{long:?}"), "{short:?}\n{long:?}");
        }
    }

    /// Whatever is read and asked for, the torque is finite, within the limit, and none without an arming since the last fault.
    #[test]
    fn no_reading_and_no_request_makes_a_torque_that_may_not_be(
        samples in proptest::collection::vec((any::<u64>(), 0u8..8, -1.0..1.0f64, 0u32..3, 0u8..40), 400),
    ) {
        let mut guard = Guard::<f64>::new(&LIMITS, &WORLD);
        let mut position = 0.0;
        let mut may = false;
        for (bits, how, by, missed, asked) in samples {
            position += 0.01 * by;
            let mut now = Reading { missed: u32::from(missed == 2), ..reading(position) };
            match how {
                0 if bits % 7 == 0 => now.position = f64::from_bits(bits),
                1 if bits % 7 == 0 => now.late = f64::from_bits(bits),
                2 if bits % 7 == 0 => now.silent = f64::from_bits(bits),
                3 if bits % 7 == 0 => now.velocity = f64::from_bits(bits),
                _ => {}
            }
            let request = match asked {
                0 => Some(Request::Stop),
                1 => Some(Request::Disarm),
                2..=8 => Some(Request::Arm),
                9..=12 => Some(Request::Clear),
                _ => None,
            };
            let before = guard.watch.phase;
            let guarded = guard.step(&now, request);
            may = match guarded.phase {
                Phase::FadingIn if before == Phase::Disarmed => request == Some(Request::Arm),
                Phase::Disarmed | Phase::Faulted => false,
                _ => may,
            };
            prop_assert!(guarded.output.is_finite() && guarded.output.abs() <= 0.8 * (1.0 + 1e-12));
            prop_assert!(may || guarded.output == 0.0);
            prop_assert!(before != Phase::Faulted || matches!(guarded.phase, Phase::Faulted | Phase::Disarmed));
            prop_assert!(before != Phase::Faulted || guarded.phase == Phase::Faulted || request == Some(Request::Clear));
            prop_assert_eq!(guarded.phase == Phase::Faulted, guarded.phase == Phase::Faulted && guarded.reason.is_some());
        }
    }
}

#[test]
fn a_command_beyond_its_limit_and_a_slew_beyond_its_own_are_faults() {
    let mut guard = Guard::<f64>::running(&Limits { torque: 0.3, ..LIMITS }, &WORLD, 0.28);
    assert_eq!(guard.at(0.31).reason, Some(Reason::Jump));
    let mut guard = Guard::<f64>::running(&Limits { torque: 0.3, ..LIMITS }, &WORLD, 0.28);
    assert_eq!(guard.at(0.301).reason, Some(Reason::Torque));
    let mut guard = Guard::<f64>::running(&Limits { slew: 0.01, ..LIMITS }, &WORLD, 0.0);
    assert_eq!(guard.at(0.009).phase, Phase::Running);
    assert_eq!(guard.at(0.02).reason, Some(Reason::Slew));
}

#[test]
fn codes_and_names_are_each_their_own() {
    for (i, reason) in Reason::ALL.into_iter().enumerate() {
        assert_eq!(usize::from(reason.code()), i + 1);
        assert_eq!(Reason::from_code(reason.code()), Some(reason));
        assert!(reason.sentence().ends_with('.') && reason.remedy().ends_with('.'));
        assert!(Reason::ALL.iter().filter(|other| other.name() == reason.name()).count() == 1);
    }
    assert_eq!(Reason::from_code(0), None);
    assert_eq!(Reason::from_code(200), None);
}

#[test]
fn limits_that_are_none_are_refused_by_name() {
    for (limits, name) in [
        (Limits { fade: 0.0, ..LIMITS }, "fade"),
        (Limits { velocity: f64::NAN, ..LIMITS }, "velocity"),
        (Limits { energy: -1.0, ..LIMITS }, "energy"),
        (Limits { pulse: f64::INFINITY, ..LIMITS }, "pulse"),
        (Limits { delay: -1.0, ..LIMITS }, "delay"),
    ] {
        let error = Supervisor::<f64, 4, 8>::new(&limits, &WORLD).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
}
