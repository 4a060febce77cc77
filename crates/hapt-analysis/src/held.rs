//! The held world: the bodies alone, the puck standing still.

use std::f64::consts::TAU;

use hapt_model::{Body, Coupling, Method};
use serde::Serialize;

use crate::continuous::{Slopes, bent, ties};
use crate::critical::{Critical, balance_of, of_part, roots};
use crate::eigen::{Multiplier, Root, multiplier, pair};
use crate::error::{Error, positive};
use crate::modal::Modal;
use crate::structure::{Part, parts};

/// Growth of less than this, in 1/s, either way, counts as none.
pub const MARGINAL: f64 = 1e-9;

/// Eigenvalues of modulus below this are 0: not listed.
pub const LISTED: f64 = 1e-12;

/// Up to this many nonlinear couplings every combination of their slopes is looked at.
pub const COMBINED: usize = 6;

/// A discrete eigenvalue, per sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Eigenvalue {
    /// Re λ.
    pub re: f64,
    /// Im λ.
    pub im: f64,
    /// |λ|.
    pub abs: f64,
}

/// A complex pair of the differential equation, and what the method makes of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mode {
    /// |s|/2π.
    pub frequency_hz: f64,
    /// ζ = -Re s/|s|; exactly 0 for a mode that moves no damper.
    pub damping_ratio: f64,
    /// |ln(λ)/T|/2π of the discrete pair nearest e^{sT}; `None` when that is real.
    pub discrete_frequency_hz: Option<f64>,
    /// -cos arg ln(λ): the damping ratio of that pair.
    pub discrete_damping_ratio: Option<f64>,
}

/// What becomes of a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It decays.
    Stable,
    /// It stays: |growth| below [`MARGINAL`].
    Marginal,
    /// It grows.
    Unstable,
}

impl Verdict {
    /// "stable", "marginal" or "unstable".
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Stable => "stable",
            Verdict::Marginal => "marginal",
            Verdict::Unstable => "unstable",
        }
    }

    /// The verdict on a growth rate; `None`, everything gone after one sample, is stable.
    pub fn of(growth_per_s: Option<f64>) -> Verdict {
        match growth_per_s {
            Some(g) if g >= MARGINAL => Verdict::Unstable,
            Some(g) if g > -MARGINAL => Verdict::Marginal,
            _ => Verdict::Stable,
        }
    }
}

/// The answer on the held world. With nonlinear couplings: of the worst combination of their slopes, but for the critical
/// period, which is the smallest of all combinations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Held {
    /// Largest |λ| first; equal ones by |arg λ| upwards, positive imaginary part first. Those below [`LISTED`] are left out.
    pub eigenvalues: Vec<Eigenvalue>,
    /// The largest |λ|; 0 when none is listed.
    pub spectral_radius: f64,
    /// ln(spectral radius)/T in 1/s; `None` when the radius is 0.
    pub growth_per_s: Option<f64>,
    /// By the growth.
    pub verdict: Verdict,
    /// The supremum of T0 such that no modulus is above 1 for all 0 < T ≤ T0, in s.
    pub critical_period_s: Option<f64>,
    /// Why there is none: `"never"` or `"unbounded"`.
    pub critical_period_reason: Option<&'static str>,
    /// The differential equation's complex pairs, by frequency.
    pub modes: Vec<Mode>,
}

/// What one part of the world gives.
#[derive(Clone, Debug)]
struct Found {
    multipliers: Vec<Multiplier>,
    /// z = Ts of the complex pairs, Im z > 0.
    pairs: Vec<Root>,
    critical: Critical,
}

/// Eigenvalues, growth, critical period and modes of bodies tied by couplings, the puck held.
///
/// Work: some cubes of the number of bodies that hang together, some hundred times that for the critical period of forward
/// Euler and RK4 with dampers that follow the period, and all of it again for each combination of slopes.
///
/// # Errors
/// [`Error::Value`] for a period or inertia that is not positive, [`Error::NoSuchBody`], [`Error::Eigenvalues`] when numbers
/// leave double precision.
pub fn held(bodies: &[Body], couplings: &[Coupling], method: Method, period: f64) -> Result<Held, Error> {
    positive("the period", period)?;
    let inertia = inertias(bodies)?;
    // Combinations differ in few parts: each is computed once.
    let mut known: Vec<(Part, Found)> = Vec::new();
    let mut worst: Option<(f64, Vec<Found>)> = None;
    let mut critical = Critical::Unbounded;
    for slopes in combinations(&bent(couplings)) {
        let mut all = Vec::new();
        for part in parts(&inertia, &ties(bodies, couplings, &slopes)?) {
            let found = match known.iter().find(|(p, _)| *p == part) {
                Some((_, found)) => found.clone(),
                None => {
                    let modal = Modal::new(&part)?;
                    let (multipliers, pairs) = spectrum(&modal, method, period)?;
                    let found = Found { multipliers, pairs, critical: of_part(&modal, method, critical)? };
                    known.push((part, found.clone()));
                    found
                }
            };
            critical = critical.min(found.critical);
            all.push(found);
        }
        let growth =
            all.iter().flat_map(|f| &f.multipliers).map(|m| m.growth(period)).fold(f64::NEG_INFINITY, f64::max);
        // Of combinations that rounding alone tells apart the first counts, the flat one.
        if worst.as_ref().is_none_or(|(most, _)| growth > most + MARGINAL) {
            worst = Some((growth, all));
        }
    }
    let found = worst.map(|(_, found)| found).unwrap_or_default();
    Ok(assemble(&found, critical, period))
}

/// The combinations of slopes to look at, all flat first.
fn combinations(bent: &[usize]) -> Vec<Slopes> {
    if bent.len() > COMBINED {
        let alone = bent.iter().map(|&i| Slopes::Chosen(vec![i]));
        return [Slopes::Flat, Slopes::Steep].into_iter().chain(alone).collect();
    }
    let chosen = |bits: u32| (0..bent.len()).filter(|i| bits >> i & 1 == 1).map(|i| bent[i]).collect();
    (0..1u32 << bent.len()).map(|bits| Slopes::Chosen(chosen(bits))).collect()
}

/// The discrete eigenvalues of bodies tied by couplings, the puck held, nonlinear couplings on the given slopes: 2n of them, in
/// no order.
///
/// # Errors
/// As [`held`].
pub fn multipliers(
    bodies: &[Body],
    couplings: &[Coupling],
    slopes: &Slopes,
    method: Method,
    period: f64,
) -> Result<Vec<Multiplier>, Error> {
    positive("the period", period)?;
    let mut all = Vec::new();
    for part in parts(&inertias(bodies)?, &ties(bodies, couplings, slopes)?) {
        all.extend(spectrum(&Modal::new(&part)?, method, period)?.0);
    }
    Ok(all)
}

fn inertias(bodies: &[Body]) -> Result<Vec<f64>, Error> {
    bodies.iter().map(|body| positive("a body's inertia", body.inertia)).collect()
}

/// λ of every mode, and z = Ts of the differential equation's complex pairs.
fn spectrum(part: &Modal, method: Method, period: f64) -> Result<(Vec<Multiplier>, Vec<Root>), Error> {
    // Semi-implicit Euler is forward Euler on a world with T K more damping: see `critical`.
    let implicit = if method == Method::SemiImplicitEuler { 1.0 } else { 0.0 };
    let mut discrete = Vec::new();
    let mut continuous = Vec::new();
    for (modes, compensation) in [(&part.undamped, 0.0), (&part.compensated, 1.0)] {
        for x in modes.iter().map(|omega| omega * period) {
            discrete.extend(pair(x, (compensation + implicit) * x * x));
            continuous.extend(pair(x, compensation * x * x));
        }
    }
    if !part.coupled.is_empty() {
        let modes = &part.coupled;
        let forward = (method == Method::ForwardEuler).then(|| balance_of(modes, period, &modes.uncovered));
        let own = roots(modes, period, false, forward.as_ref())?;
        match method {
            Method::SemiImplicitEuler => {
                discrete.extend(roots(modes, period, true, Some(&balance_of(modes, period, &modes.per_period)))?);
            }
            _ => discrete.extend(own.iter().copied()),
        }
        continuous.extend(own);
    }
    let ones = std::iter::repeat_n(Multiplier::ONE, part.ones);
    let multipliers: Vec<_> = ones.chain(discrete.into_iter().map(|root| multiplier(method, root))).collect();
    if !multipliers.iter().all(|m| m.less_one.re.is_finite() && m.less_one.im.is_finite() && m.ln_abs < f64::INFINITY) {
        return Err(Error::Eigenvalues { order: multipliers.len() });
    }
    // A double real root comes out of the solver as a pair √eps apart: that is no oscillation.
    let pairs = continuous.into_iter().filter(|r| r.z.im > 4.0 * f64::EPSILON.sqrt() * r.z.norm()).collect();
    Ok((multipliers, pairs))
}

fn assemble(found: &[Found], critical: Critical, period: f64) -> Held {
    let all: Vec<Multiplier> = found.iter().flat_map(|f| f.multipliers.iter().copied()).collect();
    let mut listed: Vec<Multiplier> = all.iter().copied().filter(|m| m.abs() >= LISTED).collect();
    sort(&mut listed);
    // A growth of -0 is 0.
    let growth_per_s = listed.iter().map(|m| m.growth(period) + 0.0).reduce(f64::max);
    // + 0, so that a real one does not print as -0.
    let eigenvalue = |m: &Multiplier| Eigenvalue { re: m.value().re + 0.0, im: m.value().im + 0.0, abs: m.abs() };
    let mut modes: Vec<Mode> = found.iter().flat_map(|f| &f.pairs).map(|root| mode(*root, &all, period)).collect();
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Held {
        spectral_radius: listed.iter().map(Multiplier::abs).fold(0.0, f64::max),
        eigenvalues: listed.iter().map(eigenvalue).collect(),
        growth_per_s,
        verdict: Verdict::of(growth_per_s),
        critical_period_s: critical.period(),
        critical_period_reason: critical.reason(),
        modes,
    }
}

/// Largest modulus first; those within 1e-9 of the first of their run by |arg| upwards, positive imaginary part first.
fn sort(list: &mut [Multiplier]) {
    list.sort_by(|a, b| b.ln_abs.total_cmp(&a.ln_abs));
    let mut rest = list;
    while let Some(first) = rest.first().map(Multiplier::abs) {
        let run = rest.iter().take_while(|m| m.abs() >= first - 1e-9).count();
        let (equal, others) = rest.split_at_mut(run);
        equal.sort_by(|a, b| a.arg().abs().total_cmp(&b.arg().abs()).then(b.less_one.im.total_cmp(&a.less_one.im)));
        rest = others;
    }
}

fn mode(root: Root, all: &[Multiplier], period: f64) -> Mode {
    let size = root.z.norm();
    // e^z - 1: neighbours on the circle are told apart by their distance from 1.
    let exact = multiplier(Method::Zoh, root).less_one;
    let distance = |m: &Multiplier| (m.less_one - exact).norm();
    let nearest = all.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|m| m.less_one.im != 0.0);
    let log = nearest.map(|m| (m.ln_abs, m.ln_abs.hypot(m.arg())));
    // 0 - x, because the negative of 0 is printed with its sign.
    let ratio = |re: f64, size: f64| (0.0 - re) / size;
    Mode {
        frequency_hz: size / (TAU * period),
        damping_ratio: ratio(root.z.re, size),
        discrete_frequency_hz: log.map(|(_, size)| size / (TAU * period)),
        discrete_damping_ratio: log.map(|(re, size)| ratio(re, size)),
    }
}
