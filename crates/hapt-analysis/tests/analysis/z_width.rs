//! The Z-width of a device: closed forms, and its edges checked from both sides.

use std::f64::consts::TAU;

use hapt_analysis::z_width::{Edge, with_wall};
use hapt_analysis::{Verdict, ZWidth, free_growth, required_damping, z_width};
use hapt_model::{EstimatorKind, Method, Output, World};
use hapt_testing::prelude::*;

use crate::common::Bench;

const INERTIA: f64 = 6.4e-4;

fn device(damping: f64, delay: f64, estimator: EstimatorKind) -> World {
    let mut world = Bench::of(vec![]).world(Method::Zoh, Output::End, 1e-3);
    world.sampling.delay = hapt_model::Delay::Seconds(delay * 1e-3);
    (world.sampling.estimator, world.sampling.cutoff, world.sampling.window) = (estimator, Some(60.0), 6);
    (world.device.inertia, world.device.damping) = (INERTIA, damping);
    world
}

fn of(world: &World) -> ZWidth {
    z_width(world, 24).unwrap()
}

fn near(found: f64, wanted: f64, relative: f64) {
    assert!((found - wanted).abs() <= relative * wanted.abs(), "{found} is not {wanted}");
}

fn is_passive(world: &World, k: f64, b: f64) -> bool {
    required_damping(&with_wall(world, k, b)).unwrap().is_some_and(|required| required <= world.device.damping)
}

fn is_stable(world: &World, k: f64, b: f64) -> bool {
    Verdict::of(free_growth(&with_wall(world, k, b)).unwrap()) != Verdict::Unstable
}

#[test]
fn with_the_difference_passive_is_a_straight_line() {
    let found = of(&device(1.2e-3, 0.0, EstimatorKind::Difference));
    near(found.passive_damping, 1.2e-3, 1e-9);
    let passive: Vec<&Edge> = found.edges.iter().filter(|edge| edge.passive.is_some()).collect();
    assert!(passive.len() > 10);
    for edge in passive {
        // b = KT/2 + B
        assert!((edge.passive.unwrap() - (1.2e-3 - edge.damping) * 2e3).abs() < 1e-8, "{edge:?}");
    }
}

#[test]
fn with_a_low_pass_a_damper_costs_less() {
    let world = device(1.2e-3, 0.0, EstimatorKind::LowPass);
    let tau = 1.0 / (TAU * 60.0);
    let part = 1e-3 / (1e-3 + 2.0 * tau);
    let found = of(&world);
    near(found.passive_damping, 1.2e-3 / part, 1e-9);
    for edge in found.edges.iter().filter(|edge| edge.passive.is_some()) {
        assert!((edge.passive.unwrap() - (1.2e-3 - edge.damping * part) * 2e3).abs() < 1e-8, "{edge:?}");
    }
}

#[test]
fn without_damping_and_delay_stable_is_a_known_curve() {
    let found = of(&device(0.0, 0.0, EstimatorKind::Difference));
    assert_eq!(found.passive_damping, 0.0);
    near(found.stable_damping, 2.0 * INERTIA / 1e-3, 1e-6);
    let inside = found.edges.iter().filter(|edge| edge.damping > 0.0 && edge.damping < 0.999 * found.stable_damping);
    let mut seen = 0;
    for edge in inside {
        let beta = edge.damping * 1e-3 / INERTIA;
        near(edge.stable.unwrap(), 2.0 * beta * (2.0 - beta) / (2.0 + beta) * INERTIA / 1e-6, 1e-5);
        seen += 1;
    }
    assert!(seen > 10);
    assert_eq!(found.edges[0], Edge { damping: 0.0, passive: Some(0.0), stable: Some(0.0) });
    assert!(found.edges[1..].iter().all(|edge| edge.passive.is_none()));
}

#[test]
fn light_springs_obey_the_law_of_delays() {
    // K < (b + B)/(T/2 + t_d), from 0 to 4 % above without a virtual damper.
    for delay in [0.0, 0.5, 1.0, 3.0] {
        let world = device(1e-5, delay, EstimatorKind::Difference);
        near(of(&world).edges[0].stable.unwrap(), 1e-5 / ((0.5 + delay) * 1e-3), 0.01);
    }
}

#[test]
fn a_heavily_damped_device_is_stable_as_far_as_it_is_passive_and_beyond() {
    // Beyond 100 J/T², and 100 J/T.
    for damping in [10.0, 1e3, 1e5] {
        let world = device(damping, 0.0, EstimatorKind::Difference);
        let found = of(&world);
        assert!(found.stable_damping > damping && !is_stable(&world, 0.0, 1.001 * found.stable_damping));
        for edge in found.edges.iter().filter(|edge| edge.passive.is_some()) {
            let (passive, stable) = (edge.passive.unwrap(), edge.stable.unwrap());
            assert!((passive / ((damping - edge.damping) * 2e3) - 1.0).abs() < 1e-6 || edge.damping > 0.99 * damping);
            assert!(stable >= passive * (1.0 - 1e-6), "{edge:?}");
            assert!(!is_stable(&world, stable * (1.0 + 1e-5), edge.damping), "{edge:?}");
        }
    }
}

#[test]
fn an_encoder_adds_its_line() {
    let mut world = device(1.2e-3, 0.0, EstimatorKind::Difference);
    assert_eq!(of(&world).counts, None);
    world.device.encoder = Some(4000.0);
    world.device.friction = 1e-3;
    near(of(&world).counts.unwrap(), 2e-3 / (TAU / 4000.0), 1e-12);
    world.device.friction = 5e-3;
    near(of(&world).counts.unwrap(), 2.4, 1e-12);
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    #[test]
    fn every_edge_has_both_of_its_sides(log in -5.0..-1.0f64, delay in 0..5u32, kind in 0..EstimatorKind::ALL.len()) {
        let world = device(10f64.powf(log), 0.4 * f64::from(delay), EstimatorKind::ALL[kind]);
        let found = z_width(&world, 10).unwrap();
        let width = 1e-6;
        for edge in &found.edges {
            let b = edge.damping;
            match edge.passive {
                None => prop_assert!(!is_passive(&world, 0.0, b)),
                Some(k) => {
                    prop_assert!(!is_passive(&world, k * (1.0 + width) + 1e-6, b), "{edge:?}");
                    prop_assert!(k < 1e-6 || is_passive(&world, k * (1.0 - width), b), "{edge:?}");
                }
            }
            match edge.stable {
                None => prop_assert!(!is_stable(&world, 0.0, b)),
                // The very last is where nothing is left.
                Some(k) if b < found.stable_damping => {
                    prop_assert!(k > 0.0 && !is_stable(&world, k * (1.0 + width), b), "{edge:?}");
                    // Without a gap.
                    for i in 0..60 {
                        prop_assert!(is_stable(&world, k * (1.0 - width) * f64::from(i) / 59.0, b), "{edge:?}");
                    }
                }
                Some(_) => {}
            }
            // What is passive against every hand is stable with none.
            if let Some(k) = edge.passive {
                prop_assert!(edge.stable.is_some_and(|stable| stable >= k * (1.0 - width)), "{edge:?}");
            }
        }
        prop_assert!(!is_stable(&world, 0.0, found.stable_damping * (1.0 + 1e-3)));
        // Beyond its last damper no spring makes anything passive.
        for k in 0..20 {
            let k = f64::from(k) * found.edges[0].passive.unwrap() / 10.0;
            prop_assert!(!is_passive(&world, k, found.passive_damping * (1.0 + 1e-6) + 1e-12), "{k}");
        }
    }
}
