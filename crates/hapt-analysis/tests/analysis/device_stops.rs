//! End stops of the device: what they change of a certificate, and what they do not.

use hapt_analysis::{PatternVerdict, check, passivity, uneven};
use hapt_model::{End, EstimatorKind, Handle, Method, Output, Stops, World};
use hapt_testing::prelude::*;

use crate::common::*;

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// They store and dissipate, as a passive hand does: passivity is that without them, and no verdict gets better.
    #[test]
    fn stops_ask_for_no_damping(
        bench in worlds(Dampers::Fixed, true), (low, high) in (0.0_f64..1.0, 0.0_f64..1.0), stiffness in 1.0_f64..1e3, damping in 0.0_f64..0.1,
        x in 0.01..1.0_f64, one in any::<bool>(), on_a_shaft in any::<bool>(),
    ) {
        let mut plain = bench.world(Method::Zoh, Output::End, x / fastest(&bench));
        plain.device.handle = on_a_shaft.then_some(Handle { inertia: 1e-3, stiffness: 20.0, damping: 1e-3 });
        let mut world = plain.clone();
        world.device.stops = Some(Stops { low: Some(-low).filter(|_| !one), high: Some(high), stiffness, damping });
        prop_assert_eq!(passivity(&world).unwrap(), passivity(&plain).unwrap());
        let (with, without) = (check(&world).unwrap(), check(&plain).unwrap());
        prop_assert_eq!(with.certified.holds(), without.certified.holds());
        prop_assert_eq!((&with.held, &with.free, &with.quantisation), (&without.held, &without.free, &without.quantisation));
        prop_assert_eq!(with.uneven.required_damping, without.uneven.required_damping);
        prop_assert!(with.notes.iter().any(|note| note.starts_with("device.stops: ")));
        // Eigenvalues decide between the stops, but not beyond.
        prop_assert!(with.theorems.iter().all(|theorem| theorem.id != "free-eigenvalues" && theorem.id != "free-common-form"));
        prop_assert!(!on_a_shaft || with.theorems.iter().all(|theorem| theorem.id != "held-eigenvalues"));
    }
}

/// b = 0 and B = 0.2 J/T is stable and not passive: eigenvalues prove it, but not where the puck may be in a stop.
#[test]
fn what_only_eigenvalues_tell_is_open_between_stops() {
    let bench = Bench::of(vec![damper(End::Puck, End::Ground, 0.128)]);
    let mut world: World = bench.world(Method::Zoh, Output::End, 1e-3);
    (world.device.damping, world.sampling.estimator) = (0.0, EstimatorKind::Difference);
    assert_eq!(uneven(&world).unwrap().free.verdict(), PatternVerdict::Proved);
    world.device.stops = Some(Stops { low: None, high: Some(1.0), stiffness: 10.0, damping: 0.0 });
    let found = uneven(&world).unwrap();
    assert_eq!(found.free.verdict(), PatternVerdict::Open);
    assert!(found.free.reason().unwrap().contains("end stops"));
    world.device.damping = 0.2;
    let found = check(&world).unwrap();
    assert_eq!((found.uneven.free.verdict(), found.certified.holds()), (PatternVerdict::Proved, true));
}
