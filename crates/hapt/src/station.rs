//! A station of a network: its world here, and its links to the others.

use std::io::{self, Read};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::Path;

#[cfg(target_os = "linux")]
use hapt_analysis::rounded;
use hapt_analysis::{NetworkCheck, Rounded};
use hapt_core::SafetyProfile;
#[cfg(target_os = "linux")]
use hapt_host::links::CanAddress;
use hapt_host::links::{LinkError, LinkStatus, Links};
use hapt_host::{DeviceAddress, DeviceError};
use hapt_model::{Motion, System, World, is_network};
use hapt_rt::LinkPort;
#[cfg(target_os = "linux")]
use hapt_wire::link::Frames;
use hapt_wire::link::Refusal;

use crate::args::{RunArgs, StationArgs};
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::world::{Loaded, read_system, source};

/// A longer file is refused as a key.
const LONGEST_KEY: u64 = 4096;

/// The world that runs here: a file with its overrides, by itself or as a station.
pub struct Chosen {
    pub loaded: Loaded,
    pub sets: Vec<String>,
    pub station: Option<Station>,
}

/// A station among the others.
pub struct Station {
    network: System,
    at: usize,
    transport: Transport,
}

/// The transport of its messages.
enum Transport {
    Udp {
        listen: SocketAddr,
        peers: Vec<(usize, SocketAddr)>,
        key: Vec<u8>,
    },
    #[cfg(target_os = "linux")]
    Can(CanAddress),
}

impl Chosen {
    /// Reads the world, or the network with the station of the arguments, for this device.
    pub fn of(args: &RunArgs, address: &DeviceAddress) -> Result<Self, Failure> {
        let source = source(&args.world.path)?;
        let mut sets = args.world.sets.clone();
        let name = match (is_network(&source), &args.station.station) {
            (true, Some(name)) => name,
            (true, None) => {
                let network = System::read(&source, &sets)?;
                return Err(Failure::input(format!(
                    "{} is a network; give the station that runs here: --station {}",
                    source.name,
                    names(&network).join(" or --station ")
                )));
            }
            (false, Some(name)) => {
                let text = format!("--station {name}: {} is one world; a network file has stations", source.name);
                return Err(Failure::input(text));
            }
            (false, None) => {
                let mut loaded = Loaded::of(source, &args.world)?;
                sets.extend(address.overrides(&loaded.world)?);
                loaded.world = World::read(&loaded.source, &sets)?;
                return Ok(Chosen { loaded, sets, station: None });
            }
        };
        if matches!(address, DeviceAddress::Board(_)) {
            return Err(Failure::input(
                "--station: a board runs its loop by itself, and has no network; a link needs a loop of this computer",
            ));
        }
        let network = System::read(&source, &sets)?;
        let at = index(&network, "--station", name)?;
        // Applied like keys of the file, so that the certificate and the other stations include them.
        let own = address.overrides(&network.stations[at].world)?;
        sets.extend(own.into_iter().map(|set| format!("stations.{name}.{set}")));
        let network = read_system(&source, &sets)?;
        let station = Station::new(network, at, &args.station)?;
        let hapt_model::Station { world, source, sets, .. } = station.network.stations[at].clone();
        let loaded = Loaded { name: source.name.clone(), world, source };
        Ok(Chosen { loaded, sets, station: Some(station) })
    }
}

fn names(network: &System) -> Vec<&str> {
    network.stations.iter().map(|station| station.name.as_str()).collect()
}

fn index(network: &System, flag: &str, name: &str) -> Result<usize, Failure> {
    let names = names(network);
    names.iter().position(|known| *known == name).ok_or_else(|| {
        let hint = hapt_model::did_you_mean(name, names.iter().copied());
        let known = if hint.is_empty() { format!("; there is {}", names.join(", ")) } else { hint };
        Failure::input(format!("{flag}: the network has no station {name:?}{known}"))
    })
}

impl Station {
    fn new(network: System, at: usize, args: &StationArgs) -> Result<Self, Failure> {
        let name = &network.stations[at].name;
        let listen = args.listen.as_deref().ok_or_else(|| {
            Failure::input(format!(
                "--station {name}: needs --listen with an address, such as --listen 0.0.0.0:7000, or --listen can:can0"
            ))
        })?;
        let transport =
            if listen.starts_with("can:") { over_can(listen, args)? } else { over_udp(&network, at, listen, args)? };
        Ok(Station { network, at, transport })
    }

    /// The profile of the supervisor, where `own` is that of the station's world by itself. On a motor only a certified network runs, unless
    /// `uncertified` allows any.
    pub fn profile(&self, own: SafetyProfile, uncertified: bool) -> Result<SafetyProfile, Failure> {
        if own == SafetyProfile::Simulated {
            return Ok(own);
        }
        let check = hapt_analysis::check_network(&self.network)?;
        let refused = match (check.certified, self.rounded(&check)?) {
            (true, Some(Rounded { power: None, .. })) => Some(
                "not certified over CAN: its frames round positions, and with no damping beyond what is required nothing bounds what that feeds".into(),
            ),
            (true, _) => None,
            (false, _) => Some(check.verdict_sentence()),
        };
        match (refused, uncertified) {
            (None, _) => Ok(own),
            (Some(_), true) => Ok(SafetyProfile::Uncertified),
            (Some(verdict), false) => Err(DeviceError::NotCertified { verdict }.into()),
        }
    }

    /// The power by rounded positions; `None` where messages have them in full.
    fn rounded(&self, check: &NetworkCheck) -> Result<Option<Rounded>, Failure> {
        match self.transport {
            Transport::Udp { .. } => Ok(None),
            #[cfg(target_os = "linux")]
            Transport::Can(_) => Ok(Some(rounded(&self.network, check, Frames::STEP)?)),
        }
    }

    /// Listens for the others. The second are the ends of the links for the loop.
    pub fn open(&self) -> Result<(Links, Vec<LinkPort>), Failure> {
        let Station { network, at, transport } = self;
        match transport {
            Transport::Udp { listen, peers, key } => Links::open(network, *at, *listen, peers, key).map_err(failure),
            #[cfg(target_os = "linux")]
            Transport::Can(address) => {
                let sent = address.load(network).map_err(Failure::input)?;
                let opened = Links::over_can(network, *at, address).map_err(failure)?;
                messages::say(format_args!(
                    "{address}: frames carry no authentication: whoever is on the bus can turn the wheels; the links of all stations send up \
                     to {:.0} kbit/s",
                    1e-3 * sent
                ));
                let check = hapt_analysis::check_network(network)?;
                messages::say(format_args!("{address}: {}", self.rounding(&check)?));
                Ok(opened)
            }
        }
    }

    /// The effect of the frames' rounding of positions on the certificate, as a sentence.
    #[cfg(target_os = "linux")]
    fn rounding(&self, check: &NetworkCheck) -> Result<String, Failure> {
        let unit = match self.network.motion {
            Motion::Rotary => "rad",
            Motion::Linear => "m",
        };
        let what = match self.rounded(check)?.and_then(|rounded| rounded.power) {
            _ if !check.certified => "the network is not certified".into(),
            Some(0.0) => "the friction of the devices covers it".into(),
            Some(power) => format!("all hands together may draw up to {power:.1e} W by it"),
            None => "nothing bounds what hands may draw by it".to_string(),
        };
        Ok(format!("frames round positions to {:.1e} {unit}; {what}", Frames::STEP))
    }

    /// The bus in the summary of a run.
    pub fn summary(&self) -> String {
        match &self.transport {
            Transport::Udp { .. } => String::new(),
            #[cfg(target_os = "linux")]
            Transport::Can(address) => {
                format!("bus          {address}; frames without authentication, for a closed bus\n")
            }
        }
    }
}

fn failure(error: LinkError) -> Failure {
    match error {
        LinkError::Listen { .. } | LinkError::Bus { .. } => Failure::System(format!("--listen {error}")),
        LinkError::Key { .. } => Failure::input(format!("--key: {error}")),
        LinkError::Limit(_) | LinkError::Peer { .. } | LinkError::Check(_) => Failure::input(error),
        LinkError::System { .. } => Failure::System(error.to_string()),
    }
}

/// Over UDP, to the addresses of the arguments.
fn over_udp(network: &System, at: usize, listen: &str, args: &StationArgs) -> Result<Transport, Failure> {
    let name = &network.stations[at].name;
    let listen: SocketAddr = listen.parse().map_err(|_| {
        Failure::input(format!(
            "--listen {listen}: expected an IP address and a port, such as 0.0.0.0:7000, or a CAN bus, such as can:can0"
        ))
    })?;
    let mut peers: Vec<(usize, SocketAddr)> = Vec::new();
    for peer in &args.peers {
        let (other, address) = peer.split_once('=').ok_or_else(|| {
            Failure::input(format!("--peer {peer}: expected NAME=HOST:PORT, such as right=192.168.1.8:7000"))
        })?;
        let index = index(network, "--peer", other)?;
        let linked = |link: &hapt_model::Link| link.between.contains(&at) && link.between.contains(&index);
        if index == at || !network.links.iter().any(linked) {
            return Err(Failure::input(format!("--peer {peer}: no link joins {other} to the station {name} here")));
        }
        if peers.iter().any(|(known, _)| *known == index) {
            return Err(Failure::input(format!("--peer {peer}: {other} is given twice")));
        }
        peers.push((index, resolved(peer, address, listen)?));
    }
    for link in network.links.iter().filter(|link| link.between.contains(&at)) {
        let other = link.between[usize::from(link.between[0] == at)];
        if !peers.iter().any(|(known, _)| *known == other) {
            let other = &network.stations[other].name;
            return Err(Failure::input(format!(
                "--station {name}: a link joins it to {other}; give its address, as in --peer {other}=HOST:PORT"
            )));
        }
    }
    let key = args.key.as_deref().ok_or_else(|| {
        Failure::input(format!(
            "--station {name}: needs --key with the file of the key that all stations share; make one with \
             `head -c 32 /dev/urandom > FILE`, and copy it to each"
        ))
    })?;
    let key = read(key).map_err(|error| Failure::input(format!("--key {}: {error}", key.display())))?;
    Ok(Transport::Udp { listen, peers, key })
}

/// Over the CAN bus of this address, where all stations are.
fn over_can(listen: &str, args: &StationArgs) -> Result<Transport, Failure> {
    if let Some(peer) = args.peers.first() {
        let text = format!("--peer {peer}: on a CAN bus the stations need no addresses; leave it out");
        return Err(Failure::input(text));
    }
    if let Some(key) = &args.key {
        return Err(Failure::input(format!(
            "--key {}: a frame on a CAN bus has no room for an authentication; leave it out on a bus that is closed, or use UDP",
            key.display()
        )));
    }
    #[cfg(target_os = "linux")]
    return listen.parse().map(Transport::Can).map_err(|error| Failure::input(format!("--listen {listen}: {error}")));
    #[cfg(not(target_os = "linux"))]
    Err(Failure::input(format!("--listen {listen}: a CAN bus needs Linux")))
}

/// The address of a peer, of the family of the own one.
fn resolved(peer: &str, address: &str, listen: SocketAddr) -> Result<SocketAddr, Failure> {
    let found = address.to_socket_addrs().map_err(|error| {
        if error.kind() == io::ErrorKind::InvalidInput {
            Failure::input(format!("--peer {peer}: expected a host and a port, such as 192.168.1.8:7000"))
        } else {
            Failure::System(format!("--peer {peer}: cannot find the host: {error}"))
        }
    })?;
    let of_family = found.into_iter().find(|found| found.is_ipv4() == listen.is_ipv4());
    of_family.ok_or_else(|| {
        let (own, other) = if listen.is_ipv4() { ("IPv4", "IPv6") } else { ("IPv6", "IPv4") };
        Failure::input(format!("--peer {peer}: is {other}, and --listen {listen} is {own}; both have to be the same"))
    })
}

/// The key in a file. A line break after it is ignored.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut key = Vec::new();
    hapt_model::input::open(path)?.take(LONGEST_KEY + 1).read_to_end(&mut key)?;
    if key.len() as u64 > LONGEST_KEY {
        return Err(io::Error::other(format!("has more than {LONGEST_KEY} bytes, and is no key")));
    }
    while key.last().is_some_and(|byte| matches!(byte, b'\n' | b'\r')) {
        key.pop();
    }
    Ok(key)
}

/// Changes of links that are printed one by one; a flickering link must not fill the terminal.
const CHANGES: u32 = 20;

/// The state of the links that was last printed.
#[derive(Default)]
pub struct LastReported {
    acts: Vec<bool>,
    changes: u32,
    refused: [bool; Refusal::ALL.len()],
}

impl LastReported {
    /// Prints changes: that a link acts or has released, and messages that are not of this network.
    pub fn say(&mut self, links: &[LinkStatus]) {
        self.acts.resize(links.len(), false);
        for (reported, link) in self.acts.iter_mut().zip(links) {
            if *reported != link.acts {
                *reported = link.acts;
                self.changes = self.changes.saturating_add(1);
                if self.changes < CHANGES {
                    let what = if link.acts { "acts" } else { "has let go" };
                    messages::say(format_args!("the link to {} {what}", link.to));
                } else if self.changes == CHANGES {
                    messages::say("the links go on letting go; the summary counts how often");
                }
            }
            for refusal in strange() {
                let reported = &mut self.refused[refusal.code()];
                if link.refused[refusal.code()] > 0 && !*reported {
                    *reported = true;
                    messages::say(format_args!("warning: refused {}", refusal.sentence()));
                }
            }
        }
    }
}

/// Refusals that need an action: not those of messages that only came late.
fn strange() -> impl Iterator<Item = Refusal> {
    Refusal::ALL.into_iter().filter(|refusal| *refusal != Refusal::Old)
}

/// A line for each link in the summary of a run, and one for each kind of messages that were refused.
pub fn summary(links: &[LinkStatus]) -> String {
    let mut text = String::new();
    for link in links {
        let LinkStatus { to, age_max, samples, acted, releases, oldest, taken, refused, .. } = link;
        let [samples, taken] = [*samples, *taken].map(format::count);
        text += &match acted {
            0 if taken == "0" => format!("link         to {to}: never acted; nothing came from it\n"),
            0 => format!("link         to {to}: never acted, with {taken} messages from it\n"),
            _ => {
                let [acted, times] = [*acted, *releases].map(format::count);
                let s = if *releases == 1 { "" } else { "s" };
                format!(
                    "link         to {to}: acted in {acted} of {samples} samples, let go {times} time{s}; {taken} messages\n             \
                     positions acted up to an age of {:.1} ms, of {:.1} ms\n",
                    1e3 * oldest,
                    1e3 * age_max
                )
            }
        };
        for refusal in strange().filter(|refusal| refused[refusal.code()] > 0) {
            let count = format::count(refused[refusal.code()]);
            text += &format!("             refused {count} {}\n", refusal.sentence());
        }
    }
    text
}
