//! A million loops of one body under forward Euler: how fast each grows, the puck held.

use anyhow::{Context, Result};
use hapt_analysis::{closed_form::forward_euler_growth, held_growth};
use hapt_model::{Body, Coupling, End, Law, Method};

use crate::timed;

const PERIOD: f64 = 1e-3;
/// Values of stiffness, and of inertia: those of `bench/python/loops.py`.
const SIDE: usize = 1000;

/// The largest relative error against ln(1 + x²)/(2T) is the answer.
pub fn time(repeats: usize) -> Result<()> {
    let at = |from: f64, to: f64, i: usize| from + (to - from) * i as f64 / (SIDE - 1) as f64;
    let worlds = || (0..SIDE * SIDE).map(|cell| (at(0.5, 2.0, cell / SIDE), at(0.01, 0.05, cell % SIDE)));
    let mut growths = vec![0.0; SIDE * SIDE];
    timed(repeats, growths.len(), || {
        for (growth, (stiffness, inertia)) in growths.iter_mut().zip(worlds()) {
            let bodies = [Body { inertia, position: 0.0, velocity: 0.0 }];
            let law = Law::Spring { stiffness, rest: 0.0 };
            let couplings = [Coupling { first: End::Puck, second: End::Body(0), law }];
            *growth = held_growth(&bodies, &couplings, Method::ForwardEuler, PERIOD)?.context("no growth")?;
        }
        Ok(())
    })?;
    let error = |(growth, (stiffness, inertia)): (&f64, (f64, f64))| {
        let exact = forward_euler_growth((stiffness / inertia).sqrt(), PERIOD);
        ((growth - exact) / exact).abs()
    };
    println!("{:e}", growths.iter().zip(worlds()).map(error).fold(0.0, f64::max));
    Ok(())
}
