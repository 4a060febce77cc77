//! No step gains energy, however long it is, with any kind of numbers.

use hapt_core::{Coupling, End, Law, Loop, Output, Real, Side, Spec};
use hapt_testing::prelude::*;

use super::{KEEPING, METHODS, Small, body, floor, grounded, list, spring};

use crate::reference::{World, world};

/// The changes of the energy over some steps with the puck held at z, relative to the largest energy: the largest gain of one step, the
/// gain and the loss of the whole; and the number of steps that did not settle.
struct Account {
    step: f64,
    gain: f64,
    loss: f64,
    unsettled: u32,
}

fn account<F: Real>(world: &World, spec: &Spec, z: f64, steps: usize, every: usize) -> Account {
    let control = Loop::<F, 6, 12, 3>::new(spec).unwrap();
    let mut state = control.start();
    let n = world.bodies.len();
    let z = F::from_f64(z);
    control.step(&mut state, z, F::ZERO);
    let (first, mut scale) = world.energy(&list(&state.now, n), z.to_f64());
    let mut last = first;
    let mut account = Account { step: 0.0, gain: 0.0, loss: 0.0, unsettled: 0 };
    for k in 1..=steps {
        control.step(&mut state, z, F::ZERO);
        if k % every != 0 {
            continue;
        }
        let (now, size) = world.energy(&list(&state.now, n), z.to_f64());
        scale = scale.max(size);
        account.step = account.step.max((now - last) / scale);
        account.gain = account.gain.max((now - first) / scale);
        account.loss = account.loss.max((first - now) / scale);
        last = now;
    }
    account.unsettled = state.contacts.unsettled;
    account
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn with_the_puck_held_no_step_gains_energy(world in world(true), angle in 1e-3_f64..1.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f64>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 1e-13, "{}: {:e}", method.name(), account.step);
            prop_assert_eq!(account.unsettled, 0, "{}", method.name());
        }
    }

    /// The fastest swing turns by up to 8 rad a step, and torques need not converge: the remaining energy is dissipated.
    #[test]
    fn nor_does_one_that_is_far_too_long_for_its_world(world in world(true), angle in 1.0_f64..8.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f64>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 1e-12, "{}: {:e}", method.name(), account.step);
        }
    }

    #[test]
    fn nor_does_one_on_single_floats(world in world(true), angle in 1e-2_f64..1.0, z in -1.0_f64..1.0) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let account = account::<f32>(&world, &spec, z, 200, 1);
            prop_assert!(account.step < 4e-5, "{}: {:e}", method.name(), account.step);
        }
    }

    #[test]
    fn a_wall_with_damping_never_pulls_and_never_gains(
        inertia in 1e-3_f64..0.1, velocity in -20.0_f64..-0.01, stiffness in 0.0_f64..1e4, damping in 0.0_f64..10.0,
        above in 0.0_f64..1e-2, limit in prop::option::of(0.1_f64..10.0), weight in 0.0_f64..1.0,
    ) {
        let law = floor(stiffness, damping);
        let couplings = vec![Coupling { limit, ..grounded(law) }, grounded(Law::Constant { torque: -weight })];
        let world = World { bodies: vec![body(inertia, above, velocity)], couplings };
        for method in METHODS {
            let control = Small::new(&world.spec(method, Output::End, 1e-3)).unwrap();
            let mut state = control.start();
            let mut touched = false;
            let mut last = f64::INFINITY;
            for _ in 0..300 {
                let (energy, size) = world.energy(&list(&state.now, 1), 0.0);
                prop_assert!(energy <= last + 1e-13 * size.max(last.abs()) || last.is_infinite(), "{}: {last} {energy}", method.name());
                last = energy;
                control.step(&mut state, 0.0, 0.0);
                let torque = state.contacts.torques[0];
                prop_assert!(torque >= 0.0 && torque <= limit.unwrap_or(f64::INFINITY), "{torque}");
                touched |= torque > 0.0;
            }
            prop_assert!(touched || stiffness + damping < 1e-2 || above > 300.0 * 1e-3 * velocity.abs());
        }
    }

    #[test]
    fn states_of_any_size_end_their_step(
        world in world(true), bits in prop::collection::vec(any::<u64>(), 16), powers in prop::collection::vec(-40_i32..40, 16),
        sane in any::<bool>(), angle in 1e-3_f64..20.0,
    ) {
        for method in METHODS {
            let spec = world.spec(method, Output::End, angle / world.fastest());
            let control = Small::new(&spec).unwrap();
            let mut state = control.start();
            let number = |i: usize| {
                let any = f64::from_bits(bits[i]);
                if sane { 10_f64.powi(powers[i]) * if bits[i] % 2 == 0 { 1.0 } else { -1.0 } } else { any }
            };
            for i in 0..6 {
                (state.now.position[i], state.now.velocity[i]) = (number(i), number(6 + i));
            }
            for _ in 0..3 {
                let sample = control.step(&mut state, number(12), number(13));
                prop_assert!(!sane || sample.torque.is_finite());
                prop_assert!(!sane || list(&state.now, 6).iter().all(|x| x.is_finite()));
            }
        }
    }
}

#[test]
fn a_million_steps_gain_less_than_a_hundred_millionth() {
    let detent = Law::Detent { torque: 0.3, pitch: 0.4, phase: 0.1 };
    let wall = |side, at| Law::Wall { side, at, stiffness: 800.0, damping: 0.0 };
    let between = |first, second, law| Coupling { first, second, law, limit: None };
    let (a, b, c) = (End::Body(0), End::Body(1), End::Body(2));
    let worlds = [
        // In a box, over detents.
        World {
            bodies: vec![body(0.01, 0.1, 3.0)],
            couplings: vec![grounded(wall(Side::Above, 0.5)), grounded(wall(Side::Below, -0.5)), grounded(detent)],
        },
        // Three in a row, with walls between them, on the puck's spring, which levels off.
        World {
            bodies: vec![body(0.01, 0.0, 3.0), body(0.03, 0.3, 0.0), body(0.02, 0.6, -1.0)],
            couplings: vec![
                Coupling { limit: Some(0.4), ..between(End::Puck, a, spring(5.0)) },
                between(a, b, wall(Side::Above, -0.1)),
                between(b, c, wall(Side::Above, -0.1)),
                between(c, End::Ground, wall(Side::Above, 1.0)),
                between(b, c, detent),
            ],
        },
    ];
    for world in worlds {
        for method in KEEPING {
            let steps = if cfg!(debug_assertions) { 300_000 } else { 1_000_000 };
            let account = account::<f64>(&world, &world.spec(method, Output::End, 1e-3), 0.2, steps, 100);
            println!("{}: {:e} {:e}", method.name(), account.gain, account.loss);
            assert!(account.gain < 1e-8 && account.loss < 1e-8, "{}: {:e}", method.name(), account.gain);
            assert_eq!(account.unsettled, 0);
        }
    }
}
