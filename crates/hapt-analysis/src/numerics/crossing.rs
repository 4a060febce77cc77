//! The end of the interval in which nothing rises above 0.
//!
//! A loop is looked at along one parameter: its period, its delay, the stiffness of its springs. At each value it has heights: the
//! growths of all its roots, or how far a demand is beyond what the device has. Ranked from the largest down, each height is a
//! continuous function of the parameter, whichever root it belongs to. An interval is passed when no rank comes near 0 there:
//! where the largest of three heights, at both ends and in the middle, stands below 0 by more than the three differ. Else it is halved.
//! So every rank counts, and a root that rises and falls again between two values is found although a slower one stays above it
//! all the while.
//!
//! A delay of whole samples is another loop than one with a fraction of a sample: there the heights have kinks. Ends of intervals
//! are laid on whole samples, and middles between two of them, so that both are seen, however many samples the interval spans.

use hapt_model::Delay;

use crate::error::Error;

/// Intervals a decade at first, each seen at its end and in its middle.
const PER_DECADE: f64 = 8.0;

/// And so many at most, however many decades there are.
const INTERVALS: f64 = 400.0;

/// So many times the difference of its three heights has an interval to stand below 0.
const CLEAR: f64 = 1.25;

/// An interval narrower than this, relatively, is not halved any more.
const NARROW: f64 = 3e-4;

/// Below this growth, 1/s, all roots are the same: gone within two samples and the delay. What is still in flight has roots there that
/// come from 0 and go there as the delay passes whole samples.
pub(crate) fn floor(period: f64, delay: f64) -> f64 {
    -1.0 / (2.0 * period + delay)
}

/// So many values are looked at in halved intervals; beyond, an interval is taken as its three heights are.
const LOOKS: usize = 3000;

/// What a loop has at one value of the parameter.
#[derive(Clone, Debug)]
pub(crate) struct Heights {
    /// The largest first.
    ranked: Vec<f64>,
    /// What rounding may make of one.
    noise: f64,
}

impl Heights {
    /// Of any order; below `floor` they do not count.
    pub fn new(heights: impl Iterator<Item = f64>, floor: f64, noise: f64) -> Heights {
        let mut ranked: Vec<f64> = heights.map(|height| height.clamp(floor, f64::MAX)).collect();
        ranked.push(floor);
        ranked.sort_by(|a, b| b.total_cmp(a));
        Heights { ranked, noise }
    }

    /// A single one.
    pub fn one(height: f64) -> Heights {
        Heights { ranked: vec![height.clamp(-f64::MAX, f64::MAX)], noise: 0.0 }
    }

    /// The largest.
    pub fn top(&self) -> f64 {
        self.ranked[0]
    }

    /// Of a rank; the last where there are fewer.
    fn of(&self, rank: usize) -> f64 {
        self.ranked[rank.min(self.ranked.len() - 1)]
    }
}

/// How values of the parameter follow one another.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Along {
    /// By ratios.
    Ratio,
    /// By ratios too: a period, beside a delay of so many seconds.
    Period(f64),
    /// A delay in samples.
    Samples,
}

impl Along {
    /// The period, beside this delay; one in samples follows it.
    pub fn period(delay: Delay) -> Along {
        match delay {
            Delay::Seconds(delay) if delay > 0.0 => Along::Period(delay),
            Delay::Seconds(_) | Delay::Samples(_) => Along::Ratio,
        }
    }

    /// The delay in samples.
    fn samples(self, x: f64) -> f64 {
        match self {
            Along::Ratio => 0.0,
            Along::Period(delay) => delay / x,
            Along::Samples => x,
        }
    }

    /// Where the delay is so many samples.
    fn at(self, samples: f64) -> f64 {
        match self {
            Along::Period(delay) => delay / samples,
            Along::Ratio | Along::Samples => samples,
        }
    }

    /// The end of the interval that begins at `a`, `ratio` times that where nothing else sets it.
    fn next(self, a: f64, ratio: f64) -> f64 {
        match self {
            Along::Ratio => a * ratio,
            Along::Samples => (a + 1e-6 + (0.3 * a).max(1.0)).floor(),
            Along::Period(delay) => {
                let b = a * ratio;
                // Onto a whole sample, where there is one on the way.
                let samples = (delay / b).round().max(1.0);
                let whole = delay / samples;
                if whole > a * (1.0 + 1e-6) && whole < b * ratio { whole } else { b }
            }
        }
    }

    /// A value between a and b.
    fn middle(self, a: f64, b: f64) -> f64 {
        let middle = match self {
            Along::Samples => 0.5 * (a + b),
            Along::Ratio | Along::Period(_) => a * (b / a).sqrt(),
        };
        if (self.samples(a) - self.samples(b)).abs() <= 1.0 + 1e-6 {
            return middle;
        }
        let half = self.at(self.samples(middle).floor() + 0.5);
        if half > a && half < b { half } else { middle }
    }

    fn is_narrow(self, a: f64, b: f64) -> bool {
        match self {
            Along::Samples => b - a < NARROW,
            Along::Ratio | Along::Period(_) => b - a < NARROW * b,
        }
    }
}

/// A value and what is seen there.
type Look = (f64, Heights);

struct Follow<F> {
    f: F,
    along: Along,
    looks: usize,
}

/// The largest x in [low, high] up to which no height has been above 0, within `tolerance` of itself and at most that, or `None`
/// where none ever is.
pub(crate) fn first_rise(
    f: impl FnMut(f64) -> Result<Heights, Error>,
    along: Along,
    low: f64,
    high: f64,
    tolerance: f64,
) -> Result<Option<f64>, Error> {
    let mut follow = Follow { f, along, looks: 0 };
    let mut a = follow.look(low)?;
    if a.1.top() > 0.0 {
        return Ok(Some(low));
    }
    let ratio = 10f64.powf(1.0 / PER_DECADE).max((high / low).powf(1.0 / INTERVALS));
    while a.0 < high {
        let next = along.next(a.0, ratio);
        let b = follow.look(if next > a.0 { next.min(high) } else { high })?;
        let middle = follow.middle(&a, &b)?;
        if let Some([below, above]) = follow.between(&a, &middle, &b)? {
            let mut top = |x: f64| Ok((follow.f)(x)?.top());
            return crossing(&mut top, (below.0, below.1.top()), (above.0, above.1.top()), tolerance).map(Some);
        }
        a = b;
    }
    Ok(None)
}

impl<F: FnMut(f64) -> Result<Heights, Error>> Follow<F> {
    fn look(&mut self, x: f64) -> Result<Look, Error> {
        Ok((x, (self.f)(x)?))
    }

    fn middle(&mut self, a: &Look, b: &Look) -> Result<Look, Error> {
        self.look(self.along.middle(a.0, b.0))
    }

    /// Two values, the first not above 0 and the second above, with nothing above 0 before the first.
    fn between(&mut self, a: &Look, m: &Look, b: &Look) -> Result<Option<[Look; 2]>, Error> {
        if is_clear([&a.1, &m.1, &b.1]) {
            return Ok(None);
        }
        if self.along.is_narrow(a.0, b.0) || self.looks > LOOKS {
            return self.at_once(a, m, b);
        }
        self.looks += 2;
        let left = self.middle(a, m)?;
        if let Some(found) = self.between(a, &left, m)? {
            return Ok(Some(found));
        }
        let right = self.middle(m, b)?;
        self.between(m, &right, b)
    }

    /// The same of an interval that is not halved any more.
    fn at_once(&mut self, a: &Look, m: &Look, b: &Look) -> Result<Option<[Look; 2]>, Error> {
        if m.1.top() > 0.0 {
            return Ok(Some([a.clone(), m.clone()]));
        }
        if b.1.top() > 0.0 {
            return Ok(Some([m.clone(), b.clone()]));
        }
        if m.1.top() >= a.1.top() && m.1.top() >= b.1.top() && m.1.top() > a.1.top().min(b.1.top()) {
            let mut top = |x: f64| Ok((self.f)(x)?.top());
            let x = summit(&mut top, a.0, b.0)?.0;
            let found = self.look(x)?;
            if found.1.top() > 0.0 {
                return Ok(Some([a.clone(), found]));
            }
        }
        Ok(None)
    }
}

/// Whether nothing in the interval with these heights at its ends and in its middle comes near 0.
fn is_clear(three: [&Heights; 3]) -> bool {
    let ranks = three.iter().map(|heights| heights.ranked.len()).max().unwrap_or(0);
    let noise = three.iter().map(|heights| heights.noise).fold(0.0, f64::max);
    (0..ranks).all(|rank| {
        let [a, m, b] = three.map(|heights| heights.of(rank));
        let (most, least) = (a.max(m).max(b), a.min(m).min(b));
        most <= 0.0 && most + CLEAR * (most - least) <= CLEAR * 8.0 * noise
    })
}

/// A maximum between a and b, by golden section; at once when one above 0 is met.
fn summit(f: &mut impl FnMut(f64) -> Result<f64, Error>, mut a: f64, mut b: f64) -> Result<(f64, f64), Error> {
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

/// The last x before f rises above 0 between a, where it is not, and b, where it is: regula falsi with the Illinois
/// correction (Dowell and Jarratt, BIT 11, 1971), within `tolerance` of x. Where one step after the other does not halve what is left, the second is followed by
/// one that does, the third by two, and so on: f may be flat up to where it rises, another eigenvalue's rounding, and tell a secant
/// nothing.
pub(crate) fn crossing(
    f: &mut impl FnMut(f64) -> Result<f64, Error>,
    mut a: (f64, f64),
    mut b: (f64, f64),
    tolerance: f64,
) -> Result<f64, Error> {
    let (mut wa, mut wb) = (a.1, b.1);
    // Halvings still to come, and how many the next idle step costs.
    let (mut halvings, mut cost) = (0, 0);
    for _ in 0..120 {
        let width = b.0 - a.0;
        let middle = 0.5 * (a.0 + b.0);
        if middle <= a.0 || middle >= b.0 || width < tolerance.max(2.0 * f64::EPSILON) * b.0 {
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
        let found = first_rise(|x| Ok(Heights::one((-x).sin())), Along::Ratio, 0.1, 100.0, 0.0).unwrap().unwrap();
        assert!((found - std::f64::consts::PI).abs() < 1e-14, "{found}");
    }

    #[test]
    fn an_island_between_the_points_is_found() {
        // Above 0 for |ln x| < 0.01, an eighth of the grid's spacing.
        let island = |x: f64| Ok(Heights::one(1e-4 - x.ln().powi(2)));
        let found = first_rise(island, Along::Ratio, 0.0123, 98.7, 0.0).unwrap().unwrap();
        assert!((found.ln() + 0.01).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_root_that_rises_below_a_slower_one_is_found() {
        // A root that hardly decays is the largest all along; another rises above 0 for a fiftieth of a decade and falls back.
        for place in 0..40 {
            let at = 0.31 + 0.0171 * f64::from(place);
            let hump = |x: f64| 1e-3 - 0.5 * (x.log10() - at).abs().min(1.0);
            let both = |x: f64| Ok(Heights::new([-1e-9, hump(x)].into_iter(), -5.0, 0.0));
            let found = first_rise(both, Along::Ratio, 0.01, 1e3, 0.0).unwrap().unwrap();
            assert!((found.log10() - (at - 2e-3)).abs() < 1e-12, "{found}");
        }
    }

    #[test]
    fn a_fraction_of_a_sample_is_seen_however_many_samples_the_delay_has() {
        // Not above 0 on whole samples, above it between two.
        let fraction = |x: f64| Ok(Heights::one((std::f64::consts::PI * x).sin().abs() - 1e-3));
        for samples in [0.0, 1.0, 7.0, 33.0, 200.0] {
            let found = first_rise(fraction, Along::Samples, samples, 500.0, 0.0).unwrap().unwrap();
            assert!((found - samples - 1e-3 / std::f64::consts::PI).abs() < 1e-6, "{samples}: {found}");
            let by_period = |period: f64| fraction(1.0 / period);
            let whole = 1.0 / (samples + 1.0);
            let found = first_rise(by_period, Along::Period(1.0), whole, 10.0, 0.0).unwrap().unwrap();
            assert!(found >= whole && found < whole * (1.0 + 1e-3), "{samples}: {found}");
        }
    }

    /// What an eigenvalue on the circle beside the one that leaves it makes of a growth.
    #[test]
    fn where_a_flat_function_rises_is_found_in_little_more_than_halvings() {
        for power in [1, 2, 3] {
            let mut asked = 0;
            let mut kinked = |x: f64| {
                asked += 1;
                Ok((x - 2.4e-3).max(0.0).powi(power) - 1e-30)
            };
            let found = crossing(&mut kinked, (2.2e-3, -1e-30), (2.6e-3, 2e-4_f64.powi(power)), 0.0).unwrap();
            let reached = 2.4e-3 + 1e-30_f64.powf(1.0 / f64::from(power));
            assert!((found / reached - 1.0).abs() < 1e-15, "{power}: {found}");
            // A bracket of a sixth of x has 49 halvings to the last digit.
            assert!(asked < 70, "{power}: {asked}");
        }
    }

    #[test]
    fn a_function_below_zero_has_none() {
        assert_eq!(first_rise(|x| Ok(Heights::one(-x)), Along::Ratio, 0.1, 10.0, 0.0).unwrap(), None);
    }
}
