//! The answer in words, as JSON, and as the `[device]` table of a world file.

use std::fmt::Write as _;
use std::time::{SystemTime, UNIX_EPOCH};

use hapt_identify::{FoundStops, Identified, Interval, Kind, Misfit, Part, PositionTorque, TorqueFit};
use hapt_model::keys::Measure;
use hapt_model::{Delay, Motion, World};
use serde::Serialize;

use super::{Given, richer};
use crate::failure::Failure;
use crate::format;

/// A number of a device changes with the weather: no record of one hour determines it better than this, in percent.
const LEAST_TOLERANCE: f64 = 1.0;

/// JSON in lines.
pub fn pretty(json: &impl Serialize) -> Result<String, Failure> {
    let text = serde_json::to_string_pretty(json).map_err(|error| Failure::System(error.to_string()))?;
    Ok(text + "\n")
}

/// The torque's equation holds between windows of samples; the error of a value by that is below this part of it.
const EQUATION: f64 = 0.02;

/// A difference between the inertias by the motion and by the torque's equation, or between the motor's gains for a known inertia, with the
/// likely reason.
pub fn sides(given: &Given, found: &Identified, by_torque: &TorqueFit) -> Option<String> {
    if found.gain.is_some() {
        return differ("gain", found.gain?, by_torque.gain?, "of the commanded torque");
    }
    inertias(given, found.inertia?, by_torque.inertia_by_torque?)
}

/// The same of two inertias.
pub fn inertias(given: &Given, by_motion: Interval, by_torque: Interval) -> Option<String> {
    let [unit, _] = units(given.motion);
    differ("inertia", by_motion, by_torque, &unit)
}

fn differ(name: &str, by_motion: Interval, by_torque: Interval, unit: &str) -> Option<String> {
    let (motion, torque) = (by_motion.value, by_torque.value);
    let are_apart = by_motion.high < by_torque.low || by_torque.high < by_motion.low;
    (are_apart && (motion - torque).abs() > EQUATION * motion.abs()).then(|| {
        format!(
            "the {name} by the motion ({}) and by the torque ({}) differ by more than their intervals: the likely reason is a closed loop, in which the torque answers what else acts on the device, or a delay that the fit does not have",
            sized(by_motion, 1.0, unit),
            sized(by_torque, 1.0, unit)
        )
    })
}

/// A misfit in lines, the whole first.
pub fn misfit_lines(misfit: &Misfit) -> Vec<String> {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let whole = format!(
        "{} of the torque's variance, at a fit by inertia, damping, friction and a constant",
        percent(misfit.share)
    );
    let part = |part: &Part| format!("{} {}: {}", percent(part.share), described(part.kind), part.kind.remedy());
    std::iter::once(whole).chain(misfit.kinds.iter().map(part)).collect()
}

fn described(kind: Kind) -> String {
    match kind {
        Kind::Position { times_a_turn: 0 } => "goes with the position".into(),
        Kind::Position { times_a_turn: 1 } => "goes with the position, once a turn".into(),
        Kind::Position { times_a_turn } => format!("goes with the position, {times_a_turn} times a turn"),
        Kind::FrictionByPosition { times_a_turn: 1 } => "is friction that changes once a turn".into(),
        Kind::FrictionByPosition { times_a_turn } => format!("is friction that changes {times_a_turn} times a turn"),
        Kind::Velocity => "goes with the velocity".into(),
        Kind::Resonance { hz } => format!("is a resonance at {hz:.1} Hz"),
        Kind::Drift => "drifts over time".into(),
        Kind::Unexplained => "goes with none of position, velocity and time".into(),
    }
}

/// A line for each number.
pub fn text(given: &Given, found: &Identified, inertia_is_known: bool) -> String {
    let times = given.record.times();
    let mut text = format!(
        "{}: {} samples over {}, {} apart\n\n",
        given.name,
        format::count(times.len() as u64),
        format::time(times[times.len() - 1] - times[0]),
        format::time(given.record.period())
    );
    let [inertia, damping] = units(given.motion);
    let (effort, per_si) = effort(given.motion);
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<9} {words}");
    };
    let within = |interval: Option<Interval>, factor: f64, unit: &str| {
        interval.map_or("not in this record".to_string(), |x| sized(x, factor, unit))
    };
    match (inertia_is_known, found.inertia) {
        (true, Some(known)) => {
            line("inertia", format!("{} {inertia}, as given", format::number(known.value)));
            line("gain", within(found.gain, 1.0, "of the commanded torque"));
        }
        (_, found) => line("inertia", within(found, 1.0, &inertia)),
    }
    line("damping", within(found.damping, 1.0, &damping));
    line("friction", within(found.friction, per_si, effort));
    if found.damping.is_none() {
        line("damping", format!("over inertia {}", within(found.rates[0], 1.0, "1/s")));
        line("friction", format!("over inertia {}", within(found.rates[1], 1.0, per_inertia(given.motion))));
    }
    line("delay", within(found.delay, 1e3, "ms"));
    if let Some(interval) = found.lag {
        line("lag", lag(interval));
    }
    if let Some(offset) = found.offset.filter(|offset| !offset.covers(0.0)) {
        line("offset", format!("{}: a constant torque that was not commanded", sized(offset, per_si, effort)));
    }
    stops(given, found).into_iter().for_each(|(name, words)| line(name, words));
    found.terms.iter().map(|term| richer::term_words(given, term)).for_each(|(name, words)| line(name, words));
    line(
        "sign",
        match found.sign {
            None if given.record.is_driven() => "not determined".into(),
            None => "not in this record".into(),
            Some(sign) if sign.value < 0.0 => "-1: a positive torque makes the position fall".into(),
            Some(_) => "1: a positive torque makes the position grow".into(),
        },
    );
    line("encoder", encoder(given.motion, found));
    let (unit, factor) = if given.motion == Motion::Linear { ("um", 1e6) } else { ("mdeg", 1e3f64.to_degrees()) };
    let counts =
        found.lattice.map_or(String::new(), |lattice| format!(", {:.2} counts", found.residual.rms / lattice.step));
    line("residual", format!("{} {unit} rms{counts}", digits(found.residual.rms * factor, 3)));
    text
}

/// The end stops that the record runs into, or where it moves without one.
fn stops(given: &Given, found: &Identified) -> Vec<(&'static str, String)> {
    let (unit, factor) = place(given.motion);
    let Some(FoundStops { low, high, stiffness, damping }) = found.stops else {
        let positions = given.record.positions();
        let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
        let [low, high] = [low, high].map(|z| digits(factor * z, 3));
        return vec![("stops", format!("none between {low} and {high} {unit}; the record goes no farther"))];
    };
    let [_, of_damping] = units(given.motion);
    let at = |x: Option<Interval>| x.map_or("not reached".to_string(), |x| sized(x, factor, unit));
    vec![
        ("stops", format!("low  {}", at(low))),
        ("", format!("high {}", at(high))),
        ("", format!("stiffness {}", sized(stiffness, 1.0, &Measure::Stiffness.dimension(given.motion).symbol()))),
        ("", format!("damping {}", sized(damping, 1.0, &of_damping))),
    ]
}

/// The unit of positions, and its number per rad (m).
fn place(motion: Motion) -> (&'static str, f64) {
    if motion == Motion::Linear { ("mm", 1e3) } else { ("deg", 1f64.to_degrees()) }
}

/// A lag, or why it has no number.
pub fn lag(lag: Interval) -> String {
    match lag.low > 0.0 {
        true => sized(lag, 1e3, "ms"),
        false => {
            format!(
                "not separable from the delay, which is the sum of both; up to {} ms fits",
                digits(1e3 * lag.high, 2)
            )
        }
    }
}

fn encoder(motion: Motion, found: &Identified) -> String {
    match (found.counts, found.lattice) {
        (Some(counts), _) if counts.low == counts.high => format!("{} counts a revolution", counts.value),
        (Some(counts), _) => format!("{} to {} counts a revolution", counts.low, counts.high),
        (None, Some(lattice)) if motion == Motion::Linear => format!("{} um a count", digits(1e6 * lattice.step, 6)),
        _ => "no counts show in the positions".into(),
    }
}

/// Torques that depend on the position, in the file's units; empty without any.
pub fn unmodelled(given: &Given, found: &Identified) -> Option<String> {
    let PositionTorque { times_a_turn, size, explains } = found.unmodelled?;
    let (effort, per_si) = effort(given.motion);
    let what = match times_a_turn {
        0 => format!("a spring of {} {}", digits(size, 2), Measure::Stiffness.dimension(given.motion).symbol()),
        1 => format!("{} {effort} once a turn, a weight beside the axis", digits(size * per_si, 2)),
        n => format!("{} {effort} {n} times a turn, a motor's cogging", digits(size * per_si, 2)),
    };
    Some(format!(
        "a torque depends on the position, most like {what}: it explains {:.0} % of the residuals, is in none of these numbers, and makes the intervals too narrow",
        100.0 * explains
    ))
}

/// The certificate of the world with this device; empty without a world.
pub fn certificate(given: &Given, found: &Identified) -> Result<String, Failure> {
    let Some(before) = &given.world else { return Ok(String::new()) };
    let (Some(inertia), Some(damping)) = (found.inertia, found.damping) else { return Ok(String::new()) };
    if !found.terms.is_empty() {
        return Ok("\nworld     no verdict beside torques of the position: hapt check decides on the world with this [device] table\n".into());
    }
    let friction = found.friction.map_or(0.0, |x| x.value);
    let mut world = before.clone();
    world.device.inertia = inertia.value;
    world.device.damping = damping.value;
    world.device.set_friction(friction);
    if let Some([forward, backward]) = by_direction(found.friction, found.offset) {
        (world.device.friction, world.device.friction_backward) = (forward.value, Some(backward.value));
    }
    world.device.stops = found.stops.map(|stops| stops.values()).or(world.device.stops);
    world.device.encoder = encoder_key(given.motion, found).or(world.device.encoder);
    world.device.lag = found.lag.map_or(world.device.lag, |lag| lag.value);
    if let Some(delay) = found.delay {
        world.sampling.delay = Delay::Seconds(whole(delay, world.sampling.period));
    }
    let mut least = world.clone();
    least.device.damping = damping.low;
    if let Some(delay) = found.delay.filter(|_| world.sampling.delay_s() % world.sampling.period != 0.0) {
        least.sampling.delay = Delay::Seconds(delay.high);
    }
    if let Some(lag) = found.lag.filter(|lag| lag.low > 0.0) {
        least.device.lag = lag.high;
    }
    let verdict = |world: &World| -> Result<String, Failure> { Ok(hapt_analysis::check(world)?.verdict_sentence()) };
    let (was, is, at_least) = (verdict(before)?, verdict(&world)?, verdict(&least)?);
    let mut text = format!("\nworld     as its file has the device: {was}\n          with this device: {is}\n");
    if at_least != is {
        let _ = writeln!(text, "          at the bad ends of the intervals: {at_least}");
    }
    Ok(text)
}

/// The `[device]` table, with its origin.
pub fn table(given: &Given, found: &Identified) -> String {
    let [inertia, damping] = units(given.motion);
    let (effort, per_si) = effort(given.motion);
    let mut text = format!("[device] # identified {} from {}\n", today(), given.name.escape_default());
    let mut line = |entry: String, note: &str| {
        let _ = match entry.starts_with('#') {
            true => writeln!(text, "{entry}"),
            false => writeln!(text, "{entry:<50}# {note}"),
        };
    };
    let directions = by_direction(found.friction, found.offset);
    let friction = found.friction.filter(|_| directions.is_none());
    for (key, x, factor, unit) in [
        ("inertia", found.inertia, 1.0, &*inertia),
        ("damping", found.damping, 1.0, &*damping),
        ("friction", friction, per_si, effort),
        ("lag", found.lag.filter(|lag| lag.low > 0.0), 1e3, "ms"),
    ] {
        let Some(x) = x else { continue };
        let note = if x.low == x.high { "as given".into() } else { ends(x, factor) };
        line(entry(key, x, factor, unit), &note);
    }
    if let Some(levels) = directions {
        let entries = direction_entries(levels, per_si, effort);
        entries.into_iter().zip(levels).for_each(|(entry, x)| line(entry, &ends(x, per_si)));
    }
    match (found.counts, found.lattice) {
        (Some(counts), _) if counts.low == counts.high => line(format!("encoder  = {}", counts.value), "exact"),
        (None, Some(lattice)) if given.motion == Motion::Linear => {
            line(format!("encoder  = \"{} um\"", digits(1e6 * lattice.step, 6)), "the positions' lattice");
        }
        _ => {}
    }
    if let Some(limit) = given.world.as_ref().and_then(|world| world.device.limit) {
        let limit = format!("limit    = \"{} {effort}\"", format::number(per_si * limit));
        line(limit, "as the world's file has it");
    }
    if let Some(delay) = found.delay {
        let _ = writeln!(text, "# for [loop]: delay = \"{} ms\", {} ms", delay_words(given, delay), ends(delay, 1e3));
    }
    if let Some(offset) = found.offset.filter(|offset| !offset.covers(0.0) && directions.is_none()) {
        let _ = writeln!(text, "# beside it a constant torque of {}: no key", sized(offset, per_si, effort));
    }
    if found.sign.is_some_and(|sign| sign.value < 0.0) {
        text += "# the motor's sign is -1: turn its leads over, or its sign in the driver, before a world runs on it\n";
    }
    text + &stops_table(given, found) + &richer::own_torques(given.motion, &found.terms, found.friction)
}

/// `[device.stops]`, where the record runs into any.
fn stops_table(given: &Given, found: &Identified) -> String {
    let Some(FoundStops { low, high, stiffness, damping }) = found.stops else { return String::new() };
    let [_, of_damping] = units(given.motion);
    let (unit, factor) = place(given.motion);
    let of_stiffness = Measure::Stiffness.dimension(given.motion).symbol();
    let mut text = "\n[device.stops]\n".to_string();
    let numbers = [
        ("low", low, factor, unit),
        ("high", high, factor, unit),
        ("stiffness", Some(stiffness), 1.0, &of_stiffness),
        ("damping", Some(damping), 1.0, &of_damping),
    ];
    for (key, x, factor, unit) in numbers.into_iter().filter_map(|(key, x, factor, unit)| Some((key, x?, factor, unit)))
    {
        let value = to(factor * x.value, 0.5 * factor * (x.high - x.low));
        let _ = writeln!(text, "{:<50}# {}", format!("{key:<9} = \"{value} {unit}\""), ends(x, factor));
    }
    text
}

/// The keys of friction by direction, toward larger positions and toward smaller ones.
pub const DIRECTIONS: [&str; 2] = ["friction", "friction_backward"];

/// The friction in the two directions of [`DIRECTIONS`] that is equivalent, in motion and at rest, to friction with a constant torque along
/// the position; `None` where that torque is not significantly different from 0, or exceeds the friction.
pub fn by_direction(friction: Option<Interval>, offset: Option<Interval>) -> Option<[Interval; 2]> {
    let (friction, offset) = (friction?, offset.filter(|offset| !offset.covers(0.0))?);
    (friction.value > offset.value.abs()).then(|| {
        let level = |value: f64, low: f64, high: f64| Interval { value, low: low.max(0.0), high };
        [
            level(friction.value - offset.value, friction.low - offset.high, friction.high - offset.low),
            level(friction.value + offset.value, friction.low + offset.low, friction.high + offset.high),
        ]
    })
}

/// A key of a file with its quantity. Where [`quantity`] has none, the line is a comment: a certificate for the value alone would claim more
/// than the record does.
pub fn entry(key: &str, x: Interval, factor: f64, unit: &str) -> String {
    match quantity(x, factor, unit) {
        Some(quantity) => format!("{key:<8} = {quantity}"),
        None => format!("# {key}: {}; too wide an interval for a tolerance", sized(x, factor, unit)),
    }
}

/// The keys of friction by direction with their quantities. Where one has none, both are comments: alone, one level holds for both directions.
pub fn direction_entries(levels: [Interval; 2], factor: f64, unit: &str) -> [String; 2] {
    let are_known = levels.iter().all(|x| quantity(*x, factor, unit).is_some());
    let of = |(key, x): (&str, Interval)| match are_known {
        true => entry(key, x, factor, unit),
        false => format!("# {key}: {}; no tolerance holds both directions", sized(x, factor, unit)),
    };
    let [forward, backward] = DIRECTIONS;
    [of((forward, levels[0])), of((backward, levels[1]))]
}

/// A quantity of a file, with the tolerance that holds its interval; `None` where the number may be more than twice as large.
pub fn quantity(x: Interval, factor: f64, unit: &str) -> Option<String> {
    let text = to(factor * x.value, 0.5 * factor * (x.high - x.low));
    if x.low == x.high {
        return Some(format!("\"{text} {unit}\""));
    }
    let shown = text.parse().unwrap_or(factor * x.value);
    let part = (factor * x.high - shown).max(shown - factor * x.low) / shown;
    if !(part > 0.0 && part <= 1.0) {
        return None;
    }
    // Two digits of the tolerance, rounded up.
    let percent = (100.0 * part).max(LEAST_TOLERANCE);
    let step = 10f64.powf(percent.log10().floor() - 1.0);
    let percent = ((percent / step).ceil() * step).min(100.0);
    Some(format!("\"{text} {unit} ± {} %\"", digits(percent, 3)))
}

/// The delay as it is used, in ms.
fn delay_words(given: &Given, delay: Interval) -> String {
    let period = given.world.as_ref().map_or(given.record.period(), |world| world.sampling.period);
    let used = whole(delay, period);
    if used == delay.value { to(1e3 * used, 0.5e3 * (delay.high - delay.low)) } else { format::number(1e3 * used) }
}

/// A delay that is known to a sample, and may be a whole number of samples, is rounded to it.
pub fn whole(delay: Interval, period: f64) -> f64 {
    let nearest = (delay.value / period).round() * period;
    if delay.covers(nearest) && delay.high - delay.low < period { nearest } else { delay.value }
}

fn encoder_key(motion: Motion, found: &Identified) -> Option<f64> {
    match motion {
        Motion::Rotary => found.counts.filter(|counts| counts.low == counts.high).map(|counts| counts.value),
        Motion::Linear => found.lattice.map(|lattice| lattice.step),
    }
}

/// Of inertia and damping.
pub fn units(motion: Motion) -> [String; 2] {
    [Measure::Inertia, Measure::Damping].map(|measure| measure.dimension(motion).symbol())
}

/// The unit of torques, and its number per N m (linear: N).
pub fn effort(motion: Motion) -> (&'static str, f64) {
    if motion == Motion::Linear { ("N", 1.0) } else { ("N mm", 1e3) }
}

/// A value with its unit and its interval.
pub fn sized(x: Interval, factor: f64, unit: &str) -> String {
    let half = 0.5 * factor * (x.high - x.low);
    format!("{} {unit}, {}", to(factor * x.value, half), ends(x, factor))
}

pub fn ends(x: Interval, factor: f64) -> String {
    let half = 0.5 * factor * (x.high - x.low);
    format!("95 %: {} to {}", to(factor * x.low, half), to(factor * x.high, half))
}

/// Rounded so that the second digit of its uncertainty still shows.
pub fn to(x: f64, half: f64) -> String {
    if !(half > 0.0 && half.is_finite()) {
        return format::number(x);
    }
    let step = 10f64.powf(half.log10().floor() - 1.0);
    let whole = (x / step).round();
    if whole == 0.0 { "0".into() } else { format::number(format!("{:.6e}", whole * step).parse().unwrap_or(x)) }
}

/// With this many digits.
pub fn digits(x: f64, digits: usize) -> String {
    format!("{x:.*e}", digits - 1).parse().map_or_else(|_| x.to_string(), format::number)
}

/// The date, in UTC: days since 1970 by the civil calendar (Hinnant, "chrono-compatible low-level date algorithms").
fn today() -> String {
    let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400);
    let z = days + 719_468;
    let (era, day_of_era) = (z / 146_097, z % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let (day, month) =
        (day_of_year - (153 * shifted + 2) / 5 + 1, if shifted < 10 { shifted + 3 } else { shifted - 9 });
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

/// The unit of friction over inertia.
pub(super) fn per_inertia(motion: Motion) -> &'static str {
    if motion == Motion::Linear { "m/s^2" } else { "rad/s^2" }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with the forward level alone has it backward too: more friction than the record allows.
    #[test]
    fn of_two_directions_no_level_is_written_without_the_other() {
        let level = |value: f64, half: f64| Interval { value, low: f64::max(value - half, 0.0), high: value + half };
        for (levels, written) in [
            ([level(0.07, 0.01), level(0.014, 0.02)], false),
            ([level(0.014, 0.02), level(0.07, 0.01)], false),
            ([level(0.07, 0.01), level(0.03, 0.02)], true),
        ] {
            let entries = direction_entries(levels, 1e3, "N mm");
            assert!(entries.iter().all(|entry| entry.starts_with('#') != written), "{entries:?}");
        }
    }
}
