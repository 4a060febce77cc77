//! Whether counts and noise explain the residuals of a fit.
//!
//! The noise σ is known without any fit, from third differences of the positions, in which a smooth motion vanishes. A fit that is right
//! leaves that noise, and the counts' rounding. So two conditions hold for its residuals r with variance s²:
//!
//! ```text
//! s² <= 1.5 σ² + Δ²/4
//! mean over blocks of (mean of r)² <= χ²(blocks)/blocks · s²/m + e²
//! ```
//!
//! The second is for blocks of m = 8 samples and for fifty blocks: independent noise averages out in them, and a wrong motion does not. χ²
//! is its quantile of 1 - 10⁻⁶. e is the largest mean of rounding: half a count without noise, and, with Gaussian noise of σ' before
//! counting, 1/π · exp(-2π² (σ'/Δ)²) of a count (Widrow and Kollár, Quantization Noise, 2008), with a fifth more.

use std::f64::consts::PI;

use crate::counts::Lattice;
use crate::record::Record;

/// The samples of a short block, and the number of long blocks.
const SHORT: usize = 8;
const BLOCKS: usize = 50;
/// The standard normal's quantiles of 1 - 10⁻⁶, and of 1 - 10⁻³.
const SURELY: f64 = 4.753;
const LIKELY: f64 = 3.090;
/// A fit with residuals of less than this part of the motion is as exact as printed numbers.
pub(crate) const NOTHING: f64 = 1e-6;

/// Whether counts and noise explain the residuals of a motion with this standard deviation.
pub(crate) fn explained(record: &Record, left: &[f64], lattice: Option<Lattice>, spread: f64) -> bool {
    explained_to(SURELY, record, left, lattice, spread)
}

/// The same of a fit whose terms were chosen by its residuals, by χ²'s quantile of 1 - 10⁻³: a term that is not the device's can bring the
/// residuals of another device just within the wider bound.
pub(crate) fn explained_by_choice(record: &Record, left: &[f64], lattice: Option<Lattice>, spread: f64) -> bool {
    explained_to(LIKELY, record, left, lattice, spread)
}

fn explained_to(level: f64, record: &Record, left: &[f64], lattice: Option<Lattice>, spread: f64) -> bool {
    let n = left.len() as f64;
    let variance = left.iter().map(|r| r * r).sum::<f64>() / n;
    if variance.sqrt() < NOTHING * spread {
        return true;
    }
    let count = lattice.map_or(0.0, |lattice| lattice.step);
    let seen = record.noise().powi(2);
    if variance > 1.5 * seen + 0.25 * count * count {
        return false;
    }
    let before = (seen.min(variance) - count * count / 12.0).max(0.0);
    let rounds =
        if count > 0.0 { (1.2 / PI * (-2.0 * PI * PI * before / (count * count)).exp()).min(0.5) } else { 0.0 };
    // With little noise the first harmonic is not the whole rounding error.
    let rounds = if before < 0.04 * count * count { 0.5 * count } else { rounds * count };
    [SHORT, left.len().div_ceil(BLOCKS)].into_iter().filter(|m| *m >= SHORT).all(|m| {
        let means: Vec<f64> = left.chunks_exact(m).map(|block| block.iter().sum::<f64>() / m as f64).collect();
        let blocks = means.len() as f64;
        let squares = means.iter().map(|mean| mean * mean).sum::<f64>() / blocks;
        squares <= quantile(level, blocks) * variance / m as f64 + rounds * rounds
    })
}

/// χ²'s quantile at the standard normal's `level` over its degrees of freedom (Wilson and Hilferty 1931).
fn quantile(level: f64, freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    (1.0 - v + level * v.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_the_tables() {
        // χ² of 50 and of 500 degrees of freedom is above these once in a million times, and once in a thousand.
        for (level, freedom, of_it) in
            [(SURELY, 50.0, 113.3), (SURELY, 500.0, 665.1), (LIKELY, 50.0, 86.66), (LIKELY, 500.0, 603.4)]
        {
            let found = quantile(level, freedom) * freedom;
            assert!((found / of_it - 1.0).abs() < 0.01, "{found} {of_it}");
        }
    }
}
