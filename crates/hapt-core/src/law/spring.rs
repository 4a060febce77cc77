//! A spring, and the rising torque that levels off at a limit: a spring's, a wall's, a dead band's.

use crate::contact::{Solution, StepResponse, solve_falling, within};
use crate::{Number, Real};

/// A spring with a limit; those without are matrices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring<F> {
    pub stiffness: F,
    pub rest: F,
    pub limit: F,
}

impl<F: Number> Spring<F> {
    /// -stiffness · (q - rest), within ±limit
    #[inline(always)]
    pub fn torque(&self, q: F) -> F {
        within(-(self.stiffness * (q - self.rest)), -self.limit, self.limit)
    }
}

impl<F: Real> Spring<F> {
    fn ramp(&self) -> Ramp<F> {
        Ramp::new(self.stiffness, -self.limit, self.limit)
    }

    /// The torque that keeps its energy over a step.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let (ramp, limit) = (self.ramp(), self.limit);
        let response = StepResponse { start: response.start - self.rest, ..*response };
        let law = |distance| {
            let (mean, slope) = ramp.mean(response.start, distance);
            (-mean, -slope)
        };
        solve_falling(&response, law).within(-limit, limit)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        self.ramp().mean(start - self.rest, distance).0
    }
}

/// stiffness · x²/2 up to the x at which the torque is `limit`, linear from there on.
pub(super) fn energy(stiffness: f64, x: f64, limit: f64) -> f64 {
    if limit == f64::INFINITY {
        return 0.5 * stiffness * (x * x);
    }
    let x = x.abs();
    let slope = x.min(limit / stiffness);
    0.5 * stiffness * slope * slope + if x > slope { limit * (x - slope) } else { 0.0 }
}

/// k x, held between two torques: the derivative of the stored energy of a wall (0 and its limit) or of a spring with a limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp<F> {
    stiffness: F,
    /// The x at which it levels off; infinite where it never does.
    low: F,
    high: F,
}

impl<F: Real> Ramp<F> {
    pub fn new(stiffness: F, least: F, most: F) -> Self {
        // Avoids the NaN of 0/0, for a wall without stiffness.
        let low = if least == F::ZERO { least } else { least / stiffness };
        Ramp { stiffness, low, high: most / stiffness }
    }

    /// The mean from `from` to `from + distance`, and its derivative by `distance`.
    pub fn mean(&self, from: F, distance: F) -> (F, F) {
        let to = from + distance;
        let (a, b) = (within(from, self.low, self.high), within(to, self.low, self.high));
        if a == from && b == to {
            return (self.stiffness * (from + F::HALF * distance), F::HALF * self.stiffness);
        }
        // The rounded displacement, so that its shares below, on and above the slope sum to 1.
        let travel = to - from;
        if travel == F::ZERO {
            return (self.stiffness * a, F::ZERO);
        }
        // Relative to the value at the start: no share of a short displacement multiplies more than that displacement.
        let mut rise = F::HALF * (b - a) * ((b - a) / travel);
        for (level, share) in [
            (self.high, over(to, self.high) - over(from, self.high)),
            (self.low, over(self.low, from) - over(self.low, to)),
        ] {
            if share != F::ZERO {
                rise += (level - a) * (share / travel);
            }
        }
        let mean = a + rise;
        (self.stiffness * mean, self.stiffness * ((b - mean) / travel))
    }
}

/// x - y where positive, else 0.
fn over<F: Real>(x: F, y: F) -> F {
    if x > y { x - y } else { F::ZERO }
}
