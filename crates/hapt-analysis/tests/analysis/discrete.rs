//! The step's matrices against the rules themselves, run on the couplings' torques.

use hapt_analysis::{Continuous, Discrete, Slopes};
use hapt_model::{Coupling, Damping, End, Law, Method, Output};
use hapt_testing::prelude::*;
use nalgebra::{DVector, Vector2};

use crate::common::*;

/// The ends' torques from the laws, one coupling after another: (on the bodies, on the puck).
fn torques(world: &Bench, period: f64, x: &DVector<f64>, u: [f64; 2]) -> (DVector<f64>, f64) {
    let n = world.bodies.len();
    let at = |end| match end {
        End::Puck => u,
        End::Ground => [0.0, 0.0],
        End::Body(i) => [x[i], x[n + i]],
    };
    let stiffness = |c: &Coupling| if let Law::Spring { stiffness, .. } = c.law { stiffness } else { 0.0 };
    let (mut bodies, mut puck) = (DVector::zeros(n), 0.0);
    for c in &world.couplings {
        let (a, b) = (at(c.first), at(c.second));
        let (q, rate) = (a[0] - b[0], a[1] - b[1]);
        let torque = match c.law {
            Law::Spring { stiffness, rest } => -stiffness * (q - rest),
            Law::Damper { damping: Damping::Fixed(b) } => -b * rate,
            Law::Damper { damping: Damping::Compensating } => {
                let between = |o: &&Coupling| {
                    [o.first, o.second] == [c.first, c.second] || [o.second, o.first] == [c.first, c.second]
                };
                let here = if c.first == End::Ground { c.second } else { c.first };
                let at_body = |o: &&Coupling| o.first == here || o.second == here;
                let to_ground = (c.first == End::Ground || c.second == End::Ground) && here != End::Puck;
                let sum: f64 = if to_ground {
                    world.couplings.iter().filter(at_body).map(stiffness).sum()
                } else {
                    world.couplings.iter().filter(between).map(stiffness).sum()
                };
                -period * sum * rate
            }
            Law::Constant { torque } => torque,
            _ => 0.0,
        };
        for (end, torque) in [(c.first, torque), (c.second, -torque)] {
            match end {
                End::Puck => puck += torque,
                End::Body(i) => bodies[i] += torque,
                End::Ground => {}
            }
        }
    }
    (bodies, puck)
}

/// f(x, u) of the differential equation.
fn rate(world: &Bench, period: f64, x: &DVector<f64>, u: [f64; 2]) -> DVector<f64> {
    let n = world.bodies.len();
    let (torque, _) = torques(world, period, x, u);
    DVector::from_fn(2 * n, |i, _| if i < n { x[n + i] } else { torque[i - n] / world.bodies[i - n].inertia })
}

/// Classical Runge-Kutta over `time`, u a straight line from `u` to `v`, on the dampers of `period`.
fn runge_kutta(world: &Bench, period: f64, x: &DVector<f64>, u: [f64; 2], v: [f64; 2], steps: u32) -> DVector<f64> {
    let h = period / f64::from(steps);
    let at = |t: f64| [u[0] + (v[0] - u[0]) * t / period, u[1] + (v[1] - u[1]) * t / period];
    let mut x = x.clone();
    for i in 0..steps {
        let t = f64::from(i) * h;
        let a = rate(world, period, &x, at(t));
        let b = rate(world, period, &(&x + &a * (h / 2.0)), at(t + h / 2.0));
        let c = rate(world, period, &(&x + &b * (h / 2.0)), at(t + h / 2.0));
        let d = rate(world, period, &(&x + &c * h), at(t + h));
        x += (a + b * 2.0 + c * 2.0 + d) * (h / 6.0);
    }
    x
}

/// How far x and y are apart, positions in units of the largest, velocities in those of ω times it.
fn apart(x: &DVector<f64>, y: &DVector<f64>, around: &[&DVector<f64>], period: f64) -> f64 {
    let n = x.len() / 2;
    let size =
        around.iter().flat_map(|v| v.iter().enumerate()).map(|(i, v)| if i < n { v.abs() } else { v.abs() * period });
    let size = size.fold(1e-300, f64::max);
    let off =
        (x - y).iter().enumerate().map(|(i, v)| if i < n { v.abs() } else { v.abs() * period }).fold(0.0, f64::max);
    off / size
}

fn advance(step: &Discrete, x: &DVector<f64>, u: [f64; 2], v: [f64; 2]) -> DVector<f64> {
    x + &step.d * x + &step.previous * Vector2::from(u) + &step.current * Vector2::from(v) + &step.constant
}

prop_compose! {
    /// A world with rests and a constant, a state and two samples of the puck.
    fn cases()(
        mut world in worlds(Dampers::Mixed, true),
        numbers in prop::collection::vec(-1.0..1.0f64, 32),
        x in 1e-4..0.8f64,
    ) -> (Bench, DVector<f64>, [f64; 2], [f64; 2], f64) {
        let n = world.bodies.len();
        for (c, value) in world.couplings.iter_mut().zip(numbers.iter().cycle()) {
            if let Law::Spring { rest, .. } = &mut c.law {
                *rest = 0.3 * value;
            }
        }
        world.couplings.push(Coupling { first: End::Puck, second: End::Body(0), law: Law::Constant { torque: numbers[0] }, limit: None });
        world.couplings.push(spring(End::Ground, End::Puck, 3.0));
        world.couplings.push(damper(End::Body(0), End::Puck, 1e-3));
        let omega = fastest(&world);
        // Dampers included, so that the explicit methods stay near the circle.
        let lightest = world.bodies.iter().map(|b| b.inertia).fold(1.0, f64::min);
        let period = x / (omega + 60.0 / lightest);
        let state = DVector::from_fn(2 * n, |i, _| if i < n { numbers[i] } else { omega * numbers[i] });
        let u = [numbers[28], omega * numbers[29]];
        let v = [numbers[30], omega * numbers[31]];
        (world, state, u, v, period)
    }
}

proptest! {
    #[test]
    fn every_method_does_what_its_rule_says((world, x, u, v, period) in cases()) {
        let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
        let n = world.bodies.len();
        let f = |x: &DVector<f64>, u| rate(&world, period, x, u);
        for method in Method::ALL {
            let step = Discrete::new(&equations, method, Output::Start, 0, period).unwrap();
            let next = advance(&step, &x, u, v);
            let want = match method {
                Method::ForwardEuler => &x + f(&x, v) * period,
                Method::BackwardEuler => &x + f(&next, v) * period,
                Method::SemiImplicitEuler => {
                    let mut want = &x + f(&x, v) * period;
                    for i in 0..n {
                        want[i] = x[i] + period * want[n + i];
                    }
                    want
                }
                Method::Trapezoidal => &x + (f(&x, v) + f(&next, v)) * (period / 2.0),
                Method::Tustin => &x + (f(&x, u) + f(&next, v)) * (period / 2.0),
                Method::Rk4 => runge_kutta(&world, period, &x, v, v, 1),
                Method::Zoh => runge_kutta(&world, period, &x, v, v, 400),
                Method::Foh => runge_kutta(&world, period, &x, u, v, 400),
            };
            let off = apart(&next, &want, &[&x, &next, &(f(&x, v) * period)], period);
            prop_assert!(off < 1e-11, "{}: off by {off}", method.name());
            if !method.takes_new_sample_first() {
                prop_assert_eq!(step.previous.amax(), 0.0);
            }
        }
    }

    #[test]
    fn the_torque_is_that_of_the_state_the_output_names((world, x, u, v, period) in cases(), ahead in 0..5u32) {
        let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
        let n = world.bodies.len();
        for method in Method::ALL {
            for output in Output::ALL {
                if method.takes_new_sample_first() && output != Output::Start {
                    prop_assert!(Discrete::new(&equations, method, output, 0, period).is_err());
                    continue;
                }
                let ahead = if output == Output::End { ahead } else { 0 };
                let step = Discrete::new(&equations, method, output, ahead, period).unwrap();
                let next = advance(&step, &x, u, v);
                let mean = |from: &DVector<f64>, to: &DVector<f64>| {
                    DVector::from_fn(2 * n, |i, _| if i < n { to[i] } else { (to[i - n] - from[i - n]) / period })
                };
                let state = match output {
                    Output::Start => x.clone(),
                    Output::Middle => (&x + &next) * 0.5,
                    Output::End => {
                        let (mut from, mut to) = (x.clone(), next);
                        for _ in 0..ahead {
                            let further = advance(&step, &to, [v[0], 0.0], [v[0], 0.0]);
                            (from, to) = (to, further);
                        }
                        mean(&from, &to)
                    }
                };
                let (_, want) = torques(&world, period, &state, v);
                let got = (&step.torque.state * &x)[0]
                    + step.torque.puck[0] * v[0]
                    + step.torque.puck[1] * v[1]
                    + step.torque.constant;
                let law = equations.torque(period).state;
                let size: f64 = want.abs()
                    + law.iter().zip(state.iter()).map(|(a, b)| (a * b).abs()).sum::<f64>()
                    + law.iter().skip(n).map(|b| b.abs()).sum::<f64>() * state.rows(0, n).amax() / period
                    + step.torque.puck[0].abs() + (step.torque.puck[1] * v[1]).abs();
                prop_assert!((got - want).abs() < 1e-11 * size, "{} {}: {got} {want}", method.name(), output.name());
            }
        }
    }

    #[test]
    fn a_short_step_is_the_differential_equation_without_cancellation(world in worlds(Dampers::Fixed, true)) {
        let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
        let a = equations.rates(0.0).a;
        // Σ |A| is at least any rate of it in these units.
        let period = 1e-12 / (a.amax() + 1.0);
        let n = world.bodies.len();
        for method in Method::ALL {
            let step = Discrete::new(&equations, method, Output::Start, 0, period).unwrap();
            let rate = step.d / period;
            // The rows of velocities; to 1e-11, where λ - 1 from λ would leave no digit at all.
            let off = (rate.rows(n, n) - a.rows(n, n)).amax();
            prop_assert!(off <= 1e-11 * a.amax(), "{}: {off}", method.name());
        }
    }
}

#[test]
fn the_torque_row_is_the_input_column_transposed() {
    let mut world = oscillator(6.0, 0.1);
    world.couplings.push(compensator(End::Body(0), End::Puck));
    let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
    let (rates, torque) = (equations.rates(1e-3), equations.torque(1e-3));
    // Inertia 1: acceleration per puck motion is torque on the puck per body motion.
    assert_eq!(rates.b[(1, 0)], torque.state[0]);
    assert_eq!(rates.b[(1, 1)], torque.state[1]);
    assert!((torque.state[1] - (1.2 + 0.036)).abs() < 1e-15);
    assert_eq!(torque.puck, [-torque.state[0], -torque.state[1]]);
}
