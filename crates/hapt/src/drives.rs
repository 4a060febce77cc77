//! Motor drives: which are plugged in, driving one, and simulating one.

use std::process::ExitCode;

use crate::args::SimulateDriveArgs;
use crate::failure::Failure;

#[cfg(target_os = "linux")]
pub use linux::{devices, simulate};
#[cfg(not(target_os = "linux"))]
pub use other::{devices, simulate};

/// The assumption of a certificate about a real motor; printed wherever one is driven.
pub const NOT_CERTIFIED: &str = "the certificate includes lag and jitter only as the file states them, in device.lag, loop.interval_max \
                                 and loop.delay_max; the last two are enforced where they are stated, as safety.late says";

#[cfg(target_os = "linux")]
mod linux {
    use std::io::{Write, stdout};
    use std::time::Instant;

    use hapt_drive::simulate::{Simulator, Time};
    use hapt_drive::{Bus, Make, Socket};

    use super::*;
    use crate::latency::time;
    use crate::messages::say;
    use crate::signals;
    use crate::world::{read_world, source};

    pub fn devices() -> Result<ExitCode, Failure> {
        let mut text = String::new();
        for port in hapt_drive::ports() {
            let specs: Vec<String> = port.specs.iter().map(|spec| format!("--device {spec}")).collect();
            text += format!("{:<16} {:<40} {}", port.name, port.says, specs.join(" or ")).trim_end();
            text.push('\n');
        }
        if text.is_empty() {
            text += "no serial port on USB and no CAN interface\n";
        }
        stdout().lock().write_all(text.as_bytes()).map_err(Failure::stdout)?;
        Ok(ExitCode::SUCCESS)
    }

    pub fn simulate(args: &SimulateDriveArgs) -> Result<ExitCode, Failure> {
        let (name, motor) = match args.make.split_once('?') {
            None => (&*args.make, None),
            Some((name, motor)) => (name, Some(motor)),
        };
        let make = Make::from_name(name).ok_or_else(|| {
            Failure::input(format!("cannot simulate a drive {name:?}; expected {}", Make::NAMES.join(", ")))
        })?;
        if !make.ids().contains(&args.id) {
            let (from, to) = (make.ids().start().to_owned(), make.ids().end().to_owned());
            return Err(Failure::input(format!("--id {}: {}'s go from {from} to {to}", args.id, make.one())));
        }
        if args.can.is_some() && !make.has_can() {
            return Err(Failure::input(format!("--can: {} has a serial port and no CAN; use --pty", make.one())));
        }
        let source = source(args.world.as_deref().unwrap_or("@notes/wheel".as_ref()))?;
        let world = read_world(&source, &args.sets)?;
        let scenario = args.scenario.as_deref().map(|name| world.scenario(name)).transpose()?;
        let ends_at = args.duration.as_deref().map(|text| time("--duration", text)).transpose()?;
        let clock = if args.lockstep { Time::Lockstep(world.sampling.period) } else { Time::Real };
        let firmware = match motor {
            None => make.simulated(args.id),
            Some(motor) => {
                let wrong = |error| Failure::input(format!("{}: {error}", args.make));
                let motor = motor.parse().map_err(wrong)?;
                make.with_motor(motor).ok_or_else(|| wrong(format!("{} has no constant of a motor", make.one())))?
            }
        };
        let (bus, name): (Box<dyn Bus>, String) = match &args.can {
            Some(interface) => {
                let wrong = |error| Failure::System(format!("--can {interface}: {error}"));
                (Box::new(Socket::open(interface).map_err(wrong)?), interface.clone())
            }
            None => {
                let (line, path) = hapt_drive::pty().map_err(|error| Failure::System(format!("no pty: {error}")))?;
                (make.adapter(line), path.display().to_string())
            }
        };
        let mut simulator = Simulator::new(bus, firmware, &world, clock);
        writeln!(stdout(), "{name}").and_then(|()| stdout().flush()).map_err(Failure::stdout)?;
        signals::end_in_order();
        say(format_args!("{} with id {} is simulated at {name}; Ctrl-C takes it away", make.one(), args.id));
        if let Some(scenario) = scenario {
            simulator.play(&world, &scenario.name);
        }
        let begun = Instant::now();
        let is_over = || ends_at.is_some_and(|ends_at| begun.elapsed().as_secs_f64() >= ends_at);
        let ran = simulator.run(|| signals::signalled().is_some() || is_over());
        ran.map_err(|error| Failure::System(format!("{name} is gone: {error}")))?;
        Ok(signals::signalled().map_or(ExitCode::SUCCESS, ExitCode::from))
    }
}

/// Drives need Linux.
#[cfg(not(target_os = "linux"))]
mod other {
    use std::io::{Write, stdout};

    use hapt_host::board::names;

    use super::*;

    const ONLY_LINUX: &str = "motor drives are driven from Linux only";

    /// Serial ports, for boards.
    pub fn devices() -> Result<ExitCode, Failure> {
        let names = names().map_err(|error| Failure::System(format!("the serial ports cannot be listed: {error}")))?;
        let line = |name: &std::path::PathBuf| format!("{:<16} --device hapt:{}\n", name.display(), name.display());
        let mut text: String = names.iter().map(line).collect();
        if text.is_empty() {
            text += "no serial port\n";
        }
        stdout().lock().write_all(text.as_bytes()).map_err(Failure::stdout)?;
        Ok(ExitCode::SUCCESS)
    }

    pub fn simulate(_: &SimulateDriveArgs) -> Result<ExitCode, Failure> {
        Err(Failure::input(ONLY_LINUX))
    }
}
