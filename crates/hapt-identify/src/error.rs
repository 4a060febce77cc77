//! The errors of a record.

use std::fmt;

use crate::identified::PositionTorque;
use crate::puck::Puck;

/// The residuals of the best fit, where counts and noise do not explain them.
#[derive(Clone, Debug, PartialEq)]
pub struct LargeResidual {
    /// Root mean square, in rad (linear: m).
    pub rms: f64,
    /// The same in counts, where the positions have them.
    pub counts: Option<f64>,
    /// A torque that depends on the position, where that explains most of them.
    pub position: Option<PositionTorque>,
    /// A clear line in their spectrum, in Hz, where no such torque explains them.
    pub resonance_hz: Option<f64>,
    /// The best fit itself, of which no interval is valid; `None` with a handle.
    pub puck: Option<Box<Puck>>,
}

impl fmt::Display for LargeResidual {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the motion does not follow from the torque to within counts and noise: the residuals of the best fit are "
        )?;
        match self.counts {
            Some(counts) => write!(f, "{counts:.2} counts rms")?,
            None => write!(f, "{:.3e} rms", self.rms)?,
        }
        write!(f, ", more than independent noise; ")?;
        if let (None, Some(hz)) = (self.position, self.resonance_hz) {
            return write!(
                f,
                "a line at {hz:.1} Hz stands out of them, as of a handle on a flexible shaft, which hapt identify --handle fits"
            );
        }
        match self.position.map(|position| position.times_a_turn) {
            None => write!(
                f,
                "look at whether a hand, a belt or a spring was on the puck, at the columns and their units, and at the torque's limit"
            ),
            Some(0) => write!(f, "a torque that grows with the position, as a spring's, explains most of them"),
            Some(1) => {
                write!(f, "a torque that repeats once a turn, as of an eccentric weight, explains most of them")
            }
            Some(n) => write!(f, "a torque that repeats {n} times a turn, as a motor's cogging, explains most of them"),
        }
    }
}

/// Why a record cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The lists of times, positions and torques are of different lengths.
    #[error("{times} times, {positions} positions and {torques} torques; a record has one of each for every sample")]
    Lengths {
        /// How many.
        times: usize,
        /// How many.
        positions: usize,
        /// How many.
        torques: usize,
    },
    /// A number that is not finite.
    #[error("sample {sample}: the {what} is {value}; expected a finite number")]
    NotFinite {
        /// From 0.
        sample: usize,
        /// time, position, torque or force.
        what: &'static str,
        /// NaN or infinite.
        value: f64,
    },
    /// The list of forces is of another length.
    #[error("{forces} forces and {samples} samples; a record has one force for every sample")]
    Forces {
        /// How many.
        forces: usize,
        /// How many.
        samples: usize,
    },
    /// The force is the same all the time.
    #[error("the force is {force} throughout; expected the column of a sensor that measured one")]
    StillForce {
        /// The force, in the column's unit.
        force: f64,
    },
    /// Time does not increase.
    #[error("sample {sample}: the time is {time} s after {before} s; times must increase")]
    Times {
        /// From 0.
        sample: usize,
        /// In s.
        time: f64,
        /// In s.
        before: f64,
    },
    /// Too few samples, or over too short a time.
    #[error(
        "{samples} samples over {duration:.3} s are too few; 200 over half a second are the least, some seconds are good"
    )]
    Short {
        /// How many.
        samples: usize,
        /// In s.
        duration: f64,
    },
    /// Samples that are too far apart for a device.
    #[error(
        "the samples are {apart} s apart; a device shows itself in samples at most 0.5 s apart. Are the times in ms? Name their column time_ms"
    )]
    Sparse {
        /// In s.
        apart: f64,
    },
    /// The position does not change.
    #[error(
        "nothing moves: different positions in the whole record: {values}, where 8 are the least; the torque has to overcome the friction, and move the puck by many counts"
    )]
    Still {
        /// Different positions.
        values: usize,
    },
    /// The torque is the same all the time, and is not 0.
    #[error(
        "there is no excitation: the torque is {torque} throughout; expected a torque that steps up and down, or a chirp (or none at all, for a coast-down)"
    )]
    Constant {
        /// The torque, in N·m (N).
        torque: f64,
    },
    /// The motion does not follow the torque.
    #[error(
        "the motion does not follow from the torque: no inertia, damping, friction and delay up to 50 ms were found that explain it; look at the columns, their units, and at whether a hand was on the puck"
    )]
    Unexplained,
    /// No handle shows: the interval of its inertia includes a part that no record could show.
    #[error("a device without a handle on a shaft explains this record as well")]
    Rigid,
    /// The residuals are larger than counts and noise.
    #[error("{0}")]
    Residual(LargeResidual),
    /// The columns of a table.
    #[error("{0}")]
    Columns(String),
}
