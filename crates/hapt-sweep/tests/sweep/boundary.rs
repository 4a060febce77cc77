//! Edges against closed forms, and against verdicts on worlds that are read anew.

use std::f64::consts::TAU;

use hapt_analysis::{Verdict, check, free_growth, held_growth, required_damping};
use hapt_model::{Source, World};
use hapt_sweep::Error;
use hapt_sweep::boundary::{Boundary, Claim, Edge, EdgeMethod};
use hapt_testing::prelude::*;

/// T, b and J of the wall below.
const PERIOD: f64 = 1e-3;
const DAMPING: f64 = 1.2e-3;
const INERTIA: f64 = 6.4e-4;

const WALL: &str = r#"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
[[couplings]]
kind = "wall"
between = ["puck", "ground"]
side = "above"
at = 0
stiffness = "1 N m/rad"
damping = "1e-4 N m s/rad"
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = 0
pitch = "20 deg"
"#;

const WHEEL: &str = r#"
[loop]
period = "1 ms"
method = "forward-euler"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1 N m/rad"
[[couplings]]
kind = "damper"
between = ["wheel", "ground"]
damping = "1e-3 N m s/rad"
"#;

fn boundary(file: &str, sets: &[&str], axes: &[&str], claims: &[Edge]) -> Result<Boundary, Error> {
    let strings = |all: &[&str]| all.iter().map(ToString::to_string).collect::<Vec<_>>();
    Boundary::new(&Source::from_text("w.toml", file), &strings(sets), &strings(axes), claims)
}

/// The requested claim, without failed or lost points.
fn claim(file: &str, sets: &[&str], axes: [&str; 2], edge: Edge) -> Claim {
    let mut boundary = boundary(file, sets, &axes, &[edge]).unwrap();
    let claim = boundary.claims.remove(0);
    assert!(claim.pieces.iter().all(|piece| piece.failed == 0), "{claim:?}");
    claim
}

/// Asserts that every point of the edge satisfies its closed form within `most`, relatively, and that there is one piece, of at least `least`
/// points.
fn is(claim: &Claim, method: EdgeMethod, least: usize, most: f64, left: impl Fn([f64; 2]) -> f64) {
    let [piece] = &claim.pieces[..] else { panic!("{} pieces", claim.pieces.len()) };
    assert_eq!(piece.method, method);
    assert!(piece.points.len() >= least, "{} points", piece.points.len());
    for point in &piece.points {
        let left = left(point.values);
        assert!(left.abs() < most, "{left} at {:?}", point.values);
    }
}

/// Colgate and Schenkel's wall: b = KT/2 + B for a differenced damper, b = KT/2 + BT/(T + 2τ) behind a low-pass.
#[test]
fn the_edge_of_passivity_of_a_wall_is_a_line() {
    let axes = ["couplings.0.stiffness=0..5", "couplings.0.damping=0..0.05"];
    let of = |sets: &[&str]| claim(WALL, sets, axes, Edge::Passive);
    is(&of(&[]), EdgeMethod::Continuation, 5, 1e-9, |[k, b]| (0.5 * k * PERIOD + b) / DAMPING - 1.0);
    let low_pass = of(&["loop.estimator=low-pass", "loop.cutoff=40Hz"]);
    let share = PERIOD / (PERIOD + 2.0 / (TAU * 40.0));
    is(&low_pass, EdgeMethod::Continuation, 5, 1e-9, |[k, b]| (0.5 * k * PERIOD + share * b) / DAMPING - 1.0);
    // A damper requires most damping at half of the sampling rate.
    assert!(low_pass.pieces[0].points.iter().all(|p| p.hz.is_none_or(|hz| (hz - 500.0).abs() < 1e-6)));
}

/// K(1/2 + d) T = b for whole samples d, and between them b = (KT/4)(q + √(q² + 4a(1 - a))), q = 1 + 2(d + a).
#[test]
fn the_edge_of_delay_against_stiffness_is_its_closed_form() {
    let axes = ["loop.delay=0..4ms", "couplings.0.stiffness=0..5"];
    let found = claim(WALL, &["couplings.0.damping=0"], axes, Edge::Passive);
    is(&found, EdgeMethod::Continuation, 40, 1e-9, |[delay, k]| {
        let a = (delay / PERIOD).fract();
        let q = 1.0 + 2.0 * delay / PERIOD;
        0.25 * k * PERIOD * (q + (q * q + 4.0 * a * (1.0 - a)).sqrt()) / DAMPING - 1.0
    });
}

/// The curve of the equation, and the same curve by continuation where a detent's pitch, in which the equation is not linear, gives the stiffness
/// K = 2π torque/pitch: Hulin's α = 2β(2 - β)/(2 + β), without damping of the device.
#[test]
fn continuation_and_equation_are_one_curve() {
    let left = |k: f64, b: f64| {
        let (alpha, beta) = (k * PERIOD.powi(2) / INERTIA, b * PERIOD / INERTIA);
        alpha - 2.0 * beta * (2.0 - beta) / (2.0 + beta)
    };
    let file = r#"
        [loop]
        period = "1 ms"
        estimator = "difference"
        [device]
        inertia = "6.4e-4 kg m^2"
        [[couplings]]
        kind = "spring"
        between = ["puck", "ground"]
        stiffness = 0
        [[couplings]]
        kind = "damper"
        between = ["puck", "ground"]
        damping = 1
        [[couplings]]
        kind = "detent"
        between = ["puck", "ground"]
        torque = 0
        pitch = 1
    "#;
    // Short of β = 2, where a loop without a spring leaves the circle as well.
    let damping = "couplings.1.damping=0.02..1.2";
    let by_equation = claim(file, &[], ["couplings.0.stiffness=10..1000", damping], Edge::Free);
    is(&by_equation, EdgeMethod::Equation, 100, 1e-9, |[k, b]| left(k, b));
    let followed = claim(file, &["couplings.2.torque=10"], ["couplings.2.pitch=0.06..6:log", damping], Edge::Free);
    is(&followed, EdgeMethod::Continuation, 50, 1e-7, |[pitch, b]| left(TAU * 10.0 / pitch, b));
}

/// The notes' (2.14) and the branch that it omits: forward Euler is stable for T ≤ 2ζ/ω, and from ζ = 1 on for Tω ≤ 2(ζ - √(ζ² - 1)).
#[test]
fn forward_euler_against_damping_has_a_corner_at_critical_damping() {
    let (k, j) = (1.0, 0.0258f64);
    let omega = (k / j).sqrt();
    let axes = ["couplings.1.damping=1e-3..2:log", "loop.period=1ms..1s:log"];
    let found = claim(WHEEL, &[], axes, Edge::Held);
    // A growth of 1e-9 per second counts as none: 2e-9/(ω²T) of T at light damping.
    is(&found, EdgeMethod::Continuation, 60, 1e-7, |[damping, period]| {
        let zeta = damping / (2.0 * j * omega);
        let limit = if zeta < 1.0 { 2.0 * zeta } else { 2.0 * (zeta - (zeta * zeta - 1.0).sqrt()) };
        period * omega / limit - 1.0
    });
    // Both branches, and the corner between them, T = 2/ω.
    let points = &found.pieces[0].points;
    let corner = points.iter().map(|p| p.values[1] * omega).fold(0.0, f64::max);
    assert!((corner / 2.0 - 1.0).abs() < 1e-3, "{corner}");
    assert!(points.iter().any(|p| p.values[0] > 1.0) && points.iter().any(|p| p.values[0] < 0.01));
    // The same loop in the plane of stiffness and damping: C = KT by its equation, and 4J - 2CT + KT² = 0.
    let axes = ["couplings.0.stiffness=0..100", "couplings.1.damping=0..3"];
    let found = claim(WHEEL, &["loop.period=50ms"], axes, Edge::Held);
    let t = 0.05;
    let crossings = |[k, c]: [f64; 2]| [c / (k * t) - 1.0, (2.0 * c * t - k * t * t) / (4.0 * j) - 1.0];
    is(&found, EdgeMethod::Equation, 50, 1e-9, |values| {
        crossings(values).map(f64::abs).into_iter().fold(1.0, f64::min)
    });
}

/// Where nothing depends on the keys, or no value makes a difference, there is no edge, and all is on one side.
#[test]
fn a_plane_without_an_edge_has_the_verdict_of_all_its_points() {
    let axes = ["couplings.0.stiffness=0.1..0.2", "device.damping=0.01..0.02"];
    for (sets, unstable) in [(&["loop.method=trapezoidal"][..], false), (&["couplings.1.damping=0"], true)] {
        let found = claim(WHEEL, sets, axes, Edge::Held);
        assert_eq!((found.everywhere, found.pieces.len()), (Some(unstable), 0));
        assert_eq!(found.beyond.len(), usize::from(unstable));
    }
}

#[test]
fn invalid_planes_are_refused_with_a_reason() {
    let message = |axes: &[&str]| boundary(WALL, &[], axes, &Edge::ALL).unwrap_err().to_string();
    let stiffness = "couplings.0.stiffness=0..1";
    for (axes, part) in [
        (&[stiffness][..], "2 keys, and 1 are given"),
        (&[stiffness, "loop.delay=0..1ms", "device.damping=0..1"], "3 are given"),
        (&[stiffness, "loop.delay=0..1ms:40"], "expected KEY=FROM..TO"),
        (&[stiffness, "loop.method=zoh..foh"], "zoh..foh"),
        (&[stiffness, "loop.delay=0..1ms:log"], "one side of 0"),
        (&[stiffness, "loop.delay=1ms..1ms"], "both ends are the same"),
        (&[stiffness, "loop.window=1..9"], "whole numbers"),
        (&[stiffness, "loop.period=0..1ms"], "above 0"),
        (&[stiffness, "loop.delay=0..10s"], "in flight"),
    ] {
        let message = message(axes);
        assert!(message.contains(part), "{message}");
    }
}

/// Whether a world, read from its file, is beyond an edge.
fn beyond(world: &World, edge: Edge) -> bool {
    let sampling = &world.sampling;
    match edge {
        Edge::Held => {
            let growth = held_growth(&world.bodies, &world.couplings, sampling.method, sampling.period).unwrap();
            Verdict::of(growth) == Verdict::Unstable
        }
        Edge::Free => Verdict::of(free_growth(world).unwrap()) == Verdict::Unstable,
        Edge::Certified => !check(world).unwrap().certified.holds(),
        Edge::Passive | Edge::Fixed => required_damping(world).unwrap().is_none_or(|b| b > world.device.damping),
    }
}

/// Even-odd.
fn is_in(polygons: &[Vec<[f64; 2]>], [x, y]: [f64; 2]) -> bool {
    let sides = polygons.iter().flat_map(|p| (0..p.len()).map(move |i| (p[i], p[(i + 1) % p.len()])));
    let crossed = |(a, b): &([f64; 2], [f64; 2])| {
        (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    };
    sides.filter(crossed).count() % 2 == 1
}

const KEYS: [&str; 8] = [
    "couplings.0.stiffness=0.1..30:log",
    "couplings.1.damping=1e-4..0.1:log",
    "couplings.2.stiffness=0..10",
    "couplings.2.damping=0..0.02",
    "device.damping=1e-4..0.02",
    "device.inertia=1e-4..1e-2:log",
    "loop.period=0.1ms..20ms:log",
    "bodies.wheel.inertia=1e-3..0.1:log",
];

/// A wheel on the puck, and a wall.
fn random_world() -> impl Strategy<Value = String> {
    let methods = prop::sample::select(vec!["forward-euler", "semi-implicit-euler", "zoh", "trapezoidal", "rk4"]);
    let outputs = prop::sample::select(vec!["end", "middle"]);
    let estimators = prop::sample::select(vec!["difference", "low-pass", "exact"]);
    let delays = prop::sample::select(vec!["0 ms", "0.7 ms", "2 ms"]);
    (methods, outputs, estimators, delays, -3.0..-1.0f64).prop_map(|(method, output, estimator, delay, inertia)| {
        let inertia = 10f64.powf(inertia);
        format!(
            r#"
            [loop]
            period = "2 ms"
            method = "{method}"
            output = "{output}"
            estimator = "{estimator}"
            cutoff = "60 Hz"
            delay = "{delay}"
            [device]
            inertia = "6.4e-4 kg m^2"
            damping = "2e-3 N m s/rad"
            [bodies.wheel]
            inertia = {inertia:?}
            [[couplings]]
            kind = "spring"
            between = ["puck", "wheel"]
            stiffness = "0.5 N m/rad"
            [[couplings]]
            kind = "damper"
            between = ["wheel", "ground"]
            damping = "5e-3 N m s/rad"
            [[couplings]]
            kind = "wall"
            between = ["puck", "ground"]
            side = "above"
            at = 0
            stiffness = "0.2 N m/rad"
            damping = "1e-4 N m s/rad"
            "#
        )
    })
}

/// A millionth of the frame to either side of the points of every edge the verdicts differ, every edge ends at the frame, at its start, or is
/// reported as lost, and at the points `places` the region has the right verdict.
fn is_true(found: &Boundary, file: &str, places: &[(f64, f64)]) -> Result<(), TestCaseError> {
    let source = Source::from_text("w.toml", file);
    let [x, y] = &found.plane.axes;
    let at = |place: [f64; 2]| {
        let [a, b] = found.plane.values(place);
        World::read(&source, &[format!("{}={a:?}", x.key), format!("{}={b:?}", y.key)]).unwrap()
    };
    for claim in &found.claims {
        let what = format!("{:?} over {} and {}", claim.edge, x.key, y.key);
        for piece in &claim.pieces {
            prop_assert_eq!(piece.failed, 0, "{}", what);
            let on_frame = |p: [f64; 2]| p.iter().any(|x| *x < 1e-5 || *x > 1.0 - 1e-5);
            let ends = [piece.points.first(), piece.points.last()].map(|p| p.unwrap().place);
            prop_assert!(
                piece.closed || ends.iter().all(|p| on_frame(*p)) || !claim.lost.is_empty(),
                "{}: {:?}",
                what,
                ends
            );
            for point in piece.points.iter().step_by(7) {
                let offset = |sign: f64| {
                    [0, 1].map(|i| (point.place[i] + sign * 1e-6 * point.beyond[i]).clamp(1e-6, 1.0 - 1e-6))
                };
                let sides = [1.0, -1.0].map(|sign| beyond(&at(offset(sign)), claim.edge));
                prop_assert_eq!(sides, [true, false], "{}: {:?}", what, point);
            }
        }
        for &(x, y) in places.iter().filter(|_| claim.lost.is_empty()) {
            let near = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y) < 0.01;
            if claim.pieces.iter().any(|piece| piece.points.iter().any(|p| near(&p.place))) {
                continue;
            }
            prop_assert_eq!(is_in(&claim.beyond, [x, y]), beyond(&at([x, y]), claim.edge), "{}: {:?}", what, (x, y));
        }
    }
    Ok(())
}

fn places() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((1e-3..0.999f64, 1e-3..0.999f64), 40)
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(11, 12))]

    #[test]
    fn every_edge_separates_two_verdicts_and_every_region_has_its_verdict(
        pair in (0..8usize, 0..7usize),
        file in random_world(),
        places in places(),
    ) {
        let axes = [KEYS[pair.0], KEYS[(pair.0 + 1 + pair.1) % 8]];
        is_true(&boundary(&file, &[], &axes, &[]).unwrap(), &file, &places)?;
    }

    /// The same for edges by their equation, at every scale of the keys.
    #[test]
    fn every_edge_by_its_equation_separates_two_verdicts(
        file in random_world(),
        stiffness in 0.0..3.0f64,
        damping in -3.0..0.5f64,
        log in any::<bool>(),
        places in places(),
    ) {
        let (k, b, from, end) = (10f64.powf(stiffness), 10f64.powf(damping), 1e-3, if log { ":log" } else { "" });
        let from = if log { from } else { 0.0 };
        let axes = [
            format!("couplings.2.damping={:?}..{b:?}{end}", from * b),
            format!("couplings.2.stiffness={:?}..{k:?}{end}", from * k),
        ];
        let found = boundary(&file, &[], &axes.each_ref().map(String::as_str), &[Edge::Free]).unwrap();
        prop_assert!(found.claims[0].pieces.iter().all(|piece| piece.method == EdgeMethod::Equation), "{:?}", axes);
        is_true(&found, &file, &places)?;
    }
}

/// A magnet at a body behind a delay: no theorem covers it, for any edges of its eigenvalues and its port.
#[test]
fn what_no_theorem_covers_is_beyond_the_edge_of_the_certificate() {
    let magnet = WHEEL
        .replace("method = \"forward-euler\"", "delay = \"0.4 ms\"")
        .replace("kind = \"spring\"", "kind = \"magnet\"\nat = 0\nwidth = \"0.1 rad\"")
        .replace("stiffness = \"1 N m/rad\"", "torque = \"0.01 N m\"");
    let axes = ["loop.period=0.1ms..2ms:log", "device.damping=0.001..1:log"];
    assert_eq!(claim(&magnet, &[], axes, Edge::Certified).everywhere, Some(true));
}

/// A spring is certified up to b = K T/2; with uneven samples up to their longest interval, and with the least damping of a tolerance.
#[test]
fn the_edge_of_the_certificate_is_that_of_the_times_and_tolerances_of_the_file() {
    let file =
        WALL.replace("estimator = \"difference\"", "").replace("[device]", "interval_max = \"1.6 ms\"\n[device]");
    let file =
        file.replace("\ndamping = \"1e-4 N m s/rad\"", "").replace("1.2e-3 N m s/rad", "1.2e-3 N m s/rad ± 20 %");
    let axes = ["couplings.0.stiffness=0.1..4", "device.damping=1e-4..4e-3"];
    let points = |edge: Edge| {
        let found = claim(&file, &[], axes, edge);
        found.pieces.iter().flat_map(|piece| piece.points.clone()).map(|point| point.values).collect::<Vec<_>>()
    };
    let (certified, passive) = (points(Edge::Certified), points(Edge::Passive));
    assert!(certified.len() > 20 && passive.len() > 20);
    for [stiffness, damping] in passive {
        assert!((damping / (stiffness * PERIOD / 2.0) - 1.0).abs() < 1e-6, "{stiffness} {damping}");
    }
    for [stiffness, damping] in certified {
        assert!((0.8 * damping / (stiffness * 1.6e-3 / 2.0) - 1.0).abs() < 1e-2, "{stiffness} {damping}");
    }
}
