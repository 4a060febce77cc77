//! The numbers a loop can run on.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number, or several side by side ([`crate::Lanes`]): the operations that a sample needs. None of them branches on a number: each
/// chooses between two computed numbers, so that lanes with different results stay together.
pub trait Number:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;
    /// 1/2
    const HALF: Self;
    /// Whether it is several numbers, a vector by itself.
    const IS_VECTOR: bool = false;
    /// Rounds to the nearest.
    fn from_f64(x: f64) -> Self;
    /// The largest whole number that is not greater.
    fn floor(self) -> Self;
    /// The nearest number within ±`limit`, which is not negative; NaN stays.
    fn within(self, limit: Self) -> Self;
    /// Itself, or 0 in place of what is infinite or NaN.
    fn finite_or_zero(self) -> Self;
    /// `yes` where it is greater than `bound`, else `no`; NaN is never greater.
    fn if_above(self, bound: Self, yes: Self, no: Self) -> Self;
    /// |x|
    fn abs(self) -> Self;
    /// sin x
    fn sin(self) -> Self;
    /// e^x
    fn exp(self) -> Self;
    /// e^x - 1, good near 0
    fn expm1(self) -> Self;
    /// √x, correctly rounded
    fn sqrt(self) -> Self;
}

/// `f32` or `f64`. Their functions are only libm's: the standard library's differ between machines.
pub trait Real: Number + PartialOrd {
    /// From 1 to the next number.
    const EPSILON: Self;
    /// The largest number.
    const MAX: Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

macro_rules! real {
    ($float:ty, $floor:path, $fabs:path, $sin:path, $exp:path, $expm1:path, $sqrt:path) => {
        impl Number for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const HALF: Self = 0.5;
            #[inline]
            fn from_f64(x: f64) -> Self {
                x as $float
            }
            #[inline]
            fn floor(self) -> Self {
                $floor(self)
            }
            #[inline]
            fn within(self, limit: Self) -> Self {
                let x = if self > limit { limit } else { self };
                if x < -limit { -limit } else { x }
            }
            #[inline]
            fn finite_or_zero(self) -> Self {
                if <$float>::is_finite(self) { self } else { 0.0 }
            }
            #[inline]
            fn if_above(self, bound: Self, yes: Self, no: Self) -> Self {
                if self > bound { yes } else { no }
            }
            #[inline]
            fn abs(self) -> Self {
                $fabs(self)
            }
            #[inline]
            fn sin(self) -> Self {
                $sin(self)
            }
            #[inline]
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline]
            fn expm1(self) -> Self {
                $expm1(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
        }

        impl Real for $float {
            const EPSILON: Self = <$float>::EPSILON;
            const MAX: Self = <$float>::MAX;
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn is_finite(self) -> bool {
                <$float>::is_finite(self)
            }
        }
    };
}

real!(f32, libm::floorf, libm::fabsf, libm::sinf, libm::expf, libm::expm1f, libm::sqrtf);
real!(f64, libm::floor, libm::fabs, libm::sin, libm::exp, libm::expm1, libm::sqrt);
