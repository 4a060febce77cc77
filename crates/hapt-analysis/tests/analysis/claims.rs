//! What is claimed, and what is not: only by theorems, for all that the file allows.

use hapt_analysis::{PatternVerdict, Status, check, is_certified, passivity, required_damping};
use hapt_model::{Coupling, Delay, End, EstimatorKind, Law, Method, Output, Side, World};
use hapt_testing::prelude::*;
use proptest::sample::select;

use crate::common::*;

fn wall(first: End, stiffness: f64, damping: f64, at: f64) -> Coupling {
    let law = Law::Wall { side: Side::Above, at, stiffness, damping };
    Coupling { first, second: End::Ground, law, limit: None }
}

/// A spring from the puck to a body, which a damper holds to ground.
fn held_by_a_damper(method: Method, k: f64, damping: f64, inertia: f64) -> World {
    let couplings = vec![spring(End::Puck, End::Body(0), k), damper(End::Body(0), End::Ground, damping)];
    Bench { bodies: vec![body(inertia)], couplings }.world(method, Output::End, 1e-3)
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    /// A body that a huge damper holds is ground: the spring to it requires what a spring to ground does, however slow the body is. The
    /// damper's effect, k r/ω² of the rate r, is least where a lag has not lowered the requirement yet: a hundred-thousandth of it for
    /// these rates.
    #[test]
    fn a_spring_to_a_body_that_a_damper_holds_costs_what_one_to_ground_does(
        method in select(vec![Method::Zoh, Method::Trapezoidal, Method::BackwardEuler, Method::Tustin, Method::Foh]),
        k in -2.0..2.0f64, rate in -25.0..-7.0f64, heavy in -6.0..3.0f64, late in prop_oneof![Just(0.0), 0.0..3.0f64],
        lag in prop_oneof![3 => Just(0.0), 1 => 0.01..1.0f64],
    ) {
        let k = 10f64.powf(k);
        let mut world = held_by_a_damper(method, k, k / 10f64.powf(rate), 10f64.powf(heavy));
        (world.sampling.delay, world.device.lag) = (Delay::Samples(late), lag * 1e-3);
        let mut fixed = Bench::of(vec![spring(End::Puck, End::Ground, k)]).world(method, Output::End, 1e-3);
        (fixed.sampling.delay, fixed.device.lag) = (world.sampling.delay, world.device.lag);
        let wanted = required_damping(&fixed).unwrap().unwrap();
        let found = required_damping(&world).unwrap();
        prop_assert!(found.is_some_and(|found| (found / wanted - 1.0).abs() < 1e-4), "{found:?} {wanted}");
        world.device.damping = 0.9 * wanted;
        prop_assert!(!is_certified(&world) && !check(&world).unwrap().certified.holds());
    }

    /// With another body the poles may be beyond double precision. Then nothing is claimed.
    #[test]
    fn rates_that_lie_too_far_apart_claim_nothing_or_the_right_number(
        k in 0.1..10.0f64, light in -15.0..-1.0f64, strong in 8.0..16.0f64, other in -6.0..1.0f64, damped in 1e-4..1e-1f64,
        late in 0..5u32, lag in prop_oneof![Just(0.0), 0.1..5.0f64],
    ) {
        let couplings = vec![
            spring(End::Puck, End::Body(0), k),
            damper(End::Body(0), End::Ground, k * 10f64.powf(strong)),
            spring(End::Body(0), End::Body(1), 1.0),
            damper(End::Body(1), End::Ground, damped),
        ];
        let bodies = vec![body(10f64.powf(light)), body(10f64.powf(other))];
        let mut world = Bench { bodies, couplings }.world(Method::Zoh, Output::End, 1e-3);
        (world.sampling.delay, world.device.lag) = (Delay::Samples(f64::from(late)), 1e-3 * lag);
        let mut fixed = Bench::of(vec![spring(End::Puck, End::Ground, k)]).world(Method::Zoh, Output::End, 1e-3);
        (fixed.sampling.delay, fixed.device.lag) = (world.sampling.delay, world.device.lag);
        let wanted = required_damping(&fixed).unwrap().unwrap();
        let found = required_damping(&world).unwrap();
        prop_assert!(found.is_none_or(|found| found >= wanted * (1.0 - 1e-4)), "{found:?} {wanted}");
        world.device.damping = 0.99 * wanted;
        prop_assert!(!is_certified(&world) && !passivity(&world).unwrap().passive.holds());
    }

    /// The damping of a damper to a heavy body vanishes toward 0 Hz, however heavy the body is.
    #[test]
    fn a_damper_to_a_heavy_body_pays_for_nothing_at_rest(
        k in 0.1..10.0f64, share in 0.05..2.0f64, heavy in 0.0..10.0f64, late in 1..6u32,
    ) {
        let springs = 1e-3 * k * (0.5 + f64::from(late));
        let couplings = vec![spring(End::Puck, End::Ground, k), damper(End::Puck, End::Body(0), share * springs)];
        let mut world = Bench { bodies: vec![body(10f64.powf(heavy))], couplings }.world(Method::Zoh, Output::End, 1e-3);
        world.sampling.delay = Delay::Samples(f64::from(late));
        let found = required_damping(&world).unwrap();
        prop_assert!(found.is_none_or(|found| found >= springs * (1.0 - 1e-6)), "{found:?} {springs}");
    }

    /// Before it reaches a wall, the hand feels the world without it.
    #[test]
    fn no_coupling_out_of_reach_lowers_what_is_required(
        k in 0.1..10.0f64, b in 0.0..5e-3f64, walls in prop::collection::vec((1e-3..10.0f64, 0.0..2e-2f64), 1..3), late in 0.0..12.0f64,
        output in select(vec![Output::Start, Output::Middle, Output::End]), at_body in any::<bool>(), damped in any::<bool>(),
    ) {
        let mut couplings = vec![spring(End::Puck, End::Ground, k), damper(End::Puck, End::Ground, b)];
        let bodies = if at_body { vec![body(1e-3)] } else { vec![] };
        if at_body {
            couplings.push(spring(End::Puck, End::Body(0), 0.5 * k));
            couplings.extend(damped.then(|| damper(End::Body(0), End::Ground, 1e-2)));
        }
        let mut world = Bench { bodies, couplings: couplings.clone() }.world(Method::Zoh, output, 1e-3);
        world.sampling.delay = Delay::Samples(late.floor());
        let linear = required_damping(&world).unwrap();
        for (i, (stiffness, damping)) in walls.iter().enumerate() {
            let first = if at_body && i == 1 { End::Body(0) } else { End::Puck };
            world.couplings.push(wall(first, *stiffness, *damping, 1.0));
        }
        let found = passivity(&world).unwrap();
        match (found.required_damping, linear) {
            (Some(found), Some(linear)) => prop_assert!(found >= linear * (1.0 - 1e-9), "{found} {linear}"),
            (Some(found), None) => prop_assert!(false, "{found} where nothing is enough before the wall"),
            (None, _) => {}
        }
    }

    /// Passive and unstable together contradict each other, and certified means passive, stable and proved by theorems.
    #[test]
    fn an_answer_does_not_contradict_itself(
        bench in worlds(Dampers::Fixed, false), x in 0.01..1.9f64, late in prop_oneof![Just(0.0), 0.0..3.0f64], share in 0.0..2.0f64,
        method in select(Method::ALL.to_vec()), output in select(vec![Output::Start, Output::Middle, Output::End]),
        estimator in select(vec![EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::Foaw, EstimatorKind::Kalman, EstimatorKind::Levant]),
        wall_at in prop::option::of((any::<bool>(), 0.1..10.0f64, 0.0..1e-2f64)), longest in prop::option::of(1.0..2.0f64),
    ) {
        let period = x / fastest(&bench);
        let mut world = bench.world(method, output, period);
        (world.sampling.delay, world.sampling.estimator) = (Delay::Samples(late), estimator);
        (world.sampling.cutoff, world.sampling.acceleration) = (Some(0.05 / period), Some(1.0));
        world.sampling.interval_max = longest.map(|longest| longest * period);
        if let Some((at_body, stiffness, damping)) = wall_at {
            world.couplings.push(wall(if at_body { End::Body(0) } else { End::Puck }, stiffness, damping, 0.1));
        }
        if let Ok(Some(required)) = required_damping(&world) {
            world.device.damping = required * share;
        }
        let Ok(found) = check(&world) else { return Ok(()) };
        let unstable = found.free.verdict == hapt_analysis::Verdict::Unstable;
        prop_assert!(!(found.passivity.passive.holds() && unstable), "{found:?}");
        prop_assert_eq!(found.certified.holds(), found.status == Status::Certified);
        prop_assert_eq!(found.certified.holds(), is_certified(&world));
        let claims = |claim: &str| found.theorems.iter().any(|theorem| theorem.claims.contains(&claim));
        if found.certified.holds() {
            prop_assert!(claims("held") && claims("free") && claims("passive"));
            prop_assert!(found.uneven.passive.holds() && found.passivity.passive.holds());
        }
        prop_assert_eq!(found.passivity.proved.holds(), found.passivity.not_proved.is_empty(), "{:?}", found.passivity);
        prop_assert!(!found.passivity.passive.holds() || found.passivity.required_damping.unwrap() <= world.device.damping);
    }

    /// Friction with bristles that are a hysteresis of the path: no motion under any times draws energy at the damping that is called
    /// enough.
    #[test]
    fn bristles_without_damping_give_no_energy_at_the_damping_that_is_enough(
        stiffness in 0.1..10.0f64, level in 1e-3..0.1f64, viscous in prop_oneof![Just(0.0), 0.0..1e-3f64], longest in prop::option::of(1.0..2.0f64),
        late in prop_oneof![Just(0.0), 0.0..1.0f64], size in -2.0..2.0f64,
        steps in prop::collection::vec((0.01..1.0f64, 0.0..1.0f64, prop::array::uniform4(-1.0..1.0f64)), 20..60),
    ) {
        let law = Law::Lugre {
            coulomb: level, stribeck: level, stribeck_velocity: 0.1, bristle_stiffness: stiffness, bristle_damping: 0.0, viscous,
        };
        let mut world = Bench::of(vec![law.between(End::Puck, End::Ground)]).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.interval_max = longest.map(|longest| longest * 1e-3);
        world.sampling.delay_max = Some(Delay::Samples(late));
        let damping = hapt_analysis::uneven_damping(&world).unwrap().unwrap();
        world.device.damping = damping;
        prop_assert!(is_certified(&world));
        // From sample to sample in four straight pieces, with displacements of the size that bends the bristles.
        let speed = 10f64.powf(size) * level / stiffness / 1e-3;
        let (mut z, mut before, mut bristle, mut held, mut drawn, mut moved) = (0.0, 0.0, 0.0, 0.0, 0.0f64, 0.0f64);
        for (share, delay, velocities) in steps {
            let interval = longest.map_or(1e-3, |longest| share * longest * 1e-3);
            let v: f64 = (z - before) / 1e-3;
            before = z;
            let rate = stiffness * v.abs() / level;
            let kept = (-rate * 1e-3).exp();
            bristle = if rate > 0.0 { bristle * kept + v * (1.0 - kept) / rate } else { bristle };
            let (next, arrives) = (-(stiffness * bristle + viscous * v), delay * late * 1e-3);
            for (i, part) in velocities.iter().enumerate() {
                let velocity = part * speed;
                let [from, to] = [i as f64, i as f64 + 1.0].map(|i| 0.25 * i * interval);
                let old = (arrives.clamp(from, to) - from).min(to - from);
                for (torque, time) in [(held, old), (next, to - from - old)] {
                    drawn += torque * velocity * time - damping * velocity * velocity * time;
                    moved += (torque * velocity * time).abs();
                }
                z += velocity * (to - from);
                prop_assert!(drawn <= 1e-9 * moved, "{drawn} of {moved}");
            }
            held = next;
        }
    }

    /// Friction makes up for missing damping up to the speed (f - KΔ/2 - ΣB Δ/T)/(b_required - b), less two counts a sample that the
    /// supervisor does not see.
    #[test]
    fn friction_makes_up_for_damping_up_to_a_speed(
        k in 0.1..10.0f64, share in 0.0..0.99f64, b in 0.0..1e-3f64, friction in 1e-4..0.1f64, counts in prop::option::of(1e3..1e5f64), late in 0..4u32,
    ) {
        let couplings = vec![spring(End::Puck, End::Ground, k), damper(End::Puck, End::Ground, b)];
        let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.delay = Delay::Samples(f64::from(late));
        let required = required_damping(&world).unwrap().unwrap();
        (world.device.damping, world.device.friction, world.device.encoder) = (share * required, friction, counts);
        let count = counts.map_or(0.0, |n| std::f64::consts::TAU / n);
        let wanted = (friction - count * (0.5 * k + b / 1e-3)) / (required * (1.0 - share)) - 2.0 * count / 1e-3;
        let found = passivity(&world).unwrap();
        prop_assert!(!found.passive.holds());
        match found.speed_max {
            Some(speed) => prop_assert!((speed / wanted - 1.0).abs() < 1e-6, "{speed} {wanted}"),
            None => prop_assert!(wanted < 1e-6),
        }
        // The supervisor keeps the speed that the file states.
        let Some(speed) = found.speed_max else { return Ok(()) };
        for (part, certified) in [(0.999, true), (1.001, false)] {
            world.safety.overspeed = Some(part * speed);
            prop_assert_eq!(is_certified(&world), certified);
            let found = check(&world).unwrap();
            prop_assert_eq!((found.certified.holds(), found.passivity.passive.holds()), (certified, certified));
        }
        // A larger speed that the file allows by another key is the one that counts.
        (world.safety.overspeed, world.safety.velocity) = (Some(0.5 * speed), Some(2.0 * speed));
        prop_assert!(!is_certified(&world));
        // The low end of the friction's tolerance counts.
        (world.safety.velocity, world.safety.overspeed, world.device.tolerances.friction) = (None, Some(0.999 * speed), 0.1);
        prop_assert!(!is_certified(&world));
    }
}

/// Intervals up to the period are not the period: the torque of a motor that lags hardly changes in short ones.
#[test]
fn intervals_up_to_the_period_are_more_than_even_samples() {
    let couplings = vec![spring(End::Puck, End::Ground, 1.0), damper(End::Puck, End::Ground, 1e-3)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.device.inertia, world.device.lag) = (1e-3, 1e-3, 1e-3);
    let even = check(&world).unwrap();
    assert_eq!(even.uneven.interval_s, [1e-3, 1e-3]);
    world.sampling.interval_max = Some(1e-3);
    let any = check(&world).unwrap();
    assert_eq!(any.uneven.interval_s, [0.0, 1e-3]);
    assert!(!any.certified.holds() && !any.uneven.passive.holds());
    assert!(any.uneven.required_damping > even.uneven.required_damping);
    // The pattern 0.01 ms, 0.01 ms, 1 ms grows by 0.234 per second.
    assert_eq!(any.uneven.free.verdict(), PatternVerdict::Broken, "{:?}", any.uneven.free);
    assert!(any.uneven.free.pattern().unwrap().growth_per_s > 0.23);
}

/// Stable at the flat and at the steep slope, and the loop between them grows: its exact run goes from 574 to 4e13 N·m in 18 s.
#[test]
fn eigenvalues_of_two_linear_loops_prove_nothing_of_the_wall_between_them() {
    let couplings = vec![spring(End::Puck, End::Ground, 34630.0), wall(End::Puck, 4470.0, 178.0, 0.0)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
    (world.sampling.delay, world.device.inertia, world.device.damping) = (Delay::Seconds(12e-3), 1.0, 337.0);
    let found = check(&world).unwrap();
    assert!(found.free.verdict == hapt_analysis::Verdict::Stable);
    assert_eq!(found.uneven.free.verdict(), PatternVerdict::Open, "{:?}", found.uneven.free);
    assert!(!found.certified.holds() && !found.passivity.passive.holds());
}

#[test]
fn a_common_form_proves_walls_that_are_not_passive() {
    let couplings = vec![
        spring(End::Puck, End::Ground, 3.0),
        damper(End::Puck, End::Ground, 5e-3),
        wall(End::Puck, 0.3, 1e-3, 0.1),
    ];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
    (world.device.inertia, world.device.damping) = (1e-4, 1e-3);
    for late in [0.0, 0.5, 1.0] {
        world.sampling.delay = Delay::Samples(late);
        let found = check(&world).unwrap();
        assert!(!found.passivity.passive.holds());
        let free = &found.uneven.free;
        assert_eq!(
            (free.verdict(), free.proved_by()),
            (PatternVerdict::Proved, Some("common form")),
            "{late}: {free:?}"
        );
    }
}

#[test]
fn a_world_that_no_theorem_covers_is_open() {
    let couplings = vec![spring(End::Puck, End::Ground, 1.0), damper(End::Puck, End::Ground, 1e-4)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
    world.sampling.estimator = EstimatorKind::Foaw;
    let found = check(&world).unwrap();
    assert_eq!((found.status, found.certified.holds(), found.passivity.passive.holds()), (Status::Open, false, false));
    assert!(found.verdict_sentence().starts_with("open, not certified: nothing was found against it"));
    // The true velocity counts as the difference, but is not one.
    world.sampling.estimator = EstimatorKind::Exact;
    let found = check(&world).unwrap();
    assert_eq!((found.status, found.certified.holds(), found.passivity.passive.holds()), (Status::Open, false, true));
    assert_eq!(hapt_analysis::remedies(&world).unwrap().estimator, Some("difference"));
    world.sampling.estimator = EstimatorKind::Difference;
    assert_eq!(check(&world).unwrap().status, Status::Certified);
    world.device.damping = 1e-4;
    assert_eq!(check(&world).unwrap().status, Status::Refuted);
}
