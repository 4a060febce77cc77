//! A passive hand on the puck, or on the handle of a shaft.

use serde::Serialize;

/// A passive hand on the puck, or on the handle of a shaft: its inertia moves with it, its spring and damper act between it and the hand's
/// position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Grip {
    /// kg·m² (linear: kg), zero or more.
    pub inertia: f64,
    /// N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// N·m/rad (linear: N/m), zero or more.
    pub stiffness: f64,
}
