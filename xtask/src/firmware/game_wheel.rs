//! The wheel for games that runs on a board by itself: its world as bytes, and the contents of its program.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use hapt_wire::pid::DESCRIPTOR;

use super::{chip, control, program, qemu};

/// The file of the program's world.
const BYTES: &str = "firmware/worlds/game-wheel.bin";
/// The built-in world, with stops as far apart as those of `hapt wheel`.
const WORLD: &str = "worlds/devices/game-wheel.toml";
/// 900°.
#[cfg(target_os = "linux")]
const RANGE: f64 = 5.0 * std::f64::consts::PI;
/// Of this board.
pub const BOARD: &str = "stm32f405";
/// The texts that the host reads in addition to the report descriptor, in UTF-8 as in the program.
const TEXTS: [&str; 2] = ["hapt wheel", "hapt"];

/// Writes the world of a file into the program.
pub fn write(file: &Path) -> Result<()> {
    fs::write(BYTES, bytes(file)?).context(BYTES)
}

#[cfg(target_os = "linux")]
fn room(file: &Path) -> Result<(hapt_model::World, hapt_host::game_wheel::Room)> {
    let world = hapt_model::World::read(&hapt_model::Source::open(file)?, &[])?;
    let room = hapt_host::game_wheel::Room::of(&world, RANGE)?;
    Ok((world, room))
}

#[cfg(target_os = "linux")]
fn bytes(file: &Path) -> Result<Vec<u8>> {
    let (world, room) = room(file)?;
    let mut bytes = [0; 2048];
    let limits = hapt_core::Limits {
        // No host has to send heartbeats: the effects handle the loss of the USB host.
        link: f64::INFINITY,
        ..world.board_limits(hapt_core::SafetyProfile::Certified)
    };
    Ok(hapt_wire::pack_wheel(room.device(), room.half(), &world.spec(), &limits, &mut bytes)?.to_vec())
}

/// The code of a wheel is built only where `hapt wheel` is.
#[cfg(not(target_os = "linux"))]
fn bytes(_: &Path) -> Result<Vec<u8>> {
    anyhow::bail!("worlds are made into wheels on Linux only")
}

/// The answers of `hapt wheel` to these requests of a host.
#[cfg(target_os = "linux")]
fn of_this_computer(requests: &[[u8; 8]]) -> Result<Vec<Vec<u8>>> {
    use hapt_host::game_wheel::GameWheel;
    use std::io::{Read as _, Write as _};
    let (own, mut host) = std::os::unix::net::UnixStream::pair()?;
    host.set_read_timeout(Some(super::line::BOARD_TIMEOUT))?;
    let (_wheel, _port) = GameWheel::on(own, &room(Path::new(WORLD))?.1)?;
    let mut answers = Vec::new();
    for (number, setup) in (1..).zip(requests) {
        let length = u32::from(u16::from_le_bytes([setup[6], setup[7]]));
        // USBIP_CMD_SUBMIT, and the answer's header before its data.
        let words = [1, number, 0x10002, 1, 0, 0, length, 0, 0, 1];
        let mut message: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
        message.extend(setup);
        host.write_all(&message)?;
        let mut header = [0; 48];
        host.read_exact(&mut header)?;
        let word = |at: usize| header[at..].first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes));
        ensure!(word(20) == 0, "hapt wheel does not answer {setup:02x?}");
        let mut answer = vec![0; word(24) as usize];
        host.read_exact(&mut answer)?;
        answers.push(answer);
    }
    Ok(answers)
}

#[cfg(not(target_os = "linux"))]
fn of_this_computer(_: &[[u8; 8]]) -> Result<Vec<Vec<u8>>> {
    anyhow::bail!("hapt wheel is there on Linux only")
}

/// On the emulated board, with its controller's endpoints: every descriptor is the computer's to the byte; a host's constant torque acts,
/// and ends after a suspend.
fn runs() -> Result<()> {
    let printed = qemu("netduinoplus2", &program(BOARD, "usb", None)?, &[], &[])?;
    let (mut requests, mut answers, mut torques) = (Vec::<[u8; 8]>::new(), Vec::new(), Vec::new());
    for line in printed.lines() {
        match line.split_once(' ').map(|(request, answer)| (bytes_of(request), bytes_of(answer))) {
            Some((Some(request), Some(answer))) if request.len() == 8 => {
                requests.push(request.try_into().unwrap_or_default());
                answers.push(answer);
            }
            _ if line.starts_with(char::is_alphabetic) => {}
            _ => torques = line.split(' ').map(str::parse::<f64>).collect::<Result<_, _>>().context(printed.clone())?,
        }
    }
    ensure!(requests.len() == 6, "the board does not tell its descriptors: {printed}");
    ensure!(answers == of_this_computer(&requests)?, "the board's descriptors are not those of hapt wheel: {printed}");
    let [before, during, after] = torques[..] else { anyhow::bail!("no torques: {printed}") };
    // Half of the wheel's 5 N·m.
    let holds = before == 0.0 && (during - 2.5).abs() < 1e-3 && after.abs() < 1e-3;
    ensure!(holds, "{before} N m before an effect of 2.5 N m, {during} while it plays, {after} after a suspend");
    Ok(())
}

/// Instructions of the wheel's interrupt by number of conditions, the additional ones of a change, and those of a report in the main loop.
pub fn counts() -> Result<String> {
    let program = program(BOARD, "usb", None)?;
    let printed = qemu("netduinoplus2", &program, &[], &["-icount", "shift=5,sleep=off"])?;
    let mut table =
        String::from("| conditions that play | a sample | a sample after a change |\n| --- | ---: | ---: |\n");
    let mut report = None;
    for line in printed.lines() {
        match line.split(' ').collect::<Vec<_>>()[..] {
            ["effects", effects, sample, change] => writeln!(table, "| {effects} | {sample} | {change} |")?,
            ["report", count] => report = Some(count),
            _ => {}
        }
    }
    let report = report.with_context(|| format!("no counts: {printed}"))?;
    writeln!(table, "\nA report that changes a condition takes {report} in the main loop.")?;
    Ok(table)
}

fn bytes_of(digits: &str) -> Option<Vec<u8>> {
    digits.as_bytes().chunks(2).map(|two| u8::from_str_radix(std::str::from_utf8(two).ok()?, 16).ok()).collect()
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
    runs()?;
    println!("        the wheel for games: its world, the descriptors of hapt wheel, no panic code in its interrupts");
    Ok(())
}
