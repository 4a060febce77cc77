//! One sample of the core with warm caches: worlds in which every body is coupled to every other one.

use anyhow::{Result, bail};
use hapt_core::{Body, Coupling, Damping, End, Estimator, Law, Loop, Method, Output, Spec};

use crate::timed;

const PERIOD: f64 = 1e-3;
const LIMIT: f64 = 50.0;
const SAMPLES: usize = 4096;

/// n bodies of random inertia in a chain of springs, each tied to the puck as well, by springs and dampers in turns. The exact
/// hold makes every matrix full.
struct Chain {
    bodies: Vec<Body>,
    couplings: Vec<Coupling>,
    /// z_k and ż_k, a random walk.
    inputs: Vec<(f64, f64)>,
}

impl Chain {
    fn new(n: usize) -> Self {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        // Knuth's linear congruential generator; its upper bits, on [0, 1).
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let bodies =
            (0..n).map(|_| Body { inertia: 0.01 + 0.02 * random(), position: random(), velocity: 0.0 }).collect();
        let mut couplings = Vec::new();
        for i in 0..n {
            let own = match i % 2 {
                0 => Law::Spring { stiffness: 1.0 + random(), rest: 0.0 },
                _ => Law::Damper { damping: Damping::Fixed(0.01 + 0.01 * random()) },
            };
            couplings.push(Coupling { first: End::Puck, second: End::Body(i), law: own, limit: None });
            if i > 0 {
                let law = Law::Spring { stiffness: 100.0 + 100.0 * random(), rest: 0.0 };
                couplings.push(Coupling { first: End::Body(i - 1), second: End::Body(i), law, limit: None });
            }
        }
        let mut z = 0.0;
        let walk = |_| {
            let velocity = 2.0 * random() - 1.0;
            z += PERIOD * velocity;
            (z, velocity)
        };
        let inputs = (0..SAMPLES).map(walk).collect();
        Chain { bodies, couplings, inputs }
    }

    fn compiled<const B: usize>(&self) -> Result<Loop<f64, B, 64, 257>> {
        let (bodies, couplings) = (&self.bodies[..], &self.couplings[..]);
        let (limit, estimator) = (Some(LIMIT), Estimator::Exact);
        let (method, output) = (Method::Zoh, Output::End);
        let spec = Spec { method, output, estimator, limit, bodies, couplings, ..Spec::new(PERIOD) };
        Ok(Loop::new(&spec)?)
    }
}

/// In the capacities of hapt-sim: 1, 2, 4, 8 and 32.
pub fn time(n: usize, repeats: usize) -> Result<()> {
    match n {
        1 => time_in::<1>(n, repeats),
        2 => time_in::<2>(n, repeats),
        3..=4 => time_in::<4>(n, repeats),
        5..=8 => time_in::<8>(n, repeats),
        9..=32 => time_in::<32>(n, repeats),
        _ => bail!("1 to 32 bodies"),
    }
}

fn time_in<const B: usize>(n: usize, repeats: usize) -> Result<()> {
    let chain = Chain::new(n);
    let compiled = chain.compiled::<B>()?;
    let mut state = compiled.start();
    let mut sum = 0.0;
    timed(repeats, SAMPLES, || {
        (state, sum) = (compiled.start(), 0.0);
        for &(z, v) in &chain.inputs {
            sum += compiled.step(&mut state, z, v).command;
        }
        Ok(())
    })?;
    println!("{sum:e}");
    for i in 0..n {
        println!("{:e} {:e}", state.now.position[i], state.now.velocity[i]);
    }
    Ok(())
}
