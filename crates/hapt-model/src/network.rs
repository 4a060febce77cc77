//! A network file: stations, each an ordinary world, and the links between their pucks.

use hapt_core::{Law, Side};

use crate::document::{Document, Place};
use crate::error::{Error, ErrorKind};
use crate::fields::{Context, Fields};
use crate::keys::NETWORK_FILE;
use crate::kinds::Motion;
use crate::network_numbers::MILLIONTH;
use crate::path;
use crate::read::{items, kind, named, one_of};
use crate::source::Source;
use crate::timing::Timing;
use crate::words;
use crate::world::{Scenario, World};

/// An instant within this part of a period of another is that one, as in the loop.
const SAME_INSTANT: f64 = 1e-6;
/// The largest drift of a clock, in millionths.
const MOST_DRIFT: f64 = 10_000.0;
/// The longest time of a station or a link, in s.
const MOST_TIME: f64 = 1000.0;
/// The most messages that may be under way on a link, each way: a run keeps them.
const MOST_UNDER_WAY: f64 = 1e6;

/// A network file, read and checked. All numbers are in SI.
///
/// ```
/// use hapt_model::{Network, Source};
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
/// source.files.insert("wheel.toml".into(), "loop.period = '1 ms'\ndevice.inertia = '6.4e-4 kg m^2'".into());
/// // An override of a station goes on to its world.
/// let network = Network::read(&source, &["stations.left.loop.period=2ms".to_string()])?;
/// assert_eq!(network.stations[0].world.sampling.period, 2e-3);
/// assert_eq!(network.stations[1].world.sampling.period, 1e-3);
/// assert_eq!(network.links[0].between, [0, 1]);
/// # Ok::<(), hapt_model::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// What the file calls itself.
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
    /// Its name.
    pub name: String,
    /// Its world's file, as the network names it.
    pub file: String,
    /// Its world.
    pub world: World,
    /// That file's text.
    pub source: Source,
    /// What is set over it.
    pub sets: Vec<String>,
    /// When its first sample is taken, in s.
    pub phase: f64,
    /// By what part its clock is fast: a second of it takes 1/(1 + drift) s. Its world's longest interval has room for it.
    pub drift: f64,
    /// The longest interval that the world's file states.
    pub(crate) interval_max: Option<f64>,
}

/// A coupling between the pucks of two stations, of which each computes its own end.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Which stations: q is the first one's puck as seen from the second's.
    pub between: [usize; 2],
    /// A spring or a wall: its torque at rest. Its own damping is 0.
    pub law: Law,
    /// D in N·m·s/rad (linear: N·s/m), of a wall inside.
    pub damping: f64,
    /// The largest torque in N·m (linear: N); `None`: any.
    pub limit: Option<f64>,
    /// Between two messages in s; `None`: the sender's period.
    pub period: Option<f64>,
    /// How long a message is on its way at least, in s.
    pub delay: f64,
    /// How long at most, in s; no shorter. `None`: `delay`.
    pub delay_max: Option<f64>,
    /// The part of the messages that a simulation loses, from 0 to 1.
    pub loss: f64,
    /// The part of the messages that arrive twice in a simulation, from 0 to 1.
    pub duplicate: f64,
    /// Of the losses, copies and times that a simulation draws.
    pub seed: u32,
    /// The greatest age in s of a position at any time that its torque acts.
    pub age_max: f64,
}

impl Link {
    /// K in N·m/rad (linear: N/m): the steepest slope.
    pub fn stiffness(&self) -> f64 {
        let (Law::Spring { stiffness, .. } | Law::Wall { stiffness, .. }) = self.law else { return 0.0 };
        stiffness
    }

    /// Whether it has any torque.
    pub fn acts(&self) -> bool {
        self.stiffness() > 0.0 || self.damping > 0.0
    }

    /// The same link, this stiff.
    pub fn with_stiffness(&self, stiffness: f64) -> Link {
        let mut link = self.clone();
        if let Law::Spring { stiffness: own, .. } | Law::Wall { stiffness: own, .. } = &mut link.law {
            *own = stiffness;
        }
        link
    }

    /// Between two messages of a sender that takes a sample every `sample` s, in s: a whole number of them, `period` at least.
    pub fn between_messages(&self, sample: f64) -> f64 {
        self.period.map_or(1.0, |own| (own / sample - SAME_INSTANT).ceil().max(1.0)) * sample
    }

    /// How long a message is on its way at most, in s.
    pub fn delay_max_s(&self) -> f64 {
        self.delay_max.unwrap_or(self.delay)
    }

    /// The torque on the first station's puck at q and q̇; the second's has the opposite sign. A wall never pulls.
    pub fn torque(&self, q: f64, rate: f64) -> f64 {
        let drag = -self.damping * rate;
        let torque = match self.law {
            Law::Spring { stiffness, rest } => -stiffness * (q - rest) + drag,
            Law::Wall { side: Side::Above, at, stiffness, .. } if q > at => (-stiffness * (q - at) + drag).min(0.0),
            Law::Wall { side: Side::Below, at, stiffness, .. } if q < at => (-stiffness * (q - at) + drag).max(0.0),
            _ => 0.0,
        };
        self.limit.map_or(torque, |limit| torque.clamp(-limit, limit))
    }

    /// The torque on the puck of one of the stations, the first or the second, with position and velocity of its own and of the other's puck. Where
    /// that velocity is not known there is no damping.
    pub fn torque_at(&self, first: bool, own: [f64; 2], other: f64, velocity: Option<f64>) -> f64 {
        let [q, rate] = [own[0] - other, velocity.map_or(0.0, |velocity| own[1] - velocity)];
        if first { self.torque(q, rate) } else { -self.torque(-q, -rate) }
    }
}

impl Station {
    /// How long a torque that was computed at a sample may act, in s: until the next sample's has arrived.
    pub fn hold(&self) -> f64 {
        self.world.sampling.interval_max_s() + self.world.sampling.delay_max_s()
    }

    /// The same station with another world on its device, such as one of which a key has been set: its intervals have room for the clock too.
    pub fn with_world(&self, world: World) -> Station {
        let mut station = Station { interval_max: world.sampling.interval_max, world, ..self.clone() };
        station.follow_clock();
        station
    }

    /// Its world as its file has it: without the room for a slow clock.
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

    /// What its clock shows, in ns from its first sample on, when the network's clock shows `time` ns; `None` before that sample.
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

/// Whether the file joins stations. What cannot be parsed does not.
pub fn is_network(source: &Source) -> bool {
    Document::parse(source, NETWORK_FILE).is_ok_and(|document| document.place("stations").is_some())
}

impl Network {
    /// Reads and checks a network and the worlds of its stations. Each of `sets` is an override `KEY=VALUE`; those of
    /// `stations.NAME.KEY` go on to the station's world, but for its own keys (`world`, `phase`).
    ///
    /// # Errors
    /// The first mistake found: its key, what would be right, and where it stands.
    pub fn read(source: &Source, sets: &[String]) -> Result<Network, Error> {
        let (own, passed): (Vec<String>, Vec<String>) =
            sets.iter().cloned().partition(|set| station_key(set).is_none());
        let document = Document::within(NETWORK_FILE, source, &own)?;
        let root =
            |motion| Context { document: &document, motion, pattern: NETWORK_FILE, path: String::new(), hand: None };
        let top = Fields::new(root(Motion::Rotary), Some(&document.root))?;

        let mut stations: Vec<Station> = Vec::new();
        for entry in named(&top, "stations") {
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
            let phase = fields.number("phase")?;
            no_longer(&fields, "phase", Some(phase))?;
            let drift = drift(&fields, &world)?;
            let interval_max = world.sampling.interval_max;
            let name = entry.key.clone();
            let mut station = Station { name, file, world, source, sets, phase, drift, interval_max };
            station.follow_clock();
            stations.push(station);
        }
        for set in &passed {
            let name = station_key(set).map_or("", |(name, _)| name);
            if !stations.iter().any(|station| station.name == name) {
                let hint = words::did_you_mean(name, stations.iter().map(|station| station.name.as_str()));
                let message = format!("the network has no station {}{hint}", words::quoted(name));
                return Err(Error { kind: ErrorKind::Name, key: format!("stations.{name}"), message, location: None });
            }
        }
        let motion = stations.first().map_or(Motion::Rotary, |station| station.world.motion);
        let top = Fields::new(root(motion), Some(&document.root))?;
        let mut links = Vec::new();
        for (index, node) in items(&top, "links").iter().enumerate() {
            let context = Context { path: format!("links.{index}"), ..top.inner("links", "network.links.*") };
            links.push(link(&Fields::new(context, Some(node))?, &stations)?);
        }
        let network = Network { title: top.text("title"), motion, stations, links };
        network.check_scenarios(&top)?;
        Ok(network)
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

    /// What each station does in the scenario `name`; `None` for one whose world has no such scenario: there the puck is free.
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

/// Of an override of a station's world its station, and the override for that world: `stations.left.loop.period=2ms` is
/// `loop.period=2ms` of `left`. `None` for the network's own keys.
fn station_key(set: &str) -> Option<(&str, &str)> {
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

/// Refuses a time of a station or a link, in s, that is beyond what any network takes.
fn no_longer(fields: &Fields<'_>, key: &str, time: Option<f64>) -> Result<(), Error> {
    match time.filter(|time| *time > MOST_TIME) {
        None => Ok(()),
        Some(time) => {
            let message = format!("{time:?} s is longer than in any network; expected {MOST_TIME:?} s or less");
            Err(fields.error(ErrorKind::Combination, key, message))
        }
    }
}

/// The drift of a station's clock as a part.
fn drift(fields: &Fields<'_>, world: &World) -> Result<f64, Error> {
    let millionths = fields.number("drift")?;
    if millionths.abs() > MOST_DRIFT {
        let message =
            format!("{millionths:?} is beyond what any clock drifts; expected {MOST_DRIFT:?} or less, either way");
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

fn link(fields: &Fields<'_>, stations: &[Station]) -> Result<Link, Error> {
    let ends = fields.ends("between")?;
    let station = |(name, place): (&str, &Place)| {
        stations.iter().position(|station| station.name == name).ok_or_else(|| {
            let known = || stations.iter().map(|station| station.name.as_str());
            let hint = match words::did_you_mean(name, known()) {
                hint if hint.is_empty() => format!("; a station is {}", words::alternatives(known())),
                hint => hint,
            };
            let message = format!("{} is not a station of this network{hint}", words::quoted(name));
            fields.error_at(ErrorKind::Name, "between", message, place)
        })
    };
    let between = [station(ends[0])?, station(ends[1])?];
    if between[0] == between[1] {
        let message = format!("both ends are {}; a link is between two different stations", words::quoted(ends[0].0));
        return Err(fields.error(ErrorKind::Value, "between", message));
    }
    let stiffness = fields.number("stiffness")?;
    let law = match kind(fields, |name| ["spring", "wall"].into_iter().find(|known| *known == name))? {
        "spring" => Law::Spring { stiffness, rest: fields.number("rest")? },
        _ => Law::Wall {
            side: one_of(fields, "side", &[Side::Above, Side::Below], Side::name)?
                .ok_or_else(|| fields.missing("side"))?,
            at: fields.number("at")?,
            stiffness,
            damping: 0.0,
        },
    };
    let delay = fields.number("delay")?;
    let link = Link {
        between,
        law,
        damping: fields.number("damping")?,
        limit: fields.optional_number("limit")?,
        period: fields.optional_number("period")?,
        delay,
        delay_max: fields.optional_number("delay_max")?,
        loss: fields.number("loss")?,
        duplicate: fields.number("duplicate")?,
        seed: fields.whole("seed")?,
        age_max: fields.number("age_max")?,
    };
    let combination = |name, message: String| Err(fields.error(ErrorKind::Combination, name, message));
    let times = [
        ("period", link.period),
        ("delay", Some(delay)),
        ("delay_max", link.delay_max),
        ("age_max", Some(link.age_max)),
    ];
    for (key, time) in times {
        no_longer(fields, key, time)?;
    }
    if link.delay_max_s() < delay {
        return combination(
            "delay_max",
            format!(
                "{:?} s is below delay, {delay:?} s, which is the least; expected {delay:?} s or more",
                link.delay_max_s()
            ),
        );
    }
    for (key, part) in [("loss", link.loss), ("duplicate", link.duplicate)] {
        if part > 1.0 {
            let message = format!("{part:?} is more than 1, which is every message; expected a number from 0 to 1");
            return combination(key, message);
        }
    }
    for sender in between {
        let (name, period) = (&stations[sender].name, stations[sender].world.sampling.period);
        if let Some(own) = link.period.filter(|own| *own < period) {
            return combination(
                "period",
                format!(
                    "{own:?} s is below the period of {name}, {period:?} s, which sends at its samples; expected {period:?} s or more"
                ),
            );
        }
        let between_two = link.between_messages(period);
        let under_way = link.delay_max_s() / between_two;
        if under_way > MOST_UNDER_WAY {
            let key = if link.delay_max.is_some() { "delay_max" } else { "delay" };
            let most = MOST_UNDER_WAY * between_two;
            let message = format!(
                "{name} sends every {between_two:?} s, so that {under_way:.0} messages are under way; at most {MOST_UNDER_WAY:.0} can be; \
                 expected {most:?} s or less, or a longer period"
            );
            return combination(key, message);
        }
        if between_two > link.age_max {
            let key = if link.period.is_some() { "period" } else { "age_max" };
            return combination(
                key,
                format!(
                    "{name} sends every {between_two:?} s, and a position is used up to an age of {:?} s: the link would let go between two messages; expected an age_max above the period",
                    link.age_max
                ),
            );
        }
    }
    for [from, to] in [between, [between[1], between[0]]] {
        let (sender, receiver) = (&stations[from], &stations[to]);
        let least = delay + receiver.hold();
        if least > link.age_max {
            let message = format!(
                "a position of {} acts at {} up to {least:?} s after its sample at least (its way, a period, the delay of the loop), and only {:?} s are allowed; expected an age_max of that or more",
                sender.name, receiver.name, link.age_max
            );
            return combination("age_max", message);
        }
    }
    Ok(link)
}
