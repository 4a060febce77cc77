//! What every drive can do, and what can be wrong with one.

use std::io;
use std::time::Instant;

pub use hapt_rt::DriveFault;

/// Frames that are looked at before a sample's question, and after it: a bus full of others' does not hold the loop.
pub(crate) const OTHERS: usize = 256;

/// A motor drive, whatever its protocol. Angles are revolutions and torques N·m, both at the drive's own shaft.
///
/// [`Drive::read`] and [`Drive::command`] are called on the loop's thread, one after the other in every sample: they allocate nothing,
/// and wait until the instant that they are given, no longer.
pub trait Drive: Send {
    /// Stops it, clears what it has latched, looks whether it is well, and gives it the terms that it will be held to. It stands ready
    /// afterwards, without torque, and waits for a second at least for its first command. May take some seconds.
    ///
    /// # Errors
    /// It does not answer, or has a fault that does not clear.
    fn start(&mut self, terms: &Terms) -> Result<Answer, Error>;

    /// Asks it where it is. An answer to an earlier question is none to this one.
    ///
    /// # Errors
    /// See [`Trouble`].
    fn read(&mut self, until: Instant) -> Result<Answer, Trouble>;

    /// The torque to hold from now on. It feeds the drive's watchdog; where questions do so too, the drive is asked which torque it uses.
    /// A drive that was stopped is not switched on by it, or is stopped again at once.
    ///
    /// # Errors
    /// See [`Trouble`].
    fn command(&mut self, torque: f64, until: Instant) -> Result<(), Trouble>;

    /// No torque, and stopped: said once, and no answer is waited for. Whatever has failed says so in every sample, and is switched on
    /// again by nothing but a start.
    fn halt(&mut self, until: Instant);

    /// No torque, and stopped, as far as anybody is there to hear it. Called on every way out, more than once too.
    fn stop(&mut self);

    /// From one sample of the loop to the next, in s, from now on.
    fn paced(&mut self, _period: f64) {}

    /// What whoever starts it has to know: what it cannot be told, and who has to set it.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// What a drive is held to from the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms {
    /// Without a command for so long, in s, the drive takes the torque away by itself and starts again for nobody but an explicit stop.
    pub watchdog: f64,
    /// The largest torque at its shaft, in N·m; infinite where the world knows none.
    pub torque: f64,
}

/// What a drive says about its shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// In revolutions, over as many turns as there were.
    pub position: f64,
    /// In revolutions per second.
    pub velocity: f64,
}

/// What is wrong at one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Nothing has come until the instant that was given.
    Silent,
    /// Something has come, but no answer to this question in time.
    Late,
    /// It has stopped by itself, and says why.
    Fault(DriveFault),
    /// The port or bus is gone.
    Gone,
}

impl From<io::Error> for Trouble {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::TimedOut { Trouble::Late } else { Trouble::Gone }
    }
}

/// Why a drive cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The port or interface cannot be opened.
    #[error("cannot open {name}: {error}{}", may(.error))]
    Open {
        /// The port's path or the interface's name.
        name: String,
        /// The system's own word.
        error: io::Error,
    },
    /// The port or bus went away.
    #[error("{name} went away: {error}")]
    Gone {
        /// The port's path or the interface's name.
        name: String,
        /// The system's own word.
        error: io::Error,
    },
    /// Nobody answers.
    #[error("{drive} does not answer{hint}")]
    Silent {
        /// Which drive was asked, and where.
        drive: String,
        /// What was heard instead, or what to look at; begins with its own punctuation.
        hint: String,
    },
    /// It answers, and has a fault that does not go away.
    #[error("{drive} is in fault and stays there: {fault}")]
    Fault {
        /// Which drive was asked, and where.
        drive: String,
        /// What it says.
        fault: DriveFault,
    },
    /// It answers, and is not set up so that it may be driven.
    #[error("{drive} {why}")]
    Refused {
        /// Which drive was asked, and where.
        drive: String,
        /// What is wrong with it, and what would be right.
        why: String,
    },
}

/// What helps who may not open a port.
fn may(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::PermissionDenied => {
            "; on most systems ports are for the group dialout: sudo usermod -aG dialout $USER, and log in anew"
        }
        _ => "",
    }
}
