//! Random worlds.
#![allow(dead_code)]

use hapt_model::{Body, Coupling, Damping, Device, End, EstimatorKind, Law, Method, Output, Sampling, World};
use proptest::prelude::*;

/// Bodies and couplings.
#[derive(Clone, Debug)]
pub struct Bench {
    pub bodies: Vec<Body>,
    pub couplings: Vec<Coupling>,
}

impl Bench {
    /// Couplings without bodies.
    pub fn of(couplings: Vec<Coupling>) -> Self {
        Bench { bodies: vec![], couplings }
    }

    /// A loop on the notes' device, the velocity differenced; the output is "start" with the methods that take no other.
    pub fn world(&self, method: Method, output: Output, period: f64) -> World {
        let output = if method.takes_new_sample_first() { Output::Start } else { output };
        let sampling = Sampling { method, output, estimator: EstimatorKind::Difference, ..Sampling::new(period) };
        World {
            names: (0..self.bodies.len()).map(|i| format!("body{i}")).collect(),
            bodies: self.bodies.clone(),
            couplings: self.couplings.clone(),
            ..World::new(sampling, Device { damping: 1.2e-3, ..Device::new(6.4e-4) })
        }
    }
}

/// Which dampers a random world has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dampers {
    None,
    Fixed,
    /// One of T k in parallel with every spring.
    Matched,
    /// Fixed ones and some of T k.
    Mixed,
}

pub fn spring(first: End, second: End, stiffness: f64) -> Coupling {
    Coupling { first, second, law: Law::Spring { stiffness, rest: 0.0 }, limit: None }
}

pub fn damper(first: End, second: End, damping: f64) -> Coupling {
    Coupling { first, second, law: Law::Damper { damping: Damping::Fixed(damping) }, limit: None }
}

pub fn compensator(first: End, second: End) -> Coupling {
    Coupling { first, second, law: Law::Damper { damping: Damping::Compensating }, limit: None }
}

pub fn body(inertia: f64) -> Body {
    Body { inertia, position: 0.0, velocity: 0.0 }
}

/// One body of frequency ω and damping ratio ζ on the puck.
pub fn oscillator(omega: f64, zeta: f64) -> Bench {
    let ends = (End::Body(0), End::Puck);
    let mut couplings = vec![spring(ends.0, ends.1, omega * omega)];
    if zeta > 0.0 {
        couplings.push(damper(ends.0, ends.1, 2.0 * zeta * omega));
    }
    Bench { bodies: vec![body(1.0)], couplings }
}

/// A chain of equal bodies from the puck.
pub fn chain(n: usize, inertia: f64, stiffness: f64) -> Bench {
    let end = |i: usize| if i == 0 { End::Puck } else { End::Body(i - 1) };
    Bench { bodies: vec![body(inertia); n], couplings: (0..n).map(|i| spring(end(i), end(i + 1), stiffness)).collect() }
}

fn log_uniform(decades: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    decades.prop_map(|d| 10f64.powf(d))
}

/// 1 to 6 bodies, each tied to an earlier one, the puck or ground, or (`free`) maybe to nothing, and some further springs;
/// inertias and stiffnesses over six decades.
pub fn worlds(dampers: Dampers, free: bool) -> impl Strategy<Value = Bench> {
    let one = (log_uniform(-5.0..1.0), 0..8usize, log_uniform(-2.0..4.0), log_uniform(-7.0..1.0), 0..4u8, 0..4u8);
    (prop::collection::vec(one, 1..6), prop::collection::vec((0..6usize, 0..8usize, log_uniform(-2.0..4.0)), 0..3))
        .prop_map(move |(each, further)| {
            let n = each.len();
            let mut couplings = Vec::new();
            let end = |i: usize, pick: usize| match pick {
                // A compensating damper to ground counts all springs at its body: too much together with another one.
                0 if dampers != Dampers::Matched => End::Ground,
                0 => End::Puck,
                1 => End::Puck,
                _ if i == 0 => End::Puck,
                _ => End::Body((pick - 2) % i),
            };
            for (i, &(_, pick, k, b, damped, loose)) in each.iter().enumerate() {
                let (here, there) = (End::Body(i), end(i, pick));
                if !(free && loose == 0) {
                    couplings.push(spring(here, there, k));
                    if dampers == Dampers::Matched || (dampers == Dampers::Mixed && damped % 2 == 0) {
                        couplings.push(compensator(there, here));
                    }
                }
                if dampers == Dampers::Fixed || (dampers == Dampers::Mixed && damped < 2) {
                    couplings.push(damper(here, there, b));
                }
            }
            for &(i, pick, k) in &further {
                let (here, there) = (End::Body(i % n), end(i % n, pick));
                if couplings.iter().any(|c| [c.first, c.second] == [here, there]) {
                    continue;
                }
                couplings.push(spring(here, there, k));
                if dampers == Dampers::Matched {
                    couplings.push(compensator(here, there));
                }
            }
            Bench { bodies: each.iter().map(|e| body(e.0)).collect(), couplings }
        })
}

/// The fastest ω of a world, from above (Gershgorin).
pub fn fastest(bench: &Bench) -> f64 {
    let at = |i: usize| -> f64 {
        let mine = |c: &&Coupling| c.first == End::Body(i) || c.second == End::Body(i);
        bench
            .couplings
            .iter()
            .filter(mine)
            .map(|c| if let Law::Spring { stiffness, .. } = c.law { stiffness } else { 0.0 })
            .sum()
    };
    let most = bench.bodies.iter().enumerate().map(|(i, b)| 2.0 * at(i) / b.inertia).fold(0.0, f64::max);
    most.sqrt().max(1e-3)
}
