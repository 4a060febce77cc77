//! The edge of stability by its equation: closed forms, and the eigenvalues of the loop itself.

use std::f64::consts::PI;

use hapt_analysis::Keys;
use hapt_analysis::{Decomposition, free_eigenvalues, held_eigenvalues};
use hapt_model::{Coupling, End, EstimatorKind, Law, Method, Output, Side, World};
use hapt_testing::prelude::*;

use crate::common::*;

/// `bench` behind a spring and a damper, couplings 0 and 1, between puck and ground.
fn world(bench: &Bench, method: Method, period: f64, inertia: f64, damping: f64) -> World {
    let ends = (End::Puck, End::Ground);
    let mut world = bench.world(method, Output::End, period);
    world.couplings.splice(..0, [spring(ends.0, ends.1, 1.0), damper(ends.0, ends.1, 1.0)]);
    (world.sampling.cutoff, world.sampling.window) = (Some(50.0), 5);
    (world.device.inertia, world.device.damping) = (inertia, damping);
    world
}

const PATHS: [&str; 2] = ["couplings.0.stiffness", "couplings.1.damping"];

fn nothing() -> Bench {
    Bench { bodies: vec![], couplings: vec![] }
}

/// J/T² and J/T: the scales of stiffness and damping of a sampled inertia.
fn keys(world: &World) -> Keys<'static> {
    let (inertia, period) = (world.device.inertia, world.sampling.period);
    Keys { paths: PATHS, ranges: [[0.0, 4.0 * inertia / period.powi(2)], [0.0, 4.0 * inertia / period]] }
}

fn methods() -> impl Strategy<Value = Method> {
    prop::sample::select(vec![
        Method::ForwardEuler,
        Method::BackwardEuler,
        Method::SemiImplicitEuler,
        Method::Trapezoidal,
        Method::Zoh,
        Method::Rk4,
        Method::Tustin,
        Method::Foh,
    ])
}

proptest! {
    #![proptest_config(hapt_testing::cases(48))]

    /// Gil et al. and Hulin et al. in their normalised plane, α = KT²/J and β = BT/J, for an undamped mass: at |λ| = 1 the
    /// equation λ³ + ((α + β)/2 - 2) λ² + (1 + α/2) λ - β/2 gives α = 2β(2 - β)/(2 + β).
    #[test]
    fn a_wall_with_a_differenced_damper_has_its_closed_form(
        log_inertia in -5.0..1.0f64,
        log_period in -5.0..-1.0f64,
        phi in 0.01..3.1f64,
    ) {
        let (inertia, period) = (10f64.powf(log_inertia), 10f64.powf(log_period));
        let world = world(&nothing(), Method::Zoh, period, inertia, 0.0);
        let all = Decomposition::free(&world, keys(&world)).unwrap().unwrap();
        prop_assert_eq!(all.len(), 1);
        let [stiffness, damping] = all[0].at(phi).unwrap();
        let (alpha, beta) = (stiffness * period.powi(2) / inertia, damping * period / inertia);
        let wanted = 2.0 * beta * (2.0 - beta) / (2.0 + beta);
        prop_assert!((alpha - wanted).abs() < 1e-10 * (1.0 + beta.abs()), "{} {} at {}", alpha, wanted, beta);
        // And that φ: λ² + λ ((α + β)/2 - 2 + β/2) + 1 is what the pair leaves of the cubic, whose third root is β/2.
        prop_assert!((2.0 * phi.cos() + (0.5 * (alpha + beta) - 2.0 + 0.5 * beta)).abs() < 1e-9);
    }

    /// Whatever hangs on the puck, and however it is sampled: the loop with these two numbers has that eigenvalue.
    #[test]
    fn at_every_point_of_the_curve_the_loop_has_that_eigenvalue(
        bench in worlds(Dampers::Fixed, false),
        method in methods(),
        estimator in prop::sample::select(vec![
            EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::LowPass, EstimatorKind::FoawBest,
        ]),
        middle in any::<bool>(),
        delay in prop::sample::select(vec![0.0, 0.3, 1.0, 2.6]),
        lag in prop::sample::select(vec![0.0, 0.0, 0.03, 0.7]),
        step in 0.01..0.5f64,
        ratio in -2.0..2.0f64,
        damping in 0.0..0.3f64,
    ) {
        let period = step / fastest(&bench);
        let inertia = bench.bodies[0].inertia * 10f64.powf(ratio);
        let mut world = world(&bench, method, period, inertia, damping * inertia / period);
        world.sampling.estimator = estimator;
        world.sampling.cutoff = Some(0.05 / period);
        world.sampling.delay = hapt_model::Delay::Seconds(delay * period);
        world.device.lag = lag * period;
        if middle && !method.takes_new_sample_first() {
            world.sampling.output = Output::Middle;
        }
        let all = Decomposition::free(&world, keys(&world)).unwrap().unwrap();
        // FOAW by its shortest and by its longest window.
        let windows = if estimator == EstimatorKind::FoawBest { 2 } else { 1 };
        prop_assert_eq!(all.len(), windows);
        let mut looked = 0;
        for i in 1..200 {
            let phi = PI * f64::from(i) / 200.0;
            let Some([stiffness, damping]) = all[windows - 1].at(phi).filter(|v| v[0] > 0.0 && v[1] > 0.0) else { continue };
            let mut there = world.clone();
            prop_assert!(there.set_number(PATHS[0], stiffness) && there.set_number(PATHS[1], damping));
            let (sin, cos) = phi.sin_cos();
            let eigenvalues = free_eigenvalues(&there).unwrap();
            // The loop counts the worse of FOAW's windows: that is the longest, to which this curve belongs, unless another one grows.
            if windows > 1 && eigenvalues.iter().any(|e| e.abs > 1.0 + 1e-9 * period) {
                continue;
            }
            let nearest = eigenvalues.iter().map(|e| (e.re - cos).hypot(e.im - sin)).fold(1.0, f64::min);
            prop_assert!(nearest < 1e-7, "{} at {}", nearest, phi);
            looked += 1;
        }
        prop_assume!(looked > 0);
    }

    /// (2.13) and (2.14): a complex pair of forward Euler crosses where C = KT, a real pole where 4J - 2CT + KT² = 0. Explicit
    /// damping under semi-implicit Euler: where C = 0, and where 4J - 2CT - KT² = 0.
    #[test]
    fn a_body_alone_leaves_the_circle_where_the_notes_say(
        inertia in 1e-4..1.0f64,
        period in 1e-4..1e-1f64,
        phi in 0.01..3.1f64,
        implicit in any::<bool>(),
    ) {
        let (here, fixed) = (End::Body(0), End::Puck);
        let bench = Bench { bodies: vec![body(inertia)], couplings: vec![spring(here, fixed, 1.0), damper(here, End::Ground, 1.0)] };
        let method = if implicit { Method::SemiImplicitEuler } else { Method::ForwardEuler };
        let world = world(&bench, method, period, 1.0, 0.0);
        let size = inertia / period;
        let keys = Keys {
            paths: ["couplings.2.stiffness", "couplings.3.damping"],
            ranges: [[0.0, 4.0 * size / period], [0.0, 4.0 * size]],
        };
        let all = Decomposition::held(&world, keys).unwrap().unwrap();
        prop_assert_eq!(all.len(), 1);
        let [stiffness, damping] = all[0].at(phi).unwrap();
        let wanted = if implicit { 0.0 } else { stiffness * period };
        prop_assert!((damping - wanted).abs() < 1e-10 * size, "{} {}", damping, wanted);
        let mut there = world.clone();
        prop_assert!(there.set_number(keys.paths[0], stiffness) && there.set_number(keys.paths[1], damping.max(0.0)));
        let (sin, cos) = phi.sin_cos();
        let eigenvalues = held_eigenvalues(&there.bodies, &there.couplings, method, period).unwrap();
        prop_assert!(eigenvalues.iter().any(|e| (e.re - cos).hypot(e.im - sin) < 1e-7), "{:?}", eigenvalues);
        let line = all[0].lines()[1].unwrap();
        let sign = if implicit { 1.0 } else { -1.0 };
        // On 2CT ± KT² = 4J, at any of these stiffnesses.
        for k in [0.0, 1.0, 3.0].map(|k| k * size / period) {
            let c = (4.0 * inertia - sign * k * period.powi(2)) / (2.0 * period);
            let on = line.normal[0] * k + line.normal[1] * c - line.offset;
            let scale = line.normal[0].abs() * size / period + line.normal[1].abs() * size;
            prop_assert!(on.abs() < 1e-10 * scale, "{on} of {scale}");
        }
    }
}

/// Two clusters of eigenvalues, four near 0 and four near 1, on an edge of stability: the QR algorithm once wandered between them
/// until its bound of iterations.
#[test]
fn a_loop_with_eigenvalues_in_two_clusters_has_a_growth() {
    let bench = Bench {
        bodies: vec![body(0.013901369751422093)],
        couplings: vec![spring(End::Puck, End::Body(0), 0.5), damper(End::Body(0), End::Ground, 5e-3)],
    };
    let mut world = world(&bench, Method::ForwardEuler, 0.0018382282299633105, 6.4e-4, 2e-3);
    world.sampling.output = Output::Middle;
    world.sampling.delay = hapt_model::Delay::Seconds(2e-3);
    assert!(world.set_number(PATHS[0], 0.2) && world.set_number(PATHS[1], 1e-4));
    let eigenvalues = free_eigenvalues(&world).unwrap();
    let near = |at: f64| eigenvalues.iter().filter(|e| (e.re - at).hypot(e.im) < 0.1).count();
    assert_eq!((near(1.0), eigenvalues.len()), (4, 7), "{eigenvalues:?}");
    // And it is on the edge.
    assert!((eigenvalues[0].abs - 1.0).abs() < 1e-8);
}

/// A wall counts as its spring and damper; its flat slopes have no curve.
#[test]
fn a_wall_enters_as_its_spring_and_damper() {
    let mut world = world(&nothing(), Method::Zoh, 1e-3, 1e-3, 1e-3);
    let ends = (End::Puck, End::Ground);
    let plain = Decomposition::free(&world, keys(&world)).unwrap().unwrap();
    let law = Law::Wall { side: Side::Above, at: 0.1, stiffness: 1.0, damping: 1.0 };
    world.couplings = vec![Coupling { first: ends.0, second: ends.1, law, limit: None }];
    let keys = Keys { paths: ["couplings.0.stiffness", "couplings.0.damping"], ..keys(&world) };
    let wall = Decomposition::free(&world, keys).unwrap().unwrap();
    assert_eq!(wall, plain);
    // In parallel with a detent, 2π torque/pitch where it is steep, the flat curve and one that lies lower by that much.
    let law = Law::Detent { torque: 1.0, pitch: 20.0 * PI, phase: 0.0 };
    world.couplings.push(Coupling { first: ends.0, second: ends.1, law, limit: None });
    let parts = Decomposition::free(&world, keys).unwrap().unwrap();
    assert_eq!(parts.len(), 2);
    for phi in [0.1, 1.0, 2.0] {
        let [[flat, _], [steep, damping]] = [0, 1].map(|i| parts[i].at(phi).unwrap());
        let [stiffness, wanted] = plain[0].at(phi).unwrap();
        assert!((flat / stiffness - 1.0).abs() < 1e-12 && (damping / wanted - 1.0).abs() < 1e-9);
        assert!((flat - steep - 0.1).abs() < 1e-9 * stiffness.max(1.0));
    }
}

/// Where a key enters in another way, there is no equation.
#[test]
fn what_is_no_stiffness_or_damping_at_one_place_has_no_equation() {
    let bench = Bench { bodies: vec![body(0.01)], couplings: vec![spring(End::Body(0), End::Puck, 1.0)] };
    let mut world = world(&bench, Method::Zoh, 1e-3, 1e-3, 1e-3);
    let detent = Law::Detent { torque: 1.0, pitch: 1.0, phase: 0.0 };
    world.couplings.push(Coupling { first: End::Puck, second: End::Ground, law: detent, limit: None });
    world.couplings.push(spring(End::Puck, End::Ground, 1.0));
    for path in [
        "loop.period",
        "loop.delay",
        "device.damping",
        "bodies.body0.inertia",
        "couplings.2.stiffness",
        "couplings.3.pitch",
        "couplings.3.torque",
        "couplings.4.stiffness",
    ] {
        let keys = Keys { paths: [PATHS[0], path], ranges: [[0.0, 1.0], [1e-3, 2e-3]] };
        assert_eq!(Decomposition::free(&world, keys).unwrap(), None, "{path}");
    }
    assert!(Decomposition::free(&world, keys(&world)).unwrap().is_some());
    assert_eq!(Decomposition::held(&world, keys(&world)).unwrap(), None);
}
