//! One nonlinear coupling at a body, over one step: the constant torque that keeps its energy.
//!
//! With the torques of all other couplings held constant, the step moves this coupling by q' - q = free + G F: the [`StepResponse`].
//! G ≥ 0 is the displacement by a unit of its torque. Its law is F = -(V(q') - V(q))/(q' - q), plus damping. Line and law together are
//! one equation in the one unknown F. For every law but a steep detent or magnet, F(d) never rises, so d - G F(d) rises with a slope of
//! at least 1 and has one root. Newton's method finds it, inside a bracket that shrinks at every step.
//!
//! The quotients are closed forms without a difference of energies: the mean torque over the displacement from q to q'.

use crate::{Number, Real};

/// How the step moves one coupling as a function of its own torque, the torques of all others held constant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepResponse<F> {
    /// q at the start of the step, with z held.
    pub start: F,
    /// q' - q without the coupling.
    pub free: F,
    /// G: the change of q' by a unit of torque, rad/(N·m) (linear: m/N).
    pub compliance: F,
    /// q̇' without the coupling, the puck at rest.
    pub rate: F,
    /// The change of q̇' by a unit of torque.
    pub mobility: F,
    /// The part of q̇ that is due to the puck's measured velocity.
    pub puck_rate: F,
}

/// A coupling's torque over the step, and its derivatives by the response.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution<F> {
    pub torque: F,
    /// The derivative by `free`.
    pub by_free: F,
    /// The derivative by `rate`.
    pub by_rate: F,
}

impl<F: Real> Solution<F> {
    /// A torque that does not depend on the response.
    pub fn fixed(torque: F) -> Self {
        Solution { torque, by_free: F::ZERO, by_rate: F::ZERO }
    }

    /// The same within [low, high].
    pub fn within(self, low: F, high: F) -> Self {
        let torque = within(self.torque, low, high);
        if torque == self.torque { self } else { Solution::fixed(torque) }
    }
}

/// More steps than a scalar solve can take: every second step halves the bracket.
const STEPS: usize = 120;
/// Points at which the search for the nearest of several solutions evaluates the law.
const PROBES: usize = 200;

/// x within [low, high]; a NaN stays one.
#[inline(always)]
pub(crate) fn within<F: Number>(x: F, low: F, high: F) -> F {
    x.if_above(high, high, low.if_above(x, low, x))
}

/// Solves a law that may have several solutions for the one nearest to the free motion. The torque is within ±`most`. `fall` and
/// `steepest` are G |F'(d)| at the law's steepest fall and at its steepest slope of either sign: with `fall` below 1 there is one
/// solution. Two solutions closer than `fine` are not distinguished.
pub(crate) fn solve_nearest<F: Real>(
    response: &StepResponse<F>,
    most: F,
    (fall, steepest): (F, F),
    fine: F,
    law: impl Fn(F) -> (F, F),
) -> Solution<F> {
    let reach = response.compliance * most;
    let found = if fall < F::ONE {
        solve(response, (response.free - reach, response.free + reach), true, law)
    } else {
        let (ends, rising) = nearest(response, reach, steepest, fine, &law);
        solve(response, ends, rising, law)
    };
    found.within(-most, most)
}

/// Brackets the motion nearest to the free motion, under a law of any shape: two neighbouring numbers, between which the residual
/// d - free - G F(d) changes its sign. `law` is within ±`most`; `steepest` is G |F'(d)| at its steepest slope. There always is one: the residual
/// is negative at free - G `most` and positive at free + G `most`.
pub(crate) fn enclose_nearest<F: Real>(
    response: &StepResponse<F>,
    most: F,
    steepest: F,
    fine: F,
    law: impl Fn(F) -> F,
) -> (F, F) {
    let reach = response.compliance * most;
    // So many steps reach both ends.
    let least = (reach + reach) / F::from_f64(PROBES as f64 - 4.0);
    let fine = if fine > least { fine } else { least };
    let ((mut low, mut high), rising) = nearest(response, reach, steepest, fine, |distance| (law(distance), F::ZERO));
    for _ in 0..STEPS {
        let middle = low + F::HALF * (high - low);
        if !(middle > low && middle < high) {
            break;
        }
        if (middle - response.free - response.compliance * law(middle) > F::ZERO) == rising {
            high = middle;
        } else {
            low = middle;
        }
    }
    (low, high)
}

/// Brackets the solution nearest to the free motion, searching on both sides in turn. From a point with the residual
/// r = d - free - G F no solution is nearer than |r|/(1 + `steepest`). Also returns whether the residual rises through the bracket.
fn nearest<F: Real>(
    response: &StepResponse<F>,
    reach: F,
    steepest: F,
    fine: F,
    law: impl Fn(F) -> (F, F),
) -> ((F, F), bool) {
    let residual = |distance: F| distance - response.free - response.compliance * law(distance).0;
    let first = residual(response.free);
    let is_above = first > F::ZERO;
    let (mut above, mut below) = ((response.free, first), (response.free, first));
    for _ in 0..PROBES {
        let up = above.0 - response.free <= response.free - below.0;
        let side = if up { &mut above } else { &mut below };
        let safe = side.1.abs() / (F::ONE + steepest);
        let step = if safe > fine { safe } else { fine };
        let next = if up { side.0 + step } else { side.0 - step };
        let value = residual(next);
        if (value > F::ZERO) != is_above {
            return if up { ((side.0, next), !is_above) } else { ((next, side.0), is_above) };
        }
        *side = (next, value);
    }
    // Within the largest torque's reach there is always one.
    ((response.free - reach, response.free + reach), true)
}

/// Solves a law that never rises. The solution lies between the free motion and the motion under the torque at the free motion.
pub(crate) fn solve_falling<F: Real>(response: &StepResponse<F>, law: impl Fn(F) -> (F, F)) -> Solution<F> {
    let far = response.free + response.compliance * law(response.free).0;
    let ends = if far < response.free { (far, response.free) } else { (response.free, far) };
    solve(response, ends, true, law)
}

/// Solves d = free + G F and F = law(d) for F, between two ends at which d - free - G F has different signs. `law` returns the
/// torque and its derivative. Takes Newton's steps, and bisects where such a step leaves the bracket or is not half of the one before.
///
/// The torque is the tangent's at the next step: it satisfies both equations to the last bits, however steep either is.
fn solve<F: Real>(response: &StepResponse<F>, ends: (F, F), rising: bool, law: impl Fn(F) -> (F, F)) -> Solution<F> {
    let (mut low, mut high) = ends;
    let mut at = within(response.free, low, high);
    let mut longest = high - low;
    let mut solution = Solution::fixed(F::ZERO);
    for _ in 0..STEPS {
        let (force, slope) = law(at);
        let residual = at - response.free - response.compliance * force;
        let gradient = F::ONE - response.compliance * slope;
        let step = residual / gradient;
        solution = Solution { torque: force, by_free: slope / gradient, by_rate: F::ZERO };
        // The law's argument is q, so that the rounding of q limits the residual.
        let rounding = (gradient - F::ONE).abs() * response.start.abs() / gradient.abs();
        if step.abs() <= (F::EPSILON + F::EPSILON) * (at.abs() + response.free.abs() + rounding) {
            return Solution { torque: force - slope * step, ..solution };
        }
        if (residual > F::ZERO) == rising {
            high = at;
        } else {
            low = at;
        }
        let newton = at - step;
        let next = if newton >= low && newton <= high && step.abs() <= longest {
            // The next of Newton's steps must be at most half as long; else the bracket is halved.
            longest = F::HALF * step.abs();
            newton
        } else {
            longest = high - low;
            low + F::HALF * (high - low)
        };
        if next == at {
            break;
        }
        at = next;
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Ramp;
    use hapt_testing::prelude::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(20000))]

        #[test]
        fn the_torque_found_satisfies_both_line_and_law(
            place in (-1.0_f64..2.0, -1.0_f64..2.0), near in prop::option::of((-17_i32..-1, 1.0_f64..10.0)),
            free in (-12_i32..1, -10.0_f64..10.0), stiff in -3.0_f64..3.0, two_sided in any::<bool>(),
        ) {
            let (stiffness, limit) = (10.0, 10.0);
            let low = if two_sided { -limit } else { 0.0 };
            let ramp = Ramp::new(stiffness, low, limit);
            // On the kinks, and near to them.
            let start = near.map_or(place.0, |(power, digit)| place.0.round() + digit * 10_f64.powi(power));
            let free = free.1 * 10_f64.powi(free.0);
            let response = StepResponse { start, free, compliance: 10_f64.powf(stiff) / stiffness, rate: 0.0, mobility: 1.0, puck_rate: 0.0 };
            let law = |distance: f64| {
                let (mean, slope) = ramp.mean(response.start, distance);
                (-mean, -slope)
            };
            let torque = solve_falling(&response, law).torque;
            let distance = response.free + response.compliance * torque;
            let noise = 8.0 * f64::EPSILON * (limit + (stiffness + 1.0 / response.compliance) * (start.abs() + free.abs()));
            prop_assert!((torque - law(distance).0).abs() < noise, "{torque} {} {distance:e} {noise:e}", law(distance).0);
        }
    }
}
