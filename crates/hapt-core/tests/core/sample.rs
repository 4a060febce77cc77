//! One sample, step by step as docs/contract.md, section 3 has it: the encoder, the velocity, the torque's state.

use hapt_core::{Body, Coupling, End, Estimator, Law, Loop, Method, Output, Spec};
use hapt_testing::prelude::*;

use crate::reference::{World, world};

type Small = Loop<f64, 6, 12, 33>;

const TAU: f64 = std::f64::consts::TAU;

const EMPTY: Spec = Spec::new(1e-3);

/// The loop's measurements at each of the positions.
fn measure(spec: &Spec, positions: &[f64]) -> Vec<(f64, f64)> {
    let compiled = Small::new(spec).unwrap();
    let mut state = compiled.start();
    let sample = |&z: &f64| {
        let puck = compiled.step(&mut state, z, 0.0).puck;
        (puck.position, puck.velocity)
    };
    positions.iter().map(sample).collect()
}

#[test]
fn a_count_is_the_nearest_and_a_tie_within_a_billionth_goes_up() {
    let count = TAU / 4000.0;
    let spec = Spec { count: Some(count), ..EMPTY };
    for (position, counts) in [
        (0.49, 0.0),
        (0.5, 1.0),
        (0.5 - 0.9e-9, 1.0),
        (0.5 - 1.2e-9, 0.0),
        (-0.5, 0.0),
        (-0.51, -1.0),
        (1234.4, 1234.0),
    ] {
        assert_eq!(measure(&spec, &[position * count])[0].0, counts * count, "{position}");
    }
}

#[test]
fn the_exact_estimator_is_told_the_velocity_at_the_first_sample_too() {
    let compiled = Small::new(&EMPTY).unwrap();
    assert_eq!(compiled.step(&mut compiled.start(), 0.1, -3.5).puck.velocity, -3.5);
}

/// foaw by the contract's definition: every length, every sample in between, one by one.
fn slow_foaw(counts: &[f64], window: usize, best: bool) -> f64 {
    let k = counts.len() - 1;
    let inside = |n: usize| {
        (1..n).all(|j| {
            let line = counts[k] + (counts[k - n] - counts[k]) * j as f64 / n as f64;
            (counts[k - j] - line).abs() <= 1.0 + 1e-9
        })
    };
    let n = (1..=window.min(k)).take_while(|&n| (1..=n).all(inside)).last().unwrap_or(0);
    if n == 0 {
        return 0.0;
    }
    if !best {
        return (counts[k] - counts[k - n]) / n as f64;
    }
    let mean = |f: &dyn Fn(usize) -> f64| (0..=n).map(f).sum::<f64>() / (n + 1) as f64;
    let (t, y) = (mean(&|j| -(j as f64)), mean(&|j| counts[k - j]));
    let top = mean(&|j| (-(j as f64) - t) * (counts[k - j] - y));
    top / mean(&|j| (-(j as f64) - t).powi(2))
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    #[test]
    fn foaw_is_what_its_definition_says(
        steps in prop::collection::vec(-3_i32..4, 1..80), calm in 0.0_f64..2.0, window in 1_u32..32, best in any::<bool>(),
    ) {
        let count = TAU / 500.0;
        let estimator = if best { Estimator::FoawBest { window } } else { Estimator::Foaw { window } };
        let spec = Spec { count: Some(count), estimator, ..EMPTY };
        // Slow drifts make long windows, jumps make short ones.
        let mut z = 0.0;
        let positions: Vec<f64> = steps.iter().map(|&step| {
            z += calm + if step == 3 { 5.0 } else { 0.1 * f64::from(step) };
            z * count
        }).collect();
        let measured = measure(&spec, &positions);
        let counts: Vec<f64> = measured.iter().map(|(z, _)| (z / count).round()).collect();
        for k in 0..counts.len() {
            let expected = slow_foaw(&counts[..=k], window as usize, best) * count / 1e-3;
            prop_assert!((measured[k].1 - expected).abs() <= 1e-9 * (1.0 + expected.abs()), "{k}: {} {expected}", measured[k].1);
        }
    }

    #[test]
    fn difference_and_low_pass_are_their_equations(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..30), cutoff in 1.0_f64..1000.0,
    ) {
        let difference = measure(&Spec { estimator: Estimator::Difference, ..EMPTY }, &positions);
        let ideal_foaw = measure(&Spec { estimator: Estimator::Foaw { window: 9 }, ..EMPTY }, &positions);
        let low_pass = measure(&Spec { estimator: Estimator::LowPass { cutoff }, ..EMPTY }, &positions);
        let (t, tau) = (1e-3, 1.0 / (TAU * cutoff));
        let mut v = 0.0;
        prop_assert_eq!((difference[0].1, low_pass[0].1), (0.0, 0.0));
        for k in 1..positions.len() {
            let step = positions[k] - positions[k - 1];
            v = (tau * v + step) / (tau + t);
            prop_assert!((difference[k].1 - step / t).abs() < 1e-9);
            prop_assert_eq!(ideal_foaw[k].1, difference[k].1, "an ideal encoder has n = 1");
            prop_assert!((low_pass[k].1 - v).abs() < 1e-9 * (1.0 + v.abs()));
        }
    }

    #[test]
    fn a_difference_over_samples_is_its_equation_and_over_one_the_difference_to_the_bit(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..60), every in 1_u32..32, is_counted in any::<bool>(),
    ) {
        let spec = Spec { count: is_counted.then_some(TAU / 500.0), ..EMPTY };
        let measured = measure(&Spec { estimator: Estimator::DifferenceOver { every }, ..spec }, &positions);
        for (k, (z, v)) in measured.iter().enumerate() {
            let before = measured[k.saturating_sub(every as usize)].0;
            let expected = (z - before) / (f64::from(every) * 1e-3);
            prop_assert!((v - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{k}: {v} {expected}");
        }
        let over_one = measure(&Spec { estimator: Estimator::DifferenceOver { every: 1 }, ..spec }, &positions);
        prop_assert_eq!(over_one, measure(&Spec { estimator: Estimator::Difference, ..spec }, &positions));
    }

    /// The world sees the filtered position, and the estimator the measured one: a spring and a damper, with and without a count.
    #[test]
    fn a_filter_shows_the_world_its_equation_and_leaves_the_velocity(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..40), filter in 1.0_f64..1000.0,
        is_counted in any::<bool>(), first in any::<bool>(),
    ) {
        let laws = [Law::Spring { stiffness: 2.0, rest: 0.1 }, Law::Damper { damping: hapt_core::Damping::Fixed(0.3) }];
        let couplings = laws.map(|law| law.between(End::Puck, End::Ground));
        let (method, output) = if first { (Method::Tustin, Output::Start) } else { (Method::Zoh, Output::End) };
        let count = is_counted.then_some(TAU / 500.0);
        let spec = Spec { method, output, estimator: Estimator::Difference, count, couplings: &couplings, ..EMPTY };
        let (plain, filtered) = (Small::new(&spec).unwrap(), Small::new(&Spec { filter: Some(filter), ..spec }).unwrap());
        let (mut one, mut other) = (plain.start(), filtered.start());
        let pole = (-TAU * filter * 1e-3).exp();
        let mut seen = None;
        for &z in &positions {
            let (a, b) = (plain.step(&mut one, z, 0.0), filtered.step(&mut other, z, 0.0));
            prop_assert_eq!(a.puck, b.puck);
            let y = seen.map_or(a.puck.position, |y: f64| pole * y + (1.0 - pole) * a.puck.position);
            seen = Some(y);
            prop_assert!((b.torque - a.torque - 2.0 * (a.puck.position - y)).abs() < 1e-12, "{} {}", b.torque, a.torque);
        }
    }

    /// With a body, held still: it oscillates about the filtered position, under any method.
    #[test]
    fn a_body_is_moved_by_the_filtered_position(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..40), filter in 5.0_f64..300.0, method in 0..Method::ALL.len(),
    ) {
        let method = Method::ALL[method];
        let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
        let bodies = [Body { inertia: 0.01, position: 0.0, velocity: 0.0 }];
        let couplings = [Law::Spring { stiffness: 2.0, rest: 0.0 }.between(End::Puck, End::Body(0))];
        let spec = Spec { method, output, bodies: &bodies, couplings: &couplings, ..EMPTY };
        let (plain, filtered) = (Small::new(&spec).unwrap(), Small::new(&Spec { filter: Some(filter), ..spec }).unwrap());
        let (mut one, mut other) = (plain.start(), filtered.start());
        let gain = -(-TAU * filter * 1e-3).exp_m1();
        let mut seen = None;
        for &z in &positions {
            let y = seen.map_or(z, |y: f64| y + gain * (z - y));
            seen = Some(y);
            let (a, b) = (plain.step(&mut one, y, 0.0), filtered.step(&mut other, z, 0.0));
            prop_assert!((a.torque - b.torque).abs() < 1e-12 && b.puck.position == z);
        }
    }

    #[test]
    fn the_torque_is_the_couplings_at_the_state_that_the_output_names(
        world in world(true), angle in 1e-3_f64..0.3, advance in 0_u32..4, z in -1.0_f64..1.0, v in -5.0_f64..5.0,
    ) {
        let t = angle / world.fastest();
        for method in [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4] {
            for output in Output::ALL {
                let ahead = if output == Output::End { advance } else { 0 };
                let spec = Spec { advance: ahead, ..world.spec(method, output, t) };
                let compiled = Small::new(&spec).unwrap();
                let mut state = compiled.start();
                let sample = compiled.step(&mut state, z, v);
                let expected = torque_by_the_contract(&world, &compiled, &state, output, ahead, t, (z, v));
                let scale = world.torque_scale();
                prop_assert!((sample.torque - expected).abs() < 1e-11 * scale, "{} {}: {} {expected}",
                    method.name(), output.name(), sample.torque);
                prop_assert_eq!(sample.torque, sample.command);
            }
        }
    }
}

/// Steps ahead are taken with a second loop: the same world, its puck held still.
fn torque_by_the_contract(
    world: &World,
    compiled: &Small,
    state: &hapt_core::State<f64, 6, 12, 33>,
    output: Output,
    advance: u32,
    t: f64,
    u: (f64, f64),
) -> f64 {
    let n = world.bodies.len();
    let now: Vec<f64> = state.now.position[..n].iter().chain(&state.now.velocity[..n]).copied().collect();
    let change: Vec<f64> = state.change.position[..n].iter().chain(&state.change.velocity[..n]).copied().collect();
    let plus = |x: &[f64], factor: f64, d: &[f64]| x.iter().zip(d).map(|(x, d)| x + factor * d).collect::<Vec<_>>();
    match output {
        Output::Start => world.torque(&now, u),
        Output::Middle => world.torque(&plus(&now, 0.5, &change), u),
        Output::End => {
            let mut ahead = *state;
            let (mut x, mut d) = (plus(&now, 1.0, &change), change);
            for _ in 0..advance {
                compiled.step(&mut ahead, u.0, 0.0);
                x = ahead.now.position[..n].iter().chain(&ahead.now.velocity[..n]).copied().collect();
                d = ahead.change.position[..n].iter().chain(&ahead.change.velocity[..n]).copied().collect();
                x = plus(&x, 1.0, &d);
            }
            let mean: Vec<f64> = d[..n].iter().map(|d| d / t).collect();
            x[n..].copy_from_slice(&mean);
            world.torque(&x, u)
        }
    }
}

#[test]
fn tustin_and_foh_do_nothing_at_the_first_sample() {
    let world = World {
        bodies: vec![Body { inertia: 0.02, position: 0.3, velocity: 2.0 }],
        couplings: vec![Coupling {
            first: End::Puck,
            second: End::Body(0),
            law: Law::Spring { stiffness: 1.0, rest: 0.0 },
            limit: None,
        }],
    };
    for method in [Method::Tustin, Method::Foh] {
        let compiled = Small::new(&world.spec(method, Output::Start, 1e-3)).unwrap();
        let mut state = compiled.start();
        let sample = compiled.step(&mut state, 0.7, 0.0);
        assert_eq!((state.now.position[0], state.now.velocity[0]), (0.3, 2.0));
        assert!((sample.torque - (0.3 - 0.7)).abs() < 1e-15);
        compiled.step(&mut state, 0.7, 0.0);
        assert_ne!(state.now.position[0], 0.3);
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn a_bristle_is_bent_at_the_sample_and_then_stands(
        levels in (0.01_f64..0.1, 0.0_f64..0.1), stribeck_velocity in 0.05_f64..2.0, bristle in (1.0_f64..500.0, 0.0_f64..0.1),
        viscous in 0.0_f64..0.01, puck in prop::collection::vec((-0.5_f64..0.5, -3.0_f64..3.0), 6), reversed in any::<bool>(),
    ) {
        let (coulomb, stribeck) = (levels.0, levels.0 + levels.1);
        let (bristle_stiffness, bristle_damping) = bristle;
        let law = Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous };
        let (first, second) = if reversed { (End::Body(0), End::Puck) } else { (End::Puck, End::Body(0)) };
        let couplings = [Coupling { first, second, law, limit: None }];
        let (inertia, t) = (0.05, 1e-3);
        let bodies = [Body { inertia, position: 0.1, velocity: -0.4 }];
        let g = |v: f64| coulomb + (stribeck - coulomb) * (-(v / stribeck_velocity).powi(2)).exp();
        // The torque on the puck at relative velocity v (puck from body) with the bristle at s.
        let torque = |v: f64, s: f64| {
            let slip = v - bristle_stiffness * v.abs() * s / g(v);
            -(bristle_stiffness * s + bristle_damping * slip + viscous * v)
        };
        for method in [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4] {
            let spec = Spec { period: t, method, output: Output::Start, bodies: &bodies, couplings: &couplings, ..EMPTY };
            let compiled = Small::new(&spec).unwrap();
            let mut state = compiled.start();
            let (mut w, mut v, mut s) = (0.1, -0.4, 0.0);
            for &(z, vz) in &puck {
                let sample = compiled.step(&mut state, z, vz);
                let slide = vz - v;
                // ds/dt = v - a s over T, exactly.
                let a = bristle_stiffness * slide.abs() / g(slide);
                s = if a > 0.0 { s * (-a * t).exp() + slide / a * (1.0 - (-a * t).exp()) } else { s };
                prop_assert!((sample.torque - torque(slide, s)).abs() < 1e-9, "{} {}", sample.torque, torque(slide, s));
                let rate = |v: f64| -torque(vz - v, s) / inertia;
                let (v0, k1) = (v, rate(v));
                match method {
                    Method::ForwardEuler => (w, v) = (w + t * v0, v0 + t * k1),
                    Method::SemiImplicitEuler => {
                        v = v0 + t * k1;
                        w += t * v;
                    }
                    _ => {
                        let k2 = rate(v0 + t / 2.0 * k1);
                        let k3 = rate(v0 + t / 2.0 * k2);
                        let k4 = rate(v0 + t * k3);
                        w += t * v0 + t * t / 6.0 * (k1 + k2 + k3);
                        v = v0 + t / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                    }
                }
                prop_assert!((state.now.velocity[0] + state.change.velocity[0] - v).abs() < 1e-9);
                prop_assert!((state.now.position[0] + state.change.position[0] - w).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn a_state_of_any_bits_gives_a_command_within_the_limit() {
    for estimator in [Estimator::Foaw { window: 16 }, Estimator::DifferenceOver { every: 16 }] {
        of_any_bits(Spec { estimator, count: Some(1e-3), limit: Some(0.5), ..EMPTY });
    }
}

fn of_any_bits(spec: Spec) {
    let control = Loop::<f64, 1, 1, 17>::new(&spec).unwrap();
    for place in [0, 16, 17, usize::MAX - 1, usize::MAX] {
        for number in [f64::NAN, f64::INFINITY, -1e308, 0.0] {
            let mut state = control.start();
            (state.memory.newest, state.memory.older) = (place, place);
            state.memory.counts = [number; 17];
            for position in [0.1, number] {
                let command = control.step(&mut state, position, number).command;
                assert!(command.abs() <= 0.5, "{command}");
            }
        }
    }
}

proptest! {
    /// The filter as its definition has it, with the gains that the core gives.
    #[test]
    fn kalman_is_its_equations(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..60), cutoff in 1.0_f64..1000.0, is_counted in any::<bool>(),
    ) {
        let spec = Spec { count: is_counted.then_some(TAU / 500.0), ..EMPTY };
        let measured = measure(&Spec { estimator: Estimator::Kalman { cutoff }, ..spec }, &positions);
        let [alpha, beta, gamma] = hapt_core::kalman_gains(TAU * cutoff * 1e-3);
        let t = 1e-3;
        let (mut p, mut v, mut a) = (measured[0].0, 0.0, 0.0);
        prop_assert_eq!(measured[0].1, 0.0);
        for (z, velocity) in &measured[1..] {
            let error = z - (p + t * v + 0.5 * t * t * a);
            (p, v, a) = (z - error + alpha * error, v + t * a + beta / t * error, a + gamma / (t * t) * error);
            prop_assert!((velocity - v).abs() < 1e-8 * (1.0 + v.abs()), "{velocity} {v}");
        }
    }

    /// It follows a motion of constant acceleration without an error.
    #[test]
    fn kalman_follows_a_constant_acceleration(
        (z, v, a) in (-1.0_f64..1.0, -10.0_f64..10.0, -100.0_f64..100.0), cutoff in 5.0_f64..400.0,
    ) {
        let at = |k: usize| { let t = 1e-3 * k as f64; z + v * t + 0.5 * a * t * t };
        let samples = (30.0 / (1e-3 * cutoff)) as usize;
        let positions: Vec<f64> = (0..=samples).map(at).collect();
        let measured = measure(&Spec { estimator: Estimator::Kalman { cutoff }, ..EMPTY }, &positions);
        let now = v + a * 1e-3 * samples as f64;
        prop_assert!((measured[samples].1 - now).abs() < 1e-6 * (1.0 + now.abs() + a.abs()), "{} {now}", measured[samples].1);
    }

    /// As long as no change of the velocity is beyond 1.1 L T, Levant's differentiator is the difference, to the bit; and no change of its own
    /// velocity ever is.
    #[test]
    fn levant_is_the_difference_of_motions_within_its_acceleration(
        accelerations in prop::collection::vec(-1.0_f64..1.0, 2..200), acceleration in 1.0_f64..1e4,
    ) {
        let (mut v, mut z) = (0.0, 0.3);
        let positions: Vec<f64> = accelerations.iter().map(|part| {
            z += 1e-3 * v;
            v += 1e-3 * acceleration * part;
            z
        }).collect();
        let levant = measure(&Spec { estimator: Estimator::Levant { acceleration }, ..EMPTY }, &positions);
        prop_assert_eq!(levant, measure(&Spec { estimator: Estimator::Difference, ..EMPTY }, &positions));
    }

    /// The implicit step solves its equation, whatever the positions are, and it arrives at a steady motion.
    #[test]
    fn levant_solves_its_equation_and_arrives(
        positions in prop::collection::vec(-1.0_f64..1.0, 2..60), acceleration in 1.0_f64..1e6, speed in -5.0_f64..5.0,
    ) {
        let t = 1e-3;
        let mut all = positions.clone();
        let last = positions[positions.len() - 1];
        // It brakes at 1.1 L from any speed that it has, and comes back from beyond.
        let long = 100 + (4e3 * (20.0 / acceleration).sqrt() + 4e3 * 1e3 / acceleration) as usize;
        all.extend((1..long).map(|k| last + speed * t * k as f64));
        let levant = measure(&Spec { estimator: Estimator::Levant { acceleration }, ..EMPTY }, &all);
        let (mut x, mut v) = (all[0], 0.0);
        for (z, found) in &levant[1..] {
            let before = x + t * v - z;
            let change = (v - found) / (1.1 * acceleration * t);
            prop_assert!(change.abs() <= 1.0 + 1e-9);
            // e + 1.5 √L T √|e| sgn e + 1.1 L T² s = e₀
            let e = if change.abs() < 1.0 - 1e-9 { 0.0 } else {
                let rest = before.abs() - 1.1 * acceleration * t * t;
                let pull = 1.5 * acceleration.sqrt() * t;
                let root = 0.5 * ((pull * pull + 4.0 * rest.max(0.0)).sqrt() - pull);
                change.signum() * root * root
            };
            let sum = e + 1.5 * acceleration.sqrt() * t * e.abs().sqrt() * change + 1.1 * acceleration * t * t * change;
            prop_assert!((sum - before).abs() < 1e-9 * (1.0 + before.abs()), "{sum} {before}");
            (x, v) = (z + e, *found);
        }
        prop_assert!((levant[levant.len() - 1].1 - speed).abs() < 1e-6 * (1.0 + speed.abs()), "{:?} {speed}", levant.last());
    }
}
