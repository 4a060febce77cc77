//! The Python package compared with the crates and with other tools: `bench/python/package.py` in an environment of its own.

use std::path::{Path, PathBuf, absolute};
use std::process::Command;

use anyhow::Result;

use super::{Bench, PAGE, PAIRS, output};
use crate::marked;

const SCALE: &str = "docs/python.md";
const BLOCK: &str = "cargo xtask bench python";

/// The other packages that are installed; Drake has no wheel for some systems.
const NEEDED: [&str; 4] = ["maturin==1.16.0", "numpy==2.4.6", "pyarrow==26.0.1", "scipy==1.17.1"];
const COMPARED: [&str; 6] =
    ["control==0.10.2", "pathsim==0.27.1", "mujoco==4.0.0", "drake==1.51.1", "numba==0.68.1", "jax==0.10.2"];
/// Rounds of whole sweeps, of which MuJoCo and pathsim take seconds each.
const SWEEPS: usize = 5;

/// Measures and prints only these tables, over `rounds` rounds; with `write`, puts them into the page.
pub(super) fn measure(rounds: usize, write: bool) -> Result<()> {
    marked::publish(PAGE, BLOCK, &Bench::build()?.tables(rounds)?, write)
}

/// A sweep of `loops` in shards, end to end; with `write`, into the page.
pub(super) fn scale(loops: &str, write: bool) -> Result<()> {
    let python = environment(&Bench::build()?.folder)?;
    let processes = std::thread::available_parallelism()?.to_string();
    let text = output(Command::new(python).arg("bench/python/scale.py").args([loops, &processes]))?;
    marked::publish(SCALE, "cargo xtask bench scale", &text, write)
}

/// The Python of an environment with the package and the other tools.
fn environment(folder: &Path) -> Result<PathBuf> {
    let environment = absolute(folder.join("package"))?;
    let python = environment.join("bin/python");
    if !python.exists() {
        output(Command::new("python3").args(["-m", "venv"]).arg(&environment))?;
    }
    let install = |packages: &[&str]| {
        output(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(packages)).map(drop)
    };
    install(&NEEDED)?;
    for package in COMPARED {
        if let Err(error) = install(&[package]) {
            eprintln!("without {package}: {error}");
        }
    }
    crate::python::install(&environment, "release")?;
    Ok(python)
}

impl Bench {
    /// The tables as a part of the page.
    pub(super) fn package(&self) -> Result<String> {
        let tables = self.tables(PAIRS)?;
        Ok(format!("\n## The Python package\n\n<!-- {BLOCK} -->\n\n{}\n<!-- end -->\n", tables.trim_end()))
    }

    fn tables(&self, rounds: usize) -> Result<String> {
        let python = environment(&self.folder)?;
        let mut package = Command::new(&python);
        package.arg("bench/python/package.py").arg(self.programs.join("hapt-bench")).arg(self.programs.join("hapt"));
        let mut worlds = Command::new(&python);
        worlds.arg("bench/python/worlds.py").arg(rounds.min(SWEEPS).to_string());
        Ok(output(package.arg(rounds.to_string()))? + &output(&mut worlds)?)
    }
}
