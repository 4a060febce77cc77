//! A hand that opens and grips again: the motion of the puck, and the hand's passivity.

use std::f64::consts::FRAC_PI_2;

use crate::common::{bare, rows, scenario, spring};
use hapt_model::*;
use hapt_sim::{Ledger, Row};
use hapt_testing::prelude::*;

fn grip(inertia: f64, damping: f64, stiffness: f64, to: f64, switching: Option<Switching>) -> Drive {
    Drive::Grip { inertia, damping, stiffness, moves: Shape::Step { to, at: 0.0 }, switching }
}

#[test]
fn a_quarter_swing_a_free_flight_and_a_quarter_swing_leave_the_puck_at_rest() {
    let mut world = bare();
    world.device.damping = 0.0;
    let (stiffness, to, open) = (2.0, 0.1, 0.0137);
    let inertia: f64 = 1e-3;
    let omega = (stiffness / (world.device.inertia + inertia)).sqrt();
    let hold = FRAC_PI_2 / omega;
    let run = rows(&world, &scenario(0.2, grip(inertia, 0.0, stiffness, to, Some(Switching { hold, open })), None));
    for row in &run {
        let (flight, second) = (row.time - hold, row.time - hold - open);
        let expected = if flight < 0.0 {
            to * (1.0 - (omega * row.time).cos())
        } else if second < 0.0 {
            to + to * omega * flight
        } else if second < hold {
            to + to * omega * open + to * (omega * second).sin()
        } else {
            2.0 * to + to * omega * open
        };
        assert!((row.puck - expected).abs() < 1e-12, "{} {}", row.time, row.puck - expected);
        // The hand's work is the kinetic energy of the puck.
        let moving = 0.5 * world.device.inertia * row.puck_velocity * row.puck_velocity;
        assert!((row.ledger.hand - moving).abs() < 1e-14);
    }
}

#[test]
fn a_hand_that_would_open_after_the_end_is_one_that_holds() {
    let mut world = bare();
    world.couplings = vec![spring(End::Puck, End::Ground, 3.0)];
    let with = |switching| rows(&world, &scenario(0.5, grip(1e-3, 1e-3, 2.0, 0.1, switching), None));
    let bits = |rows: Vec<Row>| -> Vec<u64> { rows.iter().map(|row| row.puck.to_bits()).collect() };
    assert_eq!(bits(with(None)), bits(with(Some(Switching { hold: 1.0, open: 1.0 }))));
}

#[test]
fn instants_near_a_sample_are_that_sample() {
    let mut world = bare();
    world.couplings = vec![spring(End::Puck, End::Ground, 3.0)];
    let with = |hold, open| {
        let grip = grip(1e-3, 1e-3, 2.0, 0.1, Some(Switching { hold, open }));
        rows(&world, &scenario(0.02, grip, None)).pop().unwrap().puck
    };
    assert_eq!(with(3e-3, 2e-3).to_bits(), with(3e-3 + 1e-10, 2e-3 - 2e-10).to_bits());
    assert_ne!(with(3e-3, 2e-3), with(3.01e-3, 2e-3));
}

proptest! {
    #![proptest_config(hapt_testing::cases(150))]

    /// Against any loop, an unstable one too.
    #[test]
    fn a_hand_with_a_constant_target_never_supplies_more_than_the_initial_energy_of_its_spring(
        wall in 0.0_f64..20.0, damping in 0.0_f64..5e-3, friction in prop_oneof![Just(0.0), 0.0_f64..0.02], delay in 0.0_f64..3e-3,
        (inertia, hand_damping, stiffness) in (0.0_f64..3e-3, 0.0_f64..5e-3, 0.0_f64..20.0), to in -0.3_f64..0.3,
        (hold, open) in (5e-4_f64..0.05, 5e-4_f64..0.05),
    ) {
        let mut world = bare();
        (world.device.damping, world.device.friction, world.sampling.delay) = (damping, friction, hapt_model::Delay::Seconds(delay));
        world.device.limit = Some(1.0);
        world.couplings = vec![spring(End::Puck, End::Ground, wall)];
        let hand = grip(inertia, hand_damping, stiffness, to, Some(Switching { hold, open }));
        let had = 0.5 * stiffness * to * to;
        for row in rows(&world, &scenario(1.0, hand, None)) {
            let Ledger { hand, motor, damping, friction, shaft: _, field: _, stops: _ } = row.ledger;
            let moving = 0.5 * world.device.inertia * row.puck_velocity * row.puck_velocity;
            let size = had + damping + friction + motor.abs() + 1e-12;
            prop_assert!(hand <= had + 1e-9 * size, "{hand} of {had} at {}", row.time);
            prop_assert!((hand + motor - damping - friction - moving).abs() < 1e-9 * size, "{:?}", row.ledger);
        }
    }
}
