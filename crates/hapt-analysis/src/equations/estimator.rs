//! The velocity estimators as linear filters of the sampled position, and the filter of the position itself.

use hapt_model::{EstimatorKind, Sampling, kalman_gains};

/// v_k = pole v_{k-1} + Σ taps\[i\] z_{k-i}. The taps sum to 0: at rest the velocity is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// The factor of the last velocity, 0 up to 1.
    pub pole: f64,
    /// In 1/s, the newest sample first; empty for the true velocity.
    pub taps: Vec<f64>,
    /// α, β and γ of a Kalman filter, which has three states of its own. Its taps are those of what it becomes for a cutoff far beyond the
    /// sampling rate, and are not used.
    pub kalman: Option<[f64; 3]>,
}

impl Filter {
    /// The filters of an estimator at `period`. FOAW has two, of its shortest and its longest window; the others have one, and
    /// Levant's differentiator that of small motions.
    /// `exact` has no taps.
    pub fn of(sampling: &Sampling, period: f64) -> Vec<Filter> {
        let taken = |pole: f64, taps: Vec<f64>| Filter { pole, taps, kalman: None };
        let windows = |fit: fn(usize, f64) -> Vec<f64>| {
            let longest = (sampling.window as usize).max(1);
            let mut lengths = vec![1, longest];
            lengths.dedup();
            lengths.into_iter().map(|n| taken(0.0, fit(n, period))).collect()
        };
        let cutoff = sampling.cutoff.unwrap_or(f64::INFINITY);
        match sampling.estimator {
            EstimatorKind::Exact => vec![taken(0.0, Vec::new())],
            EstimatorKind::Difference => vec![taken(0.0, end_fit((sampling.every as usize).max(1), period))],
            EstimatorKind::LowPass => {
                let tau = 1.0 / (std::f64::consts::TAU * cutoff);
                let rate = 1.0 / (tau + period);
                vec![taken(tau * rate, vec![rate, -rate])]
            }
            EstimatorKind::Foaw => windows(end_fit),
            EstimatorKind::FoawBest => windows(best_fit),
            EstimatorKind::Kalman => {
                let gains = kalman_gains(std::f64::consts::TAU * cutoff * period);
                vec![Filter { kalman: Some(gains), ..taken(0.0, end_fit(1, period)) }]
            }
            // As long as it follows, it is the difference.
            EstimatorKind::Levant => vec![taken(0.0, end_fit(1, period))],
        }
    }
}

/// The one pole behind which the world sees the position: y_k = p y_{k-1} + (1 - p) z_k, p = e^{-x}, x = 2π filter T.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionFilter {
    x: f64,
}

impl PositionFilter {
    /// At `period`; `None` where the world sees the position as measured.
    pub fn of(sampling: &Sampling, period: f64) -> Option<PositionFilter> {
        sampling.filter.map(|cutoff| PositionFilter { x: std::f64::consts::TAU * cutoff * period })
    }

    /// ln p
    pub fn ln_pole(self) -> f64 {
        -self.x
    }

    /// p
    pub fn pole(self) -> f64 {
        (-self.x).exp()
    }

    /// 1 - p
    pub fn gain(self) -> f64 {
        -(-self.x).exp_m1()
    }

    /// p/(1 - p): z_k - y_k is this factor times y_k - y_{k-1}.
    pub fn lag(self) -> f64 {
        self.x.exp_m1().recip()
    }
}

/// The slope between the newest and the oldest of n + 1 samples.
fn end_fit(n: usize, period: f64) -> Vec<f64> {
    let mut taps = vec![0.0; n + 1];
    taps[0] = 1.0 / (n as f64 * period);
    taps[n] = -taps[0];
    taps
}

/// The least-squares slope through n + 1 samples: 12 (n/2 - i)/(T n (n + 1)(n + 2)) each.
fn best_fit(n: usize, period: f64) -> Vec<f64> {
    let m = n as f64;
    (0..=n).map(|i| 12.0 * (0.5 * m - i as f64) / (period * m * (m + 1.0) * (m + 2.0))).collect()
}
