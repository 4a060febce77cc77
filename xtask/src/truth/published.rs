//! Boundaries that others have published, recomputed: the certificate's edge against their law, at random numbers.
//!
//! All are of a spring K and a damper B to ground on a device of inertia J and damping b, with the velocity by backward difference, and
//! α = K T²/J, β = B T/J, δ = b T/J (Hulin, Preusche and Hirzinger 2006), d the delay in samples. The certificate's edge is found by
//! bisection of its verdict; it does not use the laws.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use hapt_analysis::{free_growth, passivity, quantisation};
use hapt_model::{Coupling, Damping, Delay, Device, End, EstimatorKind, Law, Method, Output, Sampling, World};

use crate::campaign::Campaign;
use crate::random::log_uniform;

const PERIOD: f64 = 1e-3;
const INERTIA: f64 = 6.4e-4;
/// A bisection ends where the edge is known to this part.
const NEAR: f64 = 1e-9;

/// A law at random numbers.
struct Published {
    law: &'static str,
    source: &'static str,
    /// The law's edge, and the certificate's.
    edges: fn(&mut Rng) -> Result<[f64; 2]>,
    /// How far they may be apart: 0 but for bisections and rounding, or the law's own second-order terms.
    within: f64,
}

const ALL: [Published; 7] = [
    Published {
        law: "passive for b > KT/2 + abs(B)",
        source: "Colgate and Schenkel 1997",
        edges: colgate_schenkel,
        within: 1e-9,
    },
    Published {
        law: "let go, without friction and delay: stable for α < 2β(2 - β)/(2 + β)",
        source: "Hulin, Preusche and Hirzinger 2006",
        edges: hulin,
        within: 1e-6,
    },
    Published {
        law: "let go, with friction: stable while the cubic's roots are inside the unit circle",
        source: "Gil, Avello, Rubio and Flórez 2004",
        edges: gil_cubic,
        within: 1e-6,
    },
    Published {
        law: "the same with a delay of 1 to 3 samples",
        source: "Hulin, Albu-Schäffer and Hirzinger 2014",
        edges: delayed,
        within: 1e-6,
    },
    Published {
        law: "small α, β, δ and any delay: stable for K < (b + B)/(T/2 + delay)",
        source: "Gil, Sánchez, Hulin, Preusche and Hirzinger 2009",
        edges: small,
        within: 0.01,
    },
    Published {
        law: "a spring alone, with a delay of whole samples: passive for b > K(T/2 + delay)",
        source: "Hulin, Albu-Schäffer and Hirzinger 2014",
        edges: delayed_spring,
        within: 1e-9,
    },
    Published {
        law: "with counts Δ and Coulomb friction f: no limit cycle for K <= min(2b/T, 2f/Δ)",
        source: "Abbott and Okamura 2005; Diolaiti, Niemeyer, Barbagli and Salisbury 2006",
        edges: counts,
        within: 1e-9,
    },
];

fn wall(stiffness: f64, damping: f64, device_damping: f64, delay: f64) -> World {
    let to_ground = |law: Law| Coupling { first: End::Puck, second: End::Ground, law, limit: None };
    let sampling = Sampling {
        method: Method::Zoh,
        output: Output::End,
        delay: Delay::Seconds(delay),
        estimator: EstimatorKind::Difference,
        ..Sampling::new(PERIOD)
    };
    let couplings = vec![
        to_ground(Law::Spring { stiffness, rest: 0.0 }),
        to_ground(Law::Damper { damping: Damping::Fixed(damping) }),
    ];
    World { couplings, ..World::new(sampling, Device { damping: device_damping, ..Device::new(INERTIA) }) }
}

/// In the dimensionless numbers of the module's head.
fn plane([alpha, beta, delta, d]: [f64; 4]) -> World {
    let unit = INERTIA / PERIOD;
    wall(alpha * unit / PERIOD, beta * unit, delta * unit, d * PERIOD)
}

/// The first edge of stability, from a soft spring up.
fn edge(is_stable: &dyn Fn(f64) -> Result<bool>) -> Result<f64> {
    let (mut low, mut high) = (1e-7, 1e-7);
    ensure!(is_stable(low)?, "not stable with the softest spring");
    while is_stable(high)? {
        ensure!(high < 100.0, "stable with every spring");
        (low, high) = (high, 1.02 * high);
    }
    while high / low - 1.0 > NEAR {
        let middle = (low * high).sqrt();
        if is_stable(middle)? { low = middle } else { high = middle }
    }
    Ok(low)
}

/// The certificate's largest α.
fn certified([beta, delta, d]: [f64; 3]) -> Result<f64> {
    edge(&|alpha| Ok(free_growth(&plane([alpha, beta, delta, d]))?.context("no growth")? < 0.0))
}

/// g₁ and g₂ of the mass with friction under a held torque, (g₁ z + g₂)/((z - 1)(z - e^-δ)) in units of T²/J.
fn held_mass(delta: f64) -> [f64; 2] {
    let e = (-delta).exp();
    [(delta - 1.0 + e) / (delta * delta), (1.0 - e - delta * e) / (delta * delta)]
}

fn colgate_schenkel(rng: &mut Rng) -> Result<[f64; 2]> {
    let (k, b) = (log_uniform(rng, -1.0, 3.0), 2.0 * rng.f64() - 1.0);
    Ok([0.5 * k * PERIOD + b.abs(), passivity(&wall(k, b, 0.0, 0.0))?.required_damping.context("no damping")?])
}

fn hulin(rng: &mut Rng) -> Result<[f64; 2]> {
    let beta = 0.01 + 1.98 * rng.f64();
    Ok([2.0 * beta * (2.0 - beta) / (2.0 + beta), certified([beta, 0.0, 0.0])?])
}

/// z (z - 1)(z - e) + (α z + β (z - 1))(g₁ z + g₂), and Jury's conditions on z³ + p z² + q z + r:
/// 1 + p + q + r > 0, 1 - p + q - r > 0, |r| < 1, |r² - 1| > |r p - q|.
fn gil_cubic(rng: &mut Rng) -> Result<[f64; 2]> {
    let (beta, delta) = (1.5 * rng.f64(), log_uniform(rng, -2.0, 0.0));
    let (e, [g1, g2]) = ((-delta).exp(), held_mass(delta));
    let is_stable = |alpha: f64| {
        let (p, q, r) = (-(1.0 + e) + (alpha + beta) * g1, e + (alpha + beta) * g2 - beta * g1, -beta * g2);
        let inside = 1.0 + p + q + r > 0.0 && 1.0 - p + q - r > 0.0 && r.abs() < 1.0;
        Ok(inside && (r * r - 1.0).abs() > (r * p - q).abs())
    };
    Ok([edge(&is_stable)?, certified([beta, delta, 0.0])?])
}

/// Whether all roots of a polynomial, from the constant up, are inside the unit circle: Schur's and Cohn's reduction.
fn has_roots_inside(mut c: Vec<f64>) -> bool {
    while c.len() > 1 {
        let n = c.len() - 1;
        if c[0].abs() >= c[n].abs() {
            return false;
        }
        c = (0..n).map(|k| c[n] * c[k + 1] - c[0] * c[n - k - 1]).collect();
    }
    true
}

/// The same with z^(d + 1) in place of z.
fn delayed(rng: &mut Rng) -> Result<[f64; 2]> {
    let d = rng.usize(1..4);
    // With more damping a delayed loop has no stable spring at all.
    let (beta, delta) = (0.2 * rng.f64(), log_uniform(rng, -2.0, 0.0));
    let (e, [g1, g2]) = ((-delta).exp(), held_mass(delta));
    let is_stable = |alpha: f64| {
        let mut c = vec![0.0; d + 4];
        [e, -(1.0 + e), 1.0].into_iter().enumerate().for_each(|(i, x)| c[d + 1 + i] += x);
        [-beta * g2, (alpha + beta) * g2 - beta * g1, (alpha + beta) * g1]
            .into_iter()
            .enumerate()
            .for_each(|(i, x)| c[i] += x);
        Ok(has_roots_inside(c))
    };
    Ok([edge(&is_stable)?, certified([beta, delta, d as f64])?])
}

fn small(rng: &mut Rng) -> Result<[f64; 2]> {
    let (total, share, d) = (log_uniform(rng, -5.0, -3.0), rng.f64(), 4.0 * rng.f64());
    Ok([total / (0.5 + d), certified([share * total, (1.0 - share) * total, d])?])
}

fn delayed_spring(rng: &mut Rng) -> Result<[f64; 2]> {
    let (k, d) = (log_uniform(rng, -1.0, 2.0), f64::from(rng.u32(1..5)));
    let found = passivity(&wall(k, 0.0, 0.0, d * PERIOD))?.required_damping.context("no damping")?;
    Ok([k * PERIOD * (0.5 + d), found])
}

fn counts(rng: &mut Rng) -> Result<[f64; 2]> {
    let (b, friction, counts) = (log_uniform(rng, -4.0, 0.0), log_uniform(rng, -4.0, 0.0), log_uniform(rng, 2.0, 5.0));
    let mut world = wall(1.0, 0.0, b, 0.0);
    (world.device.friction, world.device.encoder) = (friction, Some(counts));
    let found = quantisation(&world)?.max_stiffness.context("no limit")?;
    Ok([(2.0 * b / PERIOD).min(2.0 * friction * counts / TAU), found])
}

/// `cargo xtask published [--n N] [--seed S] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let options = Campaign::parse(words, false)?;
    let mut text = format!(
        "{} random devices for each law, seed {}.\n\n| law | source | the certificate's edge is off it by at most | allowed |\n| --- | --- | --- | --- |\n",
        options.n, options.seed
    );
    for Published { law, source, edges, within } in ALL {
        let mut worst: f64 = 0.0;
        for i in 0..options.n {
            let mut rng = Rng::with_seed(options.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i);
            let [published, found] = edges(&mut rng).with_context(|| format!("{law}: case {i}"))?;
            worst = worst.max((found / published - 1.0).abs());
        }
        ensure!(worst <= within, "{law} ({source}): the certificate is off by {worst:e} of it");
        writeln!(text, "| {law} | {source} | {worst:.0e} | {within:.0e} |")?;
    }
    options.publish("published", super::PAGE, &text)
}
