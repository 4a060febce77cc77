//! What each law requires, by its steepest slope.

use hapt_testing::laws::{SIZES, is_potential, with};
use hapt_testing::prelude::*;

use super::*;

/// The steepest slope of a torque over the position, between points so near to each other that it is missed by less than 1e-4 of it.
fn steepest(law: Law) -> f64 {
    let world = plain(vec![law.between(End::Puck, End::Ground)], 1e-3);
    let step = 1e-4;
    let torque = |i: i32| world.spec().coupling_torque(0, (step * f64::from(i), 0.0), &[]);
    (-15_000..15_000).map(|i| (torque(i + 1) - torque(i)).abs() / step).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(hapt_testing::cases(128))]

    /// The steepest slope times half a period and the delay, plus all damping.
    #[test]
    fn the_steepest_slope_of_each_law_counts(
        law in SIZES.laws(|law| is_potential(law) || law.constant().is_some()), damping in prop_oneof![Just(0.0), 0.01..0.3],
    ) {
        let law = with(law, "damping", damping);
        let damping = if law.side().is_some() { damping } else { 0.0 };
        let slope = steepest(law);
        let mut world = plain(vec![law.between(End::Puck, End::Ground)], 1e-3);
        let is_near = |found: f64, periods: f64| {
            let wanted = periods * 1e-3 * slope + damping;
            found > wanted * (1.0 - 1e-8) && found <= wanted * (1.0 + 2e-4)
        };
        prop_assert!(slope == 0.0 || is_near(required(&world), 0.5), "{law:?}: {} {slope}", required(&world));
        if law.waveform().is_none() {
            // The core has the slope in closed form too.
            let wanted = 0.5e-3 * law.slopes().stiffness + damping;
            prop_assert!((required(&world) - wanted).abs() <= 1e-12 * wanted, "{law:?}: {} {wanted}", required(&world));
        }
        // A damped wall takes the velocity: its difference, not that of an instant.
        world.sampling.estimator = EstimatorKind::Difference;
        prop_assert_eq!(reasons(&world), Vec::<String>::new());
        world.sampling.delay = hapt_model::Delay::Seconds(2e-3);
        if slope > 0.0 && damping == 0.0 {
            prop_assert!(is_near(required(&world), 2.5), "{law:?}: {} {slope}", required(&world));
        }
        world.sampling.delay = hapt_model::Delay::Seconds(2.5e-3);
        prop_assert_eq!(reasons(&world), Vec::<String>::new());
    }
}

#[test]
fn bristles_ask_for_their_slope_without_a_proof_and_coulomb_friction_for_what_no_damping_gives() {
    let lugre = Law::Lugre {
        coulomb: 0.1,
        stribeck: 0.2,
        stribeck_velocity: 0.1,
        bristle_stiffness: 100.0,
        bristle_damping: 0.1,
        viscous: 0.1,
    };
    let world = plain(vec![lugre.between(End::Puck, End::Ground)], 1e-3);
    near(required(&world), 0.05 + 0.2, 1e-12);
    assert!(!reasons(&world).is_empty());
    let world = plain(vec![Law::Coulomb { torque: 0.1 }.between(End::Ground, End::Puck)], 1e-3);
    let found = passivity(&world).unwrap();
    assert_eq!((found.required_damping, found.passive.holds(), found.cause), (None, false, Some(Cause::Coulomb)));
}

proptest! {
    #![proptest_config(hapt_testing::cases(32))]

    /// A motor at its limit is a law of slopes up to K, and needs what those need.
    #[test]
    fn a_motor_at_its_limit_asks_for_no_less_than_a_nonlinear_law(
        k in 0.1..100.0f64, damping in 0.0..0.1f64, late in 0.0..4.0f64, spare in 0.5..2.0f64,
    ) {
        let mut world = plain(to_ground(k, damping), 1e-3);
        world.sampling.estimator = EstimatorKind::Difference;
        world.sampling.delay = hapt_model::Delay::Seconds(late * 1e-3);
        world.device.limit = Some(1.0);
        let part = late.fract();
        let even = 1e-3 * k * (0.5 + late) + damping;
        let bound = 0.5 * (even + even.hypot((part * (1.0 - part)).sqrt() * 1e-3 * k));
        prop_assert!(required(&world) <= bound * (1.0 + 1e-9));
        world.device.damping = bound * spare;
        let found = passivity(&world).unwrap();
        if spare > 1.0 {
            prop_assert!(found.passive.holds() && found.proved.holds(), "{found:?}");
        } else if found.passive.holds() && damping > 0.0 {
            prop_assert!(!found.proved.holds() || (1.0 - spare) < 1e-6, "{found:?}");
        }
    }
}

/// Either of the two may be clamped, and is then separate from the linear rest.
#[test]
fn a_compensating_damper_is_proved_as_the_damping_that_it_is() {
    let (k, period) = (1.0, 1e-3);
    for damping in [Damping::Fixed(k * period), Damping::Compensating] {
        for (spring, damper) in [(Some(0.1), None), (None, Some(0.1))] {
            let laws = [(Law::Spring { stiffness: k, rest: 0.0 }, spring), (Law::Damper { damping }, damper)];
            let couplings = laws.map(|(law, limit)| Coupling { first: End::Puck, second: End::Ground, law, limit });
            let mut world = plain(couplings.into(), period);
            world.sampling.delay = hapt_model::Delay::Samples(1.0);
            world.sampling.estimator = EstimatorKind::Difference;
            // T K (1/2 + 1) of the spring, and the damper's own.
            let found = passivity(&world).unwrap();
            near(found.required_damping.unwrap(), 2.5e-3, 1e-9);
            assert!(found.proved.holds(), "{spring:?} {damper:?} {:?}", found.not_proved);
            // The linear loop requires less: between the two nothing is known.
            for (damping, refuted) in [(1.6e-3, true), (1.63e-3, false), (2.49e-3, false)] {
                world.device.damping = damping;
                let check = hapt_analysis::check(&world).unwrap();
                assert_eq!(
                    (check.status == Status::Refuted, check.passivity.passive.holds()),
                    (refuted, false),
                    "{damping}"
                );
            }
            world.device.damping = 2.501e-3;
            assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        }
    }
}

#[test]
fn a_law_that_a_host_computes_asks_for_what_a_loop_at_its_rate_does() {
    for (hold, lateness) in [(1.0 / 60.0, 0.016), (0.01, 0.0), (0.01, 0.02), (3e-3, 0.0571)] {
        let mut world = plain(
            vec![Coupling {
                first: End::Puck,
                second: End::Ground,
                law: Law::Spring { stiffness: 1.0, rest: 0.0 },
                limit: None,
            }],
            hold,
        );
        world.sampling.delay = hapt_model::Delay::Seconds(lateness);
        near(required(&world), hapt_core::wheel::game_loop::HostTime { hold, lateness }.cost(), 1e-9);
    }
}
