//! Archives of the program and of the library of FMUs, with manual pages and completions: tried in an empty root, under QEMU, under Wine.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::{Made, SHIPPED, done, emptied, folder, head, packed, shell, version};
use crate::windows::Wine;
use crate::{macos, programs, tools};

const HERE: &str = "x86_64-unknown-linux-gnu";
/// The systems that a release has a program for.
pub const TARGETS: [&str; 5] =
    [HERE, "aarch64-unknown-linux-gnu", "x86_64-pc-windows-gnu", "x86_64-apple-darwin", "aarch64-apple-darwin"];
/// The oldest C library for Linux: CentOS 7's, as the wheels have it.
const GLIBC: &str = "2.17";
/// Debian's libraries for the processor that QEMU runs (libc6-arm64-cross).
const AARCH64: &str = "/usr/aarch64-linux-gnu";
/// The most that this machine's program has, in bytes: one of which a profile leaves parts unoptimised has twice as many.
const MAX_BYTES: u64 = 25_000_000;
/// How the verdict on the notes' wheel begins.
const VERDICT: &str = "Certified:";
/// The file that `hapt sim` writes of the run under Euler's method.
const RUN: &str = "step.csv";
/// A server that is silent for longer does not work.
const ANSWER: Duration = Duration::from_secs(30);

/// Compiles the program for a target, packs and tries it.
pub fn build(target: &str) -> Result<Made> {
    let environment = tools::packaging()?;
    let is_windows = target.contains("windows");
    // zig links for an old glibc, and for macOS; MinGW for Windows.
    let (program, verb, with) = match target {
        _ if is_windows => (PathBuf::from(env!("CARGO")), "build", target.to_string()),
        _ if target.contains("apple") => (environment.join("bin/cargo-zigbuild"), "zigbuild", target.to_string()),
        _ => (environment.join("bin/cargo-zigbuild"), "zigbuild", format!("{target}.{GLIBC}")),
    };
    let mut cargo = Command::new(if is_windows { program } else { absolute(program)? });
    cargo.args([verb, "--quiet", "--locked", "--profile", SHIPPED, "--target", &with, "-p", "hapt", "-p", "hapt-fmi"]);
    cargo.env("PATH", tools::path_with(&environment.join("bin"))?);
    if target.contains("apple") {
        cargo.env("RUSTFLAGS", macos::frameworks()?);
    }
    done(&mut cargo)?;
    let built = programs::target().join(target).join(SHIPPED);
    if target == HERE {
        let bytes = fs::metadata(built.join("hapt"))?.len();
        ensure!(bytes <= MAX_BYTES, "the program has {bytes} bytes, more than {MAX_BYTES}");
    }
    let made = pack(target, &built, &own()?)?;
    let tried = match target {
        HERE => Some(used_in_an_empty_root(&made)?),
        "aarch64-unknown-linux-gnu" => under_qemu(&built)?,
        _ if is_windows => Some(under_wine(&built)?),
        _ => None,
    };
    Ok(Made { file: made, tried })
}

/// The archive for this machine, of a profile that has been built.
pub fn of_this_machine(profile: &str) -> Result<Made> {
    programs::cargo(&format!("build --quiet --profile {profile} --package hapt --package hapt-fmi"), "")?;
    let built = programs::target().join(profile);
    let file = pack(HERE, &built, Path::new(programs::binary(profile).get_program()))?;
    let tried = Some(used_in_an_empty_root(&file)?);
    Ok(Made { file, tried })
}

/// The archive for this machine, where it has been made.
pub fn file() -> Result<PathBuf> {
    let file = folder()?.join(format!("{}.tar.gz", name(HERE)));
    ensure!(file.exists(), "no {}: cargo xtask release archives {HERE}", file.display());
    Ok(file)
}

/// The instructions for getting the program: it needs no installer.
pub fn install_line() -> String {
    let (name, repository) = (name(HERE), env!("CARGO_PKG_REPOSITORY"));
    format!(
        "curl --location {repository}/releases/download/v{}/{name}.tar.gz | tar --extract --gzip\n{name}/hapt live --open",
        version()
    )
}

/// The program that runs here and writes manual pages: they are the same on every system.
fn own() -> Result<PathBuf> {
    Ok(PathBuf::from(programs::program("hapt")?.get_program()))
}

/// An archive's name without its suffix: hapt-0.1.0-x86_64-linux.
fn name(target: &str) -> String {
    let system = match target {
        _ if target.contains("windows") => "windows",
        _ if target.contains("apple") => "macos",
        _ => "linux",
    };
    format!("hapt-{}-{}-{system}", version(), target.split('-').next().unwrap_or(target))
}

/// The folder in the archive for this machine.
pub fn folder_of_this_machine() -> String {
    name(HERE)
}

/// Packs what was built for a target; `own` runs here.
fn pack(target: &str, built: &Path, own: &Path) -> Result<PathBuf> {
    let (program, library) = match target {
        _ if target.contains("windows") => ("hapt.exe", "hapt_fmi.dll"),
        _ if target.contains("apple") => ("hapt", "libhapt_fmi.dylib"),
        _ => ("hapt", "libhapt_fmi.so"),
    };
    let inside = folder()?.join("archives").join(name(target));
    shell(own, &inside.join("shell"))?;
    for file in [program, library] {
        fs::copy(built.join(file), inside.join(file)).with_context(|| built.join(file).display().to_string())?;
        let mut first = [0; 4];
        fs::File::open(inside.join(file))?.read_exact(&mut first)?;
        ensure!(first.starts_with(head(target)), "{file} is none for {target}");
    }
    if target == HERE && done(Command::new("strip").arg("--version")).is_ok() {
        done(Command::new("strip").args(["--strip-debug"]).arg(inside.join(program)).arg(inside.join(library)))?;
    }
    for file in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md"] {
        fs::copy(file, inside.join(file))?;
    }
    fs::write(inside.join("LICENCES.txt"), done(Command::new(absolute(own)?).args(["explain", "licences"]))?)?;
    let suffix = if target.contains("windows") { "zip" } else { "tar.gz" };
    let file = folder()?.join(format!("{}.{suffix}", name(target)));
    packed(&inside, &file)?;
    Ok(file)
}

/// Unpacks the archive in a root that has the C library, which every Linux has, and nothing else: no shell, no fonts, no home.
fn used_in_an_empty_root(archive: &Path) -> Result<String> {
    let root = folder()?.join("root");
    emptied(&root)?;
    done(Command::new("tar").arg("--extract").arg("--file").arg(archive).arg("--directory").arg(&root))?;
    let at = root.join(name(HERE));
    for library in libraries(&at.join("hapt"))? {
        let to = root.join(library.strip_prefix("/")?);
        fs::create_dir_all(to.parent().context("no folder")?)?;
        fs::copy(&library, to)?;
    }
    for folder in ["proc", "tmp", "out"] {
        fs::create_dir_all(root.join(folder))?;
    }

    let verdict = done(&mut inside(&root, &["check", "@notes/default"]))?;
    ensure!(verdict.starts_with(VERDICT), "hapt check: {verdict}");
    done(&mut inside(&root, &["sim", "@notes/default", "--out", "/out/runs"]))?;
    done(&mut inside(&root, &["report", "@notes/default", "--out", "/out/report"]))?;
    done(&mut inside(&root, &["export", "fmu", "@notes/default", "-o", "/out/wheel.fmu"]))?;
    done(&mut inside(&root, &["export", "c", "@knob/coarse-strong", "-o", "/out/knob.c"]))?;
    for file in ["runs", "report/default.html", "wheel.fmu", "knob.c"] {
        ensure!(root.join("out").join(file).exists(), "no {file} in the empty root");
    }
    gives_its_page(&root)?;
    Ok("used in an empty root: check, sim, report, export, live".into())
}

/// `hapt live` prints its address, and gives its page there.
fn gives_its_page(root: &Path) -> Result<()> {
    let mut server = inside(root, &["live", "@notes/default", "--port", "0"]).stdout(Stdio::piped()).spawn()?;
    let mut address = String::new();
    let read = server.stdout.take().map(|output| BufReader::new(output).read_line(&mut address));
    // The program ends here for any answer.
    let page = page(address.trim());
    server.kill()?;
    server.wait()?;
    read.context("no output")??;
    let page = page?;
    ensure!(page.contains("200 OK") && page.contains("<title>"), "hapt live at {address:?} answers {page:.200}");
    Ok(())
}

/// The answer of a server at an address such as http://127.0.0.1:4278/?token=...
fn page(address: &str) -> Result<String> {
    let (host, path) = address.strip_prefix("http://").context("no address")?.split_once('/').context("no path")?;
    let mut stream = TcpStream::connect(host)?;
    stream.set_read_timeout(Some(ANSWER))?;
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

/// The program in a root of its own with the kernel's /proc, as a container has it, and without any variable of this shell.
fn inside(root: &Path, words: &[&str]) -> Command {
    let mut command = Command::new("unshare");
    command.args(["--mount", "--pid", "--fork", "--kill-child"]);
    // Without root's rights the command runs as root of a namespace.
    if !done(Command::new("id").arg("-u")).is_ok_and(|user| user.trim() == "0") {
        command.arg("--map-root-user");
    }
    command.arg(format!("--mount-proc={}", root.join("proc").display())).arg("chroot").arg(root);
    command.arg(format!("/{}/hapt", name(HERE))).args(words).env_clear().stdin(Stdio::null());
    command.env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin");
    command
}

/// The shared libraries of a program, its loader too.
fn libraries(program: &Path) -> Result<Vec<PathBuf>> {
    let printed = done(Command::new("ldd").arg(program))?;
    Ok(printed.split_whitespace().filter(|word| word.starts_with('/')).map(PathBuf::from).collect())
}

/// The program for the other processor, where QEMU's user mode and Debian's libraries are.
fn under_qemu(built: &Path) -> Result<Option<String>> {
    let ready = Command::new("qemu-aarch64").arg("--version").output().is_ok() && Path::new(AARCH64).exists();
    if !ready {
        println!("  not run: apt-get install qemu-user libc6-arm64-cross libgcc-s1-arm64-cross");
        return Ok(None);
    }
    let mut runs = Vec::new();
    for mut command in [Command::new("qemu-aarch64"), Command::new(own()?)] {
        if command.get_program() == "qemu-aarch64" {
            command.args(["-L", AARCH64]).arg(built.join("hapt"));
        }
        let out = folder()?.join(format!("runs-{}", runs.len()));
        emptied(&out)?;
        let printed = done(command.args(["sim", "@notes/euler", "--out"]).arg(&out))?;
        let run = fs::read(out.join(RUN)).with_context(|| format!("no {RUN} of hapt sim"))?;
        runs.push((printed.replace(&*out.to_string_lossy(), ""), run));
    }
    ensure!(runs[0] == runs[1], "a run under QEMU has other bytes than here");
    Ok(Some("run under QEMU: a run has the bytes of x86-64".into()))
}

/// The program for Windows, under Wine.
fn under_wine(built: &Path) -> Result<String> {
    let wine = Wine::ready()?;
    let printed = done(wine.command().arg(built.join("hapt.exe")).args(["check", "@notes/default"]))?;
    ensure!(printed.starts_with(VERDICT), "hapt check: {printed}");
    Ok("run under Wine".into())
}
