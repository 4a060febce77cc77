//! One nonlinear coupling at a body, over one step: the constant torque that keeps its energy.
//!
//! With the torques of all others held, the step leaves one coupling the line q' - q = free + G F, where G ≥ 0 is what a unit of
//! its torque moves it by. Against that line stands its law, F = -(V(q') - V(q))/(q' - q) and what it damps, so that F is the
//! root of one equation in one unknown. For everything but a steep detent the law never rises, d - G F(d) rises at a slope of 1 at
//! least, and there is one root: Newton's, inside a bracket that shrinks at every step.
//!
//! The quotients are closed forms without a difference of energies: a mean of the torque over the way from q to q'.

use crate::Real;
use crate::nonlinear::{Curve, Nonlinear};

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
    fn fixed(torque: F) -> Self {
        Answer { torque, by_free: F::ZERO, by_rate: F::ZERO }
    }

    /// The same within [low, high].
    fn within(self, low: F, high: F) -> Self {
        let torque = within(self.torque, low, high);
        if torque == self.torque { self } else { Answer::fixed(torque) }
    }
}

/// More steps of a scalar solve than it can take: every other one halves the bracket.
const STEPS: usize = 120;
/// Points at which a steep detent is looked at for the nearest of its solutions.
const LOOKS: usize = 200;

impl<F: Real> Nonlinear<F> {
    /// Whether a wall is out of reach from `start` to `start + distance`: the common case, and cheap to see.
    #[inline]
    pub fn is_clear(&self, start: F, distance: F) -> bool {
        match self.curve {
            Curve::Wall { direction, at, .. } => {
                let depth = direction * (start - at);
                depth <= F::ZERO && depth + direction * distance <= F::ZERO
            }
            Curve::Spring { .. }
            | Curve::Damper { .. }
            | Curve::Detent { .. }
            | Curve::Coulomb { .. }
            | Curve::Lugre(_) => false,
        }
    }

    /// The torque on the first end, held over the step of 1/`rate` seconds.
    pub fn held(&self, gap: &Gap<F>, rate: F) -> Answer<F> {
        match self.curve {
            Curve::Wall { direction, at, stiffness, damping, limit } => {
                let inward = Gap { start: direction * (gap.start - at), free: direction * gap.free, ..*gap };
                let answer = wall(&inward, &Ramp::new(stiffness, F::ZERO, limit), damping * rate, limit);
                Answer { torque: direction * answer.torque, ..answer }
            }
            Curve::Spring { stiffness, rest, limit } => {
                let ramp = Ramp::new(stiffness, -limit, limit);
                let gap = Gap { start: gap.start - rest, ..*gap };
                let law = |distance| {
                    let (mean, slope) = ramp.mean(gap.start, distance);
                    (-mean, -slope)
                };
                meet_falling(&gap, law).within(-limit, limit)
            }
            Curve::Damper { damping, limit } => {
                // Straight where it is not clamped, so that the straight solution, clamped, is the solution.
                let drag = damping * rate;
                let whole = F::ONE + drag * gap.compliance;
                let torque = -(drag * gap.free + damping * gap.carried) / whole;
                Answer { torque, by_free: -(drag / whole), by_rate: F::ZERO }.within(-limit, limit)
            }
            Curve::Detent { torque, pitch, phase } => detent(gap, torque, pitch, phase),
            Curve::Coulomb { torque } => coulomb(gap, torque),
            // Refused at bodies when the loop was compiled.
            Curve::Lugre(_) => Answer::fixed(F::ZERO),
        }
    }

    /// (V(q + distance) - V(q))/distance of what the coupling stores, its limit at 0; 0 for what only takes.
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        match self.curve {
            Curve::Wall { direction, at, stiffness, limit, .. } => {
                let ramp = Ramp::new(stiffness, F::ZERO, limit);
                direction * ramp.mean(direction * (start - at), direction * distance).0
            }
            Curve::Spring { stiffness, rest, limit } => {
                Ramp::new(stiffness, -limit, limit).mean(start - rest, distance).0
            }
            Curve::Detent { torque, pitch, phase } => {
                sine_mean(torque, pitch, from_rest(start, pitch, phase), distance).0
            }
            Curve::Damper { .. } | Curve::Coulomb { .. } | Curve::Lugre(_) => F::ZERO,
        }
    }
}

/// k x, held between two torques: the slope of what a wall (0 and its limit) or a clamped spring stores.
#[derive(Clone, Copy, Debug)]
struct Ramp<F> {
    stiffness: F,
    /// The x at which it levels off; infinite where it never does.
    low: F,
    high: F,
}

impl<F: Real> Ramp<F> {
    fn new(stiffness: F, least: F, most: F) -> Self {
        // 0/0 of a wall without stiffness would be no number.
        let low = if least == F::ZERO { least } else { least / stiffness };
        Ramp { stiffness, low, high: most / stiffness }
    }

    /// The mean over the way from `from` to `from + distance`, and its derivative by `distance`.
    fn mean(&self, from: F, distance: F) -> (F, F) {
        let to = from + distance;
        let (a, b) = (within(from, self.low, self.high), within(to, self.low, self.high));
        if a == from && b == to {
            return (self.stiffness * (from + F::HALF * distance), F::HALF * self.stiffness);
        }
        // The way as the numbers have it, so that its shares below, on and above the slope make 1.
        let way = to - from;
        if way == F::ZERO {
            return (self.stiffness * a, F::ZERO);
        }
        // From the start's level on: no share of a short way multiplies more than that way.
        let mut rise = F::HALF * (b - a) * ((b - a) / way);
        for (level, share) in [
            (self.high, over(to, self.high) - over(from, self.high)),
            (self.low, over(self.low, from) - over(self.low, to)),
        ] {
            if share != F::ZERO {
                rise += (level - a) * (share / way);
            }
        }
        let mean = a + rise;
        (self.stiffness * mean, self.stiffness * ((b - mean) / way))
    }
}

/// How far x is over y; 0 when it is not.
fn over<F: Real>(x: F, y: F) -> F {
    if x > y { x - y } else { F::ZERO }
}

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

/// A wall that pushes outward from x > 0, in x and torque that count inward. `drag` is damping/T.
///
/// Damping acts where the middle of the way is inside, on one side of d = -2x. From inside, the push falls to its undamped value
/// there, and of two solutions the damped one, with the smaller change, is nearest to the free motion. From outside it rises
/// there: where neither side has a solution, it stands at the edge, with the part of the damping that holds it there.
fn wall<F: Real>(gap: &Gap<F>, ramp: &Ramp<F>, drag: F, limit: F) -> Answer<F> {
    let push = |drag: F, distance: F| {
        let (mean, slope) = ramp.mean(gap.start, distance);
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
        let edge = -(gap.start + gap.start);
        let beyond = |drag: F| edge - gap.free - gap.compliance * push(drag, edge).0;
        if beyond(drag) <= F::ZERO {
            damped = drag;
        } else if beyond(F::ZERO) < F::ZERO {
            let by_free = -(F::ONE / gap.compliance);
            let torque = (edge - gap.free) / gap.compliance;
            return Answer { torque, by_free, by_rate: F::ZERO }.within(-limit, F::ZERO);
        }
    }
    meet_falling(gap, |distance| push(damped, distance)).within(-limit, F::ZERO)
}

/// Coulomb friction of level `torque`: of the torques within ±`torque` that oppose q' - q, or make it 0, the one that brings q̇'
/// nearest to rest.
///
/// Under backward Euler, and for what slides on, or rests already, this is -`torque` · sign(q' - q), or the torque that makes q' - q
/// 0. Under zoh and the trapezoidal rule that alone would not bring a moving body to rest: it sends it back with -q̇, and so at
/// every sample from then on.
fn coulomb<F: Real>(gap: &Gap<F>, torque: F) -> Answer<F> {
    if gap.free == F::ZERO {
        return Answer::fixed(F::ZERO);
    }
    let by_free = -(F::ONE / gap.compliance);
    let most = Answer { torque: -(gap.free / gap.compliance), by_free, by_rate: F::ZERO }.within(-torque, torque);
    if gap.mobility <= F::ZERO {
        return most;
    }
    let by_rate = -(F::ONE / gap.mobility);
    let stop = Answer { torque: -(gap.rate / gap.mobility), by_free: F::ZERO, by_rate };
    let level = most.torque;
    let beyond = if level > F::ZERO { stop.torque > level } else { stop.torque < level };
    if beyond {
        most
    } else if level > F::ZERO {
        stop.within(F::ZERO, level)
    } else {
        stop.within(level, F::ZERO)
    }
}

/// q from the nearest rest, in turns.
fn from_rest<F: Real>(q: F, pitch: F, phase: F) -> F {
    let turns = (q - phase) / pitch;
    turns - (turns + F::HALF).floor()
}

/// The mean of torque · sin over `distance` from `from` turns, and its derivative:
/// (cos a - cos(a + 2h))/2h = sin(a + h) · sin(h)/h.
fn sine_mean<F: Real>(torque: F, pitch: F, from: F, distance: F) -> (F, F) {
    let tau = F::from_f64(core::f64::consts::TAU);
    let half = F::HALF * (distance / pitch);
    let angle = tau * half;
    let share = if angle == F::ZERO { F::ONE } else { angle.sin() / angle };
    let mean = torque * ((tau * (from + half)).sin() * share);
    let slope = if half.abs() > F::from_f64(1.0 / 64.0) {
        (torque * (tau * (from + half + half)).sin() - mean) / distance
    } else {
        // Half of the slope in the middle; sin a quarter of a turn on is cos.
        torque * F::HALF * (tau / pitch) * (tau * (from + half + F::HALF * F::HALF)).sin()
    };
    (mean, slope)
}

/// The detent's torque at the solution nearest to the free motion.
fn detent<F: Real>(gap: &Gap<F>, torque: F, pitch: F, phase: F) -> Answer<F> {
    let from = from_rest(gap.start, pitch, phase);
    let gap = &Gap { start: from * pitch, ..*gap };
    let law = |distance: F| {
        let (mean, slope) = sine_mean(torque, pitch, from, distance);
        (-mean, -slope)
    };
    let reach = gap.compliance * torque;
    // How far a falling slope can turn the line, 1 - G F'(d): below 1, there is one solution.
    let turn = reach * F::from_f64(core::f64::consts::PI) / pitch;
    let found = if turn < F::ONE {
        meet(gap, (gap.free - reach, gap.free + reach), true, law)
    } else {
        let (ends, rising) = nearest(gap, reach, turn, pitch * F::from_f64(1.0 / 64.0), law);
        meet(gap, ends, rising, law)
    };
    found.within(-torque, torque)
}

/// Brackets the solution nearest to the free motion, looking to both sides in turn: from a point at which d - free - G F is r
/// there is none nearer than |r|/(1 + turn), and two within `fine` are not told apart. The second answer is whether it rises.
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
fn meet_falling<F: Real>(gap: &Gap<F>, law: impl Fn(F) -> (F, F)) -> Answer<F> {
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
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20000, failure_persistence: None, ..ProptestConfig::default() })]

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
