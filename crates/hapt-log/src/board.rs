//! The log of a board, replayed: its loop is one of f32 in a small room, and what it was told is what its phases show.
//!
//! Telemetry does not say what the board's supervisor was told at a sample, or how late the sample was: [`told`] says it from the phases on
//! either side. A disarmed world stands at its start, so that the replay can begin wherever it was armed.

use std::io::Read;

use hapt_core::{Controller, ControllerState, Phase, Reading, Reason, Request, SafetyProfile};

use crate::Error;
use crate::log::{Log, LoggedPlan};
use crate::replay::{Replay, world_error};
use crate::schema::{COMMAND, LIVE_COLUMNS, TORQUE};

/// The board's room: bodies, couplings, remembered counts (docs/wire.md).
const B: usize = 4;
const C: usize = 8;
const W: usize = 17;

/// How a log's device begins that is a board.
const BOARD: &str = "hapt:";

/// Later, and longer silent, than any limit.
const TOO_LATE: f64 = f32::MAX as f64;

/// What a board's supervisor must have been told at a sample: its request, how late it was, and how long nobody had been heard, in s; from
/// the phase before it and from the phase and reason after it.
pub fn told(before: Phase, after: Phase, reason: Option<Reason>) -> (Option<Request>, f64, f64) {
    use Phase::{Disarmed, FadingIn, FadingOut, Faulted, Running};
    let lost = reason == Some(Reason::Link);
    let request = match (before, after) {
        (_, Faulted) if reason == Some(Reason::Stop) && before != Faulted => Some(Request::Stop),
        // It was not armed: its motor's driver has a fault.
        (Disarmed, Faulted) if reason == Some(Reason::Driver) => None,
        (Disarmed, FadingIn | Running | Faulted) | (FadingOut, FadingIn | Running) => Some(Request::Arm),
        (FadingIn | Running, FadingOut | Disarmed) if !lost => Some(Request::Disarm),
        (Faulted, Disarmed) => Some(Request::Clear),
        _ => None,
    };
    let ended = before.is_active() && before != after;
    let late = if ended && reason == Some(Reason::Late) { TOO_LATE } else { 0.0 };
    let silent = if ended && lost && before != FadingOut { TOO_LATE } else { 0.0 };
    (request, late, silent)
}

/// Whether the log is a board's.
pub(crate) fn is_boards<R>(log: &Log<R>) -> bool {
    log.header.device.starts_with(BOARD)
}

/// A board's loop at work.
struct Running {
    /// Its plan's number.
    plan: u32,
    controller: Controller<f32, B, C, W>,
    state: ControllerState<f32, B, C, W>,
}

impl Running {
    fn start(logged: &LoggedPlan, profile: SafetyProfile) -> Result<Box<Self>, Error> {
        let controller = Controller::new(&logged.world.spec(), &logged.world.limits(profile)).map_err(world_error)?;
        let state = controller.start();
        Ok(Box::new(Running { plan: logged.number, controller, state }))
    }
}

/// Replays it from every sample on at which it was armed, as far as samples follow one another.
pub(crate) fn replay<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let profile = log.header.profile;
    let mut running: Option<Box<Running>> = None;
    let mut next = None;
    while let Some(sample) = log.next()? {
        let Some(inputs) = sample.inputs() else { continue };
        let Reading { position, velocity, announced, late, missed, silent } = inputs.reading;
        let first = inputs.sample.saturating_sub(u64::from(missed));
        if next.is_some_and(|next| next != first) {
            result.gaps += 1;
            running = None;
        }
        next = Some(inputs.sample + 1);
        // A board takes another world only while it is disarmed.
        running = running.filter(|running| running.plan == sample.plan.number);
        if running.is_none() && inputs.request == Some(Request::Arm) {
            running = Some(Running::start(sample.plan, profile)?);
        }
        let Some(running) = &mut running else {
            result.skipped += 1;
            continue;
        };
        let reading = Reading {
            position: position as f32,
            velocity: velocity as f32,
            announced,
            late: late as f32,
            missed,
            silent: silent as f32,
        };
        let Running { controller, state, .. } = &mut **running;
        // What the board's own driver has reported is in no reading.
        if state.supervisor.phase != Phase::Faulted && inputs.reason == u64::from(Reason::Driver.code()) {
            state.trip(Reason::Driver);
        }
        let guarded = controller.step(state, &reading, inputs.request);
        let output = sample.values.len() - LIVE_COLUMNS;
        let torques = [(TORQUE, guarded.sample.torque), (COMMAND, guarded.sample.command), (output, guarded.output)];
        result.compare(&sample, inputs.sample, &torques.map(|(place, torque)| (place, f64::from(torque))));
    }
    // Not even two samples in a row: the board was asked for every so many.
    if result.gaps > 0 && result.compared <= result.gaps {
        return Err(Error::NoReplay(
            "a board's log can be replayed only where every sample is in it, and this one skips some between each two: record it over a \
             faster line (hapt:PATH@BAUD), or with a longer loop.period"
                .into(),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_board_was_told_follows_from_its_phases() {
        use Phase::{Disarmed, FadingIn, FadingOut, Faulted, Running};
        let asked = |before, after, reason| told(before, after, reason).0;
        assert_eq!(asked(Disarmed, FadingIn, None), Some(Request::Arm));
        assert_eq!(asked(Disarmed, Faulted, Some(Reason::Jump)), Some(Request::Arm));
        assert_eq!(asked(Disarmed, Faulted, Some(Reason::Driver)), None);
        assert_eq!(asked(Running, Faulted, Some(Reason::Driver)), None);
        assert_eq!(asked(FadingOut, FadingIn, None), Some(Request::Arm));
        assert_eq!(asked(Running, FadingOut, None), Some(Request::Disarm));
        assert_eq!(asked(Running, Faulted, Some(Reason::Stop)), Some(Request::Stop));
        assert_eq!(asked(Faulted, Disarmed, None), Some(Request::Clear));
        for (before, after, reason) in
            [(FadingIn, Running, None), (FadingOut, Disarmed, None), (Running, Faulted, Some(Reason::Slew))]
        {
            assert_eq!(told(before, after, reason), (None, 0.0, 0.0));
        }
        // Nobody asked for a torque that a lost link or a late sample took away.
        assert_eq!(told(Running, FadingOut, Some(Reason::Link)), (None, 0.0, TOO_LATE));
        assert_eq!(told(Running, Faulted, Some(Reason::Link)), (None, 0.0, TOO_LATE));
        assert_eq!(told(Running, Faulted, Some(Reason::Late)), (None, TOO_LATE, 0.0));
    }
}
