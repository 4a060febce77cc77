//! The intervals of a loop on this machine, with and without busy programs, as a part of the page about time.

use std::fmt::Write;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result};
use serde_json::Value;

use super::{Bench, output};

/// The duration of each measurement.
const DURATION: &str = "20s";

/// The conditions of a measurement: their name, the words after `hapt latency`, and whether every core has two busy programs.
const CONDITIONS: [(&str, &[&str], bool); 4] = [
    ("alone", &[], false),
    ("busy", &[], true),
    ("busy, spinning", &["--spin", "200us"], true),
    ("busy, ordinary priority", &["--priority", "0"], true),
];

/// Programs that never pause, until they are dropped.
struct Busy(Vec<Child>);

impl Busy {
    fn new() -> Result<Busy> {
        let mut busy = Busy(Vec::new());
        for _ in 0..2 * std::thread::available_parallelism()?.get() {
            busy.0.push(Command::new("sh").args(["-c", "while :; do :; done"]).stdin(Stdio::null()).spawn()?);
        }
        Ok(busy)
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // An error means that it has ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

impl Bench {
    pub(super) fn intervals(&self) -> Result<String> {
        let hapt = self.programs.join("hapt");
        let mut measured = Vec::new();
        for (_, words, busy) in CONDITIONS {
            let load = busy.then(Busy::new).transpose()?;
            let mut command = Command::new(&hapt);
            let json = output(command.args(["latency", "--json", "--duration", DURATION]).args(words))?;
            drop(load);
            measured.push(serde_json::from_str::<Value>(&json)?);
        }
        let names: Vec<&str> = CONDITIONS.iter().map(|(name, ..)| *name).collect();
        let mut text = format!("| | {} |\n| ---{} |\n", names.join(" | "), " | ---".repeat(names.len()));
        let mut row = |name: &str, cell: &dyn Fn(&Value) -> Result<String>| -> Result<()> {
            let cells: Vec<String> = measured.iter().map(cell).collect::<Result<_>>()?;
            Ok(writeln!(text, "| {name} | {} |", cells.join(" | "))?)
        };
        let number = |value: &Value| value.as_f64().context("hapt latency prints other fields");
        let ms = |value: &Value| Ok(format!("{:.3}", 1e-3 * number(value)?));
        row("scheduling", &|v| {
            Ok(v["realtime"]["priority"].as_u64().map_or("ordinary".into(), |n| format!("SCHED_FIFO {n}")))
        })?;
        for (name, quantile) in
            [("half are at most", "p50"), ("99 % are at most", "p99"), ("99.9 % are at most", "p999")]
        {
            row(&format!("{name}, ms"), &|v| ms(&v["period_us"][quantile]))?;
        }
        row("**longest, ms**", &|v| ms(&v["longest_gap_us"]))?;
        row("samples, missed", &|v| Ok(format!("{}, {}", v["samples"], v["missed"])))?;
        row("taken away by the hypervisor, s", &|v| Ok(format!("{:.2}", number(&v["stolen_s"]).unwrap_or(0.0))))?;
        Ok(text)
    }
}
