//! The C compilers of this machine.

use std::path::Path;
use std::process::Command;

pub const WARNINGS: [&str; 3] = ["-Wall", "-Wextra", "-Werror"];

/// Undefined behaviour ends the program.
pub const SANITIZERS: [&str; 3] = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

pub const ARM: &str = "arm-none-eabi-gcc";
pub const QEMU: &str = "qemu-system-arm";
pub const AVR: &str = "avr-gcc";
pub const SIMAVR: &str = "simavr";

/// A processor that gcc compiles for and QEMU has a machine of.
pub struct Board {
    pub name: &'static str,
    pub machine: &'static str,
    /// Its processor, for gcc.
    pub flags: &'static [&'static str],
    /// Where a linker puts code and data.
    code: &'static str,
    ram: &'static str,
}

/// With a floating-point unit for f32, with one and Arm's newer core (RP2350, in its secure state), and without any (RP2040's M0+ has the
/// instructions of the M0, which QEMU emulates).
pub const BOARDS: [Board; 3] = [
    Board {
        name: "cortex-m4f",
        machine: "mps2-an386",
        flags: &["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"],
        code: "ORIGIN = 0x00000000, LENGTH = 4M",
        ram: "ORIGIN = 0x20000000, LENGTH = 4M",
    },
    Board {
        name: "cortex-m33",
        machine: "mps2-an505",
        flags: &["-mcpu=cortex-m33", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard"],
        code: "ORIGIN = 0x10000000, LENGTH = 4M",
        ram: "ORIGIN = 0x38000000, LENGTH = 2M",
    },
    Board {
        name: "cortex-m0plus",
        machine: "microbit",
        flags: &["-mcpu=cortex-m0plus"],
        code: "ORIGIN = 0x00000000, LENGTH = 256K",
        ram: "ORIGIN = 0x20000000, LENGTH = 16K",
    },
];

/// Without a library of C.
pub const FREESTANDING: [&str; 6] = ["-mthumb", "-ffreestanding", "-nostdlib", "-T", "board.ld", "-lgcc"];

impl Board {
    /// The board of this name.
    pub fn named(name: &str) -> Option<&'static Board> {
        BOARDS.iter().find(|board| board.name == name)
    }

    /// The linker's script.
    pub fn script(&self) -> String {
        include_str!("cortex_m.ld").replace("@code@", self.code).replace("@ram@", self.ram)
    }
}

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
    let printed = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{compiler} {arguments:?} in {}: {printed}", folder.display());
}
