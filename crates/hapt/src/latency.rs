//! `hapt latency`: the timing of a loop on this machine.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use hapt_core::{Request, SafetyProfile, WhenLate};
use hapt_model::{Dimension, World};
use hapt_rt::{Certified, Engine, LoopCommand, Plan, Quantiles, Realtime, Settings, SimulatedDevice, Timing};
use serde_json::{Value, json};

use crate::args::{LatencyArgs, RealtimeArgs};
use crate::failure::Failure;
use crate::host::Stolen;
use crate::{format, signals, world};

/// The polling period of records.
pub const LOOK: Duration = Duration::from_millis(5);
/// The longest bar of the histogram, in characters.
const WIDEST: u64 = 50;

pub fn run(args: &LatencyArgs) -> Result<ExitCode, Failure> {
    let source = world::source(args.world.as_deref().unwrap_or(Path::new("@notes/default")))?;
    let mut world = world::read_world(&source, &args.sets)?;
    // This measurement has no torque that could do harm.
    world.safety.late = Some(WhenLate::Count);
    let duration = time("--duration", &args.duration)?;
    let (device, _hands) = SimulatedDevice::new(&world);
    let mut engine = Engine::start_with(
        plan(&world, SafetyProfile::Simulated)?,
        Box::new(device),
        settings(&args.realtime, &world)?,
    )?;
    signals::end_in_order();
    let handle = engine.handle().clone();
    signals::stop_with(move || handle.end());
    let _ = engine.send(LoopCommand::Request(Request::Arm));
    let stolen = Stolen::until_now();
    let mut timing = Timing::new();
    let mut latest = 0;
    while (latest as f64) < duration * 1e9 && signals::signalled().is_none() && engine.ended().is_none() {
        std::thread::sleep(LOOK);
        while let Ok(record) = engine.records.pop() {
            timing.add(&record);
            latest = record.due;
        }
    }
    engine.end();
    let (realtime, stolen) = (engine.realtime(), stolen.since());
    let text =
        if args.json { json(&world, &timing, realtime, stolen) } else { text(&world, &timing, realtime, stolen) };
    let mut out = stdout().lock();
    let printed = out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout);
    match signals::signalled() {
        // The terminal may be closed.
        Some(code) => Ok(ExitCode::from(code)),
        None => printed.map(|()| ExitCode::SUCCESS),
    }
}

/// A positive time.
pub fn time(flag: &str, text: &str) -> Result<f64, Failure> {
    format::positive(flag, text, Dimension::TIME)
}

/// A compiled world with a supervisor of this profile.
pub fn plan(world: &World, profile: SafetyProfile) -> Result<Plan, Failure> {
    Plan::new(world, profile).map_err(Failure::input)
}

/// The scheduling of the thread.
pub fn settings(args: &RealtimeArgs, world: &World) -> Result<Settings, Failure> {
    let spin = match args.spin.as_deref() {
        None => 0.0,
        Some(text) => time("--spin", text)?,
    };
    let period = world.sampling.period;
    if spin > 0.5 * period {
        let (spin, most) = (format::time(spin), format::time(0.5 * period));
        let why =
            format!("at {} a sample the most is {most}, which leaves time for other threads", format::time(period));
        return Err(Failure::input(format!("--spin: {spin} is too long: {why}")));
    }
    let priority = (args.priority > 0).then_some(args.priority);
    Ok(Settings { priority, lock: true, spin: Duration::from_secs_f64(spin), leave_a_core: false })
}

impl From<hapt_rt::Error> for Failure {
    fn from(error: hapt_rt::Error) -> Self {
        match error {
            hapt_rt::Error::Period { .. } => Failure::input(error),
            hapt_rt::Error::Thread(_) => Failure::System(error.to_string()),
        }
    }
}

/// The granted scheduling, a line each, and the steal time of its host.
pub fn granted(realtime: &Realtime, stolen: Option<Duration>) -> String {
    let text = match realtime.priority {
        Some(priority) => format!("priority     SCHED_FIFO {priority}\n"),
        None => "priority     as any other program\n".into(),
    };
    let text = text + if realtime.locked { "memory       locked in place\n" } else { "memory       not locked\n" };
    let took = stolen.map(|stolen| {
        let stolen = format::time(stolen.as_secs_f64());
        format!(
            "host         preempted each core for {stolen} (steal time); no setting avoids the samples missed then\n"
        )
    });
    text + &took.unwrap_or_default()
}

/// The number of samples at which the loop kept the times that the file states, as a line; empty where it states none.
pub fn kept(world: &World, timing: &Timing) -> String {
    let Some(Certified { samples, inside, longest, .. }) = certified(world, timing) else { return String::new() };
    let [inside, all] = [inside, samples].map(format::count);
    let longest = format::time(longest as f64 * 1e-9);
    format!("\ncertified    inside the certificate for {inside} of {all} samples, longest {longest}")
}

fn certified(world: &World, timing: &Timing) -> Option<Certified> {
    world.sampling.states_times().then(|| timing.certified())
}

fn text(world: &World, timing: &Timing, realtime: &Realtime, stolen: Option<Duration>) -> String {
    let mut text = format!(
        "{} a sample, on the simulated device\n\n{timing}{}\n\n",
        format::time(world.sampling.period),
        kept(world, timing)
    );
    let bars = timing.latency_bars();
    let most = bars.iter().map(|bar| bar.count).max().unwrap_or(1).max(1);
    for (i, bar) in bars.iter().enumerate() {
        let name = if i == 0 { "latency" } else { "" };
        let label = format!("below {}", format::time(bar.to as f64 * 1e-9));
        // A single sample shows, too.
        let length = (bar.count * WIDEST).div_ceil(most) as usize;
        let _ = writeln!(text, "{name:<12} {label:<14} {:>9} {}", bar.count, "#".repeat(length));
    }
    text.push('\n');
    text += &lines(world, timing);
    text += &granted(realtime, stolen);
    for warning in &realtime.warnings {
        let _ = writeln!(text, "\n{warning}");
    }
    text
}

/// The measured times, as lines for the file.
fn lines(world: &World, timing: &Timing) -> String {
    // Up to the next microsecond.
    let up = |ns: u64| format!("\"{} us\"", ns.div_ceil(1000));
    format!(
        "for [loop], as far as this run shows; allow for rarer ones:\n  interval_max = {:<12} # the longest time between two samples\n  \
         delay_max = {:<15} # from the sample to the command; add what the device itself takes\n\n",
        up(timing.longest_gap().max((world.sampling.period * 1e9).ceil() as u64)),
        up(timing.computation().max)
    )
}

fn json(world: &World, timing: &Timing, realtime: &Realtime, stolen: Option<Duration>) -> String {
    let us = |ns: u64| ns as f64 / 1e3;
    let quantiles = |q: Quantiles| -> Value {
        json!({ "p50": us(q.p50), "p90": us(q.p90), "p99": us(q.p99), "p999": us(q.p999), "max": us(q.max) })
    };
    let bars: Vec<Value> = timing
        .latency_bars()
        .iter()
        .map(|bar| json!({ "from_us": us(bar.from), "to_us": us(bar.to), "count": bar.count }))
        .collect();
    let value = json!({
        "period_s": world.sampling.period,
        "samples": timing.samples(),
        "overruns": timing.overruns(),
        "missed": timing.missed(),
        "latency_us": quantiles(timing.latency()),
        "period_us": quantiles(timing.period()),
        "computation_us": quantiles(timing.computation()),
        "longest_gap_us": us(timing.longest_gap()),
        "certified": certified(world, timing).map(|Certified { samples, inside, longest, longest_delay }| {
            json!({ "samples": samples, "inside": inside, "longest_us": us(longest), "longest_delay_us": us(longest_delay) })
        }),
        "histogram": bars,
        "stolen_s": stolen.unwrap_or_default().as_secs_f64(),
        "realtime": { "priority": realtime.priority, "locked": realtime.locked, "warnings": realtime.warnings },
    });
    format!("{value:#}\n")
}
