//! End stops of the device in runs of the loop.

use crate::common::{bare, rows, scenario, spring};
use hapt_analysis::is_certified;
use hapt_model::*;
use hapt_sim::{Error, Simulation};
use hapt_testing::prelude::*;

fn any_stops() -> impl Strategy<Value = Stops> {
    let damping = prop_oneof![Just(0.0), 1e-4..0.05_f64];
    (0.01_f64..0.3, 0.01_f64..0.3, 1.0_f64..500.0, damping).prop_map(|(low, high, stiffness, damping)| Stops {
        low: Some(-low),
        high: Some(high),
        stiffness,
        damping,
    })
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// Under a passive loop no puck gains energy from stop to stop: kinetic energy and the energy stored in spring and stops never grow hands-off.
    #[test]
    fn a_certified_loop_gains_no_energy_between_stops(
        stiffness in 0.1_f64..2.4, stops in any_stops(), push in -0.5_f64..0.5, friction in prop_oneof![Just(0.0), 1e-3..0.02_f64],
        rest in -0.5_f64..0.5,
    ) {
        let mut world = bare();
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        // The spring's rest position is within the range or beyond a stop.
        if let Law::Spring { rest: at, .. } = &mut world.couplings[0].law {
            *at = rest;
        }
        (world.device.friction, world.device.stops) = (friction, Some(stops));
        prop_assert!(is_certified(&world));
        let hand = Drive::Torque(Shape::Step { to: push, at: 0.0 });
        let rows = rows(&world, &scenario(1.5, hand, Some(0.2)));
        let depth = |z: f64| (z - stops.high.unwrap()).max(stops.low.unwrap() - z).max(0.0);
        let energy = |row: &hapt_sim::Row| {
            let (z, v) = (row.puck, row.puck_velocity);
            0.5 * world.device.inertia * v * v + 0.5 * stiffness * (z - rest).powi(2) + 0.5 * stops.stiffness * depth(z).powi(2)
        };
        let free: Vec<f64> = rows.iter().skip(200).map(energy).collect();
        // Between two samples the held torque differs from the spring's by up to K dz; damping dissipates the energy of that difference. A puck whose
        // velocity a stop reverses moves farther than from sample to sample.
        let travel = rows.iter().map(|row| row.puck_velocity.abs() * 1e-3).fold(0.0, f64::max);
        let slack = 2.0 * stiffness * travel * travel;
        for pair in free.windows(2) {
            prop_assert!(pair[1] <= pair[0] + slack + 1e-12);
        }
        prop_assert!(free.last().unwrap() <= &(free[0] + slack));
        let (ledger, last) = (rows.last().unwrap().ledger, rows.last().unwrap());
        let kept = 0.5 * world.device.inertia * last.puck_velocity.powi(2) + 0.5 * stops.stiffness * depth(last.puck).powi(2);
        let left = ledger.hand + ledger.motor - ledger.damping - ledger.friction - ledger.stops - kept;
        prop_assert!(left.abs() < 1e-9 * (ledger.hand.abs() + ledger.motor.abs() + ledger.damping + ledger.stops) + 1e-12, "{ledger:?}");
        prop_assert!(ledger.stops >= -1e-12 && (stops.damping > 0.0 || ledger.stops < 1e-9));
    }

    /// A puck under a constant push comes to rest where the stop, the spring and the push balance.
    #[test]
    fn a_pushed_puck_rests_where_the_stop_balances_the_push(
        stiffness in 0.1_f64..2.0, stops in any_stops(), push in 0.1_f64..2.0, back in any::<bool>(),
    ) {
        let mut world = bare();
        world.device.damping = 0.02;
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        world.device.stops = Some(Stops { damping: stops.damping.max(0.01), ..stops });
        let push = if back { -push } else { push };
        let rows = rows(&world, &scenario(6.0, Drive::Torque(Shape::Step { to: push, at: 0.0 }), None));
        let (z, at) = (rows.last().unwrap().puck, if back { stops.low.unwrap() } else { stops.high.unwrap() });
        let free = push / stiffness;
        let wanted = if free.abs() < at.abs() { free } else { (push + stops.stiffness * at) / (stiffness + stops.stiffness) };
        prop_assert!((z - wanted).abs() < 1e-4 * wanted.abs(), "{z} {wanted}");
    }
}

#[test]
fn a_stop_too_stiff_for_the_period_or_at_the_start_is_refused_by_name() {
    let mut world = bare();
    world.device.stops = Some(Stops { low: None, high: Some(0.1), stiffness: 1e12, damping: 0.0 });
    let hand = scenario(0.1, Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), None);
    let error = Simulation::new(&world, &hand).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Device { table: "stops", key: "stiffness", .. }), "{error}");
    // As a sweep may set it.
    assert!(world.set_number("device.stops.stiffness", 10.0) && world.set_number("device.stops.high", -0.1));
    let error = Simulation::new(&world, &hand).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Device { table: "stops", key: "high", .. }), "{error}");
}
