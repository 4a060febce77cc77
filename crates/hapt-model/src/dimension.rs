//! Physical dimensions, including the angle, and their names.

use std::fmt;

/// The exponents of angle, length, mass and time. The angle is a base dimension: N·m/rad is a stiffness, N·m a torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dimension {
    /// Of rad.
    pub angle: i8,
    /// Of m.
    pub length: i8,
    /// Of kg.
    pub mass: i8,
    /// Of s.
    pub time: i8,
}

/// A dimension that has a name.
struct Named {
    dimension: Dimension,
    name: &'static str,
    symbol: &'static str,
    example: &'static str,
}

const fn named(dimension: Dimension, name: &'static str, symbol: &'static str, example: &'static str) -> Named {
    Named { dimension, name, symbol, example }
}

/// Every dimension of a key, and those that people give by mistake.
const NAMED: &[Named] = &[
    named(Dimension::NONE, "a plain number", "1", "1"),
    named(Dimension::ANGLE, "an angle", "rad", "45 deg"),
    named(Dimension::LENGTH, "a length", "m", "5 mm"),
    named(Dimension::TIME, "a time", "s", "1 ms"),
    named(Dimension::MASS, "a mass", "kg", "0.5 kg"),
    named(Dimension::FREQUENCY, "a frequency", "Hz", "50 Hz"),
    named(Dimension::ANGULAR_VELOCITY, "an angular velocity", "rad/s", "90 deg/s"),
    named(Dimension::VELOCITY, "a velocity", "m/s", "10 mm/s"),
    named(Dimension::ANGULAR_ACCELERATION, "an angular acceleration", "rad/s^2", "10 rad/s^2"),
    named(Dimension::ACCELERATION, "an acceleration", "m/s^2", "9.81 m/s^2"),
    named(Dimension::FORCE, "a force", "N", "2 N"),
    named(Dimension::TORQUE, "a torque", "N m", "5 N mm"),
    named(Dimension::ANGULAR_STIFFNESS, "a torsional stiffness", "N m/rad", "20 N mm/deg"),
    named(Dimension::ANGULAR_DAMPING, "a torsional damping", "N m s/rad", "1.2e-3 N m s/rad"),
    named(Dimension::STIFFNESS, "a stiffness", "N/m", "500 N/m"),
    named(Dimension::DAMPING, "a damping", "N s/m", "2 N s/m"),
    named(Dimension::INERTIA, "an inertia", "kg m^2", "6.4e-4 kg m^2"),
    named(Dimension::INERTIA_PER_ANGLE, "an inertia", "N m s^2/rad", "6.4e-4 N m s^2/rad"),
    named(Dimension::new(0, 2, 0, 0), "an area", "m^2", "1 m^2"),
    named(Dimension::new(0, 2, 1, -3), "a power", "N m/s", "1 N m/s"),
];

impl Dimension {
    /// A plain number.
    pub const NONE: Dimension = Dimension::new(0, 0, 0, 0);
    /// rad
    pub const ANGLE: Dimension = Dimension::new(1, 0, 0, 0);
    /// m
    pub const LENGTH: Dimension = Dimension::new(0, 1, 0, 0);
    /// kg
    pub const MASS: Dimension = Dimension::new(0, 0, 1, 0);
    /// s
    pub const TIME: Dimension = Dimension::new(0, 0, 0, 1);
    /// Hz = 1/s
    pub const FREQUENCY: Dimension = Dimension::new(0, 0, 0, -1);
    /// rad/s
    pub const ANGULAR_VELOCITY: Dimension = Dimension::new(1, 0, 0, -1);
    /// m/s
    pub const VELOCITY: Dimension = Dimension::new(0, 1, 0, -1);
    /// rad/s²
    pub const ANGULAR_ACCELERATION: Dimension = Dimension::new(1, 0, 0, -2);
    /// m/s²
    pub const ACCELERATION: Dimension = Dimension::new(0, 1, 0, -2);
    /// N = kg m/s²
    pub const FORCE: Dimension = Dimension::new(0, 1, 1, -2);
    /// N m; an energy (J) has it too
    pub const TORQUE: Dimension = Dimension::new(0, 2, 1, -2);
    /// N m/rad
    pub const ANGULAR_STIFFNESS: Dimension = Dimension::new(-1, 2, 1, -2);
    /// N m s/rad
    pub const ANGULAR_DAMPING: Dimension = Dimension::new(-1, 2, 1, -1);
    /// N/m
    pub const STIFFNESS: Dimension = Dimension::new(0, 0, 1, -2);
    /// N s/m
    pub const DAMPING: Dimension = Dimension::new(0, 0, 1, -1);
    /// kg m²
    pub const INERTIA: Dimension = Dimension::new(0, 2, 1, 0);
    /// N m s²/rad, the other spelling of an inertia
    pub const INERTIA_PER_ANGLE: Dimension = Dimension::new(-1, 2, 1, 0);

    /// From the exponents of rad, m, kg and s.
    pub const fn new(angle: i8, length: i8, mass: i8, time: i8) -> Dimension {
        Dimension { angle, length, mass, time }
    }

    /// Whether a quantity of dimension `given` may stand where `self` is expected: the same one, and for an inertia also
    /// the spelling with the angle, N m s²/rad.
    pub fn accepts(self, given: Dimension) -> bool {
        self == given || (self == Dimension::INERTIA && given == Dimension::INERTIA_PER_ANGLE)
    }

    /// The SI unit in a spelling that the unit parser reads: `N m/rad`, `kg m/s`, `kg/(rad s)`, `1`.
    pub fn symbol(self) -> String {
        if let Some(named) = self.named() {
            return named.symbol.to_string();
        }
        let bases = [("kg", self.mass), ("rad", self.angle), ("m", self.length), ("s", self.time)];
        let side = |sign: i16| -> Vec<String> {
            let powers =
                bases.iter().map(|&(unit, power)| (unit, i16::from(power) * sign)).filter(|&(_, power)| power > 0);
            powers.map(|(unit, power)| if power == 1 { unit.into() } else { format!("{unit}^{power}") }).collect()
        };
        let (above, below) = (side(1), side(-1));
        let numerator = if above.is_empty() { "1".to_string() } else { above.join(" ") };
        match below.len() {
            0 => numerator,
            1 => format!("{numerator}/{}", below.join(" ")),
            _ => format!("{numerator}/({})", below.join(" ")),
        }
    }

    /// A quantity of this dimension as someone might write it: `1 ms` for a time.
    pub fn example(self) -> String {
        self.named().map_or_else(|| format!("1 {}", self.symbol()), |named| named.example.to_string())
    }

    fn named(self) -> Option<&'static Named> {
        NAMED.iter().find(|named| named.dimension == self)
    }
}

/// The name of a quantity of this dimension: `a torque (N m)`, or `in kg m/s` where the dimension has no name.
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.named() {
            Some(named) if *self == Dimension::NONE => f.write_str(named.name),
            Some(named) => write!(f, "{} ({})", named.name, named.symbol),
            None => write!(f, "in {}", self.symbol()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::Unit;
    use hapt_testing::prelude::*;

    #[test]
    fn every_name_in_the_table_has_a_symbol_and_an_example_of_its_own_dimension() {
        for named in NAMED {
            let symbol = Unit::parse(named.symbol).unwrap();
            assert_eq!(symbol.dimension(), named.dimension, "{}", named.symbol);
            assert_eq!(symbol.factor(), 1.0, "{} is not SI", named.symbol);
            let example = crate::parse_quantity(named.example, named.dimension);
            assert!(example.is_ok(), "{}: {example:?}", named.example);
        }
    }

    #[test]
    fn dimensions_without_a_name_go_by_their_symbols() {
        assert_eq!(Dimension::new(0, 1, 1, -1).to_string(), "in kg m/s");
        assert_eq!(Dimension::new(-1, 0, 1, -1).symbol(), "kg/(rad s)");
        assert_eq!(Dimension::new(0, 0, 0, -2).symbol(), "1/s^2");
    }

    #[test]
    fn only_an_inertia_may_be_written_with_or_without_the_angle() {
        assert!(Dimension::INERTIA.accepts(Dimension::INERTIA_PER_ANGLE));
        assert!(!Dimension::INERTIA_PER_ANGLE.accepts(Dimension::INERTIA));
        assert!(!Dimension::TORQUE.accepts(Dimension::ANGULAR_STIFFNESS));
        assert!(!Dimension::ANGULAR_STIFFNESS.accepts(Dimension::TORQUE));
        assert!(!Dimension::FREQUENCY.accepts(Dimension::ANGULAR_VELOCITY));
    }

    proptest! {
        #[test]
        fn every_symbol_reads_back_as_its_dimension(angle in -9i8..9, length in -9i8..9, mass in -9i8..9, time in -9i8..9) {
            let dimension = Dimension::new(angle, length, mass, time);
            let unit = Unit::parse(&dimension.symbol()).unwrap();
            prop_assert_eq!(unit.dimension(), dimension);
        }
    }
}
