//! A texture: a periodic torque without a mean, as a Fourier sum.
//!
//! With θ = 2π(q - phase)/pitch the torque is torque · Σ (sineₙ sin nθ + cosineₙ cos nθ), n from 1 to [`HARMONICS`]. It is -V' of
//! V = torque · pitch/2π · Σ (sineₙ cos nθ - cosineₙ sin nθ + √(sineₙ² + cosineₙ²))/n, which is nowhere negative. The mean of each harmonic
//! over a displacement is its value in the middle times sin(a)/a, with a half of the displacement as an angle of that harmonic.

use core::array::from_fn;

use crate::contact::{Solution, StepResponse, solve_nearest};
use crate::lanes::each;
use crate::law::reduced;
use crate::{Lanes, Number, Real};

/// Harmonics of a texture: every coupling stores this many, also on boards.
pub const HARMONICS: usize = 4;

/// One period of a texture as a Fourier sum without a mean: Σ (sineₙ sin nθ + cosineₙ cos nθ), θ from 0 to 2π. Its factors are f32: a
/// board of 32 KiB holds several copies of every coupling while it compiles a world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Waveform {
    /// Of sin θ, sin 2θ, and so on.
    pub sine: [f32; HARMONICS],
    /// Of cos θ, cos 2θ, and so on.
    pub cosine: [f32; HARMONICS],
}

impl Waveform {
    /// sin θ
    pub const SINE: Waveform = {
        let mut sine = [0.0; HARMONICS];
        sine[0] = 1.0;
        Waveform { sine, cosine: [0.0; HARMONICS] }
    };

    /// The harmonics: n, and the factors of sin nθ and cos nθ.
    pub fn harmonics(&self) -> impl Iterator<Item = (f64, f64, f64)> + Clone + use<> {
        self.sine
            .into_iter()
            .zip(self.cosine)
            .enumerate()
            .map(|(i, (sine, cosine))| ((i + 1) as f64, f64::from(sine), f64::from(cosine)))
    }

    /// Its value at an angle.
    pub fn at(&self, angle: f64) -> f64 {
        self.harmonics().map(|(n, sine, cosine)| sine * libm::sin(n * angle) + cosine * libm::cos(n * angle)).sum()
    }

    /// A bound on its slope in 1/rad, of either sign: the steepest slopes of its harmonics, added.
    pub fn slope(&self) -> f64 {
        self.harmonics().map(|(n, sine, cosine)| n * libm::hypot(sine, cosine)).sum()
    }

    /// Whether it is 0 everywhere.
    pub fn is_zero(&self) -> bool {
        self.sine.iter().chain(&self.cosine).all(|x| *x == 0.0)
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Texture<F> {
    pub pitch: F,
    pub phase: F,
    /// Times the torque, as the cosines.
    pub sine: [F; HARMONICS],
    pub cosine: [F; HARMONICS],
}

/// The energy that it stores at q.
pub(super) fn energy(torque: f64, pitch: f64, phase: f64, waveform: &Waveform, q: f64) -> f64 {
    let angle = core::f64::consts::TAU * (q - reduced(phase, pitch)) / pitch;
    let of = |(n, sine, cosine): (f64, f64, f64)| {
        let swing = sine * libm::cos(n * angle) - cosine * libm::sin(n * angle);
        (libm::hypot(sine, cosine) + swing) / n
    };
    torque * pitch / core::f64::consts::TAU * waveform.harmonics().map(of).sum::<f64>()
}

impl<F: Number> Texture<F> {
    #[inline(always)]
    pub fn torque(&self, q: F) -> F {
        self.sum(self.turns(q), |_| F::ONE).0
    }

    /// q from the nearest whole period, in periods.
    #[inline(always)]
    fn turns(&self, q: F) -> F {
        let turns = (q - self.phase) / self.pitch;
        turns - (turns + F::HALF).floor()
    }

    #[inline(always)]
    fn harmonics(&self) -> impl Iterator<Item = (F, F, F)> {
        let factors = self.sine.into_iter().zip(self.cosine);
        factors.scan(F::ZERO, |n, (sine, cosine)| {
            *n += F::ONE;
            Some((*n, sine, cosine))
        })
    }

    /// The sum of the harmonics at `turns`, each times its share, and its derivative by q.
    #[inline(always)]
    fn sum(&self, turns: F, share: impl Fn(F) -> F) -> (F, F) {
        let tau = F::from_f64(core::f64::consts::TAU);
        let (sine, cosine) = unit(turns);
        let (mut s, mut c) = (sine, cosine);
        let (mut sum, mut slope) = (F::ZERO, F::ZERO);
        for (n, of_sine, of_cosine) in self.harmonics() {
            let share = share(n);
            sum += (of_sine * s + of_cosine * c) * share;
            slope += n * (of_sine * c - of_cosine * s);
            (s, c) = (s * cosine + c * sine, c * cosine - s * sine);
        }
        (sum, slope * (tau / self.pitch))
    }
}

impl<F: Real> Texture<F> {
    pub fn new(torque: f64, pitch: f64, phase: f64, waveform: &Waveform) -> Self {
        let scaled = |factors: [f32; HARMONICS]| factors.map(|factor| F::from_f64(torque * f64::from(factor)));
        Texture {
            pitch: F::from_f64(pitch),
            phase: F::from_f64(reduced(phase, pitch)),
            sine: scaled(waveform.sine),
            cosine: scaled(waveform.cosine),
        }
    }

    /// The torque that keeps its energy over a step, at the solution nearest to the free motion.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let from = self.turns(response.start);
        let response = &StepResponse { start: from * self.pitch, ..*response };
        let (most, steepest) = self.sizes();
        // A mean torque changes by at most half of the steepest slope.
        let turn = response.compliance * steepest * F::from_f64(core::f64::consts::PI) / self.pitch;
        solve_nearest(response, most, (turn, turn), self.fine(), |distance| self.mean(from, distance))
    }

    /// The distance within which two solutions count as one.
    pub fn fine(&self) -> F {
        self.pitch * F::from_f64(1.0 / (64.0 * HARMONICS as f64))
    }

    /// A bound on the torque, and one on the slope of its mean over a displacement.
    pub fn bounds(&self) -> (F, F) {
        let (most, steepest) = self.sizes();
        (most, steepest * F::from_f64(core::f64::consts::PI) / self.pitch)
    }

    /// The harmonics' sizes, and those times their numbers.
    fn sizes(&self) -> (F, F) {
        let (mut most, mut steepest) = (F::ZERO, F::ZERO);
        for (n, sine, cosine) in self.harmonics() {
            // A harmonic is at most |sine| + |cosine|.
            let size = sine.abs() + cosine.abs();
            most += size;
            steepest += n * size;
        }
        (most, steepest)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        -self.mean(self.turns(start), distance).0
    }

    /// The mean torque over `distance` from `from` periods, and its derivative by `distance`.
    fn mean(&self, from: F, distance: F) -> (F, F) {
        let half = F::HALF * (distance / self.pitch);
        let angle = F::from_f64(core::f64::consts::TAU) * half;
        let share = |n: F| {
            let angle = n * angle;
            if angle == F::ZERO { F::ONE } else { angle.sin() / angle }
        };
        let (mean, slope) = self.sum(from + half, share);
        if half.abs() > F::from_f64(1.0 / (64.0 * HARMONICS as f64)) {
            let end = self.sum(from + half + half, |_| F::ONE).0;
            (mean, (end - mean) / distance)
        } else {
            // Half of the slope in the middle.
            (mean, F::HALF * slope)
        }
    }
}

impl<const N: usize> Texture<Lanes<N>> {
    /// N textures.
    pub fn side_by_side(textures: [Texture<f64>; N]) -> Self {
        Texture {
            pitch: each(&textures, &|texture| texture.pitch),
            phase: each(&textures, &|texture| texture.phase),
            sine: from_fn(|n| each(&textures, &|texture| texture.sine[n])),
            cosine: from_fn(|n| each(&textures, &|texture| texture.cosine[n])),
        }
    }
}

/// Sine and cosine of an angle in turns.
#[inline(always)]
fn unit<F: Number>(turns: F) -> (F, F) {
    let tau = F::from_f64(core::f64::consts::TAU);
    // sin a quarter of a turn on is cos.
    ((tau * turns).sin(), (tau * (turns + F::HALF * F::HALF)).sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn waveform() -> impl Strategy<Value = Waveform> {
        let factors = || prop::array::uniform4(-1.0_f32..1.0);
        (factors(), factors()).prop_map(|(sine, cosine)| Waveform { sine, cosine })
    }

    proptest! {
        #[test]
        fn the_mean_torque_is_the_difference_of_the_energies_over_the_way(
            waveform in waveform(), torque in 0.01_f64..2.0, pitch in 0.01_f64..1.0, from in -3.0_f64..3.0, travel in -2.0_f64..2.0,
            power in -9_i32..1,
        ) {
            let texture = Texture::new(torque, pitch, 0.3, &waveform);
            let (start, distance) = (0.3 + from * pitch, travel * 10_f64.powi(power) * pitch);
            let mean = texture.stored_slope(start, distance);
            if distance.abs() > 1e-3 * pitch {
                let at = |q| energy(torque, pitch, 0.3, &waveform, q);
                let difference = (at(start + distance) - at(start)) / distance;
                prop_assert!((mean - difference).abs() < 1e-10 * torque, "{mean} {difference}");
            } else {
                let middle = -texture.torque(start + 0.5 * distance);
                prop_assert!((mean - middle).abs() < 1e-3 * torque, "{mean} {middle}");
            }
        }

        #[test]
        fn a_short_way_keeps_its_digits(waveform in waveform(), from in -0.5_f64..0.5, travel in 1e-12_f64..1e-9) {
            let texture: Texture<f64> = Texture::new(1.0, 1.0, 0.0, &waveform);
            prop_assert!((texture.stored_slope(from, travel) + texture.torque(from + 0.5 * travel)).abs() < 1e-13);
        }

        #[test]
        fn the_derivative_of_the_mean_is_its_slope(waveform in waveform(), from in -0.5_f64..0.5, travel in -2.0_f64..2.0) {
            let texture: Texture<f64> = Texture::new(1.0, 1.0, 0.0, &waveform);
            let (h, slope) = (1e-5, texture.mean(from, travel).1);
            let difference = (texture.mean(from, travel + h).0 - texture.mean(from, travel - h).0) / (2.0 * h);
            prop_assert!((slope - difference).abs() < 1e-6 + 0.02 * core::f64::consts::TAU * waveform.slope(), "{slope} {difference}");
        }

        #[test]
        fn the_energy_is_nowhere_negative_and_no_slope_passes_its_bound(waveform in waveform(), q in -2.0_f64..2.0) {
            prop_assert!(energy(1.0, 1.0, 0.0, &waveform, q) > -1e-12);
            let h = 1e-6;
            let slope = (waveform.at(q + h) - waveform.at(q - h)) / (2.0 * h);
            prop_assert!(slope.abs() < waveform.slope() + 1e-6);
        }

        #[test]
        fn one_falling_sine_is_a_detent(q in -2.0_f64..2.0, travel in -1.0_f64..1.0) {
            let waveform = Waveform { sine: [-1.0, 0.0, 0.0, 0.0], ..Waveform::default() };
            let texture: Texture<f64> = Texture::new(0.7, 0.4, 0.1, &waveform);
            let detent = crate::law::Detent { torque: 0.7, pitch: 0.4, phase: 0.1 };
            prop_assert!((texture.torque(q) - detent.torque(q)).abs() < 1e-12);
            prop_assert!((energy(0.7, 0.4, 0.1, &waveform, q) - detent.energy(q)).abs() < 1e-12);
            prop_assert!((texture.stored_slope(q, travel) - detent.stored_slope(q, travel)).abs() < 1e-12);
        }
    }
}
