//! A board that is none: the firmware's own station in real time on the exact device, behind a pseudoterminal.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::SeqCst};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;
use hapt_wire::LONGEST;
use hapt_wire::device::{Board, Endpoint, Measurement, WorldStorage};

use super::{Line, pty};

/// Samples that are made up for when the thread comes late; a longer pause is none in the board's time.
const BURST: u32 = 50;
/// How long an answer may wait for a host that does not read.
const PATIENCE: Duration = Duration::from_millis(100);

/// A simulated board. Dropped, it is gone.
#[derive(Debug)]
pub struct SimulatedBoard {
    path: PathBuf,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    end: AtomicBool,
    /// The line is cut; the board goes on.
    unplugged: AtomicBool,
    /// The board is to begin anew, without its world.
    restarted: AtomicBool,
    /// Its motor's driver reports a fault.
    tripped: AtomicBool,
    /// Of so many bytes on the line, either way, one is another; 0: none.
    disturbed: AtomicU32,
    /// The bits of what the motor holds, and of the most that it has held.
    torque: AtomicU32,
    most: AtomicU32,
}

impl SimulatedBoard {
    /// Puts a board on the table, whose motor turns the puck of `spec`; the world's own period takes the place of the spec's.
    ///
    /// # Errors
    /// The system gives no pseudoterminal, or no thread.
    pub fn start(board: Board, spec: DeviceSpec) -> io::Result<Self> {
        let (line, path) = pty()?;
        let shared = Arc::new(Shared::default());
        let its = Arc::clone(&shared);
        let thread =
            std::thread::Builder::new().name("board".into()).spawn(move || Table::new(spec, its, line).run(board))?;
        Ok(SimulatedBoard { path, shared, thread: Some(thread) })
    }

    /// Where it is plugged in.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the motor holds now, in N·m (linear: N).
    pub fn torque(&self) -> f32 {
        f32::from_bits(self.shared.torque.load(SeqCst))
    }

    /// The most that it has held, either way.
    pub fn most(&self) -> f32 {
        f32::from_bits(self.shared.most.load(SeqCst))
    }

    /// Pulls the plug. The board's supply is another: it goes on.
    pub fn unplug(&self) {
        self.shared.unplugged.store(true, SeqCst);
    }

    /// Its processor begins anew, as a watchdog or a supply that dips makes it.
    pub fn restart(&self) {
        self.shared.restarted.store(true, SeqCst);
    }

    /// Its motor's driver reports a fault at the next sample, such as too much current.
    pub fn trip(&self) {
        self.shared.tripped.store(true, SeqCst);
    }

    /// From now on one of so many bytes on the line is another; 0: none.
    pub fn disturb(&self, one_of: u32) {
        self.shared.disturbed.store(one_of, SeqCst);
    }
}

impl Drop for SimulatedBoard {
    fn drop(&mut self) {
        self.shared.end.store(true, SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What the thread has before it.
struct Table {
    spec: DeviceSpec,
    device: VirtualDevice,
    shared: Arc<Shared>,
    line: Option<Line>,
    /// Bytes since one was another.
    whole: u32,
}

impl Table {
    fn new(spec: DeviceSpec, shared: Arc<Shared>, line: Line) -> Self {
        Table { spec, device: VirtualDevice::new(&spec), shared, line: Some(line), whole: 0 }
    }

    fn run(&mut self, board: Board) {
        while !self.shared.end.load(SeqCst) {
            self.until_it_restarts(board);
            self.device.command(0.0);
            self.shared.torque.store(0, SeqCst);
        }
    }

    fn until_it_restarts(&mut self, board: Board) {
        let (mut one, mut other) = (WorldStorage::EMPTY, WorldStorage::EMPTY);
        let mut station = Endpoint::new(board, &mut one, &mut other);
        let mut due = Instant::now();
        while !self.shared.end.load(SeqCst) && !self.shared.restarted.swap(false, SeqCst) {
            if self.shared.unplugged.load(SeqCst) {
                self.line = None;
            }
            self.listen(&mut station, due);
            for _ in 0..BURST {
                if due > Instant::now() {
                    break;
                }
                due += Duration::from_secs_f32(station.period());
                if !board.externally_clocked {
                    self.sample(&mut station);
                    self.answer(&mut station);
                }
            }
            due = due.max(Instant::now());
        }
    }

    /// What comes on the line until the next sample.
    fn listen(&mut self, station: &mut Endpoint<'_>, due: Instant) {
        let mut bytes = [0; 256];
        let Some(line) = &mut self.line else {
            return std::thread::sleep(due.saturating_duration_since(Instant::now()));
        };
        match line.read(&mut bytes, due) {
            Ok(count) => {
                for byte in &bytes[..count] {
                    let byte = self.disturbed(*byte);
                    station.push(byte);
                    self.answer(station);
                }
            }
            Err(_) => self.line = None,
        }
    }

    fn sample(&mut self, station: &mut Endpoint<'_>) {
        let period = f64::from(station.period());
        if (period - self.spec.period).abs() > 1e-6 * period {
            self.spec.period = period;
            self.device.refit(&mut VirtualDevice::new(&self.spec));
        }
        let (position, velocity) = self.device.puck();
        let fault = self.shared.tripped.swap(false, SeqCst);
        let seen =
            Measurement { position: position as f32, velocity: velocity as f32, fault, ..Measurement::default() };
        let motor = station.sample(&seen);
        self.device.command(f64::from(motor.torque));
        self.device.travel();
        self.shared.torque.store(motor.torque.to_bits(), SeqCst);
        let most = f32::from_bits(self.shared.most.load(SeqCst)).max(motor.torque.abs());
        self.shared.most.store(most.to_bits(), SeqCst);
    }

    /// What there is to say, for a host that listens.
    fn answer(&mut self, station: &mut Endpoint<'_>) {
        let mut room = [0; LONGEST];
        while let Some(frame) = station.answer(&mut room) {
            let frame: Vec<u8> = frame.iter().map(|byte| self.disturbed(*byte)).collect();
            if let Some(line) = &mut self.line {
                let _ = line.write(&frame, Instant::now() + PATIENCE);
            }
        }
    }

    fn disturbed(&mut self, byte: u8) -> u8 {
        let one_of = self.shared.disturbed.load(SeqCst);
        self.whole += 1;
        if one_of == 0 || self.whole < one_of {
            return byte;
        }
        self.whole = 0;
        byte ^ 0x55
    }
}
