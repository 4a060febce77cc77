//! Certificates: of many worlds in memory, and `hapt check` as a process.

use std::fmt::Write;
use std::fs;

use anyhow::{Context, Result};

use super::sweep::{ROUNDS, processes};
use super::{Bench, STARTS, Times, goal, in_turns, program};

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

/// The world file of a chain of `n` bodies on springs.
fn chain(n: u32) -> String {
    let mut file = String::from("loop.period = \"1 ms\"\ndevice = { inertia = 6.4e-4, damping = 1.2e-3 }\n");
    for i in 0..n {
        file += &format!("[bodies.b{i}]\ninertia = {}\n", 0.01 + 0.001 * f64::from(i));
    }
    for i in 0..n {
        let before = if i == 0 { "puck".into() } else { format!("b{}", i - 1) };
        file +=
            &format!("[[couplings]]\nkind = \"spring\"\nbetween = [\"{before}\", \"b{i}\"]\nstiffness = {}\n", 1 + i);
    }
    file
}

impl Bench {
    /// A million worlds of one body with a delay, by the functions of `hapt sweep`, on one core.
    pub(super) fn certificates(&self) -> Result<String> {
        let mut text = String::from(
            "\n## Certificates over a grid\n\n10⁶ worlds of [one body with a delay](../bench/worlds/delayed.toml) over stiffness and delay, by the \
             functions that `hapt sweep` calls, on one core; and the whole process with its file, on two threads. Worlds that differ by their delay share what does \
             not depend on it. A required damping agrees to 1e-10 with that of the search by intervals, a verdict always.\n\n\
             | | s | goal | |\n| --- | --- | --- | --- |\n",
        );
        for (measure, wanted) in [("certified", 10.0), ("required_damping", 10.0), ("free_growth_per_s", 10.0)] {
            // Of a hundredth of them, each of a hundred stiffnesses with a hundred delays.
            let [times] = in_turns([self.rust(&format!("certificates bench/worlds/delayed.toml {measure} 100 3"))])?;
            let seconds = times.median() * 1e-3;
            writeln!(text, "| `{measure}` | {seconds:.1} | {} |", goal(seconds, wanted))?;
        }
        let file = self.folder.join("certified.csv");
        let sweep = format!(
            "sweep bench/worlds/delayed.toml --vary couplings.0.stiffness=0.1..3:1000 --vary loop.delay=0.05ms..2.5ms:1000 \
             --measure certified --threads 2 --out {}",
            file.to_str().context("a path in UTF-8")?
        );
        let [whole] = processes(3, [program(&self.programs.join("hapt"), &sweep)])?;
        let seconds = whole.median() * 1e-3;
        writeln!(
            text,
            "| `hapt sweep --measure certified` with its file, two threads | {seconds:.1} | {} |",
            goal(seconds, 5.0)
        )?;
        Ok(text)
    }

    /// Whole processes of `hapt check`.
    pub(super) fn checks(&self) -> Result<String> {
        let undamped = |n: u32| -> Result<String> {
            let path = self.folder.join(format!("chain{n}.toml"));
            fs::write(&path, chain(n))?;
            Ok(path.to_str().context("a path in UTF-8")?.to_owned())
        };
        let (eight, many) = (undamped(8)?, undamped(32)?);
        let check = |words: &str| program(&self.programs.join("hapt"), &format!("check {words}"));
        let [one] = processes(STARTS, [check("worlds/notes/default.toml")])?;
        let [eight] = processes(ROUNDS, [check(&eight)])?;
        let [quick] = processes(ROUNDS, [check(&format!("{many} --no-remedies"))])?;
        let [all] = processes(3, [check(&many)])?;
        let of_stated = |n: usize| -> Result<Times> {
            let path = self.folder.join(format!("stated{n}.toml"));
            fs::write(&path, stated(n))?;
            let [times] = processes(ROUNDS, [check(path.to_str().context("a path in UTF-8")?)])?;
            Ok(times)
        };
        let (one_stated, eight_stated) = (of_stated(1)?, of_stated(8)?);
        let delayed = |world: &str| processes(ROUNDS, [check(&format!("bench/worlds/{world}.toml"))]);
        let ([one_late], [eight_late]) = (delayed("delayed")?, delayed("chain8")?);
        let [chain_late] = processes(3, [check("bench/worlds/chain32.toml --no-remedies")])?;
        let mut text = String::from(
            "\n## One check\n\nThe whole process of `hapt check`; 8 and 32 bodies are a chain of springs, those with a delay are [in bench/worlds](../bench/worlds).\n\n\
             | | ms | goal | |\n| --- | --- | --- | --- |\n",
        );
        for (name, times, wanted) in [
            ("1 body, with remedies", one, 10.0),
            ("1 body with a delay, with remedies", one_late, 20.0),
            ("1 body with times and a tolerance, with remedies", one_stated, 20.0),
            ("8 bodies with times and a tolerance, with remedies", eight_stated, 300.0),
            ("8 damped bodies with a delay, with remedies", eight_late, 300.0),
            ("8 bodies, with remedies", eight, 300.0),
            ("32 bodies, without", quick, 60.0),
            ("32 damped bodies with a delay, without", chain_late, 60.0),
            ("32 bodies, with remedies", all, 5000.0),
        ] {
            let ms = times.median();
            writeln!(text, "| {name} | {ms:.1} | {} |", goal(ms, wanted))?;
        }
        Ok(text)
    }

    pub(super) fn edges(&self) -> Result<String> {
        let [hapt] = in_turns([self.rust("boundary worlds/devices/eth-wall.toml 200")])?;
        let us = hapt.median() * 1e-3;
        Ok(format!(
            "\n## An edge of stability\n\nThe curve on which an eigenvalue of the ETH wheel with its wall is on the unit circle, in the \
             plane of the wall's stiffness and damping: from the world to 2000 points in memory, `Decomposition::free`. Which of \
             them are the edge takes two verdicts a point more, and is not timed.\n\n\
             | | µs | goal | |\n| --- | --- | --- | --- |\n| 2000 points | {us:.0} | {} |\n",
            goal(us, 100.0)
        ))
    }
}
