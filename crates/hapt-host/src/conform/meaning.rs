//! The meaning of effects, by the standard ("Device Class Definition for Physical Interface Devices", version 1.0) and Linux's `linux/input.h`, and the
//! known errors of drivers.

use super::effect::{Condition, Envelope, Form, HostEffect, Law, Wave};

/// Below this velocity a friction's torque is not determined, in half ranges per second.
pub const SLOW: f64 = 0.02;

macro_rules! known_errors {
    ($($(#[$doc:meta])* $name:ident = $sentence:literal),* $(,)?) => {
        /// A known error in the rendering of an effect.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum KnownError { $($(#[$doc])* $name),* }

        impl KnownError {
            /// All of them.
            pub const ALL: &[KnownError] = &[$(KnownError::$name),*];

            /// In a sentence.
            pub fn sentence(self) -> &'static str {
                match self { $(KnownError::$name => $sentence),* }
            }
        }
    };
}

known_errors! {
    /// It counts as none.
    Infinite = "an effect without length ends at once",
    /// No torque at all.
    Nothing = "the effect gives no torque",
    /// Whatever the wave.
    Sine = "the wave is a sine (hid-pidff: PERIODIC_SINE_ONLY)",
    /// Up for down.
    Sawtooth = "a sawtooth runs the other way",
    /// The other way.
    Inverted = "the sign is inverted",
    /// As if it were only left or right.
    Direction = "the direction counts only as left or right",
    /// The device's gain.
    Gain = "the device's gain is ignored",
    /// Attack and fade.
    Envelope = "the envelope is ignored",
    /// It plays on.
    Length = "the effect plays beyond its length",
    /// At once.
    Delay = "the delay before the effect is ignored (hid-pidff: MISSING_DELAY)",
    /// Once.
    Count = "the effect plays once, however often it is asked to",
    /// As at its start.
    Update = "a change of an effect that plays is ignored",
    /// It plays on.
    Stop = "the effect plays on when it is stopped",
    /// Not their sum.
    Last = "of several effects only the last one acts",
    /// From the beginning of the wave.
    Phase = "the phase is ignored",
    /// About 0.
    Offset = "the offset of the wave is ignored",
    /// The level that it begins with.
    Ramp = "the ramp stays at the level that it begins with",
    /// In proportion to the velocity.
    FrictionAsDamper = "friction is rendered as a damper",
    /// Whatever the velocity.
    DamperAsFriction = "a damper is rendered as friction",
    /// From the velocity.
    InertiaAsDamper = "inertia is rendered as a damper",
    /// Its edges count as its middle.
    DeadBand = "the dead band is ignored",
    /// About the middle of the range.
    Center = "the centre of the condition is ignored",
    /// Up to the whole torque.
    Saturation = "the saturation is ignored",
    /// The right one on both sides.
    Left = "the coefficient of the left side is ignored",
    /// It replaces the first.
    SecondAxis = "the numbers of a second axis replace those of the wheel (hid-pidff: MISSING_PBO)",
}

/// A wheel's motion at an instant, in parts of half of the steering range and s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelMotion {
    /// To the right.
    pub position: f64,
    /// 1/s
    pub velocity: f64,
    /// 1/s²
    pub acceleration: f64,
}

/// Torques to the right, in parts of the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Torque {
    /// Whose scale the standard states.
    pub stated: f64,
    /// Of dampers, frictions and inertias, in the wheel's own scale.
    pub scaled: f64,
    /// The undetermined part of that: friction at rest has any torque up to its largest.
    pub slack: f64,
}

/// An action on an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// It starts, this many times in a row.
    Start(u32),
    /// It has other numbers.
    Change(HostEffect),
    /// It stops.
    Stop,
}

/// An effect with the actions on it, in the order of time.
#[derive(Clone, Debug)]
pub struct Played {
    /// Its initial numbers.
    pub requested: HostEffect,
    /// The times in s, and the actions.
    pub actions: Vec<(f64, Action)>,
}

impl Played {
    /// The time of its last start before `time`, the number of times that it plays, and its numbers then.
    fn at(&self, time: f64, error: Option<KnownError>) -> Option<(f64, u32, HostEffect)> {
        let (mut started, mut requested) = (None, self.requested);
        for (when, action) in self.actions.iter().take_while(|(when, _)| *when <= time) {
            match action {
                Action::Start(count) => started = Some((*when, *count)),
                Action::Change(next) if error != Some(KnownError::Update) || started.is_none() => requested = *next,
                Action::Stop if error != Some(KnownError::Stop) => started = None,
                Action::Change(_) | Action::Stop => {}
            }
        }
        started.map(|(since, count)| (since, count, requested))
    }

    /// Whether it has been started and not been stopped.
    pub fn plays(&self, time: f64, error: Option<KnownError>) -> bool {
        self.at(time, error).is_some()
    }

    /// The torque at `time`, under an error.
    fn torque(&self, time: f64, motion: &WheelMotion, error: Option<KnownError>) -> Option<Torque> {
        let (since, count, requested) = self.at(time, error)?;
        let delay = if error == Some(KnownError::Delay) { 0.0 } else { requested.delay };
        let count = if error == Some(KnownError::Count) { 1 } else { count };
        let time = time - since - delay;
        let time = match requested.length {
            None if error == Some(KnownError::Infinite) => return None,
            None => time,
            Some(_) if error == Some(KnownError::Length) => time,
            Some(length) if time < length * f64::from(count) => {
                time.max(-1.0) - length * (time / length).floor().max(0.0)
            }
            Some(_) => return None,
        };
        if time < 0.0 {
            return None;
        }
        if error == Some(KnownError::Nothing) {
            return Some(Torque::default());
        }
        Some(match requested.form {
            Form::Condition { law, axes } => condition(law, &axes, motion, error),
            Form::Constant { .. } | Form::Ramp { .. } | Form::Periodic { .. } => {
                let right = -(std::f64::consts::TAU * requested.direction).sin();
                let right = if error == Some(KnownError::Direction) && right != 0.0 { right.signum() } else { right };
                let right = if error == Some(KnownError::Inverted) { -right } else { right };
                Torque { stated: right * level(&requested, time, error), ..Torque::default() }
            }
        })
    }
}

/// The sum of effects, of which the last of the list is the last that was started.
pub fn torque(effects: &[Played], gain: f64, time: f64, motion: &WheelMotion, error: Option<KnownError>) -> Torque {
    let gain = if error == Some(KnownError::Gain) { 1.0 } else { gain };
    let mut sum = Torque::default();
    for effect in effects {
        let Some(one) = effect.torque(time, motion, error) else { continue };
        if error == Some(KnownError::Last) {
            sum = Torque::default();
        }
        sum.stated += gain * one.stated;
        sum.scaled += gain * one.scaled;
        sum.slack += gain * one.slack;
    }
    sum.stated = sum.stated.clamp(-1.0, 1.0);
    sum
}

fn level(requested: &HostEffect, time: f64, error: Option<KnownError>) -> f64 {
    match requested.form {
        Form::Constant { level, envelope } => enveloped(level, &envelope, requested.length, time, error),
        Form::Ramp { from, .. } if error == Some(KnownError::Ramp) => from,
        Form::Ramp { from, to } => {
            requested.length.map_or(from, |length| from + (to - from) * (time / length).min(1.0))
        }
        Form::Periodic { wave, magnitude, offset, phase, period } => {
            let phase = if error == Some(KnownError::Phase) { 0.0 } else { phase };
            let offset = if error == Some(KnownError::Offset) { 0.0 } else { offset };
            offset + magnitude * waved(wave, (time / period + phase).rem_euclid(1.0), error)
        }
        Form::Condition { .. } => 0.0,
    }
}

fn enveloped(level: f64, envelope: &Envelope, length: Option<f64>, time: f64, error: Option<KnownError>) -> f64 {
    if error == Some(KnownError::Envelope) {
        return level;
    }
    let between = |edge: f64, share: f64| level.signum() * edge + (level - level.signum() * edge) * share;
    if time < envelope.attack {
        return between(envelope.attack_level, time / envelope.attack);
    }
    match length {
        Some(length) if envelope.fade > 0.0 && length - time < envelope.fade => {
            between(envelope.fade_level, (length - time).max(0.0) / envelope.fade)
        }
        _ => level,
    }
}

fn waved(wave: Wave, turn: f64, error: Option<KnownError>) -> f64 {
    if error == Some(KnownError::Sine) {
        return (std::f64::consts::TAU * turn).sin();
    }
    let reversed = error == Some(KnownError::Sawtooth);
    match wave {
        Wave::Square => {
            if turn < 0.5 {
                1.0
            } else {
                -1.0
            }
        }
        Wave::Triangle => 1.0 - 4.0 * ((turn + 0.25).rem_euclid(1.0) - 0.5).abs(),
        Wave::Sine => (std::f64::consts::TAU * turn).sin(),
        Wave::SawUp if !reversed => 2.0 * turn - 1.0,
        Wave::SawDown if reversed => 2.0 * turn - 1.0,
        Wave::SawUp | Wave::SawDown => 1.0 - 2.0 * turn,
    }
}

fn condition(law: Law, axes: &[Condition; 2], motion: &WheelMotion, error: Option<KnownError>) -> Torque {
    let [first, second] = axes;
    let numbers = if error == Some(KnownError::SecondAxis) { second } else { first };
    let rests = motion.velocity.abs() < SLOW;
    let sign = if rests { 0.0 } else { motion.velocity.signum() };
    let (x, scaled) = match law {
        Law::Spring => (motion.position, false),
        Law::Damper if error == Some(KnownError::DamperAsFriction) => (sign, true),
        Law::Damper => (motion.velocity, true),
        Law::Friction if error == Some(KnownError::FrictionAsDamper) => (motion.velocity, true),
        Law::Friction => (sign, true),
        Law::Inertia if error == Some(KnownError::InertiaAsDamper) => (motion.velocity, true),
        Law::Inertia => (motion.acceleration, true),
    };
    let center = if error == Some(KnownError::Center) { 0.0 } else { numbers.center };
    let band = if error == Some(KnownError::DeadBand) { 0.0 } else { numbers.dead_band };
    let beyond = (x - center) - (x - center).clamp(-band, band);
    let (coefficient, most) = match beyond > 0.0 {
        true => (numbers.right, numbers.right_most),
        false if error == Some(KnownError::Left) => (numbers.right, numbers.left_most),
        false => (numbers.left, numbers.left_most),
    };
    let most = if error == Some(KnownError::Saturation) { 1.0 } else { most };
    let resisting = coefficient * beyond;
    // In an unknown scale the saturation is unknown too.
    let resisting = if scaled { resisting } else { resisting.clamp(-most, most) };
    let torque = if error == Some(KnownError::Inverted) { resisting } else { -resisting };
    let dry = match law {
        Law::Damper => error == Some(KnownError::DamperAsFriction),
        Law::Friction => error != Some(KnownError::FrictionAsDamper),
        Law::Spring | Law::Inertia => false,
    };
    let slack = if dry && rests { numbers.right.max(numbers.left) } else { 0.0 };
    if scaled {
        Torque { scaled: torque, slack, ..Torque::default() }
    } else {
        Torque { stated: torque, ..Torque::default() }
    }
}
