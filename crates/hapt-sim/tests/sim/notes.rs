//! The errata of the notes, proved on the loop, the exact device and the worlds of worlds/notes; docs/notes.md cites them.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::common::{self, INERTIA, STIFFNESS, rows, scenario, spring, step};
use hapt_analysis::{Continuous, Discrete, Slopes, Verdict, closed_form, held};
use hapt_core::Loop;
use hapt_model::*;
use hapt_sim::{Row, Simulation, Summary};
use hapt_testing::prelude::*;
use nalgebra::{DMatrix, Matrix2, Vector2};

const DEGREE: f64 = TAU / 360.0;
/// The course's wheel, J_z.
const DEVICE: f64 = 6.4e-4;

/// A world file of the notes, with keys set.
fn notes(name: &str, sets: &[&str]) -> World {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../worlds/notes/{}.toml"), name);
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    World::read(&Source::open(path).unwrap(), &sets).unwrap()
}

/// Every row of a world's first scenario.
fn run(world: &World) -> Vec<Row> {
    rows(world, &world.scenarios[0])
}

/// One virtual wheel on a spring, torque from x_k.
fn wheel(inertia: f64, stiffness: f64, period: f64, method: Method) -> World {
    let mut world = common::wheel(method, Output::Start);
    world.sampling.period = period;
    world.bodies[0].inertia = inertia;
    world.couplings = vec![spring(End::Puck, End::Body(0), stiffness)];
    world
}

fn damper(first: End, second: End, damping: Damping) -> Coupling {
    Coupling { first, second, law: Law::Damper { damping }, limit: None }
}

fn peak(run: &[Row]) -> f64 {
    run.iter().fold(0.0, |m, row| f64::max(m, row.torque.abs()))
}

/// The growth of the oscillation of puck against wheel from `from` on, in 1/s.
///
/// A sequence y = A r^k cos(kφ + θ) has y_k² - y_{k-1} y_{k+1} = A² r^2k sin²φ, without a ripple. Second differences of
/// the separation are such a sequence: the effect of the spin on the separation changes too slowly to be seen in them.
fn swing_growth(run: &[Row], from: f64) -> f64 {
    let period = run[1].time - run[0].time;
    let separation: Vec<f64> =
        run.iter().filter(|row| row.time > from - 0.5 * period).map(|row| row.puck - row.bodies[0].0).collect();
    let bends: Vec<f64> = separation.windows(3).map(|d| d[2] - 2.0 * d[1] + d[0]).collect();
    let size = |y: &[f64]| y[1] * y[1] - y[0] * y[2];
    let n = bends.len();
    (size(&bends[n - 3..]) / size(&bends[..3])).ln() / (2.0 * (n - 3) as f64 * period)
}

/// The same growth from the laboratory's matrices, and that of the spin: eigenvalues of one period of wheel and released
/// puck, in separation and velocities, the torque held and the puck moving exactly between the samples.
fn released_growth(world: &World) -> (f64, f64) {
    let (sampling, device) = (&world.sampling, &world.device);
    let period = sampling.period;
    let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
    let loop_ = Discrete::new(&continuous, sampling.method, sampling.output, 0, period).unwrap();
    let mut flow = DMatrix::zeros(3, 3);
    (flow[(0, 1)], flow[(1, 1)], flow[(1, 2)]) = (1.0, -device.damping / device.inertia, 1.0 / device.inertia);
    let flow = (flow * period).exp();
    // From (separation, ẇ, ż), the wheel at 0.
    let one_period = DMatrix::from_fn(3, 3, |i, j| {
        let start = |index: usize| if index == j { 1.0 } else { 0.0 };
        let (x, u) = ([0.0, start(1)], [start(0), start(2)]);
        let change =
            |row: usize| (0..2).map(|n| loop_.d[(row, n)] * x[n] + loop_.current[(row, n)] * u[n]).sum::<f64>();
        let torque: f64 = (0..2).map(|n| loop_.torque.state[n] * x[n] + loop_.torque.puck[n] * u[n]).sum();
        let puck = |row: usize| flow[(row, 0)] * u[0] + flow[(row, 1)] * u[1] + flow[(row, 2)] * torque;
        match i {
            0 => puck(0) - change(0),
            1 => x[1] + change(1),
            _ => puck(1),
        }
    });
    let roots = one_period.complex_eigenvalues();
    let growth = |swings: bool| {
        let of = roots.iter().filter(|root| (root.im.abs() > 1e-6) == swings).map(|root| root.norm().ln() / period);
        of.fold(f64::NEG_INFINITY, f64::max)
    };
    (growth(true), growth(false))
}

/// The notes' wheel under five methods with three outputs each. (RK4 is the exact hold to all digits that matter here.)
fn loops() -> impl Iterator<Item = World> {
    let methods =
        [Method::ForwardEuler, Method::BackwardEuler, Method::SemiImplicitEuler, Method::Trapezoidal, Method::Zoh];
    methods.into_iter().flat_map(|method| Output::ALL.map(|output| common::wheel(method, output)))
}

/// 45° at 0, released after a quarter of a period.
fn released() -> Scenario {
    scenario(3.0, step(FRAC_PI_4, 0.0), Some(0.25))
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    #[test]
    fn stiffness_and_inertia_scaled_together_scale_the_torque_and_leave_the_motion(
        frequency in 0.3_f64..20.0, log_stiffness in -2.0_f64..2.0, log_factor in -2.0_f64..2.0,
        z0 in 0.1_f64..2.0, hand_frequency in 0.3_f64..20.0, method in prop::sample::select(&Method::ALL[..]),
    ) {
        let (stiffness, factor) = (10_f64.powf(log_stiffness), 10_f64.powf(log_factor));
        let inertia = stiffness / (TAU * frequency).powi(2);
        let world = wheel(inertia, stiffness, 1e-3, method);
        let scaled = wheel(factor * inertia, factor * stiffness, 1e-3, method);
        let sine = Drive::Position(Shape::Sine { amplitude: z0, frequency: hand_frequency, phase: 0.3 });
        for drive in [step(z0, 0.1), sine] {
            let scenario = scenario(1.0, drive, None);
            let run = rows(&world, &scenario);
            let motion = run.iter().fold(z0, |m, row| m.max(row.bodies[0].0.abs()));
            for (row, other) in run.iter().zip(rows(&scaled, &scenario)) {
                prop_assert!((other.bodies[0].0 - row.bodies[0].0).abs() <= 1e-10 * motion);
                prop_assert!((other.torque - factor * row.torque).abs() <= 1e-10 * factor * stiffness * motion);
            }
        }
    }

    #[test]
    fn beyond_critical_damping_2_13_is_the_product_of_two_unequal_roots_and_2_14_allows_too_long_a_period(
        frequency in 0.3_f64..20.0, zeta in 1.05_f64..4.0, x in 0.01_f64..3.0,
    ) {
        let omega = TAU * frequency;
        let mut world = wheel(1.3 / (omega * omega), 1.3, x / omega, Method::ForwardEuler);
        let damping = Damping::Fixed(2.0 * zeta * 1.3 / omega);
        world.couplings.push(damper(End::Body(0), End::Ground, damping));
        let at = |period: f64| held(&world.bodies, &world.couplings, Method::ForwardEuler, period).unwrap();
        let found = at(x / omega);
        let moduli: Vec<f64> = found.eigenvalues.iter().map(|root| root.abs).collect();
        prop_assert!(moduli.len() == 2 && found.eigenvalues.iter().all(|root| root.im == 0.0));
        let printed = (1.0 - 2.0 * zeta * x + x * x).abs();
        prop_assert!((moduli[0] * moduli[1] - printed).abs() < 1e-9 * (1.0 + x * x), "{moduli:?} {printed}");
        // Between their squares, except for the opposite roots at ζx = 1 and a root at 0.
        if (1.0 - zeta * x).abs() > 1e-3 && printed > 1e-6 {
            prop_assert!(moduli[0].powi(2) > printed && printed > moduli[1].powi(2), "{moduli:?} {printed}");
        }
        let limit = 2.0 * (zeta - (zeta * zeta - 1.0).sqrt()) / omega;
        prop_assert!((found.critical_period_s.unwrap() / limit - 1.0).abs() < 1e-9);
        prop_assert_eq!(at(0.999 * limit).verdict, Verdict::Stable);
        prop_assert_eq!(at(1.001 * limit).verdict, Verdict::Unstable);
        prop_assert_eq!(at(2.0 * zeta / omega * 0.999).verdict, Verdict::Unstable, "printed as stable");
    }

    #[test]
    fn the_torque_on_the_puck_is_the_opposite_of_the_torque_on_the_virtual_wheel(
        frequency in 0.3_f64..20.0, log_stiffness in -2.0_f64..2.0, z0 in 0.1_f64..2.0, hand_frequency in 0.3_f64..20.0,
        damping_ratio in prop_oneof![Just(0.0), 0.01_f64..1.0],
    ) {
        let (stiffness, omega) = (10_f64.powf(log_stiffness), TAU * frequency);
        let inertia = stiffness / (omega * omega);
        let damping = 2.0 * damping_ratio * stiffness / omega;
        let mut world = wheel(inertia, stiffness, 1e-3, Method::ForwardEuler);
        if damping > 0.0 {
            world.couplings.push(damper(End::Puck, End::Body(0), Damping::Fixed(damping)));
        }
        let sine = Drive::Position(Shape::Sine { amplitude: z0, frequency: hand_frequency, phase: 0.3 });
        let run = rows(&world, &scenario(0.5, sine, None));
        let most = |of: fn(&Row) -> f64| run.iter().fold(0.0, |m, row| f64::max(m, of(row).abs()));
        let (farthest, fastest) = (z0 + most(|row| row.bodies[0].0), most(|row| row.bodies[0].1));
        let torques = stiffness * farthest + damping * (fastest + most(|row| row.puck_velocity));
        let rounding = 8.0 * f64::EPSILON * (inertia * fastest / 1e-3 + torques);
        for pair in run.windows(2) {
            let on_wheel = inertia * (pair[1].bodies[0].1 - pair[0].bodies[0].1) / 1e-3;
            prop_assert!((on_wheel + pair[0].torque).abs() <= rounding, "{on_wheel} {}", pair[0].torque);
        }
        prop_assert!(peak(&run) > 0.0);
    }

    #[test]
    fn with_b_equal_tk_forward_euler_is_symplectic_euler_positions_first_entry_by_entry(
        frequency in 0.3_f64..20.0, log_stiffness in -2.0_f64..2.0, z0 in 0.1_f64..2.0, x in 1e-3_f64..1.5,
    ) {
        let (stiffness, omega) = (10_f64.powf(log_stiffness), TAU * frequency);
        let (inertia, period) = (stiffness / (omega * omega), x / omega);
        let mut damped = wheel(inertia, stiffness, period, Method::ForwardEuler);
        damped.couplings.push(damper(End::Puck, End::Body(0), Damping::Compensating));
        let continuous = Continuous::new(&damped.bodies, &damped.couplings, &Slopes::Flat).unwrap();
        let step_of = Discrete::new(&continuous, Method::ForwardEuler, Output::Start, 0, period).unwrap();
        // First w' = w + Tv, then v' = v - Tω² w'.
        let position = Matrix2::new(1.0, period, 0.0, 1.0);
        let velocity = Matrix2::new(1.0, 0.0, -period * omega * omega, 1.0);
        let symplectic = velocity * position;
        let input = [Vector2::new(0.0, period * omega * omega), Vector2::new(0.0, x * x)];
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-14 * b.abs() + 1e-15;
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            prop_assert!(close(step_of.d[(i, j)], symplectic[(i, j)] - f64::from(i == j)), "{i} {j}: {}", step_of.d);
            prop_assert!(close(step_of.current[(i, j)], input[j][i]), "{i} {j}: {}", step_of.current);
        }
        // The velocity first, with only the spring: one sample ahead, and the same torque.
        let duration = 1000.0 * period;
        let run = rows(&damped, &scenario(duration, step(z0, 0.0), None));
        let ahead = wheel(inertia, stiffness, period, Method::SemiImplicitEuler);
        let ahead = rows(&ahead, &scenario(duration, step(z0, 0.0), None));
        for (k, row) in run.iter().enumerate() {
            prop_assert!((row.torque - ahead[k].torque).abs() <= 1e-11 * stiffness * z0, "{k}");
            if let Some(next) = run.get(k + 1) {
                prop_assert!((next.bodies[0].0 - ahead[k].bodies[0].0).abs() <= 1e-11 * z0, "{k}");
            }
        }
    }

    #[test]
    fn the_released_wheels_position_changes_by_its_velocity_and_not_by_its_position(
        frequency in 0.3_f64..5.0, log_stiffness in -1.0_f64..0.5, z0 in 0.1_f64..2.0,
        output in prop::sample::select(&Output::ALL[..]),
    ) {
        let stiffness = 10_f64.powf(log_stiffness);
        let mut world = wheel(stiffness / (TAU * frequency).powi(2), stiffness, 1e-3, Method::Trapezoidal);
        world.sampling.output = output;
        let run = rows(&world, &scenario(1.0, step(z0, 0.0), Some(0.1)));
        let farthest = run.iter().fold(z0, |m, row| m.max(row.bodies[0].0.abs()));
        let mut printed_error = 0.0_f64;
        for pair in run.windows(2).filter(|pair| pair[0].time > 0.0995) {
            let ((w, v), (next_w, next_v)) = (pair[0].bodies[0], pair[1].bodies[0]);
            prop_assert!((next_w - w - 1e-3 * (v + next_v) / 2.0).abs() <= 1e-14 * farthest, "{}", pair[0].time);
            // Row 3 of (3.6) as printed, ẇ = w.
            printed_error = printed_error.max((next_w - w - 1e-3 * (w + next_w) / 2.0).abs());
        }
        prop_assert!(printed_error > 1e-4 * z0, "{printed_error}");
    }

    #[test]
    fn the_held_wheel_is_back_after_two_pi_root_of_inertia_over_stiffness(
        log_inertia in -4.0_f64..2.0, log_stiffness in -2.0_f64..2.0, z0 in 0.1_f64..2.0,
    ) {
        let (inertia, stiffness) = (10_f64.powf(log_inertia), 10_f64.powf(log_stiffness));
        let turn = TAU * (inertia / stiffness).sqrt();
        let world = wheel(inertia, stiffness, turn / 1000.0, Method::Zoh);
        let run = rows(&world, &scenario(turn, step(z0, 0.0), None));
        let away = |k: usize| {
            let ((w, v), (w0, v0)) = (run[k].bodies[0], run[0].bodies[0]);
            (w - w0).abs().max((v - v0).abs() * turn / TAU)
        };
        prop_assert_eq!(run.len(), 1001);
        prop_assert!(away(1000) < 1e-9 * z0, "{}", away(1000));
        prop_assert!((1..1000).all(|k| away(k) > 1e-3 * z0));
        // √(J/k) is one radian of the swing only.
        prop_assert!(away(159) > 0.4 * z0, "{}", away(159));
    }
}

#[test]
fn at_a_damping_ratio_of_two_the_wheel_comes_to_rest_at_85_ms_and_flees_at_86() {
    let after_100_s = |period: &str| {
        let period = format!("loop.period={period}");
        let sets = ["couplings.1.damping=0.64845557", "scenarios.step.duration=100 s", &period];
        let world = notes("damped-to-ground", &sets);
        let held = held(&world.bodies, &world.couplings, world.sampling.method, world.sampling.period).unwrap();
        let limit = held.critical_period_s.unwrap();
        assert!((limit - 85.2909e-3).abs() < 5e-8, "{limit}");
        let last = rows(&world, &world.scenarios[0]).pop().unwrap();
        ((last.bodies[0].0 - last.puck).abs() / FRAC_PI_4, held.verdict)
    };
    let (distance, verdict) = after_100_s("85 ms");
    assert!(distance < 1e-3 && verdict == Verdict::Stable, "{distance}");
    let (distance, verdict) = after_100_s("86 ms");
    assert!(distance > 1e6 && verdict == Verdict::Unstable, "{distance}");
    // 2ζ/ω, as printed.
    let (distance, verdict) = after_100_s("636 ms");
    assert!(distance > 1e60 && verdict == Verdict::Unstable, "{distance}");
}

#[test]
fn stepping_back_half_a_period_later_asks_for_twice_the_torque() {
    let world = common::wheel(Method::Zoh, Output::Start);
    let run_of = |points: &[(f64, f64)]| {
        let points = points.iter().map(|&(t, degrees)| (t, degrees * DEGREE)).collect();
        let path = Drive::Position(Shape::Path { file: "path.csv".into(), points });
        rows(&world, &scenario(3.0, path, None))
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    let once = run_of(&[(0.0, 45.0)]);
    assert!(near(peak(&once), 0.8), "one step from rest: k z0");
    let back = run_of(&[(0.0, 45.0), (0.499, 45.0), (0.5, 0.0)]);
    assert!(near(peak(&back[..500]), 0.8), "{}", peak(&back[..500]));
    assert!(near(back[500].torque, 1.6), "{}", back[500].torque);
    assert!(near(peak(&back[501..]), 1.6), "{}", peak(&back[501..]));
    let again = run_of(&[(0.0, 45.0), (0.499, 45.0), (0.5, 0.0), (0.999, 0.0), (1.0, 45.0)]);
    assert!(near(again[1000].torque, -2.4) && near(peak(&again), 2.4), "{}", again[1000].torque);
}

#[test]
fn a_stiffness_per_degree_beside_radians_keeps_the_frequency_and_loses_the_torque() {
    let right = notes("wheel", &[]);
    // The same two numbers, taken per radian.
    let slip = notes(
        "wheel",
        &[
            "couplings.0.stiffness=17.77777777777778 N mm/rad",
            "bodies.wheel.inertia=0.45031637174372346 N mm/(rad/s^2)",
        ],
    );
    assert!(matches!(slip.couplings[0].law, Law::Spring { stiffness, .. } if (stiffness - 0.0177778).abs() < 1e-7));
    assert!((slip.bodies[0].inertia - 4.503164e-4).abs() < 1e-10);
    let (right, slip) = (run(&right), run(&slip));
    for (a, b) in right.iter().zip(&slip) {
        assert!((a.bodies[0].0 - b.bodies[0].0).abs() < 1e-9, "{}", a.time);
        assert!((a.torque * DEGREE - b.torque).abs() < 1e-9, "{}", a.time);
    }
    // 1 Hz: at rest at 0 again after each second, and nowhere between.
    let at_rest = |row: &&Row| row.bodies[0].0.abs() + row.bodies[0].1.abs() < 1e-3;
    let times: Vec<f64> = slip.iter().filter(at_rest).map(|row| row.time).collect();
    assert!(times.len() == 11 && times.iter().enumerate().all(|(k, t)| (t - k as f64).abs() < 1e-9), "{times:?}");
    assert!((peak(&slip) - 0.8 * DEGREE).abs() < 1e-9 && (peak(&slip) - 13.9626e-3).abs() < 1e-7, "{}", peak(&slip));
}

#[test]
fn with_the_printed_sign_the_released_wheel_runs_away_by_a_factor_e_every_25_ms() {
    // Wheel and spring in the loop, its torque times `sign` held on a puck that moves exactly, 45° apart at the start.
    let separations = |method: Method, sign: f64, damping: f64| {
        let world = common::wheel(method, Output::Start);
        let period = world.sampling.period;
        let core = Loop::<f64, 1, 1, 1>::new(&world.spec()).unwrap();
        let mut state = core.start();
        let rate = damping / DEVICE;
        let (velocity_time, position_time) = match rate {
            0.0 => (period, period * period / 2.0),
            _ => (-(-rate * period).exp_m1() / rate, (period + (-rate * period).exp_m1() / rate) / rate),
        };
        let (mut z, mut v) = (FRAC_PI_4, 0.0);
        let mut separations = Vec::new();
        for _ in 0..=300 {
            let torque = sign * core.step(&mut state, z, v).torque;
            separations.push(z - state.now.position[0]);
            z += v * velocity_time + torque / DEVICE * position_time;
            v += (torque / DEVICE - rate * v) * velocity_time;
        }
        separations
    };
    // The shrinking root of the pair is gone after 0.15 s.
    let growth = |method, damping| {
        let separations = separations(method, -1.0, damping);
        (separations[300] / separations[150]).ln() / 0.15
    };
    for (method, eigenvalue) in [(Method::Trapezoidal, 39.015), (Method::ForwardEuler, 39.025)] {
        let free = growth(method, 0.0);
        assert!((free - eigenvalue).abs() < 1e-3, "{}: {free}", method.name());
        assert!((1e3 / free - 25.6).abs() < 0.05, "{}: {free}", method.name());
        let damped = growth(method, 1.2e-3);
        assert!((1e3 / damped - 26.3).abs() < 0.05, "{}: {damped}", method.name());
        // With the sign of the reaction it swings.
        let swing = separations(method, 1.0, 0.0);
        assert!(swing.iter().all(|d| d.abs() < 1.2 * FRAC_PI_4) && swing.iter().any(|&d| d < -0.9 * FRAC_PI_4));
    }
}

#[test]
fn a_differenced_puck_velocity_doubles_the_first_torque_of_a_step() {
    let torques = |sets: &[&str]| run(&notes("damped", sets)).iter().map(|row| row.torque).collect::<Vec<_>>();
    let at = "scenarios.step.hand.at=0.1 s";
    let differenced = torques(&["loop.estimator=difference", at]);
    assert!(differenced[..100].iter().all(|&torque| torque == 0.0));
    assert!((differenced[100] + 1.6).abs() < 1e-9, "{}", differenced[100]);
    assert!((differenced[101] + 0.79994).abs() < 5e-6, "{}", differenced[101]);
    assert!(differenced[101..].iter().all(|torque| torque.abs() < 0.8001));
    let exact = torques(&["loop.estimator=exact", at]);
    assert!((exact[100] + 0.8).abs() < 1e-9 && exact.iter().all(|torque| torque.abs() < 0.8001), "{}", exact[100]);
}

#[test]
fn turned_steadily_the_grounded_damper_drags_on_the_puck_and_the_one_between_does_not() {
    // Ten whole swings of the wheel, so that it ends as it began, at rest on a slack spring.
    let ramp = Drive::Position(Shape::Ramp { to: 900.0 * DEGREE, at: 0.0, over: 10.0 });
    let scenario = scenario(10.0, ramp, None);
    let motor_work = |name: &str| {
        let run = rows(&notes(name, &[]), &scenario);
        assert!(run.iter().all(|row| row.command == row.torque), "nothing clips");
        run[run.len() - 1].ledger.motor
    };
    let drag = 1e-3 * STIFFNESS * FRAC_PI_2;
    assert!((drag - 1.6e-3).abs() < 1e-9, "b times 90 °/s is 1.6 N·mm: {drag}");
    let grounded = motor_work("damped-to-ground");
    assert!((grounded + drag * 900.0 * DEGREE).abs() < 1e-6 && (grounded + 25.1327e-3).abs() < 1e-6, "{grounded}");
    let between = motor_work("damped");
    assert!(between.abs() < 1e-7, "{between}");
}

#[test]
fn with_the_puck_held_both_dampers_let_the_wheel_swing_alike() {
    let (between, grounded) = (run(&notes("damped", &[])), run(&notes("damped-to-ground", &[])));
    assert_eq!((between.len(), grounded.len()), (10_001, 10_001));
    for (a, b) in between.iter().zip(&grounded) {
        assert!((a.bodies[0].0 - b.bodies[0].0).abs() < 1e-12, "{} {} {}", a.time, a.bodies[0].0, b.bodies[0].0);
    }
    // Figure 11: the swing keeps its size.
    let reach = |run: &[Row]| run.iter().fold(0.0, |m, row| f64::max(m, (row.bodies[0].0 - row.puck).abs()));
    assert!((reach(&between[9000..]) - FRAC_PI_4).abs() < 1e-5 && (reach(&between) - FRAC_PI_4).abs() < 1e-5);
}

#[test]
fn released_without_device_damping_every_method_grows_twenty_times_faster_than_held_forward_euler() {
    let held_growth = closed_form::forward_euler_growth(TAU, 1e-3);
    assert!((held_growth - 0.0197388).abs() < 5e-8);
    for mut world in loops() {
        world.device.damping = 0.0;
        let name = (world.sampling.method.name(), world.sampling.output.name());
        let growth = swing_growth(&rows(&world, &released()), 0.25);
        let (predicted, _) = released_growth(&world);
        assert!((growth - predicted).abs() < 1e-6, "{name:?}: {growth} {predicted}");
        assert!((19.0..21.3).contains(&(growth / held_growth)), "{name:?}: {growth}");
    }
}

#[test]
fn the_course_wheels_damping_stills_the_released_wheel_under_every_method() {
    let enough = STIFFNESS * 1e-3 / 2.0;
    for mut world in loops() {
        let name = (world.sampling.method.name(), world.sampling.output.name());
        let mut growth = |damping: f64| {
            world.device.damping = damping;
            let growth = swing_growth(&rows(&world, &released()), 0.25);
            let (predicted, spin) = released_growth(&world);
            assert!((growth - predicted).abs() < 1e-6, "{name:?}: {growth} {predicted}");
            (growth, spin)
        };
        let (swing, spin) = growth(1.2e-3);
        assert!((-0.537..-0.497).contains(&swing) && spin < 0.0, "{name:?}: {swing} {spin}");
        let (swing, _) = growth(0.8 * enough);
        assert!((0.067..0.107).contains(&swing), "{name:?}: {swing}");
        // The least damping is kT/2, to 8 %.
        assert!(growth(0.92 * enough).0 > 0.0 && growth(1.08 * enough).0 < 0.0, "{name:?}");
    }
    // The spin requires up to kT, where torque and step do not conserve momentum.
    let spins = |damping: f64| {
        loops().map(move |mut world| {
            world.device.damping = damping;
            released_growth(&world).1
        })
    };
    assert!(spins(1.98 * enough).any(|spin| spin > 0.0) && spins(2.02 * enough).all(|spin| spin < 0.0));
}

#[test]
fn released_the_damper_between_the_wheels_pays_for_the_hold_and_the_grounded_one_does_not() {
    for (name, expected) in [("damped", -0.398), ("damped-to-ground", 0.417)] {
        let world =
            notes(name, &["device.damping=0", "scenarios.step.hand.release=0.25 s", "scenarios.step.duration=2 s"]);
        let run = run(&world);
        assert!(run.iter().all(|row| row.command == row.torque), "nothing clips");
        let growth = swing_growth(&run, 0.25);
        let (predicted, _) = released_growth(&world);
        assert!((growth - expected).abs() < 5e-4 && (growth - predicted).abs() < 1e-6, "{name}: {growth} {predicted}");
    }
}

#[test]
fn let_go_at_the_turning_point_the_wheel_swings_about_a_centre_that_stands_still() {
    let released_at = |release: f64| {
        let release_key = format!("scenarios.release.hand.release={release} s");
        let mut world = notes("released", &["device.damping=0", &release_key]);
        world.device.limit = None;
        let mut run = run(&world);
        run.retain(|row| row.time > release - 0.5e-4);
        run
    };
    let drift = |row: &Row| (DEVICE * row.puck_velocity + INERTIA * row.bodies[0].1) / (DEVICE + INERTIA);
    // After half a period: wheel at 90°, puck at 45°, both at rest.
    let run = released_at(0.5);
    assert!(run.iter().all(|row| drift(row).abs() < 1e-6 * TAU * FRAC_PI_4));
    let growth = swing_growth(&run, 0.5);
    assert!((growth - 0.04).abs() < 1e-3, "{growth}");
    let centre = |row: &Row| (DEVICE * row.puck + INERTIA * row.bodies[0].0) / (DEVICE + INERTIA) / DEGREE;
    assert!(run.iter().all(|row| (centre(row) - 88.911).abs() < 1e-3), "{}", centre(&run[0]));
    // The first half of a swing, to the other side.
    let swing = &run[..1000];
    let (low, high) = swing.iter().fold((f64::MAX, f64::MIN), |(l, h), row| (l.min(row.puck), h.max(row.puck)));
    assert!(((high + low) / 2.0 / DEGREE - 88.91).abs() < 0.1, "{}", (high + low) / 2.0 / DEGREE);
    assert!(((high - low) / 2.0 / DEGREE - 43.91).abs() < 0.1, "{}", (high - low) / 2.0 / DEGREE);
    // After a quarter it spins off.
    let run = released_at(0.25);
    assert!(run.iter().all(|row| (drift(row) / DEGREE - 275.90).abs() < 0.01), "{}", drift(&run[0]) / DEGREE);
}

#[test]
fn the_same_turning_pumps_a_wheel_that_lags_and_stills_one_that_leads() {
    let world = notes("pumped-and-damped", &[]);
    for (name, sign, size) in [("pump", 1.0, 35.708), ("damp", -1.0, 4.292)] {
        let run = rows(&world, world.scenario(name).unwrap());
        assert!(
            (run[1000].bodies[0].0.abs() / DEGREE - size).abs() < 0.01,
            "{name}: {}",
            run[1000].bodies[0].0 / DEGREE
        );
        for row in &run {
            let turning = sign * closed_form::resonance(5.0, TAU, row.time);
            let exact = -20.0 * (TAU * row.time).cos() + turning;
            assert!((row.bodies[0].0 / DEGREE - exact).abs() < 0.01, "{name} {}", row.time);
        }
    }
}

#[test]
fn below_the_period_the_formula_names_forward_euler_stays_unclipped_for_ten_seconds() {
    // The period at which the torque's envelope, 800 N·mm e^(growth t), reaches the limit after ten seconds.
    let growth = (822.25_f64 / 800.0).ln() / 10.0;
    let (mut below, mut above) = (1e-6, 1e-3);
    for _ in 0..100 {
        let middle = 0.5 * (below + above);
        if closed_form::forward_euler_growth(TAU, middle) < growth { below = middle } else { above = middle }
    }
    let first_clipped = |period: f64| {
        let world = notes("euler", &[&format!("loop.period={period} s")]);
        let mut run = Simulation::new(&world, &world.scenarios[0]).unwrap();
        let mut summary = Summary::new(&world, &run);
        while let Some(row) = run.next() {
            summary.add(row.unwrap());
        }
        summary.first_clipped.map(|(_, time)| time)
    };
    assert!((below - 0.139e-3).abs() < 0.0005e-3, "{below}");
    assert_eq!(first_clipped(0.9999 * below), None);
    let clipped = first_clipped(1.0001 * above);
    assert!(clipped.is_some_and(|time| time > 9.99), "{clipped:?}");
    assert_eq!(first_clipped(0.138e-3), None);
    let clipped = first_clipped(0.14e-3).unwrap();
    assert!((clipped - 9.997).abs() < 5e-4, "{clipped}");
}
