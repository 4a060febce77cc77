//! `hapt run`: a world in real time on a device, without a page.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_log::{Header, Recorder, Summary};
use hapt_model::{Scenario, World};
use hapt_rt::{End, Engine, Failure as DeviceFailure, Hands, Order, Record, Timing, Touch};
use hapt_sim::script;

use crate::args::RunArgs;
use crate::board_run;
use crate::device::Spec;
use crate::drives;
use crate::failure::Failure;
use crate::host::Stolen;
use crate::latency::{LOOK, granted, plan, settings, time};
use crate::log::Recording;
use crate::output;
use crate::people;
use crate::sim;
use crate::world::{Loaded, files, load};

pub fn run(args: &RunArgs) -> Result<ExitCode, Failure> {
    let mut loaded = load(&args.world)?;
    let spec = Spec::named(&args.device)?;
    let mut sets = args.world.sets.clone();
    sets.extend(spec.overrides(&loaded.world)?);
    loaded.world = World::read(&loaded.source, &sets)?;
    let world = &loaded.world;
    let scenario = args.scenario.as_deref().map(|name| world.scenario(name)).transpose()?;
    if scenario.is_some() && spec != Spec::Sim {
        return Err(Failure::input(
            "--scenario: only the simulated device (--device sim) has a hand that can play one",
        ));
    }
    let duration = match &args.duration {
        Some(text) => time("--duration", text)?,
        None => scenario.map_or(f64::INFINITY, |scenario| scenario.duration),
    };
    let mut inputs = files(&args.world.path, world);
    if let Spec::Replay(recorded) = &spec {
        inputs.push(("the recording", recorded.clone()));
    }
    output::apart(&output::given(&[("--log", &args.log)]), &inputs)?;
    if let Spec::Board(port) = &spec {
        return board_run::run(args, loaded, port, duration);
    }
    let profile = profile(args.uncertified, &spec, world)?;
    let settings = settings(&args.realtime, world)?;
    let plan = plan(world, profile)?;
    let recording = Recording::start(args.log.as_deref(), world, || header(args, &loaded, &sets, profile))?;
    if spec.has_a_motor() {
        // Before anything can hold a torque: a signal takes it off first, and no message holds anybody up.
        output::end_in_order();
    }
    let (device, hands) = spec.open(world)?;
    output::end_in_order();
    let engine = Engine::start_with(plan, device, settings)?;
    let handle = engine.handle().clone();
    output::stop_with(move || handle.end());
    let recorder = recording.map(Recording::begin).transpose()?;
    if spec.has_a_motor() {
        people::say(drives::NOT_CERTIFIED);
    }
    for warning in &engine.realtime().warnings {
        people::say(format_args!("warning: {warning}"));
    }
    let mut run = Run { world, engine, hands, scenario, duration, stolen: Stolen::until_now(), seen: Seen::default() };
    let how = run.until_it_ends(recorder.as_ref())?;
    let logged = recorder.map(finish).transpose();
    let mut out = stdout().lock();
    let logged_line = logged.as_ref().ok().and_then(Option::as_deref).unwrap_or_default();
    let text = run.summary(&loaded, &spec, &how) + logged_line;
    let printed = out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout);
    if let How::Signal(code) = how {
        // The terminal may be gone, and with it whoever reads.
        return Ok(ExitCode::from(code));
    }
    printed?;
    logged?;
    if spec.has_a_motor()
        && let Some(missed) = run.seen.timing.warning()
    {
        people::say(format_args!("warning: {missed}"));
    }
    match how {
        How::Done => Ok(ExitCode::SUCCESS),
        How::Signal(code) => Ok(ExitCode::from(code)),
        How::Fault(reason) => {
            Err(Failure::System(format!("the torque was taken away. {} {}", reason.sentence(), reason.remedy())))
        }
        How::Device(failure) => Err(Failure::System(format!("the run ended by itself, the torque off: {failure}"))),
        How::Panicked => Err(Failure::System("the loop broke off, the torque off: a defect of hapt".into())),
    }
}

/// What goes into the log beside the samples.
fn header(args: &RunArgs, loaded: &Loaded, sets: &[String], profile: SafetyProfile) -> Header {
    let (device, scenario) = (args.device.clone(), args.scenario.clone());
    Header { device, scenario, profile, ..sim::header(loaded, sets, true) }
}

/// Its last second, and what has become of it.
pub fn finish(recorder: Recorder) -> Result<String, Failure> {
    let Summary { path, written, lost } =
        recorder.finish().map_err(|error| Failure::System(format!("the log has ended early: {error}")))?;
    let lost = if lost > 0 { format!(", {} lost", people::count(lost)) } else { String::new() };
    Ok(format!("log          {} samples{lost}: {}\n", people::count(written), path.display()))
}

/// On a motor only what is certified runs, unless somebody says otherwise.
pub fn profile(uncertified: bool, spec: &Spec, world: &World) -> Result<SafetyProfile, Failure> {
    if spec.has_a_motor() { judged(world, uncertified) } else { Ok(SafetyProfile::Simulated) }
}

/// How the supervisor is to guard a motor from a world.
pub fn judged(world: &World, uncertified: bool) -> Result<SafetyProfile, Failure> {
    let check = hapt_analysis::check(world)?;
    if check.certified {
        return Ok(SafetyProfile::Certified);
    }
    if uncertified {
        return Ok(SafetyProfile::Uncertified);
    }
    let what = format!("{}; hapt check lists what would certify it", check.verdict_sentence());
    Err(Failure::input(format!("{what}. --uncertified runs it all the same, with a tighter supervisor")))
}

/// How a run has ended.
enum How {
    Done,
    Signal(u8),
    Fault(Reason),
    Device(DeviceFailure),
    Panicked,
}

/// What the records have said.
#[derive(Default)]
struct Seen {
    timing: Timing,
    last: Option<Record>,
    /// From when to when the torque was all there, in ns from the start.
    running: Option<(u64, u64)>,
    /// The largest |output|, in N·m (linear: N).
    peak: f64,
    fault: Option<Reason>,
}

struct Run<'w> {
    world: &'w World,
    engine: Engine,
    hands: Option<Hands>,
    scenario: Option<&'w Scenario>,
    /// In s, counted from when the torque is all there.
    duration: f64,
    stolen: Stolen,
    seen: Seen,
}

impl Run<'_> {
    /// Arms, plays the scenario, disarms; looks at every record, and gives it to `recorder`.
    fn until_it_ends(&mut self, recorder: Option<&Recorder>) -> Result<How, Failure> {
        if output::signalled().is_none() {
            self.order(Request::Arm)?;
        }
        // When the time began to count, in ns from the start.
        let mut begun = None;
        let mut is_over = false;
        loop {
            std::thread::sleep(LOOK);
            // Asked before the last records are taken: they may be those of its end.
            let ended = self.engine.ended();
            self.take_records(recorder);
            if let Some(how) = self.how(ended) {
                self.engine.end();
                self.take_records(recorder);
                return Ok(how);
            }
            let (Some(last), Some(_)) = (self.seen.last, self.seen.running) else { continue };
            let since = match begun {
                Some(since) => since,
                None if self.play() => {
                    people::say("at full torque; Ctrl-C takes it off");
                    *begun.insert(last.due)
                }
                None => continue,
            };
            if !is_over && (last.due - since) as f64 >= self.duration * 1e9 {
                is_over = true;
                self.order(Request::Disarm)?;
            }
        }
    }

    fn take_records(&mut self, recorder: Option<&Recorder>) {
        while let Ok(record) = self.engine.records.pop() {
            self.seen.add(&record);
            if let Some(recorder) = recorder {
                recorder.follow(&mut self.engine, &record);
            }
        }
    }

    /// Begins the scenario, if there is one.
    fn play(&mut self) -> bool {
        let (Some(scenario), Some(hands)) = (self.scenario, &mut self.hands) else { return true };
        let script = Box::new(script(scenario, self.world.sampling.period));
        hands.push(Touch::Scenario(script)).is_ok()
    }

    /// How it has ended, if it has.
    fn how(&self, ended: Option<End>) -> Option<How> {
        if let Some(signal) = output::signalled() {
            return Some(How::Signal(signal));
        }
        if let Some(reason) = self.seen.fault {
            return Some(How::Fault(reason));
        }
        match ended {
            None => {}
            Some(End::Device(DeviceFailure::Ended) | End::Asked) => return Some(How::Done),
            Some(End::Device(failure)) => return Some(How::Device(failure)),
            Some(End::Panicked) => return Some(How::Panicked),
        }
        let is_disarmed = self.seen.last.is_some_and(|record| record.phase == Phase::Disarmed);
        (is_disarmed && self.seen.running.is_some()).then_some(How::Done)
    }

    fn order(&mut self, request: Request) -> Result<(), Failure> {
        self.engine.send(Order::Request(request)).map_err(|_| Failure::System("the loop takes no orders".into()))
    }

    fn summary(&self, loaded: &Loaded, spec: &Spec, how: &How) -> String {
        let on = match spec {
            Spec::Sim => "the simulated device".to_string(),
            Spec::Replay(file) => format!("the positions of {}", file.display()),
            Spec::Board(port) => port.path.display().to_string(),
            Spec::Drive(address) => format!("the drive {address}"),
        };
        let Seen { timing, running, peak, .. } = &self.seen;
        let ran = match running {
            Some((from, to)) => format!("for {} at full torque", people::time((to - from) as f64 * 1e-9)),
            None => "the torque was never all there".into(),
        };
        let end = match how {
            How::Done => "ended in order".into(),
            How::Signal(_) => "interrupted, the torque off at once".into(),
            How::Fault(reason) => format!("faulted. {}", reason.sentence()),
            How::Device(failure) => failure.to_string(),
            How::Panicked => "broken off".into(),
        };
        format!(
            "{} on {on}, {} a sample\nran          {ran}; {end}\nmotor        asked for {} at most\n\n{timing}\n\n{}",
            loaded.title(),
            people::time(self.world.sampling.period),
            people::effort(*peak, self.world.motion),
            granted(self.engine.realtime(), self.stolen.since()),
        )
    }
}

impl Seen {
    fn add(&mut self, record: &Record) {
        self.timing.add(record);
        self.peak = self.peak.max(record.output.abs());
        if record.phase == Phase::Running {
            self.running.get_or_insert((record.due, record.due)).1 = record.due;
        }
        if record.phase == Phase::Faulted {
            self.fault = self.fault.or(record.reason);
        }
        self.last = Some(*record);
    }
}
