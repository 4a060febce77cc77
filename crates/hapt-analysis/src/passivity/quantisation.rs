//! Encoder and torque quantisation: the friction and damping that they require of the device, and the power that they can feed.
//!
//! The loop sees z + e, |e| ≤ Δ/2, and the motor rounds the torque to within half a step. Without bodies the sum of both is a
//! torque on the puck of at most D = KΔ/2 + BΔ/T + step/2, whose work is at most D times the path. Coulomb friction of at least D
//! dissipates as much. A difference over n samples has BΔ/(nT),
//! a Kalman filter half the sum of its impulse response. A torque along the acceleration, J_c (1 - z⁻¹) v/((τ + T) (1 - p z⁻¹)), p = τ/(τ + T), has 2 J_c/(τ + T)
//! times the error of the velocity v at most.
//!
//! At a body it is a torque D_i = K_iΔ/2 + B_iΔ/T, which the friction of the puck does not compensate. Over an energy-conserving step
//! its work is at most D·|path|, and dampers C that the puck does not move dissipate at least pathᵀ C path/T. The difference is at
//! most Dᵀ C⁻¹ D/4 times T. For one body with a damper B to ground that is a power of K²Δ²/(16 B).

use hapt_model::{Coupling, End, EstimatorKind, Output, Sampling, World};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::equations::continuous::{LinearCoupling, Slopes, linearise};
use crate::equations::delay::Delay;
use crate::equations::discrete::keeps_energy;
use crate::equations::laws::{self, Acceleration, Kind};
use crate::equations::slopes::at_puck;
use crate::error::Error;
use crate::passivity::kalman::count_error;
use crate::passivity::within::beyond_friction;

/// The stiffness that encoder and torque quantisation allow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantisation {
    /// min(2b/T, 2 (friction - ΣB Δ/T - step/2)/Δ), never below 0, N·m/rad (linear: N/m); `None` for ideal counts and levels.
    pub max_stiffness: Option<f64>,
    /// Whether the stiffness at the puck is no larger, and the friction no less than dampers and levels require.
    pub ok: bool,
    /// ΣB Δ/T + step/2, N·m (linear: N).
    #[serde(skip)]
    pub least_friction: f64,
    /// The friction of the device in the direction that has less, without what (T76) takes of it, in the same unit.
    #[serde(skip)]
    pub friction: f64,
    /// The stiffness at the puck, at the steepest slopes.
    #[serde(skip)]
    pub stiffness: f64,
}

impl Quantisation {
    /// Whether the friction is less than dampers and levels require, at any stiffness.
    pub fn lacks_friction(&self) -> bool {
        self.max_stiffness.is_some() && self.friction < self.least_friction
    }

    /// Whether the stiffness at the puck is above `max_stiffness`.
    pub fn is_too_stiff(&self) -> bool {
        self.max_stiffness.is_some_and(|most| self.stiffness > most)
    }
}

/// The step between two levels of the motor, N·m (linear: N); 0 for an ideal one.
pub(crate) fn step(world: &World) -> f64 {
    match (world.device.levels, world.device.limit) {
        (Some(levels), Some(limit)) => 2.0 * limit / f64::from(levels),
        // Levels divide the range of the limit.
        (Some(_), None) | (None, Some(_)) | (None, None) => 0.0,
    }
}

/// The largest error of the velocity per count, 1/s: that of a difference, which no other estimator but a Kalman filter exceeds.
fn error_by_counts(sampling: &Sampling) -> f64 {
    let Sampling { period, estimator, every, .. } = *sampling;
    if estimator == EstimatorKind::Kalman {
        let cutoff = sampling.cutoff.unwrap_or(f64::INFINITY);
        return count_error(std::f64::consts::TAU * cutoff * period) / period;
    }
    let over = if sampling.takes_several_samples() { f64::from(every) } else { 1.0 };
    1.0 / (over * period)
}

/// The stiffness that encoder and torque quantisation allow (Abbott and Okamura, IEEE Trans. Robotics 21(5), 2005, with dampers and
/// levels).
///
/// # Errors
/// [`Error::NoSuchBody`].
pub fn quantisation(world: &World) -> Result<Quantisation, Error> {
    let [stiffness, damping] = at_puck(world, &world.couplings)?;
    let (device, period, rest) = (&world.device, world.sampling.period, beyond_friction(world));
    let (friction, step, count) = (rest.device.least_friction(), step(world), world.count());
    let along: f64 = rest.couplings.iter().filter_map(|c| Acceleration::of(&c.law)).map(|a| a.gain(period)).sum();
    let by_velocity = damping + 2.0 * along;
    let least_friction = count.map_or(0.0, |count| by_velocity * count * error_by_counts(&world.sampling)) + 0.5 * step;
    let max_stiffness = (count.is_some() || step > 0.0).then(|| {
        let left = friction - least_friction;
        let by_friction = match count {
            Some(count) => 2.0 * left / count,
            None if left >= 0.0 => f64::INFINITY,
            None => 0.0,
        };
        (2.0 * device.damping / period).min(by_friction).max(0.0)
    });
    let found = Quantisation { max_stiffness, ok: true, least_friction, friction, stiffness };
    Ok(Quantisation { ok: !found.is_too_stiff() && !found.lacks_friction(), ..found })
}

/// Whether the step does not raise the energy while the puck is held, with the torque at its end and without delay: the assumption
/// of the power bound.
fn keeps_energy_on_time(world: &World) -> Result<bool, Error> {
    let sampling = &world.sampling;
    let lag = Delay::of_loop(sampling)?;
    Ok(keeps_energy(sampling.method)
        && sampling.output == Output::End
        && sampling.advance == 0
        && sampling.filter.is_none()
        && lag.samples == 0
        && lag.fraction == 0.0)
}

/// An upper bound in W of the power that encoder counts feed into damped bodies; `None` without counts, without bodies at the puck, or
/// without a bound.
///
/// # Errors
/// [`Error::NoSuchBody`], [`Error::InFlight`].
pub(crate) fn count_power(world: &World) -> Result<Option<f64>, Error> {
    let (Some(count), n) = (world.count(), world.bodies.len()) else { return Ok(None) };
    let over_several = world.sampling.takes_several_samples() || world.sampling.estimator == EstimatorKind::Kalman;
    let outside = |c: &Coupling| {
        matches!(Kind::of(c), Kind::Constant | Kind::Lugre)
            || (laws::at_body(c) && laws::at_puck(c) && laws::is_damped_wall(&c.law))
            || (over_several && laws::at_body(c) && laws::at_puck(c) && laws::takes_velocity(&c.law))
    };
    // Its sum is about steps at every sample.
    if world.sampling.bodies_every > 1 || !keeps_energy_on_time(world)? || world.couplings.iter().any(outside) {
        return Ok(None);
    }
    let period = world.sampling.period;
    let damping = |term: &LinearCoupling| term.fixed + period * term.per_period;
    let (mut push, mut taken) = (DVector::zeros(n), DMatrix::zeros(n, n));
    for term in linearise(&world.bodies, &world.couplings, &Slopes::Steep)? {
        if let (End::Puck, End::Body(i)) | (End::Body(i), End::Puck) = (term.first, term.second) {
            push[i] += 0.5 * term.stiffness * count + damping(&term) * count / period;
        }
    }
    // Only damping at every motion counts.
    for term in linearise(&world.bodies, &world.couplings, &Slopes::Flat)? {
        match (term.first, term.second) {
            (End::Ground, End::Body(i)) | (End::Body(i), End::Ground) => taken[(i, i)] += damping(&term),
            (End::Body(i), End::Body(j)) => {
                let damping = damping(&term);
                taken[(i, i)] += damping;
                taken[(j, j)] += damping;
                taken[(i, j)] -= damping;
                taken[(j, i)] -= damping;
            }
            (End::Puck, End::Puck | End::Ground | End::Body(_))
            | (End::Ground, End::Puck | End::Ground)
            | (End::Body(_), End::Puck) => {}
        }
    }
    let size: f64 = taken.amax();
    if push.amax() == 0.0 || size == 0.0 {
        return Ok(None);
    }
    let Ok(speed) = taken.clone().svd(true, true).solve(&push, 1e-12 * size) else { return Ok(None) };
    let bounded = (&taken * &speed - &push).amax() <= 1e-9 * push.amax();
    Ok(bounded.then(|| 0.25 * push.dot(&speed)))
}
