//! The guest: Debian's stock kernel in an emulated machine, for features that the kernel here may lack: a virtual CAN bus, and a virtual
//! USB controller with the driver of force-feedback wheels.
//!
//! It has this machine's root below a layer in memory, so that programs built here run there. Its time advances with its instructions, so
//! that timing there is the same on a busy machine. It does not measure speed.

use std::process::Command;

use anyhow::{Context, Result, ensure};

/// The files that it is booted with, and their Debian packages.
const TOOLS: [(&str, &str); 7] = [
    ("apt-get", "apt"),
    ("qemu-system-x86_64", "qemu-system-x86"),
    ("busybox", "busybox-static"),
    ("cpio", "cpio"),
    ("modprobe", "kmod"),
    ("ip", "iproute2"),
    ("/usr/lib/python3/dist-packages/evdev", "python3-evdev"),
];
/// The test of the command line that needs a CAN interface.
const OVER_CAN: &str = "over_an_interface";
/// How long it may take, in s.
const TIME: &str = "1800";
/// The same for the games of a car.
const LONG: &str = "5400";

/// The drives on a CAN bus, `crates/hapt-drive/tests/vcan/main.rs`, a link over one, `crates/hapt/tests/cli/station_can.rs`, and the wheel for games,
/// `xtask/guest/wheel.py`.
pub fn devices() -> Result<()> {
    let missing = missing();
    if !missing.is_empty() {
        ensure!(std::env::var_os("CI").is_none(), "missing: apt-get install {missing}");
        println!("SKIPPED: drives and wheel in the guest need, as root on Debian: apt-get install {missing}");
        return Ok(());
    }
    let wheel = wheel("")?;
    run(&format!("{} && {} && {wheel}", bus("vcan", "")?, bus("cli", OVER_CAN)?))
}

/// The line that runs tests of this program, those of a filter, on a virtual CAN bus.
fn bus(program: &str, filter: &str) -> Result<String> {
    let programs = crate::programs::built(&[program])?;
    let test = programs.first().with_context(|| format!("there is no test {program}"))?;
    let list = test.command().args(["--list", "--format", "terse", filter]).output()?;
    ensure!(!list.stdout.is_empty(), "no test of {program} has {filter:?} in its name");
    let test = test.file();
    Ok(format!(
        "{{ [ -e /sys/class/net/vcan0 ] || {{ ip link add vcan0 type vcan && ip link set vcan0 mtu 72; }}; }} && \
         ip link set vcan0 up && HAPT_CAN=vcan0 {} {filter} --nocapture --test-threads=1",
        test.display()
    ))
}

/// A link over a CAN bus.
pub fn link() -> Result<()> {
    run(&bus("cli", OVER_CAN)?)
}

/// 1000 changes of an effect a second, for a minute.
pub fn storm() -> Result<()> {
    run(&wheel("storm")?)
}

/// The effects of fftest and of SDL's haptics test, Debian's packages joystick and libsdl2-tests.
pub fn games() -> Result<()> {
    run(&wheel("games")?)
}

/// `hapt wheel --conform` on hapt's own wheel; without names all of its cases.
pub fn conform(cases: &[&str]) -> Result<()> {
    run(&wheel(&format!("conform {}", cases.join(" ")))?)
}

/// The table of `wheel_games::drive`, whose games run in the guest.
pub fn car() -> Result<String> {
    let (own, hapt) = (std::env::current_exe()?, std::path::absolute(crate::programs::program("hapt")?.get_program())?);
    let line = format!("cd /tmp && {} guest drive {} 2> /dev/ttyS0", own.display(), hapt.display());
    let output = Command::new("xtask/guest/boot").args(["--even", "target/guest", LONG, &line]).output()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    ensure!(
        output.status.success(),
        "the guest ends with {}: {text}{}",
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(text)
}

/// The line that tries the wheel.
fn wheel(mode: &str) -> Result<String> {
    let script = std::path::absolute("xtask/guest/wheel.py")?;
    let hapt = std::path::absolute(crate::programs::program("hapt")?.get_program())?;
    Ok(format!("/usr/bin/python3 {} {} {mode}", script.display(), hapt.display()))
}

/// A line of shell in the guest; its output goes to ours.
pub fn run(line: &str) -> Result<()> {
    let status = Command::new("xtask/guest/boot").args(["--even", "target/guest", TIME, line]).status()?;
    ensure!(status.success(), "the guest ends with {status}");
    Ok(())
}

/// The packages that are missing to boot it.
fn missing() -> String {
    let is_there = |tool: &str| {
        let path = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&path)
            .chain(["/usr/sbin".into(), "/sbin".into()])
            .any(|folder| folder.join(tool).exists())
    };
    TOOLS.iter().filter(|(tool, _)| !is_there(tool)).map(|(_, package)| *package).collect::<Vec<_>>().join(" ")
}
