//! `hapt init`: a world file to start from, and the schema that its editor reads.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::ExitCode;

use hapt_model::did_you_mean;

use crate::args::InitArgs;
use crate::failure::Failure;
use crate::messages;
use crate::output::{self, Draft};

const TEMPLATES: [(&str, &str); 8] = [
    ("spring-mass", include_str!("../templates/spring-mass.toml")),
    ("wall", include_str!("../templates/wall.toml")),
    ("detents", include_str!("../templates/detents.toml")),
    ("damper", include_str!("../templates/damper.toml")),
    ("inertia", include_str!("../templates/inertia.toml")),
    ("friction", include_str!("../templates/friction.toml")),
    ("end-stops", include_str!("../templates/end-stops.toml")),
    ("two-wheels", include_str!("../templates/two-wheels.toml")),
];

pub fn run(args: &InitArgs) -> Result<ExitCode, Failure> {
    let name = args.template.as_str();
    let Some((_, world)) = TEMPLATES.iter().find(|(known, _)| *known == name) else {
        let names = TEMPLATES.map(|(known, _)| known);
        let (hint, list) = (did_you_mean(name, names), names.join(", "));
        let list =
            if hint.is_empty() { format!("; the templates are {list}") } else { format!(" The templates are {list}") };
        return Err(Failure::input(format!("no template {name:?}{hint}{list}")));
    };
    let schema = hapt_model::schema();
    // In the current folder messages have the plain names, as they are typed.
    let folder = if args.folder == Path::new(".") { Path::new("") } else { &args.folder };
    let (world_path, schema_path) = (folder.join("world.toml"), folder.join("hapt.schema.json"));
    refuse_existing(&world_path)?;
    // An equal schema stays: a second world in the folder uses it too.
    let schema_is_there = is_there(&schema_path, schema.as_bytes());
    if !schema_is_there {
        refuse_existing(&schema_path)?;
    }
    refuse_file_name(folder)?;
    make(folder)?;

    let world = draft(&world_path, world)?;
    if !schema_is_there {
        finish(draft(&schema_path, &schema)?, &schema_path)?;
    }
    finish(world, &world_path)?;
    let shown = world_path.display();
    messages::say(format_args!("next: hapt sim {shown}, hapt check {shown}, and read its comments"));
    Ok(ExitCode::SUCCESS)
}

/// Whether a file has exactly these bytes; no more of it is read.
fn is_there(path: &Path, bytes: &[u8]) -> bool {
    let mut there = Vec::new();
    let open = fs::metadata(path).is_ok_and(|there| there.is_file()).then(|| fs::File::open(path).ok()).flatten();
    open.is_some_and(|file| file.take(bytes.len() as u64 + 1).read_to_end(&mut there).is_ok() && there == bytes)
}

/// No file of the user is overwritten, nor a link to a missing file.
fn refuse_existing(path: &Path) -> Result<(), Failure> {
    match fs::symlink_metadata(path) {
        Ok(_) => Err(Failure::input(format!("{} is there already; init overwrites nothing", path.display()))),
        Err(_) => Ok(()),
    }
}

/// A name of a world file is no new folder.
fn refuse_file_name(folder: &Path) -> Result<(), Failure> {
    if folder.extension().is_none_or(|extension| extension != "toml") || folder.is_dir() {
        return Ok(());
    }
    let (name, bare) = (folder.display(), folder.with_extension(""));
    Err(Failure::input(format!(
        "{name} is the name of a file; init makes a folder, and world.toml in it: hapt init {}",
        bare.display()
    )))
}

fn make(folder: &Path) -> Result<(), Failure> {
    if let Some(file) = folder.ancestors().find(|at| at.exists() && !at.is_dir()) {
        return Err(Failure::input(format!("{} is a file; init needs a folder", file.display())));
    }
    if folder.as_os_str().is_empty() {
        return Ok(());
    }
    output::make(folder)
}

fn draft(path: &Path, text: &str) -> Result<Draft, Failure> {
    let failed = |error| Failure::write(path.display(), error);
    let mut draft = Draft::new(path.to_path_buf()).map_err(failed)?;
    draft.write_all(text.as_bytes()).map_err(failed)?;
    Ok(draft)
}

fn finish(draft: Draft, path: &Path) -> Result<(), Failure> {
    draft.finish().map_err(|error| Failure::write(path.display(), error))?;
    messages::say(format_args!("wrote {}", path.display()));
    Ok(())
}
