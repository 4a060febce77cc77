//! Specification of a wheel on a spring, section 2.1 of the notes.

use std::f64::consts::TAU;

use hapt_model::{Dimension, Source, World, parse_positive};
use serde::Serialize;

use crate::error::{Error, positive};
use crate::text::number;

/// A virtual wheel on a torsional spring with a given torque at a given step of the puck.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Design {
    /// k in N·m/rad: the torque at full travel, (2.4) at t = 0.
    pub stiffness: f64,
    /// J_w in kg·m²: k/ω², by (2.1).
    pub inertia: f64,
    /// b in N·m·s/rad: T k, which cancels the growth of forward Euler, (2.24).
    pub compensating_damping: f64,
    /// ω/2π.
    pub natural_frequency_hz: f64,
    /// N·m: k z0, for one step from rest. Stepping back half a period later takes twice as much.
    pub peak_torque: f64,
}

impl Design {
    /// From the travel in rad (linear: m), the torque in N·m (N), the frequency in Hz and the period in s, all positive.
    ///
    /// ```
    /// use hapt_analysis::Design;
    ///
    /// // 45 degrees and 800 N mm at 1 Hz, 1 ms: the wheel of the notes (section 2.1).
    /// let wheel = Design::new(std::f64::consts::FRAC_PI_4, 0.8, 1.0, 1e-3)?;
    /// assert!((wheel.stiffness - 1.018592).abs() < 1e-6);
    /// assert!((wheel.inertia - 0.02580123).abs() < 1e-8);
    /// # Ok::<(), hapt_analysis::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Value`] when one is not a finite number above 0, or takes a result out of double precision.
    pub fn new(travel: f64, torque: f64, frequency_hz: f64, period: f64) -> Result<Self, Error> {
        positive("the travel", travel)?;
        positive("the torque", torque)?;
        positive("the frequency", frequency_hz)?;
        positive("the period", period)?;
        let stiffness = positive("the stiffness, torque/travel,", torque / travel)?;
        let omega = TAU * frequency_hz;
        Ok(Design {
            stiffness,
            inertia: positive("the inertia, stiffness/(2π frequency)²,", stiffness / (omega * omega))?,
            compensating_damping: positive("the damping, period · stiffness,", period * stiffness)?,
            natural_frequency_hz: frequency_hz,
            peak_torque: torque,
        })
    }
}

/// A specification as it is typed: positive quantities with units, or numbers in SI.
#[derive(Clone, Copy, Debug)]
pub struct Specification<'a> {
    /// The angle at which the spring has the torque.
    pub travel: &'a str,
    /// That torque.
    pub torque: &'a str,
    /// The natural frequency.
    pub frequency: &'a str,
    /// The loop's period.
    pub period: &'a str,
}

/// The wheel of a [`Specification`].
#[derive(Clone, Debug, PartialEq)]
pub struct Wheel {
    /// Its numbers.
    pub design: Design,
    /// Its world file: forward Euler with the compensating damper, on the device of the notes, with a step of the travel.
    pub file: String,
    /// What the numbers do not keep.
    pub note: Option<&'static str>,
}

impl Specification<'_> {
    /// The wheel. In messages the names of the quantities follow `prefix`, such as `--` on a command line.
    ///
    /// ```
    /// use hapt_analysis::design::Specification;
    ///
    /// let notes = Specification { travel: "45 deg", torque: "800 N mm", frequency: "1 Hz", period: "1 ms" };
    /// assert!((notes.wheel("")?.design.inertia - 0.02580123).abs() < 1e-8);
    /// assert_eq!(Specification { travel: "0", ..notes }.wheel("--"), Err("--travel: \"0\" must be positive".into()));
    /// # Ok::<(), String>(())
    /// ```
    ///
    /// # Errors
    /// A sentence about a quantity that is not positive, or of another dimension; about numbers beyond double precision, or a world that
    /// hapt does not read.
    pub fn wheel(&self, prefix: &str) -> Result<Wheel, String> {
        let read = |name: &str, text: &str, dimension: Dimension| {
            parse_positive(text, dimension).map_err(|error| format!("{prefix}{name}: {error}"))
        };
        let travel = read("travel", self.travel, Dimension::ANGLE)?;
        let torque = read("torque", self.torque, Dimension::TORQUE)?;
        let frequency = read("frequency", self.frequency, Dimension::FREQUENCY)?;
        let period = read("period", self.period, Dimension::TIME)?;
        let design = Design::new(travel, torque, frequency, period).map_err(|error| error.to_string())?;
        let file = self.world_file(&design, travel, period);
        // A number may leave the physical range only here, where it is computed.
        World::read(&Source::from_text("the world", file.as_str()), &[]).map_err(|refused| {
            format!("these numbers make no world that hapt reads: {}: {}", refused.key, refused.message)
        })?;
        let note = (TAU * frequency * period >= 2.0)
            .then_some("at this period the damper b = Tk no longer balances forward Euler (it does for ωT < 2)");
        Ok(Wheel { design, file, note })
    }

    fn world_file(&self, design: &Design, travel: f64, period: f64) -> String {
        let degree = std::f64::consts::PI / 180.0;
        let travel = given(self.travel, travel, "rad");
        format!(
            r#"# {travel} and {torque} at {frequency}: the notes' specification, sections 2.1 to 2.4.
#
#   k   = torque/travel  = {k_mm} N mm/deg
#   J_w = k/(2π f)²      = {j_mm} N mm/(deg/s^2)
#   b   = T k            = {b} N m s/rad, which undoes forward Euler's growth
title = "Virtual wheel on a torsional spring"

[loop]
period = "{period}"
method = "forward-euler"
output = "start"                        # the torque from x_k, as the notes' diagrams have it

[device]                                # University of Michigan haptic wheel
inertia  = "6.4e-4 kg m^2"
damping  = "1.2e-3 N m s/rad"
limit    = "822.25 N mm"
encoder  = 4000                         # rounds the travel to a count of 0.09 deg

[bodies.wheel]
inertia = "{j} kg m^2"

[[couplings]]
kind      = "spring"
between   = ["puck", "wheel"]
stiffness = "{k} N m/rad"

[[couplings]]
kind    = "damper"
between = ["puck", "wheel"]
damping = "compensating"                # b = T k, at whatever period

[scenarios.step]
duration = "10 s"
hand     = {{ kind = "step", to = "{travel}" }}
"#,
            torque = given(self.torque, design.peak_torque, "N m"),
            frequency = given(self.frequency, design.natural_frequency_hz, "Hz"),
            period = given(self.period, period, "s"),
            k_mm = number(design.stiffness * 1e3 * degree),
            j_mm = number(design.inertia * 1e3 * degree),
            b = number(design.compensating_damping),
            j = design.inertia,
            k = design.stiffness,
        )
    }
}

/// The quantity as it was typed; a bare number gets its SI unit.
fn given(text: &str, value: f64, unit: &str) -> String {
    if text.trim().parse::<f64>().is_ok() { format!("{value} {unit}") } else { text.trim().into() }
}
