//! The demand of each theorem on passivity: a damping of the device that is enough, or why it does not cover the world.

use std::borrow::Cow;

use hapt_model::{Coupling, EstimatorKind, World};

use crate::equations::continuous::{Slopes, piecewise, settled};
use crate::equations::laws;
use crate::equations::laws::{Acceleration, Kind, is_nonlinear};
use crate::equations::slopes::{at_puck, combinations, straightened};
use crate::error::Error;
use crate::passivity::kalman::overshoot;
use crate::passivity::required::{
    Cause, KALMAN, Requirement, largest_gain, late_requirement, linear_requirement_wanted, requirement_wanted,
};
use crate::passivity::supremum::Wanted;
use crate::passivity::timing::Timing;
use crate::passivity::two_rates::with_fixed_bodies;
use crate::theorems::assumptions::{
    BRISTLE, BRISTLE_EVERY, LOW_PASS, behind_filter, outside_energy, outside_estimator, outside_recentre,
    takes_estimate, within_friction,
};
use crate::theorems::{
    BEHIND_KALMAN, ENERGY, INTEGRAL, LAWS, LINEAR, LINEAR_LAG, LINEAR_LATE, LINEAR_UNEVEN, RECENTRE, TWO_RATES, Theorem,
};

/// The demand of a theorem.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Demand {
    /// This damping is enough.
    Enough {
        damping: f64,
        /// The lowest frequency that needs it, where the theorem gives frequencies.
        at_hz: Option<f64>,
        /// Whether less is not enough.
        is_least: bool,
    },
    /// No finite damping is enough.
    Never { cause: Cause, at_hz: Option<f64> },
    /// The theorem does not cover the world.
    Outside(String),
}

/// A demand, and the theorems that make it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Demanded {
    pub demand: Demand,
    pub theorems: Vec<&'static Theorem>,
}

impl Demanded {
    fn new(demand: Demand, theorem: &'static Theorem) -> Demanded {
        Demanded { demand, theorems: vec![theorem] }
    }

    fn outside(why: impl Into<String>) -> Demanded {
        Demanded { demand: Demand::Outside(why.into()), theorems: Vec::new() }
    }

    /// A sufficient damping of no frequency.
    fn enough(damping: f64, theorem: &'static Theorem) -> Demanded {
        Demanded::new(Demand::Enough { damping, at_hz: None, is_least: false }, theorem)
    }

    pub fn damping(&self) -> Option<f64> {
        match self.demand {
            Demand::Enough { damping, .. } => Some(damping),
            Demand::Never { .. } | Demand::Outside(_) => None,
        }
    }

    /// The one that requires less; one with a number before one without.
    fn or(self, other: Demanded) -> Demanded {
        match (self.damping(), other.damping()) {
            (Some(own), Some(others)) if others < own => other,
            (None, Some(_)) => other,
            _ => self,
        }
    }
}

/// The theorem that requires the least damping of the device of `world`, whose times are `timing`. The world has one delay, one lag, and
/// the least device.
pub(super) fn best(world: &World, timing: Timing, wanted: Wanted) -> Result<Demanded, Error> {
    if world.sampling.recentre.is_some() {
        return recentred(world, timing);
    }
    if let Some(why) = outside_estimator(world) {
        let is_kalman = world.sampling.estimator == EstimatorKind::Kalman;
        return if is_kalman { behind_kalman(world, timing, wanted) } else { Ok(Demanded::outside(why)) };
    }
    // With a limit it gives the same energy in every turn of a hand that is slow and small; but friction of more than the limit takes that.
    if world.couplings.iter().any(integrates) {
        let most: f64 = world.couplings.iter().filter(|c| integrates(c)).map(laws::most).sum();
        if most <= world.device.least_friction() {
            return Ok(Demanded::outside(within_friction(world)));
        }
        return Ok(Demanded::new(Demand::Never { cause: Cause::Integral, at_hz: Some(0.0) }, &INTEGRAL));
    }
    if world.couplings.iter().any(|c| Kind::of(c) == Kind::Assist && laws::most(c) > 0.0) {
        return Ok(Demanded::outside(within_friction(world)));
    }
    if world.couplings.iter().any(|c| is_nonlinear(c) && Acceleration::of(&c.law).is_some()) {
        return Ok(Demanded::outside(within_friction(world)));
    }
    let at_body = |c: &Coupling| is_nonlinear(c) && laws::at_body(c);
    if !world.couplings.iter().any(is_nonlinear) {
        let linear = linear(world, timing, wanted)?;
        let is_exact = matches!(linear.demand, Demand::Enough { is_least: true, .. } | Demand::Never { .. });
        return Ok(if is_exact || !world.bodies.is_empty() { linear } else { linear.or(at_the_puck(world, timing)?) });
    }
    if world.couplings.iter().any(at_body) { energy(world, timing, wanted) } else { sum(world, timing, wanted) }
}

fn integrates(coupling: &Coupling) -> bool {
    laws::integral_gain(&coupling.law) > 0.0
}

/// The linear estimate of a world that no theorem covers: the worst over its flat and steep slopes.
pub(super) fn estimate(world: &World, timing: Timing, wanted: Wanted) -> Result<Demand, Error> {
    // Requirements at different frequencies give no estimate of their sum.
    if world.sampling.estimator == EstimatorKind::Kalman && takes_estimate(world) && !is_kalman_alone(world) {
        return Ok(Demand::Outside(KALMAN.into()));
    }
    let mut worst: Option<Demand> = None;
    let mut world = world.clone();
    world.sampling.recentre = None;
    // In small motions it is the difference.
    if world.sampling.estimator == EstimatorKind::Levant {
        (world.sampling.estimator, world.sampling.every) = (EstimatorKind::Difference, 1);
    }
    let world = &world;
    for slopes in combinations(&piecewise(&world.couplings)) {
        let couplings = straightened(world, &slopes)?;
        let found = best(&World { couplings, ..world.clone() }, timing, wanted)?.demand;
        let rank = |demand: &Demand| match demand {
            Demand::Enough { damping, .. } => (0, *damping),
            Demand::Outside(_) => (1, 0.0),
            Demand::Never { .. } => (2, 0.0),
        };
        if worst.as_ref().is_none_or(|worst| rank(&found) > rank(worst)) {
            worst = Some(found);
        }
    }
    Ok(worst.unwrap_or(Demand::Outside("there is nothing to estimate".into())))
}

/// The frequency that requires the most damping where nonlinear couplings have their steepest slopes: theorems on them give no frequency.
/// `None` for a linear world, and where there is no such number.
pub(super) fn steepest_at_hz(world: &World, timing: Timing) -> Result<Option<Option<f64>>, Error> {
    let is_known = !world.couplings.iter().any(is_nonlinear)
        || world.couplings.iter().any(integrates)
        || outside_estimator(world).is_some();
    if is_known {
        return Ok(None);
    }
    let couplings = straightened(world, &Slopes::Steep)?;
    Ok(match linear(&World { couplings, ..world.clone() }, timing, Wanted::Value)?.demand {
        Demand::Enough { at_hz, .. } => Some(at_hz),
        Demand::Never { .. } | Demand::Outside(_) => None,
    })
}

/// (T29) and what follows of it: the linear loop.
fn linear(world: &World, timing: Timing, wanted: Wanted) -> Result<Demanded, Error> {
    let one_lag = timing.lag[0] == timing.lag[1];
    if (timing.is_even() && one_lag) || timing.is_at_once() {
        let (stretch, theorem) = match timing.is_even() {
            true => (1.0, &LINEAR),
            false => (timing.longest / timing.period, &LINEAR_UNEVEN),
        };
        let found = linear_requirement_wanted(wanted, world)?;
        let mut demanded = Demanded::new(of_requirement(found, stretch), theorem);
        if world.sampling.bodies_every > 1 {
            demanded.theorems.push(&TWO_RATES);
            if let Demand::Enough { is_least, .. } = &mut demanded.demand {
                *is_least = false;
            }
        }
        return Ok(demanded);
    }
    if world.sampling.bodies_every > 1 {
        return Ok(Demanded::outside(
            "bodies that step every n-th sample are proved only where the torque comes at once: leave out loop.delay, loop.delay_max and \
             device.lag",
        ));
    }
    // Coulomb friction and growth have no requirement under any timing.
    let at_once = without_delay(world);
    if let demand @ Demand::Never { .. } = of_requirement(linear_requirement_wanted(wanted, &at_once)?, 1.0) {
        return Ok(Demanded::new(demand, &LINEAR));
    }
    if timing.is_even() {
        let middle = 0.5 * (timing.lag[0] + timing.lag[1]);
        let mut of_middle = world.clone();
        of_middle.device.lag = middle;
        let found = requirement_wanted(wanted, &of_middle, &world.couplings)?.damping;
        let gain = largest_gain(wanted, world, &world.couplings)?;
        let all = found.ok().zip(gain.and_then(|gain| timing.of_lag(gain))).map(|(b, more)| b + more);
        return Ok(all.map_or_else(
            || {
                Demanded::outside(
                    "a lag of the motor that is known within bounds has no proof with undamped bodies, or where it may be 0",
                )
            },
            |damping| Demanded::enough(damping, &LINEAR_LAG),
        ));
    }
    if timing.lag[1] > 0.0 {
        return Ok(Demanded::outside(
            "the motor's lag is proved at even samples and a fixed delay only, since short intervals let bodies and estimator take any \
             number of steps while the motor's torque still follows: leave out loop.interval_max and loop.delay_max, or device.lag",
        ));
    }
    if !timing.has_even_samples {
        return Ok(Demanded::outside(
            "with bodies a delay is proved at even samples only, since short intervals let the bodies take any number of steps before a \
             command arrives: leave out loop.interval_max, or loop.delay and loop.delay_max",
        ));
    }
    if !timing.arrives_in_time() {
        return Ok(Demanded::outside("with bodies a delay that varies is proved up to one period only"));
    }
    let parts = timing.delay.map(|delay| delay / timing.longest);
    let found = late_requirement(wanted, world, &world.couplings, (timing.longest, parts))?;
    Ok(found.map_or_else(
        || {
            Demanded::outside(
                "an undamped mode of the world has no proof with a delay that varies: a damper from the bodies to ground would take energy \
                 from it",
            )
        },
        |damping| Demanded::enough(damping, &LINEAR_LATE),
    ))
}

fn of_requirement(found: Requirement, stretch: f64) -> Demand {
    match found.damping {
        Ok(damping) => Demand::Enough { damping: damping * stretch, at_hz: found.at_hz, is_least: true },
        Err(Cause::Outside { reason }) => Demand::Outside(reason.to_string()),
        Err(cause) => Demand::Never { cause, at_hz: found.at_hz },
    }
}

/// The same world without delay of its torque.
fn without_delay(world: &World) -> World {
    let mut fixed = world.clone();
    fixed.sampling.delay = hapt_model::Delay::Seconds(0.0);
    fixed.device.lag = 0.0;
    fixed
}

/// Torques along the acceleration, which are linear, beside the others: each of the two gets a share of the damping. `None` without any.
fn beside_accelerations(world: &World, timing: Timing, wanted: Wanted) -> Result<Option<Demanded>, Error> {
    let all: Vec<Coupling> = settled(&world.couplings, world.sampling.period);
    let (along, others): (Vec<Coupling>, Vec<Coupling>) =
        all.into_iter().partition(|c| Acceleration::of(&c.law).is_some());
    if along.is_empty() {
        return Ok(None);
    }
    let own = linear(&with_fixed_bodies(world, &along), timing, wanted)?;
    let Demand::Enough { damping: own, .. } = own.demand else { return Ok(Some(own)) };
    let rest = best(&World { couplings: others, ..world.clone() }, timing, shared(wanted, own))?;
    let Demanded { demand: Demand::Enough { damping, at_hz, .. }, mut theorems } = rest else { return Ok(Some(rest)) };
    theorems.push(&LINEAR);
    let demand = Demand::Enough { damping: damping + own, at_hz, is_least: false };
    Ok(Some(Demanded { demand, theorems }))
}

/// (T35), (T39), (T42), (T45), (T46): everything is between puck and ground, linear or not.
fn at_the_puck(world: &World, timing: Timing) -> Result<Demanded, Error> {
    if world.couplings.iter().any(|c| Acceleration::of(&c.law).is_some()) {
        return Ok(Demanded::outside("a torque along the acceleration is not a static law"));
    }
    Ok(Demanded::enough(timing.of_laws(felt(world, &world.couplings)?)?, &LAWS))
}

/// (T84): dampers between puck and ground behind a Kalman filter have a share of the device's damping of their own.
fn behind_kalman(world: &World, timing: Timing, wanted: Wanted) -> Result<Demanded, Error> {
    let takes = |c: &Coupling| laws::at_puck(c) && laws::takes_velocity(&c.law);
    // A compensating damper and its springs may fall into different groups.
    let all: Vec<Coupling> = settled(&world.couplings, world.sampling.period);
    let (dampers, others): (Vec<Coupling>, Vec<Coupling>) = all.into_iter().partition(takes);
    if !timing.is_at_once() || dampers.iter().any(|c| laws::at_body(c) || Kind::of(c) != Kind::Linear) {
        return Ok(Demanded::outside(KALMAN));
    }
    let [_, damping] = at_puck(world, &dampers)?;
    let cutoff = world.sampling.cutoff.unwrap_or(f64::INFINITY);
    let (part, angle) = overshoot(std::f64::consts::TAU * cutoff * timing.period);
    let own = damping * part * timing.longest / timing.period;
    if !own.is_finite() {
        return Ok(Demanded::outside(KALMAN));
    }
    let is_exact = timing.is_even() && is_kalman_alone(world) && !others.iter().any(is_nonlinear);
    let rest = best(&World { couplings: others, ..world.clone() }, timing, shared(wanted, own))?;
    let Demanded { demand: Demand::Enough { damping, at_hz, .. }, mut theorems } = rest else { return Ok(rest) };
    theorems.push(&BEHIND_KALMAN);
    let at_hz = if is_exact { Some(angle / (std::f64::consts::TAU * timing.period)) } else { at_hz };
    Ok(Demanded { demand: Demand::Enough { damping: damping + own, at_hz, is_least: is_exact }, theorems })
}

/// Whether only springs and dampers at the puck, seen without a filter of the position, are with the Kalman filter: then the requirements add
/// up at every frequency.
fn is_kalman_alone(world: &World) -> bool {
    world.bodies.is_empty() && world.sampling.filter.is_none()
}

/// (T80): the origin slips while the puck rests. Its own energy pays, so that the requirement is that of the energy theorem.
fn recentred(world: &World, timing: Timing) -> Result<Demanded, Error> {
    if let Some(why) = outside_recentre(world, timing) {
        return Ok(Demanded::outside(why));
    }
    let [stiffness, _] = at_puck(world, &world.couplings)?;
    let own = if world.bodies.is_empty() { &LAWS } else { &ENERGY };
    let mut demanded = Demanded::enough(0.5 * stiffness * timing.longest, own);
    if world.sampling.bodies_every > 1 {
        demanded.theorems.push(&TWO_RATES);
    }
    demanded.theorems.push(&RECENTRE);
    Ok(demanded)
}

/// The stiffness and damping that count at the puck: the steepest slopes, and of bristles twice their stiffness. Where a puck turns round
/// they go back by up to twice its displacement, ṡ = q̇ (1 - σ₀ s sgn q̇/F). A filter of the position counts as damping.
fn felt(world: &World, couplings: &[Coupling]) -> Result<[f64; 2], Error> {
    let [stiffness, damping] = at_puck(world, couplings)?;
    let bristles = couplings.iter().filter(|c| laws::at_puck(c) && Kind::of(c) == Kind::Lugre);
    let bristles = bristles.map(|c| laws::steepest(&c.law).0).sum::<f64>();
    let [_, damping] = behind_filter(world, [stiffness, damping]);
    Ok([stiffness + bristles, damping])
}

/// A linear loop, and nonlinear laws between puck and ground. Each of the two gets a share of the damping.
fn sum(world: &World, timing: Timing, wanted: Wanted) -> Result<Demanded, Error> {
    if world.sampling.estimator == EstimatorKind::LowPass && takes_estimate(world) {
        return Ok(Demanded::outside(LOW_PASS));
    }
    // A compensating damper and its springs may fall into different groups.
    let all: Vec<Coupling> = settled(&world.couplings, world.sampling.period);
    let (laws, straight): (Vec<Coupling>, Vec<Coupling>) = all.into_iter().partition(is_nonlinear);
    for law in &laws {
        match Kind::of(law) {
            Kind::Potential | Kind::Linear | Kind::Constant | Kind::Integral | Kind::Assist | Kind::Acceleration => {}
            Kind::Lugre if world.sampling.takes_several_samples() => return Ok(Demanded::outside(BRISTLE_EVERY)),
            Kind::Lugre if laws::is_hysteresis(&law.law) => {}
            Kind::Lugre => return Ok(Demanded::outside(BRISTLE)),
            Kind::Coulomb if laws::most(law) > 0.0 => {
                return Ok(Demanded::new(Demand::Never { cause: Cause::Coulomb, at_hz: None }, &LAWS));
            }
            Kind::Coulomb => {}
        }
    }
    let of_laws = timing.of_laws(felt(world, &laws)?)?;
    let rest = best(&World { couplings: straight, ..world.clone() }, timing, shared(wanted, of_laws))?;
    let Demanded { demand: Demand::Enough { damping, at_hz, .. }, mut theorems } = rest else { return Ok(rest) };
    theorems.push(&LAWS);
    let sum = Demanded { demand: Demand::Enough { damping: damping + of_laws, at_hz, is_least: false }, theorems };
    if world.bodies.is_empty() { Ok(sum.or(at_the_puck(world, timing)?)) } else { Ok(sum) }
}

/// The requested result for the linear rest, after the share of the laws.
fn shared(wanted: Wanted, share: f64) -> Wanted {
    match wanted {
        Wanted::AtMost(damping) if damping > share => Wanted::AtMost(damping - share),
        Wanted::AtMost(_) | Wanted::From(_) => Wanted::Least,
        Wanted::Value | Wanted::Least | Wanted::Bound(_) => wanted,
    }
}

/// (T24), (T40), (T62): nonlinear couplings at bodies.
fn energy(world: &World, timing: Timing, wanted: Wanted) -> Result<Demanded, Error> {
    if let Some(found) = beside_accelerations(world, timing, wanted)? {
        return Ok(found);
    }
    let couplings: Cow<'_, [Coupling]> = Cow::Borrowed(&world.couplings);
    if couplings.iter().any(|c| Kind::of(c) == Kind::Coulomb && laws::most(c) > 0.0 && laws::at_puck(c)) {
        return Ok(Demanded::new(Demand::Never { cause: Cause::Coulomb, at_hz: None }, &ENERGY));
    }
    if world.sampling.estimator == EstimatorKind::LowPass && takes_estimate(world) {
        return Ok(Demanded::outside(LOW_PASS));
    }
    if let Some(why) = outside_energy(world, timing) {
        return Ok(Demanded::outside(why));
    }
    let [stiffness, damping] = at_puck(world, &couplings)?;
    let bound = timing.longest * (0.5 * stiffness + damping / timing.period);
    let mut demanded = Demanded::enough(bound, &ENERGY);
    if world.sampling.bodies_every > 1 {
        // The linear part decides whether the slower rate is covered.
        let flat = World { couplings: straightened(world, &Slopes::Steep)?, ..world.clone() };
        let of_rates = linear(&flat, timing, wanted)?;
        if of_rates.damping().is_none() {
            return Ok(of_rates);
        }
        demanded.theorems.push(&TWO_RATES);
    }
    Ok(demanded)
}
