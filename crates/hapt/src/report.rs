//! `hapt report`: a page a world, its figures as files, an index of several, and beside them pages on which the worlds run.

use std::collections::HashSet;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use hapt_analysis::{Check, NetworkCheck, Proposal};
use hapt_live::standalone::{self, File, PageInput, PageNetwork, PageWorld};
use hapt_model::{Parameter, Source, System, World, is_network};
use hapt_report::{Drawing, NetworkReport, NetworkScenario, Report, Run, index_drawings, index_page};
use hapt_sim::Simulation;

use crate::args::ReportArgs;
use crate::failure::Failure;
use crate::messages;
use crate::network;
use crate::output::{self, Draft};
use crate::sim::rows;
use crate::world::{Loaded, source};

/// A world, ready to be run.
struct Ready {
    title: String,
    stem: String,
    world: World,
    parameters: Vec<Parameter>,
    check: Check,
    proposal: Option<Proposal>,
    lines: Vec<String>,
    /// Its name on the command line, with its overrides.
    command: String,
    /// For the page on which it runs, or why it has none.
    live: Result<PageWorld, String>,
}

/// A network, ready to be run.
struct ReadyNetwork {
    title: String,
    stem: String,
    network: System,
    /// Of the world of each station.
    parameters: Vec<Vec<Parameter>>,
    check: NetworkCheck,
    /// Its name on the command line, with its overrides.
    command: String,
    /// For the page with its wheels, or why it has none.
    live: Result<PageNetwork, String>,
}

/// Where the pages are on which the worlds run.
const LIVE: &str = "live";

pub fn run(args: &ReportArgs) -> Result<ExitCode, Failure> {
    // All errors of worlds come before the first file is written.
    let (worlds, networks) = read(args)?;
    let several = worlds.len() + networks.len() > 1;
    output::folder("--out", &args.out)?;
    let (mut reports, mut of_networks) = (Vec::new(), Vec::new());
    let mut first_failure = None;
    for ready in &worlds {
        let report = report(ready)?;
        let Ready { title, stem, check, proposal, command, .. } = ready;
        write_live(&args.out, title, &ready.live, |world| {
            let proposal = proposal.as_ref();
            standalone::world(stem, &PageInput { world, check, proposal, command, report: &back(stem) })
        })?;
        let drawings = report.drawings();
        write_page(&args.out, &report.stem, &report.page(&drawings, several), &drawings)?;
        let mut failed = report.runs.iter().filter_map(|run| Some((&run.name, run.failure.as_ref()?)));
        first_failure = first_failure.or(failed.next().map(|run| early(&report.title, run)));
        reports.push(report);
    }
    for ready in &networks {
        let report = report_network(ready)?;
        let ReadyNetwork { title, stem, command, .. } = ready;
        write_live(&args.out, title, &ready.live, |network| {
            standalone::network(stem, network, title, command, &back(stem))
        })?;
        let drawings = report.drawings();
        write_page(&args.out, &report.stem, &report.page(&drawings, several), &drawings)?;
        let mut failed = report.runs.iter().filter_map(|run| Some((&run.name, run.failure.as_ref()?)));
        first_failure = first_failure.or(failed.next().map(|run| early(&report.title, run)));
        of_networks.push(report);
    }
    if several {
        let drawings = index_drawings(&reports);
        let page = args.out.join("index.html");
        write(&page, index_page(&reports, &of_networks, &drawings).as_bytes())?;
        write_figures(&args.out, "index", &drawings)?;
        messages::say(format_args!("wrote {}", page.display()));
    }
    first_failure.map_or(Ok(ExitCode::SUCCESS), Err)
}

/// The failure of a run that has ended early.
fn early(title: &str, (name, failure): (&String, &String)) -> Failure {
    Failure::System(format!("{title}, scenario {name}: {failure}; its figures end before"))
}

/// Writes a page, and its figures beside it.
fn write_page(folder: &Path, stem: &str, page: &str, drawings: &[Drawing]) -> Result<(), Failure> {
    let path = folder.join(format!("{stem}.html"));
    write(&path, page.as_bytes())?;
    write_figures(folder, stem, drawings)?;
    messages::say(format_args!("wrote {} and {} figures beside it", path.display(), drawings.len()));
    Ok(())
}

/// Reads and checks every world and network, and sees that each of its scenarios can start.
fn read(args: &ReportArgs) -> Result<(Vec<Ready>, Vec<ReadyNetwork>), Failure> {
    if args.worlds.iter().filter(|path| path.as_os_str() == "-").count() > 1 {
        return Err(Failure::input("standard input, -, can be read only once"));
    }
    let mut taken = HashSet::new();
    if args.worlds.len() > 1 {
        taken.insert("index".to_string());
    }
    let (mut worlds, mut networks) = (Vec::new(), Vec::new());
    for path in &args.worlds {
        let source = source(path)?;
        if is_network(&source) {
            networks.push(ReadyNetwork::of(path, &source, &args.sets, &mut taken)?);
            continue;
        }
        let world = World::read(&source, &args.sets)?;
        let parameters = hapt_model::parameters(&source, &args.sets)?;
        let check = hapt_analysis::check(&world)?;
        hapt_sim::check(&world)?;
        let scenarios: Vec<&str> = world.scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
        let stem = stem(path, &scenarios, &mut taken);
        let title = titled(world.title.as_deref(), &stem);
        let live = PageWorld::new(&source, args.sets.clone());
        let loaded = Loaded { name: source.name.clone(), world, source };
        let remedies = hapt_analysis::remedies(&loaded.world)?;
        let proposal = hapt_analysis::proposal(&loaded.world, &loaded.source, &args.sets, &check, &remedies)?;
        let lines = proposal.as_ref().map_or(Vec::new(), Proposal::lines);
        let command = command(path, &args.sets);
        worlds.push(Ready { title, stem, world: loaded.world, parameters, check, proposal, lines, command, live });
    }
    Ok((worlds, networks))
}

/// The title of a file, or else its stem.
fn titled(title: Option<&str>, stem: &str) -> String {
    title.filter(|title| !title.trim().is_empty()).unwrap_or(stem).to_string()
}

impl ReadyNetwork {
    fn of(path: &Path, source: &Source, sets: &[String], taken: &mut HashSet<String>) -> Result<Self, Failure> {
        let network = System::read(source, sets)?;
        for station in &network.stations {
            hapt_sim::check(&station.world)?;
        }
        let check = hapt_analysis::check_network(&network)?;
        let parameters = network.stations.iter().map(|station| hapt_model::parameters(&station.source, &station.sets));
        let parameters = parameters.collect::<Result<_, _>>()?;
        let stations = network.stations.iter().map(|station| station.name.as_str());
        let names: Vec<&str> = network.scenarios().into_iter().chain(stations).collect();
        let stem = stem(path, &names, taken);
        let title = titled(network.title.as_deref(), &stem);
        let live = PageNetwork::new(source, sets.to_vec(), &network, &check);
        Ok(ReadyNetwork { title, stem, network, parameters, check, command: command(path, sets), live })
    }
}

/// Runs every scenario of a network. One that stops being finite is shown up to there.
fn report_network(ready: &ReadyNetwork) -> Result<NetworkReport<'_>, Failure> {
    let ReadyNetwork { title, stem, network, parameters, check, .. } = ready;
    let mut runs = Vec::new();
    for name in network.scenarios() {
        let mut simulation = hapt_sim::Run::new(network, name)?;
        let mut run = NetworkScenario::new(network, name);
        let end = network::rows(&mut simulation, name, |row| {
            run.add(row);
            Ok(())
        })?;
        run.failure = end.err().map(|error| error.to_string());
        run.let_go = simulation.let_go().collect();
        runs.push(run);
    }
    let live = live_page(&ready.live, stem);
    Ok(NetworkReport { title: title.clone(), stem: stem.clone(), network, parameters, check, runs, live })
}

/// The file's name without folder and ending, as it can stand in a link, with a number where another world's files would have
/// the same names; "world" for standard input.
fn stem(path: &Path, figures: &[&str], taken: &mut HashSet<String>) -> String {
    let name = match path.file_stem() {
        Some(stem) if path.as_os_str() != "-" => stem.to_string_lossy().into_owned(),
        _ => "world".into(),
    };
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' };
    let name: String = name.trim_start_matches(['.', '@']).chars().map(safe).collect();
    let name = if name.is_empty() { "world".to_string() } else { name };
    // Some file systems do not tell capitals from small letters.
    let files = |name: &str| -> Vec<String> {
        let figures = figures.iter().map(|figure| format!("{name}-{figure}"));
        figures.chain([name.to_string()]).map(|file| file.to_lowercase()).collect()
    };
    let mut candidates = std::iter::once(name.clone()).chain((2..).map(|n: u64| format!("{name}-{n}")));
    let free = candidates.find(|candidate| files(candidate).iter().all(|file| !taken.contains(file)));
    let stem = free.unwrap_or(name);
    taken.extend(files(&stem));
    stem
}

/// Runs every scenario of a world. One that stops being finite is shown up to there.
fn report(ready: &Ready) -> Result<Report<'_>, Failure> {
    let Ready { title, stem, world, parameters, check, proposal, lines, live, .. } = ready;
    let proposal = proposal.as_ref().map(|proposal| (proposal.heading, lines.as_slice()));
    let live = live_page(live, stem);
    let mut runs = Vec::new();
    for scenario in &world.scenarios {
        let played = hapt_analysis::with_worst_pattern(world, scenario)?;
        let simulation = Simulation::new(world, &played)?;
        let mut run = Run::new(world, scenario, &simulation, check);
        let end = rows(simulation, &scenario.name, |row| {
            run.add(row);
            Ok::<(), Failure>(())
        })?;
        run.failure = end.err().map(|error| error.to_string());
        runs.push(run);
    }
    Ok(Report { title: title.clone(), stem: stem.clone(), world, parameters, check, proposal, runs, live })
}

/// Where a page is on which a world runs, from the report.
fn live_page<T>(live: &Result<T, String>, stem: &str) -> Option<String> {
    live.is_ok().then(|| format!("{LIVE}/{stem}.html"))
}

/// Where the report is, from there.
fn back(stem: &str) -> String {
    format!("../{stem}.html")
}

/// Writes the page on which a world or a network runs, and the shared files of all pages.
fn write_live<T>(
    folder: &Path,
    title: &str,
    live: &Result<T, String>,
    files: impl FnOnce(&T) -> [File; 2],
) -> Result<(), Failure> {
    let files = match live {
        Ok(live) => files(live),
        Err(why) => {
            messages::say(format_args!("{title} has no page to grab it on: {why}"));
            return Ok(());
        }
    };
    let folder = folder.join(LIVE);
    output::folder("--out", &folder.join("assets"))?;
    for (name, bytes) in standalone::shared().into_iter().chain(files) {
        write(&folder.join(name), &bytes)?;
    }
    Ok(())
}

/// A world's name on the command line, quoted for a shell.
fn command(path: &Path, sets: &[String]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "@%+=:,./_-".contains(c);
    let quoted = |word: &str| match word.chars().all(plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    };
    let name = if path.as_os_str() == "-" { "world.toml".into() } else { path.to_string_lossy() };
    let sets = sets.iter().map(|set| format!(" --set {}", quoted(set)));
    quoted(&name) + &sets.collect::<String>()
}

fn write_figures(folder: &Path, stem: &str, drawings: &[Drawing]) -> Result<(), Failure> {
    drawings
        .iter()
        .try_for_each(|drawing| write(&folder.join(format!("{stem}-{}.svg", drawing.name)), drawing.file.as_bytes()))
}

fn write(target: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |error| Failure::write(target.display(), error);
    let mut draft = Draft::new(target.to_path_buf()).map_err(failed)?;
    draft.write_all(bytes).map_err(failed)?;
    draft.finish().map_err(failed)?;
    Ok(())
}
