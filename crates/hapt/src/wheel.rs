//! `hapt wheel`: the device as a force-feedback wheel of this computer, for games.

use std::path::PathBuf;
use std::process::ExitCode;

use hapt_host::DeviceAddress;
use hapt_host::game_wheel::{STEERING, WheelError};
use hapt_model::{Dimension, World};

use crate::args::{LiveArgs, RunArgs, StationArgs, Steering, WheelArgs, WorldArgs, device};
use crate::conform;
use crate::failure::Failure;
use crate::format;
use crate::live;
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
    let world = World::read(&file, &sets)?;
    if device == DeviceAddress::Sim && world.safety.late.is_none() {
        // A desktop computer samples late now and then, and no hand holds a simulated wheel.
        sets.push("safety.late=count".into());
    }
    if let DeviceAddress::Board(_) = device {
        return Err(Failure::input(
            "--device: a board runs its loop by itself, and knows no effects; a wheel needs a loop of this computer",
        ));
    }
    if args.page {
        let live = LiveArgs {
            paths: vec![path],
            sets,
            port: args.port,
            device: args.device.clone(),
            uncertified: false,
            listen: None,
            log_dir: PathBuf::from("."),
            open: false,
            realtime: args.realtime.clone(),
        };
        return live::with(&live, Some(Steering { range, dry: args.dry }));
    }
    let run = RunArgs {
        world: WorldArgs { path, sets },
        device: args.device.clone(),
        scenario: args.scenario.clone(),
        duration: args.duration.clone(),
        log: args.log.clone(),
        uncertified: false,
        station: StationArgs::default(),
        realtime: args.realtime.clone(),
    };
    run::with(&run, Some(Steering { range, dry: args.dry }))
}
