//! Friction of the device that differs by direction, changes with the position, and falls with the speed.

use hapt_analysis::{PatternVerdict, check, passivity, uneven};
use hapt_model::{
    Compensated, Compensation, Delay, End, EstimatorKind, FrictionByPosition, Handle, Law, Method, Output, Stribeck,
    Waveform, World,
};
use hapt_testing::prelude::*;

use crate::common::*;

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The excess in one direction acts as a passive hand: the certificate is that of the smaller level in both.
    #[test]
    fn the_smaller_level_counts(
        k in 0.1_f64..5.0, counts in prop::option::of(500.0_f64..2e4), levels in prop::option::of(10_u32..1000), share in 0.3_f64..3.0,
        part in 0.5_f64..1.5, [tolerance, other] in [0.0_f64..0.9, 0.0..0.9], more in 0.0_f64..2.0, back in any::<bool>(),
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

prop_compose! {
    fn any_changes()(
        most in 0.0_f64..1.0, pitch in 0.05_f64..10.0, phase in -1.0_f64..1.0,
        sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(0.1_f32..1.0),
    ) -> FrictionByPosition {
        let whole = FrictionByPosition { share: 1.0, pitch, phase, waveform: Waveform { sine, cosine } };
        FrictionByPosition { share: most / whole.most(), ..whole }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The excess at other positions acts as a passive hand: no claim is better than on the least level everywhere, and those of passivity
    /// are the same.
    #[test]
    fn the_least_level_of_all_positions_counts(
        k in 0.1_f64..5.0, counts in prop::option::of(500.0_f64..2e4), share in 0.3_f64..6.0, part in 0.5_f64..1.5, tolerance in 0.0_f64..0.9,
        backward in prop::option::of(0.5_f64..2.0), changes in any_changes(), takes in prop::option::of(0.0_f64..1.5), overspeed in prop::option::of(0.01_f64..10.0),
    ) {
        let spring = hapt_model::Coupling { law: Law::Spring { stiffness: k, rest: 0.0 }, ..damper(End::Puck, End::Ground, 1e-3) };
        let mut world = Bench::of(vec![spring, damper(End::Puck, End::Ground, 1e-3)]).world(Method::Zoh, Output::End, 1e-3);
        (world.sampling.estimator, world.safety.overspeed) = (EstimatorKind::Difference, overspeed);
        world.device.encoder = counts.map(f64::round);
        world.device.damping = part * passivity(&world).unwrap().required_damping.unwrap();
        world.device.friction = share * (0.5 * k * world.count().unwrap_or(1e-3) + 1e-2);
        world.device.friction_backward = backward.map(|part| part * world.device.friction);
        (world.device.tolerances.friction, world.device.friction_by_position) = (tolerance, Some(changes));
        let ([least, largest], [forward, back]) = (world.device.friction_range(), world.device.frictions());
        // The levels that the device has along a pitch are within the two.
        for i in 0..200 {
            let part = changes.at(0.005 * f64::from(i) * changes.pitch);
            let slack = 1e-12 * largest;
            prop_assert!(least <= part * forward * (1.0 - tolerance) + slack && part * back <= largest + slack);
            prop_assert!(world.device.least_friction() <= part * forward.min(back) + slack);
            prop_assert!(world.device.largest_friction() >= part * forward.max(back) - slack);
        }
        world.couplings.extend(takes.map(|part| Law::Coulomb { torque: part * least }.between(End::Puck, End::Ground)));
        let mut even = world.clone();
        even.device.set_friction(least);
        let (found, wanted) = (check(&world).unwrap(), check(&even).unwrap());
        prop_assert!(wanted.certified.holds() || !found.certified.holds());
        prop_assert_eq!(found.uneven.required_damping, wanted.uneven.required_damping);
        prop_assert_eq!(found.uneven.speed_max, wanted.uneven.speed_max);
        prop_assert_eq!(&found.uneven.passive, &wanted.uneven.passive);
        if tolerance == 0.0 {
            prop_assert_eq!((found.passivity, found.quantisation), (wanted.passivity, wanted.quantisation));
        }
    }

    /// A compensation of friction takes no more than the least level gives.
    #[test]
    fn a_compensation_takes_a_share_of_the_least_level(changes in any_changes(), share in 0.01_f64..1.0, backward in 0.5_f64..2.0) {
        let mut world = Bench::of(vec![]).world(Method::Zoh, Output::End, 1e-3);
        (world.sampling.estimator, world.device.friction) = (EstimatorKind::Difference, 0.02);
        (world.device.friction_backward, world.device.friction_by_position) = (Some(0.02 * backward), Some(changes));
        let coupling = world.device.compensation(Compensation { of: Compensated::Friction, share, velocity: Some(0.1), cutoff: None }).unwrap();
        let Law::Assist { torque, .. } = coupling.law else { panic!("{coupling:?}") };
        let least = (0..2000).map(|i| changes.at(5e-4 * f64::from(i) * changes.pitch)).fold(f64::INFINITY, f64::min);
        prop_assert!(torque <= share * 0.02 * backward.min(1.0) * (least + 1e-12));
        let (of, found) = world.device.compensated_by(&coupling).unwrap();
        prop_assert!(of == Compensated::Friction && (found - share).abs() < 1e-12);
        world.couplings = vec![coupling];
        prop_assert!(check(&world).unwrap().certified.holds());
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// The additional friction at low speeds only dissipates: passivity is that without it, and no verdict gets better.
    #[test]
    fn friction_that_falls_asks_for_no_damping(
        bench in worlds(Dampers::Fixed, true), torque in 1e-4_f64..0.1, velocity in 0.01_f64..10.0, friction in 0.0_f64..0.05,
        counts in prop::option::of(500.0_f64..2e4), x in 0.01..1.0_f64, on_a_shaft in any::<bool>(),
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
        // Eigenvalues of the linear loop do not include it.
        prop_assert!(with.theorems.iter().all(|theorem| theorem.id != "free-eigenvalues" && theorem.id != "free-common-form"));
        prop_assert!(!on_a_shaft || with.theorems.iter().all(|theorem| theorem.id != "held-eigenvalues"));
    }
}

/// b = 0 and B = 0.2 J/T is stable and not passive: no theorem proves this on a device whose friction falls.
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

/// The same loop with friction that changes with the position, and the level that its note gives.
#[test]
fn what_only_eigenvalues_tell_is_open_beside_friction_that_changes() {
    let bench = Bench::of(vec![damper(End::Puck, End::Ground, 0.128)]);
    let mut world: World = bench.world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.sampling.estimator) = (0.0, EstimatorKind::Difference);
    let waveform = Waveform { sine: [0.5, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
    world.device.friction_by_position = Some(FrictionByPosition { share: 0.5, pitch: 1.0, phase: 0.0, waveform });
    // Without friction nothing changes.
    assert_eq!(uneven(&world).unwrap().free.verdict(), PatternVerdict::Proved);
    world.device.friction = 0.02;
    let found = uneven(&world).unwrap();
    assert_eq!(found.free.verdict(), PatternVerdict::Open);
    assert!(found.free.reason().unwrap().contains("changes with the position"));
    world.device.damping = 0.2;
    let found = check(&world).unwrap();
    assert_eq!((found.uneven.free.verdict(), found.certified.holds()), (PatternVerdict::Proved, true));
    let note = found.notes.into_iter().find(|note| note.starts_with("device.friction_by_position: ")).unwrap();
    assert!(note.contains("with 0.015 N m as what it takes at least"), "{note}");
}
