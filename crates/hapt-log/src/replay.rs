//! The recorded inputs through today's core: are the torques the same bits?

use std::io::Read;
use std::sync::Arc;

use hapt_core::{Guarding, Watch};
use hapt_rt::{Plan, PlanState};
use hapt_sim::DesktopLoop;

use crate::Error;
use crate::log::{Inputs, Log, LoggedPlan, Sample};

/// Places of the torques among a sample's values, the same in every log.
const TORQUE: usize = 5;
const COMMAND: usize = 6;
const APPLIED: usize = 7;
/// The code of the disarmed phase.
const DISARMED: u64 = 0;

/// What came of a replay.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replay {
    /// Samples that were run again and compared.
    pub compared: u64,
    /// How many of them differ in a bit.
    pub different: u64,
    /// The first that does.
    pub first: Option<Difference>,
    /// Samples that could not be run again: the log does not say in what state the loop was.
    pub skipped: u64,
    /// Stretches of samples that were lost while recording.
    pub gaps: u64,
}

/// Two torques that should be one.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its sample, from 0.
    pub sample: u64,
    /// Its time in s.
    pub time: f64,
    /// The column in which they stand.
    pub column: String,
    /// What the log has.
    pub logged: f64,
    /// What today's core gives.
    pub replayed: f64,
}

/// Runs a log's inputs through today's core, from its first sample to its last.
///
/// A run begins in the world's state at the start. A loop in real time is in a known state at its sample 0, and while it is disarmed:
/// samples before the first of these are skipped, and so are those behind a gap.
///
/// # Errors
/// Those of reading, [`Error::World`] for a world that today's core does not take, and [`Error::NoReplay`] where no sample could be
/// compared.
pub fn replay<R: Read>(log: &mut Log<R>) -> Result<Replay, Error> {
    let mut result = Replay::default();
    match log.is_live() {
        true => live(log, &mut result)?,
        false => run(log, &mut result)?,
    }
    if result.compared == 0 {
        return Err(Error::NoReplay(format!(
            "none of its {} samples can be replayed: it has neither the loop's first sample nor two disarmed ones in a row",
            result.skipped
        )));
    }
    Ok(result)
}

impl Replay {
    fn compare(&mut self, sample: &Sample, number: u64, torques: &[(usize, f64)]) {
        self.compared += 1;
        let logged = |place: usize| sample.values.get(place).copied().unwrap_or(f64::NAN);
        let Some(&(place, replayed)) = torques.iter().find(|(place, x)| logged(*place).to_bits() != x.to_bits()) else {
            return;
        };
        self.different += 1;
        self.first.get_or_insert_with(|| Difference {
            sample: number,
            time: logged(0),
            column: sample.plan.columns.get(place).map(|column| column.name.clone()).unwrap_or_default(),
            logged: logged(place),
            replayed,
        });
    }
}

fn world_error(error: hapt_core::Error) -> Error {
    Error::World(error.to_string())
}

/// The log of a run: the loop alone, from each of its worlds' start.
fn run<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let mut running: Option<(Arc<LoggedPlan>, DesktopLoop, PlanState)> = None;
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

/// A plan at work.
struct Running {
    logged: Arc<LoggedPlan>,
    plan: Plan,
    state: PlanState,
    watch: Watch<f64>,
}

/// The log of a loop in real time: the loop behind its supervisor.
fn live<R: Read>(log: &mut Log<R>, result: &mut Replay) -> Result<(), Error> {
    let guarding = log.header.guarding;
    let mut running: Option<Running> = None;
    let mut before: Option<Inputs> = None;
    while let Some(sample) = log.next()? {
        let Some(inputs) = sample.inputs() else { continue };
        let next = |before: &Inputs| before.sample + 1 + u64::from(inputs.reading.missed);
        let follows = before.as_ref().is_some_and(|before| next(before) == inputs.sample);
        if before.is_some() && !follows {
            result.gaps += 1;
            running = None;
        }
        // A sample that begins and ends disarmed puts the world back to its start.
        let waits = follows && inputs.phase == DISARMED && before.is_some_and(|before| before.phase == DISARMED);
        if running.is_none() && (inputs.sample == 0 || waits) {
            running = Some(Running::start(sample.plan, guarding)?);
        }
        before = Some(inputs);
        match &mut running {
            None => result.skipped += 1,
            Some(running) => {
                running.change(sample.plan)?;
                let Running { plan, state, watch, .. } = running;
                let guarded = plan.step(watch, state, &inputs.reading, inputs.request);
                let torques =
                    [(TORQUE, guarded.sample.torque), (COMMAND, guarded.sample.command), (APPLIED, guarded.output)];
                result.compare(&sample, inputs.sample, &torques);
            }
        }
    }
    Ok(())
}

impl Running {
    fn start(logged: &Arc<LoggedPlan>, guarding: Guarding) -> Result<Self, Error> {
        let plan = Plan::new(&logged.world, guarding).map_err(world_error)?;
        Ok(Running { logged: Arc::clone(logged), state: plan.start(), plan, watch: Watch::START })
    }

    /// Goes on in the world of `logged`, as the loop did.
    fn change(&mut self, logged: &Arc<LoggedPlan>) -> Result<(), Error> {
        if !Arc::ptr_eq(&self.logged, logged) {
            let plan = Plan::following(&logged.world, &self.plan).map_err(world_error)?;
            self.watch.swap();
            (self.state, self.plan, self.logged) = (plan.carry(&self.state), plan, Arc::clone(logged));
        }
        Ok(())
    }
}
