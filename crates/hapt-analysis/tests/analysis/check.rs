//! `check`, `design` and the closed forms: the notes' numbers, and what programs read.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use hapt_analysis::closed_form::*;
use hapt_analysis::{Continuous, Design, Discrete, Slopes, check};
use hapt_core::spec::Range;
use hapt_model::{Coupling, End, EstimatorKind, Law, Method, Output, Side, World, builtin};
use hapt_testing::laws::laws;
use hapt_testing::prelude::*;

use crate::common::*;

fn world(bench: Bench, method: Method, period: f64) -> World {
    let mut world = bench.world(method, Output::Start, period);
    world.sampling.estimator = EstimatorKind::Exact;
    world
}

/// The notes' wheel, section 2.1.
fn notes() -> (Design, Bench) {
    let design = Design::new(FRAC_PI_4, 0.8, 1.0, 1e-3).unwrap();
    let couplings = vec![spring(End::Puck, End::Body(0), design.stiffness)];
    (design, Bench { bodies: vec![body(design.inertia)], couplings })
}

#[test]
fn the_notes_specification_gives_the_notes_wheel() {
    let (design, _) = notes();
    assert!((design.stiffness - 1.018592).abs() < 5e-7);
    assert!((design.inertia - 0.02580123).abs() < 5e-9);
    assert!((design.compensating_damping - 1.018592e-3).abs() < 5e-10);
    // In the notes' units: 17.7778 N mm/deg and 0.4503164 N mm/(deg/s²).
    assert!((design.stiffness * 1e3 * TAU / 360.0 - 17.7778).abs() < 5e-5);
    assert!((design.inertia * 1e3 * TAU / 360.0 - 0.4503164).abs() < 5e-8);
    let text = serde_json::to_string(&design).unwrap();
    let keys = ["stiffness", "inertia", "compensating_damping", "natural_frequency_hz", "peak_torque"];
    let places: Vec<_> = keys.iter().map(|k| text.find(&format!("\"{k}\"")).unwrap()).collect();
    assert!(places.is_sorted());
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
        assert!(Design::new(wrong, 1e300, 1.0, 1e-3).is_err());
        assert!(Design::new(1.0, 1.0, 1.0, wrong).is_err() || wrong == 1e-320);
    }
}

#[test]
fn check_speaks_the_words_of_the_contract() {
    let (_, bench) = notes();
    let answer = check(&world(bench, Method::ForwardEuler, 1e-3)).unwrap();
    let value = serde_json::to_value(&answer).unwrap();
    assert_eq!(value["period_s"], 1e-3);
    assert_eq!(value["method"], "forward-euler");
    assert_eq!(value["output"], "start");
    let held = &value["held"];
    assert!((held["growth_per_s"].as_f64().unwrap() - 0.0197388).abs() < 5e-8);
    assert_eq!(held["verdict"], "unstable");
    assert!(held["critical_period_s"].is_null());
    assert_eq!(held["critical_period_reason"], "never");
    assert_eq!(held["eigenvalues"].as_array().unwrap().len(), 2);
    assert!(held["eigenvalues"][0]["im"].as_f64().unwrap() > 0.0);
    assert!((held["eigenvalues"][0]["re"].as_f64().unwrap() - 1.0).abs() < 1e-15);
    assert_eq!(held["eigenvalues"][0]["abs"], held["spectral_radius"]);
    assert!((held["modes"][0]["frequency_hz"].as_f64().unwrap() - 1.0).abs() < 1e-14);
    assert_eq!(held["modes"][0]["damping_ratio"], 0.0);
    let x: f64 = TAU * 1e-3;
    let log = (0.5 * (x * x).ln_1p()).hypot(x.atan());
    assert!((held["modes"][0]["discrete_frequency_hz"].as_f64().unwrap() - log / x).abs() < 1e-14);
    assert!((held["modes"][0]["discrete_damping_ratio"].as_f64().unwrap() + 0.5 * (x * x).ln_1p() / log).abs() < 1e-14);
    let notes: Vec<_> = value["notes"].as_array().unwrap().iter().filter_map(|n| n.as_str()).collect();
    assert_eq!(notes, ["free: its critical period is searched from 1 us up"]);
    assert!(value["free"].as_object().unwrap().keys().eq(held.as_object().unwrap().keys()));
    let text = serde_json::to_string(&answer).unwrap();
    let keys = [
        "held",
        "free",
        "passivity",
        "required_damping",
        "device_damping",
        "at_hz",
        "passive",
        "proved",
        "not_proved",
        "quantisation",
        "max_stiffness",
        "ok",
        "notes",
    ];
    let places: Vec<_> = keys.iter().map(|k| text.find(&format!("\"{k}\":")).unwrap()).collect();
    assert!(places.is_sorted() && !text.contains("cause"));
    assert_eq!(
        answer.passivity_sentence(),
        "not passive at any device damping: the hand feels a motion at 1 Hz that grows by itself"
    );
    assert_eq!(answer.quantisation_sentence(), None);
    assert_eq!(
        answer.sentence(),
        "unstable: the held world grows by 0.01974 per second (a factor 1.22 in 10 s); forward Euler is never stable on an \
         undamped mode"
    );
}

#[test]
fn sentences_give_their_reasons() {
    let of = |bench: Bench, method, period| check(&world(bench, method, period)).unwrap().sentence();
    let (_, bench) = notes();
    assert!(
        of(bench, Method::Zoh, 1e-3)
            .starts_with("marginal: the held world neither grows nor decays; a swing keeps its size")
    );
    let (_, mut bench) = notes();
    bench.couplings.push(compensator(End::Body(0), End::Puck));
    let matched = of(bench, Method::ForwardEuler, 1e-3);
    assert!(
        matched.ends_with("its dampers undo what forward Euler adds to a swing, up to a period of 318.3 ms"),
        "{matched}"
    );
    let mut half = chain(2, 1.0, 100.0);
    half.couplings.push(compensator(End::Body(0), End::Puck));
    let half = of(half, Method::ForwardEuler, 1e-3);
    assert!(
        half.ends_with("at every period forward Euler takes more damping from a mode than its dampers give"),
        "{half}"
    );
    let loose = Bench { bodies: vec![body(1.0)], couplings: vec![] };
    assert!(of(loose, Method::Zoh, 1e-3).contains("tied by no spring"));
    // 2ζ/ω = 20 ms.
    let damped = of(oscillator(10.0, 0.1), Method::ForwardEuler, 1e-3);
    assert!(damped.starts_with("stable: a disturbance of the held world decays by at least 0.95"), "{damped}");
    assert!(damped.ends_with("forward Euler stays so up to a period of 20 ms"), "{damped}");
    let late = of(oscillator(10.0, 0.1), Method::ForwardEuler, 0.05);
    assert!(late.ends_with("forward Euler is stable here up to a period of 20 ms, and this one is 50 ms"), "{late}");
    let empty = Bench { bodies: vec![], couplings: vec![] };
    assert!(of(empty, Method::Zoh, 1e-3).starts_with("stable"));
}

#[test]
fn notes_say_what_the_numbers_leave_out() {
    let (_, mut bench) = notes();
    bench.couplings.push(compensator(End::Body(0), End::Puck));
    let notes_of = |bench: &Bench, method| check(&world(bench.clone(), method, 1e-3)).unwrap().notes;
    assert!(notes_of(&bench, Method::ForwardEuler)[0].starts_with("free: its critical period is searched"));
    assert!(notes_of(&bench, Method::Zoh)[0].contains("couplings.1"));
    let wall = Law::Wall { side: Side::Above, at: 0.1, stiffness: 1e4, damping: 0.0 };
    bench.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law: wall, limit: None });
    assert!(notes_of(&bench, Method::ForwardEuler)[0].contains("linear estimate"));
    let all = notes_of(&bench, Method::ForwardEuler);
    assert!(
        all.iter().any(|n| n.starts_with("free is a linear estimate") && n.contains("worst of 2 combinations")),
        "{all:?}"
    );
    bench.couplings.clear();
    assert!(notes_of(&bench, Method::Zoh)[0].contains("body0"));
}

#[test]
fn seven_nonlinear_couplings_are_looked_at_alone() {
    // ω² is 1e4 in each single wall, 7e4 in all of them, 100 in none: the steepest counts for the period.
    let mut bench = oscillator(10.0, 0.02);
    for _ in 0..7 {
        let wall = Law::Wall { side: Side::Below, at: 0.0, stiffness: 1e4, damping: 0.0 };
        bench.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law: wall, limit: None });
    }
    let found = check(&world(bench, Method::ForwardEuler, 1e-6)).unwrap();
    assert!((found.held.critical_period_s.unwrap() - 0.4 / 70100.0).abs() < 1e-15);
    assert!(found.notes[0].contains("alone steep"));
}

/// Runs the notes' wheel after a step of the puck to 45°: positions and torques.
fn run(bench: &Bench, method: Method, samples: usize) -> Vec<(f64, f64)> {
    let equations = Continuous::new(&bench.bodies, &bench.couplings, &Slopes::Flat).unwrap();
    let step = Discrete::new(&equations, method, Output::Start, 0, 1e-3).unwrap();
    let u = nalgebra::Vector2::new(FRAC_PI_4, 0.0);
    let mut x = nalgebra::DVector::zeros(2);
    (0..samples)
        .map(|_| {
            let torque = (&step.torque.state * &x)[0] + step.torque.puck[0] * u[0];
            let row = (x[0], torque);
            x += &step.d * &x + &step.current * u;
            row
        })
        .collect()
}

#[test]
fn closed_forms_are_what_the_step_does() {
    let (design, bench) = notes();
    let (k, z0, omega, period) = (design.stiffness, FRAC_PI_4, TAU, 1e-3);
    // (2.3), (2.4): zoh is exact.
    for (i, (w, torque)) in run(&bench, Method::Zoh, 3000).into_iter().enumerate() {
        let t = i as f64 * period;
        assert!((w - step_response(z0, omega, t)).abs() < 1e-12);
        assert!((torque - step_torque(k, z0, omega, t)).abs() < 1e-12);
    }
    // Forward Euler: sample by sample, and the first beyond the motor's 822.25 N mm.
    let rows = run(&bench, Method::ForwardEuler, 5000);
    for (i, (_, torque)) in rows.iter().enumerate() {
        assert!((torque - forward_euler_torque(k, z0, omega, period, i as u64)).abs() < 1e-12);
    }
    let first = rows.iter().position(|(_, torque)| torque.abs() > 0.82225).unwrap();
    assert_eq!(forward_euler_exceeds(k, z0, omega, period, 0.82225), Some(first as u64));
    assert!((forward_euler_growth(omega, period) - 0.0197388).abs() < 5e-8);
    // b = Tk: the swing about z0 has amplitude z0/cos(φ/2); at x = 0.7, where the samples meet every phase.
    let mut matched = oscillator(700.0, 0.0);
    matched.couplings.push(compensator(End::Puck, End::Body(0)));
    let swing = run(&matched, Method::ForwardEuler, 100_000).iter().map(|(w, _)| (w - z0).abs()).fold(0.0, f64::max);
    let amplitude = compensated_amplitude(z0, 700.0, period).unwrap();
    assert!((swing / amplitude - 1.0).abs() < 1e-8 && amplitude > 1.06 * z0, "{swing} {amplitude}");
    assert_eq!(compensated_amplitude(z0, 2.0, 1.0), None);
}

#[test]
fn resonance_has_no_bound_and_a_released_pair_swings_faster() {
    // ẅ + ω² w = ω² A sin ωt by central differences of the closed form.
    let (a, omega, h) = (0.3, 7.0, 1e-3);
    for t in [0.005, 0.5, 3.0] {
        let w = |t| resonance(a, omega, t);
        let acceleration = (w(t + h) - 2.0 * w(t) + w(t - h)) / (h * h);
        assert!((acceleration + omega * omega * (w(t) - a * (omega * t).sin())).abs() < 1e-3 * (1.0 + omega * t));
    }
    assert!((resonance(1.0, 1.0, 0.1) - resonance(1.0, 1.0, 0.1 - 1e-12)).abs() < 1e-13);
    assert!(resonance(a, omega, 100.0).abs().max(resonance(a, omega, 100.0 + PI / 14.0).abs()) > 50.0);
    assert!((released_frequency_hz(1.0, 0.5, 0.5) - 2.0 / TAU).abs() < 1e-15);
}

proptest! {
    #[test]
    fn the_first_sample_beyond_a_limit_is_the_first(x in 1e-3..5.0f64, ratio in 0.5..50.0f64) {
        let torque = |k: u64| forward_euler_torque(1.0, 1.0, x, 1.0, k).abs();
        let naive = (0..100_000_000).find(|&k| torque(k) > ratio);
        prop_assert_eq!(forward_euler_exceeds(1.0, 1.0, x, 1.0, ratio), naive);
    }
}

#[test]
fn a_limit_that_is_never_passed_is_none() {
    assert_eq!(forward_euler_exceeds(1.0, 1.0, 0.0, 1e-3, 2.0), None);
    assert_eq!(forward_euler_exceeds(0.0, 1.0, 1.0, 1e-3, 2.0), None);
    assert_eq!(forward_euler_exceeds(1.0, 1.0, 1e-6, 1e-6, 2.0), None);
    assert_eq!(forward_euler_exceeds(1.0, 1.0, 1.0, 1e-3, f64::INFINITY), None);
    assert_eq!(forward_euler_exceeds(1.0, 1.0, 1.0, 1e-3, f64::NAN), None);
    assert_eq!(forward_euler_exceeds(f64::NAN, 1.0, 1.0, 1e-3, 1.0), None);
    assert_eq!(forward_euler_exceeds(1.0, 1.0, 1e200, 1e200, 1.0), None);
}

/// 10^±300, or an everyday number.
fn any_size() -> impl Strategy<Value = f64> {
    prop_oneof![(-300.0..300.0f64).prop_map(|d| 10f64.powf(d)), (-6.0..6.0f64).prop_map(|d| 10f64.powf(d)), Just(0.0)]
}

fn any_of(_: &str, range: Range) -> BoxedStrategy<f64> {
    match range {
        Range::Any => prop_oneof![any_size(), any_size().prop_map(|x| -x)].boxed(),
        Range::ZeroOrMore => any_size().boxed(),
        Range::Positive => any_size().prop_map(|x| x.max(f64::MIN_POSITIVE)).boxed(),
    }
}

proptest! {
    #[test]
    fn no_finite_world_makes_it_panic_or_lie(
        inertias in prop::collection::vec(any_size(), 1..5),
        laws in prop::collection::vec((laws(|_| true, any_of), 0..6usize, 0..6usize), 0..10),
        period in any_size(),
    ) {
        let n = inertias.len();
        let end = |i: usize| match i { 0 => End::Puck, 1 => End::Ground, i => End::Body(i % n) };
        let apart = laws.into_iter().filter(|&(_, first, second)| end(first) != end(second));
        let couplings = apart.map(|(law, first, second)| law.between(end(first), end(second)));
        let bench = Bench { bodies: inertias.into_iter().map(body).collect(), couplings: couplings.collect() };
        // Only an integral term gives a continuous mode energy.
        let gives = bench.couplings.iter().any(|coupling| matches!(coupling.law, Law::Integral { .. }));
        let damping_ratios = if gives { -1.0 - 1e-12 } else { -1e-12 }..1.0 + 1e-12;
        for method in Method::ALL {
            let Ok(found) = check(&world(bench.clone(), method, period)) else { continue };
            for part in [&found.held, &found.free] {
                prop_assert!(part.spectral_radius.is_finite());
                prop_assert!(part.growth_per_s.is_none_or(f64::is_finite));
                prop_assert!(part.critical_period_s.is_none_or(|t| t > 0.0 && t.is_finite()));
                prop_assert_eq!(part.critical_period_s.is_none(), part.critical_period_reason.is_some());
                prop_assert!(part.modes.iter().all(|m| m.frequency_hz > 0.0 && damping_ratios.contains(&m.damping_ratio)));
            }
            prop_assert!(!found.sentence().contains("NaN") && !found.free_sentence().contains("NaN"));
        }
    }
}

#[test]
fn passivity_is_said_with_what_is_missing_and_where() {
    let (design, bench) = notes();
    let mut world = world(bench, Method::Zoh, 1e-3);
    world.sampling.output = Output::End;
    let half = 0.5e-3 * design.stiffness;
    let answer = check(&world).unwrap();
    assert!((answer.passivity.required_damping.unwrap() - half).abs() < 1e-12 * half);
    assert_eq!(
        answer.passivity_sentence(),
        "passive against every passive hand: it requires a device damping of 0.0005093 N m s/rad, the same at every frequency, and the \
         device has 0.0012"
    );
    world.sampling.output = Output::Start;
    assert_eq!(
        check(&world).unwrap().passivity_sentence(),
        "not passive at any device damping: the mode at 1 Hz is undamped, and its torque is out of phase with the hand"
    );
    let puck = |law| Coupling { first: End::Puck, second: End::Ground, law, limit: None };
    world.couplings.extend([puck(Law::Constant { torque: -0.6 }), puck(Law::Coulomb { torque: 0.1 })]);
    let answer = check(&world).unwrap();
    assert!(answer.notes.iter().any(|n| n.contains("constant torque") && n.contains("500")), "{:?}", answer.notes);
    assert!(answer.notes.iter().any(|n| n.contains("Coulomb friction at the puck")));
    world.couplings = vec![puck(Law::Spring { stiffness: 10.0, rest: 0.0 })];
    world.device.encoder = Some(1000.0);
    let answer = check(&world).unwrap();
    assert_eq!(
        answer.passivity_sentence(),
        "not passive (the linear loop): it requires a device damping of 0.005 N m s/rad, the same at every frequency, and the device has \
         0.0012, 0.0038 too little"
    );
    assert!(
        answer
            .quantisation_sentence()
            .unwrap()
            .ends_with("only up to 0 N m/rad at the puck, and there is more: it may buzz")
    );
}

/// Users write these worlds onto a board and turn the knob without another check.
#[test]
fn every_knob_that_comes_along_is_certified_within_what_is_known_of_its_motor() {
    let knobs: Vec<String> = builtin::names().filter(|name| name.starts_with("@knob/")).collect();
    assert!(knobs.len() >= 14, "{knobs:?}");
    for name in knobs {
        let world = World::read(&builtin::source(&name).unwrap(), &[]).unwrap();
        assert!(world.device.tolerances.inertia > 0.0, "{name}");
        let check = check(&world).unwrap();
        assert!(check.certified.holds(), "{name}: {}", check.headline());
    }
}
