//! The limits of a supervisor, as plain data in SI.

use crate::{Error, Spec};

crate::named! {
    /// The supervisor's profile for a device and a world.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum SafetyProfile {
        /// A real device, its world certified: stable and passive.
        Certified => "certified",
        /// A real device, the world not certified: the energy ledgers are armed tighter.
        Uncertified => "uncertified",
        /// The simulated device: no risk of injury.
        Simulated => "simulated",
    }
}

crate::named! {
    /// The reaction of the supervisor to a sample or a command later than the certificate covers. The codes are used on wires, and never
    /// change their meaning.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[repr(u8)]
    pub enum WhenLate {
        /// A fault: no torque from that sample on.
        Fault = 0 => "fault",
        /// The torque fades out, and stays off until it is armed again.
        Fade = 1 => "fade",
        /// A count and a warning.
        Count = 2 => "count",
    }
}

/// The times that a certificate covers, and what happens where they are not kept.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CertifiedTime {
    /// The longest time between two samples, in s; infinite where none is stated.
    pub interval: f64,
    /// The longest time from a sample to its command, in s; infinite where none is stated.
    pub delay: f64,
    /// The reaction beyond them.
    pub when_late: WhenLate,
}

impl CertifiedTime {
    /// No time is stated, and none enforced.
    pub const NOT_STATED: Self =
        CertifiedTime { interval: f64::INFINITY, delay: f64::INFINITY, when_late: WhenLate::Count };

    /// Whether it bounds anything.
    pub fn is_stated(&self) -> bool {
        self.interval.is_finite() || self.delay.is_finite()
    }
}

impl Default for CertifiedTime {
    fn default() -> Self {
        Self::NOT_STATED
    }
}

/// The limits of a supervisor and the parameters of the device. An infinite limit disables the check.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Duration of a fade, in s.
    pub fade: f64,
    /// The largest speed that the device can reach, in rad/s (linear: m/s).
    pub velocity: f64,
    /// The largest change of the displacement from one sample to the next, in rad (m).
    pub jump: f64,
    /// The largest speed with the motor on, in rad/s (m/s).
    pub overspeed: f64,
    /// The longest time that the position may stand still under more than `stuck_torque`, added up, in s.
    pub stuck: f64,
    /// Torque above which the puck should move, in N·m (N).
    pub stuck_torque: f64,
    /// The largest command, in N·m (N).
    pub torque: f64,
    /// The largest change of torque from one sample to the next, in N·m (N).
    pub slew: f64,
    /// Thermal limit of the motor.
    pub motor: Heat,
    /// Thermal limit of the driver.
    pub driver: Heat,
    /// The longest time that the motor may hold a torque beyond its period, in s; more is a fault, independently of the certificate.
    pub stall: f64,
    /// The times that the certificate covers. Not serialized: a board gets them after the other limits.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub time: CertifiedTime,
    /// Time from the last heartbeat to torque 0, in s, the fade included.
    pub link: f64,
    /// Whether a lost link is a fault; else the torque fades out.
    pub link_faults: bool,
    /// The most energy that the hand may receive beyond the stored energy, and that the method may generate, in J.
    pub energy: f64,
    /// Whether the world's own ledger trips; else it warns.
    pub world_trips: bool,
    /// Whether the ledger at the port trips; else it warns.
    pub port_trips: bool,
    /// The torque of the sign test's pulse in N·m (N), at most the motor's limit; 0: no test.
    pub pulse: f64,
    /// Damping after a fault that leaves the encoder trusted, in N·m·s/rad (N·s/m); 0: none.
    pub brake: f64,
    /// For how long the puck rests before the world's origin slips to where its torque is 0, and the time constant of the slip, in s; at least
    /// two periods, 0: never. Not serialized: a board gets it after the other limits.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub recentre: f64,
    /// Whether arming sets the position to 0.
    pub zero_where_armed: bool,
    /// Whether announced jumps are accepted: those of a simulated hand.
    pub announcements: bool,
    /// The puck's inertia in kg·m² (kg), positive.
    pub inertia: f64,
    /// Its viscous damping in N·m·s/rad (N·s/m).
    pub damping: f64,
    /// Its Coulomb friction in N·m (N).
    pub friction: f64,
    /// From the sample to the motor's torque, in s.
    pub delay: f64,
}

/// A first-order thermal model: the heating is proportional to the square of the torque.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Heat {
    /// The torque that may be held for ever, in N·m (N).
    pub rms: f64,
    /// The time constant in s.
    pub time: f64,
}

impl Limits {
    /// How long the heartbeat may be absent, in s, before the torque goes: [`Limits::link`] less the fade, the sample that detects it, and
    /// the delay. A lost link that is a fault takes no fade, unless it brakes.
    pub fn silence(&self, period: f64) -> f64 {
        let fade = if self.link_faults && self.brake <= 0.0 { 0.0 } else { self.fade };
        self.link - (fade + period + self.delay)
    }

    /// Errors on a number that no limit can have, naming it.
    pub(crate) fn check(&self, spec: &Spec) -> Result<(), Error> {
        Error::check_positive("period", spec.period)?;
        Error::check_positive("fade", self.fade)?;
        Error::check_positive("inertia", self.inertia)?;
        for (what, given) in [
            ("velocity", self.velocity),
            ("jump", self.jump),
            ("overspeed", self.overspeed),
            ("stuck", self.stuck),
            ("torque", self.torque),
            ("slew", self.slew),
            ("rms", self.motor.rms),
            ("heating", self.motor.time),
            ("driver_rms", self.driver.rms),
            ("driver_heating", self.driver.time),
            ("stall", self.stall),
            ("link", self.link),
            ("energy", self.energy),
        ] {
            let right = given > 0.0;
            if !right {
                return Err(Error::Value { what, given, wanted: "positive, or infinite for none" });
            }
        }
        let (interval, delay) = (self.time.interval, self.time.delay);
        // An interval rounded to the period is one.
        let is_period_or_longer = interval >= spec.period * (1.0 - 1e-6);
        if !is_period_or_longer {
            let wanted = "the period or longer: samples come once a period";
            return Err(Error::Value { what: "interval_max", given: interval, wanted });
        }
        let is_delay = delay >= 0.0;
        if !is_delay {
            return Err(Error::Value { what: "delay_max", given: delay, wanted: "zero or more" });
        }
        if self.silence(spec.period) <= 0.0 {
            let wanted = "longer than the fade, a period and the delay together: the torque is 0 by then";
            return Err(Error::Value { what: "link", given: self.link, wanted });
        }
        if self.recentre > 0.0 && self.recentre < 2.0 * spec.period {
            let wanted = "two periods or longer: the origin slips in many samples";
            return Err(Error::Value { what: "recentre", given: self.recentre, wanted });
        }
        for (what, given) in [
            ("stuck_torque", self.stuck_torque),
            ("pulse", self.pulse),
            ("brake", self.brake),
            ("recentre", self.recentre),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay", self.delay),
        ] {
            if !(given >= 0.0 && given.is_finite()) {
                return Err(Error::Value { what, given, wanted: "zero or more" });
            }
        }
        Ok(())
    }
}
