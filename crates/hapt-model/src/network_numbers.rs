//! Every number of a network under its key's name: what a sweep changes, and what the writer writes.

use std::fmt::{self, Write};

use hapt_core::Law;

use crate::keys::{self, Key};
use crate::network::{Link, Network, Station};
use crate::numbers::NumberSlot::{Number, Optional, Whole};
use crate::numbers::NumberSlots;
use crate::write::text;

/// A clock's drift is in millionths in files.
pub(crate) const MILLIONTH: f64 = 1e-6;

/// A link's kind and its numbers.
fn numbers(link: &mut Link) -> (&'static str, NumberSlots<'_>) {
    let mut slots = vec![
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
            "phase" => Some(self.phase),
            "drift" => Some(self.drift / MILLIONTH),
            "loop.interval_max" => self.interval_max,
            key => self.world.number(key),
        }
    }

    fn set_number(&mut self, key: &str, value: f64) -> bool {
        self.world.sampling.interval_max = self.interval_max;
        let is_set = match key {
            "phase" => {
                self.phase = value;
                true
            }
            "drift" => {
                self.drift = MILLIONTH * value;
                true
            }
            key => self.world.set_number(key, value),
        };
        self.interval_max = self.world.sampling.interval_max;
        self.follow_clock();
        is_set
    }
}

impl Network {
    /// Of a dotted path to a key of a station, or of its world, the station's number and the rest of the path.
    fn of_station<'p>(&self, path: &'p str) -> Option<(usize, &'p str)> {
        let (name, key) = path.strip_prefix("stations.")?.split_once('.')?;
        Some((self.stations.iter().position(|station| station.name == name)?, key))
    }

    /// The same of a key of a link.
    fn of_link<'p>(&self, path: &'p str) -> Option<(usize, &'p str)> {
        let (index, key) = path.strip_prefix("links.")?.split_once('.')?;
        Some((index.parse().ok().filter(|index| *index < self.links.len())?, key))
    }

    /// Puts a number, in the key's SI unit, where the dotted path of its key leads: `links.0.stiffness`,
    /// `stations.left.device.damping`. Nothing is checked, as of a world's ([`World::set_number`](crate::World::set_number)).
    ///
    /// `false`, and nothing is changed, where this network has no number under that key, or one that takes no such value.
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

    /// The row of the table of keys for a dotted path to a number of this network; `None` where there is no number.
    pub fn key(&self, path: &str) -> Option<&'static Key> {
        if let Some((at, key)) = self.of_station(path) {
            let own =
                || keys::rows("network.stations.*").find(|row| row.name() == key && row.takes.quantity().is_some());
            return own().or_else(|| self.stations[at].world.key(key));
        }
        let (at, key) = self.of_link(path)?;
        let mut link = self.links[at].clone();
        let (kind, slots) = numbers(&mut link);
        slots.iter().find(|(name, _)| *name == key)?;
        keys::rows("network.links.*").find(|row| row.name() == key && row.belongs(Some(kind), None, self.motion))
    }
}

impl Network {
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

#[cfg(test)]
mod tests {
    use crate::{Source, System};

    /// A number set by its path is the number that an override of that path would have been read as.
    #[test]
    fn every_number_of_a_network_is_where_its_override_goes() {
        let text = r#"
            [stations.left]
            world = "w.toml"
            phase = "0.3 ms"
            drift = -500
            [stations.right]
            world = "w.toml"
            [[links]]
            kind = "spring"
            between = ["left", "right"]
            stiffness = 0.2
            delay = "1 ms"
            age_max = "30 ms"
            [[links]]
            kind = "wall"
            between = ["left", "right"]
            stiffness = 0.2
            side = "above"
            at = 0.5
            delay = "1 ms"
            delay_max = "2 ms"
            age_max = "30 ms"
        "#;
        let mut source = Source::from_text("pair.toml", text);
        let world =
            "loop = { period = \"1 ms\", interval_max = \"1.3 ms\" }\ndevice = { inertia = 1e-3, damping = 0.02 }\n";
        source.files.insert("w.toml".into(), world.into());
        let system = System::read(&source, &[]).unwrap();
        let paths = [
            ("stations.left.phase", 1e-3),
            ("stations.left.drift", 800.0),
            ("stations.left.drift", -900.0),
            ("stations.left.loop.period", 1.1e-3),
            ("stations.left.loop.interval_max", 1.7e-3),
            ("stations.left.device.damping", 0.5),
            ("stations.right.loop.delay", 0.4e-3),
            ("links.0.stiffness", 0.7),
            ("links.0.rest", -0.1),
            ("links.0.limit", 2.0),
            ("links.0.period", 7e-3),
            ("links.0.delay", 3e-3),
            ("links.1.delay_max", 4e-3),
            ("links.1.loss", 0.3),
            ("links.1.duplicate", 0.2),
            ("links.1.seed", 7.0),
            ("links.1.at", 0.25),
            ("links.1.age_max", 0.05),
        ];
        for (path, value) in paths {
            assert!(system.key(path).is_some(), "{path}");
            let mut changed = system.clone();
            assert!(changed.set_number(path, value), "{path}");
            let of = |system: &System| match system {
                System::Network(network) => {
                    let mut network = network.clone();
                    network.stations.iter_mut().for_each(|station| station.sets.clear());
                    network
                }
                System::World(_) => panic!("it has stations"),
            };
            let read = System::read(&source, &[format!("{path}={value}")]).unwrap();
            assert_eq!(of(&changed), of(&read), "{path}");
            assert!((changed.number(path).unwrap() - value).abs() < 1e-12 * value.abs(), "{path}");
        }
        // Written and read again it is the same.
        let System::Network(network) = &system else { panic!("it has stations") };
        let mut written = Source::from_text("pair.toml", network.to_toml(&["left.toml".into(), "right.toml".into()]));
        for station in &network.stations {
            written.files.insert(format!("{}.toml", station.name), station.stated_world().to_toml());
        }
        let System::Network(read) = System::read(&written, &[]).unwrap() else { panic!("it has stations") };
        assert_eq!((&read.links, read.stations.len()), (&network.links, 2));
        for (read, own) in read.stations.iter().zip(&network.stations) {
            assert_eq!((&read.world, read.phase), (&own.world, own.phase));
            assert!((read.drift - own.drift).abs() < 1e-15);
        }
        for path in
            ["links.0.at", "links.2.stiffness", "links.1.damping", "links.0.kind", "stations.left.world", "loop.period"]
        {
            assert!(system.key(path).is_none() && system.number(path).is_none(), "{path}");
            assert!(!system.clone().set_number(path, 1.0), "{path}");
        }
    }
}
