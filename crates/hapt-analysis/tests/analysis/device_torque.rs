//! Gravity and cogging of the device: what they change of a certificate, and what they do not.

use hapt_analysis::{Grip, PatternVerdict, Verdict, check, free, free_growth, gripped_growth, passivity, uneven};
use hapt_model::{
    Cogging, Compensated, Compensation, Coupling, Damping, DeviceTorque, End, EstimatorKind, Gravity, Law, Method,
    Output, Waveform, World,
};
use hapt_testing::prelude::*;

use crate::common::*;

prop_compose! {
    pub fn any_torque()(
        gravity in prop::option::of((0.001_f64..0.5, -3.0_f64..3.0)), cogging in (0.001_f64..0.05, 0.05_f64..1.0, -1.0_f64..1.0),
        sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(-1.0_f32..1.0),
    ) -> DeviceTorque {
        let (torque, pitch, phase) = cogging;
        DeviceTorque {
            gravity: gravity.map(|(torque, phase)| Gravity { torque, phase }),
            cogging: Some(Cogging { torque, pitch, phase, waveform: Waveform { sine, cosine } }),
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    /// A compensation is certified as its law: it requires the steepest slope of the compensated torque times half a period, and more
    /// behind a filter or a delay.
    #[test]
    fn a_compensation_costs_its_steepest_slope(torque in any_torque(), share in 0.01_f64..=1.0, d in 0..3_u32, x in 0.1_f64..3.0) {
        let of = if torque.gravity.is_some() { Compensated::Gravity } else { Compensated::Cogging };
        let mut world = Bench::of(vec![]).world(Method::Zoh, Output::End, 1e-3);
        world.device.torque = torque;
        world.couplings = vec![world.device.compensation(Compensation { of, share, velocity: None, cutoff: None }).unwrap()];
        world.sampling.delay = hapt_model::Delay::Seconds(f64::from(d) * 1e-3);
        world.sampling.filter = Some(x / (std::f64::consts::TAU * 1e-3));
        let slope = world.couplings[0].law.slopes().stiffness;
        let found = passivity(&world).unwrap();
        let wanted = 1e-3 * slope * (0.5 / (0.5 * x).tanh() + f64::from(d));
        // The core adds up the slopes of several sines.
        let part = found.required_damping.unwrap() / wanted;
        prop_assert!(part < 1.0 + 1e-9 && part > if of == Compensated::Gravity { 1.0 - 1e-9 } else { 0.3 }, "{found:?} {wanted}");
        prop_assert!(found.not_proved.is_empty());
        let notes = check(&world).unwrap().notes;
        let heading = format!("compensation of {}: it takes ", of.name());
        prop_assert!(notes.iter().any(|note| note.starts_with(&heading)), "{notes:?}");
    }
}

fn damper(damping: f64) -> Coupling {
    Coupling {
        first: End::Puck,
        second: End::Ground,
        law: Law::Damper { damping: Damping::Fixed(damping) },
        limit: None,
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// They act between the motor and the hand, store energy, and add none: they count as part of a passive hand.
    #[test]
    fn a_torque_that_only_stores_asks_for_no_damping(bench in worlds(Dampers::Fixed, true), torque in any_torque(), x in 0.01..1.0f64) {
        let plain = bench.world(Method::Zoh, Output::End, x / fastest(&bench));
        let mut world = plain.clone();
        world.device.torque = torque;
        prop_assert_eq!(passivity(&world).unwrap(), passivity(&plain).unwrap());
        let (with, without) = (uneven(&world).unwrap(), uneven(&plain).unwrap());
        prop_assert_eq!((with.required_damping, with.passive.holds()), (without.required_damping, without.passive.holds()));
        // No verdict gets better by them.
        let (with, without) = (check(&world).unwrap(), check(&plain).unwrap());
        prop_assert!(without.certified.holds() || !with.certified.holds());
        prop_assert_eq!(with.held, without.held);
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// Their slope acts as a hand that holds the puck by a spring, the flat slope as no hand.
    #[test]
    fn free_is_the_worse_of_no_slope_and_the_steepest(bench in worlds(Dampers::Fixed, false), torque in any_torque(), x in 0.01..1.0f64) {
        let mut world = bench.world(Method::Zoh, Output::End, x / fastest(&bench));
        let spring = Grip { inertia: 0.0, damping: 0.0, stiffness: torque.steepest() };
        let worse = [gripped_growth(&world, &Grip::default()), gripped_growth(&world, &spring)];
        let worse = worse.into_iter().filter_map(|growth| growth.unwrap()).fold(f64::NEG_INFINITY, f64::max);
        world.device.torque = torque;
        let found = free_growth(&world).unwrap().unwrap_or(f64::NEG_INFINITY);
        prop_assert!(found == worse || (found - worse).abs() <= 1e-9, "{found} {worse}");
    }

    /// Their steepest slope is a bound on every one, and so is their size.
    #[test]
    fn no_slope_is_steeper_than_the_bound(torque in any_torque(), z in -5.0..5.0f64) {
        let h = 1e-6;
        let slope = (torque.at(z + h) - torque.at(z - h)) / (2.0 * h);
        prop_assert!(slope.abs() <= torque.steepest() + 1e-4 && torque.at(z).abs() <= torque.most() + 1e-12);
    }
}

/// b = 0 and B = 0.2 J/T is stable and not passive: eigenvalues prove it of the linear loop, and no theorem proves it of the loop with
/// cogging.
#[test]
fn what_only_eigenvalues_tell_is_open_under_gravity() {
    let mut world: World = Bench::of(vec![damper(0.128)]).world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.sampling.estimator) = (0.0, EstimatorKind::Difference);
    let plain = uneven(&world).unwrap();
    assert_eq!((plain.free.verdict(), plain.passive.holds()), (PatternVerdict::Proved, false));
    world.device.torque.gravity = Some(Gravity { torque: 0.01, phase: 0.0 });
    let found = uneven(&world).unwrap();
    assert_eq!(found.free.verdict(), PatternVerdict::Open);
    assert!(found.free.reason().unwrap().contains("gravity"));
    // Passive, it is proved with gravity too.
    world.device.damping = 0.2;
    let found = check(&world).unwrap();
    assert_eq!((found.uneven.free.verdict(), found.certified.holds()), (PatternVerdict::Proved, true));
    assert!(found.notes.iter().any(|note| note.starts_with("device.gravity: ")));
    assert!(found.theorems.iter().all(|theorem| theorem.id != "free-eigenvalues"), "{:?}", found.theorems);
}

/// A puck between two teeth rings at √(k/J), and a slow command excites it: the hands-off loop with a late damper finds it.
#[test]
fn a_cogging_that_rings_is_seen() {
    let mut world: World = Bench::of(vec![damper(5e-3)]).world(Method::Zoh, Output::End, 1e-3);
    world.device.damping = 0.0;
    world.sampling.delay = hapt_model::Delay::Seconds(2e-3);
    assert_ne!(free(&world).unwrap().verdict, Verdict::Unstable);
    let waveform = Waveform { sine: [-1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
    // At 200 Hz a delay of 2 ms and a half sample is more than a quarter turn.
    let stiffness = 6.4e-4 * (std::f64::consts::TAU * 200.0_f64).powi(2);
    let pitch = 0.1;
    world.device.torque.cogging =
        Some(Cogging { torque: stiffness * pitch / std::f64::consts::TAU, pitch, phase: 0.0, waveform });
    assert_eq!(free(&world).unwrap().verdict, Verdict::Unstable);
}

/// A damper holds no lever against gravity, but a spring stiffer than the slope of gravity does: the certificate says which.
#[test]
fn a_certificate_says_what_gravity_does_to_a_puck_that_is_let_go() {
    let mut world: World = Bench::of(vec![damper(1e-4)]).world(Method::Zoh, Output::End, 1e-3);
    world.device.damping = 0.01;
    world.device.torque.gravity = Some(Gravity { torque: 0.05, phase: 0.0 });
    let found = check(&world).unwrap();
    let (line, text) = (found.headline(), found.text("lever", &world.sampling, None, false));
    assert!(line.starts_with("Certified: safe to let go, and gravity may move the puck from rest at up to "), "{text}");
    assert!(text.contains("gravity pushes it from where no spring holds it: doubles in "), "{text}");
    // Twice the amplitude, from the top to the bottom.
    let speed = (2.0 * 0.1 / world.device.inertia).sqrt();
    let printed: f64 = line.split("up to ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((printed - speed).abs() <= 0.01 * speed, "{printed} {speed}");
    for (stiffness, falls) in [(0.049, true), (0.051, false)] {
        let mut held = world.clone();
        held.couplings.push(Coupling {
            first: End::Puck,
            second: End::Ground,
            law: Law::Spring { stiffness, rest: 0.0 },
            limit: None,
        });
        let line = check(&held).unwrap().headline();
        assert_eq!(line.contains("gravity"), falls, "{stiffness}");
        // A spring also adds the energy that it has stored.
        assert!(!line.contains("at up to"), "{line}");
    }
}
