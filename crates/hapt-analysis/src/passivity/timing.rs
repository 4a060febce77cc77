//! Bounds of the required damping for every pattern of sample intervals and delays (docs/theory.md, (T40) to (T46)).
//!
//! The motor holds the torque τ_k of sample k from its arrival s_k on, at most `delay` after the sample at t_k. δ_k = z_{k+1} - z_k,
//! and ε_k is the displacement of the puck from t_k to s_k. The world takes steps of its period T, whatever the intervals are. Intervals
//! are at most `longest`, L.
//!
//! **Every linear loop without delay.** The work of the motor is Σ τ_k δ_k. That does not depend on the intervals, since τ_k depends only
//! on the samples. The damping takes b δ_k²/L at least. With the even requirement b₀, Σ τ_k δ_k ≤ b₀/T Σ δ_k², so that b ≥ b₀ L/T is
//! enough. A constant interval of L needs it.
//!
//! **Position laws**, with slopes within ±K, do work beyond the change of their energy of at most K (δ²/2 + |δ before| |ε|). With
//! even samples and delays up to D, none longer than the period, the damping takes b (ε²/D + (δ - ε)²/(L - D)) at least.
//! The larger eigenvalue of the forms is the bound of a delay that stays at D, a = D/L:
//!
//! ```text
//! b = (K L/4) (q + √(q² + 4a (1 - a))),    q = 1 + 2a
//! ```
//!
//! **Position laws and a motor that lags** with a time constant τ, without delay. Let v' be the velocity through the lag backwards
//! in time, v' - τ v̇' = v, and z' its position. The work of the lagged torque along z is that of the held one along z', and
//! z = z' - τ v'. It exceeds the change of energy by at most K (δ'²/2 + τ |v'(t_k)| |δ'|). Since ∫v² = ∫(v'² + τ² v̇'²), in each
//! interval the form is bounded by the Gram matrix of the functionals ∫v' and v'(t_k), (L, 1; 1, coth(L/τ)/τ):
//!
//! ```text
//! b = (K/2) (L/2 + τ + √(L²/4 + L τ (1 + coth(L/τ))))
//! ```
//!
//! **In all cases**, delays longer than an interval included, |z(t) - z_k| of the command in force is at most the path since the newest
//! sample that is older than D. The path since t - D requires K D, the rest at most 2L/π (Wirtinger), a lag at most τ: b = K (2L/π + D +
//! τ).
//!
//! **Dampers at the puck** add (B/T) √(L (L + D - least delay)): the held velocity is |δ before|/T for L + D - least delay at most.
//!
//! **Every linear loop with a delay** within [D_min, D], no longer than the period, at even samples: `required::late_requirement`, (T43).
//!
//! **A lag that is known to ± Δτ**, at even samples and a fixed delay: two lags differ in their work by at most
//! Δτ h √(x coth x), x = T/(2 τ), τ the least.

use std::f64::consts::PI;

use hapt_model::World;

use crate::equations::delay::Delay;
use crate::error::Error;

/// The times of a loop within which its passivity is claimed, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    pub period: f64,
    /// Whether every interval is the period. Otherwise intervals are any up to `longest`, as short as they may be.
    pub has_even_samples: bool,
    /// The longest interval between two samples.
    pub longest: f64,
    /// The least and the largest delay.
    pub delay: [f64; 2],
    /// The least and the largest time constant of the motor.
    pub lag: [f64; 2],
}

/// x coth x, 1 at 0.
fn x_coth(x: f64) -> f64 {
    if x < 1e-8 { 1.0 } else { x / x.tanh() }
}

impl Timing {
    /// All that the file allows.
    pub fn of(world: &World) -> Timing {
        let sampling = &world.sampling;
        Timing {
            period: sampling.period,
            has_even_samples: sampling.interval_max.is_none(),
            longest: sampling.interval_max_s(),
            delay: [sampling.delay_s(), sampling.delay_max_s()],
            lag: world.device.lag_range(),
        }
    }

    /// Even samples, one delay and one lag.
    pub fn even(world: &World) -> Timing {
        let (sampling, lag) = (&world.sampling, world.device.lag);
        let (period, delay) = (sampling.period, sampling.delay_s());
        Timing { period, has_even_samples: true, longest: period, delay: [delay, delay], lag: [lag, lag] }
    }

    /// Whether the intervals are even and the delay is one number.
    pub fn is_even(&self) -> bool {
        self.has_even_samples && self.delay[0] == self.delay[1]
    }

    /// The least and the largest interval, s.
    pub fn intervals(&self) -> [f64; 2] {
        [if self.has_even_samples { self.period } else { 0.0 }, self.longest]
    }

    /// Whether the torque changes at the sample.
    pub fn is_at_once(&self) -> bool {
        self.delay[1] == 0.0 && self.lag[1] == 0.0
    }

    /// Whether every command arrives before the next sample.
    pub fn arrives_in_time(&self) -> bool {
        self.delay[1] == 0.0 || self.has_even_samples && self.delay[1] <= self.period
    }

    /// The bound for position laws at the puck with slopes within ±`stiffness` and dampers with a sum of `damping`.
    ///
    /// # Errors
    /// [`Error::InFlight`].
    pub fn of_laws(&self, [stiffness, damping]: [f64; 2]) -> Result<f64, Error> {
        let Timing { period, longest, delay: [least, delay], lag: [_, lag], .. } = *self;
        let mut per_stiffness = 2.0 * longest / PI + delay + lag;
        if lag == 0.0 && self.arrives_in_time() {
            let (a, q) = (delay / longest, 1.0 + 2.0 * delay / longest);
            per_stiffness = per_stiffness.min(0.25 * longest * (q + (q * q + 4.0 * a * (1.0 - a)).sqrt()));
        }
        if lag > 0.0 && delay == 0.0 {
            let root = 0.25 * longest * longest + longest * lag + lag * lag * x_coth(longest / lag);
            per_stiffness = per_stiffness.min(0.5 * (0.5 * longest + lag + root.sqrt()));
        }
        let bound = stiffness * per_stiffness + damping / period * (longest * (longest + delay - least)).sqrt();
        if lag > 0.0 || !self.is_even() {
            return Ok(bound);
        }
        // One delay: the fraction of a sample requires the same damping as in the linear loop.
        let Delay { samples, fraction } = Delay::of(delay, period)?;
        let even = period * stiffness * (0.5 + samples as f64 + fraction) + damping;
        Ok(0.5 * (even + even.hypot((fraction * (1.0 - fraction)).sqrt() * period * stiffness)))
    }

    /// What a lag that is known to ± (largest - least)/2 adds, at even samples; `None` where it may be 0.
    pub fn of_lag(&self, gain: f64) -> Option<f64> {
        let [least, most] = self.lag;
        (least > 0.0).then(|| 0.5 * (most - least) * gain * x_coth(0.5 * self.period / least).sqrt())
    }
}
