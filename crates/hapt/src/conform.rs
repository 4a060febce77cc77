//! `hapt wheel --conform`: how a wheel of this computer plays each effect.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write, stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_host::conform::evdev::{Evdev, WheelDevice, wheels};
use hapt_host::conform::{Case, ConformError, Conformance, Finding, KnownError, Law, Verdict, cases, conform};
use hapt_report::{ConformanceCase, ConformanceReport};

use crate::args::ConformArgs;
use crate::failure::Failure;
use crate::messages;
use crate::output;
use crate::signals;

/// The question before anything moves.
const QUESTION: &str = "it will swing by itself for about two minutes, hands off; type yes to go on: ";

pub fn run(args: &ConformArgs, device: Option<&Path>) -> Result<ExitCode, Failure> {
    if let Some(out) = &args.out {
        output::format("--out", out, &["html"])?;
    }
    let level = 0.01 * f64::from(args.level);
    let chosen = chosen(level, &args.only)?;
    let path = device.map_or_else(only, |path| Ok(path.to_path_buf()))?;
    // An invalid output file is reported before the wheel moves for minutes.
    let draft = args.out.clone().map(|out| {
        let name = out.display().to_string();
        output::Draft::new(out).map_err(|error| Failure::write(name, error))
    });
    let draft = draft.transpose()?;
    signals::end_in_order();
    let wheel = Evdev::open(&path, || signals::signalled().is_some());
    let mut wheel = wheel.map_err(|error| Failure::System(error.to_string()))?;
    let name = wheel.name().to_string();
    if !args.yes {
        ask(&name, &path)?;
    }
    messages::say(format_args!("{name} ({}) moves now; Ctrl-C takes every torque off", path.display()));
    let outcome = conform(&mut wheel, chosen, 2.0 * level, |finding| {
        messages::say(format_args!("{:22} {}", finding.name, verdict_text(finding.verdict)));
    });
    drop(wheel);
    if let Some(code) = signals::signalled() {
        return Ok(ExitCode::from(code));
    }
    let found = match outcome {
        Ok(found) => found,
        Err(ConformError::NoUpdates) => {
            print(&format!("{name}\n{}\n", ConformError::NoUpdates))?;
            return Ok(ExitCode::FAILURE);
        }
        Err(error) => return Err(Failure::System(format!("{name}: {error}"))),
    };
    if let Some(mut draft) = draft {
        let written = draft.write_all(report(&name, &found).page().as_bytes()).and_then(|()| draft.finish());
        written.map_err(|error| Failure::write("the page", error))?;
    }
    print(&text(&name, &path, &found))?;
    Ok(if found.conforms() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The cases with these names; all of them without names.
fn chosen(level: f64, names: &[String]) -> Result<Vec<Case>, Failure> {
    let all = cases(level);
    if let Some(name) = names.iter().find(|name| all.iter().all(|case| case.name != name.as_str())) {
        let known: Vec<&str> = all.iter().map(|case| case.name).collect();
        return Err(Failure::input(format!("--only {name:?}: is no case; expected some of {}", known.join(", "))));
    }
    Ok(all.into_iter().filter(|case| names.is_empty() || names.iter().any(|name| name == case.name)).collect())
}

/// The wheel of this computer, where there is one.
fn only() -> Result<PathBuf, Failure> {
    let (found, closed) = wheels().map_err(|error| Failure::System(format!("/dev/input: {error}")))?;
    let unseen = match closed {
        0 => String::new(),
        closed => format!("; {closed} input devices cannot be opened, perhaps only root may"),
    };
    match found.as_slice() {
        [] => Err(Failure::System(format!("there is no wheel with force feedback{unseen}"))),
        [WheelDevice { path, .. }] => Ok(path.clone()),
        several => {
            let list: Vec<String> =
                several.iter().map(|wheel| format!("\n  {}  {}", wheel.path.display(), wheel.name)).collect();
            Err(Failure::input(format!("--conform: there are several wheels; name one of them:{}", list.concat())))
        }
    }
}

fn ask(name: &str, path: &Path) -> Result<(), Failure> {
    if !stdin().is_terminal() {
        return Err(Failure::input("--conform moves the wheel; without a terminal to ask on, add --yes"));
    }
    messages::say(format_args!("{name} ({}): {QUESTION}", path.display()));
    let mut answer = String::new();
    stdin().read_line(&mut answer).map_err(|error| Failure::System(format!("standard input: {error}")))?;
    if answer.trim() == "yes" { Ok(()) } else { Err(Failure::input("--conform: the wheel was not moved")) }
}

fn print(text: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)
}

fn verdict_text(verdict: Verdict) -> String {
    match verdict {
        Verdict::Conforms => "conforms".into(),
        Verdict::Known(error) => error.sentence().into(),
        Verdict::Differs => "differs, as no known error does".into(),
    }
}

/// The result of all cases in a sentence.
fn sentence(found: &Conformance) -> String {
    let all = found.findings.len();
    let good = found.findings.iter().filter(|finding| finding.verdict == Verdict::Conforms).count();
    format!("{good} of {all} cases conform")
}

/// The findings on the wheel itself.
fn itself(found: &Conformance) -> Vec<(String, String)> {
    let plant = &found.plant;
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let row = |name: &str, text: String| (name.to_string(), text);
    let mut list = vec![
        row("strength", format!("the largest torque accelerates it by {:.1} half ranges/s²", plant.strength.abs())),
        row(
            "friction",
            format!(
                "{} of the largest torque, and {} at a half range a second",
                percent(plant.friction),
                percent(plant.damping)
            ),
        ),
        row("latency", format!("{:.0} ms from a request to its torque", 1e3 * plant.latency)),
        row("noise", format!("{} of the largest torque", percent(plant.noise))),
    ];
    if plant.spring.abs() > 0.02 {
        list.push(row(
            "centring",
            format!("a spring of {} of the largest torque at the end of the range", percent(plant.spring)),
        ));
    }
    for (law, scale) in found.findings.iter().filter_map(|finding| finding.scale) {
        let (name, at) = match law {
            Law::Damper => ("damper", " at a half range a second"),
            Law::Friction => ("friction effect", ""),
            Law::Inertia => ("inertia", " at a half range/s²"),
            Law::Spring => continue,
        };
        list.push(row(name, format!("a full coefficient gives {} of the largest torque{at}", percent(scale))));
    }
    list
}

fn text(name: &str, path: &Path, found: &Conformance) -> String {
    let mut text = format!("{name} ({})\n", path.display());
    for (name, line) in itself(found) {
        let _ = writeln!(text, "{name:16} {line}");
    }
    text += "\ncase                   off %   of the largest torque\n";
    for Finding { name, off, verdict, .. } in &found.findings {
        let _ = writeln!(text, "{name:22} {:6.2}  {}", 100.0 * off, verdict_text(*verdict));
    }
    text + &sentence(found) + "\n"
}

fn report(name: &str, found: &Conformance) -> ConformanceReport {
    let cases = found.findings.iter().map(|finding| {
        let curve =
            |of: fn(&(f64, f64, f64)) -> f64| finding.torques.iter().map(|row| (row.0, 100.0 * of(row))).collect();
        ConformanceCase {
            name: finding.name.into(),
            asks: finding.asks.clone(),
            conforms: finding.verdict == Verdict::Conforms,
            verdict: verdict_text(finding.verdict),
            off: 100.0 * finding.off,
            acted: curve(|row| row.1),
            meant: curve(|row| row.2),
        }
    });
    let errors = KnownError::ALL.iter().map(|error| {
        let cases = found.findings.iter().filter(|finding| finding.verdict == Verdict::Known(*error));
        (error.sentence().into(), cases.map(|finding| finding.name.into()).collect())
    });
    ConformanceReport {
        wheel: name.into(),
        verdict: sentence(found) + ".",
        found: itself(found),
        cases: cases.collect(),
        errors: errors.collect(),
    }
}
