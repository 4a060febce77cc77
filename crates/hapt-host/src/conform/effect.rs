//! The requests of a host to a wheel: the effects of Linux's force feedback, with parts of full scale in place of its integers.

/// The form of a periodic effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wave {
    /// Begins at its highest.
    Square,
    /// Begins at its middle and rises.
    Triangle,
    /// Begins at its middle and rises.
    Sine,
    /// Begins at its lowest.
    SawUp,
    /// Begins at its highest.
    SawDown,
}

/// How an effect's level begins and ends; times in s, levels in shares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Envelope {
    /// The length of the attack, from the start.
    pub attack: f64,
    /// The magnitude at its start.
    pub attack_level: f64,
    /// The length of the fade, before the end.
    pub fade: f64,
    /// The magnitude at its end.
    pub fade_level: f64,
}

/// The quantity that a condition resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// The position, in shares of half of the steering range.
    Spring,
    /// The velocity. The standard leaves its full scale to the wheel.
    Damper,
    /// The direction of the motion.
    Friction,
    /// The acceleration. The standard leaves its full scale to the wheel.
    Inertia,
}

/// The numbers of a condition on one axis, shares of full scale.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Condition {
    /// The coefficient to the right of the dead band.
    pub right: f64,
    /// And to its left.
    pub left: f64,
    /// The largest torque to the right of it.
    pub right_most: f64,
    /// And to its left.
    pub left_most: f64,
    /// The middle of the dead band.
    pub center: f64,
    /// Half of its width.
    pub dead_band: f64,
}

impl Condition {
    /// The same on both sides, with the whole torque.
    pub fn even(coefficient: f64) -> Self {
        Condition { right: coefficient, left: coefficient, right_most: 1.0, left_most: 1.0, ..Condition::default() }
    }
}

/// The kind of an effect, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// The same torque all the time.
    Constant {
        /// -1 to 1.
        level: f64,
        /// Over its length.
        envelope: Envelope,
    },
    /// Straight from one level to another over its length.
    Ramp {
        /// At its start.
        from: f64,
        /// At its end.
        to: f64,
    },
    /// A wave about an offset.
    Periodic {
        /// Its form.
        wave: Wave,
        /// 0 to 1.
        magnitude: f64,
        /// The middle of the wave.
        offset: f64,
        /// The phase at the start, in turns.
        phase: f64,
        /// s
        period: f64,
    },
    /// A law of the motion.
    Condition {
        /// Which one.
        law: Law,
        /// The numbers of two axes; a wheel has the first.
        axes: [Condition; 2],
    },
}

/// An effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostEffect {
    /// Its kind.
    pub form: Form,
    /// In turns: 0.25 is left, 0.75 is right.
    pub direction: f64,
    /// s; `None`: until it is stopped.
    pub length: Option<f64>,
    /// From its start to its torque, in s.
    pub delay: f64,
}

/// To the left, in turns.
pub const LEFT: f64 = 0.25;
/// To the right.
pub const RIGHT: f64 = 0.75;

impl HostEffect {
    /// A constant torque without end.
    pub fn constant(level: f64, direction: f64) -> Self {
        let form = Form::Constant { level, envelope: Envelope::default() };
        HostEffect { form, direction, length: None, delay: 0.0 }
    }

    /// A condition with the same numbers on both axes.
    pub fn condition(law: Law, condition: Condition) -> Self {
        HostEffect { form: Form::Condition { law, axes: [condition; 2] }, direction: 0.0, length: None, delay: 0.0 }
    }
}
