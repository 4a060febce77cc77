//! Where the device's energy goes.

/// Works since t = 0 in J. Hand and motor give, damping and friction take, and the rest moves:
/// hand + motor = damping + friction + change of J_z ż²/2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ledger {
    /// Done by the hand on the puck.
    pub hand: f64,
    /// Done by the motor on the puck.
    pub motor: f64,
    /// Taken by the device's viscous damping.
    pub damping: f64,
    /// Taken by the device's Coulomb friction.
    pub friction: f64,
}
