//! The first zero crossing of a set of functions of one parameter.
//!
//! The parameter is a period, a delay or a stiffness. The functions are the growths of all roots of the loop, or the excess of the
//! required damping over that of the device. Sorted from the largest down, the value of each rank is a continuous function of the
//! parameter, whichever root it belongs to. An interval is free of crossings when no rank comes near 0: the largest of three
//! samples, at both ends and in the middle, is below 0 by more than the three differ. Otherwise the interval is halved. Every rank is
//! tested, so a root that rises above 0 and falls again within an interval is found even if a slower root is larger all the time.
//!
//! A delay of whole samples and one with a fraction of a sample give different loops, so the values have kinks at whole samples, and
//! turn there and back from one to the next. Along a period the ends of intervals are placed on every whole and half sample of the
//! delay; along a delay on whole samples, with midpoints between two of them.

use hapt_model::Delay;

use crate::error::Error;

/// Initial intervals per decade, each sampled at its end and in its middle.
const PER_DECADE: f64 = 8.0;

/// Largest number of initial intervals.
const INTERVALS: f64 = 400.0;

/// Required distance of an interval below 0, as a multiple of the difference of its three values.
const CLEARANCE: f64 = 1.25;

/// Relative width below which an interval is not halved.
const MIN_WIDTH: f64 = 3e-4;

/// The growth, 1/s, below which all roots count as equal: they decay within two samples and the delay. Commands in flight have
/// roots there that move from and to 0 as the delay passes whole samples.
pub(crate) fn growth_floor(period: f64, delay: f64) -> f64 {
    -1.0 / (2.0 * period + delay)
}

/// Largest number of samples in halved intervals. Beyond it, an interval is judged by its three samples.
const MAX_SAMPLES: usize = 3000;

/// The values at one parameter, ranked.
#[derive(Clone, Debug)]
pub(crate) struct Ranked {
    /// The largest first.
    ranked: Vec<f64>,
    /// Rounding error of a value.
    noise: f64,
}

impl Ranked {
    /// From values in any order. Those below `growth_floor` count as `growth_floor`.
    pub fn new(values: impl Iterator<Item = f64>, growth_floor: f64, noise: f64) -> Ranked {
        let mut ranked: Vec<f64> = values.map(|value| value.clamp(growth_floor, f64::MAX)).collect();
        ranked.push(growth_floor);
        ranked.sort_by(|a, b| b.total_cmp(a));
        Ranked { ranked, noise }
    }

    /// A single value.
    pub fn one(value: f64) -> Ranked {
        Ranked { ranked: vec![value.clamp(-f64::MAX, f64::MAX)], noise: 0.0 }
    }

    /// The largest.
    pub fn max(&self) -> f64 {
        self.ranked[0]
    }

    /// The value of a rank; the last where there are fewer.
    fn of(&self, rank: usize) -> f64 {
        self.ranked[rank.min(self.ranked.len() - 1)]
    }
}

/// The spacing of the samples.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Spacing {
    /// Equal ratios.
    Ratio,
    /// Equal ratios of a period, with a delay of this many seconds.
    Period(f64),
    /// A delay in samples.
    Samples,
}

impl Spacing {
    /// Of a period, with this delay. A delay in samples changes with the period.
    pub fn period(delay: Delay) -> Spacing {
        match delay {
            Delay::Seconds(delay) if delay > 0.0 => Spacing::Period(delay),
            Delay::Seconds(_) | Delay::Samples(_) => Spacing::Ratio,
        }
    }

    /// The delay in samples.
    fn samples(self, x: f64) -> f64 {
        match self {
            Spacing::Ratio => 0.0,
            Spacing::Period(delay) => delay / x,
            Spacing::Samples => x,
        }
    }

    /// The parameter at which the delay has this many samples.
    fn at(self, samples: f64) -> f64 {
        match self {
            Spacing::Period(delay) => delay / samples,
            Spacing::Ratio | Spacing::Samples => samples,
        }
    }

    /// The end of the interval that begins at `a`: `ratio` times `a`, or a whole sample. A period's intervals end on every half one.
    fn next(self, a: f64, ratio: f64) -> f64 {
        match self {
            Spacing::Ratio => a * ratio,
            Spacing::Samples => (a + 1e-6 + (0.3 * a).max(1.0)).floor(),
            Spacing::Period(delay) => {
                // Roots move there and back within a sample of the delay: an interval has half a sample at most, so that four points of
                // each detect the first turn of such a motion at any phase.
                let b = a * ratio;
                let half = delay / (0.5 * ((2.0 * delay / a) * (1.0 - 1e-6) - 1.0).ceil());
                if half > a * (1.0 + 1e-7) && half < b * ratio { half } else { b }
            }
        }
    }

    /// A value between a and b.
    fn middle(self, a: f64, b: f64) -> f64 {
        let middle = match self {
            Spacing::Samples => 0.5 * (a + b),
            Spacing::Ratio | Spacing::Period(_) => a * (b / a).sqrt(),
        };
        if (self.samples(a) - self.samples(b)).abs() <= 1.0 + 1e-6 {
            return middle;
        }
        let half = self.at(self.samples(middle).floor() + 0.5);
        if half > a && half < b { half } else { middle }
    }

    fn is_narrow(self, a: f64, b: f64) -> bool {
        match self {
            Spacing::Samples => b - a < MIN_WIDTH,
            Spacing::Ratio | Spacing::Period(_) => b - a < MIN_WIDTH * b,
        }
    }
}

/// A parameter and the values there.
type Sample = (f64, Ranked);

struct Search<F> {
    f: F,
    spacing: Spacing,
    samples: usize,
}

/// Largest number of intervals that end at a given point. Beyond it, they have equal ratios again.
const MAX_NARROWED: usize = 400;

/// The largest x in [low, high] up to which no value is above 0, to a relative `tolerance` from below; `None` where no value
/// exceeds 0.
pub(crate) fn first_crossing(
    f: impl FnMut(f64) -> Result<Ranked, Error>,
    spacing: Spacing,
    low: f64,
    high: f64,
    tolerance: f64,
) -> Result<Option<f64>, Error> {
    first_crossing_within(f, spacing, |_| f64::INFINITY, [low, high], tolerance)
}

/// The same with more ends of intervals, where narrow peaks are known to stand: an interval that begins at x ends at `next(x)` at the latest.
pub(crate) fn first_crossing_within(
    f: impl FnMut(f64) -> Result<Ranked, Error>,
    spacing: Spacing,
    next: impl Fn(f64) -> f64,
    [low, high]: [f64; 2],
    tolerance: f64,
) -> Result<Option<f64>, Error> {
    let mut search = Search { f, spacing, samples: 0 };
    let mut a = search.sample(low)?;
    if a.1.max() > 0.0 {
        return Ok(Some(low));
    }
    let ratio = 10f64.powf(1.0 / PER_DECADE).max((high / low).powf(1.0 / INTERVALS));
    let mut narrowed = 0;
    while a.0 < high {
        let (wide, narrow) = (spacing.next(a.0, ratio), next(a.0));
        let narrows = narrow < wide && narrowed < MAX_NARROWED;
        narrowed += usize::from(narrows);
        let end = if narrows { narrow } else { wide };
        let b = search.sample(if end > a.0 { end.min(high) } else { high })?;
        let middle = search.middle(&a, &b)?;
        if let Some([below, above]) = search.between(&a, &middle, &b)? {
            let mut top = |x: f64| Ok((search.f)(x)?.max());
            return illinois(&mut top, (below.0, below.1.max()), (above.0, above.1.max()), tolerance).map(Some);
        }
        a = b;
    }
    Ok(None)
}

impl<F: FnMut(f64) -> Result<Ranked, Error>> Search<F> {
    fn sample(&mut self, x: f64) -> Result<Sample, Error> {
        Ok((x, (self.f)(x)?))
    }

    fn middle(&mut self, a: &Sample, b: &Sample) -> Result<Sample, Error> {
        self.sample(self.spacing.middle(a.0, b.0))
    }

    /// Two samples, the first not above 0 and the second above, with nothing above 0 before the first.
    fn between(&mut self, a: &Sample, m: &Sample, b: &Sample) -> Result<Option<[Sample; 2]>, Error> {
        if stays_negative([&a.1, &m.1, &b.1]) {
            return Ok(None);
        }
        if self.spacing.is_narrow(a.0, b.0) || self.samples > MAX_SAMPLES {
            return self.at_once(a, m, b);
        }
        self.samples += 2;
        let left = self.middle(a, m)?;
        if let Some(found) = self.between(a, &left, m)? {
            return Ok(Some(found));
        }
        let right = self.middle(m, b)?;
        self.between(m, &right, b)
    }

    /// As `between`, for an interval that is not halved.
    fn at_once(&mut self, a: &Sample, m: &Sample, b: &Sample) -> Result<Option<[Sample; 2]>, Error> {
        if m.1.max() > 0.0 {
            return Ok(Some([a.clone(), m.clone()]));
        }
        if b.1.max() > 0.0 {
            return Ok(Some([m.clone(), b.clone()]));
        }
        if m.1.max() >= a.1.max() && m.1.max() >= b.1.max() && m.1.max() > a.1.max().min(b.1.max()) {
            let mut top = |x: f64| Ok((self.f)(x)?.max());
            let x = golden_section(&mut top, a.0, b.0)?.0;
            let found = self.sample(x)?;
            if found.1.max() > 0.0 {
                return Ok(Some([a.clone(), found]));
            }
        }
        Ok(None)
    }
}

/// Whether no value comes near 0 in the interval with these samples at its ends and in its middle.
fn stays_negative(three: [&Ranked; 3]) -> bool {
    let ranks = three.iter().map(|values| values.ranked.len()).max().unwrap_or(0);
    let noise = three.iter().map(|values| values.noise).fold(0.0, f64::max);
    (0..ranks).all(|rank| {
        let [a, m, b] = three.map(|values| values.of(rank));
        let (most, least) = (a.max(m).max(b), a.min(m).min(b));
        most <= 0.0 && most + CLEARANCE * (most - least) <= CLEARANCE * 8.0 * noise
    })
}

/// A maximum between a and b by golden section. Ends as soon as a value is above 0.
fn golden_section(f: &mut impl FnMut(f64) -> Result<f64, Error>, mut a: f64, mut b: f64) -> Result<(f64, f64), Error> {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let mut left = (b - GOLDEN * (b - a), f(b - GOLDEN * (b - a))?);
    let mut right = (a + GOLDEN * (b - a), f(a + GOLDEN * (b - a))?);
    for _ in 0..32 {
        if left.1 > 0.0 || right.1 > 0.0 {
            break;
        }
        if left.1 > right.1 {
            (b, right) = (right.0, left);
            let x = b - GOLDEN * (b - a);
            left = (x, f(x)?);
        } else {
            (a, left) = (left.0, right);
            let x = a + GOLDEN * (b - a);
            right = (x, f(x)?);
        }
    }
    Ok(if left.1 > right.1 { left } else { right })
}

/// The last x before f rises above 0, between a, where f is not above 0, and b, where it is. Regula falsi with the Illinois
/// correction (Dowell and Jarratt, BIT 11, 1971), to a relative `tolerance`. When successive steps do not halve the bracket,
/// bisections are inserted: one after the second such step, two after the third, and so on. f may be flat up to the crossing,
/// where secants give no information.
pub(crate) fn illinois(
    f: &mut impl FnMut(f64) -> Result<f64, Error>,
    mut a: (f64, f64),
    mut b: (f64, f64),
    tolerance: f64,
) -> Result<f64, Error> {
    let (mut wa, mut wb) = (a.1, b.1);
    // Bisections still to do, and the number to add after the next slow step.
    let (mut halvings, mut cost) = (0, 0);
    for _ in 0..120 {
        let width = b.0 - a.0;
        let middle = 0.5 * (a.0 + b.0);
        if middle <= a.0 || middle >= b.0 || width < tolerance.max(2.0 * f64::EPSILON) * a.0.abs().max(b.0.abs()) {
            break;
        }
        let secant = (a.0 * wb - b.0 * wa) / (wb - wa);
        let halves = halvings > 0 || !(secant > a.0 && secant < b.0);
        let x = if halves { middle } else { secant };
        let y = f(x)?;
        if y > 0.0 {
            (b, wb) = ((x, y), y);
            wa *= 0.5;
        } else {
            (a, wa) = ((x, y), y);
            wb *= 0.5;
        }
        if halves {
            halvings = i32::max(halvings - 1, 0);
        } else if b.0 - a.0 > 0.5 * width {
            halvings = cost;
            cost += 1;
        } else {
            cost = 0;
        }
    }
    Ok(a.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_many_zeros_is_found_to_the_last_digits() {
        let found = first_crossing(|x| Ok(Ranked::one((-x).sin())), Spacing::Ratio, 0.1, 100.0, 0.0).unwrap().unwrap();
        assert!((found - std::f64::consts::PI).abs() < 1e-14, "{found}");
    }

    #[test]
    fn an_island_between_the_points_is_found() {
        // Above 0 for |ln x| < 0.01, an eighth of the grid's spacing.
        let island = |x: f64| Ok(Ranked::one(1e-4 - x.ln().powi(2)));
        let found = first_crossing(island, Spacing::Ratio, 0.0123, 98.7, 0.0).unwrap().unwrap();
        assert!((found.ln() + 0.01).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_root_that_rises_below_a_slower_one_is_found() {
        // A root that hardly decays is the largest all along; another rises above 0 for a fiftieth of a decade and falls back.
        for place in 0..40 {
            let at = 0.31 + 0.0171 * f64::from(place);
            let hump = |x: f64| 1e-3 - 0.5 * (x.log10() - at).abs().min(1.0);
            let both = |x: f64| Ok(Ranked::new([-1e-9, hump(x)].into_iter(), -5.0, 0.0));
            let found = first_crossing(both, Spacing::Ratio, 0.01, 1e3, 0.0).unwrap().unwrap();
            assert!((found.log10() - (at - 2e-3)).abs() < 1e-12, "{found}");
        }
    }

    #[test]
    fn a_fraction_of_a_sample_is_seen_however_many_samples_the_delay_has() {
        // Not above 0 on whole samples, above it between two.
        let fraction = |x: f64| Ok(Ranked::one((std::f64::consts::PI * x).sin().abs() - 1e-3));
        for samples in [0.0, 1.0, 7.0, 33.0, 200.0] {
            let found = first_crossing(fraction, Spacing::Samples, samples, 500.0, 0.0).unwrap().unwrap();
            assert!((found - samples - 1e-3 / std::f64::consts::PI).abs() < 1e-6, "{samples}: {found}");
            let by_period = |period: f64| fraction(1.0 / period);
            let whole = 1.0 / (samples + 1.0);
            let found = first_crossing(by_period, Spacing::Period(1.0), whole, 10.0, 0.0).unwrap().unwrap();
            assert!(found >= whole && found < whole * (1.0 + 1e-3), "{samples}: {found}");
        }
    }

    #[test]
    fn what_returns_in_every_sample_of_a_delay_is_seen_whatever_its_phase() {
        // Above 0 for a seventh of each sample, from 20 samples on: at a period of delay/20 and longer ones.
        for phase in 0..50 {
            let at = f64::from(phase) / 50.0;
            let turns = |period: f64| {
                let samples = 1.0 / period;
                let rises = if samples < 20.0 { 0.0 } else { 1.0 };
                Ok(Ranked::one((std::f64::consts::TAU * (samples - at)).cos() - 0.9 - rises))
            };
            let found = first_crossing(turns, Spacing::Period(1.0), 1.0 / 64.0, 10.0, 0.0).unwrap().unwrap();
            assert!(found > 1.0 / 20.1 && found < 1.0 / 18.9, "{at}: {found}");
        }
    }

    /// The growth has this shape where one eigenvalue stays on the circle and another one leaves it.
    #[test]
    fn where_a_flat_function_rises_is_found_in_little_more_than_halvings() {
        for power in [1, 2, 3] {
            let mut evaluations = 0;
            let mut kinked = |x: f64| {
                evaluations += 1;
                Ok((x - 2.4e-3).max(0.0).powi(power) - 1e-30)
            };
            let found = illinois(&mut kinked, (2.2e-3, -1e-30), (2.6e-3, 2e-4_f64.powi(power)), 0.0).unwrap();
            let reached = 2.4e-3 + 1e-30_f64.powf(1.0 / f64::from(power));
            assert!((found / reached - 1.0).abs() < 1e-15, "{power}: {found}");
            // A bracket of a sixth of x has 49 halvings to the last digit.
            assert!(evaluations < 70, "{power}: {evaluations}");
        }
    }

    #[test]
    fn a_function_below_zero_has_none() {
        assert_eq!(first_crossing(|x| Ok(Ranked::one(-x)), Spacing::Ratio, 0.1, 10.0, 0.0).unwrap(), None);
    }
}
