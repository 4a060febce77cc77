//! Specification of a wheel on a spring, section 2.1 of the notes.

use std::f64::consts::TAU;

use serde::Serialize;

use crate::error::{Error, positive};

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
