//! The answer of a command that analyses something: text or JSON, files with it, and the exit code.

use std::io::{Write, stdout};
use std::path::Path;
use std::process::ExitCode;

use crate::colour;
use crate::failure::Failure;
use crate::messages;
use crate::output::Draft;

/// A file that is to be written.
pub fn begin(path: &Path) -> Result<(&Path, Draft), Failure> {
    let draft = Draft::new(path.to_path_buf()).map_err(|error| Failure::write(path.display(), error))?;
    Ok((path, draft))
}

/// Writes each text to its draft, and moves all of them to their places when all are written.
pub fn write<'p>(files: impl Iterator<Item = ((&'p Path, Draft), String)>) -> Result<(), Failure> {
    let mut written = Vec::new();
    for ((path, mut draft), text) in files {
        draft.write_all(text.as_bytes()).map_err(|error| Failure::write(path.display(), error))?;
        written.push((path, draft));
    }
    for (path, draft) in written {
        draft.finish().map_err(|error| Failure::write(path.display(), error))?;
        messages::say(format_args!("wrote {}", path.display()));
    }
    Ok(())
}

/// JSON for people.
pub fn pretty(value: &impl serde::Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(value).map_err(|error| Failure::System(error.to_string()))? + "\n")
}

/// Prints an answer; its exit code.
pub fn answer(text: &str, is_good: bool) -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(colour::for_stdout(text).as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
