//! The energy balance of the device.

/// Works since t = 0 in J. Hand and motor supply energy, damping and friction dissipate it, and the rest is kinetic:
/// hand + motor + field = damping + friction + change of J_z ż²/2. With a handle on a shaft the shaft's damping dissipates too, and its spring and
/// the handle store: hand + motor + field = damping + friction + shaft + change of (J_z ż² + J_h ḣ² + k (h - z)²)/2.
/// End stops dissipate too, and store k p²/2 where the puck is at a depth p in one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ledger {
    /// Done by the hand on the puck, or on the handle.
    pub hand: f64,
    /// Done by the motor on the puck.
    pub motor: f64,
    /// Done by the device's own gravity and cogging on the puck: their stored energy falls by as much; 0 without them.
    pub field: f64,
    /// Dissipated by the device's viscous damping.
    pub damping: f64,
    /// Dissipated by the device's Coulomb friction.
    pub friction: f64,
    /// Dissipated by the device's end stops, which store too; 0 without them.
    pub stops: f64,
    /// Dissipated by the damping of the shaft between puck and handle; 0 without one.
    pub shaft: f64,
}
