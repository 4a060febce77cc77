//! The largest damping that any frequency asks for, by branch and bound: over each interval of frequency a series with a
//! bounded remainder says how high the curve can be, and only where that is above the highest value known the interval is
//! halved. When none is left the value is proved, however narrow the peaks.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use crate::error::Error;
use crate::numerics::series::Real;
use crate::passivity::curve::Curve;

/// The value is proved to this, relatively.
const PROVED: f64 = 1e-11;

/// What comes within this of the supremum, relatively, reaches it.
const REACHED: f64 = 1e-9;

/// Intervals looked at before the search gives up. One body takes some hundred, 32 lightly damped ones some ten thousand.
const LOOKS: usize = 2_000_000;

/// The supremum of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Supremum {
    pub value: f64,
    /// The lowest angle that reaches it, in rad a sample; `None` for a flat curve.
    pub at: Option<f64>,
}

/// An interval of frequency, φ - r to φ + r, and what is known of it.
#[derive(Clone, Copy, Debug)]
struct Interval {
    phi: f64,
    r: f64,
    /// The curve is nowhere above this.
    upper: f64,
    /// By how much the curve may differ from its value in the middle.
    spread: f64,
    /// Of the curve at `at`, from below.
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

struct Search<'a> {
    curve: &'a Curve,
    best: f64,
    /// What rounding makes of the curve.
    noise: f64,
    looks: usize,
}

impl Search<'_> {
    fn at(&mut self, phi: f64) -> f64 {
        let value = self.curve.over(phi, 0.0).map_or(f64::NEG_INFINITY, |(m, h)| damping(m.c[0], h.c[0].max(0.0)));
        self.best = self.best.max(value);
        value
    }

    fn look(&mut self, phi: f64, r: f64) -> Result<Interval, Error> {
        self.looks += 1;
        if self.looks > LOOKS {
            return Err(Error::Search { looks: LOOKS });
        }
        // Too narrow for two numbers: the middle is all there is.
        if phi + 0.5 * r <= phi || r < 1e-200 {
            let value = self.at(phi);
            return Ok(Interval { phi, r, upper: value, spread: 0.0, value, at: phi });
        }
        let Some((m, h)) = self.curve.over(phi, r) else {
            return Ok(Interval {
                phi,
                r,
                upper: f64::INFINITY,
                spread: f64::INFINITY,
                value: f64::NEG_INFINITY,
                at: phi,
            });
        };
        // With h > 0, b ≤ γ is m + h/γ ≤ γ; and where that has the bound u above γ, b ≤ u.
        let gamma = self.best.max(self.noise).max(damping(m.c[0], h.c[0].max(0.0)));
        let sum: Real = if h.c[0] > 0.0 { m.plus(1.0 / gamma, &h) } else { m };
        let u = sum.vertex();
        let value = damping(m.at(u) - m.rest, (h.at(u) - h.rest).max(0.0));
        self.best = self.best.max(value);
        let spread = sum.c[1..].iter().map(|c| c.abs()).sum::<f64>() + sum.rest;
        Ok(Interval { phi, r, upper: sum.upper(), spread, value, at: phi + r * u })
    }

    /// Whether an interval may hold more than `level`.
    fn open(&self, interval: &Interval, level: f64) -> bool {
        interval.upper > level + self.noise
    }

    /// Uphill from an angle, to where the curve is highest near it.
    fn summit(&mut self, mut phi: f64, mut r: f64) -> f64 {
        let mut value = self.at(phi);
        for _ in 0..60 {
            let Some((m, h)) = self.curve.over(phi, r) else {
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

/// The supremum over all frequencies. `size` is that of the curve's terms: below 1e-14 of it, differences are rounding.
///
/// # Errors
/// [`Error::Search`].
pub(crate) fn supremum(curve: &Curve, size: f64) -> Result<Supremum, Error> {
    let mut search = Search { curve, best: 0.0, noise: 1e-14 * size, looks: 0 };
    for phi in curve.angles().into_iter().chain([0.0, PI]) {
        search.at(phi);
    }
    let first = 8;
    let r = 0.5 * PI / f64::from(first);
    let mut heap = BinaryHeap::new();
    for i in 0..first {
        heap.push(search.look(r * f64::from(2 * i + 1), r)?);
    }
    while let Some(top) = heap.pop() {
        if !search.open(&top, search.best * (1.0 + PROVED)) {
            heap.push(top);
            break;
        }
        let half = 0.5 * top.r;
        heap.push(search.look(top.phi - half, half)?);
        heap.push(search.look(top.phi + half, half)?);
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
    // Lowest last.
    while let Some(leaf) = leaves.pop() {
        if leaf.value >= reached {
            return Ok(Supremum { value: search.best, at: Some(search.summit(leaf.at, leaf.r)) });
        }
        if leaf.upper >= reached && leaf.r > 1e-15 * leaf.phi {
            let half = 0.5 * leaf.r;
            leaves.push(search.look(leaf.phi + half, half)?);
            leaves.push(search.look(leaf.phi - half, half)?);
        }
    }
    // All that reached it has been π.
    Ok(Supremum { value: search.best, at: Some(PI) })
}
