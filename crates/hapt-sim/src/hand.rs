//! The hand: what it prescribes or pushes, and when it lets go.

use hapt_model::{Drive, Hand as Model};

use crate::curve::{Curve, Form, Piece, snap};
use crate::puck::{Inertia, Push};

/// A hand laid on the loop's samples.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    curve: Curve,
    /// The curve's piece since the last event.
    piece: Piece,
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
        let curve = Curve::new(shape, period);
        Hand { piece: curve.first(), curve, kind, release: hand.release.map(|t| snap(t, period)) }
    }

    /// The position as a function of time until the next event, where the hand prescribes it.
    #[inline]
    pub fn prescribed(&self) -> Option<&Piece> {
        matches!(self.kind, Kind::Prescribed).then_some(&self.piece)
    }

    /// What the hand adds to the puck while it is there.
    pub fn grip(&self) -> Option<Inertia> {
        match self.kind {
            Kind::Grip(inertia) => Some(inertia),
            Kind::Prescribed | Kind::Torque => None,
        }
    }

    /// The push per unit of σ = sin(ωt + phase) and κ = cos(ωt + phase), and ω in rad/s; zeros where there is no sine.
    pub fn sine(&self) -> (f64, f64, f64) {
        match (self.curve.last().form, self.kind) {
            (Form::Sine { amplitude, omega, .. }, Kind::Torque) => (amplitude, 0.0, omega),
            (Form::Sine { amplitude, omega, .. }, Kind::Grip(hand)) => {
                (hand.stiffness * amplitude, hand.damping * amplitude * omega, omega)
            }
            _ => (0.0, 0.0, 0.0),
        }
    }

    /// The push from t on, until the next event: the torque itself, or a grip's spring and damper on its intended motion. A
    /// jump of the intention has no velocity: no impulse.
    pub fn push(&self, t: f64) -> Push {
        if let Form::Sine { omega, phase, .. } = self.piece.form {
            let (sin, cos) = libm::sincos(omega * t + phase);
            return Push { sin, cos, ..Push::default() };
        }
        let (value, slope) = self.piece.at(t);
        match self.kind {
            Kind::Grip(hand) => Push {
                value: hand.stiffness * value + hand.damping * slope,
                slope: hand.stiffness * slope,
                ..Push::default()
            },
            Kind::Torque | Kind::Prescribed => Push { value, slope, ..Push::default() },
        }
    }

    /// Goes over to the curve's piece at t; gives the first instant after t at which the hand does something new.
    pub fn act(&mut self, t: f64) -> Option<f64> {
        self.piece = self.curve.piece(t);
        let release = self.release.filter(|&release| release > t);
        match (self.curve.next_break(t), release) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Whether the hand is gone at t; the instant of release is the first at which it is.
    pub fn is_gone(&self, t: f64) -> bool {
        self.release.is_some_and(|release| release <= t)
    }

    /// The last thing the hand does, in s: a step, a ramp's end, a path's last point, or the release. 0 for a sine.
    pub fn last_event(&self) -> f64 {
        let curve = self.curve.last().from;
        self.release.map_or(curve, |release| release.max(curve.min(release)))
    }

    /// Whether the puck stands still, held, from the last event on.
    pub fn holds_still(&self) -> bool {
        self.prescribed().is_some() && self.release.is_none() && self.curve.last().is_flat()
    }
}
