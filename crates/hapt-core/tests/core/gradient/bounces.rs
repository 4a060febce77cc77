//! Bodies on walls: they return to the height from which they fell, at the right time, and with their momentum.

use hapt_core::{Coupling, End, Law, Loop, Method, Output, Real, Side};

use super::{KEEPING, Small, body, floor, grounded, list};

use crate::reference::World;

/// A body of 10 g·m² that falls by its weight, 0.1 N·m, onto a floor of 2000 N·m/rad (71 Hz): how high it still bounces.
fn bounce<F: Real>(method: Method, steps: usize) -> (f64, u32) {
    let (inertia, weight, height) = (0.01, 0.1, 0.3);
    let couplings = vec![grounded(floor(2000.0, 0.0)), grounded(Law::Constant { torque: -weight })];
    let world = World { bodies: vec![body(inertia, height, 0.0)], couplings };
    let control = Loop::<F, 1, 2, 2>::new(&world.spec(method, Output::End, 1e-3)).unwrap();
    let mut state = control.start();
    let (mut last, mut bounces, mut touches) = (0.0, 0, false);
    for _ in 0..steps {
        control.step(&mut state, F::ZERO, F::ZERO);
        let (w, v) = (state.now.position[0].to_f64(), state.now.velocity[0].to_f64());
        let touched = touches;
        touches = w <= 0.0;
        bounces += u32::from(touches && !touched);
        if !touches {
            last = w + 0.5 * inertia * v * v / weight;
        }
    }
    (last / height, bounces)
}

#[test]
fn a_body_that_bounces_on_a_stiff_lossless_wall_for_an_hour_keeps_its_height() {
    let hour = if cfg!(debug_assertions) { 200_000 } else { 3_600_000 };
    for method in KEEPING {
        let (height, bounces) = bounce::<f64>(method, hour);
        println!("{}: {:e} after {bounces}", method.name(), height - 1.0);
        assert!((height - 1.0).abs() < 1e-9, "{}: {height}", method.name());
        assert!(bounces as usize > hour / 800, "{bounces}");
    }
    assert!(bounce::<f64>(Method::BackwardEuler, hour / 10).0 < 1.0, "backward Euler loses what it always loses");
}

#[test]
fn on_single_floats_it_keeps_its_height_for_a_minute() {
    for method in KEEPING {
        let (height, _) = bounce::<f32>(method, 60_000);
        println!("{}: {:e}", method.name(), height - 1.0);
        assert!((height - 1.0).abs() < 2e-2, "{}: {height}", method.name());
    }
}

#[test]
fn a_bounce_takes_half_a_period_of_body_and_wall_with_an_error_of_second_order() {
    let (inertia, stiffness, velocity) = (0.02, 500.0, -2.0);
    let omega = f64::sqrt(stiffness / inertia);
    let contact = std::f64::consts::PI / omega;
    for method in KEEPING {
        // Over all phases of the contact within a sample, the largest error of the way back.
        let error = |period: f64| {
            (0..40).fold(0.0_f64, |worst, phase| {
                let start = (7.0 + f64::from(phase) / 40.0) * -velocity * period;
                let world = World {
                    bodies: vec![body(inertia, start, velocity)],
                    couplings: vec![grounded(floor(stiffness, 0.0))],
                };
                let control = Small::new(&world.spec(method, Output::End, period)).unwrap();
                let mut state = control.start();
                let samples = (1.5 * contact / period).round();
                for _ in 0..=8 + samples as usize {
                    control.step(&mut state, 0.0, 0.0);
                }
                let since = (8.0 + samples) * period + start / velocity - contact;
                worst.max((state.now.position[0] + velocity * since).abs())
            })
        };
        let (coarse, fine) = (error(contact / 20.0), error(contact / 160.0));
        let order = (coarse / fine).log2() / 3.0;
        assert!(order > 1.9, "{}: {order} {coarse:e} {fine:e}", method.name());
        assert!(fine < 1e-3 * contact * -velocity, "{fine}");
    }
}

#[test]
fn bodies_with_walls_between_them_keep_momentum_and_energy_through_a_thousand_collisions() {
    let wall = Law::Wall { side: Side::Above, at: -0.05, stiffness: 3000.0, damping: 0.0 };
    // On a ring: each pushes the next, the last the first, a turn on.
    let round = Law::Wall { side: Side::Above, at: 0.95, stiffness: 3000.0, damping: 0.0 };
    let bodies = vec![body(0.01, 0.0, 5.0), body(0.02, 0.25, -1.0), body(0.015, 0.5, 0.3), body(0.03, 0.75, -2.0)];
    let coupling = |i: usize, j: usize, law| Coupling { first: End::Body(i), second: End::Body(j), law, limit: None };
    let couplings = vec![coupling(0, 1, wall), coupling(1, 2, wall), coupling(2, 3, wall), coupling(3, 0, round)];
    let world = World { bodies, couplings };
    let momentum = |x: &[f64]| world.bodies.iter().zip(&x[4..]).map(|(body, v)| body.inertia * v).sum::<f64>();
    for method in KEEPING {
        let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
        let mut state = control.start();
        let start = list(&state.now, 4);
        let (mut pushes, mut most) = (0, 0);
        for _ in 0..50_000 {
            control.step(&mut state, 0.0, 0.0);
            let pushing = state.contacts.torques.iter().filter(|torque| **torque < 0.0).count();
            pushes += usize::from(pushing > 0);
            most = most.max(pushing);
        }
        let end = list(&state.now, 4);
        let (before, after) = (world.energy(&start, 0.0).0, world.energy(&end, 0.0).0);
        assert!((after / before - 1.0).abs() < 1e-11, "{}: {before} {after}", method.name());
        assert!((momentum(&start) - momentum(&end)).abs() < 1e-12, "{}", method.name());
        assert!(pushes > 1000 && most > 1, "{pushes} {most}");
    }
}
