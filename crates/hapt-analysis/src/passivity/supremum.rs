//! The supremum of the required damping over all frequencies, by branch and bound. A series with a bounded remainder gives an upper
//! bound of the curve over each interval. An interval whose bound exceeds the best known value is halved. When none is left the
//! value is proved, however narrow the peaks.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use crate::error::Error;
use crate::numerics::series::{Real, TERMS};
use crate::passivity::curve::{Condition, DampingCurve, Enough};
use crate::until::is_over;

/// Relative accuracy of the proof.
const PROVED: f64 = 1e-11;

/// The same by the polynomial condition. The value itself is that of a peak, to the last digits; no other peak is higher by more.
const PEAKS: f64 = 1e-10;

/// Relative distance within which a value counts as the supremum.
const REACHED: f64 = 1e-9;

/// Number of terms of the first look at an interval, where a bound below is wanted.
const FEW: usize = 4;

/// Largest number of dampings that are tried by the polynomial condition.
const ROUNDS: usize = 30;

/// Largest number of intervals. One body takes some hundred, 32 lightly damped ones some ten thousand.
const MAX_INTERVALS: usize = 2_000_000;

/// The supremum of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Supremum {
    pub value: f64,
    /// The lowest angle that reaches it, in rad a sample; `None` for a flat curve.
    pub at: Option<f64>,
}

/// An interval of frequency, φ - r to φ + r, with its bounds.
#[derive(Clone, Copy, Debug)]
struct Interval {
    phi: f64,
    r: f64,
    /// An upper bound of the curve.
    upper: f64,
    /// Largest difference of the curve from its value in the middle.
    spread: f64,
    /// A lower bound of the curve at `at`.
    value: f64,
    at: f64,
}

impl PartialEq for Interval {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Interval {}
impl PartialOrd for Interval {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Interval {
    fn cmp(&self, other: &Self) -> Ordering {
        self.upper.total_cmp(&other.upper)
    }
}

/// The b of b² - b m - h = 0.
pub(super) fn damping(m: f64, h: f64) -> f64 {
    if h > 0.0 { 0.5 * (m + (m * m + 4.0 * h).sqrt()) } else { m }
}

/// The requested result of a curve's supremum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    /// Its value, and where it is.
    Value,
    /// Only its value.
    Least,
    /// Whether it is at most this. A value above is found, or a bound below is proved; only a supremum within [`SPARE`] below is searched to
    /// the end.
    AtMost(f64),
    /// Its distance from this, to a part of [`NEAR`], on the right side.
    From(f64),
    /// An upper bound, to this relative accuracy.
    Bound(f64),
}

/// Relative accuracy of a distance.
const NEAR: f64 = 1e-3;

/// The part of a damping by which a bound has to be below it, so that no more than the bound is wanted. A loop that is passive with
/// as much to spare is stable hands-off too.
pub(crate) const SPARE: f64 = 1e-6;

/// Relative difference within which a requirement is the device's damping. A file's numbers are decimal, so that in binary a product like
/// KT/2 misses the damping that it equals by a few roundings.
const EQUAL: f64 = 8.0 * f64::EPSILON;

/// The requirement, or `damping` where it is equal to that up to rounding.
pub(crate) fn rounded_requirement(damping: f64, required: f64) -> f64 {
    if (required - damping).abs() <= EQUAL * damping { damping } else { required }
}

impl Wanted {
    /// The value above which no more is wanted.
    pub fn enough(self) -> f64 {
        match self {
            Wanted::Value | Wanted::Least | Wanted::From(_) | Wanted::Bound(_) => f64::INFINITY,
            Wanted::AtMost(damping) => damping * (1.0 + EQUAL),
        }
    }

    /// The bound below which no more is wanted, for a curve with this rounding error.
    fn spared(self, noise: f64) -> f64 {
        match self {
            Wanted::Value | Wanted::Least | Wanted::From(_) | Wanted::Bound(_) => 0.0,
            // The form of a fraction of a delay divides by it.
            Wanted::AtMost(damping) => Some(damping * (1.0 - SPARE) - noise).filter(|b| *b > noise).unwrap_or(0.0),
        }
    }
}

struct Search<'a> {
    curve: &'a DampingCurve,
    wanted: Wanted,
    best: f64,
    /// Rounding error of the curve.
    noise: f64,
    intervals: usize,
}

impl Search<'_> {
    fn at(&mut self, phi: f64) -> f64 {
        let value = self.curve.over::<1>(phi, 0.0).map_or(f64::NEG_INFINITY, |(m, h)| damping(m.c[0], h.c[0].max(0.0)));
        self.best = self.best.max(value);
        value
    }

    /// The requested value, by the polynomial condition; `None` where that does not decide. A value that it claims to be too small is
    /// one of the curve.
    fn by_condition(&mut self) -> Option<f64> {
        let condition = Condition::of(self.curve)?;
        for _ in 0..ROUNDS {
            let low = self.best;
            let high = match self.wanted {
                Wanted::Value | Wanted::Least => low * (1.0 + PEAKS) + self.noise,
                Wanted::AtMost(_) => self.wanted.spared(self.noise),
                Wanted::From(damping) if low > damping => low + 0.5 * NEAR * (low - damping),
                Wanted::From(damping) => (low + 0.5 * NEAR * damping) / (1.0 + 0.5 * NEAR),
                Wanted::Bound(accuracy) => low * (1.0 + 0.5 * accuracy),
            };
            if high <= low.max(self.noise) {
                return None;
            }
            match condition.holds(high) {
                Enough::Proved => {
                    return Some(match self.wanted {
                        Wanted::Value | Wanted::Least => low,
                        Wanted::From(damping) if low > damping => low,
                        Wanted::AtMost(_) | Wanted::From(_) | Wanted::Bound(_) => high,
                    });
                }
                Enough::Fails(phi) => self.at(phi),
                Enough::Open => return None,
            };
            if self.best > self.wanted.enough() {
                return Some(self.best);
            }
            if self.best <= low {
                return None;
            }
        }
        None
    }

    /// The bounds over an interval, by a series of N terms.
    fn bound<const N: usize>(&mut self, phi: f64, r: f64) -> Result<Interval, Error> {
        if is_over() {
            return Err(Error::Stopped);
        }
        self.intervals += 1;
        if self.intervals > MAX_INTERVALS {
            return Err(Error::Search { intervals: MAX_INTERVALS });
        }
        // Too narrow to halve: the middle is the only number.
        if phi + 0.5 * r <= phi || r < 1e-200 {
            let value = self.at(phi);
            return Ok(Interval { phi, r, upper: value, spread: 0.0, value, at: phi });
        }
        let Some((m, h)) = self.curve.over::<N>(phi, r) else {
            return Ok(Interval {
                phi,
                r,
                upper: f64::INFINITY,
                spread: f64::INFINITY,
                value: f64::NEG_INFINITY,
                at: phi,
            });
        };
        // With h > 0, b ≤ γ is equivalent to m + h/γ ≤ γ. If the bound u of that is above γ, b ≤ u.
        let known = self.best.max(self.wanted.spared(self.noise));
        let gamma = known.max(self.noise).max(damping(m.c[0], h.c[0].max(0.0)));
        let sum: Real<N> = if h.c[0] > 0.0 { m.plus(1.0 / gamma, &h) } else { m };
        let u = sum.vertex();
        let value = damping(m.at(u) - m.rest, (h.at(u) - h.rest).max(0.0));
        self.best = self.best.max(value);
        let spread = sum.c[1..].iter().map(|c| c.abs()).sum::<f64>() + sum.rest;
        Ok(Interval { phi, r, upper: sum.upper(), spread, value, at: phi + r * u })
    }

    /// Whether the curve may exceed `level` in an interval.
    fn may_exceed(&self, interval: &Interval, level: f64) -> bool {
        interval.upper > level + self.noise
    }

    /// The local maximum near an angle.
    fn refine_maximum(&mut self, mut phi: f64, mut r: f64) -> f64 {
        let mut value = self.at(phi);
        for _ in 0..60 {
            let Some((m, h)) = self.curve.over::<TERMS>(phi, r) else {
                r *= 0.25;
                continue;
            };
            let sum = if h.c[0] > 0.0 { m.plus(1.0 / self.best, &h) } else { m };
            let next = (phi + r * sum.vertex()).clamp(0.0, PI);
            let there = self.at(next);
            if (next - phi).abs() < 1e-10 * phi || there < value {
                if r < 1e-9 * phi {
                    break;
                }
                r *= 0.25;
            }
            if there >= value {
                (phi, value) = (next, there);
            }
        }
        // The curve is even about π.
        if PI - phi < 1e-6 && self.at(PI) >= value - self.noise { PI } else { phi }
    }
}

/// The supremum over all frequencies. `size` is that of the curve's terms: below 1e-14 of it, differences are rounding. Where less than
/// the value is `wanted`, the result is on the same side of that damping as the supremum, and has no angle.
///
/// # Errors
/// [`Error::Search`], [`Error::Stopped`].
pub(crate) fn supremum(curve: &DampingCurve, size: f64, wanted: Wanted) -> Result<Supremum, Error> {
    if is_over() {
        return Err(Error::Stopped);
    }
    let mut search = Search { curve, wanted, best: 0.0, noise: 1e-14 * size, intervals: 0 };
    if !matches!(wanted, Wanted::AtMost(_)) {
        search.look();
    }
    let known = search.by_condition();
    match (known, wanted) {
        (Some(value), Wanted::Least | Wanted::AtMost(_) | Wanted::From(_) | Wanted::Bound(_)) => {
            Ok(Supremum { value, at: None })
        }
        (None, _) => search.by_series(),
        // The series have its angle.
        (Some(value), Wanted::Value) => Ok(Supremum { value, ..search.by_series()? }),
    }
}

impl Search<'_> {
    /// The values where the curve may be largest.
    fn look(&mut self) {
        for phi in self.curve.angles().into_iter().chain([0.0, PI]) {
            self.at(phi);
        }
    }

    /// The requested result, by bounds over intervals.
    fn by_series(mut self) -> Result<Supremum, Error> {
        if self.wanted == Wanted::Least {
            // The same work for the same value, to the last bit.
            self.wanted = Wanted::Value;
        }
        let wanted = self.wanted;
        let (enough, spared) = (wanted.enough(), wanted.spared(self.noise));
        self.look();
        let search = &mut self;
        let mut heap = BinaryHeap::new();
        let mut from = 0.0;
        while from < PI && search.best <= enough {
            let r = match wanted {
                Wanted::Value | Wanted::Least => PI / 16.0,
                Wanted::AtMost(_) | Wanted::From(_) | Wanted::Bound(_) => search.curve.reach(from),
            };
            let r = if from + 2.1 * r < PI { r } else { 0.5 * (PI - from) };
            let interval = match wanted {
                Wanted::Value | Wanted::Least => search.bound::<TERMS>(from + r, r)?,
                Wanted::AtMost(_) | Wanted::From(_) | Wanted::Bound(_) => search.bound::<FEW>(from + r, r)?,
            };
            if interval.upper > spared || search.best > spared {
                heap.push(interval);
            }
            from = if from + 2.1 * r < PI { from + 2.0 * r } else { PI };
        }
        if heap.is_empty() && search.best <= spared {
            return Ok(Supremum { value: spared, at: None });
        }
        while let Some(top) = heap.pop() {
            if search.best > enough {
                return Ok(Supremum { value: search.best, at: None });
            }
            if search.best <= spared && top.upper <= spared {
                return Ok(Supremum { value: spared, at: None });
            }
            let (low, high) = (search.best, top.upper.max(search.best));
            if let Wanted::Bound(accuracy) = wanted
                && high - low <= accuracy * low
            {
                return Ok(Supremum { value: high, at: None });
            }
            if let Wanted::From(damping) = wanted {
                if low > damping && high - low <= NEAR * (low - damping) {
                    return Ok(Supremum { value: low, at: None });
                }
                if high < damping && high - low <= NEAR * (damping - high) {
                    return Ok(Supremum { value: high, at: None });
                }
            }
            if !search.may_exceed(&top, search.best * (1.0 + PROVED)) {
                heap.push(top);
                break;
            }
            let half = 0.5 * top.r;
            heap.push(search.bound::<TERMS>(top.phi - half, half)?);
            heap.push(search.bound::<TERMS>(top.phi + half, half)?);
        }
        if wanted != Wanted::Value {
            return Ok(Supremum { value: search.best, at: None });
        }
        let mut leaves = heap.into_vec();
        let reached = search.best * (1.0 - REACHED) - search.noise;
        let slack = REACHED * search.best + search.noise;
        if leaves.iter().all(|leaf| leaf.spread <= slack && leaf.value >= reached) {
            return Ok(Supremum { value: search.best, at: None });
        }
        if search.at(0.0) >= reached {
            return Ok(Supremum { value: search.best, at: Some(0.0) });
        }
        leaves.sort_by(|a, b| b.phi.total_cmp(&a.phi));
        // The lowest frequency is last.
        while let Some(leaf) = leaves.pop() {
            if leaf.value >= reached {
                return Ok(Supremum { value: search.best, at: Some(search.refine_maximum(leaf.at, leaf.r)) });
            }
            if leaf.upper >= reached && leaf.r > 1e-15 * leaf.phi {
                let half = 0.5 * leaf.r;
                leaves.push(search.bound::<TERMS>(leaf.phi + half, half)?);
                leaves.push(search.bound::<TERMS>(leaf.phi - half, half)?);
            }
        }
        // Only π reaches it.
        Ok(Supremum { value: search.best, at: Some(PI) })
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;
    use nalgebra::Complex;
    use proptest::strategy::ValueTree;

    use super::*;
    use crate::equations::delay::Delay;
    use crate::equations::estimator::Filter;
    use crate::impedance::{Pole, TransferFunction};

    type C = Complex<f64>;

    /// Poles inside the circle, in pairs and real, with gains of any size, behind a filter and a delay.
    fn curves() -> impl Strategy<Value = (DampingCurve, f64)> {
        let gains = prop::collection::vec(prop_oneof![Just(0.0), -1.0..1.0f64], 8);
        let pole = (-4.0..0.3f64, -4.0..-0.02f64, any::<bool>(), gains);
        let filter = prop::sample::select(vec![0, 1, 2, 3]);
        let delay = (0..6usize, prop_oneof![Just(0.0), 0.0..1.0f64]);
        (prop::collection::vec(pole, 0..4), filter, delay, -1.0..2.0f64, prop_oneof![Just(0.0), -1.0..1.0f64]).prop_map(
            |(all, filter, (samples, fraction), stiffness, direct)| {
                let period = 1e-3;
                let mut poles = Vec::new();
                for (arg, decay, is_real, gains) in all {
                    let (arg, ln_abs) = (if is_real { 0.0 } else { 10f64.powf(arg) }, -10f64.powf(decay));
                    let scale = arg - ln_abs;
                    let unit = [scale, scale, scale * period, scale * period];
                    let gains: [C; 4] =
                        std::array::from_fn(|i| unit[i] * C::new(gains[i], if is_real { 0.0 } else { gains[i + 4] }));
                    poles.push(Pole { ln_abs, arg, gains });
                    if !is_real {
                        poles.push(Pole { ln_abs, arg: -arg, gains: gains.map(|gain| gain.conj()) });
                    }
                }
                let filter = match filter {
                    0 => Filter { pole: 0.0, taps: Vec::new(), kalman: None },
                    1 => Filter { pole: 0.6, taps: vec![0.4 / period, -0.4 / period], kalman: None },
                    2 => Filter { pole: 0.0, taps: vec![1.0 / period, -1.0 / period], kalman: None },
                    _ => Filter { pole: 0.0, taps: vec![0.5 / period, 0.0, 0.0, -0.5 / period], kalman: None },
                };
                let at_puck = [4.0, 4.0 * period];
                let transfer =
                    TransferFunction { stiffness, direct: direct * period, poles, at_puck, is_accurate: true };
                let curve = DampingCurve::new(&transfer, &filter, Delay { samples, fraction }, 0.0, period);
                (curve, DampingCurve::size(&transfer, 0.0, period))
            },
        )
    }

    fn search(curve: &DampingCurve, size: f64, wanted: Wanted) -> Search<'_> {
        Search { curve, wanted, best: 0.0, noise: 1e-14 * size, intervals: 0 }
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(2000))]

        /// Bounds over intervals and the polynomial condition are two proofs of the same.
        #[test]
        fn the_polynomial_condition_has_the_answers_of_the_series((curve, size) in curves()) {
            let least = search(&curve, size, Wanted::Least).by_series().unwrap().value;
            let found = supremum(&curve, size, Wanted::Least).unwrap().value;
            prop_assert!((found - least).abs() <= 2.0 * PEAKS * least + 1e-13 * size, "{} {}", found, least);
            prop_assume!(least > 1e-6 * size);
            for more in [0.5, 0.9, 0.999, 1.0 - 1e-5, 1.0 - 1e-9, 1.0 + 1e-9, 1.0 + 2e-6, 1.001, 1.1, 2.0] {
                let damping = more * least;
                let holds = |wanted, found: Result<Supremum, Error>| (wanted, found.unwrap().value <= damping);
                for wanted in [Wanted::AtMost(damping), Wanted::From(damping)] {
                    let by_series = holds(wanted, search(&curve, size, wanted).by_series());
                    prop_assert_eq!(holds(wanted, supremum(&curve, size, wanted)), by_series, "{}", more);
                    prop_assert_eq!(by_series.1, more > 1.0, "{}", more);
                }
                let distance = supremum(&curve, size, Wanted::From(damping)).unwrap().value - damping;
                prop_assert!((distance / (least - damping) - 1.0).abs() <= 2.0 * NEAR + 1e-13 * size / (least - damping).abs());
            }
            let bound = supremum(&curve, size, Wanted::Bound(1e-3)).unwrap().value;
            prop_assert!(bound >= least * (1.0 - PEAKS) && bound <= least * (1.0 + 1e-3));
        }
    }

    #[test]
    fn a_single_body_needs_no_series() {
        let mut runner = proptest::test_runner::TestRunner::deterministic();
        let (mut open, mut all) = (0, 0);
        for _ in 0..400 {
            let (curve, size) = curves().new_tree(&mut runner).unwrap().current();
            let least = supremum(&curve, size, Wanted::Least).unwrap().value;
            for more in [0.5, 0.99, 1.01, 2.0].into_iter().filter(|_| least > 1e-6 * size) {
                all += 1;
                open += usize::from(search(&curve, size, Wanted::AtMost(more * least)).by_condition().is_none());
            }
        }
        assert!(all > 500 && 50 * open < all, "{open} of {all}");
    }
}
