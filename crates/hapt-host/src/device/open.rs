//! Opens devices.

use hapt_core::SafetyProfile;
use hapt_model::World;
use hapt_rt::{Device, Hands, Outside, Replay, Settings, SimulatedDevice};

use super::recorded::positions;
use super::{BoardPort, DeviceAddress, DeviceError};
use crate::machine::{Backend, Machine};

/// A device of a loop on this computer, without a torque.
pub struct OpenedDevice {
    /// Started.
    pub device: Box<dyn Device>,
    /// The sender of commands to a simulated device's hand; `None` for every other device.
    pub hands: Option<Hands>,
    /// Notes for the user, such as the settings of a drive that hapt cannot change.
    pub notes: Vec<String>,
}

/// The machine that runs the loop of a session, without a torque.
pub struct OpenedMachine {
    /// For [`crate::Session::start`].
    pub machine: Machine,
    /// The device in words: "the simulated device", "the board NAME".
    pub description: String,
    /// Notes for the user.
    pub notes: Vec<String>,
}

impl DeviceAddress {
    /// Opens the device for a loop on this computer that runs `world`. May take some seconds.
    ///
    /// # Errors
    /// The device cannot be opened, or is a board, which runs the loop itself.
    pub fn open(&self, world: &World) -> Result<OpenedDevice, DeviceError> {
        match self {
            DeviceAddress::Sim => {
                let (device, hands) = SimulatedDevice::new(world);
                Ok(OpenedDevice { device: Box::new(device), hands: Some(hands), notes: Vec::new() })
            }
            DeviceAddress::Replay(file) => {
                let device = Replay::new(positions(file, world.motion)?);
                Ok(OpenedDevice { device: Box::new(device), hands: None, notes: Vec::new() })
            }
            #[cfg(target_os = "linux")]
            DeviceAddress::Drive(address) => {
                let started = address.open().and_then(|drive| hapt_drive::DriveDevice::start(drive, world));
                let device = started.map_err(|error| DeviceError::Drive { address: address.clone(), error })?;
                let notes = device.notes();
                Ok(OpenedDevice { device: Box::new(device), hands: None, notes })
            }
            #[cfg(not(target_os = "linux"))]
            DeviceAddress::Drive(address) => match *address {},
            DeviceAddress::Board(port) => Err(DeviceError::NotLocal { path: port.path.clone() }),
        }
    }

    /// Opens the machine that runs the loop of `world` in a session: a thread of this computer with `settings`, or a board, which sends a sample
    /// every `every` s (0: every sample).
    ///
    /// # Errors
    /// The device cannot be opened, or is a board that runs no loop by itself.
    pub fn machine(
        &self,
        world: &World,
        profile: SafetyProfile,
        settings: Settings,
        every: f64,
    ) -> Result<OpenedMachine, DeviceError> {
        let name = self.to_string();
        match self {
            DeviceAddress::Board(port) => board(port, name, profile, every),
            DeviceAddress::Sim | DeviceAddress::Replay(_) | DeviceAddress::Drive(_) => {
                let OpenedDevice { device, hands, notes } = self.open(world)?;
                let backend = Backend::Local { device, settings, outside: Outside::default() };
                let machine = Machine { name, backend, hands, network: None, wheel: None, profile };
                Ok(OpenedMachine { machine, description: self.description(), notes })
            }
        }
    }

    /// The device in words.
    fn description(&self) -> String {
        match self {
            DeviceAddress::Sim => "the simulated device".into(),
            DeviceAddress::Replay(file) => format!("the positions of {}", file.display()),
            DeviceAddress::Drive(_) => format!("the drive {self}"),
            DeviceAddress::Board(_) => format!("the board at {self}"),
        }
    }
}

fn board(port: &BoardPort, name: String, profile: SafetyProfile, every: f64) -> Result<OpenedMachine, DeviceError> {
    let link = port.open()?;
    let board = link.board();
    if board.externally_clocked {
        return Err(DeviceError::ExternallyClocked { name: board.name.clone() });
    }
    let (description, notes) =
        (format!("the board {}", board.name), board.note().into_iter().map(Into::into).collect());
    let backend = Backend::Board { link: Box::new(link), every };
    Ok(OpenedMachine {
        machine: Machine { name, backend, hands: None, network: None, wheel: None, profile },
        description,
        notes,
    })
}

impl BoardPort {
    /// Opens the port and makes the handshake with the board there. A torque that is on stays on.
    ///
    /// # Errors
    /// There is no such port, nothing answers, or the board has another version of the protocol.
    pub fn open(&self) -> Result<crate::board::Link, DeviceError> {
        Ok(crate::board::Link::open_at(&self.path, self.baud)?)
    }
}
