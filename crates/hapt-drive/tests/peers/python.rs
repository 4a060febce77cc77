//! Python with third-party packages.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// ODrive's DBC files and a client, over python-can: the environment, and the imported module.
pub const ODRIVE_CAN: (&str, &str) = ("odrive-can", "can, cantools, odrive_can, serial");
/// The manufacturer's library for the moteus.
pub const MOTEUS: (&str, &str) = ("moteus", "moteus");

/// A Python that has the packages: of the environment that `cargo xtask test` makes with `CI` set (`xtask/src/tools.rs`), or the
/// system's. `None` where there is none.
///
/// # Panics
/// With `CI` set there must be one.
pub fn python((name, imports): (&str, &str)) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name).join("bin/python");
    let has = |python: &Path| {
        let output = Command::new(python).args(["-c", &format!("import {imports}")]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = [own, "python3".into()].into_iter().find(|python| has(python));
    assert!(
        found.is_some() || std::env::var_os("CI").is_none(),
        "no Python has {imports}: cargo xtask test installs it"
    );
    if found.is_none() {
        // Past the test's captured output, so that it is read.
        let _ = writeln!(std::io::stderr(), "SKIPPED: no Python has {imports}; CI=1 cargo xtask test installs it");
    }
    found
}
