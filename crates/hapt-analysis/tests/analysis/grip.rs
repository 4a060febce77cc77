//! A passive hand on the loop: what grows with it, and how near the worst of them comes to the certificate.

use std::f64::consts::PI;

use hapt_analysis::MARGINAL;
use hapt_analysis::{Grip, breaking_damping, free_growth, gripped_growth, is_certified, required_damping, worst_grip};
use hapt_model::{End, Method, Output, World};
use hapt_testing::prelude::*;
use proptest::sample::select;

use crate::common::*;

const PERIOD: f64 = 1e-3;
const INERTIA: f64 = 6.4e-4;

fn world(bench: &Bench, method: Method, output: Output) -> World {
    bench.world(method, output, PERIOD)
}

/// A spring and a damper from the puck to ground, on a device with this damping.
fn wall(stiffness: f64, damper: f64, device: f64) -> World {
    let couplings =
        vec![spring(End::Puck, End::Ground, stiffness), crate::common::damper(End::Puck, End::Ground, damper)];
    let mut world = world(&Bench::of(couplings), Method::Zoh, Output::End);
    world.device.damping = device;
    world
}

fn growth(world: &World, grip: Grip) -> f64 {
    gripped_growth(world, &grip).unwrap().unwrap()
}

#[test]
fn a_heavy_slow_hand_breaks_a_spring_nearly_up_to_the_certificate() {
    for stiffness in [0.5, 3.0, 40.0] {
        let required = required_damping(&wall(stiffness, 0.0, 0.0)).unwrap().unwrap();
        assert!((required / (0.5 * stiffness * PERIOD) - 1.0).abs() < 1e-9);
        let breaking = breaking_damping(&wall(stiffness, 0.0, 0.0)).unwrap().unwrap();
        assert!(breaking.damping > 0.9999 * required && breaking.damping <= required, "{breaking:?} {required}");
        // The search gives the same result from another damping of the device.
        let again = breaking_damping(&wall(stiffness, 0.0, 0.7 * required)).unwrap().unwrap();
        assert!((again.damping / required - 1.0).abs() < 2e-4, "{again:?}");
    }
}

#[test]
fn a_differenced_dampers_worst_hand_swings_at_nyquist_and_gets_eight_over_pi_squared_of_it() {
    // Between the samples the hand's sine dissipates π²/8 of the energy of straight lines.
    for (stiffness, damper) in [(0.2, 5e-3), (1.0, 2e-3), (5.0, 0.02)] {
        let world = wall(stiffness, damper, 1e-3);
        let required = required_damping(&world).unwrap().unwrap();
        assert!((required / (0.5 * stiffness * PERIOD + damper) - 1.0).abs() < 1e-9);
        let breaking = breaking_damping(&world).unwrap().unwrap();
        assert!((breaking.damping / required * PI * PI / 8.0 - 1.0).abs() < 1e-3, "{breaking:?} {required}");
    }
}

#[test]
fn a_lossless_wheel_at_the_start_of_the_step_falls_at_any_damping_of_a_real_device() {
    let wheel = Bench { bodies: vec![body(0.0258)], couplings: vec![spring(End::Puck, End::Body(0), 1.0186)] };
    for method in [Method::ForwardEuler, Method::Zoh, Method::Trapezoidal, Method::Tustin, Method::Foh] {
        let mut world = world(&wheel, method, Output::Start);
        assert_eq!(required_damping(&world).unwrap(), None);
        for damping in [0.0, 1e-3, 1e-2] {
            world.device.damping = damping;
            let worst = worst_grip(&world).unwrap().unwrap();
            assert!(worst.growth_per_s > 1e-6 && growth(&world, worst.grip) >= worst.growth_per_s - 1e-9);
        }
    }
}

#[test]
fn what_pulls_at_nothing_breaks_nothing() {
    let empty = world(&Bench { bodies: vec![], couplings: vec![] }, Method::Zoh, Output::End);
    assert_eq!(worst_grip(&empty).unwrap(), None);
    assert_eq!(breaking_damping(&empty).unwrap(), None);
}

fn outputs() -> impl Strategy<Value = (Method, Output)> {
    (select(Method::ALL.to_vec()), select(Output::ALL.to_vec()))
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(7, 60))]

    #[test]
    fn a_hand_without_a_spring_is_a_heavier_device_with_more_damping(
        bench in worlds(Dampers::Fixed, true), (method, output) in outputs(), inertia in 0.0..1e-2f64, damping in 0.0..1e-2f64,
    ) {
        let world = world(&bench, method, output);
        let mut heavier = world.clone();
        heavier.device.inertia += inertia;
        heavier.device.damping += damping;
        let (one, other) = (gripped_growth(&world, &Grip { inertia, damping, stiffness: 0.0 }), free_growth(&heavier));
        let (one, other) = (one.unwrap().unwrap_or(0.0), other.unwrap().unwrap_or(0.0));
        prop_assert!((one - other).abs() < 1e-9 * (1.0 + one.abs()), "{one} {other}");
    }

    /// First order in 1/M: the mode of a heavy hand feels its energy a period, and that is the fundamental's.
    #[test]
    fn a_heavy_hand_on_a_spring_grows_by_what_the_hold_gives_less_the_damping(
        stiffness in 0.5..10.0f64, angle in 0.05..2.5f64, share in 0.0..2.0f64,
    ) {
        let mass = 2e4 * INERTIA;
        let world = wall(stiffness, 0.0, share * 0.5 * stiffness * PERIOD);
        let omega = angle / PERIOD;
        let total = mass + INERTIA;
        let grip = Grip { inertia: mass, damping: 0.0, stiffness: total * omega * omega };
        let sinc = (0.5 * angle).sin() / (0.5 * angle);
        let expected = 0.5 / total * 0.5 * stiffness * PERIOD * (sinc * sinc - share);
        let found = growth(&world, grip);
        prop_assert!((found - expected).abs() < 1e-3 * 0.25 * stiffness * PERIOD / total, "{found} {expected}");
    }

    #[test]
    fn no_hand_breaks_what_is_certified(bench in worlds(Dampers::Fixed, false), (method, output) in outputs()) {
        let mut world = world(&bench, method, output);
        let Some(required) = required_damping(&world).unwrap() else { return Ok(()) };
        world.device.damping = required * (1.0 + 1e-6);
        // A part that grows by itself, unfelt, grows in any hand.
        if !is_certified(&world) {
            return Ok(());
        }
        prop_assert_eq!(worst_grip(&world).unwrap(), None);
        if let Some(breaking) = breaking_damping(&world).unwrap() {
            prop_assert!(breaking.damping <= required * (1.0 + 1e-6), "{breaking:?} {required}");
        }
    }

    #[test]
    fn some_hundred_other_hands_do_not_grow_much_faster(
        inertia in -3.0..-1.0f64, stiffness in -1.0..1.5f64, loss in -5.0..-2.0f64, at_puck in -5.0..-2.5f64,
        share in 0.0..1.5f64, (method, output) in outputs(),
    ) {
        let [inertia, stiffness, loss, at_puck] = [inertia, stiffness, loss, at_puck].map(|d| 10f64.powf(d));
        let (puck, wheel) = (End::Puck, End::Body(0));
        let couplings = vec![
            spring(puck, wheel, stiffness),
            crate::common::damper(puck, wheel, at_puck),
            crate::common::damper(wheel, End::Ground, loss),
        ];
        let mut world = world(&Bench { bodies: vec![body(inertia)], couplings }, method, output);
        world.device.damping = share * (0.5 * stiffness * PERIOD + at_puck);
        let mut most = f64::NEG_INFINITY;
        for mass in (0..12).map(|i| 10f64.powf(-1.0 + 5.0 * f64::from(i) / 11.0)) {
            for omega in (0..32).map(|i| 2e-3 * (0.6e3 * PI).powf(f64::from(i) / 31.0) / PERIOD) {
                let total = (1.0 + mass) * INERTIA;
                let swings = (total * omega * omega).max(0.01 * stiffness);
                most = most.max(growth(&world, Grip { inertia: mass * INERTIA, damping: 0.0, stiffness: swings }));
            }
        }
        let worst = worst_grip(&world).unwrap().map_or(0.0, |worst| worst.growth_per_s);
        prop_assert!(worst >= 0.9 * most - 1e-8, "{worst} {most}");
    }

    #[test]
    fn the_worst_hands_growth_is_that_of_the_gripped_loop(bench in worlds(Dampers::Fixed, false), (method, output) in outputs()) {
        let mut world = world(&bench, method, output);
        let Some(required) = required_damping(&world).unwrap() else { return Ok(()) };
        world.device.damping = 0.3 * required;
        if let Some(worst) = worst_grip(&world).unwrap() {
            let whole = growth(&world, worst.grip);
            prop_assert!(worst.growth_per_s >= MARGINAL);
            // The whole loop has further bodies, which the hand never feels.
            prop_assert!(whole >= worst.growth_per_s * (1.0 - 1e-6) - 1e-9, "{whole} {worst:?}");
        }
    }
}
