//! The variance of a sum of correlated terms, for residuals that are not independent (Newey and West, Econometrica 55 (1987) 703).

/// Samples over which residuals are taken as correlated, at most.
const LONGEST: usize = 400;

/// The variance of a sum of correlated terms, by Bartlett's weights up to Andrews's lag for an autoregression (Econometrica 59 (1991) 817).
pub(crate) fn long_run(scores: &[f64]) -> f64 {
    let at = |lag: usize| scores.iter().zip(&scores[lag.min(scores.len())..]).map(|(a, b)| a * b).sum::<f64>();
    let own = at(0);
    if own <= 0.0 {
        return 0.0;
    }
    let next = (at(1) / own).clamp(-0.97, 0.97);
    let alpha = 4.0 * next * next / ((1.0 - next).powi(2) * (1.0 + next).powi(2));
    let lag = (1.1447 * (alpha * scores.len() as f64).cbrt()).clamp(1.0, LONGEST as f64) as usize;
    let more: f64 = (1..=lag).map(|k| 2.0 * (1.0 - k as f64 / (lag + 1) as f64) * at(k)).sum();
    (own + more).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// The sum of an autoregression of coefficient a has 1/(1 - a)² times the variance of the sum of its input.
    #[test]
    fn the_variance_of_a_sum_of_correlated_terms_is_that_of_theory() {
        for seed in hapt_testing::seeds(8) {
            let mut rng = Rng::with_seed(seed);
            let a = 0.8 * rng.f64();
            let mut x = 0.0;
            let scores: Vec<f64> = (0..40_000)
                .map(|_| {
                    x = a * x + (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
                    x
                })
                .collect();
            let ratio = long_run(&scores) / scores.len() as f64 * (1.0 - a).powi(2);
            assert!((ratio - 1.0).abs() < 0.2, "seed {seed}, {a}: {ratio}");
        }
    }
}
