//! Coulomb friction of the device that differs by direction.

use hapt_analysis::{check, passivity};
use hapt_model::{Delay, End, EstimatorKind, Law, Method, Output};
use proptest::prelude::*;

use crate::common::*;

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// What one direction has more is a passive hand's: the certificate is that of the smaller level in both.
    #[test]
    fn the_smaller_level_counts(
        k in 0.1_f64..5.0, counts in prop::option::of(500.0_f64..2e4), levels in prop::option::of(10_u32..1000), share in 0.3_f64..3.0,
        part in 0.5_f64..1.5, [tolerance, other] in [0.0_f64..0.9, 0.0..0.9], more in 0.0_f64..2.0, back: bool,
    ) {
        let spring = hapt_model::Coupling { law: Law::Spring { stiffness: k, rest: 0.0 }, ..damper(End::Puck, End::Ground, 1e-3) };
        let mut world = Bench::of(vec![spring, damper(End::Puck, End::Ground, 1e-3)]).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.estimator = EstimatorKind::Difference;
        world.sampling.delay = Delay::Samples(1.0);
        (world.device.limit, world.device.levels) = (levels.map(|_| 10.0), levels.map(|half| 2 * half));
        world.device.encoder = counts.map(f64::round);
        world.device.damping = part * passivity(&world).unwrap().required_damping.unwrap();
        let wanted = 0.5 * k * world.count().unwrap_or(1e-3) + 1e-2;
        let own = share * wanted / (1.0 - tolerance);
        // Never less than the least of the other.
        let higher = (1.0 + more) * own / (1.0 - other);
        let mut even = world.clone();
        (even.device.friction, even.device.tolerances.friction) = (own, tolerance);
        let device = &mut world.device;
        if back {
            (device.friction, device.tolerances.friction) = (higher, other);
            (device.friction_backward, device.tolerances.friction_backward) = (Some(own), tolerance);
        } else {
            (device.friction, device.tolerances.friction) = (own, tolerance);
            (device.friction_backward, device.tolerances.friction_backward) = (Some(higher), other);
        }
        let (found, wanted) = (check(&world).unwrap(), check(&even).unwrap());
        prop_assert_eq!(found.uneven, wanted.uneven);
        prop_assert_eq!(found.certified.holds(), wanted.certified.holds());
        if higher >= own {
            prop_assert_eq!((found.passivity, found.quantisation), (wanted.passivity, wanted.quantisation));
        }
    }
}
