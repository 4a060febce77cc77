//! `hapt wheel`: the device as a force-feedback wheel of this computer, for games.

use std::path::PathBuf;
use std::process::ExitCode;

use hapt_core::wheel::Shortfall;
use hapt_host::game_wheel::{GameWheel, Room, STEERING, WheelError, WheelStatus, reason};
use hapt_host::{DeviceAddress, WheelView};
use hapt_model::{Dimension, World, is_network};
use hapt_rt::EffectsPort;

use crate::args::{LiveArgs, RunArgs, StationArgs, WheelArgs, WorldArgs, device};
use crate::conform;
use crate::failure::Failure;
use crate::format;
use crate::live;
use crate::messages;
use crate::run;
use crate::world::source;

/// Two soft stops.
const DEFAULT: &str = "@devices/game-wheel";
/// The stops of the default world, and the side that each is on.
const STOPS: [(&str, f64); 2] = [("couplings.0.at", 0.5), ("couplings.1.at", -0.5)];

pub fn run(args: &WheelArgs) -> Result<ExitCode, Failure> {
    if let Some(device) = &args.conform.conform {
        return conform::run(&args.conform, device.as_deref());
    }
    let range = format::positive("--range", &args.range, Dimension::ANGLE)?;
    if !STEERING.contains(&range) {
        return Err(Failure::input(format!(
            "--range {}: {}",
            args.range,
            WheelError::Range { degrees: range.to_degrees() }
        )));
    }
    let mut sets = Vec::new();
    if args.path.is_none() {
        sets.extend(STOPS.map(|(key, share)| format!("{key}={} rad", share * range)));
    }
    sets.extend(args.sets.iter().cloned());
    let path = args.path.clone().unwrap_or_else(|| PathBuf::from(DEFAULT));
    let (file, device) = (source(&path)?, device(&args.device)?);
    if is_network(&file) {
        return Err(Failure::input(format!("{}: is a network; a wheel runs one world", path.display())));
    }
    if device == DeviceAddress::Sim && World::read(&file, &sets)?.safety.late.is_none() {
        // A desktop computer samples late now and then, and nobody holds a simulated wheel.
        sets.push("safety.late=count".into());
    }
    if let DeviceAddress::Board(_) = device {
        return Err(Failure::input(
            "--device: a board runs its loop by itself, and knows no effects; a wheel needs a loop of this computer",
        ));
    }
    if args.page {
        let live = LiveArgs {
            path: Some(path),
            sets,
            port: args.port,
            device: args.device.clone(),
            uncertified: false,
            listen: None,
            log_dir: PathBuf::from("."),
            open: false,
            realtime: args.realtime.clone(),
        };
        return live::with(&live, Some(range));
    }
    let run = RunArgs {
        world: WorldArgs { path, sets },
        device: args.device.clone(),
        scenario: None,
        duration: args.duration.clone(),
        log: args.log.clone(),
        uncertified: false,
        station: StationArgs::default(),
        realtime: args.realtime.clone(),
    };
    run::with(&run, Some(range))
}

/// The wheel beside a run.
pub struct Wheel {
    wheel: GameWheel,
    room: Room,
    /// Which reasons have been told.
    told: [bool; 3],
}

/// Why less is given than asked, in the order of [`WheelStatus::less`].
const REASONS: [Shortfall; 3] = [Shortfall::Drives, Shortfall::Stiffness, Shortfall::Limit];

impl Wheel {
    /// What the device of this world can be as a wheel.
    pub fn room(world: &World, range: f64) -> Result<Room, Failure> {
        Room::of(world, range).map_err(failure)
    }

    /// Attaches it. The second is the loop's end.
    pub fn attach(room: Room) -> Result<(Self, EffectsPort), Failure> {
        let (wheel, port) = GameWheel::attach(&room).map_err(failure)?;
        if let Some(why) = room.not_proved().first() {
            messages::say(format_args!("the world of this wheel is certified as far as its linear loop goes: {why}"));
        }
        messages::say(format_args!(
            "the wheel is attached; games have {} of springs and dampers to share",
            stiffness(&room)
        ));
        Ok((Wheel { wheel, room, told: [false; 3] }, port))
    }

    /// For the pages of its loop.
    pub fn view(&self) -> Box<dyn WheelView> {
        Box::new(self.wheel.view())
    }

    /// Whether the host has it.
    pub fn is_attached(&self) -> bool {
        self.wheel.status().is_attached
    }

    /// Says what is new.
    pub fn say(&mut self) {
        let status = self.wheel.status();
        for ((told, samples), why) in self.told.iter_mut().zip(status.less).zip(REASONS) {
            if samples > 0 && !*told {
                *told = true;
                messages::say(format_args!("less is given than a game asks for: {}", reason(why)));
            }
        }
    }

    /// Detaches it, and gives the lines of the summary.
    pub fn end(&mut self) -> String {
        let WheelStatus { taken, refused, samples, played, peak, less, scale, .. } = self.wheel.end();
        let [taken, samples, played] = [taken, samples, played].map(format::count);
        let refused = if refused > 0 { format!(", {} refused", format::count(refused)) } else { String::new() };
        let room = &self.room;
        let mut text = format!(
            "wheel        the effects share {} N m s/rad of damping: {} at most\n\
             effects      {taken} reports taken{refused}; effects played in {played} of {samples} samples, the motor gave {peak:.3} N m at most\n",
            format::number(room.damping()),
            stiffness(room),
        );
        for (samples, why) in less.iter().zip(REASONS).filter(|(samples, _)| **samples > 0) {
            text += &format!("             less than asked in {} samples: {}\n", format::count(*samples), reason(why));
        }
        if scale < 1.0 {
            text += &format!("             springs were scaled to {:.1} % at least\n", 100.0 * scale);
        }
        text
    }
}

fn stiffness(room: &Room) -> String {
    format!("{} N m/rad", format::number(room.stiffness()))
}

fn failure(error: WheelError) -> Failure {
    match error {
        WheelError::Device(_) | WheelError::Range { .. } | WheelError::World(_) | WheelError::Check(_) => {
            Failure::input(error)
        }
        WheelError::NoController | WheelError::Permission | WheelError::NoPort | WheelError::Attach(_) => {
            Failure::System(error.to_string())
        }
    }
}
