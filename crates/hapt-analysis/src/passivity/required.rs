//! How much damping the device needs so that the loop is passive against every passive hand.
//!
//! The linear loop is passive exactly when G(z) = b/T + H/(z - 1) is positive real (Colgate and Schenkel 1997), H from the
//! sampled position to the torque that resists the hand: poles outside the circle never pass, one on it must be simple with a
//! residue ρ = R/p that is real and not negative, and all around the circle b is no less than the curve of `curve`. That nothing grows
//! is read from the held world, before anything is left out for a small residue. A pole on
//! the circle is what a lossless world has; it is taken out by its residue before the largest value is looked for, because no
//! grid of frequencies sees it.
//!
//! Steps ahead pay for whole samples of delay. In a lossless world at the end of a step each pole λ has a residue ρ ≥ 0, and d
//! steps ahead with d samples of delay make of it ρ wᵈ w/(1 - w), w = λ/z, |w| = 1. Since
//! wᵈ⁺¹/(1 - w) = w/(1 - w) - w - ... - wᵈ and Re w/(1 - w) = -1/2, the curve is
//!
//! ```text
//! m = T Ks (1/2 + Σ cos iφ) + Σ T ρ (1/2 + Σ cos i(φ - arg λ)),  i = 1..d,    Ks + Σ ρ = K
//! ```
//!
//! which is nowhere above K T (1/2 + d).

use hapt_model::{Coupling, Sampling, World};

use crate::equations::continuous::Slopes;
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::laws::{self, Kind, most};
use crate::error::Error;
use crate::impedance::{Impedance, Pole, Rule};
use crate::passivity::curve::Curve;
use crate::passivity::supremum::supremum;
use crate::stability::held::{held_eigenvalues, held_growth};
use crate::stability::{MARGINAL, Verdict};

/// A residue counts as real when its imaginary part is below this, relatively.
const REAL: f64 = 1e-9;

/// Why no finite damping will do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// The puck's torque has a mode that grows by itself.
    Grows {
        /// Of the mode.
        hz: f64,
    },
    /// The world grows by itself while the puck is held, in a motion that the puck's torque hardly shows.
    Unseen {
        /// Of the motion.
        hz: f64,
    },
    /// A mode that nothing damps answers the hand out of step.
    OutOfStep {
        /// Of the mode.
        hz: f64,
    },
    /// A mode that nothing damps, under a delay with a fraction of a sample.
    Fraction {
        /// Of the mode.
        hz: f64,
    },
    /// Coulomb friction at the puck.
    Coulomb,
}

impl Cause {
    /// Where in frequency, when that is a point.
    fn at_hz(self) -> Option<f64> {
        match self {
            Cause::OutOfStep { hz } | Cause::Fraction { hz } => Some(hz),
            Cause::Grows { .. } | Cause::Unseen { .. } | Cause::Coulomb => None,
        }
    }
}

/// What a loop asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Need {
    pub damping: Result<f64, Cause>,
    pub at_hz: Option<f64>,
}

/// The port of `couplings`, nonlinear ones on the given slopes.
fn port(world: &World, couplings: &[Coupling], slopes: &Slopes) -> Result<Impedance, Error> {
    let Sampling { method, output, advance, period, .. } = world.sampling;
    Impedance::new(&world.bodies, couplings, slopes, Rule { method, output, advance, period })
}

/// What the linear loop of `couplings` asks for, nonlinear ones on their steepest rises.
pub(crate) fn need(world: &World, couplings: &[Coupling]) -> Result<Need, Error> {
    let period = world.sampling.period;
    let port = port(world, couplings, &Slopes::Steep)?;
    let lag = Delay::of_loop(&world.sampling)?;
    let mut worst: Option<Need> = None;
    for filter in Filter::of(&world.sampling, period) {
        let need = of_filter(&port, &filter, lag, period)?;
        let more = |old: &Need| match (need.damping, old.damping) {
            (Ok(new), Ok(old)) => new > old,
            (new, old) => new.is_err() && old.is_ok(),
        };
        if worst.as_ref().is_none_or(more) {
            worst = Some(need);
        }
    }
    Ok(worst.unwrap_or(Need { damping: Ok(0.0), at_hz: None }))
}

/// Whether a pole is at the circle. Real ones just below 1 belong to a body that only a very weak damper holds: it stands still.
fn is_neutral(pole: &Pole, period: f64) -> bool {
    pole.ln_abs.abs() < MARGINAL * period && pole.arg != 0.0
}

fn of_filter(port: &Impedance, filter: &Filter, lag: Delay, period: f64) -> Result<Need, Error> {
    let band = MARGINAL * period;
    let (seen, neutral) = (|p: &Pole| port.has_residue(p, period), |p: &Pole| is_neutral(p, period));
    let hz = |p: &Pole| p.arg.abs() / std::f64::consts::TAU / period;
    let lowest = |wanted: &dyn Fn(&Pole) -> bool| port.poles.iter().filter(|p| wanted(p)).map(hz).reduce(f64::min);
    let never = |cause: Cause| Ok(Need { damping: Err(cause), at_hz: cause.at_hz() });
    if let Some(hz) = lowest(&|p| p.ln_abs >= band && seen(p)) {
        return never(Cause::Grows { hz });
    }
    if lag.part > 0.0
        && let Some(hz) = lowest(&|p| neutral(p) && seen(p))
    {
        return never(Cause::Fraction { hz });
    }
    let mut curve = Curve::new(port, filter, lag, period);
    curve.drop_poles(|p| p.ln_abs > -band && !(neutral(p) && seen(p)));
    if !port.is_finite() {
        return Err(Error::Eigenvalues { order: port.poles.len() });
    }
    let out = curve.take_out(neutral);
    let out_of_step = out.iter().filter(|(_, rho)| !(rho.re >= 0.0 && rho.im.abs() <= REAL * rho.norm()));
    if let Some(hz) = out_of_step.map(|(pole, _)| hz(pole)).reduce(f64::min) {
        return never(Cause::OutOfStep { hz });
    }
    let found = supremum(&curve, Curve::size(port, period))?;
    let at_hz = found.at.map(|angle| angle / std::f64::consts::TAU / period);
    Ok(Need { damping: Ok(found.value.max(0.0)), at_hz })
}

/// Whether a coupling is Coulomb friction at the puck.
fn is_coulomb_at_puck(coupling: &Coupling) -> bool {
    Kind::of(coupling) == Kind::Coulomb && most(coupling) > 0.0 && laws::at_puck(coupling)
}

/// What [`passivity`] finds first: the verdict on the linear loop.
pub(crate) fn found(world: &World) -> Result<Need, Error> {
    let never = |cause| Ok(Need { damping: Err(cause), at_hz: None });
    if world.couplings.iter().any(is_coulomb_at_puck) {
        return never(Cause::Coulomb);
    }
    let need = need(world, &world.couplings)?;
    // A pole outside the circle never passes, however little of it the puck's torque shows.
    let Sampling { method, period, .. } = world.sampling;
    let grows = Verdict::of(held_growth(&world.bodies, &world.couplings, method, period)?) == Verdict::Unstable;
    if grows && !matches!(need.damping, Err(Cause::Grows { .. })) {
        // The first listed is the largest.
        let listed = held_eigenvalues(&world.bodies, &world.couplings, method, period)?;
        let turn = listed.first().map_or(0.0, |most| most.im.atan2(most.re).abs());
        return never(Cause::Unseen { hz: turn / std::f64::consts::TAU / period });
    }
    Ok(need)
}

/// [`Passivity::required_damping`] alone.
///
/// # Errors
/// As [`passivity`].
pub fn required_damping(world: &World) -> Result<Option<f64>, Error> {
    Ok(found(world)?.damping.ok())
}
