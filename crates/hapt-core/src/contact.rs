//! One nonlinear coupling at a body, over one step: the constant torque that keeps its energy.
//!
//! With the torques of all others held, the step leaves one coupling the line q' - q = free + G F, where G ≥ 0 is what a unit of
//! its torque moves it by. Against that line stands its law, F = -(V(q') - V(q))/(q' - q) and what it damps, so that F is the
//! root of one equation in one unknown. For everything but a steep detent the law never rises, d - G F(d) rises at a slope of 1 at
//! least, and there is one root: Newton's, inside a bracket that shrinks at every step.
//!
//! The quotients are closed forms without a difference of energies: a mean of the torque over the way from q to q'.

use crate::Real;

/// What the step leaves to one coupling, the torques of all others held.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap<F> {
    /// q at the start, with z held.
    pub start: F,
    /// q' - q without the coupling.
    pub free: F,
    /// G: how far a unit of torque moves q' on.
    pub compliance: F,
    /// q̇' without the coupling, the puck at rest.
    pub rate: F,
    /// How far a unit of torque moves q̇' on.
    pub mobility: F,
    /// The rate of q by the puck's own measured velocity.
    pub carried: F,
}

/// A coupling's torque, and how it follows what the others leave to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answer<F> {
    pub torque: F,
    /// Its derivative by `free`.
    pub by_free: F,
    /// Its derivative by `rate`.
    pub by_rate: F,
}

impl<F: Real> Answer<F> {
    /// Whatever the others do.
    pub fn fixed(torque: F) -> Self {
        Answer { torque, by_free: F::ZERO, by_rate: F::ZERO }
    }

    /// The same within [low, high].
    pub fn within(self, low: F, high: F) -> Self {
        let torque = within(self.torque, low, high);
        if torque == self.torque { self } else { Answer::fixed(torque) }
    }
}

/// More steps of a scalar solve than it can take: every other one halves the bracket.
const STEPS: usize = 120;
/// Points at which a law that falls steeply is looked at for the nearest of its solutions.
const LOOKS: usize = 200;

/// x within [low, high]; a NaN stays one.
pub(crate) fn within<F: Real>(x: F, low: F, high: F) -> F {
    if x > high {
        high
    } else if x < low {
        low
    } else {
        x
    }
}

/// The solution nearest to the free motion of a law that may fall; its torque is within ±`most`. `turns` are how far its steepest fall
/// and its steepest slope of either sign turn the line, G |F'(d)|: below 1 for the fall, there is one solution. Two solutions within
/// `fine` are not told apart.
pub(crate) fn meet_any<F: Real>(
    gap: &Gap<F>,
    most: F,
    (fall, steepest): (F, F),
    fine: F,
    law: impl Fn(F) -> (F, F),
) -> Answer<F> {
    let reach = gap.compliance * most;
    let found = if fall < F::ONE {
        meet(gap, (gap.free - reach, gap.free + reach), true, law)
    } else {
        let (ends, rising) = nearest(gap, reach, steepest, fine, &law);
        meet(gap, ends, rising, law)
    };
    found.within(-most, most)
}

/// Brackets the solution nearest to the free motion, looking to both sides in turn: from a point at which d - free - G F is r
/// there is none nearer than |r|/(1 + turn), `turn` being G times the steepest slope, and two within `fine` are not told apart. The second answer is whether it rises.
fn nearest<F: Real>(gap: &Gap<F>, reach: F, turn: F, fine: F, law: impl Fn(F) -> (F, F)) -> ((F, F), bool) {
    let off = |distance: F| distance - gap.free - gap.compliance * law(distance).0;
    let first = off(gap.free);
    let is_above = first > F::ZERO;
    let (mut above, mut below) = ((gap.free, first), (gap.free, first));
    for _ in 0..LOOKS {
        let up = above.0 - gap.free <= gap.free - below.0;
        let side = if up { &mut above } else { &mut below };
        let safe = side.1.abs() / (F::ONE + turn);
        let step = if safe > fine { safe } else { fine };
        let next = if up { side.0 + step } else { side.0 - step };
        let value = off(next);
        if (value > F::ZERO) != is_above {
            return if up { ((side.0, next), !is_above) } else { ((next, side.0), is_above) };
        }
        *side = (next, value);
    }
    // One is there for certain.
    ((gap.free - reach, gap.free + reach), true)
}

/// The solution of a law that never rises: it lies between the free motion and what the torque there would make of it.
pub(crate) fn meet_falling<F: Real>(gap: &Gap<F>, law: impl Fn(F) -> (F, F)) -> Answer<F> {
    let far = gap.free + gap.compliance * law(gap.free).0;
    let ends = if far < gap.free { (far, gap.free) } else { (gap.free, far) };
    meet(gap, ends, true, law)
}

/// F where d = free + G F and F = law(d) meet, between two ends at which d - free - G F has different signs; `law` gives the
/// torque and its derivative. Newton's steps, and halves of the bracket wherever they leave it or do not halve.
///
/// The torque is the tangent's at the next step, which fits line and law alike to the last bits, however steep the one or the
/// other is.
fn meet<F: Real>(gap: &Gap<F>, ends: (F, F), rising: bool, law: impl Fn(F) -> (F, F)) -> Answer<F> {
    let (mut low, mut high) = ends;
    let mut at = within(gap.free, low, high);
    let mut longest = high - low;
    let mut answer = Answer::fixed(F::ZERO);
    for _ in 0..STEPS {
        let (force, slope) = law(at);
        let off = at - gap.free - gap.compliance * force;
        let turn = F::ONE - gap.compliance * slope;
        let step = off / turn;
        answer = Answer { torque: force, by_free: slope / turn, by_rate: F::ZERO };
        // The law sees its place with the bits of q alone.
        let seen = (turn - F::ONE).abs() * gap.start.abs() / turn.abs();
        if step.abs() <= (F::EPSILON + F::EPSILON) * (at.abs() + gap.free.abs() + seen) {
            return Answer { torque: force - slope * step, ..answer };
        }
        if (off > F::ZERO) == rising {
            high = at;
        } else {
            low = at;
        }
        let newton = at - step;
        let next = if newton >= low && newton <= high && step.abs() <= longest {
            // The next of Newton's steps is half as long, or the bracket is halved.
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
    answer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Ramp;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(20000))]

        #[test]
        fn line_and_law_meet_at_the_torque_that_is_found(
            place in (-1.0_f64..2.0, -1.0_f64..2.0), near in prop::option::of((-17_i32..-1, 1.0_f64..10.0)),
            free in (-12_i32..1, -10.0_f64..10.0), stiff in -3.0_f64..3.0, two_sided: bool,
        ) {
            let (stiffness, limit) = (10.0, 10.0);
            let low = if two_sided { -limit } else { 0.0 };
            let ramp = Ramp::new(stiffness, low, limit);
            // On the kinks, and near to them.
            let start = near.map_or(place.0, |(power, digit)| place.0.round() + digit * 10_f64.powi(power));
            let free = free.1 * 10_f64.powi(free.0);
            let gap = Gap { start, free, compliance: 10_f64.powf(stiff) / stiffness, rate: 0.0, mobility: 1.0, carried: 0.0 };
            let law = |distance: f64| {
                let (mean, slope) = ramp.mean(gap.start, distance);
                (-mean, -slope)
            };
            let torque = meet_falling(&gap, law).torque;
            let distance = gap.free + gap.compliance * torque;
            let noise = 8.0 * f64::EPSILON * (limit + (stiffness + 1.0 / gap.compliance) * (start.abs() + free.abs()));
            prop_assert!((torque - law(distance).0).abs() < noise, "{torque} {} {distance:e} {noise:e}", law(distance).0);
        }
    }
}
