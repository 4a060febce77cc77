//! A wall: a spring and a damper on one side of its face, which only push.

use crate::contact::{Solution, StepResponse, solve_falling, within};
use crate::law::spring::{self, Ramp};
use crate::{Number, Real};

/// On which side of its face a wall pushes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Side {
    /// It pushes toward smaller q while q > at.
    Above,
    /// It pushes toward larger q while q < at.
    Below,
}

impl Side {
    /// The side's name in world files.
    pub const fn name(self) -> &'static str {
        match self {
            Side::Above => "above",
            Side::Below => "below",
        }
    }
}

/// `direction` is +1 for a wall above its face, -1 for one below: then q, q̇ and torque are mirrored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall<F> {
    pub direction: F,
    pub at: F,
    pub stiffness: F,
    pub damping: F,
    /// Infinite where it has none.
    pub limit: F,
}

/// +1 where it pushes above its face, -1 where below.
pub(crate) const fn direction(side: Side) -> f64 {
    match side {
        Side::Above => 1.0,
        Side::Below => -1.0,
    }
}

/// The energy that it stores at q.
pub(super) fn energy(side: Side, at: f64, stiffness: f64, q: f64, limit: f64) -> f64 {
    let depth = match side {
        Side::Above => (q - at).max(0.0),
        Side::Below => (at - q).max(0.0),
    };
    spring::energy(stiffness, depth, limit)
}

impl<F: Number> Wall<F> {
    #[inline(always)]
    pub fn torque(&self, q: F, velocity: F) -> F {
        let Wall { direction, at, stiffness, damping, limit } = *self;
        let depth = direction * (q - at);
        let push = stiffness * depth + damping * (direction * velocity);
        // It pushes only, and only inside; a NaN pushes nothing.
        let inside = push.if_above(F::ZERO, -(direction * within(push, F::ZERO, limit)), F::ZERO);
        depth.if_above(F::ZERO, inside, F::ZERO)
    }
}

impl<F: Real> Wall<F> {
    /// Whether it is out of reach from `start` to `start + distance`: the common case, with a cheap test.
    #[inline]
    pub fn is_clear(&self, start: F, distance: F) -> bool {
        let depth = self.direction * (start - self.at);
        depth <= F::ZERO && depth + self.direction * distance <= F::ZERO
    }

    fn ramp(&self) -> Ramp<F> {
        Ramp::new(self.stiffness, F::ZERO, self.limit)
    }

    /// The torque that keeps its energy over a step of 1/`rate` seconds, plus that of its damping.
    pub fn solve(&self, response: &StepResponse<F>, rate: F) -> Solution<F> {
        let direction = self.direction;
        let inward = StepResponse {
            start: direction * (response.start - self.at),
            free: direction * response.free,
            ..*response
        };
        let solution = push(&inward, &self.ramp(), self.damping * rate, self.limit);
        Solution { torque: direction * solution.torque, ..solution }
    }

    /// The torque over a step of 1/`rate` seconds in which q goes from `start` by `distance`: damped where the middle of the displacement
    /// is inside, and undamped where it is not.
    pub fn over_step(&self, start: F, distance: F, rate: F) -> F {
        let direction = self.direction;
        let (x, travel) = (direction * (start - self.at), direction * distance);
        let drag = (x + F::HALF * travel).if_above(F::ZERO, self.damping * rate, F::ZERO);
        -(direction * within(self.ramp().mean(x, travel).0 + drag * travel, F::ZERO, self.limit))
    }

    /// The same without damping.
    pub fn over_step_undamped(&self, start: F, distance: F) -> F {
        Wall { damping: F::ZERO, ..*self }.over_step(start, distance, F::ZERO)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        let direction = self.direction;
        direction * self.ramp().mean(direction * (start - self.at), direction * distance).0
    }
}

/// A wall that pushes outward from x > 0, in x and torque that count inward. `drag` is damping/T.
///
/// Damping acts where the middle of the displacement is inside, on one side of d = -2x. From inside, the push falls to its undamped value
/// there, and of two solutions the damped one, with the smaller change, is nearest to the free motion. From outside it rises there: where
/// neither side has a solution, the solution is at the edge, with the part of the damping that holds it there.
fn push<F: Real>(response: &StepResponse<F>, ramp: &Ramp<F>, drag: F, limit: F) -> Solution<F> {
    let push = |drag: F, distance: F| {
        let (mean, slope) = ramp.mean(response.start, distance);
        let sum = mean + drag * distance;
        if sum > limit {
            (-limit, F::ZERO)
        } else if sum > F::ZERO {
            (-sum, -(slope + drag))
        } else {
            (F::ZERO, F::ZERO)
        }
    };
    let mut damped = F::ZERO;
    if drag > F::ZERO {
        let edge = -(response.start + response.start);
        let beyond = |drag: F| edge - response.free - response.compliance * push(drag, edge).0;
        if beyond(drag) <= F::ZERO {
            damped = drag;
        } else if beyond(F::ZERO) < F::ZERO {
            let by_free = -(F::ONE / response.compliance);
            let torque = (edge - response.free) / response.compliance;
            return Solution { torque, by_free, by_rate: F::ZERO }.within(-limit, F::ZERO);
        }
    }
    solve_falling(response, |distance| push(damped, distance)).within(-limit, F::ZERO)
}
