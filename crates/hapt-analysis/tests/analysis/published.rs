//! What the field has published on the spring and damper between a device and ground, against the certificate.
//!
//! α = K T²/J, β = B T/J, δ = b T/J throughout (Hulin, Preusche and Hirzinger 2006), t_d the delay, d = t_d/T. The velocity is
//! the backward difference. The characteristic polynomials are put together here, from the exact hold of a mass with friction.

use hapt_analysis::{check, free_growth, held, passivity, quantisation};
use hapt_model::{End, Method, Output, World};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use crate::common::*;

const PERIOD: f64 = 1e-3;
const INERTIA: f64 = 6.4e-4;

/// A wall without a surface: K and B to ground, on a device with damping b.
fn wall(stiffness: f64, damping: f64, device_damping: f64, delay: f64) -> World {
    let couplings = vec![spring(End::Puck, End::Ground, stiffness), damper(End::Puck, End::Ground, damping)];
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, PERIOD);
    world.sampling.delay = hapt_model::Delay::Seconds(delay);
    (world.device.inertia, world.device.damping) = (INERTIA, device_damping);
    world
}

/// In the dimensionless numbers of the module's head; `d` in samples.
fn plane(alpha: f64, beta: f64, delta: f64, d: f64) -> World {
    let unit = INERTIA / PERIOD;
    wall(alpha * unit / PERIOD, beta * unit, delta * unit, d * PERIOD)
}

fn is_stable(world: &World) -> bool {
    free_growth(world).unwrap().unwrap() < 0.0
}

/// ln of the largest modulus of the roots of
/// z^(d+1) (z - 1)(z - e^-δ) + (α z + β (z - 1)) (g₁ z + g₂) = 0,
/// g₁ = (δ - 1 + e^-δ)/δ², g₂ = (1 - e^-δ - δ e^-δ)/δ²: the mass with friction under a held torque.
fn polynomial(alpha: f64, beta: f64, delta: f64, d: usize) -> f64 {
    let e = (-delta).exp();
    let (g1, g2) = if delta == 0.0 {
        (0.5, 0.5)
    } else {
        ((delta - 1.0 + e) / (delta * delta), (1.0 - e - delta * e) / (delta * delta))
    };
    // From the constant upwards.
    let mut c = vec![0.0; d + 4];
    for (i, x) in [e, -(1.0 + e), 1.0].into_iter().enumerate() {
        c[d + 1 + i] += x;
    }
    c[2] += (alpha + beta) * g1;
    c[1] += (alpha + beta) * g2 - beta * g1;
    c[0] -= beta * g2;
    let n = c.len() - 1;
    let companion = DMatrix::from_fn(n, n, |i, j| match (i, j) {
        (0, j) => -c[n - 1 - j] / c[n],
        (i, j) if i == j + 1 => 1.0,
        _ => 0.0,
    });
    let roots: Vec<Complex<f64>> = companion.complex_eigenvalues().iter().copied().collect();
    roots.iter().map(|z| z.norm()).fold(0.0, f64::max).ln()
}

/// Colgate and Schenkel 1997, "Passivity of a class of sampled-data systems", J. Robotic Systems 14(1), and 1994 (ACC): the
/// virtual wall needs b > K T/2 + |B|.
#[test]
fn colgate_and_schenkels_wall() {
    proptest!(|(k in 0.1..1e3f64, b in -1.0..1.0f64)| {
        let bound = 0.5 * k * PERIOD + b.abs();
        let needs = passivity(&wall(k, b, bound * (1.0 + 1e-9), 0.0)).unwrap();
        prop_assert!(needs.passive.holds() && (needs.required_damping.unwrap() / bound - 1.0).abs() < 1e-10);
        prop_assert!(!passivity(&wall(k, b, bound * (1.0 - 1e-9), 0.0)).unwrap().passive.holds());
    });
}

/// Hulin, Preusche and Hirzinger 2006, "Stability boundary for haptic rendering: influence of physical damping" (IROS): without
/// friction and delay the edge is α = 2β(2 - β)/(2 + β), from nothing at β = 0 over 4(√2 - 1)² at β = 2(√2 - 1) to nothing at 2.
#[test]
fn hulins_edge_without_friction_and_delay() {
    proptest!(|(beta in 0.001..1.999f64)| {
        let alpha = 2.0 * beta * (2.0 - beta) / (2.0 + beta);
        prop_assert!(is_stable(&plane(alpha * (1.0 - 1e-6), beta, 0.0, 0.0)));
        prop_assert!(!is_stable(&plane(alpha * (1.0 + 1e-6), beta, 0.0, 0.0)));
    });
    let top = 2.0 * (2f64.sqrt() - 1.0);
    let most = top * top;
    for beta in [0.9 * top, top, 1.1 * top] {
        assert!(!is_stable(&plane(most * (1.0 + 1e-6), beta, 0.0, 0.0)));
    }
    assert!(is_stable(&plane(most * (1.0 - 1e-6), top, 0.0, 0.0)));
}

/// Gil, Sánchez, Hulin, Preusche and Hirzinger 2009, "Stability boundary for haptic rendering: influence of damping and delay",
/// J. Comput. Inf. Sci. Eng. 9(1): small α, β and δ obey K < (b + B)/(T/2 + t_d) up to terms of the second order.
#[test]
fn gil_and_hulins_law_for_small_parameters() {
    proptest!(|(total in 1e-5..1e-3f64, share in 0.0..1.0f64, d in 0.0..4.0f64)| {
        let limit = total / (0.5 + d);
        let (beta, delta) = (share * total, (1.0 - share) * total);
        prop_assert!(is_stable(&plane(limit * 0.99, beta, delta, d)));
        prop_assert!(!is_stable(&plane(limit * 1.01, beta, delta, d)));
    });
}

/// The same authors' exact boundaries: Gil, Avello, Rubio and Flórez 2004, "Stability analysis of a 1 DOF haptic interface using
/// the Routh-Hurwitz criterion", IEEE Trans. Control Systems Technology 12(4); Hulin, Albu-Schäffer and Hirzinger 2014,
/// "Passivity and stability boundaries for haptic systems with time delay", ibid. 22(4). Anywhere in the space of α, β, δ and
/// whole d the largest root is that of their polynomial.
#[test]
fn the_whole_space_of_gil_and_hulin() {
    proptest!(|(alpha in 1e-3..2.0f64, beta in 0.0..2.5f64, delta in 0.0..2.0f64, d in 0..4usize)| {
        let found = free_growth(&plane(alpha, beta, delta, d as f64)).unwrap().unwrap() * PERIOD;
        let wanted = polynomial(alpha, beta, delta, d);
        prop_assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    });
}

/// Hulin et al. 2014: what is passive is stable, and much is stable that is not passive; with delay the passive part shrinks to
/// b > K T (1/2 + d) + B (1 + 2d) at most, which is the sum of what a spring and a damper each require at their worst frequency.
#[test]
fn what_is_passive_is_stable() {
    proptest!(|(k in 0.1..100.0f64, b in 0.0..0.5f64, d in 0..4u32, room in 1.0..2.0f64)| {
        let delay = f64::from(d) * PERIOD;
        let required = passivity(&wall(k, b, 0.0, delay)).unwrap().required_damping.unwrap();
        prop_assert!(required <= k * PERIOD * (0.5 + f64::from(d)) + b * (1.0 + 2.0 * f64::from(d)) + 1e-12);
        prop_assert!(is_stable(&wall(k, b, required * room, delay)));
    });
}

/// Abbott and Okamura 2005, "Effects of position quantization and sampling rate on virtual-wall passivity", IEEE Trans. Robotics
/// 21(5); Diolaiti, Niemeyer, Barbagli and Salisbury 2006, "Stability of haptic rendering: discretization, quantization, time
/// delay, and Coulomb effects", ibid. 22(2): K ≤ min(2b/T, 2 f_c/Δ). The motions that show it are in hapt-sim's tests.
#[test]
fn abbott_and_diolaitis_limits() {
    proptest!(|(b in 1e-4..1.0f64, friction in 1e-4..1.0f64, counts in 100.0..1e5f64, k in 0.1..1e4f64)| {
        let mut world = wall(k, 0.0, b, 0.0);
        (world.device.friction, world.device.encoder) = (friction, Some(counts));
        let limit = (2.0 * b / PERIOD).min(2.0 * friction * counts / std::f64::consts::TAU);
        let found = quantisation(&world).unwrap();
        prop_assert!((found.max_stiffness.unwrap() / limit - 1.0).abs() < 1e-12);
        prop_assert_eq!(found.ok, k <= limit);
    });
}

/// (2.14) of the notes says T < 2ζ/ω. It holds for ζ < 1; beyond, T < 2(ζ - √(ζ² - 1))/ω, which shrinks as ζ grows.
#[test]
fn the_notes_limit_of_the_period_corrected() {
    proptest!(|(omega in 0.1..1e3f64, zeta in 0.01..5.0f64)| {
        let limit = if zeta < 1.0 { 2.0 * zeta } else { 2.0 * (zeta - (zeta * zeta - 1.0).sqrt()) } / omega;
        let bench = oscillator(omega, zeta);
        let at = |period: f64| held(&bench.bodies, &bench.couplings, Method::ForwardEuler, period).unwrap();
        prop_assert!((at(0.5 * limit).critical_period_s.unwrap() / limit - 1.0).abs() < 1e-9);
        prop_assert!(at(limit * (1.0 - 1e-6)).growth_per_s.unwrap() < 0.0);
        prop_assert!(at(limit * (1.0 + 1e-6)).growth_per_s.unwrap() > 0.0);
    });
    // At ζ = 2 the notes allow 7.5 times too much.
    let omega = 10.0;
    let bench = oscillator(omega, 2.0);
    let notes = held(&bench.bodies, &bench.couplings, Method::ForwardEuler, 0.9 * 2.0 * 2.0 / omega).unwrap();
    assert!(notes.growth_per_s.unwrap() > 0.0);
}

/// The same two papers' wall on a wheel of the University of Michigan's kind at 1 ms: up to 2b/T it is passive, and slightly beyond it no
/// longer comes to rest when released.
#[test]
fn without_virtual_damping_passive_and_stable_end_together_on_a_lab_wheel() {
    let b = 1.2e-3;
    let stiffest = 2.0 * b / PERIOD;
    let verdict = |k: f64| check(&wall(k, 0.0, b, 0.0)).unwrap();
    let at = verdict(stiffest * 0.999_999);
    assert!(at.passivity.passive.holds() && at.certified.holds());
    let beyond = verdict(stiffest * 1.02);
    assert!(!beyond.passivity.passive.holds() && beyond.free.growth_per_s.unwrap() > 0.0);
}

/// (T25) up to β = 3.7208, and (T25b) beyond: the exact limit of a spring to ground, hands-off.
#[test]
fn the_exact_limit_of_a_spring_hand_off() {
    proptest!(|(beta in 0.05..12.0f64)| {
        let e = (-beta).exp();
        let by_determinant = beta * beta * (1.0 - e) / (1.0 - e - beta * e);
        let by_minus_one = 2.0 * beta * beta * (1.0 + e) / (beta * (1.0 + e) - 2.0 * (1.0 - e));
        prop_assert_eq!(by_determinant < by_minus_one, beta < 3.720_753_996, "{}", beta);
        let limit = by_determinant.min(by_minus_one);
        let inertia = wall(0.0, 0.0, 0.0, 0.0).device.inertia;
        let at = |x: f64| wall(x * inertia / (PERIOD * PERIOD), 0.0, beta * inertia / PERIOD, 0.0);
        prop_assert!(is_stable(&at(limit * (1.0 - 1e-6))));
        prop_assert!(!is_stable(&at(limit * (1.0 + 1e-6))));
    });
}
