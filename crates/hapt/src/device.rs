//! The devices of `--device SPEC`.

use std::fmt::{self, Display, Formatter};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use hapt_core::SafetyProfile;
#[cfg(target_os = "linux")]
use hapt_drive::Make;
use hapt_host::{Backend, Machine};
use hapt_model::{EstimatorKind, Motion, World, did_you_mean};
use hapt_rt::{Device, Hands, Position, Replay, SimulatedDevice};

use crate::args::RealtimeArgs;
use crate::board;
use crate::drives::{self, Address};
use crate::failure::Failure;
use crate::format;
use crate::latency::settings;
use crate::log;

/// A device, as it is named on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Spec {
    /// The exact simulation.
    Sim,
    /// The positions of a run, one a period.
    Replay(PathBuf),
    /// A motor drive.
    Drive(Address),
    /// A board with hapt's firmware at a serial port, which runs the loop itself.
    Board(Port),
}

/// A board's serial port: `PATH`, or `PATH@BAUD`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    pub path: PathBuf,
    /// In bits per second.
    pub baud: u32,
}

impl FromStr for Port {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // docs/wire.md
        const USUAL: u32 = 921_600;
        let number = |baud: &str| !baud.is_empty() && baud.bytes().all(|byte| byte.is_ascii_digit());
        let (path, baud) = match text.rsplit_once('@').filter(|(_, baud)| number(baud)) {
            None => (text, USUAL),
            Some((path, baud)) => match baud.parse() {
                Ok(rate @ 300..=20_000_000) => (path, rate),
                _ => return Err(format!("{baud} baud; expected 300 to 20000000")),
            },
        };
        Ok(Port { path: path.into(), baud })
    }
}

/// The drives' names, also for builds without drives.
const DRIVES: [&str; 2] = ["moteus", "odrive"];

#[cfg(target_os = "linux")]
const _: () = {
    assert!(DRIVES.len() == Make::NAMES.len(), "DRIVES lacks a drive");
    let mut i = 0;
    while i < DRIVES.len() {
        let (here, there) = (DRIVES[i].as_bytes(), Make::NAMES[i].as_bytes());
        assert!(here.len() == there.len(), "DRIVES differs from the drives' names");
        let mut j = 0;
        while j < here.len() {
            assert!(here[j] == there[j], "DRIVES differs from the drives' names");
            j += 1;
        }
        i += 1;
    }
};

impl FromStr for Spec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "sim" => Ok(Spec::Sim),
            Some(("replay", file)) if !file.is_empty() => Ok(Spec::Replay(file.into())),
            Some(("hapt", port)) if !port.is_empty() => port.parse().map(Spec::Board),
            Some((word, _)) if DRIVES.contains(&word) => text.parse().map(Spec::Drive),
            _ => {
                let word = text.split_once(':').map_or(text, |(word, _)| word);
                let number = text.get(..3).filter(|com| com.eq_ignore_ascii_case("com")).and_then(|_| text.get(3..));
                let is_com = number.is_some_and(|number| number.parse::<u8>().is_ok());
                let hint = match text.trim_start().starts_with('/') {
                    _ if is_com => format!("; did you mean \"hapt:{text}\"?"),
                    // A serial port does not show what is connected to it.
                    true => format!("; did you mean \"hapt:{text}\", \"moteus:{text}\" or \"odrive:{text}\"?"),
                    // A known word without its argument.
                    false if ["sim", "replay", "hapt"].into_iter().chain(DRIVES).any(|known| known == word) => {
                        String::new()
                    }
                    false => did_you_mean(word, ["sim", "replay", "hapt"].into_iter().chain(DRIVES)),
                };
                Err(format!(
                    "a device is sim, replay:FILE with a run's CSV or a log, a drive (moteus:..., odrive:...), or hapt:PATH with a board's \
                     serial port{hint}"
                ))
            }
        }
    }
}

impl Display for Spec {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Spec::Sim => f.write_str("the simulated device"),
            Spec::Replay(file) => write!(f, "the positions of {}", file.display()),
            Spec::Board(port) => write!(f, "{}", port.path.display()),
            Spec::Drive(address) => write!(f, "the drive {address}"),
        }
    }
}

impl Spec {
    /// Parses the value of `--device`.
    pub fn named(text: &str) -> Result<Self, Failure> {
        text.parse().map_err(|wrong| Failure::input(format!("--device {text}: {wrong}")))
    }

    /// Whether a motor hangs on it, so that a world has to be certified first.
    pub fn has_a_motor(&self) -> bool {
        match self {
            Spec::Sim | Spec::Replay(_) => false,
            Spec::Drive(_) | Spec::Board(_) => true,
        }
    }

    /// The additional conditions of a real device on the world file, and the resulting overrides. The velocity is
    /// differenced from positions, as it is certified.
    pub fn overrides(&self, world: &World) -> Result<Vec<String>, Failure> {
        // A board brings its own.
        if !matches!(self, Spec::Drive(_)) {
            return Ok(Vec::new());
        }
        let missing = |key: &str, why: &str| Failure::input(format!("a real motor needs {key}: {why}"));
        if world.device.limit.is_none() {
            return Err(missing("device.limit", "the largest torque that it may be commanded"));
        }
        if world.motion == Motion::Linear && world.device.drive.gear.is_none() {
            return Err(missing("device.drive.gear", "the displacement of the puck for one revolution of the drive"));
        }
        let exact = world.sampling.estimator == EstimatorKind::Exact;
        Ok(exact.then(|| "loop.estimator=difference".into()).into_iter().collect())
    }

    /// The machine that runs the loop of `world`, and its name in the summary of a run. A board sends a sample every `every` s.
    pub fn machine(
        &self,
        name: &str,
        realtime: &RealtimeArgs,
        world: &World,
        profile: SafetyProfile,
        every: f64,
    ) -> Result<(Machine, String), Failure> {
        let (backend, hands, on) = match self {
            Spec::Board(port) => {
                let (backend, on) = board::backend(port, every)?;
                (backend, None, on)
            }
            Spec::Sim | Spec::Replay(_) | Spec::Drive(_) => {
                let settings = settings(realtime, world)?;
                let (device, hands) = self.open(world)?;
                (Backend::Local { device, settings }, hands, self.to_string())
            }
        };
        Ok((Machine { name: name.into(), backend, hands, profile }, on))
    }

    /// The device for `world`, and the commands of its hand, where it is a simulated one.
    pub fn open(&self, world: &World) -> Result<(Box<dyn Device>, Option<Hands>), Failure> {
        match self {
            Spec::Sim => {
                let (device, hands) = SimulatedDevice::new(world);
                Ok((Box::new(device), Some(hands)))
            }
            Spec::Replay(file) => Ok((Box::new(Replay::new(positions(file, world.motion)?)), None)),
            Spec::Drive(address) => Ok((drives::open(address, world)?, None)),
            // Its loop is not on this computer.
            Spec::Board(Port { path, .. }) => {
                Err(Failure::input(format!("hapt:{}: a loop on this computer cannot drive a board", path.display())))
            }
        }
    }
}

/// The most positions of a recording: three hours and a half at 1 kHz, some 300 MB.
const MOST: usize = 1 << 23 | 1 << 22;
/// A longer line is no run's: 64 bodies in full digits take a tenth of it.
const LONGEST: u64 = 1 << 20;

/// Refuses a recording that does not end.
fn within(name: &str, positions: &[Position]) -> Result<(), Failure> {
    if positions.len() < MOST {
        return Ok(());
    }
    let message = format!("it has more than {} samples; expected a shorter recording", format::count(MOST as u64));
    Err(Failure::input(format!("{name}: {message}")))
}

/// The puck's positions and velocities in a log.
fn logged(path: &Path) -> Result<Vec<Position>, Failure> {
    let mut opened = log::open(path)?;
    let mut positions = Vec::new();
    while let Some(sample) = opened.log.next().map_err(|error| log::failure(&opened.name, error))? {
        within(&opened.name, &positions)?;
        // Time, then the puck: the first columns of every log.
        if let [_, position, velocity, ..] = *sample.values {
            positions.push(Position { position, velocity, announced: true });
        }
    }
    if positions.is_empty() { Err(Failure::input(format!("{} has no samples", opened.name))) } else { Ok(positions) }
}

/// The puck's positions and velocities in a run's CSV, or in a log.
fn positions(path: &Path, motion: Motion) -> Result<Vec<Position>, Failure> {
    let name = path.display();
    let wrong = |line: usize, message: String| Failure::input(format!("{name}, line {line}: {message}"));
    let mut file = BufReader::new(File::open(path).map_err(|error| log::missing(path, &error))?);
    let first = file.fill_buf().map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
    if hapt_log::is_log(first) {
        return logged(path);
    }
    let columns = match motion {
        Motion::Rotary => ["puck_rad", "puck_rad_per_s"],
        Motion::Linear => ["puck_m", "puck_m_per_s"],
    };
    let mut places = None;
    let mut positions = Vec::new();
    let mut text = Vec::new();
    for i in 0.. {
        within(&name.to_string(), &positions)?;
        text.clear();
        let read = (&mut file).take(LONGEST).read_until(b'\n', &mut text);
        match read.map_err(|error| wrong(i + 1, error.to_string()))? as u64 {
            0 => break,
            LONGEST => return Err(wrong(i + 1, "the line does not end within 1 MiB".into())),
            _ => {}
        }
        let line = std::str::from_utf8(&text).map_err(|_| wrong(i + 1, "it is not UTF-8 text".into()))?;
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let Some(places) = places else {
            let place = |column: &str| {
                let missing = || wrong(1, format!("no column {column}; hapt sim --out writes such files"));
                fields.iter().position(|field| *field == column).ok_or_else(missing)
            };
            places = Some([place(columns[0])?, place(columns[1])?]);
            continue;
        };
        let number = |place: usize| {
            let field = fields.get(place).copied().unwrap_or_default();
            let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| wrong(i + 1, format!("{field:?} is not a finite number")))
        };
        positions.push(Position { position: number(places[0])?, velocity: number(places[1])?, announced: true });
    }
    if positions.is_empty() {
        return Err(Failure::input(format!("{name} has no rows")));
    }
    Ok(positions)
}
