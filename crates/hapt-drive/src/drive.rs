//! The interface of every drive, its limits and its errors.

use std::io;
use std::time::Instant;

pub use hapt_rt::DriveFault;

/// The largest number of foreign frames read before a sample's request, and after it, so that a busy bus does not delay the loop.
pub(crate) const OTHERS: usize = 256;

/// A motor drive with any protocol. Angles are revolutions and torques N·m, both at the drive's own shaft.
///
/// [`Drive::read`] and [`Drive::command`] are called on the loop's thread, one after the other in every sample: they allocate nothing,
/// and wait until the instant that they are given, no longer.
///
/// A drive with a protocol of its own implements this trait; [`crate::DriveDevice`] makes it the loop's device:
///
/// ```
/// use std::time::Instant;
///
/// use hapt_core::SafetyProfile;
/// use hapt_drive::{Drive, DriveDevice, DriveError, DriveLimits, Error, ShaftState};
/// use hapt_model::{Source, World};
/// use hapt_rt::{Cycle, Moment, Plan};
///
/// /// A drive whose shaft is blocked at a quarter of a revolution.
/// struct Blocked {
///     most: f64,
///     torque: f64,
/// }
///
/// impl Drive for Blocked {
///     fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
///         self.most = limits.torque;
///         Ok(ShaftState { position: 0.25, velocity: 0.0 })
///     }
///     fn read(&mut self, _until: Instant) -> Result<ShaftState, DriveError> {
///         Ok(ShaftState { position: 0.25, velocity: 0.0 })
///     }
///     fn command(&mut self, torque: f64, _until: Instant) -> Result<(), DriveError> {
///         self.torque = torque.clamp(-self.most, self.most);
///         Ok(())
///     }
///     fn halt(&mut self, _until: Instant) {
///         self.torque = 0.0;
///     }
///     fn stop(&mut self) {
///         self.torque = 0.0;
///     }
/// }
///
/// let file = r#"
/// loop.period = "1 ms"
/// device = { inertia = "6.4e-4 kg m^2", limit = "0.1 N m" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "0.5 N m/rad"
/// "#;
/// let world = World::read(&Source::from_text("spring.toml", file), &[])?;
/// let device = DriveDevice::start(Box::new(Blocked { most: 0.0, torque: 0.0 }), &world)?;
/// let plan = Plan::new(&world, SafetyProfile::Uncertified)?;
/// let mut cycle = Cycle::new(Box::new(plan), Box::new(device));
/// let record = cycle.sample(&Moment::default(), None)?;
/// assert!((record.position - 0.25 * std::f64::consts::TAU).abs() < 1e-12);
/// assert_eq!(record.output, 0.0, "disarmed");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Drive: Send {
    /// Stops the drive, clears latched faults, checks its state and sets its limits. It is ready afterwards, without torque, and waits for
    /// its first command for a second at least. May take some seconds.
    ///
    /// # Errors
    /// It does not answer, or has a fault that does not clear.
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error>;

    /// Reads the shaft. An answer to an earlier request does not count.
    ///
    /// # Errors
    /// See [`DriveError`].
    fn read(&mut self, until: Instant) -> Result<ShaftState, DriveError>;

    /// Sets the torque to hold, and feeds the drive's watchdog. Where requests feed it too, the drive's torque is requested and compared. A
    /// stopped drive stays off, or is stopped again at once.
    ///
    /// # Errors
    /// See [`DriveError`].
    fn command(&mut self, torque: f64, until: Instant) -> Result<(), DriveError>;

    /// Stops the drive without torque: sent once, without waiting for an answer. A drive that has failed is halted in every sample, and
    /// only a start switches it on again.
    fn halt(&mut self, until: Instant);

    /// Stops the drive without torque, as far as it is reachable. Called on every exit, possibly more than once.
    fn stop(&mut self);

    /// Sets the loop's period, in s.
    fn paced(&mut self, _period: f64) {}

    /// Notes for the user: settings that hapt cannot change, and that have to be made in the drive.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// The limits that a drive enforces independently of the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveLimits {
    /// Without a command for this time, in s, the drive removes the torque, until an explicit stop and start.
    pub watchdog: f64,
    /// The largest torque at its shaft, in N·m; infinite where the world has none.
    pub torque: f64,
}

/// The state of a drive's shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftState {
    /// In revolutions, over several turns.
    pub position: f64,
    /// In revolutions per second.
    pub velocity: f64,
}

/// The failure of a drive at one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveError {
    /// No frame arrived in time.
    Silent,
    /// Frames arrived in time, but no answer to this request.
    Late,
    /// The drive stopped with a fault.
    Fault(DriveFault),
    /// The port or bus is gone.
    Gone,
}

impl From<io::Error> for DriveError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::TimedOut { DriveError::Late } else { DriveError::Gone }
    }
}

/// The reason that a drive cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The port or interface cannot be opened.
    #[error("cannot open {name}: {error}{}", may(.error))]
    Open {
        /// The port's path or the interface's name.
        name: String,
        /// The system's error.
        error: io::Error,
    },
    /// The port or bus went away.
    #[error("{name} is gone: {error}")]
    Gone {
        /// The port's path or the interface's name.
        name: String,
        /// The system's error.
        error: io::Error,
    },
    /// The drive does not answer.
    #[error("{drive} does not answer{hint}")]
    Silent {
        /// The drive and its address.
        drive: String,
        /// The frames that arrived instead, or what to check; starts with its own punctuation.
        hint: String,
    },
    /// The drive has a fault that does not clear.
    #[error("{drive} is in fault and stays there: {fault}")]
    Fault {
        /// The drive and its address.
        drive: String,
        /// The fault.
        fault: DriveFault,
    },
    /// The drive is not configured so that it may be driven.
    #[error("{drive} {why}")]
    Refused {
        /// The drive and its address.
        drive: String,
        /// The cause, and the remedy.
        why: String,
    },
}

/// The remedy for a port without permission.
fn may(error: &io::Error) -> &'static str {
    if error.kind() == io::ErrorKind::PermissionDenied {
        "; on most systems ports are for the group dialout: sudo usermod -aG dialout $USER, and log in anew"
    } else {
        ""
    }
}
