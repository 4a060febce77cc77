//! `hapt worst` of a network: the hands at all stations that draw most energy together.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_model::keys::Measure;
use hapt_model::{Motion, Source, Station, System};
use hapt_sweep::worst::{Hand, MOST_TOGETHER, WorstTogether, search_together};

use crate::args::WorstArgs;
use crate::colour;
use crate::failure::Failure;
use crate::format;
use crate::output;
use crate::world::inputs;
use crate::worst::{begin, grip, pasted, unit, watched, write};

pub fn run(source: &Source, args: &WorstArgs) -> Result<ExitCode, Failure> {
    let network = System::read(source, &args.world.sets)?;
    let files = args.out.as_deref().map(|path| Files::of(path, &network));
    if let Some(files) = &files {
        // Other files stand beside it.
        files.all().try_for_each(|path| output::regular("--out", path))?;
        let all: Vec<_> = files.all().map(|path| ("--out", path)).collect();
        output::apart(&all, &inputs(&args.world.path, &network))?;
    }
    // An invalid output file is reported before the search.
    let drafts = files.iter().flat_map(Files::all).map(begin).collect::<Result<Vec<_>, _>>()?;
    let worst = watched(MOST_TOGETHER, |watch| search_together(&network, watch))?;
    if let Some(files) = &files {
        let worlds = worst.network.stations.iter().map(|station| station.stated_world().to_toml());
        let texts = worlds.chain([worst.network.to_toml(&files.names())]);
        write(files.all().zip(drafts).zip(texts))?;
    }
    let text = if args.json {
        let json = serde_json::to_string_pretty(&worst).map_err(|error| Failure::System(error.to_string()))?;
        json + "\n"
    } else {
        text(network.title.as_deref().unwrap_or(&source.name), &worst, args.out.as_deref())
    };
    let mut out = stdout().lock();
    out.write_all(colour::for_stdout(&text).as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(if worst.broken { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Where a network and its worlds are written.
struct Files {
    network: PathBuf,
    /// `FILE-NAME.toml` beside it, for each station.
    worlds: Vec<PathBuf>,
}

impl Files {
    fn of(path: &Path, network: &System) -> Files {
        let beside = |station: &Station| {
            let mut name = path.file_stem().unwrap_or_default().to_os_string();
            name.push(format!("-{}.toml", station.name));
            path.with_file_name(name)
        };
        Files { network: path.to_path_buf(), worlds: network.stations.iter().map(beside).collect() }
    }

    /// The network last: when it is there, its worlds are.
    fn all(&self) -> impl Iterator<Item = &Path> {
        self.worlds.iter().chain([&self.network]).map(PathBuf::as_path)
    }

    /// The names by which the network knows its worlds.
    fn names(&self) -> Vec<String> {
        let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.worlds.iter().map(name).collect()
    }
}

fn text(title: &str, worst: &WorstTogether, out: Option<&Path>) -> String {
    let mut text = format!("{title}\n\n");
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<9} {words}");
    };
    line("verdict", verdict(worst));
    for (station, hand) in worst.network.stations.iter().zip(&worst.hands) {
        line("hand", format!("at {}: {}", station.name, self::hand(station, hand.as_ref())));
    }
    line("times", times(worst));
    line("run", shown_run(worst));
    for (station, (name, required, has)) in worst.network.stations.iter().zip(&worst.damping) {
        let unit = unit(&station.world, Measure::Damping);
        let asks = required.map_or("no damping is known to suffice".into(), |b| {
            format!("the certificate requires a damping of {} {unit}", format::number(b))
        });
        line("gap", format!("{name}: {asks}; the device has {} {unit}", format::number(*has)));
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

fn verdict(worst: &WorstTogether) -> String {
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
    let Some(hand) = hand else { return "nobody".into() };
    let to = match station.world.motion {
        Motion::Rotary => format!("{} deg", format::number(hand.to.to_degrees())),
        Motion::Linear => format!("{} mm", format::number(1e3 * hand.to)),
    };
    format!("{}, its spring drawn to {to}", grip(&station.world, &hand.grip))
}

fn times(worst: &WorstTogether) -> String {
    if !worst.late {
        return "messages take and lose what the file says".into();
    }
    let way = |link: &hapt_model::Link| {
        let [one, other] = link.between.map(|at| worst.network.stations[at].name.as_str());
        format!("{} between {one} and {other}", format::time(link.delay))
    };
    let links = &worst.network.links;
    let ways = match links.first() {
        Some(first) if links.len() > 1 && links.iter().all(|link| link.delay == first.delay) => {
            format!("{} on every link", format::time(first.delay))
        }
        _ => links.iter().map(way).collect::<Vec<_>>().join(", "),
    };
    format!("messages come as late as age_max allows, and all arrive: {ways}")
}

fn shown_run(worst: &WorstTogether) -> String {
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

fn breaking(worst: &WorstTogether) -> String {
    match worst.breaking_part {
        Some(part) => format!(
            "with late messages such hands draw energy at {} of the required dampings",
            format::number((part * 1e3).round() / 1e3)
        ),
        None => "with late messages such hands draw energy at no part of the required dampings that was tried".into(),
    }
}

fn notes(worst: &WorstTogether) -> Vec<&'static str> {
    let mut notes = Vec::new();
    if worst.drawn.let_go > 0 {
        notes.push(
            "a link lets go in this run; the most that its taking hold can add counts as what the network had to give",
        );
    }
    let is_rough = |station: &Station| station.world.device.friction > 0.0 || station.world.device.encoder.is_some();
    if worst.network.stations.iter().any(is_rough) {
        notes.push("hands swing: counts and friction are in the runs, but no motion against counts is tried");
    }
    notes
}
