//! The C compilers of this machine.

use std::path::Path;
use std::process::Command;

pub const WARNINGS: [&str; 3] = ["-Wall", "-Wextra", "-Werror"];

/// The compilers of C that are there.
pub fn compilers() -> Vec<&'static str> {
    ["gcc", "clang"].into_iter().filter(|name| Command::new(name).arg("--version").output().is_ok()).collect()
}

/// Runs a compiler; a warning fails the test.
pub fn compile(compiler: &str, arguments: &[&str], folder: &Path) {
    let ran = Command::new(compiler).args(WARNINGS).args(arguments).current_dir(folder).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{compiler} {arguments:?} in {}: {said}", folder.display());
}
