//! Which worlds are proved passive, and the reasons where one is not.

use hapt_testing::laws::{goes_to_bodies, with};

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
    one(
        &|w| {
            w.sampling.estimator = EstimatorKind::Foaw;
            w.couplings.push(damper(End::Body(0), End::Puck, 0.01));
        },
        "window",
    );
    // Where nothing takes a velocity any estimator will do.
    assert!(with(&|w| w.sampling.estimator = EstimatorKind::Foaw).is_empty());
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
    assert!(
        found.len() == 2 && found[1].contains("a friction of 0 N m absorb the encoder's counts: it may hum"),
        "{found:?}"
    );
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
            w.couplings.push(damper(End::Body(0), End::Puck, 0.01));
            (w.sampling.estimator, w.sampling.cutoff) = (EstimatorKind::LowPass, Some(100.0));
        },
        "low-pass",
    );
    one(
        &|w| {
            damped(w);
            w.sampling.filter = Some(100.0);
        },
        "loop.filter",
    );
    // With a difference over several samples, no damping between puck and body together with nonlinear couplings; between puck and ground
    // the velocity is a mean of earlier displacements.
    one(
        &|w| {
            damped(w);
            w.couplings.push(damper(End::Body(0), End::Puck, 0.01));
            w.sampling.every = 3;
        },
        "over several samples",
    );
    assert!(
        with(&|w| {
            damped(w);
            w.couplings.push(damper(End::Ground, End::Puck, 0.01));
            w.sampling.every = 3;
        })
        .is_empty()
    );
    let wall = |first, damping| Coupling {
        first,
        second: End::Puck,
        law: Law::Wall { side: Side::Above, at: 0.1, stiffness: 10.0, damping },
        limit: None,
    };
    one(&|w| w.couplings.push(wall(End::Body(0), 0.1)), "wall with damping");
    assert!(with(&|w| w.couplings.push(wall(End::Body(0), 0.0))).is_empty());
    // Together with a linear world under any method: a law between puck and ground.
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
    let is_nonlinear = |law: &Law| !matches!(law, Law::Spring { .. } | Law::Damper { .. } | Law::Constant { .. });
    let laws = Law::ALL.into_iter().filter(|law| goes_to_bodies(law) && is_nonlinear(law));
    let variants = laws.flat_map(|law| {
        let limits = [None, law.takes_limit().then_some(1.0)];
        [0.0, 0.1].into_iter().flat_map(move |damping| limits.map(|limit| (with(law, "damping", damping), limit)))
    });
    for (law, limit) in variants {
        // It settles where the torque depends only on the position, and never rises with it.
        let world = plain(vec![law.between(End::Puck, End::Ground)], 1e-3);
        let torque = |i: i32, rate: f64| world.spec().coupling_torque(0, (1e-2 * f64::from(i), rate), &[]);
        let settles = (-300..300).all(|i| torque(i + 1, 0.0) <= torque(i, 0.0) && torque(i, 1e-3) == torque(i, 0.0));
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

#[test]
fn reasons_speak_of_what_the_world_has_and_in_its_units() {
    let mut world = wheel(Method::Zoh, Output::End, 0.0);
    world.bodies.clear();
    world.couplings = vec![spring(End::Puck, End::Ground, 1.4)];
    world.device.damping = 1.0;
    // Levels of 1 mN m without an encoder need half a step of friction.
    let levels = |friction: f64| {
        let mut world = world.clone();
        (world.device.limit, world.device.levels, world.device.friction) = (Some(0.5), Some(1000), friction);
        let found = reasons(&world);
        assert!(found.iter().all(|reason| !reason.contains("count")), "{found:?}");
        found
    };
    assert!(levels(6e-4).iter().all(|reason| !reason.contains("levels")));
    let few = levels(3e-4);
    assert!(few.iter().any(|reason| {
        reason.contains("levels make a torque of up to 0.0005 N m, and the device's friction of 0.0003 N m")
    }));
    // Friction at the puck is no damper.
    let exact = |law| {
        let mut world = world.clone();
        world.sampling.estimator = EstimatorKind::Exact;
        world.couplings.push(Coupling { first: End::Puck, second: End::Ground, law, limit: None });
        reasons(&world).join("; ")
    };
    assert!(exact(Law::Coulomb { torque: 0.1 }).contains("tells the friction at the puck the velocity"));
    assert!(exact(Law::Damper { damping: Damping::Fixed(0.1) }).contains("tells a damper at the puck the velocity"));
}

#[test]
fn a_tolerance_of_the_friction_counts_at_its_low_end_and_says_so() {
    let text = "loop = { period = \"1 ms\", method = \"zoh\" }\n[device]\ninertia = 1e-3\ndamping = 2e-3\nencoder = 4000\n\
        friction = \"0.0012 N m ± 20 %\"\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 1.4\n";
    let world = World::read(&hapt_model::Source::from_text("w.toml", text), &[]).unwrap();
    let check = hapt_analysis::check(&world).unwrap();
    // 2·friction/Δ, Δ = 2π/4000: 1.528 N m/rad in the middle, 1.222 at the low end.
    assert!(check.quantisation.ok && check.passivity.proved.holds() && !check.uneven.proved.holds());
    let reason = &check.uneven.not_proved[0];
    assert!(
        reason.contains("1.4 N m/rad, is above the 1.222 N m/rad") && reason.contains("friction of 0.00096 N m"),
        "{reason}"
    );
    // Intervals are even and the delay is one: nothing but the device is uncertain.
    let sentence = check.uneven_sentence().unwrap();
    assert!(sentence.starts_with("passive with every device within its tolerances (the linear loop)"), "{sentence}");
    assert!(!sentence.contains("interval"), "{sentence}");
}
