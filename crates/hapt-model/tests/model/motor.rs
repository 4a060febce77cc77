//! A motor behind a gear: the numbers of its own side are those of the puck by the work that they do.

use hapt_model::{Source, World};
use hapt_testing::prelude::*;

fn read(device: &str) -> Result<World, String> {
    let text = format!("loop.period = \"1 ms\"\n{device}");
    World::read(&Source::from_text("geared.toml", text), &[]).map_err(|error| error.to_string())
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    /// At any speed and torque: kinetic energy, losses and power of both sides are those of the one puck.
    #[test]
    fn a_geared_motor_has_the_energies_and_powers_of_its_own_side(
        ratio in 0.05_f64..200.0, own in (1e-5_f64..1e-2, 0.0_f64..1e-2, 0.0_f64..0.05), motor in (0.0_f64..1e-4, 0.0_f64..1e-5, 0.0_f64..0.01),
        limit in 0.001_f64..1.0, counts in 16_u32..20_000, speed in -50.0_f64..50.0, tolerance in 0.01_f64..0.5,
    ) {
        let (inertia, damping, friction) = own;
        let (rotor, viscous, brush) = motor;
        let world = read(&format!(
            "[device]\ninertia = \"{inertia} kg m^2 ± {} %\"\ndamping = {damping}\nfriction = {friction}\n[device.motor]\nratio = {ratio}\n\
             inertia = {rotor}\ndamping = {viscous}\nfriction = {brush}\nlimit = {limit}\nencoder = {counts}\n",
            100.0 * tolerance
        )).unwrap();
        let device = &world.device;
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (a.abs() + b.abs());
        let turned = ratio * speed;
        prop_assert!(near(device.inertia * speed * speed, inertia * speed * speed + rotor * turned * turned));
        prop_assert!(near(device.damping * speed * speed, damping * speed * speed + viscous * turned * turned));
        prop_assert!(near(device.friction * speed.abs(), friction * speed.abs() + brush * turned.abs()));
        prop_assert!(near(device.limit.unwrap() * speed, limit * turned));
        // The rate of counts is the same, to half a count in a turn.
        prop_assert!((device.encoder.unwrap() - ratio * f64::from(counts)).abs() <= 0.5 || device.encoder == Some(1.0));
        prop_assert_eq!(device.drive.gear, Some(ratio));
        // The tolerance is of the puck's own number, and keeps its absolute width.
        let [least, most] = device.inertia_range();
        prop_assert!((most - least - 2.0 * tolerance * inertia).abs() <= 1e-9 * device.inertia, "{least} {most}");
        // The written file has the numbers at the puck, and is the same world.
        prop_assert_eq!(&World::read(&Source::from_text("again", world.to_toml()), &[]).unwrap(), &world);
    }
}

#[test]
fn a_motors_numbers_can_be_set_by_their_paths() {
    let text = "loop.period = \"1 ms\"\ndevice.inertia = 1e-3\n[device.motor]\nratio = 10\ninertia = 1e-6\ntorque_constant = 0.05\ncurrent = 2\n";
    let source = Source::from_text("w.toml", text);
    let world = World::read(&source, &["device.motor.ratio=20".into()]).unwrap();
    assert!((world.device.inertia - 1.4e-3).abs() < 1e-15 && (world.device.limit.unwrap() - 2.0).abs() < 1e-12);
}

#[test]
fn what_two_sides_say_of_one_number_is_refused() {
    let base = "[device]\ninertia = 1e-3\nlimit = 1\nencoder = 100\n[device.motor]\nratio = 10\n";
    let message = |more: &str| read(&format!("{base}{more}\n")).unwrap_err();
    assert!(message("limit = 0.1").starts_with("device.motor.limit: device.limit is there too"));
    assert!(message("encoder = 10").starts_with("device.motor.encoder: device.encoder is there too"));
    assert!(message("current = 1").starts_with("device.motor.torque_constant: missing"));
    assert!(message("torque_constant = 0.1\ncurrent = 1").starts_with("device.motor.limit: device.limit is there too"));
    assert!(message("ratio = 0").contains("ratio"));
    assert!(
        read("device.inertia = 1e-3\n[device.motor]\ninertia = 1e-6\n")
            .unwrap_err()
            .starts_with("device.motor.ratio: missing")
    );
    let linear = "motion = \"linear\"\ndevice.inertia = 1e-3\n[device.motor]\nratio = 3\n";
    assert!(read(linear).is_err());
}

/// Its friction is the same in both directions, and is added to each.
#[test]
fn a_motors_friction_adds_to_both_directions_of_the_device() {
    let text = "loop.period = 1e-3\n[device]\ninertia = 1e-3\nfriction = \"2 mN m ± 50 %\"\nfriction_backward = \"1 mN m ± 10 %\"\n\
                [device.motor]\nratio = 10\nfriction = 1e-4\n";
    let device = World::read(&Source::from_text("w.toml", text), &[]).unwrap().device;
    let [forward, backward] = device.frictions_range();
    for ([low, high], wanted) in [(forward, [2e-3, 4e-3]), (backward, [1.9e-3, 2.1e-3])] {
        assert!((low - wanted[0]).abs() < 1e-12 && (high - wanted[1]).abs() < 1e-12, "{low} {high} {wanted:?}");
    }
    assert!((device.least_friction() - 2e-3).abs() < 1e-12 && (device.largest_friction() - 3e-3).abs() < 1e-12);
}
