//! Starts session, server and certifier, and ends them in the right order.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use hapt_core::SafetyProfile;
use hapt_host::{Machine, Session, WorldConfig, rule};
use hapt_model::{Source, World};
use hapt_rt::LoopHandle;

use crate::access::Access;
use crate::certifier::Certifier;
use crate::sender::{self, Event, EventSender};
use crate::server::{self, Server};
use crate::session::SharedSession;

/// The default port.
pub const PORT: u16 = 4278;

/// The options of a loop behind a page.
#[derive(Clone, Debug)]
pub struct Options {
    /// The world files, of one device; the first runs, and pages may enter the others.
    pub worlds: Vec<Source>,
    /// `KEY=VALUE` overrides of all of them.
    pub sets: Vec<String>,
    /// The address to listen on; port 0: any free port.
    pub address: SocketAddr,
    /// Whether pages need a token even on the loopback and without a motor.
    pub token: bool,
    /// The folder for recordings.
    pub folder: PathBuf,
}

/// The reason that a loop behind a page cannot start, or has ended.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The world file is wrong.
    #[error("{0}")]
    World(String),
    /// The address cannot be used.
    #[error("cannot listen on {address}: {}", listening(.address, .error))]
    Address {
        /// The address.
        address: SocketAddr,
        /// The system's error.
        error: io::Error,
    },
    /// The system gives no threads, or no random numbers.
    #[error("the system gives no thread or no token: {0}")]
    System(#[from] io::Error),
    /// The loop does not start.
    #[error(transparent)]
    Session(#[from] hapt_host::Error),
    /// The loop failed while it ran.
    #[error("{0}")]
    Device(String),
}

impl From<hapt_host::board::Error> for Error {
    fn from(error: hapt_host::board::Error) -> Self {
        Error::Session(error.into())
    }
}

/// The remedy for an address that cannot be used.
fn listening(address: &SocketAddr, error: &io::Error) -> String {
    let kind = error.kind();
    if kind == io::ErrorKind::AddrInUse {
        format!("port {} is taken, perhaps by another hapt live; --port 0 takes one that is free", address.port())
    } else if kind == io::ErrorKind::AddrNotAvailable {
        format!("no address of this machine ({error})")
    } else if kind == io::ErrorKind::PermissionDenied {
        format!("{error}; ports from 1024 on need no permission")
    } else {
        error.to_string()
    }
}

/// A loop behind a page, running. Dropped, it ends, with no torque on.
///
/// ```
/// use std::time::Duration;
///
/// use hapt_live::{Live, Options};
/// use hapt_model::Source;
///
/// let file = "loop.period = \"1 ms\"\ndevice = { inertia = \"6.4e-4 kg m^2\", damping = \"1e-3 N m s/rad\" }\n";
/// let options = Options {
///     worlds: vec![Source::from_text("free.toml", file)],
///     sets: Vec::new(),
///     address: "127.0.0.1:0".parse()?,
///     token: false,
///     folder: ".".into(),
/// };
/// let live = Live::start(options)?;
/// println!("open {}", live.link());
/// live.wait(Duration::from_millis(20))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Live {
    link: String,
    address: SocketAddr,
    asks_for_token: bool,
    sender: EventSender,
    session: Option<JoinHandle<()>>,
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

    /// The same on the machine that `open` gives for the world. It is opened last, and starts disarmed; the page arms it.
    ///
    /// # Errors
    /// As [`Live::start`], and those of `open`.
    pub fn start_on<E: From<Error>>(
        options: Options,
        open: impl FnOnce(&World) -> Result<Machine, E>,
    ) -> Result<Live, E> {
        let Options { worlds, sets, address, token, folder } = options;
        let config = WorldConfig::of(worlds, sets, rule::check).map_err(Error::World)?;
        let refused = |error| Error::Address { address, error };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(Error::System)?;
        let address = listener.local_addr().map_err(Error::System)?;
        let (to_session, events) = sender::events();
        let answers = to_session.clone();
        let certifier =
            Certifier::start(move |generation, answer| answers.send(Event::Certified(generation, answer)).is_ok());
        let certifier = certifier.map_err(Error::System)?;
        let machine = open(&config.world)?;
        let access =
            Access::new(address, token || machine.profile != SafetyProfile::Simulated).map_err(Error::System)?;
        let (link, asks_for_token) = (access.link(), access.asks_for_token());
        let ready = to_session.clone();
        // With a full queue the session is awake.
        let ready = move || drop(ready.try_send(Event::TaskDone));
        let session = Session::start_in(config, machine, folder, ready).map_err(Error::Session)?;
        let sender = EventSender::new(to_session, session.handle());
        let session = SharedSession::new(session, certifier, &sender);

        let (report, outcome) = channel();
        let thread = std::thread::Builder::new().name("session".into()).spawn(move || {
            // The session is dropped before the outcome is reported: no torque is on then.
            let _ = report.send(session.run(&events).map_err(|error| error.to_string()));
        });
        let thread = thread.map_err(Error::System)?;
        let server = server::start(listener, access, sender.clone()).map_err(Error::System)?;
        Ok(Live { link, address, asks_for_token, sender, session: Some(thread), server: Some(server), outcome })
    }

    /// The page's address, with the token where one is needed.
    pub fn link(&self) -> &str {
        &self.link
    }

    /// The server's address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether pages need the token: there is a motor, or other machines can reach the server.
    pub fn asks_for_token(&self) -> bool {
        self.asks_for_token
    }

    /// Ends the loop with no torque on, from any thread, at any time.
    pub fn handle(&self) -> LoopHandle {
        self.sender.handle()
    }

    /// Waits for the end, for this time at most.
    ///
    /// # Errors
    /// [`Error::Device`]: the loop has failed.
    pub fn wait(&self, most: Duration) -> Result<(), Error> {
        match self.outcome.recv_timeout(most) {
            Ok(Err(message)) => Err(Error::Device(message)),
            Ok(Ok(())) | Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => Err(Error::Device("the session has ended unexpectedly".into())),
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // At once, also while the session is busy.
        self.sender.handle().end();
        self.sender.end();
        if let Some(session) = self.session.take() {
            let _ = session.join();
        }
        drop(self.server.take());
    }
}
