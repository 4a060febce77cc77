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
use crate::start::{Begin, begins, starts};

/// Of ln (J + J_h), b, f, delay, ln (J_h / J), ln (k / m), d / m, with m = J J_h / (J + J_h); of the beginning, the motor's position, its
/// velocity, and what position and velocity of the handle are beyond these.
///
/// A record tells the whole inertia, the resonance √(k/m) and its decay d/m well, and the ratio of the inertias badly. In these
/// coordinates the valley of good fits is straight, and the steps along it are long.
const PARAMETERS: usize = 11;
type Parameters = [f64; PARAMETERS];

/// The first parameter of the beginning.
const POSITION: usize = 7;
/// The parameters of a device that begins at rest, on an unloaded shaft: without the last three.
const AT_REST: usize = PARAMETERS - 3;
/// How large these are at most, in rad/s, rad and rad/s (linear: m).
const FIRST: [f64; 3] = [100.0, 1.0, 100.0];
/// Damping, friction, delay and the shaft's damping.
const NOT_BELOW_0: [usize; 4] = [1, 2, 3, 6];

/// Of [`PARAMETERS`], those that enter by their logarithms.
const LOGARITHMS: [usize; 3] = [0, 4, 5];

/// Parts of the whole inertia that are the motor's, from which fits start.
const SHARES: [f64; 5] = [0.5, 0.3, 0.7, 0.15, 0.85];
/// The most fits that are followed to their end.
const FOLLOWED: usize = 4;
/// Steps of a fit that is only compared with others, and of one that is followed.
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

/// Fits a device with a handle to a record that begins at rest or in motion.
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
    search(&Watched { record, stop }, None)?.told()
}

/// The best fit of a search.
pub(crate) struct Found {
    fit: Fit,
    /// Why it does not explain the record.
    wrong: Option<Error>,
    pub residual: Residual,
}

impl Found {
    /// The numbers, or why there are none.
    pub fn told(self) -> Result<WithHandle, Error> {
        match self.wrong {
            Some(error) => Err(error),
            None => self.fit.told(self.residual).ok_or(Error::Unexplained),
        }
    }

    /// The positions of the fit, with their times.
    pub fn fitted(&self, record: &Record) -> Vec<(f64, f64)> {
        measured(record).map(|i| record.times()[i]).zip(positions(record, &self.fit.p, self.fit.lag)).collect()
    }

    /// What it leaves of the record's.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        measured(record).map(|i| record.times()[i]).zip(self.fit.left.iter().copied()).collect()
    }
}

/// The search for the device that explains a record. A search that begins near a device ends with it where that explains the record; the
/// motor's lag is the one of that device.
pub(crate) fn search(watched: &Watched<'_>, near: Option<&DeviceSpec>) -> Result<Found, Error> {
    let Watched { record, stop } = *watched;
    let period = record.period();
    if let Some(i) = record.times().windows(2).position(|pair| (pair[1] - pair[0] - period).abs() > EVEN * period) {
        return Err(Error::Uneven { sample: i + 1 });
    }
    let lag = near.map_or(0.0, |device| device.lag);
    let (lattice, spread) = (lattice(record.positions()), variance(record.positions()).sqrt());
    let explains = |fit: &Fit| explained(record, &fit.left, lattice, spread);
    let from = |(rests, p): (bool, Parameters)| {
        let mut fit = Fit::of(record, p, rests, lag)?;
        if !rests {
            // A wrong beginning of a fast motion would bend every other number first.
            fit.begins = true;
            fit = fit.improved(record, FEW, stop)?;
            fit.begins = false;
        }
        fit.improved(record, FEW, stop)
    };
    // The best after a few steps need not be the best in the end: the next one follows until one explains the record.
    let mut best: Option<Fit> = None;
    for starts in [near.map(|device| around(record, device)), starts_of(watched)].into_iter().flatten() {
        let mut fits: Vec<Fit> = starts.into_iter().filter_map(from).collect();
        fits.sort_by(|a, b| a.squares.total_cmp(&b.squares));
        for fit in fits.into_iter().take(FOLLOWED) {
            if stop() || best.as_ref().is_some_and(explains) {
                break;
            }
            let fit = fit.improved(record, MOST, stop).ok_or(Error::Unexplained)?;
            best = best.into_iter().chain([fit]).min_by(|a, b| a.squares.total_cmp(&b.squares));
        }
        if best.as_ref().is_some_and(explains) {
            break;
        }
    }
    let fit = best.ok_or(Error::Unexplained)?;
    let residual = residual(&fit.left);
    let counts = lattice.map(|lattice| residual.rms / lattice.step);
    let wrong = LargeResidual { rms: residual.rms, counts, position: None, resonance_hz: None };
    let wrong = (!explains(&fit)).then_some(Error::Residual(wrong));
    Ok(Found { fit, wrong, residual })
}

/// Where fits start: from rest or in motion, and with which parameters. A small velocity that friction ends within some samples hardly shows
/// that it should be 0.
type Starts = Vec<(bool, Parameters)>;

/// At a device.
fn around(record: &Record, device: &DeviceSpec) -> Starts {
    let handle = device.handle.unwrap_or(Handle { inertia: device.inertia, stiffness: 0.0, damping: 0.0 });
    let whole = device.inertia + handle.inertia;
    let mass = device.inertia * handle.inertia / whole;
    let start: Parameters = [
        whole.ln(),
        device.damping,
        device.friction,
        device.delay.clamp(0.0, LONGEST_DELAY),
        (handle.inertia / device.inertia).ln(),
        (handle.stiffness / mass).ln(),
        handle.damping / mass,
        record.positions()[0],
        0.0,
        0.0,
        0.0,
    ];
    vec![(true, start), (false, moving(record, start))]
}

/// The same beginning as one in motion.
fn moving(record: &Record, mut start: Parameters) -> Parameters {
    let Begin { position, velocity } = begins(record, 0)[0];
    (start[7], start[8]) = (position, velocity);
    start
}

/// At the line that a rigid device leaves in the record; `None` without one.
fn starts_of(watched: &Watched<'_>) -> Option<Starts> {
    let record = watched.record;
    let rigid = best(watched, &starts(watched))?;
    let Line { hz, .. } = line(&left(record, &rigid), record.period())?;
    let (whole, omega) = (rigid.puck.gain.recip(), std::f64::consts::TAU * hz);
    if !(whole.is_finite() && whole > 0.0) {
        return None;
    }
    let start = |share: f64| -> Parameters {
        [
            whole.ln(),
            (rigid.puck.damping * whole).max(0.0),
            (rigid.puck.friction * whole).max(0.0),
            (rigid.puck.delay + rigid.puck.lag).clamp(0.0, LONGEST_DELAY),
            ((1.0 - share) / share).ln(),
            2.0 * omega.ln(),
            0.02 * omega,
            record.positions()[0],
            0.0,
            0.0,
            0.0,
        ]
    };
    let from = |rests: bool, share: f64| if rests { start(share) } else { moving(record, start(share)) };
    Some([true, false].into_iter().flat_map(|rests| SHARES.map(|share| (rests, from(rests, share)))).collect())
}

/// Whether a sample is fitted: it is a measurement, and the torques before the record, which nobody knows, have all gone. What they did is
/// in the state from which the fit begins.
fn is_measured(record: &Record, i: usize) -> bool {
    record.is_news(i) && record.times()[i] - record.times()[0] >= LONGEST_DELAY
}

fn measured(record: &Record) -> impl Iterator<Item = usize> {
    (0..record.times().len()).filter(|i| is_measured(record, *i))
}

/// Parameters, what they leave, and its derivatives.
struct Fit {
    p: Parameters,
    /// Whether it begins at rest, on an unloaded shaft, which is then no parameter.
    rests: bool,
    /// Whether the beginning alone is fitted, to a device that is known.
    begins: bool,
    /// The motor's, in s, which is known.
    lag: f64,
    left: Vec<f64>,
    squares: f64,
    derivatives: DMatrix<f64>,
}

/// J, J_h and m = J J_h / (J + J_h).
fn inertias(p: &Parameters) -> [f64; 3] {
    let (whole, ratio) = (p[0].exp(), p[4].exp());
    let (own, handle) = (whole / (1.0 + ratio), whole * ratio / (1.0 + ratio));
    [own, handle, own * handle / whole]
}

/// The device of these parameters.
fn spec(p: &Parameters, lag: f64, period: f64) -> DeviceSpec {
    let [inertia, handle, mass] = inertias(p);
    let handle = Handle { inertia: handle, stiffness: mass * p[5].exp(), damping: mass * p[6] };
    DeviceSpec { period, delay: p[3], lag, inertia, damping: p[1], friction: p[2], handle: Some(handle) }
}

/// The positions of such a device under the record's torques, at the samples that are measurements.
fn positions(record: &Record, p: &Parameters, lag: f64) -> Vec<f64> {
    let mut device = VirtualDevice::new(&spec(p, lag, record.period()));
    device.set_out((p[7], p[8]), (p[7] + p[9], p[8] + p[10]));
    let mut all = Vec::with_capacity(record.times().len());
    for (i, torque) in record.torques().iter().enumerate() {
        if is_measured(record, i) {
            all.push(device.puck().0);
        }
        device.command(*torque);
        device.travel();
    }
    all
}

impl Fit {
    fn of(record: &Record, p: Parameters, rests: bool, lag: f64) -> Option<Fit> {
        let there = positions(record, &p, lag);
        let left: Vec<f64> = measured(record).zip(&there).map(|(i, there)| record.positions()[i] - there).collect();
        let squares: f64 = left.iter().map(|r| r * r).sum();
        squares.is_finite().then_some(Fit {
            p,
            rests,
            begins: false,
            lag,
            left,
            squares,
            derivatives: DMatrix::zeros(0, 0),
        })
    }

    /// The first parameter that is fitted.
    fn first(&self) -> usize {
        if self.begins { POSITION } else { 0 }
    }

    fn parameters(&self) -> usize {
        if self.rests { AT_REST } else { PARAMETERS }
    }

    /// The change of each parameter over which a derivative is taken.
    fn steps(&self, period: f64) -> Parameters {
        let [whole, b, f, delay, _, square, decay, _, v, _, rate_beyond] = self.p;
        let (whole, rate) = (whole.exp(), (0.5 * square).exp());
        // Wide enough to see past single stops and starts under friction.
        [
            3e-4,
            1e-3 * b.max(1e-2 * whole * rate),
            1e-3 * f.max(1e-2 * whole),
            1e-3 * delay.max(period),
            3e-4,
            3e-4,
            1e-3 * decay.max(1e-2 * rate),
            1e-6,
            1e-5 * v.abs().max(1.0),
            1e-6,
            1e-5 * rate_beyond.abs().max(1.0),
        ]
    }

    /// With its derivatives.
    fn differentiated(mut self, record: &Record) -> Option<Fit> {
        let steps = self.steps(record.period());
        let mut derivatives = DMatrix::zeros(self.left.len(), PARAMETERS);
        let parameters = self.parameters();
        for (i, step) in steps.into_iter().enumerate().take(parameters).skip(self.first()) {
            let mut p = self.p;
            p[i] += step;
            let moved = Fit::of(record, p, self.rests, self.lag)?;
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
                .for_each(|(i, p)| *p += if LOGARITHMS.contains(&i) { step[i].clamp(-1.0, 1.0) } else { step[i] });
            NOT_BELOW_0.into_iter().for_each(|i| p[i] = p[i].max(0.0));
            p[3] = p[3].min(LONGEST_DELAY);
            let is_small = size < SMALL * SMALL * at.squares / at.left.len() as f64;
            let next = Fit::of(record, p, at.rests, at.lag).map(|next| Fit { begins: at.begins, ..next });
            match next {
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
        let mut free: [bool; PARAMETERS] = std::array::from_fn(|i| i >= self.first());
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
        let parameters = self.parameters();
        let freedom = self.left.len().saturating_sub(parameters).max(1) as f64;
        // Friction can end a first motion before it shows. Then no more is known of it than this, and the other numbers are told all the same.
        let known =
            |i: usize| FIRST.get(i.wrapping_sub(AT_REST)).map_or(0.0, |size| self.squares / freedom / (size * size));
        let own = DVector::from_fn(parameters, |i, _| information[(i, i)] + known(i));
        let scale = own.map(|x| x.sqrt().recip());
        let matrix = DMatrix::from_fn(parameters, parameters, |i, j| match i == j {
            true => 1.0,
            false => information[(i, j)] * scale[i] * scale[j],
        });
        let inverse = matrix.cholesky()?.inverse();
        let unit = SIGMAS * SIGMAS * self.squares / freedom;
        // Half of the interval of what has this gradient in the parameters.
        let error = |gradient: &[(usize, f64)]| {
            let of = |&(i, a): &(usize, f64), &(j, b): &(usize, f64)| a * b * inverse[(i, j)] * scale[i] * scale[j];
            let sum: f64 = gradient.iter().flat_map(|row| gradient.iter().map(move |column| of(row, column))).sum();
            (unit * sum).sqrt()
        };
        let plain = |value: f64, gradient: &[(usize, f64)]| {
            let error = error(gradient);
            Interval { value, low: (value - error).max(0.0), high: value + error }
        };
        let log = |value: f64, gradient: &[(usize, f64)]| {
            let error = error(gradient);
            Interval { value, low: value * (-error).exp(), high: value * error.exp() }
        };
        let [inertia, handle, mass] = inertias(&self.p);
        let share = handle / (inertia + handle);
        let damping = mass * self.p[6];
        let found = WithHandle {
            inertia: log(inertia, &[(0, 1.0), (4, -share)]),
            damping: plain(self.p[1], &[(1, 1.0)]),
            friction: plain(self.p[2], &[(2, 1.0)]),
            delay: plain(self.p[3], &[(3, 1.0)]),
            handle_inertia: log(handle, &[(0, 1.0), (4, 1.0 - share)]),
            stiffness: log(mass * self.p[5].exp(), &[(0, 1.0), (4, 1.0 - 2.0 * share), (5, 1.0)]),
            shaft_damping: plain(damping, &[(0, damping), (4, damping * (1.0 - 2.0 * share)), (6, mass)]),
            resonance_hz: (0.5 * self.p[5]).exp() / std::f64::consts::TAU,
            residual,
        };
        let finite = found.named().iter().all(|(_, of)| [of.value, of.low, of.high].iter().all(|x| x.is_finite()));
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
