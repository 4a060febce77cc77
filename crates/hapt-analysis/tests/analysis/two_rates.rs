//! Bodies that step at every n-th sample: the theorem about them on the real core, and what has no proof.

use hapt_analysis::{
    Cause, Error, Impedance, PatternVerdict, Slopes, Verdict, breaking_damping, check, free, free_growth, held,
    held_world, passivity, required_damping, uneven, with_worst_pattern, worst_grip, worst_pattern,
};
use hapt_core::Loop;
use hapt_model::{
    Coupling, Damping, Delay, Drive, End, EstimatorKind, Hand, Law, Method, Output, Scenario, Shape, Side, Timing,
    World,
};
use hapt_testing::laws::{SIZES, Sizes, is_potential, some_limited};
use hapt_testing::prelude::*;

use crate::common::*;

const KEEPING: [Method; 3] = [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler];

fn log_uniform(decades: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    decades.prop_map(|d| 10f64.powf(d))
}

/// Laws of the position between the ends of a small world, dampers and frictions where the puck does not move them, and a damper to ground at
/// the puck: what the theorem covers. Their scale is 1 N·m/rad.
fn covered() -> impl Strategy<Value = World> {
    let ends = [
        (End::Puck, End::Body(0)),
        (End::Body(1), End::Puck),
        (End::Body(0), End::Body(1)),
        (End::Body(1), End::Ground),
        (End::Puck, End::Ground),
    ];
    let position = some_limited(Sizes { damping: 0.0..=0.0, ..SIZES }.laws(is_potential), 0.01..0.5);
    let damped = prop_oneof![
        (0.0..0.02).prop_map(|damping| Law::Damper { damping: Damping::Fixed(damping) }),
        (0.0..0.05).prop_map(|torque| Law::Coulomb { torque }),
    ];
    let couplings = (
        prop::collection::vec((0..5usize, position), 1..6),
        prop::collection::vec((2..4usize, damped), 0..3),
        prop_oneof![Just(0.0), 1e-4..1e-2],
    );
    let bodies = (log_uniform(-4.0..-2.0), log_uniform(-4.0..-2.0));
    (bodies, couplings, prop::sample::select(KEEPING.to_vec()), log_uniform(-3.5..-2.0), 1..12u32).prop_map(
        move |((one, other), (position, damped, ground), method, period, every)| {
            let mut couplings: Vec<Coupling> = position
                .into_iter()
                .map(|(at, (law, limit))| Coupling { limit, ..law.between(ends[at].0, ends[at].1) })
                .chain(damped.into_iter().map(|(at, law)| law.between(ends[at].0, ends[at].1)))
                .collect();
            if ground > 0.0 {
                couplings.push(damper(End::Puck, End::Ground, ground));
            }
            let mut bodies = vec![body(one), body(other)];
            (bodies[0].position, bodies[0].velocity) = (0.1, -1.0);
            let mut world = Bench { bodies, couplings }.world(method, Output::End, period);
            world.sampling.bodies_every = every;
            world
        },
    )
}

type Core = Loop<f64, 6, 32, 2>;

/// The energy that a hand has drawn from the loop after each sample, in J: it moves the puck by `motion` of the present torque, uniformly from
/// sample to sample, and the device dissipates b δ²/T of it.
fn drawn(world: &World, damping: f64, samples: usize, mut motion: impl FnMut(usize, f64) -> f64) -> Vec<f64> {
    let core = Core::new(&world.spec()).unwrap();
    let (mut state, mut z, mut sum) = (core.start(), 0.0, 0.0);
    let period = world.sampling.period;
    (0..samples)
        .map(|k| {
            let torque = core.step(&mut state, z, 0.0).torque;
            let dz = motion(k, torque);
            z += dz;
            sum += torque * dz - damping * dz * dz / period;
            sum
        })
        .collect()
}

/// The energy that the world has at the start, the puck at 0.
fn stored(world: &World) -> f64 {
    let moving: f64 = world.bodies.iter().map(|b| 0.5 * b.inertia * b.velocity * b.velocity).sum();
    let at = |end: End| end.body().map_or(0.0, |i| world.bodies[i].position);
    moving + world.couplings.iter().map(|c| c.stored(at(c.first) - at(c.second), 0.0)).sum::<f64>()
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// However the puck moves: at random, greedily along with the torque, and between two places at every sample.
    #[test]
    fn no_hand_draws_more_than_was_stored_from_what_the_theorem_covers(
        world in covered(), steps in prop::collection::vec(-1.0..1.0f64, 400), size in log_uniform(-4.0..-0.5), pull in 0.2..2.0f64,
    ) {
        let found = passivity(&world).unwrap();
        let required = found.required_damping.unwrap();
        prop_assert!(found.proved.holds() == (required <= world.device.damping) || found.not_proved.is_empty(), "{found:?}");
        let most = stored(&world);
        let greedy = |_: usize, torque: f64| 0.5 * pull * torque * world.sampling.period / required.max(1e-6);
        let random = |k: usize, _: f64| size * steps[k];
        let nyquist = |k: usize, _: f64| if k.is_multiple_of(2) { size } else { -size };
        let hands: [&dyn Fn(usize, f64) -> f64; 4] = [
            &random, &greedy, &nyquist, &|k, torque| if steps[k] > 0.0 { greedy(k, torque) } else { random(k, torque) },
        ];
        for (hand, motion) in hands.into_iter().enumerate() {
            // The turnover's rounding.
            let mut moved = 0.0f64;
            let got = drawn(&world, required.max(1e-6), steps.len(), |k, torque| {
                let dz = motion(k, torque);
                moved += (torque * dz).abs();
                dz
            });
            let worst = got.into_iter().fold(0.0, f64::max);
            prop_assert!(worst <= most * (1.0 + 1e-9) + 1e-9 * moved, "{hand}: {worst} of {most}, {moved}: {world:?}");
        }
    }

    /// Between two steps of the bodies the world is the bare spring K: a hand that is back where it was at each of them draws for ever.
    #[test]
    fn a_hand_between_two_steps_of_the_bodies_draws_at_less(
        stiffness in prop::collection::vec(0.1..20.0f64, 3), inertia in log_uniform(-4.0..-2.0), every in 2..12u32,
        period in log_uniform(-3.5..-2.0), method in prop::sample::select(KEEPING.to_vec()),
    ) {
        let couplings = vec![
            spring(End::Puck, End::Body(0), stiffness[0]),
            spring(End::Body(0), End::Ground, stiffness[1]),
            spring(End::Ground, End::Puck, stiffness[2]),
        ];
        let mut world = Bench { bodies: vec![body(inertia)], couplings }.world(method, Output::End, period);
        world.sampling.bodies_every = every;
        let k = stiffness[0] + stiffness[2];
        let required = required_damping(&world).unwrap().unwrap();
        prop_assert!((required - 0.5 * k * period).abs() < 1e-9 * required, "{required} {k}");
        // The fast Nyquist frequency; where a step has an odd number of samples it rests at one of them.
        let amplitude = 0.01;
        let motion = |k: usize, _: f64| match k % every as usize {
            at if !every.is_multiple_of(2) && at == every as usize - 1 => 0.0,
            at if at.is_multiple_of(2) => amplitude,
            _ => -amplitude,
        };
        let gains = |damping: f64| {
            let got = drawn(&world, damping, 100 * every as usize, motion);
            got[got.len() - 1]
        };
        let pairs = f64::from(every / 2) * 100.0;
        // Out against no torque and back with K times the displacement.
        let expected = |damping: f64| pairs * amplitude * amplitude * (k - 2.0 * damping / period);
        for part in [0.95, 1.0, 1.05] {
            let (got, wanted) = (gains(part * required), expected(part * required));
            prop_assert!((got - wanted).abs() < 1e-9 * pairs * amplitude * amplitude * k, "{part}: {got} {wanted}");
        }
        prop_assert!(gains(0.95 * required) > 0.0);
    }

    /// The held world is that of a loop of n periods, and its critical period is in periods of the loop.
    #[test]
    fn the_held_world_is_that_of_the_bodies_step(bench in worlds(Dampers::Mixed, true), method in 0..6usize, every in 2..9u32, x in log_uniform(-2.5..0.5)) {
        let mut world = bench.world(Method::ALL[method], Output::End, x / fastest(&bench));
        world.sampling.bodies_every = every;
        let found = held_world(&world).unwrap();
        let slow = held(&world.bodies, &world.couplings, world.sampling.method, world.sampling.step()).unwrap();
        prop_assert_eq!(&found.eigenvalues, &slow.eigenvalues);
        prop_assert_eq!(found.growth_per_s, slow.growth_per_s);
        if let Some(critical) = found.critical_period_s {
            let grows = |period: f64| {
                let mut world = world.clone();
                world.sampling.period = period;
                held_world(&world).unwrap().growth_per_s.unwrap_or(f64::NEG_INFINITY) > 0.0
            };
            prop_assert!(!grows(0.999 * critical) && grows(1.001 * critical), "{critical}");
        }
    }
}

proptest! {
    // Each is some thousand eigenvalue problems.
    #![proptest_config(hapt_testing::cases(16))]

    /// A hand at rest is passive, and so is no hand: with neither does a loop grow that the theorem covers.
    #[test]
    fn a_passive_loop_does_not_grow_hands_off_nor_in_a_grip(
        bench in worlds(Dampers::Fixed, true), method in prop::sample::select(KEEPING.to_vec()), every in 2..9u32,
        x in log_uniform(-2.5..0.3), own in log_uniform(-1.0..2.0), margin in 1.0..1.5f64,
    ) {
        let mut bench = bench;
        // Dampers at the puck are beyond the theorem.
        bench.couplings.retain(|c| matches!(c.law, Law::Spring { .. }) || (c.first != End::Puck && c.second != End::Puck));
        bench.couplings.push(spring(End::Puck, End::Ground, own));
        let mut world = bench.world(method, Output::End, x / fastest(&bench) / f64::from(every));
        world.sampling.bodies_every = every;
        let required = required_damping(&world).unwrap().unwrap();
        world.device.damping = margin * required;
        world.device.inertia = 0.3 * required * world.sampling.period;
        prop_assert!(Verdict::of(free_growth(&world).unwrap()) != Verdict::Unstable, "{:?}", free_growth(&world));
        prop_assert_eq!(worst_grip(&world).unwrap(), None);
        // The damping at which a hand breaks it is below the requirement, and a hand is found that nearly needs it.
        world.device.damping = 0.0;
        let broken = breaking_damping(&world).unwrap();
        prop_assert!(broken.is_some_and(|hand| hand.damping <= required && hand.damping > 0.3 * required), "{broken:?} {required}");
    }
}

/// A wheel on a spring, its bodies at every fourth sample.
fn wheel() -> World {
    let couplings = vec![spring(End::Puck, End::Body(0), 1.0), damper(End::Body(0), End::Ground, 1e-3)];
    let mut world = Bench { bodies: vec![body(0.02)], couplings }.world(Method::Zoh, Output::End, 1e-3);
    world.sampling.bodies_every = 4;
    world.names = vec!["wheel".into()];
    world
}

#[test]
fn what_the_theorem_does_not_cover_has_no_number_and_says_why() {
    let passive = check(&wheel()).unwrap();
    assert!(
        passive.certified.holds() && passive.passivity.proved.holds() && passive.uneven.proved.holds(),
        "{passive:?}"
    );
    assert!((passive.passivity.required_damping.unwrap() - 0.5e-3).abs() < 1e-12);
    let one = |change: &dyn Fn(&mut World), word: &str| {
        let mut world = wheel();
        change(&mut world);
        let found = check(&world).unwrap();
        let reasons = &found.passivity.not_proved;
        assert!(reasons.iter().any(|reason| reason.contains(word)), "{word}: {reasons:?}");
        assert_eq!(
            (found.passivity.required_damping, found.passivity.passive.holds(), found.passivity.proved.holds()),
            (None, false, false)
        );
        assert!(!found.certified.holds() && found.uneven.required_damping.is_none());
        assert!(
            found.verdict_sentence().contains("no theorem says that it is passive"),
            "{}",
            found.verdict_sentence()
        );
        // The same world at one rate has a number, or another reason.
        world.sampling.bodies_every = 1;
        assert!(!passivity(&world).unwrap().not_proved.iter().any(|reason| reason.contains("every n-th sample")));
    };
    for method in [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4] {
        one(&|w| w.sampling.method = method, "zoh, trapezoidal");
    }
    for output in [Output::Start, Output::Middle] {
        one(&|w| w.sampling.output = output, "end of their step");
    }
    one(&|w| w.sampling.delay = Delay::Samples(1.0), "late");
    one(&|w| w.sampling.delay = Delay::Seconds(1e-4), "late");
    one(&|w| w.device.lag = 1e-4, "the motor's lags");
    for law in [
        Law::Damper { damping: Damping::Fixed(1e-4) },
        Law::Damper { damping: Damping::Compensating },
        Law::Wall { side: Side::Above, at: 0.1, stiffness: 1.0, damping: 1e-4 },
    ] {
        one(&|w| w.couplings.push(law.between(End::Body(0), End::Puck)), "a damper or a friction");
    }
    // A friction at the puck has none at any rate.
    let mut world = wheel();
    world.couplings.push(Law::Coulomb { torque: 0.1 }.between(End::Body(0), End::Puck));
    assert_eq!(passivity(&world).unwrap().cause, Some(Cause::Coulomb));
    // A delay that varies, and not only one that stays.
    let mut world = wheel();
    world.sampling.delay_max = Some(Delay::Seconds(2e-4));
    let found = uneven(&world).unwrap();
    assert!(
        found.required_damping.is_none() && !found.passive.holds() && found.not_proved[0].contains("at once"),
        "{found:?}"
    );
    assert!(!check(&world).unwrap().certified.holds());
}

/// Dampers between puck and ground count as in parallel with a bare spring: those that compensate, only with the springs between puck and
/// ground.
#[test]
fn dampers_to_ground_add_what_they_are() {
    let mut world = wheel();
    world.couplings.extend([
        spring(End::Ground, End::Puck, 0.5),
        compensator(End::Puck, End::Ground),
        damper(End::Ground, End::Puck, 1e-4),
    ]);
    let required = required_damping(&world).unwrap().unwrap();
    assert!((required - (0.5 * 1.5e-3 + 0.5e-3 + 1e-4)).abs() < 1e-12, "{required}");
}

/// (T40): the work does not depend on the intervals.
#[test]
fn uneven_intervals_ask_for_as_much_more_as_they_are_longer() {
    let mut world = wheel();
    world.sampling.interval_max = Some(2e-3);
    let found = uneven(&world).unwrap();
    assert!(found.proved.holds() && (found.required_damping.unwrap() - 1e-3).abs() < 1e-12, "{found:?}");
    assert_eq!(found.free.proved_by(), Some("passivity"));
    // Without that proof nothing else is known.
    world.device.damping = 0.9e-3;
    let found = uneven(&world).unwrap();
    assert!(!found.passive.holds() && found.free.verdict() == PatternVerdict::Open, "{found:?}");
}

#[test]
fn what_is_about_loops_of_one_rate_is_refused_by_name() {
    let world = wheel();
    let refused = |error: Error| {
        let text = error.to_string();
        assert!(
            matches!(error, Error::BodiesEvery { every: 4, .. }) && text.contains("loop.bodies_every is 4"),
            "{text}"
        );
    };
    refused(Impedance::new(&world, &Slopes::Steep).unwrap_err());
    refused(worst_pattern(&world).unwrap_err());
    let hand = Hand { drive: Drive::Position(Shape::Step { to: 0.1, at: 0.0 }), release: None };
    let scenario = Scenario { name: "s".into(), duration: 1.0, hand, timing: Timing::Worst };
    refused(with_worst_pattern(&world, &scenario).unwrap_err());
}

/// The estimators, counts and limits that are not proved with bodies are not proved at this rate either.
#[test]
fn the_reasons_of_one_rate_stay() {
    let reasons = |change: &dyn Fn(&mut World)| {
        let mut world = wheel();
        change(&mut world);
        passivity(&world).unwrap().not_proved
    };
    for (found, word) in [
        (reasons(&|w| w.device.limit = Some(0.1)), "limit"),
        (reasons(&|w| w.device.encoder = Some(4000.0)), "counts"),
        (
            reasons(&|w| {
                w.couplings.push(damper(End::Puck, End::Ground, 1e-5));
                w.sampling.estimator = EstimatorKind::Exact;
            }),
            "exact",
        ),
        (reasons(&|w| w.couplings.push(Law::Constant { torque: 0.1 }.between(End::Body(0), End::Ground))), "constant"),
    ] {
        assert!(found.iter().any(|reason| reason.contains(word)), "{word}: {found:?}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(30))]

    /// A spring from puck to ground is in every sample what it is at one rate, (T25); a body apart has its own limit, of n periods.
    #[test]
    fn what_the_puck_and_a_body_do_apart_keeps_both_closed_limits(
        beta in log_uniform(-3.0..0.3), inertia in log_uniform(-5.0..0.0), period in log_uniform(-4.0..-2.0), every in 2..12u32,
        part in 0.3..3.0f64,
    ) {
        let rest = -(-beta).exp_m1();
        let stiffness = beta * beta * rest / (rest - beta * (-beta).exp()) * inertia / period / period;
        // Semi-implicit Euler on an undamped mode: nTω = 2.
        let omega = 2.0 / (part * period * f64::from(every));
        let couplings = vec![spring(End::Puck, End::Ground, stiffness), spring(End::Body(0), End::Ground, 0.02 * omega * omega)];
        let mut world = Bench { bodies: vec![body(0.02)], couplings }.world(Method::SemiImplicitEuler, Output::End, period);
        (world.device.inertia, world.device.damping) = (inertia, beta * inertia / period);
        world.sampling.bodies_every = every;
        let critical = free(&world).unwrap().critical_period_s.unwrap();
        prop_assert!((critical / period - part.min(1.0)).abs() < 1e-9, "{critical} {period} {part}");
    }

    /// Modes that hardly decay drive each other in narrow windows of periods, where a step of the bodies is a whole number of half swings.
    #[test]
    fn nothing_grows_at_any_period_up_to_the_critical_one(
        coupling in log_uniform(-3.0..0.0), stiffness in 0.3..3.0f64, own in prop_oneof![Just(0.0), 0.1..3.0f64], inertia in prop::collection::vec(0.5..2.0f64, 2),
        damping in log_uniform(-6.0..-1.5), samples in prop_oneof![Just(0.0), 0.0..3.0f64], every in 2..9u32, phases in prop::collection::vec(0.0..1.0f64, 1500),
    ) {
        let couplings = vec![
            spring(End::Puck, End::Body(0), coupling),
            spring(End::Body(0), End::Ground, stiffness),
            spring(End::Puck, End::Ground, own),
        ];
        let mut world = Bench { bodies: vec![body(inertia[0])], couplings }.world(Method::Zoh, Output::End, 0.1);
        (world.device.inertia, world.device.damping) = (inertia[1], damping);
        world.sampling.bodies_every = every;
        world.sampling.delay = Delay::Seconds(0.01 * samples);
        let found = free(&world).unwrap();
        let low = hapt_analysis::shortest_period(&world.sampling);
        let growth = |period: f64| {
            let mut world = world.clone();
            world.sampling.period = period;
            free_growth(&world).unwrap().unwrap_or(f64::NEG_INFINITY)
        };
        if found.critical_period_reason == Some("never") {
            prop_assert!(growth(low) > 0.0, "{world:?}");
            return Ok(());
        }
        // After many swings in a step, only rounding separates a root that touches the circle from one that leaves it.
        if found.critical_period_s.is_some_and(|critical| critical > 50.0 * world.sampling.period) {
            return Ok(());
        }
        if let Some(critical) = found.critical_period_s {
            prop_assert!([1e-6, 1e-4, 1e-2].iter().any(|more| growth(critical * (1.0 + more)) > 0.0), "{critical}: {world:?}");
        }
        let high = found.critical_period_s.unwrap_or(20.0);
        for (i, phase) in phases.iter().enumerate() {
            let period = low * (high / low).powf((i as f64 + phase) / phases.len() as f64);
            prop_assert!(growth(period) < 1e-9, "{period} below {high}: {world:?}");
        }
    }
}
