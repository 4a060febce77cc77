//! The actions on a puck or a handle: a hand's grasp, and the push of hand and motor.

/// Inertia, damping and stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Inertia {
    pub inertia: f64,
    pub damping: f64,
    pub stiffness: f64,
}

/// A hand's push per unit of σ and of κ, and its ω in rad/s; zeros where there is no sine.
pub(crate) type Sine = (f64, f64, f64);

pub(crate) const NO_SINE: Sine = (0.0, 0.0, 0.0);

/// The push on the puck over a time step: value + slope · t, and the sine's σ and κ at its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Push {
    /// N·m (N)
    pub value: f64,
    /// N·m/s (N/s)
    pub slope: f64,
    /// σ
    pub sin: f64,
    /// κ
    pub cos: f64,
}

/// How the hand holds the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Grasp {
    /// None, or a torque.
    Free,
    /// Its inertia, damping and stiffness.
    Grip(Inertia),
    /// It prescribes the handle's motion.
    Prescribed,
}
