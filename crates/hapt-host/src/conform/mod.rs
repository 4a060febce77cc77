//! Tests whether a force-feedback wheel, with any driver, renders each effect as the standard means it.
//!
//! Only the wheel's position is measured. [`conform`] first identifies how a constant torque moves the wheel ([`Plant`]), and then plays each case
//! while the wheel swings. The torque that acted follows from the motion, in parts of the largest torque; the judge compares it with the
//! standard's meaning of the request, and where it differs, with the known errors of drivers ([`KnownError`]).

mod cases;
mod effect;
#[cfg(target_os = "linux")]
pub mod evdev;
mod judge;
mod meaning;
mod motion;
mod plant;
mod run;
#[cfg(test)]
mod tests;

pub use cases::{Case, Scale, cases};
pub use effect::{Condition, Envelope, Form, HostEffect, LEFT, Law, RIGHT, Wave};
pub use judge::{Finding, Judge, NEAR, Verdict};
pub use meaning::{KnownError, WheelMotion, torque};
pub use plant::Plant;
pub use run::{ConformError, Wheel};

use motion::Course;
use run::{Swing, probe};

/// The amplitudes of the wide and of the narrow swing, in parts of half the range.
const WIDE: f64 = 0.15;
const NARROW: f64 = 0.06;

/// The result for a wheel.
#[derive(Clone, Debug)]
pub struct Conformance {
    /// The wheel without effects.
    pub plant: Plant,
    /// Whether a positive level to the left turns the wheel to the right.
    pub inverted: bool,
    /// The findings, one for each case.
    pub findings: Vec<Finding>,
}

impl Conformance {
    /// Whether every case conforms to the standard.
    pub fn conforms(&self) -> bool {
        self.findings.iter().all(|finding| finding.verdict == Verdict::Conforms)
    }
}

/// Plays these cases while the wheel swings by torques of at most `most`; `report` is called with each finding.
///
/// # Errors
/// The wheel cannot be measured. Nothing plays then.
pub fn conform(
    wheel: &mut dyn Wheel,
    cases: Vec<Case>,
    most: f64,
    mut report: impl FnMut(&Finding),
) -> Result<Conformance, ConformError> {
    wheel.clear()?;
    let strength = probe(wheel, most)?;
    let rough = Swing { strength, most, amplitude: WIDE };
    rough.centre(wheel)?;
    let seen = rough.play(wheel, &Case { seconds: 5.0, ..Case::rest() })?;
    let course = Course::of(&seen.trace).ok_or(ConformError::NoPlant)?;
    let plant = Plant::fit(&course, |time| seen.push(time)).ok_or(ConformError::NoPlant)?;
    if plant.strength * strength <= 0.0 {
        return Err(ConformError::NoPlant);
    }
    let mut judge = Judge::new(plant);
    let mut findings = Vec::new();
    // A weak wheel swings less.
    let room = 0.4 * most * plant.strength.abs() / Swing::square();
    for case in cases {
        let amplitude = if case.wide { WIDE } else { NARROW }.min(room);
        let swing = Swing { strength: plant.strength, most, amplitude };
        let mut once = || {
            swing.centre(wheel)?;
            let seen = swing.play(wheel, &case)?;
            judge.judge(&case, &seen).ok_or(ConformError::NoPlant)
        };
        let mut finding = once()?;
        if finding.verdict != Verdict::Conforms {
            // An error of the wheel repeats, a disturbance by a busy computer does not.
            let again = once()?;
            let better = again.verdict == Verdict::Conforms || again.off < finding.off;
            finding = if better { again } else { finding };
        }
        report(&finding);
        findings.push(finding);
    }
    wheel.gain(1.0)?;
    Ok(Conformance { plant, inverted: plant.strength < 0.0, findings })
}
