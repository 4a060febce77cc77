//! The condition on the damping over all frequencies at once, for few poles and a short delay.
//!
//! Over the common denominator D, b² - b m - h ≥ 0 is a polynomial condition in s = sin²(φ/2), for 0 ≤ s ≤ 1:
//!
//! ```text
//! P = b² |D|² - b m |D|² - h |D|² ≥ 0,    D = ∏ (w - μ_i),  μ = λ - 1,  w = z - 1
//! ```
//!
//! Everything is expanded in w, so that slow poles keep their digits, and turned into s by |w|² = 4s, Re wⁿ = R_n(s):
//! w² = -4s (1 + w) makes R_n = -4s (R_{n-1} + R_{n-2}), R_0 = 1, R_1 = -2s. On an interval of s a polynomial is no less than the least of its
//! Bernstein coefficients, the first and the last of which are its values at the ends. Intervals on which these do not decide are halved.
//! Every coefficient carries the sum of the absolute values of its terms, which bounds its rounding.

use std::f64::consts::PI;

use nalgebra::Complex;

use crate::numerics::phi::exp_m1;
use crate::passivity::curve::DampingCurve;
use crate::passivity::supremum::damping;

type C = Complex<f64>;

/// Largest number of coefficients of P.
const MAX_TERMS: usize = 26;

/// Bound of the rounding of a coefficient, relative to the sum of its terms' absolute values: above that of some dozen operations one after the other.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Largest number of intervals of one answer.
const INTERVALS: usize = 400;

/// Largest number of halvings.
const DEPTH: u32 = 40;

/// Evaluations of a local maximum.
const STEPS: usize = 16;

/// A polynomial, and the same with the absolute values of all terms.
#[derive(Clone, Copy, Debug)]
struct Polynomial {
    c: [f64; MAX_TERMS],
    size: [f64; MAX_TERMS],
    /// Number of coefficients.
    n: usize,
}

impl Polynomial {
    const ZERO: Self = Polynomial { c: [0.0; MAX_TERMS], size: [0.0; MAX_TERMS], n: 1 };

    fn constant(value: f64) -> Self {
        let mut p = Self::ZERO;
        (p.c[0], p.size[0]) = (value, value.abs());
        p
    }

    /// c0 + c1 x
    fn linear(c0: f64, c1: f64) -> Self {
        let mut p = Self::constant(c0);
        (p.c[1], p.size[1], p.n) = (c1, c1.abs(), 2);
        p
    }

    fn add(&mut self, factor: f64, other: &Self) {
        self.n = self.n.max(other.n);
        for i in 0..other.n {
            self.c[i] += factor * other.c[i];
            self.size[i] += factor.abs() * other.size[i];
        }
    }

    /// The caller keeps within [`MAX_TERMS`] coefficients.
    fn times(&self, other: &Self) -> Self {
        let mut p = Polynomial { n: self.n + other.n - 1, ..Self::ZERO };
        for i in 0..self.n {
            for j in 0..other.n {
                p.c[i + j] += self.c[i] * other.c[j];
                p.size[i + j] += self.size[i] * other.size[j];
            }
        }
        p
    }

    fn at(&self, x: f64) -> f64 {
        self.c[..self.n].iter().rev().fold(0.0, |sum, c| sum * x + c)
    }

    fn size_at(&self, x: f64) -> f64 {
        self.size[..self.n].iter().rev().fold(0.0, |sum, c| sum * x + c)
    }
}

/// Re wⁿ as a polynomial in s, for n below [`MAX_TERMS`]: the coefficients, all of one sign times (-1)^(their power).
const TURNS: [[f64; MAX_TERMS]; MAX_TERMS] = {
    let mut all = [[0.0; MAX_TERMS]; MAX_TERMS];
    all[0][0] = 1.0;
    all[1][1] = -2.0;
    let mut n = 2;
    while n < MAX_TERMS {
        let mut i = 1;
        while i <= n {
            all[n][i] = -4.0 * (all[n - 1][i - 1] + all[n - 2][i - 1]);
            i += 1;
        }
        n += 1;
    }
    all
};

/// Re{A(w) conj B(w)} as a polynomial in s.
fn real_part(a: &Polynomial, b: &Polynomial) -> Polynomial {
    // By powers of |w|² and of w: what goes with (4s)^k Re wⁿ.
    let mut sum = Polynomial { n: a.n.max(b.n), ..Polynomial::ZERO };
    for i in 0..a.n {
        for j in 0..b.n {
            let (pairs, n) = (i.min(j), i.abs_diff(j));
            let power = 4f64.powi(pairs as i32);
            let (c, size) = (power * a.c[i] * b.c[j], power * a.size[i] * b.size[j]);
            // Re wⁿ begins with the power ⌈n/2⌉.
            for (at, turn) in TURNS[n].iter().enumerate().take(n + 1).skip(n.div_ceil(2)) {
                sum.c[pairs + at] += c * turn;
                sum.size[pairs + at] += size * turn.abs();
            }
        }
    }
    sum
}

/// |D|², m |D|² and h |D|² in s.
#[derive(Clone, Debug)]
pub(crate) struct Condition {
    square: Polynomial,
    m: Polynomial,
    h: Polynomial,
    /// Where the first interval ends.
    first: f64,
}

/// The verdict on a damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Enough {
    /// It is enough at every frequency.
    Proved,
    /// It is not, at this angle: a local maximum of the required damping.
    Fails(f64),
    /// Rounding hides it.
    Open,
}

impl Condition {
    /// `None` for a curve of too many poles or samples of delay, or with a lag of the motor.
    pub fn of(curve: &DampingCurve) -> Option<Condition> {
        let (taps, poles) = (&curve.slope.taps, &curve.poles);
        let moves = curve.direct != 0.0
            || poles.iter().any(|pole| pole.gains[2] != C::from(0.0) || pole.gains[3] != C::from(0.0));
        let (taps, own) = if moves { (&taps[..], curve.slope.pole > 0.0) } else { (&[1.0][..], false) };
        // F of (1 + w)^back has no negative powers of z.
        let back = taps.len();
        let order = poles.len() + usize::from(own);
        let d = curve.lag.samples;
        if curve.motor > 0.0
            || curve.is_gain
            || curve.taps.len() + order > MAX_TERMS
            || order + d + back + 2 > MAX_TERMS
        {
            return None;
        }
        let mut mu: Vec<C> = poles.iter().map(|pole| exp_m1(C::new(pole.ln_abs, pole.arg))).collect();
        mu.extend(own.then(|| C::from(curve.slope.ln_pole.exp_m1())));
        let mut powers = vec![Polynomial::constant(1.0)];
        for _ in 0..order + d + back + 1 {
            let next = powers[powers.len() - 1].times(&Polynomial::linear(1.0, 1.0));
            powers.push(next);
        }
        // Σ taps z^(back - 1 - i), and with the pole of a low-pass another z.
        let mut filter = Polynomial::ZERO;
        taps.iter().enumerate().for_each(|(i, tap)| filter.add(*tap, &powers[back - 1 - i]));
        if own {
            filter = filter.times(&powers[1]);
        }
        let all = factors(&mu, None).real(C::from(1.0));
        // Of -F: the poles' gains over all other factors.
        let mut n = Polynomial::ZERO;
        for (i, pole) in poles.iter().enumerate() {
            let [one, one_back, slope, slope_back] = pole.gains;
            let is_real = pole.arg == 0.0 || pole.arg.abs() == PI;
            if pole.arg < 0.0 && !is_real {
                // In twice the real part of its conjugate.
                continue;
            }
            let twice = if is_real { 1.0 } else { 2.0 };
            let (still, moving) = (factors(&mu, Some(i)), factors(&mu[..poles.len()], Some(i)));
            for (gain, less, of) in [(one, 0, &still), (one_back, 1, &still)] {
                n.add(twice, &of.real(gain).times(&powers[back - less]));
            }
            for (gain, less, of) in [(slope, 0, &moving), (slope_back, 1, &moving)] {
                let lifted = if less == 0 { filter.times(&powers[1]) } else { filter };
                n.add(twice, &of.real(gain).times(&lifted));
            }
        }
        if curve.direct != 0.0 {
            n.add(curve.direct, &factors(&mu[..poles.len()], None).real(C::from(1.0)).times(&filter));
        }
        let square = real_part(&all, &all);
        // conj{z^-(d + back) (1 - a + a/z)} D against N.
        let delayed = powers[d + back].times(&Polynomial::linear(1.0, curve.lag.fraction)).times(&all);
        let mut cosines = Polynomial::constant(curve.constant);
        for (i, tap) in curve.taps.iter().enumerate().filter(|(_, tap)| **tap != 0.0) {
            cosines.add(*tap, &real_part(powers.get(i)?, &Polynomial::constant(1.0)));
        }
        let mut m = cosines.times(&square);
        m.add(curve.period, &real_part(&delayed, &n));
        let mut whole = powers[back].times(&all);
        (0..whole.n).for_each(|i| {
            whole.c[i] *= -curve.stiffness;
            whole.size[i] *= curve.stiffness.abs();
        });
        whole.add(1.0, &n.times(&Polynomial::linear(0.0, 1.0)));
        let mut h = Polynomial::ZERO;
        if curve.spread > 0.0 {
            h.add(0.25 * curve.spread * curve.period * curve.period, &real_part(&whole, &whole));
        }
        let slowest = mu.iter().map(|mu| mu.norm_sqr()).filter(|square| *square > 0.0).fold(1.0, f64::min);
        Some(Condition { square, m, h, first: (slowest / 64.0).max(1e-12) })
    }

    /// The required damping at s.
    fn required(&self, s: f64) -> f64 {
        let square = self.square.at(s);
        damping(self.m.at(s) / square, (self.h.at(s) / square).max(0.0))
    }

    /// Whether a damping above 0 is enough at every frequency.
    pub fn holds(&self, b: f64) -> Enough {
        let mut p = Polynomial::ZERO;
        p.add(b * b, &self.square);
        p.add(-b, &self.m);
        p.add(-1.0, &self.h);
        let mut left = INTERVALS;
        let mut from: f64 = 0.0;
        while from < 1.0 {
            let to = if from == 0.0 { self.first } else { (4.0 * from).min(1.0) };
            let form = Bernstein::new(&p, from, to);
            match form.decide(ROUNDING * p.size_at(to), DEPTH, &mut left) {
                Decided::Positive => {}
                Decided::Negative(s) => return Enough::Fails(self.peak(s)),
                Decided::Open => return Enough::Open,
            }
            from = to;
        }
        Enough::Proved
    }

    /// The angle of a local maximum of the required damping, from s on by parabolas.
    fn peak(&self, s: f64) -> f64 {
        // Over ln s, where resonances are as wide as slow ones.
        let at = |x: f64| self.required(x.exp().min(1.0));
        let middle = s.max(1e-300).ln();
        let mut x = [middle - 0.1, middle, (middle + 0.1).min(0.0)];
        let mut f = x.map(at);
        for _ in 0..STEPS {
            let best = highest(f);
            let next = if best == 1 && x[0] < x[1] && x[1] < x[2] {
                let [left, right] = [(f[1] - f[0]) / (x[1] - x[0]), (f[2] - f[1]) / (x[2] - x[1])];
                x[1] + 0.5 * (left * (x[2] - x[1]) + right * (x[1] - x[0])) / (left - right)
            } else if best == 0 {
                x[0] - 2.0 * (x[2] - x[0])
            } else {
                (x[2] + 2.0 * (x[2] - x[0])).min(0.0)
            };
            let there = at(next);
            if !next.is_finite() || (next - x[best]).abs() <= 1e-9 || x.contains(&next) {
                break;
            }
            if next < x[0] {
                (x, f) = ([next, x[0], x[1]], [there, f[0], f[1]]);
            } else if next > x[2] {
                (x, f) = ([x[1], x[2], next], [f[1], f[2], there]);
            } else if next < x[1] {
                (x, f) = if there > f[1] {
                    ([x[0], next, x[1]], [f[0], there, f[1]])
                } else {
                    ([next, x[1], x[2]], [there, f[1], f[2]])
                };
            } else {
                (x, f) = if there > f[1] {
                    ([x[1], next, x[2]], [f[1], there, f[2]])
                } else {
                    ([x[0], x[1], next], [f[0], f[1], there])
                };
            }
        }
        2.0 * x[highest(f)].exp().min(1.0).sqrt().asin()
    }
}

/// The place of the largest.
fn highest(f: [f64; 3]) -> usize {
    let first = if f[0] > f[1] { 0 } else { 1 };
    if f[2] > f[first] { 2 } else { first }
}

/// A product of factors w - μ.
struct Factors {
    c: [C; MAX_TERMS],
    size: [f64; MAX_TERMS],
    n: usize,
}

impl Factors {
    /// The real part of a multiple.
    fn real(&self, gain: C) -> Polynomial {
        let mut p = Polynomial { n: self.n, ..Polynomial::ZERO };
        for i in 0..self.n {
            p.c[i] = (gain * self.c[i]).re;
            p.size[i] = gain.norm() * self.size[i];
        }
        p
    }
}

/// ∏ (w - μ) over all but one.
fn factors(mu: &[C], without: Option<usize>) -> Factors {
    let mut all = Factors { c: [C::from(0.0); MAX_TERMS], size: [0.0; MAX_TERMS], n: 1 };
    (all.c[0], all.size[0]) = (C::from(1.0), 1.0);
    for (_, mu) in mu.iter().enumerate().filter(|(i, _)| Some(*i) != without) {
        let norm = mu.norm();
        for k in (0..=all.n).rev() {
            let below = if k > 0 { (all.c[k - 1], all.size[k - 1]) } else { (C::from(0.0), 0.0) };
            all.c[k] = below.0 - mu * all.c[k];
            all.size[k] = below.1 + norm * all.size[k];
        }
        all.n += 1;
    }
    all
}

/// The verdict on a polynomial over an interval.
enum Decided {
    Positive,
    Negative(f64),
    Open,
}

/// A polynomial over an interval by its Bernstein coefficients.
struct Bernstein {
    c: [f64; MAX_TERMS],
    n: usize,
    ends: [f64; 2],
}

impl Bernstein {
    fn new(p: &Polynomial, from: f64, to: f64) -> Self {
        let n = p.n;
        let mut c = p.c;
        // About `from`, in units of the length.
        if from > 0.0 {
            for i in 0..n {
                for k in (i..n - 1).rev() {
                    c[k] += from * c[k + 1];
                }
            }
        }
        let mut power = 1.0;
        for c in &mut c[1..n] {
            power *= to - from;
            *c *= power;
        }
        // Over their binomials, then summed up along the diagonals.
        let degree = n - 1;
        let mut binomial = 1.0;
        for (i, c) in c.iter_mut().enumerate().take(n).skip(1) {
            binomial *= (degree + 1 - i) as f64 / i as f64;
            *c /= binomial;
        }
        for i in 1..n {
            for k in (i..n).rev() {
                c[k] += c[k - 1];
            }
        }
        Bernstein { c, n, ends: [from, to] }
    }

    /// `error` bounds that of each coefficient.
    fn decide(&self, error: f64, depth: u32, left: &mut usize) -> Decided {
        let n = self.n;
        let (first, last) = (self.c[0], self.c[n - 1]);
        if first < -error || last < -error {
            return Decided::Negative(if first < last { self.ends[0] } else { self.ends[1] });
        }
        if self.c[..n].iter().all(|c| *c > error) {
            return Decided::Positive;
        }
        // An end within rounding of 0 stays so.
        if depth == 0 || *left == 0 || first <= error || last <= error {
            return Decided::Open;
        }
        *left -= 1;
        // De Casteljau in the middle.
        let mut right = self.c;
        let mut half = [0.0; MAX_TERMS];
        for (i, first) in half.iter_mut().enumerate().take(n) {
            *first = right[0];
            for k in 0..n - 1 - i {
                right[k] = 0.5 * (right[k] + right[k + 1]);
            }
        }
        let middle = 0.5 * (self.ends[0] + self.ends[1]);
        let [low, high] = self.ends;
        match (Bernstein { c: half, n, ends: [low, middle] }).decide(error, depth - 1, left) {
            Decided::Positive => (Bernstein { c: right, n, ends: [middle, high] }).decide(error, depth - 1, left),
            decided @ (Decided::Negative(_) | Decided::Open) => decided,
        }
    }
}
