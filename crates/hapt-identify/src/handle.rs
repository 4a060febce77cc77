//! A device whose handle is on a flexible shaft: both inertias, the shaft's stiffness and damping, and the losses and delay of the motor's side.
//!
//! The model is the exact device of hapt-plant, run with the recorded torques. Its derivatives are differences of such runs. The encoder is
//! at the motor, the handle is free.

use hapt_model::Handle;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;
use nalgebra::{DMatrix, DVector};

use crate::counts::lattice;
use crate::error::{Error, LargeResidual};
use crate::estimate::{best, left, residual, variance};
use crate::explained::explained;
use crate::identified::{Interval, Residual};
use crate::record::{LONGEST_DELAY, Record, Watched};
use crate::spectrum::{Line, line};
use crate::start::starts;

/// Of ln J, b, f, delay, ln J_h, ln k, d, first position, first velocity.
const PARAMETERS: usize = 9;
type Parameters = [f64; PARAMETERS];

/// Damping, friction, delay and the shaft's damping.
const NOT_BELOW_0: [usize; 4] = [1, 2, 3, 6];

/// Parts of the whole inertia that are the motor's, from which fits start.
const SHARES: [f64; 5] = [0.5, 0.3, 0.7, 0.15, 0.85];
/// Steps of a fit that is only compared with others, and of the best.
const FEW: usize = 10;
const MOST: usize = 100;
/// A step of this many standard errors is none.
const SMALL: f64 = 1e-3;
/// The standard normal's quantile of 97.5 %.
const SIGMAS: f64 = 1.96;
/// The largest difference of two sample intervals, in periods.
const EVEN: f64 = 0.02;

/// What a record tells of a device with a handle; each value with its 95 % interval, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct WithHandle {
    /// J of the motor's side.
    pub inertia: Interval,
    /// Viscous, of the motor's side.
    pub damping: Interval,
    /// Coulomb's, of the motor's side.
    pub friction: Interval,
    /// From the sample to the change of the torque, in s.
    pub delay: Interval,
    /// J_h of the handle beyond the shaft.
    pub handle_inertia: Interval,
    /// Of the shaft.
    pub stiffness: Interval,
    /// Of the shaft.
    pub shaft_damping: Interval,
    /// Of both inertias on the shaft, hands-off, in Hz.
    pub resonance_hz: f64,
    /// What the fit leaves.
    pub residual: Residual,
}

/// Fits a device with a handle to a record that begins at rest or in motion as one, on an unloaded shaft.
///
/// # Errors
/// [`Error::Uneven`] for samples that are not even; [`Error::Unexplained`] and [`Error::Residual`] where no such device explains it.
pub fn identify_handle(record: &Record) -> Result<WithHandle, Error> {
    identify_handle_until(record, &|| false)
}

/// The same, until `stop` says true; the fit of that moment is then what counts.
///
/// # Errors
/// As [`identify_handle`].
pub fn identify_handle_until(record: &Record, stop: &dyn Fn() -> bool) -> Result<WithHandle, Error> {
    let period = record.period();
    if let Some(i) = record.times().windows(2).position(|pair| (pair[1] - pair[0] - period).abs() > EVEN * period) {
        return Err(Error::Uneven { sample: i + 1 });
    }
    let watched = Watched { record, stop };
    let rigid = best(&watched, &starts(&watched)).ok_or(Error::Unexplained)?;
    let of_rigid = left(record, &rigid);
    let Some(Line { hz, .. }) = line(&of_rigid, period) else { return Err(Error::Unexplained) };
    let (whole, omega) = (rigid.puck.gain.recip(), std::f64::consts::TAU * hz);
    if !(whole.is_finite() && whole > 0.0) {
        return Err(Error::Unexplained);
    }
    let start = |share: f64| -> Parameters {
        let (inertia, handle) = (share * whole, (1.0 - share) * whole);
        let mass = inertia * handle / whole;
        [
            inertia.ln(),
            (rigid.puck.damping * whole).max(0.0),
            (rigid.puck.friction * whole).max(0.0),
            (rigid.puck.delay + rigid.puck.lag).clamp(0.0, LONGEST_DELAY),
            handle.ln(),
            (mass * omega * omega).ln(),
            0.02 * mass * omega,
            record.positions()[0],
            0.0,
        ]
    };
    let fits = SHARES.into_iter().filter_map(|share| Fit::of(record, start(share))?.improved(record, FEW, stop));
    let first = fits.min_by(|a, b| a.squares.total_cmp(&b.squares)).ok_or(Error::Unexplained)?;
    let fit = first.improved(record, MOST, stop).ok_or(Error::Unexplained)?;
    let spread = variance(record.positions()).sqrt();
    let rest = residual(&fit.left);
    if !explained(record, &fit.left, lattice(record.positions()), spread) {
        let counts = lattice(record.positions()).map(|lattice| rest.rms / lattice.step);
        return Err(Error::Residual(LargeResidual { rms: rest.rms, counts, position: None, resonance_hz: None }));
    }
    fit.told(rest).ok_or(Error::Unexplained)
}

/// Parameters, what they leave, and its derivatives.
struct Fit {
    p: Parameters,
    left: Vec<f64>,
    squares: f64,
    derivatives: DMatrix<f64>,
}

/// The device of these parameters.
fn spec(p: &Parameters, period: f64) -> DeviceSpec {
    let handle = Handle { inertia: p[4].exp(), stiffness: p[5].exp(), damping: p[6] };
    DeviceSpec {
        period,
        delay: p[3],
        lag: 0.0,
        inertia: p[0].exp(),
        damping: p[1],
        friction: p[2],
        handle: Some(handle),
    }
}

/// The positions of such a device under the record's torques, at the samples that are measurements.
fn positions(record: &Record, p: &Parameters) -> Vec<f64> {
    let mut device = VirtualDevice::new(&spec(p, record.period()));
    device.set_out(p[7], p[8]);
    let mut all = Vec::with_capacity(record.times().len());
    for (i, torque) in record.torques().iter().enumerate() {
        if record.is_news(i) {
            all.push(device.puck().0);
        }
        device.command(*torque);
        device.travel();
    }
    all
}

impl Fit {
    fn of(record: &Record, p: Parameters) -> Option<Fit> {
        let there = positions(record, &p);
        let seen = record.positions().iter().enumerate().filter(|(i, _)| record.is_news(*i)).map(|(_, z)| z);
        let left: Vec<f64> = seen.zip(&there).map(|(seen, there)| seen - there).collect();
        let squares: f64 = left.iter().map(|r| r * r).sum();
        squares.is_finite().then_some(Fit { p, left, squares, derivatives: DMatrix::zeros(0, 0) })
    }

    /// The change of each parameter over which a derivative is taken.
    fn steps(&self, period: f64) -> Parameters {
        let [j, b, f, delay, _, k, d, _, v] = self.p;
        let rate = (0.5 * (k - j)).exp();
        // Wide enough to see past single stops and starts under friction.
        [
            3e-4,
            1e-3 * b.max(1e-2 * j.exp() * rate),
            1e-3 * f.max(1e-2 * j.exp()),
            1e-3 * delay.max(period),
            3e-4,
            3e-4,
            1e-3 * d.max(1e-2 * j.exp() * rate),
            1e-6,
            1e-5 * v.abs().max(1.0),
        ]
    }

    /// With its derivatives.
    fn differentiated(mut self, record: &Record) -> Option<Fit> {
        let steps = self.steps(record.period());
        let mut derivatives = DMatrix::zeros(self.left.len(), PARAMETERS);
        for (i, step) in steps.into_iter().enumerate() {
            let mut p = self.p;
            p[i] += step;
            let moved = Fit::of(record, p)?;
            for (j, (a, b)) in self.left.iter().zip(&moved.left).enumerate() {
                derivatives[(j, i)] = (a - b) / step;
            }
        }
        self.derivatives = derivatives;
        Some(self)
    }

    /// Levenberg's and Marquardt's steps from here.
    fn improved(self, record: &Record, most: usize, stop: &dyn Fn() -> bool) -> Option<Fit> {
        let mut at = self.differentiated(record)?;
        let mut damping = 1e-3;
        for _ in 0..most {
            if stop() {
                break;
            }
            let (information, right) = at.normal();
            let Some(step) = at.step(&information, &right, damping) else { return Some(at) };
            let size = (step.transpose() * &information * &step)[0];
            let mut p = at.p;
            // Far steps of what enters by its logarithm lead nowhere.
            p.iter_mut()
                .enumerate()
                .for_each(|(i, p)| *p += if [0, 4, 5].contains(&i) { step[i].clamp(-1.0, 1.0) } else { step[i] });
            NOT_BELOW_0.into_iter().for_each(|i| p[i] = p[i].max(0.0));
            p[3] = p[3].min(LONGEST_DELAY);
            let is_small = size < SMALL * SMALL * at.squares / at.left.len() as f64;
            match Fit::of(record, p) {
                Some(next) if next.squares < at.squares => {
                    at = next.differentiated(record)?;
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

    /// The next step, damped by Marquardt's `more`. What is 0 already, and would go below, stays while the others move.
    fn step(&self, information: &DMatrix<f64>, right: &DVector<f64>, more: f64) -> Option<DVector<f64>> {
        let mut free = [true; PARAMETERS];
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

    fn normal(&self) -> (DMatrix<f64>, DVector<f64>) {
        let left = DVector::from_column_slice(&self.left);
        (self.derivatives.transpose() * &self.derivatives, self.derivatives.transpose() * left)
    }

    /// The numbers with their intervals, from the covariance.
    fn told(&self, residual: Residual) -> Option<WithHandle> {
        let (information, _) = self.normal();
        let scale = information.diagonal().map(|x| x.sqrt().recip());
        let matrix = DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let inverse = matrix.cholesky()?.inverse();
        let freedom = self.left.len().saturating_sub(PARAMETERS).max(1) as f64;
        let error = |i: usize| SIGMAS * (inverse[(i, i)] * self.squares / freedom).sqrt() * scale[i];
        let plain = |i: usize| {
            let (value, error) = (self.p[i], error(i));
            Interval { value, low: (value - error).max(0.0), high: value + error }
        };
        let log = |i: usize| {
            let (value, error) = (self.p[i], error(i));
            Interval { value: value.exp(), low: (value - error).exp(), high: (value + error).exp() }
        };
        let masses = (-self.p[0]).exp() + (-self.p[4]).exp();
        let found = WithHandle {
            inertia: log(0),
            damping: plain(1),
            friction: plain(2),
            delay: plain(3),
            handle_inertia: log(4),
            stiffness: log(5),
            shaft_damping: plain(6),
            resonance_hz: (self.p[5].exp() * masses).sqrt() / std::f64::consts::TAU,
            residual,
        };
        let finite = (0..PARAMETERS).all(|i| self.p[i].is_finite() && error(i).is_finite());
        finite.then_some(found)
    }
}

impl WithHandle {
    /// The numbers under their names, in the order of `hapt identify --handle --json`.
    pub fn named(&self) -> [(&'static str, Interval); 7] {
        [
            ("inertia", self.inertia),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay_s", self.delay),
            ("handle_inertia", self.handle_inertia),
            ("stiffness", self.stiffness),
            ("shaft_damping", self.shaft_damping),
        ]
    }
}

/// The line of a shaft in what a rigid device leaves, in Hz; `None` where no line stands out.
pub(crate) fn resonance(record: &Record, left: &[f64]) -> Option<f64> {
    line(left, record.period()).filter(Line::is_clear).map(|line| line.hz)
}
