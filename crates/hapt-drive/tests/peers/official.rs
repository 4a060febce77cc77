//! The manufacturer's Python library on the simulated moteus, unchanged.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hapt_drive::moteus::{Adapter, Simulated};
use hapt_drive::pty;
use hapt_drive::simulate::{Simulator, Time};
use hapt_model::{Source, World};
use hapt_testing::in_time;

use crate::python::{MOTEUS, python};

/// The wheel that official.py assumes.
const WORLD: &str = r#"
    [loop]
    period = "1 ms"
    [device]
    inertia = "6.4e-4 kg m^2"
    damping = "1.2e-3 N m s/rad"
    limit = "822.25 N mm"
"#;

#[test]
fn the_makers_own_library_works_on_the_simulated_drive() {
    in_time(|| {
        let Some(python) = python(MOTEUS) else { return };
        let world = World::read(&Source::from_text("w.toml", WORLD), &[]).unwrap();
        let (line, path) = pty().unwrap();
        let bus = Box::new(Adapter::new(line));
        let mut simulator = Simulator::new(bus, Box::new(Simulated::new(1)), &world, Time::Real);
        let ends = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let ends = Arc::clone(&ends);
            move || simulator.run(|| ends.load(Ordering::SeqCst))
        });
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/official.py");
        let output = Command::new(python).arg(script).arg(&path).output().unwrap();
        ends.store(true, Ordering::SeqCst);
        thread.join().unwrap().unwrap();
        let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success() && out.ends_with("well\n"), "{out}{err}");
    });
}
