//! The loop sample by sample, without a clock.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hapt_core::{Phase, Reading, Request, SafeOutput};

use crate::pace::Pace;
use crate::plan::PlanState;
use crate::{BODIES, Device, Failure, Outside, Plan, Record, Snapshot};

/// The time of a sample by the caller's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// The sample's instant in ns from the start; only the record shows it.
    pub due: u64,
    /// When the sample is taken, in ns by the clock of the links.
    pub now: u64,
    /// The lateness of the sample, in s.
    pub late: f64,
    /// Periods since the last sample: 1, or more when samples were missed; 0 at the first.
    pub periods: u32,
    /// Time since the last heartbeat of the client in control, in s; 0 without a link.
    pub silent: f64,
}

/// The loop on its device, sample after sample, for any thread and any clock: [`crate::Engine`]'s, a test's, a campaign's.
///
/// A sample is [`Cycle::pass`], then [`Cycle::swap`] where the world changes, then [`Cycle::sample`], then [`Cycle::commanded`] where there is
/// a clock. Dropped, it leaves no torque on.
///
/// ```
/// use hapt_core::{Phase, Request, SafetyProfile};
/// use hapt_model::{Source, World};
/// use hapt_rt::{Cycle, Moment, Plan, SimulatedDevice};
///
/// let file = "loop.period = \"1 ms\"\ndevice.inertia = \"6.4e-4 kg m^2\"\n";
/// let world = World::read(&Source::from_text("free.toml", file), &[])?;
/// let (device, _hands) = SimulatedDevice::new(&world);
/// let mut cycle = Cycle::new(Box::new(Plan::new(&world, SafetyProfile::Simulated)?), Box::new(device));
/// let mut phase = Phase::Disarmed;
/// for sample in 0..2000 {
///     let periods = u32::from(sample > 0);
///     cycle.pass(periods);
///     let request = (sample == 20).then_some(Request::Arm);
///     phase = cycle.sample(&Moment { periods, ..Moment::default() }, request)?.phase;
/// }
/// assert_eq!(phase, Phase::Running);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Cycle {
    plan: Box<Plan>,
    device: Safe,
    state: PlanState,
    sample: u64,
    swaps: u32,
    outside: Outside,
    /// With links: whether the computer is too slow for the loop, which nothing else reports where all stations run on it.
    pace: Pace,
}

/// A device whose torque is set to 0 when it is dropped, also after a panic.
struct Safe(Box<dyn Device>);

impl Drop for Safe {
    fn drop(&mut self) {
        // A second panic while unwinding would abort the process.
        let _ = catch_unwind(AssertUnwindSafe(|| self.0.write(0.0)));
    }
}

impl Cycle {
    /// `plan` on `device`, disarmed.
    pub fn new(mut plan: Box<Plan>, mut device: Box<dyn Device>) -> Self {
        plan.reserve();
        device.adopt(&mut plan);
        let state = plan.start();
        Cycle {
            plan,
            device: Safe(device),
            state,
            sample: 0,
            swaps: 0,
            outside: Outside::default(),
            pace: Pace::default(),
        }
    }

    /// The same loop with external torques, which stay when the world changes.
    pub fn with_outside(self, outside: Outside) -> Self {
        Cycle { outside, ..self }
    }

    /// T in s.
    pub fn period(&self) -> f64 {
        self.plan.period()
    }

    /// Advances by periods: 1 between two samples, more when samples were missed; none before the first.
    pub fn pass(&mut self, periods: u32) {
        if periods > 0 {
            self.sample += u64::from(periods);
            self.device.0.passed(periods);
            self.plan.hold(periods, self.state.supervisor.output);
        }
    }

    /// Copies the loop's state before its next sample. Allocates nothing.
    pub fn snapshot(&self, into: &mut Snapshot) {
        *into = Snapshot { sample: self.sample, plan: self.swaps, state: self.state };
    }

    /// Replaces the world from this sample on; returns the previous plan. Bodies keep the states that [`Plan::following`] matched, or begin at
    /// their start where the puck enters it ([`crate::Change`]); the torque fades over. Allocates nothing.
    pub fn swap(&mut self, mut plan: Box<Plan>) -> Box<Plan> {
        self.state = plan.transfer(&self.plan, &self.state);
        plan.motor.follow(&self.plan.motor);
        self.device.0.adopt(&mut plan);
        self.swaps += 1;
        std::mem::replace(&mut self.plan, plan)
    }

    /// Sets the delay in ns after which the device has received the command of the last sample. The supervisor evaluates it at the next sample.
    pub fn commanded(&mut self, delay: u32) {
        self.state.commanded(f64::from(delay) / 1e9);
    }

    /// Takes the sample. Errors where the device fails, or where a loop with links does not keep its period; its torque is then set to 0.
    pub fn sample(&mut self, moment: &Moment, request: Option<Request>) -> Result<Record, Failure> {
        let record = self.guarded(moment, request).and_then(|record| self.keeps_pace(moment, record));
        if record.is_err() {
            let _ = self.device.0.write(0.0);
        }
        record
    }

    /// The samples that the computer missed count, not the stale readings of a drive.
    fn keeps_pace(&mut self, moment: &Moment, record: Record) -> Result<Record, Failure> {
        if self.outside.links.is_empty() {
            return Ok(record);
        }
        let missed = moment.periods.saturating_sub(1);
        self.pace.add(self.plan.period(), missed).map_or(Ok(record), |missed| Err(Failure::Slow(missed)))
    }

    fn guarded(&mut self, moment: &Moment, request: Option<Request>) -> Result<Record, Failure> {
        let position = self.device.0.read()?;
        let reading = Reading {
            position: position.position,
            velocity: position.velocity,
            announced: position.announced,
            late: moment.late,
            missed: moment.periods.saturating_sub(1).saturating_add(self.device.0.missed()),
            silent: moment.silent,
        };
        let Cycle { plan, device, state, outside, .. } = self;
        let (before, enters) = (state.supervisor.offset, state.supervisor.enters());
        let mut link = 0.0;
        // One path for both in the page, which keeps its program small.
        let guarded = if outside.is_none() && !cfg!(target_family = "wasm") {
            plan.step(state, &reading, request)
        } else {
            plan.step_with(state, &reading, request, |input| {
                let torque = (!outside.is_none()).then(|| outside.sample(input, moment.now));
                link = torque.unwrap_or(0.0);
                torque
            })
        };
        let SafeOutput { sample, output, phase, reason, warning, outside: _ } = guarded;
        let zero = state.supervisor.offset;
        // Where the origin slips while the puck rests, the hand that holds the puck stays in its place.
        if zero != before && (enters || phase != Phase::Running) {
            device.0.homed(zero);
        }
        device.0.write(output)?;
        plan.motor.command(output);
        let applied = device.0.applied().unwrap_or(plan.motor.applied);
        let mut bodies = [(0.0, 0.0); BODIES];
        let now = &self.state.world.now;
        for (place, state) in
            bodies.iter_mut().zip(now.position.iter().zip(&now.velocity)).take(plan.controller.world().bodies())
        {
            *place = (*state.0, *state.1);
        }
        Ok(Record {
            sample: self.sample,
            due: moment.due,
            plan: self.swaps,
            position: reading.position,
            velocity: reading.velocity,
            zero,
            announced: reading.announced,
            late: reading.late,
            missed: reading.missed,
            silent: reading.silent,
            request,
            measured: sample.puck.position,
            measured_velocity: sample.puck.velocity,
            torque: sample.torque,
            link,
            command: sample.command,
            output,
            applied,
            phase,
            reason,
            warning,
            latency: u32::try_from((moment.late * 1e9).round() as u64).unwrap_or(u32::MAX),
            computation: u32::try_from((device.0.age() * 1e9).round() as u64).unwrap_or(u32::MAX),
            outside: self.state.supervisor.outside(),
            bodies,
        })
    }
}
