//! `hapt check` as a process.

use std::fmt::Write;
use std::fs;

use anyhow::Result;

use super::sweep::{ROUNDS, processes};
use super::{Bench, STARTS, Times, goal, program};

/// The world file of a chain of bodies behind the puck: the loop and device, the inertia of each body and the stiffness of the spring before
/// it, and the damping in parallel with each spring.
fn chain(head: &str, bodies: usize, of_body: impl Fn(f64) -> (f64, f64), damping: f64) -> String {
    let mut file = head.to_string();
    for i in 0..bodies {
        file += &format!("[bodies.b{i}]\ninertia = {:?}\n", of_body(i as f64).0);
    }
    for i in 0..bodies {
        let before = if i == 0 { "puck".into() } else { format!("b{}", i - 1) };
        let between = format!("[[couplings]]\nbetween = [\"{before}\", \"b{i}\"]\n");
        file += &format!("{between}kind = \"spring\"\nstiffness = {:?}\n", of_body(i as f64).1);
        if damping > 0.0 {
            file += &format!("{between}kind = \"damper\"\ndamping = {damping:?}\n");
        }
    }
    file
}

/// A chain with springs and no dampers.
fn undamped(bodies: usize) -> String {
    let head = "loop.period = \"1 ms\"\ndevice = { inertia = 6.4e-4, damping = 1.2e-3 }\n";
    chain(head, bodies, |i| (0.01 + 0.001 * i, 1.0 + i), 0.0)
}

/// A chain whose file states intervals, delays and a tolerance, and which is certified.
pub(super) fn stated(bodies: usize) -> String {
    let head = "loop = { period = \"1 ms\", method = \"trapezoidal\", interval_max = \"1.4 ms\", delay = \"0.3 ms\", delay_max = \"0.6 ms\" }\n\
                device = { inertia = 1e-3, damping = \"0.3 N m s/rad ± 20 %\" }\n";
    chain(head, bodies, |i| (0.01 / (1.0 + i), 2.0 * (1.0 + i)), 0.002)
}

/// A damped chain, and a torque that comes a fraction of a sample late.
fn delayed(bodies: usize) -> String {
    let head = "loop = { period = \"1 ms\", delay = \"0.3 ms\" }\ndevice = { inertia = 6.4e-4, damping = 4e-2 }\n";
    chain(head, bodies, |i| (1e-3 + 1e-4 * i, 2.0 + 0.1 * i), 1e-3)
}

impl Bench {
    /// Whole processes of `hapt check`.
    pub(super) fn checks(&self) -> Result<String> {
        let check = |words: &str| program(&self.programs.join("hapt"), &format!("check {words}"));
        let measure = |name: &str, text: String, words: &str, rounds: usize| -> Result<Times> {
            let path = self.folder.join(format!("{name}.toml"));
            fs::write(&path, text)?;
            let [times] = processes(rounds, [check(&format!("{} {words}", path.display()))])?;
            Ok(times)
        };
        let [one] = processes(STARTS, [check("worlds/notes/default.toml")])?;
        let [one_late] = processes(ROUNDS, [check("bench/worlds/delayed.toml")])?;
        let mut text = String::from(
            "\n## One check\n\nThe whole process of `hapt check`; 8 and 32 bodies are a chain of springs, damped with a delay or times.\n\n\
             | | ms | goal | |\n| --- | --- | --- | --- |\n",
        );
        let without = "--no-remedies";
        for (name, times, wanted) in [
            ("1 body, with remedies", one, 10.0),
            ("1 body with a delay, with remedies", one_late, 20.0),
            ("1 body with times and a tolerance, with remedies", measure("stated1", stated(1), "", ROUNDS)?, 20.0),
            ("8 bodies with times and a tolerance, with remedies", measure("stated8", stated(8), "", ROUNDS)?, 300.0),
            ("8 damped bodies with a delay, with remedies", measure("delayed8", delayed(8), "", ROUNDS)?, 300.0),
            ("8 bodies, with remedies", measure("chain8", undamped(8), "", ROUNDS)?, 300.0),
            ("32 bodies, without", measure("chain32", undamped(32), without, ROUNDS)?, 60.0),
            ("32 damped bodies with a delay, without", measure("delayed32", delayed(32), without, 3)?, 60.0),
            ("32 bodies, with remedies", measure("chain32", undamped(32), "", 3)?, 5000.0),
        ] {
            let ms = times.median();
            writeln!(text, "| {name} | {ms:.1} | {} |", goal(ms, wanted))?;
        }
        Ok(text)
    }
}
