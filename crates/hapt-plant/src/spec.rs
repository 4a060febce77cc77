//! The parameters of a device and a hand, as plain data in SI: rotary worlds in rad, N·m and kg·m², linear ones in m, N and kg.

use alloc::string::String;
use alloc::vec::Vec;

use hapt_core::Waveform;

/// The parameters of a [`crate::VirtualDevice`]: the device and the loop's times.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DeviceSpec {
    /// T in s, positive.
    pub period: f64,
    /// From the sample to the moment the motor torque changes, in s, zero or more.
    pub delay: f64,
    /// The time constant in s with which the motor torque follows its command, zero or more; 0: at once.
    pub lag: f64,
    /// The puck's J_z in kg·m² (linear: kg), positive.
    pub inertia: f64,
    /// Viscous damping, in N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// Coulomb friction, in N·m (linear: N), zero or more.
    pub friction: f64,
    /// The Coulomb friction toward smaller positions, where it differs from that toward larger ones.
    pub friction_backward: Option<f64>,
    /// How Coulomb friction changes with the position.
    pub friction_by_position: Option<FrictionByPosition>,
    /// The excess of friction at low speeds.
    pub stribeck: Option<Stribeck>,
    /// The ends of the puck's range.
    pub stops: Option<Stops>,
    /// A handle on a flexible shaft; `None`: the puck is the handle.
    pub handle: Option<Handle>,
    /// Gravity and cogging, which act on the puck.
    pub torque: DeviceTorque,
}

impl DeviceSpec {
    /// A puck of this inertia in kg·m² (linear: kg) that moves freely, at samples of this period in s, with a motor that follows at once.
    pub const fn new(period: f64, inertia: f64) -> Self {
        DeviceSpec {
            period,
            delay: 0.0,
            lag: 0.0,
            inertia,
            damping: 0.0,
            friction: 0.0,
            friction_backward: None,
            friction_by_position: None,
            stribeck: None,
            stops: None,
            handle: None,
            torque: DeviceTorque { gravity: None, cogging: None },
        }
    }
}

/// Coulomb friction that depends on the position: both levels are 1 + share · Σ (sineₙ sin nθ + cosineₙ cos nθ) times their mean,
/// θ = 2π (z - phase)/pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrictionByPosition {
    /// Zero or more, and [`FrictionByPosition::most`] is 1 at most: no level is negative. Of more, the device takes what makes it 1.
    pub share: f64,
    /// One period, in rad (linear: m), positive.
    pub pitch: f64,
    /// Where a period begins, in the same unit.
    pub phase: f64,
    /// Its harmonics.
    pub waveform: Waveform,
}

impl FrictionByPosition {
    /// A bound on the part of the mean level by which a level is above or below it: the sizes of all sines.
    pub fn most(&self) -> f64 {
        self.sum(|_| 1.0)
    }

    /// A bound on the slope of that part, in 1/rad (linear: 1/m).
    pub fn steepest(&self) -> f64 {
        self.sum(|rate| rate)
    }

    /// A level with the puck at `z` rad (linear: m), for a mean level of 1.
    pub fn at(&self, z: f64) -> f64 {
        1.0 + self.share * self.waveform.at(core::f64::consts::TAU * (z - self.phase) / self.pitch)
    }

    /// The sizes of all sines, each times a weight of its rate in 1/rad (linear: 1/m).
    fn sum(&self, weight: impl Fn(f64) -> f64) -> f64 {
        let rate = core::f64::consts::TAU / self.pitch;
        let size = |(n, sine, cosine): (f64, f64, f64)| self.share * libm::hypot(sine, cosine) * weight(n * rate);
        self.waveform.harmonics().map(size).sum()
    }
}

/// Friction that falls as the puck speeds up: the level is `torque` · max(0, 1 - |ż|/`velocity`) above Coulomb friction, in either direction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stribeck {
    /// The excess of friction at rest over Coulomb friction, in N·m (linear: N), zero or more.
    pub torque: f64,
    /// The speed from which on friction is Coulomb friction, in rad/s (linear: m/s), positive.
    pub velocity: f64,
}

impl Stribeck {
    /// The slope with which friction falls: the magnitude of a negative damping, in N·m·s/rad (linear: N·s/m).
    pub fn slope(&self) -> f64 {
        self.torque / self.velocity
    }
}

/// Mechanical stops at the puck: springs and dampers that push it back, and never pull.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stops {
    /// Where that toward smaller positions begins, in rad (linear: m); `None`: there is none.
    pub low: Option<f64>,
    /// Where that toward larger positions begins, in the same unit.
    pub high: Option<f64>,
    /// In N·m/rad (linear: N/m), positive.
    pub stiffness: f64,
    /// In N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
}

/// The torques of the device's own that depend on its position: it stores their energy, and over a turn their work is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DeviceTorque {
    /// Of an unbalanced puck or handle.
    pub gravity: Option<Gravity>,
    /// Of the motor without current.
    pub cogging: Option<Cogging>,
}

/// torque · sin(z + phase) on the puck. It turns with the angle: rotary devices have it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gravity {
    /// In N·m, zero or more.
    pub torque: f64,
    /// In rad.
    pub phase: f64,
}

/// torque · Σ (sineₙ sin nθ + cosineₙ cos nθ) on the puck, θ = 2π (z - phase)/pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cogging {
    /// In N·m (linear: N), zero or more.
    pub torque: f64,
    /// One period, in rad (linear: m), positive.
    pub pitch: f64,
    /// Where a period begins, in the same unit.
    pub phase: f64,
    /// Its harmonics.
    pub waveform: Waveform,
}

impl DeviceTorque {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.most() == 0.0
    }

    /// A bound on it, in N·m (linear: N): the sizes of all sines.
    pub fn most(&self) -> f64 {
        self.sum(|_| 1.0)
    }

    /// A bound on its slope of either sign, in N·m/rad (linear: N/m): the steepest slopes of all sines.
    pub fn steepest(&self) -> f64 {
        self.sum(|rate| rate)
    }

    /// A bound on the energy that it gives between any two positions, in J.
    pub fn depth(&self) -> f64 {
        self.sum(|rate| 2.0 / rate)
    }

    /// On the puck at `z` rad (linear: m), in N·m (linear: N).
    pub fn at(&self, z: f64) -> f64 {
        let gravity = self.gravity.map_or(0.0, |gravity| gravity.torque * libm::sin(z + gravity.phase));
        let cogging = self.cogging.map_or(0.0, |cogging| {
            cogging.torque * cogging.waveform.at(core::f64::consts::TAU * (z - cogging.phase) / cogging.pitch)
        });
        gravity + cogging
    }

    /// The sizes of all sines, each times a weight of its rate in 1/rad (linear: 1/m).
    fn sum(&self, weight: impl Fn(f64) -> f64) -> f64 {
        let gravity = self.gravity.map_or(0.0, |gravity| gravity.torque * weight(1.0));
        let cogging = self.cogging.map_or(0.0, |Cogging { torque, pitch, waveform, .. }| {
            let rate = core::f64::consts::TAU / pitch;
            let size = |(n, sine, cosine): (f64, f64, f64)| torque * libm::hypot(sine, cosine) * weight(n * rate);
            waveform.harmonics().map(size).sum()
        });
        gravity + cogging
    }
}

/// A handle that a flexible shaft connects to the puck: the motor and the encoder are at the puck, the hand is at the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Handle {
    /// Of the handle beyond the shaft, in kg·m² (linear: kg), positive.
    pub inertia: f64,
    /// Of the shaft, in N·m/rad (linear: N/m), positive.
    pub stiffness: f64,
    /// Of the shaft, in N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
}

/// A hand on the puck, or on its handle, and its release.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hand {
    /// Its effect on the puck.
    pub drive: Drive,
    /// Time of the release in s, zero or more; `None`: the hand holds to the end.
    pub release: Option<f64>,
}

/// The effect of a hand on the puck.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Drive {
    /// `step`, `ramp`, `sine`, `path`: the position is prescribed, for any torque.
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
        /// A hand that alternately opens and closes; `None`: it stays closed.
        switching: Option<Switching>,
    },
}

/// A grip that alternately closes and opens, from t = 0 on. Open, it has no spring and no damper, and the energy of its spring is
/// lost; its inertia stays with the puck. It closes at the puck's position: its intended position is that one, plus the change of
/// `moves` from then on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Switching {
    /// Duration of a closed interval in s, positive.
    pub hold: f64,
    /// Duration of an open interval in s, positive.
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

impl Shape {
    /// A sine's frequency in Hz; `None` for the other shapes.
    pub fn frequency(&self) -> Option<f64> {
        if let Shape::Sine { frequency, .. } = *self { Some(frequency) } else { None }
    }
}
