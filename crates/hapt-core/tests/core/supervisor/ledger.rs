//! Both energy ledgers in closed form, and over random worlds.

use hapt_core::{Body, Damping, Reason};
use hapt_testing::laws::{SIZES, Sizes, goes_to_bodies, some_limited};
use hapt_testing::prelude::*;

use super::*;

for_both! {
    rocking_a_spring_takes_what_the_hold_leaks
}

/// To d and back: out against the torque held before, which is 0, and back with K d held. Without damping the hand gets K d² each time,
/// until the ledger trips.
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

/// Held still, forward Euler's energy is (1 + x²)^k of the first, and all of the growth is generated.
#[test]
fn forward_eulers_growth_is_the_ledgers_residual() {
    for every in [1, 4] {
        grows_by_forward_euler(every);
    }
}

/// The bodies step at every `every`-th sample, by as many periods: between their steps no energy is generated.
fn grows_by_forward_euler(every: u32) {
    let angle = 0.1_f64;
    let inertia = K * (f64::from(every) * T / angle).powi(2);
    let bodies = [Body { inertia, position: 0.3, velocity: 0.0 }];
    let couplings = [Coupling { second: End::Body(0), ..SPRING[0] }];
    let spec = Spec {
        method: Method::ForwardEuler,
        output: Output::Start,
        bodies: &bodies,
        couplings: &couplings,
        bodies_every: every,
        ..WORLD
    };
    let mut guard = Guard::<f64>::new(&Limits { energy: 10.0, world_trips: false, ..LIMITS }, &spec);
    guard.step(&reading(0.0), Some(Request::Arm));
    let first = 0.5 * K * 0.3 * 0.3;
    // The ledger begins with the first sample, whose step is already taken.
    for sample in 1..300 {
        guard.at(0.0);
        let k = 1 + sample / every as i32;
        let expected = first * ((1.0 + angle * angle).powi(k) - (1.0 + angle * angle));
        let made = guard.watch.made() - first * angle * angle;
        assert!((made - expected).abs() < 1e-9 * (first + expected), "{k}: {made} {expected}");
    }
    // With a lower bound on the generated energy, it warns or trips.
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

/// With a puck that is moved by steps, each for a number of samples.
fn never_draws_on_its_account(limits: &Limits, spec: &Spec, steps: &[(f64, u8)]) -> Result<(), TestCaseError> {
    let mut guard = Guard::<f64>::new(limits, spec);
    let mut position = 0.0;
    guard.step(&reading(position), Some(Request::Arm));
    for (step, samples) in steps {
        for _ in 0..*samples {
            position += step;
            prop_assert!(guard.at(position).phase != Phase::Faulted, "{:?}", guard.watch.reason);
            prop_assert!(guard.watch.account() > limits.energy * (1.0 - 1e-9) - 1e-12, "{}", guard.watch.account());
        }
    }
    Ok(())
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
    let sizes = Sizes { damping: 0.0..=0.01, torque: 0.0..=0.2, length: 0.2..=2.0, ..SIZES };
    let law = some_limited(sizes.laws(goes_to_bodies), 0.01..0.5);
    let couplings = proptest::collection::vec((0usize..4, law), 2..8).prop_map(move |all| {
        all.into_iter()
            .map(|(pair, (law, limit))| Coupling { first: pairs[pair].0, second: pairs[pair].1, law, limit })
            .collect()
    });
    (proptest::collection::vec(body, 2), couplings)
}

proptest! {
    /// The methods that find torques generate no energy, for any couplings and any motion of the puck.
    #[test]
    fn an_exact_step_makes_no_energy(
        (bodies, couplings) in network(),
        method in proptest::sample::select([Method::Zoh, Method::Trapezoidal, Method::BackwardEuler].to_vec()),
        steps in proptest::collection::vec(-0.02..0.02f64, 300), bodies_every in prop_oneof![Just(1), 2..20u32],
    ) {
        let spec = Spec { method, limit: None, bodies: &bodies, couplings: &couplings, bodies_every, ..WORLD };
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
        steps in proptest::collection::vec(-0.02..0.02f64, 300), bodies_every in prop_oneof![Just(1), 2..20u32],
    ) {
        let bodies = [Body { inertia, position: 0.3, velocity: -2.0 }];
        let spring = |second, stiffness| Coupling { first: End::Puck, second, law: Law::Spring { stiffness, rest: 0.0 }, limit: None };
        let couplings = [spring(End::Body(0), stiffness), spring(End::Ground, own)];
        let spec = Spec { bodies: &bodies, couplings: &couplings, bodies_every, ..WORLD };
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

    /// The same with all laws of the position, and with the frictions and dampers that the puck does not move, by every method that keeps
    /// energy, at one rate and at two.
    #[test]
    fn no_passive_world_draws_on_its_account(
        (bodies, couplings) in network(),
        method in proptest::sample::select([Method::Zoh, Method::Trapezoidal, Method::BackwardEuler].to_vec()),
        bodies_every in prop_oneof![Just(1), 2..20u32], steps in proptest::collection::vec(-0.02..0.02f64, 300),
    ) {
        let is_at_puck = |c: &Coupling| c.first == End::Puck || c.second == End::Puck;
        let takes_velocity = |c: &Coupling| c.law.slopes().damping != Damping::Fixed(0.0) || c.law.slopes().friction > 0.0;
        let is_covered = |c: &Coupling| c.law.constant().is_none() && !(is_at_puck(c) && takes_velocity(c));
        let couplings: Vec<Coupling> = couplings.into_iter().filter(is_covered).collect();
        let stiffness: f64 = couplings.iter().filter(|c| is_at_puck(c)).map(|c| c.law.slopes().stiffness).sum();
        let spec = Spec { method, limit: None, bodies: &bodies, couplings: &couplings, bodies_every, ..WORLD };
        let limits =
            Limits { damping: 0.5 * stiffness * T, jump: 1.0, torque: f64::INFINITY, slew: f64::INFINITY, ..LIMITS };
        let mut guard = Guard::<f64>::new(&limits, &spec);
        let mut position = 0.0;
        guard.step(&reading(position), Some(Request::Arm));
        for step in steps {
            position += step;
            prop_assert!(guard.at(position).phase != Phase::Faulted, "{:?}", guard.watch.reason);
            prop_assert!(guard.watch.account() > limits.energy * (1.0 - 1e-9));
        }
    }

    /// The same for a spring behind a delay, whole or not, with the least damping that makes it passive: the charges that the delay still
    /// holds do not trip the account.
    #[test]
    fn a_passive_spring_behind_a_delay_never_draws_on_its_account(
        stiffness in 0.1..20.0f64, delay in prop_oneof![0.0..12.0f64, (0..12u8).prop_map(f64::from)], energy in 1e-9..1e-3f64,
        steps in proptest::collection::vec((-0.02..0.02f64, 1..20u8), 60),
    ) {
        let couplings = [Coupling { law: Law::Spring { stiffness, rest: 0.0 }, ..SPRING[0] }];
        let spec = Spec { couplings: &couplings, limit: Some(1e3), ..WORLD };
        let damping = (0.5 + delay) * stiffness * T;
        let limits = Limits { damping, energy, delay: delay * T, torque: 1e3, jump: 1.0, slew: f64::INFINITY, ..LIMITS };
        never_draws_on_its_account(&limits, &spec, &steps)?;
    }

    /// The same for laws behind a filter of the position, with the least damping that its lag requires, with a delay or without: a step of
    /// the hand that the filter has not followed yet does not trip the account, however slow the filter is.
    #[test]
    fn passive_laws_behind_a_filter_never_draw_on_their_account(
        (_, couplings) in network(), decades in prop_oneof![-300.0..0.5f64, 0.5..3.5f64], delay in prop_oneof![Just(0.0), (0..4u8).prop_map(f64::from)],
        energy in 1e-9..1e-3f64, steps in proptest::collection::vec((-0.02..0.02f64, 1..20u8), 60),
    ) {
        let is_covered = |c: &Coupling| c.law.constant().is_none() && c.law.slopes().damping == Damping::Fixed(0.0) && c.law.slopes().friction == 0.0;
        let couplings: Vec<Coupling> = couplings
            .into_iter()
            .filter(is_covered)
            .map(|c| Coupling { first: End::Puck, second: End::Ground, ..c })
            .collect();
        let stiffness: f64 = couplings.iter().map(|c| c.law.slopes().stiffness).sum();
        let filter = 10f64.powf(decades);
        let spec = Spec { filter: Some(filter), couplings: &couplings, limit: Some(1e3), ..WORLD };
        let gain = -(-std::f64::consts::TAU * filter * T).exp_m1();
        let damping = (0.5 + delay + (1.0 - gain) / gain) * stiffness * T;
        let limits = Limits { damping, energy, delay: delay * T, torque: 1e3, jump: 1.0, slew: f64::INFINITY, ..LIMITS };
        never_draws_on_its_account(&limits, &spec, &steps)?;
    }
}
