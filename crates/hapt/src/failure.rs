//! The end of a command that fails: a message, and the contract's exit code.

use std::fmt::Display;
use std::io;
use std::path::Path;
use std::process::ExitCode;

use hapt_host::DeviceError;

use crate::messages;
use crate::suggest;

/// Why a command stops.
#[derive(Debug)]
pub enum Failure {
    /// Bad usage or bad input: exit code 2.
    Input(String),
    /// The device or the system failed: exit code 3.
    System(String),
    /// The reader of standard output has closed it: exit code 0, without a message.
    Closed,
}

impl Failure {
    /// The end of a run whose wheel for games was detached by the computer.
    pub fn detached() -> Self {
        Failure::System("the run ended early, with the torque off: the computer has detached the wheel".into())
    }

    pub fn input(message: impl Display) -> Self {
        Failure::Input(message.to_string())
    }

    /// A file that cannot be opened, and the one that was probably meant.
    pub fn unreadable(path: &Path, error: &io::Error) -> Self {
        Failure::input(format!("cannot read {}: {error}{}", path.display(), suggest::file(path)))
    }

    /// A failed write to `what`.
    pub fn write(what: impl Display, error: impl Display) -> Self {
        Failure::System(format!("cannot write {what}: {error}"))
    }

    /// A failed write to standard output.
    pub fn stdout(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure::Closed
        } else {
            Failure::write("to standard output", error)
        }
    }

    /// Its message.
    pub fn message(self) -> String {
        match self {
            Failure::Input(message) | Failure::System(message) => message,
            Failure::Closed => String::new(),
        }
    }

    pub fn report(self) -> ExitCode {
        match self {
            Failure::Input(message) => {
                messages::say(format_args!("hapt: {message}"));
                ExitCode::from(2)
            }
            Failure::System(message) => {
                messages::say(format_args!("hapt: {message}"));
                ExitCode::from(3)
            }
            Failure::Closed => ExitCode::SUCCESS,
        }
    }
}

/// The output of clap instead of arguments: the requested help, or an error.
pub fn usage(usage: &clap::Error) -> ExitCode {
    match usage.print() {
        Err(error) if !usage.use_stderr() => Failure::stdout(error).report(),
        _ if usage.use_stderr() => ExitCode::from(2),
        _ => ExitCode::SUCCESS,
    }
}

impl From<hapt_model::Error> for Failure {
    fn from(error: hapt_model::Error) -> Self {
        Failure::input(error)
    }
}

impl From<hapt_analysis::Error> for Failure {
    fn from(error: hapt_analysis::Error) -> Self {
        Failure::input(error)
    }
}

impl From<hapt_sweep::Error> for Failure {
    fn from(error: hapt_sweep::Error) -> Self {
        Failure::input(error)
    }
}

impl From<hapt_sweep::worst::Error> for Failure {
    fn from(error: hapt_sweep::worst::Error) -> Self {
        match error {
            hapt_sweep::worst::Error::Linear(error) => error.into(),
            hapt_sweep::worst::Error::Run(error) => error.into(),
            error @ hapt_sweep::worst::Error::Interrupted => Failure::System(error.to_string()),
        }
    }
}

impl From<DeviceError> for Failure {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::Check(error) => error.into(),
            DeviceError::Board(error) => error.into(),
            #[cfg(target_os = "linux")]
            DeviceError::Drive { .. } => Failure::System(format!("--device {error}")),
            DeviceError::Unreadable { path, error } => Failure::unreadable(&path, &error),
            DeviceError::NotCertified { .. } => {
                Failure::input(format!("{error}. --uncertified runs it regardless, with tighter limits"))
            }
            DeviceError::Address(_)
            | DeviceError::Unsupported { .. }
            | DeviceError::Missing { .. }
            | DeviceError::World(_)
            | DeviceError::Line { .. }
            | DeviceError::Recording { .. }
            | DeviceError::Log { .. }
            | DeviceError::NotLocal { .. }
            | DeviceError::ExternallyClocked { .. } => Failure::input(error),
        }
    }
}

impl From<hapt_host::board::Error> for Failure {
    fn from(error: hapt_host::board::Error) -> Self {
        let is_input = matches!(&error, hapt_host::board::Error::Refused { why, .. } if why.is_about_the_world());
        if is_input { Failure::input(error) } else { Failure::System(error.to_string()) }
    }
}

impl From<hapt_sim::Error> for Failure {
    fn from(error: hapt_sim::Error) -> Self {
        match error {
            hapt_sim::Error::Loop(error) => Failure::input(error),
            error @ (hapt_sim::Error::Timing { .. }
            | hapt_sim::Error::Clock { .. }
            | hapt_sim::Error::Device { .. }
            | hapt_sim::Error::Hand { .. }) => Failure::input(error),
            error @ hapt_sim::Error::NotFinite { .. } => Failure::System(error.to_string()),
        }
    }
}
