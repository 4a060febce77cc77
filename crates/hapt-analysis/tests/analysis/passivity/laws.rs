//! What each law requires, by its steepest slope.

use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;

#[test]
fn the_steepest_rise_of_each_law_counts() {
    let (puck, ground) = (End::Puck, End::Ground);
    let laws: [(Law, f64); 8] = [
        (Law::Wall { side: Side::Above, at: 0.1, stiffness: 200.0, damping: 0.3 }, 0.1 + 0.3),
        (Law::Detent { torque: 0.02, pitch: 0.1, phase: 0.0 }, 0.5e-3 * TAU * 0.2),
        (Law::DeadBand { stiffness: 10.0, rest: 0.1, width: 0.2 }, 5e-3),
        (Law::Magnet { torque: 0.02, width: 0.1, at: 0.3 }, 0.5e-3 * 0.5_f64.exp() * 0.2),
        // Alone, its third harmonic is a detent of a third of the pitch.
        (Law::Texture { torque: 0.02, pitch: 0.1, phase: 0.3, waveform: THIRD }, 0.5e-3 * 3.0 * TAU * 0.2),
        (Law::Constant { torque: 3.0 }, 0.0),
        (Law::Spring { stiffness: 10.0, rest: 1.0 }, 5e-3),
        (
            Law::Lugre {
                coulomb: 0.1,
                stribeck: 0.2,
                stribeck_velocity: 0.1,
                bristle_stiffness: 100.0,
                bristle_damping: 0.1,
                viscous: 0.1,
            },
            0.05 + 0.2,
        ),
    ];
    for (law, wanted) in laws {
        let mut world = plain(vec![Coupling { first: puck, second: ground, law, limit: None }], 1e-3);
        near(required(&world), wanted, 1e-12);
        // A damped wall takes the velocity: its difference, not that of an instant.
        world.sampling.estimator = EstimatorKind::Difference;
        let proved = reasons(&world).is_empty();
        assert_eq!(proved, !matches!(law, Law::Lugre { .. }), "{law:?} {:?}", reasons(&world));
        world.sampling.delay = hapt_model::Delay::Seconds(2e-3);
        if let Law::Detent { .. } | Law::DeadBand { .. } | Law::Magnet { .. } | Law::Texture { .. } = law {
            near(required(&world), 5.0 * wanted, 1e-12);
            assert_eq!(reasons(&world), Vec::<String>::new());
        }
        world.sampling.delay = hapt_model::Delay::Seconds(2.5e-3);
        assert_eq!(!matches!(law, Law::Lugre { .. }), reasons(&world).is_empty(), "{law:?}");
    }
    let world =
        plain(vec![Coupling { first: ground, second: puck, law: Law::Coulomb { torque: 0.1 }, limit: None }], 1e-3);
    let found = passivity(&world).unwrap();
    assert_eq!((found.required_damping, found.passive.holds(), found.cause), (None, false, Some(Cause::Coulomb)));
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    /// The certificate's slope of a texture is its steepest one of either sign, to a part in ten thousand.
    #[test]
    fn a_texture_asks_for_its_steepest_slope(
        sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(-1.0_f32..1.0),
    ) {
        let waveform = Waveform { sine, cosine };
        let law = Law::Texture { torque: 1e-3, pitch: TAU, phase: 0.0, waveform };
        let world = plain(vec![Coupling { first: End::Puck, second: End::Ground, law, limit: None }], 1e-3);
        let slope = |i: u32| {
            let (q, h) = (TAU * f64::from(i) / 20_000.0, 1e-6);
            ((waveform.at(q + h) - waveform.at(q - h)) / (2.0 * h)).abs()
        };
        let steepest = (0..20_000).map(slope).fold(0.0, f64::max);
        let found = required(&world) / 0.5e-6;
        prop_assert!(found > steepest * (1.0 - 1e-8) - 1e-8 && found < steepest * (1.0 + 1e-4) + 1e-8, "{found} {steepest}");
    }
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

/// Whichever of the two is clamped, and so stands apart from the linear rest.
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
            // The linear loop asks for less: between the two nothing is known.
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
