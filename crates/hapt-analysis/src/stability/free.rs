//! Stability of the free loop: world, estimator, delay, hold and device together, with a handle on a shaft where there is one, hands-off. Levels, encoder, limit and Coulomb
//! friction are omitted; nonlinear couplings enter by their slopes, and so do gravity and cogging of the device: with slope 0, and as a
//! spring from puck to ground of their steepest slope.
//!
//! Modes decoupled from the puck keep their eigenvalues of the held world, with their closed forms. The rest is one matrix, that of
//! `closed_loop`. Shifts that change no torque are removed before the eigenvalue solver. Momentum, where the scheme conserves it, is
//! then a simple eigenvalue 1, accurate to a few eps. It is conserved where the torque on a wheel in uniform rotation is 0:
//! forward and semi-implicit Euler at START, zoh and the trapezoidal rule at MIDDLE, backward Euler at END, tustin and
//! foh. Half a sample later the torque accelerates the whole loop, at (KT/2 - b)/(J_z + J_w); a whole sample later at
//! (KT - b)/(J_z + J_w).

use hapt_model::{Device, EstimatorKind, Method, Output, Sampling, World};
use nalgebra::{Complex, DMatrix};

use crate::equations::closed_loop::closed_loop;
use crate::equations::continuous::{of_step, piecewise};
use crate::equations::discrete::keeps_energy;
use crate::equations::estimator::{Filter, PositionFilter};
use crate::equations::grip::Grip;
use crate::equations::modal::Modal;
use crate::equations::port::Port;
use crate::equations::slopes::combinations;
use crate::equations::structure::{Part, inertias_with_puck, linearise_with_puck, parts};
use crate::error::{Error, positive};
use crate::numerics::crossing::{Ranked, Spacing, first_crossing_within, growth_floor};
use crate::numerics::eigenvalues::{eigenvalues, eigenvalues_and_scale};
use crate::numerics::rayleigh::Quotients;
use crate::stability::critical::{Critical, of_part};
use crate::stability::delayed::Delayed;
use crate::stability::held::spectrum;
use crate::stability::modal_loop::ModalLoop;
use crate::stability::multiplier::{Multiplier, Root, multiplier};
use crate::stability::pairs::continuous_pairs;
use crate::stability::{Eigenvalue, MARGINAL, NOT_SEARCHED, Stability, assemble};

/// The search for the critical period begins at this fraction of the period, or at this fraction of the delay, whichever is longer.
const SHORTEST: (f64, f64) = (1e-3, 1.0 / 64.0);

/// The search ends at this multiple of the longest time constant. Beyond it every product of a rate and the period is large, and
/// stability no longer changes.
const MAX_PERIOD_RATIO: f64 = 100.0;

/// Relative distance above a proved period at which a growth means that the proof ends where the stability does.
const CLOSE: f64 = 1e-10;

/// Largest relative change of a rate from one period to the next for which the same change is expected up to another.
const MOVED: f64 = 0.1;

/// Length of a sample, in time constants of a mode, from which on the mode has decayed by the next sample.
const FORGOTTEN: f64 = 3.0;

/// Largest number of modes whose resonances in pairs are computed, too.
const MOST_PAIRED: usize = 8;

/// Error of an eigenvalue, relative to the largest entry of the matrix.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Distance from the unit circle, as a multiple of the error, below which an eigenvalue is refined.
const DOUBTFUL: f64 = 100.0;

/// The result of one part of the world.
#[derive(Clone, Debug)]
struct PartResult {
    /// Number of shifts that change no torque: λ = 1, not in `multipliers`.
    shifts: usize,
    multipliers: Vec<Multiplier>,
    /// z = Ts of the differential equation's complex pairs, Im z > 0.
    pairs: Vec<Root>,
    critical: Critical,
}

/// How much of the result is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Extent {
    Whole,
    /// No critical period, which is most of the work.
    ThisPeriod,
    /// No modes of the differential equation either.
    Eigenvalues,
}

/// Eigenvalues, growth, critical period and modes of the loop, hands-off. Where the bodies step at every n-th sample, the eigenvalues are
/// those of n samples, and the critical period is that of a sample, n staying what it is.
///
/// Work, for each combination of slopes: O(n³) in the modes coupled to the puck, estimator memory and commands in flight, and about
/// a hundred times that for the critical period; with many bodies a tenth of it.
///
/// # Errors
/// [`Error::Value`] for a period or inertia that is not positive, [`Error::NoSuchBody`], [`Error::InFlight`] for a delay of too
/// many periods, [`Error::Step`] and [`Error::Eigenvalues`] when numbers leave double precision.
pub fn free(world: &World) -> Result<Stability, Error> {
    analyse(world, &Grip::default(), Extent::Whole)
}

/// As [`free`], without the search for the critical period, whose reason is then [`NOT_SEARCHED`].
///
/// # Errors
/// As [`free`].
pub(crate) fn free_at_this_period(world: &World) -> Result<Stability, Error> {
    let found = analyse(world, &Grip::default(), Extent::ThisPeriod)?;
    Ok(Stability { critical_period_s: None, critical_period_reason: Some(NOT_SEARCHED), ..found })
}

/// Only the growth of [`free`], in 1/s.
///
/// # Errors
/// As [`free`].
pub fn free_growth(world: &World) -> Result<Option<f64>, Error> {
    gripped_growth(world, &Grip::default())
}

/// The growth in 1/s of the loop with a hand at rest on the puck, or on the handle of a shaft: its inertia moves with it, its spring and
/// damper act between it and ground. Such a hand is passive, so any growth takes its energy from the loop. With all three 0 it is [`free_growth`].
///
/// # Errors
/// As [`free`].
pub fn gripped_growth(world: &World, grip: &Grip) -> Result<Option<f64>, Error> {
    Ok(analyse(world, grip, Extent::Eigenvalues)?.growth_per_s)
}

/// The growths of all eigenvalues without shifts, 1/s, less the margin of the verdict.
///
/// # Errors
/// As [`free`].
pub(crate) fn free_growths(world: &World) -> Result<Ranked, Error> {
    let period = world.sampling.step();
    let found = analyse(world, &Grip::default(), Extent::Eigenvalues)?;
    // `eigenvalues` contains the shifts.
    let most = found.growth_per_s.unwrap_or(f64::NEG_INFINITY);
    let growths = found.eigenvalues.iter().filter(|v| v.im >= 0.0).map(|v| v.abs.ln() / period);
    let others = growths.filter(|growth| *growth < most - MARGINAL);
    let growths = others.chain([most]).map(|growth| growth - MARGINAL);
    Ok(Ranked::new(growths, growth_floor(period, world.sampling.delay_s()), 0.0))
}

/// Only the eigenvalues of [`free`].
///
/// # Errors
/// As [`free`].
pub fn free_eigenvalues(world: &World) -> Result<Vec<Eigenvalue>, Error> {
    Ok(analyse(world, &Grip::default(), Extent::Eigenvalues)?.eigenvalues)
}

/// Gravity and cogging count with their flat slope or the steepest that holds the puck, whichever is worse.
pub(crate) fn analyse(world: &World, grip: &Grip, extent: Extent) -> Result<Stability, Error> {
    let (flat, most) = analyse_anchored(world, grip, 0.0, extent)?;
    let steepest = world.device.torque.steepest();
    if steepest == 0.0 {
        return Ok(flat);
    }
    let (steep, critical) = analyse_anchored(world, grip, steepest, extent)?;
    let critical = critical.min(most);
    let growth = |found: &Stability| found.growth_per_s.unwrap_or(f64::NEG_INFINITY);
    let worse = if growth(&steep) > growth(&flat) + MARGINAL { steep } else { flat };
    Ok(Stability { critical_period_s: critical.period(), critical_period_reason: critical.reason(), ..worse })
}

/// With a spring of the device's own from puck to ground.
pub(super) fn analyse_anchored(
    world: &World,
    grip: &Grip,
    anchor: f64,
    extent: Extent,
) -> Result<(Stability, Critical), Error> {
    // The critical period is searched where it may be below this.
    let mut critical = if extent == Extent::Whole { Critical::Unbounded } else { Critical::Never };
    let sampling = &world.sampling;
    // That of the eigenvalues.
    let period = positive("the period", sampling.step())?;
    let couplings = of_step(&world.couplings, sampling);
    // The puck is one of the bodies, the first.
    let inertia = inertias_with_puck(world)?;
    let mut known: Vec<(Part, PartResult)> = Vec::new();
    let mut worst: Option<(f64, Vec<PartResult>)> = None;
    for slopes in combinations(&piecewise(&couplings)) {
        let mut all: Vec<PartResult> = Vec::new();
        for (index, part) in
            parts(&inertia, &linearise_with_puck(&world.bodies, &couplings, &slopes)?).into_iter().enumerate()
        {
            let found = match known.iter().find(|(p, _)| *p == part) {
                Some((_, found)) => found.clone(),
                None => {
                    let found = match index {
                        0 => puck_part(&part, (sampling, &world.device), (grip, anchor), critical, extent)?,
                        _ => decoupled_part(&part, sampling, critical)?,
                    };
                    known.push((part, found.clone()));
                    found
                }
            };
            critical = critical.min(found.critical);
            all.push(found);
        }
        let shifts = all.iter().map(|f| f.shifts).sum();
        let multipliers = all.iter().flat_map(|f| f.multipliers.iter().copied()).collect();
        let most = growth(&without_shifts(multipliers, shifts, period, MARGINAL), period);
        // Of combinations that differ only by rounding, the first (flat) one counts.
        if worst.as_ref().is_none_or(|(growth, _)| most > growth + MARGINAL) {
            worst = Some((most, all));
        }
    }
    let found = worst.map(|(_, found)| found).unwrap_or_default();
    let shifts = found.iter().map(|f| f.shifts).sum();
    let moving: Vec<Multiplier> = found.iter().flat_map(|f| f.multipliers.iter().copied()).collect();
    let without_shifts = without_shifts(moving.clone(), shifts, period, MARGINAL);
    let all: Vec<Multiplier> = std::iter::repeat_n(Multiplier::ONE, shifts).chain(moving).collect();
    let pairs: Vec<Root> = found.iter().flat_map(|f| f.pairs.iter().copied()).collect();
    // A crossing below the shortest period is outside the range of the search.
    let critical = match critical {
        Critical::Period(period) if period <= shortest_period(sampling) => Critical::Never,
        Critical::Period(_) | Critical::Never | Critical::Unbounded => critical,
    };
    Ok((assemble(&all, &without_shifts, &pairs, critical, period), critical))
}

/// The period in s at which the search for the critical period begins.
pub fn shortest_period(sampling: &Sampling) -> f64 {
    match sampling.delay {
        hapt_model::Delay::Seconds(delay) => (SHORTEST.0 * sampling.period).max(SHORTEST.1 * delay),
        // The delay changes with the period.
        hapt_model::Delay::Samples(_) => SHORTEST.0 * sampling.period,
    }
}

/// The result of a part that is decoupled from the puck.
fn decoupled_part(part: &Part, sampling: &Sampling, known: Critical) -> Result<PartResult, Error> {
    let modal = Modal::new(part)?;
    let (mut multipliers, pairs) = spectrum(&modal, sampling.method, sampling.step())?;
    // The first are 1: shifts, then momentum.
    let shifts = part.clusters.iter().filter(|c| !c.anchored).count();
    multipliers.drain(..shifts.min(modal.unit_count));
    Ok(PartResult { shifts, multipliers, pairs, critical: of_bodies(&modal, sampling, known)? })
}

/// The critical period of modes that the puck does not feel, whose step may take several periods.
fn of_bodies(modes: &Modal, sampling: &Sampling, known: Critical) -> Result<Critical, Error> {
    let every = f64::from(sampling.bodies_every);
    Ok(of_part(modes, sampling.method, known.times(every))?.times(1.0 / every))
}

/// The result of the part whose first member is the puck.
fn puck_part(
    part: &Part,
    (sampling, device): (&Sampling, &Device),
    (grip, anchor): (&Grip, f64),
    known: Critical,
    extent: Extent,
) -> Result<PartResult, Error> {
    let period = sampling.step();
    let port = Port::new(part)?.lagging(device.lag).with_handle(device.handle).anchored(anchor);
    let (port, damping) = port.gripped(device.damping, grip);
    let (unobservable, _) = spectrum(&port.unobservable, sampling.method, period)?;
    let mut critical = of_bodies(&port.unobservable, sampling, known)?;
    let pairs = match extent {
        Extent::Whole | Extent::ThisPeriod => continuous_pairs(part, &port, damping, period)?,
        Extent::Eigenvalues => Vec::new(),
    };
    let mut worst: Option<(f64, Vec<Multiplier>)> = None;
    for (index, filter) in Filter::of(sampling, sampling.period).iter().enumerate() {
        let found = multipliers(&port, sampling, damping, filter, sampling.period)?;
        let multipliers: Vec<Multiplier> = found.into_iter().map(|(m, _)| m).collect();
        if multipliers.iter().any(|m| m.ln_abs.is_nan() || m.ln_abs == f64::INFINITY) {
            return Err(Error::Eigenvalues { order: multipliers.len() });
        }
        let most = growth(&without_shifts(multipliers.clone(), port.shifts, period, MARGINAL), period);
        if worst.as_ref().is_none_or(|(growth, _)| most > growth + MARGINAL) {
            worst = Some((most, multipliers));
        }
        let conserved = !port.grounded && damping == 0.0 && conserves_momentum(sampling, &port);
        critical = critical.min(critical_period(&port, sampling, damping, index, conserved, known.min(critical))?);
        if !port.takes_velocity() {
            // The velocity is not used.
            break;
        }
    }
    let multipliers = unobservable.into_iter().chain(worst.map(|(_, m)| m).unwrap_or_default()).collect();
    Ok(PartResult { shifts: port.shifts, multipliers, pairs, critical })
}

/// The eigenvalues of the closed loop over a step of the bodies, each with an error bound. Those within rounding of the unit circle are
/// refined.
pub(crate) fn multipliers(
    port: &Port,
    sampling: &Sampling,
    damping: f64,
    filter: &Filter,
    period: f64,
) -> Result<Vec<(Multiplier, f64)>, Error> {
    let d = closed_loop(port, sampling, damping, filter, period)?;
    let (values, size) = eigenvalues_and_scale(&d)?;
    // A product of maps has the rounding of each.
    let product = f64::from(sampling.bodies_every - 1) * ROUNDING * size;
    let rounding = ROUNDING * size + product;
    // Forward Euler maps μ to λ = 1 + μ.
    let of = |mu| multiplier(Method::ForwardEuler, Root::from(mu));
    let mut found: Vec<(Multiplier, f64)> = values.iter().map(|mu| (of(*mu), rounding)).collect();
    let doubtful = |m: &Multiplier| m.ln_abs.abs() < DOUBTFUL * rounding && m.less_one.im >= 0.0;
    let quotients = found.iter().any(|(m, _)| doubtful(m)).then(|| Quotients::new(&d));
    for i in 0..found.len() {
        let mu = found[i].0.less_one;
        let Some(quotients) = quotients.as_ref().filter(|_| doubtful(&found[i].0)) else { continue };
        let Some((better, error)) = quotients.at(mu) else { continue };
        if (better - mu).norm() > DOUBTFUL * rounding {
            continue;
        }
        let conjugate = found.iter().position(|(m, _)| mu.im > 0.0 && m.less_one == mu.conj());
        let error = (error + product).min(rounding);
        found[i] = (of(better), error);
        if let Some(other) = conjugate {
            found[other] = (of(better.conj()), error);
        }
    }
    // A low-pass whose output is not used keeps its own pole.
    if !port.takes_velocity() && filter.pole > 0.0 {
        let all = f64::from(sampling.bodies_every) * (-period * filter.taps[0]).ln_1p();
        found.push((of(Complex::new(all.exp_m1(), 0.0)), 0.0));
    }
    // So does a Kalman filter.
    if let Some([position, velocity, acceleration]) = filter.kalman.filter(|_| !port.takes_velocity()) {
        let [a, b, c] = [position, velocity, acceleration];
        let own = DMatrix::from_row_slice(3, 3, &[-a, 1.0 - a, 0.5 - 0.5 * a, -b, -b, 1.0 - 0.5 * b, -c, -c, -0.5 * c]);
        let own = (0..sampling.bodies_every).fold(DMatrix::zeros(3, 3), |all, _| &all + &own + &own * &all);
        found.extend(eigenvalues_and_scale(&own)?.0.into_iter().map(|mu| (of(mu), 0.0)));
    }
    // So does a filter of the position whose output is not used.
    if let Some(filter) = PositionFilter::of(sampling, period).filter(|_| port.is_uncoupled()) {
        let all = f64::from(sampling.bodies_every) * filter.ln_pole();
        found.push((of(Complex::new(all.exp_m1(), 0.0)), 0.0));
    }
    Ok(found)
}

/// The roots near the circle at the periods where they are known.
struct Followed {
    /// Of many bodies.
    modal: Option<ModalLoop>,
    /// ln λ/T of one root of each pair.
    known: Vec<(f64, Vec<Complex<f64>>)>,
}

impl Followed {
    fn keep(&mut self, period: f64, found: &[(Multiplier, f64)]) {
        let upper = found.iter().filter(|(m, _)| m.less_one.im >= 0.0 && m.ln_abs > -1.0);
        let rates = upper.map(|(m, _)| Complex::new(m.ln_abs, m.arg()) / period).collect();
        let at = self.known.partition_point(|(known, _)| *known < period);
        self.known.insert(at, (period, rates));
    }

    /// The rates at a period, from those of the nearest two.
    fn expected(&self, period: f64) -> Option<Vec<Complex<f64>>> {
        let after = self.known.partition_point(|(known, _)| *known < period);
        // Two on either side, in the order of their distance.
        let mut near: Vec<_> = self.known[after.saturating_sub(2)..self.known.len().min(after + 2)].iter().collect();
        let distance = |known: f64| (known / period).ln().abs();
        near.sort_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
        let (first, rates) = *near.first()?;
        let Some((second, others)) = near.get(1).filter(|(_, others)| others.len() == rates.len()) else {
            return Some(rates.clone());
        };
        let part = (period - first) / (second - first);
        let line = |(rate, other): (&Complex<f64>, &Complex<f64>)| {
            // Roots that moved far are not the same ones.
            let change = other - rate;
            if change.norm() < MOVED * rate.norm() { rate + change * part } else { *rate }
        };
        Some(rates.iter().zip(others).map(line).collect())
    }

    /// The multipliers that do not decay within two samples and the delay, from those of a neighbouring period; `None` where all have to be
    /// computed.
    fn near_circle(
        &self,
        port: &Port,
        sampling: &Sampling,
        damping: f64,
        filter: &Filter,
        period: f64,
        conserved: bool,
    ) -> Result<Option<Vec<(Multiplier, f64)>>, Error> {
        // The equations of the delayed and of the modal loop are those of one sample, of the measured position and a velocity by one pole.
        let is_measured = sampling.filter.is_none() && filter.kalman.is_none();
        let is_static = port.integral == 0.0 && port.accelerations.is_empty();
        let is_plain = sampling.bodies_every == 1 && is_measured && is_static;
        let Some(rates) = self.expected(period).filter(|_| is_plain) else { return Ok(None) };
        let delayed;
        let (mut function, size) = match &self.modal {
            Some(modal) => (modal.at(sampling, damping, filter, period)?, modal.size(period)),
            None => match Delayed::new(port, sampling, damping, filter, period)? {
                Some(found) => {
                    delayed = found;
                    (delayed.characteristic(), delayed.size)
                }
                None => return Ok(None),
            },
        };
        let near: Vec<_> =
            rates.iter().map(|rate| multiplier(Method::Zoh, Root::from(rate * period)).less_one).collect();
        let radius = (growth_floor(period, sampling.delay.seconds(period)) * period).exp();
        let known = if conserved { vec![Complex::new(0.0, 0.0)] } else { vec![] };
        let Some(found) = function.outside(radius, &known, &near) else { return Ok(None) };
        let rounding = ROUNDING * size;
        let of = |(i, mu): (usize, &Complex<f64>)| {
            let error = if i < known.len() { 0.0 } else { rounding / apart(&found, i).min(1.0) };
            (multiplier(Method::ForwardEuler, Root::from(*mu)), error)
        };
        let found: Vec<_> = found.iter().enumerate().map(of).collect();
        let doubtful = found.iter().skip(known.len()).any(|(m, error)| m.ln_abs.abs() < DOUBTFUL * error);
        Ok((!doubtful).then_some(found))
    }
}

/// The distance of a root from the next one, its own conjugate among them: two that are near each other are less accurate.
fn apart(roots: &[Complex<f64>], at: usize) -> f64 {
    let root = roots[at];
    let others = roots.iter().enumerate().flat_map(|(i, other)| {
        let itself = (i != at).then(|| (root - other).norm());
        let conjugate = (i != at || root.im != 0.0).then(|| (root - other.conj()).norm());
        [itself, conjugate]
    });
    others.flatten().fold(f64::INFINITY, f64::min)
}

/// Removes up to `shifts` eigenvalues within `near`, in 1/s, of 1.
pub(crate) fn without_shifts(mut all: Vec<Multiplier>, shifts: usize, period: f64, near: f64) -> Vec<Multiplier> {
    all.sort_by_cached_key(|m| from_one(m).to_bits());
    let gone = all.iter().take(shifts).take_while(|m| from_one(m) / period < near).count();
    all.split_off(gone)
}

/// |ln λ|, which is not negative, so its bits sort in the same order.
fn from_one(m: &Multiplier) -> f64 {
    m.ln_abs.hypot(m.arg())
}

/// The largest growth; -∞ for none.
fn growth(multipliers: &[Multiplier], period: f64) -> f64 {
    multipliers.iter().map(|m| m.growth(period)).fold(f64::NEG_INFINITY, f64::max)
}

/// Whether the torque on a wheel in uniform rotation is 0, so that momentum is conserved. A damper at the puck under the exact hold
/// violates that at MIDDLE, and bodies that stand still while the puck turns do.
fn conserves_momentum(sampling: &Sampling, port: &Port) -> bool {
    if sampling.bodies_every > 1 {
        return false;
    }
    match (sampling.method, sampling.output) {
        (Method::ForwardEuler | Method::SemiImplicitEuler | Method::Tustin | Method::Foh, Output::Start) => true,
        (Method::Trapezoidal, Output::Middle) => true,
        (Method::Zoh, Output::Middle) => !port.takes_velocity(),
        (Method::BackwardEuler, Output::End) => sampling.advance == 0,
        (
            Method::ForwardEuler | Method::SemiImplicitEuler | Method::Tustin | Method::Foh,
            Output::Middle | Output::End,
        )
        | (Method::Trapezoidal | Method::Zoh, Output::Start | Output::End)
        | (Method::BackwardEuler, Output::Start | Output::Middle)
        | (Method::Rk4, Output::Start | Output::Middle | Output::End) => false,
    }
}

/// Where two modes may drive each other: at the whole multiples of a period 2π/(ω₁ ± ω₂), and of π/ω for a mode with itself. Each with the
/// mean decay of the two, 1/s. A mode turns by its frequency times the period where the method is exact, and so does the puck on its shaft
/// or spring. A weak coupling lets them grow in a narrow window of periods around such a period. Under other methods modes do not alias.
/// Where the bodies step at every n-th sample these are periods of their step.
fn resonances(port: &Port, sampling: &Sampling, damping: f64) -> Result<Vec<(f64, f64)>, Error> {
    let mut modes = Vec::new();
    if let Method::Zoh | Method::Foh = sampling.method {
        for block in &port.blocks {
            modes.extend(eigenvalues(&block.equations.rates(sampling.step()).a)?.into_iter().map(|s| (-s.re, s.im)));
        }
    }
    let mut spring = |stiffness: f64, damping: f64, per_inertia: f64| {
        let (decay, square) = (0.5 * damping * per_inertia, stiffness * per_inertia);
        modes.push((decay, (square - decay * decay).max(0.0).sqrt()));
    };
    spring(port.spring, damping, 1.0 / port.inertia);
    if let Some((handle, grip)) = port.handle {
        spring(handle.stiffness, handle.damping, 1.0 / port.inertia + 1.0 / (handle.inertia + grip.inertia));
    }
    modes.retain(|(_, omega)| *omega > 0.0);
    let mut all = Vec::new();
    for (i, (decay, omega)) in modes.iter().enumerate() {
        all.push((*decay, std::f64::consts::PI / omega));
        for (other_decay, other) in modes.iter().take(i).filter(|_| modes.len() <= MOST_PAIRED) {
            let decay = 0.5 * (decay + other_decay);
            let apart = [omega + other, (omega - other).abs()].map(|rate| std::f64::consts::TAU / rate);
            all.extend(apart.into_iter().filter(|apart| apart.is_finite()).map(|apart| (decay, apart)));
        }
    }
    Ok(all)
}

/// The period up to which the energy theorem makes the loop passive, so that no eigenvalue leaves the circle: T (K/2 + C1) + C0 = b, with the
/// springs and dampers at the puck, for the torque at the end of a step that does not raise the energy. 0 where it does not apply. It holds
/// at every shorter period without a search.
fn passive_below(port: &Port, sampling: &Sampling, damping: f64) -> f64 {
    let keeps_energy = keeps_energy(sampling.method) && sampling.output == Output::End;
    let on_time = sampling.delay.seconds(sampling.period) == 0.0 && port.lag == 0.0 && sampling.filter.is_none();
    let at_once = sampling.advance == 0 && on_time && port.integral == 0.0 && port.accelerations.is_empty();
    // A damper at the puck takes the mean velocity of both its ends, if these move in the same sample.
    let is_mean = sampling.estimator == EstimatorKind::Difference && sampling.every == 1 && sampling.bodies_every == 1;
    let by_difference = !port.has_damper() || is_mean;
    let rate = 0.5 * port.stiffness + port.per_period;
    if keeps_energy && at_once && by_difference && rate > 0.0 { ((damping - port.fixed) / rate).max(0.0) } else { 0.0 }
}

/// The critical period of the closed loop, with the delay fixed in s and the number of samples to a step of the bodies. Periods above
/// `known` are not searched.
fn critical_period(
    port: &Port,
    sampling: &Sampling,
    damping: f64,
    filter: usize,
    conserved: bool,
    known: Critical,
) -> Result<Critical, Error> {
    let low = shortest_period(sampling);
    let slowest = port.slowest(damping).max(sampling.period).max(sampling.delay_s());
    let high = (MAX_PERIOD_RATIO * slowest).min(known.period().unwrap_or(f64::INFINITY));
    if port.is_uncoupled() || known == Critical::Never || high <= low {
        return Ok(Critical::Unbounded);
    }
    let every = f64::from(sampling.bodies_every);
    let mut followed = Followed { modal: ModalLoop::new(port, sampling.method), known: Vec::new() };
    let mut growths = |period: f64| {
        let step = every * period;
        let filters = Filter::of(sampling, period);
        let filter = filters.get(filter).or(filters.first()).ok_or(Error::Eigenvalues { order: 0 })?;
        let few = followed.near_circle(port, sampling, damping, filter, period, conserved)?;
        let all = few.map_or_else(|| multipliers(port, sampling, damping, filter, period), Ok);
        let mut all = match all {
            Ok(found) => {
                followed.keep(period, &found);
                found
            }
            // A step beyond double precision has left the unit circle before.
            Err(Error::Step { .. } | Error::Eigenvalues { .. }) if period > sampling.period => {
                return Ok(Ranked::one(f64::MAX));
            }
            Err(error) => return Err(error),
        };
        // Conserved momentum is identified by structure with a wide bound, otherwise by the rounding error.
        let bound = |i: usize, error: f64| if i == 0 && conserved { 1e3 * MARGINAL * step } else { 4.0 * error };
        all.sort_by_cached_key(|(m, _)| from_one(m).to_bits());
        let near = |(i, (m, error)): &(usize, &(Multiplier, f64))| from_one(m) <= bound(*i, *error);
        let kept = all.iter().take(port.shifts).enumerate().take_while(near).count();
        // One of each pair.
        let without_shifts = all[kept..].iter().filter(|(m, _)| m.less_one.im >= 0.0);
        let noise = without_shifts.clone().map(|(_, error)| error / step).fold(0.0, f64::max);
        let floor = growth_floor(step, sampling.delay.seconds(period));
        Ok(Ranked::new(without_shifts.map(|(m, error)| (m.ln_abs - error) / step), floor, noise))
    };
    let proved = passive_below(port, sampling, damping).min(high);
    if proved >= high {
        return Ok(Critical::Unbounded);
    }
    if proved > low && (growths(proved)?.max() > 0.0 || growths(proved * (1.0 + CLOSE))?.max() > 0.0) {
        return Ok(Critical::Period(proved));
    }
    let from = proved.max(low);
    let resonances = resonances(port, sampling, damping)?;
    let next = |period: f64| {
        let step = every * period;
        let seen = resonances.iter().filter(|(decay, _)| decay * step < FORGOTTEN);
        let steps = seen.map(|(_, apart)| apart * ((step / apart * (1.0 + 1e-9)).floor() + 1.0));
        steps.fold(f64::INFINITY, f64::min) / every
    };
    let mut from = from;
    for left in (0..TOUCHES).rev() {
        let found = first_crossing_within(&mut growths, Spacing::period(sampling.delay), next, [from, high], 0.0)?;
        let Some(period) = found else { break };
        if period <= low {
            return Ok(Critical::Never);
        }
        if left == 0 || !touches(&mut growths, period, every)? {
            return Ok(Critical::Period(period));
        }
        from = period * (1.0 + TOUCH);
        if from >= high {
            break;
        }
    }
    Ok(Critical::Unbounded)
}

/// Relative width of what may be a touch.
const TOUCH: f64 = 1e-3;

/// Largest growth per step that counts as rounding where two eigenvalues meet: the root of that of a single one, with a margin.
const MEETING: f64 = 1e-6;

/// Largest number of touches that the search passes.
const TOUCHES: usize = 200;

/// Whether the growth comes to 0 at this period and goes back without a crossing, as at each period that is half an oscillation of an undamped
/// mode or a multiple: there the puck does not move it, and its two eigenvalues meet on the circle, where a growth is known to the root of the
/// rounding error only.
fn touches(growths: &mut impl FnMut(f64) -> Result<Ranked, Error>, period: f64, every: f64) -> Result<bool, Error> {
    for part in [1e-3, 1e-2, 0.1, 0.3] {
        let there = period * (1.0 + part * TOUCH);
        if growths(there)?.max() * every * there > MEETING {
            return Ok(false);
        }
    }
    Ok(growths(period * (1.0 + TOUCH))?.max() <= 0.0)
}
