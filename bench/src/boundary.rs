//! The edge of stability of a wall in the plane of its stiffness and damping, by its equation.

use std::f64::consts::PI;
use std::path::Path;

use anyhow::{Context, Result};
use hapt_analysis::Decomposition;
use hapt_analysis::Keys;
use hapt_model::{Source, World};

use crate::timed;

const POINTS: u32 = 2000;

/// As users run it: from the world to the curve's points.
pub fn time(file: &str, repeats: usize) -> Result<()> {
    let world = World::read(&Source::open(Path::new(file))?, &[])?;
    let paths = ["couplings.0.stiffness", "couplings.0.damping"];
    let keys = Keys { paths, ranges: [[0.0, 100.0], [0.0, 0.5]] };
    let mut sum = [0.0; 2];
    timed(repeats, 1, || {
        let equations = Decomposition::free(&world, keys)?.context("these keys have no equation")?;
        let equation = equations.first().context("the wall is slack")?;
        let angles = (1..=POINTS).map(|i| PI * f64::from(i) / f64::from(POINTS + 1));
        let points: Vec<[f64; 2]> = angles.filter_map(|phi| equation.at(phi)).collect();
        sum = points.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        Ok(())
    })?;
    println!("{:e} {:e}", sum[0], sum[1]);
    Ok(())
}
