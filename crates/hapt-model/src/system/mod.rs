//! The system of a file: stations, each a world with its own clock, and the links between their pucks. A world file is one station.

mod link;
mod numbers;

use crate::document::Document;
use crate::error::{Error, ErrorKind};
use crate::fields::{Context, Fields};
use crate::fields::{entries, items};
use crate::keys::NETWORK_FILE;
use crate::kinds::Motion;
use crate::path;
use crate::source::Source;
use crate::timing::Timing;
use crate::words;
use crate::world::{Scenario, World};
use numbers::MILLIONTH;

pub use link::Link;

/// The largest drift of a clock, in millionths.
const MAX_DRIFT_MILLIONTHS: f64 = 10_000.0;
/// The longest time of a station or a link, in s.
const MAX_TIME_S: f64 = 1000.0;

/// Stations, each a world on its own device and by its own clock, and the links between their pucks. A world file is one station without
/// links. All numbers are in SI.
///
/// ```
/// use hapt_model::{Source, System};
///
/// let wheel = "loop.period = '1 ms'\ndevice.inertia = '6.4e-4 kg m^2'\n";
/// let mut system = System::read(&Source::from_text("wheel.toml", wheel), &[])?;
/// assert!(system.world().is_some() && system.links.is_empty());
/// assert!(system.set_number("loop.period", 2e-3) && system.number("loop.period") == Some(2e-3));
///
/// let mut source = Source::from_text("pair.toml", r#"
/// stations.left.world = "wheel.toml"
/// stations.right.world = "wheel.toml"
/// [[links]]
/// kind = "spring"
/// between = ["left", "right"]
/// stiffness = "5 N mm/deg"
/// age_max = "20 ms"
/// "#);
/// source.files.insert("wheel.toml".into(), wheel.into());
/// // An override of a station goes on to its world.
/// let system = System::read(&source, &["stations.left.loop.period=2ms".to_string()])?;
/// assert_eq!(system.stations[0].world.sampling.period, 2e-3);
/// assert_eq!(system.number("stations.right.loop.period"), Some(1e-3));
/// assert_eq!(system.links[0].between, [0, 1]);
/// # Ok::<(), hapt_model::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// The file's title.
    pub title: Option<String>,
    /// Rotary or linear, as all of its stations are.
    pub motion: Motion,
    /// In file order.
    pub stations: Vec<Station>,
    /// In file order.
    pub links: Vec<Link>,
}

/// A device with its own world and its own clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Station {
    /// Its name; empty for the station of a world file, whose keys have no prefix.
    pub name: String,
    /// Its world's file, as the network names it; of a world file its own name.
    pub file: String,
    /// Its world.
    pub world: World,
    /// That file's text.
    pub source: Source,
    /// Its overrides.
    pub sets: Vec<String>,
    /// When its first sample is taken, in s.
    pub phase: f64,
    /// The relative error of its clock: a second of it takes 1/(1 + drift) s. Its world's longest interval includes it.
    pub drift: f64,
    /// The longest interval that the world's file states.
    pub(crate) interval_max: Option<f64>,
}

impl Station {
    /// How long a torque that was computed at a sample may act, in s: until the next sample's has arrived.
    pub fn hold(&self) -> f64 {
        self.world.sampling.interval_max_s() + self.world.sampling.delay_max_s()
    }

    /// The same station with another world on its device, such as one of which a key has been set: its intervals include the clock too.
    pub fn with_world(&self, world: World) -> Station {
        let mut station = Station { interval_max: world.sampling.interval_max, world, ..self.clone() };
        station.follow_clock();
        station
    }

    /// Its world as in its file, without the margin for a slow clock.
    pub fn stated_world(&self) -> World {
        let mut world = self.world.clone();
        world.sampling.interval_max = self.interval_max;
        world
    }

    /// The world's longest interval is that of its file, which a slow clock makes longer.
    pub(crate) fn follow_clock(&mut self) {
        let sampling = &mut self.world.sampling;
        sampling.interval_max = self.interval_max;
        if self.drift < 0.0 {
            sampling.interval_max = Some(sampling.interval_max_s() / (1.0 + self.drift) * (1.0 + 1e-12));
        }
    }

    /// The reading of its clock, in ns from its first sample on, when the network's clock shows `time` ns; `None` before that sample.
    pub fn shown(&self, time: u64) -> Option<u64> {
        let since = time.checked_sub((1e9 * self.phase) as u64)?;
        Some(since.saturating_add_signed((since as f64 * self.drift) as i64))
    }

    /// The network's time in ns when its clock shows `shown` ns: the inverse of [`Station::shown`].
    pub fn time_of(&self, shown: u64) -> u64 {
        let since = shown.saturating_add_signed((-(shown as f64) * self.drift / (1.0 + self.drift)) as i64);
        since.saturating_add((1e9 * self.phase) as u64)
    }

    /// The true age in s of a position that is `age` old by this station's clock, at most.
    pub fn true_age(&self, age: f64) -> f64 {
        age / (1.0 + self.drift).min(1.0)
    }
}

/// Whether the file joins stations. A text that cannot be parsed does not.
pub fn is_network(source: &Source) -> bool {
    Document::parse(source, NETWORK_FILE).is_ok_and(|document| document.place("stations").is_some())
}

impl System {
    /// Reads and checks a world file, or a network file with the worlds of its stations. Each of `sets` is an override `KEY=VALUE`; those
    /// of `stations.NAME.KEY` apply to the station's world, except for its own keys (`world`, `phase`, `drift`).
    ///
    /// # Errors
    /// The first mistake found: its key, what would be right, and where it stands.
    pub fn read(source: &Source, sets: &[String]) -> Result<System, Error> {
        if is_network(source) {
            return System::read_network(source, sets);
        }
        let world = World::read(source, sets)?;
        let station = Station {
            name: String::new(),
            file: source.name.clone(),
            source: source.clone(),
            sets: sets.to_vec(),
            phase: 0.0,
            drift: 0.0,
            interval_max: world.sampling.interval_max,
            world,
        };
        let world = &station.world;
        Ok(System { title: world.title.clone(), motion: world.motion, stations: vec![station], links: Vec::new() })
    }

    /// The world, of a world file; `None` of a network.
    pub fn world(&self) -> Option<&World> {
        match self.stations.as_slice() {
            [station] if station.name.is_empty() => Some(&station.world),
            _ => None,
        }
    }

    /// Its title, or else the name of the source that it was read from.
    pub fn title_or<'s>(&'s self, source: &'s Source) -> &'s str {
        self.title.as_deref().unwrap_or(&source.name)
    }

    /// The kind of its file: "world" or "network".
    pub fn kind(&self) -> &'static str {
        if self.world().is_some() { "world" } else { "network" }
    }

    /// The same for a network file only.
    ///
    /// # Errors
    /// As [`System::read`], and a file without stations.
    pub fn read_network(source: &Source, sets: &[String]) -> Result<System, Error> {
        let (own, passed): (Vec<String>, Vec<String>) =
            sets.iter().cloned().partition(|set| station_key(set).is_none());
        let document = Document::within(NETWORK_FILE, source, &own)?;
        let root =
            |motion| Context { document: &document, motion, pattern: NETWORK_FILE, path: String::new(), hand: None };
        let top = Fields::new(root(Motion::Rotary), Some(&document.root))?;

        let mut stations: Vec<Station> = Vec::new();
        for entry in entries(&top, "stations") {
            let context =
                Context { path: format!("stations.{}", entry.key), ..top.inner("stations", "network.stations.*") };
            let fields = Fields::new(context, Some(&entry.node))?;
            let file = fields.text("world").ok_or_else(|| fields.missing("world"))?;
            let sets: Vec<String> = passed
                .iter()
                .filter_map(|set| station_key(set))
                .filter(|(name, _)| *name == entry.key)
                .map(|(_, set)| set.to_string())
                .collect();
            let (source, world) = world(source, &fields, &file, &sets)?;
            if let Some(first) = stations.first().filter(|first| first.world.motion != world.motion) {
                let message = format!(
                    "{file} is {}, and the station {} is {}: pucks that a link joins move alike",
                    world.motion.name(),
                    first.name,
                    first.world.motion.name()
                );
                return Err(fields.error(ErrorKind::Combination, "world", message));
            }
            if world.sampling.recentre.is_some() {
                let message = format!(
                    "{file} has loop.recentre, and links count positions from an origin that stays; expected a world without it"
                );
                return Err(fields.error(ErrorKind::Combination, "world", message));
            }
            let phase = fields.number("phase")?;
            no_longer(&fields, "phase", Some(phase))?;
            let drift = drift(&fields, &world)?;
            let interval_max = world.sampling.interval_max;
            let name = entry.key.clone();
            let mut station = Station { name, file, world, source, sets, phase, drift, interval_max };
            station.follow_clock();
            stations.push(station);
        }
        if stations.is_empty() {
            let message =
                "the network has no station; expected at least one, such as [stations.left] with its world".to_string();
            return Err(top.error(ErrorKind::Name, "stations", message));
        }
        for set in &passed {
            let name = station_key(set).map_or("", |(name, _)| name);
            if !stations.iter().any(|station| station.name == name) {
                let hint = words::did_you_mean(name, stations.iter().map(|station| station.name.as_str()));
                let message = format!("the network has no station {}{hint}", words::quoted(name));
                return Err(Error { kind: ErrorKind::Name, key: format!("stations.{name}"), message, location: None });
            }
        }
        let motion = stations[0].world.motion;
        let top = Fields::new(root(motion), Some(&document.root))?;
        let mut links = Vec::new();
        for (index, node) in items(&top, "links").iter().enumerate() {
            let context = Context { path: format!("links.{index}"), ..top.inner("links", "network.links.*") };
            links.push(link::read(&Fields::new(context, Some(node))?, &stations)?);
        }
        let system = System { title: top.text("title"), motion, stations, links };
        system.check_scenarios(&top)?;
        Ok(system)
    }

    /// The scenarios' names: those of all stations, in the order in which they come.
    pub fn scenarios(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for scenario in self.stations.iter().flat_map(|station| &station.world.scenarios) {
            if !names.contains(&scenario.name.as_str()) {
                names.push(&scenario.name);
            }
        }
        names
    }

    /// Whether a station has the scenario `name`.
    ///
    /// # Errors
    /// None has it; the message lists the scenarios.
    pub fn find_scenario(&self, name: &str) -> Result<(), Error> {
        if let Some(world) = self.world() {
            return world.scenario(name).map(drop);
        }
        let names = self.scenarios();
        if names.contains(&name) {
            return Ok(());
        }
        let hint = match words::did_you_mean(name, names.iter().copied()) {
            hint if hint.is_empty() => format!("; there is {}", names.join(", ")),
            hint => hint,
        };
        let message = format!("no station's world has a scenario {}{hint}", words::quoted(name));
        Err(Error { kind: ErrorKind::Name, key: String::new(), message, location: None })
    }

    /// The scenario `name` at each station; `None` for one whose world has no such scenario: there the puck is free.
    pub fn scenario(&self, name: &str) -> Vec<Option<&Scenario>> {
        let of = |station: &'_ Station| station.world.scenarios.iter().position(|scenario| scenario.name == name);
        self.stations.iter().map(|station| of(station).map(|at| &station.world.scenarios[at])).collect()
    }

    /// A scenario takes the same time at every station that has it.
    fn check_scenarios(&self, top: &Fields<'_>) -> Result<(), Error> {
        for name in self.scenarios() {
            let of = self.scenario(name);
            let mut all = self.stations.iter().zip(&of).filter_map(|(station, scenario)| Some((station, (*scenario)?)));
            let Some((first, own)) = all.next() else { continue };
            if let Some((other, its)) = all.find(|(_, scenario)| scenario.duration != own.duration) {
                let message = format!(
                    "the scenario {name} takes {:?} s at {} and {:?} s at {}; it takes the same time at every station that has it",
                    own.duration, first.name, its.duration, other.name
                );
                return Err(top.error(ErrorKind::Combination, "stations", message));
            }
        }
        Ok(())
    }
}

/// The station of an override of a station's world, and the override for that world: `stations.left.loop.period=2ms` is
/// `loop.period=2ms` of `left`. `None` for the network's own keys.
pub(crate) fn station_key(set: &str) -> Option<(&str, &str)> {
    let (name, rest) = set.trim_start().strip_prefix("stations.")?.split_once('.')?;
    let key = rest.split('=').next()?.trim();
    let is_own = crate::keys::rows("network.stations.*").any(|row| row.name() == key);
    (!is_own && !name.contains('=')).then_some((name.trim(), rest))
}

/// The world of a station. A mistake in its file is shown there, one in its name here.
fn world(source: &Source, fields: &Fields<'_>, file: &str, sets: &[String]) -> Result<(Source, World), Error> {
    let here = |error: Error| fields.error(error.kind, "world", error.message);
    let (name, text) = path::Reader::new(source, Motion::Rotary).text(file).map_err(|error| match error.location {
        Some(_) => error,
        None => here(error),
    })?;
    let folder =
        std::path::Path::new(file).parent().map_or_else(|| source.folder.clone(), |inner| source.folder.join(inner));
    let of_station = Source { folder, files: source.files.clone(), ..Source::from_text(name, text) };
    if is_network(&of_station) {
        return Err(fields.error(
            ErrorKind::Value,
            "world",
            format!("{} is itself a network; a station has a world", words::quoted(file)),
        ));
    }
    let world = World::read(&of_station, sets)?;
    Ok((of_station, world))
}

/// Refuses a time of a station or a link, in s, that is beyond the largest of any network.
fn no_longer(fields: &Fields<'_>, key: &str, time: Option<f64>) -> Result<(), Error> {
    match time.filter(|time| *time > MAX_TIME_S) {
        None => Ok(()),
        Some(time) => {
            let message = format!("{time:?} s is longer than in any network; expected {MAX_TIME_S:?} s or less");
            Err(fields.error(ErrorKind::Combination, key, message))
        }
    }
}

/// The drift of a station's clock as a part.
fn drift(fields: &Fields<'_>, world: &World) -> Result<f64, Error> {
    let millionths = fields.number("drift")?;
    if millionths.abs() > MAX_DRIFT_MILLIONTHS {
        let message = format!(
            "{millionths:?} is beyond what any clock drifts; expected {MAX_DRIFT_MILLIONTHS:?} or less, either way"
        );
        return Err(fields.error(ErrorKind::Combination, "drift", message));
    }
    let drift = MILLIONTH * millionths;
    let is_true = |scenario: &&Scenario| matches!(scenario.timing, Timing::Random { .. } | Timing::Worst);
    if let Some(scenario) = world.scenarios.iter().find(is_true).filter(|_| drift != 0.0) {
        let message = format!(
            "the timing of the scenario {} draws its intervals by the clock of the network; expected no drift, or a timing that is even, a pattern or recorded",
            scenario.name
        );
        return Err(fields.error(ErrorKind::Combination, "drift", message));
    }
    Ok(drift)
}
