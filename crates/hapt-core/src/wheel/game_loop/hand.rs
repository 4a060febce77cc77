//! The torque and work of a hand: the part of the wheel's motion that motor, damping and friction do not explain.

use super::super::Timing;
use super::Rotor;
use crate::Real;
use crate::contact::within;

/// Works are averaged over this time, s.
const WINDOW: f64 = 0.1;
/// The time constant, s, with which a detected hand is forgotten while it still holds a torque: its work passes through 0 where it turns
/// round, but its torque does not at the same time. The second one applies where it holds no torque.
const BELIEF: [f64; 2] = [1.0, 0.05];
/// A hand's torque is averaged over this, s.
const GRASP: f64 = 0.05;
/// The largest torque of inertia, damping and friction fades with this time constant, s.
const RECENT: f64 = 0.3;
/// The part of that beyond which a torque is a hand's, and the further part at which the hand replaces the whole remedy. The free wheel's
/// motion leaves no more than this part unexplained where the device's numbers are accurate to within it, at any torque of the motor.
const HOLDS: [f64; 2] = [0.2, 0.1];
/// Speeds below this, rad/s, are rest.
const REST: f64 = 0.02;
/// The part of the lacking damping, and of the energy that motor and damping exchange with the wheel, that may be due to errors of the
/// device's numbers.
const ERRORS: [f64; 2] = [0.25, 0.1];

/// Compiled for a device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand<F> {
    period: F,
    /// The part of a period in which the command before the last one acts.
    late: F,
    inertia: F,
    damping: F,
    friction: F,
    /// Smoothing of the velocity, of works and of torques: the weight of a new value; the decay of what fades; the part that is kept of a
    /// detected hand.
    fresh: F,
    averaged: F,
    grasped: F,
    faded: F,
    kept: [F; 2],
    /// The average torque that a single count causes in the estimate of a hand's torque, N·m.
    count_torque: F,
}

/// Its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Works<F> {
    commands: [F; 2],
    /// The mean velocity of the last interval, and the torque of motor, damping and friction there; with the same smoothing.
    velocity: F,
    other: F,
    /// Averages: the hand's power and the size of the others', W, and the square of the velocity.
    hand: F,
    size: F,
    square: F,
    /// Averages of the hand's torque, of its size, of the size of the sum of motor, damping and friction, and of the torque that
    /// accelerates the wheel; and the recent maximum of the torques of inertia, damping and friction together, N·m.
    torque: F,
    torque_size: F,
    moved_size: F,
    inertial: F,
    largest: F,
    /// The part of a remedy that the hand has recently replaced: 0 to 1, and up to half more.
    share: F,
}

/// Motion and work from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval<F> {
    /// The mean velocity, rad/s, as smooth as the counts require.
    pub velocity: F,
    /// The work of the motor, and the work that may be a hand's, J.
    pub work: F,
    pub hand: F,
}

impl<F: Real> Works<F> {
    pub fn command(&mut self, torque: F) {
        self.commands = [torque.finite_or_zero(), self.commands[0]];
    }
}

impl<F: Real> Hand<F> {
    pub fn new(timing: Timing, rotor: &Rotor, count: f64) -> Self {
        let of = F::from_f64;
        let period = timing.period;
        // A count changes the velocity by 0.05 rad/s at most.
        let smoothing = (2.0 * period).max(count / 0.05);
        let late = (timing.delay + timing.lag) / period;
        Hand {
            period: of(period),
            late: of(late.min(1.0)),
            inertia: of(rotor.inertia),
            damping: of(rotor.damping),
            friction: of(rotor.friction),
            fresh: of(period / (period + smoothing)),
            averaged: of(period / (period + WINDOW)),
            grasped: of(period / (period + GRASP)),
            faded: of(period / (period + RECENT)),
            count_torque: of(rotor.inertia * count / (period + smoothing) / (period + GRASP)),
            kept: BELIEF.map(|time| of(libm::exp(-period / time))),
        }
    }

    pub fn start(&self) -> Works<F> {
        let zero = F::ZERO;
        Works {
            commands: [zero; 2],
            velocity: zero,
            other: zero,
            hand: zero,
            size: zero,
            square: zero,
            torque: zero,
            torque_size: zero,
            moved_size: zero,
            inertial: zero,
            largest: zero,
            share: zero,
        }
    }

    /// The wheel has moved by `travel` since the last sample.
    pub fn interval(&self, works: &mut Works<F>, travel: F) -> Interval<F> {
        let speed = travel / self.period;
        let torque = works.commands[0] + self.late * (works.commands[1] - works.commands[0]);
        let slides =
            speed.if_above(F::ZERO, self.friction, F::ZERO) - (-speed).if_above(F::ZERO, self.friction, F::ZERO);
        // At rest friction balances the torque, up to its level.
        let dry = if speed == F::ZERO { torque.within(self.friction) } else { slides };
        let (before, other) = (works.velocity, works.other);
        works.velocity += self.fresh * (speed - before);
        works.other += self.fresh * (torque - self.damping * speed - dry - other);
        // Newton's law from the middle of one interval to that of the next: the torque that motor, damping and friction do not explain is
        // the hand's. Every part has the same smoothing.
        let (mean, moved) = (F::HALF * (before + works.velocity), F::HALF * (other + works.other));
        let inertial = self.inertia * (works.velocity - before) / self.period;
        let hand = inertial - moved;
        works.torque += self.grasped * (hand - works.torque);
        works.torque_size += self.grasped * (hand.abs() - works.torque_size);
        works.moved_size += self.grasped * (moved.abs() - works.moved_size);
        works.largest -= works.largest * self.faded;
        works.inertial += self.grasped * (inertial - works.inertial);
        let others = works.inertial.abs() + (self.damping * mean).abs() + dry.abs();
        works.largest = if others > works.largest { others } else { works.largest };
        works.hand += self.averaged * (hand * mean - works.hand);
        works.size += self.averaged * ((moved * mean).abs() - works.size);
        works.square += self.averaged * (mean * mean - works.square);
        Interval { velocity: works.velocity, work: torque * travel, hand: hand * mean * self.period }
    }

    /// The damping, N·m·s/rad, that does as much work as the hand does, of either sign.
    fn resists(works: &Works<F>) -> F {
        let work = works.hand.abs() - F::from_f64(ERRORS[1]) * works.size;
        if work > F::ZERO { work / (works.square + F::from_f64(REST * REST)) } else { F::ZERO }
    }

    /// The part of a remedy against this lack of damping that remains with a hand on the wheel. A hand replaces the remedy where it does as
    /// much work as the damping would, or holds a torque that the motion does not explain.
    pub fn leaves(&self, works: &mut Works<F>, lacking: F) -> F {
        let most = F::ONE + F::HALF;
        let works_alike = within((Self::resists(works) / lacking).finite_or_zero(), F::ZERO, most);
        let [least, more] = HOLDS.map(F::from_f64);
        let beyond = ((works.torque.abs() - self.count_torque) / works.largest).finite_or_zero() - least;
        let holds = within(beyond / more, F::ZERO, most);
        let now = if holds > works_alike { holds } else { works_alike };
        let [slow, fast] = self.kept;
        works.share = works.share * if works.torque_size > least * works.moved_size { slow } else { fast };
        works.share = if now > works.share { now } else { works.share };
        within(F::ONE + F::from_f64(ERRORS[0]) - works.share, F::ZERO, F::ONE)
    }
}
