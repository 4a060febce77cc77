//! The loop in the timer's interrupt, in the emulator's time: every instruction takes 32 ns of it.

use anyhow::{Context, Result, ensure};
use hapt_core::{Limits, Phase, SafetyProfile};
use hapt_model::EstimatorKind;
use hapt_wire::{Command, DeviceMessage, Parameter};

use super::line::{BOARD_TIMEOUT, Board};
use super::{Extent, has_tools, program};
use crate::notes::world;

const ICOUNT: [&str; 2] = ["-icount", "shift=5,sleep=off"];
/// Ticks of the board's clock in a period of 0.1 ms.
const PERIOD: u32 = 2500;
/// Three seconds, and half a minute.
const SHORT: u64 = 30_000;
const FULL: u64 = 300_000;
/// The sample that takes too long, in the program that then stops.
const SLOW: u64 = 2000;

/// A run at 10 kHz without a sample that takes longer than its period, or comes late.
pub fn holds(extent: Extent) -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    let samples = if extent == Extent::Full { FULL } else { SHORT };
    let program = program("mps2", "wheel", None)?;
    let mut board = Board::start("mps2-an386", &program, &ICOUNT, false)?;
    let mut wheel = world("released")?;
    wheel.sampling.estimator = EstimatorKind::Difference;
    // A sample that comes half a period late is a fault.
    let limits = Limits { stall: 0.5e-4, ..wheel.limits(SafetyProfile::Simulated) };
    let hash = board.load(&wheel, &limits)?;
    board.done(Command::Set { parameter: Parameter::Divider as u8, value: 10_000 })?;
    board.done(Command::Set { parameter: Parameter::MostUsed as u8, value: 0 })?;
    board.done(Command::Arm { world: hash })?;
    let start = board.sample;
    let mut shown = 0;
    while board.sample < start + samples {
        let message = board.receive(BOARD_TIMEOUT, |message| match message {
            DeviceMessage::Telemetry(telemetry) => Some(telemetry),
            _ => None,
        })?;
        let telemetry = message.context("no telemetry")?;
        ensure!(telemetry.phase == Phase::Running as u8 || shown == 0, "{telemetry:?}");
        ensure!(telemetry.missed == 0, "{telemetry:?}");
        board.sample = telemetry.sample;
        shown += 1;
    }
    let sequence_sent = board.ask(Command::Get { parameter: Parameter::MostUsed as u8 })?;
    let most = board.receive(BOARD_TIMEOUT, |message| match message {
        DeviceMessage::Value { sequence, value, .. } if sequence == sequence_sent => Some(value),
        _ => None,
    })?;
    let most = most.context("no answer to what a sample has taken")?;
    println!("        mps2-an386 at 10 kHz: {samples} samples, the longest interrupt {most} of {PERIOD} clocks");
    ensure!(most > 0 && most < PERIOD, "an interrupt took {most} clocks of {PERIOD}");
    Ok(())
}

/// A sample that once takes more than five periods: the four that pass are counted as missed. Then a loop that stops: the watchdog resets
/// the board. A running loop is not reset, as [`holds`] shows.
pub fn counts_and_watches() -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    let program = program("mps2", "wheel-that-stops", None)?;
    let off = [ICOUNT[0], ICOUNT[1], "-action", "watchdog=poweroff"];
    let mut board = Board::start("mps2-an386", &program, &off, false)?;
    board.done(Command::Set { parameter: Parameter::Divider as u8, value: 100 })?;
    let mut missed = None;
    let ended = board.receive(BOARD_TIMEOUT, |message| {
        if let DeviceMessage::Telemetry(telemetry) = message
            && telemetry.sample > SLOW
        {
            missed = Some(telemetry.missed);
        }
        None::<()>
    });
    ensure!(missed == Some(4), "after a sample of more than five periods {missed:?} are missed, which should be 4");
    ensure!(ended.is_err() && board.has_ended()?, "the loop stopped, and the watchdog did nothing");
    Ok(())
}
