//! The time of one exchange with a drive over a serial port: hapt's request, answer and command, compared with one command and its answer
//! by the manufacturer's library. The drive at the other end is simulated, and the same for both.
//!
//! `cargo run --release -p hapt-drive --example exchange [PYTHON]`; without a Python that has the library, only hapt's time.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hapt_drive::moteus::{Adapter, Client, Moteus, Simulated};
use hapt_drive::simulate::{Simulator, Time};
use hapt_drive::{Drive, DriveLimits, Line, pty};
use hapt_model::{Source, World};

const EXCHANGES: usize = 5_000;
const WORLD: &str = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 6.4e-4\nlimit = 0.8\n";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = World::read(&Source::from_text("w.toml", WORLD), &[])?;
    let (line, path) = pty()?;
    let (bus, firmware) = (Box::new(Adapter::new(line)), Box::new(Simulated::new(1)));
    let mut simulator = Simulator::new(bus, firmware, &world, Time::Real);
    let ends = Arc::new(AtomicBool::new(false));
    let thread = std::thread::spawn({
        let ends = Arc::clone(&ends);
        move || simulator.run(|| ends.load(Ordering::SeqCst))
    });

    let ours = ours(&path)?;
    println!("hapt         {ours:.0} us, p50 of {EXCHANGES}: question, answer, command");
    let python = std::env::args().nth(1).unwrap_or("python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/official.py");
    let count = EXCHANGES.to_string();
    let output = Command::new(python).arg(script).arg(&path).args(["--time", &count]).output();
    match output.ok().and_then(|output| String::from_utf8(output.stdout).ok()?.trim().parse::<f64>().ok()) {
        Some(theirs) => println!("the makers'  {theirs:.0} us: command with answer\nratio        {:.2}", ours / theirs),
        None => println!("SKIPPED: the makers' library is missing; python3 -m pip install moteus==1.1.1"),
    }
    ends.store(true, Ordering::SeqCst);
    let _ = thread.join();
    Ok(())
}

/// The time of hapt's exchange in us.
fn ours(path: &Path) -> Result<f64, Box<dyn std::error::Error>> {
    let mut drive = Moteus::new(Box::new(Client::new(Line::open(path)?, true)), 1, path.display().to_string());
    drive.start(&DriveLimits { watchdog: 1.0, torque: 0.8 })?;
    let patience = || Instant::now() + Duration::from_secs(1);
    let mut times = Vec::with_capacity(EXCHANGES);
    for _ in 0..EXCHANGES {
        let begun = Instant::now();
        drive.read(patience()).map_err(|trouble| format!("{trouble:?}"))?;
        drive.command(0.0, patience()).map_err(|trouble| format!("{trouble:?}"))?;
        times.push(begun.elapsed().as_secs_f64());
    }
    drive.stop();
    times.sort_by(f64::total_cmp);
    Ok(1e6 * times[EXCHANGES / 2])
}
