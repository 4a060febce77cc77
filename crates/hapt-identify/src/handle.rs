//! A device whose handle is on a flexible shaft: both inertias, the shaft's stiffness and damping, and the losses, delay and lag of the
//! motor's side.
//!
//! The model is solved exactly under the recorded torques at their times ([`Shafted`]). Its derivatives are differences of such runs. The
//! encoder is at the motor, the handle is free.

use hapt_model::Handle;
use hapt_plant::spec::DeviceSpec;
use nalgebra::{DMatrix, DVector};

use crate::counts::lattice;
use crate::error::{Error, LargeResidual};
use crate::estimate::{best, residual, variance};
use crate::explained::explained;
use crate::identified::{CorrelatedPair, Interval, Residual};
use crate::intervals::{CORRELATED, VAGUE, no_longer, positive};
use crate::lag::Late;
use crate::quantile::student;
use crate::record::{LONGEST_DELAY, Record, Watched};
use crate::shaft::Shafted;
use crate::spectrum::{Line, line};
use crate::start::{Begin, begins, starts};

/// Of ln (J + J_h), b, f, the time d + λ to the torque, ln (J_h / J), ln (k / m), d / m, λ², with m = J J_h / (J + J_h); of the beginning,
/// the motor's position, its velocity, and what position and velocity of the handle are beyond these.
///
/// A record tells the whole inertia, the resonance √(k/m) and its decay d/m well, and the ratio of the inertias badly. In these
/// coordinates the valley of good fits is straight, and the steps along it are long.
const PARAMETERS: usize = 12;
type Parameters = [f64; PARAMETERS];

const FRICTION: usize = 2;
const LATE: usize = 3;
const VARIANCE: usize = 7;
/// The first parameter of the beginning.
const POSITION: usize = 8;
/// The parameters of a device that begins at rest, on an unloaded shaft: without the last three.
const AT_REST: usize = PARAMETERS - 3;
/// How large these are at most, in rad/s, rad and rad/s (linear: m).
const FIRST: [f64; 3] = [100.0, 1.0, 100.0];
/// Damping, friction, the time to the torque, the shaft's damping and λ².
const NOT_BELOW_0: [usize; 5] = [1, FRICTION, LATE, 6, VARIANCE];
/// The names of the parameters of the device, for those that a record does not separate.
const NAMES: [&str; POSITION] =
    ["inertia", "damping", "friction", "delay", "share of the handle", "shaft stiffness", "shaft damping", "lag"];
/// No command acts so much earlier than it is given, in s: delays below 0 are looked for up to here, as beside a rigid device.
const EARLIEST: f64 = 0.2 * LONGEST_DELAY;

/// Of [`PARAMETERS`], those that enter by their logarithms.
const LOGARITHMS: [usize; 3] = [0, 4, 5];

/// Parts of the whole inertia that are the motor's, from which fits start.
const SHARES: [f64; 5] = [0.5, 0.3, 0.7, 0.15, 0.85];
/// The most fits that are followed to their end.
const FOLLOWED: usize = 4;
/// Steps of a fit that is compared with others, first without a lag and then with one or beside the best, and of one that is followed to its
/// end.
const FEW: usize = 10;
const SOME: usize = 20;
const MOST: usize = 100;
/// The lag from which one is looked for, in periods.
const SHORT: f64 = 0.5;
/// Parts of delay and lag together that are the lag's, and parts of λ² and of the friction, from which a fit is repeated.
const BESIDE: [(usize, f64); 7] =
    [(LATE, 0.9), (LATE, 0.6), (LATE, 0.3), (FRICTION, 0.5), (FRICTION, 0.0), (VARIANCE, 1.5), (VARIANCE, 0.7)];
/// A step of this many standard errors is none.
const SMALL: f64 = 1e-3;

/// What a record tells of a device with a handle; each value with its 95 % interval, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct WithHandle {
    /// J of the motor's side.
    pub inertia: Interval,
    /// Viscous, of the motor's side.
    pub damping: Interval,
    /// Coulomb's, of the motor's side.
    pub friction: Interval,
    /// From the sample to the change of the torque, in s. Where the interval of the lag begins at 0, the record does not tell them apart, and
    /// this is both together.
    pub delay: Interval,
    /// The motor's, in s.
    pub lag: Interval,
    /// Delay and lag together, in s.
    pub late: Interval,
    /// J_h of the handle beyond the shaft.
    pub handle_inertia: Interval,
    /// Of the shaft.
    pub stiffness: Interval,
    /// Of the shaft.
    pub shaft_damping: Interval,
    /// Of both inertias on the shaft, hands-off, in Hz.
    pub resonance_hz: f64,
    /// Two of delay, lag, shaft damping, ... that the record hardly separates.
    pub correlated: Vec<CorrelatedPair>,
    /// What the fit leaves.
    pub residual: Residual,
}

/// Fits a device with a handle to a record that begins at rest or in motion.
///
/// # Errors
/// [`Error::Unexplained`] and [`Error::Residual`] where no such device explains it.
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
        measured(record).map(|i| record.times()[i]).zip(positions(record, &self.fit.p).unwrap_or_default()).collect()
    }

    /// What it leaves of the record's.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        measured(record).map(|i| record.times()[i]).zip(self.fit.left.iter().copied()).collect()
    }
}

/// The search for the device that explains a record. A search that begins near a device ends with it where that explains the record.
pub(crate) fn search(watched: &Watched<'_>, near: Option<&DeviceSpec>) -> Result<Found, Error> {
    let Watched { record, stop } = *watched;
    let (lattice, spread) = (lattice(record.positions()), variance(record.positions()).sqrt());
    let explains = |fit: &Fit| explained(record, &fit.left, lattice, spread);
    let from = |(rests, p): (bool, Parameters)| {
        let mut fit = Fit::of(record, p, rests)?;
        if !rests {
            // A wrong beginning of a fast motion would bend every other number first.
            fit.free = Free::Beginning;
            fit = fit.improved(record, FEW, stop)?;
        }
        // Far from the device a lag takes what is another parameter's.
        fit.free = Free::ButLag;
        fit.improved(record, FEW, stop)
    };
    // The best after a few steps need not be the best in the end, and beside much noise more than one may explain the record.
    let mut best: Option<Fit> = None;
    for starts in [near.map(|device| around(record, device)), starts_of(watched)].into_iter().flatten() {
        let by_squares = |a: &Fit, b: &Fit| a.squares.total_cmp(&b.squares);
        let mut fits: Vec<Fit> = starts.into_iter().filter_map(from).collect();
        fits.sort_by(by_squares);
        fits.truncate(FOLLOWED);
        let with_lag = |fit: Fit| fit.lagging(record).improved(record, SOME, stop);
        let mut fits: Vec<Fit> = fits.into_iter().filter_map(with_lag).collect();
        fits.sort_by(by_squares);
        for fit in fits {
            if stop() || best.as_ref().is_some_and(explains) {
                break;
            }
            best = best.into_iter().chain(fit.improved(record, MOST, stop)).min_by(by_squares);
        }
        if best.as_ref().is_some_and(explains) {
            break;
        }
    }
    let fit = best.ok_or(Error::Unexplained)?.settled(record, stop);
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
        (device.delay + device.lag).clamp(0.0, LONGEST_DELAY),
        (handle.inertia / device.inertia).ln(),
        (handle.stiffness / mass).ln(),
        handle.damping / mass,
        device.lag.min(LONGEST_DELAY).powi(2),
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
    (start[POSITION], start[POSITION + 1]) = (position, velocity);
    start
}

/// At the line that a rigid device leaves in the record; `None` without one.
fn starts_of(watched: &Watched<'_>) -> Option<Starts> {
    let record = watched.record;
    let rigid = best(watched, &starts(watched))?;
    let Line { hz, .. } = line(&rigid.puck.left_from_sample(record, rigid.first))?;
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
            0.0,
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
    free: Free,
    left: Vec<f64>,
    squares: f64,
    derivatives: DMatrix<f64>,
}

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Free {
    /// The beginning alone, of a device that is known.
    Beginning,
    /// All but the lag.
    ButLag,
    All,
}

/// J, J_h and m = J J_h / (J + J_h).
fn inertias(p: &Parameters) -> [f64; 3] {
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
fn positions(record: &Record, p: &Parameters) -> Option<Vec<f64>> {
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
    fn of(record: &Record, p: Parameters, rests: bool) -> Option<Fit> {
        let there = positions(record, &p)?;
        let left: Vec<f64> = measured(record).zip(&there).map(|(i, there)| record.positions()[i] - there).collect();
        let squares: f64 = left.iter().map(|r| r * r).sum();
        squares.is_finite().then_some(Fit {
            p,
            rests,
            free: Free::All,
            left,
            squares,
            derivatives: DMatrix::zeros(0, 0),
        })
    }

    fn is_free(&self, i: usize) -> bool {
        match self.free {
            Free::Beginning => i >= POSITION,
            Free::ButLag => i != VARIANCE,
            Free::All => true,
        }
    }

    fn parameters(&self) -> usize {
        if self.rests { AT_REST } else { PARAMETERS }
    }

    /// The change of each parameter over which a derivative is taken.
    fn steps(&self, period: f64) -> Parameters {
        let [whole, b, f, late, _, square, decay, variance, _, v, _, rate_beyond] = self.p;
        let (whole, rate) = (whole.exp(), (0.5 * square).exp());
        // Wide enough to see past single stops and starts under friction.
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

    /// The same with a lag that is fitted too, and not from 0, where a motor that sticks may hide it.
    fn lagging(mut self, record: &Record) -> Fit {
        let mut p = self.p;
        p[VARIANCE] = p[VARIANCE].max((SHORT * record.period()).powi(2));
        self.free = Free::All;
        Fit::of(record, p, self.rests).unwrap_or(self)
    }

    /// The best of the fits from here and from other lags and frictions: each stop of a motor bends the squares, and a fit can end beside
    /// the least.
    fn settled(mut self, record: &Record, stop: &dyn Fn() -> bool) -> Fit {
        for (i, part) in BESIDE {
            let mut p = self.p;
            match i {
                // A lag that is missed is another share of the inertia.
                LATE => p[VARIANCE] = (part * p[LATE]).powi(2),
                i => p[i] *= part,
            }
            let beside = Fit::of(record, p, self.rests).and_then(|fit| fit.improved(record, SOME, stop));
            if let Some(better) = beside.filter(|fit| fit.squares < self.squares) {
                self = better;
            }
        }
        self
    }

    /// With its derivatives.
    fn differentiated(mut self, record: &Record) -> Option<Fit> {
        let steps = self.steps(record.period());
        let mut derivatives = DMatrix::zeros(self.left.len(), PARAMETERS);
        let parameters = self.parameters();
        for (i, step) in steps.into_iter().enumerate().take(parameters).filter(|(i, _)| self.is_free(*i)) {
            let mut p = self.p;
            p[i] += step;
            let moved = Fit::of(record, p, self.rests)?;
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
            p[LATE] = p[LATE].min(LONGEST_DELAY);
            p[VARIANCE] = p[VARIANCE].min((p[LATE] + EARLIEST).powi(2));
            let is_small = size < SMALL * SMALL * at.squares / at.left.len() as f64;
            let next = Fit::of(record, p, at.rests).map(|next| Fit { free: at.free, ..next });
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

    fn normal(&self) -> (DMatrix<f64>, DVector<f64>) {
        let left = DVector::from_column_slice(&self.left);
        (self.derivatives.transpose() * &self.derivatives, self.derivatives.transpose() * left)
    }

    /// Pairs of the device's parameters that the record does not separate, by their normalised covariance and half intervals.
    fn correlated(&self, inverse: &DMatrix<f64>, half: impl Fn(usize) -> f64) -> Vec<CorrelatedPair> {
        let vague = |i: usize| half(i) > VAGUE * if LOGARITHMS.contains(&i) { 1.0 } else { self.p[i].abs() };
        let pairs = (0..POSITION).flat_map(|i| (i + 1..POSITION).map(move |j| (i, j)));
        let of = |(i, j): (usize, usize)| {
            let correlation = inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt();
            let is_one = correlation.abs() > CORRELATED && (vague(i) || vague(j));
            is_one.then_some(CorrelatedPair { names: [NAMES[i], NAMES[j]], correlation })
        };
        pairs.filter_map(of).collect()
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
        let unit = student(freedom).powi(2) * self.squares / freedom;
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
        let half = |i: usize| error(&[(i, 1.0)]);
        let slope = inverse[(LATE, VARIANCE)] * scale[LATE] / (inverse[(VARIANCE, VARIANCE)] * scale[VARIANCE]);
        let late = Late::new([self.p[LATE], half(LATE)], [self.p[VARIANCE], half(VARIANCE)], slope)?;
        let found = WithHandle {
            inertia: log(inertia, &[(0, 1.0), (4, -share)]),
            damping: plain(self.p[1], &[(1, 1.0)]),
            friction: plain(self.p[2], &[(2, 1.0)]),
            delay: positive(if late.is_told() { late.delay() } else { late.late() }),
            lag: no_longer(late.lag(), late.late()),
            late: positive(late.late()),
            handle_inertia: log(handle, &[(0, 1.0), (4, 1.0 - share)]),
            stiffness: log(mass * self.p[5].exp(), &[(0, 1.0), (4, 1.0 - 2.0 * share), (5, 1.0)]),
            shaft_damping: plain(damping, &[(0, damping), (4, damping * (1.0 - 2.0 * share)), (6, mass)]),
            resonance_hz: (0.5 * self.p[5]).exp() / std::f64::consts::TAU,
            correlated: self.correlated(&inverse, half),
            residual,
        };
        let finite = found.named().iter().all(|(_, of)| [of.value, of.low, of.high].iter().all(|x| x.is_finite()));
        finite.then_some(found)
    }
}

impl WithHandle {
    /// The numbers under their names, in the order of `hapt identify --handle --json`.
    pub fn named(&self) -> [(&'static str, Interval); 9] {
        [
            ("inertia", self.inertia),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay_s", self.delay),
            ("lag_s", self.lag),
            ("late_s", self.late),
            ("handle_inertia", self.handle_inertia),
            ("stiffness", self.stiffness),
            ("shaft_damping", self.shaft_damping),
        ]
    }
}

/// The line of a shaft in what a rigid device leaves, in Hz; `None` where no line stands out.
pub(crate) fn resonance(left: &[(f64, f64)]) -> Option<f64> {
    line(left).filter(Line::is_clear).map(|line| line.hz)
}
