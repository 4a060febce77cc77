//! Addresses of buses and of drives on them: `moteus:/dev/ttyACM0`, `odrive:can0#3`, `odrive:/dev/ttyACM0@250k`,
//! `simplefoc:/dev/ttyACM0?volts-per-torque=20`.

use std::fmt;
use std::io;
use std::path::Path;
use std::str::FromStr;

use crate::can::{Bus, Socket};
use crate::drive::{Drive, Error};
use crate::ports::ports;
use crate::serial::{Line, SPEED};
use crate::simplefoc::{self, MotorConstant};
use crate::simulate::Firmware;
use crate::slcan::{self, Rate};
use crate::{moteus, odrive};

hapt_core::named! {
    /// The make of a drive.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Make {
        /// mjbots' moteus.
        Moteus => "moteus",
        /// An ODrive.
        Odrive => "odrive",
        /// SimpleFOC on a maker's board.
        Simplefoc => "simplefoc",
    }
}

/// A CAN bus: an interface of the system, or an adapter on a serial port, with its rate.
///
/// ```
/// use hapt_drive::BusAddress;
///
/// let address: BusAddress = "/dev/ttyACM0@250k".parse()?;
/// assert!(address.is_port() && !"can0".parse::<BusAddress>()?.is_port());
/// assert!("can0@250k".parse::<BusAddress>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusAddress {
    /// The path of a serial port, or the name of a CAN interface.
    pub place: String,
    /// The bit rate of an slcan adapter's bus; `None`: not given.
    pub rate: Option<Rate>,
}

impl FromStr for BusAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // A path may contain an @: a rate starts with a digit.
        let (place, rate) =
            match text.rsplit_once('@').filter(|(_, rate)| rate.starts_with(|c: char| c.is_ascii_digit())) {
                None => (text, None),
                Some((place, rate)) => (place, Some(rate.parse::<Rate>()?)),
            };
        if place.is_empty() {
            return Err("the port is missing".into());
        }
        let address = BusAddress { place: place.into(), rate };
        if rate.is_some() && !address.is_port() {
            return Err(format!(
                "{place} is a network interface, and the system sets its rate: ip link set {place} up type can bitrate 250000"
            ));
        }
        Ok(address)
    }
}

impl fmt::Display for BusAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.place)?;
        self.rate.map_or(Ok(()), |rate| write!(f, "@{rate}"))
    }
}

impl BusAddress {
    /// Whether its place is a serial port, not a CAN interface.
    pub fn is_port(&self) -> bool {
        self.place.contains('/')
    }

    /// Opens the interface, or the port as that of an slcan adapter, for frames with 29-bit identifiers that agree with `id` in the bits of
    /// `mask`; an adapter gives others too.
    ///
    /// # Errors
    /// The interface or port cannot be opened.
    pub fn open_for(&self, id: u32, mask: u32) -> io::Result<Box<dyn Bus>> {
        if self.is_port() { self.open_adapter() } else { Ok(Box::new(Socket::open_for(&self.place, id, mask)?)) }
    }

    fn open_adapter(&self) -> io::Result<Box<dyn Bus>> {
        let line = Line::open(Path::new(&self.place))?;
        Ok(Box::new(slcan::Client::open(line, self.rate.unwrap_or_default())?))
    }
}

/// A drive on a port or bus.
///
/// ```
/// use hapt_drive::{Address, Make};
///
/// let address: Address = "odrive:/dev/ttyACM0@250k#3".parse()?;
/// assert_eq!((address.make, address.bus.place.as_str(), address.id), (Make::Odrive, "/dev/ttyACM0", 3));
/// assert!("odrive:can0#99".parse::<Address>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Its make.
    pub make: Make,
    /// Its bus, or the serial port of its adapter.
    pub bus: BusAddress,
    /// Its identifier on the bus.
    pub id: u8,
    /// Of a SimpleFOC board: the speed of its port in bits per second, and its motor.
    pub board: Option<(u32, MotorConstant)>,
}

impl Make {
    /// Its name with its article.
    pub const fn one(self) -> &'static str {
        match self {
            Make::Moteus => "a moteus",
            Make::Odrive => "an ODrive",
            Make::Simplefoc => "a SimpleFOC board",
        }
    }

    /// The range of its identifiers.
    pub const fn ids(self) -> std::ops::RangeInclusive<u8> {
        match self {
            Make::Moteus => 1..=126,
            Make::Odrive => 0..=62,
            // It is the only device on its port.
            Make::Simplefoc => 1..=1,
        }
    }

    /// The rate of its bus, where it has only one.
    pub const fn rate(self) -> Option<&'static str> {
        match self {
            Make::Moteus => Some("1 Mbit/s with 5 Mbit/s for the data"),
            Make::Odrive | Make::Simplefoc => None,
        }
    }

    /// Whether it can be on a CAN bus.
    pub const fn has_can(self) -> bool {
        match self {
            Make::Moteus | Make::Odrive => true,
            Make::Simplefoc => false,
        }
    }

    /// The firmware of a simulated drive with this identifier.
    pub fn simulated(self, id: u8) -> Box<dyn Firmware> {
        match self {
            Make::Moteus => Box::new(moteus::Simulated::new(id)),
            Make::Odrive => Box::new(odrive::Simulated::new(id)),
            Make::Simplefoc => Box::new(simplefoc::Simulated::new()),
        }
    }

    /// The same with a motor of this constant, controlled in its unit; `None`: its firmware knows no constant.
    pub fn with_motor(self, motor: MotorConstant) -> Option<Box<dyn Firmware>> {
        match self {
            Make::Moteus | Make::Odrive => None,
            Make::Simplefoc => Some(Box::new(simplefoc::Simulated::new().with_motor(motor))),
        }
    }

    /// The adapter of a simulated drive on a serial line.
    pub fn adapter(self, line: Line) -> Box<dyn Bus> {
        match self {
            Make::Moteus => Box::new(moteus::Adapter::new(line)),
            Make::Odrive => Box::new(slcan::Adapter::new(line)),
            Make::Simplefoc => Box::new(simplefoc::Adapter::new(line)),
        }
    }
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (make, rest) = text.split_once(':').ok_or("a drive is moteus:PATH, odrive:PATH or simplefoc:PATH")?;
        let make = Make::from_name(make)
            .ok_or_else(|| format!("{make:?} is not a known drive; expected {}", Make::NAMES.join(", ")))?;
        if make == Make::Simplefoc {
            return board(rest);
        }
        let (place, id) = match rest.rsplit_once('#') {
            None => (rest, 1),
            Some((place, id)) => {
                let ids = make.ids();
                let id = id.parse().ok().filter(|id| ids.contains(id)).ok_or_else(|| {
                    format!("{id:?} is not an identifier of {}; expected {} to {}", make.one(), ids.start(), ids.end())
                })?;
                (place, id)
            }
        };
        if place.is_empty() || place.starts_with('@') {
            let name = make.name();
            return Err(format!(
                "the port is missing: {name}:/dev/ttyACM0, or {name}:can0 on a CAN interface; hapt devices lists them"
            ));
        }
        let bus: BusAddress = place.parse()?;
        let address = Address { make, bus, id, board: None };
        if address.bus.rate.is_none() {
            return Ok(address);
        }
        match make.rate() {
            Some(own) => Err(format!("{}'s bus has one rate, {own}: leave it out", make.one())),
            None => Ok(address),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.board {
            None => write!(f, "{}:{}#{}", self.make.name(), self.bus, self.id),
            Some((SPEED, motor)) => write!(f, "{}:{}?{motor}", self.make.name(), self.bus),
            Some((speed, motor)) => write!(f, "{}:{}@{speed}?{motor}", self.make.name(), self.bus),
        }
    }
}

/// The address of a SimpleFOC board: `PATH[@BAUD]?volts-per-torque=V` or `?torque-constant=K`.
fn board(text: &str) -> Result<Address, String> {
    let (place, motor) = text.split_once('?').unwrap_or((text, ""));
    if motor.is_empty() {
        return Err(format!(
            "its motor's constant is missing: simplefoc:{place}?volts-per-torque=20 in V/(N m) where its sketch controls a voltage, or \
             simplefoc:{place}?torque-constant=0.05 in N m/A where it controls a current; hapt identify --inertia measures it"
        ));
    }
    let motor = motor.parse()?;
    let number = |baud: &str| !baud.is_empty() && baud.bytes().all(|byte| byte.is_ascii_digit());
    let (place, speed) = match place.rsplit_once('@').filter(|(_, baud)| number(baud)) {
        None => (place, SPEED),
        Some((place, baud)) => {
            let speed = baud.parse().ok().filter(|speed| (300..=20_000_000).contains(speed));
            (place, speed.ok_or_else(|| format!("{baud} baud; expected 300 to 20000000"))?)
        }
    };
    let bus = BusAddress { place: place.into(), rate: None };
    if !bus.is_port() {
        return Err(format!(
            "{place:?} is not the path of a serial port, such as /dev/ttyACM0; hapt devices lists them"
        ));
    }
    Ok(Address { make: Make::Simplefoc, bus, id: 1, board: Some((speed, motor)) })
}

impl Address {
    /// Whether its place is a serial port, not a CAN interface.
    pub fn is_port(&self) -> bool {
        self.bus.is_port()
    }

    /// Opens the port or interface. Sends nothing to the drive.
    ///
    /// # Errors
    /// The port or interface cannot be opened.
    pub fn open(&self) -> Result<Box<dyn Drive>, Error> {
        let BusAddress { place, .. } = &self.bus;
        let wrong = |error| Error::Open { name: place.clone(), error };
        match self.make {
            Make::Moteus => {
                let bus: Box<dyn Bus> = if self.is_port() {
                    let path = Path::new(place);
                    let line = Line::open(path).map_err(wrong)?;
                    // Only an fdcanusb works without a CRC.
                    Box::new(moteus::Client::new(line, !is_adapter(path)))
                } else {
                    Box::new(Socket::open(place).map_err(wrong)?)
                };
                Ok(Box::new(moteus::Moteus::new(bus, self.id, place.clone())))
            }
            Make::Odrive => {
                let bus = if self.is_port() {
                    self.bus.open_adapter().map_err(wrong)?
                } else {
                    Box::new(Socket::open(place).map_err(wrong)?)
                };
                Ok(Box::new(odrive::Odrive::new(bus, self.id, place)))
            }
            Make::Simplefoc => {
                let missing = || wrong(io::Error::new(io::ErrorKind::InvalidInput, "its motor's constant is missing"));
                let (speed, motor) = self.board.ok_or_else(missing)?;
                let line = Line::open_at(Path::new(place), speed).map_err(wrong)?;
                Ok(Box::new(simplefoc::SimpleFoc::new(Box::new(simplefoc::Client::new(line)), motor, place)))
            }
        }
    }
}

fn is_adapter(path: &Path) -> bool {
    let path = path.canonicalize().unwrap_or(path.into());
    let is_cans = |port: &crate::Port| port.specs.iter().any(|spec| !spec.starts_with(Make::Simplefoc.name()));
    ports().iter().any(|port| Path::new(&port.name) == path && is_cans(port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_reads_back() {
        for text in [
            "moteus:/dev/ttyACM0#1",
            "odrive:can0#0",
            "moteus:vcan0#126",
            "odrive:/dev/ttyACM0@250k#3",
            "odrive:/dev/a@b#1",
            "simplefoc:/dev/ttyACM0?volts-per-torque=20",
            "simplefoc:/dev/a@b@115200?torque-constant=0.055",
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        assert_eq!("moteus:can0".parse::<Address>().unwrap().id, 1);
        let wrong = ["moteus", "moteus:", "moteus:can0#0", "moteus:can0#127", "odrive:can0#x", "vesc:can0"];
        let rates = ["odrive:/dev/ttyACM0@300k", "odrive:can0@250k", "moteus:/dev/ttyACM0@1M", "odrive:@250k"];
        let boards = [
            "simplefoc:/dev/ttyACM0",
            "simplefoc:/dev/ttyACM0?",
            "simplefoc:/dev/ttyACM0?volts-per-torque=",
            "simplefoc:/dev/ttyACM0?volts-per-torque=nan",
            "simplefoc:/dev/ttyACM0?torque-constant=-1",
            "simplefoc:/dev/ttyACM0?kv=100",
            "simplefoc:can0?torque-constant=1",
            "simplefoc:/dev/ttyACM0@9?torque-constant=1",
        ];
        for text in wrong.into_iter().chain(rates).chain(boards) {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }
}
