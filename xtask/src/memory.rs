//! `cargo xtask memory`: the memory of a run of any length while its rows go to CSV.

use std::fs;
use std::io::{self, Write};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use hapt_sim::{CsvWriter, Simulation, Summary};

use crate::notes::world;

/// Takes bytes and counts them.
#[derive(Default)]
struct Counted(u64);

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Streams this many samples of the notes' damped wheel, with their summary; returns the bytes of CSV.
fn stream(samples: u64) -> Result<u64> {
    let mut world = world("damped")?;
    let period = world.sampling.period;
    let scenario = world.scenarios.first_mut().context("a scenario")?;
    scenario.duration = samples.saturating_sub(1) as f64 * period;
    let scenario = scenario.clone();
    let mut run = Simulation::new(&world, &scenario)?;
    ensure!(run.rows() == samples, "{} rows", run.rows());
    let mut summary = Summary::new(&world, &run);
    let mut csv = CsvWriter::new(Counted::default(), &world)?;
    while let Some(row) = run.next() {
        let row = row?;
        summary.add(row);
        csv.write(row)?;
    }
    Ok(csv.finish()?.0)
}

/// The peak memory of this process, in KiB, as Linux counts it.
fn peak() -> Result<u64> {
    let status = fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).context("no VmHWM")?;
    Ok(line.split_whitespace().next().context("no number")?.parse()?)
}

/// Prints the memory for streaming this many samples.
pub fn command(samples: &str) -> Result<()> {
    let samples = samples.parse::<f64>().context("a number of samples")? as u64;
    let start = Instant::now();
    let bytes = stream(samples)?;
    let (seconds, peak) = (start.elapsed().as_secs_f64(), peak()?);
    println!("{samples} samples, {bytes} bytes of CSV, {seconds:.0} s, at most {:.1} MiB", peak as f64 / 1024.0);
    Ok(())
}

/// Ten times the samples take no more than a megabyte more, which is noise.
pub fn is_bounded() -> Result<()> {
    if !cfg!(target_os = "linux") {
        println!("        (looked at on Linux only)");
        return Ok(());
    }
    // Each in a process of its own: this one's memory has other contents too.
    let of = |samples: &str| -> Result<f64> {
        let output = Command::new(std::env::current_exe()?).args(["memory", samples]).output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let most =
            text.split_once("at most ").and_then(|(_, rest)| rest.split_whitespace().next()).context("no peak")?;
        Ok(most.parse()?)
    };
    let (short, long) = (of("1e5")?, of("1e6")?);
    ensure!(long - short <= 1.0, "{short} MiB with 1e5 samples, {long} MiB with 1e6");
    Ok(())
}
