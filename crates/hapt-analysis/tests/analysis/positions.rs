//! A refutation is shown at one position of the puck: walls that are never touched at once refute nothing together.

use hapt_analysis::{Status, check, free};
use hapt_core::Waveform;
use hapt_model::{Coupling, Delay, End, Law, Method, Output, Side, Source, World};
use hapt_testing::prelude::*;

use crate::common::*;

const PERIOD: f64 = 1e-3;

/// A wall, dead band or spring between puck and ground, with the ends in either order.
fn law() -> impl Strategy<Value = Coupling> {
    let side = prop_oneof![Just(Side::Above), Just(Side::Below)];
    // Places in steps, so that faces meet.
    let at = || (-3..=3i32).prop_map(|at| 0.1 * f64::from(at));
    let stiffness = || 0.2..8.0f64;
    let damping = prop_oneof![Just(0.0), 0.0..2e-3f64];
    let law = prop_oneof![
        3 => (side, at(), stiffness(), damping).prop_map(|(side, at, stiffness, damping)| Law::Wall { side, at, stiffness, damping }),
        1 => (at(), 0..3i32, stiffness()).prop_map(|(rest, width, stiffness)| Law::DeadBand { rest, width: 0.1 * f64::from(width), stiffness }),
        1 => stiffness().prop_map(|stiffness| Law::Spring { stiffness, rest: 0.05 }),
    ];
    (law, any::<bool>()).prop_map(|(law, turned)| {
        let (first, second) = if turned { (End::Ground, End::Puck) } else { (End::Puck, End::Ground) };
        law.between(first, second)
    })
}

/// The stiffness and damping of a coupling at z, by its definition.
fn slopes(coupling: &Coupling, z: f64) -> [f64; 2] {
    let q = if coupling.first == End::Puck { z } else { -z };
    match coupling.law {
        Law::Wall { side: Side::Above, at, stiffness, damping } if q > at => [stiffness, damping],
        Law::Wall { side: Side::Below, at, stiffness, damping } if q < at => [stiffness, damping],
        Law::DeadBand { rest, width, stiffness } if (q - rest).abs() > width => [stiffness, 0.0],
        Law::Spring { stiffness, .. } => [stiffness, 0.0],
        _ => [0.0; 2],
    }
}

/// KT/2 + B where it is largest.
fn required(couplings: &[Coupling]) -> f64 {
    // Next to faces, which stand at tenths.
    let near = (-80..=80i32).flat_map(|i| [-1e-9, 0.0, 1e-9].map(|to| 0.01 * f64::from(i) + to));
    let at = |z: f64| couplings.iter().map(|c| slopes(c, z)).fold([0.0; 2], |[k, b], [dk, db]| [k + dk, b + db]);
    near.map(at).map(|[k, b]| 0.5 * k * PERIOD + b).fold(0.0, f64::max)
}

fn world(couplings: Vec<Coupling>, damping: f64) -> World {
    let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, PERIOD);
    world.device.damping = damping;
    world
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// Springs and dampers at the puck need KT/2 + B, and a nonlinear loop is refuted where its linear one is at some position.
    #[test]
    fn a_loop_is_refuted_where_a_position_lacks_damping(
        couplings in prop::collection::vec(law(), 1..5), share in 0.5..1.5f64,
    ) {
        let needs = required(&couplings);
        let damping = needs * share;
        let found = check(&world(couplings.clone(), damping)).unwrap();
        let expected = (share < 1.0 - 1e-6).then_some(Status::Refuted);
        prop_assert!(found.status == Status::Refuted || expected.is_none(), "{found:?}");
        prop_assert!(found.status != Status::Refuted || share < 1.0 + 1e-6, "{found:?}");
    }
}

fn wall(side: Side, at: f64, stiffness: f64) -> Coupling {
    Law::Wall { side, at, stiffness, damping: 0.0 }.between(End::Puck, End::Ground)
}

/// Two walls that face each other need what one of them needs; whether a sum is enough is another matter.
#[test]
fn walls_that_face_each_other_refute_one_by_one() {
    let walls = |at: f64| vec![wall(Side::Above, at, 5.0), wall(Side::Below, -at, 5.0)];
    let status = |at: f64, damping: f64| check(&world(walls(at), damping)).unwrap().status;
    assert_eq!(
        [2.4e-3, 2.6e-3, 4.9e-3, 5.1e-3].map(|b| status(0.1, b)),
        [Status::Refuted, Status::Open, Status::Open, Status::Certified]
    );
    // Between these both push.
    assert_eq!([4.9e-3, 5.1e-3].map(|b| status(-0.1, b)), [Status::Refuted, Status::Certified]);
}

/// A magnet has its steepest slope at its place.
#[test]
fn magnets_at_two_places_refute_one_by_one() {
    let status = |at: f64, damping: f64| {
        let magnet = |at: f64| {
            format!(
                "[[couplings]]\nkind = \"magnet\"\nbetween = [\"puck\", \"ground\"]\ntorque = 0.06\nwidth = 0.02\nat = {at}\n"
            )
        };
        let text = format!(
            "loop = {{ period = 1e-3, estimator = \"difference\" }}\ndevice = {{ inertia = 6.4e-4, damping = {damping} }}\n{}{}",
            magnet(at),
            magnet(-at)
        );
        check(&World::read(&Source::from_text("magnets.toml", text), &[]).unwrap()).unwrap().status
    };
    // Each needs √e 0.06/0.02 T/2.
    let one = 0.5e-3 * 1f64.exp().sqrt() * 3.0;
    let shares = [0.99, 1.01, 1.99, 2.01];
    let expected = [Status::Refuted, Status::Open, Status::Open, Status::Certified];
    assert_eq!(shares.map(|share| status(0.2, share * one)), expected);
    assert_eq!(
        shares.map(|share| status(0.0, share * one))[1..],
        [Status::Refuted, Status::Refuted, Status::Certified]
    );
}

/// Eigenvalues of slopes that no position has say nothing: with a delay, the loop of both walls grows and that of each does not.
#[test]
fn a_sum_that_grows_refutes_nothing() {
    let of = |at: f64| {
        let mut world = world(vec![wall(Side::Above, at, 5.0), wall(Side::Below, -at, 5.0)], 6e-3);
        world.sampling.delay = Delay::Seconds(0.6e-3);
        world
    };
    for (at, expected) in [(0.1, Status::Open), (-0.1, Status::Refuted)] {
        assert!(free(&of(at)).unwrap().growth_per_s.unwrap() > 0.0);
        let found = check(&of(at)).unwrap();
        assert_eq!(found.status, expected, "{}", found.headline());
    }
}

/// A texture that falls more steeply than it rises needs what its rise needs.
#[test]
fn a_falling_slope_refutes_nothing() {
    // The torque 0.1 N m (sin θ - sin 2θ/4) rises by 1.25 at θ = π and falls by 0.75 at 0, times 2π 0.1/pitch: against the motion the other way.
    let of = |second: f32, damping: f64| {
        let waveform = Waveform { sine: [1.0, second, 0.0, 0.0], cosine: [0.0; 4] };
        let law = Law::Texture { torque: 0.1, pitch: 0.2, phase: 0.0, waveform };
        check(&world(vec![law.between(End::Puck, End::Ground)], damping)).unwrap()
    };
    let slope = std::f64::consts::TAU * 0.1 / 0.2;
    for second in [-0.25f32, 0.25, 0.4] {
        let x = f64::from(second);
        // -w' = -cos θ - 2x cos 2θ, with c = cos θ: -c - 4x c² + 2x.
        let c = (-1.0 / (8.0 * x)).clamp(-1.0, 1.0);
        let rise = [c, -1.0, 1.0].map(|c| -c - 4.0 * x * c * c + 2.0 * x).into_iter().fold(0.0, f64::max) * slope;
        let [less, more] = [0.999, 1.001].map(|share| of(second, 0.5 * share * rise * PERIOD).status);
        assert!(less == Status::Refuted && more != Status::Refuted, "{second} {less:?} {more:?}");
    }
}
