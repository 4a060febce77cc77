//! Coulomb friction at bodies: it holds, slows and stops them according to the law.

use hapt_core::{Body, Coupling, End, Law, Method, Output, Spec};

use super::{KEEPING, METHODS, Small, body, grounded, spring};

use crate::reference::World;

/// x_k of a body with friction to ground and more.
fn slide(method: Method, body: Body, level: f64, more: &[Law], steps: usize) -> Vec<(f64, f64, f64)> {
    let laws = [&[Law::Coulomb { torque: level }], more].concat();
    let world = World { bodies: vec![body], couplings: laws.into_iter().map(grounded).collect() };
    let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
    let mut state = control.start();
    let step = |_| {
        control.step(&mut state, 0.0, 0.0);
        (state.now.position[0], state.now.velocity[0], state.contacts.torques[0])
    };
    (0..steps).map(step).collect()
}

#[test]
fn friction_holds_a_body_at_rest_against_a_spring_below_its_level_for_ever() {
    for method in METHODS {
        // 0.3 rad · 1 N·m/rad against 0.31 N·m.
        let rows = slide(method, body(0.01, 0.3, 0.0), 0.31, &[spring(1.0)], 100_000);
        for (w, v, torque) in rows {
            assert_eq!(w, 0.3, "{}", method.name());
            assert!(v.abs() < 1e-16, "{}: {v:e}", method.name());
            assert!((torque - 0.3).abs() < 1e-15);
        }
        let rows = slide(method, body(0.01, 0.3, 0.0), 0.29, &[spring(1.0)], 100);
        assert!(rows[99].0 < 0.3, "{}: above its level it lets go", method.name());
    }
}

#[test]
fn friction_slows_a_body_evenly_and_then_stops_it_for_good() {
    let (inertia, level, velocity, t) = (0.01, 0.05, 2.0, 1e-3);
    let slowing = level / inertia;
    for method in METHODS {
        let rows = slide(method, body(inertia, 0.0, velocity), level, &[], 1000);
        let stop = (velocity / slowing / t) as usize;
        for (k, (_, v, _)) in rows.iter().enumerate().take(stop - 1) {
            assert!((v - (velocity - slowing * t * k as f64)).abs() < 1e-12, "{}", method.name());
        }
        let end = rows[stop + 2];
        let travel = velocity * velocity / (2.0 * slowing);
        // Backward Euler is late by half a sample, the others only in the last one.
        let error = if method == Method::BackwardEuler { 0.6 * velocity * t } else { slowing * t * t };
        assert!((end.0 - travel).abs() <= error, "{}: {} {travel}", method.name(), end.0);
        for (w, v, torque) in &rows[stop + 2..] {
            assert_eq!(*w, end.0);
            assert!(v.abs() < 1e-16 && torque.abs() < 1e-12, "{}: {v:e} {torque:e}", method.name());
        }
    }
}

#[test]
fn friction_brings_a_swing_to_rest_where_the_spring_is_below_its_level_by_equal_losses() {
    // Each half swing loses 2 level/k of its amplitude.
    let (inertia, stiffness, level, start) = (0.01, 4.0, 0.11, 0.3);
    let lost = 2.0 * level / stiffness;
    for method in KEEPING {
        let rows = slide(method, body(inertia, start, 0.0), level, &[spring(stiffness)], 2000);
        let end = rows[1999].0;
        // 0.3 -> -0.245 -> 0.19 -> -0.135 -> 0.08 -> -0.025, where 4 · 0.025 < 0.11.
        let expected = -(start - 5.0 * lost);
        assert!((end - expected).abs() < 2e-3, "{}: {end} {expected}", method.name());
        assert!(rows[1000..].iter().all(|(w, v, _)| *w == end && v.abs() < 1e-15), "{}", method.name());
    }
}

#[test]
fn friction_between_two_bodies_takes_their_relative_motion_and_leaves_their_momentum() {
    let bodies = vec![body(0.01, 0.0, 3.0), body(0.04, 0.5, -1.0)];
    let between = |law| Coupling { first: End::Body(0), second: End::Body(1), law, limit: None };
    for method in METHODS {
        let world = World { bodies: bodies.clone(), couplings: vec![between(Law::Coulomb { torque: 0.02 })] };
        let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
        let mut state = control.start();
        for _ in 0..5000 {
            control.step(&mut state, 0.0, 0.0);
        }
        let [a, b, ..] = state.now.velocity;
        let common = (0.01 * 3.0 - 0.04) / 0.05;
        assert!((a - common).abs() < 1e-12 && (b - common).abs() < 1e-12, "{}: {a} {b}", method.name());
        let apart = state.now.position[0] - state.now.position[1];
        control.step(&mut state, 0.0, 0.0);
        assert!((state.now.position[0] - state.now.position[1] - apart).abs() < 1e-15, "they stick");
    }
}

#[test]
fn a_stack_of_heavy_and_light_bodies_sticks_together() {
    // 1:1000 in inertia: passes over the couplings one by one would converge slowly.
    let inertia = [1e-4, 0.1, 2e-4, 0.05];
    let bodies = inertia.iter().map(|&inertia| body(inertia, 0.1, 0.0)).collect();
    let friction =
        |i: usize, second| Coupling { first: End::Body(i), second, law: Law::Coulomb { torque: 1.0 }, limit: None };
    let push =
        |i, torque| Coupling { first: End::Body(i), second: End::Ground, law: Law::Constant { torque }, limit: None };
    let couplings = vec![
        friction(0, End::Ground),
        friction(1, End::Body(0)),
        friction(2, End::Body(1)),
        friction(3, End::Body(2)),
        push(0, 0.1),
        push(1, -0.3),
        push(2, 0.7),
        push(3, 0.2),
    ];
    let world = World { bodies, couplings };
    for method in METHODS {
        let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
        let mut state = control.start();
        for _ in 0..1000 {
            control.step(&mut state, 0.0, 0.0);
        }
        println!("{}: {} unsettled", method.name(), state.contacts.unsettled);
        assert!(state.now.position[..4].iter().all(|w| (w - 0.1).abs() < 1e-12), "{:?}", state.now);
        assert_eq!(state.contacts.unsettled, 0, "{}", method.name());
    }
}

#[test]
fn the_puck_feels_the_friction_that_was_found() {
    // A weight of 0.2 N·m hangs on the puck by friction of 0.5 N·m: the hand carries it. By friction of 0.1 it slips.
    for method in METHODS {
        for output in Output::ALL {
            for (level, felt) in [(0.5, -0.2), (0.1, -0.1)] {
                for reversed in [false, true] {
                    let (first, second) = if reversed { (End::Body(0), End::Puck) } else { (End::Puck, End::Body(0)) };
                    let couplings = vec![
                        Coupling { first, second, law: Law::Coulomb { torque: level }, limit: None },
                        grounded(Law::Constant { torque: -0.2 }),
                    ];
                    let world = World { bodies: vec![body(0.01, 0.0, 0.0)], couplings };
                    for advance in 0..if output == Output::End { 3 } else { 1 } {
                        let spec = Spec { advance, ..world.spec(method, output, 1e-3) };
                        let control = Small::new(&spec).unwrap();
                        let mut state = control.start();
                        for _ in 0..5 {
                            let torque = control.step(&mut state, 0.0, 0.0).torque;
                            assert!((torque - felt).abs() < 1e-14, "{} {}: {torque}", method.name(), output.name());
                        }
                    }
                }
            }
        }
    }
}
