//! The linker's file of the board's memory, and the step in C where its instructions are counted for comparison.

use std::path::PathBuf;
use std::{env, fs};

/// The boards, and the file of each one's memory.
const BOARDS: [(&str, &str); 7] = [
    ("mps2", "boards"),
    ("mps2-an505", "boards"),
    ("stm32f405", "boards"),
    ("netduinoplus2", "boards"),
    ("b-g431b-esc1", "boards"),
    ("pico2", "boards"),
    ("my-board", "template"),
];

/// The include of the memory of a board whose program runs in RAM.
const CODE_IN_RAM: &str = "boards/code-in-ram.x";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let feature = |board: &str| format!("CARGO_FEATURE_{}", board.to_uppercase().replace('-', "_"));
    let chosen: Vec<_> = BOARDS.iter().filter(|(board, _)| env::var_os(feature(board)).is_some()).collect();
    let [(board, folder)] = chosen[..] else {
        panic!("choose one board by --features: {}", BOARDS.map(|(board, _)| board).join(", "))
    };
    let memory = format!("{folder}/{board}.x");
    fs::copy(&memory, out.join("memory.x")).unwrap_or_else(|error| panic!("{memory}: {error}"));
    println!("cargo:rerun-if-changed={memory}");
    fs::copy(CODE_IN_RAM, out.join("code-in-ram.x")).unwrap_or_else(|error| panic!("{CODE_IN_RAM}: {error}"));
    println!("cargo:rerun-if-changed={CODE_IN_RAM}");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-env-changed=HAPT_C_STEP");
    if let Some(object) = env::var_os("HAPT_C_STEP") {
        println!("cargo:rustc-link-arg-bin=count={}", object.to_string_lossy());
        println!("cargo:rerun-if-changed={}", object.to_string_lossy());
    }
}
