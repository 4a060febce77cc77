//! The Python package: its wheel is built and installed, its tests and the examples of its documentation run, its types hold.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{test, tools};

/// In the environment that [`tools::installed`] makes; without it the step is skipped.
pub fn holds() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else {
        println!(
            "        (skipped: no environment of Python with the packages of xtask/src/tools.rs; CI=1 installs it)"
        );
        return Ok(());
    };
    let environment = std::path::absolute(environment)?;
    let python = environment.join("bin/python");
    install(&environment, test::PROFILE)?;
    let module = |name: &str| module(&environment, name);
    run(module("pytest").args([
        "-q",
        "-p",
        "no:cacheprovider",
        "--doctest-modules",
        "--pyargs",
        "hapt",
        "python/tests",
    ]))?;
    let cache = test::target().join("mypy");
    run(module("mypy").arg("--cache-dir").arg(&cache).args(["python/hapt", "python/tests"]))?;
    run(module("pyright").arg("--pythonpath").arg(&python))?;
    run(module("mypy.stubtest").args(["hapt._hapt", "--ignore-disjoint-bases", "--mypy-config-file", "pyproject.toml"]))
}

/// Builds the wheel and installs it into an environment that has maturin.
pub fn install(environment: &Path, profile: &str) -> Result<()> {
    let wheels = std::path::absolute(test::target().join("wheels"))?;
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels)?;
    }
    run(module(environment, "maturin").args(["build", "--quiet", "--profile", profile, "--out"]).arg(&wheels))?;
    let wheel = std::fs::read_dir(&wheels)?.next().context("maturin made no wheel")??.path();
    let arguments = ["install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"];
    run(module(environment, "pip").args(arguments).arg(&wheel))
}

/// A module of an environment's Python as a command.
fn module(environment: &Path, name: &str) -> Command {
    let mut command = Command::new(environment.join("bin/python"));
    command.args(["-m", name]).env("VIRTUAL_ENV", environment).env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

fn run(command: &mut Command) -> Result<()> {
    let said = command.output().with_context(|| format!("{command:?}"))?;
    let [out, errors] = [&said.stdout, &said.stderr].map(|text| String::from_utf8_lossy(text));
    ensure!(said.status.success(), "{command:?}: {out}{errors}");
    Ok(())
}
