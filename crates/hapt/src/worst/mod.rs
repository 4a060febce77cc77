//! `hapt worst`: the passive hand that draws most energy from a world's loop, and the scenario that shows it.

mod together;

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use hapt_analysis::{Grip, Status};
use hapt_model::keys::Measure;
use hapt_model::{Drive, Shape, Station, System, World};
use hapt_sweep::worst::{Exploit, Gap, Hand, HandMotion, Watch, Worst, WorstOfWorld};

use crate::answer::{answer, begin, pretty, write};
use crate::args::WorstArgs;
use crate::failure::Failure;
use crate::format;
use crate::output;
use crate::progress::Progress;
use crate::world::{inputs, read_system, source};

/// The polling period of the search.
const LOOK: Duration = Duration::from_millis(200);

pub fn run(args: &WorstArgs) -> Result<ExitCode, Failure> {
    if let Some(path) = &args.out {
        output::format("--out", path, &["toml"])?;
    }
    let source = source(&args.world.path)?;
    let system = read_system(&source, &args.world.sets)?;
    let is_world = system.world().is_some();
    let targets = args.out.as_deref().map_or(Vec::new(), |out| targets(out, &system));
    if !is_world {
        targets.iter().try_for_each(|path| output::regular("--out", path))?;
    }
    let outputs: Vec<_> = targets.iter().map(|path| ("--out", path.as_path())).collect();
    output::apart(&outputs, &inputs(&args.world.path, &system))?;
    // Invalid output files are reported before the search, which says whether a world needs the file of a motion.
    let early = targets.iter().skip(usize::from(is_world));
    let mut drafts = early.map(|path| begin(path)).collect::<Result<Vec<_>, _>>()?;
    let most = hapt_sweep::worst::most_runs(&system)?;
    let worst = watched(most, |watch| hapt_sweep::worst::search(&system, watch))?;
    let (title, out) = (system.title_or(&source), args.out.as_deref());
    let (text, files): (String, Vec<String>) = match &worst {
        Worst::World(worst) => {
            let shown = with_scenario(&system.stations[0].world, worst, out);
            let motion = worst.motion.as_ref().map(|motion| motion.csv(system.motion));
            (text(title, worst, out, &shown), motion.into_iter().chain([shown.to_toml()]).collect())
        }
        Worst::Network(worst) => {
            let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let names: Vec<String> = targets.iter().map(name).collect();
            let worlds = worst.network.stations.iter().map(|station| station.stated_world().to_toml());
            (together::text(title, worst, out), worlds.chain([worst.network.to_toml(&names)]).collect())
        }
    };
    if let Some(out) = out.filter(|_| drafts.len() < files.len()) {
        // A device cannot have a file next to it.
        output::regular("--out", out)?;
        drafts.insert(0, begin(&targets[0])?);
    }
    write(drafts.into_iter().zip(files))?;
    answer(&if args.json { pretty(&worst)? } else { text }, !worst.is_broken())
}

/// The files of a system with the worst hands, its own file last: next to it, as `FILE-NAME.toml`, the world of each station of a network,
/// or as `FILE-motion.csv` the motion of a world. When the last file exists, so do the others.
fn targets(out: &Path, system: &System) -> Vec<PathBuf> {
    let world = |station: &Station| match station.name.as_str() {
        "" => sibling(out, "motion.csv"),
        name => sibling(out, &format!("{name}.toml")),
    };
    system.stations.iter().map(world).chain([out.to_path_buf()]).collect()
}

/// A search of at most this many runs, with its progress on standard error.
fn watched<T: Send>(
    most: usize,
    search: impl FnOnce(&Watch<'_>) -> Result<T, hapt_sweep::worst::Error> + Send,
) -> Result<T, Failure> {
    let seen = AtomicUsize::new(0);
    let mut progress = Progress::new("worst", "hands", most as u64, 0);
    let (done, is_done) = channel::<()>();
    thread::scope(|scope| {
        let seen = &seen;
        let search = scope.spawn(move || {
            // Dropped at the end, and on a panic too: the waiting thread below ends at once.
            let _done = done;
            search(&|runs| {
                seen.store(runs, Relaxed);
                ControlFlow::Continue(())
            })
        });
        while is_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            match seen.load(Relaxed) {
                0 => progress.begins("the linear loop's worst hand comes first"),
                runs => progress.reached(runs as u64),
            }
        }
        search.join().unwrap_or_else(|panic| resume_unwind(panic)).map_err(Failure::from)
    })
}

/// The analysed world, with only this scenario: the others may need files next to the world. A motion's own file is next to `out`.
fn with_scenario(world: &World, worst: &WorstOfWorld, out: Option<&Path>) -> World {
    let mut scenario = worst.scenario.clone();
    if let (Drive::Position(Shape::Path { file, .. }), Some(out)) = (&mut scenario.hand.drive, out) {
        *file = sibling(out, "motion.csv").file_name().map_or(file.clone(), |name| name.to_string_lossy().into_owned());
    }
    World { scenarios: vec![scenario], ..world.clone() }
}

/// A file next to `out`.
fn sibling(out: &Path, what: &str) -> PathBuf {
    let mut name = out.file_stem().unwrap_or_default().to_os_string();
    name.push(format!("-{what}"));
    out.with_file_name(name)
}

fn text(title: &str, worst: &WorstOfWorld, out: Option<&Path>, world: &World) -> String {
    let mut text = format!("{title}\n\n");
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<9} {words}");
    };
    line("verdict", verdict(worst));
    line("linear", linear(world, worst));
    line("gap", gap(world, &worst.gap));
    line("hand", worst.motion.as_ref().map_or_else(|| hand(world, &worst.hand), |found| motion(world, found)));
    line("run", shown_run(worst));
    for note in notes(world, worst) {
        line("note", note);
    }
    match out {
        Some(path) => {
            let _ = writeln!(text, "\nhapt sim {} shows it{}", path.display(), ends_at(worst));
        }
        None if worst.motion.is_some() => {
            let _ = writeln!(
                text,
                "\n--out FILE.toml writes the world with this motion, and its points beside it, for `hapt sim`"
            );
        }
        None => {
            let _ = write!(text, "\n{}", pasted(world));
        }
    }
    text
}

/// How to see a draw that is largest before the run's end: a summary has only the end.
fn ends_at(worst: &WorstOfWorld) -> String {
    let at = worst.drawn.at_s;
    if !worst.drew || at >= worst.scenario.duration * (1.0 - 1e-6) {
        return String::new();
    }
    let set = format!("--set scenarios.{}.duration={}", worst.scenario.name, format::time(at).replace(' ', ""));
    format!("; the draw is largest at {}, where {set} ends the run", format::time(at))
}

fn verdict(worst: &WorstOfWorld) -> String {
    let tried = format::count(worst.runs as u64);
    let hand = if worst.motion.is_some() { "a motion of the hand" } else { "a passive hand" };
    let none = format!("none of {tried} passive hands draws energy");
    match (worst.broken, worst.drew, worst.status) {
        (true, true, Status::Certified) => {
            format!("broken, though certified: what `hapt check` calls not proved lets {hand} draw energy")
        }
        (true, true, Status::Open) => {
            format!("broken, where no theorem covers the world: {hand} draws energy from it")
        }
        (true, true, Status::Refuted) => format!("broken: {hand} draws energy from it"),
        (true, false, _) => {
            "broken: a passive hand makes it grow, too slowly for its energy to be seen in this run, or \
             from a larger motion than this"
                .into()
        }
        (false, _, Status::Certified) if worst.linear.is_some() => {
            format!("survived, as certified by the device's friction up to safety.overspeed: {none}")
        }
        (false, _, Status::Certified) => format!("survived, as certified: {none}"),
        (false, _, Status::Open) => format!("survived, though no theorem covers it (open): {none}"),
        (false, _, Status::Refuted) => format!("survived, though refuted: {none}"),
    }
}

fn linear(world: &World, worst: &WorstOfWorld) -> String {
    match &worst.linear {
        None => "no hand that was tried makes the linear loop grow".into(),
        Some(found) => {
            let growth = found.growth_per_s;
            format!(
                "with a hand of {} the loop grows by {} per second, doubling every {}",
                grip(world, &found.grip),
                format::number(growth),
                format::time(std::f64::consts::LN_2 / growth)
            )
        }
    }
}

fn gap(world: &World, gap: &Gap) -> String {
    let unit = unit(world, Measure::Damping);
    let asks = match gap.required_damping {
        Some(damping) => format!("the certificate requires a device damping of {} {unit}", format::number(damping)),
        None => "no device damping is enough for the certificate".into(),
    };
    let breaks = match gap.breaking_damping {
        Some(_) if gap.required_damping.is_none() => {
            "the worst hand breaks the linear loop at each that was tried".into()
        }
        Some(damping) => format!("the worst hand breaks the linear loop up to {} {unit}", format::number(damping)),
        None => "no hand breaks the linear loop at any".into(),
    };
    format!("{asks}; {breaks}; the device has {} {unit}", format::number(gap.device_damping))
}

pub fn unit(world: &World, measure: Measure) -> String {
    measure.dimension(world.motion).symbol()
}

pub fn grip(world: &World, grip: &Grip) -> String {
    let parts =
        [(grip.inertia, Measure::Inertia), (grip.damping, Measure::Damping), (grip.stiffness, Measure::Stiffness)];
    let parts: Vec<String> = parts
        .into_iter()
        .filter(|(value, _)| *value > 0.0)
        .map(|(value, measure)| format!("{} {}", format::number(value), unit(world, measure)))
        .collect();
    if parts.is_empty() { "nothing at all".into() } else { parts.join(" and ") }
}

fn hand(world: &World, hand: &Hand) -> String {
    let drawn = format!(
        "{}, its spring drawn to {} at first",
        grip(world, &hand.grip),
        match world.motion {
            hapt_model::Motion::Rotary => format!("{} deg", format::number(hand.to.to_degrees())),
            hapt_model::Motion::Linear => format!("{} mm", format::number(1e3 * hand.to)),
        }
    );
    match hand.hold_and_open {
        None => drawn,
        Some((hold, open)) => {
            format!("{drawn}; it holds for {}, opens for {}, and so on", format::time(hold), format::time(open))
        }
    }
}

fn motion(world: &World, motion: &HandMotion) -> String {
    let does = match motion.trick {
        Exploit::Work => "it is the one for which the motor's work on the linear loop is largest, repeated",
        Exploit::Dither => "it dithers along with the error that counts and levels make in the torque",
        Exploit::Pump => {
            "it dithers across a count in step with a body's swing, and gives way when the swing is at its end"
        }
        Exploit::Reverse => {
            "it turns round within each sample, so that the exact velocity of the instant is not that of the way"
        }
        Exploit::Follow => "it moves with the constant torque at a steady pace",
    };
    let reach = match world.motion {
        hapt_model::Motion::Rotary => format!("{} deg", format::number(motion.reach().to_degrees())),
        hapt_model::Motion::Linear => format!("{} mm", format::number(1e3 * motion.reach())),
    };
    format!("a motion of up to {reach}, of {} points: {does}", format::count(motion.points.len() as u64))
}

fn shown_run(worst: &WorstOfWorld) -> String {
    let drawn = &worst.drawn;
    let within = format::time(worst.scenario.duration);
    let given = match drawn.supplied {
        supplied if supplied > 0.0 => format!("the {} that the world had to give", format::energy(supplied)),
        _ => "all that it gave".into(),
    };
    if worst.drew {
        format!(
            "in {within} the hand draws {} more than {given}, at {}",
            format::energy(drawn.gain),
            format::time(drawn.at_s)
        )
    } else {
        format!("in {within} the hand draws no more than {given}")
    }
}

/// The assumptions of the numbers.
fn notes(world: &World, worst: &WorstOfWorld) -> Vec<String> {
    let mut notes = Vec::new();
    if worst.motion.as_ref().is_none_or(|motion| motion.trick != Exploit::Follow)
        && world.couplings.iter().any(|c| c.law.constant().is_some_and(|torque| torque != 0.0))
    {
        notes.push(
            "a constant torque at the puck gives energy without bound; its work counts as what the world had to give"
                .into(),
        );
    }
    if worst.motion.is_some() {
        notes.push(
            "a motion is as good as a grip here: a loop that gives energy to a motion without end is not passive"
                .into(),
        );
    }
    if worst.linear.is_some() && !worst.broken {
        notes.push(
            "the linear loop leaves out the device's friction, counts and levels, and takes bends by their slopes"
                .into(),
        );
    }
    notes
}

/// The scenario's lines of the file.
pub fn pasted(shown: &World) -> String {
    let file = shown.to_toml();
    file.find("[scenarios.").map_or(String::new(), |at| file[at..].to_string())
}
