//! Which worlds are proved passive, and the reasons where one is not.

use super::*;

#[test]
fn what_is_not_proved_says_why() {
    let detent = |first| Coupling {
        first,
        second: End::Puck,
        law: Law::Detent { torque: 0.02, pitch: 0.1, phase: 0.0 },
        limit: None,
    };
    let mut world = wheel(Method::Zoh, Output::End, 0.3);
    assert_eq!(reasons(&world), Vec::<String>::new());
    world.device.damping = 1.0;
    let with = |change: &dyn Fn(&mut World)| {
        let mut world = world.clone();
        change(&mut world);
        reasons(&world)
    };
    let one = |change: &dyn Fn(&mut World), word: &str| {
        let found = with(change);
        assert!(found.len() == 1 && found[0].contains(word), "{word}: {found:?}");
    };
    one(&|w| (w.device.limit, w.device.levels) = (Some(1.0), None), "limit");
    one(&|w| w.sampling.estimator = EstimatorKind::Foaw, "window");
    let counted = |w: &mut World| (w.device.encoder, w.device.damping, w.device.friction) = (Some(4e3), 1.0, 1.0);
    one(&|w| counted(w), "counts push at a body");
    // A damped body takes some of it, and that is no proof.
    one(
        &|w| {
            counted(w);
            w.couplings.push(damper(End::Body(0), End::Ground, 0.01));
        },
        "counts push at a body",
    );
    let found = with(&|w| {
        counted(w);
        w.device.friction = 0.0;
    });
    assert!(found.len() == 2 && found[1].contains("max_stiffness"), "{found:?}");
    let constant = |first| Coupling { first, second: End::Ground, law: Law::Constant { torque: 0.1 }, limit: None };
    one(&|w| w.couplings.push(constant(End::Body(0))), "constant torque at a body");
    one(
        &|w| {
            w.sampling.estimator = EstimatorKind::Exact;
            w.couplings.push(damper(End::Body(0), End::Puck, 0.01));
        },
        "exact",
    );
    // The energy theorem covers a detent at a body, at the end of a step that keeps energy, on time.
    assert!(with(&|w| w.couplings.push(detent(End::Body(0)))).is_empty());
    let damped = |w: &mut World| w.couplings.extend([detent(End::Body(0)), damper(End::Body(0), End::Ground, 0.01)]);
    one(
        &|w| {
            damped(w);
            w.sampling.output = Output::Start;
        },
        "end of the step",
    );
    one(
        &|w| {
            damped(w);
            w.sampling.method = Method::SemiImplicitEuler;
        },
        "discrete-gradient",
    );
    one(
        &|w| {
            damped(w);
            w.sampling.advance = 1;
        },
        "later step",
    );
    one(
        &|w| {
            damped(w);
            w.sampling.delay = hapt_model::Delay::Seconds(1e-3);
        },
        "late",
    );
    one(
        &|w| {
            damped(w);
            (w.sampling.estimator, w.sampling.cutoff) = (EstimatorKind::LowPass, Some(100.0));
        },
        "low-pass",
    );
    let wall = |first, damping| Coupling {
        first,
        second: End::Puck,
        law: Law::Wall { side: Side::Above, at: 0.1, stiffness: 10.0, damping },
        limit: None,
    };
    one(&|w| w.couplings.push(wall(End::Body(0), 0.1)), "wall with damping");
    assert!(with(&|w| w.couplings.push(wall(End::Body(0), 0.0))).is_empty());
    // A damped world may ask for less than the theorem does: then only the theorem's number is proved.
    one(
        &|w| {
            damped(w);
            w.device.damping = 0.0;
        },
        "begins at",
    );
    // Beside a linear world under any method: a law between puck and ground.
    assert!(
        with(&|w| {
            w.couplings.push(wall(End::Ground, 0.0));
            w.sampling.method = Method::BackwardEuler;
            w.sampling.output = Output::Start;
        })
        .is_empty()
    );
}

/// Where the step does not settle the two ends of the damper feel different torques: a hand then drew from single samples.
#[test]
fn a_damper_with_a_limit_is_not_proved_beside_what_may_not_settle() {
    let limited = |first| Coupling {
        first,
        second: End::Puck,
        law: Law::Damper { damping: Damping::Fixed(0.01) },
        limit: Some(0.1),
    };
    let to_body = |law, limit| Coupling { first: End::Body(0), second: End::Ground, law, limit };
    let detent = Law::Detent { torque: 0.02, pitch: 0.1, phase: 0.0 };
    let wall = |damping| Law::Wall { side: Side::Above, at: 0.1, stiffness: 1.0, damping };
    for (law, limit, settles) in [
        (wall(0.0), None, true),
        (detent, None, false),
        (Law::DeadBand { stiffness: 1.0, rest: 0.0, width: 0.1 }, None, true),
        (Law::Magnet { torque: 0.02, width: 0.1, at: 0.0 }, None, false),
        (Law::Texture { torque: 0.02, pitch: 0.3, phase: 0.0, waveform: THIRD }, None, false),
        (wall(0.1), None, false),
        (wall(0.1), Some(1.0), false),
        (Law::Coulomb { torque: 0.1 }, None, false),
    ] {
        let mut world = wheel(Method::Zoh, Output::End, 0.3);
        world.device.damping = 1.0;
        world.sampling.estimator = EstimatorKind::Difference;
        world.couplings.push(to_body(law, limit));
        assert_eq!(reasons(&world), Vec::<String>::new(), "{law:?}");
        world.couplings.push(limited(End::Body(0)));
        assert_eq!(reasons(&world).is_empty(), settles, "{law:?} {:?}", reasons(&world));
    }
}

#[test]
fn nothing_that_follows_the_position_alone_minds_the_exact_estimator() {
    let mut world = plain(to_ground(10.0, 0.0), 1e-3);
    world.couplings.truncate(1);
    world.sampling.estimator = EstimatorKind::Exact;
    assert_eq!(reasons(&world), Vec::<String>::new());
    let mut world = plain(to_ground(10.0, 0.01), 1e-3);
    world.sampling.estimator = EstimatorKind::Exact;
    assert!(reasons(&world)[0].contains("exact"));
    world.sampling.estimator = EstimatorKind::Difference;
    assert_eq!(reasons(&world), Vec::<String>::new());
}
