//! FMUs: their library needs no other one and exports only the standard's functions; importers of others check them.

mod reference;

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{programs, tools};

/// The libraries that it may need at run time: the C library and the compiler's, which are on every Linux.
const LIBRARIES: [&str; 5] =
    ["libc.so.6", "libm.so.6", "libgcc_s.so.1", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"];

pub use reference::write;

/// In the environment that [`tools::installed`] makes; without it the importers are skipped.
pub fn holds() -> Result<()> {
    let hapt = programs::program("hapt")?.get_program().to_os_string();
    if cfg!(target_os = "linux") {
        is_self_contained(&programs::folder(programs::PROFILE).join("deps/libhapt_fmi.so"))?;
    }
    reference::is_current()?;
    let Some(environment) = tools::environment("fmi") else {
        println!("        (importers skipped: no environment of Python; CI=1 installs it)");
        return Ok(());
    };
    let mut importers = tools::python(&environment)?;
    importers.arg("fmi/tests/importers.py").arg(hapt).arg(programs::target().join("fmus"));
    let output = importers.output()?;
    let [out, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    ensure!(output.status.success(), "{out}{errors}");
    println!("        ({})", out.lines().last().unwrap_or_default());
    Ok(())
}

fn is_self_contained(library: &Path) -> Result<()> {
    let listed = |arguments: &[&str]| -> Result<String> {
        let program = arguments[0];
        let output = Command::new(program).args(&arguments[1..]).arg(library).output();
        Ok(String::from_utf8(output.with_context(|| format!("binutils: {program}"))?.stdout)?)
    };
    let needed = listed(&["objdump", "-p"])?;
    let needed = needed.lines().filter_map(|line| line.trim().strip_prefix("NEEDED")).map(str::trim);
    let needed: Vec<&str> = needed.collect();
    ensure!(!needed.is_empty() && needed.iter().all(|name| LIBRARIES.contains(name)), "it needs {needed:?}");
    let symbols = listed(&["nm", "--dynamic", "--defined-only"])?;
    let names: Vec<&str> = symbols.lines().filter_map(|line| line.split_whitespace().last()).collect();
    let other = names.iter().find(|name| !(name.starts_with("fmi2") || name.starts_with("fmi3")));
    ensure!(other.is_none(), "it exports {other:?}");
    for (version, count) in [("fmi2", 44), ("fmi3", 75)] {
        let exported = names.iter().filter(|name| name.starts_with(version)).count();
        ensure!(exported == count, "it exports {exported} functions of {version}, and the standard has {count}");
    }
    Ok(())
}
