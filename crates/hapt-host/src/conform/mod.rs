//! Whether a force-feedback wheel does what the standard means by each effect, whoever made it and its driver.
//!
//! The wheel shows its position and nothing else. [`conform`] first finds how a constant torque moves it ([`Plant`]), and then plays each case
//! while it swings. What acted on the wheel follows from its motion, in shares of its largest torque; the judge compares it with the meaning of
//! what was asked, and where it differs, with what drivers are known to make of it ([`KnownError`]).

mod asked;
mod cases;
#[cfg(target_os = "linux")]
pub mod evdev;
mod judge;
mod meaning;
mod motion;
mod plant;
mod run;
#[cfg(test)]
mod tests;

pub use asked::{Asked, Condition, Envelope, Form, LEFT, Law, RIGHT, Wave};
pub use cases::{Case, Scale, cases};
pub use judge::{Finding, Judge, NEAR, Verdict};
pub use meaning::{KnownError, WheelMotion, torque};
pub use plant::Plant;
pub use run::{ConformError, Wheel};

use motion::Course;
use run::{Swing, probe};

/// The wide swing, in shares of half the range, and the narrow one.
const WIDE: f64 = 0.15;
const NARROW: f64 = 0.06;

/// What is found of a wheel.
#[derive(Clone, Debug)]
pub struct Conformance {
    /// The wheel without effects.
    pub plant: Plant,
    /// A positive level to the left turns it to the right.
    pub inverted: bool,
    /// Each case.
    pub findings: Vec<Finding>,
}

impl Conformance {
    /// Whether every case does what the standard means.
    pub fn conforms(&self) -> bool {
        self.findings.iter().all(|finding| finding.verdict == Verdict::Conforms)
    }
}

/// Plays these cases, and makes the wheel swing with torques of at most `most`; `tell` hears of each.
///
/// # Errors
/// The wheel cannot be measured. Nothing plays then.
pub fn conform(
    wheel: &mut dyn Wheel,
    cases: Vec<Case>,
    most: f64,
    mut tell: impl FnMut(&Finding),
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
            // What is wrong is wrong each time; what a busy computer has disturbed is not.
            let again = once()?;
            let better = again.verdict == Verdict::Conforms || again.off < finding.off;
            finding = if better { again } else { finding };
        }
        tell(&finding);
        findings.push(finding);
    }
    wheel.gain(1.0)?;
    Ok(Conformance { plant, inverted: plant.strength < 0.0, findings })
}
