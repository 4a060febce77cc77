//! The display units of a run's figures.

use hapt_model::Motion;

/// A unit's name, and its number per SI unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    pub name: &'static str,
    pub per_si: f64,
}

const fn unit(name: &'static str, per_si: f64) -> Unit {
    Unit { name, per_si }
}

pub(crate) const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// The unit for positions of up to this size in SI.
pub(crate) fn position(motion: Motion, size: f64) -> Unit {
    match motion {
        Motion::Rotary => unit("°", DEGREES),
        Motion::Linear if size < 1.0 => unit("mm", 1e3),
        Motion::Linear => unit("m", 1.0),
    }
}

pub(crate) fn velocity(motion: Motion, size: f64) -> Unit {
    match motion {
        Motion::Rotary => unit("°/s", DEGREES),
        Motion::Linear if size < 1.0 => unit("mm/s", 1e3),
        Motion::Linear => unit("m/s", 1.0),
    }
}

pub(crate) fn effort(motion: Motion, size: f64) -> Unit {
    match motion {
        Motion::Rotary if size < 10.0 => unit("N·mm", 1e3),
        Motion::Rotary => unit("N·m", 1.0),
        Motion::Linear => unit("N", 1.0),
    }
}

pub(crate) fn energy(size: f64) -> Unit {
    match size {
        size if size >= 1.0 => unit("J", 1.0),
        size if size >= 1e-3 => unit("mJ", 1e3),
        _ => unit("µJ", 1e6),
    }
}

pub(crate) fn time(size: f64) -> Unit {
    match size {
        size if size >= 1.0 => unit("s", 1.0),
        size if size >= 0.9995e-3 => unit("ms", 1e3),
        _ => unit("µs", 1e6),
    }
}

impl Unit {
    /// A value in SI, written in this unit.
    pub fn say(self, si: f64, digits: usize) -> String {
        format!("{} {}", crate::ticks::number(si * self.per_si, digits), self.name)
    }
}

/// A time in a suitable unit.
pub(crate) fn say_time(s: f64) -> String {
    time(if s == 0.0 { 1.0 } else { s.abs() }).say(s, 4)
}

/// An energy; below 10 fJ it is rounding.
pub(crate) fn say_energy(joule: f64) -> String {
    if joule.abs() < 1e-14 { "0 J".into() } else { energy(joule.abs()).say(joule, 4) }
}

pub(crate) fn say_effort(si: f64, motion: Motion) -> String {
    effort(motion, si.abs()).say(si, 6)
}

/// The name of a torque in this motion.
pub(crate) fn effort_name(motion: Motion) -> &'static str {
    match motion {
        Motion::Rotary => "torque",
        Motion::Linear => "force",
    }
}
