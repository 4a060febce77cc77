//! Samples that are not even: at random, in patterns, as recorded.

use crate::common::{bare, rows, scenario, spring};
use crate::device::random_run;
use hapt_model::*;
use hapt_sim::{Error, Row, Simulation};
use hapt_testing::prelude::*;

/// A hand on straight lines through random points, at random times.
fn path() -> impl Strategy<Value = Drive> {
    prop::collection::vec((2e-4_f64..6e-3, -0.3_f64..0.3), 3..60).prop_map(|steps| {
        let mut time = 0.0;
        let mut points = vec![(0.0, 0.0)];
        points.extend(steps.into_iter().map(|(after, place)| {
            time += after;
            (time, place)
        }));
        Drive::Position(Shape::Path { file: String::new(), points })
    })
}

/// A spring on the puck, its device at `share` of the damping that THEORY requires at these intervals and delays.
fn spring_at(stiffness: f64, longest: f64, late: f64, share: f64) -> World {
    let mut world = bare();
    world.sampling.interval_max = Some(longest);
    world.sampling.delay_max = Some(hapt_model::Delay::Seconds(late));
    let a = late / longest;
    let q = 1.0 + 2.0 * a;
    world.device.damping = share * stiffness * longest / 4.0 * (q + (q * q + 4.0 * a * (1.0 - a)).sqrt());
    world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
    world
}

fn timed(drive: Drive, timing: Timing) -> Scenario {
    Scenario { timing, ..scenario(0.1, drive, None) }
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    #[test]
    fn a_pattern_of_even_intervals_is_bit_identical_to_the_even_run(
        run in random_run(), delays in 0.0_f64..=1.0, whole in any::<bool>(), with_delays in any::<bool>(),
    ) {
        let (mut world, even) = run;
        let delay = if whole { 1.0 } else { delays };
        world.sampling.delay = hapt_model::Delay::Seconds(delay * world.sampling.period);
        let intervals = vec![1.0; if with_delays { 3 } else { 1 }];
        let delays = if with_delays { vec![delay; 3] } else { vec![] };
        let uneven = Scenario { timing: Timing::Pattern { intervals, delays }, ..even.clone() };
        let (even, uneven) = (rows(&world, &even), rows(&world, &uneven));
        prop_assert_eq!(even.len(), uneven.len());
        for (even, uneven) in even.iter().zip(&uneven) {
            prop_assert_eq!(even, uneven);
        }
    }

    #[test]
    fn random_samples_keep_their_bounds_and_repeat_with_their_seed(
        seed in any::<u32>(), longest in 1.0_f64..3.0, late in 0.0_f64..=1.0, shortest in prop::option::of(0.05_f64..1.0), drive in path(),
    ) {
        let world = spring_at(2.0, 1e-3 * longest, 1e-3 * late, 1.0);
        let scenario = timed(drive, Timing::Random { seed, shortest: shortest.map(|part| 1e-3 * part) });
        let run = rows(&world, &scenario);
        let least = shortest.unwrap_or((2.0 - longest).max(0.01)) * 1e-3;
        let inside = |x: f64| (least * (1.0 - 1e-9)..=1e-3 * longest * (1.0 + 1e-9)).contains(&x);
        prop_assert!(run.windows(2).all(|pair| inside(pair[1].time - pair[0].time)));
        prop_assert!(run[0].time == 0.0 && run[run.len() - 1].time <= 0.1 + 1e-9);
        prop_assert!(run[run.len() - 1].time > 0.1 - 1e-3 * longest - 1e-9);
        prop_assert_eq!(&run, &rows(&world, &scenario));
        let mut bare = Simulation::without_works(&world, &scenario).unwrap();
        let mut count = 0;
        while let Some(row) = bare.next() {
            let row = row.unwrap();
            prop_assert_eq!(row, &Row { ledger: row.ledger, ..run[count].clone() });
            count += 1;
        }
        prop_assert_eq!(count, run.len());
    }

    /// b = K T_max/2 without a delay, and with delays up to D the larger bound: no hand draws energy under any pattern.
    #[test]
    fn at_the_bound_no_hand_draws_energy_under_any_pattern(
        seed in any::<u32>(), drive in path(), stiffness in 0.1_f64..20.0, longest in 1.0_f64..3.0,
        late in prop_oneof![Just(0.0), 0.0_f64..1.0], random in any::<bool>(), parts in prop::collection::vec(0.0_f64..=1.0, 1..6),
    ) {
        let world = spring_at(stiffness, 1e-3 * longest, 1e-3 * late, 1.0);
        let intervals: Vec<f64> = parts.iter().map(|part| late.max(0.1) + (longest - late.max(0.1)) * part).collect();
        let delays = parts.iter().rev().map(|part| late * part).collect();
        let timing = match random {
            true => Timing::Random { seed, shortest: Some(1e-4) },
            false => Timing::Pattern { intervals, delays },
        };
        for row in rows(&world, &timed(drive, timing)) {
            // The hand's work beyond the puck's own motion; without friction it is this.
            let drawn = row.ledger.motor - row.ledger.damping;
            prop_assert!(drawn <= 1e-9 * row.ledger.damping, "{drawn} of {:?} at {}", row.ledger, row.time);
        }
    }

    #[test]
    fn below_the_bound_a_hand_draws_under_the_longest_intervals(stiffness in 0.1_f64..20.0, longest in 1.0_f64..3.0) {
        let world = spring_at(stiffness, 1e-3 * longest, 0.0, 0.9);
        // To and fro, turning where the samples are.
        let points = (0..100).map(|i| (f64::from(i) * longest * 1e-3, if i % 2 == 1 { 0.1 } else { 0.0 })).collect();
        let drive = Drive::Position(Shape::Path { file: String::new(), points });
        let last = rows(&world, &timed(drive.clone(), Timing::Pattern { intervals: vec![longest], delays: vec![] })).pop().unwrap();
        prop_assert!(last.ledger.motor > 1.01 * last.ledger.damping, "{:?}", last.ledger);
        if longest > 1.2 {
            let even = rows(&world, &timed(drive, Timing::Even)).pop().unwrap();
            prop_assert!(even.ledger.motor < even.ledger.damping, "the same device is passive where the period is kept: {:?}", even.ledger);
        }
    }

    #[test]
    fn a_recording_of_a_pattern_is_that_pattern(
        drive in path(), parts in prop::collection::vec((0.2_f64..2.0, 0.0_f64..1.0), 1..6), shift in -5.0_f64..5.0,
    ) {
        let world = spring_at(1.0, 2e-3, 1e-3, 1.0);
        let (intervals, delays): (Vec<f64>, Vec<f64>) = parts.iter().map(|&(x, part)| (x, part * x.min(1.0))).unzip();
        let mut samples = vec![];
        let mut time = shift;
        for i in (0..parts.len()).cycle() {
            samples.push((time, Some(delays[i] * 1e-3)));
            if time - shift > 0.11 {
                break;
            }
            time += intervals[i] * 1e-3;
        }
        let pattern = rows(&world, &timed(drive.clone(), Timing::Pattern { intervals, delays }));
        let recorded = rows(&world, &timed(drive, Timing::Recorded { file: String::new(), samples }));
        for (a, b) in pattern.iter().zip(&recorded) {
            prop_assert!((a.time - b.time).abs() < 1e-12 && (a.puck - b.puck).abs() < 1e-9 && (a.applied - b.applied).abs() < 1e-9);
        }
    }
}

/// A sweep may change a loop so that a timing no longer suits it.
#[test]
fn a_timing_that_does_not_suit_the_loop_is_refused() {
    let mut world = spring_at(1.0, 2e-3, 0.0, 1.0);
    world.sampling.delay_max = None;
    let hold = || Drive::Position(Shape::Step { to: 0.0, at: 0.0 });
    let scenario = timed(hold(), Timing::Pattern { intervals: vec![0.4, 2.0], delays: vec![] });
    assert!(Simulation::new(&world, &scenario).is_ok());
    world.sampling.delay = hapt_model::Delay::Seconds(0.5e-3);
    let message = |world: &World| match Simulation::new(world, &scenario) {
        Err(error @ Error::Timing { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|run| run.rows())),
    };
    assert!(message(&world).contains("before the command arrives"), "{}", message(&world));
    world.sampling.delay = hapt_model::Delay::Seconds(1.5e-3);
    assert!(message(&world).contains("is longer than the period"), "{}", message(&world));
    (world.sampling.delay, world.sampling.interval_max) = (hapt_model::Delay::Seconds(0.0), None);
    assert!(message(&world).contains("a larger loop.interval_max"), "{}", message(&world));
}

/// K and B to ground in the dimensionless numbers α = K T²/J, β = B T/J, δ = b T/J.
fn plane(alpha: f64, beta: f64, delta: f64, stretch: f64, late: f64) -> World {
    let mut world = bare();
    let unit = world.device.inertia / 1e-3;
    world.sampling.estimator = EstimatorKind::Difference;
    world.sampling.interval_max = Some(1e-3 * stretch);
    world.sampling.delay_max = (late > 0.0).then_some(hapt_model::Delay::Seconds(1e-3 * late));
    world.device.damping = delta * unit;
    let law = Law::Damper { damping: Damping::Fixed(beta * unit) };
    world.couplings = vec![
        spring(End::Puck, End::Ground, alpha * unit / 1e-3),
        Coupling { first: End::Puck, second: End::Ground, law, limit: None },
    ];
    world
}

/// The growth in 1/s between a tenth and the end of a hands-off run, by the largest norm of the state in each tenth.
fn grown(world: &World, timing: Timing, duration: f64) -> f64 {
    let hand = Hand { drive: Drive::Torque(Shape::Step { to: 1e-3, at: 0.0 }), release: Some(1e-3) };
    let scenario = Scenario { name: "free".into(), duration, hand, timing };
    let mut most = [0.0f64; 10];
    for row in rows(world, &scenario) {
        let part = ((10.0 * row.time / duration) as usize).min(9);
        most[part] = most[part].max(row.puck.abs().max(1e-3 * row.puck_velocity.abs()));
    }
    (most[9] / most[1]).ln() / (0.8 * duration)
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// A loop that the analysis proves stable decays on the real core under every pattern, and one that it refutes grows at the predicted rate.
    #[test]
    fn the_hands_off_loop_decays_or_grows_under_patterns_as_analysed(
        alpha in 0.05..2.0f64, beta in 0.0..0.9f64, delta in 0.01..0.2f64, stretch in 1.1..1.9f64,
        late in prop_oneof![Just(0.0), Just(0.2)], seed in any::<u32>(),
    ) {
        let world = plane(alpha, beta, delta, stretch, late);
        let free = hapt_analysis::uneven(&world).unwrap().free;
        let hand = Hand { drive: Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), release: None };
        let worst = Scenario { name: "worst".into(), duration: 1.0, hand, timing: Timing::Worst };
        let worst = hapt_analysis::with_worst_pattern(&world, &worst).unwrap().timing.clone();
        match free.verdict() {
            hapt_analysis::PatternVerdict::Broken => {
                let growth = hapt_analysis::worst_pattern(&world).unwrap().growth_per_s;
                prop_assert!(growth >= 0.9 * free.pattern().unwrap().growth_per_s);
                // Long enough for the growing mode to dominate, and short enough not to overflow.
                let found = grown(&world, worst, (20.0 / growth).clamp(0.05, 8.0));
                prop_assert!(growth < 3.0 || found > 0.4 * growth, "{found} {growth}");
            }
            hapt_analysis::PatternVerdict::Proved => {
                let random = Timing::Random { seed, shortest: None };
                for timing in [worst, random, Timing::Pattern { intervals: vec![stretch], delays: vec![] }] {
                    let found = grown(&world, timing, 1.0);
                    prop_assert!(found < 1.0 || found.is_nan(), "{found}");
                }
            }
            hapt_analysis::PatternVerdict::Open => {}
        }
    }
}

#[test]
fn the_worst_pattern_is_found_before_a_run_and_not_in_it() {
    let world = plane(1.0, 0.3, 0.05, 1.5, 0.0);
    let scenario = timed(Drive::Position(Shape::Step { to: 0.0, at: 0.0 }), Timing::Worst);
    assert!(matches!(Simulation::new(&world, &scenario), Err(Error::Timing { .. })));
    let ready = hapt_analysis::with_worst_pattern(&world, &scenario).unwrap();
    assert!(Simulation::new(&world, &ready).is_ok());
    assert_eq!(ready.timing, hapt_analysis::with_worst_pattern(&world, &scenario).unwrap().timing);
}
