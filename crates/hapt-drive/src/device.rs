//! A drive as the loop's device: its direction, the transmission to the puck, and no torque on any exit.

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use hapt_core::WhenLate;
use hapt_model::{Motion, World};
use hapt_rt::{Device, Failure, Plan, Position};

use crate::drive::{Drive, DriveError, DriveLimits, Error, ShaftState};

/// The drive's watchdog where a late command is no fault: periods without a command, and the shortest time in s.
const WATCHDOG: (f64, f64) = (10.0, 5e-3);
/// Consecutive samples without an answer after which the drive counts as gone.
const SILENT: u32 = 5;
/// The largest parts of a period for reading and for commanding.
const READING: f64 = 0.6;
const COMMANDING: f64 = 0.2;

/// The transmission between drive and puck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// The puck's displacement for one revolution of the drive, in rad (linear: m); negative for opposite directions.
    pub travel: f64,
    /// The puck's position, from the drive's zero, at the world's 0; `None`: the position at arming.
    pub home: Option<f64>,
    /// Whether positions repeat after a turn of the puck.
    pub turns: bool,
    /// The largest torque at the puck, in N·m (linear: N).
    pub limit: f64,
}

impl Mounting {
    /// The transmission of the world's `[device]` and `[device.drive]`.
    pub fn new(world: &World) -> Self {
        let drive = &world.device.drive;
        let (travel, turns) = match world.motion {
            Motion::Rotary => (TAU / drive.gear.unwrap_or(1.0), true),
            // Required for a real drive, optional in a simulation.
            Motion::Linear => (drive.gear.unwrap_or(1e-3), false),
        };
        let travel = if drive.reversed { -travel } else { travel };
        Mounting { travel, home: drive.home, turns, limit: world.device.limit.unwrap_or(f64::INFINITY) }
    }

    /// The torque at the drive's shaft in N·m for 1 N·m (linear: 1 N) at the puck: both do the same work.
    fn torque(&self, puck: f64) -> f64 {
        puck.clamp(-self.limit, self.limit) * self.travel / TAU
    }
}

/// A drive with a puck on it.
pub struct DriveDevice {
    drive: Box<dyn Drive>,
    mounting: Mounting,
    /// Added to the puck's position: whole turns and the home.
    offset: f64,
    period: f64,
    last: Position,
    /// Consecutive samples with a stale reading, and those of them without any frame of the drive.
    stale: u32,
    silent: u32,
    /// The stale readings reported to the supervisor.
    missed: u32,
    /// Its failure, which persists: a bus that returns does not restore the torque.
    failed: Option<Failure>,
}

impl DriveDevice {
    /// Starts the drive, with its watchdog on: ten periods, 5 ms at least. Where the world states `interval_max` and a late sample is a
    /// fault, it is the longest time between two commands that the certificate covers: while this computer is late, only the drive can act.
    ///
    /// The world's 0 is the position at arming, unless there is a home. With a home, a rotary puck has to be within half a turn of it at
    /// the start; from then on turns are counted.
    ///
    /// # Errors
    /// See [`Drive::start`].
    pub fn start(mut drive: Box<dyn Drive>, world: &World) -> Result<Self, Error> {
        let (mounting, period) = (Mounting::new(world), world.sampling.period);
        let watchdog = watchdog(world);
        let limits = DriveLimits { watchdog, torque: mounting.torque(mounting.limit).abs() };
        let answer = drive.start(&limits)?;
        drive.paced(period);
        let position = answer.position * mounting.travel;
        let offset = match mounting.home {
            None => 0.0,
            Some(home) if mounting.turns => {
                let from_home = position - home;
                // Whole turns leave it in [-π, π).
                -home - TAU * ((from_home + PI) / TAU).floor()
            }
            Some(home) => -home,
        };
        let last = Position { position: position + offset, velocity: 0.0, announced: false };
        Ok(DriveDevice { drive, mounting, offset, period, last, stale: 0, silent: 0, missed: 0, failed: None })
    }

    /// The drive's notes for the user.
    pub fn notes(&self) -> Vec<String> {
        self.drive.notes()
    }

    fn until(&self, part: f64) -> Instant {
        Instant::now() + Duration::from_secs_f64(part * self.period)
    }

    fn reading(&mut self) -> Result<Position, Failure> {
        match self.drive.read(self.until(READING)) {
            Ok(ShaftState { position, velocity }) => {
                self.missed = std::mem::take(&mut self.stale);
                self.silent = 0;
                let travel = self.mounting.travel;
                self.last = Position {
                    position: position * travel + self.offset,
                    velocity: velocity * travel,
                    announced: false,
                };
                Ok(self.last)
            }
            Err(DriveError::Silent) => {
                self.silent += 1;
                self.is_stale()
            }
            Err(DriveError::Late) => {
                self.silent = 0;
                self.is_stale()
            }
            Err(DriveError::Fault(fault)) => Err(Failure::Drive(fault)),
            Err(DriveError::Gone) => Err(Failure::Unplugged),
        }
    }

    fn is_stale(&mut self) -> Result<Position, Failure> {
        self.stale += 1;
        self.missed = self.stale;
        if self.silent >= SILENT { Err(Failure::Gone) } else { Ok(self.last) }
    }
}

/// The time of the drive's watchdog, in s.
fn watchdog(world: &World) -> f64 {
    let sampling = &world.sampling;
    let default = (WATCHDOG.0 * sampling.period).max(WATCHDOG.1);
    match (sampling.interval_max, world.safety.late) {
        (Some(_), Some(WhenLate::Fault)) => {
            let spread = sampling.delay_max_s() - sampling.delay_s();
            default.min(sampling.interval_max_s() + spread)
        }
        (Some(_), Some(WhenLate::Fade | WhenLate::Count) | None) | (None, _) => default,
    }
}

impl Device for DriveDevice {
    fn read(&mut self) -> Result<Position, Failure> {
        if let Some(failure) = self.failed {
            return Err(failure);
        }
        let reading = self.reading();
        if reading.is_err() {
            self.failed = reading.err();
            self.drive.halt(self.until(COMMANDING));
        }
        reading
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        if let Some(failure) = self.failed {
            self.drive.halt(self.until(COMMANDING));
            return Err(failure);
        }
        // A NaN commands no torque.
        let torque = if torque.is_finite() { self.mounting.torque(torque) } else { 0.0 };
        let failure = match self.drive.command(torque, self.until(COMMANDING)) {
            Ok(()) => None,
            Err(DriveError::Fault(fault)) => Some(Failure::Drive(fault)),
            Err(DriveError::Gone) => Some(Failure::Unplugged),
            // A line that accepts nothing for this time has no peer.
            Err(DriveError::Silent | DriveError::Late) => Some(Failure::Gone),
        };
        self.failed = failure;
        failure.map_or(Ok(()), Err)
    }

    fn missed(&self) -> u32 {
        self.missed
    }

    fn age(&self) -> f64 {
        f64::from(self.stale) * self.period
    }

    fn adopt(&mut self, plan: &mut Plan) {
        self.period = plan.period();
        self.drive.paced(self.period);
    }
}

impl Drop for DriveDevice {
    fn drop(&mut self) {
        self.drive.stop();
    }
}
