//! The result for devices that no puck of the model explains: means over models and over bands of frequency, and their residuals.

use rayon::prelude::*;

use crate::counts::Lattice;
use crate::equation::{
    BLOCKS, Band, CONSTANT, COSINE, DAMPING, DIRECTION, Errors, FEWEST, FORCE, FRICTION, INERTIA, Mask, SINE,
    STIFFNESS, Solved, TERMS, TorqueRows,
};
use crate::identified::Known;
use crate::interval::Interval;
use crate::intervals::positive;
use crate::misfit::{Misfit, misfit};
use crate::predicted::predicted;
use crate::puck::Puck;
use crate::quantile::student;
use crate::record::{CancellableRecord, Record};
use crate::start::{delayed, signs};
use crate::terms::{Choice, Term, TermKind, terms};

/// The bands: lengths of the windows in s, and whether the weight is the bump's slope. The longer ones contain slow torques, and the slope
/// no constant one: where the model is right all agree, and where they differ the interval is as wide as they differ.
const BANDS: [Band; 7] = [
    Band { length: 0.03, slope: false },
    Band { length: 0.06, slope: false },
    Band { length: 0.1, slope: false },
    Band { length: 0.15, slope: false },
    Band { length: 0.06, slope: true },
    Band { length: 0.1, slope: true },
    Band { length: 0.15, slope: true },
];
/// The bands of the picture and of the misfit: the first whose windows have enough samples.
const SHOWN: [Band; 3] = [BANDS[1], BANDS[2], BANDS[3]];
/// The number of delays that are tried, and their step in s.
const DELAYS: usize = 11;
const DELAY_STEP: f64 = 1e-3;
/// A band with more than this part of noise in the squared accelerations, or of residual in the torques, is not used where others are
/// better.
const NOISY: f64 = 0.1;
const LEFT: f64 = 0.5;
/// The exponent of the likelihood where every model is wrong.
const TEMPER: f64 = 0.25;
/// The degrees of freedom of intervals, by the blocks of the jackknife.
const FREEDOM: f64 = (BLOCKS - 1) as f64;
/// Student's t of 95 % at one end, with this many degrees of freedom.
const ONE_SIDED: f64 = 1.895;
/// Student's t of 99.9 % with this many degrees of freedom: beyond it a sign is determined.
const SURELY: f64 = 5.408;
/// An inertia of less than this many standard errors is not determined.
const TOLD: f64 = 1.2;
/// Where more than this part of the torque's variance is left, the motion is unrelated to it.
const UNRELATED: f64 = 0.8;
/// Where a hand moves the puck, more than this part of the torque's variance, beyond noise, depends on none of position, velocity and time.
const STRANGE: f64 = 0.05;
/// The same of a device without friction.
const UNRESISTED: f64 = 0.02;
/// Where the equation of motion leaves more than this part of the torque beyond noise, the device may be richer than the puck.
const RICH: f64 = 3e-3;
/// A torque that position and velocity give by themselves to within this part of its variance is the law of the loop, or of the spring that
/// the device touched: with such a torque no inertia is determined.
const LAW_LEAVES: f64 = 0.02;
const LAW: Mask = {
    let mut law = mask(&[STIFFNESS]);
    law[INERTIA] = false;
    law[FRICTION] = false;
    law
};
/// A sine of the position is separated from a stiffness over this travel, in rad.
const TRAVEL: f64 = 1.0;

const fn mask(more: &[usize]) -> Mask {
    let mut mask = [false; TERMS];
    mask[INERTIA] = true;
    mask[DAMPING] = true;
    mask[FRICTION] = true;
    mask[CONSTANT] = true;
    let mut i = 0;
    while i < more.len() {
        mask[more[i]] = true;
        i += 1;
    }
    mask
}

pub(crate) const PLAIN: Mask = mask(&[]);
/// With a torque of the position that is spring or gravity.
pub(crate) const BENT: Mask = mask(&[STIFFNESS, SINE, COSINE]);
/// Friction by direction hides a constant, so a model that has a sine of the position is tried without it too.
const MODELS: [Mask; 5] =
    [PLAIN, mask(&[STIFFNESS]), mask(&[STIFFNESS, DIRECTION]), BENT, mask(&[STIFFNESS, DIRECTION, SINE, COSINE])];

fn is_rich(beyond_noise: f64, share: f64) -> bool {
    beyond_noise > RICH && beyond_noise > 0.5 * share
}

/// A model, with the second torque where the record has one.
fn with_force(mut model: Mask, record: &Record) -> Mask {
    model[FORCE] = record.forces().is_some();
    model
}

/// The numbers of the best fit of the torque by inertia, damping, friction and a constant torque on the puck, in SI. They have no intervals,
/// and may be far from the device's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestFit {
    /// The known one, where it is. Positive: the sign of the torque is the one that makes it so, here and in the other numbers.
    pub inertia: f64,
    /// Of either sign, as friction and offset.
    pub damping: f64,
    /// Coulomb's.
    pub friction: f64,
    /// The constant torque.
    pub offset: f64,
}

/// The fit of the equation of motion to the torque, with 95 % intervals that hold where the device is richer than the equation.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueFit {
    /// J in kg·m² (linear: kg), from the estimate by the torque up to the one by the motion (for a value between two estimates: Imbens and
    /// Manski, Econometrica 72 (2004) 1845); from 0 where there may be none, `None` where the record does not determine it.
    pub inertia: Option<Interval>,
    /// b in N·m·s/rad (N·s/m).
    pub damping: Option<Interval>,
    /// Coulomb's, in N·m (N).
    pub friction: Option<Interval>,
    /// A constant torque, in N·m (N).
    pub offset: Option<Interval>,
    /// The true torque per commanded torque, where the inertia is known beforehand.
    pub gain: Option<Interval>,
    /// 1 or -1, where the motion determines it at 99.9 %.
    pub sign: Option<f64>,
    /// The inertia by least squares of the torque, kg·m² (kg): biased towards 0 by other torques on the puck, unless the torque follows the
    /// motion.
    pub inertia_by_torque: Option<Interval>,
    /// The inertia by the regression of the acceleration on the torque: biased away from 0 by the parts of the torque that are not the
    /// device's.
    pub inertia_by_motion: Option<Interval>,
    /// The factor of the second torque of the record, of either sign: so multiplied it acts on the puck, along the position.
    pub force: Option<Interval>,
    /// The terms of the record in addition to these, in parts of the commanded torque.
    pub terms: Vec<Term>,
    /// Whether more than a twentieth of the torque depends on none of position, velocity and time, or, without friction, more than a fiftieth:
    /// then something else moves the puck, and no inertia is determined.
    pub is_moved_by_another: bool,
    /// The lattice of the positions.
    pub lattice: Option<Lattice>,
    /// The residual of the equation.
    pub misfit: Misfit,
    /// The numbers of that fit.
    pub best: BestFit,
    /// The part of the torque's variance that the equation does not explain, and the positions' noise does not either.
    pub beyond_noise: f64,
    /// The delay that the fit assumes, in s.
    pub delay: f64,
    /// Times and positions that the fit predicts, begun anew every [`crate::PREDICTION_S`] s from the measured ones; none without an
    /// inertia, and none with a second torque.
    pub motion: Vec<(f64, f64)>,
    /// The windows, for a picture.
    pub windows: Vec<Window>,
}

/// A window of the record, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The time of its middle, in s.
    pub time: f64,
    /// The mean position, in rad (m).
    pub position: f64,
    /// The mean velocity, in rad/s (m/s).
    pub velocity: f64,
    /// The commanded torque, in N·m (N).
    pub torque: f64,
    /// The torque of the equation.
    pub fitted: f64,
}

impl TorqueFit {
    /// The fields of `hapt identify --json`, in its order, as [`crate::Identified::named`]; delay and lag are not determined.
    pub fn named(&self, is_linear: bool) -> [(&'static str, Option<Interval>); 9] {
        let exactly = |value: f64| Interval { value, low: value, high: value };
        [
            ("inertia", self.inertia),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay_s", None),
            ("lag_s", None),
            ("late_s", None),
            ("offset", self.offset),
            ("sign", self.sign.map(exactly)),
            ("counts_per_rev", self.counts().filter(|_| !is_linear).map(exactly)),
        ]
    }

    /// The encoder's counts a revolution, where they are whole.
    pub fn counts(&self) -> Option<f64> {
        let counts = std::f64::consts::TAU / self.lattice?.step;
        let whole = counts.round();
        ((counts - whole).abs() < 1e-3 && whole > 0.0).then_some(whole)
    }

    /// Whether the equation of motion leaves more of the torque than the positions' noise explains, as for a richer device.
    pub fn leaves_more_than_noise(&self) -> bool {
        is_rich(self.beyond_noise, self.misfit.share)
    }

    /// The part of its residual without terms that torques and friction of the position predict.
    pub(crate) fn of_position(&self) -> f64 {
        let is_one = |term: &&Term| !matches!(term.kind, TermKind::Stribeck { .. } | TermKind::Drag);
        self.terms.iter().filter(is_one).filter_map(|term| term.predicts).sum()
    }

    /// Whether the motion hardly depends on the torque: the columns may not be of one device, or a hand moved it.
    pub fn is_unrelated(&self) -> bool {
        self.inertia.is_none() && self.misfit.share > UNRELATED
    }
}

/// A mean over models or bands.
#[derive(Clone, Copy, Debug)]
struct Mean {
    value: f64,
    variance: f64,
}

/// The weighted mean, and the variance of one value with their differences: all use the same record, so their number does not narrow it.
fn mean(parts: impl Iterator<Item = (f64, Mean)> + Clone) -> Option<Mean> {
    let weight: f64 = parts.clone().map(|part| part.0).sum();
    let value = parts.clone().map(|(w, part)| w * part.value).sum::<f64>() / weight;
    let variance = parts.map(|(w, part)| w * (part.variance + (part.value - value).powi(2))).sum::<f64>() / weight;
    (value.is_finite() && variance.is_finite()).then_some(Mean { value, variance })
}

/// The models of a band, weighted by their likelihood over the independent values, tempered: none of them is the device (Grünwald, The safe
/// Bayesian, 2012).
fn weighed(models: &[Solved]) -> Vec<(f64, &Solved)> {
    let least = models.iter().map(|model| model.share).fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE);
    let of = |model: &Solved| (model.share.max(least) / least).powf(-0.5 * TEMPER * model.independent.min(30.0));
    models.iter().map(|model| (of(model), model)).collect()
}

/// Fits the equation of motion to the torque.
///
/// `None` where there is no torque, or where no window of the record moves.
pub fn fit_torque(record: &Record, known: &Known) -> Option<TorqueFit> {
    fit_torque_by(record, known, Errors::default())
}

/// The same, or `None` once `stop` is true.
pub fn fit_torque_until(record: &Record, known: &Known, stop: &(dyn Fn() -> bool + Sync)) -> Option<TorqueFit> {
    fitted(&CancellableRecord { record, stop }, known, Errors::default())
}

/// The same with standard errors by another method, to compare their coverage.
#[doc(hidden)]
pub fn fit_torque_by(record: &Record, known: &Known, errors: Errors) -> Option<TorqueFit> {
    fitted(&CancellableRecord { record, stop: &|| false }, known, errors)
}

fn fitted(record: &CancellableRecord<'_>, known: &Known, errors: Errors) -> Option<TorqueFit> {
    let goes_on = || !(record.stop)();
    if !record.is_driven() {
        return None;
    }
    let signs = signs(record);
    let duration = record.period() * record.times().len() as f64;
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let turns = !known.is_linear && high - low > TRAVEL;
    let models: Vec<Mask> =
        MODELS.iter().filter(|model| turns || !model[SINE]).map(|model| with_force(*model, record)).collect();
    let (plain_terms, spring_terms) = (models[0], models[1]);
    let shown = |rows: &TorqueRows| {
        let mut models = [spring_terms, plain_terms].into_iter();
        Some(models.find_map(|model| rows.solved(model, duration))?.share)
    };
    let has_enough = |band: &Band| (0.5 * band.length / record.period()).round() as usize >= FEWEST;
    let band_shown = SHOWN.into_iter().find(has_enough)?;
    let rows = TorqueRows::new(record, &signs, record.torques(), band_shown);
    let weights = rows.weights(record);
    let samples = record.record;
    let late = |delay: f64| rows.under(&weights, &delayed(samples, delay));
    let best_of = |first: f64, step: f64, count: usize| {
        let delays = (0..count).into_par_iter().map(|i| first + i as f64 * step).filter(|delay| *delay >= 0.0);
        let shares: Vec<(f64, f64)> = delays.filter_map(|delay| Some((delay, shown(&late(delay))?))).collect();
        Some(shares.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?.0)
    };
    let delay = best_of(0.0, DELAY_STEP, DELAYS)?;
    // In a loop a delay is a damping, which therefore is no better known than the delay between two steps.
    let finer = best_of(delay - 0.75 * DELAY_STEP, 0.25 * DELAY_STEP, 7)?;
    let damping_at = |delay: f64| Some(late(delay).solved(plain_terms, duration)?.values[DAMPING]);
    let by_delay = damping_at(finer).zip(damping_at(delay)).map_or(0.0, |(finer, there)| finer - there);
    drop((rows, weights));
    let torques = &delayed(record, delay);
    let of_band = |band: &Band| {
        if !goes_on() || 4.0 * band.length >= duration {
            return None;
        }
        let rows = TorqueRows::new(samples, &signs, torques, *band).with_errors(errors);
        if rows.rows.len() < 4 * TERMS {
            return None;
        }
        let solved = models.iter().take_while(|_| goes_on()).filter_map(|model| rows.solved(*model, duration));
        let solved: Vec<Solved> = solved.collect();
        (!solved.is_empty()).then(|| (*band, rows.noise_part(), solved))
    };
    let (mut solved_bands, rows): (Vec<(Band, f64, Vec<Solved>)>, TorqueRows) = rayon::join(
        || BANDS.par_iter().filter_map(of_band).collect(),
        || TorqueRows::new(samples, &signs, torques, band_shown).with_errors(errors),
    );
    if !goes_on() {
        return None;
    }
    let least = |solved: &[Solved]| solved.iter().map(|model| model.share).fold(f64::INFINITY, f64::min);
    let good = |(_, noise, solved): &(Band, f64, Vec<Solved>)| *noise < NOISY && least(solved) < LEFT;
    if solved_bands.iter().any(good) {
        solved_bands.retain(good);
    }
    let over = |pick: &dyn Fn(&Solved) -> Option<(f64, f64)>, with_slopes: bool| {
        let bands = solved_bands.iter().filter(|band| with_slopes || !band.0.slope);
        let means: Vec<(f64, Mean)> = bands
            .filter_map(|(_, _, solved)| {
                let part = |(weight, model): (f64, &Solved)| {
                    pick(model).map(|(value, error)| (weight, Mean { value, variance: error.powi(2) }))
                };
                mean(weighed(solved).into_iter().filter_map(part).collect::<Vec<_>>().into_iter())
            })
            .map(|mean| (mean.variance.max(f64::MIN_POSITIVE).recip(), mean))
            .collect();
        mean(means.into_iter())
    };
    let of = |term: usize, with_slopes: bool| {
        let has = |model: &Solved| term != CONSTANT || model.has_constant;
        over(&|model| has(model).then(|| (model.values[term], model.errors[term])), with_slopes)
    };
    let t = student(FREEDOM);
    let interval = |mean: Mean, sign: f64| {
        let (value, half) = (sign * mean.value, t * mean.variance.sqrt());
        Interval { value, low: value - half, high: value + half }
    };
    let inertia = of(INERTIA, true)?;
    let sign = if inertia.value < 0.0 { -1.0 } else { 1.0 };
    let deviation = inertia.variance.sqrt();
    let plain = rows.solved(plain_terms, duration)?;
    // Motion of one frequency does not separate an inertia from a spring, nor from a hand.
    let is_apart = rows.solved(spring_terms, duration).is_some();
    // A sensor's torque separates the device from a spring that it touched, where it explains more than the law.
    let least = if record.forces().is_some() { LAW_LEAVES.min(plain.share) } else { LAW_LEAVES };
    let is_a_law = rows.solved(LAW, duration).is_some_and(|law| law.share < least);
    let (misfit, beyond_noise) =
        (misfit(record, &signs, &rows, &plain, duration, known.is_linear), rows.unexplained(&plain));
    // The part that depends on none of position, velocity and time, beyond the positions' noise, is another torque.
    let strange = misfit.strange.min(beyond_noise);
    // A motor that moves a device works against its friction. Where none shows, the torque may be the law of a loop that a hand moves.
    let rubs = of(FRICTION, false).is_some_and(|mean| sign * mean.value > t * mean.variance.sqrt());
    let most = if rubs { STRANGE } else { UNRESISTED };
    let is_moved = is_rich(beyond_noise, misfit.share) && strange > most;
    let is_determined = inertia.value.abs() > TOLD * deviation && !is_a_law && !is_moved && is_apart;
    let inertia_by_motion = over(&|model| Some(model.by_motion), true).filter(|_| is_determined);
    // The truth lies between the two where the torque does not follow the motion: each end has a one-sided quantile.
    let reach = inertia_by_motion.map_or(0.0, |mean| sign * mean.value + ONE_SIDED * mean.variance.sqrt());
    let whole = interval(inertia, sign);
    let found = is_determined.then(|| positive(Interval { high: whole.high.max(reach), ..whole }));
    let inertia_by_torque = is_determined.then(|| positive(whole));
    let carries = is_determined && is_rich(beyond_noise, misfit.share);
    let found_terms =
        if carries { terms(record, &rows, sign, known.is_linear, Choice::Sure).terms } else { Vec::new() };
    // Where the inertia is known, all torques are in parts of the motor's.
    let gain = known.inertia.map(|known| known / inertia.value.abs()).filter(|gain| gain.is_finite());
    let scaled = |x: Interval, by: f64| Interval { value: by * x.value, low: by * x.low, high: by * x.high };
    let torque = |term: usize, sign: f64| {
        let x = of(term, false).map(|mean| interval(mean, sign))?;
        if known.inertia.is_some() { gain.map(|gain| scaled(x, gain)) } else { Some(x) }
    };
    let more = sign * by_delay * gain.unwrap_or(1.0);
    let motor = gain.zip(found).map(|(gain, x)| Interval {
        value: gain,
        low: gain * x.value / x.high,
        high: if x.low > 0.0 { gain * x.value / x.low } else { f64::MAX },
    });
    // The scale of this one fit, with which a known inertia is its own.
    let scale = known.inertia.map_or(1.0, |known| known / plain.values[INERTIA].abs());
    let size = |term: usize| plain.values[INERTIA].signum() * plain.values[term] * scale;
    let best = BestFit {
        inertia: size(INERTIA),
        damping: size(DAMPING) - known.back_damping,
        friction: size(FRICTION),
        offset: -size(CONSTANT),
    };
    // The puck of the equation that the picture shows.
    let moves = is_determined && record.forces().is_none() && plain.values[INERTIA] * sign > 0.0;
    let per_inertia = |term: usize| plain.values[term] / plain.values[INERTIA];
    let puck = moves.then(|| Puck {
        gain: plain.values[INERTIA].recip(),
        damping: per_inertia(DAMPING),
        friction: per_inertia(FRICTION),
        delay,
        offset: -per_inertia(CONSTANT),
        position: 0.0,
        velocity: 0.0,
        lag: 0.0,
    });
    let windows = rows.rows.iter().zip(&plain.left).map(|(row, left)| Window {
        time: row.time,
        position: row.position,
        velocity: row.velocity,
        torque: row.torque,
        fitted: row.torque - left,
    });
    goes_on().then(|| TorqueFit {
        inertia: match known.inertia {
            Some(known) => Some(Interval { value: known, low: known, high: known }),
            None => found,
        },
        damping: torque(DAMPING, sign)
            .filter(|_| is_determined)
            .map(|x| Interval { value: x.value, low: x.low + more.min(0.0), high: x.high + more.max(0.0) })
            .map(|damping| known.own(positive(damping))),
        friction: torque(FRICTION, sign).filter(|_| is_determined).map(positive),
        // A positive constant torque on the puck is negative in the equation.
        offset: torque(CONSTANT, -sign).filter(|_| is_determined),
        gain: motor.filter(|motor| motor.high < f64::MAX),
        sign: (is_determined && inertia.value.abs() > SURELY * deviation).then_some(sign),
        lattice: record.lattice(),
        misfit,
        best,
        beyond_noise,
        inertia_by_torque,
        inertia_by_motion: inertia_by_motion.map(|mean| positive(interval(mean, sign))),
        force: record.forces().and_then(|_| torque(FORCE, -sign)).filter(|_| is_determined),
        is_moved_by_another: is_moved,
        terms: found_terms,
        delay,
        motion: puck.map_or(Vec::new(), |puck| predicted(record, puck)),
        windows: windows.collect(),
    })
}
