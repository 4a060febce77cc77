//! A drive and its wheel, simulated: the exact puck, the drive's protocol, and its watchdog, at the end of a bus.

use std::f64::consts::TAU;
use std::io;
use std::time::{Duration, Instant};

use hapt_model::World;
use hapt_plant::spec::DeviceSpec;
use hapt_plant::{Script, VirtualDevice};

use crate::can::Bus;
use crate::device::Mounting;
use crate::frame::Frame;

/// The longest step of the simulation, in s: torques change and watchdogs run out on its instants.
const STEP: f64 = 50e-6;
/// After a longer pause the simulation does not catch up: the machine has stood still. In lockstep that is no silence of the loop's.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE_IN_LOCKSTEP: Duration = Duration::from_millis(20);
/// From one look whether to end to the next.
const LOOK: Duration = Duration::from_millis(1);
/// Lockstep ends when nobody has spoken for so long.
const QUIET: Duration = Duration::from_millis(50);
/// An answer that nobody takes for so long is lost.
const PATIENCE: Duration = Duration::from_millis(20);

/// What is inside of a simulated drive: its protocol, its state, its watchdog.
pub trait Firmware: Send {
    /// Whether the frame asks this drive where its shaft is: a period of lockstep is over then.
    fn asks(&self, frame: &Frame) -> bool;

    /// A frame is on the bus, for this drive or for another; what it says to that goes to `say`.
    fn hear(&mut self, frame: &Frame, shaft: Shaft, say: &mut dyn FnMut(Frame));

    /// So many seconds pass; the torque at the shaft, in N·m, from now on. What it says by itself goes to `say`.
    fn pass(&mut self, seconds: f64, shaft: Shaft, say: &mut dyn FnMut(Frame)) -> f64;
}

/// What a drive's own encoder says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// In revolutions.
    pub position: f64,
    /// In revolutions per second.
    pub velocity: f64,
}

/// Whose time the simulation runs in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// Everybody's.
    Real,
    /// The loop's: a period of so many seconds passes each time that it is asked for its position, and none otherwise. Where nobody
    /// speaks to it for 50 ms, it goes on in real time, so that heartbeats and watchdogs stay what they are.
    Lockstep(f64),
}

/// A drive with a wheel on it.
pub struct Simulator {
    bus: Box<dyn Bus>,
    inside: Inside,
    time: Time,
    /// Up to where the simulation has come, in real time.
    now: Instant,
}

/// Everything but bus and clock.
struct Inside {
    firmware: Box<dyn Firmware>,
    puck: VirtualDevice,
    travel: f64,
    step: f64,
    /// Seconds that are over and not simulated yet: less than a step.
    rest: f64,
}

impl Simulator {
    /// The puck of `world` on a drive, at rest at 0, at the end of `bus`.
    pub fn new(bus: Box<dyn Bus>, firmware: Box<dyn Firmware>, world: &World, time: Time) -> Self {
        let step = match time {
            Time::Real => STEP,
            Time::Lockstep(period) => period / (period / STEP).ceil(),
        };
        let puck = VirtualDevice::new(&DeviceSpec { period: step, delay: 0.0, ..world.device_spec() });
        let travel = Mounting::new(world).travel;
        Simulator { bus, inside: Inside { firmware, puck, travel, step, rest: 0.0 }, time, now: Instant::now() }
    }

    /// The hand of the scenario of this name takes the puck, at its t = 0; `false`: there is none.
    pub fn play(&mut self, world: &World, scenario: &str) -> bool {
        let Some(scenario) = world.scenarios.iter().find(|known| known.name == scenario) else { return false };
        let mut script = Script::new(&scenario.hand, scenario.duration, self.inside.step);
        self.inside.puck.begin(&mut script);
        true
    }

    /// Runs until `ends` says so.
    ///
    /// # Errors
    /// The bus is gone.
    pub fn run(&mut self, mut ends: impl FnMut() -> bool) -> io::Result<()> {
        self.now = Instant::now();
        let mut quiet = Duration::ZERO;
        while !ends() {
            let frame = self.bus.receive(Instant::now() + LOOK)?;
            let Simulator { bus, inside, time, now } = self;
            // An answer that finds no room is lost, as on a real bus.
            let mut say = |frame: Frame| drop(bus.send(&frame, Instant::now() + PATIENCE));
            let then = std::mem::replace(now, Instant::now());
            let longest = if *time == Time::Real { LONGEST_PAUSE } else { LONGEST_PAUSE_IN_LOCKSTEP };
            let passed = (*now - then).min(longest);
            quiet = if frame.is_some() { Duration::ZERO } else { quiet + passed };
            if *time == Time::Real || quiet > QUIET {
                inside.travel(passed.as_secs_f64(), &mut say);
            }
            if let Some(frame) = frame {
                if let (Time::Lockstep(period), true) = (*time, inside.firmware.asks(&frame)) {
                    inside.travel(period, &mut say);
                }
                let shaft = inside.shaft();
                inside.firmware.hear(&frame, shaft, &mut say);
            }
        }
        Ok(())
    }
}

impl Inside {
    fn shaft(&self) -> Shaft {
        let (position, velocity) = self.puck.puck();
        Shaft { position: position / self.travel, velocity: velocity / self.travel }
    }

    /// Step by step, as many as fit.
    fn travel(&mut self, seconds: f64, say: &mut dyn FnMut(Frame)) {
        // Less than a thousandth of a step is rounding.
        let steps = ((self.rest + seconds) / self.step + 1e-3).floor();
        self.rest += seconds - steps * self.step;
        for _ in 0..steps as u64 {
            let torque = self.firmware.pass(self.step, self.shaft(), say);
            self.puck.command(torque * TAU / self.travel);
            self.puck.travel();
        }
    }
}
