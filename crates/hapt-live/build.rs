//! Lists the built page, web/dist, as a table of `include_bytes!`, so that the binary needs no further files and a build no Node; also the
//! page's core, web/core/hapt.wasm. A package has both through links.

use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let either = |repository: &str, package: &str| {
        let place = here.join(repository);
        if place.exists() { place } else { here.join(package) }
    };
    let page = either("../../web/dist", "page");
    println!("cargo::rerun-if-changed={}", page.display());
    let mut files = Vec::new();
    list(&page, "", &mut files);
    files.sort();
    let core = either("../../web/core/hapt.wasm", "core.wasm");
    println!("cargo::rerun-if-changed={}", core.display());
    if let Err(error) = embed(&files, &core) {
        println!("cargo::error=the page cannot be embedded: {error}");
    }
}

/// Copies the files to this build's folder, since the page may be rebuilt while the build runs, and writes the table.
fn embed(files: &[(String, PathBuf)], core: &Path) -> std::io::Result<()> {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
    let mut table = String::from("&[\n");
    for (number, (name, path)) in files.iter().enumerate() {
        let copy = out.join(number.to_string());
        fs::copy(path, &copy)?;
        // Debug quotes as Rust does.
        table += &format!("    ({name:?}, include_bytes!({:?})),\n", copy.display().to_string());
    }
    // A checkout without it builds too, without pages that need no server.
    fs::write(out.join("core.wasm"), fs::read(core).unwrap_or_default())?;
    fs::write(out.join("page.rs"), table + "]")
}

/// The files below a folder, by their paths on the server.
fn list(folder: &Path, under: &str, files: &mut Vec<(String, PathBuf)>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (format!("{under}/{}", entry.file_name().to_string_lossy()), entry.path());
        if path.is_dir() {
            list(&path, &name, files);
        } else {
            files.push((name, path));
        }
    }
}
