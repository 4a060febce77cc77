//! The notes' wheel for 10 s at 1 kHz, recorded in memory.

use anyhow::{Context, Result, bail};
use hapt_model::{Law, Source, World};
use hapt_sim::{Row, Simulation};

use crate::timed;

/// The wheel stepped and held, or released after a quarter of a second.
pub fn world(scenario: &str) -> Result<World> {
    let release = "scenarios.step.hand.release=0.25 s".to_owned();
    let overrides = match scenario {
        "held" => vec![],
        "released" => vec![release],
        _ => bail!("held or released?"),
    };
    Ok(World::read(&Source::open("worlds/notes/default.toml")?, &overrides)?)
}

/// The columns of the CSV, and the device's works.
fn numbers(row: &Row) -> [f64; 14] {
    let (wheel, wheel_velocity) = row.bodies.first().copied().unwrap_or_default();
    let works = row.ledger;
    [
        row.time,
        row.puck,
        row.puck_velocity,
        row.measured,
        row.measured_velocity,
        row.torque,
        row.command,
        row.applied,
        wheel,
        wheel_velocity,
        works.hand,
        works.motor,
        works.damping,
        works.friction,
    ]
}

pub fn time(scenario: &str, everything: bool, repeats: usize) -> Result<()> {
    if everything { time_columns::<14>(scenario, repeats) } else { time_columns::<10>(scenario, repeats) }
}

fn time_columns<const N: usize>(scenario: &str, repeats: usize) -> Result<()> {
    let world = world(scenario)?;
    let scenario = world.scenario("step")?;
    let samples = hapt_sim::rows(scenario.duration, world.sampling.period) as usize;
    let mut columns = [(); N].map(|()| vec![0.0; samples]);
    timed(repeats, samples, || {
        let mut run = Simulation::new(&world, scenario)?;
        // All of one length, so that one check of bounds is enough.
        let mut columns = columns.each_mut().map(|column| &mut column[..samples]);
        let mut k = 0;
        while let Some(row) = run.next() {
            for (column, x) in columns.iter_mut().zip(numbers(row?)) {
                column[k] = x;
            }
            k += 1;
        }
        Ok(())
    })?;
    for column in &columns {
        println!("{:e} {:e}", column.iter().map(|x| x.abs()).sum::<f64>(), column.last().context("no rows")?);
    }
    Ok(())
}

/// The world's numbers for the other programs: T, samples, J_z, b, limit, J_w, k, z0, the sample of the release.
pub fn parameters(scenario: &str) -> Result<()> {
    let world = world(scenario)?;
    let step = world.scenario("step")?;
    let period = world.sampling.period;
    let samples = hapt_sim::rows(step.duration, period);
    let release = step.hand.release.map_or(samples, |t| (t / period).round() as u64);
    let (Some(body), Some(Law::Spring { stiffness, .. })) =
        (world.bodies.first(), world.couplings.first().map(|c| c.law))
    else {
        bail!("expected a wheel on a spring");
    };
    let hapt_model::Drive::Position(hapt_model::Shape::Step { to, .. }) = step.hand.drive else {
        bail!("expected a step");
    };
    let limit = world.device.limit.context("expected a limit")?;
    let device = &world.device;
    println!(
        "{period} {samples} {} {} {limit} {} {stiffness} {to} {release}",
        device.inertia, device.damping, body.inertia
    );
    Ok(())
}
