//! Sixteen worlds side by side, each with its own period, in a process of their own: without a grid, threads and a file around them.

use anyhow::{Context, Result};
use hapt_model::{Source, World};
use hapt_sim::{LANES, rows, run_batch};

use crate::timed;

/// Their periods, in s: neighbours in the sweeps of `cargo xtask bench`.
fn worlds(file: &str) -> Result<[World; LANES]> {
    let source = Source::open(file)?;
    let world = |i: usize| Ok(World::read(&source, &[format!("loop.period={}", 1e-3 + 5e-7 * i as f64)])?);
    let worlds: Vec<World> = (0..LANES).map(world).collect::<Result<_>>()?;
    worlds.try_into().ok().context("as many as lanes")
}

pub fn time(file: &str, repeats: usize) -> Result<()> {
    let worlds = worlds(file)?;
    let samples = worlds.iter().map(|world| rows(world.scenarios[0].duration, world.sampling.period) as usize).sum();
    let mut outcomes = [None; LANES];
    timed(repeats, samples, || {
        outcomes = run_batch(&worlds.each_ref(), 0, &|| false).context("these do not run as a batch")?;
        Ok(())
    })?;
    for outcome in outcomes {
        let outcome = outcome.context("a run stops being finite")?;
        println!("{:e} {:e}", outcome.peak_torque, outcome.final_energy);
    }
    Ok(())
}
