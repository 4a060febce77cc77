//! The roots near the unit circle of a loop with many commands in flight.
//!
//! The commands in flight only hand a command on, so that the characteristic equation needs none of their states. With the rest of the
//! state x, D₀ and the command c = t x of `closed_loop`, and a delay of d samples and a fraction of one, μ = λ - 1,
//!
//! ```text
//! p(λ) = det(μ - D₀ - λ^-d (b₀ + b₁/λ) t) = 0
//! ```
//!
//! In coordinates where t is a multiple of the last unit vector and D₀ has Hessenberg form, the whole matrix has, and p takes O(n²)
//! operations for n states, whatever the delay. p has n more zeros than poles, all poles at 0. Its zeros outside a circle are found from
//! those of a neighbouring period, and counted by the turns of p along the circle: none is missed.

use hapt_model::Sampling;
use nalgebra::linalg::Hessenberg;
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::closed_loop::{ClosedLoop, Hold};
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::port::Port;
use crate::error::Error;
use crate::numerics::balance::{balance, scaled};

type C = Complex<f64>;

/// Fewest commands in flight for which this is less work than all eigenvalues.
const FEWEST: usize = 4;

/// Most states of which p is made.
const MOST_STATES: usize = 40;

/// Steps of a search for a root.
const STEPS: usize = 24;

/// Largest turn of p between two neighbouring points on the circle, rad.
const TURN: f64 = 1.0;

/// How often an arc is halved.
const HALVINGS: u32 = 12;

/// p of the module documentation, at one period.
pub(crate) struct Delayed {
    /// D₀ in Hessenberg form, row by row.
    h: Vec<f64>,
    n: usize,
    /// t b₀ and t b₁, in the last column.
    push: [Vec<f64>; 2],
    delay: i32,
    /// The largest entry of the matrix of all states.
    pub size: f64,
}

impl Delayed {
    /// `None` for a loop of few commands in flight, or of many other states.
    ///
    /// # Errors
    /// As [`crate::equations::closed_loop::closed_loop`].
    pub fn new(
        port: &Port,
        sampling: &Sampling,
        damping: f64,
        filter: &Filter,
        period: f64,
    ) -> Result<Option<Self>, Error> {
        let delay = Delay::of(sampling.delay.seconds(period), period)?;
        let bodies: usize = port.blocks.iter().map(|block| block.positions + block.equations.bodies()).sum();
        if delay.in_flight() < FEWEST || port.is_uncoupled() || bodies > MOST_STATES {
            return Ok(None);
        }
        // The commands of d and of d + 1 samples ago stand where one has those of 1 and 2 samples ago.
        let parts = ClosedLoop::new(port, sampling, filter, period, 2)?;
        if parts.order > MOST_STATES {
            return Ok(None);
        }
        let hold = Hold { interval: period, before: delay.fraction * period, age: 1 };
        let d = parts.map(&parts.puck(damping, hold));
        if !d.iter().all(|x| x.is_finite()) {
            return Err(Error::Eigenvalues { order: parts.order });
        }
        let d = scaled(&d, &balance(&d));
        let size = d.amax().max(1.0);
        let first = parts.first_in_flight();
        let kept: Vec<usize> = (0..d.nrows()).filter(|i| *i != first && *i != first + 1).collect();
        let n = kept.len();
        // The first command in flight takes this sample's, less itself.
        let t = DVector::from_fn(n, |i, _| d[(first, kept[i])]);
        let rest = d.select_rows(&kept);
        let (own, commands) = (rest.select_columns(&kept), rest.columns(first, 2).into_owned());
        // In units of the first, the second takes the first command by the ratio of their units.
        let units = d[(first + 1, first)];
        // A reflection takes t to a multiple of the first unit vector; D₀ᵀ then keeps it in its Hessenberg form.
        let (reflection, along) = reflected(&t);
        let transposed = &reflection * own.transpose() * &reflection;
        let (q, upper) =
            if n > 2 { Hessenberg::new(transposed).unpack() } else { (DMatrix::identity(n, n), transposed) };
        let to = q.transpose() * reflection;
        let [old, older] = [0, 1].map(|i| &to * commands.column(i) * along);
        let turned = |v: &DVector<f64>, unit: f64| (0..n).map(|i| v[n - 1 - i] * unit).collect();
        let h = (0..n * n).map(|at| upper[(n - 1 - at % n, n - 1 - at / n)]).collect();
        Ok(Some(Delayed {
            h,
            n,
            push: [turned(&old, 1.0), turned(&older, units)],
            delay: i32::try_from(delay.samples).unwrap_or(i32::MAX),
            size,
        }))
    }

    /// p at λ = 1 + μ.
    fn at(&self, mu: C, room: &mut Vec<C>) -> C {
        let n = self.n;
        let lambda = mu + 1.0;
        let late = lambda.powi(-self.delay);
        let later = late / lambda;
        room.clear();
        room.extend(self.h.iter().map(|x| C::from(-x)));
        for i in 0..n {
            room[i * n + i] += mu;
            room[i * n + n - 1] -= late * self.push[0][i] + later * self.push[1][i];
        }
        let mut product = C::from(1.0);
        for k in 0..n {
            if k + 1 < n {
                let (above, below) = room.split_at_mut((k + 1) * n);
                let (row, next) = (&mut above[k * n + k..], &mut below[k..n]);
                if row[0].norm_sqr() < next[0].norm_sqr() {
                    row.swap_with_slice(next);
                    product = -product;
                }
                if row[0] != C::from(0.0) {
                    let part = next[0] / row[0];
                    next.iter_mut().zip(row.iter()).skip(1).for_each(|(x, y)| *x -= part * y);
                }
            }
            product *= room[k * n + k];
        }
        product
    }

    /// μ of all roots with |λ| above `radius`, from those near them: one of each pair, Im μ ≥ 0. `known` are roots by structure. `None`
    /// where not all are found.
    pub fn outside(&self, radius: f64, known: &[C], near: &[C]) -> Option<Vec<C>> {
        let mut room = Vec::with_capacity(self.n * self.n);
        let mut found = known.to_vec();
        for guess in near {
            self.search(*guess, radius, &mut found, &mut room);
        }
        for _ in 0..2 {
            let (missing, least) = self.missing(radius, &found, &mut room)?;
            if missing == 0 {
                return Some(found);
            }
            // A pair may have become two real roots, or another root may have come near the circle.
            let before = found.len();
            for guess in near.iter().copied().chain([least]) {
                self.search(guess * C::new(1.01, 0.01), radius, &mut found, &mut room);
            }
            if found.len() == before {
                break;
            }
        }
        None
    }

    /// Adds the root near `guess` that is not yet found, by parabolas through three points (Muller 1956).
    fn search(&self, guess: C, radius: f64, found: &mut Vec<C>, room: &mut Vec<C>) {
        let mut value = |mu: C| self.at(mu, room) / product(found, mu);
        let step = 1e-3 * guess + 1e-12;
        let mut x = [guess - step, guess + step * C::new(0.7, 0.7), guess];
        let mut f = x.map(&mut value);
        for _ in 0..STEPS {
            let [h0, h1] = [x[1] - x[0], x[2] - x[1]];
            let [d0, d1] = [(f[1] - f[0]) / h0, (f[2] - f[1]) / h1];
            let a = (d1 - d0) / (h1 + h0);
            let b = a * h1 + d1;
            let root = (b * b - 4.0 * f[2] * a).sqrt();
            let below = if (b + root).norm_sqr() > (b - root).norm_sqr() { b + root } else { b - root };
            let step = -2.0 * f[2] / below;
            if !(step.re.is_finite() && step.im.is_finite()) {
                // Three equal values: the root is reached as far as numbers go.
                if f[2].norm() > f64::EPSILON * f[0].norm() {
                    return;
                }
                break;
            }
            x = [x[1], x[2], x[2] + step];
            if step.norm() <= 2.0 * f64::EPSILON * (1.0 + x[2].norm()) || step.norm() <= 1e-14 * x[2].norm() {
                let mu = self.as_real(x[2], found, room);
                let mu = if mu.im < 0.0 { mu.conj() } else { mu };
                if (mu + 1.0).norm() > radius {
                    found.push(mu);
                }
                return;
            }
            f = [f[1], f[2], value(x[2])];
            if f[2] == C::from(0.0) {
                f[2] = C::from(f64::MIN_POSITIVE);
            }
        }
    }

    /// The real root beside `mu`, where it is one up to rounding.
    fn as_real(&self, mu: C, found: &[C], room: &mut Vec<C>) -> C {
        if mu.im.abs() > 1e-6 * mu.norm() {
            return mu;
        }
        // p is real on the real axis, and changes its sign at a simple root.
        let reach = 2.0 * mu.im.abs() + 1e-13 * mu.norm() + 4.0 * f64::EPSILON;
        let mut value = |x: f64| {
            let mu = C::from(x);
            (self.at(mu, room) / product(found, mu)).re
        };
        if value(mu.re - reach) * value(mu.re + reach) <= 0.0 { C::from(mu.re) } else { mu }
    }

    /// How many zeros outside the circle of `radius` are not among those found, and μ where p without those is least on it. `None` where
    /// rounding hides it.
    fn missing(&self, radius: f64, found: &[C], room: &mut Vec<C>) -> Option<(usize, C)> {
        let pairs: i32 = found.iter().map(|mu| if mu.im > 0.0 { 2 } else { 1 }).sum();
        let power = self.n as i32 - pairs;
        let inside = radius - 1.0;
        let place = |phi: f64| {
            let (sin, cos) = (0.5 * phi).sin_cos();
            C::new(inside - 2.0 * radius * sin * sin, 2.0 * radius * sin * cos)
        };
        let mut least = (f64::INFINITY, C::from(0.0));
        let mut value = |phi: f64| {
            let mu = place(phi);
            let value = self.at(mu, room) / product(found, mu) * (mu + 1.0).powi(-power);
            if value.norm() < least.0 {
                least = (value.norm(), mu);
            }
            value
        };
        let arcs = 12 + self.delay / 2;
        let mut turns = 0.0;
        let mut from = value(0.0);
        for i in 1..=arcs {
            let ends = [i - 1, i].map(|i| std::f64::consts::PI * f64::from(i) / f64::from(arcs));
            let to = value(ends[1]);
            turns += turned(&mut value, ends, [from, to], HALVINGS)?;
            from = to;
        }
        let missing = (-turns / std::f64::consts::PI).round();
        (missing >= 0.0).then_some((missing as usize, least.1))
    }
}

/// ∏ (μ - μ_i) of the found roots, with the conjugates of pairs.
fn product(found: &[C], mu: C) -> C {
    found.iter().fold(C::from(1.0), |all, root| {
        let one = mu - root;
        all * if root.im > 0.0 { one * (mu - root.conj()) } else { one }
    })
}

/// The change of the argument along an arc, rad.
fn turned(value: &mut impl FnMut(f64) -> C, ends: [f64; 2], values: [C; 2], halvings: u32) -> Option<f64> {
    let turn = (values[1] / values[0]).arg();
    if turn.abs() < TURN {
        return Some(turn);
    }
    let halvings = halvings.checked_sub(1)?;
    let middle = 0.5 * (ends[0] + ends[1]);
    let between = value(middle);
    Some(
        turned(value, [ends[0], middle], [values[0], between], halvings)?
            + turned(value, [middle, ends[1]], [between, values[1]], halvings)?,
    )
}

/// The reflection that takes v to the first unit vector times the number.
fn reflected(v: &DVector<f64>) -> (DMatrix<f64>, f64) {
    let n = v.len();
    let size = v.norm();
    let mut u = v.clone();
    let along = if v[0] > 0.0 { -size } else { size };
    u[0] -= along;
    let square = u.norm_squared();
    if square == 0.0 {
        return (DMatrix::identity(n, n), along);
    }
    (DMatrix::identity(n, n) - &u * u.transpose() * (2.0 / square), along)
}
