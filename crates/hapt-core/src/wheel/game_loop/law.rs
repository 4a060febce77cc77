//! The law that a game computes, found from its levels and the wheel's motion.
//!
//! Level and position are taken without their slow parts. A level is then -K times the position that the game has used, plus a part that
//! does not depend on the motion. For each of a grid of lags the least squares of levels on positions give a stiffness and a residual; old
//! frames count less. The lags whose residual is not significantly larger than the least one are the interval of the lateness. Torques that
//! do not depend on the wheel's motion, of kerbs, engines and collisions, are residual, and a frame that is far outside of the others has
//! little weight. A frame in which the wheel stands still is not used, so that the law is kept during a menu.

use super::cost::HostTime;
use crate::Real;
use crate::contact::within;

/// Lags of the search.
const LAGS: usize = 32;
/// From one lag to the next, s, where the period allows it, for the first [`EVEN`] lags.
const LAG: f64 = 2.5e-3;
const EVEN: usize = 20;
/// Beyond, each lag is larger than the one before by this factor, up to a quarter of a second: the car's own response to the steering is
/// late.
const RATIO: f64 = 1.14;
const RING: usize = 1024;
/// The time constant of the slow parts, s.
const SLOW: f64 = 0.2;
/// Frames count less by a factor of e after this time in motion, s.
const MEMORY: f64 = 1.0;
/// The least time between two frames that are used, s.
pub(super) const SPAN: f64 = 0.012;
/// A level that stays is used after this many of its usual intervals: a law at its largest torque stays.
const STAYS: f64 = 3.0;
/// Below this, rad/s, intervals are not those of a game's frames.
const SLOW_SPEED: f64 = 0.2;
/// An interval beyond this is a pause, s.
const PAUSE: f64 = 0.5;
/// A level that has not changed for this time is no loop, s. A law at its largest torque does not change either, while the wheel swings far
/// out.
const SILENCE: f64 = 2.0;
/// The half width of an interval, in standard errors.
const ERRORS: f64 = 3.0;
/// The relative systematic error by which a stiffness may be too large: a level's slow part is later than the level by half of its hold.
const TOO_LARGE: f64 = 0.05;
/// The standard errors beyond which a stiffness is significant.
const DECIDED: f64 = 4.0;
/// The least number of frames for a result.
const FEWEST: f64 = 5.0;

/// The law from the wheel's position to a game's level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GameLaw<F> {
    /// N·m/rad, positive where the torque pulls back; negative where it pushes away.
    pub stiffness: F,
    /// Least and most.
    pub stiffness_range: [F; 2],
    /// From a position of the wheel to the level that belongs to it, s.
    pub lateness: F,
    /// Least and most.
    pub lateness_range: [F; 2],
    /// The mean interval of levels while the wheel moves, s.
    pub hold: F,
    /// The mean deviation of intervals from it, s.
    pub uneven: F,
    /// The part of the levels' changes that the law explains, 0 to 1.
    pub explained: F,
    /// The lateness may be beyond the range of the search.
    pub beyond: bool,
    /// Of the possible stiffnesses and latenesses, those that require the most damping.
    pub worst: (F, HostTime<F>),
}

impl<F: Real> GameLaw<F> {
    /// The effect of its lateness on the wheel's damping, N·m·s/rad: negative where it reduces the damping.
    pub fn damping(&self) -> F {
        -(self.stiffness * (self.lateness + F::HALF * self.hold))
    }
}

/// Finds the law; compiled for a loop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search<F> {
    period: F,
    /// Samples.
    lags: [usize; LAGS],
    /// The position without its slow part below which the wheel counts as at rest, rad.
    rest: F,
    /// The weight of a new value in a slow part.
    slow: F,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums<F> {
    /// Of positions squared, and of positions times levels.
    squares: F,
    products: F,
}

/// Its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Memory<F> {
    /// Positions without their slow part.
    ring: [F; RING],
    /// The newest.
    at: usize,
    /// Positions in the ring.
    filled: usize,
    /// Samples since the last frame, and since the last one that was used.
    since: usize,
    unseen: usize,
    /// The slow parts of position and level.
    slow: (F, F),
    /// The last position without its slow part, and the displacement since the last frame.
    quick: F,
    moved: F,
    sums: [Sums<F>; LAGS],
    /// Of levels squared.
    squares: F,
    /// Frames that count.
    frames: F,
    hold: F,
    uneven: F,
    /// The index of the best lag.
    best: usize,
    /// The stiffness there.
    stiffness: F,
}

impl<F: Real> Search<F> {
    pub fn new(period: f64, count: f64) -> Self {
        let of = F::from_f64;
        let mut lags = [0; LAGS];
        let mut time = 0.0;
        for (index, lag) in lags.iter_mut().enumerate().skip(1) {
            time = if index <= EVEN { LAG * index as f64 } else { time * RATIO };
            // At least a sample each, in a ring that holds them.
            *lag = (libm::ceil(time / period) as usize).max(index).min(RING - LAGS + index);
        }
        Search { period: of(period), lags, rest: of((3.0 * count).max(1e-5)), slow: of(period / (period + SLOW)) }
    }

    pub fn start(&self) -> Memory<F> {
        let zero = F::ZERO;
        Memory {
            ring: [zero; RING],
            at: 0,
            filled: 0,
            // There has been no frame.
            since: usize::MAX,
            unseen: usize::MAX,
            slow: (zero, zero),
            quick: zero,
            moved: zero,
            sums: [Sums { squares: zero, products: zero }; LAGS],
            squares: zero,
            frames: zero,
            hold: zero,
            uneven: zero,
            best: 0,
            stiffness: zero,
        }
    }

    /// A sample, with the host's level in N·m, which it has just changed or not. Where a frame has been used in motion, returns the present
    /// estimate of the law.
    pub fn sample(&self, memory: &mut Memory<F>, position: F, level: F, changed: bool) -> Option<Option<GameLaw<F>>> {
        if memory.filled == 0 {
            memory.slow = (position, level);
        }
        memory.slow.0 += self.slow * (position - memory.slow.0);
        memory.slow.1 += self.slow * (level - memory.slow.1);
        memory.at = (memory.at + 1) % RING;
        let quick = position - memory.slow.0;
        let travel = quick - core::mem::replace(&mut memory.quick, quick);
        memory.moved += travel.abs();
        if let Some(place) = memory.ring.get_mut(memory.at) {
            *place = quick;
        }
        memory.filled = if memory.filled < RING { memory.filled + 1 } else { RING };
        memory.since = memory.since.saturating_add(1);
        memory.unseen = memory.unseen.saturating_add(1);
        if memory.filled <= self.lags.last().copied().unwrap_or(0) {
            return None;
        }
        let interval = self.time(memory.since);
        let is_pause = interval > F::from_f64(PAUSE);
        if changed {
            memory.since = 0;
            // In slow motion a level stays for several frames.
            if !is_pause && memory.moved > F::from_f64(SLOW_SPEED) * interval {
                memory.rhythm(interval);
            }
            memory.moved = F::ZERO;
        }
        let elapsed = self.time(memory.unseen);
        let stays = elapsed > F::from_f64(STAYS) * memory.hold;
        if is_pause || elapsed < F::from_f64(SPAN) || !(changed || stays) {
            return None;
        }
        memory.unseen = 0;
        let (mut positions, mut most) = ([F::ZERO; LAGS], F::ZERO);
        for (lag, place) in positions.iter_mut().enumerate() {
            *place = memory.ring.get(self.place(memory, lag)).copied().unwrap_or(F::ZERO);
            let size = place.abs();
            most = if size > most { size } else { most };
        }
        if most < self.rest {
            return None;
        }
        memory.learn(&positions, level - memory.slow.1, elapsed);
        if !(memory.squares.is_finite() && memory.sums.iter().all(|sums| sums.squares.is_finite())) {
            *memory = self.start();
            return None;
        }
        let law = self.law(memory);
        // A motion that is small compared with those in the sums is not used.
        let usual = memory.sums.get(memory.best).map_or(F::ZERO, |sums| sums.squares);
        (most * most * memory.frames > F::from_f64(0.01) * usual).then_some(law)
    }

    /// The index in the ring of the position of `lag` samples ago.
    fn place(&self, memory: &Memory<F>, lag: usize) -> usize {
        (memory.at + RING - self.samples(lag)) % RING
    }

    /// Of a lag.
    fn samples(&self, lag: usize) -> usize {
        self.lags.get(lag).copied().unwrap_or(0)
    }

    /// From a lag to the next larger one, s.
    fn gap(&self, lag: usize) -> F {
        let next = if lag + 1 < LAGS { lag + 1 } else { lag };
        let before = if next > 0 { next - 1 } else { 0 };
        self.time(self.samples(next) - self.samples(before))
    }

    fn time(&self, samples: usize) -> F {
        F::from_f64(samples as f64) * self.period
    }

    /// Whether the host has changed its level lately.
    pub fn is_live(&self, memory: &Memory<F>) -> bool {
        self.time(memory.since) < F::from_f64(SILENCE)
    }

    /// The law by the sums.
    fn law(&self, memory: &mut Memory<F>) -> Option<GameLaw<F>> {
        let of = F::from_f64;
        let least = memory.squares * of(1e-6);
        let residual = |sums: &Sums<F>| {
            let explained = if sums.squares > F::ZERO { sums.products * sums.products / sums.squares } else { F::ZERO };
            let rest = memory.squares - explained;
            if rest > least { rest } else { least }
        };
        let mut residuals = [F::ZERO; LAGS];
        let (mut best, mut smallest) = (0, F::MAX);
        for (lag, (place, sums)) in residuals.iter_mut().zip(&memory.sums).enumerate() {
            *place = residual(sums);
            if *place < smallest {
                (best, smallest) = (lag, *place);
            }
        }
        let free = memory.frames - F::ONE - F::ONE;
        let free = if free > F::HALF { free } else { F::HALF };
        // With few frames a law may fit by chance.
        let chance = F::ONE + of(4.0) / free;
        let of_lag = |lag: usize| {
            let sums = memory.sums.get(lag).copied().unwrap_or(Sums { squares: F::ZERO, products: F::ZERO });
            if sums.squares > F::ZERO {
                (-(sums.products / sums.squares), chance * (smallest / (sums.squares * free)).sqrt())
            } else {
                (F::ZERO, F::MAX)
            }
        };
        let (stiffness, error) = of_lag(best);
        (memory.best, memory.stiffness) = (best, stiffness);
        if memory.frames < of(FEWEST) || stiffness.abs() < of(DECIDED) * error {
            return None;
        }
        // Neighbours of the best lag whose residual may be as small.
        let bound = smallest * (F::ONE + of(ERRORS * ERRORS) * chance / free);
        let fits = |lag: &usize| residuals.get(*lag).is_some_and(|residual| *residual <= bound);
        let first = (0..best).rev().take_while(|lag| fits(lag)).last().unwrap_or(best);
        let last = (best + 1..LAGS).take_while(|lag| fits(lag)).last().unwrap_or(best);
        let time = |lag: usize| self.time(self.samples(lag));
        let hold = memory.hold + of(ERRORS) * memory.uneven;
        let (mut worst, mut dearest) = ((F::ZERO, HostTime { hold, lateness: F::ZERO }), F::ZERO);
        let mut range = [stiffness, stiffness];
        for lag in first..=last {
            let (stiffness, error) = of_lag(lag);
            let (wide, smaller) = (of(ERRORS) * error, stiffness * of(1.0 - TOO_LARGE));
            let (low, high) = if stiffness > F::ZERO {
                (smaller - wide, stiffness + wide)
            } else {
                (stiffness - wide, smaller + wide)
            };
            range[0] = if low < range[0] { low } else { range[0] };
            range[1] = if high > range[1] { high } else { range[1] };
            let steepest = stiffness.abs() + wide;
            let host = HostTime { hold, lateness: time(lag) + F::HALF * self.gap(lag) };
            let cost = steepest * host.cost();
            if cost > dearest {
                (worst, dearest) = ((steepest, host), cost);
            }
        }
        let early = time(first) - self.gap(first);
        Some(GameLaw {
            stiffness,
            stiffness_range: range,
            lateness: time(best) + self.gap(best) * between(&residuals, best),
            lateness_range: [if early > F::ZERO { early } else { F::ZERO }, time(last) + self.gap(last)],
            hold: memory.hold,
            uneven: memory.uneven,
            explained: if memory.squares > F::ZERO { F::ONE - smallest / memory.squares } else { F::ZERO },
            beyond: last + 1 == LAGS,
            worst,
        })
    }
}

/// The distance of the least residual from its lag, in lags: the vertex of the parabola through its neighbours.
fn between<F: Real>(residuals: &[F; LAGS], best: usize) -> F {
    let at = |lag: usize| residuals.get(lag).copied();
    let neighbours = best.checked_sub(1).and_then(at).zip(at(best)).zip(at(best + 1));
    let Some(((before, here), after)) = neighbours else { return F::ZERO };
    let bend = before - (here + here) + after;
    if bend > F::ZERO { within(F::HALF * (before - after) / bend, -F::HALF, F::HALF) } else { F::ZERO }
}

impl<F: Real> Memory<F> {
    /// Updates the interval of the levels, from an interval in motion.
    fn rhythm(&mut self, interval: F) {
        if self.hold > F::ZERO {
            let off = interval - self.hold;
            self.hold += off * F::from_f64(0.125);
            self.uneven += (off.abs() - self.uneven) * F::from_f64(0.125);
        } else {
            self.hold = interval;
        }
    }

    fn learn(&mut self, positions: &[F; LAGS], level: F, elapsed: F) {
        let of = F::from_f64;
        // A level far outside of the others counts as one three deviations away.
        let surprise = level + self.stiffness * positions.get(self.best).copied().unwrap_or(F::ZERO);
        let (mut weight, square) = (F::ONE, surprise * surprise);
        if self.frames > of(8.0) {
            let best = self.sums.get(self.best).copied().unwrap_or(Sums { squares: F::ZERO, products: F::ZERO });
            let explained = if best.squares > F::ZERO { best.products * best.products / best.squares } else { F::ZERO };
            let usual = of(9.0) * (self.squares - explained) / self.frames;
            let floor = of(1e-6) * self.squares / self.frames;
            let usual = if usual > floor { usual } else { floor };
            if square > usual {
                weight = usual / square;
            }
        }
        let kept = of(MEMORY) / (of(MEMORY) + elapsed);
        for (sums, position) in self.sums.iter_mut().zip(positions) {
            sums.squares = kept * sums.squares + weight * *position * *position;
            sums.products = kept * sums.products + weight * *position * level;
        }
        self.squares = kept * self.squares + weight * level * level;
        self.frames = kept * self.frames + weight;
    }
}
