//! Where a drive is: `moteus:/dev/ttyACM0`, `odrive:can0#3`.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use crate::can::{Bus, Socket};
use crate::drive::{Drive, Error};
use crate::ports::ports;
use crate::simulate::Firmware;
use crate::{moteus, odrive, slcan};
use hapt_line::Line;

/// Whose drive it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Make {
    /// mjbots' moteus.
    Moteus,
    /// An ODrive.
    Odrive,
}

/// A drive on a port or bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Whose it is.
    pub make: Make,
    /// The path of a serial port, or the name of a CAN interface.
    pub place: String,
    /// Its identifier there.
    pub id: u8,
}

impl Make {
    /// Both.
    pub const ALL: [Make; 2] = [Make::Moteus, Make::Odrive];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Make::Moteus => "moteus",
            Make::Odrive => "odrive",
        }
    }

    /// The identifiers that it may have.
    pub const fn ids(self) -> std::ops::RangeInclusive<u8> {
        match self {
            Make::Moteus => 1..=126,
            Make::Odrive => 0..=62,
        }
    }

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        Make::ALL.into_iter().find(|make| make.name() == name)
    }

    /// The inside of a simulated one with this identifier.
    pub fn simulated(self, id: u8) -> Box<dyn Firmware> {
        match self {
            Make::Moteus => Box::new(moteus::Simulated::new(id)),
            Make::Odrive => Box::new(odrive::Simulated::new(id)),
        }
    }

    /// What a simulated one has at its end of a serial line.
    pub fn adapter(self, line: Line) -> Box<dyn Bus> {
        match self {
            Make::Moteus => Box::new(moteus::Adapter::new(line)),
            Make::Odrive => Box::new(slcan::Adapter::new(line)),
        }
    }
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (make, rest) = text.split_once(':').ok_or("a drive is moteus:PATH or odrive:PATH")?;
        let make = Make::named(make).ok_or_else(|| format!("{make:?} is no drive; moteus and odrive are"))?;
        let (place, id) = match rest.rsplit_once('#') {
            None => (rest, 1),
            Some((place, id)) => {
                let ids = make.ids();
                let id = id.parse().ok().filter(|id| ids.contains(id)).ok_or_else(|| {
                    format!(
                        "{id:?} is no identifier of a {}; they go from {} to {}",
                        make.name(),
                        ids.start(),
                        ids.end()
                    )
                })?;
                (place, id)
            }
        };
        if place.is_empty() {
            let name = make.name();
            return Err(format!(
                "where? {name}:/dev/ttyACM0, or {name}:can0 on a CAN interface; hapt devices lists them"
            ));
        }
        Ok(Address { make, place: place.into(), id })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}#{}", self.make.name(), self.place, self.id)
    }
}

impl Address {
    /// Whether its place is a port, and not an interface of the system's.
    pub fn is_port(&self) -> bool {
        self.place.contains('/')
    }

    /// Opens the port or interface. Nothing is said to the drive yet.
    ///
    /// # Errors
    /// The port or interface cannot be opened.
    pub fn open(&self) -> Result<Box<dyn Drive>, Error> {
        let wrong = |error| Error::Open { name: self.place.clone(), error };
        match self.make {
            Make::Moteus => {
                let bus: Box<dyn Bus> = if self.is_port() {
                    let path = Path::new(&self.place);
                    let line = Line::open(path).map_err(wrong)?;
                    // Only an fdcanusb does without a CRC.
                    Box::new(moteus::Client::new(line, !is_adapter(path)))
                } else {
                    Box::new(Socket::open(&self.place).map_err(wrong)?)
                };
                Ok(Box::new(moteus::Moteus::new(bus, self.id, self.place.clone())))
            }
            Make::Odrive => {
                let bus: Box<dyn Bus> = if self.is_port() {
                    Box::new(slcan::Client::open(Line::open(Path::new(&self.place)).map_err(wrong)?).map_err(wrong)?)
                } else {
                    Box::new(Socket::open(&self.place).map_err(wrong)?)
                };
                Ok(Box::new(odrive::Odrive::new(bus, self.id, &self.place)))
            }
        }
    }
}

fn is_adapter(path: &Path) -> bool {
    let path = path.canonicalize().unwrap_or(path.into());
    ports().iter().any(|port| Path::new(&port.name) == path && !port.specs.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_reads_back() {
        for text in ["moteus:/dev/ttyACM0#1", "odrive:can0#0", "moteus:vcan0#126"] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        assert_eq!("moteus:can0".parse::<Address>().unwrap().id, 1);
        for text in ["moteus", "moteus:", "moteus:can0#0", "moteus:can0#127", "odrive:can0#x", "vesc:can0"] {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }
}
