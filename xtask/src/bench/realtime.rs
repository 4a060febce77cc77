//! The loop in real time and a bare C loop with the same calls of the clock, in turns on the same core.

use std::fmt::Write;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::Bench;
use crate::random::quantile;

/// The number of rounds; then the samples of each, and their period in ns.
const ROUNDS: usize = 15;
const SAMPLES: u64 = 2000;
const PERIOD: u64 = 1_000_000;
/// How long the spinning loops poll the clock, in ns.
const SPIN: u64 = 200_000;

/// p50, p90, p99, p99.9 and the largest latency of each round, in ns.
struct Latencies(Vec<[f64; 5]>);

impl Latencies {
    /// The median of the rounds, in us.
    fn us(&self, i: usize) -> f64 {
        quantile(self.0.iter().map(|round| round[i]), 0.5) * 1e-3
    }

    /// The difference to the other's: the median of the rounds' differences, in us.
    fn more_than(&self, other: &Latencies, i: usize) -> f64 {
        quantile(self.0.iter().zip(&other.0).map(|(a, b)| a[i] - b[i]), 0.5) * 1e-3
    }
}

impl Bench {
    pub(super) fn realtime(&self) -> Result<String> {
        self.compile("realtime", "realtime", &[])?;
        let mut text = format!(
            "\n## In real time\n\nHow late the loop is at its samples: hapt's, on the simulated device, and a [bare loop in C](../bench/c/realtime.c) with \
             the same calls of the clock and nothing to compute, at 1 kHz, in turns on the same core, {ROUNDS} rounds of 2 s each; medians of \
             the rounds. \"Spinning\" watches the clock for the last 200 us. The goals are for the median (sleeping, hapt beyond C) and for \
             p50 and p90 (spinning, hapt itself).\n\n"
        );
        if Command::new("taskset").arg("--version").output().is_err() {
            return Ok(text + "Skipped: there is no taskset to put both on one core.\n");
        }
        let core = (std::thread::available_parallelism()?.get() - 1).to_string();
        let (sleeping, spinning) = (self.latencies(&core, 0)?, self.latencies(&core, SPIN)?);
        text += "| µs | p50 | p90 | p99 | p99.9 | largest |\n| --- | --- | --- | --- | --- | --- |\n";
        for (name, [hapt, c]) in [("sleeping", &sleeping), ("spinning", &spinning)] {
            for (who, of) in [("hapt", hapt), ("C", c)] {
                let numbers: Vec<String> = (0..5).map(|i| format!("{:.2}", of.us(i))).collect();
                writeln!(text, "| {name}, {who} | {} |", numbers.join(" | "))?;
            }
        }
        let more = sleeping[0].more_than(&sleeping[1], 0);
        let (half, most) = (spinning[0].us(0), spinning[0].us(1));
        let met = |is: bool| if is { "met" } else { "**missed**" };
        writeln!(
            text,
            "\n| | µs | goal | |\n| --- | --- | --- | --- |\n| sleeping, hapt beyond C at p50 | {more:.2} | 2 | {} |\n\
             | spinning, p50 | {half:.2} | 1 | {} |\n| spinning, p90 | {most:.2} | 1 | {} |",
            met(more <= 2.0),
            met(half < 1.0),
            met(most < 1.0)
        )?;
        Ok(text)
    }

    /// hapt and C in turns, pinned to `core`.
    fn latencies(&self, core: &str, spin: u64) -> Result<[Latencies; 2]> {
        let mut all = [Latencies(Vec::new()), Latencies(Vec::new())];
        let words = format!("{SAMPLES} {PERIOD} {spin}");
        for _ in 0..ROUNDS {
            let programs = [self.rust(&format!("realtime {words}")), self.c("realtime", &words)];
            let mut classes = Vec::new();
            for (program, latencies) in programs.into_iter().zip(&mut all) {
                let mut pinned = Command::new("taskset");
                pinned.args(["-c", core]).arg(program.get_program()).args(program.get_args());
                let printed = super::output(&mut pinned)?;
                let numbers: Vec<f64> = printed.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
                let (class, rest) = numbers.split_first().context("no numbers")?;
                classes.push(*class);
                latencies.0.push(rest.try_into().context("expected five quantiles")?);
            }
            ensure!(classes[0] == classes[1], "one runs under SCHED_FIFO, and the other does not");
        }
        Ok(all)
    }
}
