//! Critical periods: closed forms, and growth that changes sign there.

use hapt_analysis::multipliers;
use hapt_analysis::stability::critical::{Critical, RK4_REAL, critical};
use hapt_analysis::{Slopes, free, free_growth, held};
use hapt_model::{Delay, End, EstimatorKind, Method, Output, Source, World};
use hapt_testing::prelude::*;

use crate::common::*;

fn limit(world: &Bench, method: Method) -> Critical {
    critical(&world.bodies, &world.couplings, &Slopes::Flat, method).unwrap()
}

fn growth(world: &Bench, method: Method, period: f64) -> f64 {
    let all = multipliers(&world.bodies, &world.couplings, &Slopes::Flat, method, period).unwrap();
    all.iter().map(|m| m.growth(period)).fold(f64::NEG_INFINITY, f64::max)
}

/// Growth changes sign at the critical period, within a millionth of it, and nothing grows on the way there.
fn turns(world: &Bench, method: Method) -> Result<(), TestCaseError> {
    let omega = fastest(world);
    // The error by rounding in the growth of a world with this fastest rate.
    match limit(world, method) {
        Critical::Period(t) => {
            let floor = 1e-12 * omega.max(1.0 / t);
            let (below, above) = (growth(world, method, t * (1.0 - 1e-6)), growth(world, method, t * (1.0 + 1e-6)));
            prop_assert!(below < floor, "{} grows by {below} below {t}", method.name());
            prop_assert!(above > 0.0 || above.abs() < floor, "{} does not grow above {t}: {above}", method.name());
            for i in 1..60 {
                let earlier = t * 10f64.powf(-0.05 * f64::from(i));
                prop_assert!(growth(world, method, earlier) < 1e-12 * omega.max(1.0 / earlier), "at {earlier} of {t}");
            }
        }
        Critical::Never => {
            prop_assert_eq!(method, Method::ForwardEuler);
            for i in 1..5 {
                let t = 10f64.powi(-i) / omega;
                prop_assert!(growth(world, method, t) > -1e-12 * omega);
            }
        }
        Critical::Unbounded => {
            for i in -3..6 {
                let t = 10f64.powi(i) / omega;
                prop_assert!(growth(world, method, t) < 1e-12 * omega.max(1.0 / t));
            }
        }
    }
    Ok(())
}

const EXPLICIT: [Method; 3] = [Method::ForwardEuler, Method::SemiImplicitEuler, Method::Rk4];

proptest! {
    #[test]
    fn one_mode_has_the_closed_form(omega in 1e-2..1e5f64, zeta in 1e-6..3.0f64) {
        let world = oscillator(omega, zeta);
        let x = |method| limit(&world, method).period().unwrap() * omega;
        // Erratum of (2.14): 2ζ for complex roots only.
        let forward = if zeta < 1.0 { 2.0 * zeta } else { 2.0 / (zeta + (zeta * zeta - 1.0).sqrt()) };
        // Near ζ = 1 the two roots are one, which an eigenvalue solver finds to √eps.
        let tolerance = 1e-12 + 1e-15 / (1.0 - zeta).abs().max(1e-8);
        prop_assert!((x(Method::ForwardEuler) / forward - 1.0).abs() < tolerance);
        let semi = 2.0 / ((1.0 + zeta * zeta).sqrt() + zeta);
        prop_assert!((x(Method::SemiImplicitEuler) / semi - 1.0).abs() < 1e-14);
    }

    #[test]
    fn undamped_modes_have_exact_limits(omega in 1e-3..1e6f64) {
        let world = oscillator(omega, 0.0);
        prop_assert_eq!(limit(&world, Method::ForwardEuler), Critical::Never);
        let x = |method| limit(&world, method).period().unwrap() * omega;
        prop_assert!((x(Method::SemiImplicitEuler) - 2.0).abs() < 1e-15);
        prop_assert!((x(Method::Rk4) - 8f64.sqrt()).abs() < 1e-15);
        let mut matched = world;
        matched.couplings.push(compensator(End::Puck, End::Body(0)));
        let x = |method| limit(&matched, method).period().unwrap() * omega;
        prop_assert!((x(Method::ForwardEuler) - 2.0).abs() < 1e-15);
        prop_assert!((x(Method::SemiImplicitEuler) - 2.0 / 3f64.sqrt()).abs() < 1e-15);
        // z² + x² z + x² = 0 at the end of RK4's real axis.
        let x = x(Method::Rk4);
        prop_assert!((RK4_REAL * RK4_REAL + x * x * (1.0 + RK4_REAL)).abs() < 1e-13);
    }

    #[test]
    fn growth_turns_at_the_critical_period_with_fixed_dampers(world in worlds(Dampers::Fixed, true)) {
        for method in EXPLICIT {
            turns(&world, method)?;
        }
    }

    #[test]
    fn growth_turns_at_the_critical_period_without_dampers(world in worlds(Dampers::None, true)) {
        for method in EXPLICIT {
            turns(&world, method)?;
        }
    }

    #[test]
    fn growth_turns_at_the_critical_period_with_matched_dampers(world in worlds(Dampers::Matched, true)) {
        for method in EXPLICIT {
            turns(&world, method)?;
        }
    }

    #[test]
    fn growth_turns_at_the_critical_period_with_mixed_dampers(world in worlds(Dampers::Mixed, true)) {
        for method in EXPLICIT {
            turns(&world, method)?;
        }
    }

    #[test]
    fn scaling_time_scales_the_critical_period(world in worlds(Dampers::Mixed, false), faster in -3..4i32) {
        // Stiffness by s², fixed damping by s: every rate by s.
        let s = 2f64.powi(faster);
        let mut quick = world.clone();
        for c in &mut quick.couplings {
            match &mut c.law {
                hapt_model::Law::Spring { stiffness, .. } => *stiffness *= s * s,
                hapt_model::Law::Damper { damping: hapt_model::Damping::Fixed(b) } => *b *= s,
                _ => {}
            }
        }
        for method in EXPLICIT {
            match (limit(&world, method), limit(&quick, method)) {
                (Critical::Period(a), Critical::Period(b)) => prop_assert!((a / (b * s) - 1.0).abs() < 1e-7, "{}: {a} {}", method.name(), b * s),
                (a, b) => prop_assert_eq!(a, b),
            }
        }
    }
}

#[test]
fn a_node_of_a_mode_sees_no_damper() {
    // Two equal bodies, each on its own equal spring to the puck, a spring and a damper between them: they swing together
    // without moving the damper, at any size of it.
    for damping in [1e-9, 1.0, 1e6] {
        let mut world = oscillator(7.0, 0.0);
        world.bodies.push(body(1.0));
        world.couplings.push(spring(End::Puck, End::Body(1), 49.0));
        world.couplings.push(spring(End::Body(0), End::Body(1), 11.0));
        world.couplings.push(damper(End::Body(0), End::Body(1), damping));
        assert_eq!(limit(&world, Method::ForwardEuler), Critical::Never);
        let found = held(&world.bodies, &world.couplings, Method::Zoh, 1e-3).unwrap();
        assert_eq!(found.growth_per_s, Some(0.0));
        assert!(found.modes.iter().any(|m| m.damping_ratio == 0.0));
    }
    // The middle of five bodies between puck and ground stands still in two of their modes; the shapes are known up to rounding.
    let mut world = chain(5, 0.3, 70.0);
    world.couplings.push(spring(End::Body(4), End::Ground, 70.0));
    world.couplings.push(damper(End::Body(2), End::Ground, 2.0));
    assert_eq!(limit(&world, Method::ForwardEuler), Critical::Never);
    let found = held(&world.bodies, &world.couplings, Method::Zoh, 1e-3).unwrap();
    assert_eq!(found.modes.iter().filter(|m| m.damping_ratio == 0.0).count(), 2);
    // Unequal bodies move it.
    let mut world = oscillator(7.0, 0.0);
    world.bodies.push(body(1.001));
    world.couplings.push(spring(End::Puck, End::Body(1), 49.0));
    world.couplings.push(damper(End::Body(0), End::Body(1), 1.0));
    assert!(limit(&world, Method::ForwardEuler).period().is_some());
}

#[test]
fn modes_of_one_frequency_are_mixed_before_they_are_judged() {
    // Two equal bodies on equal springs, a damper between them and no spring: one frequency, and of its two modes only the
    // difference is damped. Any mixture would look damped.
    let mut world = oscillator(7.0, 0.0);
    world.bodies.push(body(1.0));
    world.couplings.push(spring(End::Puck, End::Body(1), 49.0));
    world.couplings.push(damper(End::Body(0), End::Body(1), 1.0));
    assert_eq!(limit(&world, Method::ForwardEuler), Critical::Never);
    assert_eq!(held(&world.bodies, &world.couplings, Method::Zoh, 1e-3).unwrap().growth_per_s, Some(0.0));
}

#[test]
fn half_a_compensation_is_not_enough_and_a_little_fixed_damping_helps() {
    // Two springs, one of them with a compensating damper: forward Euler grows at once.
    let mut world = chain(2, 1.0, 100.0);
    world.couplings.push(compensator(End::Puck, End::Body(0)));
    assert_eq!(limit(&world, Method::ForwardEuler), Critical::Never);
    world.couplings.push(damper(End::Body(1), End::Ground, 0.05));
    let with = limit(&world, Method::ForwardEuler).period().unwrap();
    // To first order T = φᵀC0φ/(ω² - φᵀC1φ) of the fast mode: ω² = 50 (3 + √5), φ = (√(1+1/√5), -√(1-1/√5))/√2.
    let root = 5f64.sqrt();
    let (near, far) = ((1.0 + 1.0 / root) / 2.0, (1.0 - 1.0 / root) / 2.0);
    let first_order = 0.05 * far / (50.0 * (3.0 + root) - 100.0 * near);
    assert!((with / first_order - 1.0).abs() < 1e-3, "{with} {first_order}");
}

#[test]
fn a_chains_far_end_keeps_its_digits_behind_a_stiff_one() {
    // Springs of 1e-2 and 1e10: the slow mode at 1/√1 rad/s, its limit 2ζ/ω, eleven decades below the other's.
    let mut world = oscillator(1e5, 0.0);
    world.couplings.push(damper(End::Body(0), End::Ground, 1e5));
    world.bodies.push(body(1.0));
    world.couplings.push(spring(End::Body(0), End::Body(1), 1e-2));
    world.couplings.push(damper(End::Body(1), End::Ground, 1e-9));
    // The slow mode: c/ω² = 1e-9/1e-2, but for 1e-2/1e10 of the neighbour.
    let t = limit(&world, Method::ForwardEuler).period().unwrap();
    assert!((t / 1e-7 - 1.0).abs() < 1e-9, "{t}");
}

/// Two bodies on the puck, damped, and a delay of many samples.
fn delayed(method: &str, [period, delay, puck, damping]: [f64; 4], bodies: [[f64; 3]; 2], ground: [f64; 2]) -> World {
    let mut file = format!(
        "[loop]\nmethod = \"{method}\"\noutput = \"start\"\nestimator = \"difference\"\nperiod = {period}\ndelay = {delay}\n\
         [device]\ninertia = {puck}\ndamping = {damping}\n"
    );
    let tie = |first: &str, second: &str, stiffness: f64, damping: f64| {
        let ends = format!("between = [\"{first}\", \"{second}\"]");
        format!(
            "[[couplings]]\nkind = \"spring\"\n{ends}\nstiffness = {stiffness}\n[[couplings]]\nkind = \"damper\"\n{ends}\ndamping = {damping}\n"
        )
    };
    let ties = [tie("b0", "puck", bodies[0][1], bodies[0][2]), tie("b1", "puck", bodies[1][1], bodies[1][2])];
    let to_ground = tie("puck", "ground", ground[0], ground[1]);
    for (i, [inertia, ..]) in bodies.iter().enumerate() {
        file += &format!("[bodies.b{i}]\ninertia = {inertia}\n");
    }
    World::read(&Source::from_text("w", file + &ties.concat() + &to_ground), &[]).unwrap()
}

#[test]
fn a_window_of_instability_ends_the_critical_period_of_a_delayed_loop() {
    // Found among random loops: each is unstable in a window of periods, and stable again beyond it, up to the last number.
    let loops = [
        (
            delayed(
                "tustin",
                [3.741221216969887e-4, 1.4759038491039366e-2, 8.933138894469159e-3, 76.58331030144569],
                [
                    [1.2406518455666089e-3, 0.8000835832773125, 0.0],
                    [3.937661185782494e-2, 6556.180776992292, 74.00132253966065],
                ],
                [0.0, 0.0],
            ),
            2.46973883200949e-3,
            7.29e-3,
        ),
        (
            delayed(
                "tustin",
                [1.769239793051922e-3, 6.473228380183889e-2, 1.725394005887226e-5, 4.882967297124297e-3],
                [
                    [3.3476939111281012e-6, 1.359985112091497e-2, 6.057964835357552e-5],
                    [6.713114238541137e-6, 1.240132139150423e-2, 2.06882908324919e-5],
                ],
                [2.9431763752081423e-6, 2.143021629008457e-6],
            ),
            3.2912650980367185e-2,
            5.68e-2,
        ),
    ];
    for (world, window, beyond) in loops {
        let at = |period: f64| {
            let mut world = world.clone();
            world.sampling.period = period;
            free_growth(&world).unwrap().unwrap()
        };
        let found = free(&world).unwrap().critical_period_s.unwrap();
        assert!((found / window - 1.0).abs() < 1e-9, "{found}");
        let lowest = (world.sampling.period / 1e3).max(world.sampling.delay_s() / 64.0);
        for i in 0..400 {
            let period = lowest * (found / lowest).powf(f64::from(i) / 400.0);
            assert!(at(period) < 1e-9, "{period} of {found}");
        }
        assert!(at(found * (1.0 + 1e-6)) > 0.0);
        // The window has another end.
        assert!((1..100).any(|i| at(found + (beyond - found) * f64::from(i) / 100.0) < 0.0));
    }
}

#[test]
fn a_window_between_the_steps_of_a_search_ends_the_critical_period() {
    // A window that returns in every sample of a delay of some 37, and one at the half turn of a body of 166 rad/s under an exact method.
    let mut late = delayed(
        "semi-implicit-euler",
        [1.5854986620761956e-3, 2.1772788603264676e-3, 1.6158203399652027e-5, 0.7752337246829156],
        [
            [1.837503047770782e-5, 0.05256803111570606, 0.5119047014523884],
            [1.8993674726089607e-2, 3.026819564633642, 0.0],
        ],
        [38.49312999789208, 0.0],
    );
    late.sampling.output = Output::End;
    let turned = delayed(
        "foh",
        [2.4170014919091152e-3, 2.4170014919091152e-3, 1.1149712485963311e-4, 0.34555070347704886],
        [
            [2.8642530238558808e-5, 0.7888958363914487, 1.7310478061444356e-6],
            [3.0747935590143563e-2, 0.11847420014016213, 3.94895165844702e-6],
        ],
        [0.0, 0.0],
    );
    for world in [late, turned] {
        let at = |period: f64| {
            let mut world = world.clone();
            world.sampling.period = period;
            free_growth(&world).unwrap().unwrap()
        };
        let found = free(&world).unwrap().critical_period_s.unwrap();
        let lowest = (world.sampling.period / 1e3).max(world.sampling.delay_s() / 64.0);
        for i in 0..2000 {
            let period = lowest * (found / lowest).powf(f64::from(i) / 2000.0);
            assert!(at(period) < 1e-8, "{period} of {found}");
        }
        assert!(at(found * (1.0 + 1e-6)) > 0.0);
        // Stable again beyond the window.
        assert!((1..400).any(|i| at(found * (1.0 + 1e-3 * f64::from(i))) < 0.0), "{found}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    /// b = T (K/2 + C1) + C0 at the puck is the period up to which a loop that keeps its energy is passive, and so stable hands-off.
    #[test]
    fn a_loop_that_keeps_its_energy_does_not_grow_up_to_the_period_of_its_damping(
        method in prop::sample::select(vec!["zoh", "trapezoidal", "backward-euler"]),
        puck in -5.0..-2.0f64,
        bodies in prop::array::uniform2((-5.0..-1.0f64, -1.0..4.0f64, prop_oneof![Just(0.0), (-6.0..-1.0f64).prop_map(|x| 10f64.powf(x))])),
        ground in prop_oneof![Just(0.0), 0.1..100.0f64],
        spare in 0.01..10.0f64,
        at in 1e-3..1.0f64,
    ) {
        let bodies = bodies.map(|(inertia, stiffness, damping)| [10f64.powf(inertia), 10f64.powf(stiffness), damping]);
        let [stiffness, fixed] = [1, 2].map(|i| bodies.iter().map(|body| body[i]).sum::<f64>());
        let stiffness = stiffness + ground;
        let mut world = delayed(method, [1e-3, 0.0, 10f64.powf(puck), fixed + spare], bodies, [ground, 0.0]);
        world.sampling.output = Output::End;
        world.sampling.delay = Delay::Seconds(0.0);
        world.sampling.estimator = EstimatorKind::Difference;
        let proved = 2.0 * spare / stiffness;
        let found = free(&world).unwrap();
        prop_assert!(found.critical_period_s.is_none_or(|critical| critical >= proved), "{:?} of {proved}", found.critical_period_s);
        prop_assert!(found.critical_period_reason != Some("never"));
        world.sampling.period = at * proved;
        let growth = free_growth(&world).unwrap().unwrap_or(f64::NEG_INFINITY);
        prop_assert!(growth < 1e-9 + 1e-13 / world.sampling.period + 1e-12 * (stiffness / bodies[0][0].min(bodies[1][0])).sqrt(), "{growth}");
    }
}
