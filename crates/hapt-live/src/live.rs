//! Everything started, and ended in the right order.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use hapt_core::SafetyProfile;
use hapt_model::{Source, World};
use hapt_rt::{Device, Hands, LoopHandle, Settings, Simulated};

use crate::access::Access;
use crate::desk::{self, Desk, Door, Event, Start};
use crate::hand::VisitorsHand;
use crate::judge::Judge;
use crate::runner::{Here, Runner};
use crate::server::{self, Server};
use crate::state::Workbench;
use crate::worker::Worker;

/// The port where nobody asks for another.
pub const PORT: u16 = 4278;

/// What a loop behind a page is started with.
#[derive(Clone, Debug)]
pub struct Options {
    /// The world file.
    pub source: Source,
    /// `KEY=VALUE` overrides of it.
    pub sets: Vec<String>,
    /// Where the server listens; port 0: any that is free.
    pub address: SocketAddr,
    /// Where recordings go.
    pub folder: PathBuf,
}

/// What the loop drives, and how.
pub struct Machine {
    /// As it is named: `sim`, `moteus:/dev/ttyACM0`.
    pub name: String,
    /// What runs it.
    pub runs: Runs,
    /// What moves its hand, where it is a simulated one; a real one is moved by a real one.
    pub hands: Option<Hands>,
    /// How its supervisor guards. With [`SafetyProfile::Certified`] the page sets no key to a value that is not certified.
    pub profile: SafetyProfile,
}

/// Where the loop runs.
pub enum Runs {
    /// On a thread of this computer.
    Here {
        /// Started, and without a torque.
        device: Box<dyn Device>,
        /// What the thread asks of the system.
        settings: Settings,
    },
    /// On a board, which is given the world.
    #[cfg(unix)]
    Board(Box<hapt_link::Link>),
}

impl Runs {
    /// Starts it with the bench's world, disarmed.
    fn start(self, bench: &Workbench, profile: SafetyProfile) -> Result<Box<dyn Runner>, Error> {
        Ok(match self {
            Runs::Here { device, settings } => Box::new(Here::start(bench, profile, device, settings)?),
            #[cfg(unix)]
            Runs::Board(link) => Box::new(crate::board::Board::start(bench, profile, *link)?),
        })
    }
}

impl Machine {
    /// The exact simulation of this world's device, with a hand for the page.
    pub fn simulated(world: &World) -> Self {
        let (device, hands) = Simulated::new(world);
        Machine {
            name: "sim".into(),
            runs: Runs::Here { device: Box::new(device), settings: Settings::default() },
            hands: Some(hands),
            profile: SafetyProfile::Simulated,
        }
    }
}

/// Why a loop behind a page cannot start, or has ended.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The world file is wrong.
    #[error("{0}")]
    World(String),
    /// The address is not to be had.
    #[error("cannot listen on {address}: {}", listening(.address, .error))]
    Address {
        /// Which.
        address: SocketAddr,
        /// What the system says.
        error: io::Error,
    },
    /// The system gives no threads, or no random numbers.
    #[error("the system gives no thread or no token: {0}")]
    System(#[from] io::Error),
    /// The loop's thread does not start.
    #[error(transparent)]
    Engine(#[from] hapt_rt::Error),
    /// The board does not answer, or does not take the world.
    #[cfg(unix)]
    #[error(transparent)]
    Board(#[from] hapt_link::Error),
    /// The device has gone while it ran.
    #[error("{0}")]
    Device(String),
}

/// What to do about an address that is not to be had.
fn listening(address: &SocketAddr, error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::AddrInUse => {
            format!("port {} is taken, perhaps by another hapt live; --port 0 takes one that is free", address.port())
        }
        io::ErrorKind::AddrNotAvailable => format!("no address of this machine ({error})"),
        io::ErrorKind::PermissionDenied => format!("{error}; ports from 1024 on need no permission"),
        _ => error.to_string(),
    }
}

/// A loop behind a page, running. Dropped, it ends, with no torque on.
pub struct Live {
    link: String,
    address: SocketAddr,
    asks_for_token: bool,
    door: Door,
    desk: Option<JoinHandle<()>>,
    server: Option<Server>,
    outcome: Receiver<Result<(), String>>,
}

impl Live {
    /// Starts the loop on the simulated device, and the server.
    ///
    /// # Errors
    /// All of [`Error`] but [`Error::Device`]; nothing runs then.
    pub fn start(options: Options) -> Result<Live, Error> {
        Live::start_on(options, |world| Ok(Machine::simulated(world)))
    }

    /// The same on whatever `open` gives for the world. It is opened last, when everything else is there, and disarmed; the page arms it.
    ///
    /// # Errors
    /// As [`Live::start`], and those of `open`.
    pub fn start_on<E: From<Error>>(
        options: Options,
        open: impl FnOnce(&World) -> Result<Machine, E>,
    ) -> Result<Live, E> {
        let Options { source, sets, address, folder } = options;
        let bench = Workbench::new(source, sets).map_err(Error::World)?;
        let refused = |error| Error::Address { address, error };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(Error::System)?;
        let address = listener.local_addr().map_err(Error::System)?;
        let (to_desk, events) = desk::events();
        let judging = to_desk.clone();
        let judge = Judge::start(move |generation, says| judging.send(Event::Judged(generation, says)).is_ok());
        let judge = judge.map_err(Error::System)?;
        let worker = Worker::start(to_desk.clone()).map_err(Error::System)?;
        let Machine { name, runs, hands, profile } = open(&bench.world)?;
        let access = Access::new(address, profile != SafetyProfile::Simulated).map_err(Error::System)?;
        let (link, asks_for_token) = (access.link(), access.asks_for_token());
        let bench = bench.on(name, profile).map_err(Error::World)?;
        let hand = VisitorsHand::new(&bench.world, hands);
        let runner = runs.start(&bench, profile)?;
        let door = Door::new(to_desk, runner.handle());
        let desk = Desk::new(Start { bench, runner, profile, hand, judge, worker, folder }, &door);

        let (says, outcome) = channel();
        let desk = std::thread::Builder::new().name("desk".into()).spawn(move || {
            // With the desk goes what runs the loop: no torque is on when the outcome is told.
            let _ = says.send(desk.run(&events));
        });
        let desk = desk.map_err(Error::System)?;
        let server = server::start(listener, access, door.clone()).map_err(Error::System)?;
        Ok(Live { link, address, asks_for_token, door, desk: Some(desk), server: Some(server), outcome })
    }

    /// What to type into a browser, with the token where one is asked for.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// Where the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether pages must have the link's token: there is a motor, or other machines can reach the server.
    pub fn asks_for_token(&self) -> bool {
        self.asks_for_token
    }

    /// What ends the loop with no torque on from any thread, whatever else is under way.
    pub fn handle(&self) -> LoopHandle {
        self.door.handle()
    }

    /// Waits for its end, so long at most.
    ///
    /// # Errors
    /// [`Error::Device`]: it has ended by itself.
    pub fn wait(&self, most: Duration) -> Result<(), Error> {
        match self.outcome.recv_timeout(most) {
            Ok(Err(words)) => Err(Error::Device(words)),
            Ok(Ok(())) | Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => Err(Error::Device("the desk has ended by itself".into())),
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // Whatever the desk is at.
        self.door.handle().end();
        self.door.end();
        if let Some(desk) = self.desk.take() {
            let _ = desk.join();
        }
        drop(self.server.take());
    }
}
