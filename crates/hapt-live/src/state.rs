//! The world as it runs: its file, what has been set since, and what the page is told of it.

use hapt_core::SafetyProfile;
use hapt_model::{Drive, Error, Hand, Shape, Source, World};
use hapt_sim::Measures;
use serde_json::{Value, json};

use crate::attached::Attached;
use crate::frames::columns_of;
use crate::keys::{PERIODS, companion, end, keys, kind, may_be_set};
use crate::protocol::{BodySays, KeySays, ScenarioSays, Units, WorldSays};
use crate::sensible;

/// The device that needs no name.
const SIMULATED: &str = "sim";

/// A world file and the changes that pages have made.
#[derive(Clone, Debug)]
pub struct Workbench {
    source: Source,
    /// From the command line.
    given: Vec<String>,
    /// By pages: keys and values, in the order in which they were first set.
    changes: Vec<(String, String)>,
    /// As it stands.
    pub world: World,
    /// Counted from 0 with each change.
    pub generation: u32,
    device: String,
    /// With a motor: what its file says of it.
    attached: Option<Attached>,
}

impl Workbench {
    /// The world of a file with its overrides, to run on the simulated device.
    ///
    /// # Errors
    /// As [`World::read`], and for a period that a page cannot be shown.
    pub fn new(source: Source, given: Vec<String>) -> Result<Self, String> {
        let world = World::read(&source, &given).map_err(|error| error.to_string())?;
        slow_enough(&world)?;
        sensible::check(&world, &source, &given)?;
        Ok(Workbench {
            source,
            given,
            changes: Vec::new(),
            world,
            generation: 0,
            device: SIMULATED.into(),
            attached: None,
        })
    }

    /// The same on another device, as `--device` names it, guarded so. From here on the file's device and limits are ceilings, where a
    /// motor is there.
    ///
    /// # Errors
    /// In a sentence: the core does not take it.
    pub fn on(mut self, device: String, profile: SafetyProfile) -> Result<Self, String> {
        if profile != SafetyProfile::Simulated {
            let attached = Attached::new(&self.world, profile)?;
            attached.hold(&mut self.world)?;
            self.attached = Some(attached);
        }
        Ok(Workbench { device, ..self })
    }

    /// The world of which the certificate is: with a motor on the file's device, whatever has been set.
    pub fn judged(&self) -> World {
        self.attached.as_ref().map_or_else(|| self.world.clone(), |attached| attached.judged(&self.world))
    }

    /// Whether these keys can be set here.
    pub fn leaves(&self, sets: &[(String, String)]) -> bool {
        self.attached.as_ref().is_none_or(|attached| sets.iter().all(|(key, _)| attached.leaves(key)))
    }

    /// The device that it runs on.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The file.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// All overrides as they stand.
    pub fn sets(&self) -> Vec<String> {
        let changes = self.changes.iter().map(|(key, value)| format!("{key}={value}"));
        self.given.iter().cloned().chain(changes).collect()
    }

    /// The same with a key set; nothing is changed here.
    ///
    /// # Errors
    /// In the reader's words, without the place, which nobody typed.
    pub fn with(&self, key: &str, value: &str) -> Result<Self, String> {
        self.with_all(&[(key.to_string(), value.to_string())])
    }

    /// The same with several keys set together, all of them or none.
    ///
    /// # Errors
    /// As [`Workbench::with`].
    pub fn with_all(&self, sets: &[(String, String)]) -> Result<Self, String> {
        if let Some((key, _)) = sets.iter().find(|(key, _)| !may_be_set(&self.world, key)) {
            return Err(format!("{key:?} is no key that can be set while the loop runs"));
        }
        if let Some(attached) = &self.attached
            && let Some((key, _)) = sets.iter().find(|(key, _)| !attached.leaves(key))
        {
            return Err(attached.refusal(key));
        }
        let others: Vec<_> = sets.iter().filter_map(|(key, value)| companion(&self.world, key, value)).collect();
        match self.changed(sets).read() {
            Err(refused) if !others.is_empty() => self.changed(&others).changed(sets).read().map_err(|_| refused),
            alone => alone,
        }
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

    /// The same as the file has it.
    ///
    /// # Errors
    /// When the file's other parts are gone.
    pub fn reset(&self) -> Result<Self, String> {
        let mut next = self.clone();
        next.changes.clear();
        next.read()
    }

    fn read(mut self) -> Result<Self, String> {
        self.world = World::read(&self.source, &self.sets()).map_err(|error| said(&error))?;
        slow_enough(&self.world)?;
        sensible::check(&self.world, &self.source, &self.sets())?;
        if let Some(attached) = &self.attached {
            attached.hold(&mut self.world)?;
        }
        self.generation = self.generation.wrapping_add(1);
        Ok(self)
    }

    /// The keys that can be set.
    pub fn keys(&self) -> Vec<KeySays> {
        // It has been read before, with the same overrides.
        let mut keys = keys(&self.source, &self.given, &self.sets()).unwrap_or_default();
        if let Some(attached) = &self.attached {
            keys.iter_mut().for_each(|key| attached.bound(key));
        }
        keys
    }

    /// What the page is told.
    pub fn says(&self) -> WorldSays {
        let world = &self.world;
        let motion = world.motion;
        WorldSays {
            generation: self.generation,
            title: world.title.clone().unwrap_or_else(|| self.source.name.clone()),
            motion: motion.name(),
            units: Units {
                position: Measures::Position.unit(motion),
                velocity: Measures::Velocity.unit(motion),
                effort: Measures::Effort.unit(motion),
            },
            period_s: world.sampling.period,
            limit: world.device.limit,
            device: self.device.clone(),
            bodies: (world.names.iter().zip(&world.bodies))
                .map(|(name, body)| BodySays { name: name.clone(), inertia: body.inertia })
                .collect(),
            couplings: (0..world.couplings.len()).map(|index| coupling(world, index)).collect(),
            scenarios: (world.scenarios.iter())
                .map(|scenario| ScenarioSays {
                    name: scenario.name.clone(),
                    duration_s: scenario.duration,
                    hand: hand(&scenario.hand),
                })
                .collect(),
            keys: self.keys(),
            columns: columns_of(world),
        }
    }
}

/// A loop that somebody looks at.
fn slow_enough(world: &World) -> Result<(), String> {
    let period = world.sampling.period;
    match PERIODS.contains(&period) {
        true => Ok(()),
        false => {
            Err(format!("loop.period: {period} s is no period for a loop behind a page; 50 us to 100 ms is wanted"))
        }
    }
}

/// The reader's words on a set.
fn said(error: &Error) -> String {
    match error.key.is_empty() {
        true => error.message.clone(),
        false => format!("{}: {}", error.key, error.message),
    }
}

fn hand(hand: &Hand) -> &'static str {
    match &hand.drive {
        Drive::Position(Shape::Step { .. }) => "step",
        Drive::Position(Shape::Ramp { .. }) => "ramp",
        Drive::Position(Shape::Sine { .. }) => "sine",
        Drive::Position(Shape::Path { .. }) => "path",
        Drive::Torque(_) => "torque",
        Drive::Grip { .. } => "grip",
    }
}

/// A coupling, with the numbers by which it is drawn.
fn coupling(world: &World, index: usize) -> Value {
    let Some(coupling) = world.couplings.get(index) else { return Value::Null };
    let ends = [end(world, coupling.first), end(world, coupling.second)];
    let mut says = json!({ "kind": kind(coupling), "between": ends, "key": format!("couplings.{index}") });
    // One number for either friction: the level when sliding.
    let mut law = coupling.law;
    for quantity in law.quantities() {
        says[if quantity.name == "coulomb" { "torque" } else { quantity.name }] = json!(*quantity.value);
    }
    if let Some(side) = coupling.law.side() {
        says["side"] = json!(side.name());
    }
    says
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::WHEEL;

    fn bench() -> Workbench {
        let source = Source::from_text("wheel.toml", WHEEL);
        Workbench::new(source, vec!["device.damping=2e-3 N m s/rad".into()]).unwrap()
    }

    fn key(bench: &Workbench, path: &str) -> KeySays {
        bench.keys().into_iter().find(|key| key.path == path).unwrap_or_else(|| panic!("no {path}"))
    }

    #[test]
    fn every_key_has_its_own_unit_and_a_slider_about_its_value() {
        let bench = bench();
        let spring = key(&bench, "couplings.0.stiffness");
        assert_eq!((spring.unit.as_str(), spring.written.as_str()), ("N mm/deg", "17.8 N mm/deg"));
        assert!((spring.value.unwrap() / spring.factor - 17.8).abs() < 1e-12);
        assert_eq!((spring.group.as_str(), spring.label.as_str()), ("spring, puck to wheel", "stiffness"));
        assert!(!spring.changed && !key(&bench, "device.damping").changed, "the command line's word is the file's");
        for key in bench.keys() {
            assert!(key.min < key.max && (!key.log || key.min > 0.0), "{key:?}");
            let value = key.value.unwrap_or(key.min);
            assert!(key.min <= value && value <= key.max, "{key:?}");
            assert_eq!(key.kind == "choice", !key.choices.is_empty() && key.value.is_none(), "{key:?}");
        }
        let method = key(&bench, "loop.method");
        assert!(method.choices.contains(&method.written.as_str()) && method.choices.len() == 8);
        assert_eq!(key(&bench, "loop.output").written, "end");
        let rest = key(&bench, "couplings.0.rest");
        assert_eq!((rest.written.as_str(), rest.unit.as_str(), rest.value), ("0 deg", "deg", Some(0.0)));
        assert!(!bench.keys().iter().any(|key| key.path == "loop.window"), "it does nothing here");
    }

    #[test]
    fn a_set_changes_one_key_and_a_reset_takes_it_back() {
        let before = bench();
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
    fn no_key_is_another_in_disguise() {
        let bench = bench();
        assert!(bench.with("bodies.wheel.inertia", "1").is_ok());
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
            let refused = bench.with(key, value).map(|next| next.sets()).unwrap_err();
            assert!(refused.contains("is no key that can be set"), "{key}: {refused}");
        }
    }

    #[test]
    fn a_choice_brings_along_what_it_cannot_do_without() {
        let bench = bench();
        let smooth = bench.with("loop.estimator", "low-pass").unwrap();
        assert_eq!(smooth.world.sampling.cutoff, Some(100.0), "a tenth of 1 kHz");
        let start = bench.with("loop.output", "middle").unwrap().with("loop.method", "tustin").unwrap();
        assert_eq!(start.world.sampling.output.name(), "start");
        // And what needs nothing brings nothing.
        assert_eq!(bench.with("loop.method", "tustin").unwrap().sets().len(), 2);
    }

    #[test]
    fn what_every_slider_offers_at_its_ends_the_reader_takes() {
        let bench = bench();
        for key in bench.keys().into_iter().filter(|key| key.kind == "quantity") {
            for end in [key.min, key.max] {
                let value = format!("{} {}", end / key.factor, key.unit);
                let set = bench.with(&key.path, &value);
                assert!(set.is_ok() || key.path == "loop.period", "{} = {value}: {:?}", key.path, set.err());
            }
        }
    }

    #[test]
    fn every_world_that_comes_along_has_its_sliders_in_order() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds");
        let mut seen = 0;
        for entry in ["notes", "devices"].iter().flat_map(|under| std::fs::read_dir(folder.join(under)).unwrap()) {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            let bench = Workbench::new(Source::open(&path).unwrap(), Vec::new()).unwrap();
            for key in bench.keys() {
                let value = key.value.unwrap_or(key.min);
                assert!(key.min <= value && value <= key.max && key.min < key.max, "{}: {key:?}", path.display());
                assert!(!key.group.is_empty() && !key.label.is_empty(), "{key:?}");
            }
            assert_eq!(bench.says().couplings.len(), bench.world.couplings.len());
            seen += 1;
        }
        assert!(seen >= 12, "{seen} worlds");
    }
}
