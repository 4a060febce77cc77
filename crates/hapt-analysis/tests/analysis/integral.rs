//! The integral term of a PID controller: the hands-off loop by its eigenvalues, and no claim of passivity.

use hapt_analysis::{Status, Verdict, check, free_growth, gripped_growth, is_certified, worst_grip};
use hapt_core::{Loop, Puck};
use hapt_model::{Coupling, Delay, End, EstimatorKind, Law, Method, Output, World};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use crate::common::*;

type Room = Loop<f64, 2, 4, 2>;

fn integral(stiffness: f64, time: f64) -> Coupling {
    Law::Integral { stiffness, time, rest: 0.0 }.between(End::Ground, End::Puck)
}

fn pid(period: f64, [k, b, gain]: [f64; 3]) -> World {
    let couplings =
        vec![spring(End::Puck, End::Ground, k), damper(End::Puck, End::Ground, b), integral(gain * 0.5, 0.5)];
    Bench::of(couplings).world(Method::Zoh, Output::End, period)
}

/// The effect of one sample of the core on the exact puck on each part of the state: z, ż, the sum, z and v before, the filtered z, the
/// last command.
fn map(world: &World) -> DMatrix<f64> {
    let core = Room::new(&world.spec()).unwrap();
    let (j, b, period) = (world.device.inertia, world.device.damping, world.sampling.period);
    let equations = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, -b / j, 1.0 / j, 0.0, 0.0, 0.0]);
    let late = world.sampling.delay_s();
    let parts = [(late, 1), (period - late, 0)].map(|(h, age)| ((&equations * h).exp(), age));
    let place = world.couplings.iter().position(|c| c.law.integrates()).unwrap();
    let step = |s: [f64; 7]| {
        let mut state = core.start();
        state.bristles[place] = s[2];
        state.memory.last = Some(Puck { position: s[3], velocity: s[4] });
        state.memory.filtered = s[5];
        let sample = core.step(&mut state, s[0], 0.0);
        let commands = [sample.command, s[6]];
        let mut puck = (s[0], s[1]);
        for (part, age) in &parts {
            let at = |i: usize| part[(i, 0)] * puck.0 + part[(i, 1)] * puck.1 + part[(i, 2)] * commands[*age];
            puck = (at(0), at(1));
        }
        let filtered = if world.sampling.filter.is_some() { state.memory.filtered } else { 0.0 };
        [puck.0, puck.1, state.bristles[place], s[0], sample.puck.velocity, filtered, commands[0]]
    };
    let columns: Vec<[f64; 7]> = (0..7).map(|i| step(std::array::from_fn(|j| f64::from(u8::from(i == j))))).collect();
    DMatrix::from_fn(7, 7, |i, j| columns[j][i])
}

proptest! {
    #![proptest_config(hapt_testing::cases(128))]

    /// The growth of the certificate is that of the real loop on an exact puck, with delays and filters.
    #[test]
    fn the_growth_is_that_of_the_real_loop(
        angle in 0.01..0.6f64, zeta in 0.0..1.0f64, share in 0.05..3.0f64, late in prop_oneof![Just(0.0), 0.0..0.9f64],
        filter in prop::option::of(10.0..300.0f64),
    ) {
        let (period, inertia) = (1e-3, 6.4e-4);
        let omega = angle / period;
        let (k, b) = (inertia * omega * omega, 2.0 * zeta * inertia * omega);
        let mut world = pid(period, [k, b, share * k * (b + 1.2e-3) / inertia]);
        world.sampling.estimator = EstimatorKind::Difference;
        world.sampling.delay = Delay::Seconds(late * period);
        world.sampling.filter = filter;
        let most = map(&world).complex_eigenvalues().iter().map(|l: &Complex<f64>| l.norm()).fold(0.0, f64::max);
        let found = free_growth(&world).unwrap().unwrap();
        prop_assert!((found - most.ln() / period).abs() < 1e-6 * (1.0 / period), "{found} {}", most.ln() / period);
    }

    /// J s³ + B s² + K s + k_i: the differential equation is stable up to k_i = K B/J (Routh and Hurwitz), and so is a fast loop.
    #[test]
    fn a_fast_loop_grows_beyond_the_gain_of_routh_and_hurwitz(k in 0.1..10.0f64, b in 1e-2..0.1f64) {
        let world = |share: f64| {
            let mut world = pid(1e-6, [k, b, share * k * (b + 1.2e-3) / 6.4e-4]);
            world.sampling.estimator = EstimatorKind::Exact;
            world
        };
        prop_assert!(free_growth(&world(0.98)).unwrap().unwrap() < 0.0);
        prop_assert!(free_growth(&world(1.02)).unwrap().unwrap() > 0.0);
        let found = check(&world(0.5)).unwrap();
        // The modes of the differential equation are the roots of the cubic.
        for mode in &found.free.modes {
            let (omega, zeta) = (mode.frequency_hz * std::f64::consts::TAU, mode.damping_ratio);
            let s = Complex::new(-zeta, (1.0 - zeta * zeta).sqrt()) * omega;
            let gain = 0.5 * k * (b + 1.2e-3) / 6.4e-4;
            let size = 6.4e-4 * omega.powi(3);
            prop_assert!((s * s * s * 6.4e-4 + s * s * (b + 1.2e-3) + s * k + gain).norm() < 1e-6 * size);
        }
    }

    /// No theorem claims that it is passive on any device: with a heavy hand on a soft spring it grows.
    #[test]
    fn it_is_never_claimed_to_be_passive_and_a_slow_hand_grows(
        k in 0.0..5.0f64, b in 0.0..0.02f64, gain in 0.5..50.0f64, damping in 1e-3..1.0f64, limit in prop::option::of(0.01..1.0f64),
        late in prop_oneof![Just(0.0), 1e-4..3e-3f64],
    ) {
        let mut world = pid(1e-3, [k, b, gain]);
        world.couplings[2].limit = limit;
        world.device.damping = damping;
        world.sampling.delay = Delay::Seconds(late);
        let found = check(&world).unwrap();
        prop_assert!(!found.certified.holds() && !found.passivity.passive.holds() && !found.uneven.passive.holds());
        prop_assert_eq!((found.passivity.required_damping, found.passivity.at_hz), (None, Some(0.0)));
        prop_assert!(!found.uneven.free.claimed().holds() || limit.is_none());
        // ω² below k_i/b: the hand's spring and mass swing there.
        let omega = 0.3 * (gain / (damping + b)).sqrt();
        let inertia = 1e3 * (world.device.inertia + (k + 1.0) / (omega * omega));
        let grip = hapt_analysis::Grip { inertia, damping: 0.0, stiffness: inertia * omega * omega };
        let mut ideal = world.clone();
        ideal.sampling.delay = Delay::Seconds(0.0);
        prop_assert!(gripped_growth(&ideal, &grip).unwrap().unwrap() > 0.0);
    }
}

#[test]
fn the_search_for_hands_finds_one() {
    let worst = worst_grip(&pid(1e-3, [1.0, 0.01, 10.0])).unwrap().unwrap();
    assert!(worst.growth_per_s > 0.0);
}

/// Friction of the size of its limit dissipates what it gives, (T76), in both directions.
#[test]
fn friction_that_takes_the_limit_makes_it_passive() {
    let mut world = pid(1e-3, [4.0, 0.0, 10.0]);
    (world.device.damping, world.couplings[2].limit) = (0.02, Some(0.1));
    for (friction, status) in
        [(0.0, Status::Refuted), (0.099, Status::Refuted), (0.1, Status::Certified), (0.15, Status::Certified)]
    {
        world.device.friction = friction;
        let found = check(&world).unwrap();
        assert_eq!(found.status, status, "{friction}: {:?}", found.passivity);
        assert_eq!(found.passivity.passive.holds(), status == Status::Certified);
        assert_eq!(is_certified(&world), status == Status::Certified);
    }
    // Its eigenvalues, which leave out friction, show growth.
    world.couplings[2].law = Law::Integral { stiffness: 1e4, time: 0.5, rest: 0.0 };
    let found = check(&world).unwrap();
    assert_eq!((found.free.verdict, found.status, is_certified(&world)), (Verdict::Unstable, Status::Certified, true));
    assert!(found.headline().contains("safe to let go, on the device's friction"), "{}", found.headline());
    // A tolerance counts, and so does the direction that has less.
    world.device.tolerances.friction = 0.5;
    assert!(!check(&world).unwrap().certified.holds() && !is_certified(&world));
    world.device.tolerances.friction = 0.0;
    world.device.friction_backward = Some(0.09);
    assert!(!check(&world).unwrap().certified.holds() && !is_certified(&world));
}

/// At the motor's limit an integral term continues to grow, so that a large swing may grow where small ones die out; and eigenvalues are
/// those of one inertia.
#[test]
fn a_pid_that_winds_up_or_whose_inertia_is_uncertain_is_not_claimed_hands_off() {
    let mut world = pid(1e-3, [1.0, 0.01, 1.0 / 0.15]);
    (world.device.inertia, world.device.damping) = (1e-3, 1e-3);
    world.sampling.estimator = EstimatorKind::Difference;
    assert!(check(&world).unwrap().headline().contains(": safe to let go"));
    let mut limited = world.clone();
    limited.device.limit = Some(0.1);
    let found = check(&limited).unwrap();
    assert!(found.headline().contains(": not proved safe to let go"), "{}", found.headline());
    assert!(found.headline().contains("clipping"), "{}", found.headline());
    // Torques that it never requests do not matter.
    for coupling in &mut limited.couplings {
        coupling.limit = Some(0.03);
    }
    limited.device.limit = Some(0.1);
    assert!(!check(&limited).unwrap().headline().contains("clipping"));
    world.device.tolerances.inertia = 0.5;
    let found = check(&world).unwrap();
    assert!(found.headline().contains(": not proved safe to let go"), "{}", found.headline());
}
