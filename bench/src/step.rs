//! One sample of the core, hot: worlds whose every body feels every other one.

use std::fs;

use anyhow::{Context, Result, bail};
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

/// In the rooms of hapt-sim: 1, 2, 4, 8 and 32.
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

/// The same step for C: T, limit, the puck's own gains, the bodies' gains on it, the start, the response to z and ż, the matrix
/// by columns, and the inputs. The matrices follow from the step itself: it is affine, and evaluated at unit vectors.
pub fn matrices(n: usize, file: &str) -> Result<()> {
    let chain = Chain::new(n);
    let compiled = chain.compiled::<32>()?;
    let mut zero = compiled.start();
    (zero.now.position, zero.now.velocity) = ([0.0; 32], [0.0; 32]);
    let change = |state: &_, z, v| -> Vec<f64> {
        let mut state = *state;
        compiled.step(&mut state, z, v);
        state.change.position[..n].iter().chain(&state.change.velocity[..n]).copied().collect()
    };
    let (mut springs, mut dampers) = (vec![0.0; n], vec![0.0; n]);
    for coupling in &chain.couplings {
        match (coupling.first, coupling.second, coupling.law) {
            (End::Puck, End::Body(i), Law::Spring { stiffness, .. }) => springs[i] += stiffness,
            (End::Puck, End::Body(i), Law::Damper { damping: Damping::Fixed(damping) }) => dampers[i] += damping,
            _ => {}
        }
    }
    let mut numbers = vec![PERIOD, LIMIT, -springs.iter().sum::<f64>(), -dampers.iter().sum::<f64>()];
    numbers.extend(springs.iter().chain(&dampers));
    numbers.extend(chain.bodies.iter().map(|body| body.position).chain(chain.bodies.iter().map(|body| body.velocity)));
    numbers.extend(change(&zero, 1.0, 0.0));
    numbers.extend(change(&zero, 0.0, 1.0));
    for j in 0..2 * n {
        let mut state = zero;
        *(if j < n { &mut state.now.position[j] } else { &mut state.now.velocity[j - n] }) = 1.0;
        numbers.extend(change(&state, 0.0, 0.0));
    }
    numbers.extend(chain.inputs.iter().flat_map(|&(z, v)| [z, v]));
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_ne_bytes()).collect();
    fs::write(file, bytes).context("cannot write the matrices")
}
