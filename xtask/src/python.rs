//! The Python package: its wheel is built and installed, its tests and the examples of its documentation run, its types hold.

use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{test, tools};

/// In the environment that [`tools::installed`] makes; without it the step is skipped.
pub fn holds() -> Result<()> {
    let environment = std::path::absolute(tools::environments().join("hapt"))?;
    let python = environment.join("bin/python");
    if !python.exists() {
        println!("        (skipped: no environment of Python; CI=1 installs it)");
        return Ok(());
    }
    let wheels = std::path::absolute(test::target().join("wheels"))?;
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels)?;
    }
    let module = |name: &str| {
        let mut command = Command::new(&python);
        command.args(["-m", name]).env("VIRTUAL_ENV", &environment).env("PYTHONDONTWRITEBYTECODE", "1");
        command
    };
    run(module("maturin").args(["build", "--quiet", "--profile", test::PROFILE, "--out"]).arg(&wheels))?;
    let wheel = std::fs::read_dir(&wheels)?.next().context("maturin made no wheel")??.path();
    run(module("pip").args(["install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"]).arg(&wheel))?;
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

fn run(command: &mut Command) -> Result<()> {
    let said = command.output().with_context(|| format!("{command:?}"))?;
    let [out, errors] = [&said.stdout, &said.stderr].map(|text| String::from_utf8_lossy(text));
    ensure!(said.status.success(), "{command:?}: {out}{errors}");
    Ok(())
}
