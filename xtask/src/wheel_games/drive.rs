//! The car as a game of its own process: it reads the steering from evdev and sets a constant effect frame by frame, through Linux's own driver of force
//! feedback, with `hapt wheel` at the other end.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{fs, thread};

use anyhow::{Context, Result, anyhow, bail, ensure};
use fastrand::Rng;
use hapt_core::wheel::{Device, Effect, Timing, Wheel as Effects};
use hapt_host::conform::evdev::{Evdev, wheels};
use hapt_host::conform::{HostEffect, RIGHT, Wheel as _};
use hapt_log::Log;

use super::car::Car;
use super::record::WHEELS;
use crate::random::log_between;
use crate::{marked, vm};

const PAGE: &str = "docs/wheel.md";
/// s
const PERIOD: f64 = 1e-3;
/// Of a run, and when the hands release the wheel, s after full torque.
const DURATION: f64 = 12.0;
const RELEASE: f64 = 4.0;
/// The interval over which the hands' torque is compared, s after full torque.
const COMPARED: Range<f64> = 1.0..RELEASE - 0.1;
/// From one end of the steering to the other, rad.
const RANGE: f64 = 5.0 * std::f64::consts::PI;
/// Frames a second, and frames late.
const RATES: [f64; 3] = [60.0, 100.0, 333.0];
const LATE: [usize; 3] = [1, 2, 3];
/// A firm and a light grip: stiffness in N·m/rad, damping in N·m·s/rad.
const GRIPS: [[f64; 2]; 2] = [[60.0, 2.0], [10.0, 0.8]];
/// The longest time from an angle to its torque in the search, samples.
const LONGEST: i32 = 60;
/// The largest difference of the clocks of the game and of the record, samples.
const APART: i32 = 1000;
/// The wheel appears, or there is none.
const APPEARS: Duration = Duration::from_secs(60);

/// A game on a wheel, in a driver's hands.
struct Game {
    seed: u64,
    wheel: [f64; 5],
    grip: [f64; 2],
    /// Frames a second.
    rate: f64,
    /// Frames from reading the angle to sending its torque.
    late: usize,
}

/// The game's signals at a frame.
struct Frame {
    /// s since 1970
    time: f64,
    /// The angle that it read, rad.
    angle: f64,
    /// The torque that it sent, N·m.
    level: f64,
}

/// A sample of the record.
struct Sample {
    time: f64,
    angle: f64,
    speed: f64,
    /// The torque of the effects with the added one, N·m.
    torque: f64,
}

/// The result of a run.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// The largest speeds in the first and in the last second without hands, rad/s.
    first: f64,
    last: f64,
    /// With hands: the rms of the torque in addition to the game's, relative to it, and the time from an angle to its torque at the motor
    /// without the game's own lateness, s.
    felt: f64,
    lag: f64,
}

/// `cargo xtask guest car [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    ensure!(words.is_empty() || words == ["--write"], "expected --write or nothing");
    marked::publish(PAGE, "cargo xtask guest car", &vm::car()?, !words.is_empty())
}

/// `xtask guest drive HAPT`, in the guest: every game, with hapt's damping and without.
pub fn all(hapt: &str) -> Result<()> {
    println!(
        "| frames a second, late | wheel | hands off, with nothing, rad/s: at first | at last | with hapt: at first | at last | firm grip: torque \
         beside the game's | with nothing | light grip | from angle to torque, ms | with nothing |\n| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | \
         ---: | ---: |"
    );
    let cells = RATES.into_iter().flat_map(|rate| LATE.map(|late| (rate, late)));
    for ((rate, late), (name, wheel)) in cells.zip(WHEELS.into_iter().cycle()) {
        let mut outcomes = Vec::new();
        for grip in GRIPS {
            // The same game in both hands.
            let game = Game { seed: rate as u64 + late as u64, wheel, grip, rate, late };
            for acts in [false, true] {
                let outcome = run(hapt, &game, acts)?;
                eprintln!("{rate} {late} {name} {grip:?} {acts} {outcome:?}");
                outcomes.push(outcome);
            }
        }
        let [firm_nothing, firm, light_nothing, light] = outcomes[..] else { bail!("{} outcomes", outcomes.len()) };
        let worst = |[one, other]: [Outcome; 2], of: fn(Outcome) -> f64| of(one).max(of(other));
        let (nothing, acting) = ([firm_nothing, light_nothing], [firm, light]);
        let mut text = format!("| {rate:.0}, {late} | {name} |");
        for both in [nothing, acting] {
            let _ = write!(text, " {:.2} | {:.2} |", worst(both, |one| one.first), worst(both, |one| one.last));
        }
        for outcome in [firm, firm_nothing, light] {
            let _ = write!(text, " {:.1} % |", 100.0 * outcome.felt);
        }
        // In a light grip a swing can hide it.
        println!("{text} {:.0} | {:.0} |", 1e3 * firm.lag, 1e3 * firm_nothing.lag);
    }
    Ok(())
}

/// One game on `hapt wheel`.
fn run(hapt: &str, game: &Game, acts: bool) -> Result<Outcome> {
    fs::write("wheel.toml", game.world())?;
    let _ = fs::remove_file("wheel.mcap");
    let mut command = Command::new(hapt);
    command.args(["wheel", "wheel.toml", "--scenario", "drive", "--log", "wheel.mcap"]);
    if !acts {
        command.arg("--dry");
    }
    let mut wheel = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    let frames = game.play(&mut wheel);
    if frames.is_err() {
        let _ = wheel.kill();
    }
    let status = wheel.wait()?;
    let frames = frames?;
    ensure!(status.success(), "hapt wheel ends with {status}");
    game.outcome(&frames, &recorded("wheel.mcap".as_ref())?)
}

impl Game {
    /// The wheel, and the hand that steers it.
    fn world(&self) -> String {
        let ([inertia, damping, friction, counts, limit], [stiffness, viscous]) = (self.wheel, self.grip);
        format!(
            "[loop]\nperiod = \"{PERIOD} s\"\nestimator = \"difference\"\n[device]\ninertia = \"{inertia} kg m^2\"\ndamping = \"{damping} N m s/rad\"\n\
             friction = \"{friction} N m\"\nencoder = {counts}\nlimit = \"{limit} N m\"\n[scenarios.drive]\nduration = \"{DURATION} s\"\nhand = {{ kind = \
             \"grip\", inertia = \"2e-3 kg m^2\", stiffness = \"{stiffness} N m/rad\", damping = \"{viscous} N m s/rad\", release = \"{RELEASE} s\", \
             moves = {{ kind = \"sine\", amplitude = \"0.6 rad\", frequency = \"0.625 Hz\" }} }}\n"
        )
    }

    /// Plays on the wheel that this starts, until it is detached.
    fn play(&self, hapt: &mut Child) -> Result<Vec<Frame>> {
        let begin = Instant::now();
        let mut device = loop {
            match wheels()?.0.first() {
                Some(device) => break Evdev::open(&device.path, || false).map_err(|error| anyhow!("{error}"))?,
                None if hapt.try_wait()?.is_some() => bail!("hapt wheel has ended"),
                None => ensure!(begin.elapsed() < APPEARS, "the wheel does not appear"),
            }
            thread::sleep(Duration::from_millis(10));
        };
        let mut rng = Rng::with_seed(self.seed);
        let limit = self.wheel[4];
        let stiffness = log_between(&mut rng, 2.0, 40.0);
        let mut car = Car::random(stiffness, true, &mut rng);
        let pauses = rng.bool();
        let (mut frames, mut levels, mut trace) = (Vec::new(), vec![0.0; self.late], Vec::new());
        let (mut kerb_end, mut kerb_at) = (0.0, 1.0 + rng.f64());
        let start = device.now();
        device
            .put(0, &HostEffect::constant(0.0, RIGHT))
            .and_then(|()| device.start(0, 1))
            .map_err(|error| anyhow!("{error}"))?;
        for frame in 0_u32.. {
            let t = f64::from(frame) / self.rate;
            if device.watch(start + t, &mut trace).is_err() {
                break;
            }
            if pauses && (3.0..3.5).contains(&t) {
                continue;
            }
            // The wheel is at full torque later than the game begins: no kerb shakes it once it is released.
            if t > kerb_at && t < RELEASE - 0.5 {
                (kerb_end, kerb_at) = (t + 0.3, t + 0.5 + 2.0 * rng.f64());
            }
            let stone = if ((30.0 * t) as u32).is_multiple_of(2) { 0.1 } else { -0.1 };
            let kerb = if t < kerb_end { stone * limit } else { 0.0 };
            let engine = 0.002 * limit * (rng.f64() - 0.5);
            let angle = 0.5 * RANGE * trace.last().map_or(0.0, |(_, share)| *share);
            levels.push((car.drive(angle, 1.0 / self.rate) + kerb + engine).clamp(-limit, limit));
            let level = levels.remove(0);
            if device.put(0, &HostEffect::constant(level / limit, RIGHT)).is_err() {
                break;
            }
            let time = SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs_f64();
            frames.push(Frame { time, angle, level });
        }
        Ok(frames)
    }

    /// The levels of the game at each sample with nothing added, where a level acts `after` its sending.
    fn requested(&self, frames: &[Frame], samples: &[Sample], after: f64) -> Result<Vec<f64>> {
        let [_, damping, _, counts, limit] = self.wheel;
        let ideal = Device::ideal(Timing::even(PERIOD), damping, limit);
        let device = Device { count: std::f64::consts::TAU / counts, ..ideal };
        let wheel = Effects::<f64>::new(&device).map_err(|error| anyhow!("{error}"))?;
        let (mut state, mut next) = (wheel.start(), 0);
        Ok(samples
            .iter()
            .map(|sample| {
                while frames.get(next).is_some_and(|frame| frame.time + after <= sample.time) {
                    next += 1;
                }
                let level = next.checked_sub(1).and_then(|at| frames.get(at)).map_or(0.0, |frame| frame.level);
                wheel.step(&mut state, sample.angle, &[Effect::Torque(level)], next as u32).torque
            })
            .collect())
    }

    fn outcome(&self, frames: &[Frame], samples: &[Sample]) -> Result<Outcome> {
        let begin = samples.first().context("no sample at full torque")?.time;
        let during = |range: Range<f64>| samples.iter().filter(move |sample| range.contains(&(sample.time - begin)));
        let fastest = |range| during(range).map(|sample: &Sample| sample.speed.abs()).fold(0.0, f64::max);
        let squares = |of: &dyn Fn(usize) -> f64| {
            let within = |at: &usize| COMPARED.contains(&(samples[*at].time - begin));
            (0..samples.len()).filter(within).map(|at| of(at) * of(at)).sum::<f64>()
        };
        // A record's clock begins when the program does.
        let held: Vec<&Sample> = during(0.0..RELEASE).collect();
        let apart = least(-APART..APART, |apart| Ok(misread(frames, &held, f64::from(apart) * PERIOD)))?.0;
        let (late, felt) = least(apart..apart + LONGEST, |late| {
            // A level comes a sample sooner or later.
            let mut requested = Vec::new();
            for nearby in [late, late - 1, late + 1] {
                requested.push(self.requested(frames, samples, f64::from(nearby) * PERIOD)?);
            }
            let least = |at: usize| {
                requested
                    .iter()
                    .map(|requested| (samples[at].torque - requested[at]).abs())
                    .fold(f64::INFINITY, f64::min)
            };
            Ok((squares(&least) / squares(&|at| requested[0][at]).max(1e-12)).sqrt())
        })?;
        let lag = f64::from(late - apart) * PERIOD;
        let (first, last) = (fastest(RELEASE + 0.1..RELEASE + 1.1), fastest(DURATION - 1.0..DURATION));
        Ok(Outcome { first, last, felt, lag })
    }
}

/// The place of the minimum, and its value.
fn least(among: Range<i32>, of: impl Fn(i32) -> Result<f64>) -> Result<(i32, f64)> {
    let mut found = (among.start, f64::INFINITY);
    for at in among {
        let size = of(at)?;
        if size < found.1 {
            found = (at, size);
        }
    }
    Ok(found)
}

/// The mean square difference of the angles that the game read from those of the record `after` seconds later.
fn misread(frames: &[Frame], samples: &[&Sample], after: f64) -> f64 {
    let rate =
        frames.len() as f64 / frames.last().zip(frames.first()).map_or(1.0, |(last, first)| last.time - first.time);
    let most = rate * samples.len() as f64 * PERIOD;
    let (mut sum, mut count, mut at) = (0.0, 0.0, 0);
    for frame in frames {
        while samples.get(at).is_some_and(|sample| sample.time < frame.time + after) {
            at += 1;
        }
        if let Some(sample) = samples.get(at).filter(|_| at > 0) {
            sum += (sample.angle - frame.angle).powi(2);
            count += 1.0;
        }
    }
    // A shift with few common samples is not used.
    if count < 0.8 * most { f64::INFINITY } else { sum / count }
}

/// The samples of a record at full torque.
fn recorded(path: &Path) -> Result<Vec<Sample>> {
    let mut log = Log::open(path)?;
    let columns: Vec<String> = log.plan().columns.iter().map(|column| column.name.clone()).collect();
    let place =
        |name: &str| columns.iter().position(|column| column == name).with_context(|| format!("no column {name}"));
    let [phase, angle, speed, torque] =
        [place("phase")?, place("puck_rad")?, place("puck_rad_per_s")?, place("link_Nm")?];
    let running = 2.0;
    let mut samples = Vec::new();
    while let Some(sample) = log.next()? {
        let of = |place: usize| sample.values.get(place).copied().unwrap_or(f64::NAN);
        if of(phase) == running {
            let time = sample.log_time as f64 * 1e-9;
            samples.push(Sample { time, angle: of(angle), speed: of(speed), torque: of(torque) });
        }
    }
    Ok(samples)
}
