//! The held world: the table of integrators, structure, tiny growth, sorting.

use hapt_analysis::continuous::{Continuous, Slopes};
use hapt_analysis::eigenvalues;
use hapt_analysis::{Discrete, Verdict, held, held_growth};
use hapt_model::{Body, Coupling, Damping, End, Law, Method, Output, Side};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use crate::common::*;

/// |λ|² and, where undamped, arg λ of each integrator on one mode.
fn table(method: Method, x: f64, zeta: f64) -> (f64, f64) {
    let q = x * x / 4.0;
    match method {
        Method::ForwardEuler => (1.0 - 2.0 * zeta * x + x * x, x.atan()),
        Method::BackwardEuler => (1.0 / (1.0 + 2.0 * zeta * x + x * x), x.atan()),
        Method::SemiImplicitEuler => (1.0 - 2.0 * zeta * x, 2.0 * (x / 2.0).asin()),
        Method::Trapezoidal | Method::Tustin => ((1.0 - zeta * x + q) / (1.0 + zeta * x + q), 2.0 * (x / 2.0).atan()),
        Method::Zoh | Method::Foh => ((-2.0 * zeta * x).exp(), x),
        Method::Rk4 => (
            1.0 - x.powi(6) / 72.0 + x.powi(8) / 576.0,
            (x - x.powi(3) / 6.0).atan2(1.0 - x * x / 2.0 + x.powi(4) / 24.0),
        ),
    }
}

proptest! {
    #[test]
    fn one_mode_follows_the_table_under_every_method(
        omega in 0.1..1e4f64, zeta in 0.0..0.9f64, x in 1e-4..0.9f64, undamped in any::<bool>(),
    ) {
        let zeta = if undamped { 0.0 } else { zeta };
        let world = oscillator(omega, zeta);
        let period = x / omega;
        for method in Method::ALL {
            if method == Method::Rk4 && zeta > 0.0 {
                continue;
            }
            let found = held(&world.bodies, &world.couplings, method, period).unwrap();
            let (square, angle) = table(method, x, zeta);
            for value in &found.eigenvalues {
                // Semi-implicit Euler's roots are real beyond x = 2(1 - ζ); the table holds for complex ones.
                if value.im == 0.0 {
                    prop_assert_eq!(method, Method::SemiImplicitEuler);
                    continue;
                }
                prop_assert!((value.abs.powi(2) - square).abs() < 1e-13, "{}", method.name());
                prop_assert!((value.re.hypot(value.im) - value.abs).abs() < 1e-13);
                if zeta == 0.0 {
                    prop_assert!((value.im.atan2(value.re).abs() - angle).abs() < 1e-13);
                }
            }
        }
    }

    /// One body on springs has its growth from a formula, any other world from its matrices; the results agree.
    #[test]
    fn growth_alone_is_the_growth_of_the_whole_answer(
        inertia in -5.0..2.0f64,
        stiffness in (-3.0..7.0f64, -3.0..7.0f64),
        period in -5.0..-1.0f64,
        grounded in any::<bool>(),
        damper_kind in 0..4,
    ) {
        let ten = |x: f64| 10_f64.powf(x);
        let spring = |second, stiffness| Coupling { first: End::Body(0), second, law: Law::Spring { stiffness, rest: 0.1 }, limit: None };
        let damper = |damping| Coupling { first: End::Body(0), second: End::Ground, law: Law::Damper { damping }, limit: None };
        let bodies = [Body { inertia: ten(inertia), position: 0.0, velocity: 0.0 }];
        let mut couplings = vec![spring(End::Puck, ten(stiffness.0))];
        couplings.extend(grounded.then(|| spring(End::Ground, ten(stiffness.1))));
        couplings.extend(match damper_kind {
            0 => Some(damper(Damping::Compensating)),
            1 => Some(damper(Damping::Fixed(ten(stiffness.1) * 1e-4))),
            _ => None,
        });
        for method in Method::ALL {
            let whole = held(&bodies, &couplings, method, ten(period)).unwrap().growth_per_s;
            let growth = held_growth(&bodies, &couplings, method, ten(period)).unwrap();
            prop_assert_eq!(growth.map(f64::to_bits), whole.map(f64::to_bits), "{}", method.name());
        }
    }

    #[test]
    fn what_the_modes_say_the_steps_own_matrix_says(world in worlds(Dampers::Mixed, false), x in 1e-3..0.7f64) {
        let period = x / fastest(&world);
        for method in Method::ALL {
            let found = held(&world.bodies, &world.couplings, method, period).unwrap();
            let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
            let output = if method.takes_new_sample_first() { Output::Start } else { Output::End };
            let step = Discrete::new(&equations, method, output, 0, period).unwrap();
            let n = step.d.nrows();
            let mut left: Vec<Complex<f64>> = eigenvalues(&step.d).unwrap().iter().map(|v| v + 1.0).collect();
            prop_assert!(found.eigenvalues.len() <= n);
            for value in &found.eigenvalues {
                let value = Complex::new(value.re, value.im);
                let (at, distance) = left
                    .iter()
                    .map(|other| (other - value).norm())
                    .enumerate()
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .unwrap();
                // Close pairs of eigenvalues are known to the root of the precision only, of the largest one.
                prop_assert!(distance < 3e-6 * (1.0 + found.spectral_radius), "{}: {value} is {distance} from any of {left:?}", method.name());
                left.swap_remove(at);
            }
        }
    }

    #[test]
    fn undamped_worlds_keep_every_digit_of_the_modulus(world in worlds(Dampers::None, false), x in 1e-3..100.0f64) {
        let period = x / fastest(&world);
        for method in [Method::Zoh, Method::Foh, Method::Trapezoidal, Method::Tustin] {
            let found = held(&world.bodies, &world.couplings, method, period).unwrap();
            prop_assert_eq!(found.spectral_radius, 1.0);
            prop_assert_eq!(found.growth_per_s, Some(0.0));
            prop_assert_eq!(found.verdict, Verdict::Marginal);
            prop_assert!(found.modes.iter().all(|m| m.damping_ratio == 0.0));
            prop_assert_eq!(found.modes.len(), world.bodies.len());
        }
    }

    #[test]
    fn matched_dampers_undo_forward_eulers_growth_on_any_network(world in worlds(Dampers::Matched, false), x in 1e-3..0.9f64) {
        let period = x / fastest(&world);
        let found = held(&world.bodies, &world.couplings, Method::ForwardEuler, period).unwrap();
        prop_assert!(found.growth_per_s.unwrap().abs() < 1e-9);
        prop_assert!(found.eigenvalues.iter().all(|v| (v.abs - 1.0).abs() < 1e-12));
        // The same by the step's own matrix, which is derived without modes: λ - 1 = D's, |λ|² - 1 = 2 Re + |.|².
        let equations = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
        let step = Discrete::new(&equations, Method::ForwardEuler, Output::Start, 0, period).unwrap();
        for v in eigenvalues(&step.d).unwrap() {
            prop_assert!((2.0 * v.re + v.norm_sqr()).abs() < 1e-11);
        }
    }

    #[test]
    fn loose_bodies_count_as_exactly_one_and_nothing_splits(world in worlds(Dampers::Fixed, true), x in 1e-3..0.5f64) {
        let period = x / fastest(&world);
        // A cluster of springs without an anchor has one 1; a part without any tie to the fixed side another.
        let fixed = |end| matches!(end, End::Puck | End::Ground);
        let n = world.bodies.len();
        let reach = |springs_only: bool| {
            let mut label: Vec<usize> = (0..=n).collect();
            let at = |end| if let End::Body(i) = end { i } else { n };
            for _ in 0..=n {
                for c in &world.couplings {
                    if springs_only && !matches!(c.law, Law::Spring { .. }) {
                        continue;
                    }
                    let (a, b) = (at(c.first), at(c.second));
                    // Bodies that both hang on the fixed side are one group here: only the loose ones matter.
                    let low = label[a].min(label[b]);
                    (label[a], label[b]) = (low, low);
                }
            }
            let mut loose: Vec<usize> = label[..n].iter().copied().filter(|l| *l != label[n]).collect();
            loose.sort_unstable();
            loose.dedup();
            loose.len()
        };
        prop_assert!(world.couplings.iter().all(|c| !(fixed(c.first) && fixed(c.second))));
        let ones = reach(true) + reach(false);
        let found = held(&world.bodies, &world.couplings, Method::Zoh, period).unwrap();
        let exact = found.eigenvalues.iter().filter(|v| v.re == 1.0 && v.im == 0.0 && v.abs == 1.0).count();
        prop_assert_eq!(exact, ones);
        prop_assert_eq!(found.verdict == Verdict::Marginal || found.growth_per_s.unwrap() > -1e-9, ones > 0 || found.growth_per_s.unwrap() > -1e-9);
        prop_assert!(found.eigenvalues.iter().all(|v| v.abs <= 1.0));
    }

    #[test]
    fn passive_worlds_are_stable_under_the_implicit_and_exact_methods(world in worlds(Dampers::Mixed, true), x in 1e-3..1e6f64) {
        let period = x / fastest(&world);
        for method in [Method::BackwardEuler, Method::Trapezoidal, Method::Tustin, Method::Zoh, Method::Foh] {
            let found = held(&world.bodies, &world.couplings, method, period).unwrap();
            prop_assert!(found.spectral_radius <= 1.0 + 1e-13);
            prop_assert_eq!(found.critical_period_reason, Some("unbounded"));
        }
    }
}

#[test]
fn growth_of_a_billionth_per_second_is_a_number_and_not_noise() {
    // ω²T/2 = 1e-9 1/s at 1 ms: |λ| - 1 = 1e-12.
    let omega = 2e-6f64.sqrt();
    let world = oscillator(omega, 0.0);
    let found = held(&world.bodies, &world.couplings, Method::ForwardEuler, 1e-3).unwrap();
    assert!((found.growth_per_s.unwrap() - 1e-9).abs() < 1e-18);
    // The same growth behind a stiff, damped neighbour at the far end of a chain: the slow body's own damping is 1e-9 less
    // than what forward Euler needs.
    let ends = (End::Body(0), End::Ground);
    let mut world = oscillator(10.0, 0.0);
    world.couplings.push(damper(ends.0, ends.1, 100.0 * 1e-3 - 4e-9));
    world.bodies.push(body(1.0));
    world.couplings.push(spring(End::Body(1), End::Ground, 1e6));
    world.couplings.push(damper(End::Body(1), End::Ground, 1.9e3));
    let found = held(&world.bodies, &world.couplings, Method::ForwardEuler, 1e-3).unwrap();
    assert!((found.growth_per_s.unwrap() - 2e-9).abs() < 1e-13, "{:?}", found.growth_per_s);
    assert_eq!(found.verdict, Verdict::Unstable);
}

#[test]
fn the_notes_wheel_grows_by_two_percent_a_second_under_forward_euler() {
    let k = 0.8 / std::f64::consts::FRAC_PI_4;
    let wheel = body(k / std::f64::consts::TAU.powi(2));
    let mut couplings = vec![spring(End::Puck, End::Body(0), k)];
    let found = held(&[wheel], &couplings, Method::ForwardEuler, 1e-3).unwrap();
    assert!((found.growth_per_s.unwrap() - 0.0197388).abs() < 5e-8);
    assert_eq!(found.critical_period_reason, Some("never"));
    // (2.24): b = Tk keeps it on the circle, up to Tω = 2.
    couplings.push(compensator(End::Puck, End::Body(0)));
    let found = held(&[wheel], &couplings, Method::ForwardEuler, 1e-3).unwrap();
    assert_eq!(found.growth_per_s, Some(0.0));
    assert!((found.critical_period_s.unwrap() - 1.0 / std::f64::consts::PI).abs() < 1e-15);
    // ζ = π/1000.
    assert!((found.modes[0].damping_ratio - std::f64::consts::PI / 1000.0).abs() < 1e-15);
    let frequency = (std::f64::consts::PI * 1e-3).asin() * 2.0 / 1e-3 / std::f64::consts::TAU;
    assert!((found.modes[0].discrete_frequency_hz.unwrap() - frequency).abs() < 1e-12);
    assert!(found.modes[0].discrete_damping_ratio.unwrap().abs() < 1e-15);
}

#[test]
fn a_body_that_nothing_ties_is_a_double_one_and_marginal() {
    for method in Method::ALL {
        let found = held(&[body(0.3)], &[spring(End::Body(0), End::Puck, 0.0)], method, 1e-3).unwrap();
        assert_eq!(found.eigenvalues.len(), 2);
        assert!(found.eigenvalues.iter().all(|v| v.re == 1.0 && v.im == 0.0 && v.abs == 1.0));
        assert_eq!((found.growth_per_s, found.verdict), (Some(0.0), Verdict::Marginal));
        assert_eq!(found.critical_period_reason, Some("unbounded"));
    }
}

#[test]
fn two_bodies_on_one_spring_keep_their_momentum_and_their_swing() {
    let world = [body(1.0), body(3.0)];
    let between = [spring(End::Body(0), End::Body(1), 300.0)];
    let found = held(&world, &between, Method::SemiImplicitEuler, 1e-3).unwrap();
    assert_eq!(found.eigenvalues.iter().filter(|v| v.re == 1.0 && v.abs == 1.0).count(), 2);
    assert_eq!(found.growth_per_s, Some(0.0));
    // ω² = k (1/1 + 1/3) = 400.
    assert!((found.modes[0].frequency_hz - 20.0 / std::f64::consts::TAU).abs() < 1e-13);
    assert!((found.critical_period_s.unwrap() - 0.1).abs() < 1e-16);
}

#[test]
fn no_bodies_nothing_to_grow() {
    let found = held(&[], &[spring(End::Puck, End::Ground, 1.0)], Method::Zoh, 1e-3).unwrap();
    assert!(found.eigenvalues.is_empty() && found.modes.is_empty());
    assert_eq!((found.spectral_radius, found.growth_per_s, found.verdict), (0.0, None, Verdict::Stable));
}

#[test]
fn eigenvalues_come_by_modulus_then_angle_then_sign() {
    let mut world = oscillator(30.0, 0.0);
    world.bodies.push(body(1.0));
    world.couplings.push(spring(End::Body(1), End::Ground, 100.0));
    world.bodies.push(body(1.0));
    world.couplings.push(spring(End::Body(2), End::Ground, 100.0));
    world.couplings.push(damper(End::Body(2), End::Ground, 1.0));
    let list = held(&world.bodies, &world.couplings, Method::Zoh, 1e-2).unwrap().eigenvalues;
    let angles: Vec<f64> = list.iter().map(|v| v.im.atan2(v.re)).collect();
    let want = [0.1, -0.1, 0.3, -0.3];
    assert!(angles.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-12), "{angles:?}");
    assert!(list[4].abs < 1.0 && list[4].im > 0.0 && list[5].im == -list[4].im);
}

#[test]
fn a_wall_counts_out_and_in_and_the_worst_of_both() {
    let wall = |stiffness, damping| Coupling {
        first: End::Body(0),
        second: End::Ground,
        law: Law::Wall { side: Side::Above, at: 0.1, stiffness, damping },
        limit: None,
    };
    let mut world = oscillator(10.0, 0.02);
    world.couplings.push(wall(1e4, 0.0));
    // Out: ω = 10, stable up to 2ζ/ω = 4 ms. In: c/(ω² + 1e4) = 0.4/10100 s, and the growth at 1 ms is that of the wall.
    let found = held(&world.bodies, &world.couplings, Method::ForwardEuler, 1e-3).unwrap();
    assert!((found.critical_period_s.unwrap() - 0.4 / 10100.0).abs() < 1e-15);
    assert_eq!(found.verdict, Verdict::Unstable);
    let inside = held(
        &world.bodies,
        &[&world.couplings[..2], &[spring(End::Body(0), End::Ground, 1e4)]].concat(),
        Method::ForwardEuler,
        1e-3,
    );
    assert_eq!(found.growth_per_s, inside.unwrap().growth_per_s);
}

#[test]
fn thirty_two_bodies_finish() {
    for method in Method::ALL {
        let mut world = chain(32, 1e-4, 100.0);
        for i in 0..32 {
            match i % 3 {
                0 => world.couplings.push(damper(End::Body(i), End::Ground, 1e-3 * (1.0 + i as f64))),
                1 => world.couplings.push(compensator(End::Body(i), End::Body(i - 1))),
                _ => {}
            }
        }
        let found = held(&world.bodies, &world.couplings, method, 1e-5).unwrap();
        assert_eq!(found.eigenvalues.len(), 64);
        // Six walls: 64 combinations of one part.
        if !matches!(method, Method::SemiImplicitEuler | Method::Zoh) {
            continue;
        }
        for i in [3, 8, 14, 20, 26, 31] {
            let law = Law::Wall { side: Side::Above, at: 0.0, stiffness: 300.0, damping: 1e-3 };
            world.couplings.push(Coupling { first: End::Body(i), second: End::Ground, law, limit: None });
        }
        let start = std::time::Instant::now();
        let found = held(&world.bodies, &world.couplings, method, 1e-5).unwrap();
        println!("     with six walls: {:6.1} ms, {:?}", start.elapsed().as_secs_f64() * 1e3, found.critical_period_s);
    }
}

#[test]
fn numbers_beyond_double_precision_are_an_error_and_no_hang() {
    for (inertia, stiffness) in [(1e-300, 1e300), (f64::MIN_POSITIVE, 1.0), (1.0, 1e-320)] {
        let mut world = oscillator(1.0, 0.3);
        world.bodies[0].inertia = inertia;
        world.couplings[0] = spring(End::Body(0), End::Puck, stiffness);
        for method in Method::ALL {
            if let Ok(found) = held(&world.bodies, &world.couplings, method, 1e-3) {
                assert!(found.spectral_radius.is_finite());
            }
        }
    }
    assert!(held(&[body(0.0)], &[], Method::Zoh, 1e-3).is_err());
    assert!(held(&[], &[spring(End::Body(3), End::Puck, 1.0)], Method::Zoh, 1e-3).is_err());
    assert_eq!(eigenvalues(&DMatrix::zeros(0, 0)), Ok(vec![]));
}
