//! `hapt check --proof`: the file, and no file where it cannot be written.

use std::fs;

use serde_json::Value;

use crate::common::{WHEEL, folder, hapt, names};

#[test]
fn the_proof_of_a_certified_wheel_has_its_claims_and_their_slopes() {
    let at = folder(&[("w.toml", WHEEL)]);
    let plain = hapt(at.path(), ["check", "w.toml", "--no-remedies"]).done();
    let ended = hapt(at.path(), ["check", "w.toml", "--no-remedies", "--proof", "w.json"]).done();
    assert_eq!(ended.out, plain.out);
    assert!(ended.err.contains("wrote w.json"), "{ended:?}");
    let proof: Value = serde_json::from_str(&fs::read_to_string(at.path().join("w.json")).unwrap()).unwrap();
    assert!(proof["format"] == 1 && proof["status"] == "certified", "{proof}");
    let claims: Vec<&Value> = proof["claims"].as_array().unwrap().iter().map(|claim| &claim["claim"]).collect();
    assert_eq!(claims, ["held", "free", "passive"]);
    let passive = &proof["claims"][2];
    let number = |value: &Value| value.as_str().unwrap().parse::<f64>().unwrap();
    let slope = number(&passive["witness"]["laws"][0]["stiffness"]);
    assert_eq!(number(&passive["required_damping"]), 0.5 * number(&passive["times"]["period"]) * slope);
    assert!(number(&passive["required_damping"]) <= number(&passive["device_damping"]), "{passive}");
}

#[test]
fn the_proof_of_a_refused_wheel_has_the_claims_that_hold() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended =
        hapt(at.path(), ["check", "w.toml", "--no-remedies", "--set", "device.damping=1e-6", "--proof", "w.json"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let proof: Value = serde_json::from_str(&fs::read_to_string(at.path().join("w.json")).unwrap()).unwrap();
    assert_eq!(proof["status"], "refuted");
    let all = [&proof["claims"], &proof["without_witness"]].map(|list| list.as_array().unwrap().clone()).concat();
    assert!(all.len() == 1 && all[0]["claim"] == "held", "{proof}");
}

#[test]
fn a_proof_that_cannot_be_written_leaves_nothing() {
    let network = "[stations.l]\nworld = \"w.toml\"\n[stations.r]\nworld = \"w.toml\"\n[[links]]\nkind = \"spring\"\n\
        between = [\"l\", \"r\"]\nstiffness = \"1 N mm/deg\"\nage_max = \"50 ms\"\n";
    let at = folder(&[("w.toml", WHEEL), ("n.toml", network), ("bad.toml", "[loop]\nperiod = 3 ms\n")]);
    let check = |world: &str, file: &str| hapt(at.path(), ["check", world, "--no-remedies", "--proof", file]);
    check("w.toml", "w.toml").refused(2, &["--proof w.toml", "that is the world itself"]);
    check("n.toml", "n.json").refused(2, &["--proof", "a network has no proof file"]);
    check("bad.toml", "bad.json").refused(2, &["bad.toml"]);
    check("w.toml", "none/w.json").refused(3, &["none/w.json"]);
    assert_eq!(names(at.path()), ["bad.toml", "n.toml", "w.toml"]);
    assert_eq!(fs::read_to_string(at.path().join("w.toml")).unwrap(), WHEEL);
}
