//! What a world stores, and what a step of it may bring in: the couplings as energies.
//!
//! The loop's matrices know torques alone, so that this is derived from the spec a second time, and a check of them.

use crate::compile::compensated;
use crate::{Clampable, Coupling, Damping, End, Law, Method, Real, Side, Spec, State, Vector};

/// A potential V(q).
#[derive(Clone, Copy, Debug)]
enum Potential<F> {
    Nothing,
    /// stiffness · x²/2 up to the x at which the torque is `limit`, straight from there on; x = |q - rest|, or inside of a wall's face.
    Spring {
        stiffness: F,
        rest: F,
        /// +1: above the rest only (a wall), -1: below it only, 0: both sides.
        side: F,
        limit: F,
    },
    /// torque · pitch/2π · (1 - cos 2π(q - phase)/pitch)
    Detent {
        torque: F,
        pitch: F,
        phase: F,
    },
    /// stiffness · s²/2 of the coupling's bristle.
    Bristle {
        stiffness: F,
    },
}

/// One coupling: what it stores, what it drags along, what it gives.
#[derive(Clone, Copy, Debug)]
struct Part<F> {
    first: End,
    second: End,
    potential: Potential<F>,
    /// N·m·s/rad (N·s/m)
    damping: F,
    /// The largest torque of a friction, N·m (N).
    friction: F,
    /// A constant's torque.
    constant: F,
    /// Between the puck and a body: only such a one can bring the puck's motion into a held step.
    carries: bool,
}

/// A world's energies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Energy<F, const B: usize, const C: usize> {
    inertia: [F; B],
    bodies: usize,
    parts: [Option<Part<F>>; C],
    /// No part stands from here on.
    count: usize,
    rate: F,
    /// T/2 where the method keeps V - T/2 · V'(q) q̇ in place of V (semi-implicit Euler), else 0.
    lag: F,
    /// Whether a step is made with the puck held: not by the methods that take the new sample first.
    holds: bool,
    /// The torques of all constants on the puck.
    pub constant: F,
}

/// What one step did.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<F> {
    /// Stored after it, with the puck where it was seen, in J.
    pub stored: F,
    /// What the integrator made, in J: the change of what is stored less what the puck's motion and constants brought in; at most what
    /// it made where something was damped.
    pub made: F,
    /// The constants' work on the bodies, in J.
    pub given: F,
}

impl<F: Real, const B: usize, const C: usize> Energy<F, B, C> {
    /// Of a world that the loop has compiled.
    pub fn new(spec: &Spec) -> Self {
        let f = F::from_f64;
        let mut parts = [None; C];
        let mut constant = 0.0;
        for (place, coupling) in parts.iter_mut().zip(spec.couplings) {
            *place = part(spec, coupling);
            if let Law::Constant { torque } = coupling.law {
                match (coupling.first, coupling.second) {
                    (End::Puck, _) => constant += torque,
                    (_, End::Puck) => constant -= torque,
                    _ => {}
                }
            }
        }
        let mut inertia = [F::ZERO; B];
        for (place, body) in inertia.iter_mut().zip(spec.bodies) {
            *place = f(body.inertia);
        }
        Energy {
            inertia,
            bodies: spec.bodies.len().min(B),
            parts,
            count: parts.iter().rposition(Option::is_some).map_or(0, |last| last + 1),
            rate: f(1.0 / spec.period),
            lag: if spec.method == Method::SemiImplicitEuler { f(0.5 * spec.period) } else { F::ZERO },
            holds: !spec.method.takes_new_sample_first(),
            constant: f(constant),
        }
    }

    /// The step that `state` has just taken, at the puck's measured position and velocity.
    pub fn step<const W: usize>(&self, state: &State<F, B, C, W>, puck: (F, F)) -> Step<F> {
        let (from, change) = (&state.now, &state.change);
        let (mut before, mut after, mut given, mut carried) = (F::ZERO, F::ZERO, F::ZERO, F::ZERO);
        let bodies = from.velocity.iter().zip(&change.velocity).zip(&self.inertia).take(self.bodies);
        for ((v, dv), inertia) in bodies {
            let (v, end) = (*v, *v + *dv);
            before += F::HALF * *inertia * (v * v);
            after += F::HALF * *inertia * (end * end);
        }
        for (part, bristle) in self.parts.iter().zip(&state.bristles).take(self.count) {
            let Some(part) = part else { continue };
            let (q, rate) = part.relative(puck.0, from);
            let (moved, turned) = part.relative(F::ZERO, change);
            before += part.potential.at(q, *bristle, self.lag * rate);
            after += part.potential.at(q + moved, *bristle, self.lag * (rate + turned));
            given += part.constant * moved;
            if part.carries && puck.1 != F::ZERO {
                let q_dot = if part.first == End::Puck { puck.1 } else { -puck.1 };
                let work = -(part.damping * (q_dot + moved * self.rate) * moved);
                carried += if work > F::ZERO { work } else { F::ZERO };
                carried += part.friction * moved.abs();
            }
        }
        // Rounding is nobody's doing.
        let rounding = F::from_f64(16.0) * F::EPSILON * (before.abs() + after.abs());
        let made = if self.holds { after - before - given - carried - rounding } else { F::ZERO };
        Step { stored: after, made, given }
    }
}

impl<F: Real> Part<F> {
    /// q and the bodies' part of q̇, the puck at `puck` and at rest.
    fn relative<const B: usize>(&self, puck: F, bodies: &Vector<F, B>) -> (F, F) {
        let at = |end: End| match end {
            End::Puck => (puck, F::ZERO),
            End::Ground => (F::ZERO, F::ZERO),
            End::Body(i) => {
                (bodies.position.get(i).copied().unwrap_or(F::ZERO), bodies.velocity.get(i).copied().unwrap_or(F::ZERO))
            }
        };
        let (first, second) = (at(self.first), at(self.second));
        (first.0 - second.0, first.1 - second.1)
    }
}

impl<F: Real> Potential<F> {
    /// V(q) - V'(q) · `lag`
    fn at(&self, q: F, bristle: F, lag: F) -> F {
        match *self {
            Potential::Nothing => F::ZERO,
            Potential::Spring { stiffness, rest, side, limit } => {
                let x = q - rest;
                if side * x < F::ZERO {
                    return F::ZERO;
                }
                let torque = stiffness * x;
                if torque.abs() <= limit {
                    return F::HALF * torque * x - torque * lag;
                }
                // The slope ends at limit/stiffness.
                let size = x.abs() - F::HALF * limit / stiffness;
                limit * size - if x > F::ZERO { limit * lag } else { -(limit * lag) }
            }
            Potential::Detent { torque, pitch, phase } => {
                // 1 - cos 2a = 2 sin² a: a small swing about a rest keeps its digits.
                let turns = (q - phase) / pitch;
                let half = F::from_f64(core::f64::consts::PI) * (turns - (turns + F::HALF).floor());
                let sine = half.sin();
                let well = torque * pitch / F::from_f64(core::f64::consts::PI) * (sine * sine);
                if lag == F::ZERO { well } else { well - torque * (half + half).sin() * lag }
            }
            Potential::Bristle { stiffness } => F::HALF * stiffness * (bristle * bristle),
        }
    }
}

fn part<F: Real>(spec: &Spec, coupling: &Coupling) -> Option<Part<F>> {
    let f = F::from_f64;
    let spring = |stiffness, rest, side, limit| {
        if stiffness == 0.0 {
            return Potential::Nothing;
        }
        Potential::Spring { stiffness: f(stiffness), rest: f(rest), side: f(side), limit: f(limit) }
    };
    let facing = |side| if side == Side::Above { 1.0 } else { -1.0 };
    let damper = |damping| match damping {
        Damping::Fixed(damping) => damping,
        Damping::Compensating => spec.period * compensated(spec.couplings, coupling).unwrap_or(0.0),
    };
    let (potential, damping, friction, constant) = match coupling.law {
        Law::Spring { stiffness, rest } => (spring(stiffness, rest, 0.0, f64::INFINITY), 0.0, 0.0, 0.0),
        Law::Wall { side, at, stiffness, damping } => {
            (spring(stiffness, at, facing(side), f64::INFINITY), damping, 0.0, 0.0)
        }
        Law::Clamped { law, limit } => match law {
            Clampable::Spring { stiffness, rest } => (spring(stiffness, rest, 0.0, limit), 0.0, 0.0, 0.0),
            Clampable::Wall { side, at, stiffness, damping } => {
                (spring(stiffness, at, facing(side), limit), damping, 0.0, 0.0)
            }
            Clampable::Damper { damping } => (Potential::Nothing, damper(damping), 0.0, 0.0),
        },
        Law::Detent { torque, pitch, phase } => {
            (Potential::Detent { torque: f(torque), pitch: f(pitch), phase: f(phase) }, 0.0, 0.0, 0.0)
        }
        Law::Damper { damping } => (Potential::Nothing, damper(damping), 0.0, 0.0),
        Law::Coulomb { torque } => (Potential::Nothing, 0.0, torque, 0.0),
        Law::Lugre { coulomb, stribeck, bristle_stiffness, bristle_damping, viscous, .. } => {
            let level = if coulomb > stribeck { coulomb } else { stribeck };
            let potential = Potential::Bristle { stiffness: f(bristle_stiffness) };
            (potential, bristle_damping + viscous, level, 0.0)
        }
        Law::Constant { torque } => (Potential::Nothing, 0.0, 0.0, torque),
    };
    let ends = [coupling.first, coupling.second];
    let carries = ends.contains(&End::Puck)
        && ends.iter().any(|end| matches!(end, End::Body(_)))
        && (damping > 0.0 || friction > 0.0);
    // At the puck alone, or between bodies, a damper has no part in what is counted here.
    let counts = carries || constant != 0.0 || !matches!(potential, Potential::Nothing);
    counts.then(|| Part {
        first: coupling.first,
        second: coupling.second,
        potential,
        damping: f(damping),
        friction: f(friction),
        constant: f(constant),
        carries,
    })
}
