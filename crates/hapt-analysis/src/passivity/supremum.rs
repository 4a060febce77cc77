//! The supremum of the required damping over all frequencies, by branch and bound. A series with a bounded remainder gives an upper
//! bound of the curve over each interval. An interval whose bound exceeds the best known value is halved. When none is left the
//! value is proved, however narrow the peaks.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use crate::error::Error;
use crate::numerics::series::{Real, TERMS};
use crate::passivity::curve::DampingCurve;
use crate::until::is_over;

/// Relative accuracy of the proof.
const PROVED: f64 = 1e-11;

/// Relative distance within which a value counts as the supremum.
const REACHED: f64 = 1e-9;

/// Number of terms of the first look at an interval, where a bound below is wanted.
const FEW: usize = 4;

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
fn damping(m: f64, h: f64) -> f64 {
    if h > 0.0 { 0.5 * (m + (m * m + 4.0 * h).sqrt()) } else { m }
}

/// What is wanted of a curve's supremum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    /// Its value, and where it is.
    Value,
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
pub(crate) fn requirement_beside(damping: f64, required: f64) -> f64 {
    if (required - damping).abs() <= EQUAL * damping { damping } else { required }
}

impl Wanted {
    /// The value above which no more is wanted.
    pub fn enough(self) -> f64 {
        match self {
            Wanted::Value | Wanted::From(_) | Wanted::Bound(_) => f64::INFINITY,
            Wanted::AtMost(damping) => damping * (1.0 + EQUAL),
        }
    }

    /// The bound below which no more is wanted, for a curve with this rounding error.
    fn spared(self, noise: f64) -> f64 {
        match self {
            Wanted::Value | Wanted::From(_) | Wanted::Bound(_) => 0.0,
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
    let mut search = Search { curve, wanted, best: 0.0, noise: 1e-14 * size, intervals: 0 };
    let (enough, spared) = (wanted.enough(), wanted.spared(search.noise));
    for phi in curve.angles().into_iter().chain([0.0, PI]) {
        search.at(phi);
    }
    let mut heap = BinaryHeap::new();
    let mut from = 0.0;
    while from < PI && search.best <= enough {
        let r = match wanted {
            Wanted::Value => PI / 16.0,
            Wanted::AtMost(_) | Wanted::From(_) | Wanted::Bound(_) => curve.reach(from),
        };
        let r = if from + 2.1 * r < PI { r } else { 0.5 * (PI - from) };
        let interval = match wanted {
            Wanted::Value => search.bound::<TERMS>(from + r, r)?,
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
