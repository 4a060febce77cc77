//! The Python package: it is built and installed, its tests and the examples of its documentation run, its types hold.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::{programs, tools};

/// All checks of the package.
pub fn holds() -> Result<()> {
    is_built()?;
    works()?;
    has_types()
}

/// Builds the package for the environment that [`tools::installed`] makes; without it the steps are skipped.
pub fn is_built() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else {
        println!(
            "        (skipped: no environment of Python with the packages of xtask/src/tools.rs; CI=1 installs it)"
        );
        return Ok(());
    };
    install(&environment, programs::PROFILE)
}

/// Its tests, with the program `hapt` on the path, and the examples of its documentation.
pub fn works() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else { return Ok(()) };
    let words = ["-q", "-p", "no:cacheprovider", "--doctest-modules", "--pyargs", "hapt", "python/tests"];
    let folder = programs::folder(programs::PROFILE);
    run(module(&environment, "pytest")?.args(words).env("PATH", tools::path_with(&folder)?))
}

/// Its types, by two checkers, and that they are those of the library.
pub fn has_types() -> Result<()> {
    let Some(environment) = tools::environment("hapt") else { return Ok(()) };
    let module = |name: &str| module(&environment, name);
    let cache = programs::target().join("mypy");
    run(module("mypy")?.arg("--cache-dir").arg(&cache).args(["python/hapt", "python/tests"]))?;
    run(module("pyright")?.arg("--pythonpath").arg(tools::python(&environment)?.get_program()))?;
    run(module("mypy.stubtest")?.args([
        "hapt._hapt",
        "--ignore-disjoint-bases",
        "--mypy-config-file",
        "pyproject.toml",
    ]))
}

/// Builds the package and makes an environment import it: the library in the sources' folder, and that folder on Python's path. A wheel by
/// maturin holds the same files, and would compile most dependencies again with other features (`cargo xtask release` makes wheels).
pub fn install(environment: &Path, profile: &str) -> Result<()> {
    let packages: &[&str] = if profile == programs::PROFILE { &["--workspace"] } else { &["--package", "hapt-python"] };
    let mut build = Command::new(env!("CARGO"));
    run(build.args(["build", "--quiet", "--lib", "--profile", profile]).args(packages))?;
    let root = std::path::absolute(programs::target())?;
    let package = root.join("python").join(profile).join("hapt");
    if package.exists() {
        fs::remove_dir_all(&package)?;
    }
    fs::create_dir_all(&package)?;
    for entry in fs::read_dir("python/hapt")? {
        let file = entry?;
        if file.file_type()?.is_file() {
            fs::copy(file.path(), package.join(file.file_name()))?;
        }
    }
    let library = format!("{DLL_PREFIX}_hapt{DLL_SUFFIX}");
    fs::copy(root.join(programs::folder_name(profile)).join(&library), package.join("_hapt.abi3.so"))
        .context(library)?;
    let mut query = tools::python(environment)?;
    query.args(["-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]);
    let output = query.output()?;
    ensure!(output.status.success(), "{query:?}: {}", String::from_utf8_lossy(&output.stderr));
    let site = String::from_utf8(output.stdout)?;
    let parent = package.parent().context("no folder")?;
    Ok(fs::write(Path::new(site.trim()).join("hapt.pth"), format!("{}\n", parent.display()))?)
}

/// A module of an environment's Python as a command.
fn module(environment: &Path, name: &str) -> Result<Command> {
    let mut command = tools::python(environment)?;
    command.args(["-m", name]);
    Ok(command)
}

fn run(command: &mut Command) -> Result<()> {
    let output = command.output().with_context(|| format!("{command:?}"))?;
    let [out, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    ensure!(output.status.success(), "{command:?}: {out}{errors}");
    Ok(())
}
