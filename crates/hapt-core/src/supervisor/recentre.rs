//! Idle re-centring: while the puck rests, the world's origin slips so that the torque falls to 0.
//!
//! Friction holds a knob next to its detent, and the motor holds a torque against it until the knob is turned. Where the puck has stayed
//! within four counts for `recentre` seconds, and the torque τ of the couplings is within the device's friction, the origin slips
//! each sample by
//!
//! ```text
//! e = λ τ/K,    λ = T/recentre,    K: the steepest rises at the puck together
//! ```
//!
//! in the direction in which τ pushes: the torque falls like that of a spring K in series with a damper K · `recentre`. The slip is taken
//! only where |τ| ≥ 2 K (|δ| + 3Δ/2), with the displacement δ of the sample and counts Δ: then it does not raise what the couplings store,
//! wherever the puck truly is (docs/theory.md, (T80)). With an encoder the slips are collected and taken by whole counts, so that the
//! world's positions stay those of counts.

use crate::spec::sign_at_puck;
use crate::supervisor::Limits;
use crate::supervisor::standing::{COUNTS, FAR};
use crate::{Constants, Real, Spec};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Recentre<F> {
    /// λ/K
    slip: F,
    /// The friction of the device, no more than the motor's limit, at which the torque is not the couplings'.
    most: F,
    /// 2 K
    stiffness: F,
    /// Δ; 0: ideal.
    count: F,
    /// 3Δ/2
    counts: F,
    /// How far from where it came to rest the puck counts as at rest.
    near: F,
    /// In samples.
    idle: u32,
}

/// Where the puck came to rest, and for how many samples it has been there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Rest<F> {
    at: F,
    pub samples: u32,
    /// The sum of slips that is less than a count.
    travel: F,
    /// Slips in counts since the origin was set, and where it was set.
    counts: i32,
    origin: F,
}

impl<F: Real> Rest<F> {
    pub const NONE: Self = Rest { at: F::ZERO, samples: 0, travel: F::ZERO, counts: 0, origin: F::ZERO };

    /// The origin is set from outside.
    pub fn origin_is_set(&mut self) {
        self.counts = 0;
    }
}

/// Every whole number up to this one is exact in f32.
const MOST: u32 = 1 << 24;

impl<F: Real> Recentre<F> {
    /// `None` where the limits have none, or where nothing pulls at the puck.
    pub fn new(limits: &Limits, spec: &Spec) -> Option<Self> {
        let at_puck = spec.couplings.iter().filter(|c| sign_at_puck(c.first, c.second) != 0.0);
        let stiffness: f64 = at_puck.map(|coupling| coupling.law.slopes().stiffness).sum();
        let f = F::from_f64;
        (limits.recentre > 0.0 && stiffness > 0.0).then(|| Recentre {
            slip: f(spec.period / limits.recentre / stiffness),
            most: f(limits.friction.min(spec.limit.unwrap_or(f64::INFINITY))),
            stiffness: f(2.0 * stiffness),
            count: f(spec.count.unwrap_or(0.0)),
            counts: f(1.5 * spec.count.unwrap_or(0.0)),
            near: f(spec.count.map_or(FAR, |count| COUNTS * count)),
            idle: libm::ceil(limits.recentre / spec.period) as u32,
        })
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        for (name, about, value) in [
            ("recentre_slip", "the slip of a sample by the torque", self.slip),
            ("recentre_most", "the largest torque that slips", self.most),
            ("recentre_stiffness", "twice the steepest rises at the puck", self.stiffness),
            ("recentre_count", "one count; 0: ideal", self.count),
            ("recentre_counts", "what the counts may hide of a displacement", self.counts),
            ("recentre_near", "how far the puck may be from where it came to rest", self.near),
        ] {
            to.number(name, about, value.to_f64());
        }
        to.whole("recentre_idle", "samples at rest before the origin slips", i64::from(self.idle));
    }

    /// The origin after a sample at `position`, after a displacement of `step` under the couplings' torque `torque`.
    #[inline]
    pub fn origin(&self, rest: &mut Rest<F>, origin: F, position: F, step: F, torque: F) -> F {
        if (position - rest.at).abs() > self.near {
            (rest.at, rest.samples, rest.travel) = (position, 0, F::ZERO);
            return origin;
        }
        if rest.samples < self.idle {
            rest.samples += 1;
            return origin;
        }
        let size = torque.abs();
        // Written so that a NaN slips nothing.
        let slips = size <= self.most && size >= self.stiffness * (step.abs() + self.counts);
        if !slips {
            return origin;
        }
        let travel = self.slip * torque;
        if self.count <= F::ZERO {
            return origin - travel;
        }
        rest.travel += travel;
        if rest.travel.abs() < self.count || rest.counts.unsigned_abs() >= MOST {
            return origin;
        }
        if rest.counts == 0 {
            rest.origin = origin;
        }
        let is_ahead = rest.travel > F::ZERO;
        rest.counts += if is_ahead { 1 } else { -1 };
        rest.travel += if is_ahead { -self.count } else { self.count };
        // Of the sum: the rounding of many slips does not add up.
        rest.origin - F::from_f64(f64::from(rest.counts)) * self.count
    }
}
