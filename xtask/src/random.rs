//! Random draws of the campaigns, and statistics of many numbers.

use fastrand::Rng;
use hapt_core::spec::Range;
use hapt_core::{Law, Waveform};

/// Uniform in the logarithm, between two powers of ten.
pub fn log_uniform(rng: &mut Rng, from: f64, to: f64) -> f64 {
    10f64.powf(from + (to - from) * rng.f64())
}

/// Uniform in the logarithm, between two numbers.
pub fn log_between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.f64())
}

pub fn one_of<T: Copy>(rng: &mut Rng, of: &[T]) -> T {
    of[rng.usize(..of.len())]
}

/// The laws that follow the position about a place, and have an energy.
pub fn potentials() -> Vec<Law> {
    Law::ALL.into_iter().filter(|law| law.center().is_some() && !law.integrates()).collect()
}

/// A law of this kind near 0, as steep as the stiffness at most, and with the damping where it has one.
pub fn as_steep_as(rng: &mut Rng, mut law: Law, stiffness: f64, damping: f64) -> Law {
    for quantity in law.quantities() {
        *quantity.value = match (quantity.name, quantity.range) {
            ("damping", _) => damping,
            (_, Range::Any) => 0.6 * (rng.f64() - 0.5),
            (_, Range::ZeroOrMore) => 0.3 * rng.f64(),
            (_, Range::Positive) => log_uniform(rng, -1.5, 0.0),
        };
    }
    if let Some(waveform) = law.waveform_mut() {
        let mut factors = || std::array::from_fn(|_| if rng.bool() { 2.0 * rng.f32() - 1.0 } else { 0.0 });
        *waveform = Waveform { sine: factors(), cosine: factors() };
    }
    if let Some(strength) = law.strength() {
        *strength.value = 1.0;
    }
    // A texture of no harmonic has no slope.
    let slope = law.slopes().stiffness.max(1e-3);
    if let Some(strength) = law.strength() {
        *strength.value = stiffness / slope;
    }
    law
}

/// The number below which this share of the values is; NaN without values.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() as f64 * share) as usize).or(sorted.last()).copied().unwrap_or(f64::NAN)
}
