//! Searches for the value of one number at which a world becomes certified, or ceases to be.

use hapt_model::World;

use crate::certificate::rounding::{Certified, roundest};
use crate::certificate::{excess_below, is_certified};
use crate::numerics::crossing::illinois;

/// Ratio of successive trials.
pub const STRIDE: f64 = 2.0;
/// Range of an outward search, as a ratio.
const MAX_RATIO: f64 = 1e9;
/// Relative tolerance of a search.
pub const WIDTH: f64 = 1e-7;
/// Relative damping margin with which a passive loop is taken as stable hands-off.
pub const SPARE: f64 = 1e-6;

pub fn changed(world: &World, change: impl FnOnce(&mut World)) -> bool {
    let mut world = world.clone();
    change(&mut world);
    is_certified(&world)
}

/// A world, and what a value of the search changes in it.
pub struct Change<'w, F> {
    pub world: &'w World,
    pub set: F,
}

impl<F: Fn(&mut World, f64)> Change<'_, F> {
    fn excess(&self, value: f64, spare: f64) -> f64 {
        let mut world = self.world.clone();
        (self.set)(&mut world, value);
        excess_below(&world, spare)
    }

    pub fn is_certified(&self, value: f64) -> bool {
        self.excess(value, 0.0) <= 0.0
    }

    /// The roundest certified value next to `end`, from the present one `now` upwards.
    pub fn largest_from(&self, now: f64, end: f64) -> f64 {
        roundest(end, Certified::Below, |x| *x >= now && self.is_certified(*x))
    }

    /// The last certified value on the way from a certified one to one that is not, to [`WIDTH`], as a round number.
    pub fn last(&self, good: f64, bad: f64) -> f64 {
        // The search runs upwards.
        let sign = if good < bad { 1.0 } else { -1.0 };
        let search = |spare: f64| {
            let excess = |x: f64| self.excess(sign * x, spare);
            let (from, to) = ((sign * good, excess(sign * good)), (sign * bad, excess(sign * bad)));
            if from.1 > 0.0 || to.1 <= 0.0 {
                return None;
            }
            illinois(&mut |x| Ok(excess(x)), from, to, WIDTH).ok().map(|x| sign * x)
        };
        let end = search(SPARE).filter(|end| self.is_certified(*end)).or_else(|| search(0.0)).unwrap_or(good);
        let side = if good < bad { Certified::Below } else { Certified::Above };
        roundest(end, side, |x| sign * x >= sign * good && self.is_certified(*x))
    }

    /// The first certified value below `now` in steps of [`STRIDE`], down to `down` times it, then the largest.
    pub fn largest_below(&self, now: f64, down: f64) -> Option<f64> {
        let mut bad = now;
        while bad > now * down {
            let good = (bad / STRIDE).max(now * down);
            if self.is_certified(good) {
                return Some(self.last(good, bad));
            }
            bad = good;
        }
        None
    }

    /// The first certified value from `good` upwards in steps of [`STRIDE`], then the least.
    pub fn least(&self, mut bad: f64, mut good: f64) -> Option<f64> {
        let far = MAX_RATIO * good;
        while !self.is_certified(good) {
            // 0 and infinity do not grow.
            if !(STRIDE * good > good && good <= far) {
                return None;
            }
            bad = good;
            good *= STRIDE;
        }
        Some(self.last(good, bad))
    }
}
