//! The search over all frequencies against a grid, with the impedance from the matrices of one sample.

use std::f64::consts::{PI, TAU};

use hapt_analysis::{Continuous, Discrete, Slopes, multipliers};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use super::*;

type C = Complex<f64>;

/// H at an angle, from the matrices of one sample.
fn torque(world: &World, phi: f64) -> C {
    let sampling = &world.sampling;
    let period = sampling.period;
    let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Steep).unwrap();
    let d = Discrete::new(&continuous, sampling.method, sampling.output, sampling.advance, period).unwrap();
    let z = C::from_polar(1.0, phi);
    let back = 1.0 / z;
    let step = C::new(-2.0 * (0.5 * phi).sin().powi(2), phi.sin());
    let v = match sampling.estimator {
        EstimatorKind::Exact => (1.0 - back) / period,
        EstimatorKind::Difference => (1.0 - back.powi(sampling.every as i32)) / (f64::from(sampling.every) * period),
        EstimatorKind::LowPass => {
            let tau = 1.0 / (TAU * sampling.cutoff.unwrap());
            (1.0 - back) / (tau + period - tau * back)
        }
        _ => (1.0 - back.powi(sampling.window as i32)) / (f64::from(sampling.window) * period),
    };
    let n = d.d.nrows();
    let matrix = DMatrix::from_fn(n, n, |i, j| if i == j { step } else { C::from(0.0) } - d.d[(i, j)]);
    // The position that the world sees.
    let seen = sampling.filter.map_or(C::from(1.0), |filter| {
        let pole = (-TAU * filter * period).exp();
        (1.0 - pole) / (1.0 - pole * back)
    });
    let input = DMatrix::from_fn(n, 1, |i, _| {
        // x_{k+1} takes u_k (held), or x_k takes u_{k-1} and u_k.
        let (now, before) =
            if sampling.method.takes_new_sample_first() { (z, C::from(1.0)) } else { (C::from(1.0), C::from(0.0)) };
        (now * d.current[(i, 0)] + before * d.previous[(i, 0)]) * seen
            + (now * d.current[(i, 1)] + before * d.previous[(i, 1)]) * v
    });
    let x = matrix.lu().solve(&input).unwrap();
    let out = (0..n).fold(C::from(0.0), |sum, i| sum + x[(i, 0)] * d.torque.state[i]);
    -(out + seen * d.torque.puck[0] + v * d.torque.puck[1])
}

/// The least damping that one angle requires.
fn at_angle(world: &World, phi: f64) -> f64 {
    let period = world.sampling.period;
    let h = torque(world, phi);
    let z = C::from_polar(1.0, phi);
    let delay = world.sampling.delay_s() / period;
    let whole = if (delay - delay.round()).abs() < 1e-6 { delay.round() } else { delay.floor() };
    let a = if (delay - whole).abs() < 1e-6 { 0.0 } else { delay - whole };
    let lagged = h * C::from_polar(1.0, -whole * phi) * (1.0 - a + a / z);
    let m = 0.5 * period * ((1.0 - 1.0 / z) * lagged).re / (2.0 * (0.5 * phi).sin().powi(2));
    0.5 * (m + (m * m + a * (1.0 - a) * period * period * h.norm_sqr()).sqrt())
}

/// The highest over a grid, refined at its tops.
fn brute(world: &World, low: f64, points: usize) -> f64 {
    let grid: Vec<f64> = (0..=points)
        .map(|i| low * (PI / low).powf(i as f64 / points as f64))
        .chain((1..points).map(|i| PI * i as f64 / points as f64))
        .collect();
    let mut grid = grid;
    grid.sort_by(f64::total_cmp);
    let values: Vec<f64> = grid.iter().map(|&phi| at_angle(world, phi)).collect();
    let mut best = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for i in 0..grid.len() {
        let (lower, upper) = (i.saturating_sub(1), (i + 1).min(grid.len() - 1));
        if values[i] < values[lower] || values[i] < values[upper] {
            continue;
        }
        let (mut a, mut b) = (grid[lower], grid[upper]);
        for _ in 0..60 {
            let (x, y) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
            let (fx, fy) = (at_angle(world, x), at_angle(world, y));
            best = best.max(fx).max(fy);
            if fx > fy { b = y } else { a = x }
        }
    }
    best
}

proptest! {
    #![proptest_config(hapt_testing::cases(20))]

    #[test]
    fn no_frequency_asks_for_more_and_one_for_all_of_it(
        bench in worlds(Dampers::Fixed, true), x in 0.01..1.5f64, method in 0..8usize, output in 0..3usize, advance in 0..3u32,
        delay in prop_oneof![Just(0.0), (0..5u32).prop_map(f64::from), 0.01..4.0f64], estimator in 0..4usize, cutoff in 0.01..1.0f64, every in 1..12u32,
        filter in prop::option::of(0.01..2.0f64),
    ) {
        let period = x / fastest(&bench);
        let method = Method::ALL[method];
        let output = if method.takes_new_sample_first() { Output::Start } else { Output::ALL[output] };
        let mut world = world(bench, method, output, period);
        world.sampling.advance = if output == Output::End { advance } else { 0 };
        world.sampling.delay = hapt_model::Delay::Seconds(delay * period);
        world.sampling.estimator = [EstimatorKind::Exact, EstimatorKind::LowPass, EstimatorKind::FoawBest, EstimatorKind::Difference][estimator];
        world.sampling.every = every;
        world.sampling.filter = filter.map(|filter| filter / period);
        if estimator == 2 { world.sampling.window = 1; }
        world.sampling.cutoff = Some(cutoff / period);
        let all = multipliers(&world.bodies, &world.couplings, &Slopes::Steep, method, period).unwrap();
        // The error by double precision in a matrix's lightest damping, and of (1 - z⁻¹) H/(1 - cos φ) at small φ.
        let lightest = all.iter().map(|m| m.ln_abs.abs()).filter(|l| *l > 0.0).fold(1.0, f64::min);
        let relative = |phi: f64| 1e-9 + 1e-14 / lightest + 1e-11 / phi;
        prop_assume!(relative(0.1) < 1e-3);
        // In addition, both sides round sums of terms of this size, which may cancel: m is T times a torque per position.
        let size: f64 = world.couplings.iter().filter(|c| [c.first, c.second].contains(&End::Puck)).map(|c| match c.law {
            Law::Spring { stiffness, .. } => period * stiffness,
            Law::Damper { damping: Damping::Fixed(damping) } => damping,
            ref law => unreachable!("{law:?}"),
        }).sum();
        let tolerance = |phi: f64, most: f64| relative(phi) * most + 1e-13 * size;
        let found = passivity(&world).unwrap();
        if let Some(most) = found.required_damping {
            for low in [1e-5, 1e-2] {
                let grid = brute(&world, low, 120);
                prop_assert!(grid <= most + tolerance(low, most), "{low} {grid} {most} {size} {lightest} {found:?}");
            }
            if let Some(phi) = found.at_hz.map(|hz| TAU * hz * period).filter(|phi| *phi > 1e-5) {
                let there = at_angle(&world, phi);
                prop_assert!((there - most).abs() < 2.0 * tolerance(phi, most), "{there} {most} {size} {lightest} {found:?}");
            }
        }
    }
}

#[test]
fn a_peak_a_billionth_wide_is_found() {
    // Twice the damping halves the peak: -Re s = 5e-7 to 1e-6 per second, at ω = 300.
    let at = |damping: f64| {
        let mut world = wheel(Method::Zoh, Output::Start, 0.3);
        world.couplings.push(damper(End::Body(0), End::Ground, damping * world.bodies[0].inertia));
        let found = passivity(&world).unwrap();
        near(found.at_hz.unwrap(), 300.0 / TAU, 1e-7);
        found.required_damping.unwrap()
    };
    near(at(1e-6), 2.0 * at(2e-6), 1e-6);
    // ρ = K/2 turned by x, over the circle that 1/(ε + jδ) runs along, ε = 5e-10 from the pole to the circle.
    near(at(1e-6), 1e-3 * 50.0 * (1.0 - 0.3f64.cos()) / (2.0 * 5e-10), 1e-6);
}

#[test]
fn a_critically_damped_body_is_no_exception() {
    for method in [Method::Zoh, Method::BackwardEuler, Method::Trapezoidal, Method::ForwardEuler, Method::Foh] {
        for seed in hapt_testing::seeds(3) {
            let zeta = [1.0, 1.0 - 1e-9, 1.0 + 1e-12][seed as usize];
            for chained in [false, true] {
                let mut bench = oscillator(300.0, zeta);
                if chained {
                    bench.bodies.push(body(1.0));
                    bench
                        .couplings
                        .extend([spring(End::Body(0), End::Body(1), 10.0), damper(End::Body(0), End::Body(1), 3.0)]);
                }
                let world = world(bench, method, Output::Start, 1e-3);
                near(required(&world), brute(&world, 1e-5, 400), 1e-8);
            }
        }
    }
}
