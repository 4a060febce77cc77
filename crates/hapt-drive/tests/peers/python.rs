//! Programs of others, to hold ours against: Python with its packages, in an environment of its own below the target folder.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// What a peer wants of pip, and under which names Python then finds it.
pub struct Packages {
    pub pip: &'static [&'static str],
    pub imports: &'static str,
}

/// ODrive's DBC files and a client of theirs, over python-can.
pub const ODRIVE_CAN: &Packages = &Packages {
    pip: &["odrive-can==2.1.0", "cantools==45.1.0", "python-can==4.6.1", "pyserial==3.5"],
    imports: "can, cantools, odrive_can, serial",
};

/// A Python that has them, or `None`, loudly. With `CI` set what is missing is installed, into an environment of this `name`.
pub fn python(name: &str, &Packages { pip, imports }: &Packages) -> Option<PathBuf> {
    // Tests run side by side: one of them installs.
    static INSTALLS: Mutex<()> = Mutex::new(());
    let _only = INSTALLS.lock();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let own = folder.join("bin/python");
    let has = |python: &Path| {
        let said = Command::new(python).args(["-c", &format!("import {imports}")]).output();
        said.is_ok_and(|said| said.status.success())
    };
    if let Some(python) = [own.as_path(), Path::new("python3")].into_iter().find(|python| has(python)) {
        return Some(python.to_path_buf());
    }
    if std::env::var_os("CI").is_none() {
        println!("SKIPPED: wants Python with {} (pip install), or CI=1 to have it installed", pip.join(" "));
        return None;
    }
    let run = |command: &mut Command| {
        let said = command.output().expect("Python is there");
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder));
    run(Command::new(&own).args(["-m", "pip", "install", "--quiet"]).args(pip));
    assert!(has(&own), "{pip:?} do not import as {imports}");
    Some(own)
}
