//! Fits on a bound: damping, friction and delay are 0 or more.
//!
//! Where the data hardly determine one of them, the least squares may lie below 0. Cutting the interval of that fit off at 0 leaves too
//! little of it, or nothing; and a damping below 0 is correlated with a wrong inertia and a wrong delay. So the squares are minimised again
//! with the bounds kept.
//!
//! The interval of a parameter at 0 goes from 0 to the larger of two ends. One is Student's t times the standard error: an estimate below 0
//! has no more information than one of 0, so the interval is never shorter than the resolution of the record. The other is the profile
//! likelihood's: the largest value with which the other parameters, fitted again within their own bounds, leave at most t² s² more than the
//! best fit. The distribution of that difference at a bound is half of χ² and half 0 (Chernoff 1954), so t² covers at least as often as
//! stated.

use crate::factor::Free;
use crate::fit::{Fit, fit};
use crate::puck::{DAMPING, DELAY, FRICTION, Puck};
use crate::quantile::student;
use crate::record::{CancellableRecord, LONGEST_DELAY};

/// Parameters that are never below 0 in a real puck.
const BOUNDED: [usize; 3] = [DAMPING, FRICTION, DELAY];
/// The bounds are certainly violated where keeping them costs this many standard errors.
const SURELY: f64 = 5.0;
/// A better fit found along a profile is followed at most this many times.
const ROUNDS: usize = 3;
/// A profile is evaluated at this many values at most, until its squares are within this part of t² s².
const PLACES: usize = 10;
const NEAR: f64 = 0.1;

/// The best fit within the bounds.
#[derive(Clone, Debug)]
pub(crate) struct Bounded {
    /// Every parameter of its `free` is in its covariance, also those at 0.
    pub fit: Fit,
    /// Pucks that the record allows, as far as profiles of parameters at 0 reach beyond their standard errors: every interval includes
    /// them.
    pub ends: Vec<Puck>,
}

/// The result of a profile of a parameter at 0.
enum Profile {
    Ends(Vec<Puck>),
    /// The fit was not the best.
    Better(Box<Fit>),
}

impl Bounded {
    /// From the best fit without bounds. Where the record certainly violates them, that fit is kept.
    pub fn new(record: &CancellableRecord<'_>, best: Fit) -> Self {
        if is_within(&best.puck, best.free) {
            return Bounded { fit: best, ends: Vec::new() };
        }
        let is_near = |fit: &Fit| {
            let more = fit.factor.squares - best.factor.squares;
            more < SURELY.powi(2) * best.variance() && fit.puck.delay < LONGEST_DELAY
        };
        let found = within(record, best.puck, best.free, best.first).filter(is_near);
        found.map_or(Bounded { fit: best, ends: Vec::new() }, |fit| Bounded::from_fit(record, fit))
    }

    fn from_fit(record: &CancellableRecord<'_>, mut fit: Fit) -> Self {
        for _ in 0..ROUNDS {
            match profiles(record, &fit) {
                Profile::Ends(ends) => return Bounded { fit, ends },
                Profile::Better(better) => fit = *better,
            }
        }
        Bounded { fit, ends: Vec::new() }
    }
}

fn is_within(puck: &Puck, free: Free) -> bool {
    let p = puck.parameters();
    BOUNDED.iter().all(|i| !free[*i] || p[*i] >= 0.0)
}

/// The least squares with the bounds kept, from `start`. Where the fit without bounds violates one, any set of the parameters may be at 0:
/// of those sets with which the other parameters stay above 0, the one with the least squares.
fn within(record: &CancellableRecord<'_>, start: Puck, free: Free, first: usize) -> Option<Fit> {
    let local = fit(record, start, free, first)?;
    if is_within(&local.puck, free) {
        return Some(local);
    }
    let p = local.puck.parameters();
    let sets = (1..1_usize << BOUNDED.len()).map(|set| {
        let at_0 = BOUNDED.iter().enumerate().filter(move |(k, _)| set >> k & 1 == 1);
        at_0.map(|(_, i)| *i).collect::<Vec<usize>>()
    });
    let fits = sets.filter(|set| set.iter().all(|i| free[*i])).filter_map(|set| {
        let (mut p, mut others) = (p, free);
        BOUNDED.iter().for_each(|i| p[*i] = p[*i].max(0.0));
        set.iter().for_each(|i| (p[*i], others[*i]) = (0.0, false));
        let found = fit(record, Puck::from_parameters(p), others, first)?;
        is_within(&found.puck, free).then_some(Fit { free, ..found })
    });
    fits.min_by(|a, b| a.factor.squares.total_cmp(&b.factor.squares))
}

/// The profiles of all parameters that a fit has at 0.
fn profiles(record: &CancellableRecord<'_>, fit: &Fit) -> Profile {
    let p = fit.puck.parameters();
    let mut ends = Vec::new();
    for i in BOUNDED.into_iter().filter(|i| fit.free[*i] && p[*i] == 0.0) {
        match profile(record, fit, i) {
            Profile::Ends(more) => ends.extend(more),
            better @ Profile::Better(_) => return better,
        }
    }
    Profile::Ends(ends)
}

/// Where the squares reach t² s² more than those of the fit, as parameter `i` goes up from 0.
fn profile(record: &CancellableRecord<'_>, fit: &Fit, i: usize) -> Profile {
    let mut ends = Vec::new();
    let Some(covariance) = fit.inverse() else { return Profile::Ends(ends) };
    let allowed = student(fit.freedom()).powi(2) * fit.variance();
    let most = if i == DELAY { LONGEST_DELAY } else { f64::INFINITY };
    let (mut inside, mut outside) = (0.0, f64::INFINITY);
    let mut place = (allowed * covariance[(i, i)]).sqrt().min(most);
    let mut start = fit.puck.parameters();
    // The other estimates change with this one.
    start.iter_mut().enumerate().for_each(|(j, p)| *p += covariance[(j, i)] / covariance[(i, i)] * place);
    let mut free = fit.free;
    free[i] = false;
    for _ in 0..PLACES {
        start[i] = place;
        let Some(there) = within(record, Puck::from_parameters(start), free, fit.first) else { break };
        let more = there.factor.squares - fit.factor.squares;
        if more < -NEAR * allowed {
            return within(record, there.puck, fit.free, fit.first)
                .filter(|better| better.factor.squares < fit.factor.squares)
                .map_or(Profile::Ends(ends), |better| Profile::Better(Box::new(better)));
        }
        if more <= allowed {
            (inside, start) = (place, there.puck.parameters());
            ends.push(there.puck);
        } else {
            outside = place;
        }
        // The standard error already reaches farther.
        let is_short = inside > 0.0 && inside < most && more < (1.0 - NEAR) * allowed;
        if !(is_short || inside > 0.0 && more > (1.0 + NEAR) * allowed) {
            break;
        }
        place = match outside.is_finite() {
            true => 0.5 * (inside + outside),
            false => (place * (allowed / more.max(NEAR * allowed)).sqrt().clamp(1.1, 2.0)).min(most),
        };
    }
    Profile::Ends(ends)
}
