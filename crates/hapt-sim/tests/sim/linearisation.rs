//! The core's real step, linearised, against the laboratory's matrices. The two share no code.
#![allow(clippy::needless_range_loop)] // Rows and columns, as on paper.

use hapt_analysis::{Continuous, Discrete, Slopes};
use hapt_core::{Loop, Real, State};
use hapt_model::*;
use hapt_testing::prelude::*;

const B: usize = 6;
type Room<F> = Loop<F, B, 16, 2>;

#[derive(Clone, Debug)]
struct Linear {
    bodies: Vec<Body>,
    couplings: Vec<Coupling>,
    period: f64,
    advance: u32,
}

impl Linear {
    fn spec(&self, method: Method, output: Output) -> Spec<'_> {
        Spec {
            method,
            output,
            advance: if output == Output::End { self.advance } else { 0 },
            bodies: &self.bodies,
            couplings: &self.couplings,
            ..Spec::new(self.period)
        }
    }

    /// Rates and torques that make the matrices' entries comparable.
    fn scales(&self) -> (f64, f64) {
        let lightest = self.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
        let (mut k, mut c) = (0.0, 0.0);
        for coupling in &self.couplings {
            match coupling.law {
                Law::Spring { stiffness, .. } => k += stiffness,
                Law::Damper { damping: Damping::Fixed(damping) } => c += damping,
                _ => {}
            }
        }
        let rate = (2.0 * k / lightest).sqrt() + 2.0 * c / lightest + 1.0;
        (rate, k + c * rate + 1e-3)
    }
}

fn linear(affine: bool) -> impl Strategy<Value = Linear> {
    let body = (-4.0_f64..-1.0).prop_map(|log| Body { inertia: 10_f64.powf(log), position: 0.0, velocity: 0.0 });
    let bodies = prop::collection::vec(body, 1..=B);
    (bodies, -4.0_f64..0.5, 0_u32..5).prop_flat_map(move |(bodies, log_angle, advance)| {
        let n = bodies.len();
        let end = move |i: usize| match i {
            i if i < n => End::Body(i),
            i if i == n => End::Puck,
            _ => End::Ground,
        };
        let rest = if affine { -1.0..1.0 } else { 0.0..f64::MIN_POSITIVE };
        let law = prop_oneof![
            3 => (-2.0_f64..2.0, rest.clone()).prop_map(move |(log, rest)| Law::Spring {
                stiffness: 10_f64.powf(log), rest: if affine { rest } else { 0.0 } }),
            1 => (-5.0_f64..-1.0).prop_map(|log| Law::Damper { damping: Damping::Fixed(10_f64.powf(log)) }),
            1 => rest.prop_map(move |torque| if affine { Law::Constant { torque } } else { Law::Spring { stiffness: 1.0, rest: 0.0 } }),
        ];
        let coupling = (0..n + 2, 0..n + 2, law)
            .prop_filter("two ends", |(a, b, _)| a != b)
            .prop_map(move |(a, b, law)| Coupling { first: end(a), second: end(b), law, limit: None });
        (prop::collection::vec(coupling, 1..12), any::<bool>()).prop_map(move |(mut couplings, compensate)| {
            let spring = couplings.iter().find(|coupling| matches!(coupling.law, Law::Spring { .. })).copied();
            if let (true, Some(spring)) = (compensate, spring) {
                couplings.push(Coupling { law: Law::Damper { damping: Damping::Compensating }, ..spring });
            }
            let mut world = Linear { bodies: bodies.clone(), couplings, period: 1.0, advance };
            world.period = 10_f64.powf(log_angle) / world.scales().0;
            world
        })
    })
}

/// One real step from x with u before and at the sample: the new increment and the torque.
fn step<F: Real>(control: &Room<F>, x: &[f64], last: Option<(f64, f64)>, u: (f64, f64)) -> (Vec<f64>, f64) {
    let n = control.bodies();
    let mut state: State<F, B, 16, 2> = control.start();
    for i in 0..n {
        state.now.position[i] = F::from_f64(x[i]);
        state.now.velocity[i] = F::from_f64(x[n + i]);
    }
    let before = state.now;
    state.memory.last = last.map(|(z, v)| hapt_core::Puck { position: F::from_f64(z), velocity: F::from_f64(v) });
    let torque = control.step(&mut state, F::from_f64(u.0), F::from_f64(u.1)).torque.to_f64();
    let list = |x: &hapt_core::Vector<F, B>| {
        x.position[..n].iter().chain(&x.velocity[..n]).map(|x| x.to_f64()).collect::<Vec<_>>()
    };
    let (held, now, before) = (list(&state.change), list(&state.now), list(&before));
    // The increment of x, which methods that take the new sample first apply at once.
    let change = held.iter().zip(now.iter().zip(&before)).map(|(held, (now, before))| held + (now - before)).collect();
    (change, torque)
}

/// Compares every column; `tolerance` is relative to the largest entry of each kind.
fn compare<F: Real>(world: &Linear, method: Method, output: Output, tolerance: f64) -> Result<(), TestCaseError> {
    let spec = world.spec(method, output);
    let control = Room::<F>::new(&spec).unwrap();
    let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
    let discrete = Discrete::new(&continuous, method, output, spec.advance, spec.period).unwrap();
    let n = world.bodies.len();
    let (rate, torque_scale) = world.scales();
    let first = method.takes_new_sample_first();
    let origin = vec![0.0; 2 * n];
    let check = |name: &str, unit: f64, got: (Vec<f64>, f64), row: &[f64], torque: f64| {
        for i in 0..2 * n {
            let size = if i < n { 1.0 } else { rate };
            let error = (got.0[i] - row[i]).abs() * unit / size;
            prop_assert!(
                error <= tolerance,
                "{} {name} row {i}: {:e} {:e}, {error:e}",
                method.name(),
                got.0[i],
                row[i]
            );
        }
        // An unstable rule taken further steps ahead multiplies the torque, and its rounding with it.
        let largest = discrete
            .torque
            .state
            .iter()
            .enumerate()
            .fold(torque_scale, |m, (j, x)| m.max(x.abs() * if j < n { 1.0 } else { rate }));
        let error = (got.1 - torque).abs() * unit / largest;
        prop_assert!(
            error <= tolerance,
            "{} {} {name} torque: {:e} {:e}, {error:e}",
            method.name(),
            output.name(),
            got.1,
            torque
        );
        Ok(())
    };
    // In units in which positions are 1 and velocities are the fastest rate.
    for j in 0..2 * n {
        let unit = if j < n { 1.0 } else { rate };
        let mut x = origin.clone();
        x[j] = 1.0;
        let column: Vec<f64> = discrete.d.column(j).iter().copied().collect();
        let (change, torque) = step(&control, &x, first.then_some((0.0, 0.0)), (0.0, 0.0));
        let expected = if first {
            // The torque comes from the new x.
            (0..2 * n).map(|i| discrete.torque.state[i] * (x[i] + column[i])).sum()
        } else {
            discrete.torque.state[j]
        };
        check(&format!("state {j}"), unit, (change, torque), &column, expected)?;
    }
    for (j, (unit, u)) in [(1.0, (1.0, 0.0)), (rate, (0.0, 1.0))].into_iter().enumerate() {
        let current: Vec<f64> = discrete.current.column(j).iter().copied().collect();
        let moved: f64 = (0..2 * n).map(|i| discrete.torque.state[i] * current[i]).sum();
        let expected = discrete.torque.puck[j] + if first { moved } else { 0.0 };
        check(
            &format!("input {j}"),
            unit,
            step(&control, &origin, first.then_some((0.0, 0.0)), u),
            &current,
            expected,
        )?;
        if first {
            let previous: Vec<f64> = discrete.previous.column(j).iter().copied().collect();
            let moved: f64 = (0..2 * n).map(|i| discrete.torque.state[i] * previous[i]).sum();
            check(&format!("previous {j}"), unit, step(&control, &origin, Some(u), (0.0, 0.0)), &previous, moved)?;
        }
    }
    Ok(())
}

/// A very light body between strong dampers: C T/J = 2575. Its own mode decays at once, and it follows the dampers.
#[test]
fn the_exact_hold_keeps_its_digits_on_a_light_body_between_strong_dampers() {
    let body = |inertia| Body { inertia, position: 0.0, velocity: 0.0 };
    let damper = |first, second, damping| Coupling {
        first,
        second,
        law: Law::Damper { damping: Damping::Fixed(damping) },
        limit: None,
    };
    let world = Linear {
        bodies: vec![body(1.0), body(4e-4)],
        couplings: vec![damper(End::Puck, End::Body(0), 1.0), damper(End::Body(0), End::Body(1), 3.11)],
        period: 0.3313,
        advance: 0,
    };
    for output in Output::ALL {
        compare::<f64>(&world, Method::Zoh, output, 1e-10).unwrap();
    }
    compare::<f64>(&world, Method::Foh, Output::Start, 1e-10).unwrap();
}

proptest! {
    #![proptest_config(hapt_testing::cases(2000))]

    #[test]
    fn the_real_step_linearised_is_the_laboratorys_matrices(world in linear(false)) {
        for method in Method::ALL {
            let outputs: &[Output] = if method.takes_new_sample_first() { &[Output::Start] } else { &Output::ALL };
            for &output in outputs {
                compare::<f64>(&world, method, output, 1e-12)?;
                compare::<f32>(&world, method, output, 1e-5)?;
            }
        }
    }

    #[test]
    fn rests_and_constants_drift_the_same_in_both(world in linear(true)) {
        for method in [Method::ForwardEuler, Method::BackwardEuler, Method::SemiImplicitEuler, Method::Trapezoidal, Method::Zoh, Method::Rk4] {
            for output in Output::ALL {
                let spec = world.spec(method, output);
                let control = Room::<f64>::new(&spec).unwrap();
                let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
                let discrete = Discrete::new(&continuous, method, output, spec.advance, spec.period).unwrap();
                let n = world.bodies.len();
                let (change, torque) = step(&control, &vec![0.0; 2 * n], None, (0.0, 0.0));
                let (rate, scale) = world.scales();
                for i in 0..2 * n {
                    let size = if i < n { 1.0 } else { rate };
                    prop_assert!((change[i] - discrete.constant[i]).abs() <= 1e-12 * size * (1.0 + 1.0 / (world.bodies.iter().map(|b| b.inertia).fold(1.0, f64::min) * rate * rate)));
                }
                // Some steps ahead an unstable method's torque is far above the couplings' own.
                prop_assert!((torque - discrete.torque.constant).abs() <= 1e-11 * (1.0 + scale + torque.abs()));
            }
        }
    }
}
