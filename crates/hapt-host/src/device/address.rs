//! The address of a device, and the requirements on a world there.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;
use std::str::FromStr;

use hapt_core::SafetyProfile;
#[cfg(target_os = "linux")]
use hapt_drive::{Address, Make};
use hapt_model::{EstimatorKind, Motion, World, did_you_mean};
use hapt_rt::Plan;

use super::DeviceError;
use crate::packed;

/// A device: `sim`, `replay:FILE`, `moteus:PATH|canX[#ID]`, `odrive:PATH[@RATE]|canX[#ID]`, `simplefoc:PATH[@BAUD]?CONSTANT`, or
/// `hapt:PATH[@BAUD]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceAddress {
    /// The exact simulation.
    Sim,
    /// The positions of a run, one per period: a CSV file or a log.
    Replay(PathBuf),
    /// A motor drive.
    Drive(Address),
    /// A board with hapt's firmware at a serial port, which runs the loop itself.
    Board(BoardPort),
}

/// Where drives are not supported there is no address of one.
#[cfg(not(target_os = "linux"))]
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {}

/// A board's serial port: `PATH`, or `PATH@BAUD`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardPort {
    /// The port.
    pub path: PathBuf,
    /// In bits per second.
    pub baud: u32,
}

/// The default rate of a board's line, in bits per second (docs/wire.md).
const BAUD: u32 = 921_600;

impl FromStr for BoardPort {
    type Err = DeviceError;

    fn from_str(text: &str) -> Result<Self, DeviceError> {
        let number = |baud: &str| !baud.is_empty() && baud.bytes().all(|byte| byte.is_ascii_digit());
        let (path, baud) = match text.rsplit_once('@').filter(|(_, baud)| number(baud)) {
            None => (text, BAUD),
            Some((path, baud)) => match baud.parse() {
                Ok(rate @ 300..=20_000_000) => (path, rate),
                _ => return Err(DeviceError::Address(format!("{baud} baud; expected 300 to 20000000"))),
            },
        };
        Ok(BoardPort { path: path.into(), baud })
    }
}

impl Display for BoardPort {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "hapt:{}", self.path.display())?;
        if self.baud == BAUD { Ok(()) } else { write!(f, "@{}", self.baud) }
    }
}

/// The drives' names, also for builds without drives.
const DRIVES: [&str; 3] = ["moteus", "odrive", "simplefoc"];

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

impl FromStr for DeviceAddress {
    type Err = DeviceError;

    fn from_str(text: &str) -> Result<Self, DeviceError> {
        match text.split_once(':') {
            None if text == "sim" => Ok(DeviceAddress::Sim),
            Some(("replay", file)) if !file.is_empty() => Ok(DeviceAddress::Replay(file.into())),
            Some(("hapt", port)) if !port.is_empty() => port.parse().map(DeviceAddress::Board),
            Some((word, _)) if DRIVES.contains(&word) => drive(text).map(DeviceAddress::Drive),
            _ => {
                let word = text.split_once(':').map_or(text, |(word, _)| word);
                let mut words = ["sim", "replay", "hapt"].into_iter().chain(DRIVES);
                let number = text.get(..3).filter(|com| com.eq_ignore_ascii_case("com")).and_then(|_| text.get(3..));
                let hint = if number.is_some_and(|number| number.parse::<u8>().is_ok()) {
                    format!("; did you mean \"hapt:{text}\"?")
                } else if text.trim_start().starts_with('/') {
                    // A serial port does not identify the connected device.
                    format!(
                        "; did you mean \"hapt:{text}\", \"moteus:{text}\", \"odrive:{text}\" or \"simplefoc:{text}?...\"?"
                    )
                } else if words.clone().any(|known| known == word) {
                    // A known word without its argument.
                    String::new()
                } else {
                    did_you_mean(word, &mut words)
                };
                Err(DeviceError::Address(format!(
                    "a device is sim, replay:FILE with a run's CSV or a log, a drive (moteus:..., odrive:..., simplefoc:...), or hapt:PATH with a board's \
                     serial port{hint}"
                )))
            }
        }
    }
}

#[cfg(target_os = "linux")]
fn drive(text: &str) -> Result<Address, DeviceError> {
    text.parse().map_err(DeviceError::Address)
}

#[cfg(not(target_os = "linux"))]
fn drive(text: &str) -> Result<Address, DeviceError> {
    Err(DeviceError::Unsupported { address: text.into(), what: "motor drives", systems: "Linux" })
}

impl Display for DeviceAddress {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            DeviceAddress::Sim => f.write_str("sim"),
            DeviceAddress::Replay(file) => write!(f, "replay:{}", file.display()),
            #[cfg(target_os = "linux")]
            DeviceAddress::Drive(address) => write!(f, "{address}"),
            #[cfg(not(target_os = "linux"))]
            DeviceAddress::Drive(address) => match *address {},
            DeviceAddress::Board(port) => write!(f, "{port}"),
        }
    }
}

impl DeviceAddress {
    /// Whether a motor is connected to it, so that a world has to be certified first.
    pub fn has_motor(&self) -> bool {
        match self {
            DeviceAddress::Sim | DeviceAddress::Replay(_) => false,
            DeviceAddress::Drive(_) | DeviceAddress::Board(_) => true,
        }
    }

    /// The same device with its motor's constant corrected, where the motor makes this part of the commanded torque; `None`: its address has no
    /// such constant.
    pub fn corrected(&self, gain: f64) -> Option<Self> {
        match self {
            #[cfg(target_os = "linux")]
            DeviceAddress::Drive(address) if gain.is_finite() && gain > 0.0 => {
                let (speed, motor) = address.board?;
                let board = Some((speed, motor.corrected(gain)));
                Some(DeviceAddress::Drive(Address { board, ..address.clone() }))
            }
            DeviceAddress::Sim | DeviceAddress::Replay(_) | DeviceAddress::Drive(_) | DeviceAddress::Board(_) => None,
        }
    }

    /// The overrides that a world needs on a motor, as `KEY=VALUE`: an encoder gives no true velocity, so that the estimator `exact` becomes
    /// `difference`, and is certified as such.
    ///
    /// # Errors
    /// [`DeviceError::Missing`]: a number that only the file can give.
    pub fn overrides(&self, world: &World) -> Result<Vec<String>, DeviceError> {
        if !self.has_motor() {
            return Ok(Vec::new());
        }
        let missing = |key, why| Err(DeviceError::Missing { key, why });
        if world.device.limit.is_none() {
            return missing("device.limit", "the largest torque that it may be commanded, such as \"800 N mm\"");
        }
        let is_drive = matches!(self, DeviceAddress::Drive(_));
        if is_drive && world.motion == Motion::Linear && world.device.drive.gear.is_none() {
            return missing("device.drive.gear", "the displacement of the puck for one revolution of the drive");
        }
        let home = world.device.drive.home;
        if world.counts_from_device() && home.is_none() {
            return missing(
                "device.drive.home",
                "where the world's 0 is by the drive's or encoder's own zero, from which a [[compensation]] of gravity or cogging counts",
            );
        }
        if !is_drive && home.is_some_and(|home| home != 0.0) {
            return Err(DeviceError::World(
                "device.drive.home: a board counts from its encoder's own zero; expected 0".into(),
            ));
        }
        let exact = world.sampling.estimator == EstimatorKind::Exact;
        Ok(exact.then(|| "loop.estimator=difference".into()).into_iter().collect())
    }

    /// The supervisor's profile for `world` on this device. On a motor only a certified world runs, unless `uncertified` allows any, with tighter
    /// limits.
    ///
    /// # Errors
    /// The world is not certified, or the core that runs the loop refuses it: this computer's, or a board's, which is smaller.
    pub fn profile(&self, world: &World, uncertified: bool) -> Result<SafetyProfile, DeviceError> {
        let profile = if self.has_motor() { certified(world, uncertified)? } else { SafetyProfile::Simulated };
        match self {
            DeviceAddress::Board(_) => packed(world, profile).map(drop).map_err(DeviceError::World)?,
            DeviceAddress::Sim | DeviceAddress::Replay(_) | DeviceAddress::Drive(_) => {
                Plan::new(world, profile).map(drop).map_err(|error| DeviceError::World(error.to_string()))?;
            }
        }
        Ok(profile)
    }
}

fn certified(world: &World, uncertified: bool) -> Result<SafetyProfile, DeviceError> {
    let check = hapt_analysis::check(world)?;
    match (check.certified.holds(), uncertified) {
        (true, _) => Ok(SafetyProfile::Certified),
        (false, true) => Ok(SafetyProfile::Uncertified),
        (false, false) => Err(DeviceError::NotCertified { verdict: check.verdict_sentence().to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use hapt_model::Source;

    use super::*;
    use crate::testing::world;

    #[test]
    fn an_address_reads_back() {
        for text in ["sim", "replay:runs/a:b.csv", "hapt:/dev/ttyACM0", "hapt:/dev/a@b", "hapt:/dev/ttyUSB0@115200"] {
            assert_eq!(text.parse::<DeviceAddress>().unwrap().to_string(), text);
        }
        for text in ["", "sim:", "replay:", "replay", "hapt:", "hapt:/dev/ttyACM0@299", "vesc:can0", "/dev/ttyACM0"] {
            assert!(matches!(text.parse::<DeviceAddress>(), Err(DeviceError::Address(_))), "{text}");
        }
    }

    #[test]
    fn a_motor_needs_a_limit_and_a_velocity_from_an_encoder() {
        let board: DeviceAddress = "hapt:/dev/ttyACM0".parse().unwrap();
        let mut world = world();
        world.sampling.estimator = EstimatorKind::Exact;
        assert_eq!(board.overrides(&world).unwrap(), ["loop.estimator=difference"]);
        world.device.limit = None;
        assert!(matches!(board.overrides(&world), Err(DeviceError::Missing { key: "device.limit", .. })));
        assert!(DeviceAddress::Sim.overrides(&world).unwrap().is_empty());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_motor_needs_a_home_for_a_compensation_that_counts_from_it() {
        let motors: [DeviceAddress; 2] = ["moteus:/dev/ttyACM0", "hapt:/dev/ttyACM0"].map(|text| text.parse().unwrap());
        let overrides = |motor: usize, of: &str, home: &str| {
            let text = format!(
                "[loop]\nperiod = \"1 ms\"\nestimator = \"difference\"\n[device]\ninertia = 6.4e-4\nfriction = 0.01\nlimit = 1\n\
                 [device.gravity]\ntorque = 0.1\n[device.cogging]\ntorque = 0.1\npitch = 0.2\nsine = [1]\n{home}\
                 [[compensation]]\nshare = 0.5\nof = \"{of}\"\n"
            );
            let world = World::read(&Source::from_text("w.toml", &text), &[]).unwrap();
            motors[motor].overrides(&world)
        };
        for motor in [0, 1] {
            for of in ["gravity", "cogging"] {
                let without = overrides(motor, of, "");
                assert!(matches!(without, Err(DeviceError::Missing { key: "device.drive.home", .. })), "{without:?}");
                assert!(overrides(motor, of, "[device.drive]\nhome = 0\n").is_ok());
                // A board has no place for another one.
                assert_eq!(overrides(motor, of, "[device.drive]\nhome = 0.5\n").is_ok(), motor == 0);
            }
            assert!(overrides(motor, "friction\"\nvelocity = \"0.2 rad/s", "").is_ok());
        }
    }

    /// A spring so stiff that the loop is unstable.
    #[test]
    fn an_uncertified_world_runs_on_a_motor_on_request_only() {
        let mut world = world();
        let board: DeviceAddress = "hapt:/dev/ttyACM0".parse().unwrap();
        world.sampling.period = 0.1;
        assert!(matches!(board.profile(&world, false), Err(DeviceError::NotCertified { .. })));
        assert_eq!(board.profile(&world, true).unwrap(), SafetyProfile::Uncertified);
        assert_eq!(DeviceAddress::Sim.profile(&world, false).unwrap(), SafetyProfile::Simulated);
    }
}
