//! Which couplings a method takes at a body.

use hapt_core::{Coupling, Method};

use crate::words;

/// Why `method` does not take this coupling ([`Coupling::goes_with`]), and an alternative; `None` when it does.
pub(crate) fn refusal(method: Method, coupling: &Coupling) -> Option<String> {
    if coupling.goes_with(method) {
        return None;
    }
    let noun = coupling.law.noun();
    let what = if coupling.limit.is_some() { noun.replacen("a ", "a clamped ", 1) } else { noun.to_string() };
    let methods = Method::ALL.into_iter().filter(|&method| coupling.goes_with(method)).map(Method::name);
    Some(format!("{what} at a body does not go with method {:?}; use {}", method.name(), words::alternatives(methods)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_core::{Damping, End, Law, Side};

    const WALL: Coupling =
        Law::Wall { side: Side::Above, at: 0.0, stiffness: 1.0, damping: 0.0 }.between(End::Body(0), End::Ground);
    const DETENT: Coupling = Law::Detent { torque: 1.0, pitch: 1.0, phase: 0.0 }.between(End::Body(0), End::Ground);
    const COULOMB: Coupling = Law::Coulomb { torque: 1.0 }.between(End::Body(0), End::Ground);
    const SPRING: Coupling = Law::Spring { stiffness: 1.0, rest: 0.0 }.between(End::Body(0), End::Ground);
    const CLAMPED: Coupling = Coupling { limit: Some(1.0), ..SPRING };
    const CONSTANT: Coupling = Law::Constant { torque: 1.0 }.between(End::Body(0), End::Ground);
    const LUGRE: Coupling = Law::Lugre {
        coulomb: 1.0,
        stribeck: 1.0,
        stribeck_velocity: 1.0,
        bristle_stiffness: 1.0,
        bristle_damping: 1.0,
        viscous: 1.0,
    }
    .between(End::Body(0), End::Ground);

    #[test]
    fn linear_couplings_go_with_every_method() {
        for method in Method::ALL {
            assert_eq!(refusal(method, &SPRING), None);
            assert_eq!(
                refusal(method, &Law::Damper { damping: Damping::Compensating }.between(End::Body(0), End::Puck)),
                None
            );
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
