//! Regular expressions for quantities, by which editors know a wrong unit before hapt sees the file.
//!
//! An expression cannot add exponents up. It can list, though, what is written when nothing stands twice: one unit that
//! carries mass (kg, N, N m), one of length, one of time, one of angle, each with a power of ±1 or ±2, in any order. For those
//! [`plain`] takes the right dimension and no other. Everything else that reads, such as `N mm/(deg/s^2)` or `m/s/s`, is
//! [`unusual`], where the dimension is left to the reader. Together they take whatever the reader takes.

use crate::dimension::Dimension;
use crate::keys::Range;
use crate::unit::UNITS;

const NUMBER: &str = r"^\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?";
const POWER: &str = r"(?: *\^[+-]?[0-9]+|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)";
/// All powers but 2, -1 and -2.
const OTHER_POWER: &str =
    r"(?: *\^(?:\+[0-9]+|1|-?0[0-9]*|-?[3-9][0-9]*|-?[12][0-9]+)|¹|⁻?[⁰³⁴⁵⁶⁷⁸⁹][⁰¹²³⁴⁵⁶⁷⁸⁹]*|⁻?[¹²][⁰¹²³⁴⁵⁶⁷⁸⁹]+)";
/// What stands between units, parentheses among it.
const BETWEEN: &str = r"[ ·⋅*/()]";

/// A unit in a product, and its power.
#[derive(Clone, Copy)]
struct Factor {
    dimension: Dimension,
    power: i8,
}

/// What takes a number and a unit of the dimension `wanted`, where no base stands twice.
pub(crate) fn plain(wanted: Dimension) -> String {
    // Hz and rpm, which stand in no product.
    let rate = names(|dimension| dimension == wanted && !is_factor(dimension));
    let mut spellings = vec![format!(" *{rate}")];
    let other = Dimension::INERTIA_PER_ANGLE;
    for dimension in [wanted, other].into_iter().filter(|&d| d == wanted || wanted.accepts(d)) {
        spellings.extend(products(dimension).iter().map(|factors| in_any_order(factors, true)));
    }
    spellings.retain(|spelling| spelling != " *(?:)");
    format!(r"{NUMBER}(?:{}) *$", spellings.join("|"))
}

/// What takes a number and units of any dimension, where `plain` cannot tell: parentheses, a base twice, Hz or rpm beside
/// others, a power such as 3, a 1 in between.
pub(crate) fn unusual() -> String {
    let name = names(|_| true);
    let closed = format!("{name}(?:{POWER}{BETWEEN}*|{BETWEEN}+)");
    let item = format!("(?:{closed}|1{POWER}?{BETWEEN}*)");
    let rest = format!("{item}*{name}?");
    let after = format!("(?:(?:{POWER}{BETWEEN}*|{BETWEEN}+){rest})?");
    // A 1 directly after the number is a digit of it.
    let something = format!(r"(?: *{closed}{item}*| +{item}+| *[/(]{BETWEEN}*{item}*)");
    let anything = format!(r"(?:{something}| *)");

    let mut features = vec![
        format!(r"{anything}{name}?{BETWEEN}*\({BETWEEN}*{rest}{BETWEEN}*"),
        format!("{anything}{name}{OTHER_POWER}{BETWEEN}*{rest}"),
        format!("{anything}{name}{POWER}{name}{after}"),
        format!("{something}1{POWER}?{BETWEEN}*{rest}"),
        format!(r" +1(?:{POWER}{BETWEEN}*| *[·⋅*]{BETWEEN}*| *)(?:{item}+{name}?|{name})"),
    ];
    let carries = |has: fn(Dimension) -> bool| names(|dimension| is_factor(dimension) && has(dimension));
    let bases: [fn(Dimension) -> bool; 4] =
        [|d| d.mass != 0, |d| d == Dimension::LENGTH, |d| d == Dimension::TIME, |d| d == Dimension::ANGLE];
    for base in bases.map(carries) {
        features.push(format!("{anything}{base}(?:{POWER}{BETWEEN}*|{BETWEEN}+){item}*{base}{after}"));
    }
    let rate = names(|dimension| !is_factor(dimension));
    features.push(format!("{something}{rate}{after}"));
    features.push(format!(r" *{rate}(?:{POWER}{BETWEEN}*{rest}|{BETWEEN}+(?:{item}+{name}?|{name}))"));
    // Other blanks than the space: tabs, and those of typesetters. In every place above they would make the whole three times
    // as long, and slow to compile.
    features.push(r"[\s\S]*[^\S ][\s\S]*".to_string());
    format!(r"{NUMBER}(?:{}) *$", features.join("|"))
}

/// What takes a number of samples, 0 or more.
pub(crate) fn samples() -> String {
    let number = NUMBER.replace("[+-]?(?:[0-9]+\\.", "\\+?(?:[0-9]+\\.");
    format!(r"{number}\s*samples?\s*$")
}

/// What takes a quantity with a tolerance; its units are left to the reader.
pub(crate) fn tolerated() -> String {
    format!(r"{NUMBER}.*(?:±|\+/?-)\s*\+?[0-9.]")
}

/// What takes texts whose number, at their beginning, is in this range; `None`: all are.
pub(crate) fn number_in(range: Range) -> Option<&'static str> {
    match range {
        Range::Any => None,
        Range::ZeroOrMore => Some(r"^\s*(?:[+.0-9]|-[.0]+(?:[^.0-9]|$))"),
        Range::Positive => Some(r"^\s*\+?[.0-9]*[1-9]"),
    }
}

/// Whether a unit stands in plain products: it carries mass, or is of length, time or angle.
fn is_factor(dimension: Dimension) -> bool {
    dimension.mass != 0 || [Dimension::LENGTH, Dimension::TIME, Dimension::ANGLE].contains(&dimension)
}

fn names(of: impl Fn(Dimension) -> bool) -> String {
    let names: Vec<&str> = UNITS.iter().filter(|(_, unit)| of(unit.dimension())).map(|(name, _)| *name).collect();
    format!("(?:{})", names.join("|"))
}

/// The products that give `wanted`, every base written once.
fn products(wanted: Dimension) -> Vec<Vec<Factor>> {
    let mut carriers = vec![Dimension::NONE];
    for (_, unit) in UNITS {
        if unit.dimension().mass != 0 && !carriers.contains(&unit.dimension()) {
            carriers.push(unit.dimension());
        }
    }
    let product = |carrier: Dimension| {
        let bases = [
            (carrier, i8::from(carrier != Dimension::NONE)),
            (Dimension::LENGTH, wanted.length - carrier.length),
            (Dimension::TIME, wanted.time - carrier.time),
            (Dimension::ANGLE, wanted.angle - carrier.angle),
        ];
        let factors = bases.map(|(dimension, power)| Factor { dimension, power });
        let factors: Vec<Factor> = factors.into_iter().filter(|factor| factor.power != 0).collect();
        let right = carrier.mass == wanted.mass && factors.iter().all(|factor| factor.power.abs() <= 2);
        right.then_some(factors)
    };
    carriers.into_iter().filter_map(product).collect()
}

fn in_any_order(factors: &[Factor], first: bool) -> String {
    let orders: Vec<String> = (0..factors.len())
        .map(|index| {
            let mut others = factors.to_vec();
            let factor = others.remove(index);
            let (unit, inverse) = (written(factor.dimension, factor.power), written(factor.dimension, -factor.power));
            let here = match first {
                true => format!(r"(?: *{unit}|(?: +1)? */ *{inverse})"),
                false => format!(r"(?:(?: *[·⋅*] *| +){unit}| */ *{inverse})"),
            };
            if others.is_empty() { here } else { here + &in_any_order(&others, false) }
        })
        .collect();
    if let [order] = orders.as_slice() { order.clone() } else { format!("(?:{})", orders.join("|")) }
}

fn written(dimension: Dimension, power: i8) -> String {
    let power = match power {
        2 => r"(?: *\^2|²)",
        -1 => r"(?: *\^-1|⁻¹)",
        -2 => r"(?: *\^-2|⁻²)",
        _ => "",
    };
    names(|of| of == dimension) + power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;
    use jsonschema::Validator;
    use proptest::prelude::*;
    use serde_json::json;
    use std::sync::LazyLock;

    /// The dimensions that keys want.
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

    fn compiled(pattern: &str) -> Validator {
        jsonschema::draft7::new(&json!({ "pattern": pattern })).unwrap()
    }

    fn takes(pattern: &Validator, text: &str) -> bool {
        pattern.is_valid(&json!(text))
    }

    static PLAIN: LazyLock<[Validator; 14]> = LazyLock::new(|| WANTED.map(|wanted| compiled(&plain(wanted))));
    static UNUSUAL: LazyLock<Validator> = LazyLock::new(|| compiled(&unusual()));

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
        let range = |range| compiled(number_in(range).unwrap());
        let (positive, not_negative) = (range(Range::Positive), range(Range::ZeroOrMore));
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

        /// And a wrong unit is marked where every base stands once.
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
}
