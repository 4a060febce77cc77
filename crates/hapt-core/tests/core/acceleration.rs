//! The torque along the acceleration, sample by sample.

use hapt_core::{Body, Coupling, End, Error, Estimator, Law, Loop, Method, Output, Spec};
use hapt_testing::prelude::*;

type Room = Loop<f64, 2, 4, 9>;

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// inertia times the change of the low-passed velocity in a sample over T, within ±limit, the same from either end.
    #[test]
    fn its_torque_is_the_inertia_times_the_change_of_a_low_passed_velocity(
        positions in prop::collection::vec(-1e-2..1e-2f64, 1..200), inertia in 0.0..1e-3f64, cutoff in 0.1..500.0f64,
        estimate in 5.0..300.0f64, limit in prop::option::of(1e-3..0.1f64), from_ground in any::<bool>(),
    ) {
        let (first, second) = if from_ground { (End::Ground, End::Puck) } else { (End::Puck, End::Ground) };
        let slow = |cutoff: f64| 1.0 / (std::f64::consts::TAU * cutoff);
        for method in Method::ALL {
            let couplings = [Coupling { first, second, law: Law::Acceleration { inertia, cutoff }, limit }];
            let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
            let spec = Spec { method, output, estimator: Estimator::LowPass { cutoff: estimate }, couplings: &couplings, ..Spec::new(1e-3) };
            let world = Room::new(&spec).unwrap();
            let mut state = world.start();
            let (mut last, mut v, mut smooth) = (None, 0.0, 0.0);
            for &z in &positions {
                v = last.map_or(0.0, |last| (slow(estimate) * v + z - last) / (slow(estimate) + 1e-3));
                last = Some(z);
                let before = smooth;
                smooth = (slow(cutoff) * smooth + 1e-3 * v) / (slow(cutoff) + 1e-3);
                let most = limit.unwrap_or(f64::INFINITY);
                let wanted = (inertia * (smooth - before) / 1e-3).clamp(-most, most);
                let found = world.step(&mut state, z, 0.0).torque;
                let scale = inertia * (v.abs() + before.abs()) / slow(cutoff);
                prop_assert!((found - wanted).abs() <= 1e-12 * (1e-9 + scale), "{method:?}: {found} {wanted}");
            }
        }
    }
}

#[test]
fn it_is_between_puck_and_ground_and_without_an_advance() {
    let bodies = [Body { inertia: 1e-2, position: 0.0, velocity: 0.0 }];
    let law = Law::Acceleration { inertia: 1e-4, cutoff: 5.0 };
    for (first, second) in [(End::Puck, End::Body(0)), (End::Body(0), End::Ground)] {
        let couplings = [law.between(first, second)];
        let spec = Spec { bodies: &bodies, couplings: &couplings, ..Spec::new(1e-3) };
        assert_eq!(Room::new(&spec).err(), Some(Error::AtPuck { coupling: 0 }));
    }
    let couplings = [law.between(End::Puck, End::Ground)];
    let ahead = Spec { advance: 1, couplings: &couplings, ..Spec::new(1e-3) };
    assert_eq!(Room::new(&ahead).err(), Some(Error::AtPuck { coupling: 0 }));
    for (inertia, cutoff, what) in [(-1.0, 5.0, "inertia"), (1.0, 0.0, "cutoff"), (1.0, 1001.0, "cutoff")] {
        let couplings = [Law::Acceleration { inertia, cutoff }.between(End::Puck, End::Ground)];
        let refused = Room::new(&Spec { couplings: &couplings, ..Spec::new(1e-3) }).err();
        assert!(matches!(refused, Some(Error::Value { what: found, .. }) if found == what), "{refused:?}");
    }
}

/// However its file makes it, its torque is a number in single precision too, and 0 at rest.
#[test]
fn an_extreme_one_is_finite_at_rest() {
    for (inertia, cutoff) in [(1e30, 1e3), (1e-30, 1e-30), (1e30, 1e-30)] {
        let couplings =
            [Coupling { limit: Some(1.0), ..Law::Acceleration { inertia, cutoff }.between(End::Puck, End::Ground) }];
        let world = Loop::<f32, 1, 1, 2>::new(&Spec { couplings: &couplings, ..Spec::new(1e-3) }).unwrap();
        let mut state = world.start();
        assert_eq!(world.step(&mut state, 0.0, 0.0).torque, 0.0);
        let torque = world.step(&mut state, 0.0, 1.0).torque;
        assert!((0.0..=1.0).contains(&torque), "{torque}");
    }
}
