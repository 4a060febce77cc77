//! The pattern of intervals and delays under which the hands-off loop grows most.
//!
//! From several starts the motion takes the step, of a few intervals and delays, that lengthens the state most in a norm of the even loop.
//! Where the state comes back to its direction, the steps since then are repeated as a pattern. Its growth is that of the eigenvalues of
//! their product. Single steps are then exchanged as long as that increases the growth. Every choice is fixed: the same loop has the same
//! pattern.

use nalgebra::{DMatrix, DVector};

use crate::error::Error;
use crate::numerics::eigenvalues::eigenvalues;
use crate::stability::patterns::common::Norm;
use crate::stability::patterns::family::{Cell, Family, Step};
use crate::until::is_over;

/// Steps of one motion, and the longest pattern in it.
const MOTION: usize = 500;
const MAX_PATTERN_SAMPLES: usize = 240;
/// Times that a step follows another in the first patterns.
const MOST_OF_ONE: usize = 2;
/// Starts of a motion.
const STARTS: usize = 3;
/// Patterns of one motion whose product is taken.
const TRIED: usize = 3;
/// Rounds of exchanges.
const ROUNDS: usize = 4;
/// A shorter pattern counts as the worst where it grows by this part of the largest growth.
const NEARLY: f64 = 0.95;

/// Steps that repeat, and the growth under them, 1/s.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WorstPattern {
    pub steps: Vec<Step>,
    pub growth_per_s: f64,
    /// ln of the modulus of the largest eigenvalue of the whole pattern.
    pub ln_abs: f64,
}

/// A map in the coordinates of a norm, less 1.
struct Choice {
    step: Step,
    d: DMatrix<f64>,
}

struct Search {
    choices: Vec<Choice>,
    best: Option<(Vec<usize>, f64, f64)>,
    /// Every pattern that grows, with its rate and ln |λ|.
    growing: Vec<(Vec<usize>, f64, f64)>,
}

/// The pattern of the steps within `all` that was found to grow most, or to decay least. `None` for a loop without states.
///
/// # Errors
/// [`Error::Eigenvalues`], [`Error::Stopped`].
pub(crate) fn worst(family: &Family<'_>, all: Cell, even: Step, norm: &Norm) -> Result<Option<WorstPattern>, Error> {
    if family.order() == 0 {
        return Ok(None);
    }
    let [[least, longest], [soon, late]] = [all.interval, all.delay];
    let mut steps = vec![even];
    for interval in [least, 0.5 * (least + even.interval), even.interval, 0.5 * (even.interval + longest), longest] {
        for delay in [soon, late.min(interval)] {
            let step = Step { interval, delay };
            if !steps.contains(&step) {
                steps.push(step);
            }
        }
    }
    let choices: Vec<Choice> =
        steps.iter().map(|step| Choice { step: *step, d: norm.scaled(&family.at(*step)) }).collect();
    let mut search = Search { choices, best: None, growing: Vec::new() };
    for i in 0..search.choices.len() {
        search.take(vec![i])?;
    }
    // One step and a few of another, such as a long one after short ones that a lagging motor does not forget.
    for i in 0..search.choices.len() {
        for j in (0..search.choices.len()).filter(|j| *j != i) {
            for times in 1..=MOST_OF_ONE {
                let mut pattern = vec![i];
                pattern.extend(std::iter::repeat_n(j, times));
                search.take(pattern)?;
            }
        }
    }
    for price in [0.0, search.rate()] {
        for start in 0..STARTS {
            let steps = search.motion(start, price);
            for pattern in steps {
                search.take(pattern)?;
            }
        }
    }
    search.exchange()?;
    let most = search.rate();
    let shortest =
        search.growing.iter().filter(|(_, rate, _)| *rate >= NEARLY * most).min_by_key(|(steps, ..)| steps.len());
    let best = if most > 0.0 { shortest.cloned() } else { search.best };
    Ok(best.map(|(pattern, growth_per_s, ln_abs)| {
        let steps = pattern.into_iter().map(|i| search.choices[i].step).collect();
        WorstPattern { steps, growth_per_s, ln_abs }
    }))
}

impl Search {
    fn rate(&self) -> f64 {
        self.best.as_ref().map_or(0.0, |(_, rate, _)| *rate)
    }

    fn time(&self, pattern: &[usize]) -> f64 {
        pattern.iter().map(|&i| self.choices[i].step.interval).sum()
    }

    /// Keeps the pattern if it grows more than the best so far; a longer one has to grow more than rounding does.
    fn take(&mut self, pattern: Vec<usize>) -> Result<bool, Error> {
        if is_over() {
            return Err(Error::Stopped);
        }
        let n = self.choices[0].d.nrows();
        let mut product = DMatrix::<f64>::zeros(n, n);
        for &i in &pattern {
            let d = &self.choices[i].d;
            product = d + &product + d * &product;
        }
        if !product.iter().all(|x| x.is_finite()) {
            return Ok(false);
        }
        let of = |mu: &nalgebra::Complex<f64>| 0.5 * (2.0 * mu.re + mu.norm_sqr()).max(-1.0).ln_1p();
        let ln_abs = eigenvalues(&product)?.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let rate = ln_abs / self.time(&pattern);
        let better = self.best.as_ref().is_none_or(|(_, best, _)| rate > best + 1e-6 * best.abs() + 1e-9);
        if ln_abs > 0.0 {
            self.growing.push((pattern.clone(), rate, ln_abs));
        }
        if better && rate.is_finite() {
            self.best = Some((pattern, rate, ln_abs));
        }
        Ok(better)
    }

    /// Patterns of the motion that takes the longest next state, less `price` for its time in 1/s.
    fn motion(&self, start: usize, price: f64) -> Vec<Vec<usize>> {
        let n = self.choices[0].d.nrows();
        let mut state = DVector::from_fn(n, |i, _| if start == 0 { 1.0 } else { ((i * 7 + 3 * start) as f64).sin() });
        state /= state.norm();
        let (mut taken, mut states, mut lengths, mut times) = (Vec::new(), vec![state.clone()], vec![0.0], vec![0.0]);
        let (mut length, mut time) = (0.0, 0.0);
        for _ in 0..MOTION {
            let mut best: Option<(f64, f64, usize, DVector<f64>)> = None;
            for (i, choice) in self.choices.iter().enumerate() {
                let next = &state + &choice.d * &state;
                let grown = next.norm().ln();
                let worth = grown - price * choice.step.interval;
                if best.as_ref().is_none_or(|(most, ..)| worth > most + 1e-12) {
                    best = Some((worth, grown, i, next));
                }
            }
            let Some((_, grown, i, next)) = best.filter(|(worth, ..)| worth.is_finite()) else { break };
            length += grown;
            time += self.choices[i].step.interval;
            state = &next / next.norm();
            taken.push(i);
            states.push(state.clone());
            lengths.push(length);
            times.push(time);
        }
        let end = taken.len();
        let mut returns: Vec<(f64, usize)> = (1..=MAX_PATTERN_SAMPLES.min(end / 2))
            .filter_map(|p| {
                let from = end - p;
                let turned = states[from].dot(&states[end]).powi(2);
                let rate = (lengths[end] - lengths[from]) / (times[end] - times[from]);
                // A deviation in direction reduces the growth.
                (turned > 0.9).then(|| (rate + turned.ln() / (times[end] - times[from]), p))
            })
            .collect();
        returns.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = returns.first().map_or(0.0, |(rate, _)| *rate);
        // The shortest that nearly grows as much, too: a long one may be a short one several times.
        let short = returns.iter().filter(|(rate, _)| *rate > 0.9 * most).map(|(_, p)| *p).min();
        let tried = short.into_iter().chain(returns.iter().take(TRIED).map(|(_, p)| *p));
        tried.map(|p| taken[end - p..].to_vec()).collect()
    }

    /// Exchanges steps of the best pattern, by what each adds to its eigenvalue to first order.
    fn exchange(&mut self) -> Result<(), Error> {
        for _ in 0..ROUNDS {
            let Some((pattern, rate, _)) = self.best.clone() else { return Ok(()) };
            let n = self.choices[0].d.nrows();
            let [mut right, mut left] = [DVector::from_element(n, 1.0), DVector::from_element(n, 1.0)];
            // Power iterations, over whole patterns.
            for _ in 0..(400 / pattern.len()).max(4) {
                for &i in &pattern {
                    right = &right + &self.choices[i].d * &right;
                }
                right /= right.norm();
                for &i in pattern.iter().rev() {
                    left = &left + self.choices[i].d.tr_mul(&left);
                }
                left /= left.norm();
            }
            // left_k: what counts after step k.
            let mut after = vec![left.clone()];
            for &i in pattern.iter().rev() {
                let next = &after[after.len() - 1] + self.choices[i].d.tr_mul(&after[after.len() - 1]);
                after.push(&next / next.norm());
            }
            let mut changed = pattern.clone();
            for (k, &i) in pattern.iter().enumerate() {
                let y = &after[pattern.len() - 1 - k];
                let worth = |choice: &Choice| {
                    let next = &right + &choice.d * &right;
                    y.dot(&next).abs().ln() - rate * choice.step.interval
                };
                let most = |best: usize, j: usize| {
                    if worth(&self.choices[j]) > worth(&self.choices[best]) + 1e-9 { j } else { best }
                };
                changed[k] = (0..self.choices.len()).fold(i, most);
                right = &right + &self.choices[i].d * &right;
                right /= right.norm();
            }
            if changed == pattern || !self.take(changed)? {
                return Ok(());
            }
        }
        Ok(())
    }
}
