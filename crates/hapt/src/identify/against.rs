//! `hapt identify --against`: whether the record agrees with the world's file.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_identify::{Claims, Compared, Comparison, Interval, Verdict, against};
use hapt_model::keys::Measure;
use hapt_model::{Motion, World};

use super::print::{digits, effort, per_inertia, quantity, sized, to, units};
use super::{Drawn, Given, plot, print, written};
use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::format;

pub fn run(args: &IdentifyArgs, given: &Given) -> Result<ExitCode, Failure> {
    let (Some(path), Some(world)) = (&args.against, &given.world) else {
        return Err(Failure::input("--against needs a world"));
    };
    let file = path.display().to_string();
    let claims = Claims::of(world);
    is_of(given, world, &claims, &file)?;
    let found = against(&given.record, &claims, given.motion == Motion::Linear)
        .map_err(|error| Failure::input(format!("{}: {error}", given.name)))?;
    written([plot(args, given, &Drawn::of_best(&found))?])?;
    let text =
        if args.json { print::pretty(&found.json())? } else { text(given, &file, &found, claims.stops.is_some()) };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(if found.agrees() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Whether the record can be one of the world's loop.
fn is_of(given: &Given, world: &World, claims: &Claims, file: &str) -> Result<(), Failure> {
    let name = &given.name;
    if given.motion != world.motion {
        let word = |motion| if motion == Motion::Linear { "moves along a line" } else { "turns" };
        return Err(Failure::input(format!(
            "{name}: its puck {}, and that of {file} {}; pass the world that ran",
            word(given.motion),
            word(world.motion)
        )));
    }
    if let Some(own) = claims.other_period(&given.record) {
        return Err(Failure::input(format!(
            "{name}: its samples are {} apart, and loop.period of {file} is {}; pass the world that ran, or --set loop.period={}",
            format::time(own),
            format::time(claims.period),
            format::time(own).replace(' ', "")
        )));
    }
    Ok(())
}

fn text(given: &Given, file: &str, found: &Comparison, has_stops: bool) -> String {
    let times = given.record.times();
    let mut text = format!(
        "{} against {file}: {} samples over {}, {} apart\n\n",
        given.name,
        format::count(times.len() as u64),
        format::time(times[times.len() - 1] - times[0]),
        format::time(given.record.period())
    );
    let width = found.numbers.iter().map(|number| number.name.len()).fold(15, usize::max);
    for number in &found.numbers {
        let Scale { factor, unit } = Scale::of(number, given.motion);
        let record = number.estimate.map_or("-".to_string(), |x| match number.measure {
            None => format::number(x.value),
            Some(_) => sized(x, factor, &unit),
        });
        let says = format!("{}: {}", range(number, factor, &unit), words(number));
        let _ = writeln!(text, "{:<width$} {record}\n{:<width$} file {says}", number.name, "");
    }
    let (unit, factor) = if given.motion == Motion::Linear { ("um", 1e6) } else { ("mdeg", 1e3f64.to_degrees()) };
    let counts =
        found.lattice.map_or(String::new(), |lattice| format!(", {:.2} counts", found.residual.rms / lattice.step));
    let _ = writeln!(
        text,
        "{:<width$} {} {unit} rms{counts}; the noise of the positions is {} {unit} rms; neighbours are correlated by {:.2}",
        "residual",
        digits(found.residual.rms * factor, 3),
        digits(found.noise * factor, 3),
        found.residual.correlation
    );
    for (i, words) in found.misfit.iter().flat_map(print::misfit_lines).enumerate() {
        let _ = writeln!(text, "{:<width$} {words}", if i == 0 { "misfit" } else { "" });
    }
    let _ = writeln!(text, "\n{:<width$} {}", "verdict", verdict(found, has_stops));
    for line in found.numbers.iter().filter_map(|number| remedy(number, given.motion)) {
        let _ = writeln!(text, "{:<width$} {line}", "remedy");
    }
    text
}

/// The end of the names of numbers that are divided by the inertia.
const OVER_INERTIA: &str = " over inertia";

/// How a measure is shown.
struct Scale {
    factor: f64,
    unit: String,
}

impl Scale {
    fn of(number: &Compared, motion: Motion) -> Self {
        let [inertia, damping] = units(motion);
        let (effort, per_si) = effort(motion);
        let (factor, unit) = match number.measure {
            Some(Measure::Damping) if number.name.ends_with(OVER_INERTIA) => (1.0, "1/s".into()),
            Some(Measure::Torque) if number.name.ends_with(OVER_INERTIA) => (1.0, per_inertia(motion).into()),
            Some(Measure::Inertia) => (1.0, inertia),
            Some(Measure::Damping) => (1.0, damping),
            Some(Measure::Time) => (1e3, "ms".into()),
            Some(Measure::Torque) => (per_si, effort.into()),
            Some(Measure::Position) if motion == Motion::Linear => (1e3, "mm".into()),
            Some(Measure::Position) => (1f64.to_degrees(), "deg".into()),
            Some(Measure::Velocity) => (1.0, Measure::Velocity.dimension(motion).symbol()),
            Some(Measure::Ratio) => (1.0, "of the friction".into()),
            Some(Measure::Stiffness) => (1.0, if motion == Motion::Linear { "N/m" } else { "N m/rad" }.into()),
            Some(_) | None => (1.0, String::new()),
        };
        Scale { factor, unit }
    }
}

/// The range that the file allows.
fn range(number: &Compared, factor: f64, unit: &str) -> String {
    let [low, high] = number.file.map(|x| factor * x);
    match (number.measure, low == high) {
        _ if low.is_nan() => "none".into(),
        (None, _) => format::number(high),
        (Some(_), true) => format!("{} {unit}, exactly", format::number(high)),
        (Some(_), false) => {
            let half = 0.5 * (high - low);
            format!("{} to {} {unit}", to(low, half), to(high, half))
        }
    }
}

fn words(number: &Compared) -> String {
    let outside = |sigmas: f64| match sigmas {
        0.0 => String::new(),
        x if x.is_finite() => format!(", {x:.1} standard errors outside"),
        _ => ", outside".into(),
    };
    match (number.verdict, number.reason) {
        (verdict, Some(reason)) => format!("{}, {reason}", verdict.word()),
        (verdict, None) => format!("{}{}", verdict.word(), number.sigmas.map_or(String::new(), outside)),
    }
}

fn verdict(found: &Comparison, has_stops: bool) -> String {
    let of = |verdict: Verdict| -> Vec<&str> {
        found.numbers.iter().filter(|number| number.verdict == verdict).map(|number| number.name).collect()
    };
    if let Some(wrong) = found.wrong.as_ref().filter(|_| has_stops) {
        return format!(
            "no device between stops was found that explains the record, so that it does not agree with the file: either a torque moved the \
             puck that this device does not have, or the fit missed it at an impact, which a shorter stretch shows (--from, --to); {wrong}"
        );
    }
    if let Some(wrong) = &found.wrong {
        let all = "the record contradicts the file: a torque moved the puck that no such device has";
        if found.misfit.is_none() {
            return format!("{all}; {wrong}");
        }
        let list = |verdict, words: &str| match &of(verdict)[..] {
            [] => String::new(),
            names => format!("; {words}: {}", names.join(", ")),
        };
        return format!(
            "{all}, which the misfit names{}{}{}",
            list(Verdict::Contradicts, "by the torque's equation the file is wrong in"),
            list(Verdict::Agrees, "it agrees in"),
            list(Verdict::NotDetermined, "not determined by this record")
        );
    }
    let (wrong, silent) = (of(Verdict::Contradicts), of(Verdict::NotDetermined));
    let mut text = match wrong.is_empty() {
        true if of(Verdict::Agrees).is_empty() => return "the record determines none of the file's numbers".into(),
        true => "the record agrees with the file".to_string(),
        false => format!("the record contradicts the file: {}", wrong.join(", ")),
    };
    if !silent.is_empty() {
        let _ = write!(text, "; not determined by this record: {}", silent.join(", "));
    }
    text
}

/// The line for the file, or what to do about the device.
fn remedy(number: &Compared, motion: Motion) -> Option<String> {
    let x: Interval = number.estimate.filter(|_| number.verdict == Verdict::Contradicts)?;
    let Scale { factor, unit } = Scale::of(number, motion);
    Some(match number.name {
        "constant torque" => {
            "no key: friction has to hold a constant torque; level the device, or take the offset out of its driver"
                .into()
        }
        "spring" => {
            "no key: a cable or a spring pulls the device; take it off, or remember that the file lacks it".into()
        }
        "gravity sine" => format!("[device.gravity] torque times the cosine of phase: {}", sized(x, factor, &unit)),
        "gravity cosine" => format!("[device.gravity] torque times the sine of phase: {}", sized(x, factor, &unit)),
        name if name.ends_with(OVER_INERTIA) => {
            format!("[device] {} have to give {}", name.replace(" over ", " and "), sized(x, factor, &unit))
        }
        name if ["cogging ", "friction "].iter().any(|wave| name.starts_with(wave)) => {
            let (table, part) = name.split_once(' ').unwrap_or_default();
            let (table, size) = if table == "friction" { ("friction_by_position", "share") } else { (table, "torque") };
            format!("[device.{table}] {size} times {part}: {}", sized(x, factor, &unit))
        }
        "sign" => "turn the motor's leads over, or its sign in the driver".into(),
        "delay" => format!("[loop] delay = \"{} {unit}\"", to(factor * x.value, 0.5 * factor * (x.high - x.low))),
        "delay and lag" => {
            format!("[loop] delay and [device] lag have to sum up to {}", sized(x, factor, &unit))
        }
        "low stop" | "high stop" => {
            let key = if number.name == "low stop" { "low" } else { "high" };
            format!("[device.stops] {key} = \"{} {unit}\"", to(factor * x.value, 0.5 * factor * (x.high - x.low)))
        }
        "stop stiffness" | "stop damping" | "stribeck torque" | "stribeck velocity" => {
            let (table, key) = number.name.split_once(' ').unwrap_or_default();
            let table = if table == "stop" { "stops" } else { table };
            format!("[device.{table}] {key} = \"{} {unit}\"", to(factor * x.value, 0.5 * factor * (x.high - x.low)))
        }
        name => match name.strip_prefix("handle ").or_else(|| name.strip_prefix("shaft ")) {
            Some(key) => {
                format!("[device.handle] {key} = \"{} {unit}\"", to(factor * x.value, 0.5 * factor * (x.high - x.low)))
            }
            None => match quantity(x, factor, &unit) {
                Some(quantity) => format!("[device] {name} = {quantity}"),
                None => format!("[device] {name}: {}", sized(x, factor, &unit)),
            },
        },
    })
}
