//! Discrete eigenvalues of the methods.
//!
//! A method maps an eigenvalue s of the differential equation of the held world to λ = R(Ts). The distance of |λ| from 1 decides:
//! a wheel that grows by 1e-9 per second at 1 ms has |λ| - 1 = 1e-12. λ is therefore stored as λ - 1 and ln |λ|, both computed from
//! z = Ts without subtracting numbers near 1. Where the real part of z is 0 by structure, ln |λ| is exactly 0 under the methods
//! that preserve the energy of a lossless world.

use hapt_model::Method;
use nalgebra::Complex;

/// The roots of z² + d z + x² for x > 0, d ≥ 0: z = Ts of a mode of frequency x/T and damping d/T that is coupled to no other.
pub(crate) fn pair(x: f64, d: f64) -> [Root; 2] {
    let half = 0.5 * d;
    if half < x {
        let z = Complex::new(-half, ((x - half) * (x + half)).sqrt());
        return [z, z.conj()].map(|z| Root { z, square: x * x, excess: None });
    }
    let far = -(half + ((half - x) * (half + x)).sqrt());
    [far, x * (x / far)].map(|z| Root { z: Complex::new(z, 0.0), square: z * z, excess: None })
}

/// z = Ts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root {
    pub z: Complex<f64>,
    /// |z|², which is more accurate than its two parts for a mode that is coupled to no other.
    pub square: f64,
    /// |1 + z|² - 1, where it is known more accurately than as 2 Re z + |z|².
    pub excess: Option<f64>,
}

impl From<Complex<f64>> for Root {
    fn from(z: Complex<f64>) -> Self {
        Root { z, square: z.norm_sqr(), excess: None }
    }
}

/// A discrete eigenvalue λ, per sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Multiplier {
    /// λ - 1.
    pub less_one: Complex<f64>,
    /// ln |λ|; -∞ for λ = 0.
    pub ln_abs: f64,
}

impl Multiplier {
    /// λ = 1 exactly.
    pub const ONE: Multiplier = Multiplier { less_one: Complex::new(0.0, 0.0), ln_abs: 0.0 };

    /// λ.
    pub fn value(&self) -> Complex<f64> {
        self.less_one + 1.0
    }

    /// |λ|.
    pub fn abs(&self) -> f64 {
        self.ln_abs.exp()
    }

    /// arg λ in rad, from -π to π.
    pub fn arg(&self) -> f64 {
        self.value().arg()
    }

    /// Whether all parts are within double precision; λ = 0 is.
    pub(crate) fn is_representable(&self) -> bool {
        self.less_one.re.is_finite() && self.less_one.im.is_finite() && self.ln_abs < f64::INFINITY
    }

    /// ln |λ|/T in 1/s.
    pub fn growth(&self, period: f64) -> f64 {
        self.ln_abs / period
    }
}

/// λ of a method at z = Ts. For semi-implicit Euler, z is that of the equation with T K added to the damping (see
/// [`crate::stability::critical`]), on which it acts as forward Euler.
pub(crate) fn multiplier(method: Method, root: Root) -> Multiplier {
    let z = root.z;
    let less_one = match method {
        Method::ForwardEuler | Method::SemiImplicitEuler => z,
        Method::BackwardEuler => z / (1.0 - z),
        Method::Trapezoidal | Method::Tustin => z / (1.0 - 0.5 * z),
        Method::Zoh | Method::Foh => {
            // e^z - 1 = (e^a - 1) cos b + (cos b - 1) + j e^a sin b
            let sin = (0.5 * z.im).sin();
            let re = z.re.exp_m1() * z.im.cos() - 2.0 * sin * sin;
            return Multiplier { less_one: Complex::new(re, z.re.exp() * z.im.sin()), ln_abs: z.re };
        }
        Method::Rk4 => z * (1.0 + 0.5 * z * (1.0 + z / 3.0 * (1.0 + 0.25 * z))),
    };
    let excess = excess(method, root);
    // Far inside the circle |λ|² - 1 rounds to -1, and λ itself is more accurate. Far outside both are accurate.
    let ln_abs = if excess > INSIDE { 0.5 * excess.ln_1p() } else { (less_one + 1.0).norm().ln() };
    Multiplier { less_one, ln_abs }
}

/// The smallest |λ|² - 1 from which ln |λ| is computed.
pub(crate) const INSIDE: f64 = -0.5;

/// |λ|² - 1, without the exponential of zoh and foh: 2 ln |λ| for these.
#[inline(always)]
pub(crate) fn excess(method: Method, root: Root) -> f64 {
    let Root { z, square, excess } = root;
    match method {
        Method::ForwardEuler | Method::SemiImplicitEuler => excess.unwrap_or(2.0 * z.re + square),
        Method::BackwardEuler => (2.0 * z.re - square) / (1.0 - z).norm_sqr(),
        Method::Trapezoidal | Method::Tustin => 2.0 * z.re / (1.0 - 0.5 * z).norm_sqr(),
        Method::Zoh | Method::Foh => 2.0 * z.re,
        Method::Rk4 => rk4_excess(root).iter().rev().fold(0.0, |sum, c| sum + c),
    }
}

/// |R(z)|² - 1 of RK4 by its orders 1 to 8 in z. Up to order 4 they are those of |e^z|² = e^{2 Re z}; from there on some terms
/// of the product are missing. For Re z = 0 there remains -x⁶/72 + x⁸/576.
#[inline(always)]
pub(crate) fn rk4_excess(Root { z, square, .. }: Root) -> [f64; 8] {
    let a = 2.0 * z.re;
    let (z2, z3) = (z * z, z * z * z);
    [
        a,
        a * a / 2.0,
        a * a * a / 6.0,
        a * a * a * a / 24.0,
        square * (z3.re / 12.0 + square * z.re / 6.0),
        square * square * (z2.re / 24.0 + square / 36.0),
        square * square * square * z.re / 72.0,
        square * square * square * square / 576.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn rk4s_orders_sum_to_its_modulus(re in -2.0..0.5f64, im in -2.0..2.0f64) {
            let z = Complex::new(re, im);
            let r: Complex<f64> = 1.0 + z + z.powi(2) / 2.0 + z.powi(3) / 6.0 + z.powi(4) / 24.0;
            let excess: f64 = rk4_excess(z.into()).iter().sum();
            prop_assert!((excess - (r.norm_sqr() - 1.0)).abs() < 1e-12);
        }
    }
}
