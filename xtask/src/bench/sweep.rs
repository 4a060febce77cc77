//! Many worlds at once: `hapt sweep` beside C with OpenMP, loops beside NumPy, and `hapt check` as a process.

use std::fmt::Write;
use std::fs;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use super::{Bench, STARTS, Times, goal, in_turns, output, program};

/// Rounds of whole sweeps.
const ROUNDS: usize = 9;
/// The axes, and what is asked.
const STIFFNESS: (f64, f64, usize) = (0.5, 2.0, 250);
const INERTIA: (f64, f64, usize) = (0.01, 0.05, 400);
const MEASURES: &str = "peak_torque,final_energy";

/// Runs the commands in turns, so many rounds; ms of each whole process.
fn processes<const N: usize>(rounds: usize, mut commands: [Command; N]) -> Result<[Times; N]> {
    let mut all = [(); N].map(|()| Times { ns: Vec::new(), answer: Vec::new() });
    for _ in 0..rounds {
        for (command, times) in commands.iter_mut().zip(&mut all) {
            let start = Instant::now();
            let out = command.output().with_context(|| format!("{command:?}"))?;
            times.ns.push(start.elapsed().as_secs_f64() * 1e3);
            // A check may end with 1: not certified.
            ensure!(matches!(out.status.code(), Some(0 | 1)), "{command:?} failed");
        }
    }
    Ok(all)
}

/// A chain of bodies whose file states intervals, delays and a tolerance, and which is certified.
pub(super) fn stated(bodies: usize) -> String {
    let mut file = String::from(
        "loop = { period = \"1 ms\", method = \"trapezoidal\", interval_max = \"1.4 ms\", delay = \"0.3 ms\", delay_max = \"0.6 ms\" }\n\
         device = { inertia = 1e-3, damping = \"0.3 N m s/rad ± 20 %\" }\n",
    );
    for i in 0..bodies {
        file += &format!("[bodies.b{i}]\ninertia = {:?}\n", 0.01 / (1 + i) as f64);
    }
    for i in 0..bodies {
        let before = if i == 0 { "puck".into() } else { format!("b{}", i - 1) };
        let between = format!("[[couplings]]\nbetween = [\"{before}\", \"b{i}\"]\n");
        file += &format!(
            "{between}kind = \"spring\"\nstiffness = {}\n{between}kind = \"damper\"\ndamping = 0.002\n",
            2 * (1 + i)
        );
    }
    file
}

/// The largest difference between two tables of numbers, each relative to the larger of the two.
fn difference(one: &str, other: &str) -> Result<f64> {
    let numbers = |text: &str| -> Result<Vec<f64>> {
        let fields = text.lines().skip(1).flat_map(|line| line.split(','));
        fields.map(|field| field.parse().context("no number")).collect()
    };
    let (one, other) = (numbers(one)?, numbers(other)?);
    ensure!(one.len() == other.len(), "tables of {} and {} numbers", one.len(), other.len());
    let relative = |(a, b): (&f64, &f64)| (a - b).abs() / a.abs().max(b.abs()).max(f64::MIN_POSITIVE);
    Ok(one.iter().zip(&other).map(relative).fold(0.0, f64::max))
}

impl Bench {
    /// 100 000 worlds of a second, from the command to the file.
    pub(super) fn sweeps(&self) -> Result<String> {
        let mut text = String::from(
            "\n## A sweep of runs\n\n`hapt sweep` of 100 000 worlds of 1 s at 1 kHz, the notes' wheel held, or released after 0.25 s, two \
             measures, two threads: the whole process with its file, against [C](../bench/c/sweep.c) with OpenMP, sixteen worlds side by \
             side (`-O3 -march=native -ffinite-math-only`). The last column is the largest relative difference of any two numbers in \
             the tables.\n\n\
             | run | hapt / C | goal | | hapt, ms | C, ms | difference |\n| --- | --- | --- | --- | --- | --- | --- |\n",
        );
        for scenario in ["released", "held"] {
            let parameters = output(&mut self.rust(&format!("parameters {scenario}")))?;
            let words: Vec<&str> = parameters.split_whitespace().collect();
            let [period, _, inertia, damping, limit, _, _, to, release] = words[..] else {
                anyhow::bail!("expected nine parameters: {parameters}");
            };
            let [own, other] = ["hapt.csv", "c.csv"].map(|name| self.folder.join(name));
            let (own, other) = (own.to_str().context("a path in UTF-8")?, other.to_str().context("a path in UTF-8")?);
            let axis = |key: &str, (from, to, n): (f64, f64, usize)| format!("--vary {key}={from}..{to}:{n}");
            let (k, j) = (axis("couplings.0.stiffness", STIFFNESS), axis("bodies.wheel.inertia", INERTIA));
            let mut hapt = format!(
                "sweep worlds/notes/default.toml --set scenarios.step.duration=1 {k} {j} --measure {MEASURES} --threads 2 --out {own}"
            );
            if scenario == "released" {
                hapt += " --set scenarios.step.hand.release=0.25";
            }
            let values = |(from, to, n): (f64, f64, usize)| format!("{from} {to} {n}");
            let c = format!(
                "{period} 1001 {inertia} {damping} {limit} {to} {release} {} {} {other}",
                values(STIFFNESS),
                values(INERTIA)
            );
            let mut c = self.c("sweep", &c);
            c.env("OMP_NUM_THREADS", "2");
            let [hapt, c] = processes(ROUNDS, [program(&self.release.join("hapt"), &hapt), c])?;
            let difference = difference(&fs::read_to_string(own)?, &fs::read_to_string(other)?)?;
            ensure!(difference < 1e-9, "the tables differ by {difference:e}");
            let (ratio, quartiles) = hapt.over(&c);
            let goal = goal(ratio, 1.0);
            let (hapt, c) = (hapt.median(), c.median());
            writeln!(text, "| {scenario} | {quartiles} | {goal} | {hapt:.0} | {c:.0} | {difference:.0e} |")?;
        }
        Ok(text)
    }

    /// A million loops, without reading and writing; and from the command to the file.
    pub(super) fn loops(&self) -> Result<String> {
        let python = self.folder.join("python/bin/python");
        let mut text = String::from(
            "\n## A sweep of loops\n\nHow fast 10⁶ loops of one body on a spring grow under forward Euler, held, over stiffness and inertia, and \
             whether they do, as `hapt sweep` has it decided: five columns of numbers in memory, on one core. The error is the largest, \
             relative to ln(1 + x²)/(2T). The last row is the whole process with its file of 10⁶ rows, on two threads.\n\n\
             | | ms | goal | | error |\n| --- | --- | --- | --- | --- |\n",
        );
        let own = ["growth", "verdict"].map(|ask| self.rust(&format!("loops {ask} 9")));
        let there = Command::new(&python).args(["-c", "import numpy"]).output().is_ok_and(|out| out.status.success());
        let (growth, verdict, numpy) = if there {
            let [growth, verdict] = own;
            let mut numpy = Command::new(&python);
            numpy.args(["bench/python/loops.py", "1"]);
            let [growth, verdict, numpy] = in_turns([growth, verdict, numpy])?;
            (growth, verdict, Some(numpy))
        } else {
            let [growth, verdict] = in_turns(own)?;
            (growth, verdict, None)
        };
        let error = growth.answer.first().copied().context("no error")?;
        writeln!(text, "| growth | {:.1} | {} | {error:.0e} |", growth.median(), goal(growth.median(), 50.0))?;
        writeln!(text, "| stable or not | {:.2} | {} | |", verdict.median(), goal(verdict.median(), 2.0))?;
        if let Some(numpy) = &numpy {
            let error = numpy.answer.first().copied().context("no error")?;
            writeln!(text, "| NumPy's `eigvals` | {:.0} | | | {error:.0e} |", numpy.median())?;
        }
        let file = self.folder.join("loops.csv");
        let sweep = format!(
            "sweep worlds/notes/euler.toml --vary couplings.0.stiffness=0.5..2:1000 --vary bodies.wheel.inertia=0.01..0.05:1000 \
             --measure held_verdict --threads 2 --out {}",
            file.to_str().context("a path in UTF-8")?
        );
        let [whole] = processes(ROUNDS, [program(&self.release.join("hapt"), &sweep)])?;
        writeln!(text, "| `hapt sweep`, stable or not | {:.0} | | | |", whole.median())?;
        match &numpy {
            Some(numpy) => {
                let of = |times: &Times, wanted: f64| {
                    let (ratio, quartiles) = numpy.over(times);
                    (quartiles, if ratio >= wanted { "met" } else { "**missed**" })
                };
                let ((growth, twenty), (verdict, thousand)) = (of(&growth, 20.0), of(&verdict, 1000.0));
                writeln!(
                    text,
                    "\nNumPy takes {growth} times as long as the growth (goal 20, {twenty}), and {verdict} times as long as the verdict \
                     (goal 1000, {thousand})."
                )?;
            }
            None => text += "\nNumPy is skipped: there is no Python environment with it.\n",
        }
        text += "\nA verdict is three conditions on the characteristic polynomial, eight loops in a vector where the machine has them that wide; \
                 a growth's time is its logarithm, which is the system's, to the last digit and one by one. So are both for every method, \
                 any springs and dampers at one body, dampers that follow the springs, and couplings that do not touch it. Several bodies, and \
                 nonlinear couplings at the body, go the general way through eigenvalues. Of the whole sweep's time nearly all is the text \
                 of three million numbers.\n";
        Ok(text)
    }

    /// Whole processes of `hapt check`.
    pub(super) fn checks(&self) -> Result<String> {
        let mut chain = String::from("loop.period = \"1 ms\"\ndevice = { inertia = 6.4e-4, damping = 1.2e-3 }\n");
        for i in 0..32 {
            writeln!(chain, "[bodies.b{i}]\ninertia = {}", 0.01 + 0.001 * f64::from(i))?;
        }
        for i in 0..32 {
            let before = if i == 0 { "puck".into() } else { format!("b{}", i - 1) };
            writeln!(
                chain,
                "[[couplings]]\nkind = \"spring\"\nbetween = [\"{before}\", \"b{i}\"]\nstiffness = {}",
                1 + i
            )?;
        }
        let file = self.folder.join("chain.toml");
        fs::write(&file, chain)?;
        let file = file.to_str().context("a path in UTF-8")?;
        let check = |words: &str| program(&self.release.join("hapt"), &format!("check {words}"));
        let [one] = processes(STARTS, [check("worlds/notes/default.toml")])?;
        let [quick] = processes(ROUNDS, [check(&format!("{file} --no-remedies"))])?;
        let [all] = processes(3, [check(file)])?;
        let of_stated = |n: usize| -> Result<Times> {
            let path = self.folder.join(format!("stated{n}.toml"));
            fs::write(&path, stated(n))?;
            let [times] = processes(ROUNDS, [check(path.to_str().context("a path in UTF-8")?)])?;
            Ok(times)
        };
        let (one_stated, eight_stated) = (of_stated(1)?, of_stated(8)?);
        let mut text = String::from(
            "\n## One check\n\nThe whole process of `hapt check`; the 32 bodies are a chain of springs.\n\n\
             | | ms | goal | |\n| --- | --- | --- | --- |\n",
        );
        for (name, times, wanted) in [
            ("1 body, with remedies", one, 10.0),
            ("1 body with times and a tolerance, with remedies", one_stated, 20.0),
            ("8 bodies with times and a tolerance, with remedies", eight_stated, 300.0),
            ("32 bodies, without", quick, 100.0),
            ("32 bodies, with remedies", all, 5000.0),
        ] {
            let ms = times.median();
            writeln!(text, "| {name} | {ms:.1} | {} |", goal(ms, wanted))?;
        }
        text += "\nThe free loop of this chain keeps its energy up to the period 2b/K, and grows just above it, so that its critical period takes \
                 two eigenvalue problems of puck and bodies together. Where the energy theorem does not apply, or the bodies are damped, \
                 there are some hundred. Of each problem a good half is the reduction to Hessenberg form and QR, and nearly all of the rest \
                 a second look, with vectors, at those eigenvalues that stand within rounding of the circle: with a lossless chain, all of \
                 its modes.\n";
        Ok(text)
    }
}
