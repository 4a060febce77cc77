//! Many loops of one body, the puck held, side by side: which of them grow, and how fast.
//!
//! A body on springs and dampers is five numbers ([`Loops`]), and a verdict on it takes no eigenvalue. With A μ² + B μ + C the
//! characteristic polynomial in μ = λ - 1, A > 0, both λ lie within the radius r = e^{gT} if and only if (Jury)
//!
//! ```text
//! C + B (r - 1) + A (r - 1)² > 0,    C - B (r + 1) + A (r + 1)² > 0,    B - C + A (r² - 1) > 0
//! ```
//!
//! | method | A | B | C | B - C |
//! | --- | --- | --- | --- | --- |
//! | forward Euler | J | D | K T² | T (C0 + T (C1 - K)) |
//! | semi-implicit Euler | J | D + K T² | K T² | D |
//! | backward Euler | J + D + K T² | D + 2 K T² | K T² | D + K T² |
//! | trapezoidal, tustin | J + D/2 + K T²/4 | D + K T² | K T² | D |
//!
//! with D = T (C0 + T C1). For zoh and foh, where ln |λ| is Re z, they become Hurwitz's, of J z² + D z + K T² shifted by gT, without
//! the second one. RK4 is asked by the |λ|² of a complex pair. Two radii, g = ±[`MARGINAL`], tell stable, marginal and unstable
//! apart.
//!
//! A loop that stands within rounding of an edge, and one whose numbers are out of proportion, is decided alone. So every verdict is
//! that of [`crate::held()`], and every growth has the bits of [`crate::held_growth()`].

use hapt_model::Method;
use nalgebra::Complex;
use pulp::{Arch, Simd, WithSimd};

use crate::stability::multiplier::{INSIDE, Root, excess, rk4_excess};
use crate::stability::single_body::Lone;
use crate::stability::{MARGINAL, Verdict, growth};

/// So many loops are looked at before those among them that have to be decided alone.
const BLOCK: usize = 64;

/// Rounding of a condition, relative to the sum of its terms: far more than what its dozen operations come to.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// K T²/J, from and to, of a loop in proportion; D/J up to the latter.
const PROPORTION: [f64; 2] = [1e-60, 1e30];
/// J of such a loop.
const INERTIA: [f64; 2] = [1e-200, 1e200];
/// T of such a loop, in s: up to here e^{±2gT} = 1 ± 2gT + 2(gT)² but for rounding.
const PERIOD: [f64; 2] = [1e-12, 10.0];

/// Loops of one body, the puck held, in SI: an entry a loop in each column.
#[derive(Clone, Copy, Debug)]
pub struct Loops<'a> {
    /// J, above 0.
    pub inertia: &'a [f64],
    /// K, the sum of the springs at the body.
    pub stiffness: &'a [f64],
    /// C0, the sum of the dampers at it that are what they are.
    pub fixed: &'a [f64],
    /// C1, per second of period, of those that follow the springs.
    pub following: &'a [f64],
    /// T in s.
    pub period: &'a [f64],
}

impl Loops<'_> {
    /// Of each loop 1 where it is unstable, 0 where it is marginal, -1 where it is stable; NaN where its numbers leave double
    /// precision. As many as the shortest column has.
    pub fn verdicts(&self, method: Method, out: &mut [f64]) {
        Arch::new().dispatch(Verdicts { loops: *self, method, out });
    }

    /// The growth of each loop in 1/s; NaN where it has none, or its numbers leave double precision.
    pub fn growths(&self, method: Method, out: &mut [f64]) {
        Arch::new().dispatch(Growths { loops: *self, method, out });
    }

    /// `quick` for each loop, then, where that is NaN or `always`, `slow` of it.
    #[inline(always)]
    fn each(
        &self,
        out: &mut [f64],
        quick: impl Fn(Lone, f64) -> f64 + Copy,
        slow: impl Fn(f64, Lone, f64) -> f64 + Copy,
        always: bool,
    ) {
        let columns = [self.inertia, self.stiffness, self.fixed, self.following, self.period];
        let count = columns.iter().fold(out.len(), |count, column| count.min(column.len()));
        let (blocks, rest) = out[..count].as_chunks_mut::<BLOCK>();
        let from = blocks.len() * BLOCK;
        let whole = |column| <[f64]>::as_chunks::<BLOCK>(column).0;
        let [inertia, stiffness, fixed, following, period] = columns;
        let each =
            whole(inertia).iter().zip(whole(stiffness)).zip(whole(fixed)).zip(whole(following)).zip(whole(period));
        for (out, ((((inertia, stiffness), fixed), following), period)) in blocks.iter_mut().zip(each) {
            of_block([inertia, stiffness, fixed, following, period], out, quick, slow, always);
        }
        if !rest.is_empty() {
            // A block with loops that nobody asked for.
            let filled = columns.map(|column| {
                let mut block = [1.0; BLOCK];
                block[..rest.len()].copy_from_slice(&column[from..count]);
                block
            });
            let mut block = [0.0; BLOCK];
            of_block(filled.each_ref(), &mut block, quick, slow, always);
            rest.copy_from_slice(&block[..rest.len()]);
        }
    }
}

#[inline(always)]
fn of_block(
    columns: [&[f64; BLOCK]; 5],
    out: &mut [f64; BLOCK],
    quick: impl Fn(Lone, f64) -> f64,
    slow: impl Fn(f64, Lone, f64) -> f64,
    always: bool,
) {
    let [inertia, stiffness, fixed, following, period] = columns;
    for (i, out) in out.iter_mut().enumerate() {
        let lone = Lone { inertia: inertia[i], stiffness: stiffness[i], fixed: fixed[i], following: following[i] };
        *out = quick(lone, period[i]);
    }
    if always || out.iter().filter(|x| x.is_nan()).count() > 0 {
        for (i, out) in out.iter_mut().enumerate().filter(|(_, out)| always || out.is_nan()) {
            let lone = Lone { inertia: inertia[i], stiffness: stiffness[i], fixed: fixed[i], following: following[i] };
            *out = slow(*out, lone, period[i]);
        }
    }
}

/// The number of a verdict: the sign of the growth, as far as it counts.
pub fn sign(verdict: Verdict) -> f64 {
    match verdict {
        Verdict::Stable => -1.0,
        Verdict::Marginal => 0.0,
        Verdict::Unstable => 1.0,
    }
}

struct Verdicts<'a> {
    loops: Loops<'a>,
    method: Method,
    out: &'a mut [f64],
}

impl WithSimd for Verdicts<'_> {
    type Output = ();

    /// Compiled for each width of vectors, and there for each method.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Verdicts { loops, method, out } = self;
        let alone = |_, lone: Lone, period| match lone.spectrum(method, period) {
            Some(found) => sign(Verdict::of(growth(&found.multipliers, period))),
            None => f64::NAN,
        };
        match method {
            Method::ForwardEuler => loops.each(
                out,
                #[inline(always)]
                |lone, t| Jury::forward(lone, t).verdict(t),
                alone,
                false,
            ),
            Method::SemiImplicitEuler => loops.each(
                out,
                #[inline(always)]
                |lone, t| Jury::implicit(lone, t).verdict(t),
                alone,
                false,
            ),
            Method::BackwardEuler => loops.each(
                out,
                #[inline(always)]
                |lone, t| Jury::backward(lone, t).verdict(t),
                alone,
                false,
            ),
            Method::Trapezoidal | Method::Tustin => {
                loops.each(
                    out,
                    #[inline(always)]
                    |lone, t| Jury::trapezoidal(lone, t).verdict(t),
                    alone,
                    false,
                );
            }
            Method::Zoh | Method::Foh => loops.each(
                out,
                #[inline(always)]
                |lone, t| Jury::exact(lone, t).verdict(t),
                alone,
                false,
            ),
            Method::Rk4 => loops.each(out, runge_kutta, alone, false),
        }
    }
}

struct Growths<'a> {
    loops: Loops<'a>,
    method: Method,
    out: &'a mut [f64],
}

impl WithSimd for Growths<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Growths { loops, method, out } = self;
        let alone = |lone: Lone, period| {
            let found = lone.spectrum(method, period);
            found.and_then(|found| growth(&found.multipliers, period)).unwrap_or(f64::NAN)
        };
        // A logarithm has no lanes.
        let logarithm = |excess: f64, lone, period| match excess {
            nothing if nothing.is_nan() => alone(lone, period),
            excess => 0.5 * excess.ln_1p() / period + 0.0,
        };
        macro_rules! of {
            ($method:expr) => {
                loops.each(
                    out,
                    #[inline(always)]
                    |lone, t| of_pair($method, lone, t, INSIDE),
                    logarithm,
                    true,
                )
            };
        }
        match method {
            Method::ForwardEuler => of!(Method::ForwardEuler),
            Method::SemiImplicitEuler => of!(Method::SemiImplicitEuler),
            Method::BackwardEuler => of!(Method::BackwardEuler),
            Method::Trapezoidal | Method::Tustin => of!(Method::Trapezoidal),
            Method::Rk4 => of!(Method::Rk4),
            Method::Zoh | Method::Foh => {
                // Twice the logarithm itself; a λ of 1e-12 and less does not count.
                loops.each(
                    out,
                    #[inline(always)]
                    |lone, t| 0.5 * of_pair(Method::Zoh, lone, t, -50.0) / t + 0.0,
                    |_, lone, period| alone(lone, period),
                    false,
                );
            }
        }
    }
}

/// Whether nothing in the loop's arithmetic comes near the ends of double precision.
#[inline(always)]
fn in_proportion(Lone { inertia, .. }: Lone, spring: f64, damper: f64, period: f64) -> bool {
    let (slow, fast) = (PROPORTION[0] * inertia, PROPORTION[1] * inertia);
    (INERTIA[0]..=INERTIA[1]).contains(&inertia)
        & (slow..=fast).contains(&spring)
        & (0.0..=fast).contains(&damper)
        & (PERIOD[0]..=PERIOD[1]).contains(&period)
}

/// |λ|² - 1 of a complex pair, in the operations of [`crate::stability::multiplier`]; NaN where it is none, or below `least`.
#[inline(always)]
fn of_pair(method: Method, lone: Lone, period: f64, least: f64) -> f64 {
    let Pair { root, is_one } = Pair::new(lone, period, matches!(method, Method::SemiImplicitEuler));
    let excess = excess(method, root);
    if is_one & (excess > least) { excess } else { f64::NAN }
}

/// A loop's complex pair.
struct Pair {
    root: Root,
    /// Whether it is one, and of a loop in proportion.
    is_one: bool,
}

impl Pair {
    #[inline(always)]
    fn new(lone: Lone, period: f64, implicit: bool) -> Self {
        let x = lone.frequency() * period;
        let d = lone.damping(period, x, implicit);
        let excess = Some(lone.excess(period, x, d, implicit));
        let half = 0.5 * d;
        // As in `eigen::pair`.
        let z = Complex::new(-half, ((x - half) * (x + half)).sqrt());
        let sound = in_proportion(lone, x * x * lone.inertia, d * lone.inertia, period);
        Pair { root: Root { z, square: x * x, excess }, is_one: sound & (half < x) }
    }
}

/// A verdict's number, and NaN where none of the three is certain.
#[inline(always)]
fn number(unstable: bool, marginal: bool, stable: bool) -> f64 {
    let sure = if stable { -1.0 } else { f64::NAN };
    let sure = if marginal { 0.0 } else { sure };
    if unstable { 1.0 } else { sure }
}

/// RK4, whose |λ|² - 1 is a sum of orders.
#[inline(always)]
fn runge_kutta(lone: Lone, period: f64) -> f64 {
    let Pair { root, is_one } = Pair::new(lone, period, false);
    let orders = rk4_excess(root);
    let (mut sum, mut size) = (0.0, 0.0);
    for order in orders.iter().rev() {
        sum += order;
        size += order.abs();
    }
    let gap = 2.0 * MARGINAL * period;
    let (high, low) = (gap + 0.5 * gap * gap, gap - 0.5 * gap * gap);
    let doubt = ROUNDING * (size + gap);
    let marginal = (sum < high - doubt) & (sum > doubt - low);
    number(is_one & (sum > high + doubt), is_one & marginal, is_one & (sum < -(low + doubt)))
}

/// The conditions of the module's head.
struct Jury {
    a: f64,
    b: f64,
    c: f64,
    /// B - C, without the subtraction.
    balance: f64,
    /// The sum of its terms.
    terms: f64,
    /// The polynomial at λ = -1, without subtractions that structure spares; infinite where that is no edge.
    alternating: f64,
    /// Whether the radius is e^{gT}, and not gT itself the bound.
    curved: bool,
    sound: bool,
}

impl Jury {
    /// K T² and D, and the conditions of a method that has nothing of its own.
    #[inline(always)]
    fn of(lone: Lone, t: f64) -> (f64, f64, Self) {
        let spring = t * t * lone.stiffness;
        let damper = t * (lone.fixed + t * lone.balanced().following);
        let sound = in_proportion(lone, spring, damper, t);
        let (a, b, c, balance, terms) = (lone.inertia, damper, spring, damper, damper);
        (spring, damper, Jury { a, b, c, balance, terms, alternating: f64::INFINITY, curved: true, sound })
    }

    #[inline(always)]
    fn forward(lone: Lone, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(lone, t);
        let balance = t * (lone.fixed + t * (lone.balanced().following - lone.stiffness));
        let alternating = 4.0 * of.a + spring - 2.0 * damper;
        Jury { balance, terms: damper + spring, alternating, ..of }
    }

    #[inline(always)]
    fn implicit(lone: Lone, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(lone, t);
        Jury { b: damper + spring, alternating: 4.0 * of.a - spring - 2.0 * damper, ..of }
    }

    #[inline(always)]
    fn backward(lone: Lone, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(lone, t);
        let balance = damper + spring;
        let alternating = 4.0 * of.a + 2.0 * damper + spring;
        Jury { a: of.a + balance, b: balance + spring, balance, terms: balance, alternating, ..of }
    }

    #[inline(always)]
    fn trapezoidal(lone: Lone, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(lone, t);
        let alternating = 4.0 * of.a;
        Jury { a: of.a + 0.5 * damper + 0.25 * spring, b: damper + spring, alternating, ..of }
    }

    #[inline(always)]
    fn exact(lone: Lone, t: f64) -> Self {
        Jury { curved: false, ..Jury::of(lone, t).2 }
    }

    #[inline(always)]
    fn verdict(self, period: f64) -> f64 {
        let Jury { a, b, c, balance, terms, alternating, curved, sound } = self;
        // r² - 1 at both radii.
        let gap = 2.0 * MARGINAL * period;
        let more = if curved { 0.5 * gap * gap } else { 0.0 };
        let (high, low) = (a * (gap + more), a * (gap - more));
        let doubt = ROUNDING * (terms + a * gap);
        // Near +1 and near -1 it is enough to be clear of both radii.
        let clear = c > gap * b;
        let near = (4.0 * a + c + 2.0 * b) * (ROUNDING + 2.0 * gap);
        let (passes, stays) = (alternating < -near, alternating > near);
        let unstable = passes | (balance < -(high + doubt));
        let marginal = stays & (balance > doubt - high) & (balance < low - doubt);
        let stable = stays & clear & (balance > low + doubt);
        number(sound & unstable, sound & marginal, sound & stable)
    }
}
