//! Nonlinear couplings at bodies under zoh, trapezoidal and backward Euler: the discrete-gradient step of docs/contract.md,
//! section 4.
// Tests run where the standard library is.
#![allow(clippy::disallowed_methods, clippy::disallowed_macros)]

mod reference;

use hapt_core::{Body, Coupling, Damping, End, Law, Loop, Method, Output, Real, Side, Spec, State, Vector};
use proptest::prelude::*;
use reference::{World, stored, torque, world};

type Small = Loop<f64, 6, 12, 3>;

const METHODS: [Method; 3] = [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler];
/// Those that keep the energy of what is lossless.
const KEEPING: [Method; 2] = [Method::Zoh, Method::Trapezoidal];

fn list<F: Real, const B: usize>(x: &Vector<F, B>, n: usize) -> Vec<f64> {
    x.position[..n].iter().chain(&x.velocity[..n]).map(|x| x.to_f64()).collect()
}

/// A body J at a position with a velocity.
fn body(inertia: f64, position: f64, velocity: f64) -> Body {
    Body { inertia, position, velocity }
}

/// A body to ground.
fn grounded(law: Law) -> Coupling {
    Coupling { first: End::Body(0), second: End::Ground, law }
}

fn spring(stiffness: f64) -> Law {
    Law::Spring { stiffness, rest: 0.0 }
}

/// A lossless wall below q = 0.
fn floor(stiffness: f64, damping: f64) -> Law {
    Law::Wall { side: Side::Below, at: 0.0, stiffness, damping }
}

/// What the energy did over some steps with the puck held at z, beside the largest energy: the largest gain of one step, the
/// gain and the loss of the whole. And how many steps did not settle.
struct Account {
    step: f64,
    gain: f64,
    loss: f64,
    unsettled: u32,
}

fn account<F: Real>(world: &World, spec: &Spec, z: f64, steps: usize, every: usize) -> Account {
    let control = Loop::<F, 6, 12, 3>::new(spec).unwrap();
    let mut state = control.start();
    let n = world.bodies.len();
    let z = F::from_f64(z);
    control.step(&mut state, z, F::ZERO);
    let (first, mut scale) = world.energy(&list(&state.now, n), z.to_f64());
    let mut last = first;
    let mut account = Account { step: 0.0, gain: 0.0, loss: 0.0, unsettled: 0 };
    for k in 1..=steps {
        control.step(&mut state, z, F::ZERO);
        if k % every != 0 {
            continue;
        }
        let (now, size) = world.energy(&list(&state.now, n), z.to_f64());
        scale = scale.max(size);
        account.step = account.step.max((now - last) / scale);
        account.gain = account.gain.max((now - first) / scale);
        account.loss = account.loss.max((first - now) / scale);
        last = now;
    }
    account.unsettled = state.contacts.unsettled;
    account
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn with_the_puck_held_no_step_gains_energy(world in world(true), angle in 1e-3_f64..1.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f64>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 1e-13, "{}: {:e}", method.name(), account.step);
            prop_assert_eq!(account.unsettled, 0, "{}", method.name());
        }
    }

    /// The fastest swing turns by up to 8 rad a step, and torques need not agree: what is left over is lost.
    #[test]
    fn nor_does_one_that_is_far_too_long_for_its_world(world in world(true), angle in 1.0_f64..8.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f64>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 1e-12, "{}: {:e}", method.name(), account.step);
        }
    }

    #[test]
    fn nor_does_one_on_single_floats(world in world(true), angle in 1e-2_f64..1.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f32>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 4e-5, "{}: {:e}", method.name(), account.step);
        }
    }

    /// The contract's words: each coupling's torque from its own start and end, and the linear part by its method with these held.
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
                    coupling.law = Law::Constant { torque: found };
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
            let run = |clamp: &dyn Fn(Law) -> Law| {
                let couplings = laws.iter().map(|&law| Coupling { first: End::Puck, second: End::Body(0), law: clamp(law) });
                let world = World { bodies: vec![body(0.02, 0.3, -1.0)], couplings: couplings.collect() };
                let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
                let mut state = control.start();
                puck.iter().map(|&(z, v)| control.step(&mut state, z, v).torque).collect::<Vec<_>>()
            };
            for (free, clamped) in run(&|law| law).iter().zip(run(&|law| law.clamped(1e4).unwrap())) {
                prop_assert!((free - clamped).abs() < 1e-11 * (1.0 + free.abs()), "{free} {clamped}");
            }
        }
    }

    #[test]
    fn a_wall_with_damping_never_pulls_and_never_gains(
        inertia in 1e-3_f64..0.1, velocity in -20.0_f64..-0.01, stiffness in 0.0_f64..1e4, damping in 0.0_f64..10.0,
        above in 0.0_f64..1e-2, limit in prop::option::of(0.1_f64..10.0), weight in 0.0_f64..1.0,
    ) {
        let law = floor(stiffness, damping);
        let law = limit.map_or(law, |limit| law.clamped(limit).unwrap());
        let couplings = vec![grounded(law), grounded(Law::Constant { torque: -weight })];
        let world = World { bodies: vec![body(inertia, above, velocity)], couplings };
        for method in METHODS {
            let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
            let mut state = control.start();
            let mut touched = false;
            let mut last = f64::INFINITY;
            for _ in 0..300 {
                let (energy, size) = world.energy(&list(&state.now, 1), 0.0);
                prop_assert!(energy <= last + 1e-13 * size.max(last.abs()) || last.is_infinite(), "{}: {last} {energy}", method.name());
                last = energy;
                control.step(&mut state, 0.0, 0.0);
                let torque = state.contacts.torques[0];
                prop_assert!(torque >= 0.0 && torque <= limit.unwrap_or(f64::INFINITY), "{torque}");
                touched |= torque > 0.0;
            }
            prop_assert!(touched || stiffness + damping < 1e-2 || above > 300.0 * 1e-3 * velocity.abs());
        }
    }

    #[test]
    fn states_of_any_size_end_their_step(
        world in world(true), bits in prop::collection::vec(any::<u64>(), 16), powers in prop::collection::vec(-40_i32..40, 16),
        sane: bool, angle in 1e-3_f64..20.0,
    ) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let control = Small::new(&spec).unwrap();
            let mut state = control.start();
            let number = |i: usize| {
                let any = f64::from_bits(bits[i]);
                if sane { 10_f64.powi(powers[i]) * if bits[i] % 2 == 0 { 1.0 } else { -1.0 } } else { any }
            };
            for i in 0..6 {
                (state.now.position[i], state.now.velocity[i]) = (number(i), number(6 + i));
            }
            for _ in 0..3 {
                let sample = control.step(&mut state, number(12), number(13));
                prop_assert!(!sane || sample.torque.is_finite());
                prop_assert!(!sane || list(&state.now, 6).iter().all(|x| x.is_finite()));
            }
        }
    }
}

/// The contract's torque of a nonlinear coupling at a body from its start and end; for what may be one of many, `found` when it
/// is one of them. `None` for couplings that the method takes by its matrices, or that have no body.
fn by_the_rule(world: &World, c: &Coupling, x: &[f64], next: &[f64], u: (f64, f64), t: f64, found: f64) -> Option<f64> {
    let at_body = matches!(c.first, End::Body(_)) || matches!(c.second, End::Body(_));
    if !at_body || matches!(c.law, Law::Spring { .. } | Law::Damper { .. } | Law::Constant { .. }) {
        return None;
    }
    let (q, end) = (world.relative(c, x, (u.0, 0.0)).0, world.relative(c, next, (u.0, 0.0)).0);
    let d = end - q;
    // V's difference loses its digits in short steps.
    let quotient = if d.abs() > 1e-7 {
        -(stored(&c.law, end) - stored(&c.law, q)) / d
    } else {
        torque(&c.law, (q + end) / 2.0, 0.0)
    };
    let limit = if let Law::Clamped { limit, .. } = c.law { limit } else { f64::INFINITY };
    Some(match c.law.unclamped() {
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
fn a_million_steps_gain_less_than_a_hundred_millionth() {
    let detent = Law::Detent { torque: 0.3, pitch: 0.4, phase: 0.1 };
    let wall = |side, at| Law::Wall { side, at, stiffness: 800.0, damping: 0.0 };
    let between = |first, second, law| Coupling { first, second, law };
    let (a, b, c) = (End::Body(0), End::Body(1), End::Body(2));
    let worlds = [
        // In a box, over detents.
        World {
            bodies: vec![body(0.01, 0.1, 3.0)],
            couplings: vec![grounded(wall(Side::Above, 0.5)), grounded(wall(Side::Below, -0.5)), grounded(detent)],
        },
        // Three in a row, with walls between them, on the puck's spring, which levels off.
        World {
            bodies: vec![body(0.01, 0.0, 3.0), body(0.03, 0.3, 0.0), body(0.02, 0.6, -1.0)],
            couplings: vec![
                between(End::Puck, a, spring(5.0).clamped(0.4).unwrap()),
                between(a, b, wall(Side::Above, -0.1)),
                between(b, c, wall(Side::Above, -0.1)),
                between(c, End::Ground, wall(Side::Above, 1.0)),
                between(b, c, detent),
            ],
        },
    ];
    for world in worlds {
        for method in KEEPING {
            let steps = if cfg!(debug_assertions) { 300_000 } else { 1_000_000 };
            let account = account::<f64>(&world, &world.spec(method, Output::End, 1e-3), 0.2, steps, 100);
            println!("{}: {:e} {:e}", method.name(), account.gain, account.loss);
            assert!(account.gain < 1e-8 && account.loss < 1e-8, "{}: {:e}", method.name(), account.gain);
            assert_eq!(account.unsettled, 0);
        }
    }
}

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
        // Over all phases of the touch within a sample, the largest error of the way back.
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
    let coupling = |i: usize, j: usize, law| Coupling { first: End::Body(i), second: End::Body(j), law };
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
        let way = velocity * velocity / (2.0 * slowing);
        // Backward Euler is late by half a sample, the others by nothing but the last one.
        let error = if method == Method::BackwardEuler { 0.6 * velocity * t } else { slowing * t * t };
        assert!((end.0 - way).abs() <= error, "{}: {} {way}", method.name(), end.0);
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
    let between = |law| Coupling { first: End::Body(0), second: End::Body(1), law };
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
    // 1:1000 in inertia: passes over the couplings one by one would close in slowly.
    let inertia = [1e-4, 0.1, 2e-4, 0.05];
    let bodies = inertia.iter().map(|&inertia| body(inertia, 0.1, 0.0)).collect();
    let friction = |i: usize, second| Coupling { first: End::Body(i), second, law: Law::Coulomb { torque: 1.0 } };
    let push = |i, torque| Coupling { first: End::Body(i), second: End::Ground, law: Law::Constant { torque } };
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
                        Coupling { first, second, law: Law::Coulomb { torque: level } },
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

#[test]
fn the_puck_feels_walls_and_detents_by_their_law_at_the_state_that_the_output_names() {
    let laws =
        [floor(300.0, 0.4), Law::Detent { torque: 0.3, pitch: 0.2, phase: 0.0 }, spring(30.0).clamped(0.5).unwrap()];
    let t = 1e-3;
    for method in METHODS {
        for (output, advance) in [(Output::Start, 0), (Output::Middle, 0), (Output::End, 0), (Output::End, 2)] {
            let couplings = laws.map(|law| Coupling { first: End::Puck, second: End::Body(0), law }).to_vec();
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
        // What was found is an answer, not a memory.
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
