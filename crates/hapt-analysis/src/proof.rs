//! What a certificate of the linear loop leaves open.
//!
//! Two arguments reach beyond it. τ_k is the torque held while the puck goes from z_k to z_{k+1}, δ = z_{k+1} - z_k; the device
//! pays for b δ²/T.
//!
//! **Beside a linear loop.** A coupling between puck and ground with a law f(z) that nowhere rises by more than K has the energy
//! S, S' = f, and f(z_k) δ ≥ S(z_{k+1}) - S(z_k) - K δ²/2, whatever falls. With a wall's damping B the torque is never more than
//! B |v_k| away from that, |v_k| = |δ before|/T, which costs B (δ² + δ²before)/2T at most. A delay of d samples moves f(z_k) by no
//! more than K times the d steps between, as long as nothing falls by more than K either. Together T K (1/2 + d) + B, on top of
//! what the linear rest of the loop asks for by itself. The motor holds 0, and not f(z_0), until the first command arrives: that lends
//! the hand |f(z_0)| times the way of the first d samples at most, once, beyond the energy S(z_0).
//!
//! **At bodies** the energy theorem: where the step, puck held, does not raise the energy S(z, x), and the torque is -∂S/∂z at
//! its end, the hand's work is the change of S less K δ²/2 at most. `zoh`, `trapezoidal` and `backward-euler` with their
//! discrete-gradient step are such; the torque has to be that of `end`, not of a later step, and not late. A damper at the puck
//! costs its B, taken with the mean velocity. A wall with damping between puck and body is not covered: its body's damping goes
//! by the middle of the step and the puck's by its end, and they need not be inside together.

use hapt_model::{Coupling, End, EstimatorKind, Law, Method, Output, World};

use crate::check::short;
use crate::error::Error;
use crate::passivity::{Need, at_puck, is_lossless, lag, need, quantisation};

fn is_nonlinear(law: &Law) -> bool {
    !matches!(law, Law::Spring { .. } | Law::Damper { .. } | Law::Constant { .. })
}

fn at_body(coupling: &Coupling) -> bool {
    [coupling.first, coupling.second].iter().any(|end| matches!(end, End::Body(_)))
}

fn is_at_puck(coupling: &Coupling) -> bool {
    coupling.first == End::Puck || coupling.second == End::Puck
}

/// Whether the couplings at the puck can never ask the motor for more than `limit`.
fn is_within(world: &World, limit: f64) -> bool {
    let most = |law: &Law| match *law {
        Law::Clamped { limit, .. } => limit,
        Law::Detent { torque, .. } | Law::Coulomb { torque } => torque,
        Law::Constant { torque } => torque.abs(),
        _ => f64::INFINITY,
    };
    world.couplings.iter().filter(|c| is_at_puck(c)).map(|c| most(&c.law)).sum::<f64>() <= limit
}

/// The reasons why the answer on the linear loop is not one on the whole.
pub(crate) fn missing(world: &World, found: &Need) -> Result<Vec<String>, Error> {
    let (sampling, device) = (&world.sampling, &world.device);
    let mut reasons = Vec::new();
    if matches!(sampling.estimator, EstimatorKind::Foaw | EstimatorKind::FoawBest) {
        reasons.push(format!(
            "the {} estimator changes its window as the puck moves, and only the longest and the shortest were looked at",
            sampling.estimator.name()
        ));
    }
    let rounds = match (device.encoder, device.levels) {
        (Some(_), Some(_)) => Some("the encoder's counts and the motor's levels push"),
        (Some(_), None) => Some("the encoder's counts push"),
        (None, Some(_)) => Some("the motor's levels push"),
        (None, None) => None,
    };
    if let Some(push) = rounds
        && is_lossless(world)?
    {
        reasons.push(format!("{push} at a body whose swing nothing damps, and may push it up without bound"));
    }
    if device.limit.is_some_and(|limit| !is_within(world, limit)) && !world.bodies.is_empty() {
        reasons.push(
            "the motor's limit cuts the torque on the puck but not its opposite on the bodies: a limit on every coupling at the \
             puck, together no more than the motor's, would cut both"
                .to_string(),
        );
    }
    let nonlinear: Vec<&Coupling> = world.couplings.iter().filter(|c| is_nonlinear(&c.law)).collect();
    if !nonlinear.is_empty() {
        if sampling.estimator == EstimatorKind::LowPass {
            reasons.push("a low-pass delays the velocity, and nonlinear couplings have no proof with that".to_string());
        }
        let bodies: Vec<&Coupling> = nonlinear.iter().copied().filter(|c| at_body(c)).collect();
        let claimed = claimed(world, found);
        let outside = if bodies.is_empty() { beside(world, claimed)? } else { theorem(world, &bodies, claimed)? };
        reasons.extend(outside);
    }
    for (index, coupling) in world.couplings.iter().enumerate() {
        if let Law::Lugre { coulomb, stribeck, bristle_damping, viscous, .. } = coupling.law {
            // viscous < bristle_damping (stribeck - coulomb)/coulomb, without the quotient
            if viscous * coulomb < bristle_damping * (stribeck - coulomb) {
                reasons.push(format!(
                    "couplings.{index}: its bristles give energy back when it slips: viscous would have to be at least \
                     bristle_damping (stribeck - coulomb)/coulomb"
                ));
            }
        }
    }
    if !quantisation(world)?.ok {
        reasons.push(
            "the stiffness at the puck is above quantisation.max_stiffness: counts may keep it humming".to_string(),
        );
    }
    Ok(reasons)
}

/// The damping for which the verdict speaks: what the device has, or what it would need.
fn claimed(world: &World, found: &Need) -> Option<f64> {
    let required = found.damping.ok()?;
    Some(required.max(world.device.damping))
}

fn falls_short(claimed: Option<f64>, bound: f64) -> bool {
    // Where no damping will do there is nothing to prove beyond that.
    claimed.is_some_and(|b| b < bound * (1.0 - 1e-9))
}

/// Nonlinear couplings between puck and ground beside a linear rest.
fn beside(world: &World, claimed: Option<f64>) -> Result<Option<String>, Error> {
    let lag = lag(&world.sampling)?;
    if lag.part > 0.0 {
        return Ok(Some("nonlinear couplings have no proof under a delay with a fraction of a sample".to_string()));
    }
    let (bent, straight): (Vec<Coupling>, Vec<Coupling>) = world.couplings.iter().partition(|c| is_nonlinear(&c.law));
    if bent.iter().any(|c| is_at_puck(c) && matches!(c.law, Law::Lugre { .. })) {
        return Ok(Some(
            "the sampled bristle of LuGre friction at the puck has no proof beyond its steepest slope".into(),
        ));
    }
    let [stiffness, damping] = at_puck(world, &bent)?;
    let Ok(rest) = need(world, &straight)?.damping else { return Ok(None) };
    let bound = rest + world.sampling.period * stiffness * (0.5 + lag.samples as f64) + damping;
    Ok(falls_short(claimed, bound).then(|| {
        format!("the nonlinear couplings at the puck are proved passive from a device damping of {} on", short(bound))
    }))
}

/// Nonlinear couplings at bodies: the conditions of the energy theorem.
fn theorem(world: &World, bodies: &[&Coupling], claimed: Option<f64>) -> Result<Option<String>, Error> {
    let sampling = &world.sampling;
    let lag = lag(sampling)?;
    let outside = |why: &str| Ok(Some(format!("the energy theorem does not cover this nonlinear world: {why}")));
    if !matches!(sampling.method, Method::Zoh | Method::Trapezoidal | Method::BackwardEuler) {
        return outside(&format!("{} has no discrete-gradient step", sampling.method.name()));
    }
    if sampling.output != Output::End {
        return outside("the torque is not that at the end of the step");
    }
    if sampling.advance > 0 {
        return outside("the torque is that of a later step");
    }
    if lag.samples > 0 || lag.part > 0.0 {
        return outside("the torque comes late");
    }
    let damped_wall =
        |c: &&&Coupling| is_at_puck(c) && matches!(c.law.unclamped(), Law::Wall { damping, .. } if damping > 0.0);
    if bodies.iter().any(|c| damped_wall(&c)) {
        return outside("a wall with damping stands between the puck and a body");
    }
    let [stiffness, damping] = at_puck(world, &world.couplings)?;
    let bound = 0.5 * sampling.period * stiffness + damping;
    if falls_short(claimed, bound) {
        return outside(&format!("it begins at a device damping of {}", short(bound)));
    }
    Ok(None)
}
