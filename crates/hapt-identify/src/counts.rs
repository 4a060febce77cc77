//! The encoder's count from the positions, which are on a lattice.

/// The lattice of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The spacing, in the positions' unit.
    pub step: f64,
    /// The standard error of the spacing.
    pub error: f64,
}

/// Fewer different positions do not show a lattice.
const FEWEST: usize = 8;
/// A gap may differ from a whole number of steps by this part of a step, rms: positions may be printed with few digits.
const ROUGHEST: f64 = 0.1;

/// The lattice of these positions, if they are on one: the smallest gap between neighbours is about a step, every other one a
/// multiple, and the line through all of them is the step to many digits.
pub fn lattice(positions: &[f64]) -> Option<Lattice> {
    let mut sorted: Vec<f64> = positions.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let span = sorted.last()? - sorted.first()?;
    // The same lattice line, computed or printed in two ways.
    sorted.dedup_by(|b, a| *b - *a <= 1e-9 * span);
    if sorted.len() < FEWEST {
        return None;
    }
    let gaps: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    // The mean of the gaps that are one step is better than the smallest.
    let single: Vec<f64> = gaps.iter().copied().filter(|gap| *gap < 1.5 * smallest).collect();
    let mut step = single.iter().sum::<f64>() / single.len() as f64;
    // First gap by gap, so that an error in the last digit of the step does not add up; then all together.
    for _ in 0..2 {
        let multiple = |gap: &f64| (gap / step).round().max(1.0);
        let off = gaps.iter().map(|gap| (gap / step - multiple(gap)).powi(2)).sum::<f64>() / gaps.len() as f64;
        if off.sqrt() > ROUGHEST {
            return None;
        }
        step = gaps.iter().sum::<f64>() / gaps.iter().map(multiple).sum::<f64>();
    }
    let mut line = 0.0;
    let lines: Vec<f64> = std::iter::once(0.0)
        .chain(gaps.iter().map(|gap| {
            line += (gap / step).round().max(1.0);
            line
        }))
        .collect();
    let n = sorted.len() as f64;
    let (x, y) = (lines.iter().sum::<f64>() / n, sorted.iter().sum::<f64>() / n);
    let xx: f64 = lines.iter().map(|line| (line - x).powi(2)).sum();
    let xy: f64 = lines.iter().zip(&sorted).map(|(line, at)| (line - x) * (at - y)).sum();
    let slope = xy / xx;
    let rest: f64 = lines.iter().zip(&sorted).map(|(line, at)| (at - y - slope * (line - x)).powi(2)).sum();
    Some(Lattice { step: slope, error: (rest / (n - 2.0) / xx).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;
    use std::f64::consts::TAU;

    proptest! {
        #[test]
        fn an_encoder_is_found_in_positions_printed_with_few_digits(
            counts in 100u32..50_000, seed in any::<u64>(), samples in 100usize..1000, degrees in any::<bool>(),
        ) {
            let mut rng = fastrand::Rng::with_seed(seed);
            let turn = if degrees { 360.0 } else { TAU };
            let step = turn / f64::from(counts);
            let digits = (10f64).powf((0.02 * step).log10().floor());
            let mut at = 0i32;
            let seen: Vec<f64> = (0..samples).map(|_| {
                at += rng.i32(-3..=4);
                (f64::from(at) * step / digits).round() * digits
            }).collect();
            let found = lattice(&seen).map(|lattice| turn / lattice.step);
            prop_assert!(found.is_some_and(|found| (found / f64::from(counts) - 1.0).abs() < 1e-3), "{found:?}");
        }

        #[test]
        fn a_smooth_motion_has_no_counts(seed in any::<u64>()) {
            let mut rng = fastrand::Rng::with_seed(seed);
            let seen: Vec<f64> = (0..500).map(|_| rng.f64()).collect();
            prop_assert_eq!(lattice(&seen), None);
        }
    }
}
