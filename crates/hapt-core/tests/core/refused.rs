//! A spec that cannot be compiled is refused by name.

use hapt_core::{Body, Coupling, Damping, End, Error, Estimator, Law, Loop, Method, Output, Side, Spec};

const BODIES: [Body; 2] = [Body { inertia: 0.02, position: 0.0, velocity: 0.0 }; 2];
const SPRING: Coupling =
    Coupling { first: End::Puck, second: End::Body(0), law: Law::Spring { stiffness: 1.0, rest: 0.0 }, limit: None };
const SPEC: Spec = Spec { bodies: &BODIES, couplings: &[SPRING], ..Spec::new(1e-3) };

fn refusal(spec: &Spec) -> Option<Error> {
    Loop::<f64, 2, 3, 17>::new(spec).err()
}

fn coupling(first: End, second: End, law: Law) -> [Coupling; 2] {
    [SPRING, Coupling { first, second, law, limit: None }]
}

#[test]
fn a_world_within_its_ranges_is_not_refused() {
    assert_eq!(refusal(&SPEC), None);
    assert_eq!(refusal(&Spec { couplings: &[], bodies: &[], ..SPEC }), None);
}

#[test]
fn more_than_there_is_room_for_is_refused_with_the_room() {
    let bodies = [BODIES[0]; 3];
    assert_eq!(refusal(&Spec { bodies: &bodies, ..SPEC }), Some(Error::TooManyBodies { given: 3, room: 2 }));
    let couplings = [SPRING; 4];
    assert_eq!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::TooManyCouplings { given: 4, room: 3 }));
    let estimator = Estimator::Foaw { window: 17 };
    let long = Spec { estimator, count: Some(1e-3), ..SPEC };
    assert_eq!(refusal(&long), Some(Error::WindowTooLong { given: 17, room: 17 }));
    assert_eq!(refusal(&Spec { estimator: Estimator::Foaw { window: 16 }, ..long }), None);
    // A difference needs the memory with an ideal encoder too.
    for count in [None, long.count] {
        let over = |every| refusal(&Spec { estimator: Estimator::DifferenceOver { every }, count, ..long });
        assert_eq!(over(17), Some(Error::WindowTooLong { given: 17, room: 17 }));
        assert_eq!((over(16), over(1)), (None, None));
        assert_eq!(over(0), Some(Error::Value { what: "every", given: 0.0, wanted: "positive" }));
    }
}

#[test]
fn numbers_outside_their_ranges_are_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(refusal(&Spec { period: bad, ..SPEC }), Some(Error::Value { what: "period", .. })));
        let bodies = [Body { inertia: bad, ..BODIES[0] }];
        assert!(matches!(refusal(&Spec { bodies: &bodies, ..SPEC }), Some(Error::Value { what: "inertia", .. })));
        assert!(matches!(refusal(&Spec { count: Some(bad), ..SPEC }), Some(Error::Value { what: "count", .. })));
        let estimator = Estimator::LowPass { cutoff: bad };
        assert!(matches!(refusal(&Spec { estimator, ..SPEC }), Some(Error::Value { what: "cutoff", .. })));
        let estimator = Estimator::Kalman { cutoff: bad };
        assert!(matches!(refusal(&Spec { estimator, ..SPEC }), Some(Error::Value { what: "cutoff", .. })));
        let estimator = Estimator::Levant { acceleration: bad };
        assert!(matches!(refusal(&Spec { estimator, ..SPEC }), Some(Error::Value { what: "acceleration", .. })));
    }
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let laws = [
            Law::Spring { stiffness: bad, rest: 0.0 },
            Law::Damper { damping: Damping::Fixed(bad) },
            Law::Wall { side: Side::Above, at: 0.0, stiffness: bad, damping: 0.0 },
            Law::Detent { torque: bad, pitch: 1.0, phase: 0.0 },
            Law::Coulomb { torque: bad },
        ];
        for law in laws {
            let couplings = coupling(End::Puck, End::Ground, law);
            assert!(matches!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::Value { .. })), "{law:?}");
        }
    }
    assert!(matches!(refusal(&Spec { levels: Some(2), ..SPEC }), Some(Error::Value { what: "levels", .. })));
}

#[test]
fn ends_must_be_two_and_there() {
    let spring = SPRING.law;
    let couplings = coupling(End::Body(1), End::Body(2), spring);
    assert_eq!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::NoSuchBody { coupling: 1 }));
    let couplings = coupling(End::Ground, End::Ground, spring);
    assert_eq!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::SameEnds { coupling: 1 }));
}

#[test]
fn a_compensating_damper_needs_its_spring() {
    let law = Law::Damper { damping: Damping::Compensating };
    for (first, second, there) in [
        (End::Body(0), End::Puck, true),
        (End::Body(0), End::Ground, true),
        (End::Body(1), End::Ground, false),
        (End::Puck, End::Ground, false),
        (End::Body(0), End::Body(1), false),
    ] {
        let couplings = coupling(first, second, law);
        let refused = refusal(&Spec { couplings: &couplings, ..SPEC });
        assert_eq!(refused, (!there).then_some(Error::NoSpring { coupling: 1 }), "{first:?} {second:?}");
    }
}

#[test]
fn a_method_that_takes_the_new_sample_first_refuses_a_nonlinear_torque_on_a_body_and_those_that_find_it_refuse_lugre() {
    let of_itself = |law: &Law| !law.is_at_puck() && !law.is_compensating();
    let with = |limit: Option<f64>| Law::ALL.into_iter().filter(of_itself).map(move |law| (law, limit));
    let is_nonlinear = |&(law, limit): &(Law, Option<f64>)| match limit {
        None => !matches!(law, Law::Spring { .. } | Law::Damper { .. }),
        Some(_) => law.takes_limit(),
    };
    let laws: Vec<(Law, Option<f64>)> = with(None).chain(with(Some(1.0))).filter(is_nonlinear).collect();
    for method in Method::ALL {
        let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
        for &(law, limit) in &laws {
            let taken = method.is_explicit() || (method.finds_torques() && !law.has_bristle());
            let couplings = [SPRING, Coupling { first: End::Body(0), second: End::Ground, law, limit }];
            let refused = refusal(&Spec { method, output, couplings: &couplings, ..SPEC });
            assert_eq!(refused, (!taken).then_some(Error::Unsupported { coupling: 1, method }), "{method:?} {law:?}");
            let couplings = [SPRING, Coupling { first: End::Ground, second: End::Puck, law, limit }];
            assert_eq!(refusal(&Spec { method, output, couplings: &couplings, ..SPEC }), None);
        }
    }
}

#[test]
fn a_clamp_needs_a_limit_and_a_compensating_damper_its_spring_clamped_or_not() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let couplings = [Coupling { limit: Some(bad), ..SPRING }];
        assert!(matches!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::Value { what: "limit", .. })));
    }
    let damper = Law::Damper { damping: Damping::Compensating };
    let mut couplings = coupling(End::Body(1), End::Ground, damper);
    couplings[1].limit = Some(1.0);
    assert_eq!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::NoSpring { coupling: 1 }));
    let mut couplings = coupling(End::Body(0), End::Puck, damper);
    couplings[0].law = SPRING.law;
    couplings[0].limit = Some(1.0);
    assert_eq!(refusal(&Spec { couplings: &couplings, ..SPEC }), None);
}

#[test]
fn a_law_that_takes_no_limit_is_refused_with_one() {
    let law = Law::Detent { torque: 1.0, pitch: 1.0, phase: 0.0 };
    let couplings = [Coupling { law, limit: Some(1.0), ..SPRING }];
    assert!(matches!(refusal(&Spec { couplings: &couplings, ..SPEC }), Some(Error::Value { what: "limit", .. })));
}

#[test]
fn outputs_and_steps_ahead_that_a_method_does_not_have_are_refused() {
    assert_eq!(refusal(&Spec { method: Method::Foh, ..SPEC }), Some(Error::OutputNotStart));
    assert_eq!(refusal(&Spec { output: Output::Middle, advance: 1, ..SPEC }), Some(Error::AdvanceWithoutEnd));
    assert_eq!(refusal(&Spec { advance: 1000, ..SPEC }), None);
    assert!(matches!(refusal(&Spec { advance: 1001, ..SPEC }), Some(Error::Value { what: "advance", .. })));
}

#[test]
fn a_world_beyond_the_loops_numbers_is_refused_and_does_not_hang() {
    let bodies = [Body { inertia: 1e-300, position: 0.0, velocity: 0.0 }];
    let couplings = [Coupling { law: Law::Spring { stiffness: 1e300, rest: 0.0 }, ..SPRING }];
    for method in Method::ALL {
        let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
        let spec = Spec { method, output, bodies: &bodies, couplings: &couplings, ..SPEC };
        if let Some(error) = refusal(&spec) {
            assert_eq!(error, Error::NotFinite);
        }
    }
    let bodies = [Body { inertia: 1e-60, position: 0.0, velocity: 0.0 }];
    let spec = Spec { bodies: &bodies, method: Method::ForwardEuler, ..SPEC };
    assert!(Loop::<f64, 1, 1, 2>::new(&spec).is_ok());
    assert_eq!(Loop::<f32, 1, 1, 2>::new(&spec).err(), Some(Error::NotFinite));
}
