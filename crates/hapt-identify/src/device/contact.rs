//! Where a record shows that the puck runs into an end stop, and the device that explains it.
//!
//! Away from both ends of the travel the equation of motion gives inertia, damping and friction. A stop shows where the puck turns round near
//! an end, and loses more velocity than these take. Its place, stiffness and damping are fitted to the hardest such turn, and then all
//! numbers to all of the record.

use super::fit::{
    DAMPING, Device, FAST, FRICTION, Fit, Free, INERTIA, LATE, OFFSET, PARAMETERS, Parameters, RISE, SHORTEST_LAG,
    STIFFNESS, STOP_DAMPING, STOPS, Shot, VARIANCE,
};
use crate::equation::{self, Band, Rows};
use crate::identified::Known;
use crate::record::{CancellableRecord, Record};
use crate::start::{delayed, signs, velocities};
use crate::torque::PLAIN;

/// Parts of the travel at each end in which a stop is looked for.
const ENDS: [f64; 3] = [0.04, 0.12, 0.3];
/// Windows of the equation, s, and the delays that are tried, in s.
const WINDOWS: [f64; 2] = [0.06, 0.03];
const DELAYS: usize = 21;
const DELAY_STEP: f64 = 5e-4;
/// A turn takes this part of the velocity before it beyond what torque and losses take, or more.
const HARD: f64 = 0.4;
/// Depths of the stop in parts of the travel from which fits of a turn start, and its damping ratios.
const DEPTHS: [f64; 4] = [0.003, 0.01, 0.03, 0.1];
const RATIOS: [f64; 2] = [0.05, 0.4];
/// The puck goes into a stop by this part of its travel at most.
const DEEPEST: f64 = 0.25;
/// Parts of the file's Stribeck torque from which fits start.
const RISES: [f64; 4] = [1.0, 0.3, 3.0, 0.1];
/// Steps of a fit of one turn, and of all of the record.
const BRIEF: usize = 12;
const MANY: usize = 60;
/// So often stretches that begin beside the motion begin anew.
const MENDS: usize = 3;
/// The lag that a fit starts from, in periods.
const SHORT: f64 = 0.5;

/// A turn near an end of the travel.
#[derive(Clone, Copy, Debug)]
struct Turn {
    side: usize,
    /// Its samples.
    span: (usize, usize),
    /// The speed before it, and what of it nothing but a stop takes, in rad/s (m/s).
    speed: f64,
    excess: f64,
}

/// The numbers of the device away from the ends.
struct Away {
    device: Device,
    limits: [f64; 2],
}

fn side(stop: usize) -> f64 {
    if stop == 0 { -1.0 } else { 1.0 }
}

/// What is fitted of a device with these stops.
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

/// The device with end stops that explains a record to within counts and noise; `None` where the record shows no stop, or where it shows more.
pub(crate) fn search(record: &CancellableRecord<'_>, known: &Known) -> Option<Fit> {
    if !record.is_driven() || record.forces().is_some() {
        return None;
    }
    ENDS.iter().find_map(|part| {
        let away = away(record, known, *part)?;
        let turns = turns(record, &away);
        let hardest = |stop: usize| {
            let own = turns.iter().filter(|turn| turn.side == stop && turn.excess > HARD * turn.speed);
            own.copied().max_by(|a, b| a.excess.total_cmp(&b.excess))
        };
        let found = [hardest(0), hardest(1)];
        let start = with_stops(record, &away.device, found)?;
        let mut free = free(true, known.lag.is_some(), found.map(|turn| turn.is_some()));
        let start = around(record, start, free, found)?;
        free[VARIANCE] |= start.p[VARIANCE] > 0.0;
        explains(record, start, free).filter(|fit| are_ends(record, fit) && needs_stops(record, fit))
    })
}

/// The device near a given one that explains the record; `None` where none does, or where the record shows neither its stops nor its Stribeck
/// friction.
pub(crate) fn near(record: &CancellableRecord<'_>, device: &Device) -> Option<Fit> {
    if !record.is_driven() || record.forces().is_some() {
        return None;
    }
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    // A stop that the puck never comes near is none.
    let mut device = *device;
    let is_reached = [device.p[STOPS[0]] > low, device.p[STOPS[1]] < high];
    for stop in [0, 1].into_iter().filter(|stop| !is_reached[*stop]) {
        device.p[STOPS[stop]] = side(stop) * f64::INFINITY;
    }
    let falls = device.p[RISE] > 0.0;
    if !(falls || is_reached[0] || is_reached[1]) {
        return None;
    }
    let mut free = free(true, device.p[VARIANCE] > 0.0, is_reached);
    (free[RISE], free[FAST]) = (falls, falls);
    // From a friction that falls far too much a fit may end beside the best one.
    let parts = if falls { &RISES[..] } else { &RISES[..1] };
    parts.iter().find_map(|part| {
        let mut device = device;
        device.p[RISE] *= part;
        explains(record, device, free).filter(|fit| falls || needs_stops(record, fit))
    })
}

/// Whether what was found are ends of the way, and no spring about its middle.
fn are_ends(record: &Record, fit: &Fit) -> bool {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let deepest = DEEPEST * (high - low);
    fit.device.p[STOPS[0]] - low < deepest && high - fit.device.p[STOPS[1]] < deepest
}

/// Whether the record is another motion without the stops.
fn needs_stops(record: &Record, fit: &Fit) -> bool {
    let mut device = fit.device;
    (device.p[STOPS[0]], device.p[STOPS[1]]) = (f64::NEG_INFINITY, f64::INFINITY);
    Fit::of(record, device, fit.free, fit.shots.clone()).is_none_or(|without| without.squares > 2.0 * fit.squares)
}

/// The equation of motion over the windows that keep away from the ends.
fn away(record: &CancellableRecord<'_>, known: &Known, part: f64) -> Option<Away> {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let margin = part * (high - low);
    let limits = [low + margin, high - margin];
    let signs = signs(record);
    let duration = record.period() * record.times().len() as f64;
    let delays: Vec<f64> = (0..DELAYS).map(|i| i as f64 * DELAY_STEP).collect();
    let torques: Vec<Vec<f64>> = delays.iter().map(|delay| delayed(record, *delay)).collect();
    let windows = WINDOWS.map(|length| {
        let rows = Rows::new(record, &signs, &torques[0], Band { length, slope: false }).between(record, limits);
        rows.under(record, &torques)
    });
    let solved = |i: usize| {
        let explains = |rows: &Vec<Rows>| rows[i].solved(PLAIN, duration).filter(|solved| solved.share < 0.5);
        windows.iter().find_map(explains)
    };
    let all = delays.iter().enumerate().filter_map(|(i, delay)| Some((*delay, solved(i)?)));
    let (delay, solved) = all.min_by(|a, b| a.1.share.total_cmp(&b.1.share))?;
    let inertia = solved.values[equation::INERTIA];
    let sign = inertia.signum();
    let ratio = known.inertia.map_or(1.0, |known| known / inertia.abs());
    let mut p: Parameters = [0.0; PARAMETERS];
    p[INERTIA] = known.inertia.map_or(inertia.abs(), |_| ratio).ln();
    p[DAMPING] = (ratio * sign * solved.values[equation::DAMPING]).max(0.0);
    p[FRICTION] = (ratio * sign * solved.values[equation::FRICTION]).max(0.0);
    p[OFFSET] = -ratio * sign * solved.values[equation::CONSTANT];
    p[LATE] = delay;
    p[VARIANCE] = known.lag.map_or(0.0, |lag| lag * lag);
    p[STOPS[0]] = f64::NEG_INFINITY;
    p[STOPS[1]] = f64::INFINITY;
    Some(Away { device: Device { p, sign, inertia: known.inertia }, limits })
}

/// The visits to both ends.
fn turns(record: &Record, away: &Away) -> Vec<Turn> {
    let (times, positions) = (record.times(), record.positions());
    let (speeds, torques) = (velocities(record), delayed(record, away.device.p[LATE]));
    let numbers = away.device.numbers([0.0; 2]);
    let mut turns = Vec::new();
    for stop in [0, 1] {
        let is_in = |i: &usize| side(stop) * (positions[*i] - away.limits[stop]) > 0.0;
        let mut next = record.first().max(1);
        while let Some(from) = (next..times.len()).find(is_in) {
            let to = (from..times.len()).find(|i| !is_in(i)).unwrap_or(times.len());
            next = to + 1;
            if to >= times.len() {
                break;
            }
            let (from, to) = (from - 1, to);
            let given: f64 = (from..to)
                .map(|i| {
                    let (v, torque) = (speeds[i], torques[i]);
                    let a =
                        numbers.gain * torque + numbers.offset - numbers.damping * v - numbers.friction * v.signum();
                    a * (times[i + 1] - times[i])
                })
                .sum();
            let excess = -side(stop) * (speeds[to] - speeds[from] - given);
            turns.push(Turn { side: stop, span: (from, to), speed: speeds[from].abs(), excess });
        }
    }
    turns
}

/// The device with the stops that the turns show; `None` where there is no turn.
fn with_stops(record: &CancellableRecord<'_>, device: &Device, turns: [Option<Turn>; 2]) -> Option<Device> {
    let hardest = turns.into_iter().flatten().max_by(|a, b| a.excess.total_cmp(&b.excess))?;
    let mut found = of_turn(record, device, &hardest, true)?;
    if let Some(other) = turns.into_iter().flatten().find(|turn| turn.side != hardest.side) {
        found = of_turn(record, &found, &other, false)?;
    }
    Some(found)
}

/// The stop that explains one turn best, beside a device; `is_new`: its stiffness and damping too.
fn of_turn(record: &CancellableRecord<'_>, device: &Device, turn: &Turn, is_new: bool) -> Option<Device> {
    let around = (0.02 / record.period()).ceil() as usize;
    let (from, to) = (turn.span.0.saturating_sub(around), (turn.span.1 + around).min(record.times().len()));
    let shot = Shot::new(record, from, to);
    let positions = &record.positions()[turn.span.0..turn.span.1];
    let end = positions.iter().map(|z| side(turn.side) * z).fold(f64::NEG_INFINITY, f64::max);
    let all = record.positions().iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let travel = all.1 - all.0;
    let mut free = [false; PARAMETERS];
    free[STOPS[turn.side]] = true;
    [STIFFNESS, STOP_DAMPING].into_iter().for_each(|i| free[i] = is_new);
    let inertia = device.inertia();
    let start = |depth: f64, ratio: f64| {
        let mut device = *device;
        device.p[STOPS[turn.side]] = side(turn.side) * (end - depth * travel);
        if is_new {
            let rate = turn.speed / (depth * travel);
            device.p[STIFFNESS] = (inertia * rate * rate).ln();
            device.p[STOP_DAMPING] = 2.0 * ratio * inertia * rate;
        }
        Fit::of(record, device, free, vec![shot])?.improved(record, BRIEF)
    };
    let ratios = if is_new { &RATIOS[..] } else { &RATIOS[..1] };
    let starts = DEPTHS.iter().flat_map(|depth| ratios.iter().map(move |ratio| (*depth, *ratio)));
    let fits = starts.filter_map(|(depth, ratio)| start(depth, ratio));
    fits.min_by(|a, b| a.squares.total_cmp(&b.squares)).map(|fit| fit.device)
}

/// The device that explains the stretches about the turns; `None`: none does, and so none explains the record.
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

/// The fit from a device on that explains all of a record; `None`: none does.
pub(super) fn explains(record: &CancellableRecord<'_>, device: Device, free: Free) -> Option<Fit> {
    fitted(record, device, free, Shot::all(record, record.first()))
}

/// The fit of some shots that explains them, with a lag where that is needed; `None`: none does.
fn fitted(record: &CancellableRecord<'_>, device: Device, free: Free, shots: Vec<Shot>) -> Option<Fit> {
    let begun = Fit::of(record, device, free, shots)?;
    let mut fit = begun.mended(record).unwrap_or(begun).improved(record, MANY)?;
    for _ in 0..MENDS {
        let Some(mended) = fit.mended(record) else { break };
        fit = mended.improved(record, MANY)?;
    }
    let right = |fit: &Fit| fit.is_right(record);
    if right(&fit)
        && let Some(long) = fit.clone().lengthened(record, MANY)
    {
        // A short lag is seen over a long motion only.
        let found = if right(&long) { Some(long) } else { lagging(record, &long).filter(right) };
        if found.is_some() {
            return found;
        }
    }
    // A longer one bends a long motion, and is found from short ones.
    lagging(record, &fit).filter(right)?.lengthened(record, MANY).filter(right)
}

/// The same with a lag.
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
    // Beside a fit that is right without one a short lag tells whether there is any.
    let late = [0.5, 1.0].into_iter().filter(|_| !fit.is_right(record)).map(|part| part * fit.device.p[LATE]);
    // Last from where the lag changes next to nothing: no fit of more numbers is worse than the one without them.
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
