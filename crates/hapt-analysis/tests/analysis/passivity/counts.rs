//! Encoder counts and torque levels.

use std::f64::consts::TAU;

use hapt_analysis::quantisation;
use hapt_model::Motion;
use hapt_testing::prelude::*;

use super::*;

#[test]
fn counts_allow_what_damping_and_friction_swallow() {
    let mut world = plain(to_ground(10.0, 0.0), 1e-3);
    let ideal = quantisation(&world).unwrap();
    assert_eq!((ideal.max_stiffness, ideal.ok), (None, true));
    (world.device.encoder, world.device.damping, world.device.friction) = (Some(1000.0), 6e-3, 0.04);
    let found = quantisation(&world).unwrap();
    near(found.max_stiffness.unwrap(), 12.0, 1e-12);
    assert!(found.ok);
    world.device.friction = 0.02;
    near(quantisation(&world).unwrap().max_stiffness.unwrap(), 0.04 * 1000.0 / TAU, 1e-12);
    assert!(!quantisation(&world).unwrap().ok);
    world.motion = Motion::Linear;
    (world.device.encoder, world.device.friction) = (Some(5e-6), 1e-4);
    assert!(quantisation(&world).unwrap().ok);
}

proptest! {
    #![proptest_config(hapt_testing::cases(32))]

    /// (T34): without bodies, friction makes up for counts and levels, or they are not proved.
    #[test]
    fn friction_pays_for_counts_and_levels_at_the_puck_alone(
        k in 0.0..100.0f64, damping in 0.0..0.1f64, counts in prop::option::of(100.0..1e5f64), levels in prop::option::of(2..5000u32),
        limit in 0.1..10.0f64, part in 0.0..3.0f64, spare in 1.0..3.0f64,
    ) {
        let levels = levels.map(|n| 2 * n);
        let mut world = plain(to_ground(k, damping), 1e-3);
        world.sampling.estimator = EstimatorKind::Difference;
        (world.device.encoder, world.device.levels, world.device.limit) = (counts, levels, levels.map(|_| limit));
        let period = world.sampling.period;
        world.device.damping = (0.5 * k * period + damping) * spare;
        let count = world.count().unwrap_or(0.0);
        let step = levels.map_or(0.0, |levels| 2.0 * limit / f64::from(levels));
        let wanted = 0.5 * k * count + damping * count / period + 0.5 * step;
        world.device.friction = part * wanted;
        prop_assume!((part - 1.0).abs() > 1e-9 || wanted == 0.0);
        let (found, quantisation) = (passivity(&world).unwrap(), quantisation(&world).unwrap());
        let rounds = counts.is_some() || levels.is_some();
        prop_assert!(found.passive.holds());
        prop_assert_eq!(quantisation.ok, !rounds || part > 1.0 || wanted == 0.0);
        prop_assert_eq!(found.proved.holds(), quantisation.ok, "{:?}", found.not_proved);
        prop_assert_eq!(quantisation.max_stiffness.is_some(), rounds);
        if let Some(most) = quantisation.max_stiffness {
            prop_assert!(most >= 0.0 && most <= 2.0 * world.device.damping / period);
        }
        // With a body they are not, at any friction.
        world.device.friction = 10.0 * wanted;
        let mut bench = chain(1, 1.0, k + 1.0);
        bench.couplings.push(damper(End::Body(0), End::Ground, 0.1));
        (world.bodies, world.couplings) = (bench.bodies, bench.couplings);
        prop_assert_eq!(passivity(&world).unwrap().proved.holds(), !rounds && world.device.limit.is_none());
    }
}

#[test]
fn counts_feed_a_damped_body_with_no_more_than_a_power() {
    let mut world = wheel(Method::Zoh, Output::End, 0.3);
    world.names = vec!["wheel".into()];
    world.couplings.push(damper(End::Body(0), End::Ground, 0.01));
    let note = |world: &World| {
        let all = hapt_analysis::check(world).unwrap().notes;
        all.into_iter().find(|note| note.contains("power"))
    };
    assert_eq!(note(&world), None);
    world.device.encoder = Some(1000.0);
    // (K Δ)²/(16 B), K = 100, Δ = 2π/1000, B = 0.01.
    let power = (100.0 * TAU * 1e-3_f64).powi(2) / 0.16;
    assert!(note(&world).unwrap().contains(&format!("{power:.3} W")), "{:?} {power}", note(&world));
    // Without a damper to ground, or under a method that makes energy, nothing bounds it.
    world.sampling.output = Output::Start;
    assert_eq!(note(&world), None);
    world.sampling.output = Output::End;
    world.couplings.pop();
    assert_eq!(note(&world), None);
}
