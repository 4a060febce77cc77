//! `hapt worst` of a network: the hands at all stations that draw most energy together.

use std::fmt::Write as _;
use std::path::Path;

use hapt_model::keys::Measure;
use hapt_model::{Motion, Station};
use hapt_sweep::worst::{Hand, WorstOfNetwork};

use super::{grip, pasted, unit};
use crate::format;

pub fn text(title: &str, worst: &WorstOfNetwork, out: Option<&Path>) -> String {
    let mut text = format!("{title}\n\n");
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<9} {words}");
    };
    line("verdict", verdict(worst));
    let stations = || worst.network.stations.iter().zip(&worst.stations);
    for (station, of) in stations() {
        line("hand", format!("at {}: {}", of.name, hand(station, of.hand.as_ref())));
    }
    line("times", times(worst));
    line("run", shown_run(worst));
    for (station, of) in stations() {
        let unit = unit(&station.world, Measure::Damping);
        let asks = of.required_damping.map_or("no damping is known to suffice".into(), |b| {
            format!("the certificate requires a damping of {} {unit}", format::number(b))
        });
        line("gap", format!("{}: {asks}; the device has {} {unit}", of.name, format::number(of.device_damping)));
    }
    line("", breaking(worst));
    for note in notes(worst) {
        line("note", note.into());
    }
    match out {
        Some(path) => {
            let _ = writeln!(text, "\nhapt sim {} shows it", path.display());
        }
        None => {
            for station in worst.network.stations.iter().filter(|station| !station.world.scenarios.is_empty()) {
                let _ = write!(text, "\n# {}, the world of {}\n{}", station.file, station.name, pasted(&station.world));
            }
        }
    }
    text
}

fn verdict(worst: &WorstOfNetwork) -> String {
    let tried = format::count(worst.runs as u64);
    match (worst.broken, worst.certified) {
        (true, false) => "broken: passive hands at all stations together draw energy from it".into(),
        (true, true) => {
            "broken, though certified: what `hapt check` calls not proved lets passive hands draw energy together"
                .into()
        }
        (false, true) => {
            format!("survived, as certified: in none of {tried} runs do passive hands draw energy together")
        }
        (false, false) => {
            format!("survived, though not certified: in none of {tried} runs do passive hands draw energy together")
        }
    }
}

fn hand(station: &Station, hand: Option<&Hand>) -> String {
    let Some(hand) = hand else { return "no hand".into() };
    let to = match station.world.motion {
        Motion::Rotary => format!("{} deg", format::number(hand.to.to_degrees())),
        Motion::Linear => format!("{} mm", format::number(1e3 * hand.to)),
    };
    format!("{}, its spring drawn to {to}", grip(&station.world, &hand.grip))
}

fn times(worst: &WorstOfNetwork) -> String {
    if !worst.late {
        return "messages take and lose what the file says".into();
    }
    let delay_text = |link: &hapt_model::Link| {
        let [one, other] = link.between.map(|at| worst.network.stations[at].name.as_str());
        format!("{} between {one} and {other}", format::time(link.delay))
    };
    let links = &worst.network.links;
    let delays = match links.first() {
        Some(first) if links.len() > 1 && links.iter().all(|link| link.delay == first.delay) => {
            format!("{} on every link", format::time(first.delay))
        }
        _ => links.iter().map(delay_text).collect::<Vec<_>>().join(", "),
    };
    format!("messages come as late as age_max allows, and all arrive: {delays}")
}

fn shown_run(worst: &WorstOfNetwork) -> String {
    let drawn = &worst.drawn;
    let (within, begins) = (format::time(worst.duration_s), format::time(worst.begins_s));
    let given = match drawn.supplied {
        supplied if supplied > 0.0 => format!("the {} that the network had to give", format::energy(supplied)),
        _ => "all that they gave".into(),
    };
    let swing = format!("the hands begin at {begins} and swing at {} Hz", format::number(worst.hz));
    match worst.broken {
        true => format!(
            "{swing}; in {within} they draw {} more than {given}, at {}",
            format::energy(drawn.gain),
            format::time(drawn.at_s)
        ),
        false => format!("{swing}; in {within} they draw no more than {given}"),
    }
}

fn breaking(worst: &WorstOfNetwork) -> String {
    match worst.breaking_part {
        Some(part) => format!(
            "with late messages such hands draw energy at {} of the required dampings",
            format::number((part * 1e3).round() / 1e3)
        ),
        None => "with late messages such hands draw energy at no part of the required dampings that was tried".into(),
    }
}

fn notes(worst: &WorstOfNetwork) -> Vec<&'static str> {
    let mut notes = Vec::new();
    if worst.drawn.let_go > 0 {
        notes.push(
            "a link lets go in this run; the most that its taking hold can add counts as what the network had to give",
        );
    }
    let is_rough =
        |station: &Station| station.world.device.largest_friction() > 0.0 || station.world.device.encoder.is_some();
    if worst.network.stations.iter().any(is_rough) {
        notes.push("hands swing: counts and friction are in the runs, but no motion against counts is tried");
    }
    notes
}
