//! The end of a command that fails: a message, and the contract's exit code.

use std::fmt::Display;
use std::io;
use std::process::ExitCode;

/// The reason that the command stops.
#[derive(Debug)]
pub enum Failure {
    /// Bad usage or bad input: exit code 2.
    Input(String),
    /// The system failed: exit code 3.
    System(String),
    /// The reader of standard output has closed it: exit code 0, without a message.
    Closed,
}

impl Failure {
    pub fn input(message: impl Display) -> Self {
        Failure::Input(message.to_string())
    }

    /// A failed write to standard output.
    pub fn stdout(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure::Closed
        } else {
            Failure::System(format!("cannot write to standard output: {error}"))
        }
    }

    /// Prints the message; the exit code.
    pub fn report(self) -> ExitCode {
        let (message, code) = match self {
            Failure::Input(message) => (message, 2),
            Failure::System(message) => (message, 3),
            Failure::Closed => return ExitCode::SUCCESS,
        };
        eprintln!("hapt-grade: {message}");
        ExitCode::from(code)
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

impl From<hapt_sim::Error> for Failure {
    fn from(error: hapt_sim::Error) -> Self {
        if matches!(error, hapt_sim::Error::NotFinite { .. }) {
            Failure::System(error.to_string())
        } else {
            Failure::input(error)
        }
    }
}
