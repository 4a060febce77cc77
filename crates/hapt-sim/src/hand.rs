//! The hand: what it prescribes or pushes, and when it lets go.

use hapt_model::{Drive, Hand as Model};

use crate::curve::{Curve, snap};
use crate::puck::{Inertia, Push};

/// A hand laid on the loop's samples.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    curve: Curve,
    kind: Kind,
    release: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Prescribed,
    Torque,
    Grip(Inertia),
}

impl Hand {
    pub fn new(hand: &Model, period: f64) -> Self {
        let (shape, kind) = match &hand.drive {
            Drive::Position(shape) => (shape, Kind::Prescribed),
            Drive::Torque(shape) => (shape, Kind::Torque),
            &Drive::Grip { inertia, damping, stiffness, ref moves } => {
                (moves, Kind::Grip(Inertia { inertia, damping, stiffness }))
            }
        };
        Hand { curve: Curve::new(shape, period), kind, release: hand.release.map(|t| snap(t, period)) }
    }

    /// The position as a function of time, where the hand prescribes it.
    pub fn prescribed(&self) -> Option<&Curve> {
        matches!(self.kind, Kind::Prescribed).then_some(&self.curve)
    }

    /// What the hand adds to the puck while it is there.
    pub fn inertia(&self) -> Inertia {
        match self.kind {
            Kind::Grip(inertia) => inertia,
            Kind::Prescribed | Kind::Torque => Inertia::default(),
        }
    }

    /// The push per unit of σ = sin(ωt + phase) and κ = cos(ωt + phase), and ω in rad/s; zeros where there is no sine.
    pub fn sine(&self) -> (f64, f64, f64) {
        match (&self.curve, self.kind) {
            (&Curve::Sine { amplitude, omega, .. }, Kind::Torque) => (amplitude, 0.0, omega),
            (&Curve::Sine { amplitude, omega, .. }, Kind::Grip(hand)) => {
                (hand.stiffness * amplitude, hand.damping * amplitude * omega, omega)
            }
            _ => (0.0, 0.0, 0.0),
        }
    }

    /// The push from t on, until the next event: the torque itself, or a grip's spring and damper on its intended motion. A
    /// jump of the intention has no velocity: no impulse.
    pub fn push(&self, t: f64) -> Push {
        match &self.curve {
            &Curve::Sine { omega, phase, .. } => {
                let (sin, cos) = libm::sincos(omega * t + phase);
                Push { sin, cos, ..Push::default() }
            }
            curve => {
                let (value, slope) = curve.at(t);
                match self.kind {
                    Kind::Grip(hand) => Push {
                        value: hand.stiffness * value + hand.damping * slope,
                        slope: hand.stiffness * slope,
                        ..Push::default()
                    },
                    Kind::Torque | Kind::Prescribed => Push { value, slope, ..Push::default() },
                }
            }
        }
    }

    /// Whether the hand is gone at t; the instant of release is the first at which it is.
    pub fn is_gone(&self, t: f64) -> bool {
        self.release.is_some_and(|release| release <= t)
    }

    /// The first instant after t at which the hand does something new.
    pub fn next_event(&self, t: f64) -> Option<f64> {
        let release = self.release.filter(|&release| release > t);
        match (self.curve.next_break(t), release) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// The last thing the hand does, in s: a step, a ramp's end, a path's last point, or the release. 0 for a sine.
    pub fn last_event(&self) -> f64 {
        let curve = self.curve.last_event();
        self.release.map_or(curve, |release| release.max(curve.min(release)))
    }

    /// Whether the puck stands still, held, from the last event on.
    pub fn holds_still(&self) -> bool {
        self.prescribed().is_some() && self.release.is_none() && matches!(self.curve, Curve::Straight(_))
    }
}
