//! An emulated board, and a host on its UART.

use std::fs;
use std::io::{BufReader, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command as Process, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use fastrand::Rng;
use hapt_core::Limits;
use hapt_model::World;
use hapt_wire::{Command, DeviceMessage, HostMessage, MAX_FRAME_BYTES, PIECE, PROTOCOL, Reader, frame, hash, pack};

/// A board that does not answer within this time is dead.
pub const BOARD_TIMEOUT: Duration = Duration::from_secs(20);

/// An emulated board, and the line to it.
pub struct Board {
    emulator: Child,
    line: BufReader<UnixStream>,
    reader: Reader<MAX_FRAME_BYTES>,
    sequence: u32,
    /// The number of the next sample.
    pub sample: u64,
    /// Random bytes before each frame.
    pub noise: Option<Rng>,
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

impl Board {
    /// Starts a program on an emulated board with its UART on a socket, and greets it; `fed`: it has no encoder.
    pub fn start(machine: &str, program: &Path, more: &[&str], fed: bool) -> Result<Board> {
        let start = Instant::now();
        let socket = std::env::temp_dir().join(format!("hapt-{machine}-{}", std::process::id()));
        let _ = fs::remove_file(&socket);
        let mut command = Process::new("qemu-system-arm");
        command.args([
            "-machine",
            machine,
            "-display",
            "none",
            "-monitor",
            "none",
            "-serial",
            "chardev:line",
            "-chardev",
        ]);
        command.arg(format!("socket,id=line,server=on,wait=on,path={}", socket.display()));
        command.args(more).arg("-kernel").arg(program).stdin(Stdio::null()).stderr(Stdio::null());
        let emulator = command.spawn()?;
        let line = loop {
            match UnixStream::connect(&socket) {
                Ok(line) => break line,
                Err(_) if start.elapsed() < BOARD_TIMEOUT => std::thread::sleep(Duration::from_millis(20)),
                Err(error) => return Err(error).context("the emulator opens no line"),
            }
        };
        line.set_read_timeout(Some(Duration::from_millis(200)))?;
        let line = BufReader::new(line);
        let mut board = Board { emulator, line, reader: Reader::new(), sequence: 0, sample: 0, noise: None };
        // Bytes before its receiver is on are lost.
        (board.sequence, board.sample) = loop {
            board.ask(Command::Hello { protocol: PROTOCOL })?;
            let reply = board.receive(Duration::from_millis(500), |message| match message {
                DeviceMessage::Hello(hello) => Some((hello.sequence, hello.sample, hello.externally_clocked)),
                _ => None,
            })?;
            match reply {
                Some((sequence, sample, its)) if its == fed => break (sequence, sample),
                Some(_) => bail!("another firmware"),
                None => ensure!(start.elapsed() < BOARD_TIMEOUT, "the board does not answer"),
            }
        };
        Ok(board)
    }

    /// Whether the emulator ends by itself, as a watchdog makes it.
    pub fn has_ended(&mut self) -> Result<bool> {
        let start = Instant::now();
        while start.elapsed() < BOARD_TIMEOUT {
            if self.emulator.try_wait()?.is_some() {
                return Ok(true);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(false)
    }

    pub fn ask(&mut self, command: Command<'_>) -> Result<u32> {
        if let Some(noise) = &mut self.noise {
            let bytes: Vec<u8> = (0..noise.usize(..40)).map(|_| noise.u8(..)).chain([0]).collect();
            self.line.get_mut().write_all(&bytes)?;
        }
        self.sequence += 1;
        let message = HostMessage { sequence: self.sequence, not_after: self.sample + 30_000, command };
        let mut room = [0; MAX_FRAME_BYTES];
        self.line.get_mut().write_all(frame(&message, &mut room)?)?;
        Ok(self.sequence)
    }

    /// The first answer that `wanted` takes; `None` after `patience`.
    pub fn receive<R>(
        &mut self,
        patience: Duration,
        mut wanted: impl FnMut(DeviceMessage<'_>) -> Option<R>,
    ) -> Result<Option<R>> {
        let start = Instant::now();
        let mut byte = [0];
        while start.elapsed() < patience {
            match self.line.read(&mut byte) {
                Ok(0) => bail!("the emulator has ended"),
                Ok(_) => {}
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
                Err(error) => return Err(error.into()),
            }
            if let Some(reply) = self.reader.push::<DeviceMessage<'_>>(byte[0]).and_then(&mut wanted) {
                return Ok(Some(reply));
            }
        }
        Ok(None)
    }

    /// Sends a command, and waits until it is executed.
    pub fn done(&mut self, command: Command<'_>) -> Result<()> {
        let sequence_sent = self.ask(command)?;
        let answer = self.receive(BOARD_TIMEOUT, |message| match message {
            DeviceMessage::Done { sequence } | DeviceMessage::Value { sequence, .. } if sequence == sequence_sent => {
                Some(Ok(()))
            }
            DeviceMessage::Refused { sequence, why } if sequence == sequence_sent => Some(Err(why)),
            _ => None,
        })?;
        answer
            .with_context(|| format!("no answer to {command:?}"))?
            .map_err(|why| anyhow::anyhow!("{command:?}: refused, {}", why.sentence()))
    }

    /// Sends a world, and returns its hash.
    pub fn load(&mut self, world: &World, limits: &Limits) -> Result<u32> {
        let mut room = [0; 1024];
        let bytes = pack(&world.spec(), limits, &mut room)?;
        let hash = hash(bytes);
        self.done(Command::Begin { length: bytes.len() as u16, hash })?;
        for (i, piece) in bytes.chunks(PIECE).enumerate() {
            self.done(Command::Piece { at: (i * PIECE) as u16, bytes: piece })?;
        }
        self.done(Command::Commit)?;
        Ok(hash)
    }
}
