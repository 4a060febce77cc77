//! A simulated board: the firmware's own endpoint in real time on the exact device, behind a pseudoterminal.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::SeqCst};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;
use hapt_wire::MAX_FRAME_BYTES;
use hapt_wire::device::{Board, Endpoint, Measurement, WorldStorage};

use super::{Line, pty};

/// The largest number of samples that a late thread catches up; after a longer pause the board's time lags.
const MAX_CAUGHT_UP_SAMPLES: u32 = 50;
/// The time limit of a write to a host that does not read.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// A simulated board. Dropped, it ends.
#[derive(Debug)]
pub struct SimulatedBoard {
    path: PathBuf,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    end: AtomicBool,
    /// The line is disconnected; the board keeps running.
    unplugged: AtomicBool,
    /// The board restarts, without its world.
    restarted: AtomicBool,
    /// Its motor driver reports a fault.
    driver_fault: AtomicBool,
    /// Corrupts one byte in this many, in either direction; 0 disables.
    corrupt_every: AtomicU32,
    /// The bits of the motor's torque, and of its largest size so far.
    torque: AtomicU32,
    peak: AtomicU32,
}

impl SimulatedBoard {
    /// Starts a board whose motor turns the puck of `spec`; the period is that of the world that it runs.
    ///
    /// # Errors
    /// The system gives no pseudoterminal, or no thread.
    pub fn start(board: Board, spec: DeviceSpec) -> io::Result<Self> {
        let (line, path) = pty()?;
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        let thread =
            std::thread::Builder::new().name("board".into()).spawn(move || Bench::new(spec, own, line).run(board))?;
        Ok(SimulatedBoard { path, shared, thread: Some(thread) })
    }

    /// Its serial port.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The motor's torque, in N·m (linear: N).
    pub fn torque(&self) -> f32 {
        f32::from_bits(self.shared.torque.load(SeqCst))
    }

    /// The largest size of the motor's torque so far.
    pub fn peak_torque(&self) -> f32 {
        f32::from_bits(self.shared.peak.load(SeqCst))
    }

    /// Disconnects the line. The board has its own supply and keeps running.
    pub fn unplug(&self) {
        self.shared.unplugged.store(true, SeqCst);
    }

    /// Restarts the processor, as its watchdog or a brown-out does.
    pub fn restart(&self) {
        self.shared.restarted.store(true, SeqCst);
    }

    /// Makes the motor driver report a fault at the next sample, such as overcurrent.
    pub fn fault_driver(&self) {
        self.shared.driver_fault.store(true, SeqCst);
    }

    /// Corrupts one byte in `n` on the line; 0 disables.
    pub fn corrupt(&self, n: u32) {
        self.shared.corrupt_every.store(n, SeqCst);
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

/// The state of the thread.
struct Bench {
    spec: DeviceSpec,
    device: VirtualDevice,
    shared: Arc<Shared>,
    line: Option<Line>,
    /// Bytes since the last corrupted one.
    intact: u32,
}

impl Bench {
    fn new(spec: DeviceSpec, shared: Arc<Shared>, line: Line) -> Self {
        Bench { spec, device: VirtualDevice::new(&spec), shared, line: Some(line), intact: 0 }
    }

    fn run(&mut self, board: Board) {
        while !self.shared.end.load(SeqCst) {
            self.run_once(board);
            self.device.command(0.0);
            self.shared.torque.store(0, SeqCst);
        }
    }

    fn run_once(&mut self, board: Board) {
        let (mut one, mut other) = (WorldStorage::EMPTY, WorldStorage::EMPTY);
        let mut endpoint = Endpoint::new(board, &mut one, &mut other);
        let mut due = Instant::now();
        while !self.shared.end.load(SeqCst) && !self.shared.restarted.swap(false, SeqCst) {
            if self.shared.unplugged.load(SeqCst) {
                self.line = None;
            }
            self.read_line(&mut endpoint, due);
            for _ in 0..MAX_CAUGHT_UP_SAMPLES {
                if due > Instant::now() {
                    break;
                }
                due += Duration::from_secs_f32(endpoint.period());
                if !board.externally_clocked {
                    self.sample(&mut endpoint);
                    self.write_answers(&mut endpoint);
                }
            }
            due = due.max(Instant::now());
        }
    }

    /// Reads the line until the next sample.
    fn read_line(&mut self, endpoint: &mut Endpoint<'_>, due: Instant) {
        let mut bytes = [0; 256];
        let Some(line) = &mut self.line else {
            return std::thread::sleep(due.saturating_duration_since(Instant::now()));
        };
        match line.read(&mut bytes, due) {
            Ok(count) => {
                for byte in &bytes[..count] {
                    let byte = self.corrupted(*byte);
                    endpoint.push(byte);
                    self.write_answers(endpoint);
                }
            }
            Err(_) => self.line = None,
        }
    }

    fn sample(&mut self, endpoint: &mut Endpoint<'_>) {
        let period = f64::from(endpoint.period());
        if (period - self.spec.period).abs() > 1e-6 * period {
            self.spec.period = period;
            self.device.refit(&mut VirtualDevice::new(&self.spec));
        }
        let (position, velocity) = self.device.puck();
        let fault = self.shared.driver_fault.swap(false, SeqCst);
        let measurement =
            Measurement { position: position as f32, velocity: velocity as f32, fault, ..Measurement::default() };
        let motor = endpoint.sample(&measurement);
        self.device.command(f64::from(motor.torque));
        self.device.travel();
        self.shared.torque.store(motor.torque.to_bits(), SeqCst);
        let peak = f32::from_bits(self.shared.peak.load(SeqCst)).max(motor.torque.abs());
        self.shared.peak.store(peak.to_bits(), SeqCst);
    }

    /// Writes the queued answers.
    fn write_answers(&mut self, endpoint: &mut Endpoint<'_>) {
        let mut room = [0; MAX_FRAME_BYTES];
        while let Some(frame) = endpoint.answer(&mut room) {
            let frame: Vec<u8> = frame.iter().map(|byte| self.corrupted(*byte)).collect();
            if let Some(line) = &mut self.line {
                let _ = line.write(&frame, Instant::now() + WRITE_TIMEOUT);
            }
        }
    }

    fn corrupted(&mut self, byte: u8) -> u8 {
        let n = self.shared.corrupt_every.load(SeqCst);
        self.intact += 1;
        if n == 0 || self.intact < n {
            return byte;
        }
        self.intact = 0;
        byte ^ 0x55
    }
}
