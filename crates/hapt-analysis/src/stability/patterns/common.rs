//! One quadratic form that shrinks under every interval and delay: no pattern of them makes the loop grow.
//!
//! P is proposed by [`common_form`] for a few steps and then tested on all. On a cell of intervals and delays the map lies within e of a
//! mean of its corners, which second derivatives bound. In the norm of P a mean is no longer than the longest corner. So a corner that
//! shrinks by more than e proves the cell; a cell that this does not prove is halved. The test is a Cholesky factorisation with
//! [`ROUNDING`] to spare.

use nalgebra::{Cholesky, DMatrix};

use crate::numerics::balance::balance;
use crate::numerics::lmi::{Constraint, common_form, shrinks};
use crate::stability::patterns::family::{Cell, Family, Step};
use crate::until::is_over;

/// Error of the entries of a map, relative to what they are summed from.
const ROUNDING: f64 = 1e-12;
/// Cells that are tested for one form.
const CELLS: usize = 600;
/// Forms that are proposed.
const PROPOSALS: usize = 4;
/// Beyond this many states only the form of the even loop is tested: the others take their sixth power.
const STATES: usize = 10;
/// Doublings of a Lyapunov sum: 2^40 samples.
const DOUBLINGS: usize = 40;

/// The norm |C s|.
#[derive(Clone, Debug)]
pub(crate) struct Norm {
    pub c: DMatrix<f64>,
    pub inverse: DMatrix<f64>,
}

/// Why a form proves nothing.
enum Gap {
    /// Under this step it does not shrink.
    At(Step),
    /// More cells would be needed.
    TooNarrow,
}

impl Norm {
    fn of(form: DMatrix<f64>) -> Option<Norm> {
        let c = Cholesky::new(form)?.l().transpose();
        let inverse = c.solve_upper_triangular(&DMatrix::identity(c.nrows(), c.nrows()))?;
        (c.iter().chain(inverse.iter()).all(|x| x.is_finite())).then_some(Norm { c, inverse })
    }

    /// In which positions and velocities are of like size.
    pub fn balanced(d: &DMatrix<f64>) -> Norm {
        let s = balance(d);
        Norm { inverse: DMatrix::from_diagonal(&s), c: DMatrix::from_diagonal(&s.map(|x| 1.0 / x)) }
    }

    /// Σ (Mᵏ)ᵀ Mᵏ of M = 1 + d in balanced coordinates, by doubling; `None` where it has no end.
    pub fn lyapunov(d: &DMatrix<f64>) -> Option<Norm> {
        let balanced = Norm::balanced(d);
        let n = d.nrows();
        let (mut power, mut form) = (balanced.scaled(d) + DMatrix::identity(n, n), DMatrix::identity(n, n));
        for _ in 0..DOUBLINGS {
            let more = power.transpose() * &form * &power;
            let settled = more.norm() <= 1e-14 * form.norm();
            form += more;
            power = &power * &power;
            if settled {
                return Norm::of(form)?.after(&balanced);
            }
            if !form.norm().is_finite() {
                return None;
            }
        }
        None
    }

    /// This norm of coordinates that `before` gives.
    fn after(self, before: &Norm) -> Option<Norm> {
        let both = Norm { c: self.c * &before.c, inverse: &before.inverse * self.inverse };
        both.c.iter().chain(both.inverse.iter()).all(|x| x.is_finite()).then_some(both)
    }

    /// C D C⁻¹.
    pub fn scaled(&self, d: &DMatrix<f64>) -> DMatrix<f64> {
        &self.c * d * &self.inverse
    }

    /// Whether 1 + d shortens every state by a part of `margin` at least, for any rounding.
    fn is_shrinking(&self, d: &DMatrix<f64>, margin: f64) -> bool {
        let n = d.nrows();
        let one = DMatrix::<f64>::identity(n, n);
        let summed = (self.c.abs() * d.abs() * self.inverse.abs()).norm();
        let spare = 2.0 * margin + ROUNDING * (2.0 * summed + summed * summed + n as f64 * 1e-3);
        let slack = shrinks(&self.scaled(d), &one) - one * spare;
        slack.iter().all(|x| x.is_finite()) && Cholesky::new(slack).is_some()
    }

    /// Whether every map of an interval up to `longest` shortens every state, where nothing but the puck moves between two samples, so that the
    /// map at 0 is 1. With 1 + h E(h), |E(h) - E(h₀)| ≤ h₀ S for h ≤ h₀, S a bound of the second derivative.
    pub fn covers_from_zero(&self, family: &Family<'_>, longest: f64) -> bool {
        if !family.stands_at_zero() {
            return false;
        }
        let n = family.order();
        let e = self.scaled(&family.at(Step { interval: longest, delay: 0.0 })) / longest;
        let cell = Cell { interval: [0.0, longest], delay: [0.0; 2] };
        let [along, _] = family.curvature(&self.c, &self.inverse, longest).error(&cell);
        // The error is that of a chord: S h₀²/8.
        let apart = 8.0 * along / longest;
        let size = e.norm() + apart;
        let slack = -(&e + e.transpose())
            - DMatrix::<f64>::identity(n, n)
                * (2.0 * apart + longest * size * size + ROUNDING * (size + 1.0 / longest));
        slack.iter().all(|x| x.is_finite()) && Cholesky::new(slack).is_some()
    }

    /// Whether every map of the cell shortens every state.
    fn covers(&self, family: &Family<'_>, all: Cell) -> Result<(), Gap> {
        let curvature = family.curvature(&self.c, &self.inverse, all.interval[1]);
        let mut open = vec![all];
        let mut tested = 0;
        while let Some(cell) = open.pop() {
            let [[h0, h1], [d0, d1]] = [cell.interval, cell.delay];
            // No sample is taken before the command of the one before has arrived.
            if d0 >= h1 && d1 > d0 {
                continue;
            }
            tested += 1;
            if tested > CELLS || is_over() {
                return Err(Gap::TooNarrow);
            }
            let [along, across] = curvature.error(&cell);
            let corners = cell.corners();
            let corners = if d0 == d1 { &corners[..2] } else { &corners[..] };
            let steps: Vec<(Step, DMatrix<f64>)> = corners.iter().map(|step| (*step, family.at(*step))).collect();
            if steps.iter().all(|(_, d)| self.is_shrinking(d, along + across)) {
                continue;
            }
            let fails = |(step, d): &&(Step, DMatrix<f64>)| step.delay <= step.interval && !self.is_shrinking(d, 0.0);
            if let Some((step, _)) = steps.iter().find(fails) {
                return Err(Gap::At(*step));
            }
            let middle = |[from, to]: [f64; 2]| 0.5 * (from + to);
            let (h, d) = (middle(cell.interval), middle(cell.delay));
            if across > along && d0 < d1 {
                open.extend([Cell { delay: [d0, d], ..cell }, Cell { delay: [d, d1], ..cell }]);
            } else if h0 < h1 {
                open.extend([Cell { interval: [h0, h], ..cell }, Cell { interval: [h, h1], ..cell }]);
            } else {
                return Err(Gap::TooNarrow);
            }
        }
        Ok(())
    }
}

/// The norm of a quadratic form that shrinks under every step of `all`, if one is found. `start` is a norm that the even loop shortens.
pub(crate) fn shrinking(family: &Family<'_>, all: Cell, even: Step, start: &Norm) -> Option<Norm> {
    let gap = match start.covers(family, all) {
        Ok(()) => return Some(start.clone()),
        Err(gap) => gap,
    };
    let n = family.order();
    if n > STATES {
        return None;
    }
    let mut steps: Vec<Step> = all.corners().into_iter().filter(|step| step.delay <= step.interval).collect();
    steps.extend([even, Step { interval: even.interval, delay: all.delay[1].min(even.interval) }]);
    steps.dedup();
    if let Gap::At(step) = gap {
        steps.push(step);
    }
    let constraint = |step: &Step| Constraint {
        d: start.scaled(&family.at(*step)),
        // A short interval dissipates little.
        weight: (step.interval / even.interval).max(1e-3),
    };
    let mut constraints: Vec<Constraint> = steps.iter().map(constraint).collect();
    for _ in 0..PROPOSALS {
        let (form, slack) = common_form(&constraints, &DMatrix::identity(n, n))?;
        if slack <= 0.0 {
            return None;
        }
        let norm = Norm::of(form).and_then(|norm| norm.after(start))?;
        match norm.covers(family, all) {
            Ok(()) => return Some(norm),
            Err(Gap::TooNarrow) => return None,
            Err(Gap::At(step)) => constraints.push(constraint(&step)),
        }
    }
    None
}

/// Whether one quadratic form is found that shrinks under each of these maps, given less 1, and so under every mean of them. A form is proposed
/// from that of the first.
pub(crate) fn shrinks_under_all(maps: &[DMatrix<f64>]) -> bool {
    let Some(start) = maps.first().and_then(Norm::lyapunov) else { return false };
    let covers = |norm: &Norm| maps.iter().all(|d| norm.is_shrinking(d, 0.0));
    if covers(&start) {
        return true;
    }
    let n = start.c.nrows();
    if n > STATES {
        return false;
    }
    let constraints: Vec<Constraint> = maps.iter().map(|d| Constraint { d: start.scaled(d), weight: 1.0 }).collect();
    let Some((form, slack)) = common_form(&constraints, &DMatrix::identity(n, n)) else { return false };
    slack > 0.0 && Norm::of(form).and_then(|norm| norm.after(&start)).is_some_and(|norm| covers(&norm))
}
