//! A torque along the acceleration, as a compensation of inertia makes it: (T78), the hands-off loop, and what limits do to it.

use std::f64::consts::TAU;

use hapt_analysis::{
    Grip, Impedance, Slopes, Status, Verdict, check, free_growth, gripped_growth, is_certified, passivity, remedies,
    uneven,
};
use hapt_core::{Loop, Puck};
use hapt_model::{
    Body, Compensated, Compensation, Coupling, Delay, End, EstimatorKind, Law, Method, Output, Side, Source, World,
};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use crate::common::*;

const PERIOD: f64 = 1e-3;

type Room = Loop<f64, 2, 8, 32>;

fn along(inertia: f64, cutoff: f64) -> Coupling {
    Law::Acceleration { inertia, cutoff }.between(End::Ground, End::Puck)
}

fn world(couplings: Vec<Coupling>) -> World {
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, PERIOD);
    world.device.damping = 0.0;
    world
}

/// (T78) with one more pole r of the velocity's low-pass: J_c/T (1 - p) (1 - r) times the largest of
/// u (3 - p - r - p r - 2u)/(((1 - p)² + 2pu) ((1 - r)² + 2ru)), u = 1 - cos θ.
fn closed_form(inertia: f64, [p, r]: [f64; 2]) -> f64 {
    let (a, b, n) = ((1.0 - p).powi(2), (1.0 - r).powi(2), 3.0 - p - r - p * r);
    let (whole, slope, bend) = (a * b, 2.0 * (p * b + r * a), 4.0 * p * r);
    let u = n * whole / (2.0 * whole + (4.0 * whole * whole + n * whole * (n * bend + 2.0 * slope)).sqrt());
    inertia / PERIOD * (1.0 - p) * (1.0 - r) * u * (n - 2.0 * u) / (whole + slope * u + bend * u * u)
}

fn pole(cutoff: f64) -> f64 {
    1.0 / (1.0 + TAU * cutoff * PERIOD)
}

/// The most that a motion of so many steps draws, per Σ δ²: the largest eigenvalue of Σ τ_k δ_k as a form in the steps δ, of a linear loop.
fn drawn(world: &World, samples: usize) -> f64 {
    let core = Room::new(&world.spec()).unwrap();
    let mut state = core.start();
    core.step(&mut state, 0.0, 0.0);
    let torque: Vec<f64> = (0..samples).map(|_| core.step(&mut state, 1.0, 0.0).torque).collect();
    let form = DMatrix::from_fn(samples, samples, |i, j| if i > j { 0.5 * torque[i - j - 1] } else { 0.0 });
    (&form + form.transpose()).symmetric_eigenvalues().max()
}

/// The largest modulus of the map of one sample of the core on the exact puck, over z, ż, the low-passed velocity, z and v before, and the last
/// command.
fn modulus(world: &World) -> f64 {
    let core = Room::new(&world.spec()).unwrap();
    let (j, b, period) = (world.device.inertia, world.device.damping, world.sampling.period);
    let equations = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, -b / j, 1.0 / j, 0.0, 0.0, 0.0]);
    let late = world.sampling.delay_s();
    let parts = [(late, 1), (period - late, 0)].map(|(h, age)| ((&equations * h).exp(), age));
    let place = world.couplings.iter().position(|c| matches!(c.law, Law::Acceleration { .. })).unwrap();
    let step = |s: [f64; 6]| {
        let mut state = core.start();
        state.bristles[place] = s[2];
        state.memory.last = Some(Puck { position: s[3], velocity: s[4] });
        let sample = core.step(&mut state, s[0], 0.0);
        let commands = [sample.command, s[5]];
        let mut puck = (s[0], s[1]);
        for (part, age) in &parts {
            let at = |i: usize| part[(i, 0)] * puck.0 + part[(i, 1)] * puck.1 + part[(i, 2)] * commands[*age];
            puck = (at(0), at(1));
        }
        [puck.0, puck.1, state.bristles[place], s[0], sample.puck.velocity, commands[0]]
    };
    let columns: Vec<[f64; 6]> = (0..6).map(|i| step(std::array::from_fn(|j| f64::from(u8::from(i == j))))).collect();
    let map = DMatrix::from_fn(6, 6, |i, j| columns[j][i]);
    map.complex_eigenvalues().iter().map(|l: &Complex<f64>| l.norm()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// The requirement is (T78), with the difference and behind a low-pass, a spring adds KT/2, and a longest interval stretches it.
    #[test]
    fn the_requirement_is_the_closed_form(
        inertia in 1e-6..1e-3f64, log in -1.5..2.5f64, estimate in prop::option::of(5.0..400.0f64), k in 0.0..5.0f64, longest in 1.0..3.0f64,
    ) {
        let cutoff = 10_f64.powf(log);
        let mut world = world(vec![along(inertia, cutoff), spring(End::Puck, End::Ground, k)]);
        if let Some(estimate) = estimate {
            (world.sampling.estimator, world.sampling.cutoff) = (EstimatorKind::LowPass, Some(estimate));
        }
        let wanted = closed_form(inertia, [pole(cutoff), estimate.map_or(0.0, pole)]) + 0.5 * k * PERIOD;
        let found = passivity(&world).unwrap();
        prop_assert!((found.required_damping.unwrap() / wanted - 1.0).abs() < 1e-9, "{found:?} {wanted}");
        if estimate.is_none() {
            let p = pole(cutoff);
            let of_theory = inertia / PERIOD * (1.0 - p) * ((1.0 + p).sqrt() - (1.0 - p)).powi(2) / (2.0 * p * p);
            prop_assert!((of_theory + 0.5 * k * PERIOD - wanted).abs() < 1e-9 * wanted);
        }
        world.sampling.interval_max = Some(longest * PERIOD);
        let stretched = uneven(&world).unwrap().required_damping.unwrap();
        prop_assert!((stretched / (longest * wanted) - 1.0).abs() < 1e-9, "{stretched} {wanted}");
        // It decides, to the digit.
        world.sampling.interval_max = None;
        for (part, status) in [(1.0 - 1e-6, Status::Refuted), (1.0 + 1e-6, Status::Certified)] {
            world.device.damping = part * wanted;
            let found = check(&world).unwrap();
            prop_assert_eq!(found.passivity.passive.holds(), status == Status::Certified);
            prop_assert_eq!((found.status, is_certified(&world)), (status, status == Status::Certified));
        }
    }

    /// No motion draws more than the required damping takes, by the torque of the core itself; long ones draw almost as much.
    #[test]
    fn the_requirement_is_what_the_worst_motion_draws(
        inertia in 1e-6..1e-3f64, cutoff in 3.0..300.0f64, k in 0.0..5.0f64, b in 0.0..2e-3f64, every in 1u32..5, filter in prop::option::of(30.0..300.0f64),
        other in prop::option::of((1e-6..1e-3f64, 3.0..300.0f64)),
    ) {
        let mut couplings = vec![along(inertia, cutoff), spring(End::Puck, End::Ground, k), damper(End::Ground, End::Puck, b)];
        couplings.extend(other.map(|(inertia, cutoff)| along(inertia, cutoff)));
        let mut world = world(couplings);
        (world.sampling.every, world.sampling.filter) = (every, filter);
        let required = passivity(&world).unwrap().required_damping.unwrap();
        let most = PERIOD * drawn(&world, 300);
        prop_assert!(most <= required * (1.0 + 1e-9) + 1e-15, "{most} {required}");
        prop_assert!(most >= 0.85 * required, "{most} {required}");
    }

    /// The growth of the certificate is that of the real loop on an exact puck.
    #[test]
    fn the_growth_is_that_of_the_real_loop(
        share in 0.01..3.0f64, cutoff in 0.5..300.0f64, k in 0.0..20.0f64, b in 0.0..5e-3f64, late in prop_oneof![Just(0.0), 0.0..0.9f64],
        estimate in prop::option::of(5.0..300.0f64),
    ) {
        let mut world = world(vec![spring(End::Puck, End::Ground, k + 0.1), damper(End::Puck, End::Ground, b)]);
        world.couplings.push(along(share * world.device.inertia, cutoff));
        world.device.damping = 1.2e-3;
        world.sampling.delay = Delay::Seconds(late * PERIOD);
        if let Some(estimate) = estimate {
            (world.sampling.estimator, world.sampling.cutoff) = (EstimatorKind::LowPass, Some(estimate));
        }
        let most = modulus(&world).ln() / PERIOD;
        let found = free_growth(&world).unwrap().unwrap();
        prop_assert!((found - most).abs() < 1e-6 / PERIOD, "{found} {most}");
        let checked = check(&world).unwrap();
        prop_assert_eq!(checked.free.verdict == Verdict::Unstable, found > 0.0, "{} {:?}", found, checked.free);
        // The modes of the differential equation are roots of (J s² + B s + K) (1 + τs) = J_c s².
        let (inertia, tau) = (world.device.inertia, 1.0 / (TAU * cutoff));
        for mode in &checked.free.modes {
            let (omega, zeta) = (mode.frequency_hz * TAU, mode.damping_ratio);
            let s = Complex::new(-zeta, (1.0 - zeta * zeta).max(0.0).sqrt()) * omega;
            let own = s * s * inertia + s * (b + 1.2e-3) + k + 0.1;
            let size = (inertia * omega * omega + (b + 1.2e-3) * omega + k) * (1.0 + tau * omega);
            let left = own * (1.0 + s * tau) - s * s * (share * inertia);
            prop_assert!(left.norm() < 1e-6 * size, "{left} {size}");
        }
    }

    /// With walls and detents at the puck and with bodies, at even samples or not, it has a share of its own, and what the certificate says is enough
    /// takes all that a motion draws.
    #[test]
    fn beside_walls_and_bodies_it_has_a_share_of_its_own(
        inertia in 1e-6..2e-4f64, cutoff in 1.0..200.0f64, k in 0.1..5.0f64, with_body in any::<bool>(),
        at_body in any::<bool>(), from_above in any::<bool>(),
        steps in prop::collection::vec(-1.0..1.0f64, 400), swing in 0.05..3.1f64,
    ) {
        let side = if from_above { Side::Above } else { Side::Below };
        let mut world = world(vec![along(inertia, cutoff)]);
        let wall = Law::Wall { side, at: 0.0, stiffness: k, damping: 0.0 };
        if with_body {
            world.bodies = vec![Body { inertia: 1e-3, position: 0.0, velocity: 0.0 }];
            world.names = vec!["mass".into()];
            world.couplings.push(spring(End::Puck, End::Body(0), 0.5 * k));
        }
        let first = if with_body && at_body { End::Body(0) } else { End::Puck };
        let detent = Law::Detent { torque: 0.02 * k, pitch: 0.5, phase: 0.0 };
        world.couplings.extend([wall.between(first, End::Ground), detent.between(End::Puck, End::Ground)]);
        let found = passivity(&world).unwrap();
        let required = found.required_damping.unwrap();
        let alone = closed_form(inertia, [pole(cutoff), 0.0]);
        prop_assert!(required >= alone, "{required} {alone}");
        world.device.damping = required * (1.0 + 1e-9);
        prop_assert!(passivity(&world).unwrap().passive.holds());
        let core = Room::new(&world.spec()).unwrap();
        let mut state = core.start();
        let (mut z, mut work, mut path) = (0.0, 0.0, 0.0_f64);
        for (i, step) in steps.iter().enumerate() {
            let torque = core.step(&mut state, z, 0.0).torque;
            let moved = 1e-2 * (swing * i as f64).sin() + 3e-3 * step;
            (z, work, path) = (z + moved, work + torque * moved, path + moved * moved);
        }
        prop_assert!(work <= required / PERIOD * path * (1.0 + 1e-9) + 1e-15, "{work} {path}");
    }

    /// Of the rendered impedance it takes ω² J_c below its cutoff, and costs the required damping at the worst frequency.
    #[test]
    fn the_impedance_shows_less_inertia_and_less_damping(share in 0.01..0.9f64, cutoff in 1.0..100.0f64) {
        let mut world = world(Vec::new());
        let inertia = share * world.device.inertia;
        world.couplings.push(along(inertia, cutoff));
        let impedance = Impedance::new(&world, &Slopes::Steep).unwrap();
        let low = impedance.row(1e-3 * cutoff);
        prop_assert!((low.rendered.unwrap().inertia / -inertia - 1.0).abs() < 1e-2, "{:?}", low.rendered);
        prop_assert!((low.ideal.unwrap().inertia / -inertia - 1.0).abs() < 1e-5, "{:?}", low.ideal);
        let found = passivity(&world).unwrap();
        let at = found.at_hz.unwrap();
        let half = std::f64::consts::PI * at * PERIOD;
        let held = impedance.row(at).rendered.unwrap().damping * (half / half.sin()).powi(2);
        prop_assert!((held / found.required_damping.unwrap() + 1.0).abs() < 1e-6, "{held} {found:?}");
    }

    /// With a limit that the device's friction takes it requires no damping, whatever it is and however it is measured, (T76); with more it is
    /// not proved, and its own loop still decides whether it grows.
    #[test]
    fn a_limit_within_the_devices_friction_makes_it_free(
        share in 0.1..5.0f64, cutoff in 0.5..300.0f64, limit in 1e-3..0.05f64, part in 0.0..2.0f64, late in prop_oneof![Just(0.0), 0.0..4.0f64],
        estimator in prop::sample::select(vec![EstimatorKind::Difference, EstimatorKind::Exact, EstimatorKind::Foaw, EstimatorKind::Kalman, EstimatorKind::Levant]),
    ) {
        let mut world = world(Vec::new());
        (world.sampling.estimator, world.sampling.cutoff, world.sampling.acceleration) = (estimator, Some(50.0), Some(1e3));
        world.couplings.push(Coupling { limit: Some(limit), ..along(share * world.device.inertia, cutoff) });
        world.sampling.delay = Delay::Samples(late);
        (world.device.damping, world.device.friction, world.device.limit) = (1e-4, part * limit, Some(1.0));
        let found = check(&world).unwrap();
        prop_assert_eq!(found.certified.holds(), part >= 1.0, "{}", found.headline());
        prop_assert_eq!(is_certified(&world), part >= 1.0);
    }
}

/// Behind an estimator that no theorem covers it is not proved, with or without springs, walls and dampers.
#[test]
fn behind_other_estimators_it_is_not_proved() {
    for estimator in [
        EstimatorKind::Exact,
        EstimatorKind::Foaw,
        EstimatorKind::FoawBest,
        EstimatorKind::Kalman,
        EstimatorKind::Levant,
    ] {
        for more in [
            vec![],
            vec![spring(End::Puck, End::Ground, 0.1), damper(End::Puck, End::Ground, 1e-4)],
            vec![
                Law::Wall { side: Side::Above, at: 0.1, stiffness: 0.1, damping: 0.0 }.between(End::Puck, End::Ground),
            ],
        ] {
            let mut world = world([vec![along(1e-6, 5.0)], more].concat());
            (world.sampling.estimator, world.sampling.cutoff, world.sampling.acceleration) =
                (estimator, Some(50.0), Some(1e3));
            world.device.damping = 1.0;
            let found = check(&world).unwrap();
            assert!(!found.certified.holds() && !is_certified(&world), "{estimator:?}: {}", found.headline());
            // The true velocity counts as the difference, which `certified` does not take it for.
            assert!(!found.uneven.passive.holds() || estimator == EstimatorKind::Exact, "{estimator:?}");
        }
    }
}

/// A hand finds what is missing: at a damping below the requirement one grows.
#[test]
fn below_the_requirement_a_hand_grows() {
    for cutoff in [5.0, 50.0, 200.0] {
        let mut world = world(vec![along(1e-4, cutoff)]);
        let found = passivity(&world).unwrap();
        world.device.damping = 0.9 * found.required_damping.unwrap();
        let omega = TAU * found.at_hz.unwrap();
        let heavy = 1e3 * world.device.inertia;
        let grows = (0..200).any(|i| {
            let omega = omega * 1.01_f64.powi(i - 100);
            let grip = Grip { inertia: heavy, damping: 0.0, stiffness: heavy * omega * omega };
            gripped_growth(&world, &grip).unwrap().is_some_and(|growth| growth > 0.0)
        });
        assert!(grows, "{cutoff}");
        let worst = hapt_analysis::worst_grip(&world).unwrap().unwrap();
        assert!(worst.growth_per_s > 0.0, "{cutoff}");
    }
}

/// The motor's limit cuts its torque, which no theorem covers: the certificate says so, and eigenvalues claim nothing.
#[test]
fn a_motor_that_saturates_is_left_out_by_name() {
    let mut world = world(vec![along(1e-5, 5.0)]);
    world.device.damping = 1.2e-3;
    assert_eq!(check(&world).unwrap().status, Status::Certified);
    world.device.limit = Some(0.1);
    let found = check(&world).unwrap();
    assert!(found.headline().contains("clipping"), "{}", found.headline());
    world.device.damping = 1e-5;
    let found = check(&world).unwrap();
    assert!(found.headline().contains("not proved safe to let go"), "{}", found.headline());
}

/// The share of `[[compensation]]`: what it costs is printed, and too much of it is not certified.
#[test]
fn a_compensation_prints_what_it_costs() {
    let mut world = world(Vec::new());
    world.device.damping = 1.2e-3;
    let compensation = |share: f64| Compensation { of: Compensated::Inertia, share, velocity: None, cutoff: Some(5.0) };
    for (share, is_certified) in [(0.05, true), (0.06, true), (0.065, false), (1.0, false)] {
        let coupling = world.device.compensation(compensation(share)).unwrap();
        let (of, found) = world.device.compensated_by(&coupling).unwrap();
        assert!(of == Compensated::Inertia && (found - share).abs() < 1e-12);
        world.couplings = vec![coupling];
        let found = check(&world).unwrap();
        assert_eq!(found.certified.holds(), is_certified, "{share}");
        let cost = closed_form(share * world.device.inertia, [pole(5.0), 0.0]);
        let note = found.notes.iter().find(|note| note.starts_with("compensation of inertia")).unwrap().clone();
        let said: f64 = note.split("costs ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((said / cost - 1.0).abs() < 1e-3, "{note} {cost}");
    }
}

/// A low-pass far beyond the sampling rate passes everything: the requirement is that of double differences, 9 J_c/(8 T), and the growth that of
/// the limit, whatever the cutoff.
#[test]
fn a_low_pass_that_passes_everything_is_a_double_difference() {
    let of = |cutoff: f64, inertia: f64| {
        let mut world = world(vec![along(inertia, cutoff), spring(End::Puck, End::Ground, 2.0)]);
        world.device.damping = 1.2e-3;
        world
    };
    for inertia in [3e-8, 1e-6, 1e-4] {
        let limit = free_growth(&of(1e7, inertia)).unwrap().unwrap();
        for cutoff in [1e8, 1e11, 1e15, 1e20] {
            let world = of(cutoff, inertia);
            let required = passivity(&world).unwrap().required_damping.unwrap();
            let wanted = 9.0 * inertia / (8.0 * PERIOD) + 1e-3;
            assert!((required / wanted - 1.0).abs() < 1e-5, "{cutoff} {inertia}: {required} {wanted}");
            let growth = free_growth(&world).unwrap().unwrap();
            assert!((growth - limit).abs() < 1e-3 * limit.abs(), "{cutoff} {inertia}: {growth} {limit}");
        }
    }
}

/// A limit that is a little more than the device's friction is not proved, and not refuted: the friction takes small torques too. Without
/// friction the linear loop refutes it.
#[test]
fn a_limit_beyond_the_devices_friction_is_open() {
    let mut world = world(vec![Coupling { limit: Some(5.1e-3), ..along(1e-4, 5.0) }]);
    (world.device.damping, world.device.friction) = (1.2e-3, 5e-3);
    assert_eq!(check(&world).unwrap().status, Status::Open);
    world.device.friction = 0.0;
    assert_eq!(check(&world).unwrap().status, Status::Refuted);
    world.device.friction = 5.1e-3;
    assert_eq!(check(&world).unwrap().status, Status::Certified);
}

/// An estimator that nothing takes has no effect: with a limit that friction takes the rest is proved behind a low-pass as behind others.
#[test]
fn an_estimator_that_nothing_takes_has_no_effect() {
    let wall = Law::Wall { side: Side::Above, at: 0.1, stiffness: 0.5, damping: 0.0 }.between(End::Puck, End::Ground);
    let mut world = world(vec![Coupling { limit: Some(4.5e-3), ..along(1e-2, 5.0) }, wall]);
    (world.device.damping, world.device.friction, world.sampling.cutoff) = (1.2e-3, 5e-3, Some(50.0));
    for estimator in EstimatorKind::ALL {
        (world.sampling.estimator, world.sampling.acceleration) = (estimator, Some(1e3));
        assert_eq!(check(&world).unwrap().status, Status::Certified, "{estimator:?}");
    }
}

/// A coupling of the file that does what a compensation does has a smaller number as its remedy.
#[test]
fn a_coupling_that_compensates_too_much_has_a_smaller_number_as_remedy() {
    for (coupling, key, certified) in [
        ("kind = \"assist\"\ntorque = \"6 N mm\"\nvelocity = 1", "torque = \"5 N mm\"", "torque = 0.005"),
        (
            "kind = \"acceleration\"\ninertia = 5e-5\nlimit = \"6 N mm\"\ncutoff = \"5 Hz\"",
            "limit = \"5 N mm\"",
            "limit = 0.005",
        ),
        ("kind = \"acceleration\"\ninertia = 5e-5\ncutoff = \"5 Hz\"", "inertia = \"", "inertia = 3.92e-5"),
    ] {
        let file = |coupling: &str| {
            format!(
                "loop = {{ period = 0.001, estimator = \"difference\" }}\n\
                 device = {{ inertia = 6.4e-4, damping = 1.2e-3, friction = \"5 N mm\" }}\n\
                 [[couplings]]\nbetween = [\"puck\", \"ground\"]\n{coupling}\n"
            )
        };
        let source = Source::from_text("w", file(coupling));
        let world = World::read(&source, &[]).unwrap();
        let (check, found) = (check(&world).unwrap(), remedies(&world).unwrap());
        assert!(!check.certified.holds());
        let all = hapt_analysis::proposal(&world, &source, &[], &check, &found).unwrap().unwrap();
        let lines = all.lines();
        assert!(lines.iter().any(|line| line.trim_start().starts_with(key)), "{lines:?}");
        let name = certified.split(' ').next().unwrap();
        let others: Vec<&str> = coupling.lines().filter(|line| !line.starts_with(name)).collect();
        let smaller = file(&format!("{}\n{certified}", others.join("\n")));
        assert!(is_certified(&World::read(&Source::from_text("w", smaller), &[]).unwrap()));
    }
}
