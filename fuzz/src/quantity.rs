//! Quantities and units, with each dimension expected.

use std::mem::discriminant;

use hapt_model::{Dimension, Fault, Quantity, Unit, parse_quantity};

use crate::messages::outcome;

const WANTED: [Dimension; 9] = [
    Dimension::NONE,
    Dimension::ANGLE,
    Dimension::TIME,
    Dimension::FREQUENCY,
    Dimension::TORQUE,
    Dimension::ANGULAR_STIFFNESS,
    Dimension::ANGULAR_DAMPING,
    Dimension::INERTIA,
    Dimension::LENGTH,
];

/// A parsed quantity is finite, and its dimension's own symbol parses as that dimension; an error is short.
pub fn run(bytes: &[u8]) -> u64 {
    let (&first, rest) = bytes.split_first().unwrap_or((&0, &[]));
    let text = String::from_utf8_lossy(rest);
    let wanted = WANTED[usize::from(first) % WANTED.len()];
    if let Ok(unit) = Unit::parse(&text) {
        let symbol = unit.dimension().symbol();
        let again = Unit::parse(&symbol).unwrap_or_else(|fault| panic!("{symbol}: {fault}"));
        assert_eq!(again.dimension(), unit.dimension(), "{symbol}");
    }
    let plain = Quantity::parse(&text);
    if let Ok(quantity) = &plain {
        assert!(quantity.value.is_finite());
    }
    match parse_quantity(&text, wanted) {
        Ok(value) => {
            assert_eq!(plain.map(|quantity| quantity.value.to_bits()), Ok(value.to_bits()));
            outcome(&(wanted, value == 0.0, value > 0.0))
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 1000, "{} bytes of message", message.len());
            assert!(message.chars().all(|c| !c.is_control()), "control characters in {message:?}");
            let unit = if let Fault::Unit(unit) = &error.fault { Some(discriminant(unit)) } else { None };
            outcome(&(discriminant(&error.fault), unit))
        }
    }
}
