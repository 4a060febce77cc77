//! The experiment: steps and a chirp of a small torque, applied through the loop and its supervisor.
//!
//! Each push is a world of its own, with one constant torque on the puck and nothing else; a swap fades it over to the next. The chirp is
//! made of pushes too short to be held. Nothing in it depends on the position, so that it stays the same when the motor's sign or the
//! encoder's counts are wrong.

use std::io::{BufRead, IsTerminal, Write, stderr, stdin};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Request, SafetyProfile};
use hapt_host::DeviceAddress;
use hapt_identify::{Bounds, Record};
use hapt_log::{Header, Recorder};
use hapt_model::keys::Measure;
use hapt_model::{Coupling, End, EstimatorKind, Law, Motion, World};
use hapt_rt::{Change, End as LoopEnd, Engine, Failure as DeviceFailure, LoopCommand, Plan};

use super::{Given, positive};
use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::latency::{LOOK, plan, settings, time};
use crate::log::Recording;
use crate::{format, messages, signals};

/// The polling period of records.
const MOMENT: Duration = Duration::from_millis(20);
/// The part of the motor's limit, without --torque.
const PART: f64 = 0.1;
/// The experiment uses this part of the speed at which the supervisor removes the torque.
const CALM: f64 = 0.5;

/// The records of the loop.
#[derive(Default)]
struct Seen {
    times: Vec<f64>,
    /// As the device gave them.
    positions: Vec<f64>,
    torques: Vec<f64>,
}

pub fn experiment(args: &IdentifyArgs, device: &DeviceAddress, world: Option<World>) -> Result<Given, Failure> {
    if let Some(flag) =
        [("--columns", args.columns.is_some()), ("--spring", args.spring.is_some()), ("--coast", args.coast)]
            .into_iter()
            .find_map(|(flag, is_there)| is_there.then_some(flag))
    {
        return Err(Failure::input(format!("{flag} is for logs; {} is a device", args.what)));
    }
    let mut world = world.ok_or_else(|| {
        Failure::input("a device needs --world FILE.toml: its period, its limits, and what is known of it so far")
    })?;
    if matches!(device, DeviceAddress::Replay(_)) {
        return Err(Failure::input("a recording does not respond to torque; pass the log itself to hapt identify"));
    }
    if !device.overrides(&world)?.is_empty() {
        world.sampling.estimator = EstimatorKind::Difference;
    }
    let torque = torque(args, &world)?;
    let duration = time("--duration", &args.duration)?;
    if !(1.0..=60.0).contains(&duration) {
        return Err(Failure::input(format!("--duration: {} is not within 1 s and 60 s", format::time(duration))));
    }
    if device.has_motor() && !args.yes {
        ask(&args.what, &world, torque, duration)?;
    }
    let seen = Experiment::start(args, device, &world, torque)?.run(duration)?;
    let positions = match device.has_motor() {
        true => seen.positions,
        false => seen.positions.into_iter().map(|position| counted(&world, position)).collect(),
    };
    let name = args.what.clone();
    let record = Record::new(seen.times, positions, seen.torques).map_err(|error| {
        Failure::input(format!(
            "{name}: {error}; --torque would need more than {}",
            format::effort(torque, world.motion)
        ))
    })?;
    Ok(Given { name, record, motion: world.motion, world: Some(world), back_damping: 0.0 })
}

/// The position of a simulated puck as an encoder on it counts: by the device's own 0, which arming does not move, and before any filter of
/// the loop.
pub fn counted(world: &World, position: f64) -> f64 {
    world.count().map_or(position, |count| (position / count).round() * count)
}

fn torque(args: &IdentifyArgs, world: &World) -> Result<f64, Failure> {
    let limit = world.device.limit.unwrap_or(f64::INFINITY);
    let torque = match &args.torque {
        Some(text) => positive("--torque", text, Measure::Torque, world.motion)?,
        None if limit.is_finite() => PART * limit,
        None => return Err(Failure::input("the world has no device.limit to take a tenth of: pass --torque Q")),
    };
    if torque > limit {
        let limit = format::effort(limit, world.motion);
        return Err(Failure::input(format!("--torque: it is above the world's device.limit, {limit}")));
    }
    Ok(torque)
}

/// The limits of the experiment, within the world's own safety limits.
fn bounds(world: &World, torque: f64) -> Bounds {
    let is_linear = world.motion == Motion::Linear;
    let safety = &world.safety;
    let torque = torque.min(safety.torque.unwrap_or(f64::INFINITY));
    let mut bounds = Bounds::new(torque, world.device.inertia, world.sampling.period, is_linear);
    for limit in [safety.velocity, safety.overspeed].into_iter().flatten() {
        bounds.speed = bounds.speed.min(CALM * limit);
    }
    bounds
}

/// Asks for confirmation before any motion.
fn ask(what: &str, world: &World, torque: f64, duration: f64) -> Result<(), Failure> {
    if !stdin().is_terminal() {
        return Err(Failure::input(format!("{what} will move: pass --yes when everyone is clear of it")));
    }
    let bounds = bounds(world, torque);
    let (torque, duration) = (format::effort(bounds.torque, world.motion), format::time(duration));
    let chirp = bounds
        .chirp()
        .map_or(String::new(), |(low, high)| format!(", by steps and a chirp from {low:.1} to {high:.1} Hz,"));
    messages::say(format_args!(
        "{what} will be pushed to and fro{chirp} by up to {torque} for {duration}, and may turn far."
    ));
    let _ = write!(stderr(), "Hands off, nothing in its way? Go on? [y/N] ");
    let mut answer = String::new();
    let _ = stdin().lock().read_line(&mut answer);
    match answer.trim() {
        "y" | "Y" | "yes" => Ok(()),
        _ => Err(Failure::input("not moved")),
    }
}

struct Experiment {
    engine: Engine,
    recorder: Option<Recorder>,
    /// Without bodies and couplings.
    bare: World,
    last: Plan,
    /// Number of worlds before the one that runs.
    plans: u32,
    bounds: Bounds,
    seen: Seen,
    is_running: bool,
}

impl Experiment {
    fn start(args: &IdentifyArgs, device: &DeviceAddress, world: &World, torque: f64) -> Result<Self, Failure> {
        let mut bare = world.clone();
        bare.title = None;
        (bare.names, bare.bodies, bare.couplings, bare.scenarios) = Default::default();
        let bounds = bounds(world, torque);
        (bare.safety.fade, bare.safety.torque) = (bounds.fade, Some(bounds.torque));
        // A constant torque is safe with either sign, which is unknown here; and it may be smaller than the friction.
        (bare.safety.pulse, bare.safety.stuck) = (Some(0.0), Some(0.0));
        let profile = if device.has_motor() { SafetyProfile::Certified } else { SafetyProfile::Simulated };
        let settings = settings(&args.realtime, world)?;
        let first = plan(&bare, profile)?;
        let header = || Header { world_text: bare.to_toml(), device: args.what.clone(), profile, ..Header::default() };
        let recording = Recording::start(args.log.as_deref(), &bare, header)?;
        // Before anything can hold a torque: a signal removes it first, and no message blocks the program.
        signals::end_in_order();
        let opened = device.open(world)?;
        messages::notes(&opened.notes);
        let engine = Engine::start_with(first.clone(), opened.device, settings)?;
        let handle = engine.handle().clone();
        signals::stop_with(move || handle.end());
        let recorder = recording.map(Recording::begin).transpose()?.map(hapt_host::Recording::into_recorder);
        for warning in &engine.realtime().warnings {
            messages::say(format_args!("warning: {warning}"));
        }
        Ok(Experiment {
            engine,
            recorder,
            bare,
            last: first,
            plans: 0,
            bounds,
            seen: Seen::default(),
            is_running: false,
        })
    }

    /// Arms, pushes for `duration` s, disarms.
    fn run(mut self, duration: f64) -> Result<Seen, Failure> {
        self.send(LoopCommand::Request(Request::Arm))?;
        while !self.is_running {
            self.wait(LOOK.as_secs_f64())?;
        }
        let done = self.pushes(duration);
        let _ = self.send(LoopCommand::Request(Request::Disarm));
        let faded = done.and_then(|()| self.wait(4.0 * self.bare.safety.fade + 0.05));
        self.engine.end();
        let logged = self.recorder.take().map(|recorder| recorder.finish());
        faded?;
        if let Some(logged) = logged {
            let logged = logged.map_err(|error| Failure::System(format!("the log has ended early: {error}")))?;
            messages::say(format_args!("wrote {}", logged.path.display()));
        }
        Ok(self.seen)
    }

    fn pushes(&mut self, duration: f64) -> Result<(), Failure> {
        let started = Instant::now();
        let mut until = 0.0;
        for push in self.bounds.pushes(duration) {
            until += push.length;
            // Pushes that were missed while the machine stood still are left out, so that the experiment ends on time.
            let left = until - started.elapsed().as_secs_f64();
            if left > 0.0 {
                self.push(push.torque)?;
                self.wait(left)?;
            }
        }
        self.push(0.0)
    }

    /// Applies this torque from now on.
    fn push(&mut self, torque: f64) -> Result<(), Failure> {
        let mut world = self.bare.clone();
        world.couplings =
            vec![Coupling { first: End::Puck, second: End::Ground, law: Law::Constant { torque }, limit: None }];
        self.last = Plan::following(&world, &self.last).map_err(Failure::input)?;
        self.plans += 1;
        if let Some(recorder) = &self.recorder {
            recorder.plan(self.plans, &world, Change::Follows);
        }
        self.send(LoopCommand::Swap(Box::new(self.last.clone())))
    }

    fn send(&mut self, command: LoopCommand) -> Result<(), Failure> {
        self.engine.send(command).map_err(|_| Failure::System("the loop takes no commands".into()))
    }

    /// Runs for this many s, and reads the records.
    fn wait(&mut self, seconds: f64) -> Result<(), Failure> {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        loop {
            let left = until.saturating_duration_since(Instant::now());
            std::thread::sleep(left.min(MOMENT));
            self.look()?;
            if left.is_zero() {
                return Ok(());
            }
        }
    }

    /// Reads the records.
    fn look(&mut self) -> Result<(), Failure> {
        let ended = self.engine.ended();
        while let Ok(record) = self.engine.records.pop() {
            if let Some(recorder) = &self.recorder {
                recorder.send(&record);
            }
            self.is_running |= record.phase == Phase::Running;
            self.seen.times.push(record.due as f64 * 1e-9);
            self.seen.positions.push(record.position);
            self.seen.torques.push(record.output);
            if let (Phase::Faulted, Some(reason)) = (record.phase, record.reason) {
                let words = format!("the torque was removed. {} {}", reason.sentence(), reason.remedy());
                return Err(Failure::System(words));
            }
        }
        if signals::signalled().is_some() {
            return Err(Failure::System("interrupted, the torque off".into()));
        }
        match ended {
            None => Ok(()),
            Some(LoopEnd::Device(failure @ DeviceFailure::Gone)) => {
                Err(Failure::System(format!("the experiment ended early, with the torque off: {failure}")))
            }
            Some(_) => Err(Failure::System("the experiment ended early, with the torque off".into())),
        }
    }
}
