//! The sign test at start-up: three stretches of n samples, without torque, under a pulse, and under its opposite.
//!
//! The pulse moves a free puck, and its opposite brings it to rest again. Its drift before the pulse is subtracted:
//!
//! ```text
//! moved = d₁ - d₀
//! ```
//!
//! n is chosen so that a free puck, with its damping and friction, moves by twelve counts. Three counts are more than rounding can cause
//! (two), and less than that is no motion: the encoder is absent, or a hand is in the way.

use crate::supervisor::{Limits, Reason};
use crate::{Constants, Real, Spec};

/// How far a pulse should move the puck where there are no counts, in rad or m.
const FAR: f64 = 1e-3;
/// The longest that a stretch may be, in s.
const MAX_STRETCH_S: f64 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Pulse<F> {
    pub torque: F,
    samples: u32,
    /// The samples that the motor is behind.
    delay: u32,
    /// The least motion that counts.
    least: F,
}

/// The state of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Testing<F> {
    sample: u32,
    /// Where the puck was when each stretch began.
    marks: [F; 3],
}

/// The outcome of a sample of the test.
pub(crate) enum SignTest<F> {
    /// Not yet decided: command this torque.
    Torque(F),
    /// The puck moves the right way.
    Right,
    /// The puck does not move the right way.
    Wrong(Reason),
}

impl<F: Real> Testing<F> {
    pub const BEGIN: Self = Testing { sample: 0, marks: [F::ZERO; 3] };
}

impl<F: Real> Pulse<F> {
    /// `None` where there is to be no test, or where the pulse cannot move the puck.
    pub fn new(limits: &Limits, spec: &Spec) -> Option<Self> {
        let period = spec.period;
        let far = spec.count.map_or(FAR, |count| 12.0 * count);
        // Backward Euler is near enough.
        let push = period * (limits.pulse - limits.friction) / limits.inertia;
        let drag = 1.0 + period * limits.damping / limits.inertia;
        let (mut samples, mut travel, mut velocity) = (0, 0.0, 0.0);
        while travel < far && (samples < 2 || f64::from(samples) * period < MAX_STRETCH_S) {
            velocity = (velocity + push) / drag;
            travel += velocity * period;
            samples += 1;
        }
        let delay = libm::ceil(limits.delay / period - 1e-6);
        let least = 0.25 * far;
        (limits.pulse > 0.0 && travel > 2.0 * least).then(|| Pulse {
            torque: F::from_f64(limits.pulse),
            samples: samples.max(2),
            delay: delay as u32,
            least: F::from_f64(least),
        })
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        to.number("pulse_torque", "of the sign test", self.torque.to_f64());
        to.whole("pulse_samples", "of each of its stretches", i64::from(self.samples));
        to.whole("pulse_delay", "samples that the motor is behind", i64::from(self.delay));
        to.number("pulse_least", "the least motion that counts", self.least.to_f64());
    }

    pub fn sample(&self, testing: &mut Testing<F>, position: F) -> SignTest<F> {
        let (now, n) = (testing.sample, self.samples);
        testing.sample = now.saturating_add(1);
        // The torque that acts on the puck was commanded `delay` samples ago.
        let acting = now.saturating_sub(self.delay);
        let [start, pulse, back] = testing.marks;
        if now == 0 {
            testing.marks = [position; 3];
        } else if acting == n {
            testing.marks = [start, position, position];
        } else if acting == n.saturating_mul(2) {
            testing.marks = [start, pulse, position];
        } else if acting >= n.saturating_mul(3) {
            // Not before: after either direction, the opposite has brought it to rest.
            let moved = (back - pulse) - (pulse - start);
            return if moved > self.least {
                SignTest::Right
            } else if moved < -self.least {
                SignTest::Wrong(Reason::Reversed)
            } else {
                SignTest::Wrong(Reason::Stuck)
            };
        }
        SignTest::Torque(if now < n || now >= n.saturating_mul(3) {
            F::ZERO
        } else if now < n.saturating_mul(2) {
            self.torque
        } else {
            -self.torque
        })
    }
}
