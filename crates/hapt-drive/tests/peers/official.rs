//! The makers' own Python library on the simulated moteus, unchanged: its protocol is theirs. Without the library this says what is
//! missing; where CI is set it installs it, into a folder of its own below the target folder.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hapt_drive::moteus::{Adapter, Simulated};
use hapt_drive::pty;
use hapt_drive::simulate::{Simulator, Time};
use hapt_model::{Source, World};

const LIBRARY: &str = "moteus==1.1.1";
/// The wheel that official.py knows.
const WORLD: &str = r#"
    [loop]
    period = "1 ms"
    [device]
    inertia = "6.4e-4 kg m^2"
    damping = "1.2e-3 N m s/rad"
    limit = "822.25 N mm"
"#;

/// A Python that has the library; `None` where there is none and none is to be made.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("moteus");
    let own = folder.join("bin/python");
    let has_it = |python: &Path| {
        let said = Command::new(python).args(["-c", "import moteus"]).output();
        said.is_ok_and(|said| said.status.success())
    };
    if let Some(python) = [own.clone(), "python3".into()].into_iter().find(|python| has_it(python)) {
        return Some(python);
    }
    std::env::var_os("CI")?;
    let run = |command: &mut Command| command.status().is_ok_and(|status| status.success());
    let must = |command: &mut Command| assert!(run(command), "{command:?}");
    let make = || run(Command::new("python3").args(["-m", "venv"]).arg(&folder));
    if !make() {
        must(Command::new("apt-get").args(["install", "--yes", "--no-install-recommends", "python3-venv"]));
        assert!(make(), "python3 makes no folder for libraries");
    }
    must(Command::new(&own).args(["-m", "pip", "install", "--quiet", LIBRARY]));
    Some(own)
}

#[test]
fn the_makers_own_library_works_on_the_simulated_drive() {
    let Some(python) = python() else {
        // Past the test's own capture, so that somebody sees it.
        let _ =
            writeln!(std::io::stderr(), "SKIPPED: the official library is missing; python3 -m pip install {LIBRARY}");
        return;
    };
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
    let said = Command::new(python).arg(script).arg(&path).output().unwrap();
    ends.store(true, Ordering::SeqCst);
    thread.join().unwrap().unwrap();
    let (out, err) = (String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
    assert!(said.status.success() && out.ends_with("well\n"), "{out}{err}");
}
