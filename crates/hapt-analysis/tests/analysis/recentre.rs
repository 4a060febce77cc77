//! An origin that slips while the puck rests: certified only by (T80), and nowhere else.

use hapt_analysis::{Status, check, passivity, required_damping};
use hapt_model::{Coupling, End, Law, Source, World};
use hapt_testing::prelude::*;

const KNOB: &str = "[loop]\nperiod = \"0.25 ms\"\nestimator = \"difference\"\nrecentre = \"0.5 s\"\n\
    [device]\ninertia = \"30 g cm^2\"\ndamping = \"4e-5 N m s/rad\"\nfriction = \"1 N mm\"\nlimit = \"40 N mm\"\nencoder = 16384\n\
    [[couplings]]\nkind = \"detent\"\nbetween = [\"puck\", \"ground\"]\ntorque = \"5 N mm\"\npitch = \"8.2258 deg\"\n";

fn read(text: &str, sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    World::read(&Source::from_text("knob.toml", text), &sets).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_knob_is_certified_by_the_theorem_and_asks_for_as_much_as_without() {
    let (slips, stays) = (read(KNOB, &[]), read(&KNOB.replace("recentre = \"0.5 s\"\n", ""), &[]));
    let found = check(&slips).unwrap();
    assert!(found.certified.holds(), "{}", found.verdict_sentence());
    let ids: Vec<&str> = passivity(&slips).unwrap().passive.theorems().iter().map(|theorem| theorem.id).collect();
    assert_eq!(ids, ["laws", "recentre"]);
    assert_eq!(required_damping(&slips).unwrap(), required_damping(&stays).unwrap());
}

#[test]
fn what_the_theorem_does_not_cover_is_not_proved_and_says_why() {
    let spring = "[bodies.wheel]\ninertia = \"1e-5 kg m^2\"\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"wheel\"]\n\
        stiffness = \"0.01 N m/rad\"\n";
    let more = |kind: &str| format!("[[couplings]]\nkind = \"{kind}\"\nbetween = [\"puck\", \"ground\"]\n");
    let damper = format!("{}damping = \"1e-6 N m s/rad\"\n", more("damper"));
    let wall = format!("{}at = 1\nside = \"above\"\nstiffness = 0.03\ndamping = 1e-6\n", more("wall"));
    let lugre = format!(
        "{}coulomb = 1e-4\nstribeck = 1e-4\nstribeck_velocity = 0.1\nbristle_stiffness = 0.01\nbristle_damping = 0\nviscous = 0\n",
        more("friction")
    );
    for (text, sets, why) in [
        ("", vec!["loop.delay=1 samples"], "newest sample"),
        ("", vec!["device.lag=0.1 ms"], "lags"),
        ("", vec!["loop.filter=500 Hz"], "filter"),
        (&damper, vec![], "takes the slip for a motion"),
        (&wall, vec![], "takes the slip for a motion"),
        (&lugre, vec![], "takes the slip for a motion"),
        (spring, vec!["loop.method=semi-implicit-euler", "loop.output=middle"], "end of a step"),
        (spring, vec!["loop.output=start"], "end of a step"),
    ] {
        let world = read(&format!("{KNOB}{text}"), &sets);
        let found = check(&world).unwrap();
        assert!(!found.certified.holds() && found.status != Status::Certified, "{text} {sets:?}");
        let reasons = passivity(&world).unwrap().not_proved.join("; ");
        assert!(
            reasons.contains("loop.recentre has no proof here") && reasons.contains(why),
            "{text} {sets:?}: {reasons}"
        );
    }
    // What the reader refuses, as no place of the origin ends the torque: with a friction that follows the slip, a weight was lifted
    // without a hand.
    for law in [
        Law::Constant { torque: 1e-4 },
        Law::Coulomb { torque: 1e-4 },
        Law::Assist { torque: 1e-4, velocity: 0.1 },
        Law::Integral { stiffness: 1e-3, time: 1.0, rest: 0.0 },
    ] {
        let mut world = read(KNOB, &[]);
        world.couplings.push(Coupling { limit: Some(1e-4), ..law.between(End::Puck, End::Ground) });
        let found = check(&world).unwrap();
        assert!(!found.certified.holds() && found.status != Status::Certified, "{law:?}");
        let reasons = passivity(&world).unwrap().not_proved.join("; ");
        assert!(reasons.contains("carries it along") || reasons.contains("for a motion"), "{law:?}: {reasons}");
    }
    assert!(!check(&read(KNOB, &["loop.delay_max=0.1 ms"])).unwrap().certified.holds());
    let world = read(&format!("{KNOB}{spring}"), &["device.encoder=1e9"]);
    let ids: Vec<&str> = passivity(&world).unwrap().passive.theorems().iter().map(|theorem| theorem.id).collect();
    assert_eq!(ids, ["energy", "recentre"], "{:?}", passivity(&world).unwrap().not_proved);
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// It never requires less than the same world whose origin stays.
    #[test]
    fn a_slip_pays_for_nothing_else(
        torque in 1e-4..0.02f64, pitch in 2.0..60.0f64, stiffness in 1e-3..0.05f64, stretch in 1.0..2.0f64,
    ) {
        let sets = [
            format!("couplings.0.torque={torque:?}"), format!("couplings.0.pitch={pitch:?} deg"), format!("loop.interval_max={:?} ms", 0.25 * stretch),
        ];
        let spring = format!("[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {stiffness:?}\n");
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let slips = read(&format!("{KNOB}{spring}"), &sets);
        let stays = World { sampling: hapt_model::Sampling { recentre: None, ..slips.sampling.clone() }, ..slips.clone() };
        let (slips, stays) = (check(&slips).unwrap(), check(&stays).unwrap());
        prop_assert!(!slips.certified.holds() || stays.certified.holds());
    }
}

/// The spring that would hold a lever goes slack as the origin slips to where it hangs.
#[test]
fn a_spring_whose_origin_slips_holds_nothing_against_gravity() {
    let text = KNOB
        .replace("kind = \"detent\"", "kind = \"spring\"")
        .replace("torque = \"5 N mm\"\npitch = \"8.2258 deg\"", "stiffness = \"50 N mm/rad\"");
    let lever = format!("{text}[device.gravity]\ntorque = \"2 N mm\"\n");
    let line = |text: &str| check(&read(text, &[])).unwrap().headline();
    assert!(line(&lever).contains("gravity may move the puck"), "{}", line(&lever));
    assert!(!line(&lever.replace("recentre = \"0.5 s\"\n", "")).contains("gravity may move"));
}
