//! A world back as a file.

#![warn(clippy::wildcard_enum_match_arm)]

use std::fmt::{self, Write};

use hapt_core::{Coupling, End, Waveform};
use hapt_plant::spec::{Drive, FrictionByPosition, Hand, Shape};

use crate::keys::{self, COMPENSATING, DIRECTION, Measure, SAMPLES, Takes};
use crate::kinds::Motion;
use crate::numbers::{self, NumberSlot, NumberSlots};
use crate::quantity::percent;
use crate::safety::Safety;
use crate::timing::Timing;
use crate::world::{Mounting, Tolerances, World};

impl World {
    /// The world as a TOML file, quantities with their SI units: `"0.001 s"`. Reading it gives an equal world, as long as this one could be
    /// read (a world made by hand may have values that no file can) and its path files are in their places.
    pub fn to_toml(&self) -> String {
        let mut file = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut file);
        file
    }

    fn write(&self, f: &mut String) -> fmt::Result {
        if let Some(title) = &self.title {
            writeln!(f, "title = {}", text(title))?;
        }
        writeln!(f, "motion = {:?}", self.motion.name())?;

        // The numbers are borrowed mutably, and therefore from a copy.
        let mut world = self.clone();
        let mut drive = self.device.drive;
        let sampling = &self.sampling;
        writeln!(f, "\n[loop]\nmethod = {:?}\noutput = {:?}", sampling.method.name(), sampling.output.name())?;
        writeln!(f, "estimator = {:?}", sampling.estimator.name())?;
        let table = |pattern, slots| self.rows(pattern, None, None, slots);
        lines(f, table("loop", numbers::sampling(&mut world.sampling)))?;
        writeln!(f, "\n[device]")?;
        lines(f, table("device", numbers::device(&mut world.device)))?;
        if drive != Mounting::default() {
            writeln!(f, "\n[device.drive]\ndirection = {:?}", DIRECTION[usize::from(drive.reversed)])?;
            lines(f, table("device.drive", numbers::mounting(&mut drive)))?;
        }
        let mut changes = self.device.friction_by_position;
        if let Some(FrictionByPosition { waveform, .. }) = changes {
            writeln!(f, "\n[device.friction_by_position]")?;
            lines(f, table("device.friction_by_position", numbers::friction_by_position(&mut changes)))?;
            harmonics(f, &waveform)?;
        }
        let mut stribeck = self.device.stribeck;
        if stribeck.is_some() {
            writeln!(f, "\n[device.stribeck]")?;
            lines(f, table("device.stribeck", numbers::stribeck(&mut stribeck)))?;
        }
        let mut stops = self.device.stops;
        if stops.is_some() {
            writeln!(f, "\n[device.stops]")?;
            lines(f, table("device.stops", numbers::stops(&mut stops)))?;
        }
        let mut handle = self.device.handle;
        if handle.is_some() {
            writeln!(f, "\n[device.handle]")?;
            lines(f, self.rows("device.handle", None, None, numbers::handle(&mut handle)))?;
        }
        let mut torque = self.device.torque;
        if torque.gravity.is_some() {
            writeln!(f, "\n[device.gravity]")?;
            lines(f, table("device.gravity", numbers::gravity(&mut torque.gravity)))?;
        }
        if let Some(cogging) = torque.cogging {
            writeln!(f, "\n[device.cogging]")?;
            lines(f, table("device.cogging", numbers::cogging(&mut torque.cogging)))?;
            harmonics(f, &cogging.waveform)?;
        }
        if self.safety != Safety::default() {
            writeln!(f, "\n[safety]")?;
            self.safety.names().try_for_each(|(key, name)| writeln!(f, "{key} = {}", text(name)))?;
            lines(f, table("safety", numbers::safety(&mut world.safety)))?;
        }
        for (name, body) in self.names.iter().zip(&mut world.bodies) {
            writeln!(f, "\n[bodies.{name}]")?;
            lines(f, table("bodies.*", numbers::body(body)))?;
        }
        let compensating = self.compensating();
        for (place, coupling) in world.couplings.iter_mut().enumerate() {
            if !compensating.contains(&Some(place)) {
                self.write_coupling(f, coupling)?;
            }
        }
        for (compensation, _) in world.compensations.iter_mut().zip(&compensating).filter(|(_, place)| place.is_some())
        {
            writeln!(f, "\n[[compensation]]\nof = {:?}", compensation.of.name())?;
            lines(f, table("compensation.*", numbers::compensation(compensation)))?;
        }
        for scenario in &mut world.scenarios {
            writeln!(f, "\n[scenarios.{}]", scenario.name)?;
            lines(f, table("scenarios.*", vec![("duration", NumberSlot::Number(&mut scenario.duration))]))?;
            writeln!(f, "hand = {}", self.hand(&mut scenario.hand))?;
            if scenario.timing != Timing::Even {
                writeln!(f, "timing = {}", self.timing(&mut scenario.timing))?;
            }
        }
        Ok(())
    }

    fn write_coupling(&self, f: &mut String, coupling: &mut Coupling) -> fmt::Result {
        let end = |end: End| match end {
            End::Puck => "puck",
            End::Ground => "ground",
            End::Body(index) => self.names.get(index).map_or("", String::as_str),
        };
        let (first, second) = (end(coupling.first), end(coupling.second));
        let side = coupling.law.side().map(|side| ("side", side.name()));
        let word = side.or(coupling.law.is_compensating().then_some(("damping", COMPENSATING)));
        let (kind, slots) = numbers::coupling(coupling);
        writeln!(f, "\n[[couplings]]\nkind = {kind:?}\nbetween = [{first:?}, {second:?}]")?;
        if let Some((key, word)) = word {
            writeln!(f, "{key} = {}", text(word))?;
        }
        lines(f, self.rows("couplings.*", Some(kind), None, slots))?;
        // Samples are written as the harmonics that were read from them.
        coupling.law.waveform().map_or(Ok(()), |waveform| harmonics(f, waveform))
    }

    fn hand(&self, hand: &mut Hand) -> String {
        let (kind, slots) = numbers::hand(hand);
        let mut rows = vec![("kind", text(kind))];
        rows.extend(self.rows("scenarios.*.hand", Some(kind), None, slots));
        rows.extend(match &hand.drive {
            Drive::Position(shape) => file(shape),
            Drive::Torque(_) | Drive::Grip { .. } => None,
        });
        rows.extend(numbers::moves(hand).map(|moves| ("moves", self.moves(moves, kind))));
        inline(&rows)
    }

    fn timing(&self, timing: &mut Timing) -> String {
        let lists = match &*timing {
            Timing::Pattern { intervals, delays } => {
                let delays = (!delays.is_empty()).then(|| ("delays", format!("{delays:?}")));
                [Some(("intervals", format!("{intervals:?}"))), delays]
            }
            Timing::Recorded { file, .. } => [Some(("file", text(file))), None],
            Timing::Even | Timing::Random { .. } | Timing::Worst => [None, None],
        };
        let (kind, slots) = numbers::timing(timing);
        let mut rows = vec![("kind", text(kind))];
        rows.extend(self.rows("scenarios.*.timing", Some(kind), None, slots));
        rows.extend(lists.into_iter().flatten());
        inline(&rows)
    }

    fn moves(&self, shape: &mut Shape, hand: &str) -> String {
        let file = file(shape);
        let (kind, slots) = numbers::shape(shape);
        let mut rows = vec![("kind", text(kind))];
        rows.extend(self.rows("scenarios.*.hand.moves", Some(kind), Some(hand), slots));
        rows.extend(file);
        inline(&rows)
    }

    /// The tolerance of the device's number `name`.
    fn tolerance(&self, name: &str) -> f64 {
        let Tolerances { inertia, damping, friction, friction_backward, lag } = self.device.tolerances;
        let all = [
            ("inertia", inertia),
            ("damping", damping),
            ("friction", friction),
            ("friction_backward", friction_backward),
            ("lag", lag),
        ];
        all.into_iter().find(|(own, _)| *own == name).map_or(0.0, |(_, tolerance)| tolerance)
    }

    /// The keys of a table with their values, by the table of keys.
    fn rows(
        &self,
        pattern: &str,
        kind: Option<&str>,
        hand: Option<&str>,
        slots: NumberSlots<'_>,
    ) -> Vec<(&'static str, String)> {
        let row = |(name, slot): (&'static str, NumberSlot<'_>)| {
            let value = slot.get()?;
            let key = keys::rows(pattern).find(|key| key.name() == name && key.belongs(kind, hand, self.motion))?;
            let written = match key.takes {
                // A number out of its key's range represents an absent key: a grip without inertia.
                Takes::Quantity(_, range) | Takes::QuantityOr(_, range, _) if !range.contains(value) => return None,
                Takes::Quantity(measure, _) if key.tolerance && self.tolerance(name) != 0.0 => {
                    let (unit, percent) = (measure.dimension(self.motion).symbol(), percent(self.tolerance(name)));
                    format!("\"{value:?} {unit} ± {percent} %\"")
                }
                Takes::Quantity(measure, _) | Takes::QuantityOr(measure, ..) => quantity(measure, self.motion, value),
                Takes::TimeOrSamples if slot.is_in_samples() => {
                    format!("\"{value:?} {SAMPLES}\"")
                }
                Takes::TimeOrSamples => quantity(Measure::Time, self.motion, value),
                Takes::Text
                | Takes::Name(_)
                | Takes::Whole { .. }
                | Takes::Numbers { .. }
                | Takes::Ends(_)
                | Takes::Table
                | Takes::Named { .. }
                | Takes::List { .. } => format!("{value}"),
            };
            Some((name, written))
        };
        slots.into_iter().filter_map(row).collect()
    }
}

/// The key of a path's file.
fn file(shape: &Shape) -> Option<(&'static str, String)> {
    match shape {
        Shape::Path { file, .. } => Some(("file", text(file))),
        Shape::Step { .. } | Shape::Ramp { .. } | Shape::Sine { .. } => None,
    }
}

fn harmonics(f: &mut String, Waveform { sine, cosine }: &Waveform) -> fmt::Result {
    writeln!(f, "sine = {sine:?}\ncosine = {cosine:?}")
}

fn lines(f: &mut String, rows: Vec<(&str, String)>) -> fmt::Result {
    rows.iter().try_for_each(|(key, value)| writeln!(f, "{key} = {value}"))
}

fn inline(rows: &[(&str, String)]) -> String {
    let rows: Vec<String> = rows.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("{{ {} }}", rows.join(", "))
}

/// In quotes, with the shortest digits that read back to the same double.
fn quantity(measure: Measure, motion: Motion, value: f64) -> String {
    format!("\"{value:?} {}\"", measure.dimension(motion).symbol())
}

/// A TOML basic string.
pub(crate) fn text(text: &str) -> String {
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
