//! The contents of a proof file, against the world that it belongs to.

use hapt_analysis::{Check, check, proof, required_damping};
use hapt_model::{Source, World};
use hapt_testing::prelude::*;
use serde_json::Value;

fn world(text: &str) -> World {
    World::read(&Source::from_text("w.toml", text), &[]).unwrap()
}

fn proved(world: &World) -> (Check, Value) {
    let check = check(world).unwrap();
    let proof = serde_json::to_value(proof(world, &check).unwrap()).unwrap();
    (check, proof)
}

fn number(text: &Value) -> f64 {
    text.as_str().unwrap().parse().unwrap()
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(number).collect()
}

/// A spring and a damper from the puck to ground behind a delay of `samples` samples.
fn spring_and_damper(period: f64, samples: u32, estimator: &str, [stiffness, damping]: [f64; 2]) -> World {
    world(&format!(
        "loop = {{ period = {period:?}, delay = \"{samples} samples\", estimator = {estimator:?}, cutoff = \"40 Hz\" }}\n\
         device = {{ inertia = 1e-3, damping = 1e3 }}\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {stiffness:?}\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"ground\", \"puck\"]\ndamping = {damping:?}\n"
    ))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    /// b (1 + φ s) - R(s), R and φ from the file, is the condition (T29) of a spring and a damper, and the file's damping is the least one.
    #[test]
    fn a_polynomial_is_the_condition_of_the_linear_loop(
        period in 1e-4..1e-2f64, samples in 1..7u32, low_pass in any::<bool>(), stiffness in 0.1..100f64, damping in 0.2..2f64,
    ) {
        let estimator = if low_pass { "low-pass" } else { "difference" };
        let damping = damping * stiffness * period;
        let mut world = spring_and_damper(period, samples, estimator, [stiffness, damping]);
        let least = required_damping(&world).unwrap().unwrap();
        world.device.damping = least * (1.0 + 1e-8);
        let (_, proof) = proved(&world);
        let claim = &proof["claims"][2];
        prop_assert_eq!(&claim["theorem"], "linear");
        let required = number(&claim["required_damping"]);
        prop_assert!((required / least - 1.0).abs() < 2e-9);
        let (coefficients, filter) = (numbers(&claim["witness"]["coefficients"]), number(&claim["witness"]["filter"]));
        let tau = if low_pass { 1.0 / (std::f64::consts::TAU * 40.0) } else { 0.0 };
        for i in 1..=200 {
            let theta = std::f64::consts::PI * f64::from(i) / 200.0;
            let s = (theta / 2.0).sin().powi(2);
            let found = coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c) / (1.0 + filter * s);
            // (T/2) Re{(1 - z⁻¹) H}/(1 - cos θ), H = (K + B (1 - z⁻¹)/(τ + T - τ z⁻¹)) z⁻ᵈ.
            let step = |n: f64| nalgebra::Complex::new((n * theta).cos(), -(n * theta).sin());
            let velocity = (1.0 - step(1.0)) / (tau + period - step(1.0) * tau);
            let torque = (velocity * damping + stiffness) * step(f64::from(samples));
            let wanted = 0.5 * period * ((1.0 - step(1.0)) * torque).re / (1.0 - theta.cos());
            prop_assert!((found - wanted).abs() < 1e-8 * least, "{found} {wanted} at {theta}");
            prop_assert!(found <= required);
        }
        let ends = numbers(&claim["witness"]["intervals"]);
        prop_assert!(ends[0] == 0.0 && ends[ends.len() - 1] == 1.0 && ends.is_sorted());
    }

    /// Any less damping, and nothing is claimed of hands; any more, and the file has a witness.
    #[test]
    fn a_witness_is_there_from_the_damping_on_that_it_names(stiffness in 0.1..100f64, damping in 0.0..1f64, share in 0.5..2f64) {
        prop_assume!((share - 1.0).abs() > 1e-6);
        let mut world = spring_and_damper(1e-3, 0, "difference", [stiffness, damping * stiffness * 1e-3]);
        let (_, proof) = proved(&world);
        let required = number(&proof["claims"][2]["required_damping"]);
        prop_assert!((required / ((0.5 + damping) * stiffness * 1e-3) - 1.0).abs() < 1e-12);
        world.device.damping = share * required;
        let (check, proof) = proved(&world);
        let passive = proof["claims"].as_array().unwrap().iter().any(|claim| claim["claim"] == "passive");
        prop_assert_eq!(passive, share > 1.0);
        prop_assert_eq!(check.certified.holds(), passive);
    }
}

#[test]
fn numbers_are_the_doubles_to_the_last_digit() {
    let (_, proof) = proved(&spring_and_damper(1e-3, 0, "difference", [0.1, 0.0]));
    let claim = &proof["claims"][2];
    assert_eq!(claim["times"]["period"], "1.000000000000000020816681711721685132943093776702880859375e-3");
    assert_eq!(claim["witness"]["laws"][0]["stiffness"], "1.000000000000000055511151231257827021181583404541015625e-1");
    assert_eq!(claim["witness"]["laws"][1]["damping"], "0");
}

#[test]
fn a_claim_of_a_theorem_without_a_witness_is_named() {
    let forward = "loop = { period = 1e-3, method = \"forward-euler\", output = \"start\" }\ndevice = { inertia = 1e-3, damping = 0.01 }\n\
        bodies.b.inertia = 0.01\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"b\"]\nstiffness = 1\n\
        [[couplings]]\nkind = \"damper\"\nbetween = [\"b\", \"ground\"]\ndamping = 0.1\n";
    let (check, proof) = proved(&world(forward));
    assert!(check.certified.holds() && proof["claims"] == serde_json::json!([]), "{proof}");
    let without: Vec<&Value> =
        proof["without_witness"].as_array().unwrap().iter().map(|claim| &claim["claim"]).collect();
    assert_eq!(without, ["held", "free", "passive"]);
}
