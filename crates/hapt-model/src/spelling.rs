//! Regular expressions for quantities, by which editors detect a wrong unit before hapt reads the file.
//!
//! An expression cannot add exponents up. It can list, though, the spellings in which no base occurs twice: one unit that carries mass
//! (kg, N, N m), one of length, one of time, one of angle, each with a power of ±1 or ±2, in any order. For those [`plain`] takes the
//! right dimension and no other. Everything else that reads, such as `N mm/(deg/s^2)` or `m/s/s`, is [`unusual`], where the dimension
//! is left to the reader. Together they take everything that the reader takes.

use crate::dimension::Dimension;
use crate::keys::Range;
use crate::unit::UNITS;

const NUMBER: &str = r"^\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?";
const POWER: &str = r"(?: *\^[+-]?[0-9]+|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)";
/// All powers but 2, -1 and -2.
const OTHER_POWER: &str =
    r"(?: *\^(?:\+[0-9]+|1|-?0[0-9]*|-?[3-9][0-9]*|-?[12][0-9]+)|¹|⁻?[⁰³⁴⁵⁶⁷⁸⁹][⁰¹²³⁴⁵⁶⁷⁸⁹]*|⁻?[¹²][⁰¹²³⁴⁵⁶⁷⁸⁹]+)";
/// The characters between units, including parentheses.
const BETWEEN: &str = r"[ ·⋅*/()]";

/// A unit in a product, and its power.
#[derive(Clone, Copy)]
struct Factor {
    dimension: Dimension,
    power: i8,
}

/// The expression for a number and a unit of the dimension `wanted`, where no base occurs twice.
pub(crate) fn plain(wanted: Dimension) -> String {
    // Hz and rpm, which occur in no product.
    let rate = names(|dimension| dimension == wanted && !is_factor(dimension));
    let mut spellings = vec![format!(" *{rate}")];
    let other = Dimension::INERTIA_PER_ANGLE;
    for dimension in [wanted, other].into_iter().filter(|&d| d == wanted || wanted.accepts(d)) {
        spellings.extend(products(dimension).iter().map(|factors| in_any_order(factors, true)));
    }
    spellings.retain(|spelling| spelling != " *(?:)");
    format!(r"{NUMBER}(?:{}) *$", spellings.join("|"))
}

/// The expression for a number and units of any dimension, where `plain` cannot decide: parentheses, a base twice, Hz or rpm with other
/// units, a power such as 3, a 1 in between.
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
    features.push(format!("{anything}(?:counts?|ticks?){after}"));
    // Other blanks than the space: tabs, and those of typesetters. In every place above they would make the whole three times
    // as long, and slow to compile.
    features.push(r"[\s\S]*[^\S ][\s\S]*".to_string());
    format!(r"{NUMBER}(?:{}) *$", features.join("|"))
}

/// The expression for a number of samples, 0 or more.
pub(crate) fn samples() -> String {
    let number = NUMBER.replace("[+-]?(?:[0-9]+\\.", "\\+?(?:[0-9]+\\.");
    format!(r"{number}\s*samples?\s*$")
}

/// The expression for a quantity with a tolerance; its units are left to the reader.
pub(crate) fn tolerated() -> String {
    format!(r"{NUMBER}.*(?:±|\+/?-)\s*\+?[0-9.]")
}

/// The expression for texts whose number, at their beginning, is in this range; `None`: all are.
pub(crate) fn number_in(range: Range) -> Option<&'static str> {
    match range {
        Range::Any => None,
        Range::ZeroOrMore | Range::Share => Some(r"^\s*(?:[+.0-9]|-[.0]+(?:[^.0-9]|$))"),
        Range::Positive => Some(r"^\s*\+?[.0-9]*[1-9]"),
    }
}

/// Whether a unit occurs in plain products: it carries mass, or is of length, time or angle.
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
