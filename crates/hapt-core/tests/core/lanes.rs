//! Each lane of a batch computes the bits of its world in a loop of its own.

use hapt_core::{
    Batch, Body, Coupling, Damping, End, Estimator, Lanes, Law, Loop, Method, Number, Output, Side, Spec, Waveform,
};
use hapt_testing::laws::SIZES;
use hapt_testing::prelude::*;

const N: usize = 5;

fn bits(x: Lanes<N>) -> [u64; N] {
    // All NaNs count as equal.
    x.0.map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() })
}

/// Numbers of every size and sign, zeros, whole and half ones, and NaN.
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
        prop_assert_eq!(bits(lanes.abs()), bits(Lanes(x.map(Number::abs))));
        prop_assert_eq!(bits(lanes.finite_or_zero()), bits(Lanes(x.map(Number::finite_or_zero))));
        let within = std::array::from_fn(|i| x[i].within(limit.0[i]));
        prop_assert_eq!(bits(lanes.within(limit)), bits(Lanes(within)));
        let larger = std::array::from_fn(|i| if y[i] > x[i] { y[i] } else { x[i] });
        prop_assert_eq!(bits(lanes.larger(Lanes(y))), bits(Lanes(larger)));
    }
}

/// How many couplings there are: every law between three pairs of ends, without a limit and with one.
const COUPLINGS: usize = 6 * Law::ALL.len();

/// One of them; the scale moves its numbers within their ranges.
fn coupling(index: usize, scale: f64) -> Coupling {
    let (mut law, variant) = (Law::ALL[index % Law::ALL.len()], index / Law::ALL.len());
    for quantity in law.quantities() {
        let size = SIZES.of(quantity.name, quantity.range);
        *quantity.value = size.start() + scale / 3.0 * (size.end() - size.start());
    }
    if let Some(waveform) = law.waveform_mut() {
        *waveform = WAVEFORM;
    }
    // An integral term and an assist are between puck and ground.
    let ends = [(End::Puck, End::Ground), (End::Puck, End::Body(0)), (End::Body(1), End::Ground)];
    let (first, second) = ends[if law.is_at_puck() { 0 } else { variant % 3 }];
    Coupling { first, second, law, limit: (law.takes_limit() && variant > 2).then_some(0.1) }
}

const WALL: Coupling =
    Law::Wall { side: Side::Above, at: 0.05, stiffness: 5.0, damping: 0.01 }.between(End::Puck, End::Ground);

const WAVEFORM: Waveform = Waveform { sine: [0.5, 0.0, -0.25, 0.125], cosine: [0.0, 0.5, 0.0, -0.5] };

type Single = Loop<f64, 2, 6, 9>;

/// A world of two bodies, its numbers scaled. `None`: the method does not take these couplings.
fn compiled(
    method: Method,
    output: Output,
    estimator: Estimator,
    counted: bool,
    scale: f64,
    more: &[Coupling],
    bodies_every: u32,
) -> Option<Single> {
    let spring =
        |first, second, stiffness| Coupling { first, second, law: Law::Spring { stiffness, rest: 0.1 }, limit: None };
    let bodies = [0.02, 0.03].map(|inertia| Body { inertia: inertia * scale, position: 0.1 * scale, velocity: -0.3 });
    let damper = Law::Damper { damping: Damping::Fixed(0.01 * scale) };
    let mut couplings = vec![
        spring(End::Puck, End::Body(0), 3.0 * scale),
        spring(End::Body(0), End::Body(1), 2.0),
        Coupling { first: End::Puck, second: End::Body(1), law: damper, limit: None },
    ];
    let advance = if output == Output::End && bodies_every == 1 { 2 } else { 0 };
    // An integral term and an assist have no advance.
    couplings.extend(more.iter().map(|c| match advance > 0 && c.law.is_at_puck() {
        true => Coupling { law: Law::Coulomb { torque: 0.01 }, limit: None, ..*c },
        false => *c,
    }));
    let spec = Spec {
        method,
        output,
        advance,
        bodies_every,
        estimator,
        filter: counted.then_some(30.0 * scale),
        count: counted.then_some(1e-3 * scale),
        limit: counted.then_some(0.5 * scale),
        levels: counted.then_some(64),
        bodies: &bodies,
        couplings: &couplings,
        ..Spec::new(1e-3 * scale)
    };
    Loop::new(&spec).ok()
}

const ESTIMATORS: [Estimator; 8] = [
    Estimator::Exact,
    Estimator::Difference,
    Estimator::LowPass { cutoff: 40.0 },
    Estimator::Foaw { window: 8 },
    Estimator::FoawBest { window: 5 },
    Estimator::DifferenceOver { every: 6 },
    Estimator::Kalman { cutoff: 30.0 },
    Estimator::Levant { acceleration: 20.0 },
];

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn worlds_side_by_side_take_the_samples_they_take_alone(
        scales in prop::array::uniform5(0.2..3.0f64),
        inputs in prop::collection::vec((prop::array::uniform5(-1.0..1.0f64), prop::array::uniform5(-9.0..9.0f64)), 30),
        broken in 0..60usize, kinds in prop::array::uniform5(prop::collection::vec(0..COUPLINGS, 0..3)),
        estimator in prop::sample::select(&ESTIMATORS[..]), bends in any::<bool>(), alike in any::<bool>(), every in prop_oneof![Just(1), 2..5u32],
    ) {
        for method in Method::ALL {
            for output in Output::ALL {
                for counted in [false, true] {
                    let single = std::array::from_fn::<_, N, _>(|i| {
                        let more: Vec<Coupling> = kinds[if alike { 0 } else { i }].iter().map(|kind| coupling(*kind, scales[i])).collect();
                        let all = compiled(method, output, estimator, counted, scales[i], if bends { &more } else { &[] }, every);
                        all.or_else(|| compiled(method, output, estimator, counted, scales[i], &[], every))
                    });
                    let Some(single): Option<Vec<Single>> = single.into_iter().collect() else { continue };
                    let single: [Single; N] = single.try_into().unwrap();
                    let together = Batch::<N, 2, 6, 9, 6>::new(&single).unwrap();
                    let linear = Batch::<N, 2, 6, 9, 0>::new(&single);
                    let mut of_linear = linear.map(|batch| (batch, batch.start()));
                    let mut states = single.map(|world| world.start());
                    let mut state = together.start();
                    for (k, &(mut z, v)) in inputs.iter().enumerate() {
                        if k == broken {
                            z[1] = f64::NAN;
                        }
                        let sample = together.step(&mut state, Lanes(z), Lanes(v));
                        if let Some((batch, state)) = &mut of_linear {
                            let same = batch.step(state, Lanes(z), Lanes(v));
                            prop_assert_eq!(bits(same.torque), bits(sample.torque));
                        }
                        let own: [_; N] = std::array::from_fn(|i| single[i].step(&mut states[i], z[i], v[i]));
                        prop_assert_eq!(bits(sample.torque), bits(Lanes(own.map(|own| own.torque))), "{:?}", kinds);
                        prop_assert_eq!(bits(sample.command), bits(Lanes(own.map(|own| own.command))));
                        prop_assert_eq!(bits(sample.puck.velocity), bits(Lanes(own.map(|own| own.puck.velocity))));
                        for j in 0..2 {
                            let now = states.map(|state| state.now.velocity[j]);
                            prop_assert_eq!(bits(state.now.velocity[j]), bits(Lanes(now)));
                        }
                        for j in 0..6 {
                            let bristles = states.map(|state| state.bristles[j]);
                            prop_assert_eq!(bits(state.bristles[j]), bits(Lanes(bristles)));
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn worlds_of_different_kinds_do_not_stand_side_by_side() {
    let of = |method, output, estimator, counted, scale| {
        compiled(method, output, estimator, counted, scale, &[], 1).unwrap()
    };
    let plain = || of(Method::Zoh, Output::End, Estimator::Exact, false, 1.0);
    let with = |world| Batch::<2, 2, 6, 9, 6>::new(&[plain(), world]).is_some();
    assert!(with(of(Method::Trapezoidal, Output::End, Estimator::Exact, false, 2.0)));
    assert!(with(compiled(Method::Zoh, Output::End, Estimator::Exact, false, 1.0, &[WALL], 1).unwrap()));
    let nonlinear = compiled(Method::Zoh, Output::End, Estimator::Exact, false, 1.0, &[WALL], 1).unwrap();
    assert!(Batch::<2, 2, 6, 9, 0>::new(&[plain(), nonlinear]).is_none());
    assert!(!with(of(Method::Tustin, Output::Start, Estimator::Exact, false, 1.0)));
    assert!(!with(of(Method::Zoh, Output::Middle, Estimator::Exact, false, 1.0)));
    assert!(!with(of(Method::Zoh, Output::End, Estimator::Difference, false, 1.0)));
    assert!(!with(of(Method::Zoh, Output::End, Estimator::Exact, true, 1.0)));
    let every = |every| compiled(Method::Zoh, Output::End, Estimator::Exact, false, 1.0, &[], every).unwrap();
    assert!(Batch::<2, 2, 6, 9, 6>::new(&[every(2), every(3)]).is_none());
}
