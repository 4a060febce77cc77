//! Bodies that step at every n-th sample: the loop of n periods for the bodies, the newest puck for the torque.

use hapt_core::{Body, Coupling, Damping, End, Error, Law, Loop, Method, Output, Spec};
use hapt_testing::prelude::*;

use crate::reference::{World, world};

type Small = Loop<f64, 6, 12, 33>;

const HELD: [Method; 6] = [
    Method::ForwardEuler,
    Method::BackwardEuler,
    Method::SemiImplicitEuler,
    Method::Trapezoidal,
    Method::Zoh,
    Method::Rk4,
];

proptest! {
    #[test]
    fn the_bodies_step_as_in_a_loop_of_n_periods_and_the_torque_has_the_newest_puck(
        world in world(true), angle in 1e-3_f64..0.3, every in 2_u32..6,
        pucks in prop::collection::vec((-1.0_f64..1.0, -5.0_f64..5.0), 20),
    ) {
        let t = angle / world.fastest() / f64::from(every);
        let scale = world.torque_scale();
        let n = world.bodies.len();
        for method in HELD {
            for output in Output::ALL {
                let spec = Spec { bodies_every: every, ..world.spec(method, output, t) };
                let slowly = Spec { period: f64::from(every) * t, ..world.spec(method, output, t) };
                let (fast, slow) = (Small::new(&spec).unwrap(), Small::new(&slowly).unwrap());
                let (mut state, mut twin) = (fast.start(), slow.start());
                for (k, &(z, v)) in pucks.iter().enumerate() {
                    let sample = fast.step(&mut state, z, v);
                    if k % every as usize == 0 {
                        prop_assert_eq!(sample, slow.step(&mut twin, z, v));
                    }
                    prop_assert_eq!((&state.now, &state.change, &state.contacts), (&twin.now, &twin.change, &twin.contacts));
                    if method.is_explicit() {
                        let expected = world.torque(&named(&world, &state.now, &state.change, output, slowly.period), (z, v));
                        prop_assert!((sample.torque - expected).abs() < 1e-11 * scale, "{k}: {} {expected}", sample.torque);
                    }
                    prop_assert!(state.until_step < every && n > 0);
                }
            }
        }
    }

    /// At a body the springs are compensated over the bodies' step, between puck and ground over the period.
    #[test]
    fn a_compensating_damper_counts_the_step_at_its_own_ends(every in 1_u32..9, stiffness in 0.1..20.0_f64, z in -1.0..1.0_f64, v in -5.0..5.0_f64) {
        let bodies = [Body { inertia: 0.02, position: 0.0, velocity: 0.0 }];
        for (second, over) in [(End::Body(0), f64::from(every)), (End::Ground, 1.0)] {
            let spring = Law::Spring { stiffness, rest: 0.0 }.between(End::Puck, second);
            let torque = |damping, limit| {
                let damper = Coupling { limit, ..Law::Damper { damping }.between(End::Puck, second) };
                let couplings = [spring, damper];
                let world = World { bodies: bodies.to_vec(), couplings: couplings.to_vec() };
                let spec = world.spec(Method::ForwardEuler, Output::End, 1e-3);
                let compiled = Small::new(&Spec { bodies_every: every, ..spec }).unwrap();
                compiled.step(&mut compiled.start(), z, v).torque
            };
            // As a matrix, and with a limit by its law.
            for limit in [None, Some(1e9)] {
                let (own, fixed) = (torque(Damping::Compensating, limit), torque(Damping::Fixed(over * 1e-3 * stiffness), limit));
                prop_assert!((own - fixed).abs() < 1e-12 * (1.0 + fixed.abs()), "{own} {fixed}");
            }
        }
    }

    /// For a swap at any sample of a step, and for any rates before and after it.
    #[test]
    fn a_body_in_uniform_motion_keeps_its_way_through_a_swap(
        rates in (1_u32..6, 1_u32..6), periods in (1e-4..1e-2_f64, 1e-4..1e-2_f64), samples in 1..20_usize, first in any::<bool>(),
    ) {
        let velocity = 3.0;
        let world = World { bodies: vec![Body { inertia: 0.02, position: 0.0, velocity }], couplings: vec![] };
        let spec = world.spec(Method::Zoh, Output::End, periods.0);
        let before = Small::new(&Spec { bodies_every: rates.0, ..spec }).unwrap();
        let after = match first {
            true => Small::new(&world.spec(Method::Tustin, Output::Start, periods.1)).unwrap(),
            false => Small::new(&Spec { bodies_every: rates.1, period: periods.1, ..spec }).unwrap(),
        };
        let mut state = before.start();
        for _ in 0..samples {
            before.step(&mut state, 0.0, 0.0);
        }
        let mut state = after.transfer(&before, &state, Some, Some);
        after.step(&mut state, 0.0, 0.0);
        let expected = velocity * periods.0 * samples as f64;
        prop_assert!((state.now.position[0] - expected).abs() < 1e-12, "{} {expected}", state.now.position[0]);
    }

    /// The state may come from a caller.
    #[test]
    fn a_count_beyond_a_step_is_one_within_it(every in 2_u32..9, count in any::<u32>()) {
        let world = World { bodies: vec![Body { inertia: 0.02, position: 0.0, velocity: 1.0 }], couplings: vec![] };
        let compiled = Small::new(&Spec { bodies_every: every, ..world.spec(Method::Trapezoidal, Output::End, 1e-3) }).unwrap();
        let mut state = compiled.start();
        state.until_step = count;
        for _ in 0..every {
            compiled.step(&mut state, 0.0, 0.0);
        }
        prop_assert!(state.until_step < every && state.change.position[0] > 0.0);
    }
}

/// The state that the output names, `step` being the bodies'.
fn named(
    world: &World,
    now: &hapt_core::Vector<f64, 6>,
    change: &hapt_core::Vector<f64, 6>,
    output: Output,
    step: f64,
) -> Vec<f64> {
    let n = world.bodies.len();
    let part = match output {
        Output::Start => 0.0,
        Output::Middle => 0.5,
        Output::End => 1.0,
    };
    let positions = (0..n).map(|i| now.position[i] + part * change.position[i]);
    let velocities = (0..n).map(|i| match output {
        Output::End => change.position[i] / step,
        Output::Start | Output::Middle => now.velocity[i] + part * change.velocity[i],
    });
    positions.chain(velocities).collect()
}

#[test]
fn what_bodies_of_a_slower_rate_do_not_go_with_is_refused() {
    let lugre = Law::Lugre {
        coulomb: 1.0,
        stribeck: 1.0,
        stribeck_velocity: 1.0,
        bristle_stiffness: 1.0,
        bristle_damping: 0.0,
        viscous: 0.0,
    };
    let body = Body { inertia: 1.0, position: 0.0, velocity: 0.0 };
    let at = |second| [lugre.between(End::Puck, second)];
    let (at_body, at_ground) = (at(End::Body(0)), at(End::Ground));
    let spec = |couplings| Spec {
        method: Method::ForwardEuler,
        bodies_every: 2,
        estimator: hapt_core::Estimator::Exact,
        bodies: std::slice::from_ref(&body),
        couplings,
        ..Spec::new(1e-3)
    };
    let refusal = |spec: &Spec| Small::new(spec).err();
    assert_eq!(refusal(&spec(&at_ground)), None);
    let fine = spec(&[]);
    assert_eq!(refusal(&Spec { bodies_every: 1000, ..fine }), None);
    for bodies_every in [0, 1001, u32::MAX] {
        let error = refusal(&Spec { bodies_every, ..fine });
        assert!(matches!(error, Some(Error::Value { what: "bodies_every", .. })), "{error:?}");
    }
    for wrong in [
        spec(&at_body),
        Spec { method: Method::Tustin, output: Output::Start, ..fine },
        Spec { method: Method::Foh, output: Output::Start, ..fine },
        Spec { advance: 1, ..fine },
        Spec { bodies: &[], ..fine },
    ] {
        let error = refusal(&wrong);
        assert!(matches!(error, Some(Error::BodiesEvery { .. })), "{error:?}");
        assert_eq!(refusal(&Spec { bodies_every: 1, ..wrong }), None);
    }
}
