//! The energy that the free wheel's swings gain, for any law of the host. A car that responds to the steering closes a second loop inside
//! the game, and its torque is not a law of one old position.
//!
//! Where the host's level passes through 0 its spring is relaxed, whether a hand holds the wheel or not. From one such place to the next
//! the work of the motor is the energy that the swing gains, W = c ∫ ż² dt: the host reduces the damping by c, and a device with more
//! damping swings less. The damping that was added meanwhile is known, and therefore c of the host by itself. The work of a hand from one
//! such place to the next is subtracted from W.

use super::hand::Interval;
use crate::Real;

/// A swing below this speed, rad/s, counts as rest, and so does one below this part of the fastest recent one: kerbs shake a wheel that
/// turns round.
const SLOWEST: f64 = 0.1;
const PART: f64 = 0.3;
/// The fastest recent speed fades with this time constant, s.
const LATE: f64 = 1.0;
/// Levels are smoothed over this, s: kerbs shake them.
const SMOOTH: f64 = 3e-3;

/// Sums since the middle of the swing before: a sum over hours would lose what a swing adds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums<F> {
    /// The work of the motor and of a hand, J.
    work: F,
    hand: F,
    /// ∫ ż² dt; of the damping that was added, and of the part of the level that was held back, times ż².
    square: F,
    damping: F,
    held_back: F,
}

/// The place in a swing where the host's level is nearest to 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Middle<F> {
    velocity: F,
    /// The size of the level there, N·m.
    tension: F,
    until: Sums<F>,
}

/// The state of the swings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Swings<F> {
    sums: Sums<F>,
    middle: Middle<F>,
    /// The smoothed level, N·m.
    level: F,
    /// The speed in the middle of the swing before, rad/s.
    before: Option<F>,
    fastest: F,
    takes: F,
}

impl<F: Real> Swings<F> {
    pub fn start() -> Self {
        let zero = F::ZERO;
        let sums = Sums { work: zero, hand: zero, square: zero, damping: zero, held_back: zero };
        let middle = Middle { velocity: zero, tension: F::from_f64(f64::INFINITY), until: sums };
        Swings { sums, middle, level: zero, before: None, fastest: zero, takes: zero }
    }

    /// The damping that the host takes from the wheel, N·m·s/rad: the largest of the last swings, where each counts half after the next
    /// one. Zero or more.
    pub fn takes(&self) -> F {
        self.takes
    }

    /// A sample, with the host's level, the damping that was added in the last interval and the part of the level that was held back.
    pub fn sample(&mut self, period: F, interval: &Interval<F>, level: F, damping: F, held_back: F) {
        let &Interval { velocity, work, hand } = interval;
        let square = velocity * velocity * period;
        let sums = &mut self.sums;
        sums.work += work;
        sums.hand += hand;
        sums.square += square;
        sums.damping += damping * square;
        sums.held_back += held_back * square;
        self.level += (level - self.level) * (period / (period + F::from_f64(SMOOTH)));
        let (speed, before) = (velocity.abs(), self.middle.velocity.abs());
        self.fastest -= self.fastest * (period * F::from_f64(1.0 / LATE));
        self.fastest = if speed > self.fastest { speed } else { self.fastest };
        let slowest = F::from_f64(SLOWEST);
        if velocity * self.middle.velocity < F::ZERO && speed > F::from_f64(0.1) * slowest {
            if before > slowest && before > F::from_f64(PART) * self.fastest {
                self.turned();
            }
            (self.middle.velocity, self.middle.tension) = (F::ZERO, F::from_f64(f64::INFINITY));
        }
        let tension = self.level.abs();
        if speed <= slowest || tension >= self.middle.tension {
            return;
        }
        self.middle = Middle { velocity, tension, until: self.sums };
        // Faster than in the swing before: it has already gained energy.
        if self.before.is_some_and(|before| speed > before) {
            let takes = self.middle.until.takes();
            self.takes = if takes > self.takes { takes } else { self.takes };
        }
    }

    /// The wheel turns round: a swing is over.
    fn turned(&mut self) {
        let Middle { velocity, until, .. } = self.middle;
        self.sums = self.sums.since(&until);
        if self.before.replace(velocity.abs()).is_some() {
            let (takes, kept) = (until.takes(), F::HALF * self.takes);
            self.takes = if takes > kept { takes } else { kept };
        }
    }
}

impl<F: Real> Sums<F> {
    fn since(&self, before: &Self) -> Self {
        Sums {
            work: self.work - before.work,
            hand: self.hand - before.hand,
            square: self.square - before.square,
            damping: self.damping - before.damping,
            held_back: self.held_back - before.held_back,
        }
    }

    /// The damping that the host took in this swing.
    fn takes(&self) -> F {
        let gained = self.work - self.hand.abs() + self.damping;
        (gained / (self.square - self.held_back)).finite_or_zero()
    }
}
