//! The command line for Windows, cross-compiled by MinGW, under Wine: its tests, the bytes of every world against Linux's, Ctrl-C, and
//! the library of an FMU in a host of its own.

use std::fs;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::programs::{self, PROFILE};
use crate::steps::{Step, Tally};

const TARGET: &str = "x86_64-pc-windows-gnu";
const COMPILER: &str = "x86_64-w64-mingw32-gcc";
/// The tests that apply there: of the command line, the FMU's functions, and the page's server.
const TESTS: &str = "-p hapt -p hapt-fmi -p hapt-live --bins --lib --test cli --test fmi --test live";
/// Programs in C that take part: `xtask/windows/NAME.c`.
const SOURCES: &str = "xtask/windows";

/// The largest relative difference of the numbers of two verdicts.
const DIGITS: f64 = 1e-9;
/// Where a library may be that this Wine lacks.
const SYSTEM: &str = "drive_c/windows/system32";

/// All checks for Windows.
pub fn holds() -> Result<()> {
    let mut tally = Tally::new();
    let mut built = cargo("test", TESTS);
    built.args(["--no-run", "--message-format", "json-render-diagnostics"]);
    let programs = programs::programs(&mut built)?;
    let run = |words: &str| -> Result<()> {
        ensure!(cargo("build", words).status()?.success(), "cargo build {words} for {TARGET}");
        Ok(())
    };
    run("--package hapt --package hapt-fmi")?;
    let native = absolute(programs::program("hapt")?.get_program())?;
    let wine = Wine::ready()?;

    let mut steps = Vec::new();
    for program in programs {
        let (name, mut command) = (program.name(), program.through(wine.command()));
        // A page that reads too slowly is disconnected, and Wine is too slow for dozens of pages.
        if name.ends_with("/live") {
            command.args(["--skip", "crowd::"]);
        }
        steps.push(Step::tests(name, command));
    }
    for world in programs::worlds(Path::new("worlds"))? {
        let (wine, native) = (wine.clone(), native.clone());
        steps.push(Step::check(world.display().to_string(), move || same_bytes(&wine, &native, &world)));
    }
    let at = wine.clone();
    steps.push(Step::check("Ctrl-C in a console", move || interrupted(&at)));
    steps.push(Step::check("an FMU with both libraries", move || same_fmu(&wine, &native)));
    tally.run(steps);
    std::process::exit(i32::from(!tally.end()))
}

/// Cargo for Windows, in the profile of the tests.
fn cargo(verb: &str, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command.args([verb, "--quiet", "--profile", PROFILE, "--target", TARGET]).args(words.split(' '));
    command
}

/// Where cargo puts the programs of this target.
fn built() -> Result<PathBuf> {
    Ok(absolute(programs::target().join(TARGET).join(programs::folder_name(PROFILE)))?)
}

/// Wine with a disk of its own.
#[derive(Clone)]
pub struct Wine {
    program: PathBuf,
    disk: PathBuf,
}

impl Wine {
    /// A disk with the library that Wine 8 lacks, and the programs in C.
    pub fn ready() -> Result<Wine> {
        // Debian's `wine` first prints a message about 32 bits.
        let places = ["/usr/lib/wine/wine64", "/usr/bin/wine64", "/usr/bin/wine"].map(PathBuf::from);
        let program = places.into_iter().find(|path| path.exists()).context("Debian: apt-get install wine wine64")?;
        let wine = Wine { program, disk: absolute(programs::target().join("wine"))? };
        if !wine.disk.join(SYSTEM).exists() {
            wine.printed(&["wineboot", "--init"].map(String::from))?;
        }
        compiled("bcryptprimitives", &wine.disk.join(SYSTEM).join("bcryptprimitives.dll"), &["-shared", "-ladvapi32"])?;
        compiled("interrupt", &wine.disk.join("interrupt.exe"), &[])?;
        compiled("fmu", &wine.disk.join("fmu.exe"), &[])?;
        Ok(wine)
    }

    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.env("WINEPREFIX", &self.disk).env("WINEDEBUG", "-all").stdin(Stdio::null());
        command
    }

    /// The output of a command; its exit code is 0 or 1 (a world that is not certified).
    fn printed(&self, words: &[String]) -> Result<Vec<u8>> {
        printed(self.command().args(words))
    }
}

fn printed(command: &mut Command) -> Result<Vec<u8>> {
    let output = command.stdin(Stdio::null()).output().with_context(|| format!("{command:?}"))?;
    let ended = matches!(output.status.code(), Some(0 | 1));
    ensure!(ended, "{command:?}: {}{}", output.status, String::from_utf8_lossy(&output.stderr));
    Ok(output.stdout)
}

fn compiled(name: &str, to: &Path, options: &[&str]) -> Result<()> {
    let source = Path::new(SOURCES).join(name).with_extension("c");
    printed(Command::new(COMPILER).arg("-O2").arg(source).arg("-o").arg(to).args(options)).map(drop)
}

/// The runs, the printed verdict and the report of a world are the same bytes there and here.
fn same_bytes(wine: &Wine, native: &Path, world: &Path) -> Result<()> {
    let name = world.file_stem().context("a name")?;
    let scratch = absolute(programs::target().join("windows").join(name))?;
    let (mut outputs, mut verdicts) = (Vec::new(), Vec::new());
    for system in ["linux", "windows"] {
        let out = scratch.join(system);
        emptied(&out)?;
        let output = |words: &[&str]| {
            let mut command = if system == "windows" { wine.command() } else { Command::new(native) };
            if system == "windows" {
                command.arg(built()?.join("hapt.exe"));
            }
            printed(command.args(words).arg(world))
        };
        let folder = |name: &str| Ok::<_, anyhow::Error>(out.join(name).to_str().context("a path")?.to_string());
        verdicts.push(serde_json::from_slice::<Value>(&output(&["check", "--json"])?)?);
        let mut files = vec![("the verdict".into(), output(&["check"])?)];
        output(&["sim", "--out", &folder("runs")?])?;
        output(&["report", "--out", &folder("report")?])?;
        files.extend(read(&out.join("runs"))?);
        files.extend(read(&out.join("report"))?);
        outputs.push(files);
    }
    ensure!(outputs[0].len() > 3, "nothing was run");
    near("", &verdicts[0], &verdicts[1])?;
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    ensure!(names(&outputs[0]) == names(&outputs[1]), "{:?} and {:?}", names(&outputs[0]), names(&outputs[1]));
    let differ = outputs[0].iter().zip(&outputs[1]).find(|(one, other)| one.1 != other.1);
    ensure!(differ.is_none(), "{} differs", differ.map_or("", |((name, _), _)| name));
    Ok(())
}

/// Two verdicts in JSON are the same, their numbers to nine digits: the certificate takes logarithms of the system's library.
fn near(path: &str, one: &Value, other: &Value) -> Result<()> {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => {
            let [one, other] = [one, other].map(|number| number.as_f64().unwrap_or(f64::NAN));
            let is_near = (one - other).abs() <= DIGITS * one.abs().max(other.abs()).max(DIGITS);
            ensure!(is_near, "{path}: {one:e} and {other:e}");
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            for (i, (one, other)) in one.iter().zip(other).enumerate() {
                near(&format!("{path}[{i}]"), one, other)?;
            }
        }
        (Value::Object(one), Value::Object(other)) if one.keys().eq(other.keys()) => {
            for (key, one) in one {
                near(&format!("{path}.{key}"), one, &other[key])?;
            }
        }
        _ => ensure!(one == other, "{path}: {one} and {other}"),
    }
    Ok(())
}

/// The files of a folder by their names.
fn read(folder: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() {
            files.push((path.file_name().context("a name")?.to_string_lossy().into_owned(), fs::read(&path)?));
        }
    }
    files.sort();
    Ok(files)
}

/// Ctrl-C in a console ends a run with 130, and nothing half-written stays; a log keeps what was recorded.
fn interrupted(wine: &Wine) -> Result<()> {
    let hapt = built()?.join("hapt.exe");
    let out = absolute(programs::target().join("windows/interrupted"))?;
    emptied(&out)?;
    let world = absolute("worlds/notes/default.toml")?;
    let [hapt, folder, world] = [&hapt, &out, &world].map(|path| format!("Z:{}", path.display()));
    let simulate = format!("sim {world} --set scenarios.step.duration=9999999 --out {folder}");
    let run = format!("run {world} --scenario step --set scenarios.step.duration=9999 --log {folder}/run.mcap");
    for (words, file) in [(simulate, ".step.csv.*"), (run, "run.mcap*")] {
        // The console is a terminal of Linux, which util-linux's script holds. Its output is not plain text: it moves its cursor over
        // blanks. The host ends with 0 where the program ended with 130.
        let host = wine.disk.join("interrupt.exe");
        let line = format!("{} {} '{folder}/{file}' '{hapt} {words}'", wine.program.display(), host.display());
        let mut script = Command::new("script");
        script.args(["-qec", &line, "/dev/null"]).env("WINEPREFIX", &wine.disk).env("WINEDEBUG", "-all");
        let output = script.stdin(Stdio::null()).output().with_context(|| format!("{script:?}"))?;
        let (code, shown) = (output.status.code(), String::from_utf8_lossy(&output.stdout));
        ensure!(code == Some(0), "hapt {words}: the host ends with {code:?}, and shows {shown:?}");
    }
    let left: Vec<String> = read(&out)?.into_iter().map(|(name, _)| name).collect();
    ensure!(left == ["run.mcap"], "Ctrl-C leaves {left:?}");
    Ok(())
}

fn emptied(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    Ok(fs::create_dir_all(folder)?)
}

/// A host in C loads the library of an FMU here and there, and prints the same bits.
fn same_fmu(wine: &Wine, native: &Path) -> Result<()> {
    let folder = absolute(programs::target().join("windows/fmu"))?;
    emptied(&folder)?;
    let library = built()?.join("hapt_fmi.dll");
    let fmu = folder.join("wheel.fmu");
    let mut export = Command::new(native);
    export.args(["export", "fmu", "@notes/default", "--whole", "-o"]).arg(&fmu).arg("--platform").arg(library);
    printed(&mut export)?;
    printed(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(&fmu).arg(&folder))?;
    let host = folder.join("host");
    printed(Command::new("cc").args(["-O2", "xtask/windows/fmu.c", "-ldl", "-o"]).arg(&host))?;
    let here = printed(Command::new(host).arg(folder.join("binaries/linux64/hapt_fmi.so")).arg(&folder))?;
    let words = [wine.disk.join("fmu.exe"), folder.join("binaries/win64/hapt_fmi.dll"), folder];
    let there = wine.printed(&words.map(|path| format!("Z:{}", path.display())))?;
    let lines = |text: &[u8]| String::from_utf8_lossy(text).lines().map(String::from).collect::<Vec<_>>();
    ensure!(lines(&here).len() >= 1000, "the host prints {} lines", lines(&here).len());
    ensure!(lines(&here) == lines(&there), "the libraries differ");
    Ok(())
}
