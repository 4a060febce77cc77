//! The Python package: its wheel is built and installed, its tests and the examples of its documentation run, its types hold.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{test, tools};

/// All of it.
pub fn holds() -> Result<()> {
    is_built()?;
    works()?;
    has_types()
}

/// Builds the wheel and installs it into the environment that [`tools::installed`] makes; without it the steps are skipped.
pub fn is_built() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else {
        println!(
            "        (skipped: no environment of Python with the packages of xtask/src/tools.rs; CI=1 installs it)"
        );
        return Ok(());
    };
    install(&environment, test::PROFILE)
}

/// Its tests, and the examples of its documentation.
pub fn works() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else { return Ok(()) };
    let words = ["-q", "-p", "no:cacheprovider", "--doctest-modules", "--pyargs", "hapt", "python/tests"];
    run(module(&environment, "pytest")?.args(words))
}

/// Its types, by two checkers, and that they are those of the library.
pub fn has_types() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else { return Ok(()) };
    let module = |name: &str| module(&environment, name);
    let cache = test::target().join("mypy");
    run(module("mypy")?.arg("--cache-dir").arg(&cache).args(["python/hapt", "python/tests"]))?;
    run(module("pyright")?.arg("--pythonpath").arg(tools::python(&environment)?.get_program()))?;
    run(module("mypy.stubtest")?.args([
        "hapt._hapt",
        "--ignore-disjoint-bases",
        "--mypy-config-file",
        "pyproject.toml",
    ]))
}

/// Builds the wheel and installs it into an environment that has maturin.
pub fn install(environment: &Path, profile: &str) -> Result<()> {
    let wheels = std::path::absolute(test::target().join("wheels"))?;
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels)?;
    }
    run(module(environment, "maturin")?.args(["build", "--quiet", "--profile", profile, "--out"]).arg(&wheels))?;
    let wheel = std::fs::read_dir(&wheels)?.next().context("maturin made no wheel")??.path();
    let arguments = ["install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"];
    run(module(environment, "pip")?.args(arguments).arg(&wheel))
}

/// A module of an environment's Python as a command.
fn module(environment: &Path, name: &str) -> Result<Command> {
    let mut command = tools::python(environment)?;
    command.args(["-m", name]);
    Ok(command)
}

fn run(command: &mut Command) -> Result<()> {
    let said = command.output().with_context(|| format!("{command:?}"))?;
    let [out, errors] = [&said.stdout, &said.stderr].map(|text| String::from_utf8_lossy(text));
    ensure!(said.status.success(), "{command:?}: {out}{errors}");
    Ok(())
}
