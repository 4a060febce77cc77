//! The integral term of a controller, sample by sample.

use hapt_core::{Coupling, End, Error, Estimator, Law, Loop, Method, Output, Spec};
use hapt_testing::prelude::*;

type Room = Loop<f64, 2, 4, 9>;

fn spec<'a>(couplings: &'a [Coupling], method: Method, filter: Option<f64>) -> Spec<'a> {
    Spec {
        method,
        output: if method.takes_new_sample_first() { Output::Start } else { Output::End },
        estimator: Estimator::Difference,
        filter,
        couplings,
        ..Spec::new(1e-3)
    }
}

fn integral(first: End, second: End, limit: Option<f64>, (stiffness, time, rest): (f64, f64, f64)) -> Coupling {
    Coupling { first, second, law: Law::Integral { stiffness, time, rest }, limit }
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// -stiffness/time times the sum of T (q - rest) over the samples so far, which stops where the torque is the limit.
    #[test]
    fn its_torque_is_the_sum_of_the_samples(
        positions in prop::collection::vec(-1.0..1.0f64, 1..200), numbers in (0.0..50.0f64, 1e-2..10.0f64, -0.5..0.5f64),
        limit in prop::option::of(1e-3..0.1f64), from_ground in any::<bool>(), filter in prop::option::of(5.0..300.0f64),
    ) {
        let (stiffness, time, rest) = numbers;
        let (first, second, sign) = if from_ground { (End::Ground, End::Puck, -1.0) } else { (End::Puck, End::Ground, 1.0) };
        for method in Method::ALL {
            let couplings = [integral(first, second, limit, numbers)];
            let world = Room::new(&spec(&couplings, method, filter)).unwrap();
            let mut state = world.start();
            let (mut sum, mut seen) = (0.0_f64, None);
            for &z in &positions {
                let pole = filter.map_or(0.0, |hz| (-std::f64::consts::TAU * hz * 1e-3).exp());
                let y = seen.map_or(z, |y: f64| pole * y + (1.0 - pole) * z);
                seen = Some(y);
                let most = limit.map_or(f64::INFINITY, |limit| limit * time / stiffness);
                sum = (sum + 1e-3 * (sign * y - rest)).clamp(-most, most);
                let torque = world.step(&mut state, z, 0.0).torque;
                let wanted = -sign * stiffness / time * sum;
                prop_assert!((torque - wanted).abs() < 1e-12 * (1.0 + wanted.abs()), "{method:?}: {torque} {wanted}");
            }
        }
    }
}

#[test]
fn it_is_between_puck_and_ground_and_without_an_advance() {
    let numbers = (1.0, 1.0, 0.0);
    let bodies = [hapt_core::Body { inertia: 1e-2, position: 0.0, velocity: 0.0 }];
    for method in Method::ALL {
        for (first, second) in [(End::Puck, End::Body(0)), (End::Body(0), End::Ground)] {
            let couplings = [integral(first, second, None, numbers)];
            let refused = Room::new(&Spec { bodies: &bodies, ..spec(&couplings, method, None) }).err();
            assert_eq!(refused, Some(Error::AtPuck { coupling: 0 }));
        }
    }
    let couplings = [integral(End::Puck, End::Ground, None, numbers)];
    let ahead = Spec { advance: 3, ..spec(&couplings, Method::Zoh, None) };
    assert_eq!(Room::new(&ahead).err(), Some(Error::AtPuck { coupling: 0 }));
    let never = [integral(End::Puck, End::Ground, None, (1.0, 0.0, 0.0))];
    assert!(matches!(Room::new(&spec(&never, Method::Zoh, None)).err(), Some(Error::Value { what: "time", .. })));
}
