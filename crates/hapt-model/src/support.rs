//! Which couplings a method takes at a body.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_core::{Clampable, Law, Method};

use crate::words;

/// Why `method` does not take this law at a body, and what to use; `None` when it does.
///
/// The explicit methods take every law where it stands. Those that hold a body's torque over the step (zoh, trapezoidal,
/// backward Euler) find it so that the step gains no energy; LuGre's bristle has no such step. The methods that take the new
/// sample first have no place for one.
pub(crate) fn refusal(method: Method, law: &Law) -> Option<String> {
    let (what, method_name) = (name(law)?, method.name());
    let use_instead = |takes: fn(Method) -> bool| {
        let names = Method::ALL.into_iter().filter(|&method| takes(method)).map(Method::name);
        format!("use {}", words::alternatives(names))
    };
    let refused = format!("{what} at a body does not go with method {method_name:?}");
    match law {
        Law::Lugre { .. } => {
            (!method.is_explicit()).then(|| format!("{refused}; {}", use_instead(Method::is_explicit)))
        }
        Law::Spring { .. }
        | Law::Damper { .. }
        | Law::Wall { .. }
        | Law::Detent { .. }
        | Law::Coulomb { .. }
        | Law::Constant { .. }
        | Law::Clamped { .. } => method
            .takes_new_sample_first()
            .then(|| format!("{refused}; {}", use_instead(|method| !method.takes_new_sample_first()))),
    }
}

/// What a nonlinear law is called; a constant counts as one. `None`: linear.
fn name(law: &Law) -> Option<&'static str> {
    match law {
        Law::Spring { .. } | Law::Damper { .. } => None,
        Law::Wall { .. } => Some("a wall"),
        Law::Detent { .. } => Some("a detent"),
        Law::Coulomb { .. } => Some("Coulomb friction"),
        Law::Lugre { .. } => Some("LuGre friction"),
        Law::Constant { .. } => Some("a constant torque"),
        Law::Clamped { law: Clampable::Spring { .. }, .. } => Some("a clamped spring"),
        Law::Clamped { law: Clampable::Damper { .. }, .. } => Some("a clamped damper"),
        Law::Clamped { law: Clampable::Wall { .. }, .. } => Some("a clamped wall"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_core::{Damping, Side};

    const WALL: Law = Law::Wall { side: Side::Above, at: 0.0, stiffness: 1.0, damping: 0.0 };
    const DETENT: Law = Law::Detent { torque: 1.0, pitch: 1.0, phase: 0.0 };
    const COULOMB: Law = Law::Coulomb { torque: 1.0 };
    const CLAMPED: Law = Law::Clamped { law: Clampable::Spring { stiffness: 1.0, rest: 0.0 }, limit: 1.0 };
    const CONSTANT: Law = Law::Constant { torque: 1.0 };
    const LUGRE: Law = Law::Lugre {
        coulomb: 1.0,
        stribeck: 1.0,
        stribeck_velocity: 1.0,
        bristle_stiffness: 1.0,
        bristle_damping: 1.0,
        viscous: 1.0,
    };

    #[test]
    fn linear_couplings_go_with_every_method() {
        for method in Method::ALL {
            assert_eq!(refusal(method, &Law::Spring { stiffness: 1.0, rest: 0.0 }), None);
            assert_eq!(refusal(method, &Law::Damper { damping: Damping::Compensating }), None);
        }
    }

    #[test]
    fn every_coupling_goes_with_the_explicit_methods() {
        for method in [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4] {
            for law in [WALL, DETENT, COULOMB, CLAMPED, CONSTANT, LUGRE] {
                assert_eq!(refusal(method, &law), None);
            }
        }
    }

    #[test]
    fn no_nonlinear_coupling_goes_with_tustin_or_foh_and_a_constant_counts_as_one() {
        for method in [Method::Tustin, Method::Foh] {
            for law in [WALL, DETENT, COULOMB, CLAMPED, CONSTANT, LUGRE] {
                assert!(refusal(method, &law).is_some());
            }
        }
        assert_eq!(
            refusal(Method::Foh, &CONSTANT).unwrap(),
            "a constant torque at a body does not go with method \"foh\"; use \"forward-euler\", \"backward-euler\", \
             \"semi-implicit-euler\", \"trapezoidal\", \"zoh\" or \"rk4\""
        );
    }

    #[test]
    fn methods_that_hold_the_torque_take_everything_but_lugre() {
        for method in [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler] {
            for law in [WALL, DETENT, COULOMB, CLAMPED, CONSTANT] {
                assert_eq!(refusal(method, &law), None);
            }
            assert!(refusal(method, &LUGRE).is_some());
        }
        assert_eq!(
            refusal(Method::Zoh, &LUGRE).unwrap(),
            "LuGre friction at a body does not go with method \"zoh\"; \
             use \"forward-euler\", \"semi-implicit-euler\" or \"rk4\""
        );
    }
}
