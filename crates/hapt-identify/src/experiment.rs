//! The experiment on a device: a small torque that steps in both directions, and then a chirp.
//!
//! It does not depend on the position, so that it stays the same when the motor's sign or the encoder's counts are wrong. No torque is held
//! for long enough to bring the puck up to more than a given speed.

use std::f64::consts::{PI, TAU};

/// Lengths of the steps, s: together they reach from 2 Hz to 20 Hz; the list repeats.
const LENGTHS: [f64; 12] = [0.12, 0.24, 0.18, 0.09, 0.13, 0.05, 0.07, 0.03, 0.05, 0.04, 0.025, 0.06];
/// The sizes of the steps: none is the negative of the one before it, so that the record separates friction from damping.
const SIZES: [f64; 12] = [1.0, -0.9, 0.7, -1.0, 0.0, 0.8, -1.0, 1.0, -0.7, 0.9, -0.8, 0.5];
/// The steps have this part of the time, the chirp the rest.
const STEPS: f64 = 0.6;
/// The chirp begins at this frequency in Hz, or higher where a swing of it would be too fast,
const SLOWEST: f64 = 1.0;
/// and ends where a swing has this many pushes.
const PUSHES_A_SWING: f64 = 8.0;

/// A push fades to the next in this many s, or samples where those are longer.
const FADE: f64 = 5e-3;
const FADE_SAMPLES: f64 = 4.0;
/// The largest change of the velocity by a push, rad/s (linear: m/s).
const FASTEST: [f64; 2] = [25.0, 1.0];

/// A torque in N·m (N), held for this many s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// The torque, in N·m (N).
    pub torque: f64,
    /// Its duration, in s.
    pub length: f64,
}

/// The limits of an experiment on a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The largest torque, in N·m (linear: N).
    pub torque: f64,
    /// In rad/s (m/s): no push, and no swing of the chirp, changes the velocity by more, as far as the inertia is right.
    pub speed: f64,
    /// An estimate of the inertia, in kg·m² (kg).
    pub inertia: f64,
    /// The time of the transition from one torque to the next, in s; no push is shorter than two of these.
    pub fade: f64,
}

impl Bounds {
    /// The usual bounds for a loop of this period in s: fades of 5 ms or four samples, no faster than 25 rad/s (linear: 1 m/s).
    pub fn new(torque: f64, inertia: f64, period: f64, is_linear: bool) -> Self {
        Bounds { torque, inertia, speed: FASTEST[usize::from(is_linear)], fade: FADE.max(FADE_SAMPLES * period) }
    }

    /// The experiment, push by push, for `duration` s.
    pub fn pushes(&self, duration: f64) -> Vec<Push> {
        let Some((low, high)) = self.chirp() else { return self.steps(duration) };
        let mut pushes = self.steps(STEPS * duration);
        let length = self.shortest();
        let count = ((1.0 - STEPS) * duration / length).floor();
        let over = count * length;
        // The middle of a push stands for all of it.
        let at = |i: usize| (i as f64 + 0.5) * length;
        let turns = |t: f64| low * t + 0.5 * (high - low) / over * t * t;
        pushes.extend((0..count as usize).map(|i| Push { torque: self.torque * (TAU * turns(at(i))).sin(), length }));
        pushes
    }

    /// The chirp's first and last frequency in Hz, its amplitude being the largest torque; `None` where the loop is too slow for one.
    pub fn chirp(&self) -> Option<(f64, f64)> {
        // A sine of torque that begins at a rest takes the velocity from 0 to 2 τ/(2π f J).
        let low = SLOWEST.max(self.torque / (PI * self.inertia * self.speed));
        let high = (PUSHES_A_SWING * self.shortest()).recip();
        (low < 0.5 * high).then_some((low, high))
    }

    fn shortest(&self) -> f64 {
        2.0 * self.fade
    }

    fn steps(&self, duration: f64) -> Vec<Push> {
        let longest = self.speed * self.inertia / self.torque;
        let mut pushes = Vec::new();
        let mut left = duration;
        for (i, (length, size)) in LENGTHS.into_iter().zip(SIZES).cycle().enumerate() {
            if left <= 0.0 {
                break;
            }
            // Each round has the opposite sign of the one before it, so that the puck comes back.
            let sign = if (i / SIZES.len()).is_multiple_of(2) { 1.0 } else { -1.0 };
            let length = length.min(longest).max(self.shortest());
            pushes.push(Push { torque: sign * size * self.torque, length });
            left -= length;
        }
        pushes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn no_push_asks_for_more_than_it_may_and_none_lasts_too_long(
            torque in 1e-3..2.0f64, inertia in 1e-5..1e-1f64, speed in 1.0..50.0f64, fade in 1e-3..0.2f64, duration in 1.0..60.0f64,
        ) {
            let bounds = Bounds { torque, speed, inertia, fade };
            let pushes = bounds.pushes(duration);
            let total: f64 = pushes.iter().map(|push| push.length).sum();
            prop_assert!(total > 0.9 * duration - 4.0 * fade && total < duration + 0.24 + 4.0 * fade, "{total} of {duration}");
            for push in &pushes {
                prop_assert!(push.torque.abs() <= torque && push.length >= 2.0 * fade * (1.0 - 1e-12), "{push:?}");
                let gained = push.torque.abs() * push.length / inertia;
                // A push is longer than the speed allows only where the loop's period requires it.
                prop_assert!(gained <= speed * (1.0 + 1e-9) || push.length <= 2.0 * fade * (1.0 + 1e-12), "{push:?}: {gained}");
            }
            // Without friction and damping the chirp's velocity stays within the bound, from where it begins.
            if bounds.chirp().is_some() {
                let steps = bounds.steps(STEPS * duration).len();
                let mut velocity = 0.0;
                for push in &pushes[steps..] {
                    velocity += push.torque * push.length / inertia;
                    prop_assert!(f64::abs(velocity) <= 1.1 * speed, "{velocity} of {speed}");
                }
            }
        }
    }

    #[test]
    fn a_chirp_goes_through_its_band_from_below() {
        let bounds = Bounds { torque: 0.08, speed: 25.0, inertia: 6.4e-4, fade: 5e-3 };
        let (low, high) = bounds.chirp().unwrap();
        assert!((low - 0.08 / (PI * 6.4e-4 * 25.0)).abs() < 1e-12 && (high - 12.5).abs() < 1e-12, "{low} to {high} Hz");
        let chirp = &bounds.pushes(10.0)[bounds.steps(6.0).len()..];
        // Between two changes of sign there is half a swing: at the beginning a long one, at the end a short one.
        let crossings: Vec<usize> = chirp
            .windows(2)
            .enumerate()
            .filter(|(_, pair)| pair[0].torque * pair[1].torque < 0.0)
            .map(|(i, _)| i)
            .collect();
        let half = |i: usize| (crossings[i + 1] - crossings[i]) as f64 * 0.01;
        let (first, last) = (half(0), half(crossings.len() - 2));
        assert!(first > 0.15 && first < 0.5 / low && (last - 0.5 / high).abs() < 0.011, "{first} s, {last} s");
        assert!((crossings.len() as f64 - (low + high) * 4.0).abs() < 2.0, "{}", crossings.len());
        // A loop too slow for one makes steps only.
        assert_eq!(Bounds { fade: 0.4, ..bounds }.chirp(), None);
    }
}
