//! The assist, sample by sample.

use hapt_core::{Body, End, Error, Estimator, Law, Loop, Method, Output, Spec};
use hapt_testing::prelude::*;

type Room = Loop<f64, 2, 4, 9>;

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// torque · q̇/velocity of the measured velocity, within ±torque, the same from either end.
    #[test]
    fn its_torque_is_along_the_measured_velocity(
        positions in prop::collection::vec(-1e-2..1e-2f64, 1..100), torque in 0.0..0.1f64, velocity in 1e-3..100.0f64, cutoff in 5.0..300.0f64,
        from_ground in any::<bool>(),
    ) {
        let ends = if from_ground { [End::Ground, End::Puck] } else { [End::Puck, End::Ground] };
        for method in Method::ALL {
            let couplings = [Law::Assist { torque, velocity }.between(ends[0], ends[1])];
            let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
            let spec = Spec { method, output, estimator: Estimator::LowPass { cutoff }, couplings: &couplings, ..Spec::new(1e-3) };
            let world = Room::new(&spec).unwrap();
            let mut state = world.start();
            let (mut last, mut v) = (None, 0.0);
            let tau = 1.0 / (std::f64::consts::TAU * cutoff);
            for &z in &positions {
                v = last.map_or(0.0, |last| (tau * v + z - last) / (tau + 1e-3));
                last = Some(z);
                let found = world.step(&mut state, z, 0.0).torque;
                let wanted = (torque * v / velocity).clamp(-torque, torque);
                prop_assert!((found - wanted).abs() <= 1e-9 * torque, "{method:?}: {found} {wanted}");
            }
        }
    }
}

#[test]
fn it_is_between_puck_and_ground_and_without_an_advance() {
    let bodies = [Body { inertia: 1e-2, position: 0.0, velocity: 0.0 }];
    let assist = Law::Assist { torque: 0.1, velocity: 1.0 };
    for (first, second) in [(End::Puck, End::Body(0)), (End::Body(0), End::Ground)] {
        let couplings = [assist.between(first, second)];
        let spec = Spec { bodies: &bodies, couplings: &couplings, ..Spec::new(1e-3) };
        assert_eq!(Room::new(&spec).err(), Some(Error::AtPuck { coupling: 0 }));
    }
    let couplings = [assist.between(End::Puck, End::Ground)];
    let ahead = Spec { advance: 1, couplings: &couplings, ..Spec::new(1e-3) };
    assert_eq!(Room::new(&ahead).err(), Some(Error::AtPuck { coupling: 0 }));
    let at_once = [Law::Assist { torque: 0.1, velocity: 0.0 }.between(End::Puck, End::Ground)];
    let spec = Spec { couplings: &at_once, ..Spec::new(1e-3) };
    assert!(matches!(Room::new(&spec).err(), Some(Error::Value { what: "velocity", .. })));
}

/// However steep its file makes it, its torque is finite in single precision too.
#[test]
fn a_steep_one_is_finite() {
    let couplings = [Law::Assist { torque: 1e30, velocity: 1e-30 }.between(End::Puck, End::Ground)];
    let world = Loop::<f32, 1, 1, 2>::new(&Spec { couplings: &couplings, ..Spec::new(1e-3) }).unwrap();
    let mut state = world.start();
    assert_eq!(world.step(&mut state, 0.0, 0.0).torque, 0.0);
    assert_eq!(world.step(&mut state, 0.0, 1.0).torque, 1e30);
}
