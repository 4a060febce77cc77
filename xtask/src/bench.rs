//! `cargo xtask bench`: hapt and plain C, in turns, each in a process of its own that times its inner loop; and the measurements of
//! docs/performance.md. The workloads are in `bench`.

mod checks;
mod intervals;
mod package;
mod page;
mod realtime;
mod sweep;

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::marked;
use crate::random::quantile;

const PAGE: &str = "docs/performance.md";
const GUARDS: &str = "bench/guards.toml";
const FLAGS: [&str; 4] = ["-O3", "-march=native", "-Wall", "-Wextra"];
const PAIRS: usize = 25;
const STARTS: usize = 51;
const SAMPLES: f64 = 10_001.0;
/// The samples of the sixteen worlds of `hapt-bench lanes` together.
const LANES_SAMPLES: f64 = 15_960.0;

/// The part that the words after `bench` name.
pub fn command(words: &[String]) -> Result<()> {
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => run(false),
        ["--write"] => run(true),
        ["--guards"] => guards(false),
        ["--guards", "--write"] => guards(true),
        ["python"] => package::measure(25, false),
        ["python", "--short"] => package::measure(2, false),
        ["python", "--write"] => package::measure(25, true),
        ["scale"] => package::scale("1e8", false),
        ["scale", "--short"] => package::scale("1e6", false),
        ["scale", "--write"] => package::scale("1e8", true),
        ["drive"] => drive("python3"),
        ["drive", python] => drive(python),
        [name] | [name, "--write"] if let Some(part) = part(name) => one(part, words.len() > 1),
        _ => bail!(
            "cargo xtask bench [{}] [--write], or [--guards [--write]], or drive [PYTHON], or python [--short|--write], or scale [--short|--write]",
            PARTS.map(|part| part.name).join("|")
        ),
    }
}

/// One exchange with a simulated drive over a serial port, compared with that of the makers' own library.
fn drive(python: &str) -> Result<()> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["run", "--quiet", "--profile", "dist", "-p", "hapt-drive", "--example", "exchange", "--", python]);
    ensure!(command.status()?.success(), "the exchange with the drive does not run");
    Ok(())
}

/// A part that can be measured without the rest.
struct Part {
    name: &'static str,
    /// The page with a place for it; else it is a section of [`PAGE`].
    page: Option<&'static str>,
    measure: fn(&Bench) -> Result<String>,
}

const PARTS: [Part; 7] = [
    Part { name: "run", page: None, measure: Bench::runs },
    Part { name: "sweep", page: None, measure: Bench::sweeps },
    Part { name: "worlds", page: None, measure: Bench::worlds },
    Part { name: "check", page: None, measure: Bench::checks },
    Part { name: "realtime", page: None, measure: Bench::realtime },
    Part { name: "intervals", page: Some("docs/realtime.md"), measure: Bench::intervals },
    Part { name: "page", page: Some("docs/live.md"), measure: Bench::page },
];

fn part(name: &str) -> Option<&'static Part> {
    PARTS.iter().find(|part| part.name == name)
}

/// Measures one part and prints it; with `write`, into its place.
fn one(part: &Part, write: bool) -> Result<()> {
    let text = (part.measure)(&Bench::build()?)?;
    if let Some(page) = part.page {
        return marked::publish(page, &format!("cargo xtask bench {}", part.name), &text, write);
    }
    println!("{text}");
    if write {
        let page = fs::read_to_string(PAGE).context(PAGE)?;
        fs::write(PAGE, with_part(&page, &text)?).context(PAGE)?;
    }
    Ok(())
}

/// The page with this part in place of the one under the same heading.
fn with_part(page: &str, text: &str) -> Result<String> {
    let heading = text.trim_start().lines().next().context("a part without a heading")?;
    let missing = || format!("{PAGE} has no \"{heading}\": cargo xtask bench --write makes the whole page");
    let begin = page.find(&format!("\n{heading}\n")).with_context(missing)?;
    let rest = &page[begin + 1..];
    let end = rest.find("\n## ").map_or(page.len(), |end| begin + 1 + end);
    Ok(format!("{}{text}{}", &page[..begin], &page[end..]))
}

/// Measures the page's parts and prints them; with `write`, into [`PAGE`].
fn run(write: bool) -> Result<()> {
    let bench = Bench::build()?;
    let mut page = bench.head()?;
    let parts = [Bench::runs, Bench::package, Bench::sweeps, Bench::checks, Bench::realtime];
    for part in parts {
        let text = part(&bench)?;
        eprintln!("{text}");
        page += &text;
    }
    if write {
        fs::write(PAGE, page).context(PAGE)?;
        println!("wrote {PAGE}");
    }
    Ok(())
}

/// The instructions of a sample against those in [`GUARDS`]; or, with `record`, into it.
fn guards(record: bool) -> Result<()> {
    let Some(counts) = Bench::build()?.counts()? else {
        println!("SKIPPED: the guards need valgrind, and it is not here");
        return Ok(());
    };
    let rustc = first_line("rustc", &["--version"])?;
    if record {
        let mut text = format!(
            "# Instructions a sample, by callgrind: cargo xtask bench --guards; --guards --write records them anew.\n\
             rustc = \"{rustc}\"\ntolerance = 0.05\n"
        );
        counts.iter().try_for_each(|(name, count)| writeln!(text, "{name} = {count:.1}"))?;
        return fs::write(GUARDS, text).context(GUARDS);
    }
    let text = fs::read_to_string(GUARDS).context(GUARDS)?;
    let value = |key: &str| {
        let entry = text.lines().filter_map(|line| line.split_once(" = ")).find(|(name, _)| *name == key);
        entry.map(|(_, value)| value.trim_matches('"')).with_context(|| format!("{GUARDS} has no {key}"))
    };
    if value("rustc")? != rustc {
        println!("SKIPPED: the guards are of {}, this is {rustc}", value("rustc")?);
        return Ok(());
    }
    let tolerance: f64 = value("tolerance")?.parse()?;
    let mut over = Vec::new();
    for (name, count) in counts {
        let recorded: f64 = value(name)?.parse()?;
        println!("{name}: {count:.1} instructions a sample, {recorded} recorded");
        if count > recorded * (1.0 + tolerance) {
            over.push(name);
        } else if count < recorded * (1.0 - tolerance) {
            println!("  fewer than recorded: --guards --write keeps the gain");
        }
    }
    ensure!(over.is_empty(), "more instructions than {GUARDS} allows: {}", over.join(", "));
    Ok(())
}

/// Where the programs are.
struct Bench {
    programs: PathBuf,
    /// The C programs, and other intermediate files.
    folder: PathBuf,
}

/// One program's times over the rounds, in ns a sample, and its answer.
struct Times {
    ns: Vec<f64>,
    answer: Vec<f64>,
}

impl Times {
    fn median(&self) -> f64 {
        quantile(self.ns.iter().copied(), 0.5)
    }

    /// The ratio to the other's: the median of the rounds' ratios, and their quartiles as text.
    fn over(&self, other: &Times) -> (f64, String) {
        let ratios: Vec<f64> = self.ns.iter().zip(&other.ns).map(|(a, b)| a / b).collect();
        let [low, middle, high] = [0.25, 0.5, 0.75].map(|q| quantile(ratios.iter().copied(), q));
        (middle, format!("{middle:.2} ({low:.2} to {high:.2})"))
    }

    /// Whether the shorter answer is the beginning of the other.
    fn agree(&self, other: &Times) -> Result<()> {
        for (a, b) in self.answer.iter().zip(&other.answer) {
            ensure!((a - b).abs() <= 1e-9 * a.abs().max(b.abs()) + 1e-11, "answers differ: {a} and {b}");
        }
        Ok(())
    }
}

/// Runs the programs in turns, round after round.
fn in_turns<const N: usize>(programs: [Command; N]) -> Result<[Times; N]> {
    let mut programs = programs;
    let mut all = [(); N].map(|()| Times { ns: Vec::new(), answer: Vec::new() });
    for _ in 0..PAIRS {
        for (program, times) in programs.iter_mut().zip(&mut all) {
            let text = output(program)?;
            let (ns, answer) = text.strip_prefix("ns ").and_then(|text| text.split_once('\n')).context("no time")?;
            times.ns.push(ns.parse()?);
            times.answer = answer.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        }
    }
    Ok(all)
}

fn output(command: &mut Command) -> Result<String> {
    let out = command.stderr(Stdio::inherit()).output().with_context(|| format!("{command:?}"))?;
    ensure!(out.status.success(), "{command:?} failed");
    Ok(String::from_utf8(out.stdout)?)
}

fn first_line(program: &str, arguments: &[&str]) -> Result<String> {
    Ok(output(Command::new(program).args(arguments))?.lines().next().unwrap_or_default().to_owned())
}

/// "goal | met?" as two cells.
fn goal(ratio: f64, goal: f64) -> String {
    format!("{goal} | {}", if ratio <= goal { "met" } else { "**missed**" })
}

impl Bench {
    fn build() -> Result<Self> {
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from);
        let folder = target.join("bench");
        fs::create_dir_all(&folder)?;
        let packages = ["build", "--quiet", "--profile", "dist", "--package", "hapt-bench"];
        output(Command::new(env!("CARGO")).args(packages).args(["--package", "hapt"]))?;
        let bench = Bench { programs: target.join("dist"), folder };
        bench.compile("sweep", "sweep", &["-ffinite-math-only", "-fno-trapping-math", "-fopenmp"])?;
        bench.compile_worlds()?;
        // No fused multiply-add in the bound: hapt has none either.
        bench.compile("bound", "bound", &["-ffp-contract=off"])?;
        for works in [0, 1] {
            bench.compile("run", &format!("run-{works}"), &[&format!("-DWORKS={works}")])?;
        }
        Ok(bench)
    }

    fn compile(&self, source: &str, program: &str, flags: &[&str]) -> Result<()> {
        let mut gcc = Command::new("gcc");
        gcc.args(FLAGS).args(flags).arg(format!("bench/c/{source}.c")).arg("-o").arg(self.folder.join(program));
        output(gcc.arg("-lm")).map(|_| ())
    }

    fn rust(&self, words: &str) -> Command {
        program(&self.programs.join("hapt-bench"), words)
    }

    fn c(&self, name: &str, words: &str) -> Command {
        program(&self.folder.join(name), words)
    }

    fn head(&self) -> Result<String> {
        let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = cpu.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown");
        Ok(format!(
            "# Performance\n\n\
             Made by `cargo xtask bench --write`. A ratio is the median of {PAIRS} rounds (quartiles behind it), the programs in turns, each in its own \
             process; answers agree to 1e-9. On another machine only the ratios count.\n\n\
             - machine: {}, {} cores\n- {}, as shipped (the profile `dist`): no flags for this machine, no fused multiply-add\n- {}, `{}`\n",
            model.trim_start_matches([' ', '\t', ':']),
            std::thread::available_parallelism()?,
            first_line("rustc", &["--version"])?,
            first_line("gcc", &["--version"])?,
            FLAGS[..2].join(" "),
        ))
    }

    fn runs(&self) -> Result<String> {
        let mut text = String::from(
            "\n## A run\n\nThe notes' wheel by the exact hold, 10 s at 1 kHz, from the world to all columns in memory: \
             `Simulation` against [plain C](../bench/c/run.c). \"Held\" is the notes' step, \"released\" lets go after \
             0.25 s. \"Without works\" C leaves out those of hand, motor, damping and friction. The bound is \
             [the recurrence alone](../bench/c/bound.c).\n\n\
             | run | hapt / C | goal | | hapt, ns a sample | C |\n| --- | --- | --- | --- | --- | --- |\n",
        );
        for scenario in ["released", "held"] {
            let words = format!("{} 100", output(&mut self.rust(&format!("parameters {scenario}")))?.trim());
            let [hapt, columns, c, c_columns, bound] = in_turns([
                self.rust(&format!("run {scenario} everything 100")),
                self.rust(&format!("run {scenario} columns 100")),
                self.c("run-1", &words),
                self.c("run-0", &words),
                self.c("bound", &words),
            ])?;
            hapt.agree(&c)?;
            columns.agree(&c_columns)?;
            let mut row = |name: &str, hapt: &Times, c: &Times, wanted: Option<f64>| -> Result<()> {
                let (ratio, quartiles) = hapt.over(c);
                let wanted = wanted.map_or("| ".into(), |wanted| goal(ratio, wanted));
                writeln!(text, "| {name} | {quartiles} | {wanted} | {:.1} | {:.1} |", hapt.median(), c.median())?;
                Ok(())
            };
            row(&format!("{scenario}, columns and works"), &hapt, &c, Some(1.5))?;
            row(&format!("{scenario}, columns; C without works"), &columns, &c_columns, None)?;
            if scenario == "held" {
                ensure!((bound.answer[0] - hapt.answer[17]).abs() < 1e-9, "the bound computes something else");
                row("held, columns and works; the bound", &hapt, &bound, Some(1.15))?;
            }
        }
        Ok(text)
    }

    /// Instructions a sample, by callgrind; `None` without it. Two counts and their difference: what is done once cancels.
    fn counts(&self) -> Result<Option<Vec<(&'static str, f64)>>> {
        if Command::new("valgrind").arg("--version").output().is_err() {
            return Ok(None);
        }
        let collected = |words: &str| -> Result<f64> {
            let mut valgrind = Command::new("valgrind");
            valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]).arg(self.programs.join("hapt-bench"));
            let out = valgrind.args(words.split(' ')).output()?;
            let text = String::from_utf8(out.stderr)?;
            let count =
                text.lines().find_map(|line| line.split_once("Collected : ")).context("no count from callgrind")?;
            Ok(count.1.trim().parse()?)
        };
        let workloads = [
            ("run_released", "run released everything", SAMPLES),
            ("run_held", "run held everything", SAMPLES),
            ("step_1", "step 1", 4096.0),
            ("step_4", "step 4", 4096.0),
            ("step_32", "step 32", 4096.0),
            ("bare_f32", "bare f32", 4096.0),
            ("bare_f64", "bare f64", 4096.0),
            ("guarded_f32", "guarded f32", 4096.0),
            ("guarded_f64", "guarded f64", 4096.0),
            ("lanes_released", "lanes bench/worlds/released.toml", LANES_SAMPLES),
            ("lanes_wall", "lanes bench/worlds/wall.toml", LANES_SAMPLES),
            ("lanes_detents", "lanes bench/worlds/detents.toml", LANES_SAMPLES),
            ("lanes_grip", "lanes bench/worlds/grip.toml", LANES_SAMPLES),
            ("lanes_bodies", "lanes bench/worlds/bodies.toml", LANES_SAMPLES),
            ("lanes_lag", "lanes bench/worlds/lag.toml", LANES_SAMPLES),
        ];
        let count = |(name, words, samples): (&'static str, &str, f64)| {
            Ok((name, (collected(&format!("{words} 3"))? - collected(&format!("{words} 1"))?) / (2.0 * samples)))
        };
        workloads.into_iter().map(count).collect::<Result<_>>().map(Some)
    }
}

fn program(path: &Path, words: &str) -> Command {
    let mut command = Command::new(path);
    command.args(words.split_whitespace());
    command
}
