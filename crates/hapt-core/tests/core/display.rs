//! The torque of a coupling at a position and a velocity.

use hapt_core::{Body, Coupling, Damping, End, Law, Spec};
use hapt_testing::prelude::*;

const BODIES: [Body; 1] = [Body { inertia: 0.02, position: 0.0, velocity: 0.0 }];

/// The torque on the body, between the body and ground.
fn torque(law: Law, limit: Option<f64>, reversed: bool, (q, v): (f64, f64)) -> f64 {
    let (first, second) = if reversed { (End::Ground, End::Body(0)) } else { (End::Body(0), End::Ground) };
    let couplings = [Coupling { first, second, law, limit }];
    let spec = Spec { bodies: &BODIES, couplings: &couplings, ..Spec::new(1e-3) };
    let on_first = spec.coupling_torque(0, (9.0, 9.0), &[(q, v)]);
    if reversed { -on_first } else { on_first }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// On the body at q with q̇, whichever end it is.
    #[test]
    fn laws_of_the_velocity_have_the_torque_of_steady_motion(
        a in 0.0_f64..1.0, b in 0.0_f64..1.0, scale in 0.01_f64..1.0, k in 1.0_f64..50.0, limit in 0.01_f64..1.0,
        q in -2.0_f64..2.0, v in prop_oneof![-3.0_f64..-1e-3, Just(0.0), 1e-3_f64..3.0], reversed in any::<bool>(),
    ) {
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        let level = a + (b - a) * (-(v / scale) * (v / scale)).exp();
        let friction = Law::Lugre { coulomb: a, stribeck: b, stribeck_velocity: scale, bristle_stiffness: k, bristle_damping: 0.1, viscous: a };
        let damper = Law::Damper { damping: Damping::Fixed(a) };
        for (law, limit, expected) in [
            (damper, None, -a * v),
            (damper, Some(limit), (-a * v).clamp(-limit, limit)),
            (Law::Coulomb { torque: a }, None, -a * sign),
            (friction, None, -(level * sign + a * v)),
        ] {
            let is = torque(law, limit, reversed, (q, v));
            prop_assert!((is - expected).abs() < 1e-9 * (1.0 + k), "{law:?} {limit:?}: {is} {expected}");
        }
        // Toward its rest, whichever end is ground: q changes its sign with the ends.
        let integral = Law::Integral { stiffness: k, time: scale, rest: 0.0 };
        let expected = (-k * q).clamp(-limit, limit);
        let is = torque(integral, Some(limit), reversed, (q, v));
        prop_assert!((is - expected).abs() < 1e-9 * (1.0 + k), "integral: {is} {expected}");
        let assist = Law::Assist { torque: a, velocity: scale };
        let is = torque(assist, None, reversed, (q, v));
        prop_assert!((is - a * (v / scale).clamp(-1.0, 1.0)).abs() < 1e-12, "assist: {is}");
    }

    /// It damps T K (the notes' b = T k).
    #[test]
    fn a_compensating_damper_damps_as_the_springs_beside_it_ask(k in 0.1_f64..50.0, period in 1e-4_f64..1e-2, v in -3.0_f64..3.0) {
        let ends = |law: Law| law.between(End::Puck, End::Body(0));
        let damper = |damping| ends(Law::Damper { damping });
        let spring = ends(Law::Spring { stiffness: k, rest: 0.0 });
        let couplings = [spring, damper(Damping::Compensating), damper(Damping::Fixed(period * k))];
        let spec = Spec { bodies: &BODIES, couplings: &couplings, ..Spec::new(period) };
        let [compensating, fixed] = [1, 2].map(|i| spec.coupling_torque(i, (0.3, v), &[(0.1, 0.0)]));
        prop_assert!((compensating - fixed).abs() < 1e-12 * (1.0 + fixed.abs()), "{compensating} {fixed}");
        prop_assert_eq!(spec.coupling_torque(3, (0.3, v), &[]), 0.0);
    }
}
