//! Reference results of the examples in `fmi/reference`, in the files of FMI's cross-check: NAME_in.csv, NAME_ref.csv, NAME_ref.opt.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use hapt_model::{Drive, Motion, Scenario, Shape, Source, World};
use hapt_sim::{CsvWriter, SIGNALS, Simulation};

/// The examples, each a world with one scenario: a hand that pushes, and releases.
const FOLDER: &str = "fmi/reference";
/// The time between two rows of a reference, in s.
const INTERVAL: f64 = 0.02;

/// Writes the files of every example.
pub fn write() -> Result<()> {
    each(|file, text| {
        fs::write(file, text)?;
        println!("wrote {}", file.display());
        Ok(())
    })
}

/// Whether the files are those of this version.
pub fn is_current() -> Result<()> {
    each(|file, text| {
        ensure!(fs::read_to_string(file)? == text, "not current: cargo xtask fmi --write");
        Ok(())
    })
}

/// Calls `does` for every file with its text.
fn each(does: impl Fn(&Path, &str) -> Result<()>) -> Result<()> {
    for world in crate::programs::worlds(Path::new(FOLDER))? {
        let name = world.file_stem().context("a name")?.to_string_lossy().into_owned();
        for (ending, text) in files(&world)? {
            let file = world.with_file_name(format!("{name}{ending}"));
            does(&file, &text).with_context(|| file.display().to_string())?;
        }
    }
    Ok(())
}

/// Endings and texts.
fn files(path: &Path) -> Result<[(&'static str, String); 3]> {
    let world = World::read(&Source::open(path)?, &[])?;
    let scenario = world.scenarios.first().context("a scenario")?;
    let (stop, period) = (scenario.duration, world.sampling.period);
    let options =
        format!("StartTime, 0\nStopTime, {stop}\nStepSize, {period}\nRelTol, 1e-12\nOutputInterval, {INTERVAL}\n");
    Ok([("_in.csv", input(&world, scenario)?), ("_ref.csv", output(&world, scenario)?), ("_ref.opt", options)])
}

/// The hand's torque over time, straight between the points.
fn input(world: &World, scenario: &Scenario) -> Result<String> {
    let name = if world.motion == Motion::Linear { "hand_force_N" } else { "hand_torque_Nm" };
    let (Drive::Torque(Shape::Step { to, at: 0.0 }), Some(release)) = (&scenario.hand.drive, scenario.hand.release)
    else {
        bail!("{}: a hand that pushes from the start and lets go", scenario.name);
    };
    Ok(format!("time,{name}\n0,{to}\n{release},{to}\n{release},0\n{},0\n", scenario.duration))
}

/// The columns of the run, at every [`INTERVAL`].
fn output(world: &World, scenario: &Scenario) -> Result<String> {
    let every = (INTERVAL / world.sampling.period).round() as u64;
    let mut names: Vec<String> = hapt_sim::columns(world).into_iter().map(|column| column.name).collect();
    names[0] = "time".into();
    let mut csv = CsvWriter::with_columns(Vec::new(), &names)?;
    let mut run = Simulation::new(world, scenario)?;
    let mut k = 0;
    while let Some(row) = run.next() {
        let row = row?;
        if k % every == 0 {
            let own = SIGNALS.iter().map(|signal| (signal.get)(row));
            let pairs = row.pairs().flat_map(|(position, velocity)| [position, velocity]);
            csv.write_numbers(&own.chain(pairs).collect::<Vec<f64>>())?;
        }
        k += 1;
    }
    Ok(String::from_utf8(csv.finish()?)?)
}
