//! Fits of a motor with a handle on a shaft to a record.

use hapt_model::Handle;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::quantile::student;
use crate::record::{EARLIEST, LONGEST_DELAY, Record};
use crate::remainder::RESOLUTION;
use crate::shaft::Shafted;

/// Of ln (J + J_h), b, f, the time d + λ to the torque, ln (J_h / J), ln (k / m), d / m, λ², with m = J J_h / (J + J_h); of the initial
/// state, the motor's position, its velocity, and the differences of the handle's position and velocity from these.
///
/// A record determines the whole inertia, the resonance √(k/m) and its decay d/m well, and the ratio of the inertias badly. In these
/// coordinates the valley of good fits is straight, and the steps along it are long.
pub(super) const PARAMETERS: usize = 12;
pub(super) type Parameters = [f64; PARAMETERS];

pub(super) const FRICTION: usize = 2;
pub(super) const LATE: usize = 3;
pub(super) const SHARE: usize = 4;
pub(super) const VARIANCE: usize = 7;
/// The first parameter of the initial state.
pub(super) const POSITION: usize = 8;
/// The parameters of a device that begins at rest, on an unloaded shaft: without the last three.
pub(super) const AT_REST: usize = PARAMETERS - 3;
/// Damping, friction, the time to the torque, the shaft's damping and λ².
pub(super) const NOT_BELOW_0: [usize; 5] = [1, FRICTION, LATE, 6, VARIANCE];
/// The indices of the [`PARAMETERS`] that enter by their logarithms.
pub(super) const LOGARITHMS: [usize; 3] = [0, 4, 5];
/// Steps of a fit that is compared with others, with a lag or near the best, and of one that is followed to its end.
pub(super) const FEW_ITERATIONS: usize = 20;
pub(super) const MAX_ITERATIONS: usize = 100;
/// χ² of three numbers at 95 %.
const BEGINS: f64 = 7.815;
/// The lag from which the search for one starts, in periods.
const SHORT: f64 = 0.5;
/// Parts of delay and lag together that are the lag's, and factors of λ² and of the friction, from which a fit is repeated.
const RESTARTS: [(usize, f64); 7] =
    [(LATE, 0.9), (LATE, 0.6), (LATE, 0.3), (FRICTION, 0.5), (FRICTION, 0.0), (VARIANCE, 1.5), (VARIANCE, 0.7)];
/// A step of less than this many standard errors counts as none.
const SMALL: f64 = 1e-3;
/// Steps after which a fit with this many times the squares of one that explains the record is given up.
pub(super) const SOON: usize = 4;
const ELSEWHERE: f64 = 4.0;
/// Fits that are fewer standard errors apart lead to the same one.
const NEAR: f64 = 0.1;

/// Whether a sample is fitted: it is a measurement, and the unknown torques before the record have decayed. Their effect is in the initial
/// state of the fit.
fn is_measured(record: &Record, i: usize) -> bool {
    record.is_news(i) && record.times()[i] - record.times()[0] >= LONGEST_DELAY
}

pub(super) fn measured(record: &Record) -> impl Iterator<Item = usize> {
    (0..record.times().len()).filter(|i| is_measured(record, *i))
}

/// Parameters, their residuals, and the derivatives of these once a step needs them.
#[derive(Clone)]
pub(super) struct Fit {
    pub p: Parameters,
    /// Whether it begins at rest, on an unloaded shaft, which is then no parameter.
    pub rests: bool,
    free: Free,
    pub left: Vec<f64>,
    pub squares: f64,
    /// The least mean square of the positions' errors: that of their resolution.
    least: f64,
    /// By the free parameters.
    derivatives: Option<DMatrix<f64>>,
}

/// The parameters that are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Free {
    /// Only the initial state, of a known device.
    Beginning,
    /// All except this one.
    But(usize),
    All,
}

/// Whether the steps of a fit end, by the fit and the number of its steps.
pub(super) type Ends<'a> = dyn Fn(&Fit, usize) -> bool + 'a;

/// J, J_h and m = J J_h / (J + J_h).
pub(super) fn inertias(p: &Parameters) -> [f64; 3] {
    let (whole, ratio) = (p[0].exp(), p[4].exp());
    let (own, handle) = (whole / (1.0 + ratio), whole * ratio / (1.0 + ratio));
    [own, handle, own * handle / whole]
}

/// The device of these parameters.
fn device(p: &Parameters) -> Shafted {
    let [inertia, handle, mass] = inertias(p);
    let handle = Handle { inertia: handle, stiffness: mass * p[5].exp(), damping: mass * p[6] };
    let lag = p[VARIANCE].sqrt();
    Shafted { delay: p[LATE] - lag, lag, inertia, damping: p[1], friction: p[2], handle }
}

/// The positions of such a device under the record's torques, at the samples that are measurements; `None` where it moves too fast.
pub(super) fn positions(record: &Record, p: &Parameters) -> Option<Vec<f64>> {
    let device = device(p);
    if !device.is_followed(record.period()) {
        return None;
    }
    let begins = std::array::from_fn(|i| p[POSITION + i]);
    let mut all = Vec::with_capacity(record.times().len());
    device.follow(record.times(), record.torques(), begins, |i, z| {
        if is_measured(record, i) {
            all.push(z);
        }
    });
    Some(all)
}
impl Fit {
    pub fn of(record: &Record, p: Parameters, rests: bool) -> Option<Fit> {
        let there = positions(record, &p)?;
        let left: Vec<f64> = measured(record).zip(&there).map(|(i, there)| record.positions()[i] - there).collect();
        let squares: f64 = left.iter().map(|r| r * r).sum();
        squares.is_finite().then_some(Fit {
            p,
            rests,
            free: Free::All,
            left,
            squares,
            least: (RESOLUTION * record.spread()).powi(2),
            derivatives: None,
        })
    }

    /// These parameters, with the derivatives of a fit near them for the first step.
    pub fn near(record: &Record, p: Parameters, other: &Fit) -> Option<Fit> {
        let fit = Fit::of(record, p, other.rests)?;
        Some(Fit { derivatives: other.derivatives.clone(), free: other.free, ..fit })
    }

    /// The same, with these parameters fitted.
    pub fn fitting(self, free: Free) -> Fit {
        let is_known = self.free == Free::All;
        Fit { free, derivatives: self.derivatives.filter(|_| is_known), ..self }
    }

    fn is_free(&self, i: usize) -> bool {
        match self.free {
            Free::Beginning => i >= POSITION,
            Free::But(fixed) => i != fixed,
            Free::All => true,
        }
    }

    pub fn parameters(&self) -> usize {
        if self.rests { AT_REST } else { PARAMETERS }
    }

    /// The squares of devices within a 95 % interval are at most this much above the least.
    pub fn unit(&self) -> f64 {
        let freedom = self.left.len().saturating_sub(self.parameters()).max(1) as f64;
        student(freedom).powi(2) * (self.squares / freedom).max(self.least)
    }

    /// The largest squares of devices that explain the record as well.
    pub fn enough(&self) -> f64 {
        self.squares + self.unit()
    }

    /// Whether its squares are far above those of a fit that explains the record, where one is known.
    pub fn leads_elsewhere(&self, known: Option<f64>) -> bool {
        known.is_some_and(|known| self.squares > ELSEWHERE * known)
    }

    /// Whether it leads where the other leads: its motion is nearly the same.
    pub fn is_near(&self, other: &Fit) -> bool {
        let apart: f64 = self.left.iter().zip(&other.left).map(|(a, b)| (a - b) * (a - b)).sum();
        self.rests == other.rests && apart < NEAR * NEAR * other.squares / other.left.len() as f64
    }

    /// The change of each parameter over which a derivative is taken.
    fn steps(&self, period: f64) -> Parameters {
        let [whole, b, f, late, _, square, decay, variance, _, v, _, rate_beyond] = self.p;
        let (whole, rate) = (whole.exp(), (0.5 * square).exp());
        // Wide enough to average over single stops and starts under friction.
        [
            3e-4,
            1e-3 * b.max(1e-2 * whole * rate),
            1e-3 * f.max(1e-2 * whole),
            1e-3 * late.max(period),
            3e-4,
            3e-4,
            1e-3 * decay.max(1e-2 * rate),
            2e-2 * variance.max(period * period),
            1e-6,
            1e-5 * v.abs().max(1.0),
            1e-6,
            1e-5 * rate_beyond.abs().max(1.0),
        ]
    }

    /// The same with the lag fitted too, from a start above 0: near 0 a motor at rest may hide it.
    pub fn lagging(self, record: &Record) -> Fit {
        let mut p = self.p;
        p[VARIANCE] = p[VARIANCE].max((SHORT * record.period()).powi(2));
        Fit::of(record, p, self.rests).unwrap_or(self.fitting(Free::All))
    }

    /// The same from rest, where an initial motion explains no more than three parameters explain of noise.
    pub fn at_rest(self, record: &Record, stop: &(dyn Fn() -> bool + Sync)) -> Fit {
        let mut p = self.p;
        p[AT_REST..].fill(0.0);
        let resting = if self.rests { None } else { Fit::of(record, p, true) };
        let resting = resting.and_then(|fit| fit.improved(record, MAX_ITERATIONS, &|_, _| stop()));
        resting.filter(|fit| !self.shows_motion(fit.squares)).unwrap_or(self)
    }

    /// Whether an initial motion explains more than three parameters explain of noise, of the squares of a device at rest.
    pub fn shows_motion(&self, resting: f64) -> bool {
        resting >= self.squares * (1.0 + BEGINS / self.left.len() as f64)
    }

    /// The best of the fits from here and from other lags and frictions: each stop of a motor makes the squares nonlinear, and a fit can
    /// end in a local minimum.
    pub fn settled(
        mut self,
        record: &Record,
        explains: &dyn Fn(&Fit) -> bool,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Fit {
        for (i, part) in RESTARTS {
            let mut p = self.p;
            match i {
                // An error in the lag changes the estimated share of the inertia.
                LATE => p[VARIANCE] = (part * p[LATE]).powi(2),
                i => p[i] *= part,
            }
            let known = explains(&self).then_some(self.squares);
            let ends: &Ends<'_> =
                &|fit, steps| stop() || fit.is_near(&self) || (steps >= SOON && fit.leads_elsewhere(known));
            let beside = Fit::of(record, p, self.rests).and_then(|fit| fit.improved(record, FEW_ITERATIONS, ends));
            if let Some(better) = beside.filter(|fit| fit.squares < self.squares) {
                self = better;
            }
        }
        self
    }

    /// Takes the derivatives, where they are not known; `None` where a device next to it moves too fast.
    pub fn differentiate(&mut self, record: &Record) -> Option<()> {
        if self.derivatives.is_some() {
            return Some(());
        }
        let steps = self.steps(record.period());
        let free: Vec<usize> = (0..self.parameters()).filter(|i| self.is_free(*i)).collect();
        let moved = |i: &usize| {
            let mut p = self.p;
            p[*i] += steps[*i];
            Fit::of(record, p, self.rests).map(|moved| moved.left)
        };
        let moved: Vec<Vec<f64>> = free.par_iter().map(moved).collect::<Option<_>>()?;
        let mut derivatives = DMatrix::zeros(self.left.len(), PARAMETERS);
        for (i, moved) in free.into_iter().zip(moved) {
            for (j, (a, b)) in self.left.iter().zip(&moved).enumerate() {
                derivatives[(j, i)] = (a - b) / steps[i];
            }
        }
        self.derivatives = Some(derivatives);
        Some(())
    }

    /// Levenberg's and Marquardt's steps from here, until `ends`.
    pub fn improved(self, record: &Record, most: usize, ends: &Ends<'_>) -> Option<Fit> {
        let mut at = self;
        let mut damping = 1e-3;
        for steps in 0..most {
            if ends(&at, steps) {
                break;
            }
            at.differentiate(record)?;
            let Some((information, right)) = at.normal() else { break };
            let Some(step) = at.step(&information, &right, damping) else { break };
            let size = (step.transpose() * &information * &step)[0];
            let mut p = at.p;
            // Large steps of the parameters that enter by logarithms lead nowhere.
            p.iter_mut()
                .enumerate()
                .for_each(|(i, p)| *p += if LOGARITHMS.contains(&i) { step[i].clamp(-1.0, 1.0) } else { step[i] });
            NOT_BELOW_0.into_iter().for_each(|i| p[i] = p[i].max(0.0));
            p[LATE] = p[LATE].min(LONGEST_DELAY);
            p[VARIANCE] = p[VARIANCE].min((p[LATE] + EARLIEST).powi(2));
            let is_small = size < SMALL * SMALL * at.squares / at.left.len() as f64;
            let next = Fit::of(record, p, at.rests).map(|next| next.fitting(at.free));
            match next {
                Some(next) if next.squares < at.squares => {
                    at = next;
                    damping = (0.1 * damping).max(1e-9);
                    if is_small {
                        break;
                    }
                }
                _ if is_small || damping > 1e9 => break,
                _ => damping *= 10.0,
            }
        }
        Some(at)
    }

    /// The next step, damped by Marquardt's `more`. A parameter that is 0 already, and would go below, stays while the others move.
    fn step(&self, information: &DMatrix<f64>, right: &DVector<f64>, more: f64) -> Option<DVector<f64>> {
        let mut free: [bool; PARAMETERS] = std::array::from_fn(|i| self.is_free(i));
        loop {
            let scale = DVector::from_fn(PARAMETERS, |i, _| {
                let own = information[(i, i)];
                if free[i] && own > 0.0 { own.sqrt().recip() } else { 0.0 }
            });
            let matrix = DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| match i == j {
                true => 1.0 + more,
                false => information[(i, j)] * scale[i] * scale[j],
            });
            let step = matrix.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
            match NOT_BELOW_0.into_iter().find(|i| free[*i] && self.p[*i] == 0.0 && step[*i] < 0.0) {
                Some(i) => free[i] = false,
                None => return Some(step),
            }
        }
    }

    /// The normal equations; `None` without derivatives.
    pub fn normal(&self) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let derivatives = self.derivatives.as_ref()?;
        let left = DVector::from_column_slice(&self.left);
        Some((derivatives.tr_mul(derivatives), derivatives.tr_mul(&left)))
    }
}
