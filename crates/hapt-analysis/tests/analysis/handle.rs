//! A handle on a flexible shaft: limits, closed forms, and what passivity at the motor implies for it.

use hapt_analysis::{
    Grip, PatternVerdict, check, free, free_growth, gripped_growth, held_growth, held_world, held_world_growth,
    is_certified, passivity, required_damping, uneven, worst_grip, worst_pattern,
};
use hapt_model::{Delay, End, EstimatorKind, Handle, Law, Method, Output, World};
use hapt_testing::prelude::*;
use proptest::sample::select;

use crate::common::*;

/// Handles whose shaft swings between a hundredth of and ten times the sampling rate, on the notes' device.
fn handles() -> impl Strategy<Value = Handle> {
    let damping = prop_oneof![Just(0.0), 1e-5..0.1f64];
    (-5.0..-1.5f64, 0.0..4.0f64, damping).prop_map(|(inertia, stiffness, damping)| Handle {
        inertia: 10f64.powf(inertia),
        stiffness: 10f64.powf(stiffness),
        damping,
    })
}

fn loops() -> impl Strategy<Value = World> {
    let estimator = select(vec![EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::LowPass]);
    let delay = prop_oneof![Just(0.0), Just(1.0), 0.0..2.0f64];
    let lag = prop_oneof![Just(0.0), 0.02..2.0f64];
    let sampling = (select(Method::ALL.to_vec()), select(Output::ALL.to_vec()), estimator, delay, lag);
    (worlds(Dampers::Fixed, false), sampling, 0.01..1.0f64, -2.0..2.0f64).prop_map(
        |(bench, (method, output, estimator, delay, lag), x, damping)| {
            let mut world = bench.world(method, output, x / fastest(&bench));
            (world.sampling.estimator, world.sampling.cutoff) = (estimator, Some(0.1 / world.sampling.period));
            world.sampling.delay = Delay::Samples(delay);
            (world.device.lag, world.device.damping) = (lag * world.sampling.period, 1e-3 * 10f64.powf(damping));
            world
        },
    )
}

#[test]
fn a_device_alone_swings_on_its_shaft() {
    let mut world = Bench::of(vec![]).world(Method::Zoh, Output::End, 1e-3);
    world.device.damping = 0.0;
    world.device.handle = Some(Handle { inertia: 5e-4, stiffness: 20.0, damping: 0.0 });
    let found = free(&world).unwrap();
    let hz = (20.0 * (1.0 / 6.4e-4 + 1.0 / 5e-4_f64)).sqrt() / std::f64::consts::TAU;
    assert_eq!(found.modes.len(), 1);
    assert!((found.modes[0].frequency_hz - hz).abs() < 1e-9 * hz, "{found:?}");
    assert!((found.modes[0].discrete_frequency_hz.unwrap() - hz).abs() < 1e-9 * hz);
    assert!(found.growth_per_s.unwrap().abs() < 1e-9);
    // Held at the handle, the puck swings only on the shaft.
    let held = held_world(&world).unwrap();
    let hz = (20.0_f64 / 6.4e-4).sqrt() / std::f64::consts::TAU;
    assert!((held.modes[0].frequency_hz - hz).abs() < 1e-9 * hz && held.modes.len() == 1);
}

proptest! {
    #![proptest_config(hapt_testing::cases(128))]

    /// Shaft, handle and hand are one passive hand at the motor: neither the required damping nor the verdict depends on them.
    #[test]
    fn passivity_does_not_know_the_handle(world in loops(), handle in handles(), stretch in 1.0..1.9f64) {
        let mut world = world;
        world.sampling.interval_max = Some(stretch * world.sampling.period);
        let (first, times) = (passivity(&world).unwrap(), uneven(&world).unwrap());
        world.device.handle = Some(handle);
        prop_assert_eq!(passivity(&world).unwrap(), first);
        let with = uneven(&world).unwrap();
        prop_assert_eq!((with.required_damping, with.passive, with.not_proved), (times.required_damping, times.passive, times.not_proved));
    }

    /// The theorem that it rests on, by eigenvalues: what is passive at the motor grows neither hands-off, nor held at the handle, nor with a
    /// hand on it.
    #[test]
    fn what_is_passive_at_the_motor_grows_with_no_handle(
        world in loops(), handle in handles(), (inertia, damping, stiffness) in (-6.0..-1.0f64, 0.0..0.1f64, -1.0..4.0f64),
    ) {
        let mut world = world;
        if world.sampling.estimator == EstimatorKind::Exact {
            // The true velocity counts as the difference.
            world.sampling.estimator = EstimatorKind::Difference;
        }
        world.device.damping = 0.0;
        let Some(required) = required_damping(&world).unwrap() else { return Ok(()) };
        world.device.damping = required * (1.0 + 1e-9) + 1e-12;
        world.device.handle = Some(handle);
        let rounding = 1e-8 / world.sampling.period;
        let grip = Grip { inertia: 10f64.powf(inertia), damping, stiffness: 10f64.powf(stiffness) };
        let growths = [free_growth(&world).unwrap(), held_world_growth(&world).unwrap(), gripped_growth(&world, &grip).unwrap()];
        prop_assert!(growths.iter().flatten().all(|growth| *growth < rounding), "{growths:?} {world:?}");
    }

    /// A shaft much stiffer than anything else, damped so that it does not ring, acts as a rigid one.
    #[test]
    fn a_stiff_shaft_makes_handle_and_puck_one(world in loops(), inertia in -5.0..-2.0f64) {
        let mut world = world;
        let inertia = 10f64.powf(inertia);
        let mass = 1.0 / (1.0 / inertia + 1.0 / world.device.inertia);
        // The shaft's swing, a hundred thousand times the sampling rate.
        let rate = 1e5 / world.sampling.period;
        let shaft = Handle { inertia, stiffness: mass * rate * rate, damping: 2.0 * mass * rate };
        let mut rigid = world.clone();
        rigid.device.inertia += inertia;
        world.device.handle = Some(shaft);
        let (with, without) = (free_growth(&world).unwrap(), free_growth(&rigid).unwrap());
        let (Some(with), Some(without)) = (with, without) else {
            prop_assert_eq!(with, without);
            return Ok(());
        };
        let scale = 1.0 / world.sampling.period;
        prop_assert!((with - without).abs() < 1e-3 * scale.min(without.abs()) + 2e-5 * scale, "{with} {without}");
    }

    /// A heavy handle holds still: hands-off is then held at the handle, but for the drift of both.
    #[test]
    fn held_at_the_handle_is_the_free_loop_with_a_heavy_one(world in loops(), handle in handles()) {
        let mut world = world;
        world.device.handle = Some(handle);
        let held = held_world_growth(&world).unwrap();
        world.device.handle = Some(Handle { inertia: 1e9, ..handle });
        let heavy = free_growth(&world).unwrap();
        let (Some(held), Some(heavy)) = (held, heavy) else { return Ok(()) };
        let rounding = 1e-5 / world.sampling.period;
        // A drift neither grows nor decays.
        prop_assert!((heavy - held).abs() < rounding || (heavy.abs() < rounding && held < rounding), "{held} {heavy}");
    }

    /// Patterns: a proof by a common form is contradicted neither by the even loop nor by the worst pattern that is found.
    #[test]
    fn a_proof_with_a_handle_is_contradicted_by_no_pattern(
        alpha in 0.05..2.0f64, beta in 0.0..0.9f64, delta in 0.02..0.3f64, handle in handles(), stretch in 1.05..1.9f64,
    ) {
        let unit = 6.4e-4 / 1e-3;
        let couplings = vec![spring(End::Puck, End::Ground, alpha * unit / 1e-3), damper(End::Puck, End::Ground, beta * unit)];
        let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
        (world.device.damping, world.device.handle) = (delta * unit, Some(handle));
        world.sampling.interval_max = Some(stretch * 1e-3);
        let found = uneven(&world).unwrap().free;
        let worst = worst_pattern(&world).unwrap();
        match found.verdict() {
            PatternVerdict::Proved => prop_assert!(worst.growth_per_s < 1e-3, "{worst:?}"),
            PatternVerdict::Broken => prop_assert!(found.pattern().unwrap().growth_per_s > 0.0),
            PatternVerdict::Open => prop_assert!(found.reason().is_some()),
        }
    }
}

#[test]
fn some_loops_with_a_handle_are_proved_by_a_common_form() {
    let couplings = vec![spring(End::Puck, End::Ground, 100.0), damper(End::Puck, End::Ground, 0.1)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.device.handle) =
        (0.05, Some(Handle { inertia: 5e-4, stiffness: 20.0, damping: 5e-3 }));
    world.sampling.delay_max = Some(Delay::Seconds(0.1e-3));
    let found = uneven(&world).unwrap();
    assert!(!found.passive.holds());
    assert_eq!(
        (found.free.verdict(), found.free.proved_by()),
        (PatternVerdict::Proved, Some("common form")),
        "{:?}",
        found.free
    );
}

#[test]
fn a_certificate_with_a_handle_says_what_it_is_about() {
    let mut world = Bench::of(vec![spring(End::Puck, End::Ground, 2.0)]).world(Method::Zoh, Output::End, 1e-3);
    assert!(is_certified(&world));
    world.device.handle = Some(Handle { inertia: 5e-4, stiffness: 20.0, damping: 1e-3 });
    let found = check(&world).unwrap();
    assert!(found.certified.holds() && is_certified(&world) && found.passivity.proved.holds());
    assert!(
        found.sentence().starts_with("stable: with the handle held, the loop comes to rest"),
        "{}",
        found.sentence()
    );
    assert!(found.notes.iter().any(|note| note.starts_with("device.handle: ")));
    assert_eq!((found.held.modes.len(), found.free.modes.len()), (1, 2));
    // Without bodies, [`held_growth`] with the puck held has no eigenvalues.
    assert_eq!(held_growth(&world.bodies, &world.couplings, Method::Zoh, 1e-3).unwrap(), None);
    // Far above what the device damps: the shaft does not save it.
    let mut stiff = world.clone();
    stiff.couplings = vec![spring(End::Puck, End::Ground, 100.0)];
    assert!(!is_certified(&stiff) && worst_grip(&stiff).unwrap().is_some());
}

/// Held at the handle the puck moves on its shaft. Between the slopes of a detent the loop may oscillate by itself, which eigenvalues do
/// not show.
#[test]
fn a_handle_held_over_the_top_of_a_detent_is_claimed_only_where_the_loop_is_passive() {
    let detent = Law::Detent { torque: 0.24, pitch: 0.3, phase: 0.15 }.between(End::Puck, End::Ground);
    let mut world = Bench::of(vec![detent]).world(Method::Zoh, Output::End, 1e-3);
    world.device.handle = Some(Handle { inertia: 5e-4, stiffness: 20.0, damping: 1e-3 });
    world.sampling.delay = Delay::Samples(26.0);
    let claims = |world: &World| {
        let found = check(world).unwrap();
        found.theorems.iter().any(|theorem| theorem.claims.contains(&"held"))
    };
    assert!(!claims(&world));
    // With the damping that the detent with its delay requires, it is passive, and therefore stable when held.
    world.device.damping = 1.01 * required_damping(&world).unwrap().unwrap();
    assert!(claims(&world));
    world.device.handle = None;
    world.device.damping = 0.0;
    assert!(claims(&world));
}
