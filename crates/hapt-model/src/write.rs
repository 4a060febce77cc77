//! A world back as a file.

use std::fmt::{self, Write};

use hapt_core::{Coupling, Damping, End, Law};

use crate::keys::{COMPENSATING, Measure, side_name};
use crate::world::{Drive, Hand, Motion, Shape, World};

impl World {
    /// The world as a TOML file, quantities with their SI units: `"0.001 s"`. Reading it gives an equal world, as long as
    /// this one could be read (a world made by hand may hold what no file can) and its path files are where they were.
    pub fn to_toml(&self) -> String {
        let mut file = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut file);
        file
    }

    fn write(&self, f: &mut String) -> fmt::Result {
        let q = |measure: Measure, value: f64| quantity(measure, self.motion, value);
        if let Some(title) = &self.title {
            writeln!(f, "title = {}", text(title))?;
        }
        writeln!(f, "motion = {:?}", self.motion.name())?;

        let sampling = &self.sampling;
        writeln!(f, "\n[loop]\nperiod = {}", q(Measure::Time, sampling.period))?;
        writeln!(f, "method = {:?}\noutput = {:?}", sampling.method.name(), sampling.output.name())?;
        if sampling.advance != 0 {
            writeln!(f, "advance = {}", sampling.advance)?;
        }
        writeln!(f, "delay = {}", q(Measure::Time, sampling.delay))?;
        writeln!(f, "estimator = {:?}", sampling.estimator.name())?;
        if let Some(cutoff) = sampling.cutoff {
            writeln!(f, "cutoff = {}", q(Measure::Frequency, cutoff))?;
        }
        writeln!(f, "window = {}", sampling.window)?;

        let device = &self.device;
        writeln!(f, "\n[device]\ninertia = {}", q(Measure::Inertia, device.inertia))?;
        writeln!(f, "damping = {}", q(Measure::Damping, device.damping))?;
        writeln!(f, "friction = {}", q(Measure::Torque, device.friction))?;
        if let Some(limit) = device.limit {
            writeln!(f, "limit = {}", q(Measure::Torque, limit))?;
        }
        match (device.encoder, self.motion) {
            (Some(counts), Motion::Rotary) => writeln!(f, "encoder = {counts}")?,
            (Some(size), Motion::Linear) => writeln!(f, "encoder = {}", q(Measure::Position, size))?,
            (None, _) => {}
        }
        if let Some(levels) = device.levels {
            writeln!(f, "levels = {levels}")?;
        }

        for (name, body) in self.names.iter().zip(&self.bodies) {
            writeln!(f, "\n[bodies.{name}]\ninertia = {}", q(Measure::Inertia, body.inertia))?;
            writeln!(f, "position = {}", q(Measure::Position, body.position))?;
            writeln!(f, "velocity = {}", q(Measure::Velocity, body.velocity))?;
        }
        for coupling in &self.couplings {
            self.write_coupling(f, coupling)?;
        }
        for scenario in &self.scenarios {
            writeln!(f, "\n[scenarios.{}]\nduration = {}", scenario.name, q(Measure::Time, scenario.duration))?;
            writeln!(f, "hand = {}", hand(&scenario.hand, self.motion))?;
        }
        Ok(())
    }

    fn write_coupling(&self, f: &mut String, coupling: &Coupling) -> fmt::Result {
        let end = |end: End| match end {
            End::Puck => "puck",
            End::Ground => "ground",
            End::Body(index) => self.names.get(index).map_or("", String::as_str),
        };
        let (kind, keys) = law(&coupling.law, self.motion);
        writeln!(f, "\n[[couplings]]\nkind = {kind:?}")?;
        writeln!(f, "between = [{:?}, {:?}]", end(coupling.first), end(coupling.second))?;
        for (key, value) in keys {
            writeln!(f, "{key} = {value}")?;
        }
        Ok(())
    }
}

/// A law's kind, and its keys with their values.
fn law(law: &Law, motion: Motion) -> (&'static str, Vec<(&'static str, String)>) {
    let q = |measure: Measure, value: f64| quantity(measure, motion, value);
    match *law {
        Law::Spring { stiffness, rest } => {
            ("spring", vec![("stiffness", q(Measure::Stiffness, stiffness)), ("rest", q(Measure::Position, rest))])
        }
        Law::Damper { damping: Damping::Fixed(damping) } => ("damper", vec![("damping", q(Measure::Damping, damping))]),
        Law::Damper { damping: Damping::Compensating } => ("damper", vec![("damping", text(COMPENSATING))]),
        Law::Wall { side, at, stiffness, damping } => (
            "wall",
            vec![
                ("side", text(side_name(side))),
                ("at", q(Measure::Position, at)),
                ("stiffness", q(Measure::Stiffness, stiffness)),
                ("damping", q(Measure::Damping, damping)),
            ],
        ),
        Law::Detent { torque, pitch, phase } => (
            "detent",
            vec![
                ("torque", q(Measure::Torque, torque)),
                ("pitch", q(Measure::Position, pitch)),
                ("phase", q(Measure::Position, phase)),
            ],
        ),
        Law::Coulomb { torque } => ("friction", vec![("torque", q(Measure::Torque, torque))]),
        Law::Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous } => (
            "friction",
            vec![
                ("coulomb", q(Measure::Torque, coulomb)),
                ("stribeck", q(Measure::Torque, stribeck)),
                ("stribeck_velocity", q(Measure::Velocity, stribeck_velocity)),
                ("bristle_stiffness", q(Measure::Stiffness, bristle_stiffness)),
                ("bristle_damping", q(Measure::Damping, bristle_damping)),
                ("viscous", q(Measure::Damping, viscous)),
            ],
        ),
        Law::Constant { torque } => ("constant", vec![("torque", q(Measure::Torque, torque))]),
    }
}

fn hand(hand: &Hand, motion: Motion) -> String {
    let q = |measure: Measure, value: f64| quantity(measure, motion, value);
    let mut keys = match &hand.drive {
        Drive::Position(moves) => shape(moves, Measure::Position, motion),
        Drive::Torque(moves) => {
            vec![("kind", text("torque")), ("moves", inline(&shape(moves, Measure::Torque, motion)))]
        }
        Drive::Grip { inertia, damping, stiffness, moves } => {
            let mut keys = vec![("kind", text("grip"))];
            // No inertia is no key: where the key stands, it is positive.
            if *inertia != 0.0 {
                keys.push(("inertia", q(Measure::Inertia, *inertia)));
            }
            keys.push(("damping", q(Measure::Damping, *damping)));
            keys.push(("stiffness", q(Measure::Stiffness, *stiffness)));
            keys.push(("moves", inline(&shape(moves, Measure::Position, motion))));
            keys
        }
    };
    keys.extend(hand.release.map(|release| ("release", q(Measure::Time, release))));
    inline(&keys)
}

/// A shape's keys, its kind first; `measure` is what moves.
fn shape(shape: &Shape, measure: Measure, motion: Motion) -> Vec<(&'static str, String)> {
    let q = |measure: Measure, value: f64| quantity(measure, motion, value);
    match shape {
        Shape::Step { to, at } => {
            vec![("kind", text("step")), ("to", q(measure, *to)), ("at", q(Measure::Time, *at))]
        }
        Shape::Ramp { to, at, over } => vec![
            ("kind", text("ramp")),
            ("to", q(measure, *to)),
            ("at", q(Measure::Time, *at)),
            ("over", q(Measure::Time, *over)),
        ],
        Shape::Sine { amplitude, frequency, phase } => vec![
            ("kind", text("sine")),
            ("amplitude", q(measure, *amplitude)),
            ("frequency", q(Measure::Frequency, *frequency)),
            ("phase", q(Measure::Angle, *phase)),
        ],
        Shape::Path { file, .. } => vec![("kind", text("path")), ("file", text(file))],
    }
}

fn inline(keys: &[(&str, String)]) -> String {
    let keys: Vec<String> = keys.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("{{ {} }}", keys.join(", "))
}

/// In quotes, with the shortest digits that read back to the same double.
fn quantity(measure: Measure, motion: Motion, value: f64) -> String {
    format!("\"{value:?} {}\"", measure.dimension(motion).symbol())
}

/// A TOML basic string.
fn text(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
