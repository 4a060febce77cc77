//! `hapt export`: a world for the simulators of others.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_fmi::{Kind, LIBRARY, Version, places};

use crate::args::{ExportCommand, FmuArgs};
use crate::failure::Failure;
use crate::world::{files, load};
use crate::{export_c, messages, output};

pub fn run(command: &ExportCommand) -> Result<ExitCode, Failure> {
    match command {
        ExportCommand::Fmu(args) => fmu(args),
        ExportCommand::C(args) => export_c::run(args),
    }
}

fn fmu(args: &FmuArgs) -> Result<ExitCode, Failure> {
    output::format("-o", &args.out, &["fmu"])?;
    let loaded = load(&args.world)?;
    let platforms = args.platforms.iter().map(|path| ("a library of --platform", path.clone()));
    let inputs: Vec<_> = files(&args.world.path, &loaded.world).into_iter().chain(platforms).collect();
    output::apart(&[("-o", &args.out)], &inputs)?;
    let own = own_library(args.platforms.is_empty())?;
    let libraries = own.into_iter().chain(args.platforms.iter().cloned()).map(read).collect::<Result<Vec<_>, _>>()?;
    let written = hapt_model::parameters_of(&loaded.world, &loaded.source, &args.world.sets)?;
    let kind = if args.whole { Kind::Whole } else { Kind::Loop };
    let version = if args.fmi == "3" { Version::Three } else { Version::Two };
    let fmu = hapt_fmi::write(&loaded.world, &written, loaded.title(), kind, version, &libraries);
    let fmu = fmu.map_err(Failure::input)?;
    let draft = output::draft(&args.out, &fmu)?;
    let path = draft.finish().map_err(|error| Failure::write(args.out.display(), error))?;
    messages::say(format_args!("wrote {}, FMI {}, {} bytes", path.display(), version.number(), fmu.len()));
    Ok(ExitCode::SUCCESS)
}

/// The library of this computer; an FMU only for other platforms does not need it.
fn own_library(is_needed: bool) -> Result<Option<PathBuf>, Failure> {
    let program =
        std::env::current_exe().map_err(|error| Failure::System(format!("this program has no path: {error}")))?;
    let places = places(&program);
    let found = places.iter().find(|path| path.is_file());
    if found.is_none() && is_needed {
        let places = places.each_ref().map(|path| path.display().to_string()).join(", ");
        return Err(Failure::input(format!(
            "the library of FMUs is not there: {places}. cargo build --release -p hapt-fmi builds {LIBRARY}; put it beside this \
             program, or name it with --platform"
        )));
    }
    Ok(found.cloned())
}

fn read(path: PathBuf) -> Result<(PathBuf, Vec<u8>), Failure> {
    let path: &Path = &path;
    let failed = |error| Failure::input(format!("cannot read {}: {error}", path.display()));
    let mut bytes = Vec::new();
    hapt_model::input::open(path).and_then(|mut file| file.read_to_end(&mut bytes)).map_err(failed)?;
    Ok((path.to_path_buf(), bytes))
}
