//! The noise of positions, estimated without any fit.

/// Intervals that differ by less than this part of themselves differ by rounding.
const EVEN: f64 = 1e-6;

/// The noise of the positions, rms.
pub(crate) fn noise(times: &[f64], positions: &[f64]) -> f64 {
    // Third differences of a smooth motion are only noise; their median is not affected by the jerks.
    let third = |(t, z): (&[f64], &[f64])| {
        let weights = third_difference(t);
        let sum: f64 = weights.iter().zip(z).map(|(weight, z)| weight * z).sum();
        sum.abs() / weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt()
    };
    let mut thirds: Vec<f64> = times.windows(4).zip(positions.windows(4)).map(third).collect();
    let mean_square = thirds.iter().map(|x| x * x).sum::<f64>() / thirds.len() as f64;
    let middle = thirds.len() / 2;
    let median = *thirds.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
    if median > 0.0 { median } else { mean_square.sqrt() }
}

/// The weights of four samples at these times in their third difference, a multiple of the divided one; whole numbers where the times are
/// even.
fn third_difference(t: &[f64]) -> [f64; 4] {
    let mean = (t[3] - t[0]) / 3.0;
    if t.windows(2).all(|pair| (pair[1] - pair[0] - mean).abs() < EVEN * mean) {
        return [-1.0, 3.0, -3.0, 1.0];
    }
    std::array::from_fn(|i| (0..4).filter(|j| *j != i).map(|j| mean / (t[i] - t[j])).product())
}
