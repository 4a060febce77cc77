//! Predictions of hapt for EPFL's haptic paddle, compared with its authors' measurements: tables of docs/measured.md.
//!
//! The records stay outside of the project. The labs' own numbers are those of their repositories, named on the page.

mod walls;

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use hapt_analysis::{free, free_growth};
use hapt_identify::{Columns, Error, Known, Puck, Record, identify};
use hapt_model::{Source, World};
use hapt_sim::Simulation;
use rayon::prelude::*;

/// Next to the project, if they are there.
const FOLDER: &str = "../shared/data";
/// The paddle's loop, s.
const PERIOD: f64 = 350e-6;
/// Turns of its motor for one of the paddle.
const RATIO: f64 = 15.0;
/// By the authors, at the motor: friction in both directions, N m; the data sheet's damping, N m s/rad.
const LAB_FRICTION: [f64; 2] = [1.65e-3, 1.20e-3];
const LAB_DAMPING: f64 = 8.33e-7;
/// By the authors: gravity at the paddle, N m, and the gain and the period of the sustained oscillation.
const LAB_GRAVITY: f64 = 0.075 * 9.81 * 0.019_88;
const LAB_GAIN: f64 = 0.05;
const LAB_SWING: f64 = 86.7e-3;
/// The authors' sine: 2 · 3.14 rad/s, as their code has it.
#[allow(clippy::approx_constant)]
const SINE: f64 = 2.0 * 3.14;
/// The step's end, deg.
const TARGET: f64 = 10.0;
/// The time before and after a step that is used of its record, s.
const BEFORE: f64 = 0.05;
const AFTER: f64 = 0.65;

/// A step by the authors: gains in N m/deg, and their measurements, deg and s.
struct Step {
    record: Option<&'static str>,
    gains: [f64; 3],
    overshoot: Option<f64>,
    rise: Option<f64>,
    settling: Option<f64>,
}

const STEPS: [Step; 5] = [
    Step {
        record: Some("pid-encoder-p05-d0003"),
        gains: [0.05, 0.0, 3e-4],
        overshoot: Some(4.69),
        rise: Some(25.9e-3),
        settling: None,
    },
    Step {
        record: Some("pid-encoder-p05-d0008"),
        gains: [0.05, 0.0, 8e-4],
        overshoot: Some(0.65),
        rise: Some(40.95e-3),
        settling: Some(75.6e-3),
    },
    Step { record: None, gains: [0.01, 0.0, 3e-4], overshoot: None, rise: None, settling: None },
    Step {
        record: None,
        gains: [0.05, 1e-4, 8e-4],
        overshoot: Some(1.82),
        rise: Some(35e-3),
        settling: Some(325.5e-3),
    },
    Step {
        record: Some("ziegler-nichols-tuned"),
        gains: [0.03, 0.692, 3.25e-4],
        overshoot: Some(10.2),
        rise: Some(21e-3),
        settling: Some(341e-3),
    },
];

/// A device at the paddle.
#[derive(Clone, Copy, Debug)]
struct Device {
    inertia: f64,
    damping: f64,
    friction: f64,
    /// From the filtered position to the torque, s.
    delay: f64,
    offset: f64,
}

/// A fit to a record.
struct DeviceFit {
    device: Device,
    /// Of the positions, rad.
    rms: f64,
    /// With an interval of the inertia.
    has_interval: bool,
    sign: f64,
}

/// A motion over time: times in s, positions in deg.
type Trace = (Vec<f64>, Vec<f64>);

fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(FOLDER);
    folder.is_dir().then_some(folder)
}

/// The tables; `None` where the records are missing.
pub fn text() -> Result<Option<String>> {
    let Some(folder) = folder() else { return Ok(None) };
    let fits: Vec<Option<DeviceFit>> = STEPS
        .par_iter()
        .map(|step| step.record.map_or(Ok(None), |name| step.fit(&paddle(&folder, name)?)))
        .collect::<Result<_>>()?;
    let device = |i: usize| fits[i].as_ref().map(|fit| fit.device).context("no fit of a step");
    let devices = [device(0)?, device(1)?];
    let mut text = String::from("### The paddle's numbers\n\n");
    text += &numbers(&folder, &fits)?;
    text += "\n### The paddle under a proportional gain\n\n";
    text += &swing(&devices)?;
    text += "\n### The paddle's steps\n\n";
    text += &steps(&folder, &devices)?;
    text += "\n### The paddle under a sine\n\n";
    text += &sine(&folder, &devices)?;
    text += "\n### The paddle's walls\n\n";
    text += &walls::walls(devices[1])?;
    Ok(Some(text))
}

/// A record of the paddle.
fn paddle(folder: &Path, name: &str) -> Result<Trace> {
    let path = folder.join("epfl").join(format!("{name}.csv"));
    let table = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let columns = Columns { coasts: true, ..Columns::parse("time=timestamp [s],position=paddle_pos_filt [deg]")? };
    let read = columns.read_all(&table)?;
    Ok((read.times, read.positions.iter().map(|x| x.to_degrees()).collect()))
}

/// A motion at the samples of the loop, straight between those of the log.
fn resampled((times, positions): &Trace, from: f64, to: f64) -> Trace {
    let mut after = 0;
    let n = ((to - from) / PERIOD) as usize;
    let at = |k: usize| {
        let t = from + k as f64 * PERIOD;
        while after + 1 < times.len() && times[after] < t {
            after += 1;
        }
        let before = after.max(1) - 1;
        let part = ((t - times[before]) / (times[before + 1] - times[before])).clamp(0.0, 1.0);
        (t - from, positions[before] + part * (positions[before + 1] - positions[before]))
    };
    (0..n).map(at).unzip()
}

/// Where the log's position first leaves its start, by 0.02 deg, to be far from it soon.
fn first_move(positions: &[f64]) -> usize {
    let off = |x: &f64| (x - positions[0]).abs();
    let leaves = |x: &&[f64]| off(&x[0]) > 0.02 && off(&x[10]) > 0.5;
    positions.windows(11).position(|x| leaves(&x)).unwrap_or(positions.len() - 1)
}

impl Step {
    /// The law's torque at the paddle, from sample `start` on, at positions in deg.
    fn torques(&self, positions: &[f64], start: usize) -> Vec<f64> {
        let [p, i, d] = self.gains;
        let mut sum = 0.0;
        let torque = |k: usize| {
            if k < start {
                return 0.0;
            }
            let error = TARGET - positions[k];
            let last = if k > 0 { positions[k - 1] } else { positions[k] };
            sum += error * PERIOD;
            p * error + d * (last - positions[k]) / PERIOD + i * sum
        };
        (0..positions.len()).map(torque).collect()
    }

    /// The device by the law's torque and the log's motion. The log does not have the start of the law; the fit with the least residual
    /// determines it.
    fn fit(&self, motion: &Trace) -> Result<Option<DeviceFit>> {
        let moves = motion.0[first_move(&motion.1)];
        let (times, positions) = resampled(motion, moves - BEFORE, moves + AFTER);
        let begins = (BEFORE / PERIOD) as usize;
        let radians: Vec<f64> = positions.iter().map(|x| x.to_radians()).collect();
        let fits = (begins - 8..begins + 1)
            .into_par_iter()
            .map(|start| fitted(Record::new(times.clone(), radians.clone(), self.torques(&positions, start))?));
        let fits: Vec<Option<DeviceFit>> = fits.collect::<Result<_>>()?;
        Ok(fits.into_iter().flatten().min_by(|a, b| a.rms.total_cmp(&b.rms)))
    }
}

/// The best fit of a record, with intervals or without; `None` where nothing explains it.
fn fitted(record: Record) -> Result<Option<DeviceFit>> {
    let (puck, rms, has_interval) = match identify(&record, &Known::default()) {
        Ok(found) => (found.puck, found.residual.rms, true),
        Err(Error::Residual(left)) => (*left.puck.context("no fit")?, left.rms, false),
        Err(Error::Unexplained) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let Puck { gain, damping, friction, delay, lag, offset, .. } = puck;
    let inertia = gain.abs().recip();
    let at = |x: f64| x * inertia;
    let device =
        Device { inertia, damping: at(damping), friction: at(friction), delay: delay + lag, offset: at(offset) };
    Ok(Some(DeviceFit { device, rms, has_interval, sign: gain.signum() }))
}

/// The torque that the authors commanded, at the paddle, by the log's own clock.
fn sine_torque(t: f64) -> f64 {
    RATIO * 1.1e-3 * (SINE * t).sin()
}

fn sine_record(motion: &Trace) -> Result<Record> {
    let torques = motion.0.iter().map(|t| sine_torque(*t)).collect();
    Ok(Record::new(motion.0.clone(), motion.1.iter().map(|x| x.to_radians()).collect(), torques)?)
}

fn numbers(folder: &Path, fits: &[Option<DeviceFit>]) -> Result<String> {
    let of_sine = fitted(sine_record(&paddle(folder, "sine-0011")?)?)?;
    let mut text = String::from(
        "| record | inertia, kg m² | damping, N m s/rad | friction, N mm | delay, ms | damping less gain times delay, N m s/rad | constant torque, N mm | left of the motion, rms | intervals |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let lab = (LAB_SWING / TAU).powi(2) * LAB_GAIN * 180.0 / PI;
    let [most, least] = LAB_FRICTION.map(|x| 1e3 * RATIO * x);
    writeln!(
        text,
        "| the authors | {lab:.2e} by the swing's period | {:.2e} by the data sheet | {most:.1} and {least:.1} | | | | | |",
        LAB_DAMPING * RATIO * RATIO
    )?;
    let rows = STEPS.iter().zip(fits).filter_map(|(step, fit)| Some((step.record?, step.gains[0], fit.as_ref())));
    for (name, gain, fit) in rows.chain([("sine-0011", 0.0, of_sine.as_ref())]) {
        let Some(DeviceFit { device, rms, has_interval, sign }) = fit else {
            writeln!(text, "| {name} | no device explains the motion | | | | | | | |")?;
            continue;
        };
        let sign = if *sign < 0.0 { ", sign -1" } else { "" };
        writeln!(
            text,
            "| {name} | {:.2e}{sign} | {:.1e} | {:.1} | {} | {} | {:.1} | {:.3} deg | {} |",
            device.inertia,
            device.damping,
            1e3 * device.friction,
            if device.delay > 0.0 { format!("{:.2}", 1e3 * device.delay) } else { "not determined".into() },
            if gain > 0.0 {
                format!("{:.1e}", device.damping - gain * 180.0 / PI * device.delay)
            } else {
                String::new()
            },
            1e3 * device.offset,
            rms.to_degrees(),
            if *has_interval { "yes" } else { "none" }
        )?;
    }
    Ok(text)
}

/// The paddle under a proportional and a derivative gain, released at `from`, deg; its scenario is `go`.
fn world(device: &Device, gains: [f64; 3], from: f64, more: &str) -> Result<World> {
    let [p, i, d] = gains;
    let release = release_time(i);
    let Device { inertia, damping, friction, delay, .. } = device;
    let file = format!(
        "loop = {{ period = \"350 us\", estimator = \"difference\", delay = \"{delay} s\" }}\n\
         [device]\ninertia = {inertia:e}\ndamping = {damping:e}\nfriction = {friction:e}\n{more}\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"{p} N m/deg\"\nrest = \"{TARGET} deg\"\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = \"{d} N m s/deg\"\n\
         [[couplings]]\nkind = \"integral\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"{i} N m/deg\"\nrest = \"{TARGET} deg\"\n\
         [scenarios.go]\nduration = \"{AFTER} s\"\nhand = {{ kind = \"step\", to = \"{from} deg\", release = \"{release} s\" }}\n"
    );
    Ok(World::read(&Source::from_text("paddle.toml", file), &[])?)
}

/// How long the hand holds the paddle before the release, s: an integral term must not accumulate meanwhile.
fn release_time(integral: f64) -> f64 {
    if integral > 0.0 { 2.0 * PERIOD } else { BEFORE }
}

/// The run of a world from the release on, or from 0 on, in s and deg.
fn run(world: &World, from: f64) -> Result<Trace> {
    let mut run = Simulation::new(world, world.scenario("go")?)?;
    let (mut times, mut positions) = (Vec::new(), Vec::new());
    while let Some(row) = run.next() {
        let row = row?;
        if row.time >= from - 1e-9 {
            times.push(row.time - from);
            positions.push(row.puck.to_degrees());
        }
    }
    Ok((times, positions))
}

/// The extremes of a motion about the target, deg.
fn extremes(positions: &[f64]) -> Vec<f64> {
    let turns = positions.windows(3).filter(|x| (x[1] - x[0]) * (x[2] - x[1]) < 0.0);
    turns.map(|x| (x[1] - TARGET).abs()).collect()
}

/// The gain, N m/deg, beyond which `grows` is true.
fn edge(mut low: f64, mut high: f64, grows: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    if grows(low)? || !grows(high)? {
        return Ok(None);
    }
    while high / low > 1.001 {
        let middle = (low * high).sqrt();
        if grows(middle)? { high = middle } else { low = middle }
    }
    Ok(Some(low))
}

fn swing(devices: &[Device]) -> Result<String> {
    let mut text = String::from(
        "| device by | period at 0.05 N m/deg, ms | the authors' | linear loop grows beyond, N m/deg | a swing of 10 deg is sustained at, N m/deg | the authors' | growth a period at 0.05 N m/deg, of 10 deg |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (step, device) in STEPS.iter().zip(devices) {
        let at = |gain: f64| world(device, [gain, 0.0, 0.0], 0.0, "");
        let hertz =
            free(&at(LAB_GAIN)?)?.modes.first().map(|mode| mode.discrete_frequency_hz.unwrap_or(mode.frequency_hz));
        let linear = edge(1e-4, 1.0, |gain| Ok(free_growth(&at(gain)?)?.is_some_and(|growth| growth > 0.0)))?;
        // The third extreme after the release over the first is a period's growth.
        let ratio = |gain: f64| -> Result<f64> {
            let turns = extremes(&run(&at(gain)?, release_time(0.0))?.1);
            Ok(turns.get(1).map_or(0.0, |second| second / TARGET))
        };
        let kept = edge(1e-3, 1.0, |gain| Ok(ratio(gain)? > 1.0))?;
        let gain = |gain: Option<f64>| gain.map_or("none up to 1".into(), |gain| format!("{gain:.4}"));
        writeln!(
            text,
            "| {} | {} | {:.1} | {} | {} | {LAB_GAIN} | {:.2} |",
            step.record.unwrap_or(""),
            hertz.map_or(String::new(), |hertz| format!("{:.1}", 1e3 / hertz)),
            1e3 * LAB_SWING,
            gain(linear),
            gain(kept),
            ratio(LAB_GAIN)?
        )?;
    }
    Ok(text)
}

/// Overshoot in deg, rise in s, and when the motion is within 2 % of the step of its end, of a motion from its first move on.
fn measures((times, positions): &Trace) -> [Option<f64>; 3] {
    let end = positions.last().copied().unwrap_or(0.0);
    let most = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max) - TARGET;
    let rise = positions.iter().position(|x| *x > TARGET).map(|k| times[k]);
    let band = 0.02 * TARGET;
    let settled = positions.iter().rposition(|x| (x - end).abs() > band).and_then(|k| times.get(k + 1).copied());
    [(most > 0.0).then_some(most), rise, settled]
}

fn steps(folder: &Path, devices: &[Device; 2]) -> Result<String> {
    let mut text = String::from(
        "| Kp, Ki, Kd | device by | overshoot, deg: hapt | the authors | the record | rise, ms: hapt | the authors | the record | settled to 2 %, ms: hapt | the authors' settling | the record | hapt against the record, rms deg |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (i, step) in STEPS.iter().enumerate() {
        let [p, i_gain, d] = step.gains;
        let record = step.record.map(|name| paddle(folder, name)).transpose()?;
        let from = record.as_ref().map_or(0.0, |motion| motion.1[0]);
        let from_first_move = |motion: Trace| {
            let from = motion.0[first_move(&motion.1)];
            resampled(&motion, from, from + AFTER - 2.0 * BEFORE)
        };
        // By the device that another record gave.
        let (by, device) = if i == 1 { (0, &devices[0]) } else { (1, &devices[1]) };
        let run = from_first_move(run(&world(device, step.gains, from, "")?, release_time(i_gain))?);
        let (hapt, seen) = (measures(&run), record.map(from_first_move));
        let record = seen.as_ref().map(measures);
        let error = seen.map(|(_, seen)| {
            let squares: Vec<f64> = seen.iter().zip(&run.1).map(|(a, b)| (a - b).powi(2)).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        });
        let lab = [step.overshoot, step.rise, step.settling];
        let cell = |x: Option<f64>, scale: f64| {
            x.map_or("none".into(), |x| format!("{:.*}", if scale > 1.0 { 1 } else { 2 }, scale * x))
        };
        write!(text, "| {p}, {i_gain}, {d} | {} |", STEPS[by].record.unwrap_or(""))?;
        for (k, scale) in [1.0, 1e3, 1e3].into_iter().enumerate() {
            let seen = record.map_or(String::new(), |record| cell(record[k], scale));
            write!(text, " {} | {} | {seen} |", cell(hapt[k], scale), cell(lab[k], scale))?;
        }
        writeln!(text, " {} |", error.map_or(String::new(), |error| format!("{error:.2}")))?;
    }
    Ok(text)
}

/// Largest less smallest position of the last second, deg, and their mean.
fn reach((times, positions): &Trace) -> [f64; 2] {
    let end = times.last().copied().unwrap_or(0.0);
    let last = times.iter().zip(positions).filter(|(t, _)| **t > end - 1.01).map(|(_, x)| *x);
    let (low, high) = last.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    [high - low, 0.5 * (high + low)]
}

fn sine(folder: &Path, devices: &[Device; 2]) -> Result<String> {
    let motion = paddle(folder, "sine-0011")?;
    let own = fitted(sine_record(&motion)?)?.context("no fit of the sine")?.device;
    let [seen, _] = reach(&motion);
    let lab = Device { friction: RATIO * LAB_FRICTION[1], damping: RATIO * RATIO * LAB_DAMPING, ..devices[1] };
    let mut text = format!(
        "The record moves by {seen:.1} deg from end to end.\n\n\
         | device by | friction, N mm | hapt, without gravity, deg | with the authors' gravity, deg |\n| --- | --- | --- | --- |\n"
    );
    let gravity = format!("[device.gravity]\ntorque = {LAB_GRAVITY:e}\nphase = \"180 deg\"");
    for (name, device) in [
        ("the authors' friction and damping", lab),
        ("pid-encoder-p05-d0003", devices[0]),
        ("pid-encoder-p05-d0008", devices[1]),
        ("pid-encoder-p05-d0003, with the data sheet's damping", Device { damping: lab.damping, ..devices[0] }),
        ("this record", own),
    ] {
        let mut cells = String::new();
        for more in ["", &gravity] {
            let file = format!(
                "loop.period = \"350 us\"\n[device]\ninertia = {:e}\ndamping = {:e}\nfriction = {:e}\n{more}\n\
                 [scenarios.go]\nduration = \"15 s\"\nhand = {{ kind = \"torque\", moves = {{ kind = \"sine\", amplitude = {:e}, frequency = {:e} }} }}\n",
                device.inertia,
                device.damping,
                device.friction,
                RATIO * 1.1e-3,
                SINE / TAU
            );
            let world = World::read(&Source::from_text("sine.toml", file), &[])?;
            write!(cells, " {:.1} |", reach(&run(&world, 0.0)?)[0])?;
        }
        writeln!(text, "| {name} | {:.1} |{cells}", 1e3 * device.friction)?;
    }
    Ok(text)
}
