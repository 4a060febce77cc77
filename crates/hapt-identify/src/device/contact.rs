//! The end stops that a record shows, and the device that explains it.
//!
//! Away from both ends of the travel the equation of motion gives inertia, damping and friction. A stop shows where the puck turns round
//! near an end and loses more velocity than these explain. The place, stiffness and damping of the stop are fitted to the hardest such
//! turn, and then all numbers to the whole record. Where that explains no record, the terms that the torque shows away from the ends, a
//! spring, gravity, cogging and changes of friction with the position, are fitted too.

use rayon::prelude::*;

use super::away::{Away, away, loaded};
use super::fit::{Fit, SHORTEST_LAG, Shot};
use super::parameters::{
    DAMPING, Device, FAST, FRICTION, Free, GRAVITY, INERTIA, LATE, OFFSET, PARAMETERS, Parameters, RISE, SPRING,
    STIFFNESS, STOP_DAMPING, STOPS, VARIANCE,
};
use crate::identified::Known;
use crate::record::{CancellableRecord, Record};
use crate::remainder::variance;
use crate::start::{delayed, noise_of_velocities, velocities};

/// Parts of the travel at each end in which a stop is searched.
const ENDS: [f64; 3] = [0.04, 0.12, 0.3];
/// A turn is examined from this long before it to this long after it, in s.
const BRIEFLY: f64 = 0.04;
/// A turn changes the velocity by this part of that before it, or more, beyond the effect of torque and losses; a stop by at most the last
/// part.
const HARD: f64 = 0.2;
const MOST: f64 = 2.0;
/// χ²'s quantile of 1 - 10⁻⁶ with two degrees of freedom, in variances: a stop that explains less is not accepted.
const SURELY: f64 = 27.6;
/// A turn's velocity is more than this many standard errors of the noise.
const DOUBT: f64 = 5.0;
/// Rates √(k/J) of the stop from which fits of a turn start, in 1/s, and its damping ratios.
const RATES: [f64; 4] = [50.0, 150.0, 400.0, 1000.0];
const RATIOS: [f64; 2] = [0.05, 0.4];
/// The largest depth of the puck in a stop, as a part of its travel.
const DEEPEST: f64 = 0.25;
const SPRING_AND_GRAVITY: [usize; 3] = [SPRING, GRAVITY, GRAVITY + 1];
/// Parts of the file's Stribeck torque from which fits start.
const RISES: [f64; 4] = [1.0, 0.3, 3.0, 0.1];
/// Steps of a fit without a stop that is compared with one with it, of a fit of one turn, and of a fit of the whole record.
const AGAIN: usize = 2;
const BRIEF: usize = 12;
const MANY: usize = 60;
/// About this many shots show that a device does not explain a record.
const FEW_SHOTS: usize = 16;
/// Stretches that begin away from the motion begin anew at most this many times.
const MENDS: usize = 3;
/// Short shots leave at most this many times the noise, or this part of the motion's standard deviation, before a lag is tried.
const HOPELESS_NOISE: f64 = 8.0;
const HOPELESS_PART: f64 = 2e-3;
/// The lag that a fit starts from, in periods.
const SHORT: f64 = 0.5;

/// A turn near an end of the travel.
#[derive(Clone, Copy, Debug)]
struct Turn {
    side: usize,
    /// The sample at which it turns, and the samples around it that show how.
    at: usize,
    span: (usize, usize),
    /// The speed before it, and the part of that which only a stop explains, in rad/s (m/s).
    speed: f64,
    taken: f64,
}

fn side(stop: usize) -> f64 {
    if stop == 0 { -1.0 } else { 1.0 }
}

/// The parameters that are fitted for a device with these stops.
pub(super) fn free(with_offset: bool, has_lag: bool, stops: [bool; 2]) -> Free {
    let mut free = [false; PARAMETERS];
    [INERTIA, DAMPING, FRICTION, LATE].into_iter().for_each(|i| free[i] = true);
    (free[OFFSET], free[VARIANCE]) = (with_offset, has_lag);
    for stop in [0, 1] {
        free[STOPS[stop]] = stops[stop];
    }
    (free[STIFFNESS], free[STOP_DAMPING]) = (stops[0] || stops[1], stops[0] || stops[1]);
    free
}

/// The device with end stops that explains a record to within counts and noise; `None` where the record shows no stop, or where stops do
/// not explain it.
pub(crate) fn search(record: &CancellableRecord<'_>, known: &Known) -> Option<Fit> {
    let plain = inner(record, |part| away(record, known, part));
    of_turns(record, known, &plain).0
}

/// The same with the torques of the position and the changes of friction that the record shows, without stops or away from the ends. The
/// search is long: it is for a record that nothing else explains.
pub(crate) fn search_loaded(record: &CancellableRecord<'_>, known: &Known) -> Option<Fit> {
    if let Some(fit) = super::endless::search(record, known) {
        return Some(fit);
    }
    let loaded = inner(record, |part| loaded(record, known, part));
    let (found, is_near) = of_turns(record, known, &loaded);
    if known.is_linear {
        return found;
    }
    let found = found.or_else(|| {
        // The equation takes one of gravity and a spring for both over a short travel.
        let both = |away: Away| {
            let mut more = away.more;
            SPRING_AND_GRAVITY.into_iter().for_each(|i| more[i] = true);
            (more != away.more).then_some(Away { more, ..away })
        };
        let both: Vec<Away> = loaded.into_iter().filter(|_| is_near).filter_map(both).collect();
        of_turns(record, known, &both).0
    });
    Some(settled(record, found?))
}

/// The fit with neither, one or both of a spring and gravity: over a short travel each of them explains most of the other, and leaves the
/// rest to damping, friction and stops.
fn settled(record: &CancellableRecord<'_>, fit: Fit) -> Fit {
    let [mut springs, mut falls] = [fit.device, fit.device];
    let (middle, p) = (fit.device.places.middle, &fit.device.p);
    let (sine, cosine) = middle.sin_cos();
    // Each takes the other's slope in the middle.
    springs.p[SPRING] -= p[GRAVITY] * cosine - p[GRAVITY + 1] * sine;
    falls.p[GRAVITY] -= p[SPRING] * cosine;
    falls.p[GRAVITY + 1] += p[SPRING] * sine;
    let with = |mut device: Device, has: [bool; 3]| {
        let mut free = fit.free;
        for (i, has) in SPRING_AND_GRAVITY.into_iter().zip(has) {
            free[i] = has;
            device.p[i] = if has { device.p[i] } else { 0.0 };
        }
        Fit::of(record, device, free, fit.shots.clone())?.improved(record, MANY)
    };
    let starts = [(fit.device, [false; 3]), (springs, [true, false, false]), (falls, [false, true, true])];
    let simpler: Vec<Option<Fit>> = starts.into_par_iter().map(|(device, has)| with(device, has)).collect();
    // The fit of both starts from the best of these.
    let best = simpler.iter().flatten().chain([&fit]).min_by(|a, b| a.squares.total_cmp(&b.squares));
    let Some(both) = best.and_then(|best| with(best.device, [true; 3])) else { return fit };
    let is_enough = |other: &Fit| other.squares - both.squares < SURELY * both.variance();
    let mut simpler = simpler.into_iter().map(|other| other.filter(is_enough));
    let mut next = || simpler.next().flatten();
    match (next(), next(), next()) {
        (Some(one), ..) | (None, Some(one), None) | (None, None, Some(one)) => one,
        (None, Some(_), Some(_)) | (None, None, None) => both,
    }
}

/// The devices away from ends of each size, the best determined one first.
fn inner(record: &Record, away: impl Fn(f64) -> Option<Away> + Send + Sync) -> Vec<Away> {
    if !record.is_driven() || record.forces().is_some() {
        return Vec::new();
    }
    let mut found: Vec<Away> = ENDS.into_par_iter().filter_map(away).collect();
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    found
}

/// The fit that starts from one of these devices, with the stops that the hardest turns show; and whether one of them explains the motion
/// about these turns.
fn of_turns(record: &CancellableRecord<'_>, known: &Known, pairs: &[Away]) -> (Option<Fit>, bool) {
    let mut tried: Vec<([Option<usize>; 2], Free)> = Vec::new();
    let mut is_near = false;
    let found = pairs.iter().find_map(|away| {
        let both = [0, 1].map(|stop| hardest(record, away, stop));
        let most = both.iter().flatten().map(|turn| turn.taken).fold(0.0, f64::max);
        let most_only = both.map(|turn| turn.filter(|turn| turn.taken == most));
        [both, most_only].into_iter().find_map(|turns| {
            let at = turns.map(|turn| turn.map(|turn| turn.at));
            // Nearly the same turns give nearly the same fit.
            if tried.contains(&(at, away.more)) {
                return None;
            }
            tried.push((at, away.more));
            let start = with_stops(record, &away.device, turns)?;
            let mut free = free(true, known.lag.is_some(), turns.map(|turn| turn.is_some()));
            free.iter_mut().zip(&away.more).for_each(|(free, more)| *free |= more);
            let start = around(record, start, free, turns)?;
            is_near = true;
            free[VARIANCE] |= start.p[VARIANCE] > 0.0;
            explains(record, start, free).filter(|fit| are_ends(record, fit)).and_then(|fit| needed(record, fit))
        })
    });
    (found, is_near)
}

/// The fit without the stops that the record does not need; `None` where it needs no stop.
fn needed(record: &CancellableRecord<'_>, fit: Fit) -> Option<Fit> {
    let has = STOPS.map(|stop| fit.free[stop]);
    let needs = [0, 1].map(|stop| has[stop] && needs_stops(record, &fit, [stop == 0, stop == 1]));
    if needs == has || needs == [false; 2] {
        return Some(fit).filter(|_| needs == has);
    }
    let (device, free) = without(&fit, needs.map(|needs| !needs));
    explains(record, device, free).filter(|fit| needs_stops(record, fit, needs))
}

/// The device near a given one that explains the record; `None` where none does, or where the record reaches none of its stops and it has
/// neither Stribeck friction nor torques of the position. Stops that the record allows but does not need are kept.
pub(crate) fn near(record: &CancellableRecord<'_>, device: &Device) -> Option<Fit> {
    if !record.is_driven() || record.forces().is_some() {
        return None;
    }
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    // A stop that the puck never comes near is removed.
    let mut device = *device;
    let is_reached = [device.p[STOPS[0]] > low, device.p[STOPS[1]] < high];
    for stop in [0, 1].into_iter().filter(|stop| !is_reached[*stop]) {
        device.p[STOPS[stop]] = side(stop) * f64::INFINITY;
    }
    let falls = device.p[RISE] > 0.0;
    let waves = waves(&device.p);
    let has_waves = waves.contains(&true);
    if !(falls || has_waves || is_reached[0] || is_reached[1]) {
        return None;
    }
    let mut free = free(true, device.p[VARIANCE] > 0.0, is_reached);
    (free[RISE], free[FAST]) = (falls, falls);
    free.iter_mut().zip(&waves).for_each(|(free, wave)| *free |= wave);
    let shots = begun(record, &device);
    let explains = |device: Device, free: Free| fitted(record, device, free, shots.clone());
    // From a friction that falls far too much, a fit may end in a local minimum.
    let parts = if falls { &RISES[..] } else { &RISES[..1] };
    let found = parts.iter().find_map(|part| {
        let mut device = device;
        device.p[RISE] *= part;
        let has_stops = is_reached[0] || is_reached[1];
        let shows =
            |fit: &Fit| (!has_stops || needs_stops(record, fit, is_reached)) && fit.covariance(record).is_some();
        explains(device, free).filter(|fit| falls || shows(fit))
    });
    // A record that needs no stops, or does not determine their numbers, may still allow those of the file.
    found.or_else(|| {
        if falls {
            return None;
        }
        STOPS.into_iter().chain([STIFFNESS, STOP_DAMPING]).for_each(|i| free[i] = false);
        explains(device, free)
    })
}

/// The shots of a record, with the initial states of a known device where it explains them: a fit of its numbers too may end elsewhere.
fn begun(record: &CancellableRecord<'_>, device: &Device) -> Vec<Shot> {
    let all = Shot::all(record, record.first());
    let own = Fit::of(record, *device, [false; PARAMETERS], all.clone()).and_then(|own| own.improved(record, MANY));
    let own = own.map(|own| own.mended(record).unwrap_or(own));
    own.filter(|own| own.is_right(record)).map_or(all, |own| own.shots)
}

/// The parameters of the spring and of the harmonics that a device has, both parts of each.
fn waves(p: &Parameters) -> Free {
    let mut free = [false; PARAMETERS];
    free[SPRING] = p[SPRING] != 0.0;
    for at in (GRAVITY..PARAMETERS).step_by(2) {
        let has = p[at] != 0.0 || p[at + 1] != 0.0;
        (free[at], free[at + 1]) = (has, has);
    }
    free
}

/// Whether the stops found are ends of the travel, and not a spring about its middle.
fn are_ends(record: &Record, fit: &Fit) -> bool {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let deepest = DEEPEST * (high - low);
    fit.device.p[STOPS[0]] - low < deepest && high - fit.device.p[STOPS[1]] < deepest
}

/// Whether the motion differs without these stops.
fn needs_stops(record: &CancellableRecord<'_>, fit: &Fit, stops: [bool; 2]) -> bool {
    let (device, free) = without(fit, stops);
    let other = Fit::of(record, device, free, fit.shots.clone()).and_then(|other| other.improved(record, AGAIN));
    other.is_none_or(|other| other.squares - fit.squares > SURELY * fit.variance())
}

/// A fit's device without these stops, and the parameters that are then fitted.
fn without(fit: &Fit, stops: [bool; 2]) -> (Device, Free) {
    let (mut device, mut free) = (fit.device, fit.free);
    for stop in [0, 1].into_iter().filter(|stop| stops[*stop]) {
        (device.p[STOPS[stop]], free[STOPS[stop]]) = (side(stop) * f64::INFINITY, false);
    }
    (device, free)
}

/// The turn near one end with the largest loss that only a stop explains.
fn hardest(record: &Record, away: &Away, stop: usize) -> Option<Turn> {
    let (times, positions) = (record.times(), record.positions());
    let (speeds, torques) = (velocities(record), delayed(record, away.device.p[LATE]));
    let numbers = away.device.numbers([0.0; 2]);
    let given = |i: usize| {
        let v = speeds[i];
        let a = numbers.gain * torques[i] + numbers.offset - numbers.damping * v - numbers.friction * v.signum()
            + numbers.waves.at_rest(positions[i]);
        a * (times[i + 1] - times[i])
    };
    let middle = 0.5 * (away.limits[0] + away.limits[1]);
    let (first, last) = (record.first(), times.len() - 1);
    let toward = |i: usize| side(stop) * speeds[i];
    let turn = |at: usize| {
        let is_about =
            |i: &usize| (times[*i] - times[at]).abs() < BRIEFLY && side(stop) * (positions[*i] - middle) > 0.0;
        let from = (first..at).rev().take_while(is_about).last().unwrap_or(at);
        let to = (at..last).take_while(is_about).last().unwrap_or(at);
        let speed = (from..at).map(toward).fold(0.0, f64::max);
        let excess = side(stop) * (speeds[from] - speeds[to] + (from..to).map(given).sum::<f64>());
        Turn { side: stop, at, span: (from, to), speed, taken: excess.min(MOST * speed) }
    };
    let turns_near =
        |i: &usize| side(stop) * (positions[*i] - away.limits[stop]) > 0.0 && toward(*i - 1) > 0.0 && toward(*i) <= 0.0;
    let doubt = DOUBT * noise_of_velocities(record);
    let is_hard = |turn: &Turn| turn.taken > (HARD * turn.speed).max(doubt);
    let turns = (first + 1..last).filter(turns_near).map(turn).filter(is_hard);
    turns.max_by(|a, b| a.taken.total_cmp(&b.taken))
}

/// The device with the stops that the turns show; `None` where there is no turn.
fn with_stops(record: &CancellableRecord<'_>, device: &Device, turns: [Option<Turn>; 2]) -> Option<Device> {
    let hardest = turns.into_iter().flatten().max_by(|a, b| a.taken.total_cmp(&b.taken))?;
    let mut found = of_turn(record, device, &hardest, true)?;
    if let Some(other) = turns.into_iter().flatten().find(|turn| turn.side != hardest.side) {
        found = of_turn(record, &found, &other, false)?;
    }
    Some(found)
}

/// The stop that explains one turn best, the device being given; `is_new`: its stiffness and damping are fitted too.
fn of_turn(record: &CancellableRecord<'_>, device: &Device, turn: &Turn, is_new: bool) -> Option<Device> {
    let (from, to) = turn.span;
    let shot = Shot::new(record, from, to);
    let end = side(turn.side) * record.positions()[turn.at];
    let mut free = [false; PARAMETERS];
    free[STOPS[turn.side]] = true;
    [STIFFNESS, STOP_DAMPING].into_iter().for_each(|i| free[i] = is_new);
    let inertia = device.inertia();
    let start = |rate: f64, ratio: f64| {
        let mut device = *device;
        device.p[STOPS[turn.side]] = side(turn.side) * (end - turn.speed / rate);
        if is_new {
            device.p[STIFFNESS] = (inertia * rate * rate).ln();
            device.p[STOP_DAMPING] = 2.0 * ratio * inertia * rate;
        }
        Fit::of(record, device, free, vec![shot])?.improved(record, BRIEF)
    };
    let ratios = if is_new { &RATIOS[..] } else { &RATIOS[..1] };
    let starts: Vec<_> = RATES.iter().flat_map(|rate| ratios.iter().map(move |ratio| (*rate, *ratio))).collect();
    let fits: Vec<Fit> = starts.into_par_iter().filter_map(|(rate, ratio)| start(rate, ratio)).collect();
    fits.into_iter().min_by(|a, b| a.squares.total_cmp(&b.squares)).map(|fit| fit.device)
}

/// The device that explains the stretches about the turns; `None`: none does, and then none explains the record.
fn around(record: &CancellableRecord<'_>, start: Device, free: Free, turns: [Option<Turn>; 2]) -> Option<Device> {
    let all = Shot::all(record, record.first());
    let is_near =
        |(from, to): (usize, usize)| turns.iter().flatten().any(|turn| from < turn.span.1 && turn.span.0 < to);
    let is_near: Vec<bool> = all.iter().map(|shot| is_near(shot.span())).collect();
    let is_beside = |i: usize| (i.saturating_sub(1)..=i + 1).any(|i| is_near.get(i).is_some_and(|is_near| *is_near));
    let near: Vec<Shot> = all.iter().enumerate().filter(|(i, _)| is_beside(*i)).map(|(_, shot)| *shot).collect();
    if 2 * near.len() > all.len() {
        return Some(start);
    }
    fitted(record, start, free, near).map(|fit| fit.device)
}

/// The fit from this device that explains the whole record; `None`: none does.
pub(super) fn explains(record: &CancellableRecord<'_>, device: Device, free: Free) -> Option<Fit> {
    let all = Shot::all(record, record.first());
    // Most devices that are tried do not explain the record, and a part of it shows that in a part of the time.
    let one_in = all.len() / FEW_SHOTS;
    if one_in > 1 {
        let few = all.iter().step_by(one_in).copied().collect();
        let few = short(record, device, free, few)?;
        if !few.is_right(record) {
            lagging(record, &few).filter(|fit| fit.is_right(record))?;
        }
    }
    fitted(record, device, free, all)
}

/// The fit that explains some shots, with a lag where that is needed; `None`: none does.
fn fitted(record: &CancellableRecord<'_>, device: Device, free: Free, shots: Vec<Shot>) -> Option<Fit> {
    let fit = short(record, device, free, shots)?;
    let right = |fit: &Fit| fit.is_right(record);
    if right(&fit)
        && let Some(long) = fit.clone().lengthened(record, MANY)
    {
        // A short lag shows only over a long motion.
        let found = if right(&long) { Some(long) } else { lagging(record, &long).filter(right) };
        if found.is_some() {
            return found;
        }
    }
    // A longer lag makes a long motion nonlinear in the parameters, and is found from short ones.
    lagging(record, &fit).filter(right)?.lengthened(record, MANY).filter(right)
}

/// The fit of short shots; `None`: it leaves too much.
fn short(record: &CancellableRecord<'_>, device: Device, free: Free, shots: Vec<Shot>) -> Option<Fit> {
    let begun = Fit::of(record, device, free, shots)?;
    let mut fit = begun.mended(record).unwrap_or(begun).improved(record, MANY)?;
    for _ in 0..MENDS {
        let Some(mended) = fit.mended(record) else { break };
        fit = mended.improved(record, MANY)?;
    }
    (!is_hopeless(record, &fit)).then_some(fit)
}

/// Whether a fit of short shots leaves far more than the noise, and than a lag can explain over their time.
pub(super) fn is_hopeless(record: &Record, fit: &Fit) -> bool {
    let positions = record.positions();
    let moves: Vec<f64> =
        fit.shots.iter().flat_map(|shot| positions[shot.span().0..shot.span().1].iter().copied()).collect();
    let left = (fit.squares / fit.left.len() as f64).sqrt();
    left > HOPELESS_NOISE * record.noise() && left > HOPELESS_PART * variance(&moves).sqrt()
}

/// The fit with a lag, from a fit without one.
pub(super) fn lagging(record: &CancellableRecord<'_>, fit: &Fit) -> Option<Fit> {
    let mut free = fit.free;
    if std::mem::replace(&mut free[VARIANCE], true) {
        return None;
    }
    let start = |lag: f64| {
        let mut device = fit.device;
        device.p[VARIANCE] = lag * lag;
        Fit::of(record, device, free, fit.shots.clone())?.improved(record, MANY)
    };
    // Where a fit without a lag is right, a short lag shows whether there is any.
    let late = [0.5, 1.0].into_iter().filter(|_| !fit.is_right(record)).map(|part| part * fit.device.p[LATE]);
    // The last start has a lag with next to no effect: no fit of more numbers is worse than the one without them.
    let [short, least] = [SHORT, SHORTEST_LAG].map(|part| part * record.period());
    let is_no_worse = |best: &Fit| best.squares <= fit.squares;
    let mut best: Option<Fit> = None;
    for lag in std::iter::once(short).chain(late).chain([least]) {
        best = best.into_iter().chain(start(lag)).min_by(|a, b| a.squares.total_cmp(&b.squares));
        if best.as_ref().is_some_and(is_no_worse) {
            break;
        }
    }
    best.filter(is_no_worse)
}
