//! The device without a loop, with a hand that calls move.

use crate::common::{bare, rows, scenario};
use hapt_model::{Drive, Shape, World};
use hapt_sim::{Grip, VirtualDevice, script};
use hapt_testing::prelude::*;

/// The works of hand and motor less those of damping and friction and less the kinetic energy: zero.
fn imbalance(world: &World, device: &VirtualDevice) -> f64 {
    let ledger = device.ledger();
    let (_, v) = device.puck();
    ledger.hand + ledger.motor - ledger.damping - ledger.friction - 0.5 * world.device.inertia * v * v
}

fn grips() -> impl Strategy<Value = Grip> {
    (0.0_f64..1e-3, 0.0_f64..0.05, 0.1_f64..10.0).prop_map(|(inertia, damping, stiffness)| Grip {
        inertia,
        damping,
        stiffness,
    })
}

fn devices() -> impl Strategy<Value = World> {
    let friction = prop_oneof![Just(0.0), 1e-3_f64..0.02];
    let delay = prop::sample::select(&[0.0, 1e-3, 0.4e-3, 2.7e-3][..]);
    (1e-4_f64..1e-2, 0.0_f64..0.01, friction, delay).prop_map(|(inertia, damping, friction, delay)| {
        let mut world = bare();
        (world.device.inertia, world.device.damping, world.device.friction) = (inertia, damping, friction);
        world.sampling.delay = hapt_model::Delay::Seconds(delay);
        world
    })
}

/// With a torque on for some time the puck moves.
fn moving(world: &World) -> VirtualDevice {
    let mut device = VirtualDevice::new(&world.device_spec());
    device.command(0.1);
    for _ in 0..30 {
        device.travel();
        device.command(0.1);
    }
    device
}

proptest! {
    #![proptest_config(hapt_testing::cases(100))]

    #[test]
    fn a_hand_that_grips_or_releases_gives_no_impulse(world in devices(), grip in grips()) {
        let mut device = moving(&world);
        let before = device.puck();
        device.hold(Some(grip));
        prop_assert_eq!(device.puck(), before);
        // At first the hand's torque is that of its damper, and its spring is unloaded: v̇ is finite, and the velocity is continuous.
        let mut other = device.clone();
        device.travel();
        let mass = world.device.inertia + grip.inertia;
        let most = (grip.damping + grip.stiffness * 1e-3 + world.device.damping) * before.1.abs() + 0.1 + world.device.friction;
        prop_assert!((device.puck().1 - before.1).abs() <= 1.01 * most / mass * 1e-3);
        other.hold(None);
        prop_assert_eq!(other.puck(), before);
        prop_assert!(!other.is_held() && device.is_held());
    }

    #[test]
    fn targets_at_a_steady_rate_are_the_path_through_them_one_interval_late(
        world in devices(), grip in grips(), every in 1_usize..20, points in prop::collection::vec(-0.5_f64..0.5, 1..8),
    ) {
        // With a target every n samples, the hand arrives n samples later.
        let spacing = every as f64 * 1e-3;
        let mut path = vec![(spacing, 0.0)];
        path.extend(points.iter().enumerate().map(|(i, point)| ((i + 2) as f64 * spacing, *point)));
        let Grip { inertia, damping, stiffness } = grip;
        let moves = Shape::Path { file: "path.csv".into(), points: path };
        let drive = Drive::Grip { inertia, damping, stiffness, moves, switching: None };
        let run = rows(&world, &scenario((points.len() + 3) as f64 * spacing, drive, None));
        let mut device = VirtualDevice::new(&world.device_spec());
        device.hold(Some(grip));
        for (k, row) in run.iter().enumerate() {
            if k > 0 {
                device.travel();
            }
            if k > 0 && k % every == 0 && let Some(point) = points.get(k / every - 1) {
                device.intend(*point);
            }
            device.command(0.0);
            let (position, velocity) = device.puck();
            prop_assert!((position - row.puck).abs() < 1e-9, "{k}: {position} {}", row.puck);
            prop_assert!((velocity - row.puck_velocity).abs() < 1e-7, "{k}: {velocity} {}", row.puck_velocity);
            prop_assert!(!device.announced());
        }
    }

    #[test]
    fn the_works_add_up_whatever_the_hand_does(world in devices(), touches in prop::collection::vec((0_usize..5, -0.5_f64..0.5, grips()), 1..60)) {
        let mut device = VirtualDevice::new(&world.device_spec());
        let shape = Shape::Sine { amplitude: 0.2, frequency: 9.0, phase: 0.0 };
        let mut size = 1e-6_f64;
        for (what, x, grip) in touches {
            match what {
                0 => device.hold(Some(grip)),
                1 => device.hold(None),
                2 => device.begin(&mut script(&scenario(0.013, Drive::Position(shape.clone()), None), 1e-3)),
                3 => device.begin(&mut script(&scenario(0.013, Drive::Torque(shape.clone()), None), 1e-3)),
                _ => device.intend(x),
            }
            for _ in 0..7 {
                device.command(0.2 * x);
                device.travel();
                let ledger = device.ledger();
                size = [ledger.hand, ledger.motor, ledger.damping].iter().fold(size, |m, x| m.max(x.abs()));
                prop_assert!(imbalance(&world, &device).abs() <= 1e-9 * size, "{} of {size}", imbalance(&world, &device));
            }
        }
    }

    /// The device caches the kind of an event-free period until something changes; for uneven samples it computes every period in general.
    #[test]
    fn a_period_of_a_cached_kind_is_bit_identical_to_a_general_one(
        world in devices(), late in any::<bool>(),
        touches in prop::collection::vec((0_usize..6, -0.5_f64..0.5, grips(), 1_usize..9), 1..40),
    ) {
        let mut world = world;
        world.sampling.delay = hapt_model::Delay::Seconds(if late { 1e-3 } else { 0.0 });
        let (mut cached, mut general) = (VirtualDevice::new(&world.device_spec()), VirtualDevice::new(&world.device_spec()));
        for (what, x, grip, periods) in touches {
            for device in [&mut cached, &mut general] {
                let begins = |device: &mut VirtualDevice, drive| {
                    device.begin(&mut script(&scenario(1.0, drive, Some(4.5e-3)), 1e-3));
                };
                match what {
                    0 => device.hold(Some(grip)),
                    1 => device.hold(None),
                    2 => device.push(x),
                    3 => device.intend(x),
                    4 => begins(device, Drive::Position(Shape::Step { to: x, at: 1.5e-3 })),
                    _ => begins(device, Drive::Torque(Shape::Step { to: x, at: 1.5e-3 })),
                }
            }
            for k in 0..periods {
                let torque = 0.1 * x - 0.01 * k as f64;
                cached.command(torque);
                cached.travel();
                general.command(torque);
                general.travel_uneven(1e-3, cached.time(), 0.0, 0.0);
                let of = |device: &VirtualDevice| (device.puck(), device.ledger(), device.applied(), device.is_held(), device.announced());
                prop_assert_eq!(of(&cached), of(&general));
            }
        }
    }

    #[test]
    fn a_device_refitted_to_itself_continues_bit_identically(world in devices(), grip in grips()) {
        let (mut one, mut other) = (moving(&world), moving(&world));
        for device in [&mut one, &mut other] {
            device.hold(Some(grip));
            device.intend(0.3);
        }
        other.refit(&mut VirtualDevice::new(&world.device_spec()));
        for k in 0..50 {
            for device in [&mut one, &mut other] {
                device.command(f64::from(k) * 1e-3);
                device.travel();
            }
            prop_assert_eq!(one.puck(), other.puck());
            prop_assert_eq!(one.ledger(), other.ledger());
        }
    }

    #[test]
    fn in_other_periods_the_same_hand_moves_the_same_device(world in devices(), grip in grips(), to in -0.5_f64..0.5, split in 2_usize..6) {
        let mut world = world;
        world.sampling.delay = hapt_model::Delay::Seconds(0.0);
        let mut fine = world.clone();
        fine.sampling.period /= split as f64;
        let (mut one, mut other) = (VirtualDevice::new(&world.device_spec()), VirtualDevice::new(&world.device_spec()));
        for device in [&mut one, &mut other] {
            device.hold(Some(grip));
            (0..10).for_each(|_| device.travel());
            // The move takes ten periods.
            device.intend(to);
            (0..3).for_each(|_| device.travel());
        }
        other.refit(&mut VirtualDevice::new(&fine.device_spec()));
        for _ in 0..40 {
            one.travel();
            (0..split).for_each(|_| other.travel());
            let ((x, v), (y, w)) = (one.puck(), other.puck());
            prop_assert!((x - y).abs() < 1e-9 && (v - w).abs() < 1e-7, "{x} {y}, {v} {w}");
        }
    }
}

#[test]
fn a_prescribed_jump_is_announced_and_nothing_else_is() {
    let world = bare();
    let step = Drive::Position(Shape::Step { to: 0.5, at: 5e-3 });
    let mut device = VirtualDevice::new(&world.device_spec());
    let mut script = script(&scenario(20e-3, step, None), 1e-3);
    device.begin(&mut script);
    for k in 1..40 {
        device.travel();
        assert_eq!(device.announced(), k == 5, "{k}");
        assert_eq!(device.puck().0, if k < 5 { 0.0 } else { 0.5 });
        // After the scenario's duration the hand releases.
        assert_eq!(device.is_held(), k <= 20, "{k}");
    }
}

#[test]
fn delayed_commands_arrive_under_another_delay_too() {
    let delayed = |samples: f64| {
        let mut world = bare();
        world.sampling.delay = hapt_model::Delay::Seconds(samples * 1e-3);
        world
    };
    let mut device = VirtualDevice::new(&delayed(3.0).device_spec());
    for k in 0..10 {
        device.command(f64::from(k));
        device.travel();
    }
    assert_eq!(device.applied(), 6.0);
    // 7, 8 and 9 are in the delay line; with a shorter delay the older of them are dropped.
    device.refit(&mut VirtualDevice::new(&delayed(1.0).device_spec()));
    device.command(10.0);
    assert!((6.0..=9.0).contains(&device.applied()));
    device.travel();
    device.command(11.0);
    assert_eq!(device.applied(), 10.0);
}
