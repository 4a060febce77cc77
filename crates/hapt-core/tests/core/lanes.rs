//! Lanes do what their numbers would do alone, to the bit.

use hapt_core::{Body, Coupling, Damping, End, Estimator, Lanes, Law, Loop, Method, Number, Output, Real, Side, Spec};
use proptest::prelude::*;

const N: usize = 5;

fn bits(x: Lanes<N>) -> [u64; N] {
    // One NaN is as good as another.
    x.0.map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() })
}

/// Numbers of every size and sign, zeros, whole and half ones, and what is none.
fn number() -> impl Strategy<Value = f64> {
    let special = [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MIN_POSITIVE];
    prop_oneof![
        any::<f64>(),
        -10.0..10.0f64,
        (-20_i32..20).prop_map(|n| 0.5 * f64::from(n)),
        (4e15..1e16f64, any::<bool>()).prop_map(|(x, minus)| if minus { -x } else { x }),
        prop::sample::select(special.to_vec()),
    ]
}

proptest! {
    #![proptest_config(hapt_testing::cases(2000))]

    #[test]
    fn a_lanes_functions_are_the_numbers_own(x in prop::array::uniform5(number()), y in prop::array::uniform5(number())) {
        let (lanes, limit) = (Lanes(x), Lanes(y.map(f64::abs)));
        prop_assert_eq!(bits(lanes.floor()), bits(Lanes(x.map(Number::floor))));
        prop_assert_eq!(bits(lanes.abs()), bits(Lanes(x.map(Real::abs))));
        prop_assert_eq!(bits(lanes.finite_or_zero()), bits(Lanes(x.map(Number::finite_or_zero))));
        let within = std::array::from_fn(|i| x[i].within(limit.0[i]));
        prop_assert_eq!(bits(lanes.within(limit)), bits(Lanes(within)));
        let larger = std::array::from_fn(|i| if y[i] > x[i] { y[i] } else { x[i] });
        prop_assert_eq!(bits(lanes.larger(Lanes(y))), bits(Lanes(larger)));
    }
}

/// A world of two bodies, its numbers scaled.
fn compiled(method: Method, output: Output, estimator: Estimator, counted: bool, scale: f64) -> Loop<f64, 2, 4, 1> {
    let spring =
        |first, second, stiffness| Coupling { first, second, law: Law::Spring { stiffness, rest: 0.1 }, limit: None };
    let bodies = [0.02, 0.03].map(|inertia| Body { inertia: inertia * scale, position: 0.1 * scale, velocity: -0.3 });
    let damper = Law::Damper { damping: Damping::Fixed(0.01 * scale) };
    let couplings = [
        spring(End::Puck, End::Body(0), 3.0 * scale),
        spring(End::Body(0), End::Body(1), 2.0),
        Coupling { first: End::Puck, second: End::Body(1), law: damper, limit: None },
    ];
    let spec = Spec {
        period: 1e-3 * scale,
        method,
        output,
        advance: if output == Output::End { 2 } else { 0 },
        estimator,
        count: counted.then_some(1e-3 * scale),
        limit: counted.then_some(0.5 * scale),
        levels: counted.then_some(64),
        bodies: &bodies,
        couplings: &couplings,
    };
    Loop::new(&spec).unwrap()
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn worlds_side_by_side_take_the_samples_they_take_alone(
        scales in prop::array::uniform5(0.2..3.0f64),
        inputs in prop::collection::vec((prop::array::uniform5(-1.0..1.0f64), prop::array::uniform5(-9.0..9.0f64)), 30),
        broken in 0..60usize,
    ) {
        for method in Method::ALL {
            for output in Output::ALL {
                if method.takes_new_sample_first() && output != Output::Start {
                    continue;
                }
                for estimator in [Estimator::Exact, Estimator::Difference, Estimator::LowPass { cutoff: 40.0 }] {
                    for counted in [false, true] {
                        let alone = scales.map(|scale| compiled(method, output, estimator, counted, scale));
                        let together = Loop::<Lanes<N>, 2, 0, 1>::batch(&alone).unwrap();
                        let mut states = alone.map(|world| world.start());
                        let mut state = together.start();
                        for (k, &(mut z, v)) in inputs.iter().enumerate() {
                            if k == broken {
                                z[1] = f64::NAN;
                            }
                            let sample = together.step(&mut state, Lanes(z), Lanes(v));
                            let own: [_; N] = std::array::from_fn(|i| alone[i].step(&mut states[i], z[i], v[i]));
                            prop_assert_eq!(bits(sample.torque), bits(Lanes(own.map(|own| own.torque))));
                            prop_assert_eq!(bits(sample.command), bits(Lanes(own.map(|own| own.command))));
                            prop_assert_eq!(bits(sample.puck.velocity), bits(Lanes(own.map(|own| own.puck.velocity))));
                            for j in 0..2 {
                                let now = states.map(|state| state.now.velocity[j]);
                                prop_assert_eq!(bits(state.now.velocity[j]), bits(Lanes(now)));
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn worlds_of_different_kinds_do_not_stand_side_by_side() {
    let plain = || compiled(Method::Zoh, Output::End, Estimator::Exact, false, 1.0);
    let with = |world| Loop::<Lanes<2>, 2, 0, 1>::batch(&[plain(), world]).is_some();
    assert!(with(compiled(Method::Trapezoidal, Output::End, Estimator::Exact, false, 2.0)));
    assert!(!with(compiled(Method::Tustin, Output::Start, Estimator::Exact, false, 1.0)));
    assert!(!with(compiled(Method::Zoh, Output::Middle, Estimator::Exact, false, 1.0)));
    assert!(!with(compiled(Method::Zoh, Output::End, Estimator::Difference, false, 1.0)));
    assert!(!with(compiled(Method::Zoh, Output::End, Estimator::Exact, true, 1.0)));
    let wall = Law::Wall { side: Side::Above, at: 0.0, stiffness: 1.0, damping: 0.0 };
    let bodies = [Body { inertia: 1.0, position: 0.0, velocity: 0.0 }; 2];
    let couplings = [Coupling { first: End::Puck, second: End::Ground, law: wall, limit: None }];
    let (method, output, estimator) = (Method::Zoh, Output::End, Estimator::Exact);
    let (period, advance, count, limit, levels) = (1e-3, 2, None, None, None);
    let spec = Spec {
        period,
        method,
        output,
        advance,
        estimator,
        count,
        limit,
        levels,
        bodies: &bodies,
        couplings: &couplings,
    };
    assert!(!with(Loop::new(&spec).unwrap()));
}
