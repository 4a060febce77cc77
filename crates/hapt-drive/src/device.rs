//! A drive as the loop's device: which way it turns, what stands between it and the puck, and no torque on any way out.

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use hapt_model::{Motion, World};
use hapt_rt::{Device, Failure, Plan, Position};

use crate::drive::{Drive, DriveError, DriveLimits, Error, ShaftState};

/// Periods without a command after which the drive takes the torque away, and the shortest such time in s.
const WATCHDOG: (f64, f64) = (10.0, 5e-3);
/// So many samples in a row without a word from the drive, and it counts as gone.
const SILENT: u32 = 5;
/// The parts of a period that reading and commanding may take at most.
const READING: f64 = 0.6;
const COMMANDING: f64 = 0.2;

/// How the puck hangs on the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// How far the puck goes in one revolution of the drive, in rad (linear: m); negative where they run against each other.
    pub travel: f64,
    /// The puck's position, by the drive's own zero, that is the world's 0; `None`: where it is armed.
    pub home: Option<f64>,
    /// Whether positions come again after a turn of the puck.
    pub turns: bool,
    /// The largest torque at the puck, in N·m (linear: N).
    pub limit: f64,
}

impl Mounting {
    /// By the world's `[device]` and `[device.drive]`.
    pub fn new(world: &World) -> Self {
        let drive = &world.device.drive;
        let (travel, turns) = match world.motion {
            Motion::Rotary => (TAU / drive.gear.unwrap_or(1.0), true),
            // Whoever drives one has to say; a simulation need not.
            Motion::Linear => (drive.gear.unwrap_or(1e-3), false),
        };
        let travel = if drive.reversed { -travel } else { travel };
        Mounting { travel, home: drive.home, turns, limit: world.device.limit.unwrap_or(f64::INFINITY) }
    }

    /// N·m at the drive's shaft for N·m (linear: N) at the puck: both do the same work.
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
    /// Samples in a row whose reading was not new, and those of them at which nothing at all was heard.
    stale: u32,
    silent: u32,
    /// What the supervisor is told.
    missed: u32,
    /// How it has failed: a bus that comes back brings no torque back.
    failed: Option<Failure>,
}

impl DriveDevice {
    /// Starts the drive, with its watchdog on: ten periods, 5 ms at least.
    ///
    /// The world's 0 is where the loop is armed, unless there is a home. With a home a puck that turns is taken to be within half a turn
    /// of it when it is started; from then on turns count.
    ///
    /// # Errors
    /// See [`Drive::start`].
    pub fn start(mut drive: Box<dyn Drive>, world: &World) -> Result<Self, Error> {
        let (mounting, period) = (Mounting::new(world), world.sampling.period);
        let watchdog = (WATCHDOG.0 * period).max(WATCHDOG.1);
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

    /// What whoever starts it has to know of its drive.
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
        // A torque that is no number is none.
        let torque = if torque.is_finite() { self.mounting.torque(torque) } else { 0.0 };
        let failure = match self.drive.command(torque, self.until(COMMANDING)) {
            Ok(()) => None,
            Err(DriveError::Fault(fault)) => Some(Failure::Drive(fault)),
            Err(DriveError::Gone) => Some(Failure::Unplugged),
            // A line that takes nothing for so long has nobody at its other end.
            Err(DriveError::Silent | DriveError::Late) => Some(Failure::Gone),
        };
        self.failed = failure;
        failure.map_or(Ok(()), Err)
    }

    fn missed(&self) -> u32 {
        self.missed
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
