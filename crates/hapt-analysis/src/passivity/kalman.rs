//! A damper between puck and ground behind the Kalman filter of constant acceleration (docs/theory.md, (T84)).
//!
//! At ωT = θ, q = e^{-jθ}, a damper B needs the device damping -B Re(q N/C), with T v = N (1 - q)/C z the filter's velocity. With
//! s = sin²(θ/2) the factorisation (T83) gives |C|² = γ² (1 - s + 2s²/15 + 64 s³/x⁶), so that it is a quotient of two polynomials in s.

use hapt_model::kalman_gains;

use crate::numerics::polynomial::{sign_changes, value};

/// What the damper needs per B, the most over all frequencies, and ωT there. x = 2π cutoff T.
pub(crate) fn overshoot(x: f64) -> (f64, f64) {
    // The gains stay the same beyond.
    let x = x.min(1e6);
    let [a, b, c] = kalman_gains(x);
    // s = h u and the gains over x, x², x³, in which all coefficients are of the size of 1 for small x.
    let h = 0.25 * x * x;
    let (a, b, c) = (a / x, b / (x * x), c / (x * x * x));
    let first = c * (4.0 * a + 2.0 * b * x + c * x * x) - 4.0 * b * b;
    let second = b * (2.0 - a * x) - c * x;
    let above = [-1.0, first / (4.0 * c * c), second / (2.0 * c * c)];
    let below = [1.0, -h, h * h * 2.0 / 15.0, 1.0];
    let mut slope = [0.0; 5];
    for (i, p) in above.iter().enumerate() {
        for (j, d) in below.iter().enumerate().filter(|(j, _)| i + j > 0) {
            slope[i + j - 1] += (i as f64 - j as f64) * p * d;
        }
    }
    let part = |u: f64| value(&above, u) / value(&below, u);
    let ends = [0.0, 1.0 / h];
    let places = sign_changes(&slope, ends[0], ends[1]).into_iter().chain(ends);
    let (most, at) =
        places.map(|u| (part(u), u)).fold((f64::NEG_INFINITY, 0.0), |best, x| if x.0 > best.0 { x } else { best });
    // To the safe side of rounding.
    (most + 1e-12, 2.0 * (h * at).min(1.0).sqrt().asin())
}

/// The largest error of the velocity where each position is wrong by up to half a count, per count and in 1/T: half the sum of the impulse
/// response's sizes.
pub(crate) fn count_error(x: f64) -> f64 {
    // Below, the filter is Butterworth's, whose response only stretches; its sum is within a part in a hundred of that.
    let shortest = x.max(1e-2);
    let [a, b, c] = kalman_gains(shortest);
    let (mut p, mut v, mut acceleration, mut sum) = (0.0, 0.0, 0.0, 0.0);
    // The slowest pole is about e^{-x/2}.
    let samples = (80.0 / shortest.min(1.0)) as usize;
    for k in 0..samples {
        let error = if k == 0 { 1.0 } else { 0.0 } - (p + v + 0.5 * acceleration);
        (p, v, acceleration) =
            (p + v + 0.5 * acceleration + a * error, v + acceleration + b * error, acceleration + c * error);
        sum += f64::abs(v);
    }
    0.5 * sum * if x < shortest { 1.05 * x / shortest } else { 1.0 }
}
