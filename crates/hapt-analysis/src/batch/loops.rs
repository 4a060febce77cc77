//! Batches of loops of one body, the puck held: their verdicts and growths in vector lanes.
//!
//! A body on springs and dampers is five numbers ([`Loops`]), and its verdict requires no eigenvalue. With A μ² + B μ + C the
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
//! with D = T (C0 + T C1). For zoh and foh, where ln |λ| is Re z, they become Hurwitz's conditions of J z² + D z + K T² shifted by
//! gT, without the second one. RK4 uses |λ|² of a complex pair. Two radii, g = ±[`MARGINAL`], separate stable, marginal and
//! unstable.
//!
//! A loop within rounding of a boundary, or with numbers of extreme magnitude, is decided individually. Every verdict is therefore
//! that of [`crate::held()`], and every growth has the bits of [`crate::held_growth()`].

use hapt_model::Method;
use hapt_model::vectors::with_vectors;
use nalgebra::Complex;

use crate::stability::multiplier::{INSIDE, Root, excess, rk4_excess};
use crate::stability::single_body::SingleBody;
use crate::stability::{MARGINAL, Verdict, growth};

/// Number of loops in a block. After each block, the undecided loops in it are decided individually.
const BLOCK: usize = 64;

/// Error bound of a condition, relative to the sum of its terms: well above the rounding of its dozen operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Range of K T²/J in the batch; the upper bound holds for D/J too.
const STIFFNESS: [f64; 2] = [1e-60, 1e30];
/// Range of J in the batch.
const INERTIA: [f64; 2] = [1e-200, 1e200];
/// Range of T in the batch, in s: within it e^{±2gT} = 1 ± 2gT + 2(gT)², up to rounding.
const PERIOD: [f64; 2] = [1e-12, 10.0];

/// Loops of one body, the puck held, in SI: one entry per loop in each column.
#[derive(Clone, Copy, Debug)]
pub struct Loops<'a> {
    /// J, above 0.
    pub inertia: &'a [f64],
    /// K, the sum of the springs at the body.
    pub stiffness: &'a [f64],
    /// C0, the sum of the fixed dampers at the body.
    pub fixed: &'a [f64],
    /// C1, the compensating dampers at the body, per second of period.
    pub per_period: &'a [f64],
    /// T in s.
    pub period: &'a [f64],
}

impl Loops<'_> {
    /// The verdicts: 1 unstable, 0 marginal, -1 stable; NaN where the numbers leave double precision. As many as the shortest column
    /// has.
    pub fn verdicts(&self, method: Method, out: &mut [f64]) {
        let ran = with_vectors(
            #[inline(always)]
            || self.verdicts_of(method, out),
        );
        if ran.is_none() {
            self.verdicts_of(method, out);
        }
    }

    /// The growth of each loop in 1/s; NaN where all eigenvalues are 0, or the numbers leave double precision.
    pub fn growths(&self, method: Method, out: &mut [f64]) {
        let ran = with_vectors(
            #[inline(always)]
            || self.growths_of(method, out),
        );
        if ran.is_none() {
            self.growths_of(method, out);
        }
    }

    /// Evaluates `quick` for each loop, then `slow` where the result is NaN, or for each loop with `always`.
    #[inline(always)]
    fn each(
        &self,
        out: &mut [f64],
        quick: impl Fn(SingleBody, f64) -> f64 + Copy,
        slow: impl Fn(f64, SingleBody, f64) -> f64 + Copy,
        always: bool,
    ) {
        let columns = [self.inertia, self.stiffness, self.fixed, self.per_period, self.period];
        let count = columns.iter().fold(out.len(), |count, column| count.min(column.len()));
        let (blocks, rest) = out[..count].as_chunks_mut::<BLOCK>();
        let from = blocks.len() * BLOCK;
        let whole = |column| <[f64]>::as_chunks::<BLOCK>(column).0;
        let [inertia, stiffness, fixed, per_period, period] = columns;
        let each =
            whole(inertia).iter().zip(whole(stiffness)).zip(whole(fixed)).zip(whole(per_period)).zip(whole(period));
        for (out, ((((inertia, stiffness), fixed), per_period), period)) in blocks.iter_mut().zip(each) {
            fill_block([inertia, stiffness, fixed, per_period, period], out, quick, slow, always);
        }
        if !rest.is_empty() {
            // The last block is padded.
            let filled = columns.map(|column| {
                let mut block = [1.0; BLOCK];
                block[..rest.len()].copy_from_slice(&column[from..count]);
                block
            });
            let mut block = [0.0; BLOCK];
            fill_block(filled.each_ref(), &mut block, quick, slow, always);
            rest.copy_from_slice(&block[..rest.len()]);
        }
    }
}

#[inline(always)]
fn fill_block(
    columns: [&[f64; BLOCK]; 5],
    out: &mut [f64; BLOCK],
    quick: impl Fn(SingleBody, f64) -> f64,
    slow: impl Fn(f64, SingleBody, f64) -> f64,
    always: bool,
) {
    let [inertia, stiffness, fixed, per_period, period] = columns;
    for (i, out) in out.iter_mut().enumerate() {
        let body =
            SingleBody { inertia: inertia[i], stiffness: stiffness[i], fixed: fixed[i], per_period: per_period[i] };
        *out = quick(body, period[i]);
    }
    if always || out.iter().filter(|x| x.is_nan()).count() > 0 {
        for (i, out) in out.iter_mut().enumerate().filter(|(_, out)| always || out.is_nan()) {
            let body =
                SingleBody { inertia: inertia[i], stiffness: stiffness[i], fixed: fixed[i], per_period: per_period[i] };
            *out = slow(*out, body, period[i]);
        }
    }
}

/// A verdict as a number: 1 unstable, 0 marginal, -1 stable.
pub fn sign(verdict: Verdict) -> f64 {
    match verdict {
        Verdict::Stable => -1.0,
        Verdict::Marginal => 0.0,
        Verdict::Unstable => 1.0,
    }
}

impl Loops<'_> {
    /// Compiled for each width of vectors and method.
    #[inline(always)]
    fn verdicts_of(&self, method: Method, out: &mut [f64]) {
        let single = |_, body, period| single_verdict(method, body, period);
        match method {
            Method::ForwardEuler => self.each(
                out,
                #[inline(always)]
                |body, t| Jury::forward(body, t).verdict(t),
                single,
                false,
            ),
            Method::SemiImplicitEuler => self.each(
                out,
                #[inline(always)]
                |body, t| Jury::implicit(body, t).verdict(t),
                single,
                false,
            ),
            Method::BackwardEuler => self.each(
                out,
                #[inline(always)]
                |body, t| Jury::backward(body, t).verdict(t),
                single,
                false,
            ),
            Method::Trapezoidal | Method::Tustin => {
                self.each(
                    out,
                    #[inline(always)]
                    |body, t| Jury::trapezoidal(body, t).verdict(t),
                    single,
                    false,
                );
            }
            Method::Zoh | Method::Foh => self.each(
                out,
                #[inline(always)]
                |body, t| Jury::exact(body, t).verdict(t),
                single,
                false,
            ),
            Method::Rk4 => self.each(out, runge_kutta, single, false),
        }
    }

    #[inline(always)]
    fn growths_of(&self, method: Method, out: &mut [f64]) {
        let single = |body, period| single_growth(method, body, period);
        // The logarithm is scalar.
        let logarithm = |excess: f64, body, period| match excess {
            nothing if nothing.is_nan() => single(body, period),
            excess => 0.5 * excess.ln_1p() / period + 0.0,
        };
        macro_rules! of {
            ($method:expr) => {
                self.each(
                    out,
                    #[inline(always)]
                    |body, t| of_pair($method, body, t, INSIDE),
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
                // The excess is twice the logarithm itself. |λ| of 1e-12 or less does not count.
                self.each(
                    out,
                    #[inline(always)]
                    |body, t| 0.5 * of_pair(Method::Zoh, body, t, -50.0) / t + 0.0,
                    |_, body, period| single(body, period),
                    false,
                );
            }
        }
    }
}

/// The verdict of a loop by itself.
#[inline(never)]
fn single_verdict(method: Method, body: SingleBody, period: f64) -> f64 {
    match body.spectrum(method, period) {
        Some(found) => sign(Verdict::of(growth(&found.multipliers, period))),
        None => f64::NAN,
    }
}

/// The growth of a loop by itself.
#[inline(never)]
fn single_growth(method: Method, body: SingleBody, period: f64) -> f64 {
    body.spectrum(method, period).and_then(|found| growth(&found.multipliers, period)).unwrap_or(f64::NAN)
}

/// Whether the arithmetic of the loop stays well within double precision.
#[inline(always)]
fn in_range(SingleBody { inertia, .. }: SingleBody, spring: f64, damper: f64, period: f64) -> bool {
    let (slow, fast) = (STIFFNESS[0] * inertia, STIFFNESS[1] * inertia);
    (INERTIA[0]..=INERTIA[1]).contains(&inertia)
        & (slow..=fast).contains(&spring)
        & (0.0..=fast).contains(&damper)
        & (PERIOD[0]..=PERIOD[1]).contains(&period)
}

/// |λ|² - 1 of a complex pair, in the operations of [`crate::stability::multiplier`]; NaN where the roots are real, or below `least`.
#[inline(always)]
fn of_pair(method: Method, body: SingleBody, period: f64, least: f64) -> f64 {
    let Pair { root, is_one } = Pair::new(body, period, matches!(method, Method::SemiImplicitEuler));
    let excess = excess(method, root);
    if is_one & (excess > least) { excess } else { f64::NAN }
}

/// The complex pair of a loop.
struct Pair {
    root: Root,
    /// Whether the roots are complex and the numbers in range.
    is_one: bool,
}

impl Pair {
    #[inline(always)]
    fn new(body: SingleBody, period: f64, implicit: bool) -> Self {
        let x = body.frequency() * period;
        let d = body.damping(period, x, implicit);
        let excess = Some(body.excess(period, x, d, implicit));
        let half = 0.5 * d;
        // As in `eigen::pair`.
        let z = Complex::new(-half, ((x - half) * (x + half)).sqrt());
        let sound = in_range(body, x * x * body.inertia, d * body.inertia, period);
        Pair { root: Root { z, square: x * x, excess }, is_one: sound & (half < x) }
    }
}

/// The verdict as a number; NaN where none of the three is certain.
#[inline(always)]
fn number(unstable: bool, marginal: bool, stable: bool) -> f64 {
    let sure = if stable { -1.0 } else { f64::NAN };
    let sure = if marginal { 0.0 } else { sure };
    if unstable { 1.0 } else { sure }
}

/// RK4, whose |λ|² - 1 is a sum of orders.
#[inline(always)]
fn runge_kutta(body: SingleBody, period: f64) -> f64 {
    let Pair { root, is_one } = Pair::new(body, period, false);
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

/// The conditions of the module documentation.
struct Jury {
    a: f64,
    b: f64,
    c: f64,
    /// B - C, without cancellation.
    balance: f64,
    /// The sum of its terms.
    terms: f64,
    /// The polynomial at λ = -1, without cancellation; infinite where that is not a boundary.
    alternating: f64,
    /// Whether the radius is e^{gT}; otherwise the bound is gT itself.
    curved: bool,
    sound: bool,
}

impl Jury {
    /// K T² and D, and the conditions without the terms of a method.
    #[inline(always)]
    fn of(body: SingleBody, t: f64) -> (f64, f64, Self) {
        let spring = t * t * body.stiffness;
        let damper = t * (body.fixed + t * body.balanced().per_period);
        let sound = in_range(body, spring, damper, t);
        let (a, b, c, balance, terms) = (body.inertia, damper, spring, damper, damper);
        (spring, damper, Jury { a, b, c, balance, terms, alternating: f64::INFINITY, curved: true, sound })
    }

    #[inline(always)]
    fn forward(body: SingleBody, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(body, t);
        let balance = t * (body.fixed + t * (body.balanced().per_period - body.stiffness));
        let alternating = 4.0 * of.a + spring - 2.0 * damper;
        Jury { balance, terms: damper + spring, alternating, ..of }
    }

    #[inline(always)]
    fn implicit(body: SingleBody, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(body, t);
        Jury { b: damper + spring, alternating: 4.0 * of.a - spring - 2.0 * damper, ..of }
    }

    #[inline(always)]
    fn backward(body: SingleBody, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(body, t);
        let balance = damper + spring;
        let alternating = 4.0 * of.a + 2.0 * damper + spring;
        Jury { a: of.a + balance, b: balance + spring, balance, terms: balance, alternating, ..of }
    }

    #[inline(always)]
    fn trapezoidal(body: SingleBody, t: f64) -> Self {
        let (spring, damper, of) = Jury::of(body, t);
        let alternating = 4.0 * of.a;
        Jury { a: of.a + 0.5 * damper + 0.25 * spring, b: damper + spring, alternating, ..of }
    }

    #[inline(always)]
    fn exact(body: SingleBody, t: f64) -> Self {
        Jury { curved: false, ..Jury::of(body, t).2 }
    }

    #[inline(always)]
    fn verdict(self, period: f64) -> f64 {
        let Jury { a, b, c, balance, terms, alternating, curved, sound } = self;
        // r² - 1 at both radii.
        let gap = 2.0 * MARGINAL * period;
        let more = if curved { 0.5 * gap * gap } else { 0.0 };
        let (high, low) = (a * (gap + more), a * (gap - more));
        let doubt = ROUNDING * (terms + a * gap);
        // Near +1 and -1 the result must be clear of both radii.
        let clear = c > gap * b;
        let near = (4.0 * a + c + 2.0 * b) * (ROUNDING + 2.0 * gap);
        let (passes, stays) = (alternating < -near, alternating > near);
        let unstable = passes | (balance < -(high + doubt));
        let marginal = stays & (balance > doubt - high) & (balance < low - doubt);
        let stable = stays & clear & (balance > low + doubt);
        number(sound & unstable, sound & marginal, sound & stable)
    }
}
