//! Certificates of one world over a grid of stiffness and delay, of one body behind a spring: `certified`, `required_damping` and
//! `free_growth_per_s`, each world by the function that `hapt sweep` calls; and the whole check of one world.

use std::path::Path;

use anyhow::{Context, Result, bail};
use hapt_analysis::{check, free_growth, is_certified, remedies, required_damping};
use hapt_model::{Delay, Law, Source, World};

use crate::timed;

/// Stiffnesses, as factors on the file's, and as many delays, in periods.
const FACTORS: [f64; 2] = [0.1, 3.0];
const DELAYS: [f64; 2] = [0.05, 2.5];

/// ns of a world of `side`² and, as the answer, how many are certified or the sum of the numbers.
pub fn time(file: &str, measure: &str, side: usize, repeats: usize) -> Result<()> {
    let world = World::read(&Source::open(Path::new(file))?, &[])?;
    let ask: fn(&World) -> Option<f64> = match measure {
        "certified" => |world| Some(f64::from(u8::from(is_certified(world)))),
        "required_damping" => |world| required_damping(world).ok().flatten(),
        "free_growth_per_s" => |world| free_growth(world).ok().flatten(),
        _ => bail!("see xtask/src/bench/certificates.rs"),
    };
    let mut law = world.couplings.first().context("a coupling")?.law;
    let stiffness = *law.strength().context("a spring")?.value;
    let at = |[from, to]: [f64; 2], i: usize| from + (to - from) * i as f64 / (side - 1) as f64;
    let mut sum = 0.0;
    timed(repeats, side * side, || {
        sum = 0.0;
        for row in 0..side {
            for column in 0..side {
                let mut world = world.clone();
                world.couplings[0].law = Law::Spring { stiffness: stiffness * at(FACTORS, row), rest: 0.0 };
                world.sampling.delay = Delay::Samples(at(DELAYS, column));
                sum += ask(&world).unwrap_or(0.0);
            }
        }
        Ok(())
    })?;
    println!("{sum:?}");
    Ok(())
}

/// ns of a check of a world, and its verdict, 1 or 0, as the answer.
pub fn check_of(file: &str, with_remedies: bool, repeats: usize) -> Result<()> {
    let world = World::read(&Source::open(Path::new(file))?, &[])?;
    let mut certified = false;
    timed(repeats, 1, || {
        certified = check(&world)?.certified.holds();
        if with_remedies {
            std::hint::black_box(remedies(&world)?);
        }
        Ok(())
    })?;
    println!("{}", u8::from(certified));
    Ok(())
}
