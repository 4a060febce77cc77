//! The world that a command works on.

use std::path::{Path, PathBuf};

use hapt_model::{Drive, Shape, Source, System, Timing, World};

use crate::args::WorldArgs;
use crate::failure::Failure;
use crate::messages;
use crate::suggest;
use hapt_model::builtin;

/// A world and its name in messages.
pub struct Loaded {
    pub name: String,
    pub world: World,
    pub source: Source,
}

/// Reads the world file with its overrides.
pub fn load(args: &WorldArgs) -> Result<Loaded, Failure> {
    Loaded::of(source(&args.path)?, args)
}

/// The source of WORLD: a file, standard input for `-`, a built-in world for `@NAME`.
pub fn source(path: &Path) -> Result<Source, Failure> {
    match path.to_str() {
        Some("-") => Ok(Source::stdin()?),
        Some(name) if name.starts_with('@') => Ok(builtin::source(name)?),
        _ => Source::open(path).map_err(|error| Failure::input(format!("{error}{}", suggest::file(path)))),
    }
}

/// The sources of WORLD where several are taken: all worlds of a folder, by name, those of a built-in group, as `@knob`, or one ([`source`]).
pub fn sources(path: &Path) -> Result<Vec<Source>, Failure> {
    if let Some(name) = path.to_str().filter(|name| name.starts_with('@')) {
        let group: Vec<String> = builtin::group(name).collect();
        if !group.is_empty() {
            return group.iter().map(|name| Ok(builtin::source(name)?)).collect();
        }
    }
    if !path.is_dir() {
        return Ok(vec![source(path)?]);
    }
    let failed = |error: std::io::Error| Failure::input(format!("{}: {error}", path.display()));
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        files.push(entry.map_err(failed)?.path());
    }
    files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    if files.is_empty() {
        return Err(Failure::input(format!("{}: a folder without a world file (*.toml)", path.display())));
    }
    files.iter().map(|file| source(file)).collect()
}

/// The files that a world at `path` is read from, which no output may replace: its own, and the paths of its hands.
pub fn files(path: &Path, world: &World) -> Vec<(&'static str, PathBuf)> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let paths = world.scenarios.iter().filter_map(|scenario| match &scenario.hand.drive {
        Drive::Position(Shape::Path { file, .. }) => Some(("the path of a hand", folder.join(file))),
        Drive::Position(Shape::Step { .. } | Shape::Ramp { .. } | Shape::Sine { .. })
        | Drive::Torque(_)
        | Drive::Grip { .. } => None,
    });
    let timings = world.scenarios.iter().filter_map(|scenario| match &scenario.timing {
        Timing::Recorded { file, .. } => Some(("the recording of a timing", folder.join(file))),
        Timing::Even | Timing::Random { .. } | Timing::Pattern { .. } | Timing::Worst => None,
    });
    [("the world", path.to_path_buf())].into_iter().chain(paths).chain(timings).collect()
}

/// The same of a network: its own file, those of its stations, and theirs.
pub fn inputs(path: &Path, system: &System) -> Vec<(&'static str, PathBuf)> {
    if let Some(world) = system.world() {
        return files(path, world);
    }
    let home = path.parent().unwrap_or(Path::new(""));
    let of_stations = system.stations.iter().flat_map(|station| files(&home.join(&station.file), &station.world));
    [("the network", path.to_path_buf())].into_iter().chain(of_stations).collect()
}

/// Reads a world and prints the warnings about it.
pub fn read_world(source: &Source, sets: &[String]) -> Result<World, Failure> {
    let world = World::read(source, sets)?;
    warn(world.warnings(source, sets));
    Ok(world)
}

/// The same of a world or a network.
pub fn read_system(source: &Source, sets: &[String]) -> Result<System, Failure> {
    let system = System::read(source, sets)?;
    warn(system.warnings(source, sets));
    Ok(system)
}

fn warn(warnings: Vec<String>) {
    for warning in warnings {
        messages::say(format_args!("warning: {warning}"));
    }
}

impl Loaded {
    /// The world of a source that has been read.
    pub fn of(source: Source, args: &WorldArgs) -> Result<Loaded, Failure> {
        let world = read_world(&source, &args.sets)?;
        Ok(Loaded { name: source.name.clone(), world, source })
    }

    /// Its title, or else its file's name.
    pub fn title(&self) -> &str {
        self.world.title.as_deref().unwrap_or(&self.name)
    }
}
