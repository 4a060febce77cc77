//! A simulated drive with its wheel: the exact puck, the drive's protocol and its watchdog, at the end of a bus.

use std::f64::consts::TAU;
use std::io;
use std::time::{Duration, Instant};

use hapt_model::World;
use hapt_plant::spec::DeviceSpec;
use hapt_plant::{Script, VirtualDevice};

use crate::can::Bus;
use crate::device::Mounting;
use crate::frame::Frame;

/// The longest step of the simulation, in s: torques change and watchdogs expire at its instants.
const STEP: f64 = 50e-6;
/// After a longer pause of the machine the simulation does not catch up. In lockstep such a pause does not count as silence of the loop.
const MAX_PAUSE: Duration = Duration::from_secs(1);
const MAX_PAUSE_IN_LOCKSTEP: Duration = Duration::from_millis(20);
/// The interval between two checks of the end.
const POLL_PERIOD: Duration = Duration::from_millis(1);
/// Lockstep changes to real time after this time without a frame.
const LOCKSTEP_TIMEOUT: Duration = Duration::from_millis(50);
/// An answer that the bus does not accept for this time is lost.
const WRITE_TIMEOUT: Duration = Duration::from_millis(20);

/// The firmware of a simulated drive: its protocol, its state, its watchdog.
pub trait Firmware: Send {
    /// Whether the frame requests the position of this drive, which ends a period of lockstep.
    fn requests_position(&self, frame: &Frame) -> bool;

    /// Receives a frame of the bus, for this drive or another; answers go to `send`.
    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame));

    /// Advances by this many seconds; returns the torque at the shaft from now on, in N·m. Unsolicited frames go to `send`.
    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64;
}

/// The reading of a drive's own encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// In revolutions.
    pub position: f64,
    /// In revolutions per second.
    pub velocity: f64,
}

/// The clock of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// Real time.
    Real,
    /// In lockstep with the loop: each request for the position advances the time by this many seconds. After 50 ms without a frame it
    /// runs in real time, so that heartbeats and watchdogs keep their behaviour.
    Lockstep(f64),
}

/// A drive with a wheel on it.
pub struct Simulator {
    bus: Box<dyn Bus>,
    inside: DriveModel,
    time: Time,
    /// The real time up to which the simulation has advanced.
    now: Instant,
}

/// The drive and its puck, without bus and clock.
struct DriveModel {
    firmware: Box<dyn Firmware>,
    puck: VirtualDevice,
    travel: f64,
    /// The puck's position by the drive's zero where it is at its own 0, from which gravity, cogging and stops count.
    home: f64,
    step: f64,
    /// Elapsed time that is not simulated yet, in s: less than a step.
    rest: f64,
}

impl Simulator {
    /// The puck of `world` on a drive, at rest at the world's 0, at the end of `bus`.
    pub fn new(bus: Box<dyn Bus>, firmware: Box<dyn Firmware>, world: &World, time: Time) -> Self {
        let step = match time {
            Time::Real => STEP,
            Time::Lockstep(period) => period / (period / STEP).ceil(),
        };
        let puck = VirtualDevice::new(&DeviceSpec { period: step, delay: 0.0, ..world.device_spec() });
        let Mounting { travel, home, .. } = Mounting::new(world);
        let inside = DriveModel { firmware, puck, travel, home: home.unwrap_or(0.0), step, rest: 0.0 };
        Simulator { bus, inside, time, now: Instant::now() }
    }

    /// Starts the hand of the scenario of this name at its t = 0; `false`: there is no such scenario.
    pub fn play(&mut self, world: &World, scenario: &str) -> bool {
        let Some(scenario) = world.scenarios.iter().find(|known| known.name == scenario) else { return false };
        let mut script = Script::new(&scenario.hand, scenario.duration, self.inside.step);
        self.inside.puck.begin(&mut script);
        true
    }

    /// Runs until `ends` returns true.
    ///
    /// # Errors
    /// The bus is gone.
    pub fn run(&mut self, mut ends: impl FnMut() -> bool) -> io::Result<()> {
        self.now = Instant::now();
        let mut quiet = Duration::ZERO;
        while !ends() {
            let frame = self.bus.receive(Instant::now() + POLL_PERIOD)?;
            let Simulator { bus, inside, time, now } = self;
            // An answer that the bus does not accept is lost, as on a real bus.
            let mut send = |frame: Frame| drop(bus.send(&frame, Instant::now() + WRITE_TIMEOUT));
            let then = std::mem::replace(now, Instant::now());
            let longest = if *time == Time::Real { MAX_PAUSE } else { MAX_PAUSE_IN_LOCKSTEP };
            let passed = (*now - then).min(longest);
            quiet = if frame.is_some() { Duration::ZERO } else { quiet + passed };
            if *time == Time::Real || quiet > LOCKSTEP_TIMEOUT {
                inside.travel(passed.as_secs_f64(), &mut send);
            }
            if let Some(frame) = frame {
                if let (Time::Lockstep(period), true) = (*time, inside.firmware.requests_position(&frame)) {
                    inside.travel(period, &mut send);
                }
                let shaft = inside.shaft();
                inside.firmware.receive(&frame, shaft, &mut send);
            }
        }
        Ok(())
    }
}

impl DriveModel {
    fn shaft(&self) -> Shaft {
        let (position, velocity) = self.puck.puck();
        Shaft { position: (position + self.home) / self.travel, velocity: velocity / self.travel }
    }

    /// Advances by whole steps.
    fn travel(&mut self, seconds: f64, send: &mut dyn FnMut(Frame)) {
        // Less than a thousandth of a step is rounding.
        let steps = ((self.rest + seconds) / self.step + 1e-3).floor();
        self.rest += seconds - steps * self.step;
        for _ in 0..steps as u64 {
            let torque = self.firmware.pass(self.step, self.shaft(), send);
            self.puck.command(torque * TAU / self.travel);
            self.puck.travel();
        }
    }
}
