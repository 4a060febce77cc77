//! Friction of the device that differs by direction, and that falls with the speed.

use hapt_analysis::{PatternVerdict, check, passivity, uneven};
use hapt_model::{Delay, End, EstimatorKind, Handle, Law, Method, Output, Stribeck, World};
use proptest::prelude::*;

use crate::common::*;

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// What one direction has more is a passive hand's: the certificate is that of the smaller level in both.
    #[test]
    fn the_smaller_level_counts(
        k in 0.1_f64..5.0, counts in prop::option::of(500.0_f64..2e4), levels in prop::option::of(10_u32..1000), share in 0.3_f64..3.0,
        part in 0.5_f64..1.5, [tolerance, other] in [0.0_f64..0.9, 0.0..0.9], more in 0.0_f64..2.0, back: bool,
    ) {
        let spring = hapt_model::Coupling { law: Law::Spring { stiffness: k, rest: 0.0 }, ..damper(End::Puck, End::Ground, 1e-3) };
        let mut world = Bench::of(vec![spring, damper(End::Puck, End::Ground, 1e-3)]).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.estimator = EstimatorKind::Difference;
        world.sampling.delay = Delay::Samples(1.0);
        (world.device.limit, world.device.levels) = (levels.map(|_| 10.0), levels.map(|half| 2 * half));
        world.device.encoder = counts.map(f64::round);
        world.device.damping = part * passivity(&world).unwrap().required_damping.unwrap();
        let wanted = 0.5 * k * world.count().unwrap_or(1e-3) + 1e-2;
        let own = share * wanted / (1.0 - tolerance);
        // Never less than the least of the other.
        let higher = (1.0 + more) * own / (1.0 - other);
        let mut even = world.clone();
        (even.device.friction, even.device.tolerances.friction) = (own, tolerance);
        let device = &mut world.device;
        if back {
            (device.friction, device.tolerances.friction) = (higher, other);
            (device.friction_backward, device.tolerances.friction_backward) = (Some(own), tolerance);
        } else {
            (device.friction, device.tolerances.friction) = (own, tolerance);
            (device.friction_backward, device.tolerances.friction_backward) = (Some(higher), other);
        }
        let (found, wanted) = (check(&world).unwrap(), check(&even).unwrap());
        prop_assert_eq!(found.uneven, wanted.uneven);
        prop_assert_eq!(found.certified.holds(), wanted.certified.holds());
        if higher >= own {
            prop_assert_eq!((found.passivity, found.quantisation), (wanted.passivity, wanted.quantisation));
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// What friction is more at low speeds only takes: passivity is that without it, and no verdict gets better.
    #[test]
    fn friction_that_falls_asks_for_no_damping(
        bench in worlds(Dampers::Fixed, true), torque in 1e-4_f64..0.1, velocity in 0.01_f64..10.0, friction in 0.0_f64..0.05,
        counts in prop::option::of(500.0_f64..2e4), x in 0.01..1.0_f64, on_a_shaft: bool,
    ) {
        let mut plain = bench.world(Method::Zoh, Output::End, x / fastest(&bench));
        (plain.device.friction, plain.device.encoder) = (friction, counts.map(f64::round));
        plain.device.handle = on_a_shaft.then_some(Handle { inertia: 1e-3, stiffness: 20.0, damping: 1e-3 });
        let mut world = plain.clone();
        world.device.stribeck = Some(Stribeck { torque, velocity });
        prop_assert_eq!(passivity(&world).unwrap(), passivity(&plain).unwrap());
        let (with, without) = (check(&world).unwrap(), check(&plain).unwrap());
        prop_assert_eq!(with.certified.holds(), without.certified.holds());
        prop_assert_eq!((&with.held, &with.free, &with.quantisation), (&without.held, &without.free, &without.quantisation));
        prop_assert_eq!(with.uneven.required_damping, without.uneven.required_damping);
        // Eigenvalues of the linear loop tell nothing of it.
        prop_assert!(with.theorems.iter().all(|theorem| theorem.id != "free-eigenvalues" && theorem.id != "free-common-form"));
        prop_assert!(!on_a_shaft || with.theorems.iter().all(|theorem| theorem.id != "held-eigenvalues"));
    }
}

/// b = 0 and B = 0.2 J/T is stable and not passive: of a device whose friction falls no theorem tells so.
#[test]
fn what_only_eigenvalues_tell_is_open_beside_friction_that_falls() {
    let bench = Bench::of(vec![damper(End::Puck, End::Ground, 0.128)]);
    let mut world: World = bench.world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.sampling.estimator) = (0.0, EstimatorKind::Difference);
    assert_eq!(uneven(&world).unwrap().free.verdict(), PatternVerdict::Proved);
    world.device.stribeck = Some(Stribeck { torque: 0.01, velocity: 1.0 });
    let found = uneven(&world).unwrap();
    assert_eq!(found.free.verdict(), PatternVerdict::Open);
    assert!(found.free.reason().unwrap().contains("falls with the speed"));
    let note = |world: &World| {
        let notes = check(world).unwrap().notes;
        notes.into_iter().find(|note| note.starts_with("device.stribeck: ")).unwrap()
    };
    assert!(note(&world).contains("more than its damping"));
    world.device.damping = 0.2;
    let found = check(&world).unwrap();
    assert_eq!((found.uneven.free.verdict(), found.certified.holds()), (PatternVerdict::Proved, true));
    assert!(note(&world).contains("less than its damping"));
}
