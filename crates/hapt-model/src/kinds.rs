//! The kinds of motions, estimators, hands, shapes and timings, each with its name in world files.
//!
//! The table of keys takes its names from here, and the reader, the writer and all other code that names a kind match on these: a new kind
//! does not compile before each of them has an arm for it.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_plant::spec::{Drive, Shape};

hapt_core::named! {
    /// Whether the puck turns or slides.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Motion {
        /// Angles in rad, torques in N·m, inertias in kg·m².
        #[default]
        Rotary => "rotary",
        /// Positions in m, forces in N, masses in kg.
        Linear => "linear",
    }
}

hapt_core::named! {
    /// The estimators by name; their parameters are separate keys, as in the file.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum EstimatorKind {
        /// The true velocity.
        #[default]
        Exact => "exact",
        /// The backward difference, over one sample or over `every` samples.
        Difference => "difference",
        /// The backward difference through a first-order low-pass.
        LowPass => "low-pass",
        /// First-order adaptive windowing, end-fit.
        Foaw => "foaw",
        /// First-order adaptive windowing, best fit.
        FoawBest => "foaw-best",
        /// The steady Kalman filter of constant acceleration.
        Kalman => "kalman",
        /// Levant's differentiator, of first order, with an implicit step.
        Levant => "levant",
    }
}

hapt_core::named! {
    /// The torques of a device that a loop may compensate.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Compensated {
        /// That of the weight.
        Gravity => "gravity",
        /// That of the motor's poles.
        Cogging => "cogging",
        /// That of bearings, brushes and cables.
        Friction => "friction",
        /// What the inertia of the puck takes to accelerate.
        Inertia => "inertia",
    }
}

hapt_core::named! {
    /// The kinds of hands: the shapes that prescribe the puck's position, and those that have their shape in `moves`.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum HandKind {
        /// [`Shape::Step`] of the puck.
        Step => "step",
        /// [`Shape::Ramp`] of the puck.
        Ramp => "ramp",
        /// [`Shape::Sine`] of the puck.
        Sine => "sine",
        /// [`Shape::Path`] of the puck.
        Path => "path",
        /// [`Drive::Torque`]
        Torque => "torque",
        /// [`Drive::Grip`]
        Grip => "grip",
    }
}

hapt_core::named! {
    /// The kinds of shapes.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum ShapeKind {
        /// [`Shape::Step`]
        Step => "step",
        /// [`Shape::Ramp`]
        Ramp => "ramp",
        /// [`Shape::Sine`]
        Sine => "sine",
        /// [`Shape::Path`]
        Path => "path",
    }
}

impl HandKind {
    /// The kind of a hand.
    pub const fn of(drive: &Drive) -> Self {
        match drive {
            Drive::Position(shape) => match ShapeKind::of(shape) {
                ShapeKind::Step => HandKind::Step,
                ShapeKind::Ramp => HandKind::Ramp,
                ShapeKind::Sine => HandKind::Sine,
                ShapeKind::Path => HandKind::Path,
            },
            Drive::Torque(_) => HandKind::Torque,
            Drive::Grip { .. } => HandKind::Grip,
        }
    }
}

impl ShapeKind {
    /// The kind of a shape.
    pub const fn of(shape: &Shape) -> Self {
        match shape {
            Shape::Step { .. } => ShapeKind::Step,
            Shape::Ramp { .. } => ShapeKind::Ramp,
            Shape::Sine { .. } => ShapeKind::Sine,
            Shape::Path { .. } => ShapeKind::Path,
        }
    }
}

#[cfg(test)]
mod tests {
    use hapt_core::spec::CouplingKind;

    use crate::keys::{self, Presence, Takes};
    use crate::{Motion, Source, World};

    /// A world with a coupling of this kind, which has all keys that the table requires.
    fn with(kind: CouplingKind) -> String {
        let rows = keys::rows("couplings.*").filter(|row| row.belongs(Some(kind.name()), None, Motion::Rotary));
        let mut text =
            format!("[loop]\nperiod = 0.001\n[device]\ninertia = 1e-3\n[[couplings]]\nkind = {:?}\n", kind.name());
        for row in rows.filter(|row| row.presence == Presence::Required && row.name() != "kind") {
            let value = match row.takes {
                Takes::Ends(_) => "[\"puck\", \"ground\"]".into(),
                Takes::Name(names) => format!("{:?}", names[0]),
                Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples | Takes::Whole { .. } => "1".into(),
                Takes::Text | Takes::Numbers { .. } | Takes::Table | Takes::Named { .. } | Takes::List { .. } => {
                    panic!("{}", row.path)
                }
            };
            text += &format!("{} = {value}\n", row.name());
        }
        // Keys that depend on other keys.
        if kind == CouplingKind::Friction {
            text += "torque = 1\n";
        }
        if kind == CouplingKind::Texture {
            text += "sine = [1]\n";
        }
        text
    }

    #[test]
    fn a_coupling_of_each_kind_is_read_as_a_law_of_that_kind() {
        for kind in CouplingKind::ALL {
            let world = World::read(&Source::from_text("w.toml", with(kind)), &[]).unwrap();
            assert_eq!(world.couplings[0].law.kind(), kind);
        }
        assert_eq!(CouplingKind::from_name("rubber"), None);
    }

    /// The core's own names and ranges are those of the table of keys.
    #[test]
    fn every_number_of_a_law_has_its_key() {
        for kind in CouplingKind::ALL {
            let row = |name: &str| {
                keys::rows("couplings.*")
                    .find(|row| row.name() == name && row.belongs(Some(kind.name()), None, Motion::Rotary))
            };
            let world = World::read(&Source::from_text("w.toml", with(kind)), &[]).unwrap();
            let mut law = world.couplings[0].law;
            assert_eq!(row("limit").is_some(), law.takes_limit(), "{}", kind.name());
            for quantity in law.quantities() {
                let range = row(quantity.name).and_then(|row| row.takes.quantity()).map(|(_, range)| range);
                let wanted = Some(format!("{:?}", quantity.range));
                assert_eq!(range.map(|range| format!("{range:?}")), wanted, "{} of {}", quantity.name, kind.name());
            }
        }
    }
}

hapt_core::named! {
    /// The kinds of timing, of a scenario.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum TimingKind {
        /// [`crate::Timing::Even`]
        #[default]
        Even => "even",
        /// [`crate::Timing::Random`]
        Random => "random",
        /// [`crate::Timing::Pattern`]
        Pattern => "pattern",
        /// [`crate::Timing::Recorded`]
        Recorded => "recorded",
        /// [`crate::Timing::Worst`]
        Worst => "worst",
    }
}
