//! Every number of a system under its key's name, for sweeps and for the writer.

use std::fmt::{self, Write};

use hapt_core::Law;

use crate::keys::{self, Key};
use crate::numbers::NumberSlot::{Number, Optional, Whole};
use crate::numbers::NumberSlots;
use crate::write::text;

use super::{Link, Station, System};

/// A clock's drift is in millionths in files.
pub(super) const MILLIONTH: f64 = 1e-6;

/// A link's kind and its numbers.
fn numbers(link: &mut Link) -> (&'static str, NumberSlots<'_>) {
    let mut slots = vec![
        ("damping", Number(&mut link.damping)),
        ("limit", Optional(&mut link.limit)),
        ("period", Optional(&mut link.period)),
        ("delay", Number(&mut link.delay)),
        ("delay_max", Optional(&mut link.delay_max)),
        ("loss", Number(&mut link.loss)),
        ("duplicate", Number(&mut link.duplicate)),
        ("seed", Whole(&mut link.seed)),
        ("age_max", Number(&mut link.age_max)),
    ];
    let kind = if let Law::Wall { .. } = link.law { "wall" } else { "spring" };
    slots.extend(link.law.quantities().filter(|of| of.name != "damping").map(|of| (of.name, Number(of.value))));
    (kind, slots)
}

impl Station {
    fn number(&self, key: &str) -> Option<f64> {
        match key {
            // A world file has no clock but its own.
            "phase" | "drift" if self.name.is_empty() => None,
            "phase" => Some(self.phase),
            "drift" => Some(self.drift / MILLIONTH),
            "loop.interval_max" => self.interval_max,
            key => self.world.number(key),
        }
    }

    fn set_number(&mut self, key: &str, value: f64) -> bool {
        self.world.sampling.interval_max = self.interval_max;
        let is_set = match key {
            "phase" | "drift" if self.name.is_empty() => false,
            "phase" => Number(&mut self.phase).set(value),
            "drift" => Number(&mut self.drift).set(MILLIONTH * value),
            key => self.world.set_number(key, value),
        };
        self.interval_max = self.world.sampling.interval_max;
        self.follow_clock();
        is_set
    }
}

impl System {
    /// The station's number and the rest of the path, for a dotted path to a key of a station, or of its world.
    fn of_station<'p>(&self, path: &'p str) -> Option<(usize, &'p str)> {
        if self.world().is_some() {
            return Some((0, path));
        }
        let (name, key) = path.strip_prefix("stations.")?.split_once('.')?;
        Some((self.stations.iter().position(|station| station.name == name)?, key))
    }

    /// The same of a key of a link.
    fn of_link<'p>(&self, path: &'p str) -> Option<(usize, &'p str)> {
        let (index, key) = path.strip_prefix("links.")?.split_once('.')?;
        Some((index.parse().ok().filter(|index| *index < self.links.len())?, key))
    }

    /// Puts a number, in the key's SI unit, where the dotted path of its key leads: `device.damping` of a world, of a
    /// network `links.0.stiffness` or `stations.left.device.damping`. The checks are those of
    /// [`World::set_number`](crate::World::set_number).
    ///
    /// `false`, and nothing is changed, where this system has no number under that key, or one that takes no such value.
    pub fn set_number(&mut self, path: &str, value: f64) -> bool {
        if let Some((at, key)) = self.of_station(path) {
            return self.stations[at].set_number(key, value);
        }
        let Some((at, key)) = self.of_link(path) else { return false };
        let (_, slots) = numbers(&mut self.links[at]);
        slots.into_iter().find(|(name, _)| *name == key).is_some_and(|(_, slot)| slot.set(value))
    }

    /// The number where the dotted path of its key leads, in the key's SI unit; `None` where there is none.
    pub fn number(&self, path: &str) -> Option<f64> {
        if let Some((at, key)) = self.of_station(path) {
            return self.stations[at].number(key);
        }
        let (at, key) = self.of_link(path)?;
        let mut link = self.links[at].clone();
        numbers(&mut link).1.iter().find(|(name, _)| *name == key)?.1.get()
    }

    /// The row of the table of keys for a dotted path to a number of this system; `None` where there is no number.
    pub fn key(&self, path: &str) -> Option<&'static Key> {
        if let Some((at, key)) = self.of_station(path) {
            let is_own = |row: &&Key| row.name() == key && row.takes.quantity().is_some();
            let own = || keys::rows("network.stations.*").find(is_own).filter(|_| self.world().is_none());
            return own().or_else(|| self.stations[at].world.key(key));
        }
        let (at, key) = self.of_link(path)?;
        let mut link = self.links[at].clone();
        let (kind, slots) = numbers(&mut link);
        slots.iter().find(|(name, _)| *name == key)?;
        keys::rows("network.links.*").find(|row| row.name() == key && row.belongs(Some(kind), None, self.motion))
    }
}

impl System {
    /// The network as a TOML file, its numbers in SI: its stations' worlds are in `files`. Reading it gives an equal network, where each of
    /// these files has [`Station::stated_world`].
    pub fn to_toml(&self, files: &[String]) -> String {
        let mut file = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut file, files);
        file
    }

    fn write(&self, f: &mut String, files: &[String]) -> fmt::Result {
        if let Some(title) = &self.title {
            writeln!(f, "title = {}", text(title))?;
        }
        for (station, file) in self.stations.iter().zip(files) {
            writeln!(f, "\n[stations.{}]\nworld = {}", station.name, text(file))?;
            for key in ["phase", "drift"] {
                station.number(key).filter(|number| *number != 0.0).map_or(Ok(()), |x| writeln!(f, "{key} = {x:?}"))?;
            }
        }
        for link in &self.links {
            let mut link = link.clone();
            let [one, other] = link.between.map(|at| self.stations.get(at).map_or("", |station| &station.name));
            let side = link.law.side();
            let (kind, slots) = numbers(&mut link);
            writeln!(f, "\n[[links]]\nkind = {kind:?}\nbetween = [{one:?}, {other:?}]")?;
            side.map_or(Ok(()), |side| writeln!(f, "side = {:?}", side.name()))?;
            for (key, slot) in slots {
                let is_whole = matches!(slot, Whole(_));
                match slot.get() {
                    Some(number) if is_whole => writeln!(f, "{key} = {number:.0}")?,
                    Some(number) => writeln!(f, "{key} = {number:?}")?,
                    None => {}
                }
            }
        }
        Ok(())
    }
}
