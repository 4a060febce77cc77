//! The C compilers of this machine.

use std::path::Path;
use std::process::Command;

pub const WARNINGS: [&str; 3] = ["-Wall", "-Wextra", "-Werror"];

/// What C leaves undefined ends the program.
pub const SANITIZERS: [&str; 3] = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

pub const ARM: &str = "arm-none-eabi-gcc";
pub const QEMU: &str = "qemu-system-arm";
pub const AVR: &str = "avr-gcc";
pub const SIMAVR: &str = "simavr";

/// A processor with a floating-point unit for f32, without a library of C.
pub const CORTEX_M4F: [&str; 9] = [
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfpu=fpv4-sp-d16",
    "-mfloat-abi=hard",
    "-ffreestanding",
    "-nostdlib",
    "-T",
    "board.ld",
    "-lgcc",
];

fn is_there(name: &str) -> bool {
    Command::new(name).arg("--version").output().is_ok()
}

/// The compilers of C that are there.
pub fn compilers() -> Vec<&'static str> {
    ["gcc", "clang"].into_iter().filter(|name| is_there(name)).collect()
}

/// Whether a board's compiler and QEMU are there; with `CI` set they have to be.
pub fn has_board() -> bool {
    let has = is_there(ARM) && is_there(QEMU);
    assert!(has || std::env::var_os("CI").is_none(), "{ARM} and {QEMU} have to be there where CI is set");
    has
}

/// Whether the compiler of an 8-bit board and its simulator are there; with `CI` set they have to be.
pub fn has_avr() -> bool {
    let has = is_there(AVR) && Command::new(SIMAVR).arg("--help").output().is_ok();
    assert!(has || std::env::var_os("CI").is_none(), "{AVR} and {SIMAVR} have to be there where CI is set");
    has
}

/// Runs a compiler; a warning fails the test.
pub fn compile(compiler: &str, arguments: &[&str], folder: &Path) {
    let ran = Command::new(compiler).args(WARNINGS).args(arguments).current_dir(folder).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{compiler} {arguments:?} in {}: {said}", folder.display());
}
