//! `hapt log`, and the log that any command works on.

mod convert;
mod replay;

use std::io::{BufReader, Read, stdin};
use std::path::Path;
use std::process::ExitCode;

use hapt_log::{Ending, Error, Header, Log, Recorder};
use hapt_model::World;

use crate::args::LogCommand;
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::output::{self, Draft};

pub fn run(command: &LogCommand) -> Result<ExitCode, Failure> {
    match command {
        LogCommand::Replay(args) => replay::run(args),
        LogCommand::Convert(args) => convert::run(args),
    }
}

/// A log and its name in messages.
pub struct Opened {
    pub name: String,
    pub log: Log<Box<dyn Read>>,
}

/// The log of a loop in real time before its start: until then it is a file next to the target, so that a refused run leaves an older log
/// unchanged.
pub struct Recording {
    recording: hapt_host::Recording,
    draft: Draft,
}

impl Recording {
    /// Starts the log of `--log`, if given.
    pub fn start(file: Option<&Path>, world: &World, header: impl FnOnce() -> Header) -> Result<Option<Self>, Failure> {
        let Some(file) = file else { return Ok(None) };
        output::format("--log", file, &["mcap"])?;
        let failed =
            |error: std::io::Error| Failure::System(format!("--log {}: cannot write it: {error}", file.display()));
        let header = header();
        let started = output::recorded(file, |draft| {
            let recorder = Recorder::start_in(draft.handle()?, file, world, header);
            Ok(recorder.map(|recorder| (recorder, draft)))
        });
        let started = started.map_err(failed)?;
        let (recorder, draft) =
            started.map_err(|error| Failure::System(format!("--log {}: {error}", file.display())))?;
        let recording = hapt_host::Recording::from_the_start(recorder, file.into());
        Ok(Some(Recording { recording, draft }))
    }

    /// Moves the log to its target once the loop has started.
    pub fn begin(self) -> Result<hapt_host::Recording, Failure> {
        self.draft.finish().map_err(|error| Failure::System(format!("--log: cannot write the log: {error}")))?;
        Ok(self.recording)
    }
}

/// Opens a log; `-` is standard input.
pub fn open(path: &Path) -> Result<Opened, Failure> {
    let (name, from) = reader(path)?;
    let log = Log::read(from).map_err(|error| failure(&name, error))?;
    Ok(Opened { name, log })
}

/// A file's name and its bytes.
pub fn reader(path: &Path) -> Result<(String, Box<dyn Read>), Failure> {
    if path.as_os_str() == "-" {
        return Ok(("<stdin>".into(), Box::new(stdin().lock())));
    }
    let name = path.display().to_string();
    let file = hapt_model::input::open(path).map_err(|error| Failure::unreadable(path, &error))?;
    Ok((name, Box::new(BufReader::with_capacity(1 << 16, file))))
}

/// The error of the log of this name.
pub fn failure(name: &str, error: Error) -> Failure {
    Failure::input(if let Error::Unreadable(error) = error {
        format!("cannot read {name}: {error}")
    } else {
        format!("{name}: {error}")
    })
}

impl Opened {
    /// Reports an incomplete end, after the last sample.
    pub fn say_ending(&self, samples: u64, last: f64) {
        if *self.log.ending() != Ending::Whole {
            let (samples, last) = (format::count(samples), format::time(last));
            messages::say(format_args!(
                "{}: {}; {samples} samples up to {last} are there",
                self.name,
                self.log.ending()
            ));
        }
    }
}
