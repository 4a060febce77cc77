//! Devices by address: `sim`, `replay:FILE`, `moteus:PATH`, `odrive:canX#ID`, `simplefoc:PATH?CONSTANT`, `hapt:PATH`.
//!
//! A [`DeviceAddress`] names a device, gives the overrides that a world needs on it ([`DeviceAddress::overrides`]) and the supervisor's profile
//! ([`DeviceAddress::profile`]), and opens it: as a device of a loop on this computer ([`DeviceAddress::open`]), or as the [`Machine`] of a
//! session, which includes boards ([`DeviceAddress::machine`]).
//!
//! ```
//! use hapt_host::{DeviceAddress, Session, WorldConfig};
//! use hapt_model::Source;
//!
//! let file = r#"
//! loop.period = "1 ms"
//! device.inertia = "6.4e-4 kg m^2"
//! [[couplings]]
//! kind = "spring"
//! between = ["puck", "ground"]
//! stiffness = "0.5 N m/rad"
//! "#;
//! let config = WorldConfig::new(Source::from_text("spring.toml", file), Vec::new())?;
//! let address: DeviceAddress = "sim".parse()?;
//! assert!(!address.has_motor());
//! let profile = address.profile(&config.world, false)?;
//! let opened = address.machine(&config.world, profile, Default::default(), 0.02)?;
//! assert_eq!(opened.description, "the simulated device");
//! let mut session = Session::start(config, opened.machine)?;
//! session.end(|_| {});
//!
//! let drive: DeviceAddress = "moteus:/dev/ttyACM0#2".parse()?;
//! assert!(drive.has_motor(), "no world runs on it uncertified, unless that is asked for");
//! assert!("vesc:/dev/ttyACM0".parse::<DeviceAddress>().is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod address;
mod error;
mod open;
mod recorded;

pub use address::{BoardPort, DeviceAddress};
pub use error::DeviceError;
pub use open::{OpenedDevice, OpenedMachine};

#[cfg(doc)]
use crate::Machine;
