//! Truncated power series with a bound on the remainder: the range of a function over an interval, without a grid
//! (Makino and Berz, "Taylor models", Int. J. Pure Appl. Math. 4(4), 2003).

use nalgebra::Complex;

type C = Complex<f64>;

/// Number of terms over an interval. One term is the value at a point.
pub(crate) const TERMS: usize = 8;

/// An upper bound of |c|; `hypot` would take half of the time of a proof. Where the squares underflow, the bound is the sum of both parts;
/// where they are too large, it is infinite.
fn norm(c: C) -> f64 {
    let square = c.re * c.re + c.im * c.im;
    if square > 1e-290 { square.sqrt() * (1.0 + 2.0 * f64::EPSILON) } else { c.re.abs() + c.im.abs() }
}

/// f(φ0 + r u) = Σ c\[k\] u^k, to within `rest` for all real |u| ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Series<const N: usize> {
    pub c: [C; N],
    pub rest: f64,
}

impl<const N: usize> Series<N> {
    pub const ZERO: Self = Series { c: [C::new(0.0, 0.0); N], rest: 0.0 };

    pub fn constant(value: C) -> Self {
        let mut s = Self::ZERO;
        s.c[0] = value;
        s
    }

    /// scale · e^{j n r u}, n of either sign.
    pub fn turn(scale: C, n: f64, r: f64) -> Self {
        let mut s = Self::constant(scale);
        let step = n * r;
        for k in 1..N {
            let last = s.c[k - 1] * (step / k as f64);
            s.c[k] = C::new(-last.im, last.re);
        }
        // The remainder of e^{jx} for a real x is below its first term.
        s.rest = norm(s.c[N - 1]) * step.abs() / N as f64;
        s
    }

    pub fn is_zero(&self) -> bool {
        *self == Self::ZERO
    }

    /// self + factor · other
    pub fn add(&mut self, factor: C, other: &Self) {
        self.c.iter_mut().zip(&other.c).for_each(|(a, b)| *a += factor * b);
        self.rest += norm(factor) * other.rest;
    }

    pub fn times(&self, other: &Self) -> Self {
        let mut product = Self::ZERO;
        let (a, b) = (self.c.map(norm), other.c.map(norm));
        // The sum of the last n terms of the other factor.
        let (mut last, mut left) = (0.0, 0.0);
        for i in 0..N {
            let (kept, _) = other.c.split_at(N - i);
            product.c[i..].iter_mut().zip(kept).for_each(|(sum, d)| *sum += self.c[i] * d);
            left += a[i] * last;
            last += b[N - 1 - i];
        }
        product.rest = left + a.iter().sum::<f64>() * other.rest + self.rest * (last + other.rest);
        product
    }

    /// The series of the complex conjugate.
    pub fn conjugate(&self) -> Self {
        Series { c: self.c.map(|c| c.conj()), rest: self.rest }
    }

    /// Re f as a real polynomial with the same remainder.
    pub fn real(&self) -> Real<N> {
        Real { c: self.c.map(|c| c.re), rest: self.rest }
    }
}

/// 1/(q + e^{jru} - 1) over |u| ≤ 1, for many q at one r.
pub(crate) struct Inverse<const N: usize> {
    r: f64,
    /// e^{jru} - 1, from order 1 on.
    turn: Series<N>,
}

impl<const N: usize> Inverse<N> {
    pub fn new(r: f64) -> Self {
        let mut turn = Series::turn(C::new(1.0, 0.0), 1.0, r);
        turn.c[0] = C::new(0.0, 0.0);
        Inverse { r, turn }
    }

    /// The series; `None` when the interval is too long for it.
    pub fn of(&self, q: C) -> Option<Series<N>> {
        let near = q.norm() - self.r;
        if near <= 0.1 * self.r {
            return None;
        }
        let mut s = Series::constant(1.0 / q);
        let first = s.c[0];
        for k in 1..N {
            let sum = (1..=k).fold(C::new(0.0, 0.0), |sum, j| sum + self.turn.c[j] * s.c[k - j]);
            s.c[k] = -first * sum;
        }
        // 1 - (q + turn) s is the remainder of the product beyond the last term.
        let norms = s.c.map(norm);
        let mut left = self.turn.rest * norms.iter().sum::<f64>();
        let mut power = 1.0;
        for j in 1..N {
            // |turn.c[j]| = r^j/j!
            power *= self.r / j as f64;
            left += power * norms[N - j..].iter().sum::<f64>();
        }
        s.rest = left / near;
        Some(s)
    }
}

/// A truncated series of a real function over an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Real<const N: usize> {
    pub c: [f64; N],
    pub rest: f64,
}

impl<const N: usize> Real<N> {
    pub const ZERO: Self = Real { c: [0.0; N], rest: 0.0 };

    /// factor · self, for a factor that is not negative.
    pub fn scaled(mut self, factor: f64) -> Self {
        self.c.iter_mut().for_each(|c| *c *= factor);
        self.rest *= factor;
        self
    }

    /// self + factor · other
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = *self;
        sum.c.iter_mut().zip(&other.c).for_each(|(a, b)| *a += factor * b);
        sum.rest += factor.abs() * other.rest;
        sum
    }

    pub fn at(&self, u: f64) -> f64 {
        self.c.iter().rev().fold(0.0, |sum, c| sum * u + c)
    }

    /// An upper bound over the interval, for three terms at least.
    pub fn upper(&self) -> f64 {
        let (first, others) = self.c.split_at(3);
        let u = self.vertex();
        first[0] + (first[1] * u + first[2] * u * u) + others.iter().map(|c| c.abs()).sum::<f64>() + self.rest
    }

    /// The argument in \[-1, 1\] at which the first three terms have their maximum.
    pub fn vertex(&self) -> f64 {
        let (c1, c2) = (self.c[1], self.c[2]);
        if c2 < 0.0 && c1.abs() < -2.0 * c2 {
            -0.5 * c1 / c2
        } else if c1 == 0.0 {
            c2.signum()
        } else {
            c1.signum()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn what_a_series_leaves_out_is_within_its_bound(q in (-1.0..1.0f64, -1.0..1.0f64), n in -9.0..9.0f64, part in 0.01..0.8f64, u in -1.0..1.0f64) {
            let q = C::new(q.0, q.1);
            let r = part * q.norm();
            let turned = |n: f64| C::from_polar(1.0, n * r * u);
            let size = |s: &Series<TERMS>| s.c.iter().map(|c| c.norm()).sum::<f64>() + s.rest;
            let close = |s: &Series<TERMS>, value: C| {
                let sum = s.c.iter().rev().fold(C::new(0.0, 0.0), |sum, c| sum * u + c);
                (sum - value).norm() <= s.rest + 1e-13 * size(s)
            };
            let inverse = Inverse::new(r).of(q).unwrap();
            let turn = Series::turn(C::new(0.3, 2.0), n, r);
            let (a, b) = (1.0 / (q + turned(1.0) - 1.0), C::new(0.3, 2.0) * turned(n));
            prop_assert!(close(&inverse, a) && close(&turn, b));
            let product = inverse.times(&turn.conjugate());
            prop_assert!(close(&product, a * b.conj()));
            prop_assert!(product.real().upper() >= (a * b.conj()).re - 1e-13 * size(&product));
            prop_assert!(product.real().plus(-2.0, &inverse.real()).upper() >= (a * b.conj() - 2.0 * a).re - 1e-12 * size(&product));
        }
    }
}
