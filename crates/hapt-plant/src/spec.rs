//! What a device and a hand are made of, as plain data in SI: rotary worlds in rad, N·m and kg·m², linear ones in m, N and kg.

use alloc::string::String;
use alloc::vec::Vec;

/// A device and the loop's times: what a [`crate::VirtualDevice`] is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DeviceSpec {
    /// T in s, positive.
    pub period: f64,
    /// From the sample to the moment the motor torque changes, in s, zero or more.
    pub delay: f64,
    /// The puck's J_z in kg·m² (linear: kg), positive.
    pub inertia: f64,
    /// Viscous, in N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// Coulomb, in N·m (linear: N), zero or more.
    pub friction: f64,
}

/// What drives the puck, and until when.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hand {
    /// How it drives.
    pub drive: Drive,
    /// From this instant on the hand is gone; in s, zero or more.
    pub release: Option<f64>,
}

/// How a hand drives the puck.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Drive {
    /// `step`, `ramp`, `sine`, `path`: the position is prescribed, whatever the torque.
    Position(Shape),
    /// `torque`: the puck moves by itself, pushed by this torque.
    Torque(Shape),
    /// `grip`: held through a spring and a damper between the puck and the intended motion; the inertia moves with the puck.
    Grip {
        /// kg·m², 0 when not given.
        inertia: f64,
        /// N·m·s/rad, zero or more.
        damping: f64,
        /// N·m/rad, zero or more.
        stiffness: f64,
        /// The intended motion.
        moves: Shape,
        /// A hand that opens and takes hold again; `None`: it holds on.
        switching: Option<Switching>,
    },
}

/// A grip that holds, opens and takes hold again, from t = 0 on. Open, it has no spring and no damper, and what its spring held is
/// lost; its inertia stays with the puck. Each time it takes hold where the puck is: what it intends is the puck's position at that
/// instant, and what its `moves` does from then on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Switching {
    /// How long it holds, s, positive.
    pub hold: f64,
    /// How long it is open, s, positive.
    pub open: f64,
}

/// A position, or a torque, as a function of time.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Shape {
    /// 0, and from `at` on `to`.
    Step {
        /// Position or torque.
        to: f64,
        /// s, zero or more.
        at: f64,
    },
    /// From 0 to `to` straight, starting `at`, taking `over`.
    Ramp {
        /// Position or torque.
        to: f64,
        /// s, zero or more.
        at: f64,
        /// s, positive.
        over: f64,
    },
    /// amplitude · sin(2π frequency t + phase), from t = 0.
    Sine {
        /// Position or torque.
        amplitude: f64,
        /// Hz, positive.
        frequency: f64,
        /// rad.
        phase: f64,
    },
    /// Straight between points; the first value before them, the last after them.
    Path {
        /// As the world file names it.
        file: String,
        /// (s, position or torque), times strictly increasing, at least one point.
        points: Vec<(f64, f64)>,
    },
}
