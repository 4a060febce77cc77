//! A number that is N numbers, for many worlds side by side.
//!
//! A sample does not branch on its numbers, so it runs on N of them at once, in the same source, and each lane does the same operations as
//! a single number: the same bits. The loops over the lanes are plain ones, which a compiler turns into vectors as wide as the machine has
//! them. Where a law depends on a comparison it chooses between two computed numbers ([`Number::if_above`]).

use core::array::from_fn;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use crate::Number;

/// N numbers, each in its own lane.
///
/// ```
/// use hapt_core::{Lanes, Number};
///
/// let x = Lanes([1.5, -2.5]) * Lanes([2.0, 2.0]) + Lanes::ONE;
/// assert_eq!(x.within(Lanes([3.0, 5.0])), Lanes([3.0, -4.0]));
/// ```
// In memory a vector then lies in one cache line: across two it takes twice as long.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const N: usize>(pub [f64; N]);

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Lanes(from_fn(|i| f(self.0[i])))
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Lanes(from_fn(|i| f(self.0[i], other.0[i])))
    }

    /// `other` in the lanes in which it is the larger; NaN is never larger.
    #[inline(always)]
    pub fn larger(self, other: Self) -> Self {
        self.zip(other, |x, y| if y > x { y } else { x })
    }

    /// `yes` in the lanes that are not 0, `no` in the others.
    #[inline(always)]
    pub fn choose(self, yes: Self, no: Self) -> Self {
        Lanes(from_fn(|i| if self.0[i] != 0.0 { yes.0[i] } else { no.0[i] }))
    }
}

macro_rules! lane_by_lane {
    ($($trait:ident $function:ident $op:tt),*) => {$(
        impl<const N: usize> $trait for Lanes<N> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.zip(other, |x, y| x $op y)
            }
        }
    )*};
}

lane_by_lane!(Add add +, Sub sub -, Mul mul *, Div div /);

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

impl<const N: usize> AddAssign for Lanes<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Lanes<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// Every choice is between two computed numbers, and each step is a loop of its own, so that it compiles to vector instructions. Functions
/// of libm run lane after lane, out of line: libm has no vector instructions.
impl<const N: usize> Number for Lanes<N> {
    const ZERO: Self = Lanes([0.0; N]);
    const ONE: Self = Lanes([1.0; N]);
    const HALF: Self = Lanes([0.5; N]);
    const IS_VECTOR: bool = true;

    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Lanes([x; N])
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // From here on every double is whole; below, adding it and taking it away again leaves the nearest whole number.
        const WHOLE: f64 = 4_503_599_627_370_496.0;
        let nearest = self.map(|x| x + libm::copysign(WHOLE, x)).zip(self, |sum, x| sum - libm::copysign(WHOLE, x));
        let below = nearest.zip(self, |n, x| n - if n > x { 1.0 } else { 0.0 });
        // -0 is its own floor. NaN and infinity are not smaller than WHOLE either.
        let signed = below.zip(self, libm::copysign);
        signed.zip(self, |n, x| if libm::fabs(x) < WHOLE { n } else { x })
    }

    #[inline(always)]
    fn within(self, limit: Self) -> Self {
        let below = self.zip(limit, |x, limit| if x > limit { limit } else { x });
        below.zip(limit, |x, limit| if x < -limit { -limit } else { x })
    }

    #[inline(always)]
    fn finite_or_zero(self) -> Self {
        self.map(|x| if libm::fabs(x) < f64::INFINITY { x } else { 0.0 })
    }

    #[inline(always)]
    fn if_above(self, bound: Self, yes: Self, no: Self) -> Self {
        Lanes(from_fn(|i| if self.0[i] > bound.0[i] { yes.0[i] } else { no.0[i] }))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.map(libm::fabs)
    }

    #[inline(never)]
    fn sin(self) -> Self {
        self.map(libm::sin)
    }

    #[inline(never)]
    fn exp(self) -> Self {
        self.map(libm::exp)
    }

    #[inline(never)]
    fn expm1(self) -> Self {
        self.map(libm::expm1)
    }

    #[inline(never)]
    fn sqrt(self) -> Self {
        self.map(libm::sqrt)
    }
}

/// A number of each of N worlds or laws. Out of line: N copies for each number of a world were a third of what a batch takes to compile.
#[inline(never)]
pub(crate) fn each<T, const N: usize>(all: &[T; N], of: &dyn Fn(&T) -> f64) -> Lanes<N> {
    Lanes(from_fn(|i| of(&all[i])))
}
