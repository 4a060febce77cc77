//! The numbers of a device that are fitted, and the motion that they make.

use std::f64::consts::TAU;

use hapt_model::Waveform;
use hapt_plant::spec::{DeviceSpec, Stops};

use super::field::{HARMONICS, Wave, Waves};
use super::motion::Numbers;

/// ln J, or ln of the motor's gain where the inertia is known; b, f, a constant torque; d + λ and λ²; Stribeck's torque and ln of its
/// velocity; the places of both stops, ln k and c of both; the stiffness of a spring to ground; the torques of gravity by sin z and cos z;
/// those of cogging by sin nθ and cos nθ; the changes of friction by the same, as parts of it.
pub(crate) const PARAMETERS: usize = CHANGES + 2 * HARMONICS;
pub(crate) type Parameters = [f64; PARAMETERS];
pub(crate) type Free = [bool; PARAMETERS];

pub(crate) const INERTIA: usize = 0;
pub(crate) const DAMPING: usize = 1;
pub(crate) const FRICTION: usize = 2;
pub(crate) const OFFSET: usize = 3;
pub(crate) const LATE: usize = 4;
pub(crate) const VARIANCE: usize = 5;
pub(crate) const RISE: usize = 6;
pub(crate) const FAST: usize = 7;
pub(crate) const STOPS: [usize; 2] = [8, 9];
pub(crate) const STIFFNESS: usize = 10;
pub(crate) const STOP_DAMPING: usize = 11;
pub(crate) const SPRING: usize = 12;
pub(crate) const GRAVITY: usize = 13;
pub(crate) const COGGING: usize = 15;
pub(crate) const CHANGES: usize = COGGING + 2 * HARMONICS;

/// A device with these numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Device {
    pub p: Parameters,
    pub sign: f64,
    /// J, where it is known.
    pub inertia: Option<f64>,
    pub places: Places,
}

/// The numbers of its torques of the position that are not fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Places {
    /// Where a spring is relaxed; elsewhere its torque there is part of the constant one.
    pub middle: f64,
    /// Rate and phase of cogging and of the changes of friction, see [`Wave`].
    pub cogging: [f64; 2],
    pub changes: [f64; 2],
    /// Half of the difference between the frictions toward smaller positions and toward larger ones.
    pub lean: f64,
    /// Whether the constant torque is such a difference, and no other torque.
    pub offset_is_friction: bool,
    /// Whether its motion is followed in short pieces.
    pub finely: bool,
}

impl Device {
    /// The device of a specification, with a motor of sign 1.
    pub fn of_spec(spec: &DeviceSpec) -> Self {
        let DeviceSpec { inertia, damping, friction, lag, delay, .. } = *spec;
        let backward = spec.friction_backward.unwrap_or(friction);
        let (stribeck, stops) = (spec.stribeck, spec.stops);
        let stop = |of: &dyn Fn(&Stops) -> f64| stops.as_ref().map_or(0.0, of);
        let mut p = [0.0; PARAMETERS];
        let first = [
            inertia.ln(),
            damping,
            0.5 * (friction + backward),
            0.5 * (backward - friction),
            delay + lag,
            lag * lag,
            stribeck.map_or(0.0, |stribeck| stribeck.torque),
            stribeck.map_or(0.0, |stribeck| stribeck.velocity.ln()),
            stops.and_then(|stops| stops.low).unwrap_or(f64::NEG_INFINITY),
            stops.and_then(|stops| stops.high).unwrap_or(f64::INFINITY),
            stop(&|stops| stops.stiffness.ln()),
            stop(&|stops| stops.damping),
        ];
        p[..first.len()].copy_from_slice(&first);
        let mut places = Places { lean: p[OFFSET], ..Places::default() };
        if let Some(gravity) = spec.torque.gravity {
            (p[GRAVITY], p[GRAVITY + 1]) = (gravity.torque * gravity.phase.cos(), gravity.torque * gravity.phase.sin());
        }
        let mut wave = |at: usize, size: f64, pitch: f64, phase: f64, parts: &[[f64; 2]; HARMONICS]| {
            parts.as_flattened().iter().enumerate().for_each(|(i, part)| p[at + i] = size * part);
            [TAU / pitch, phase]
        };
        if let Some(cogging) = spec.torque.cogging {
            places.cogging = wave(COGGING, cogging.torque, cogging.pitch, cogging.phase, &parts(&cogging.waveform));
        }
        if let Some(changes) = spec.friction_by_position {
            places.changes = wave(CHANGES, changes.share, changes.pitch, changes.phase, &parts(&changes.waveform));
        }
        Device { p, sign: 1.0, inertia: None, places }
    }

    /// The same device with the gravity, cogging and changes of friction of another, each where that one has it; `None`: neither has any
    /// torque of the position.
    pub fn with_waves_of(&self, other: &Device) -> Option<Device> {
        let mut device = *self;
        for wave in [GRAVITY..COGGING, COGGING..CHANGES, CHANGES..PARAMETERS] {
            if other.p[wave.clone()].iter().any(|x| *x != 0.0) {
                device.p[wave.clone()].copy_from_slice(&other.p[wave.clone()]);
                match wave.start {
                    COGGING => device.places.cogging = other.places.cogging,
                    CHANGES => device.places.changes = other.places.changes,
                    _ => {}
                }
            }
        }
        device.places.lean = other.places.lean;
        device.p[SPRING..].iter().any(|x| *x != 0.0).then_some(device)
    }

    /// Sine and cosine of each harmonic of gravity, in N·m.
    pub fn gravity(&self) -> [[f64; 2]; HARMONICS] {
        std::array::from_fn(|n| if n == 0 { [self.p[GRAVITY], self.p[GRAVITY + 1]] } else { [0.0; 2] })
    }

    /// The same of cogging, in N·m (N).
    pub fn cogging(&self) -> [[f64; 2]; HARMONICS] {
        self.wave(COGGING)
    }

    /// The same of friction's changes, as parts of it.
    pub fn changes(&self) -> [[f64; 2]; HARMONICS] {
        self.wave(CHANGES)
    }

    fn wave(&self, at: usize) -> [[f64; 2]; HARMONICS] {
        std::array::from_fn(|n| [self.p[at + 2 * n], self.p[at + 2 * n + 1]])
    }

    pub fn inertia(&self) -> f64 {
        self.inertia.unwrap_or(self.p[INERTIA].exp())
    }

    /// The motor's torque per commanded one.
    pub fn gain(&self) -> f64 {
        self.inertia.map_or(1.0, |_| self.p[INERTIA].exp())
    }

    /// The numbers of a motion with this initial state.
    pub fn numbers(&self, [position, velocity]: [f64; 2]) -> Numbers {
        let p = &self.p;
        let per = self.inertia().recip();
        let lag = p[VARIANCE].max(0.0).sqrt();
        let wave = |parts: [[f64; 2]; HARMONICS], [rate, phase]: [f64; 2], factor: f64| {
            Wave::new(rate, phase, parts.map(|part| part.map(|x| factor * x)))
        };
        let places = &self.places;
        Numbers {
            gain: self.sign * self.gain() * per,
            damping: p[DAMPING] * per,
            friction: p[FRICTION] * per,
            offset: p[OFFSET] * per,
            delay: p[LATE] - lag,
            lag,
            rise: p[RISE] * per,
            fast: p[FAST].exp(),
            stops: STOPS.map(|i| p[i]),
            stiffness: p[STIFFNESS].exp() * per,
            stop_damping: p[STOP_DAMPING] * per,
            waves: Waves {
                spring: p[SPRING] * per,
                middle: places.middle,
                gravity: [p[GRAVITY] * per, p[GRAVITY + 1] * per],
                cogging: wave(self.cogging(), places.cogging, per),
                changes: wave(self.changes(), places.changes, 1.0),
                lean: if places.offset_is_friction { p[OFFSET] * per } else { places.lean * per },
            },
            finely: places.finely,
            position,
            velocity,
        }
    }
}

/// Sine and cosine of each harmonic.
pub(crate) fn parts(waveform: &Waveform) -> [[f64; 2]; HARMONICS] {
    let mut parts = [[0.0; 2]; HARMONICS];
    parts.iter_mut().zip(waveform.harmonics()).for_each(|(part, (_, sine, cosine))| *part = [sine, cosine]);
    parts
}
