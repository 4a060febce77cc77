//! The answer for a device that is richer than the model: the fit to the torque, with its misfit by kind.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::process::ExitCode;

use hapt_identify::{Error, Interval, Term, TermKind, TorqueFit};
use hapt_model::keys::Measure;
use hapt_model::{HARMONICS, Motion};

use super::figure::Drawn;
use super::print::{effort, entry, sized, to, units};
use super::{Given, plot, print, print_text, written};
use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::output;

pub fn run(args: &IdentifyArgs, given: &Given, fit: &TorqueFit, error: Option<&Error>) -> Result<ExitCode, Failure> {
    match error {
        Some(Error::Unexplained) if !fit.is_unrelated() => {
            messages::say(
                "note: inertia, damping, friction and a delay of up to 50 ms do not explain the motion by themselves",
            );
        }
        Some(error) => messages::say(format_args!("note: {error}")),
        None => {}
    }
    messages::say("note: the numbers are those of the torque's equation; their intervals allow for what it leaves");
    if args.world.is_some() {
        messages::say(
            "note: --world gives no verdict here; hapt check decides on the world with this answer's [device] table, intervals and all",
        );
    }
    let table = table(given, fit);
    if fit.is_moved_by_another {
        messages::say(
            "note: no inertia can be determined from this record: more than a twentieth of the torque (of a device without friction a fiftieth) goes with nothing that moves, so something else moves the device, such as a hand, or it runs into end stops that no fit explained; --force COLUMN takes in a hand's sensor, and --from and --to leave stops out",
        );
    } else if fit.inertia.is_none() {
        messages::say(
            "note: no inertia can be determined from this record; record faster motion in both directions, free of hands or with --force COLUMN for their sensor",
        );
    }
    if given.record.forces().is_some() && fit.inertia.is_some() {
        messages::say(
            "note: the inertia is what moves between motor and sensor; what is beyond the sensor is in the sensor's torque",
        );
    }
    let by_both = fit.inertia_by_motion.zip(fit.inertia_by_torque);
    if let Some(words) = by_both.and_then(|(motion, torque)| print::inertias(given, motion, torque)) {
        messages::say(format_args!("warning: {words}"));
    }
    let write = args.write.as_deref().filter(|_| fit.inertia.is_some());
    let drafts = [
        write.map(|target| output::draft(target, table.as_bytes())).transpose()?,
        plot(args, given, &Drawn::of_torque(fit))?,
    ];
    written(drafts)?;
    let text = if args.json {
        print::pretty(&fit.json(given.motion == Motion::Linear, given.record.forces().is_some()))?
    } else {
        text(given, fit, args.inertia.is_some())
            + &if args.write.is_some() || fit.inertia.is_none() { String::new() } else { format!("\n{table}") }
    };
    print_text(&text)
}

fn text(given: &Given, fit: &TorqueFit, inertia_is_known: bool) -> String {
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
    let effort_si = if given.motion == Motion::Linear { "N" } else { "N m" };
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<9} {words}");
    };
    let within =
        |x: Option<Interval>, factor: f64, unit: &str| x.map_or("not determined".into(), |x| sized(x, factor, unit));
    let or_best = |x: Option<Interval>, best: f64, factor: f64, unit: &str| {
        let fits = || format!("not determined; the best fit has {} {unit}", print::digits(factor * best, 3));
        x.map_or_else(fits, |x| sized(x, factor, unit))
    };
    if inertia_is_known {
        line("inertia", format!("{} {inertia}, as given", format::number(fit.inertia.map_or(0.0, |x| x.value))));
        line("gain", within(fit.gain, 1.0, "of the commanded torque"));
    } else {
        line("inertia", or_best(fit.inertia, fit.best.inertia, 1.0, &inertia));
        if let (Some(torque), Some(motion)) = (fit.inertia_by_torque, fit.inertia_by_motion) {
            line("", format!("{} by the torque alone", sized(torque, 1.0, &inertia)));
            line("", format!("{} by the motion alone", sized(motion, 1.0, &inertia)));
        }
    }
    line("damping", or_best(fit.damping, fit.best.damping, 1.0, &damping));
    line("friction", or_best(fit.friction, fit.best.friction, per_si, effort));
    line("delay", "not determined beside the misfit".into());
    if let Some(offset) = fit.offset.filter(|offset| !offset.covers(0.0)) {
        line("offset", format!("{}: a constant torque that was not commanded", sized(offset, per_si, effort)));
        // A constant torque brakes in one direction and drives in the other.
        if let Some(levels) = print::by_direction(fit.friction, fit.offset) {
            let [with, against] = levels.map(|x| to(per_si * x.value, 0.5 * per_si * (x.high - x.low)));
            line("", format!("or friction by direction: {with} {effort} forward, {against} backward"));
        }
    }
    if given.record.forces().is_some() {
        line("force", within(fit.force, 1.0, &format!("{effort_si} for one of its column")));
    }
    for (name, words) in fit.terms.iter().map(|term| term_words(given, term)) {
        line(name, words);
    }
    line(
        "sign",
        match fit.sign {
            Some(sign) if sign < 0.0 => "-1: a positive torque makes the position fall".into(),
            Some(_) => "1: a positive torque makes the position grow".into(),
            None => "not determined".into(),
        },
    );
    for (i, words) in print::misfit_lines(&fit.misfit).into_iter().enumerate() {
        line(if i == 0 { "misfit" } else { "" }, words);
    }
    text
}

/// A term's name, and its size in words.
pub fn term_words(given: &Given, term: &Term) -> (&'static str, String) {
    let (effort, per_si) = effort(given.motion);
    let is_linear = given.motion == Motion::Linear;
    let size = |factor: f64, unit: &str| sized(term.size, factor, unit);
    let words = match term.kind {
        TermKind::Stiffness => size(1.0, &Measure::Stiffness.dimension(given.motion).symbol()),
        TermKind::Turn { times, phase } => {
            format!("{}, {times} times a turn, sin({times} angle {:+.2} rad)", size(per_si, effort), phase)
        }
        TermKind::FrictionByPosition { times, phase } => {
            format!(
                "{} more and less, {times} times a turn, sin({times} angle {:+.2} rad)",
                size(per_si, effort),
                phase
            )
        }
        TermKind::Stribeck { velocity, .. } => {
            let unit = if is_linear { "m/s" } else { "rad/s" };
            format!("{} more at rest, falling within {} {unit}", size(per_si, effort), print::digits(velocity, 2))
        }
        TermKind::Drag => size(1.0, if is_linear { "N s^2/m^2" } else { "N m s^2/rad^2" }),
    };
    let is_friction = matches!(term.kind, TermKind::FrictionByPosition { .. });
    let name = if is_friction { "friction" } else { term.kind.word() };
    let predicts = |part: f64| format!("; predicts {:.0} % of what is left without", 100.0 * part);
    (name, words + &term.predicts.map_or(String::new(), predicts))
}

/// The `[device]` table.
fn table(given: &Given, fit: &TorqueFit) -> String {
    let [inertia, damping] = units(given.motion);
    let (effort, per_si) = effort(given.motion);
    let mut text = format!("[device] # identified from {}\n", given.name.escape_default());
    let mut line = |key: &str, x: Option<Interval>, factor: f64, unit: &str| {
        let _ = match x {
            Some(x) => writeln!(text, "{}", entry(key, x, factor, unit)),
            None => writeln!(text, "# {key}: not determined by this record"),
        };
    };
    let [of_damping, friction] = beside_stribeck(fit);
    line("inertia", fit.inertia, 1.0, &inertia);
    line("damping", of_damping, 1.0, &damping);
    match print::by_direction(friction, fit.offset) {
        Some(levels) => text += &print::direction_entries(levels, per_si, effort).map(|entry| entry + "\n").concat(),
        None => line("friction", friction, per_si, effort),
    }
    if let Some(counts) = fit.counts().filter(|_| given.motion == Motion::Rotary) {
        let _ = writeln!(text, "encoder  = {counts}");
    }
    if fit.sign.is_some_and(|sign| sign < 0.0) {
        text += "# the motor's sign is -1: turn its leads over, or its sign in the driver, before a world runs on it\n";
    }
    text + &own_torques(given.motion, &fit.terms, friction)
}

/// Damping and Coulomb friction, with Stribeck friction separated where the record has it.
fn beside_stribeck(fit: &TorqueFit) -> [Option<Interval>; 2] {
    let all = [fit.damping, fit.friction];
    let Some((_, _, beside)) = stribeck(&fit.terms) else { return all };
    let moved = |x: Interval, to: f64| Interval {
        value: to,
        low: (x.low + to - x.value).max(0.0),
        high: x.high + to - x.value,
    };
    [0, 1].map(|i| all[i].map(|x| moved(x, beside[i])))
}

/// Stribeck friction: its size at rest, the velocity at which it ends as a straight line of the same area, and the damping and friction
/// that go with it.
fn stribeck(terms: &[Term]) -> Option<(f64, f64, [f64; 2])> {
    terms.iter().find_map(|term| match term.kind {
        // Half of its width times its height is ∫ exp(-(v/velocity)²).
        TermKind::Stribeck { velocity, beside } => Some((term.size.value, PI.sqrt() * velocity, beside)),
        TermKind::Stiffness | TermKind::Turn { .. } | TermKind::FrictionByPosition { .. } | TermKind::Drag => None,
    })
}

/// Sines of the position, as a table of a device has them: harmonics of one pitch.
struct Wave {
    /// The size of the largest.
    size: f64,
    /// In degrees.
    pitch: f64,
    /// In rad; `None`: 0.
    phase: Option<f64>,
    /// Of the harmonics, as parts of the largest.
    sine: Vec<f64>,
    cosine: Vec<f64>,
}

impl Wave {
    /// Of sines by their periods in a turn, sizes and phases, the largest first. The pitch is the one of which most of them are harmonics, as
    /// a file has one. `None`: there are none.
    fn of(sines: &[(u32, f64, f64)]) -> Option<Wave> {
        let (largest, size, phase) = *sines.first()?;
        let order = |base: u32, times: u32| {
            let order = times / base;
            (times.is_multiple_of(base) && order as usize <= HARMONICS).then_some(order as usize)
        };
        let harmonics = |base: u32| {
            sines.iter().filter_map(move |(times, size, phase)| Some((order(base, *times)?, *size, *phase)))
        };
        let bases = (1..=HARMONICS as u32).filter(|part| largest.is_multiple_of(*part)).map(|part| largest / part);
        // Of as many the shortest pitch.
        let base = bases.min_by_key(|base| std::cmp::Reverse(harmonics(*base).count()))?;
        let pitch = 360.0 / f64::from(base);
        if harmonics(base).count() == 1 {
            let phase = Some(-wrapped(phase) / f64::from(largest));
            return Some(Wave { size, pitch, phase, sine: vec![1.0], cosine: Vec::new() });
        }
        let most = harmonics(base).map(|(order, ..)| order).max()?;
        let (mut sine, mut cosine) = (vec![0.0; most], vec![0.0; most]);
        for (order, amplitude, phase) in harmonics(base) {
            let part = amplitude / size;
            (sine[order - 1], cosine[order - 1]) = (part * phase.cos(), part * phase.sin());
        }
        Some(Wave { size, pitch, phase: None, sine, cosine })
    }

    /// The sum of its amplitudes.
    fn sum(&self) -> f64 {
        let cosine = self.cosine.iter().copied().chain(std::iter::repeat(0.0));
        self.size * self.sine.iter().zip(cosine).map(|(sine, cosine)| sine.hypot(cosine)).sum::<f64>()
    }

    /// Its lines in a table, the keys padded to this width.
    fn lines(&self, width: usize) -> String {
        let list = |numbers: &[f64]| {
            let numbers: Vec<String> = numbers.iter().map(|x| format!("{:?}", (x * 1e4).round() / 1e4 + 0.0)).collect();
            format!("[{}]", numbers.join(", "))
        };
        let mut text = format!("{:width$} = \"{} deg\"\n", "pitch", self.pitch);
        if let Some(phase) = self.phase {
            let _ = writeln!(text, "{:width$} = \"{} rad\"", "phase", print::digits(phase, 4));
        }
        let _ = writeln!(text, "{:width$} = {}", "sine", list(&self.sine));
        if !self.cosine.is_empty() {
            let _ = writeln!(text, "{:width$} = {}", "cosine", list(&self.cosine));
        }
        text
    }
}

/// The sines of these terms with sizes above 0, the largest first: the periods in a turn, the size, and the phase.
fn sines(terms: impl Iterator<Item = (u32, f64, f64)>) -> Vec<(u32, f64, f64)> {
    let positive = |(times, size, phase): (u32, f64, f64)| {
        if size < 0.0 { (times, -size, phase + PI) } else { (times, size, phase) }
    };
    let mut all: Vec<_> = terms.map(positive).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all
}

/// `[device.friction_by_position]` of the terms that change friction by a part of the table's; none where it is more than all of that.
fn changing_friction(terms: &[Term], friction: Option<Interval>) -> Option<String> {
    let changes = |term: &Term| match term.kind {
        TermKind::FrictionByPosition { times, phase } => Some((times, term.size, phase)),
        TermKind::Stiffness | TermKind::Turn { .. } | TermKind::Stribeck { .. } | TermKind::Drag => None,
    };
    let friction = friction?.value;
    let wave =
        Wave::of(&sines(terms.iter().filter_map(changes).map(|(times, size, phase)| (times, size.value, phase))))?;
    let largest =
        terms.iter().filter_map(changes).map(|(_, size, _)| size).find(|size| size.value.abs() == wave.size)?;
    (wave.sum() <= friction).then(|| {
        let [share, low, high] =
            [wave.size, largest.low, largest.high].map(|size| print::digits(size / friction, 3));
        let width = if wave.cosine.is_empty() { "share" } else { "cosine" }.len();
        let lines = wave.lines(width);
        format!(
            "\n[device.friction_by_position]\n{:width$} = {share} # 95 %: {low} to {high}, and no tolerance of a file\n{lines}",
            "share"
        )
    })
}

/// `[device.friction_by_position]`, `[device.stribeck]`, and `[device.gravity]` and `[device.cogging]` of the terms that repeat.
pub fn own_torques(motion: Motion, all: &[Term], friction: Option<Interval>) -> String {
    let (effort, per_si) = effort(motion);
    let mut text = changing_friction(all, friction).unwrap_or_default();
    if let Some((torque, velocity, _)) = stribeck(all) {
        let (torque, velocity) = (print::digits(torque * per_si, 3), print::digits(velocity, 3));
        let unit = Measure::Velocity.dimension(motion).symbol();
        let _ =
            write!(text, "\n[device.stribeck]\ntorque   = \"{torque} {effort}\"\nvelocity = \"{velocity} {unit}\"\n");
    }
    let turning = |term: &Term| match term.kind {
        // The term is the torque of a motor of sign 1 against the device's torque.
        TermKind::Turn { times, phase } => Some((times, term.size.value, phase + PI)),
        TermKind::Stiffness | TermKind::FrictionByPosition { .. } | TermKind::Stribeck { .. } | TermKind::Drag => None,
    };
    let (gravity, cogging): (Vec<_>, Vec<_>) =
        sines(all.iter().filter_map(turning)).into_iter().partition(|(times, ..)| *times == 1);
    if let Some((_, size, angle)) = gravity.first() {
        let (torque, phase) = (print::digits(size * per_si, 4), print::digits(wrapped(*angle), 4));
        let _ = write!(text, "\n[device.gravity]\ntorque = \"{torque} {effort}\"\nphase  = \"{phase} rad\"\n");
    }
    if let Some(wave) = Wave::of(&cogging) {
        let (torque, lines) = (print::digits(wave.size * per_si, 4), wave.lines("torque".len()));
        let _ = write!(text, "\n[device.cogging]\ntorque = \"{torque} {effort}\"\n{lines}");
    }
    text
}

/// An angle within half a turn of 0.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

#[cfg(test)]
mod tests {
    use hapt_model::{Source, World};
    use hapt_testing::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(64))]

        /// The table has the torque and the friction of the terms at every position, where they are harmonics of one pitch.
        #[test]
        fn tables_have_every_harmonic(
            times in 2u32..12, orders in prop::collection::btree_set(1u32..=4, 1..4), rubs in prop::collection::btree_set(1u32..=4, 1..4),
            numbers in prop::collection::vec((0.1..1.0f64, -7.0..7.0f64, any::<bool>()), 9), places in prop::collection::vec(-3.0..3.0f64, 8),
        ) {
            let of = |i: usize, most: f64| {
                let (size, phase, is_negative) = numbers[i];
                (if is_negative { -most * size } else { most * size }, phase)
            };
            let term = |kind, value| Term { kind, size: Interval { value, low: value, high: value }, predicts: None };
            let turn = |times, (size, phase)| term(TermKind::Turn { times, phase }, size);
            let mut terms = vec![turn(1, of(0, 0.02))];
            terms.extend(orders.iter().zip(1..).map(|(order, i)| turn(order * times, of(i, 0.01))));
            let rubs = rubs.iter().zip(5..).map(|(order, i)| (order * times, of(i, 0.002)));
            terms.extend(rubs.map(|(times, (size, phase))| term(TermKind::FrictionByPosition { times, phase }, size)));
            let friction = 0.01;
            let own = own_torques(Motion::Rotary, &terms, Some(Interval { value: friction, low: friction, high: friction }));
            let head = "loop.period = \"1 ms\"\n[device]\ninertia = 1e-3\nfriction = \"10 N mm\"\n";
            let world = World::read(&Source::from_text("d.toml", format!("{head}{own}")), &[]).map_err(|e| TestCaseError::fail(format!("{e} {own}")))?;
            for z in places {
                let (mut torque, mut level) = (0.0, friction);
                for term in &terms {
                    match term.kind {
                        TermKind::Turn { times, phase } => torque -= term.size.value * (f64::from(times) * z + phase).sin(),
                        TermKind::FrictionByPosition { times, phase } => level += term.size.value * (f64::from(times) * z + phase).sin(),
                        kind @ (TermKind::Stiffness | TermKind::Stribeck { .. } | TermKind::Drag) => prop_assert!(false, "{kind:?}"),
                    }
                }
                let device = &world.device;
                prop_assert!((device.torque.at(z) - torque).abs() < 1e-4, "{} {torque} {own}", device.torque.at(z));
                let there = friction * device.friction_by_position.map_or(1.0, |changes| changes.at(z));
                prop_assert!((there - level).abs() < 1e-4, "{there} {level} {own}");
            }
        }
    }
}
