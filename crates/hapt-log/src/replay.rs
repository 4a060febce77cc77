//! Replay: runs the recorded inputs through the present core and compares the bits of the torques.

use std::io::Read;
use std::sync::Arc;

use hapt_core::SafetyProfile;
use hapt_rt::{Plan, PlanState, Snapshot};
use hapt_sim::{DesktopLoop, DesktopState};

use crate::comparison::{Replay, world_error};
use crate::log::{Inputs, Log, LoggedPlan};
use crate::schema::{COMMAND, TORQUE};
use crate::{Error, board};

/// Runs a log's inputs through the present core, from its first sample to its last.
///
/// A run begins in the world's state at the start. The state of a loop in real time is known at its sample 0, and where the log has a
/// snapshot of it: samples before the first of these are skipped, and so are those after a gap.
///
/// # Errors
/// Those of reading, [`Error::World`] for a world that the present core refuses, and [`Error::NoReplay`] where no sample could be
/// compared.
pub fn replay<R: Read>(log: &mut Log<R>) -> Result<Replay, Error> {
    let mut result = Replay::default();
    match log.is_live() {
        true if board::is_boards(log) => board::replay(log, &mut result)?,
        true => live(log, &mut result)?,
        false => run(log, &mut result)?,
    }
    if result.compared == 0 {
        return Err(Error::NoReplay(format!(
            "none of its {} samples can be replayed: it has neither the loop's first sample nor its \
             state at a later one",
            result.skipped
        )));
    }
    Ok(result)
}

/// The log of a run: the loop without a supervisor, from the start of each of its worlds.
fn run<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let mut running: Option<(Arc<LoggedPlan>, DesktopLoop, DesktopState)> = None;
    while let Some(sample) = log.next()? {
        let (_, world, state) = match &mut running {
            Some(running) if Arc::ptr_eq(&running.0, sample.plan) => running,
            _ => {
                let world = DesktopLoop::new(&sample.plan.world.spec()).map_err(world_error)?;
                running.insert((Arc::clone(sample.plan), world, world.start()))
            }
        };
        let at = |place: usize| sample.values.get(place).copied().unwrap_or(f64::NAN);
        let now = world.step(state, at(1), at(2));
        result.compare(&sample, result.compared, &[(TORQUE, now.torque), (COMMAND, now.command)]);
    }
    Ok(())
}

/// A running plan.
struct Running {
    logged: Arc<LoggedPlan>,
    /// Boxed, as a plan is large for a stack.
    plan: Box<Plan>,
    state: PlanState,
}

/// The log of a loop in real time: the loop behind its supervisor.
fn live<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let profile = log.header.profile;
    let mut running: Option<Box<Running>> = None;
    let mut before: Option<Inputs> = None;
    while let Some(sample) = log.next()? {
        let Some(inputs) = sample.inputs() else { continue };
        // A reading may count as missed although its sample was taken: it was stale.
        let next = |before: &Inputs| before.sample + 1..=before.sample + 1 + u64::from(inputs.reading.missed);
        let follows = before.as_ref().is_some_and(|before| next(before).contains(&inputs.sample));
        if before.is_some() && !follows {
            result.gaps += 1;
            running = None;
        }
        if running.is_none() && (sample.snapshot.is_some() || inputs.sample == 0) {
            running = Some(Box::new(Running::start(sample.plan, profile, sample.snapshot)?));
        }
        // The first column after those of a run.
        let output = sample.plan.live_columns();
        before = Some(inputs);
        match &mut running {
            None => result.skipped += 1,
            Some(running) => {
                running.change(sample.plan)?;
                let Running { plan, state, .. } = &mut **running;
                let guarded = plan.step_with(state, &inputs.reading, inputs.request, |_| inputs.link);
                state.commanded(inputs.computation);
                let torques =
                    [(TORQUE, guarded.sample.torque), (COMMAND, guarded.sample.command), (output, guarded.output)];
                result.compare(&sample, inputs.sample, &torques);
            }
        }
    }
    Ok(())
}

impl Running {
    /// Starts from a snapshot, or else from the world's start, disarmed.
    fn start(logged: &Arc<LoggedPlan>, profile: SafetyProfile, from: Option<&Snapshot>) -> Result<Self, Error> {
        let plan = Plan::new(&logged.world, profile).map(Box::new).map_err(world_error)?;
        let state = from.map_or_else(|| plan.start(), |from| from.state);
        Ok(Running { logged: Arc::clone(logged), plan, state })
    }

    /// Changes to the world of `logged`, as the loop did.
    fn change(&mut self, logged: &Arc<LoggedPlan>) -> Result<(), Error> {
        if !Arc::ptr_eq(&self.logged, logged) {
            let plan = Plan::replacing(&logged.world, &self.plan, logged.change).map(Box::new).map_err(world_error)?;
            (self.state, self.plan, self.logged) = (plan.transfer(&self.plan, &self.state), plan, Arc::clone(logged));
        }
        Ok(())
    }
}
