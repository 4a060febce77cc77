//! The worlds of a session: their files, which of them runs, and the keys set over it.

use std::sync::Arc;

use hapt_core::SafetyProfile;
use hapt_model::{Error, Source, World};
use serde::Serialize;

use crate::attached::Attached;
use crate::keys::{SettableKey, adds_damper, companion, keys, may_be_set};

/// One of the worlds of a session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct WorldName {
    /// Its file's, without folders and ending.
    pub name: String,
    /// Its title, or its file's name.
    pub title: String,
}

/// The name of the simulated device.
const SIMULATED: &str = "sim";

/// Checks a world beyond what the reader checks, with the source and overrides that it was read from; errors are sentences.
pub type Rule = fn(&World, &Source, &[String]) -> Result<(), String>;

/// One of the worlds of a session.
#[derive(Clone, Debug)]
struct Listed {
    source: Source,
    name: WorldName,
}

impl Listed {
    fn new(source: Source, world: &World) -> Self {
        let title = world.title.as_ref().unwrap_or(&source.name).clone();
        Listed { name: WorldName { name: stem(&source.name).into(), title }, source }
    }
}

/// The worlds that a session may run, one of them running, with the keys set over its file.
///
/// ```
/// use hapt_host::WorldConfig;
/// use hapt_model::Source;
///
/// let file = "loop.period = \"1 ms\"\ndevice = { inertia = \"6.4e-4 kg m^2\", damping = \"1e-3 N m s/rad\" }\n";
/// let config = WorldConfig::new(Source::from_text("free.toml", file), Vec::new())?;
/// let faster = config.with("loop.period", "0.5 ms")?;
/// assert_eq!((faster.world.sampling.period, faster.generation), (0.5e-3, 1));
/// assert_eq!(faster.sets(), ["loop.period=0.5 ms"]);
/// assert!(faster.with("device.damping", "-1").is_err(), "the file's own checks");
/// assert_eq!(faster.reset()?.world, config.world);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug)]
pub struct WorldConfig {
    /// Of one device.
    worlds: Arc<[Listed]>,
    /// The place of the running one among them.
    place: usize,
    /// Overrides of the command line, of all of them.
    given: Vec<String>,
    /// Keys set during the session with their values, in the order in which they were first set.
    changes: Vec<(String, String)>,
    /// The present world.
    pub world: World,
    /// Counts the changes, from 0.
    pub generation: u32,
    device: String,
    /// With a motor: the limits of its file.
    attached: Option<Attached>,
    rule: Rule,
    /// The keys that can be set, computed once: that takes as long as reading the file.
    keys: Arc<[SettableKey]>,
}

impl WorldConfig {
    /// The world of a file with its overrides, on the simulated device.
    ///
    /// # Errors
    /// As [`World::read`].
    pub fn new(source: Source, given: Vec<String>) -> Result<Self, String> {
        WorldConfig::checked(source, given, |_, _, _| Ok(()))
    }

    /// The same under a rule, which holds for all later changes too.
    ///
    /// # Errors
    /// As [`World::read`], and those of the rule.
    pub fn checked(source: Source, given: Vec<String>, rule: Rule) -> Result<Self, String> {
        let world = World::read(&source, &given).map_err(|error| error.to_string())?;
        rule(&world, &source, &given)?;
        Ok(WorldConfig {
            worlds: [Listed::new(source, &world)].into(),
            place: 0,
            given,
            changes: Vec::new(),
            world,
            generation: 0,
            device: SIMULATED.into(),
            attached: None,
            rule,
            keys: Arc::default(),
        }
        .with_keys())
    }

    /// The first of several worlds, which are of one device; the others can be entered.
    ///
    /// # Errors
    /// As [`WorldConfig::checked`] of each; there is none, or two are of different devices.
    #[cfg(not(target_family = "wasm"))]
    pub fn of(sources: Vec<Source>, given: Vec<String>, rule: Rule) -> Result<Self, String> {
        let mut sources = sources.into_iter();
        let first = sources.next().ok_or("there is no world")?;
        let mut config = WorldConfig::checked(first, given, rule)?;
        let mut worlds = config.worlds.to_vec();
        for source in sources {
            let name = &source.name;
            let world = World::read(&source, &config.given).map_err(|error| error.to_string())?;
            rule(&world, &source, &config.given).map_err(|message| format!("{name}: {message}"))?;
            same_device(&config.world, &world).map_err(|key| {
                let own = &config.source().name;
                format!("{name}: {key} is not that of {own}; the worlds of one session are of one device, and of the same times")
            })?;
            worlds.push(Listed::new(source, &world));
        }
        config.worlds = worlds.into();
        Ok(config)
    }

    /// The same on another device, as `--device` names it, with this profile. With a motor the file's device and limits are ceilings
    /// from here on.
    ///
    /// # Errors
    /// In a sentence: the core does not take the world.
    pub fn on(mut self, device: String, profile: SafetyProfile) -> Result<Self, String> {
        if profile != SafetyProfile::Simulated {
            let attached = Attached::new(&self.world, profile)?;
            // The limits are written out only with a change: until then the world is bit-identical to the file's.
            #[cfg(not(target_family = "wasm"))]
            for Listed { source, .. } in &self.worlds[1..] {
                let mut world = World::read(source, &self.given).map_err(|error| error.to_string())?;
                attached.hold(&mut world).map_err(|message| format!("{}: {message}", source.name))?;
            }
            attached.hold(&mut self.world.clone())?;
            self.attached = Some(attached);
        }
        Ok(WorldConfig { device, ..self }.with_keys())
    }

    /// The world to which the certificate applies: with a motor, on the file's device, independent of keys that were set.
    pub fn certified_world(&self) -> World {
        self.attached.as_ref().map_or_else(|| self.world.clone(), |attached| attached.certified_world(&self.world))
    }

    /// Whether these keys can be set with the attached motor.
    pub fn allows(&self, sets: &[(String, String)]) -> bool {
        self.attached.as_ref().is_none_or(|attached| sets.iter().all(|(key, _)| attached.allows(key)))
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The file of the running world.
    pub fn source(&self) -> &Source {
        &self.worlds[self.place].source
    }

    /// The names and titles of all worlds, in the order in which they were given, and the place of the running one.
    pub fn worlds(&self) -> (Vec<WorldName>, usize) {
        (self.worlds.iter().map(|listed| listed.name.clone()).collect(), self.place)
    }

    /// Another of the worlds, as its file has it; nothing is changed here.
    ///
    /// # Errors
    /// In a sentence: there is no such world, a file that it refers to no longer exists, or it would exceed the limits of the first.
    #[cfg(not(target_family = "wasm"))]
    pub fn entering(&self, place: usize) -> Result<Self, String> {
        if place >= self.worlds.len() {
            return Err(format!(
                "there is no world {place}: they are counted from 0, and there are {}",
                self.worlds.len()
            ));
        }
        let mut next = self.clone();
        next.place = place;
        next.reset()
    }

    /// All overrides, those of the command line first.
    pub fn sets(&self) -> Vec<String> {
        let changes = self.changes.iter().map(|(key, value)| format!("{key}={value}"));
        self.given.iter().cloned().chain(changes).collect()
    }

    /// The keys set over the file and the command line, in the order in which they were first set.
    pub fn changes(&self) -> &[(String, String)] {
        &self.changes
    }

    /// The text of a world file that is this world, with all overrides written into it.
    ///
    /// # Errors
    /// A file that the world refers to no longer exists.
    pub fn file(&self) -> Result<String, String> {
        self.source().edited(&self.sets()).map_err(|error| message(&error))
    }

    /// The same with a key set; nothing is changed here.
    ///
    /// # Errors
    /// The reader's message, without the place in the text.
    pub fn with(&self, key: &str, value: &str) -> Result<Self, String> {
        self.with_all(&[(key.to_string(), value.to_string())])
    }

    /// The same with several keys set together, all of them or none.
    ///
    /// # Errors
    /// As [`WorldConfig::with`].
    pub fn with_all(&self, sets: &[(String, String)]) -> Result<Self, String> {
        // A coupling is added first: its own keys may follow.
        if let Some((add, rest)) = sets.split_first()
            && adds_damper(&self.world, &add.0, &add.1)
        {
            let next = self.changed(std::slice::from_ref(add)).read()?;
            let same = WorldConfig { generation: self.generation, ..next.clone() };
            return if rest.is_empty() { Ok(next) } else { same.with_all(rest) };
        }
        if let Some((key, _)) = sets.iter().find(|(key, _)| !may_be_set(&self.world, key)) {
            return Err(format!("{key:?} cannot be set while the loop runs"));
        }
        if let Some(attached) = &self.attached
            && let Some((key, _)) = sets.iter().find(|(key, _)| !attached.allows(key))
        {
            return Err(attached.refusal(key));
        }
        let others: Vec<_> = sets.iter().filter_map(|(key, value)| companion(&self.world, key, value)).collect();
        match self.changed(sets).read() {
            Err(refused) if !others.is_empty() => self.changed(&others).changed(sets).read().map_err(|_| refused),
            single => single,
        }
    }

    /// The file with these keys set and no other: a step back to an earlier state, or to the file.
    ///
    /// # Errors
    /// As [`WorldConfig::with`] and [`WorldConfig::reset`].
    pub fn with_only(&self, sets: &[(String, String)]) -> Result<Self, String> {
        let file = self.reset()?;
        if sets.is_empty() { Ok(file) } else { WorldConfig { generation: self.generation, ..file }.with_all(sets) }
    }

    fn changed(&self, sets: &[(String, String)]) -> Self {
        let mut next = self.clone();
        for (key, value) in sets {
            match next.changes.iter_mut().find(|(changed, _)| changed == key) {
                Some((_, old)) => old.clone_from(value),
                None => next.changes.push((key.clone(), value.clone())),
            }
        }
        next
    }

    /// The same with every key as in the file.
    ///
    /// # Errors
    /// A file that the world refers to no longer exists.
    pub fn reset(&self) -> Result<Self, String> {
        let mut next = self.clone();
        next.changes.clear();
        next.read()
    }

    fn read(mut self) -> Result<Self, String> {
        self.world = World::read(self.source(), &self.sets()).map_err(|error| message(&error))?;
        (self.rule)(&self.world, self.source(), &self.sets())?;
        if let Some(attached) = &self.attached {
            attached.hold(&mut self.world)?;
        }
        self.generation = self.generation.wrapping_add(1);
        Ok(self.with_keys())
    }

    /// The keys that can be set, with their ranges.
    pub fn keys(&self) -> &[SettableKey] {
        &self.keys
    }

    fn with_keys(mut self) -> Self {
        // The same text has been read before: this does not fail.
        let mut keys = keys(self.source(), &self.given, &self.sets()).unwrap_or_default();
        if let Some(attached) = &self.attached {
            keys.iter_mut().for_each(|key| attached.bound(key));
        }
        self.keys = keys.into();
        self
    }
}

/// A world's name in a file's: without folders and ending.
pub(crate) fn stem(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or_default().trim_end_matches(".toml")
}

/// Whether two worlds are of one device and of the same times, which describe the hardware; the error is what differs.
#[cfg(not(target_family = "wasm"))]
fn same_device(one: &World, other: &World) -> Result<(), &'static str> {
    let times = |world: &World| (world.sampling.delay, world.sampling.delay_max, world.sampling.interval_max);
    match () {
        () if one.motion != other.motion => Err("its motion"),
        () if one.device != other.device => Err("its [device]"),
        () if one.device.drive.home.is_none() && one.counts_from_device() != other.counts_from_device() => Err(
            "its 0 (with a [[compensation]] of gravity or cogging the device's own, else where the puck is armed; device.drive.home gives both one)",
        ),
        () if times(one) != times(other) => Err("its loop.delay, loop.delay_max or loop.interval_max"),
        () => Ok(()),
    }
}

/// The reader's error without its place.
fn message(error: &Error) -> String {
    match error.key.is_empty() {
        true => error.message.clone(),
        false => format!("{}: {}", error.key, error.message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::WHEEL;
    use hapt_model::EstimatorKind;

    fn config() -> WorldConfig {
        let source = Source::from_text("wheel.toml", WHEEL);
        WorldConfig::new(source, vec!["device.damping=2e-3 N m s/rad".into()]).unwrap()
    }

    fn key(config: &WorldConfig, path: &str) -> SettableKey {
        config.keys().iter().find(|key| key.path == path).cloned().unwrap_or_else(|| panic!("no {path}"))
    }

    #[test]
    fn every_key_has_its_own_unit_and_a_slider_about_its_value() {
        let config = config();
        let spring = key(&config, "couplings.0.stiffness");
        assert_eq!((spring.unit.as_str(), spring.written.as_str()), ("N mm/deg", "17.8 N mm/deg"));
        assert!((spring.value.unwrap() / spring.factor - 17.8).abs() < 1e-12);
        assert_eq!((spring.group.as_str(), spring.label.as_str()), ("spring, puck to wheel", "stiffness"));
        assert!(!spring.changed && !key(&config, "device.damping").changed, "the command line counts as the file");
        for key in config.keys() {
            assert!(key.min < key.max && (!key.log || key.min > 0.0), "{key:?}");
            let value = key.value.unwrap_or(key.min);
            assert!(key.min <= value && value <= key.max, "{key:?}");
            assert_eq!(key.kind == "choice", !key.choices.is_empty() && key.value.is_none(), "{key:?}");
        }
        let method = key(&config, "loop.method");
        assert!(method.choices.contains(&method.written.as_str()) && method.choices.len() == 8);
        assert_eq!(key(&config, "loop.output").written, "end");
        let rest = key(&config, "couplings.0.rest");
        assert_eq!((rest.written.as_str(), rest.unit.as_str(), rest.value), ("0 deg", "deg", Some(0.0)));
        assert!(!config.keys().iter().any(|key| key.path == "loop.window"), "it does nothing here");
    }

    #[test]
    fn a_set_changes_one_key_and_a_reset_restores_it() {
        let before = config();
        let softer = before.with("couplings.0.stiffness", "10 N mm/deg").unwrap();
        assert_eq!((softer.generation, before.generation), (1, 0));
        let spring = key(&softer, "couplings.0.stiffness");
        assert!(spring.changed && spring.written == "10 N mm/deg");
        assert_eq!((spring.min, spring.max), {
            let own = key(&before, "couplings.0.stiffness");
            (own.min, own.max)
        });
        let again = softer.with("couplings.0.stiffness", "12 N mm/deg").unwrap();
        assert_eq!(again.sets().len(), 2, "the last word on a key counts alone");
        let back = again.reset().unwrap();
        assert_eq!((back.world, back.generation), (before.world, 3));
    }

    #[test]
    fn an_earlier_state_is_restored_with_all_its_keys_and_no_other() {
        let before = config();
        let pair = |key: &str, value: &str| (key.to_string(), value.to_string());
        let mine = before.with("loop.period", "2 ms").unwrap().with("loop.method", "tustin").unwrap();
        let other = mine.with("couplings.0.stiffness", "10 N mm/deg").unwrap();
        let back = other.with_only(mine.changes()).unwrap();
        assert_eq!((&back.world, back.changes(), back.generation), (&mine.world, mine.changes(), other.generation + 1));
        let file = back.with_only(&[]).unwrap();
        assert_eq!((file.world, file.generation), (before.world.clone(), back.generation + 1));
        assert!(before.with_only(&[pair("loop.period", "2 ms"), pair("nothing", "1")]).is_err());
    }

    #[test]
    fn the_file_that_is_saved_reads_as_the_world_that_runs() {
        let mine =
            config().with("couplings.0.stiffness", "10 N mm/deg").unwrap().with("loop.estimator", "low-pass").unwrap();
        let saved = WorldConfig::new(Source::from_text("mine.toml", mine.file().unwrap()), Vec::new()).unwrap();
        assert_eq!(saved.world, mine.world);
    }

    #[test]
    fn a_damper_can_be_added_while_the_loop_runs_and_no_other_coupling() {
        let before = config();
        let damper = r#"{ kind = "damper", between = ["wheel", "ground"], damping = "2e-3 N m s/rad" }"#;
        let next = before.with("couplings.1", damper).unwrap();
        assert_eq!((next.world.couplings.len(), next.generation), (2, 1));
        let own = key(&next, "couplings.1.damping");
        assert!(own.changed && own.own.is_none());
        let more = next.with("couplings.1.damping", "3e-3 N m s/rad").unwrap();
        assert_eq!(more.with_only(more.changes()).unwrap().world, more.world);
        assert_eq!(more.reset().unwrap().world, before.world);
        let sneaky = |from: &str, to: &str| damper.replace(from, to);
        for (key, value) in [
            ("couplings.2", damper.to_string()),
            ("couplings.0", damper.to_string()),
            ("couplings.01", damper.to_string()),
            ("couplings.1", sneaky("wheel", "nobody")),
            ("couplings.1", sneaky("rad\"", "rad\", file = \"/etc/passwd\"")),
            ("couplings.1", sneaky("\"damper\"", "\"texture\"")),
            ("couplings.1", sneaky("2e-3", "-2e-3")),
            ("couplings.1", "{}".to_string()),
            ("couplings.1", "1".to_string()),
        ] {
            assert!(before.with(key, &value).is_err(), "{key} = {value}");
        }
    }

    #[test]
    fn the_limits_on_a_motor_are_those_of_the_first_world_whichever_runs() {
        let file = |name: &str, safety: &str| {
            let text = WHEEL.replace("[bodies.wheel]", &format!("[safety]\n{safety}\n[bodies.wheel]"));
            Source::from_text(name, text.replace("[loop]", "[loop]\nestimator = \"difference\""))
        };
        let wide = "overspeed = \"90 rad/s\"\nstall = \"0 s\"\nlink = \"60 s\"\ntorque = \"2 N m\"\nenergy = \"9 J\"";
        let files = vec![file("own.toml", "overspeed = \"30 rad/s\""), file("wide.toml", wide)];
        for profile in [SafetyProfile::Certified, SafetyProfile::Uncertified] {
            let own = WorldConfig::of(files.clone(), Vec::new(), |_, _, _| Ok(())).unwrap();
            let own = own.on("motor".into(), profile).unwrap();
            let entered = own.entering(1).unwrap();
            assert_eq!((entered.source().name.as_str(), entered.generation), ("wide.toml", 1));
            assert_eq!(entered.world.limits(profile), own.world.limits(profile));
            let back = entered.with("loop.period", "2 ms").unwrap().entering(0).unwrap();
            assert_eq!((back.world.limits(profile), back.changes()), (own.world.limits(profile), &[][..]));
        }
    }

    /// Without a home the 0 of one world would be where the puck was armed, and that of the other the device's.
    #[test]
    fn worlds_of_one_session_count_from_the_same_place() {
        let file = |name: &str, home: &str, more: &str| {
            let device = format!("[device.gravity]\ntorque = 0.1\n{home}[bodies.wheel]");
            Source::from_text(name, format!("{}{more}", WHEEL.replace("[bodies.wheel]", &device)))
        };
        let compensation = "[[compensation]]\nof = \"gravity\"\nshare = 0.5\n";
        let of = |home: &str, more: [&str; 2]| {
            let files = ["a.toml", "b.toml"].into_iter().zip(more).map(|(name, more)| file(name, home, more)).collect();
            WorldConfig::of(files, Vec::new(), |_, _, _| Ok(())).map(drop)
        };
        for more in [["", compensation], [compensation, ""]] {
            let refused = of("", more).unwrap_err();
            assert!(refused.contains("b.toml: its 0 ") && refused.contains("a.toml"), "{refused}");
            of("[device.drive]\nhome = 0\n", more).unwrap();
        }
        of("", [compensation; 2]).unwrap();
    }

    #[test]
    fn no_key_has_two_spellings() {
        let config = config();
        assert!(config.with("bodies.wheel.inertia", "1").is_ok());
        for (key, value) in [
            ("bodies.wheel={velocity=20,inertia=1 #.inertia", "\n}"),
            ("bodies.wheel={velocity=20,\ninertia=1 #.inertia", "\n}"),
            ("bodies.wheel.velocity", "20"),
            ("bodies. wheel.inertia", "1"),
            ("bodies.wheel .inertia", "1"),
            (" bodies.wheel.inertia", "1"),
            ("bodies.wheel.inertia ", "1"),
            ("bodies..inertia", "1"),
            ("loop. period", "1 ms"),
            ("device={inertia=1 #.inertia", "\n}"),
            ("couplings.+0.stiffness", "1"),
            ("couplings.0 .stiffness", "1"),
            ("couplings.0=1 #.stiffness", "1"),
        ] {
            let refused = config.with(key, value).map(|next| next.sets()).unwrap_err();
            assert!(refused.contains("cannot be set while the loop runs"), "{key}: {refused}");
        }
    }

    #[test]
    fn no_setting_names_a_file_or_changes_a_waveform() {
        let text = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 1e-3\n[[couplings]]\nkind = \"texture\"\n\
                    between = [\"puck\", \"ground\"]\ntorque = 1e-3\npitch = 1\nsine = [1]\n";
        let config = WorldConfig::new(Source::from_text("w.toml", text), vec![]).unwrap();
        assert!(config.with("couplings.0.torque", "2 N mm").is_ok());
        for (key, value) in [("file", "w.csv"), ("samples", "[1, -1]"), ("sine", "[1]"), ("cosine", "[1]")] {
            let refused = config.with(&format!("couplings.0.{key}"), value).map(|next| next.sets()).unwrap_err();
            assert!(refused.contains("cannot be set while the loop runs"), "{key}: {refused}");
        }
    }

    #[test]
    fn a_choice_sets_the_key_that_it_requires() {
        let config = config();
        let smooth = config.with("loop.estimator", "low-pass").unwrap();
        assert_eq!(smooth.world.sampling.cutoff, Some(100.0), "a tenth of 1 kHz");
        let start = config.with("loop.output", "middle").unwrap().with("loop.method", "tustin").unwrap();
        assert_eq!(start.world.sampling.output.name(), "start");
        // A choice that requires no other key sets none.
        assert_eq!(config.with("loop.method", "tustin").unwrap().sets().len(), 2);
    }

    #[test]
    fn with_a_motor_attached_every_estimator_of_positions_can_be_chosen_and_come_back_to() {
        let text = WHEEL.replace("[loop]", "[loop]\nestimator = \"difference\"");
        let file = vec![Source::from_text("own.toml", text)];
        let own = WorldConfig::of(file, Vec::new(), |_, _, _| Ok(())).unwrap();
        let own = own.on("motor".into(), SafetyProfile::Uncertified).unwrap();
        for name in EstimatorKind::NAMES {
            let chosen = own.with("loop.estimator", name);
            assert_eq!(chosen.is_ok(), *name != "exact", "{name}: {:?}", chosen.as_ref().err());
            // With the keys that the choice set.
            let Ok(chosen) = chosen else { continue };
            let back = own.with_only(chosen.changes());
            assert_eq!(back.map(|back| back.world), Ok(chosen.world), "{name}");
        }
    }

    #[test]
    fn the_reader_accepts_both_ends_of_every_slider() {
        let config = config();
        for key in config.keys().iter().filter(|key| key.kind == "quantity") {
            for end in [key.min, key.max] {
                let value = format!("{} {}", end / key.factor, key.unit);
                let set = config.with(&key.path, &value);
                assert!(set.is_ok() || key.path == "loop.period", "{} = {value}: {:?}", key.path, set.err());
            }
        }
    }

    #[test]
    fn every_shipped_world_has_ordered_sliders() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds");
        let mut seen = 0;
        for entry in ["notes", "devices"].iter().flat_map(|under| std::fs::read_dir(folder.join(under)).unwrap()) {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            let config = WorldConfig::new(Source::open(&path).unwrap(), Vec::new()).unwrap();
            for key in config.keys() {
                let value = key.value.unwrap_or(key.min);
                assert!(key.min <= value && value <= key.max && key.min < key.max, "{}: {key:?}", path.display());
                assert!(!key.group.is_empty() && !key.label.is_empty(), "{key:?}");
            }
            seen += 1;
        }
        assert!(seen >= 12, "{seen} worlds");
    }
}
