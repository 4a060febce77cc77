//! Detection of a dead encoder: a position that does not change although the torque should have moved the puck.
//!
//! While the position stands still, a simulated free puck starts from rest under the torque that the motor holds:
//!
//! ```text
//! J dv/dt = τ - b v - r sign(v)      τ = 0 where |τ| is within `stuck_torque`;  r = (stuck_torque + friction)/2
//! ```
//!
//! It has more friction than the puck, and under a torque of one sign it moves less. A torque of the other sign restarts it from rest:
//! the motion under an alternating torque depends on the true friction, and an assumed friction would turn it into a drift.
//! Each time that the simulated puck has moved four counts, the real one should have moved and did not: the time since the last such
//! event, at most a quarter of `stuck`, is added to a sum, and the computation restarts. Four, because a puck that was swinging back by
//! up to a count has by then moved one count forward from its turning point: with x the displacement of the simulated puck and τ held, it
//! turned within √(1/4) of the time, and has moved x/4 or more since. When the sum exceeds `stuck`, the encoder counts as dead. An
//! oscillating torque adds as much as a constant one, and one that alternates too fast to move a puck by counts adds nothing. Only motion
//! resets the sum.

use crate::supervisor::Limits;
use crate::{Constants, Real, Spec};

/// In counts; in rad or m without counts.
pub(super) const COUNTS: f64 = 4.0;
pub(super) const FAR: f64 = 0.25e-3;

/// How a free puck moves in a sample, in displacements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing<F> {
    /// A torque within it counts as none.
    torque: F,
    /// The displacement of a sample by a unit of torque: T²/J.
    push: F,
    /// The friction's, r T²/J.
    friction: F,
    /// The damping's part of it, b T/J.
    drag: F,
    far: F,
    /// In samples.
    stuck: u32,
    /// The most samples that count at once.
    most: u32,
}

/// Since the position last changed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Stand<F> {
    /// The displacement of the simulated puck since its last start.
    travel: F,
    /// Its displacement in a sample.
    speed: F,
    /// Samples since its last start, at most as many as count at once.
    since: u32,
    /// Samples for which the puck should have moved and did not.
    stalled: u32,
}

impl<F: Real> Stand<F> {
    pub const NONE: Self = Stand { travel: F::ZERO, speed: F::ZERO, since: 0, stalled: 0 };

    /// The same times and the same speed, in samples of another period. Times are rounded up: repeated changes of the world do not postpone
    /// the fault.
    pub fn at_period(self, before: F, after: F) -> Self {
        if before == after {
            return self;
        }
        let ratio = before / after;
        let samples = |count: u32| libm::ceil((F::from_f64(f64::from(count)) * ratio).to_f64()) as u32;
        Stand { speed: self.speed / ratio, since: samples(self.since), stalled: samples(self.stalled), ..self }
    }
}

impl<F: Real> Standing<F> {
    pub fn new(limits: &Limits, spec: &Spec) -> Self {
        let f = F::from_f64;
        let push = spec.period * spec.period / limits.inertia;
        let samples = |time: f64| libm::ceil(time / spec.period) as u32;
        Standing {
            torque: f(if limits.stuck.is_finite() { limits.stuck_torque } else { f64::INFINITY }),
            push: f(push),
            friction: f(push * 0.5 * (limits.stuck_torque + limits.friction)),
            drag: f(limits.damping * spec.period / limits.inertia),
            far: f(spec.count.map_or(FAR, |count| COUNTS * count)),
            stuck: samples(limits.stuck),
            most: samples(0.25 * limits.stuck),
        }
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        for (name, about, value) in [
            ("stuck_torque", "a torque within it counts as none", self.torque),
            ("stuck_push", "the displacement of a sample by a unit of torque", self.push),
            ("stuck_friction", "and by friction", self.friction),
            ("stuck_drag", "the damping's part of it", self.drag),
            ("stuck_far", "what a free puck should have moved", self.far),
        ] {
            to.number(name, about, value.to_f64());
        }
        to.whole("stuck", "samples", i64::from(self.stuck));
        to.whole("stuck_most", "samples that count at once", i64::from(self.most));
    }

    /// Whether a sample of standing still under the torque `held` changes the state.
    #[inline(always)]
    pub fn counts(&self, stand: &Stand<F>, held: F) -> bool {
        (stand.since | stand.stalled) > 0 || held.abs() > self.torque
    }

    /// After `samples` more under the torque `held`, their number given twice; `true`: it has stood still for too long.
    #[inline(never)]
    pub fn after(&self, stand: &Stand<F>, held: F, samples: u32, periods: F) -> (Stand<F>, bool) {
        if !self.counts(stand, held) {
            return (Stand::NONE, false);
        }
        let rest = Stand { stalled: stand.stalled, ..Stand::NONE };
        let stand = if held * stand.travel < F::ZERO { &rest } else { stand };
        let torque = if held.abs() > self.torque { held } else { F::ZERO };
        let pushed = stand.speed + periods * (self.push * torque);
        let friction = periods * self.friction;
        let slid = if pushed > friction {
            pushed - friction
        } else if pushed < -friction {
            pushed + friction
        } else {
            F::ZERO
        };
        let speed = slid / (F::ONE + periods * self.drag);
        let travel = stand.travel + periods * speed;
        let since = stand.since.saturating_add(samples).min(self.most);
        if travel.abs() <= self.far {
            return (Stand { travel, speed, since, stalled: stand.stalled }, false);
        }
        let stalled = stand.stalled.saturating_add(since);
        (Stand { travel: F::ZERO, speed: F::ZERO, since: 0, stalled }, stalled > self.stuck)
    }
}
