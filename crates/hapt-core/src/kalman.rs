//! The gains of the steady Kalman filter of constant acceleration.

/// α, β and γ of the filter at x = 2π cutoff T. It predicts z and v with the last acceleration a; of the rest e of the measured position it
/// adds α e to z, β e/T to v and γ e/T² to a.
///
/// They are the best there are where the jerk is white noise of a density q and each sample has independent noise of variance R, with
/// q T⁵/R = x⁶. For T → 0 the filter has the poles of a Butterworth filter at the cutoff. For a cutoff far beyond the sampling rate they are
/// those of noise-free positions.
///
/// With w = 2 - λ - 1/λ the poles λ of the filter solve w³ + x⁶ (w²/120 - w/4 + 1) = 0: what the sampled triple integrator makes of white
/// noise (the B-spline of order 5), and the measurement's noise. The left side has one root w = -x² y below 0; the two others, of the sum
/// s and the product p, give the factor λ² - (1 + r² - r √p) λ + r² with 2 (r + 1/r) = √p + √(16 - 4s + p). Nothing here subtracts
/// numbers that are near each other, so that small x keep their digits.
// Out of line: its numbers are not on the stack of what compiles a loop.
#[inline(never)]
pub fn kalman_gains(x: f64) -> [f64; 3] {
    // Beyond, they stay the same.
    let x = if x > 1e6 { 1e6 } else { x };
    let (square, fourth) = (x * x, x * x * x * x);
    // y³ = x⁴ y²/120 + x² y/4 + 1 by Newton's method, from above.
    let mut y = 1.0 + 0.5 * square + fourth / 120.0;
    for _ in 0..100 {
        let value = ((y - fourth / 120.0) * y - 0.25 * square) * y - 1.0;
        let next = y - value / ((3.0 * y - fourth / 60.0) * y - 0.25 * square);
        if next < y {
            y = next;
        } else {
            break;
        }
    }
    let (root, sum) = (square / libm::sqrt(y), (0.25 * fourth + square / y) / y);
    // √p + √(16 - 4s + p) - 4
    let excess = root + (root * root - 4.0 * sum) / (libm::sqrt(16.0 - 4.0 * sum + root * root) + 4.0);
    let less = 0.25 * (libm::sqrt(excess * (excess + 8.0)) - excess);
    let (r, q) = (1.0 - less, less * (2.0 - less));
    // One less the pole of the real root.
    let w = square * y;
    let one = 2.0 * w / (w + libm::sqrt(w * (w + 4.0)));
    let both = r * root;
    [one + q - one * q, both + one * q - 0.5 * one * both, one * both]
}
