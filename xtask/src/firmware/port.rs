//! `hapt flash` and `hapt run` with the firmware on an emulated board at a pseudoterminal, as with one at a serial port.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use hapt_wire::{Command as BoardCommand, HostMessage, PROTOCOL, frame};

use super::line::BOARD_TIMEOUT;
use super::{BUILT, control, has_tools, program};
use crate::programs;

/// A wheel on a spring, certified. The board's puck moves by itself at any torque: the motor is not tested.
const WORLD: &str = r#"
title = "knob"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "5e-3 N m s/rad"
limit = "822.25 N mm"
[safety]
pulse = "0 N m"
stuck = 0
link = "10 s"
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "0.2 N m/rad"
"#;

/// Time is what instructions take, 32 ns each, and never ahead of this machine's: a sample is never late, however busy the machine is.
const ICOUNT: [&str; 2] = ["-icount", "shift=5,align=on,sleep=on"];

/// Runs of a command whose board does not answer in time.
const TRIES: usize = 5;

/// An emulated board at a port.
struct Board {
    emulator: Child,
    port: String,
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

impl Board {
    fn start(folder: &Path, program: &Path) -> Result<Board> {
        let printed = folder.join("qemu");
        let file = File::create(&printed)?;
        let mut command = Command::new("qemu-system-arm");
        command.args(["-machine", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "pty"]);
        command.args(ICOUNT).arg("-kernel").arg(program).stdin(Stdio::null()).stdout(file.try_clone()?).stderr(file);
        let mut board = Board { emulator: command.spawn()?, port: String::new() };
        let start = Instant::now();
        loop {
            let printed = fs::read_to_string(&printed)?;
            if let Some((_, after)) = printed.split_once("redirected to ") {
                board.port = after.split_whitespace().next().unwrap_or_default().into();
                return Ok(board);
            }
            ensure!(start.elapsed() < BOARD_TIMEOUT, "the emulator gives no pseudoterminal: {printed}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Its `--device` address.
    fn device(&self) -> String {
        format!("hapt:{}", self.port)
    }
}

/// Worlds are sent, run, logged and replayed; a disconnected board, or another one, is an error with that message.
pub fn holds() -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    programs::program("hapt")?;
    let folder = std::env::current_dir()?.join(BUILT).join("port");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("w.toml"), WORLD)?;
    let board = Board::start(&folder, &program("mps2", "wheel", None)?)?;
    let device = board.device();
    let hapt = |words: &[&str]| ended(&folder, words);

    hapt(&["flash", "w.toml", "--device", &device])?
        .with(0, &["board        mps2, firmware", ": sent and verified"])?;
    hapt(&["flash", "w.toml", "--device", &device])?.with(0, &[": was there already"])?;
    // A host that ends in the middle of a world leaves no loop running, and does not block the next host.
    half_a_world(&board.port)?;
    let run = ["run", "w.toml", "--device", &device, "--duration", "0.5 s", "--log", "run.mcap"];
    hapt(&run)?.with(0, &["on the board mps2", "at full torque; ended in order", "none missed"])?;
    hapt(&["log", "replay", "run.mcap"])?.with(0, &["same       all torques of", " samples, to the bit"])?;
    // From every twentieth sample the ones in between cannot be inferred.
    let slow = format!("{device}@57600");
    hapt(&["run", "w.toml", "--device", &slow, "--duration", "0.2 s", "--log", "slow.mcap"])?
        .with(0, &["ended in order"])?;
    hapt(&["log", "replay", "slow.mcap"])?.with(2, &["only where every sample is in it", "hapt:PATH@BAUD"])?;
    // The board's own refusal, and then the world that it still has.
    let sets = ["--set", "loop.period=20ms", "--uncertified"];
    hapt(&[&["flash", "w.toml", "--device", &device], &sets[..]].concat())?
        .with(2, &["the board refuses to take the world"])?;
    hapt(&["flash", "w.toml", "--device", &device])?.with(0, &[": was there already"])?;

    cut(&folder, board)?;

    let other = Board::start(&folder, &control()?)?;
    let unanswered = hapt(&["flash", "w.toml", "--device", &other.device()])?;
    unanswered.with(3, &["answers in hapt's protocol"])?;
    println!("        mps2-an386 at a pseudoterminal: sent, run, replayed, cut");
    Ok(())
}

/// A run ends with its board, and its log can be replayed up to there.
fn cut(folder: &Path, mut board: Board) -> Result<()> {
    let mut running = Command::new(hapt_program()?);
    running.args(["run", "w.toml", "--device", &board.device(), "--log", "cut.mcap"]).current_dir(folder);
    let printed = folder.join("err");
    let mut running = running.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(File::create(&printed)?).spawn()?;
    let start = Instant::now();
    while !fs::read_to_string(&printed)?.contains("at full torque") {
        ensure!(start.elapsed() < BOARD_TIMEOUT && running.try_wait()?.is_none(), "{}", fs::read_to_string(&printed)?);
        std::thread::sleep(Duration::from_millis(20));
    }
    board.emulator.kill()?;
    let out = String::from_utf8(running.wait_with_output()?.stdout)?;
    let err = fs::read_to_string(&printed)?;
    ensure!(out.contains("broken off") && err.contains("is gone: "), "the board has gone: {out}{err}");
    let replayed = ended(folder, &["log", "replay", "cut.mcap"])?;
    // On a busy machine the log may lack the sample at which the torque began: then nothing of it can be replayed, with a message.
    if replayed.printed.contains("can be replayed: it has neither the loop's first sample") {
        return replayed.with(2, &[]);
    }
    replayed.with(0, &["same       all torques of"])
}

/// Begins to send a world, and goes away.
fn half_a_world(port: &str) -> Result<()> {
    let mut line = OpenOptions::new().write(true).open(port)?;
    let bytes = [1; 64];
    let commands = [
        BoardCommand::Hello { protocol: PROTOCOL },
        BoardCommand::Begin { length: 200, hash: 7 },
        BoardCommand::Piece { at: 0, bytes: &bytes },
    ];
    for (i, command) in commands.into_iter().enumerate() {
        // Far enough after earlier commands.
        let message = HostMessage { sequence: 1000 + i as u32, not_after: 60_000, command };
        line.write_all(frame(&message, &mut [0; 256])?)?;
    }
    // And a frame's beginning.
    Ok(line.write_all(&[3, 1])?)
}

struct Ended {
    words: String,
    code: Option<i32>,
    printed: String,
}

impl Ended {
    fn with(self, code: i32, parts: &[&str]) -> Result<()> {
        let Ended { words, printed, .. } = &self;
        ensure!(self.code == Some(code), "hapt {words}: ended with {:?}, not {code}: {printed}", self.code);
        for part in parts {
            ensure!(printed.contains(part), "hapt {words}: no {part:?} in: {printed}");
        }
        Ok(())
    }
}

fn hapt_program() -> Result<PathBuf> {
    let program = PathBuf::from(programs::binary(programs::PROFILE).get_program());
    program.canonicalize().with_context(|| program.display().to_string())
}

/// Runs a command to its end. On a busy machine the emulator may stand still for longer than a host waits for a board: such a run is
/// repeated; a dead board never answers.
fn ended(folder: &Path, words: &[&str]) -> Result<Ended> {
    for left in (0..TRIES).rev() {
        let done = Command::new(hapt_program()?).args(words).current_dir(folder).stdin(Stdio::null()).output()?;
        let printed = [done.stdout, done.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        if left == 0 || !printed.contains("has stopped answering") {
            return Ok(Ended { words: words.join(" "), code: done.status.code(), printed });
        }
    }
    bail!("no try of {words:?}")
}
