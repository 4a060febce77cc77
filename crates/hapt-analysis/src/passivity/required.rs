//! The device damping that makes the loop passive against every passive hand.
//!
//! The linear loop is passive exactly when G(z) = b/T + H/(z - 1) is positive real (Colgate and Schenkel 1997), H from the
//! sampled position to the torque that resists the hand. There must be no pole outside the unit circle. A pole on it must be simple
//! with a residue ρ = R/p that is real and not negative, and on the circle b must be no less than the curve of `curve`. Poles outside
//! the circle are found in the held world, before poles of negligible residue are omitted. A lossless world has poles on the circle.
//! They are removed by their residues before the search for the maximum, because no grid of frequencies detects them.
//!
//! `advance` compensates whole samples of delay. In a lossless world at the end of a step each pole λ has a residue ρ ≥ 0. An advance
//! of d steps with d samples of delay turns it into ρ wᵈ w/(1 - w), w = λ/z, |w| = 1. Since
//! wᵈ⁺¹/(1 - w) = w/(1 - w) - w - ... - wᵈ and Re w/(1 - w) = -1/2, the curve is
//!
//! ```text
//! m = T Ks (1/2 + Σ cos iφ) + Σ T ρ (1/2 + Σ cos i(φ - arg λ)),  i = 1..d,    Ks + Σ ρ = K
//! ```
//!
//! which never exceeds K T (1/2 + d).

use hapt_model::{Body, Coupling, EstimatorKind, Sampling, World};

use crate::equations::continuous::Slopes;
use crate::equations::delay::Delay;
use crate::equations::estimator::{Filter, PositionFilter};
use crate::equations::laws::{self, Kind, most};
use crate::error::Error;
use crate::impedance::{Discretisation, Pole, TransferFunction};
use crate::numerics::last::Last;
use crate::passivity::curve::DampingCurve;
use crate::passivity::supremum::{Wanted, damping, rounded_requirement, supremum};
use crate::passivity::two_rates;
use crate::stability::held::{held_eigenvalues, held_growth};
use crate::stability::{MARGINAL, Verdict};

/// Why the poles of a world give no verdict.
const FAR_APART: &str = "the rates of bodies, springs and dampers lie too far apart for double precision: a body that a huge damper holds is \
                         better written as ground, and a very light one left out";

/// Why no theorem covers a velocity by the Kalman filter.
pub(crate) const KALMAN: &str = "a velocity from a Kalman filter has a proof with dampers between puck and ground, without a delay or a lag: \
                                 estimator = \"difference\" or \"low-pass\" has others";

/// Whether a damper at the puck takes the velocity of a Kalman filter.
fn is_kalman(world: &World, transfer: &TransferFunction) -> bool {
    world.sampling.estimator == EstimatorKind::Kalman && transfer.at_puck[1] > 0.0
}

/// Why a filter gives no verdict.
const FILTER_POLE: &str =
    "a pole of the world is that of loop.filter to six digits: a slightly different cutoff is decided";

/// Relative imaginary part below which a residue counts as real.
const REAL: f64 = 1e-9;

/// Why no finite device damping makes the loop passive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// A mode in the torque at the puck is unstable.
    Grows {
        /// Frequency of the mode.
        hz: f64,
    },
    /// The held world is unstable in a mode that has almost no torque at the puck.
    GrowsUnseen {
        /// Frequency of the mode.
        hz: f64,
    },
    /// An undamped mode has a residue that is not real and positive.
    NegativeResidue {
        /// Frequency of the mode.
        hz: f64,
    },
    /// An undamped mode, and a delay that is not a whole number of samples.
    FractionalDelay {
        /// Frequency of the mode.
        hz: f64,
    },
    /// An undamped mode, and a motor that lags behind its command.
    MotorLag {
        /// Frequency of the mode.
        hz: f64,
    },
    /// Coulomb friction at the puck.
    Coulomb,
    /// An integral term at the puck.
    Integral,
    /// No theorem covers the loop.
    Outside {
        /// The reason that the proof does not apply.
        reason: &'static str,
    },
}

impl Cause {
    /// The frequency at which the requirement is infinite, if it is one frequency.
    fn at_hz(self) -> Option<f64> {
        match self {
            Cause::NegativeResidue { hz } | Cause::FractionalDelay { hz } | Cause::MotorLag { hz } => Some(hz),
            Cause::Integral => Some(0.0),
            Cause::Grows { .. } | Cause::GrowsUnseen { .. } | Cause::Coulomb | Cause::Outside { .. } => None,
        }
    }
}

/// The required damping of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Requirement {
    pub damping: Result<f64, Cause>,
    pub at_hz: Option<f64>,
}

/// The inputs of a transfer function.
struct Question {
    bodies: Vec<Body>,
    couplings: Vec<Coupling>,
    rule: Discretisation,
}

thread_local! {
    static TRANSFER: Last<Question, TransferFunction> = const { Last::new() };
}

/// The transfer function of `couplings`, nonlinear ones at their steepest slopes. Delay and device do not change it.
fn transfer(world: &World, couplings: &[Coupling]) -> Result<TransferFunction, Error> {
    let Sampling { method, output, advance, period, .. } = world.sampling;
    let (bodies, rule) = (&world.bodies, Discretisation { method, output, advance, period });
    TRANSFER.with(|last| {
        last.answer(
            |known| known.rule == rule && known.bodies == *bodies && known.couplings == couplings,
            || Question { bodies: bodies.clone(), couplings: couplings.to_vec(), rule },
            || TransferFunction::new(bodies, couplings, &Slopes::Steep, rule),
        )
    })
}

/// The same behind the filter of the position, where there is one; `None` where double precision does not separate their poles.
fn filtered(world: &World, couplings: &[Coupling]) -> Result<Option<TransferFunction>, Error> {
    let transfer = transfer(world, couplings)?;
    Ok(match PositionFilter::of(&world.sampling, world.sampling.period) {
        Some(filter) if transfer.is_finite() => transfer.behind(filter),
        Some(_) | None => Some(transfer),
    })
}

/// The required damping of the linear loop of `couplings`, nonlinear ones at their steepest slopes.
pub(crate) fn requirement(world: &World, couplings: &[Coupling]) -> Result<Requirement, Error> {
    requirement_wanted(Wanted::Value, world, couplings)
}

/// The same, or as much of it as is `wanted`.
pub(crate) fn requirement_wanted(wanted: Wanted, world: &World, couplings: &[Coupling]) -> Result<Requirement, Error> {
    let fixed;
    let (world, couplings) = if world.sampling.bodies_every == 1 {
        (world, couplings)
    } else {
        if let Some(reason) = two_rates::outside(world, couplings)? {
            return Ok(Requirement { damping: Err(Cause::Outside { reason }), at_hz: None });
        }
        fixed = two_rates::with_fixed_bodies(world, couplings);
        (&fixed, &fixed.couplings[..])
    };
    let period = world.sampling.period;
    let Some(transfer) = filtered(world, couplings)? else {
        return Ok(Requirement { damping: Err(Cause::Outside { reason: FILTER_POLE }), at_hz: None });
    };
    if !transfer.is_accurate {
        return Ok(Requirement { damping: Err(Cause::Outside { reason: FAR_APART }), at_hz: None });
    }
    if is_kalman(world, &transfer) {
        return Ok(Requirement { damping: Err(Cause::Outside { reason: KALMAN }), at_hz: None });
    }
    let lag = Delay::of_loop(&world.sampling)?;
    let mut worst: Option<Requirement> = None;
    for filter in Filter::of(&world.sampling, period) {
        let requirement = of_filter(&transfer, &filter, lag, world.device.lag, (period, wanted))?;
        let more = |old: &Requirement| match (requirement.damping, old.damping) {
            (Ok(new), Ok(old)) => new > old,
            (new, old) => new.is_err() && old.is_ok(),
        };
        if worst.as_ref().is_none_or(more) {
            worst = Some(requirement);
        }
    }
    Ok(worst.unwrap_or(Requirement { damping: Ok(0.0), at_hz: None }))
}

/// Whether a pole is on the unit circle, or within the resolution of a verdict of it.
fn is_neutral(pole: &Pole, period: f64) -> bool {
    pole.ln_abs.abs() < MARGINAL * period
}

/// Whether it is real and that near 1: a body that a strong damper holds, or that a weak one drags along. It moves over years, and its
/// effect is felt at once: the stiffness of a spring to a body that is held, or a damping that vanishes only over years.
fn is_slow(pole: &Pole, period: f64) -> bool {
    pole.arg == 0.0 && is_neutral(pole, period)
}

/// Distance of a slow pole from 1 at least, and relative size of a residue that is no more than rounding where the pole is on the circle.
const SLOWEST: f64 = 1e-14;

/// Takes the slow poles out of the curve, and returns the damping that they require toward 0 Hz beyond that of the rest of the curve there,
/// N·m·s/rad.
///
/// One whose residue ρ in Z F is not negative is taken as if it were on the circle: Re ρλ/(z - λ) ≥ -ρ/2 there as for every λ in (0, 1). Of
/// one with a negative residue, whose damping is missing toward 0 Hz, -T Re ρλ/(z - λ) falls from T|ρ|λ/(1 - λ) at 0 Hz to less than 0, in so
/// narrow a band that the rest of the curve does not change in it.
fn slow_poles(curve: &mut DampingCurve, can_extract: bool) -> Result<f64, Cause> {
    let period = curve.period();
    let slow: Vec<Pole> = curve.poles().iter().filter(|p| is_slow(p, period)).copied().collect();
    let mut at_rest = 0.0;
    for pole in slow {
        let mut without = curve.clone();
        let residue = without.extract(|p| *p == pole).iter().map(|(_, rho)| rho.re).sum::<f64>();
        if residue < 0.0 {
            curve.drop_poles(|p| *p == pole);
            if pole.ln_abs < 0.0 {
                at_rest += period * -residue * pole.ln_abs.exp() / -pole.ln_abs.exp_m1();
            } else if -residue > SLOWEST * curve.gain_size() {
                return Err(Cause::NegativeResidue { hz: 0.0 });
            }
        } else if can_extract {
            *curve = without;
        } else {
            curve.slow_down(&pole, -SLOWEST);
        }
    }
    Ok(at_rest)
}

fn of_filter(
    transfer: &TransferFunction,
    filter: &Filter,
    lag: Delay,
    motor: f64,
    (period, wanted): (f64, Wanted),
) -> Result<Requirement, Error> {
    let band = MARGINAL * period;
    let seen = |p: &Pole| transfer.has_residue(p, period);
    let neutral = |p: &Pole| is_neutral(p, period) && !is_slow(p, period);
    let hz = |p: &Pole| p.arg.abs() / std::f64::consts::TAU / period;
    let lowest = |wanted: &dyn Fn(&Pole) -> bool| transfer.poles.iter().filter(|p| wanted(p)).map(hz).reduce(f64::min);
    let never = |cause: Cause| Ok(Requirement { damping: Err(cause), at_hz: cause.at_hz() });
    if let Some(hz) = lowest(&|p| p.ln_abs >= band && seen(p)) {
        return never(Cause::Grows { hz });
    }
    if lag.fraction > 0.0
        && let Some(hz) = lowest(&|p| neutral(p) && seen(p))
    {
        return never(Cause::FractionalDelay { hz });
    }
    if motor > 0.0
        && let Some(hz) = lowest(&|p| neutral(p) && seen(p))
    {
        return never(Cause::MotorLag { hz });
    }
    let mut curve = DampingCurve::new(transfer, filter, lag, motor, period);
    curve.drop_poles(|p| p.ln_abs > -band && !(is_neutral(p, period) && seen(p)));
    let at_rest = match slow_poles(&mut curve, lag.fraction == 0.0 && motor == 0.0) {
        Ok(at_rest) => at_rest,
        Err(cause) => return never(cause),
    };
    if !transfer.is_finite() {
        return Err(Error::Eigenvalues { order: transfer.poles.len() });
    }
    let out = curve.extract(neutral);
    let not_positive = out.iter().filter(|(_, rho)| !(rho.re >= 0.0 && rho.im.abs() <= REAL * rho.norm()));
    if let Some(hz) = not_positive.map(|(pole, _)| hz(pole)).reduce(f64::min) {
        return never(Cause::NegativeResidue { hz });
    }
    let found = supremum(&curve, DampingCurve::size(transfer, motor, period), wanted)?;
    let toward_rest = if at_rest > 0.0 { curve.over::<1>(0.0, 0.0) } else { None };
    if let Some((m, h)) = toward_rest {
        let demand = damping(m.c[0] + at_rest, h.c[0].max(0.0));
        if demand > found.value {
            return Ok(Requirement { damping: Ok(demand.max(0.0)), at_hz: Some(0.0) });
        }
    }
    let at_hz = found.at.map(|angle| angle / std::f64::consts::TAU / period);
    Ok(Requirement { damping: Ok(found.value.max(0.0)), at_hz })
}

/// The transfer function with the poles that its torque shows; `None` where one of them is on the unit circle or outside.
fn damped(world: &World, couplings: &[Coupling]) -> Result<Option<TransferFunction>, Error> {
    let period = world.sampling.period;
    let Some(mut transfer) = filtered(world, couplings)? else { return Ok(None) };
    if !transfer.is_finite() {
        return Err(Error::Eigenvalues { order: transfer.poles.len() });
    }
    if !transfer.is_accurate {
        return Ok(None);
    }
    let mut seen: Vec<Pole> = transfer.poles.iter().filter(|p| transfer.has_residue(p, period)).copied().collect();
    let is_damped = |p: &Pole| p.ln_abs <= -MARGINAL * period || is_slow(p, period);
    if !seen.iter().all(is_damped) {
        return Ok(None);
    }
    seen.iter_mut().for_each(|p| p.ln_abs = p.ln_abs.min(-SLOWEST));
    transfer.poles = seen;
    Ok(Some(transfer))
}

/// The supremum of |H| over the unit circle, N·m/rad; `None` where an undamped mode makes it infinite. Where positions move by δ from
/// sample to sample, the root of the sum of squares of the torques' changes is at most that times the positions'.
pub(crate) fn largest_gain(wanted: Wanted, world: &World, couplings: &[Coupling]) -> Result<Option<f64>, Error> {
    let period = world.sampling.period;
    let Some(transfer) = damped(world, couplings)?.filter(|transfer| !is_kalman(world, transfer)) else {
        return Ok(None);
    };
    let mut largest = 0.0f64;
    for filter in Filter::of(&world.sampling, period) {
        let curve = DampingCurve::gain(&transfer, &filter, period);
        largest = largest.max(supremum(&curve, DampingCurve::size(&transfer, 0.0, period) / period, wanted)?.value);
    }
    Ok(Some(largest))
}

/// A damping that is enough for every pattern of delays between these two parts of `longest`, the longest interval in s (docs/theory.md, (T43)).
/// `None` where an undamped mode has no bound.
pub(crate) fn late_requirement(
    wanted: Wanted,
    world: &World,
    couplings: &[Coupling],
    (longest, parts): (f64, [f64; 2]),
) -> Result<Option<f64>, Error> {
    let period = world.sampling.period;
    let Some(transfer) = damped(world, couplings)?.filter(|transfer| !is_kalman(world, transfer)) else {
        return Ok(None);
    };
    let mut largest = 0.0f64;
    for filter in Filter::of(&world.sampling, period) {
        let curve = |samples: usize, fraction: f64| {
            DampingCurve::new(&transfer, &filter, Delay { samples, fraction }, 0.0, period)
        };
        let gain = DampingCurve::gain(&transfer, &filter, period);
        let mean = mean_delay([&curve(0, 0.0), &curve(1, 0.0), &gain], parts);
        let late = curve(0, mean.part).with_spread(mean.spread);
        let found = supremum(&late, DampingCurve::size(&transfer, 0.0, period), wanted)?;
        largest = largest.max(found.value * longest / period / (1.0 - mean.share));
    }
    Ok(Some(largest))
}

/// The multiplier of (T43): the delay ā by which the varying ones are replaced, the term that replaces ā (1 - ā), and the share of the
/// damping that pays for the variation.
struct MeanDelay {
    part: f64,
    spread: f64,
    share: f64,
}

impl MeanDelay {
    fn new(part: f64, share: f64, parts: [f64; 2]) -> MeanDelay {
        let of = |a: f64| a * (1.0 - a) + if a == part { 0.0 } else { (a - part).powi(2) / share };
        MeanDelay { part, spread: (1.0 - share) * of(parts[0]).max(of(parts[1])), share }
    }
}

/// The multiplier that requires the least damping at some frequencies. `at_once` and `later` are the curves without delay and with one
/// sample of it, between which that of a fraction lies; any multiplier gives a bound.
fn mean_delay([at_once, later, gain]: [&DampingCurve; 3], parts: [f64; 2]) -> MeanDelay {
    let [least, most] = parts;
    if least == most {
        return MeanDelay::new(least, 0.0, parts);
    }
    const EVEN: usize = 24;
    let even = (0..=EVEN).map(|i| std::f64::consts::PI * i as f64 / EVEN as f64);
    let near = at_once.angles().into_iter().flat_map(|angle| [0.5, 0.9, 1.0, 1.1, 2.0].map(|part| angle * part));
    let value = |curve: &DampingCurve, phi: f64| curve.over::<1>(phi, 0.0).map(|(m, h)| (m.c[0], h.c[0]));
    let points: Vec<[f64; 3]> = even
        .chain(near.filter(|phi| *phi < std::f64::consts::PI))
        .filter_map(|phi| Some([value(at_once, phi)?.0, value(later, phi)?.0, value(gain, phi)?.1]))
        .collect();
    let period = at_once.period();
    let cost = |mean: &MeanDelay| {
        let at = |[once, later, square]: &[f64; 3]| {
            let (m, h) = (once + mean.part * (later - once), 0.25 * mean.spread * period * period * square);
            0.5 * (m + (m * m + 4.0 * h).sqrt()) / (1.0 - mean.share)
        };
        points.iter().map(at).fold(0.0, f64::max)
    };
    // Over ā and the logarithm of the share, by steps that are halved.
    let at = |x: f64, y: f64| MeanDelay::new(least + (most - least) * x.clamp(0.0, 1.0), y.min(-0.05).exp(), parts);
    let (mut x, mut y) = (0.5, -3.0);
    let mut best = cost(&at(x, y));
    let mut step = [0.5, 2.0];
    while step[0] > 1e-3 {
        let mut moved = false;
        for [dx, dy] in
            [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]]
        {
            let (next, down) = ((x + dx * step[0]).clamp(0.0, 1.0), (y + dy * step[1]).clamp(-30.0, -0.05));
            let found = cost(&at(next, down));
            if found < best {
                (x, y, best, moved) = (next, down, found, true);
                break;
            }
        }
        if !moved {
            step = step.map(|step| 0.5 * step);
        }
    }
    at(x, y)
}

/// Whether a coupling is Coulomb friction at the puck.
fn is_coulomb_at_puck(coupling: &Coupling) -> bool {
    Kind::of(coupling) == Kind::Coulomb && most(coupling) > 0.0 && laws::at_puck(coupling)
}

/// The required damping of the linear loop of `world`, or as much of it as is `wanted`.
pub(crate) fn linear_requirement_wanted(wanted: Wanted, world: &World) -> Result<Requirement, Error> {
    let never = |cause| Ok(Requirement { damping: Err(cause), at_hz: None });
    if world.couplings.iter().any(is_coulomb_at_puck) {
        return never(Cause::Coulomb);
    }
    if world.couplings.iter().any(|c| laws::integral_gain(&c.law) > 0.0) {
        return Ok(Requirement { damping: Err(Cause::Integral), at_hz: Cause::Integral.at_hz() });
    }
    let requirement = requirement_wanted(wanted, world, &world.couplings)?;
    // A pole outside the unit circle is never passive, however small its residue.
    let (method, period) = (world.sampling.method, world.sampling.step());
    let grows = Verdict::of(held_growth(&world.bodies, &world.couplings, method, period)?) == Verdict::Unstable;
    if grows && !matches!(requirement.damping, Err(Cause::Grows { .. } | Cause::Outside { .. })) {
        // The first eigenvalue is the largest.
        let listed = held_eigenvalues(&world.bodies, &world.couplings, method, period)?;
        let turn = listed.first().map_or(0.0, |most| most.im.atan2(most.re).abs());
        return never(Cause::GrowsUnseen { hz: turn / std::f64::consts::TAU / period });
    }
    let damping = requirement.damping.map(|b| rounded_requirement(world.device.damping, b));
    Ok(Requirement { damping, ..requirement })
}
