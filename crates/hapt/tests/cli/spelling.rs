//! The schema's regular expressions for quantities: an editor marks a wrong unit, and nothing that hapt reads.

use std::sync::LazyLock;

use hapt_model::{Dimension, Quantity, schema};
use hapt_testing::prelude::*;
use jsonschema::Validator;
use serde_json::{Value, json};

/// The dimensions of keys.
const WANTED: [Dimension; 14] = [
    Dimension::ANGLE,
    Dimension::LENGTH,
    Dimension::TIME,
    Dimension::MASS,
    Dimension::FREQUENCY,
    Dimension::ANGULAR_VELOCITY,
    Dimension::VELOCITY,
    Dimension::FORCE,
    Dimension::TORQUE,
    Dimension::ANGULAR_STIFFNESS,
    Dimension::ANGULAR_DAMPING,
    Dimension::STIFFNESS,
    Dimension::DAMPING,
    Dimension::INERTIA,
];

static SCHEMA: LazyLock<Value> = LazyLock::new(|| serde_json::from_str(&schema()).unwrap());

/// A validator of the schema at this place.
fn compiled(pointer: &str) -> Validator {
    jsonschema::draft7::new(SCHEMA.pointer(pointer).unwrap_or_else(|| panic!("no {pointer}"))).unwrap()
}

/// The validator of the plain spellings of this dimension: "a torsional stiffness (N m/rad)" is defined as torsional-stiffness.
fn plain(wanted: Dimension) -> Validator {
    let called = wanted.to_string();
    let (name, _) = called.split_once(' ').unwrap().1.split_once(" (").unwrap();
    compiled(&format!("/definitions/{}/anyOf/0", name.replace(' ', "-")))
}

fn takes(pattern: &Validator, text: &str) -> bool {
    pattern.is_valid(&json!(text))
}

static PLAIN: LazyLock<[Validator; 14]> = LazyLock::new(|| WANTED.map(plain));
static UNUSUAL: LazyLock<Validator> = LazyLock::new(|| compiled("/definitions/unusual"));

#[test]
fn plain_spellings_are_of_their_own_dimension_only() {
    let table = [
        ("1 ms", Dimension::TIME),
        ("45°", Dimension::ANGLE),
        (" -1.5e-3 rev ", Dimension::ANGLE),
        ("822.25 N mm", Dimension::TORQUE),
        ("5 mNm", Dimension::TORQUE),
        ("1 J", Dimension::TORQUE),
        ("1 kg m^2/s^2", Dimension::TORQUE),
        ("17.8 N mm/deg", Dimension::ANGULAR_STIFFNESS),
        ("17.8 N·mm/deg", Dimension::ANGULAR_STIFFNESS),
        ("1 N rad^-1 m", Dimension::ANGULAR_STIFFNESS),
        ("1.2e-3 N m s/rad", Dimension::ANGULAR_DAMPING),
        ("1.2e-3Nms/rad", Dimension::NONE),
        ("1 N m/rad s", Dimension::ANGULAR_DAMPING),
        ("6.4e-4 kg m²", Dimension::INERTIA),
        ("30 g cm^2", Dimension::INERTIA),
        ("0.4 N mm s^2/deg", Dimension::INERTIA),
        ("500 N/m", Dimension::STIFFNESS),
        ("50 /s", Dimension::FREQUENCY),
        ("50 1/s", Dimension::FREQUENCY),
        ("50/s", Dimension::FREQUENCY),
        ("90 deg/s", Dimension::ANGULAR_VELOCITY),
        ("60 rpm", Dimension::ANGULAR_VELOCITY),
        ("2 kHz", Dimension::FREQUENCY),
        ("21 kg", Dimension::MASS),
        ("111kg", Dimension::MASS),
        ("5 mm", Dimension::LENGTH),
        ("5", Dimension::NONE),
        ("5 sek", Dimension::NONE),
        ("1 kg m2", Dimension::NONE),
        ("ms", Dimension::NONE),
    ];
    for (text, dimension) in table {
        for (wanted, plain) in WANTED.iter().zip(PLAIN.iter()) {
            assert_eq!(takes(plain, text), *wanted == dimension, "{text} for {wanted}");
        }
        assert!(!takes(&UNUSUAL, text), "{text}");
    }
}

#[test]
fn numbers_out_of_range_are_known_by_their_digits() {
    let device =
        |key: &str| compiled(&format!("/definitions/rotary/properties/device/properties/{key}/anyOf/0/allOf/0"));
    let (positive, not_negative) = (device("inertia"), device("damping"));
    for (text, is_positive, is_not_negative) in [
        ("1 ms", true, true),
        ("+0.05ms", true, true),
        ("0 ms", false, true),
        ("0.00e5 ms", false, true),
        ("-0 ms", false, true),
        ("-0.0", false, true),
        ("-1 ms", false, false),
        ("-0.1 ms", false, false),
        ("-00.001 ms", false, false),
    ] {
        assert_eq!(takes(&positive, text), is_positive, "{text}");
        assert_eq!(takes(&not_negative, text), is_not_negative, "{text}");
    }
}

/// A unit of one of the names, with some power.
fn factor(names: &'static [&'static str], powers: &'static [&'static str]) -> impl Strategy<Value = String> {
    (prop::sample::select(names), prop::sample::select(powers)).prop_map(|(name, power)| format!("{name}{power}"))
}

fn any(names: &'static [&'static str]) -> impl Strategy<Value = String> {
    factor(names, &["", "", "", "^2", "²", "^-1", "⁻¹", " ^-2", "^3", "^1", "^0", "^12", "^+1", "⁻³"])
}

fn usual(names: &'static [&'static str]) -> impl Strategy<Value = Option<String>> {
    prop::option::of(factor(names, &["", "", "^2", "²", "^-1", "⁻¹", " ^-2", "⁻²"]))
}

fn between() -> impl Strategy<Value = &'static str> {
    prop::sample::select(vec![" ", "\u{202f}", "·", " * ", "/", " / ", "/(", ") ", ")", "(", "/1/", " 1 ", ""])
}

proptest! {
    /// So no editor marks a quantity that hapt reads.
    #[test]
    fn whatever_reads_is_taken(
        start in prop::sample::select(vec!["5", "5 ", "\t5 ", "5\u{a0}", "-.5e-3 ", "1 1/", "21 ", "5/", "5(", "5 1 "]),
        first in any(&["N", "kg", "m", "s", "rad", "Hz", "rpm", "J", "µs", "Nmm", "°", "1"]),
        rest in prop::collection::vec(
            (between(), any(&["N", "g", "mm", "s", "deg", "kHz", "rpm", "mNm", "m", "1"])), 0..5),
        end in prop::sample::select(vec!["", "", " ", ")"]),
    ) {
        let rest: String = rest.into_iter().map(|(between, factor)| format!("{between}{factor}")).collect();
        let text = format!("{start}{first}{rest}{end}");
        if let Ok(Quantity { dimension: Some(given), .. }) = Quantity::parse(&text) {
            for (wanted, plain) in WANTED.iter().zip(PLAIN.iter()).filter(|(wanted, _)| wanted.accepts(given)) {
                prop_assert!(takes(plain, &text) || takes(&UNUSUAL, &text), "{} for {}", text, wanted);
            }
        }
    }

    /// A wrong unit is marked where every base occurs once.
    #[test]
    fn where_every_base_stands_once_the_dimension_decides(
        mass in usual(&["N", "mN", "kg", "Nmm"]),
        length in usual(&["mm", "m"]),
        time in usual(&["s", "ms"]),
        angle in usual(&["deg", "rad"]),
        order in Just([0, 1, 2, 3]).prop_shuffle(),
        separators in prop::collection::vec(prop::sample::select(vec![" ", "·", "/", " / "]), 4),
    ) {
        let factors = [mass, length, time, angle];
        let chosen: Vec<&String> = order.iter().filter_map(|&index| factors[index].as_ref()).collect();
        if chosen.is_empty() {
            return Ok(());
        }
        let mut text = "5 ".to_string();
        for (index, factor) in chosen.iter().enumerate() {
            text += if index > 0 { separators[index] } else { "" };
            text += factor;
        }
        let given = Quantity::parse(&text).unwrap().dimension.unwrap();
        prop_assert!(!takes(&UNUSUAL, &text), "{}", text);
        for (wanted, plain) in WANTED.iter().zip(PLAIN.iter()) {
            prop_assert_eq!(takes(plain, &text), wanted.accepts(given), "{} for {}", text, wanted);
        }
    }
}
