//! The theorems' assumptions on a world, and the reasons where they do not hold.
//!
//! [`outside`] are assumptions on couplings, estimator and method without which no theorem covers the world. [`beyond`] is what every theorem
//! leaves out of the device: counts, levels, the motor's limit and Coulomb friction. These are covered by arguments of their own:
//!
//! **Saturation of the motor** without bodies is a static law: the saturated sum of springs has a slope of at most K, and dampers
//! contribute at most B |v_k|, where |v_k| is at most a mean of earlier steps over T. Its bound is that of the laws at the puck
//! ([`crate::passivity::timing`]). With a body the limit cuts the torque on one end only.
//!
//! **Counts and levels** without bodies are compensated by the friction of the device (`quantisation`). With a body they are not.

use hapt_model::keys::Measure;
use hapt_model::{Coupling, EstimatorKind, Law, Output, World};

use crate::equations::discrete::keeps_energy;
use crate::equations::estimator::PositionFilter;
use crate::equations::laws::{self, Acceleration, Kind, is_nonlinear};
use crate::equations::slopes::at_puck;
use crate::error::Error;
use crate::passivity::quantisation::{Quantisation, quantisation, step};
use crate::passivity::required::KALMAN;
use crate::passivity::timing::Timing;
use crate::passivity::within::taken;
use crate::text::with_unit;

/// Why no theorem covers a damper with Levant's differentiator.
pub(super) const LEVANT: &str = "Levant's differentiator follows no acceleration beyond 1.1 loop.acceleration, and then lags and overshoots, which no \
                                 theorem covers: estimator = \"difference\" or \"low-pass\" has a proof";

pub(super) const LOW_PASS: &str = "a low-pass delays the velocity, and nonlinear couplings have no proof with that";

pub(super) const BRISTLE_EVERY: &str = "a velocity over several samples bends the bristles of LuGre friction behind the puck, and they have no proof with that: every = 1";

pub(super) const BRISTLE: &str =
    "LuGre friction at the puck is proved as a hysteresis alone: bristle_damping = 0, and stribeck the same as coulomb";

pub(super) const SATURATION: &str = "the motor's limit cuts the torque on the puck but not its opposite on the bodies: a limit on \
     every coupling at the puck, together no more than the motor's, would cut both";

/// Where no damping makes the world passive, and its claims rest on eigenvalues.
const AT_LIMIT: &str = "at the motor's limit the loop is not linear, and eigenvalues tell nothing of it: the couplings at the puck need \
     limits that together are no more than the motor's";

/// A damper behind a Kalman filter is proved as long as nothing cuts its torque, and one behind Levant's differentiator is not proved.
const LIMITED_ESTIMATOR: &str =
    "the motor's limit cuts the torque, and with that no theorem covers dampers behind this estimator";

/// A torque along the acceleration is proved as long as nothing cuts it.
const LIMITED_ACCELERATION: &str = "the motor's limit cuts the torque, and torques along the acceleration have a proof only without that, or \
     with a limit of their own that the device's friction takes";

/// A property of the device that a claim leaves out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Omission {
    /// In two words, for a headline.
    pub what: &'static str,
    /// A sentence, with its numbers.
    pub why: String,
}

const CLIPPING: &str = "clipping by the motor's limit";
const COUNTS: &str = "the encoder's counts";
const LEVELS: &str = "the motor's levels";

pub(super) fn saturated_from(world: &World, bound: f64) -> String {
    let bound = with_unit(bound, Measure::Damping, world.motion);
    format!("a motor at its limit is proved passive from a device damping of {bound} on")
}

/// Why no theorem covers the world at any times: the estimator, constants at bodies, bristles that give energy.
pub(super) fn outside(world: &World) -> Vec<String> {
    let mut reasons = Vec::new();
    reasons.extend(estimator(world));
    reasons.extend(constants(world));
    reasons.extend(bristles(world));
    reasons
}

/// Whether no theorem gives the number for this world: its estimator is not linear, and a constant at a body is a source. The estimator
/// `exact` counts as the difference, so that what is claimed is about that.
pub(super) fn is_estimate(world: &World) -> bool {
    nonlinear_estimator(world).is_some() || constants(world).is_some()
}

/// Whether the torque takes the estimated velocity.
pub(crate) fn takes_estimate(world: &World) -> bool {
    world.couplings.iter().any(|c| laws::at_puck(c) && laws::takes_velocity(&c.law))
}

/// What is not linear in the velocity that the torque takes; `None` where it takes none, or where its estimator is linear.
pub(super) fn nonlinear_estimator(world: &World) -> Option<&'static str> {
    if world.sampling.has_linear_estimator() || !takes_estimate(world) {
        return None;
    }
    Some(match world.sampling.estimator == EstimatorKind::Levant {
        true => "levant follows no acceleration beyond its bound",
        false => "FOAW changes its window",
    })
}

/// Why no theorem covers the passivity of a loop with this estimator; `None` where one may.
pub(super) fn outside_estimator(world: &World) -> Option<&'static str> {
    match world.sampling.estimator {
        _ if !takes_estimate(world) => None,
        EstimatorKind::Kalman => Some(KALMAN),
        EstimatorKind::Levant => Some(LEVANT),
        EstimatorKind::Exact
        | EstimatorKind::Difference
        | EstimatorKind::LowPass
        | EstimatorKind::Foaw
        | EstimatorKind::FoawBest => None,
    }
}

/// The properties of the device that the claim leaves out: counts and levels, at bodies and at the puck, and the motor's limit. `claimed`
/// is the damping that the claim is about, `stretch` the ratio of the longest interval to the period.
pub(super) fn beyond(world: &World, timing: Timing, claimed: Option<f64>) -> Result<Vec<Omission>, Error> {
    let mut omissions = Vec::new();
    omissions.extend(bodies_and_counts(world));
    if world.device.encoder.is_some() && world.couplings.iter().any(|c| laws::at_puck(c) && Kind::of(c) == Kind::Lugre)
    {
        let why = "what the encoder's counts do to the bristles of LuGre friction has no bound".to_string();
        omissions.push(Omission { what: COUNTS, why });
    }
    omissions.extend(limit(world, timing, claimed)?.map(|why| Omission { what: CLIPPING, why }));
    // Counts: as at even samples, with the damping of the longest interval.
    let mut stretched = world.clone();
    stretched.device.damping *= timing.period / timing.longest;
    let what = if world.device.encoder.is_some() { COUNTS } else { LEVELS };
    omissions.extend(friction(world, &quantisation(&stretched)?).map(|why| Omission { what, why }));
    Ok(omissions)
}

/// An estimator that the proof does not cover.
fn estimator(world: &World) -> Option<String> {
    let sampling = &world.sampling;
    match sampling.estimator {
        EstimatorKind::Foaw | EstimatorKind::FoawBest => nonlinear_estimator(world).map(|_| {
            format!(
                "the {} estimator changes its window as the puck moves, and only the longest and the shortest were looked at: \
                 estimator = \"difference\" or \"low-pass\" has a proof",
                sampling.estimator.name()
            )
        }),
        EstimatorKind::Exact => {
            let takes = world.couplings.iter().filter(|c| laws::at_puck(c) && laws::takes_velocity(&c.law));
            let names = takes.map(|c| {
                if matches!(c.law, Law::Coulomb { .. } | Law::Lugre { .. }) {
                    "the friction at the puck"
                } else if laws::is_damped_wall(&c.law) {
                    "a damped wall at the puck"
                } else if Acceleration::of(&c.law).is_some() {
                    "an acceleration"
                } else {
                    "a damper at the puck"
                }
            });
            // A damper or a wall goes before friction, as it does in the alphabet.
            names.min().map(|name| {
                format!(
                    "the exact estimator tells {name} the velocity of one instant, and the puck may turn round before the next: the \
                     proof is of the difference that counts here, estimator = \"difference\""
                )
            })
        }
        // `outside_estimator` is the reason with the last two.
        EstimatorKind::Difference | EstimatorKind::LowPass | EstimatorKind::Kalman | EstimatorKind::Levant => None,
    }
}

/// Quantisation with bodies, whose motion the friction of the puck does not damp.
fn bodies_and_counts(world: &World) -> Option<Omission> {
    if world.bodies.is_empty() {
        return None;
    }
    match (world.device.encoder.is_some(), world.device.levels.is_some()) {
        (false, false) => None,
        (true, levels) => {
            let why = format!(
                "the encoder's counts{} push at a body, whose motion the puck's friction does not see: a hand that dithers across a count \
                 may pump it",
                if levels { " and the motor's levels" } else { "" }
            );
            Some(Omission { what: COUNTS, why })
        }
        (false, true) => {
            let why = "the motor's levels round the torque on the puck but not its opposite on the bodies".to_string();
            Some(Omission { what: LEVELS, why })
        }
    }
}

/// Whether the loop's torque can exceed the motor's limit.
pub(super) fn may_saturate(world: &World) -> bool {
    let largest: f64 = world.couplings.iter().filter(|c| laws::at_puck(c)).map(laws::most).sum();
    world.device.limit.is_some_and(|limit| largest > limit)
}

/// The motor limit, where the loop can reach it.
fn limit(world: &World, timing: Timing, claimed: Option<f64>) -> Result<Option<String>, Error> {
    if !may_saturate(world) {
        return Ok(None);
    }
    if !world.bodies.is_empty() {
        return Ok(Some(SATURATION.to_string()));
    }
    if outside_estimator(world).is_some() {
        return Ok(Some(LIMITED_ESTIMATOR.to_string()));
    }
    if world.couplings.iter().any(|c| Acceleration::of(&c.law).is_some()) {
        return Ok(Some(LIMITED_ACCELERATION.to_string()));
    }
    let bound = timing.of_laws(behind_filter(world, at_puck(world, &world.couplings)?))?;
    Ok(match claimed {
        Some(b) if b >= bound * (1.0 - 1e-9) => None,
        Some(_) => Some(saturated_from(world, bound)),
        None => Some(AT_LIMIT.to_string()),
    })
}

/// Stiffness and damping at the puck that bound the torque of laws behind `loop.filter`: their lag is a damping more (docs/theory.md, (T70)).
pub(super) fn behind_filter(world: &World, [stiffness, damping]: [f64; 2]) -> [f64; 2] {
    let period = world.sampling.period;
    let lag = PositionFilter::of(&world.sampling, period).map_or(0.0, PositionFilter::lag);
    [stiffness, damping + stiffness * period * lag]
}

/// The device damping that laws of this stiffness and damping at the puck require, at even samples.
pub(crate) fn laws_cost(world: &World, laws: [f64; 2]) -> Result<f64, Error> {
    Timing::even(world).of_laws(behind_filter(world, laws))
}

/// Constant torques at bodies.
fn constants(world: &World) -> Option<String> {
    let is_source = |c: &Coupling| c.law.constant().is_some_and(|torque| torque != 0.0) && laws::at_body(c);
    world.couplings.iter().position(is_source).map(|index| {
        format!("couplings.{index}: a constant torque at a body is a source of energy: a hand that goes along with the body draws it")
    })
}

/// LuGre bristles that return more energy than they store.
fn bristles(world: &World) -> Vec<String> {
    let couplings = world.couplings.iter().enumerate().filter(|(_, coupling)| laws::bristles_give(&coupling.law));
    let reason = |(index, _)| {
        format!(
            "couplings.{index}: its bristles give energy back when it slips: viscous would have to be at least \
             bristle_damping (stribeck - coulomb)/coulomb"
        )
    };
    couplings.map(reason).collect()
}

/// Friction and damping required by quantisation. `world` has the device that the claim is about: the least of its tolerances.
pub(super) fn friction(world: &World, found: &Quantisation) -> Option<String> {
    let torque = |torque: f64| with_unit(torque, Measure::Torque, world.motion);
    let (levels, has_counts) = (0.5 * step(world), world.device.encoder.is_some());
    if found.lacks_friction() {
        let what = match (found.least_friction > levels, levels > 0.0) {
            (true, true) => "the encoder's counts at the dampers of the puck, and the motor's levels, make",
            (true, false) => "the encoder's counts at the dampers of the puck make",
            (false, _) => "the motor's levels make",
        };
        return Some(format!(
            "{what} a torque of up to {}, and the device's friction of {} does not take as much",
            torque(found.least_friction),
            torque(found.friction)
        ));
    }
    let most = found.max_stiffness.filter(|_| found.is_too_stiff())?;
    let what = match (has_counts, levels > 0.0) {
        (true, true) => "the encoder's counts and the motor's levels",
        (true, false) => "the encoder's counts",
        (false, _) => "the motor's levels",
    };
    let [stiffness, most] = [found.stiffness, most].map(|k| with_unit(k, Measure::Stiffness, world.motion));
    Some(format!(
        "the stiffness at the puck, {stiffness}, is above the {most} up to which damping and a friction of {} absorb {what}: it may hum",
        torque(found.friction)
    ))
}

/// Why (T76) does not cover a world whose torques are more than friction takes.
pub(super) fn within_friction(world: &World) -> String {
    let torque = |torque: f64| with_unit(torque, Measure::Torque, world.motion);
    format!(
        "friction, integral terms, assists and limited accelerations at the puck give up to {} together, and the device's friction takes {} at \
         least: torques of no more than that have a proof",
        torque(taken(&world.couplings)),
        torque(world.device.least_friction())
    )
}

/// Why the energy theorem does not cover a world with nonlinear couplings at bodies; `None` where it does.
pub(super) fn outside_energy(world: &World, timing: Timing) -> Option<String> {
    let sampling = &world.sampling;
    let outside = |why: &str| Some(format!("the energy theorem does not cover this nonlinear world: {why}"));
    let bodies = || world.couplings.iter().filter(|c| is_nonlinear(c) && laws::at_body(c));
    if !keeps_energy(sampling.method) {
        return outside(&format!("{} has no discrete-gradient step", sampling.method.name()));
    }
    if sampling.output != Output::End {
        return outside("the torque is not that at the end of the step");
    }
    if sampling.advance > 0 {
        return outside("the torque is that of a later step");
    }
    if timing.delay[1] > 0.0 {
        return outside("the torque comes late");
    }
    if sampling.filter.is_some() {
        return outside("loop.filter shows the bodies a position behind the puck's");
    }
    if timing.lag[1] > 0.0 {
        return outside("the motor's torque lags behind its command");
    }
    if bodies().any(|c| laws::at_puck(c) && laws::is_damped_wall(&c.law)) {
        return outside("a wall with damping stands between the puck and a body");
    }
    // The puck receives the torque of the law at the end of the step, the body the torque of the iteration: they agree only where it
    // converges. Clamped springs and dampers and walls do, being the means of convex energies.
    if bodies().any(|c| laws::at_puck(c) && Kind::of(c) == Kind::Potential && laws::takes_velocity(&c.law))
        && bodies().any(|c| laws::may_not_settle(&c.law))
    {
        return outside(
            "a damper with a limit stands between the puck and a body, beside detents, friction or damped walls at bodies, whose \
             torques may not agree within a step",
        );
    }
    if sampling.takes_several_samples()
        && world.couplings.iter().any(|c| laws::at_puck(c) && laws::at_body(c) && laws::takes_velocity(&c.law))
    {
        return outside("a damping between the puck and a body takes the puck's velocity over several samples");
    }
    // Neither at a body nor at the puck is the step known to be passive.
    if world.couplings.iter().any(|c| Kind::of(c) == Kind::Lugre) {
        return outside("the sampled bristle of LuGre friction has no proof beyond its steepest slope");
    }
    None
}

/// Why an origin that slips has no proof (docs/theory.md, (T80)); `None` where it has.
pub(super) fn outside_recentre(world: &World, timing: Timing) -> Option<String> {
    let sampling = &world.sampling;
    let outside = |why: &str| Some(format!("loop.recentre has no proof here: {why}"));
    if timing.delay[1] > 0.0 || sampling.advance > 0 {
        return outside("the torque is not that of the newest sample");
    }
    if timing.lag[1] > 0.0 {
        return outside("the motor's torque lags behind its command");
    }
    if sampling.filter.is_some() {
        return outside("loop.filter shows the world a position behind the puck's");
    }
    let takes = |c: &&Coupling| laws::at_puck(c) && (laws::takes_velocity(&c.law) || Kind::of(c) == Kind::Lugre);
    if world.couplings.iter().any(|c| takes(&c)) {
        return outside("a damping or a friction at the puck takes the slip for a motion");
    }
    let carries = |c: &&Coupling| {
        let has_torque = match Kind::of(c) {
            Kind::Coulomb | Kind::Assist | Kind::Integral | Kind::Acceleration => true,
            Kind::Constant => laws::most(c) > 0.0,
            Kind::Linear | Kind::Potential | Kind::Lugre => false,
        };
        has_torque && laws::at_puck(c)
    };
    if world.couplings.iter().any(|c| carries(&c)) {
        return outside("a torque at the puck that no place of the origin ends carries it along");
    }
    if world.bodies.is_empty() {
        return None;
    }
    if !keeps_energy(sampling.method) || sampling.output != Output::End {
        return outside(
            "with bodies the proof is of the energy at the end of a step of zoh, trapezoidal or backward-euler",
        );
    }
    if sampling.estimator == EstimatorKind::LowPass
        && world.couplings.iter().any(|c| is_nonlinear(c) && laws::at_body(c))
    {
        return outside(LOW_PASS);
    }
    outside_energy(world, timing)
}
