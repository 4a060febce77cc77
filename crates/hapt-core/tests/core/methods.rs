//! Every method obeys its own rule (docs/contract.md, section 4), for every linear world; the explicit ones for every world.

use hapt_core::{Body, Coupling, Damping, End, Law, Loop, Method, Output, Spec, Vector};
use hapt_testing::prelude::*;

use crate::reference::{World, world};

type Small = Loop<f64, 6, 12, 17>;
type State = Vec<f64>;

/// Runs the compiled loop over given samples of the puck and returns x_k at each, x_{k+1} at the end.
fn run<const B: usize, const C: usize>(spec: &Spec, puck: &[(f64, f64)]) -> Vec<State> {
    let compiled = Loop::<f64, B, C, 17>::new(spec).unwrap();
    let mut state = compiled.start();
    let list = |x: &Vector<f64, B>| {
        let n = compiled.bodies();
        x.position[..n].iter().chain(&x.velocity[..n]).copied().collect::<State>()
    };
    let mut states = Vec::new();
    for &(z, v) in puck {
        compiled.step(&mut state, z, v);
        states.push(list(&state.now));
    }
    let mut next = list(&state.now);
    next.iter_mut().zip(list(&state.change)).for_each(|(x, d)| *x += d);
    states.push(next);
    states
}

fn combine(x: &[f64], terms: &[(f64, &[f64])]) -> State {
    let mut out = x.to_vec();
    for (factor, term) in terms {
        out.iter_mut().zip(*term).for_each(|(out, term)| *out += factor * term);
    }
    out
}

/// The largest difference, each entry relative to the size of its kind (positions, velocities).
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() / 2;
    let part = |a: &[f64], b: &[f64]| {
        let size = a.iter().chain(b).fold(1e-3_f64, |m, x| m.max(x.abs()));
        a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs() / size))
    };
    part(&a[..n], &b[..n]).max(part(&a[n..], &b[n..]))
}

/// One step by the rule itself. For the implicit rules this is the right-hand side with x_{k+1} inserted: a fixed point.
fn rule(world: &World, t: f64, method: Method, x: &[f64], next: &[f64], old: (f64, f64), new: (f64, f64)) -> State {
    let f = |x: &[f64], u| world.rate(x, u);
    let n = x.len() / 2;
    match method {
        Method::ForwardEuler => combine(x, &[(t, &f(x, new))]),
        Method::BackwardEuler => combine(x, &[(t, &f(next, new))]),
        Method::SemiImplicitEuler => {
            let mut rate = f(x, new);
            let velocities = combine(&x[n..], &[(t, &rate[n..])]);
            rate[..n].copy_from_slice(&velocities);
            combine(x, &[(t, &rate)])
        }
        Method::Trapezoidal => combine(x, &[(t / 2.0, &f(x, new)), (t / 2.0, &f(next, new))]),
        Method::Tustin => combine(x, &[(t / 2.0, &f(x, old)), (t / 2.0, &f(next, new))]),
        Method::Rk4 => runge_kutta(world, t, x, new, new),
        Method::Zoh => reference_flow(world, t, x, new, new),
        Method::Foh => reference_flow(world, t, x, old, new),
    }
}

/// Classical Runge-Kutta with u running from `old` to `new` over the step.
fn runge_kutta(world: &World, t: f64, x: &[f64], old: (f64, f64), new: (f64, f64)) -> State {
    let middle = ((old.0 + new.0) / 2.0, (old.1 + new.1) / 2.0);
    let k1 = world.rate(x, old);
    let k2 = world.rate(&combine(x, &[(t / 2.0, &k1)]), middle);
    let k3 = world.rate(&combine(x, &[(t / 2.0, &k2)]), middle);
    let k4 = world.rate(&combine(x, &[(t, &k3)]), new);
    combine(x, &[(t / 6.0, &k1), (t / 3.0, &k2), (t / 3.0, &k3), (t / 6.0, &k4)])
}

/// The exact flow, by so many Runge-Kutta steps that their error is negligible.
fn reference_flow(world: &World, t: f64, x: &[f64], old: (f64, f64), new: (f64, f64)) -> State {
    let steps = 3000;
    let at = |i: i32| {
        let part = f64::from(i) / f64::from(steps);
        (old.0 + part * (new.0 - old.0), old.1 + part * (new.1 - old.1))
    };
    (0..steps).fold(x.to_vec(), |x, i| runge_kutta(world, t / f64::from(steps), &x, at(i), at(i + 1)))
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn every_method_takes_a_linear_world_by_its_own_rule(
        world in world(false), angle in 1e-3_f64..2.0, puck in prop::collection::vec((-1.0_f64..1.0, -10.0_f64..10.0), 3),
    ) {
        let t = angle / world.fastest();
        for method in Method::ALL {
            let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
            let states = run::<6, 12>(&world.spec(method, output, t), &puck);
            for k in 0..2 {
                let (x, next) = (&states[k], &states[k + 1]);
                // The held methods step from k to k + 1 with u_k; the others with u_k and u_{k+1}.
                let new = if method.takes_new_sample_first() { puck[k + 1] } else { puck[k] };
                let expected = rule(&world, t, method, x, next, puck[k], new);
                let error = distance(next, &expected);
                prop_assert!(error < 1e-10, "{}: {error:e}\n{next:?}\n{expected:?}", method.name());
            }
        }
    }

    #[test]
    fn the_explicit_methods_take_every_world_by_their_own_rule(
        world in world(true), angle in 1e-3_f64..0.5, puck in prop::collection::vec((-1.0_f64..1.0, -10.0_f64..10.0), 2),
    ) {
        let t = angle / world.fastest();
        for method in [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4] {
            let states = run::<6, 12>(&world.spec(method, Output::Start, t), &puck);
            for k in 0..2 {
                let expected = rule(&world, t, method, &states[k], &[], puck[k], puck[k]);
                let error = distance(&states[k + 1], &expected);
                prop_assert!(error < 1e-11, "{}: {error:e}", method.name());
            }
        }
    }

    #[test]
    fn the_room_that_a_world_is_compiled_into_changes_no_bit(world in world(true), angle in 1e-3_f64..0.5) {
        let spec = world.spec(Method::Rk4, Output::End, angle / world.fastest());
        let puck: Vec<_> = (0..20).map(|k| ((0.3 * f64::from(k)).sin(), 0.0)).collect();
        prop_assert_eq!(run::<6, 12>(&spec, &puck), run::<13, 40>(&spec, &puck));
    }

    #[test]
    fn the_same_source_runs_on_single_floats(world in world(true), angle in 1e-2_f64..0.3) {
        let spec = world.spec(Method::SemiImplicitEuler, Output::End, angle / world.fastest());
        let double = Small::new(&spec).unwrap();
        let single = Loop::<f32, 6, 12, 17>::new(&spec).unwrap();
        let (mut a, mut b) = (double.start(), single.start());
        let expected = double.step(&mut a, 0.25, -1.0).torque;
        let torque = f64::from(single.step(&mut b, 0.25, -1.0).torque);
        prop_assert!((torque - expected).abs() <= 1e-5 * world.torque_scale(), "{} {}", torque, expected);
    }
}

/// A wheel on a shaft, undamped: J in kg·m², k in N·m/rad, 1 Hz.
const WHEEL: (f64, f64) = (0.025801232, 1.0185916);
const STEP: f64 = 0.785;

/// x_k of that wheel after a step of the puck, until 0.7 s: away from the instants at which a first-order error hides in the
/// phase. `more` is in parallel with the spring.
fn swing(method: Method, period: f64, samples: usize, more: Option<Law>) -> Vec<State> {
    let spring = Law::Spring { stiffness: WHEEL.1, rest: 0.0 };
    let law = |law| Coupling { first: End::Puck, second: End::Body(0), law, limit: None };
    let couplings: Vec<Coupling> = std::iter::once(spring).chain(more).map(law).collect();
    let world = World { bodies: vec![Body { inertia: WHEEL.0, position: 0.0, velocity: 0.0 }], couplings };
    run::<1, 2>(&world.spec(method, Output::Start, period), &vec![(STEP, 0.0); samples])
}

fn last(method: Method, period: f64) -> State {
    swing(method, period, (0.7 / period).round() as usize, None).pop().unwrap()
}

#[test]
fn halving_the_period_shows_slope_one_two_and_four_by_the_methods_order() {
    let omega = (WHEEL.1 / WHEEL.0).sqrt();
    for (method, order) in [
        (Method::ForwardEuler, 1.0),
        (Method::BackwardEuler, 1.0),
        (Method::SemiImplicitEuler, 1.0),
        (Method::Trapezoidal, 2.0),
        (Method::Rk4, 4.0),
    ] {
        let error = |period: f64| {
            let x = last(method, period);
            let angle = 0.7 * omega;
            let exact = (STEP * (1.0 - angle.cos()), STEP * omega * angle.sin());
            (x[0] - exact.0).abs().max((x[1] - exact.1).abs() / omega)
        };
        let slope = (error(1.0 / 200.0) / error(1.0 / 400.0)).log2();
        assert!((slope - order).abs() < 0.1, "{}: {slope}", method.name());
    }
}

#[test]
fn the_trapezoidal_rule_and_the_exact_hold_keep_the_true_energy() {
    for method in [Method::Trapezoidal, Method::Zoh] {
        let x = last(method, 1e-2);
        let energy = 0.5 * WHEEL.0 * x[1] * x[1] + 0.5 * WHEEL.1 * (x[0] - STEP) * (x[0] - STEP);
        let start = 0.5 * WHEEL.1 * STEP * STEP;
        assert!((energy / start - 1.0).abs() < 1e-12, "{}: {energy} {start}", method.name());
    }
}

#[test]
fn semi_implicit_euler_keeps_the_energy_that_is_its_own() {
    let t = 0.05;
    let omega2 = WHEEL.1 / WHEEL.0;
    let x = last(Method::SemiImplicitEuler, t);
    let (e, v) = (x[0] - STEP, x[1]);
    // v²/2 + ω²e²/2 - Tω²ev/2, a modified energy.
    let kept = v * v / 2.0 + omega2 * e * e / 2.0 - t * omega2 * e * v / 2.0;
    assert!((kept / (omega2 * STEP * STEP / 2.0) - 1.0).abs() < 1e-12, "{kept}");
}

#[test]
fn a_compensating_damper_keeps_forward_eulers_swing_at_one_amplitude_for_ever() {
    let compensating = Law::Damper { damping: Damping::Compensating };
    let states = swing(Method::ForwardEuler, 1e-3, 60_000, Some(compensating));
    let peak = |states: &[State]| states.iter().fold(0.0_f64, |m, x| m.max((x[0] - STEP).abs()));
    let x = (WHEEL.1 / WHEEL.0).sqrt() * 1e-3;
    let amplitude = STEP / (x / 2.0).asin().cos(); // z0/cos(φ/2), φ = 2 asin(x/2)
    for late in [&states[..2000], &states[58_000..]] {
        let peak = peak(late);
        assert!(peak <= amplitude * (1.0 + 1e-10) && peak > amplitude * (1.0 - 1e-4), "{peak} {amplitude}");
    }
}

#[test]
fn with_a_compensating_damper_forward_euler_is_the_semi_implicit_scheme_step_by_step() {
    // (2.15) makes [1, T; -Tω², 1 - T²ω²] of Euler's matrix: the semi-implicit positions, one sample of phase apart in ẇ.
    let compensating = Law::Damper { damping: Damping::Compensating };
    let period = 0.02;
    let euler = swing(Method::ForwardEuler, period, 500, Some(compensating));
    let omega2 = WHEEL.1 / WHEEL.0;
    for pair in euler.windows(3) {
        // Both obey e_{k+2} - 2 e_{k+1} + e_k = -T²ω² e_{k+1}.
        let [a, b, c] = [pair[0][0] - STEP, pair[1][0] - STEP, pair[2][0] - STEP];
        assert!((c - 2.0 * b + a + period * period * omega2 * b).abs() < 1e-13);
    }
}
