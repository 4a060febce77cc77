//! The couplings that no matrix holds: wall, detent, the two frictions, and what is clamped.

use crate::contact::within;
use crate::friction::Lugre;
use crate::spec::sign_at_puck;
use crate::{Clampable, Coupling, Damping, End, Law, Real, Side, Vector};

/// The torque on the first end as a function of q and q̇.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Curve<F> {
    /// `direction` is +1 for a wall above its face, -1 for one below: then q, q̇ and torque are mirrored.
    Wall {
        direction: F,
        at: F,
        stiffness: F,
        damping: F,
        /// Infinite where it is not clamped.
        limit: F,
    },
    /// A clamped one; the others are matrices.
    Spring {
        stiffness: F,
        rest: F,
        limit: F,
    },
    /// A clamped one.
    Damper {
        damping: F,
        limit: F,
    },
    Detent {
        torque: F,
        pitch: F,
        phase: F,
    },
    Coulomb {
        torque: F,
    },
    Lugre(Lugre<F>),
}

/// A nonlinear coupling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nonlinear<F> {
    pub first: End,
    pub second: End,
    pub curve: Curve<F>,
}

/// q and q̇ of a coupling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relative<F> {
    pub position: F,
    pub velocity: F,
}

impl<F: Real> Nonlinear<F> {
    /// `None` for the couplings that are matrices. `compensating` is what a damper that follows the springs damps.
    pub fn new(coupling: &Coupling, compensating: f64) -> Option<Self> {
        let f = F::from_f64;
        let wall = |side, at, stiffness, damping, limit| Curve::Wall {
            direction: match side {
                Side::Above => F::ONE,
                Side::Below => -F::ONE,
            },
            at: f(at),
            stiffness: f(stiffness),
            damping: f(damping),
            limit: f(limit),
        };
        let curve = match coupling.law {
            Law::Spring { .. } | Law::Damper { .. } | Law::Constant { .. } => return None,
            Law::Wall { side, at, stiffness, damping } => wall(side, at, stiffness, damping, f64::INFINITY),
            Law::Clamped { law, limit } => match law {
                Clampable::Spring { stiffness, rest } => {
                    Curve::Spring { stiffness: f(stiffness), rest: f(rest), limit: f(limit) }
                }
                Clampable::Damper { damping } => {
                    let damping = match damping {
                        Damping::Fixed(damping) => damping,
                        Damping::Compensating => compensating,
                    };
                    Curve::Damper { damping: f(damping), limit: f(limit) }
                }
                Clampable::Wall { side, at, stiffness, damping } => wall(side, at, stiffness, damping, limit),
            },
            Law::Detent { torque, pitch, phase } => {
                Curve::Detent { torque: f(torque), pitch: f(pitch), phase: f(phase) }
            }
            Law::Coulomb { torque } => Curve::Coulomb { torque: f(torque) },
            Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => {
                Curve::Lugre(Lugre {
                    coulomb: f(coulomb),
                    stribeck: f(stribeck),
                    stribeck_velocity: f(stribeck_velocity),
                    bristle_stiffness: f(bristle_stiffness),
                    bristle_damping: f(bristle_damping),
                    viscous: f(viscous),
                })
            }
        };
        Some(Nonlinear { first: coupling.first, second: coupling.second, curve })
    }

    /// Whether a body stands at either end.
    pub fn at_body(&self) -> bool {
        self.first.body().is_some() || self.second.body().is_some()
    }

    /// Whether the law alone does not say its torque: Coulomb friction at a body, whose torque a discrete-gradient step finds.
    pub fn is_found(&self) -> bool {
        let is_found = match self.curve {
            Curve::Coulomb { .. } => true,
            Curve::Wall { .. }
            | Curve::Spring { .. }
            | Curve::Damper { .. }
            | Curve::Detent { .. }
            | Curve::Lugre(_) => false,
        };
        is_found && self.at_body()
    }

    /// The sign of this coupling's torque on the puck; 0 when it is not tied to it.
    pub fn sign_at_puck(&self) -> F {
        F::from_f64(sign_at_puck(self.first, self.second))
    }

    /// q and q̇ with the puck and the bodies as given.
    #[inline]
    pub fn relative<const B: usize>(&self, puck: (F, F), bodies: &Vector<F, B>) -> Relative<F> {
        let at = |end: End| match end {
            End::Puck => puck,
            End::Ground => (F::ZERO, F::ZERO),
            // The index was checked when the loop was compiled.
            End::Body(i) => {
                (bodies.position.get(i).copied().unwrap_or(F::ZERO), bodies.velocity.get(i).copied().unwrap_or(F::ZERO))
            }
        };
        let (first, second) = (at(self.first), at(self.second));
        Relative { position: first.0 - second.0, velocity: first.1 - second.1 }
    }

    /// The bristle after a period `t` in s at q̇ held; without LuGre friction there is none.
    #[inline]
    pub fn bend(&self, bristle: F, q: Relative<F>, t: F) -> F {
        match self.curve {
            Curve::Lugre(lugre) => lugre.bend(bristle, q.velocity, t),
            Curve::Wall { .. }
            | Curve::Spring { .. }
            | Curve::Damper { .. }
            | Curve::Detent { .. }
            | Curve::Coulomb { .. } => bristle,
        }
    }

    /// The torque on the first end, with LuGre's bristle as it stands.
    #[inline]
    pub fn torque(&self, q: Relative<F>, bristle: F) -> F {
        match self.curve {
            Curve::Wall { direction, at, stiffness, damping, limit } => {
                let depth = direction * (q.position - at);
                let push = stiffness * depth + damping * (direction * q.velocity);
                // It pushes only, and only inside; a NaN pushes nothing.
                if depth > F::ZERO && push > F::ZERO { -(direction * within(push, F::ZERO, limit)) } else { F::ZERO }
            }
            Curve::Spring { stiffness, rest, limit } => within(-(stiffness * (q.position - rest)), -limit, limit),
            Curve::Damper { damping, limit } => within(-(damping * q.velocity), -limit, limit),
            Curve::Detent { torque, pitch, phase } => {
                let turns = (q.position - phase) / pitch;
                // Taken from the nearest rest, so that every rest is exactly one, however far it is.
                let rest = (turns + F::HALF).floor();
                -(torque * (F::from_f64(core::f64::consts::TAU) * (turns - rest)).sin())
            }
            Curve::Coulomb { torque } => {
                if q.velocity > F::ZERO {
                    -torque
                } else if q.velocity < F::ZERO {
                    torque
                } else {
                    F::ZERO
                }
            }
            Curve::Lugre(lugre) => lugre.torque(bristle, q.velocity),
        }
    }
}
