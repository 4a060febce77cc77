//! Dampers behind the Kalman filter of constant acceleration, (T84).

use std::f64::consts::{PI, TAU};

use hapt_analysis::{Impedance, Status, Verdict, check, passivity, uneven};
use hapt_core::Loop;
use hapt_model::{Coupling, Damping, Delay, End, EstimatorKind, Law, Method, Output, Side, World};
use hapt_testing::prelude::*;
use nalgebra::DMatrix;

use crate::common::*;

const PERIOD: f64 = 1e-3;

/// A damper and a spring between puck and ground, of a cutoff of x/(2πT).
fn world(x: f64, k: f64, b: f64) -> World {
    let couplings = vec![damper(End::Puck, End::Ground, b), spring(End::Ground, End::Puck, k)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, PERIOD);
    (world.sampling.estimator, world.sampling.cutoff) = (EstimatorKind::Kalman, Some(x / (TAU * PERIOD)));
    (world.device.inertia, world.device.damping) = (1e-3, 0.0);
    world
}

/// The torque at each sample where the puck moves by 1 between the first two and then rests.
fn response(world: &World, samples: usize) -> Vec<f64> {
    let core = Loop::<f64, 2, 8, 32>::new(&world.spec()).unwrap();
    let mut state = core.start();
    core.step(&mut state, 0.0, 0.0);
    (0..samples).map(|_| core.step(&mut state, 1.0, 0.0).torque).collect()
}

/// The most that a motion of so many steps draws, per Σ δ²: the largest eigenvalue of Σ τ_k δ_k as a form in the steps δ.
fn drawn(world: &World, samples: usize) -> f64 {
    let torque = response(world, samples);
    let form = DMatrix::from_fn(samples, samples, |i, j| if i > j { 0.5 * torque[i - j - 1] } else { 0.0 });
    (&form + form.transpose()).symmetric_eigenvalues().max()
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    /// No motion draws more than the required damping takes, and long ones draw almost as much.
    #[test]
    fn the_requirement_is_what_the_worst_motion_draws(log in -1.5..1.5_f64, k in 0.0..2.0_f64, b in 1e-4..1e-2_f64) {
        let x = 10_f64.powf(log);
        let world = world(x, 0.0, b);
        let required = passivity(&world).unwrap().required_damping.unwrap();
        let most = PERIOD * drawn(&world, (60.0 / x.min(1.0)) as usize + 60);
        prop_assert!(most <= required * (1.0 + 1e-9), "{x}: {most} {required}");
        prop_assert!(most >= 0.9 * required, "{x}: {most} {required}");
        // A spring adds KT/2 at every frequency.
        let mut sprung = world.clone();
        sprung.couplings.push(spring(End::Ground, End::Puck, k));
        let with = passivity(&sprung).unwrap().required_damping.unwrap();
        prop_assert!((with - required - 0.5 * k * PERIOD).abs() <= 1e-9 * with);
        // Of uneven intervals it is that of the longest.
        sprung.sampling.interval_max = Some(1.5 * PERIOD);
        let longest = uneven(&sprung).unwrap().required_damping.unwrap();
        prop_assert!((longest - 1.5 * with).abs() <= 1e-9 * longest, "{longest} {with}");
    }

    /// The rendered damping falls to minus the required one, at the frequency of the certificate and nowhere below.
    #[test]
    fn the_impedance_is_least_where_the_certificate_says(log in -1.5..1.5_f64, b in 1e-4..1e-2_f64) {
        let world = world(10_f64.powf(log), 0.0, b);
        let found = passivity(&world).unwrap();
        let (required, at) = (found.required_damping.unwrap(), found.at_hz.unwrap());
        let impedance = Impedance::new(&world, &hapt_analysis::Slopes::Steep).unwrap();
        // Of a held torque, τ dz is the rendered damping times (ωT/2 / sin(ωT/2))².
        let held = |hz: f64| {
            let half = PI * hz * PERIOD;
            impedance.row(hz).rendered.unwrap().damping * (half / half.sin()).powi(2)
        };
        prop_assert!((held(at.min(499.999)) + required).abs() < 1e-6 * b, "{} {required}", held(at));
        for i in 1..1000 {
            prop_assert!(held(0.4999 * f64::from(i)) >= -required - 1e-9 * b);
        }
    }

    /// Certified means stable, and the edge is sharp.
    #[test]
    fn a_damping_beyond_the_requirement_certifies(log in -1.5..1.0_f64, k in 0.0..2.0_f64, b in 1e-4..1e-2_f64) {
        let mut world = world(10_f64.powf(log), k, b);
        let required = passivity(&world).unwrap().required_damping.unwrap();
        world.device.damping = required * 1.001;
        let found = check(&world).unwrap();
        prop_assert_eq!(found.status, Status::Certified, "{}", found.headline());
        prop_assert!(found.free.verdict != Verdict::Unstable);
        world.device.damping = required * 0.999;
        prop_assert_eq!(check(&world).unwrap().status, Status::Refuted);
        // Counts and the motor's limit are not covered by all of it.
        world.device.damping = required * 1.001;
        world.device.limit = Some(1.0);
        let found = check(&world).unwrap();
        prop_assert!(found.certified.holds() && !found.passivity.proved.holds(), "{:?}", found.passivity);
    }

    /// Half a count of error at each position changes the velocity by no more than the bound on the friction says, and by almost as much.
    #[test]
    fn counts_are_bounded_by_the_impulse_response(log in -3.0..1.5_f64) {
        let x = 10_f64.powf(log);
        let mut world = world(x, 0.0, 1.0);
        world.device.encoder = Some(4000.0);
        let count = TAU / 4000.0;
        let bound = hapt_analysis::quantisation(&world).unwrap().least_friction;
        let mut ideal = world.clone();
        ideal.device.encoder = None;
        // The response to one position of 1 is the difference of two steps.
        let steps = response(&ideal, (100.0 / x.min(1.0)) as usize + 10);
        let sum: f64 = steps.iter().enumerate().map(|(k, torque)| (torque - if k > 0 { steps[k - 1] } else { 0.0 }).abs()).sum();
        let most = 0.5 * count * sum;
        prop_assert!(most <= bound * (1.0 + 1e-9) && bound <= 1.1 * most, "{x}: {most} {bound}");
    }
}

/// For low cutoffs the requirement goes to that of Butterworth's filter, however low they are.
#[test]
fn the_lowest_cutoffs_require_what_butterworths_filter_does() {
    // max over u of (2u² - 2u - 1)/(1 + u³)
    let limit = (1..100_000).map(|i| f64::from(i) * 1e-4).map(|u| (2.0 * u * u - 2.0 * u - 1.0) / (1.0 + u * u * u));
    let limit = limit.fold(0.0, f64::max);
    for x in [1e-55, 1e-30, 1e-12, 1e-6, 1e-4] {
        let mut world = world(x, 0.0, 1.0);
        world.device.damping = 1e-9;
        let required = passivity(&world).unwrap().required_damping.unwrap();
        assert!((required / limit - 1.0).abs() < 1e-7 + x, "{x}: {required} {limit}");
        assert_eq!(check(&world).unwrap().status, Status::Refuted);
    }
}

/// What the theorem does not cover stays open or as the linear loop says.
#[test]
fn delays_lags_walls_and_bodies_behind_the_filter_are_not_claimed() {
    let certified = |change: &dyn Fn(&mut World)| {
        let mut world = world(0.3, 1.0, 1e-2);
        world.device.damping = 0.1;
        change(&mut world);
        check(&world).unwrap()
    };
    assert_eq!(certified(&|_| {}).status, Status::Certified);
    assert_eq!(certified(&|w| w.couplings[1].limit = Some(0.1)).status, Status::Certified);
    let changes: [&dyn Fn(&mut World); 5] = [
        &|w| w.sampling.delay = Delay::Seconds(1e-4),
        &|w| w.device.lag = 1e-4,
        &|w| w.couplings[0].limit = Some(0.1),
        &|w| {
            w.couplings[0] =
                Law::Wall { side: Side::Above, at: 0.1, stiffness: 1.0, damping: 1e-3 }.between(End::Puck, End::Ground);
        },
        &|w| {
            w.bodies.push(body(1e-3));
            w.couplings[0] = Law::Damper { damping: Damping::Fixed(1e-3) }.between(End::Puck, End::Body(0));
            w.couplings.push(Coupling {
                limit: None,
                ..Law::Spring { stiffness: 1.0, rest: 0.0 }.between(End::Body(0), End::Ground)
            });
        },
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let found = certified(change);
        assert_eq!(found.status, Status::Open, "{i}: {}", found.headline());
        assert!(found.passivity.not_proved.iter().any(|why| why.contains("Kalman")), "{i}: {:?}", found.passivity);
    }
}
