//! Counts of the file's encoder as a unit.

use hapt_core::Law;
use hapt_model::{Source, World, parameters, schema};
use hapt_testing::prelude::*;

const DETENT: &str = "[[couplings]]\nkind = \"detent\"\nbetween = [\"puck\", \"ground\"]\n";

fn knob(device: &str, torque: &str, pitch: &str) -> Source {
    let head = format!("loop.period = \"1 ms\"\ndevice.inertia = 1e-4\n{device}");
    Source::from_text("knob.toml", format!("{head}{DETENT}torque = {torque}\npitch = {pitch}\n"))
}

fn pitch(source: &Source, sets: &[String]) -> f64 {
    match World::read(source, sets).unwrap().couplings[0].law {
        Law::Detent { pitch, .. } => pitch,
        _ => unreachable!("a detent"),
    }
}

proptest! {
    /// A turn is as many counts as the encoder has, at the puck or through a gear, and the file can change its encoder later.
    #[test]
    fn a_pitch_in_counts_is_that_many_of_the_encoders_angles(counts in 1..5000u32, encoder in 1..100_000u32, ratio in 1..20u32) {
        let angle = |encoder: u32| f64::from(counts) * std::f64::consts::TAU / f64::from(encoder);
        let is = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-14;
        let written = format!("\"{counts} count\"");
        let direct = knob(&format!("device.encoder = {encoder}\n"), "1", &written);
        prop_assert!(is(pitch(&direct, &[]), angle(encoder)));
        prop_assert!(is(pitch(&direct, &["device.encoder=512".to_string()]), angle(512)));
        let geared = format!("device.motor.ratio = {ratio}\ndevice.motor.encoder = {encoder}\n");
        prop_assert!(is(pitch(&knob(&geared, "1", &written), &[]), angle(ratio * encoder)));

        let list = parameters(&direct, &[]).unwrap();
        let found = list.iter().find(|parameter| parameter.path == "couplings.0.pitch").unwrap();
        prop_assert!(is(found.si.unwrap(), angle(encoder)) && found.unit == "rad");
    }
}

#[test]
fn a_count_stands_in_products_and_quotients_and_is_a_length_on_a_rail() {
    let text = "motion = \"linear\"\nloop.period = \"1 ms\"\ndevice.inertia = 0.1\ndevice.encoder = \"5 um\"\n\
                [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"0.2 mN/count\"\n\
                [[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nstiffness = 1\nat = \"200 ticks\"\n";
    let world = World::read(&Source::from_text("rail.toml", text), &[]).unwrap();
    let (Law::Spring { stiffness, .. }, Law::Wall { at, .. }) = (&world.couplings[0].law, &world.couplings[1].law)
    else {
        panic!("a spring and a wall")
    };
    assert!((stiffness - 40.0).abs() < 1e-12 && (at - 1e-3).abs() < 1e-17, "{stiffness} {at}");
}

#[test]
fn a_count_without_an_encoder_or_in_place_of_a_torque_is_refused() {
    let refused =
        |device: &str, torque: &str, pitch: &str| World::read(&knob(device, torque, pitch), &[]).unwrap_err().message;
    assert_eq!(
        refused("", "1", "\"100 counts\""),
        "\"100 counts\" is in counts, and the file has no device.encoder, which gives their size"
    );
    let torque = refused("device.encoder = 4000\n", "\"5 counts\"", "1");
    assert_eq!(torque, "\"5 counts\" is an angle (rad); expected a torque (N m), such as \"5 N mm\"");
}

#[test]
fn the_schema_takes_counts() {
    let text = schema();
    assert!(text.contains("counts?|ticks?"), "an editor would mark what hapt takes");
}
