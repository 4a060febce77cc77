//! A hash of the source, so that two programs can tell whether they compute the same.
// This runs where the crate is built: cargo listens on standard output.
#![allow(clippy::disallowed_macros)]

use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo:rerun-if-changed=src");
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo says where it builds")).join("src");
    let mut files = Vec::new();
    gather(&root, &mut files);
    files.sort();
    // FNV-1a over names and bytes; all kinds of line breaks count as the same.
    let mut hash = 0x811c_9dc5_u32;
    for path in files {
        let name = path.strip_prefix(&root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        let bytes = fs::read(&path).expect("the source can be read");
        for byte in name.bytes().chain([0]).chain(bytes).filter(|byte| *byte != b'\r') {
            hash = (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }
    println!("cargo:rustc-env=HAPT_CORE_SOURCE={hash:08x}");
}

fn gather(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source can be listed") {
        let path = entry.expect("the source can be listed").path();
        if path.is_dir() {
            gather(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}
