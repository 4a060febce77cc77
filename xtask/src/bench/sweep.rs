//! Many worlds at once: `hapt sweep` compared with C with OpenMP.

use std::fmt::Write;
use std::fs;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use super::{Bench, Times, goal, output, program};

/// Rounds of whole sweeps.
pub(super) const ROUNDS: usize = 9;
/// The axes, and the measure.
const STIFFNESS: (f64, f64, usize) = (0.5, 2.0, 250);
const INERTIA: (f64, f64, usize) = (0.01, 0.05, 400);
const MEASURES: &str = "peak_torque,final_energy";

/// The period's axis in the sweeps of [`WORLDS`], and their stiffness's.
const PERIODS: &str = "0.9e-3 1.1e-3 400";
const STIFFNESSES: &str = "couplings.0.stiffness 0.5 2 250";

/// The worlds of bench/worlds with what is in them, the -DKIND of their C, and their first axis.
const WORLDS: [(&str, &str, &str, &str); 5] = [
    ("a wheel", "released", "RELEASED", STIFFNESSES),
    ("with a wall and Coulomb friction", "wall", "WALL", STIFFNESSES),
    ("detents and FOAW", "detents", "DETENTS", "couplings.0.torque 4e-3 1.2e-2 250"),
    ("a wheel, in a grip at first", "grip", "GRIP", STIFFNESSES),
    ("3 bodies", "bodies", "BODIES", STIFFNESSES),
];

/// Runs the commands in turns, for `rounds` rounds; returns ms of each whole process.
pub(super) fn processes<const N: usize>(rounds: usize, mut commands: [Command; N]) -> Result<[Times; N]> {
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

/// The largest difference between two tables of numbers, each relative to the larger of the two, and to a millionth of its column's largest
/// where both are less: the remainder of an energy has no digits of its own.
fn difference(one: &str, other: &str) -> Result<f64> {
    let rows = |text: &str| -> Result<Vec<Vec<f64>>> {
        let row = |line: &str| line.split(',').map(|field| field.parse().context("no number")).collect();
        text.lines().skip(1).map(row).collect()
    };
    let (one, other) = (rows(one)?, rows(other)?);
    let width = one.first().context("a table without rows")?.len();
    let even = |rows: &[Vec<f64>]| rows.len() == one.len() && rows.iter().all(|row| row.len() == width);
    ensure!(even(&one) && even(&other), "tables of {} and {} rows", one.len(), other.len());
    let largest = |j: usize| one.iter().map(|row| row[j].abs()).fold(f64::MIN_POSITIVE, f64::max);
    let of_column = |j: usize| {
        let least = 1e-6 * largest(j);
        let relative = |(a, b): (&Vec<f64>, &Vec<f64>)| (a[j] - b[j]).abs() / a[j].abs().max(b[j].abs()).max(least);
        one.iter().zip(&other).map(relative).fold(0.0, f64::max)
    };
    Ok((0..width).map(of_column).fold(0.0, f64::max))
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
            let [hapt, c] = processes(ROUNDS, [program(&self.programs.join("hapt"), &hapt), c])?;
            let difference = difference(&fs::read_to_string(own)?, &fs::read_to_string(other)?)?;
            ensure!(difference < 1e-9, "the tables differ by {difference:e}");
            let (ratio, quartiles) = hapt.over(&c);
            let goal = goal(ratio, 1.0);
            let (hapt, c) = (hapt.median(), c.median());
            writeln!(text, "| {scenario} | {quartiles} | {goal} | {hapt:.0} | {c:.0} | {difference:.0e} |")?;
        }
        Ok(text)
    }

    /// 100 000 worlds of a second whose hand releases between two samples, each with its own period, from the command to the file.
    pub(super) fn worlds(&self) -> Result<String> {
        let mut text = String::from(
            "\n## Sweeps of worlds that do more\n\n`hapt sweep` of 100 000 worlds of 1 s at about 1 kHz, over 250 stiffnesses (or torques of a detent) \
             and 400 periods: [the worlds](../bench/worlds) let go between two samples, each at another one. Two measures, two threads, \
             the whole process with its file, against [C](../bench/c/worlds.c) written for each, with OpenMP, sixteen worlds side by side \
             (`-O3 -march=native -ffinite-math-only`). The difference is as above, beside numbers below a millionth of their column's largest \
             relative to that.\n\n\
             | world | hapt / C | goal | | hapt, ms | C, ms | difference |\n| --- | --- | --- | --- | --- | --- | --- |\n",
        );
        for (name, world, kind, axis) in WORLDS {
            let [own, other] = ["hapt.csv", "c.csv"].map(|name| self.folder.join(name));
            let (own, other) = (own.to_str().context("a path in UTF-8")?, other.to_str().context("a path in UTF-8")?);
            let [key, from, to, n] = axis.split(' ').collect::<Vec<_>>()[..] else { anyhow::bail!("no axis: {axis}") };
            let [first, last, count] = PERIODS.split(' ').collect::<Vec<_>>()[..] else {
                anyhow::bail!("no axis: {PERIODS}")
            };
            let hapt = format!(
                "sweep bench/worlds/{world}.toml --vary {key}={from}..{to}:{n} --vary loop.period={first}..{last}:{count} \
                 --measure {MEASURES} --threads 2 --out {own}"
            );
            let c = self.folder.join(world);
            let mut c = program(&c, &format!("{from} {to} {n} {PERIODS} {other}"));
            c.env("OMP_NUM_THREADS", "2");
            let [hapt, c] = processes(ROUNDS, [program(&self.programs.join("hapt"), &hapt), c])
                .with_context(|| format!("{world}, of C -DKIND={kind}"))?;
            let difference = difference(&fs::read_to_string(own)?, &fs::read_to_string(other)?)?;
            ensure!(difference < 1e-8, "{world}: the tables differ by {difference:e}");
            let (ratio, quartiles) = hapt.over(&c);
            let wanted = if world == "released" { 1.5 } else { 2.0 };
            let (hapt, c, goal) = (hapt.median(), c.median(), goal(ratio, wanted));
            writeln!(text, "| {name} | {quartiles} | {goal} | {hapt:.0} | {c:.0} | {difference:.0e} |")?;
        }
        Ok(text)
    }

    /// A program in C for each of them.
    pub(super) fn compile_worlds(&self) -> Result<()> {
        let flags = ["-ffinite-math-only", "-fno-trapping-math", "-fopenmp"];
        for (_, world, kind, _) in WORLDS {
            self.compile("worlds", world, &[&flags[..], &[&format!("-DKIND={kind}")]].concat())?;
        }
        Ok(())
    }
}
