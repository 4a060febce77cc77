//! `hapt live`: the loop in real time behind a web page.

use std::io::{IsTerminal, stderr};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use hapt_core::SafetyProfile;
use hapt_host::links::LinkError;
use hapt_host::{DeviceAddress, Machine};
use hapt_live::network::{self, StationEnd};
use hapt_live::{Error, Live, Options};
use hapt_model::{Source, World, is_network};
use hapt_rt::{Outside, Settings};

use crate::args::{LiveArgs, Steering, device};
use crate::attached::Wheel;
use crate::drives;
use crate::failure::Failure;
use crate::latency::settings;
use crate::messages::{notes, print, say};
use crate::output;
use crate::phone;
use crate::signals;
use crate::world::{read_system, read_world, sources};

/// The default world: the notes' wheel under the default method, which is certified.
const WHEEL: &str = "@notes/default";
/// The polling period for signals.
const MOMENT: Duration = Duration::from_millis(20);

pub fn run(args: &LiveArgs) -> Result<ExitCode, Failure> {
    with(args, None)
}

/// The same; with a steering, the device is a wheel for games too.
pub fn with(args: &LiveArgs, steering: Option<Steering>) -> Result<ExitCode, Failure> {
    let device = device(&args.device)?;
    let address = SocketAddr::new(listen(args.listen.as_deref())?, args.port);
    let worlds = if args.paths.is_empty() { sources(Path::new(WHEEL))? } else { listed(&args.paths)? };
    if let [network] = &worlds[..]
        && is_network(network)
    {
        return stations(args, &device, address, network);
    }
    let mut sets = args.sets.clone();
    // The first is the one that starts; the others are of its device.
    let mut overrides = Vec::new();
    for (place, source) in worlds.iter().enumerate() {
        let world = read_world(source, &sets)?;
        if place == 0 {
            overrides = device.overrides(&world)?;
        }
    }
    sets.extend(overrides);
    let options = Options { worlds, sets, address, token: args.listen.is_some(), folder: args.log_dir.clone() };
    output::folder("--log-dir", &args.log_dir)?;
    // Before anything can hold a torque: a signal removes it first.
    signals::end_in_order();
    let mut wheel = None;
    let live = Live::start_on(options, |world| match steering {
        None => machine(args, &device, world),
        Some(steering) => {
            let (attached, machine) = with_games(args, &device, world, steering)?;
            wheel = Some(attached);
            Ok(machine)
        }
    })?;
    let handle = live.handle();
    signals::stop_with(move || handle.end());

    if device.has_motor() {
        say(drives::NOT_CERTIFIED);
    }
    serve(args, vec![live], wheel, |links| format!("{}\n", links.join("\n")))
}

/// The worlds of several paths.
fn listed(paths: &[PathBuf]) -> Result<Vec<Source>, Failure> {
    let mut worlds = Vec::new();
    for path in paths {
        worlds.extend(sources(path)?);
    }
    Ok(worlds)
}

/// Prints the links to the pages, and serves them until a signal comes or a loop has failed.
fn serve(
    args: &LiveArgs,
    lives: Vec<Live>,
    mut wheel: Option<Wheel>,
    text: impl FnOnce(&[&str]) -> String,
) -> Result<ExitCode, Failure> {
    let Some(live) = lives.first() else { return Ok(ExitCode::SUCCESS) };
    let links: Vec<&str> = lives.iter().map(Live::link).collect();
    // A page may arm it before the line has been read.
    let printed = print(text(&links));
    if !live.address().ip().is_loopback() {
        say(format_args!(
            "hapt: listening on {}, which other machines can reach; a page needs the token in the link",
            live.address()
        ));
    } else if live.asks_for_token() {
        say("hapt: a page needs the token in the link, behind the #");
    }
    if stderr().is_terminal() {
        for live in &lives {
            if let Some(link) = phone::link(live.link(), live.address()) {
                say(format_args!("for a phone in this network: {link}\n{}", phone::code(&link)));
            }
        }
    }
    if args.open {
        open(live.link());
    }
    loop {
        if let Some(code) = signals::signalled() {
            drop(lives);
            return Ok(ExitCode::from(code));
        }
        if let Ok(Err(error)) = printed.try_recv() {
            drop(lives);
            return Err(Failure::stdout(error));
        }
        for live in &lives {
            live.wait(MOMENT / lives.len() as u32)?;
        }
        if let Some(wheel) = &mut wheel {
            wheel.say();
            if !wheel.is_attached() {
                drop(lives);
                return Err(Failure::detached());
            }
        }
    }
}

/// Every station of a network in this program, each behind a page of its own. Their messages are delayed and lost according to the file.
fn stations(
    args: &LiveArgs,
    device: &DeviceAddress,
    address: SocketAddr,
    source: &Source,
) -> Result<ExitCode, Failure> {
    if *device != DeviceAddress::Sim {
        return Err(Failure::input(format!(
            "--device {device}: of a network hapt live simulates every station; hapt run --station NAME runs one on a motor"
        )));
    }
    let network = read_system(source, &args.sets)?;
    output::folder("--log-dir", &args.log_dir)?;
    signals::end_in_order();
    let ends = network::connect(&network).map_err(|error| match error {
        LinkError::Check(error) => Failure::input(error),
        error @ (LinkError::Listen { .. }
        | LinkError::Key { .. }
        | LinkError::Peer { .. }
        | LinkError::Bus { .. }
        | LinkError::Limit(_)
        | LinkError::System { .. }) => Failure::System(error.to_string()),
    })?;
    let mut lives = Vec::new();
    for (at, (station, StationEnd { ports, view })) in network.stations.iter().zip(ends).enumerate() {
        let port = match address.port() {
            0 => Some(0),
            first => u16::try_from(at).ok().and_then(|at| first.checked_add(at)),
        };
        let port = port.ok_or_else(|| {
            let text = format!("--port {}: each station has a port of its own from there on, up to 65535", args.port);
            Failure::input(text)
        })?;
        let options = Options {
            worlds: vec![station.source.clone()],
            sets: station.sets.clone(),
            address: SocketAddr::new(address.ip(), port),
            token: args.listen.is_some(),
            folder: args.log_dir.clone(),
        };
        let requested = settings(&args.realtime, &station.world)?;
        // The other threads carry the messages, serve the pages, and end what is too slow.
        let settings = Settings { leave_a_core: true, ..requested };
        let machine = |world: &World| {
            let machine = device.machine(world, SafetyProfile::Simulated, settings, 0.0)?.machine;
            let machine = machine
                .with_outside(Outside::linked(ports))
                .ok_or_else(|| Failure::input("the device runs its loop by itself"))?;
            Ok::<_, Failure>(Machine { network: Some(view), ..machine })
        };
        lives.push(Live::start_on(options, machine)?);
    }
    let handles: Vec<_> = lives.iter().map(Live::handle).collect();
    signals::stop_with(move || handles.iter().for_each(hapt_rt::LoopHandle::end));
    let widest = network.stations.iter().map(|station| station.name.chars().count()).max().unwrap_or(0);
    let names = network.stations.iter().map(|station| station.name.as_str());
    serve(args, lives, None, |links| names.zip(links).map(|(name, link)| format!("{name:widest$}  {link}\n")).collect())
}

/// The period of a board's telemetry in s, where the line allows it: no peak of a loop at 1 kHz is lost.
const SHOWN: f64 = 1e-3;

/// The machine that runs the world.
fn machine(args: &LiveArgs, device: &DeviceAddress, world: &World) -> Result<Machine, Failure> {
    let profile = device.profile(world, args.uncertified)?;
    let opened = device.machine(world, profile, settings(&args.realtime, world)?, SHOWN)?;
    notes(&opened.notes);
    Ok(opened.machine)
}

/// The same with the effects of games in addition to its world, and the wheel that games see.
fn with_games(
    args: &LiveArgs,
    device: &DeviceAddress,
    world: &World,
    steering: Steering,
) -> Result<(Wheel, Machine), Failure> {
    let room = Wheel::room(world, steering)?;
    let plain = machine(args, device, world)?;
    let (wheel, effects) = Wheel::attach(room)?;
    let playing = plain.with_outside(Outside::playing(effects));
    let machine = playing.ok_or_else(|| Failure::input("hapt wheel: the device runs its loop by itself"))?;
    let machine = Machine { wheel: Some(wheel.view()), ..machine };
    Ok((wheel, machine))
}

/// The address to listen on.
fn listen(address: Option<&str>) -> Result<IpAddr, Failure> {
    let Some(text) = address else { return Ok(Ipv4Addr::LOCALHOST.into()) };
    let number = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
    number.parse().map_err(|_| {
        Failure::input(format!(
            "--listen {text:?} is not a numeric address, such as 192.168.0.7, or 0.0.0.0 for all of this one's"
        ))
    })
}

/// Opens the link in the system's browser; without one, the link is printed.
fn open(link: &str) {
    let (program, before): (&str, &[&str]) = match () {
        () if cfg!(target_os = "macos") => ("open", &[]),
        () if cfg!(windows) => ("rundll32", &["url.dll,FileProtocolHandler"]),
        () => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(before).arg(link).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.spawn() {
        // It may live as long as the browser does.
        Ok(mut child) => drop(std::thread::spawn(move || child.wait())),
        Err(error) => say(format_args!("hapt: no browser could be opened ({program}: {error}); the link is above")),
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::World(_) => Failure::input(error),
            Error::Session(error) => error.into(),
            Error::Address { .. } | Error::System(_) | Error::Device(_) => Failure::System(error.to_string()),
        }
    }
}

impl From<hapt_host::Error> for Failure {
    fn from(error: hapt_host::Error) -> Self {
        match error {
            hapt_host::Error::World(_) => Failure::input(error),
            hapt_host::Error::Engine(error) => error.into(),
            hapt_host::Error::Board(error) => error.into(),
            hapt_host::Error::System(_)
            | hapt_host::Error::Device(_)
            | hapt_host::Error::Station { .. }
            | hapt_host::Error::Panicked(_) => Failure::System(error.to_string()),
        }
    }
}
