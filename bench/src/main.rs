//! One workload, timed: `ns` of one sample (or number), and the answer, a number a line. `cargo xtask bench` starts these in
//! turns with the programs of `bench/c`, which print the same.

mod guarded;
mod lanes;
mod realtime;
mod run;
mod step;

use std::time::Instant;

use anyhow::{Context, Result, bail};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["run", scenario, columns, repeats] => run::time(scenario, columns == "everything", repeats.parse()?),
        ["parameters", scenario] => run::parameters(scenario),
        ["step", bodies, repeats] => step::time(bodies.parse()?, repeats.parse()?),
        ["bare", numbers, repeats] => guarded::time(numbers, false, repeats.parse()?),
        ["guarded", numbers, repeats] => guarded::time(numbers, true, repeats.parse()?),
        ["lanes", file, repeats] => lanes::time(file, repeats.parse()?),
        ["realtime", samples, period, spin] => realtime::time(samples.parse()?, period.parse()?, spin.parse()?),
        _ => bail!("see xtask/src/bench.rs"),
    }
}

/// Does `work` `repeats` times and prints the median time of one of its `parts`, in ns.
fn timed(repeats: usize, parts: usize, mut work: impl FnMut() -> Result<()>) -> Result<()> {
    let mut times = Vec::new();
    for _ in 0..repeats {
        let start = Instant::now();
        work()?;
        times.push(start.elapsed().as_secs_f64() * 1e9 / parts as f64);
    }
    times.sort_by(f64::total_cmp);
    println!("ns {}", times.get(times.len() / 2).context("no repeats")?);
    Ok(())
}
