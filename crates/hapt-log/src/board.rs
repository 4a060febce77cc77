//! Replay of a board's log: the loop has numbers of f32 and a small capacity, and its inputs are inferred from its phases.
//!
//! Telemetry contains neither the requests to the board's supervisor nor the lateness of a sample: [`inputs`] infers them from the
//! phases before and after. A disarmed world stays at its start, so that the replay can begin at every arming.

use std::io::Read;

use hapt_core::{Controller, ControllerState, Phase, Reading, Reason, Request, SafetyProfile, WhenLate};

use crate::Error;
use crate::comparison::{Replay, world_error};
use crate::log::{Log, LoggedPlan};
use crate::schema::{COMMAND, TORQUE};

/// The capacity of a board: bodies, couplings, stored counts (docs/wire.md).
const B: usize = 4;
const C: usize = 8;
const W: usize = 17;

/// The prefix of a board's device name.
const BOARD: &str = "hapt:";

/// A lateness, and a time since the last heartbeat, beyond every limit.
const TOO_LATE: f64 = f32::MAX as f64;

/// The inputs of a board's supervisor at a sample: the request, the lateness, and the time since the last heartbeat, in s; from the phase
/// before it and from the phase and reason after it.
pub fn inputs(before: Phase, after: Phase, reason: Option<Reason>) -> (Option<Request>, f64, f64) {
    use Phase::{Disarmed, FadingIn, FadingOut, Faulted, Running};
    let lost = reason == Some(Reason::Link);
    // An automatic fade: by a lost link, or after a sample that was too late for the certificate.
    let by_itself = lost || reason == Some(Reason::Uneven);
    let request = match (before, after) {
        (_, Faulted) if reason == Some(Reason::Stop) && before != Faulted => Some(Request::Stop),
        // Arming failed: the motor's driver has a fault.
        (Disarmed, Faulted) if reason == Some(Reason::Driver) => None,
        (Disarmed, FadingIn | Running | Faulted) | (FadingOut, FadingIn | Running) => Some(Request::Arm),
        (FadingIn | Running, FadingOut | Disarmed) if !by_itself => Some(Request::Disarm),
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

/// A running loop of a board.
struct Running {
    /// The number of its plan.
    plan: u32,
    controller: Controller<f32, B, C, W>,
    state: ControllerState<f32, B, C, W>,
}

impl Running {
    fn start(logged: &LoggedPlan, profile: SafetyProfile) -> Result<Box<Self>, Error> {
        let controller =
            Controller::new(&logged.world.spec(), &logged.world.board_limits(profile)).map_err(world_error)?;
        let state = controller.start();
        Ok(Box::new(Running { plan: logged.number, controller, state }))
    }
}

/// Replays it from every arming on, as long as samples are consecutive.
pub(crate) fn replay<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let profile = log.header.profile;
    let mut running: Option<Box<Running>> = None;
    let mut next = None;
    let mut consecutive = 0;
    while let Some(sample) = log.next()? {
        let Some(inputs) = sample.inputs() else { continue };
        let Reading { position, velocity, announced, late, missed, silent } = inputs.reading;
        let first = inputs.sample.saturating_sub(u64::from(missed));
        if next.is_some_and(|next| next != first) {
            result.gaps += 1;
            running = None;
        } else {
            consecutive += 1;
        }
        next = Some(inputs.sample + 1);
        // A board changes its world only while it is disarmed.
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
        // A fault of the board's driver is not part of a reading.
        if state.supervisor.phase != Phase::Faulted && inputs.reason == u64::from(Reason::Driver.code()) {
            state.trip(Reason::Driver);
        }
        // The times of its samples are no part of a reading either.
        if inputs.reason == u64::from(Reason::Uneven.code()) && state.supervisor.reason != Some(Reason::Uneven) {
            let faults = inputs.phase == Phase::Faulted as u64;
            state.supervisor.lapse(if faults { WhenLate::Fault } else { WhenLate::Fade });
        }
        let guarded = controller.step(state, &reading, inputs.request);
        let output = sample.plan.live_columns();
        let torques = [(TORQUE, guarded.sample.torque), (COMMAND, guarded.sample.command), (output, guarded.output)];
        result.compare(&sample, inputs.sample, &torques.map(|(place, torque)| (place, f64::from(torque))));
    }
    // Few consecutive samples: telemetry was set to every nth one.
    if result.gaps > consecutive {
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
    fn a_boards_requests_follow_from_its_phases() {
        use Phase::{Disarmed, FadingIn, FadingOut, Faulted, Running};
        let request = |before, after, reason| inputs(before, after, reason).0;
        assert_eq!(request(Disarmed, FadingIn, None), Some(Request::Arm));
        assert_eq!(request(Disarmed, Faulted, Some(Reason::Jump)), Some(Request::Arm));
        assert_eq!(request(Disarmed, Faulted, Some(Reason::Driver)), None);
        assert_eq!(request(Running, Faulted, Some(Reason::Driver)), None);
        assert_eq!(request(FadingOut, FadingIn, None), Some(Request::Arm));
        assert_eq!(request(Running, FadingOut, None), Some(Request::Disarm));
        assert_eq!(request(Running, Faulted, Some(Reason::Stop)), Some(Request::Stop));
        assert_eq!(request(Faulted, Disarmed, None), Some(Request::Clear));
        for (before, after, reason) in
            [(FadingIn, Running, None), (FadingOut, Disarmed, None), (Running, Faulted, Some(Reason::Slew))]
        {
            assert_eq!(inputs(before, after, reason), (None, 0.0, 0.0));
        }
        // No request: a lost link or a late sample removed the torque.
        assert_eq!(inputs(Running, FadingOut, Some(Reason::Link)), (None, 0.0, TOO_LATE));
        assert_eq!(inputs(Running, Faulted, Some(Reason::Link)), (None, 0.0, TOO_LATE));
        assert_eq!(inputs(Running, Faulted, Some(Reason::Late)), (None, TOO_LATE, 0.0));
        for after in [FadingOut, Faulted, Disarmed] {
            assert_eq!(inputs(FadingIn, after, Some(Reason::Uneven)), (None, 0.0, 0.0));
        }
    }
}
