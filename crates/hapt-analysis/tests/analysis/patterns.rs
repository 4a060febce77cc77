//! The hands-off loop under patterns of intervals and delays: published limits, and consistency of the verdicts.

use hapt_analysis::{PatternVerdict, Uneven, free_growth, uneven, worst_pattern};
use hapt_model::{Delay, End, EstimatorKind, Method, Output, Tolerances, World};
use hapt_testing::prelude::*;

use crate::common::*;

const PERIOD: f64 = 1e-3;

/// K and B to ground, on a device with damping b, in the dimensionless numbers of Hulin and others: α = K T²/J, β = B T/J, δ = b T/J.
fn plane(alpha: f64, beta: f64, delta: f64) -> World {
    let (inertia, unit) = (6.4e-4, 6.4e-4 / PERIOD);
    let mut couplings = vec![spring(End::Puck, End::Ground, alpha * unit / PERIOD)];
    if beta > 0.0 {
        couplings.push(damper(End::Puck, End::Ground, beta * unit));
    }
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, PERIOD);
    (world.device.inertia, world.device.damping) = (inertia, delta * unit);
    world
}

fn of(world: &World) -> Uneven {
    uneven(world).unwrap()
}

/// The loop at even samples of `interval`, stepping by its nominal period: the same motion in a time that runs T/interval as fast.
fn growth_at(world: &World, interval: f64) -> f64 {
    let mut even = world.clone();
    let slower = world.sampling.period / interval;
    even.sampling.interval_max = None;
    even.device.inertia *= slower * slower;
    even.device.damping *= slower;
    free_growth(&even).unwrap().unwrap() * slower
}

/// ẋ = (0 1; 0 -0.1) x + (0; 0.1) u, u = -(3.75 11.5) x at the last sample: Branicky, Phillips and Zhang 2000; example 1 of Hetel and others,
/// Automatica 76 (2017). Here: an inertia of 10 with a damping of 1, on a spring of 3.75 and a damper of 11.5 to ground. Constant intervals are
/// stable up to 1.7294 s, and so are all patterns of shorter ones (1.7294 too: Fujioka, IEEE TAC 54(10), 2009).
fn branicky(longest: f64) -> World {
    let couplings = vec![spring(End::Puck, End::Ground, 3.75), damper(End::Puck, End::Ground, 11.5)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 0.5 * longest);
    // The true velocity: the period is in no equation, and intervals from a hundredth of it on are taken.
    world.sampling.estimator = EstimatorKind::Exact;
    world.sampling.interval_max = Some(longest);
    (world.device.inertia, world.device.damping) = (10.0, 1.0);
    world
}

#[test]
fn a_published_loop_is_proved_up_to_its_longest_interval() {
    let at = |longest: f64| of(&branicky(longest)).free;
    let broken = at(1.731);
    assert_eq!(broken.verdict(), PatternVerdict::Broken, "{broken:?}");
    let pattern = broken.pattern().unwrap();
    assert!(pattern.growth_per_s > 0.0 && pattern.intervals_s.iter().all(|h| (0.0..=1.7311).contains(h)));
    // Proved by others up to 0.869 (Fridman et al. 2004), 1.1137 (Naghshtabrizi et al. 2008), 1.3659 (Mirkin 2007), 1.695 (Fridman 2010) and
    // 1.72 (Seuret 2012).
    for longest in [0.5, 0.869, 1.1137, 1.3659, 1.695, 1.72] {
        let found = at(longest);
        assert_eq!(
            (found.verdict(), found.proved_by()),
            (PatternVerdict::Proved, Some("common form")),
            "{longest} {found:?}"
        );
    }
}

/// The same loop with a delay and hardly sampled. Its phase margin lasts for a delay of 1.1671 s: |3.75 + 11.5 jω| = ω |10 jω + 1| at
/// ω = 1.18832, where 79.46° are left. A sample that is held adds half a period, and what is left goes with the period's square.
#[test]
fn a_sample_that_is_held_delays_by_half_a_period() {
    let omega: f64 = ((131.25 + (131.25f64.powi(2) + 400.0 * 3.75 * 3.75).sqrt()) / 200.0).sqrt();
    assert!((11.5 * omega).hypot(3.75) / (omega * (10.0 * omega).hypot(1.0)) - 1.0 < 1e-12);
    let margin = std::f64::consts::FRAC_PI_2 - (10.0 * omega).atan() + (11.5 * omega / 3.75).atan();
    let longest = margin / omega;
    assert!((longest - 1.1671).abs() < 1e-4, "{longest}");
    for period in [0.02, 0.05, 0.1] {
        let at = |delay: f64| {
            let mut world = branicky(period);
            world.sampling.period = period;
            world.sampling.interval_max = None;
            world.sampling.delay = Delay::Seconds(delay);
            free_growth(&world).unwrap().unwrap()
        };
        let (edge, off) = (longest - 0.5 * period, 1e-4 + 0.3 * period * period);
        assert!(at(edge - off) < 0.0 && at(edge + off) > 0.0, "{period}: {} {}", at(edge - off), at(edge + off));
    }
}

#[test]
fn a_loop_that_is_stable_at_every_even_interval_may_be_broken_by_a_pattern() {
    let found = std::cell::Cell::new(0);
    proptest!(|(alpha in 0.18..0.28f64, beta in 0.2..0.4f64, stretch in 1.6..1.85f64)| {
        let mut world = plane(alpha, beta, 0.04);
        world.sampling.interval_max = Some(stretch * PERIOD);
        let least = (2.0 - stretch) * PERIOD;
        let stable = (0..=200).all(|i| growth_at(&world, least + (stretch * PERIOD - least) * f64::from(i) / 200.0) < -1.0);
        let free = of(&world).free;
        if stable && free.verdict() == PatternVerdict::Broken {
            found.set(found.get() + 1);
            prop_assert!(free.pattern().unwrap().intervals_s.len() > 1);
        }
    });
    assert!(found.get() > 0);
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn what_is_passive_grows_under_no_pattern(
        bench in worlds(Dampers::Fixed, false), x in 0.01..1.5f64, stretch in 1.0..1.9f64, late in prop_oneof![Just(0.0), 0.0..1.0f64],
    ) {
        let mut world = bench.clone().world(Method::Zoh, Output::End, x / fastest(&bench));
        let period = world.sampling.period;
        world.sampling.interval_max = Some(stretch * period);
        world.sampling.delay_max = (late > 0.0).then_some(Delay::Seconds(late * period));
        world.device.damping = 0.0;
        let Some(required) = of(&world).required_damping else { return Ok(()) };
        world.device.damping = required * (1.0 + 1e-9);
        let found = of(&world);
        prop_assert_eq!((found.free.verdict(), found.free.proved_by()), (PatternVerdict::Proved, Some("passivity")));
        let pattern = worst_pattern(&world).unwrap();
        prop_assert!(pattern.growth_per_s < 1e-6 / period, "{pattern:?}");
    }

    #[test]
    fn at_even_samples_the_verdict_is_that_of_the_eigenvalues(alpha in 0.01..3.0f64, beta in 0.0..2.0f64, delta in 0.0..0.5f64) {
        let world = plane(alpha, beta, delta);
        let growth = free_growth(&world).unwrap().unwrap();
        prop_assume!(growth.abs() > 1e-6);
        let free = of(&world).free;
        prop_assert_eq!(free.verdict(), if growth > 0.0 { PatternVerdict::Broken } else { PatternVerdict::Proved });
        if let Some(pattern) = free.pattern() {
            prop_assert_eq!((pattern.intervals_s.clone(), pattern.growth_per_s), (vec![PERIOD], growth));
        }
    }

    /// A proof holds for every part of its range, and no even interval within it grows.
    #[test]
    fn a_proof_covers_every_narrower_range(alpha in 0.05..2.0f64, beta in 0.0..0.9f64, delta in 0.02..0.3f64, stretch in 1.05..1.9f64, part in 0.0..1.0f64) {
        let mut world = plane(alpha, beta, delta);
        world.sampling.interval_max = Some(stretch * PERIOD);
        let free = of(&world).free;
        if free.verdict() == PatternVerdict::Proved {
            let [least, longest] = of(&world).interval_s;
            let interval = least + part * (longest - least);
            if interval > 0.0 {
                prop_assert!(growth_at(&world, interval) < 0.0);
            }
            world.sampling.interval_max = Some((1.0 + part * (stretch - 1.0)) * PERIOD);
            prop_assert_ne!(of(&world).free.verdict(), PatternVerdict::Broken);
        }
    }

    #[test]
    fn most_loops_of_a_spring_and_a_damper_are_decided(
        alpha in 0.05..2.0f64, beta in 0.0..0.9f64, late in any::<bool>(), stretch in 1.05..1.9f64,
    ) {
        let mut world = plane(alpha, beta, 0.05);
        world.sampling.interval_max = Some(stretch * PERIOD);
        world.sampling.delay_max = late.then_some(Delay::Seconds(0.1 * PERIOD));
        let free = of(&world).free;
        // The same each time, and with a reason where it is open.
        prop_assert_eq!(&free, &of(&world).free);
        prop_assert_eq!(free.verdict() == PatternVerdict::Open, free.reason().is_some());
        prop_assert_eq!(free.verdict() == PatternVerdict::Broken, free.pattern().is_some());
        prop_assert_eq!(free.verdict() == PatternVerdict::Proved, free.proved_by().is_some());
    }
}

#[test]
fn what_no_proof_covers_is_open() {
    // Stiffer than passivity allows and hardly so: no pattern breaks it.
    let mut world = plane(0.2, 0.3, 0.2);
    world.sampling.interval_max = Some(1.2 * PERIOD);
    assert!(!of(&world).passive.holds());
    assert_eq!(of(&world).free.verdict(), PatternVerdict::Open);
    assert!(of(&world).free.reason().unwrap().contains("no proof covers shorter ones"));
    (world.sampling.interval_max, world.sampling.delay_max) = (None, Some(Delay::Seconds(0.1 * PERIOD)));
    assert_eq!(of(&world).free.verdict(), PatternVerdict::Proved);
    let open = |world: &World, word: &str| {
        let free = of(world).free;
        assert_eq!(free.verdict(), PatternVerdict::Open);
        assert!(free.reason().unwrap().contains(word), "{free:?}");
    };
    let mut loose = world.clone();
    loose.device.tolerances = Tolerances { damping: 0.1, ..Tolerances::default() };
    open(&loose, "tolerances");
    let mut late = world.clone();
    late.sampling.delay_max = Some(Delay::Seconds(1.5 * PERIOD));
    open(&late, "longer than the period");
    let mut foaw = world;
    foaw.sampling.estimator = EstimatorKind::Foaw;
    open(&foaw, "FOAW");
}
