//! Hardware in the loop, in lockstep: the emulated board is the loop, this is the hardware. Each sample is sent to it over its UART, and
//! its torque turns the exact device. Time is that of the samples, so that every run is the same.

use anyhow::{Context, Result, bail, ensure};
use fastrand::Rng;
use hapt_core::{Limits, Phase, Reason, SafetyProfile};
use hapt_sim::{Simulation, VirtualDevice, script};
use hapt_wire::{Command, DeviceMessage, Telemetry};

use super::line::{BOARD_TIMEOUT, Board};
use super::{BOARDS, Extent, has_tools, on_all_boards};
use crate::notes::world;

/// Of the notes, and how many seconds of them on the first board, in full: two of them whole.
const WORLDS: [(&str, f64); 4] =
    [("default", f64::INFINITY), ("damped", 1.0), ("released", f64::INFINITY), ("resonance", 1.0)];
/// Seconds of them on the other boards then, and on the first in a short run; and on the others in that one.
const SHORT: f64 = 0.4;
const SHORTEST: f64 = 0.1;
/// The largest difference of torques, relative to the largest torque: f32's roundings, which add up in a lossless world.
const ROUNDING: f64 = 1e-5;
const ROUNDING_A_SAMPLE: f64 = 1e-8;

/// The link's deadline in its test, in s.
const LINK: f64 = 0.1;

/// Every board is the loop of an exact device, sample by sample over its UART: the rows of `hapt sim`, faults too.
pub fn holds(extent: Extent) -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    let all = on_all_boards("fed", |machine, program| {
        let mut board = Board::start(machine, program, &[], true)?;
        let most = |whole: f64| match (extent, machine == BOARDS[0].0) {
            (Extent::Full, true) => whole,
            (Extent::Full, false) | (Extent::Short, true) => SHORT,
            (Extent::Short, false) => SHORTEST,
        };
        let run = |(name, seconds): &(&str, f64)| board.runs(name, most(*seconds));
        let runs: Vec<_> = WORLDS.iter().map(run).collect::<Result<_>>()?;
        board.faults_on_a_jump()?;
        board.misses_a_silent_host()?;
        board.disturb();
        let (_, disturbed) = board.runs(WORLDS[0].0, SHORTEST)?;
        ensure!(runs[0].1.starts_with(&disturbed), "garbage between the frames changed a torque");
        Ok(runs)
    })?;
    for ((machine, ..), runs) in BOARDS.iter().zip(&all) {
        for (((name, _), (difference, bits)), (_, whole)) in WORLDS.iter().zip(runs).zip(&all[0]) {
            let samples = bits.len();
            println!("        {machine}: {name}, {samples} samples: torques within {difference:.1e} of the largest");
            let allowed = ROUNDING.max(ROUNDING_A_SAMPLE * samples as f64);
            ensure!(*difference < allowed, "{machine}: {name}: torques differ by {difference:e} of the largest");
            ensure!(whole.starts_with(bits), "{machine}: {name}: other torques than on {}", BOARDS[0].0);
        }
    }
    Ok(())
}

/// The board as a loop whose hardware is here.
impl Board {
    /// One sample.
    fn feed(&mut self, (position, velocity): (f64, f64), announced: bool) -> Result<Telemetry> {
        let sample = self.sample;
        let (position, velocity) = (position as f32, velocity as f32);
        self.ask(Command::Sample { sample, position, velocity, late: 0.0, announced })?;
        self.sample += 1;
        let message = self.receive(BOARD_TIMEOUT, |message| match message {
            DeviceMessage::Telemetry(telemetry) if telemetry.sample == sample => Some(telemetry),
            _ => None,
        })?;
        message.context("no telemetry")
    }

    /// Armed, and faded in, the puck at rest at 0.
    fn arm(&mut self, world: u32) -> Result<()> {
        self.ask(Command::Arm { world })?;
        for _ in 0..1000 {
            if self.feed((0.0, 0.0), false)?.phase == Phase::Running as u8 {
                return Ok(());
            }
        }
        bail!("it does not fade in")
    }

    /// A world's first scenario, for at most this time: the largest difference of torques from `hapt sim`'s rows, over the largest torque;
    /// and the bits of all torques.
    pub fn runs(&mut self, name: &str, most: f64) -> Result<(f64, Vec<u32>)> {
        let mut world = world(name)?;
        world.scenarios[0].duration = world.scenarios[0].duration.min(most);
        let scenario = &world.scenarios[0];
        let hash = self.load(&world, &world.limits(SafetyProfile::Simulated))?;
        self.arm(hash)?;
        let mut device = VirtualDevice::new(&world.device_spec());
        device.begin(&mut script(scenario, world.sampling.period));
        let mut run = Simulation::new(&world, scenario)?;
        let (mut difference, mut largest, mut bits) = (0.0_f64, 0.0_f64, Vec::new());
        let mut first = true;
        while let Some(row) = run.next() {
            let row = row?;
            if !std::mem::take(&mut first) {
                device.travel();
            }
            let telemetry = self.feed(device.puck(), device.announced())?;
            ensure!(telemetry.phase == Phase::Running as u8, "{name}: phase {}", telemetry.phase);
            device.command(f64::from(telemetry.output));
            difference = difference.max((f64::from(telemetry.torque) - row.torque).abs());
            largest = largest.max(row.torque.abs());
            bits.push(telemetry.torque.to_bits());
        }
        self.ask(Command::Disarm)?;
        for _ in 0..10_000 {
            if self.feed(device.puck(), false)?.phase == Phase::Disarmed as u8 {
                return Ok((difference / largest, bits));
            }
        }
        bail!("it does not fade out")
    }

    /// From here on, random bytes come between the frames.
    pub fn disturb(&mut self) {
        self.noise = Some(Rng::with_seed(11));
    }

    /// Without heartbeats the torque is 0 after the link's time, and not before.
    pub fn misses_a_silent_host(&mut self) -> Result<()> {
        let world = world("default")?;
        let limits = Limits { link: LINK, link_faults: true, ..world.limits(SafetyProfile::Simulated) };
        let hash = self.load(&world, &limits)?;
        self.ask(Command::Arm { world: hash })?;
        let mut last = 0;
        for sample in 1..=300 {
            if sample <= 150 {
                self.ask(Command::Heartbeat)?;
            }
            let telemetry = self.feed((0.1, 0.0), false)?;
            let over = f64::from(sample - 150) * world.sampling.period > LINK + 2e-3;
            if telemetry.phase == Phase::Running as u8 {
                last = sample;
            }
            if over {
                let reason = Reason::Link.code();
                ensure!(
                    telemetry.phase == Phase::Faulted as u8 && telemetry.reason == reason,
                    "sample {sample}: {telemetry:?}"
                );
                ensure!(telemetry.output == 0.0, "a torque of {} after the link's deadline", telemetry.output);
            }
        }
        ensure!(last >= 150 + (LINK / world.sampling.period) as i32 - 2, "the torque went at sample {last}");
        self.done_with_a_sample(Command::Clear)
    }

    /// A reading that jumps removes the torque at that sample.
    pub fn faults_on_a_jump(&mut self) -> Result<()> {
        let world = world("default")?;
        let hash = self.load(&world, &Limits { jump: 0.5, ..world.limits(SafetyProfile::Simulated) })?;
        self.arm(hash)?;
        let telemetry = self.feed((3.0, 0.0), false)?;
        ensure!(telemetry.phase == Phase::Faulted as u8 && telemetry.reason == Reason::Jump.code(), "{telemetry:?}");
        ensure!(telemetry.output == 0.0, "a torque of {} after a jump", telemetry.output);
        for _ in 0..20 {
            self.feed((0.0, 0.0), false)?;
        }
        self.done_with_a_sample(Command::Clear)
    }

    /// The supervisor answers with the next sample; the host is connected again.
    fn done_with_a_sample(&mut self, command: Command<'_>) -> Result<()> {
        self.ask(Command::Heartbeat)?;
        self.ask(command)?;
        let telemetry = self.feed((0.0, 0.0), false)?;
        ensure!(telemetry.phase == Phase::Disarmed as u8, "{command:?}: {telemetry:?}");
        Ok(())
    }
}
