//! Programs of others that the tests need, installed with `CI` set: tests install nothing.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::test;

/// Environments of Python, by the names under which tests look for them, with what is installed there.
const PYTHON: [(&str, &[&str]); 4] = [
    ("mcap", &["mcap==1.6.0", "mcap-protobuf-support==0.6.0"]),
    ("moteus", &["moteus==1.1.1"]),
    ("odrive-can", &["odrive-can==2.1.0", "cantools==45.1.0", "python-can==4.6.1", "pyserial==3.5"]),
    (
        "hapt",
        &[
            "maturin==1.16.0",
            "numpy==2.4.6",
            "pandas==3.1.1",
            "pandas-stubs==3.1.0.261029",
            "pytest==9.2.0",
            "mypy==2.4.1",
            "control==0.10.2",
            "cvxopt==1.3.3",
            "matplotlib==3.11.2",
            "xarray==2026.9.0",
        ],
    ),
];
/// Programs, and Debian's packages of them. A virtual environment needs more than Python: `ensurepip`.
const PROGRAMS: [(&[&str], &str); 4] = [
    (&["node", "--version"], "nodejs"),
    (&["npm", "--version"], "npm"),
    (&["python3", "-c", "import ensurepip"], "python3-venv"),
    (&["sh", "-c", "test -n \"$CHROMIUM\" || command -v chromium chromium-browser google-chrome"], "chromium"),
];
/// Node's packages for the look at the reports.
const BROWSER: &str = "crates/hapt-report/tests/browser";

/// Installs what is missing.
pub fn installed() -> Result<()> {
    if std::env::var_os("CI").is_none() {
        println!("        (tests skip what is missing; CI=1 installs Chromium, node and Python's packages)");
        return Ok(());
    }
    let missing: Vec<&str> =
        PROGRAMS.iter().filter(|(command, _)| !works(command)).map(|&(_, package)| package).collect();
    if !missing.is_empty() {
        run(Command::new("apt-get").arg("update"))?;
        run(Command::new("apt-get").args(["install", "--yes", "--no-install-recommends"]).args(missing))?;
    }
    if !Path::new(BROWSER).join("node_modules").exists() {
        run(Command::new("npm").args(["ci", "--silent", "--no-audit", "--no-fund"]).current_dir(BROWSER))?;
    }
    for (name, packages) in PYTHON {
        let folder = environments().join(name);
        let done = folder.join("installed");
        if !done.exists() {
            run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
            run(Command::new(folder.join("bin/python")).args(["-m", "pip", "install", "--quiet"]).args(packages))?;
            std::fs::write(&done, packages.join("\n"))?;
        }
    }
    Ok(())
}

/// Where the environments are: `CARGO_TARGET_TMPDIR` of the tests.
pub fn environments() -> std::path::PathBuf {
    test::target().join("tmp")
}

fn works(command: &[&str]) -> bool {
    let said = Command::new(command[0]).args(&command[1..]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    said.is_ok_and(|status| status.success())
}

fn run(command: &mut Command) -> Result<()> {
    let said = command.output().with_context(|| format!("{command:?}"))?;
    ensure!(said.status.success(), "{command:?}: {}", String::from_utf8_lossy(&said.stderr));
    Ok(())
}
