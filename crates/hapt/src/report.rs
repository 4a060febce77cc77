//! `hapt report`: a page a world, its figures as files, an index of several, and pages on which the worlds run.

use std::collections::HashSet;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use hapt_analysis::{Proposal, SystemCheck, check_system};
use hapt_live::standalone::{self, Page, PageInput, Place, ReportPlots};
use hapt_model::{Parameter, Station, System};
use hapt_report::{Drawing, PlotScript, Report, Run, index_drawings, index_page};

use crate::args::ReportArgs;
use crate::failure::Failure;
use crate::messages;
use crate::output::{self, Draft};
use crate::sim::rows;
use crate::world::{read_system, source};

/// A system, ready to be run.
struct Ready {
    title: String,
    stem: String,
    system: System,
    /// Of the world of each station.
    parameters: Vec<Vec<Parameter>>,
    check: SystemCheck,
    proposal: Option<Proposal>,
    lines: Vec<String>,
    /// Its name on the command line, with its overrides.
    command: String,
    /// For the page on which it runs, or why it has none.
    live: Result<Page, String>,
}

/// The folder of the pages on which the worlds run.
const LIVE: &str = "live";

pub fn run(args: &ReportArgs) -> Result<ExitCode, Failure> {
    // All errors of worlds come before the first file is written.
    let all = read(args)?;
    let several = all.len() > 1;
    output::folder("--out", &args.out)?;
    let mut reports = Vec::new();
    let mut first_failure = None;
    for ready in &all {
        let report = report(ready)?;
        write_live(&args.out, ready)?;
        let drawings = report.drawings();
        write_page(&args.out, &report.stem, &report.page(&drawings, several), &drawings)?;
        let mut failed = report.runs.iter().filter_map(|run| Some((&run.name, run.failure.as_ref()?)));
        first_failure = first_failure.or(failed.next().map(|run| early(&report.title, run)));
        reports.push(report);
    }
    if several {
        let drawings = index_drawings(&reports);
        let page = args.out.join("index.html");
        write(&page, index_page(&reports, &drawings).as_bytes())?;
        write_figures(&args.out, "index", &drawings)?;
        messages::say(format_args!("wrote {}", page.display()));
    }
    first_failure.map_or(Ok(ExitCode::SUCCESS), Err)
}

/// The failure of a run that has ended early.
fn early(title: &str, (name, failure): (&String, &String)) -> Failure {
    Failure::System(format!("{title}, scenario {name}: {failure}; its figures end before"))
}

/// Writes a page, and its figures next to it.
fn write_page(folder: &Path, stem: &str, page: &str, drawings: &[Drawing]) -> Result<(), Failure> {
    let path = folder.join(format!("{stem}.html"));
    write(&path, page.as_bytes())?;
    write_figures(folder, stem, drawings)?;
    messages::say(format_args!("wrote {} and {} figures beside it", path.display(), drawings.len()));
    Ok(())
}

/// Reads and checks every world and network, and sees that each of its scenarios can start.
fn read(args: &ReportArgs) -> Result<Vec<Ready>, Failure> {
    if args.worlds.iter().filter(|path| path.as_os_str() == "-").count() > 1 {
        return Err(Failure::input("standard input, -, can be read only once"));
    }
    let mut taken = HashSet::new();
    if args.worlds.len() > 1 {
        taken.insert("index".to_string());
    }
    let mut all = Vec::new();
    for path in &args.worlds {
        let source = source(path)?;
        let system = read_system(&source, &args.sets)?;
        let of = |station: &Station| hapt_model::parameters(&station.source, &station.sets);
        let parameters = system.stations.iter().map(of).collect::<Result<_, _>>()?;
        let check = check_system(&system, true)?;
        system.stations.iter().try_for_each(|station| hapt_sim::check(&station.world))?;
        let stations = system.stations.iter().map(|station| station.name.as_str()).filter(|name| !name.is_empty());
        let names: Vec<&str> = system.scenarios().into_iter().chain(stations).collect();
        let stem = stem(path, &names, &mut taken);
        let title = system.title.as_deref().filter(|title| !title.trim().is_empty()).unwrap_or(&stem).to_string();
        let live = Page::new(&source, args.sets.clone(), &system, &check);
        let proposal = check.proposal(&system)?;
        let lines = proposal.as_ref().map_or(Vec::new(), Proposal::lines);
        let command = command(path, &args.sets);
        all.push(Ready { title, stem, system, parameters, check, proposal, lines, command, live });
    }
    Ok(all)
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
    // Some file systems do not distinguish upper and lower case.
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

/// Runs every scenario of a system. One that stops being finite is shown up to there.
fn report(ready: &Ready) -> Result<Report<'_>, Failure> {
    let Ready { title, stem, system, parameters, check, proposal, lines, live, .. } = ready;
    let proposal = proposal.as_ref().map(|proposal| (proposal.heading, lines.as_slice()));
    let live = live.is_ok().then(|| format!("{LIVE}/{stem}.html"));
    let mut runs = Vec::new();
    for name in system.scenarios() {
        let played = hapt_analysis::played(system, name)?;
        let mut simulation = hapt_sim::Run::new(&played, name)?;
        let mut run = Run::new(system, name, &simulation, check);
        let end = rows(&mut simulation, name, |row| {
            run.add(row);
            Ok::<(), Failure>(())
        })?;
        run.failure = end.err().map(|error| error.to_string());
        run.releases = simulation.releases().collect();
        runs.push(run);
    }
    let plots = plots();
    Ok(Report { title: title.clone(), stem: stem.clone(), system, parameters, check, proposal, runs, live, plots })
}

/// The script for the figures of a page.
fn plots() -> Option<PlotScript<'static>> {
    standalone::report_plots().map(|ReportPlots { script, sum, style }| PlotScript { script, sum, style })
}

/// Writes the page on which a system runs, and the shared files of all pages.
fn write_live(folder: &Path, ready: &Ready) -> Result<(), Failure> {
    let Ready { title, stem, proposal, command, live, .. } = ready;
    let page = match live {
        Ok(page) => page,
        Err(why) => {
            messages::say(format_args!("{title} has no page to grab it on: {why}"));
            return Ok(());
        }
    };
    let report = format!("../{stem}.html");
    let place = Place::Report { command, report: &report };
    let input = PageInput { page, title, proposal: proposal.as_ref(), place };
    let folder = folder.join(LIVE);
    output::folder("--out", &folder.join("assets"))?;
    for (name, bytes) in standalone::shared().into_iter().chain(standalone::files(stem, &input)) {
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
