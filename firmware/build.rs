//! Where the linker finds the board's memory, and C's step where there is one to count beside ours.

use std::path::PathBuf;
use std::{env, fs};

const BOARDS: [&str; 3] = ["mps2", "netduinoplus2", "b-g431b-esc1"];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let feature =
        |board: &&&str| env::var_os(format!("CARGO_FEATURE_{}", board.to_uppercase().replace('-', "_"))).is_some();
    let chosen: Vec<_> = BOARDS.iter().filter(feature).collect();
    let [board] = chosen[..] else { panic!("choose one board by --features: {}", BOARDS.join(", ")) };
    let memory = format!("boards/{board}.x");
    fs::copy(&memory, out.join("memory.x")).unwrap_or_else(|error| panic!("{memory}: {error}"));
    println!("cargo:rerun-if-changed={memory}");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-env-changed=HAPT_C_STEP");
    if let Some(object) = env::var_os("HAPT_C_STEP") {
        println!("cargo:rustc-link-arg-bin=count={}", object.to_string_lossy());
        println!("cargo:rerun-if-changed={}", object.to_string_lossy());
    }
}
