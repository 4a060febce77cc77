//! The energy that the world stores is the work of its torques.

use crate::common::{self, bare, rows, scenario, step};
use hapt_model::*;
use hapt_sim::{Simulation, Summary, world_energy};
use hapt_testing::laws::{SIZES, Sizes, is_potential, some_limited};
use hapt_testing::prelude::*;

/// A law with an energy, and a limit where it takes one.
fn law() -> impl Strategy<Value = (Law, Option<f64>)> {
    let sizes =
        Sizes { stiffness: 0.0..=10.0, damping: 0.0..=0.0, torque: 0.0..=1.0, length: 0.1..=2.0, place: 1.0, ..SIZES };
    some_limited(sizes.laws(|law| is_potential(law) || law.constant().is_some()), 0.05_f64..5.0)
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn a_couplings_torque_is_the_slope_of_its_stored_energy((law, limit) in law(), q in -2.0_f64..2.0, reversed in any::<bool>()) {
        let (first, second) = if reversed { (End::Ground, End::Puck) } else { (End::Puck, End::Ground) };
        let mut world = bare();
        world.couplings = vec![Coupling { first, second, law, limit }];
        let torque = rows(&world, &scenario(1e-3, step(q, 0.0), None))[0].torque;
        let h = 1e-5;
        let slope = (world_energy(&world, q + h, &[], &[]) - world_energy(&world, q - h, &[], &[])) / (2.0 * h);
        prop_assert!((torque + slope).abs() < 1e-4 * (1.0 + torque.abs()), "{torque} {slope}");
        let shown = world.spec().coupling_torque(0, (q, 0.0), &[]);
        prop_assert!((torque - if reversed { -shown } else { shown }).abs() < 1e-12, "{torque} {shown}");
    }

    #[test]
    fn a_lossless_world_keeps_its_energy_under_the_exact_hold_and_the_trapezoidal_rule(
        stiffness in prop::collection::vec(0.1_f64..10.0, 3), inertia in prop::collection::vec(1e-3_f64..0.1, 3), z0 in -1.0_f64..1.0,
    ) {
        for method in [Method::Zoh, Method::Trapezoidal] {
            let mut world = bare();
            world.sampling.method = method;
            world.names = vec!["a".into(), "b".into(), "c".into()];
            world.bodies = inertia.iter().map(|&inertia| Body { inertia, position: 0.0, velocity: 0.0 }).collect();
            let ends = [End::Puck, End::Body(0), End::Body(1), End::Body(2)];
            world.couplings = (0..3).map(|i| common::spring(ends[i], ends[i + 1], stiffness[i])).collect();
            let scenario = scenario(2.0, step(z0, 0.0), None);
            let mut run = Simulation::new(&world, &scenario).unwrap();
            let mut summary = Summary::new(&world, &run);
            while let Some(row) = run.next() {
                summary.add(row.unwrap());
            }
            let start = 0.5 * stiffness[0] * z0 * z0;
            prop_assert!((summary.final_energy() / start - 1.0).abs() < 1e-9, "{} {start}", summary.final_energy());
        }
    }

    #[test]
    fn nonlinear_couplings_at_a_body_generate_no_energy_while_the_puck_is_held_and_the_devices_ledger_closes(
        laws in prop::collection::vec((law(), any::<bool>()), 1..4), coulomb in 0.0_f64..0.1, z0 in -1.0_f64..1.0, v0 in -5.0_f64..5.0,
    ) {
        for method in [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler] {
            let mut world = common::wheel(method, Output::End);
            world.bodies[0].velocity = v0;
            for &((law, limit), at_puck) in &laws {
                let second = if at_puck { End::Puck } else { End::Ground };
                world.couplings.push(Coupling { first: End::Body(0), second, law, limit });
            }
            let friction = Law::Coulomb { torque: coulomb };
            world.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law: friction, limit: None });
            let held = rows(&world, &scenario(0.5, step(z0, 0.0), None));
            let energy = |row: &hapt_sim::Row| world_energy(&world, row.puck, &row.bodies, &row.bristles);
            let size = held.iter().map(|row| energy(row).abs()).fold(1.0, f64::max);
            for pair in held.windows(2) {
                prop_assert!(energy(&pair[1]) - energy(&pair[0]) < 1e-13 * size, "{}", method.name());
            }
            // Released at once: only motor and damping act on the puck.
            let free = rows(&world, &scenario(0.5, step(0.0, 0.0), Some(0.0)));
            let last = &free[free.len() - 1];
            let moving = 0.5 * world.device.inertia * last.puck_velocity * last.puck_velocity;
            let left = last.ledger.hand + last.ledger.motor - last.ledger.damping - last.ledger.friction - moving;
            prop_assert!(left.abs() < 1e-11 * (1.0 + last.ledger.damping + moving), "{}: {left}", method.name());
        }
    }

    #[test]
    fn no_nonlinear_coupling_at_the_puck_returns_more_energy_than_it_received(
        (law, limit) in law(), z0 in -1.0_f64..1.0, coulomb in 0.0_f64..0.2,
    ) {
        // Held and moved slowly there and back: the hand's work is the energy that friction dissipates.
        let mut world = bare();
        world.couplings = vec![
            Coupling { first: End::Puck, second: End::Ground, law, limit },
            Coupling { first: End::Puck, second: End::Ground, law: Law::Coulomb { torque: coulomb }, limit: None },
        ];
        world.device.damping = 0.0;
        let points = vec![(0.0, 0.0), (1.0, z0), (2.0, 0.0)];
        let hand = Drive::Position(Shape::Path { file: "there-and-back.csv".into(), points });
        let last = rows(&world, &scenario(2.0, hand, None)).pop().unwrap();
        let friction = 2.0 * coulomb * z0.abs();
        // The tolerance is the work of one sample's hold in each direction.
        let hold = 2e-3 * z0.abs() * (coulomb + 30.0 * z0.abs() + 3.0);
        prop_assert!((last.ledger.hand - friction).abs() < hold, "{} {friction} {hold}", last.ledger.hand);
    }
}
