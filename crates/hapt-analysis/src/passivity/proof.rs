//! The proof beyond the linear loop, and the reasons where there is none.
//!
//! The following arguments extend the certificate. τ_k is the torque held while the puck moves from z_k to z_{k+1}, δ = z_{k+1} - z_k;
//! the device dissipates at least b δ²/T. All other cases are not proved.
//!
//! **With a linear loop.** A coupling between puck and ground with a law f(z) of slope at most K has the energy S, S' = f, and
//! f(z_k) δ ≥ S(z_{k+1}) - S(z_k) - K δ²/2 for any negative slopes. With a wall's damping B the torque is never more than
//! B |v_k| away from that, |v_k| = |δ before|/T, which costs B (δ² + δ²before)/2T at most. A delay of d samples changes f(z_k) by at
//! most K times the d steps between, if no slope is below -K either. The sum is T K (1/2 + d) + B, in addition to the requirement
//! of the linear rest of the loop. The motor holds 0, not f(z_0), until the first command arrives: that gives the hand at most
//! |f(z_0)| times the path of the first d samples, once, beyond the energy S(z_0).
//!
//! **Saturation of the motor** without bodies is such a law too: the saturated sum of springs has a slope of at most K, and dampers
//! contribute at most B |v_k|, where |v_k| is at most a mean of earlier steps over T. A fraction a of a sample of delay makes the
//! bound that of (T32) with m = T K (1/2 + d + a) + B, in both cases; a lag of the motor, that of `timing`.
//!
//! **At bodies** the energy theorem: where the step, puck held, does not raise the energy S(z, x), and the torque is -∂S/∂z at
//! its end, the hand's work is the change of S less K δ²/2 at most. `zoh`, `trapezoidal` and `backward-euler` with their
//! discrete-gradient step satisfy this. The torque must be that of `end`, without advance and delay. A damper at the puck
//! requires its B, with the mean velocity. A wall with damping between puck and body is not covered: the damping on the body uses the
//! middle of the step, that on the puck its end, and only one of them may be inside.
//!
//! **Counts and levels** without bodies are compensated by the friction of the device (`quantisation`). With a body they are not.

use hapt_model::keys::Measure;
use hapt_model::{Coupling, EstimatorKind, Law, Method, Output, World};

use crate::equations::continuous::settled;
use crate::equations::delay::Delay;
use crate::equations::laws::{self, Kind, is_nonlinear};
use crate::equations::slopes::at_puck;
use crate::error::Error;
use crate::passivity::quantisation::{Quantisation, quantisation, step};
use crate::passivity::required::{Cause, Requirement, requirement};
use crate::passivity::timing::Timing;
use crate::text::with_unit;

/// The reasons why the verdict on the linear loop is not proved for the whole loop.
///
/// `stretch` is the ratio of the damping that sentences name to that of the world: 1, or the longest interval over the period.
///
/// # Errors
/// As [`crate::passivity()`].
pub(crate) fn unproved(world: &World, found: &Requirement, stretch: f64) -> Result<Vec<String>, Error> {
    let claimed = claimed(world, found);
    let mut reasons = reasons_at_any_time(world);
    if let Err(Cause::BodiesEvery { reason }) = found.damping {
        reasons.push(reason.to_string());
    }
    reasons.extend(limit(world, claimed, stretch)?);
    let nonlinear: Vec<&Coupling> = world.couplings.iter().filter(|c| is_nonlinear(c)).collect();
    if !nonlinear.is_empty() {
        if world.sampling.estimator == EstimatorKind::LowPass {
            reasons.push(LOW_PASS.to_string());
        }
        let bodies: Vec<&Coupling> = nonlinear.iter().copied().filter(|c| laws::at_body(c)).collect();
        let outside = if bodies.is_empty() {
            at_puck_only(world, claimed, stretch)?
        } else {
            energy_theorem(world, &bodies, claimed, stretch)?
        };
        reasons.extend(outside);
    }
    reasons.extend(friction(world, &quantisation(world)?));
    Ok(reasons)
}

pub(super) const LOW_PASS: &str = "a low-pass delays the velocity, and nonlinear couplings have no proof with that";

pub(super) const BRISTLE: &str =
    "the sampled bristle of LuGre friction at the puck has no proof beyond its steepest slope";

pub(super) const SATURATION: &str = "the motor's limit cuts the torque on the puck but not its opposite on the bodies: a limit on \
     every coupling at the puck, together no more than the motor's, would cut both";

pub(super) fn saturated_from(world: &World, bound: f64) -> String {
    let bound = with_unit(bound, Measure::Damping, world.motion);
    format!("a motor at its limit is proved passive from a device damping of {bound} on")
}

pub(super) fn nonlinear_from(world: &World, bound: f64) -> String {
    let bound = with_unit(bound, Measure::Damping, world.motion);
    format!("the nonlinear couplings at the puck are proved passive from a device damping of {bound} on")
}

/// The reasons that depend neither on times nor on the required damping.
pub(super) fn reasons_at_any_time(world: &World) -> Vec<String> {
    let mut reasons = Vec::new();
    reasons.extend(estimator(world));
    reasons.extend(bodies_and_counts(world));
    reasons.extend(constants(world));
    reasons.extend(bristles(world));
    reasons
}

/// An estimator that the proof does not cover.
fn estimator(world: &World) -> Option<String> {
    let sampling = &world.sampling;
    match sampling.estimator {
        EstimatorKind::Foaw | EstimatorKind::FoawBest => Some(format!(
            "the {} estimator changes its window as the puck moves, and only the longest and the shortest were looked at",
            sampling.estimator.name()
        )),
        EstimatorKind::Exact => {
            let takes = world.couplings.iter().filter(|c| laws::at_puck(c) && laws::takes_velocity(&c.law));
            let names = takes.map(|c| {
                if matches!(c.law, Law::Coulomb { .. } | Law::Lugre { .. }) {
                    "the friction at the puck"
                } else if laws::is_damped_wall(&c.law) {
                    "a damped wall at the puck"
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
        EstimatorKind::Difference | EstimatorKind::LowPass => None,
    }
}

/// Quantisation with bodies, whose motion the friction of the puck does not damp.
fn bodies_and_counts(world: &World) -> Option<String> {
    if world.bodies.is_empty() {
        return None;
    }
    match (world.device.encoder.is_some(), world.device.levels.is_some()) {
        (false, false) => None,
        (true, levels) => Some(format!(
            "the encoder's counts{} push at a body, whose motion the puck's friction does not see: a hand that dithers across a count \
             may pump it",
            if levels { " and the motor's levels" } else { "" }
        )),
        (false, true) => {
            Some("the motor's levels round the torque on the puck but not its opposite on the bodies".to_string())
        }
    }
}

/// Whether the loop can ask for more than the motor's limit.
pub(super) fn may_saturate(world: &World) -> bool {
    let asked: f64 = world.couplings.iter().filter(|c| laws::at_puck(c)).map(laws::most).sum();
    world.device.limit.is_some_and(|limit| asked > limit)
}

/// The motor limit, where the loop can reach it.
fn limit(world: &World, claimed: Option<f64>, stretch: f64) -> Result<Option<String>, Error> {
    if !may_saturate(world) {
        return Ok(None);
    }
    if !world.bodies.is_empty() {
        return Ok(Some(SATURATION.to_string()));
    }
    let bound = Timing::even(world).of_laws(at_puck(world, &world.couplings)?)?;
    Ok(falls_short(claimed, bound).then(|| saturated_from(world, bound * stretch)))
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
        "the stiffness at the puck, {stiffness}, is above {most}, the quantisation.max_stiffness at a friction of {}: {what} may keep it \
         humming",
        torque(found.friction)
    ))
}

/// The damping of the verdict: that of the device, or the required one if larger.
fn claimed(world: &World, found: &Requirement) -> Option<f64> {
    let required = found.damping.ok()?;
    Some(required.max(world.device.damping))
}

fn falls_short(claimed: Option<f64>, bound: f64) -> bool {
    // Without a finite required damping there is nothing to prove.
    claimed.is_some_and(|b| b < bound * (1.0 - 1e-9))
}

/// Nonlinear couplings between puck and ground in a loop that is linear otherwise.
fn at_puck_only(world: &World, claimed: Option<f64>, stretch: f64) -> Result<Option<String>, Error> {
    // A compensating damper and its springs may fall into different groups.
    let couplings = settled(&world.couplings, world.sampling.period);
    let (indices, straight): (Vec<Coupling>, Vec<Coupling>) = couplings.into_iter().partition(is_nonlinear);
    for coupling in &indices {
        match Kind::of(coupling) {
            // Coulomb friction at the puck has no finite required damping.
            Kind::Potential | Kind::Linear | Kind::Constant | Kind::Coulomb => {}
            Kind::Lugre => {
                return Ok(Some(BRISTLE.to_string()));
            }
        }
    }
    let Ok(rest) = requirement(world, &straight)?.damping else { return Ok(None) };
    let bound = rest + Timing::even(world).of_laws(at_puck(world, &indices)?)?;
    Ok(falls_short(claimed, bound).then(|| nonlinear_from(world, bound * stretch)))
}

/// Nonlinear couplings at bodies: the conditions of the energy theorem.
fn energy_theorem(
    world: &World,
    bodies: &[&Coupling],
    claimed: Option<f64>,
    stretch: f64,
) -> Result<Option<String>, Error> {
    let sampling = &world.sampling;
    let lag = Delay::of_loop(sampling)?;
    let outside = |why: &str| Ok(Some(format!("the energy theorem does not cover this nonlinear world: {why}")));
    match sampling.method {
        Method::Zoh | Method::Trapezoidal | Method::BackwardEuler => {}
        Method::ForwardEuler | Method::SemiImplicitEuler | Method::Rk4 | Method::Tustin | Method::Foh => {
            return outside(&format!("{} has no discrete-gradient step", sampling.method.name()));
        }
    }
    if sampling.output != Output::End {
        return outside("the torque is not that at the end of the step");
    }
    if sampling.advance > 0 {
        return outside("the torque is that of a later step");
    }
    if lag.samples > 0 || lag.fraction > 0.0 {
        return outside("the torque comes late");
    }
    if world.device.lag > 0.0 {
        return outside("the motor's torque lags behind its command");
    }
    if bodies.iter().any(|c| laws::at_puck(c) && laws::is_damped_wall(&c.law)) {
        return outside("a wall with damping stands between the puck and a body");
    }
    // The puck receives the torque of the law at the end of the step, the body the torque of the iteration: they agree only where it
    // converges. Clamped springs and dampers and walls do, being the means of convex energies.
    if bodies.iter().any(|c| laws::at_puck(c) && Kind::of(c) == Kind::Potential && laws::takes_velocity(&c.law))
        && bodies.iter().any(|c| laws::may_not_settle(&c.law))
    {
        return outside(
            "a damper with a limit stands between the puck and a body, beside detents, friction or damped walls at bodies, whose \
             torques may not agree within a step",
        );
    }
    // Neither at a body nor at the puck is the step known to be passive.
    if world.couplings.iter().any(|c| Kind::of(c) == Kind::Lugre) {
        return outside("the sampled bristle of LuGre friction has no proof beyond its steepest slope");
    }
    let [stiffness, damping] = at_puck(world, &world.couplings)?;
    let bound = 0.5 * sampling.period * stiffness + damping;
    if falls_short(claimed, bound) {
        let bound = with_unit(bound * stretch, Measure::Damping, world.motion);
        return outside(&format!("it begins at a device damping of {bound}"));
    }
    Ok(None)
}
