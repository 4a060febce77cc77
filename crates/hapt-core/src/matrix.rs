//! Positions and velocities of up to B bodies, and the matrices that act on them, in blocks of B so that both fit fixed sizes.
//! Only the first `n` of each block are in use. Every sum runs only over those, in one order, so that results are bit-identical for every
//! capacity; the sums of unused places are zeros, computed too where that is faster than a branch. Functions that are always inlined are
//! compiled with the vector instructions of their caller: see [`crate::Lanes`].

use crate::{Number, Real};

/// Does the work at each of L places; with vectors only at the first n, where there are few. These have no loop around them: a compiler
/// would make vectors across the places, and gather their numbers one by one. A macro, so that the work stays where it is compiled with
/// vector instructions.
macro_rules! each_place {
    ($F:ty, $L:expr, $n:expr, $i:ident => $work:expr) => {
        if <$F>::IS_VECTOR && $L <= 4 {
            each_place!($L, $n, $i => $work, 0 1 2 3);
        } else {
            for $i in 0..$L {
                $work
            }
        }
    };
    ($L:expr, $n:expr, $i:ident => $work:expr, $($place:literal)*) => {$(
        if $place < $L && ($place == 0 || $place < $n) {
            let $i = $place;
            $work
        }
    )*};
}
pub(crate) use each_place;

/// Positions and velocities of the bodies, in rad and rad/s (linear: m and m/s), in the order of the spec.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "F: serde::Serialize", deserialize = "F: crate::Number + serde::Deserialize<'de>"))
)]
pub struct Vector<F, const B: usize> {
    /// w
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub position: [F; B],
    /// ẇ
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub velocity: [F; B],
}

impl<F: Number, const B: usize> Vector<F, B> {
    pub(crate) const ZERO: Self = Vector { position: [F::ZERO; B], velocity: [F::ZERO; B] };

    /// self += factor · other
    #[inline(always)]
    pub(crate) fn add(&mut self, n: usize, factor: F, other: &Self) {
        if F::IS_VECTOR && B < ROWS {
            return each_place!(F, B, n, i => {
                self.position[i] += factor * other.position[i];
                self.velocity[i] += factor * other.velocity[i];
            });
        }
        let places = if B < ROWS && n != 1 { B } else { n };
        for (x, y) in self.position.iter_mut().zip(&other.position).take(places) {
            *x += factor * *y;
        }
        for (x, y) in self.velocity.iter_mut().zip(&other.velocity).take(places) {
            *x += factor * *y;
        }
    }

    /// The places of L bodies from the one at `at` on; there must be as many.
    #[inline(always)]
    pub(crate) fn rows<const L: usize>(&self, at: usize) -> Vector<F, L> {
        let of = |x: &[F; B]| x.get(at..).and_then(|x| x.first_chunk()).copied().unwrap_or([F::ZERO; L]);
        Vector { position: of(&self.position), velocity: of(&self.velocity) }
    }

    /// Puts them there.
    #[inline(always)]
    pub(crate) fn set_rows<const L: usize>(&mut self, at: usize, rows: &Vector<F, L>) {
        for (x, rows) in [(&mut self.position, &rows.position), (&mut self.velocity, &rows.velocity)] {
            if let Some(x) = x.get_mut(at..).and_then(|x| x.first_chunk_mut()) {
                *x = *rows;
            }
        }
    }

    pub(crate) fn map<G: Number>(&self, f: impl Fn(F) -> G) -> Vector<G, B> {
        Vector { position: self.position.map(&f), velocity: self.velocity.map(&f) }
    }
}

impl<F: Real, const B: usize> Vector<F, B> {
    pub(crate) fn is_finite(&self) -> bool {
        self.position.iter().chain(&self.velocity).all(|x| x.is_finite())
    }
}

/// The sums of this many bodies stay in registers while a matrix's columns are added.
pub(crate) const ROWS: usize = 8;

/// The effect of one body's position and velocity, or of the puck's, on all bodies: two columns of a matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response<F, const B: usize> {
    pub position: Vector<F, B>,
    pub velocity: Vector<F, B>,
}

impl<F: Number, const B: usize> Response<F, B> {
    /// sums += response to a position and a velocity, for L bodies from the one at `at` on, of n in all
    #[inline(always)]
    pub fn apply<const L: usize>(&self, n: usize, at: usize, position: F, velocity: F, sums: &mut Vector<F, L>) {
        let (p, v) = (self.position.rows::<L>(at), self.velocity.rows::<L>(at));
        each_place!(F, L, n, i => {
            sums.position[i] += p.position[i] * position + v.position[i] * velocity;
            sums.velocity[i] += p.velocity[i] * position + v.velocity[i] * velocity;
        });
    }
}

impl<F: Real, const B: usize> Response<F, B> {
    pub fn is_finite(&self) -> bool {
        self.position.is_finite() && self.velocity.is_finite()
    }
}

/// The first n places of a block of B. The range itself ends at B, so that every compiler sees each index within the block: `0..n.min(B)` is
/// as safe, but compilers that lose the minimum on their way leave a bounds check there, and a panic behind it.
#[inline(always)]
pub(crate) fn places<const B: usize>(n: usize) -> impl Iterator<Item = usize> {
    places_from::<B>(0, n)
}

/// Those from `first` on.
#[inline(always)]
pub(crate) fn places_from<const B: usize>(first: usize, n: usize) -> impl Iterator<Item = usize> {
    (first..B).take_while(move |i| *i < n)
}

/// One block of B rows and columns.
pub(crate) type Block<F, const B: usize> = [[F; B]; B];

/// The effect of a vector of B numbers (the torques on the bodies) on positions and velocities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Half<F, const B: usize> {
    pub position: Block<F, B>,
    pub velocity: Block<F, B>,
}

impl<F: Real, const B: usize> Half<F, B> {
    pub const ZERO: Self = Half { position: [[F::ZERO; B]; B], velocity: [[F::ZERO; B]; B] };

    /// out += self · x
    #[inline]
    pub fn apply(&self, n: usize, x: &[F; B], out: &mut Vector<F, B>) {
        for i in places::<B>(n) {
            let (mut position, mut velocity) = (F::ZERO, F::ZERO);
            for (j, &x) in x.iter().enumerate().take(n) {
                position += self.position[i][j] * x;
                velocity += self.velocity[i][j] * x;
            }
            out.position[i] += position;
            out.velocity[i] += velocity;
        }
    }

    /// The effect of the j-th number of the vector.
    pub fn column(&self, j: usize) -> Vector<F, B> {
        let of = |rows: &Block<F, B>| rows.map(|row| row.get(j).copied().unwrap_or(F::ZERO));
        Vector { position: of(&self.position), velocity: of(&self.velocity) }
    }

    pub fn map<G: Real>(&self, f: impl Fn(F) -> G) -> Half<G, B> {
        Half { position: self.position.map(|row| row.map(&f)), velocity: self.velocity.map(|row| row.map(&f)) }
    }

    pub fn is_finite(&self) -> bool {
        self.position.iter().chain(&self.velocity).flatten().all(|x| x.is_finite())
    }
}

/// A matrix on the bodies' state: the effect of positions, and that of velocities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<F, const B: usize> {
    pub from_position: Half<F, B>,
    pub from_velocity: Half<F, B>,
}

impl<F: Real, const B: usize> Matrix<F, B> {
    pub const ZERO: Self = Matrix { from_position: Half::ZERO, from_velocity: Half::ZERO };

    /// out += self · x
    #[inline]
    pub fn apply(&self, n: usize, x: &Vector<F, B>, out: &mut Vector<F, B>) {
        self.from_position.apply(n, &x.position, out);
        self.from_velocity.apply(n, &x.velocity, out);
    }

    pub fn map<G: Real>(&self, f: impl Fn(F) -> G) -> Matrix<G, B> {
        Matrix { from_position: self.from_position.map(&f), from_velocity: self.from_velocity.map(&f) }
    }

    pub fn is_finite(&self) -> bool {
        self.from_position.is_finite() && self.from_velocity.is_finite()
    }
}

/// Factors a symmetric positive definite matrix in place, L Lᵀ in the lower triangle. `None` when it is not (or not finite).
pub(crate) fn cholesky<const B: usize>(n: usize, a: &mut Block<f64, B>) -> Option<()> {
    for j in places::<B>(n) {
        let mut pivot = a[j][j];
        for k in places::<B>(j) {
            pivot -= a[j][k] * a[j][k];
        }
        // A NaN must fail too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let pivot = libm::sqrt(pivot);
        a[j][j] = pivot;
        for i in places_from::<B>(j + 1, n) {
            let mut x = a[i][j];
            for k in places::<B>(j) {
                x -= a[i][k] * a[j][k];
            }
            a[i][j] = x / pivot;
        }
    }
    Some(())
}

/// Solves L Lᵀ x = b for every column of b, in place.
pub(crate) fn cholesky_solve<const B: usize>(n: usize, l: &Block<f64, B>, b: &mut Block<f64, B>) {
    let entry = |i: usize, k: usize| l.get(i).and_then(|row| row.get(k)).copied().unwrap_or(0.0);
    for i in places::<B>(n) {
        solve_row(n, i, places::<B>(i).map(|k| (k, entry(i, k))), entry(i, i), b);
    }
    for i in (0..B).rev().filter(|i| *i < n) {
        solve_row(n, i, places_from::<B>(i + 1, n).map(|k| (k, entry(k, i))), entry(i, i), b);
    }
}

/// b_i = (b_i - Σ factor_k b_k)/pivot, for rows of b.
fn solve_row<const B: usize>(
    n: usize,
    i: usize,
    factors: impl Iterator<Item = (usize, f64)>,
    pivot: f64,
    b: &mut Block<f64, B>,
) {
    let mut row = b.get(i).copied().unwrap_or([0.0; B]);
    for (k, factor) in factors {
        for (x, known) in row.iter_mut().zip(b.get(k).unwrap_or(&[0.0; B])).take(n) {
            *x -= factor * *known;
        }
    }
    row.iter_mut().take(n).for_each(|x| *x /= pivot);
    if let Some(place) = b.get_mut(i) {
        *place = row;
    }
}
