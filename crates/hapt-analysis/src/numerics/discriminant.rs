//! Whether roots that move with a parameter stay inside the unit circle between its samples.
//!
//! ```text
//! f = ∏ (1 - λ_i λ_j),  i ≤ j
//! ```
//!
//! over the roots near the circle is positive inside, and changes its sign where a real root or one pair leaves (Orlando 1911; the last
//! of Jury's determinants). A single root turns sharply where two roots of nearly one angle meet: there is where narrow windows of
//! instability stand. f is a symmetric function of the roots, which passes such a place smoothly, so that few samples tell its least
//! value, however narrow the window.

use nalgebra::Complex;

/// Most roots whose f is computed.
pub(crate) const MOST: usize = 20;

/// Least ratio of the decays at which roots part into those near the circle and others.
const APART: f64 = 1.25;

/// Number of places in an interval where its polynomial is evaluated.
const PLACES: usize = 32;

/// Steps to the bottom between two of them: to 1e-8 of the interval.
const THIRDS: usize = 40;

/// A root: μ = λ - 1 of one of a pair, Im μ ≥ 0, and ln |λ|/T.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving {
    pub less_one: Complex<f64>,
    pub growth: f64,
}

impl Moving {
    fn count(&self) -> usize {
        if self.less_one.im > 0.0 { 2 } else { 1 }
    }
}

/// The roots at one parameter, the slowest decay first, and the growth below which they are not listed.
#[derive(Clone, Copy)]
pub(crate) struct Near<'a> {
    pub at: f64,
    pub roots: &'a [Moving],
    pub floor: f64,
}

impl Near<'_> {
    /// The growth of the root after the first `count`, and the least growth of these; `None` where these part a pair, or are too many.
    fn parted(&self, count: usize) -> Option<[f64; 2]> {
        let mut sum = 0;
        for (i, root) in self.roots.iter().enumerate() {
            sum += root.count();
            if sum >= count {
                let next = self.roots.get(i + 1).map_or(self.floor, |root| root.growth.max(self.floor));
                return (sum == count && root.growth > self.floor).then_some([next, root.growth]);
            }
        }
        None
    }

    /// ln f of the first `count` roots; `None` where f is not positive.
    fn log(&self, count: usize) -> Option<f64> {
        let mut all: Vec<Complex<f64>> = Vec::with_capacity(count);
        for root in self.roots {
            if all.len() == count {
                break;
            }
            all.push(root.less_one);
            if root.less_one.im > 0.0 {
                all.push(root.less_one.conj());
            }
        }
        // 1 - λ_i λ_j = -(μ_i + μ_j + μ_i μ_j). Factors come in conjugate pairs, or are real and positive inside.
        let (mut sum, mut product) = (0.0, 1.0);
        for (i, a) in all.iter().enumerate() {
            for b in &all[..=i] {
                product *= (a + b + a * b).norm_sqr();
            }
            sum += 0.5 * product.ln();
            product = 1.0;
        }
        sum.is_finite().then_some(sum)
    }
}

/// Whether f stays positive over the interval of these five samples, in increasing order, whose roots are all inside: the polynomial
/// through them does, by more than its last term. True where there are no such roots, or more than [`MOST`].
pub(crate) fn stay_inside(samples: [Near<'_>; 5]) -> bool {
    let most = samples.iter().map(|near| near.roots.iter().map(Moving::count).sum::<usize>()).min().unwrap_or(0);
    if most == 0 || most > MOST {
        return true;
    }
    // As many as part from the rest at every sample, clearly if possible.
    let parts = |count: usize, ratio: f64| {
        samples.iter().all(|near| near.parted(count).is_some_and(|[next, least]| next <= ratio * least))
    };
    let Some(count) = [APART, 1.0].into_iter().find_map(|ratio| (1..=most).rev().find(|count| parts(*count, ratio)))
    else {
        return false;
    };
    let Some(logs) = samples.iter().map(|near| near.log(count)).collect::<Option<Vec<f64>>>() else { return false };
    let (from, to) = (samples[0].at.ln(), samples[4].at.ln());
    let x = samples.map(|near| (near.at.ln() - from) / (to - from));
    let largest = logs.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
    // Where f changes by orders of magnitude, it is a polynomial over the exponential between both ends, or itself: a window at one end of
    // the interval is seen by the latter. Both have to be positive.
    let over = |base: &dyn Fn(f64) -> f64| is_positive(x, std::array::from_fn(|i| (logs[i] - base(x[i])).exp()));
    over(&|x| logs[0] + (logs[4] - logs[0]) * x) && over(&|_| largest)
}

/// Whether the polynomial through these values at x in [0, 1] is positive between them, by more than its last term.
fn is_positive(x: [f64; 5], mut c: [f64; 5]) -> bool {
    // Divided differences.
    for order in 1..5 {
        for i in (order..5).rev() {
            c[i] = (c[i] - c[i - 1]) / (x[i] - x[i - order]);
        }
    }
    let least = |at: f64| {
        let last = c[4] * (at - x[0]) * (at - x[1]) * (at - x[2]) * (at - x[3]);
        let before = (0..4).rev().fold(0.0, |sum, i| sum * (at - x[i]) + c[i]);
        before + last.min(0.0) - last.abs()
    };
    // A window is narrower than the places are apart: its bottom is looked for wherever a place is below its neighbours.
    let places: Vec<f64> = (0..=PLACES).map(|i| least(i as f64 / PLACES as f64)).collect();
    (1..PLACES).all(|i| {
        let is_lowest = places[i] <= places[i - 1] && places[i] <= places[i + 1];
        places[i] > 0.0 && (!is_lowest || bottom([i - 1, i + 1].map(|i| i as f64 / PLACES as f64), &least) > 0.0)
    })
}

/// The least value of a function with one minimum between two places, by thirds.
fn bottom([mut from, mut to]: [f64; 2], f: &impl Fn(f64) -> f64) -> f64 {
    for _ in 0..THIRDS {
        let third = (to - from) / 3.0;
        let [left, right] = [from + third, to - third];
        if f(left) < f(right) {
            to = right;
        } else {
            from = left;
        }
    }
    f(0.5 * (from + to))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pairs whose coupling of size `w` feeds them around the parameter `at`: λ² of the detuning.
    fn pairs(x: f64, at: f64, decay: f64, w: f64) -> Vec<Moving> {
        // Amplitudes a and b*: ȧ = (iδ - σ) a + w b*, ḃ* = (-iδ - σ) b* + w a, rates -σ ± √(w² - δ²).
        let detuned = Complex::from(w * w - (x - at) * (x - at)).sqrt();
        let mut roots: Vec<Moving> = [detuned, -detuned]
            .into_iter()
            .map(|rate| {
                let log = rate - decay + Complex::new(0.0, 1.0);
                Moving { less_one: log.exp() - 1.0, growth: log.re }
            })
            .collect();
        roots.sort_by(|a, b| b.growth.total_cmp(&a.growth));
        roots
    }

    fn judged(at: f64, decay: f64, w: f64) -> bool {
        let x = [1.0, 1.05, 1.1, 1.15, 1.2];
        let roots = x.map(|x| pairs(x, at, decay, w));
        roots.iter().all(|roots| roots[0].growth < 0.0)
            && stay_inside([0, 1, 2, 3, 4].map(|i| Near { at: x[i], roots: &roots[i], floor: -1.0 }))
    }

    #[test]
    fn a_window_far_narrower_than_the_samples_is_seen() {
        for i in 0..50 {
            let at = 1.0 + 0.2 * (f64::from(i) + 0.3) / 50.0;
            for w in [1e-2, 1e-3, 1e-5] {
                assert!(!judged(at, 0.5 * w, w), "{at} {w}");
            }
            // A feed that the decay outweighs by far.
            assert!(judged(at, 0.3, 1e-3), "{at}");
        }
    }
}
