//! The puck as the loop measures it: the encoder's count and an estimated velocity (docs/contract.md, section 3, step 1).

use crate::kalman::kalman_gains;
use crate::{Error, Estimator, Number, Real, Spec};

/// The puck as the loop sees it at one sample: u_k.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Puck<F> {
    /// z_k in rad (linear: m): the count's position.
    pub position: F,
    /// v_k in rad/s (linear: m/s), by the estimator.
    pub velocity: F,
}

/// What an estimator with a model of its own makes of the positions so far.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tracked<F> {
    /// In rad (linear: m).
    pub position: F,
    /// In rad/s² (linear: m/s²).
    pub acceleration: F,
}

/// The memory of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "F: serde::Serialize", deserialize = "F: crate::Number + serde::Deserialize<'de>"))
)]
pub struct Memory<F, const W: usize> {
    /// u_{k-1}; `None` before the first sample.
    pub last: Option<Puck<F>>,
    /// y_{k-1}, where the position is filtered.
    pub filtered: F,
    /// Of `kalman`; the position of `levant`.
    pub tracked: Tracked<F>,
    /// The last counts, a ring; the newest is at `newest`. For FOAW, and positions for the difference over several samples.
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub counts: [F; W],
    /// The index of the newest.
    pub newest: usize,
    /// How many older ones there are, at most W - 1.
    pub older: usize,
}

impl<F: Number, const W: usize> Memory<F, W> {
    pub(crate) const EMPTY: Self = Memory {
        last: None,
        filtered: F::ZERO,
        tracked: Tracked { position: F::ZERO, acceleration: F::ZERO },
        counts: [F::ZERO; W],
        newest: 0,
        older: 0,
    };

    fn push(&mut self, count: F) {
        if self.last.is_some() {
            // The state may come from a caller: no sum here leaves its range.
            self.newest = (self.newest % W + 1) % W;
            self.older = (self.older.min(W - 1) + 1).min(W - 1);
        }
        if let Some(place) = self.counts.get_mut(self.newest) {
            *place = count;
        }
    }

    /// The count `age` samples ago, relative to the newest.
    fn count(&self, age: usize) -> F {
        self.then(age) - self.then(0)
    }

    /// The count `age` samples ago.
    #[inline(always)]
    pub(crate) fn then(&self, age: usize) -> F {
        self.counts.get((self.newest % W + W - age.min(W)) % W).copied().unwrap_or(F::ZERO)
    }
}

/// The encoder and the estimator's constants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensor<F> {
    pub count: Option<F>,
    pub rate: F,
    /// 1 - e^{-2π f T} of the position's filter.
    pub filter: Option<F>,
    /// `None`: the velocity is the true one.
    pub velocity: Option<Velocity<F>>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Velocity<F> {
    Difference,
    /// v_k = keep v_{k-1} + gain (z_k - z_{k-1})
    LowPass {
        keep: F,
        gain: F,
    },
    Foaw {
        window: usize,
        best: bool,
    },
    /// v_k = rate (z_k - z_{k-every}), rate = 1/(every T)
    DifferenceOver {
        every: usize,
        rate: F,
    },
    Kalman(Kalman<F>),
    Levant(Levant<F>),
}

/// The numbers of a Kalman filter of constant acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kalman<F> {
    /// T
    pub period: F,
    /// T²/2
    pub half: F,
    /// α
    pub position: F,
    /// β/T
    pub velocity: F,
    /// γ/T²
    pub acceleration: F,
}

impl<F: Number> Kalman<F> {
    #[inline(never)]
    fn new(cutoff: f64, period: f64) -> Self {
        let [position, velocity, acceleration] = kalman_gains(core::f64::consts::TAU * cutoff * period);
        Kalman {
            period: F::from_f64(period),
            half: F::from_f64(0.5 * period * period),
            position: F::from_f64(position),
            velocity: F::from_f64(velocity / period),
            acceleration: F::from_f64(acceleration / (period * period)),
        }
    }

    /// The velocity, and what is tracked, at a new position.
    #[inline(always)]
    fn step(&self, tracked: Tracked<F>, velocity: F, position: F) -> (F, Tracked<F>) {
        let Tracked { position: before, acceleration } = tracked;
        let predicted = before + self.period * velocity + self.half * acceleration;
        let error = position - predicted;
        let tracked = Tracked {
            position: predicted + self.position * error,
            acceleration: acceleration + self.acceleration * error,
        };
        (velocity + self.period * acceleration + self.velocity * error, tracked)
    }
}

/// The numbers of Levant's differentiator: λ₁ = 1.5, λ₀ = 1.1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Levant<F> {
    /// T
    pub period: F,
    /// 1/T
    pub rate: F,
    /// λ₀ L T, the largest change of the velocity in a sample
    pub change: F,
    /// λ₀ L T²
    pub reach: F,
    /// λ₁ √L T
    pub pull: F,
}

impl<F: Number> Levant<F> {
    #[inline(never)]
    fn new(acceleration: f64, period: f64) -> Self {
        let change = 1.1 * acceleration * period;
        Levant {
            period: F::from_f64(period),
            rate: F::from_f64(1.0 / period),
            change: F::from_f64(change),
            reach: F::from_f64(change * period),
            pull: F::from_f64(1.5 * libm::sqrt(acceleration) * period),
        }
    }

    /// The velocity, and the position that follows, at a new position z. With e = x_k - z_k, of the prediction e₀ = x_{k-1} + T v_{k-1} - z_k:
    ///
    /// ```text
    /// e + λ₁ √L T √|e| sgn e + λ₀ L T² s = e₀,    v_k = v_{k-1} - λ₀ L T s,    s in sgn e, from -1 to 1 at e = 0
    /// ```
    ///
    /// So e = 0 and v_k = (z_k - x_{k-1})/T while |e₀| ≤ λ₀ L T²; beyond, √|e| solves a quadratic equation.
    #[inline(always)]
    fn step(&self, before: F, velocity: F, position: F) -> (F, F) {
        let error = before + self.period * velocity - position;
        let beyond = error.abs() - self.reach;
        let rest = beyond.if_above(F::ZERO, beyond, F::ZERO);
        let sign = error.if_above(F::ZERO, F::ONE, -F::ONE);
        let two = F::ONE + F::ONE;
        let root = two * rest / (self.pull + (self.pull * self.pull + two * two * rest).sqrt());
        let within = (position - before) * self.rate;
        let velocity = beyond.if_above(F::ZERO, velocity - sign * self.change, within);
        (velocity, position + sign * root * root)
    }
}

impl<F: Number> Sensor<F> {
    pub fn new<const W: usize>(spec: &Spec) -> Result<Self, Error> {
        const { assert!(W > 0, "a loop remembers one count at least") }
        if let Some(count) = spec.count {
            Error::check_positive("count", count)?;
        }
        let foaw = |window: u32, best| match window {
            0 => Err(Error::Value { what: "window", given: 0.0, wanted: "positive" }),
            // Without counts there is no noise to average: n = 1.
            _ if spec.count.is_none() => Ok(Velocity::Difference),
            _ if window as usize >= W => Err(Error::WindowTooLong { given: window, room: W }),
            _ => Ok(Velocity::Foaw { window: window as usize, best }),
        };
        if let Some(filter) = spec.filter {
            Error::check_positive("filter", filter)?;
        }
        let gain = |filter: f64| F::from_f64(-libm::expm1(-core::f64::consts::TAU * filter * spec.period));
        let velocity = match spec.estimator {
            Estimator::Exact => None,
            Estimator::Difference => Some(Velocity::Difference),
            Estimator::LowPass { cutoff } => {
                Error::check_positive("cutoff", cutoff)?;
                let tau = 1.0 / (core::f64::consts::TAU * cutoff);
                let sum = tau + spec.period;
                Some(Velocity::LowPass { keep: F::from_f64(tau / sum), gain: F::from_f64(1.0 / sum) })
            }
            Estimator::Foaw { window } => Some(foaw(window, false)?),
            Estimator::FoawBest { window } => Some(foaw(window, true)?),
            Estimator::DifferenceOver { every } => Some(match every {
                0 => return Err(Error::Value { what: "every", given: 0.0, wanted: "positive" }),
                1 => Velocity::Difference,
                _ if every as usize >= W => return Err(Error::WindowTooLong { given: every, room: W }),
                _ => {
                    let rate = F::from_f64(1.0 / (f64::from(every) * spec.period));
                    Velocity::DifferenceOver { every: every as usize, rate }
                }
            }),
            Estimator::Kalman { cutoff } => {
                Error::check_positive("cutoff", cutoff)?;
                Some(Velocity::Kalman(Kalman::new(cutoff, spec.period)))
            }
            Estimator::Levant { acceleration } => {
                Error::check_positive("acceleration", acceleration)?;
                Some(Velocity::Levant(Levant::new(acceleration, spec.period)))
            }
        };
        Ok(Sensor {
            count: spec.count.map(F::from_f64),
            rate: F::from_f64(1.0 / spec.period),
            filter: spec.filter.map(gain),
            velocity,
        })
    }

    /// z_k from the puck's true position; the memory moves on by one sample, except for its `last`.
    #[inline(always)]
    pub fn position<const W: usize>(&self, memory: &mut Memory<F, W>, position: F) -> F {
        let position = match self.count {
            None => position,
            Some(size) => {
                let count = nearest(position, size);
                if let Some(Velocity::Foaw { .. }) = self.velocity {
                    memory.push(count);
                }
                count * size
            }
        };
        if let Some(Velocity::DifferenceOver { .. }) = self.velocity {
            memory.push(position);
        }
        position
    }

    /// The world's origin is placed: the puck is seen at `now` in place of `before`, with the same displacements before.
    pub fn place<const W: usize>(&self, memory: &mut Memory<F, W>, before: F, now: F) {
        let Some(last) = &mut memory.last else { return };
        let counts = self.count.map(|size| nearest(now, size) - nearest(before, size));
        let travel = match (self.count, counts) {
            (Some(size), Some(counts)) => counts * size,
            _ => now - before,
        };
        last.position += travel;
        memory.filtered += travel;
        memory.tracked.position += travel;
        let kept = match self.velocity {
            Some(Velocity::Foaw { .. }) => counts.unwrap_or(F::ZERO),
            Some(Velocity::DifferenceOver { .. }) => travel,
            None
            | Some(Velocity::Difference | Velocity::LowPass { .. } | Velocity::Kalman(_) | Velocity::Levant(_)) => {
                return;
            }
        };
        for count in &mut memory.counts {
            *count += kept;
        }
    }

    /// The position that the world sees: y_k, or z_k without a filter.
    #[inline(always)]
    pub fn seen<const W: usize>(&self, memory: &Memory<F, W>, position: F) -> F {
        match (self.filter, memory.last) {
            (Some(gain), Some(_)) => memory.filtered + gain * (position - memory.filtered),
            (Some(_), None) | (None, _) => position,
        }
    }

    /// The puck as the world saw it at the last sample.
    #[inline(always)]
    pub fn seen_last<const W: usize>(&self, memory: &Memory<F, W>) -> Option<Puck<F>> {
        let last = memory.last?;
        Some(if self.filter.is_some() { Puck { position: memory.filtered, ..last } } else { last })
    }

    /// The velocity from this position, of which the memory has the count already, and earlier ones; `None` for FOAW, which has to search its window.
    #[inline(always)]
    pub fn by_difference<const W: usize>(&self, memory: &mut Memory<F, W>, position: F) -> Option<F> {
        let (Some(estimator), Some(last)) = (self.velocity, memory.last) else {
            memory.tracked = Tracked { position, acceleration: F::ZERO };
            return Some(F::ZERO);
        };
        match estimator {
            Velocity::Difference => Some((position - last.position) * self.rate),
            Velocity::LowPass { keep, gain } => Some(keep * last.velocity + gain * (position - last.position)),
            Velocity::DifferenceOver { every, rate } => Some((position - memory.then(every.min(memory.older))) * rate),
            Velocity::Foaw { .. } => None,
            Velocity::Kalman(kalman) => {
                let (velocity, tracked) = kalman.step(memory.tracked, last.velocity, position);
                memory.tracked = tracked;
                Some(velocity)
            }
            Velocity::Levant(levant) => {
                let (velocity, tracked) = levant.step(memory.tracked.position, last.velocity, position);
                memory.tracked.position = tracked;
                Some(velocity)
            }
        }
    }
}

impl<F: Real> Sensor<F> {
    /// The velocity from this position and those before. Out of line: with the exact velocity a sample does not wait for the last store.
    #[inline(never)]
    pub fn estimate<const W: usize>(&self, memory: &mut Memory<F, W>, position: F) -> F {
        match self.by_difference(memory, position) {
            None => self.foaw(memory.older, |age| memory.count(age)),
            Some(velocity) => velocity,
        }
    }

    /// FOAW's window, not longer than the `older` counts; 0 where the estimator is another one.
    #[inline(always)]
    pub fn window(&self, older: usize) -> usize {
        match self.velocity {
            Some(Velocity::Foaw { window, .. }) => window.min(older),
            None
            | Some(
                Velocity::Difference
                | Velocity::LowPass { .. }
                | Velocity::DifferenceOver { .. }
                | Velocity::Kalman(_)
                | Velocity::Levant(_),
            ) => 0,
        }
    }

    /// FOAW's velocity from the newest count and the `older` ones: `count` is that of an age in samples, less the newest; 0 where the
    /// estimator is another one.
    #[inline(always)]
    pub fn foaw(&self, older: usize, count: impl Fn(usize) -> F) -> F {
        let [n] = longest_windows([self.window(older)], |age| [count(age)]);
        self.fit(n, count)
    }

    /// FOAW's velocity over `n` samples.
    #[inline(always)]
    pub fn fit(&self, n: usize, count: impl Fn(usize) -> F) -> F {
        let Some(Velocity::Foaw { best, .. }) = self.velocity else { return F::ZERO };
        let slope = if best { best_fit(n, &count) } else { end_fit(n, &count) };
        slope * self.count.unwrap_or(F::ONE) * self.rate
    }
}

/// The counts of `size` at a position. A tie within 1e-9 of a count goes up.
#[inline(always)]
fn nearest<F: Number>(position: F, size: F) -> F {
    (position / size + F::HALF + F::from_f64(1e-9)).floor()
}

/// The largest n ≤ window for which, at every length up to n, each sample in between lies within one count of the line from
/// the newest sample to the n-th before it (inclusive, 1e-9 of a count); at least 1. For N encoders side by side.
///
/// A line through the newest sample passes within a count of the sample of age j when its slope (per sample, backward) is
/// within (count(j) ± 1)/j; the slopes that pass all of them are one interval, kept while n grows. An encoder that has left its line keeps
/// an empty interval.
#[inline(always)]
pub(crate) fn longest_windows<F: Real, const N: usize>(
    window: [usize; N],
    count: impl Fn(usize) -> [F; N],
) -> [usize; N] {
    let (within, most) = (F::from_f64(1.0 + 1e-9), F::from_f64(f64::INFINITY));
    let (mut lowest, mut highest) = ([-most; N], [most; N]);
    // As numbers of the counts' kind, so that encoders side by side make vectors.
    let last = window.map(whole::<F>);
    let mut longest = [F::ONE; N];
    let mut age = F::ZERO;
    for n in 1..=window.iter().copied().max().unwrap_or(0) {
        age += F::ONE;
        let counts = count(n);
        for i in 0..N {
            let slope = counts[i] / age;
            let (low, high) = ((counts[i] - within) / age, (counts[i] + within) / age);
            let passes = (slope >= lowest[i]) & (slope <= highest[i]) & (age <= last[i]);
            let low = if low > lowest[i] { low } else { lowest[i] };
            let high = if high < highest[i] { high } else { highest[i] };
            lowest[i] = if passes { low } else { most };
            highest[i] = if passes { high } else { -most };
            longest[i] = if passes { age } else { longest[i] };
        }
        if longest.iter().all(|longest| *longest != age) {
            break;
        }
    }
    longest.map(|longest| longest.to_f64() as usize)
}

/// Counts per sample over the window's two ends.
fn end_fit<F: Real>(n: usize, count: impl Fn(usize) -> F) -> F {
    -count(n) / whole(n)
}

/// Counts per sample of the least-squares line through n + 1 samples, Σ (n - 2j) y_j · 6/(n(n+1)(n+2)) for the sample y_j of
/// age j: the sum is of whole numbers, and exact.
fn best_fit<F: Real>(n: usize, count: impl Fn(usize) -> F) -> F {
    let mut sum = F::ZERO;
    for age in 0..=n {
        sum += (whole::<F>(n) - whole::<F>(2 * age)) * count(age);
    }
    sum * F::from_f64(6.0) / whole(n * (n + 1) * (n + 2))
}

fn whole<F: Real>(n: usize) -> F {
    F::from_f64(n as f64)
}
