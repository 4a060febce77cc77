//! The words that inputs are made of: keys, units, names and the marks of TOML and CSV.

use hapt_model::UNITS;
use hapt_model::keys::{KEYS, Takes};

const MARKS: &[&str] = &[
    "=",
    " = ",
    "\n",
    "\r\n",
    "\r",
    "\t",
    "\0",
    "\u{feff}",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "\"",
    "\"\"\"",
    "'",
    "'''",
    ",",
    ".",
    "#",
    "\\",
    "\\u0000",
    "\\U0010FFFF",
    "true",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e-400",
    "0x7fffffffffffffff",
    "-9223372036854775808",
    "18446744073709551616",
    "1979-05-27T07:32:00Z",
    "1_000",
    "0b1",
    "^",
    "^2",
    "²",
    "⁻¹",
    "/",
    "·",
    "*",
    "(",
    ")",
    "°",
    "µ",
    "μ",
    "-0",
    "1 ms",
    "45 deg",
    "time_s,puck_deg\n",
    "time_s,torque_Nm\n",
    "time_s,force_N\n",
    "bodies.wheel",
    "couplings.0",
    "scenarios.turn",
    "puck",
    "ground",
    "compensating",
];

/// All of them.
pub fn words() -> Vec<String> {
    let mut words: Vec<String> =
        MARKS.iter().chain(UNITS.iter().map(|(name, _)| name)).map(|word| (*word).into()).collect();
    for key in KEYS {
        words.push(key.name().to_string());
        words.push(
            key.path.replace("bodies.*", "bodies.wheel").replace("couplings.*", "couplings.0").replace('*', "turn"),
        );
        if let Takes::Name(names) = key.takes {
            words.extend(names.iter().map(|name| format!("\"{name}\"")));
        }
    }
    words.sort();
    words.dedup();
    words
}
