//! The step is the contract's: the torques that it names, the puck's share of them, and nothing else.

use hapt_core::{Coupling, Damping, End, Law, Loop, Method, Output, Side, Spec, State};
use hapt_testing::laws::{SIZES, Sizes, goes_to_bodies};
use hapt_testing::prelude::*;

use super::{METHODS, Small, body, floor, grounded, list, spring};

use crate::reference::{World, stored, torque, world};

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The rule of the contract: each coupling's torque from its own start and end, and the linear part by its method with these held.
    #[test]
    fn the_step_is_the_linear_one_with_the_torques_that_the_rule_names(
        world in world(true), angle in 1e-3_f64..1.0, z in -1.0_f64..1.0, vz in -5.0_f64..5.0,
    ) {
        let t = angle / world.fastest();
        let n = world.bodies.len();
        for method in METHODS {
            let control = Small::new(&world.spec(method, Output::End, t)).unwrap();
            let mut state = control.start();
            for _ in 0..20 {
                control.step(&mut state, z, vz);
                let x = list(&state.now, n);
                let change = list(&state.change, n);
                let next: Vec<f64> = x.iter().zip(&change).map(|(x, d)| x + d).collect();

                let mut held = World { bodies: world.bodies.clone(), couplings: world.couplings.clone() };
                for (i, body) in held.bodies.iter_mut().enumerate() {
                    (body.position, body.velocity) = (x[i], x[n + i]);
                }
                for (coupling, &found) in held.couplings.iter_mut().zip(&state.contacts.torques) {
                    let Some(expected) = by_the_rule(&world, coupling, &x, &next, (z, vz), t, found) else { continue };
                    let size = world.torque_scale();
                    prop_assert!((found - expected).abs() < 1e-8 * size, "{} {:?}: {found} {expected}", method.name(), coupling);
                    (coupling.law, coupling.limit) = (Law::Constant { torque: found }, None);
                }
                let linear = Small::new(&held.spec(method, Output::End, t)).unwrap();
                let mut at = linear.start();
                linear.step(&mut at, z, vz);
                for (a, b) in list(&at.change, n).iter().zip(&change) {
                    prop_assert!((a - b).abs() < 1e-11 * (1.0 + a.abs()), "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_clamp_that_is_not_reached_changes_nothing_under_the_trapezoidal_rule(
        stiffness in 0.1_f64..50.0, damping in 0.0_f64..0.1, puck in prop::collection::vec((-1.0_f64..1.0, -5.0_f64..5.0), 30),
    ) {
        // The mean torque of a spring is that of the middle, and a damper's from the mean velocity: the rule's own. Backward
        // Euler has the mean velocity at the end, too.
        let law = Law::Damper { damping: Damping::Fixed(damping) };
        let laws = [(Method::Trapezoidal, vec![Law::Spring { stiffness, rest: 0.2 }, law]), (Method::BackwardEuler, vec![law])];
        for (method, laws) in laws {
            let run = |limit: Option<f64>| {
                let couplings = laws.iter().map(|&law| Coupling { first: End::Puck, second: End::Body(0), law, limit });
                let world = World { bodies: vec![body(0.02, 0.3, -1.0)], couplings: couplings.collect() };
                let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
                let mut state = control.start();
                puck.iter().map(|&(z, v)| control.step(&mut state, z, v).torque).collect::<Vec<_>>()
            };
            for (free, clamped) in run(None).iter().zip(run(Some(1e4))) {
                prop_assert!((free - clamped).abs() < 1e-11 * (1.0 + free.abs()), "{free} {clamped}");
            }
        }
    }
}

/// One body with several couplings to ground and to the puck, among them detents that its swing passes in a step.
fn crowded() -> impl Strategy<Value = World> {
    let ends = prop_oneof![
        Just((End::Body(0), End::Ground)),
        Just((End::Ground, End::Body(0))),
        Just((End::Puck, End::Body(0))),
        Just((End::Body(0), End::Puck)),
    ];
    let detent = (0.1_f64..1.0, 0.05_f64..0.4, 0.0_f64..0.4).prop_map(|(torque, pitch, phase)| Law::Detent {
        torque,
        pitch,
        phase,
    });
    let sizes = Sizes { stiffness: 1.0..=300.0, damping: 0.0..=0.3, torque: 0.01..=1.0, length: 0.05..=0.3, ..SIZES };
    let law = prop_oneof![detent.clone(), sizes.laws(goes_to_bodies)];
    let more = prop::collection::vec((ends.clone(), law, prop::option::of(0.2_f64..2.0)), 1..4);
    let steep = prop::collection::vec((ends, detent), 2..4);
    (steep, more, 1e-3_f64..1e-2, -1.0_f64..1.0, -20.0_f64..20.0).prop_map(
        |(steep, more, inertia, position, velocity)| {
            let steep = steep.into_iter().map(|(ends, law)| (ends, law, None));
            let all = steep.chain(more).map(|((first, second), law, limit)| Coupling {
                first,
                second,
                law,
                limit: limit.filter(|_| law.takes_limit()),
            });
            World { bodies: vec![body(inertia, position, velocity)], couplings: all.collect() }
        },
    )
}

proptest! {
    #![proptest_config(hapt_testing::cases(400))]

    /// All couplings of one body have one equation together, which a bracket finds however steep they are.
    #[test]
    fn every_step_of_one_body_is_the_rules_however_far_its_detents_swing_it(
        world in crowded(), angle in 0.5_f64..30.0, z in -1.0_f64..1.0, vz in -5.0_f64..5.0,
    ) {
        let t = angle / world.fastest();
        for method in METHODS {
            let control = Small::new(&world.spec(method, Output::End, t)).unwrap();
            let mut state = control.start();
            for _ in 0..50 {
                control.step(&mut state, z, vz);
                prop_assert_eq!(state.contacts.unsettled, 0, "{}", method.name());
                let (x, change) = (list(&state.now, 1), list(&state.change, 1));
                let next: Vec<f64> = x.iter().zip(&change).map(|(x, d)| x + d).collect();
                for (coupling, &found) in world.couplings.iter().zip(&state.contacts.torques) {
                    let Some(expected) = by_the_rule(&world, coupling, &x, &next, (z, vz), t, found) else { continue };
                    let size = world.torque_scale() * (1.0 + x[0].abs());
                    prop_assert!((found - expected).abs() < 1e-7 * size, "{} {:?}: {found} {expected}", method.name(), coupling);
                }
            }
        }
    }
}

/// The contract's torque of a nonlinear coupling at a body from its start and end; for a torque that is not unique, `found` when it is a
/// valid one. `None` for couplings that are in the method's matrices, or that have no body.
fn by_the_rule(world: &World, c: &Coupling, x: &[f64], next: &[f64], u: (f64, f64), t: f64, found: f64) -> Option<f64> {
    let at_body = matches!(c.first, End::Body(_)) || matches!(c.second, End::Body(_));
    if !at_body || c.linear().is_some() {
        return None;
    }
    let (q, end) = (world.relative(c, x, (u.0, 0.0)).0, world.relative(c, next, (u.0, 0.0)).0);
    let d = end - q;
    // V's difference loses its digits in short steps.
    let quotient = if d.abs() > 1e-7 { -(stored(c, end) - stored(c, q)) / d } else { torque(c, (q + end) / 2.0, 0.0) };
    let limit = c.limit.unwrap_or(f64::INFINITY);
    Some(match c.law {
        Law::Wall { side, at, damping, .. } => {
            let sign = if side == Side::Above { 1.0 } else { -1.0 };
            let middle = sign * ((q + end) / 2.0 - at);
            let damped = |part: f64| (sign * (quotient - part * damping * d / t)).clamp(-limit, 0.0) * sign;
            if middle.abs() < 1e-9 * (1.0 + q.abs()) {
                // At the edge, with a part of the damping.
                found.clamp(damped(0.0).min(damped(1.0)), damped(0.0).max(damped(1.0)))
            } else {
                damped(if middle > 0.0 { 1.0 } else { 0.0 })
            }
        }
        Law::Damper { damping: Damping::Fixed(damping) } => {
            let carried = world.relative(c, &vec![0.0; x.len()], u).1;
            (-damping * (d / t + carried)).clamp(-limit, limit)
        }
        Law::Coulomb { torque } => {
            // Within the level, and against the motion.
            assert!(found.abs() <= torque && found * d <= 1e-13, "{found} {d}");
            found
        }
        _ => quotient,
    })
}

#[test]
fn the_puck_feels_walls_and_detents_by_their_law_at_the_state_that_the_output_names() {
    let laws = [
        (floor(300.0, 0.4), None),
        (Law::Detent { torque: 0.3, pitch: 0.2, phase: 0.0 }, None),
        (spring(30.0), Some(0.5)),
    ];
    let t = 1e-3;
    for method in METHODS {
        for (output, advance) in [(Output::Start, 0), (Output::Middle, 0), (Output::End, 0), (Output::End, 2)] {
            let couplings =
                laws.map(|(law, limit)| Coupling { first: End::Puck, second: End::Body(0), law, limit }).to_vec();
            let world = World { bodies: vec![body(0.01, 0.05, -2.0)], couplings };
            let control = Small::new(&Spec { advance, ..world.spec(method, output, t) }).unwrap();
            let mut state = control.start();
            for k in 0..100 {
                let u = (0.04 * f64::from(k % 7), 1.0);
                let felt = control.step(&mut state, u.0, u.1).torque;
                let (mut x, mut change) = (list(&state.now, 1), list(&state.change, 1));
                let add = |x: &[f64], part: f64, d: &[f64]| vec![x[0] + part * d[0], x[1] + part * d[1]];
                match output {
                    Output::Start => {}
                    Output::Middle => x = add(&x, 0.5, &change),
                    Output::End => {
                        x = add(&x, 1.0, &change);
                        let mut ahead = state;
                        for _ in 0..advance {
                            control.step(&mut ahead, u.0, 0.0);
                            change = list(&ahead.change, 1);
                            x = add(&list(&ahead.now, 1), 1.0, &change);
                        }
                        x[1] = change[0] / t;
                    }
                }
                let expected = world.torque(&x, u);
                assert!((felt - expected).abs() < 1e-10, "{} {}: {felt} {expected}", method.name(), output.name());
            }
        }
    }
}

#[test]
fn a_world_without_contact_moves_as_one_without_walls_to_the_last_bit() {
    let run = |walls: bool, method| {
        let mut couplings = vec![grounded(spring(3.0))];
        if walls {
            couplings.push(grounded(Law::Wall { side: Side::Above, at: 1.0, stiffness: 1e5, damping: 1.0 }));
            couplings.push(grounded(Law::Wall { side: Side::Below, at: -1.0, stiffness: 1e5, damping: 1.0 }));
        }
        let world = World { bodies: vec![body(0.01, 0.5, 1.0)], couplings };
        let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
        let mut state = control.start();
        (0..1000).for_each(|_| {
            control.step(&mut state, 0.0, 0.0);
        });
        state.now
    };
    for method in METHODS {
        assert_eq!(run(true, method), run(false, method));
    }
}

#[test]
fn a_state_goes_on_from_where_it_is() {
    fn resumes<const B: usize, const C: usize>(spec: &Spec) -> State<f64, B, C, 2> {
        let control = Loop::<f64, B, C, 2>::new(spec).unwrap();
        let mut state = control.start();
        (0..50).for_each(|_| {
            control.step(&mut state, 0.1, 0.0);
        });
        // The result does not depend on the torques of the last step.
        let mut forgetful = state;
        forgetful.contacts.torques = [7.0; C];
        control.step(&mut state, 0.1, 0.0);
        control.step(&mut forgetful, 0.1, 0.0);
        assert_eq!(state, forgetful);
        state
    }
    let couplings = vec![grounded(floor(800.0, 0.01)), grounded(Law::Coulomb { torque: 0.01 }), grounded(spring(1.0))];
    let world = World { bodies: vec![body(0.01, 0.1, -3.0)], couplings };
    let spec = world.spec(Method::Zoh, Output::End, 1e-3);
    let (small, large) = (resumes::<1, 3>(&spec), resumes::<7, 20>(&spec));
    assert_eq!((small.now.position[0], small.now.velocity[0]), (large.now.position[0], large.now.velocity[0]));
    assert_eq!(small.contacts.torques, large.contacts.torques[..3]);
}
