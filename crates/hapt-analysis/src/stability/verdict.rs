//! The result of a stability analysis, held or free: eigenvalues, growth, verdict, critical period, modes.

use std::f64::consts::TAU;

use hapt_model::Method;
use serde::Serialize;

use crate::stability::critical::Critical;
use crate::stability::multiplier::{Multiplier, Root, multiplier};

/// Growth of smaller magnitude than this, in 1/s, counts as marginal.
pub const MARGINAL: f64 = 1e-9;

/// Eigenvalues of smaller modulus count as 0 and are not listed.
pub const LISTED: f64 = 1e-12;

/// Why a quick check has no critical period, nor a free loop whose bodies step at every n-th sample.
pub(crate) const NOT_SEARCHED: &str = "not searched";

/// A discrete eigenvalue, per sample; where the bodies step at every n-th sample, per n samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Eigenvalue {
    /// Re λ.
    pub re: f64,
    /// Im λ.
    pub im: f64,
    /// |λ|.
    pub abs: f64,
}

/// A complex pair of the differential equation, and its discrete counterpart.
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

/// The behaviour of a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It decays.
    Stable,
    /// It neither decays nor grows: |growth| below [`MARGINAL`].
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

    /// The verdict on a growth rate. `None`, all eigenvalues 0, is stable.
    pub fn of(growth_per_s: Option<f64>) -> Verdict {
        match growth_per_s {
            Some(g) if g >= MARGINAL => Verdict::Unstable,
            Some(g) if g > -MARGINAL => Verdict::Marginal,
            _ => Verdict::Stable,
        }
    }
}

/// The stability of a loop. With nonlinear couplings it is that of the worst combination of their slopes; the critical period is the
/// smallest of all combinations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stability {
    /// Largest |λ| first; equal ones by |arg λ| upwards, positive imaginary part first. Those below [`LISTED`] are omitted.
    pub eigenvalues: Vec<Eigenvalue>,
    /// The largest |λ|, without shifts that change no torque; 0 when there is none.
    pub spectral_radius: f64,
    /// ln(spectral radius)/T in 1/s; `None` when the radius is 0.
    pub growth_per_s: Option<f64>,
    /// The verdict on the growth.
    pub verdict: Verdict,
    /// The supremum of T0 such that no modulus exceeds 1 for all 0 < T ≤ T0, in s.
    pub critical_period_s: Option<f64>,
    /// Why there is no critical period: `"never"` or `"unbounded"`; `"not searched"` in a quick check, and of a free loop whose bodies step at
    /// every n-th sample.
    pub critical_period_reason: Option<&'static str>,
    /// The differential equation's complex pairs, by frequency.
    pub modes: Vec<Mode>,
}

/// The largest growth in 1/s; `None` where every eigenvalue is 0.
pub(crate) fn growth(multipliers: &[Multiplier], period: f64) -> Option<f64> {
    // A growth of -0 is 0.
    multipliers.iter().filter(|m| m.abs() >= LISTED).map(|m| m.growth(period) + 0.0).reduce(f64::max)
}

/// The result from all eigenvalues, those without shifts, z = Ts of the complex pairs of the differential equation, and the
/// critical period.
pub(crate) fn assemble(
    all: &[Multiplier],
    without_shifts: &[Multiplier],
    pairs: &[Root],
    critical: Critical,
    period: f64,
) -> Stability {
    let is_listed = |m: &&Multiplier| m.abs() >= LISTED;
    let mut listed: Vec<Multiplier> = all.iter().filter(is_listed).copied().collect();
    sort(&mut listed);
    let growth_per_s = growth(without_shifts, period);
    let without_shifts: Vec<Multiplier> = without_shifts.iter().filter(is_listed).copied().collect();
    // + 0, so that a real one does not print as -0.
    let eigenvalue = |m: &Multiplier| Eigenvalue { re: m.value().re + 0.0, im: m.value().im + 0.0, abs: m.abs() };
    let mut modes: Vec<Mode> = pairs.iter().map(|root| mode(*root, all, period)).collect();
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Stability {
        spectral_radius: without_shifts.iter().map(Multiplier::abs).fold(0.0, f64::max),
        eigenvalues: listed.iter().map(eigenvalue).collect(),
        growth_per_s,
        verdict: Verdict::of(growth_per_s),
        critical_period_s: critical.period(),
        critical_period_reason: critical.reason(),
        modes,
    }
}

/// Largest modulus first. Those within 1e-9 are ordered by |arg|, positive imaginary part first.
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
    // e^z - 1: neighbours on the unit circle differ in their distance from 1.
    let exact = multiplier(Method::Zoh, root).less_one;
    let distance = |m: &Multiplier| (m.less_one - exact).norm();
    let nearest = all.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|m| m.less_one.im != 0.0);
    let log = nearest.map(|m| (m.ln_abs, m.ln_abs.hypot(m.arg())));
    // 0 - x, so that 0 is not printed as -0.
    let ratio = |re: f64, size: f64| (0.0 - re) / size;
    Mode {
        frequency_hz: size / (TAU * period),
        damping_ratio: ratio(root.z.re, size),
        discrete_frequency_hz: log.map(|(_, size)| size / (TAU * period)),
        discrete_damping_ratio: log.map(|(re, size)| ratio(re, size)),
    }
}
