//! What the free wheel's swings gain, whatever the host's law is. A car that answers the steering closes a second loop inside the game, and its torque is no
//! law of one old position.
//!
//! Where the wheel is fastest the torques on it cancel, and the host's spring is as good as relaxed. From one such place to the next the work of the motor is
//! what the swing gains, W = c ∫ ż² dt: the host takes the damping c, and a device that has more swings less. What was added meanwhile is known, and so is c of
//! the host alone. A hand's work, whichever way, is taken off W.

use super::hand::Interval;
use crate::Real;

/// A swing that is slower, rad/s, is rest, and so is one that is slower than this part of the fastest of late: kerbs shake a wheel that turns round.
const SLOWEST: f64 = 0.1;
const PART: f64 = 0.3;
/// The fastest of late fades with this time constant, s.
const LATE: f64 = 1.0;

/// Sums since the peak of the swing before: a sum over hours would lose what a swing adds.
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

/// The place in a swing where the wheel is fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Peak<F> {
    velocity: F,
    until: Sums<F>,
}

/// What is remembered of the swings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Swings<F> {
    sums: Sums<F>,
    peak: Peak<F>,
    /// The speed at the peak of the swing before, rad/s.
    before: Option<F>,
    fastest: F,
    takes: F,
}

impl<F: Real> Swings<F> {
    pub fn start() -> Self {
        let zero = F::ZERO;
        let sums = Sums { work: zero, hand: zero, square: zero, damping: zero, held_back: zero };
        Swings { sums, peak: Peak { velocity: zero, until: sums }, before: None, fastest: zero, takes: zero }
    }

    /// The damping that the host takes from the wheel, N·m·s/rad: of the last swings the most, each one half of itself after the next. Zero or more.
    pub fn takes(&self) -> F {
        self.takes
    }

    /// A sample, with the damping that was added in the last interval and the part of the level that was held back.
    pub fn sample(&mut self, period: F, interval: &Interval<F>, damping: F, held_back: F) {
        let &Interval { velocity, work, hand } = interval;
        let square = velocity * velocity * period;
        let sums = &mut self.sums;
        sums.work += work;
        sums.hand += hand;
        sums.square += square;
        sums.damping += damping * square;
        sums.held_back += held_back * square;
        let (speed, before) = (velocity.abs(), self.peak.velocity.abs());
        self.fastest -= self.fastest * (period * F::from_f64(1.0 / LATE));
        self.fastest = if speed > self.fastest { speed } else { self.fastest };
        let slowest = F::from_f64(SLOWEST);
        if velocity * self.peak.velocity < F::ZERO && speed > F::from_f64(0.1) * slowest {
            if before > slowest && before > F::from_f64(PART) * self.fastest {
                self.turned();
            }
            self.peak.velocity = F::ZERO;
        }
        if speed <= self.peak.velocity.abs() {
            return;
        }
        self.peak = Peak { velocity, until: self.sums };
        // Faster than the swing before: it has gained already.
        if self.before.is_some_and(|before| speed > before) {
            let takes = self.peak.until.takes();
            self.takes = if takes > self.takes { takes } else { self.takes };
        }
    }

    /// The wheel turns round: a swing is over.
    fn turned(&mut self) {
        let Peak { velocity, until } = self.peak;
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

    /// What the host took.
    fn takes(&self) -> F {
        let gained = self.work - self.hand.abs() + self.damping;
        (gained / (self.square - self.held_back)).finite_or_zero()
    }
}
