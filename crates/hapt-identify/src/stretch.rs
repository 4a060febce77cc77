//! The puck over a stretch of constant drive, in closed form, with the derivatives by each parameter.
//!
//! v̇ = a - β v with a constant a has, with x = β h,
//!
//! ```text
//! v(h) = v e^-x + a h φ1,    z(h) = z + v h φ1 + a h² φ2,
//! φ1 = (1 - e^-x)/x,  φ2 = (1 - φ1)/x,  φ3 = (1/2 - φ2)/x
//! ```

/// The φ functions over a stretch of `length` s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    length: f64,
    decay: f64,
    phi1: f64,
    phi2: f64,
    phi3: f64,
}

impl Stretch {
    /// β in 1/s, length in s.
    pub fn new(beta: f64, length: f64) -> Self {
        let x = beta * length;
        let phi3 = phi3(x);
        let phi2 = 0.5 - x * phi3;
        let phi1 = 1.0 - x * phi2;
        Stretch { length, decay: 1.0 - x * phi1, phi1, phi2, phi3 }
    }

    /// The displacement, and the velocity at the end, from velocity `v` under the acceleration `a` at rest.
    pub fn travel(&self, v: f64, a: f64) -> (f64, f64) {
        let h = self.length;
        (v * h * self.phi1 + a * h * h * self.phi2, v * self.decay + a * h * self.phi1)
    }

    /// The change of position and velocity at the end, per rad/s of velocity at the start.
    pub fn of_velocity(&self) -> (f64, f64) {
        (self.length * self.phi1, self.decay)
    }

    /// The same per rad/s² of the acceleration.
    pub fn of_drive(&self) -> (f64, f64) {
        (self.length * self.length * self.phi2, self.length * self.phi1)
    }

    /// The same per 1/s of β: φ1' = φ2 - φ1 and φ2' = (2 + x) φ3 - 1/2, x = 1/φ3 (1/2 - φ2).
    pub fn of_beta(&self, v: f64, a: f64, beta: f64) -> (f64, f64) {
        let h = self.length;
        let phi1 = self.phi2 - self.phi1;
        let phi2 = (2.0 + beta * h) * self.phi3 - 0.5;
        (v * h * h * phi1 + a * h * h * h * phi2, -v * h * self.decay + a * h * h * phi1)
    }
}

/// 1/(k+3)! of φ3 = Σ (-x)^k/(k+3)!, k from 0 to 11: 0.5^12/15! is far below the last bit.
const SERIES: [f64; 12] = {
    let (mut series, mut factorial, mut k) = ([0.0; 12], 2.0, 0);
    while k < series.len() {
        factorial *= k as f64 + 3.0;
        series[k] = 1.0 / factorial;
        k += 1;
    }
    series
};

/// φ3, by its series where the quotient would lose digits.
fn phi3(x: f64) -> f64 {
    if x.abs() < 0.5 {
        return SERIES.iter().rev().fold(0.0, |sum, factor| factor - x * sum);
    }
    let phi1 = -(-x).exp_m1() / x;
    let phi2 = (1.0 - phi1) / x;
    (0.5 - phi2) / x
}

/// When a puck of velocity `v` comes to rest under the opposite acceleration `a` at rest: β t = ln(1 - β v/a).
pub(crate) fn stopping_time(v: f64, a: f64, beta: f64) -> f64 {
    let x = -beta * v / a;
    let shape = if x.abs() < 1e-9 { 1.0 - 0.5 * x } else { x.ln_1p() / x };
    -v / a * shape
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn two_halves_are_the_whole(beta in -5.0..400.0f64, h in 1e-5..0.2f64, v in -10.0..10.0f64, a in -1e3..1e3f64) {
            let (whole, half) = (Stretch::new(beta, h), Stretch::new(beta, 0.5 * h));
            let (z, end) = whole.travel(v, a);
            let (z1, v1) = half.travel(v, a);
            let (z2, v2) = half.travel(v1, a);
            let size = 1e-12 * (v.abs() + a.abs() * h + 1.0);
            prop_assert!((end - v2).abs() < size * (1.0 + (beta * h).abs().exp().min(10.0)), "{end} {v2}");
            prop_assert!((z - z1 - z2).abs() < size, "{z} {}", z1 + z2);
        }

        #[test]
        fn the_derivative_by_damping_is_the_slope_of_the_motion(
            beta in -2.0..200.0f64, h in 1e-4..0.1f64, v in -10.0..10.0f64, a in -1e3..1e3f64,
        ) {
            let step = 1e-4 * (1.0 + beta.abs());
            let at = |beta: f64| Stretch::new(beta, h).travel(v, a);
            let (up, down) = (at(beta + step), at(beta - step));
            let (z, w) = Stretch::new(beta, h).of_beta(v, a, beta);
            let size = 1e-6 * h * (v.abs() + a.abs() * h) + 1e-9;
            prop_assert!(((up.0 - down.0) / (2.0 * step) - z).abs() < size);
            prop_assert!(((up.1 - down.1) / (2.0 * step) - w).abs() < 10.0 * size / h.min(1.0));
        }

        #[test]
        fn it_rests_when_it_stops(beta in 0.0..200.0f64, v in 0.01..20.0f64, a in -1e4..-1.0f64) {
            let t = stopping_time(v, a, beta);
            prop_assert!(t > 0.0);
            let (_, end) = Stretch::new(beta, t).travel(v, a);
            prop_assert!(end.abs() < 1e-9 * (v + 1.0), "{end}");
        }
    }
}
