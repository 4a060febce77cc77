//! `hapt run`: a world in real time on a device, without a page.

use std::io::{Write, stdout};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_host::links::Links;
use hapt_host::{DeviceAddress, Error, Event, Sample, Session, WorldConfig};
use hapt_log::{Header, Recorder, Summary};
use hapt_model::Scenario;
use hapt_rt::{Failure as DeviceFailure, Outside, Record, Timing};
use hapt_sim::script;

use crate::args::{RunArgs, Steering, device};
use crate::attached::Wheel;
use crate::drives;
use crate::failure::Failure;
use crate::format;
use crate::host::Stolen;
use crate::latency::{LOOK, granted, kept, settings, time};
use crate::log::Recording;
use crate::messages;
use crate::output;
use crate::signals;
use crate::sim;
use crate::station::{self, Chosen, LastReported, Station};
use crate::world::{Loaded, files};

/// The period of a board's telemetry in s, where no log needs every sample.
const SHOWN: f64 = 0.02;
/// A board that sends no sample for this time, though it answers, has stopped its loop.
const SILENT: Duration = Duration::from_secs(2);

pub fn run(args: &RunArgs) -> Result<ExitCode, Failure> {
    with(args, None)
}

/// The same; with a steering, the device is a wheel for games too.
pub fn with(args: &RunArgs, steering: Option<Steering>) -> Result<ExitCode, Failure> {
    let address = device(&args.device)?;
    let Chosen { loaded, sets, station } = Chosen::of(args, &address)?;
    let scenario = args.scenario.as_deref().map(|name| loaded.world.scenario(name)).transpose()?.cloned();
    if scenario.is_some() && address != DeviceAddress::Sim {
        return Err(Failure::input(
            "--scenario: only the simulated device (--device sim) has a hand that can play one",
        ));
    }
    if let Some(scenario) = scenario.as_ref().filter(|scenario| scenario.timing != hapt_model::Timing::Even) {
        return Err(Failure::input(format!(
            "--scenario {}: it has a `timing`, and a loop in real time samples when its clock says; `hapt sim` plays it as it is",
            scenario.name
        )));
    }
    let duration = match &args.duration {
        Some(text) => time("--duration", text)?,
        None => scenario.as_ref().map_or(f64::INFINITY, |scenario| scenario.duration),
    };
    let mut inputs = files(&args.world.path, &loaded.world);
    if let DeviceAddress::Replay(recorded) = &address {
        inputs.push(("the recording", recorded.clone()));
    }
    output::apart(&output::given(&[("--log", &args.log)]), &inputs)?;
    let world = &loaded.world;
    let mut profile = address.profile(world, args.uncertified)?;
    if let Some(station) = &station {
        profile = station.profile(profile, args.uncertified)?;
    }
    let room = steering.map(|steering| Wheel::room(world, steering)).transpose()?;
    let recording = Recording::start(args.log.as_deref(), world, || Header {
        linked: station.is_some() || steering.is_some(),
        ..header(args, &loaded, &sets, profile)
    })?;
    let (links, ports) = station.as_ref().map(Station::open).transpose()?.unzip();
    let (wheel, effects) = room.map(Wheel::attach).transpose()?.unzip();
    if address.has_motor() {
        // Before anything can hold a torque: a signal removes it first, and no message blocks the program.
        signals::end_in_order();
    }
    let every = if args.log.is_some() { 0.0 } else { SHOWN };
    let opened = address.machine(world, profile, settings(&args.realtime, world)?, every)?;
    signals::end_in_order();
    messages::notes(&opened.notes);
    let (mut machine, on) = (opened.machine, opened.description);
    if let Some(why) = machine.clear_fault()? {
        messages::say(format_args!("the board was faulted, and is cleared: {why}"));
    }
    let outside = match (ports, effects) {
        (Some(ports), _) => Some(("--station", Outside::linked(ports))),
        (None, Some(effects)) => Some(("hapt wheel", Outside::playing(effects))),
        (None, None) => None,
    };
    if let Some((what, outside)) = outside {
        machine = machine.with_outside(outside).ok_or_else(|| {
            Failure::input(format!("{what}: the device runs its loop by itself; it needs a loop of this computer"))
        })?;
    }
    let config = WorldConfig::new(loaded.source.clone(), sets).map_err(Failure::input)?;
    let mut session = Session::start(config, machine)?;
    let handle = session.handle();
    signals::stop_with(move || handle.end());
    if let Some(recording) = recording {
        session.record(recording.begin()?);
    }
    let is_board = session.realtime().is_none();
    if address.has_motor() && !is_board {
        messages::say(drives::NOT_CERTIFIED);
    }
    for warning in session.realtime().iter().flat_map(|realtime| &realtime.warnings) {
        messages::say(format_args!("warning: {warning}"));
    }
    let stolen = Stolen::until_now();
    let mut run = Run {
        session,
        is_board,
        scenario,
        duration,
        stolen,
        seen: Seen::default(),
        links,
        wheel,
        reported: LastReported::default(),
    };
    let how = run.until_it_ends();
    // Before anything waits for a disk or for a reader.
    run.session.end(|sample| run.seen.add(sample.record));
    // The other stations are informed at once that this end has released.
    let links = run.links.as_mut().map(Links::end).unwrap_or_default();
    let wheel = run.wheel.as_mut().map(Wheel::end).unwrap_or_default();
    let how = how?;
    let recorder = run.session.take_recording().map(hapt_host::Recording::into_recorder);
    let logged = recorder.map(finish).transpose();
    let mut out = stdout().lock();
    let logged_line = logged.as_ref().ok().and_then(Option::as_deref).unwrap_or_default();
    let bus = station.as_ref().map(Station::summary).unwrap_or_default();
    let text = run.summary(&loaded, &on, &how) + &station::summary(&links) + &bus + &wheel + logged_line;
    let printed = out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout);
    if let How::Signal(code) = how {
        // The terminal may be closed.
        return Ok(ExitCode::from(code));
    }
    printed?;
    logged?;
    if let Some(missed) = run.missed().filter(|_| address.has_motor()) {
        messages::say(format_args!("warning: {missed}"));
    }
    match how {
        How::Done => Ok(ExitCode::SUCCESS),
        How::Signal(code) => Ok(ExitCode::from(code)),
        How::Fault(reason) => {
            Err(Failure::System(format!("the torque was removed. {} {}", reason.sentence(), reason.remedy())))
        }
        How::Silent => Err(Failure::System(
            "the board sends no samples any more; its own watchdog removes the torque if its loop has stopped".into(),
        )),
        How::Detached => Err(Failure::detached()),
        How::Failed(Error::Device(failure)) => {
            Err(Failure::System(format!("the run ended early, with the torque off: {failure}")))
        }
        How::Failed(Error::Panicked(_)) => {
            Err(Failure::System("the loop broke off, the torque off: a defect of hapt".into()))
        }
        How::Failed(error) => Err(error.into()),
    }
}

/// The header of the log.
fn header(args: &RunArgs, loaded: &Loaded, sets: &[String], profile: SafetyProfile) -> Header {
    let (device, scenario) = (args.device.clone(), args.scenario.clone());
    Header { device, scenario, profile, ..sim::header(&loaded.world, &loaded.source, sets, true) }
}

/// The last second of the run, and its end.
pub fn finish(recorder: Recorder) -> Result<String, Failure> {
    let Summary { path, written, lost } =
        recorder.finish().map_err(|error| Failure::System(format!("the log has ended early: {error}")))?;
    let lost = if lost > 0 { format!(", {} lost", format::count(lost)) } else { String::new() };
    Ok(format!("log          {} samples{lost}: {}\n", format::count(written), path.display()))
}

/// The end of a run.
enum How {
    Done,
    Signal(u8),
    Fault(Reason),
    /// A board that sends no samples.
    Silent,
    /// The computer has detached the wheel.
    Detached,
    Failed(Error),
}

/// The statistics of the records.
#[derive(Default)]
struct Seen {
    timing: Timing,
    first: Option<u64>,
    last: Option<Record>,
    records: u64,
    /// A torque was on.
    was_active: bool,
    /// The first and the last instant at full torque, in ns from the start.
    running: Option<(u64, u64)>,
    /// The largest |output|, in N·m (linear: N).
    peak: f64,
    fault: Option<Reason>,
}

struct Run {
    session: Session,
    /// A board sends no timing, and needs heartbeats.
    is_board: bool,
    scenario: Option<Scenario>,
    /// In s, counted from full torque on.
    duration: f64,
    stolen: Stolen,
    seen: Seen,
    /// Those of a station.
    links: Option<Links>,
    /// The wheel that the computer sees.
    wheel: Option<Wheel>,
    reported: LastReported,
}

impl Run {
    /// Arms, plays the scenario, disarms, and reads every record.
    fn until_it_ends(&mut self) -> Result<How, Failure> {
        self.keep();
        if signals::signalled().is_none() {
            self.request(Request::Arm)?;
        }
        // The instant from which the duration counts, in ns from the start.
        let mut begun = None;
        let mut is_over = false;
        let begin = Instant::now();
        let mut last_record = begin;
        loop {
            std::thread::sleep(LOOK);
            self.keep();
            if let Some(links) = &self.links {
                self.reported.say(&links.status());
            }
            if let Some(wheel) = &mut self.wheel {
                wheel.say();
                if !wheel.is_attached() {
                    return Ok(How::Detached);
                }
            }
            let before = self.seen.records;
            let ended = self.session.poll(begin.elapsed(), |sample: Sample<'_>| self.seen.add(sample.record));
            if let Some(how) = self.how(ended, is_over) {
                return Ok(how);
            }
            if self.seen.records > before {
                last_record = Instant::now();
            } else if self.is_board && last_record.elapsed() > SILENT {
                return Ok(How::Silent);
            }
            let (Some(last), Some(_)) = (self.seen.last, self.seen.running) else { continue };
            let since = match begun {
                Some(since) => since,
                None => {
                    self.play();
                    messages::say("at full torque; Ctrl-C takes it off");
                    *begun.insert(last.due)
                }
            };
            if !is_over && last.due.saturating_sub(since) as f64 >= self.duration * 1e9 {
                is_over = true;
                self.request(Request::Disarm)?;
            }
        }
    }

    /// Sends a heartbeat to a board. A loop on this computer ends with the program.
    fn keep(&self) {
        if self.is_board {
            self.session.handle().heartbeat();
        }
    }

    /// Begins the scenario, if there is one.
    fn play(&mut self) {
        if let Some(scenario) = &self.scenario {
            let script = script(scenario, self.session.config().world.sampling.period);
            let hand = self.session.hand();
            hand.play(script);
            hand.send();
        }
    }

    /// The end of the run; `None` while it runs.
    fn how(&mut self, ended: Option<Result<(), Error>>, is_over: bool) -> Option<How> {
        if let Some(signal) = signals::signalled() {
            return Some(How::Signal(signal));
        }
        while let Some(event) = self.session.event() {
            match event {
                Event::Error(error) | Event::Rejected(error) => return Some(How::Failed(error)),
                Event::Changed | Event::Refused { .. } | Event::File { .. } => {}
            }
        }
        if let Some(reason) = self.seen.fault {
            return Some(How::Fault(reason));
        }
        match ended {
            None => {}
            Some(Ok(()) | Err(Error::Device(DeviceFailure::Ended))) => return Some(How::Done),
            Some(Err(error)) => return Some(How::Failed(error)),
        }
        let last = self.seen.last.filter(|record| record.phase == Phase::Disarmed && self.seen.was_active)?;
        // It has faded out, by itself or on request.
        Some(last.reason.filter(|_| !is_over).map_or(How::Done, How::Fault))
    }

    fn request(&mut self, request: Request) -> Result<(), Failure> {
        let epoch = self.session.handle().epoch();
        self.session.request(request, epoch).map_err(|_| Failure::System("the loop takes no orders".into()))
    }

    /// A line on missed samples, where there were some.
    fn missed(&self) -> Option<String> {
        if !self.is_board {
            return self.seen.timing.warning().map(|warning| warning.to_string());
        }
        let missed = self.seen.timing.missed();
        (missed > 0).then(|| format!("the board missed {} samples; see the summary", format::count(missed)))
    }

    fn summary(&self, loaded: &Loaded, on: &str, how: &How) -> String {
        let world = &loaded.world;
        let Seen { timing, first, last, records, running, peak, .. } = &self.seen;
        let ran = match running {
            Some((from, to)) => format!("for {} at full torque", format::time((to - from) as f64 * 1e-9)),
            None => "the torque was never all there".into(),
        };
        let end = match how {
            How::Done => "ended in order".into(),
            How::Signal(_) => "interrupted, the torque off at once".into(),
            How::Fault(reason) => format!("faulted. {}", reason.sentence()),
            How::Failed(Error::Device(failure)) => failure.to_string(),
            How::Detached => "the computer has detached the wheel".into(),
            How::Silent | How::Failed(_) => "broken off".into(),
        };
        let period = format::time(world.sampling.period);
        let peak = format::effort(*peak, world.motion);
        let text = format!(
            "{} on {on}, {period} a sample\nran          {ran}; {end}\nmotor        commanded {peak} at most",
            loaded.title()
        );
        let kept = kept(world, timing);
        let Some(realtime) = self.session.realtime() else {
            let samples = last.zip(*first).map_or(0, |(last, first)| last.sample.saturating_sub(first) + 1);
            let missed = match timing.missed() {
                0 => "none".into(),
                missed => format::count(missed),
            };
            let (samples, shown) = (format::count(samples), format::count(*records));
            return format!(
                "{text}, of what was shown\nsamples      {samples}, {missed} missed; {shown} shown{kept}\n"
            );
        };
        format!("{text}\n\n{timing}{kept}\n\n{}", granted(realtime, self.stolen.since()))
    }
}

impl Seen {
    fn add(&mut self, record: &Record) {
        self.timing.add(record);
        self.records += 1;
        self.first.get_or_insert(record.sample);
        self.was_active |= record.phase.is_active();
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
