//! The wheel for games that runs on a board by itself: its world as bytes, and what its program holds.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use hapt_wire::pid::DESCRIPTOR;

use super::{chip, control, program};

/// Where the program takes its world from.
const BYTES: &str = "firmware/worlds/game-wheel.bin";
/// The world that it comes with, with stops as far apart as `hapt wheel` puts them.
const WORLD: &str = "worlds/devices/game-wheel.toml";
/// 900°.
#[cfg(target_os = "linux")]
const RANGE: f64 = 5.0 * std::f64::consts::PI;
/// Of this board.
pub const BOARD: &str = "stm32f405";
/// What the host reads of the device besides its reports' descriptor, in UTF-8 as the program holds it.
const TEXTS: [&str; 2] = ["hapt wheel", "hapt"];

/// Writes the world of a file into the program.
pub fn write(file: &Path) -> Result<()> {
    fs::write(BYTES, bytes(file)?).context(BYTES)
}

#[cfg(target_os = "linux")]
fn bytes(file: &Path) -> Result<Vec<u8>> {
    use hapt_core::SafetyProfile;
    use hapt_host::game_wheel::Room;
    use hapt_model::{Source, World};
    let world = World::read(&Source::open(file)?, &[])?;
    let room = Room::of(&world, RANGE)?;
    let mut bytes = [0; 2048];
    let limits = hapt_core::Limits {
        // There is no host that has to say that it is there: what the USB host has left is the business of the effects.
        link: f64::INFINITY,
        ..world.board_limits(SafetyProfile::Certified)
    };
    Ok(hapt_wire::pack_wheel(room.device(), room.half(), &world.spec(), &limits, &mut bytes)?.to_vec())
}

/// What makes a device a wheel is there where `hapt wheel` is.
#[cfg(not(target_os = "linux"))]
fn bytes(_: &Path) -> Result<Vec<u8>> {
    anyhow::bail!("worlds are made into wheels on Linux only")
}

/// The program's world is the file's, its descriptors are those of the class, and nothing that its interrupts call can panic.
pub fn holds() -> Result<()> {
    ensure!(
        fs::read(BYTES).context(BYTES)? == bytes(Path::new(WORLD))?,
        "{BYTES} is not {WORLD}: cargo xtask firmware game-wheel {WORLD}"
    );
    let program = program(BOARD, "game-wheel", None)?;
    let held = fs::read(&program)?;
    let holds = |what: &[u8]| held.windows(what.len()).any(|bytes| bytes == what);
    ensure!(holds(DESCRIPTOR), "the program's report descriptor is not the one of hapt-wire");
    ensure!(holds(&bytes(Path::new(WORLD))?), "the program does not hold its world");
    for text in TEXTS {
        ensure!(holds(text.as_bytes()), "the program does not name itself {text}");
    }
    chip::interrupts_cannot_panic(&program, &control()?)?;
    println!("        the wheel for games: its world, its descriptor, and no panic code in its interrupts");
    Ok(())
}
