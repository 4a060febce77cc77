//! Every number of a world under its key's name, for the writer and for sweeps.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_core::{Body, Coupling};
use hapt_plant::spec::{Cogging, Drive, FrictionByPosition, Gravity, Hand, Handle, Shape, Stops, Stribeck, Switching};

use crate::keys::{self, Key};
use crate::kinds::{HandKind, ShapeKind};
use crate::safety::Safety;
use crate::sampling::{Delay, Sampling};
use crate::timing::Timing;
use crate::world::{Compensation, Device, Mounting, World};

/// The place of a number.
pub(crate) enum NumberSlot<'a> {
    Number(&'a mut f64),
    Optional(&'a mut Option<f64>),
    Whole(&'a mut u32),
    OptionalWhole(&'a mut Option<u32>),
    /// In s, or in samples. A new value is in s.
    Delay(&'a mut Delay),
    OptionalDelay(&'a mut Option<Delay>),
}

/// A key's name and its number.
pub(crate) type NumberSlots<'a> = Vec<(&'static str, NumberSlot<'a>)>;

use NumberSlot::{Number, Optional, OptionalWhole, Whole};

impl NumberSlot<'_> {
    /// `None` where the key is absent.
    pub fn get(&self) -> Option<f64> {
        match self {
            Number(x) => Some(**x),
            Optional(x) => **x,
            Whole(n) => Some(f64::from(**n)),
            OptionalWhole(n) => n.map(f64::from),
            NumberSlot::Delay(Delay::Seconds(x) | Delay::Samples(x)) => Some(*x),
            NumberSlot::OptionalDelay(delay) => delay.map(|(Delay::Seconds(x) | Delay::Samples(x))| x),
        }
    }

    /// Whether it is a number of periods.
    pub fn is_in_samples(&self) -> bool {
        match self {
            NumberSlot::Delay(delay) => matches!(delay, Delay::Samples(_)),
            NumberSlot::OptionalDelay(delay) => matches!(delay, Some(Delay::Samples(_))),
            Number(_) | Optional(_) | Whole(_) | OptionalWhole(_) => false,
        }
    }

    /// In SI; a delay in samples is converted to seconds. `None` where the key is absent.
    fn si(&self, period: f64) -> Option<f64> {
        self.get().map(|value| if self.is_in_samples() { value * period } else { value })
    }

    /// Sets the number; returns whether the place takes `value`: none takes one that is not finite, that of a whole number no other.
    pub fn set(self, value: f64) -> bool {
        // A coupling with NaN is unequal to itself, and would no longer be found as that of its compensation.
        if !value.is_finite() {
            return false;
        }
        let whole = || (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0).then_some(value as u32);
        match self {
            Number(x) => *x = value,
            Optional(x) => *x = Some(value),
            Whole(n) => return whole().map(|whole| *n = whole).is_some(),
            OptionalWhole(n) => return whole().map(|whole| *n = Some(whole)).is_some(),
            NumberSlot::Delay(delay) => *delay = Delay::Seconds(value),
            NumberSlot::OptionalDelay(delay) => *delay = Some(Delay::Seconds(value)),
        }
        true
    }
}

pub(crate) fn sampling(sampling: &mut Sampling) -> NumberSlots<'_> {
    vec![
        ("period", Number(&mut sampling.period)),
        ("advance", Whole(&mut sampling.advance)),
        ("bodies_every", Whole(&mut sampling.bodies_every)),
        ("delay", NumberSlot::Delay(&mut sampling.delay)),
        ("delay_max", NumberSlot::OptionalDelay(&mut sampling.delay_max)),
        ("interval_max", Optional(&mut sampling.interval_max)),
        ("filter", Optional(&mut sampling.filter)),
        ("recentre", Optional(&mut sampling.recentre)),
        ("cutoff", Optional(&mut sampling.cutoff)),
        ("acceleration", Optional(&mut sampling.acceleration)),
        ("every", Whole(&mut sampling.every)),
        ("window", Whole(&mut sampling.window)),
    ]
}

pub(crate) fn device(device: &mut Device) -> NumberSlots<'_> {
    vec![
        ("inertia", Number(&mut device.inertia)),
        ("damping", Number(&mut device.damping)),
        ("friction", Number(&mut device.friction)),
        ("friction_backward", Optional(&mut device.friction_backward)),
        ("lag", Number(&mut device.lag)),
        ("limit", Optional(&mut device.limit)),
        ("encoder", Optional(&mut device.encoder)),
        ("levels", OptionalWhole(&mut device.levels)),
    ]
}

pub(crate) fn mounting(drive: &mut Mounting) -> NumberSlots<'_> {
    vec![("gear", Optional(&mut drive.gear)), ("home", Optional(&mut drive.home))]
}

/// Those of a handle that is there.
pub(crate) fn handle(handle: &mut Option<Handle>) -> NumberSlots<'_> {
    let Some(Handle { inertia, stiffness, damping }) = handle else { return Vec::new() };
    vec![("inertia", Number(inertia)), ("stiffness", Number(stiffness)), ("damping", Number(damping))]
}

/// Those of a friction that changes with the position, without its waveform.
pub(crate) fn friction_by_position(changes: &mut Option<FrictionByPosition>) -> NumberSlots<'_> {
    let Some(FrictionByPosition { share, pitch, phase, waveform: _ }) = changes else { return Vec::new() };
    vec![("share", Number(share)), ("pitch", Number(pitch)), ("phase", Number(phase))]
}

/// Those of a Stribeck friction that is there.
pub(crate) fn stribeck(stribeck: &mut Option<Stribeck>) -> NumberSlots<'_> {
    let Some(Stribeck { torque, velocity }) = stribeck else { return Vec::new() };
    vec![("torque", Number(torque)), ("velocity", Number(velocity))]
}

/// Those of end stops that are there.
pub(crate) fn stops(stops: &mut Option<Stops>) -> NumberSlots<'_> {
    let Some(Stops { low, high, stiffness, damping }) = stops else { return Vec::new() };
    vec![
        ("low", Optional(low)),
        ("high", Optional(high)),
        ("stiffness", Number(stiffness)),
        ("damping", Number(damping)),
    ]
}

/// Those of a gravity that is there.
pub(crate) fn gravity(gravity: &mut Option<Gravity>) -> NumberSlots<'_> {
    let Some(Gravity { torque, phase }) = gravity else { return Vec::new() };
    vec![("torque", Number(torque)), ("phase", Number(phase))]
}

/// Those of a cogging that is there, without its waveform.
pub(crate) fn cogging(cogging: &mut Option<Cogging>) -> NumberSlots<'_> {
    let Some(Cogging { torque, pitch, phase, waveform: _ }) = cogging else { return Vec::new() };
    vec![("torque", Number(torque)), ("pitch", Number(pitch)), ("phase", Number(phase))]
}

pub(crate) fn safety(safety: &mut Safety) -> NumberSlots<'_> {
    vec![
        ("fade", Number(&mut safety.fade)),
        ("velocity", Optional(&mut safety.velocity)),
        ("jump", Optional(&mut safety.jump)),
        ("overspeed", Optional(&mut safety.overspeed)),
        ("stuck", Optional(&mut safety.stuck)),
        ("torque", Optional(&mut safety.torque)),
        ("slew", Optional(&mut safety.slew)),
        ("rms", Optional(&mut safety.rms)),
        ("heating", Number(&mut safety.heating)),
        ("driver_rms", Optional(&mut safety.driver_rms)),
        ("driver_heating", Number(&mut safety.driver_heating)),
        ("stall", Optional(&mut safety.stall)),
        ("link", Optional(&mut safety.link)),
        ("energy", Optional(&mut safety.energy)),
        ("pulse", Optional(&mut safety.pulse)),
        ("brake", Number(&mut safety.brake)),
    ]
}

pub(crate) fn body(body: &mut Body) -> NumberSlots<'_> {
    vec![
        ("inertia", Number(&mut body.inertia)),
        ("position", Number(&mut body.position)),
        ("velocity", Number(&mut body.velocity)),
    ]
}

/// A coupling's kind and its numbers; a compensating damper's damping is not a number.
pub(crate) fn coupling(coupling: &mut Coupling) -> (&'static str, NumberSlots<'_>) {
    let kind = coupling.law.kind().name();
    let takes_limit = coupling.law.takes_limit();
    let mut slots: NumberSlots<'_> =
        coupling.law.quantities().map(|quantity| (quantity.name, Number(quantity.value))).collect();
    if takes_limit {
        slots.push(("limit", Optional(&mut coupling.limit)));
    }
    (kind, slots)
}

/// Those of a compensation; the velocity is a key of friction's only, the cutoff of inertia's.
pub(crate) fn compensation(Compensation { of: _, share, velocity, cutoff }: &mut Compensation) -> NumberSlots<'_> {
    let velocity = velocity.as_mut().map(|velocity| ("velocity", Number(velocity)));
    let cutoff = cutoff.as_mut().map(|cutoff| ("cutoff", Number(cutoff)));
    std::iter::once(("share", Number(share))).chain(velocity).chain(cutoff).collect()
}

/// A hand's kind and its numbers, those of `moves` apart.
pub(crate) fn hand(hand: &mut Hand) -> (&'static str, NumberSlots<'_>) {
    let kind = HandKind::of(&hand.drive).name();
    let release = ("release", Optional(&mut hand.release));
    let mut slots = match &mut hand.drive {
        Drive::Position(moves) => shape(moves).1,
        Drive::Torque(_) => Vec::new(),
        Drive::Grip { inertia, damping, stiffness, moves: _, switching } => {
            let mut slots =
                vec![("inertia", Number(inertia)), ("damping", Number(damping)), ("stiffness", Number(stiffness))];
            if let Some(Switching { hold, open }) = switching {
                slots.extend([("hold", Number(hold)), ("open", Number(open))]);
            }
            slots
        }
    };
    slots.push(release);
    (kind, slots)
}

/// A timing's kind and its numbers; those of a pattern are lists.
pub(crate) fn timing(timing: &mut Timing) -> (&'static str, NumberSlots<'_>) {
    let kind = timing.kind().name();
    let slots = match timing {
        Timing::Random { seed, shortest } => vec![("seed", Whole(seed)), ("shortest", Optional(shortest))],
        Timing::Even | Timing::Pattern { .. } | Timing::Recorded { .. } | Timing::Worst => Vec::new(),
    };
    (kind, slots)
}

/// The shape in a hand's `moves`.
pub(crate) fn moves(hand: &mut Hand) -> Option<&mut Shape> {
    match &mut hand.drive {
        Drive::Position(_) => None,
        Drive::Torque(moves) | Drive::Grip { moves, .. } => Some(moves),
    }
}

/// A shape's kind and its numbers.
pub(crate) fn shape(shape: &mut Shape) -> (&'static str, NumberSlots<'_>) {
    let kind = ShapeKind::of(shape).name();
    let slots = match shape {
        Shape::Step { to, at } => vec![("to", Number(to)), ("at", Number(at))],
        Shape::Ramp { to, at, over } => vec![("to", Number(to)), ("at", Number(at)), ("over", Number(over))],
        Shape::Sine { amplitude, frequency, phase } => {
            vec![("amplitude", Number(amplitude)), ("frequency", Number(frequency)), ("phase", Number(phase))]
        }
        Shape::Path { .. } => Vec::new(),
    };
    (kind, slots)
}

/// The slots of a table, its place in the table of keys, its kind, and the kind of the hand around it.
struct Table<'a> {
    pattern: &'static str,
    kind: Option<&'static str>,
    hand: Option<&'static str>,
    slots: NumberSlots<'a>,
}

impl World {
    fn table(&mut self, path: &[&str]) -> Option<Table<'_>> {
        let plain = |pattern, slots| Table { pattern, kind: None, hand: None, slots };
        Some(match *path {
            ["loop"] => plain("loop", sampling(&mut self.sampling)),
            ["device"] => plain("device", device(&mut self.device)),
            ["device", "drive"] => plain("device.drive", mounting(&mut self.device.drive)),
            ["device", "handle"] => plain("device.handle", handle(&mut self.device.handle)),
            ["device", "friction_by_position"] => {
                plain("device.friction_by_position", friction_by_position(&mut self.device.friction_by_position))
            }
            ["device", "stribeck"] => plain("device.stribeck", stribeck(&mut self.device.stribeck)),
            ["device", "stops"] => plain("device.stops", stops(&mut self.device.stops)),
            ["device", "gravity"] => plain("device.gravity", gravity(&mut self.device.torque.gravity)),
            ["device", "cogging"] => plain("device.cogging", cogging(&mut self.device.torque.cogging)),
            ["safety"] => plain("safety", safety(&mut self.safety)),
            ["bodies", name] => {
                let index = self.names.iter().position(|body| body == name)?;
                plain("bodies.*", body(self.bodies.get_mut(index)?))
            }
            ["couplings", index] => {
                // That of a compensation follows from its own table.
                let place = index.parse::<usize>().ok().filter(|place| !self.compensating().contains(&Some(*place)))?;
                let (kind, slots) = coupling(self.couplings.get_mut(place)?);
                Table { kind: Some(kind), ..plain("couplings.*", slots) }
            }
            ["compensation", index] => {
                plain("compensation.*", compensation(self.compensations.get_mut(index.parse::<usize>().ok()?)?))
            }
            ["scenarios", name, ref inner @ ..] => {
                let scenario = self.scenarios.iter_mut().find(|scenario| scenario.name == name)?;
                match inner {
                    [] => plain("scenarios.*", vec![("duration", Number(&mut scenario.duration))]),
                    ["timing"] => {
                        let (kind, slots) = timing(&mut scenario.timing);
                        Table { kind: Some(kind), ..plain("scenarios.*.timing", slots) }
                    }
                    ["hand"] => {
                        let (kind, slots) = hand(&mut scenario.hand);
                        Table { kind: Some(kind), ..plain("scenarios.*.hand", slots) }
                    }
                    ["hand", "moves"] => {
                        let around = hand(&mut scenario.hand).0;
                        let (kind, slots) = shape(moves(&mut scenario.hand)?);
                        Table { kind: Some(kind), hand: Some(around), ..plain("scenarios.*.hand.moves", slots) }
                    }
                    _ => return None,
                }
            }
            _ => return None,
        })
    }

    /// Puts a number, in SI, where the dotted path of its key leads: `couplings.0.stiffness`. Compensations follow it. The only checks are that
    /// it is finite, and whole where the key takes a whole number: the changed world may be one that no file can express.
    ///
    /// `false`, and nothing is changed, where this world has no number under that key, or one that takes no such value.
    pub fn set_number(&mut self, path: &str, value: f64) -> bool {
        let names: Vec<&str> = path.split('.').map(str::trim).collect();
        let Some((name, table)) = names.split_last() else { return false };
        let compensating = self.compensating();
        let Some(table) = self.table(table) else { return false };
        let is_set = table.slots.into_iter().find(|(key, _)| key == name).is_some_and(|(_, slot)| slot.set(value));
        self.compensate(&compensating);
        is_set
    }

    /// The number in SI where the dotted path of its key leads; `None` where there is none.
    pub fn number(&self, path: &str) -> Option<f64> {
        let names: Vec<&str> = path.split('.').map(str::trim).collect();
        let (name, table) = names.split_last()?;
        let (period, mut world) = (self.sampling.period, self.clone());
        world.table(table)?.slots.iter().find(|(key, _)| key == name)?.1.si(period)
    }

    /// The row of the table of keys for a dotted path to a number of this world; `None` where there is no number.
    pub fn key(&self, path: &str) -> Option<&'static Key> {
        let names: Vec<&str> = path.split('.').map(str::trim).collect();
        let (name, table) = names.split_last()?;
        let mut world = self.clone();
        let table = world.table(table)?;
        let (name, _) = table.slots.iter().find(|(key, _)| key == name)?;
        keys::rows(table.pattern).find(|key| key.name() == *name && key.belongs(table.kind, table.hand, self.motion))
    }
}

#[cfg(test)]
mod tests {
    use hapt_core::Law;

    use super::*;
    use crate::keys::{KEYS, Takes};
    use crate::{Source, parameters};

    const FILE: &str = r#"
        [loop]
        period = "1 ms"
        delay = "0.5 ms"
        delay_max = "0.7 ms"
        interval_max = "1.5 ms"
        estimator = "low-pass"
        cutoff = "50 Hz"
        acceleration = "1000 rad/s^2"
        [device]
        inertia = 1e-3
        limit = 1
        encoder = 4000
        levels = 200
        friction = 0.02
        [device.gravity]
        torque = 0.1
        phase = 0.2
        [device.cogging]
        torque = 0.01
        pitch = 0.3
        sine = [1]
        [device.drive]
        gear = 5
        home = 0.5
        [safety]
        velocity = 60
        link = 0.5
        [device.handle]
        inertia = 5e-4
        stiffness = 20
        [bodies.wheel]
        inertia = 0.02
        [bodies.nut]
        inertia = 0.03
        [[couplings]]
        kind = "spring"
        between = ["puck", "wheel"]
        stiffness = 1
        [[couplings]]
        kind = "spring"
        between = ["puck", "ground"]
        stiffness = 1
        limit = 2
        [[couplings]]
        kind = "damper"
        between = ["wheel", "nut"]
        damping = 1
        [[couplings]]
        kind = "wall"
        between = ["puck", "ground"]
        side = "above"
        at = 1
        stiffness = 2
        [[couplings]]
        kind = "detent"
        between = ["puck", "ground"]
        torque = 1
        pitch = 0.5
        [[couplings]]
        kind = "dead-band"
        between = ["puck", "ground"]
        stiffness = 1
        width = 0.5
        [[couplings]]
        kind = "magnet"
        between = ["puck", "ground"]
        torque = 1
        width = 0.5
        [[couplings]]
        kind = "texture"
        between = ["puck", "ground"]
        torque = 1
        pitch = 0.5
        sine = [1]
        [[couplings]]
        kind = "friction"
        between = ["puck", "ground"]
        torque = 0.1
        [[couplings]]
        kind = "friction"
        between = ["puck", "ground"]
        coulomb = 0.1
        stribeck = 0.2
        stribeck_velocity = 0.1
        bristle_stiffness = 10
        bristle_damping = 0.1
        viscous = 0.1
        [[couplings]]
        kind = "constant"
        between = ["wheel", "ground"]
        torque = 0.1
        [[compensation]]
        of = "cogging"
        share = 0.4
        [[compensation]]
        of = "friction"
        share = 0.5
        velocity = 0.2
        [[compensation]]
        of = "gravity"
        [scenarios.hold]
        duration = 1
        hand = { kind = "step", to = 1, release = 0.5 }
        timing = { kind = "random", seed = 7, shortest = 0.6e-3 }
        [scenarios.swing]
        duration = 1
        hand = { kind = "sine", amplitude = 1, frequency = 2 }
        [scenarios.push]
        duration = 1
        hand = { kind = "torque", moves = { kind = "ramp", to = 1, over = 0.5 } }
        [scenarios.lean]
        duration = 1
        hand = { kind = "grip", inertia = 1e-4, moves = { kind = "sine", amplitude = 1, frequency = 2 } }
    "#;

    /// A number set by its path is the number that an override of that path would have been read as.
    #[test]
    fn every_number_is_where_its_override_goes() {
        let source = Source::from_text("w.toml", FILE);
        let world = World::read(&source, &[]).unwrap();
        let mut set = 0;
        for parameter in parameters(&source, &[]).unwrap() {
            let Some(key) = world.key(&parameter.path) else {
                assert!(parameter.si.is_none(), "{} is a number", parameter.path);
                continue;
            };
            let value = if let Takes::Whole { step, .. } = key.takes { 4.0 * step as f64 } else { 0.75 };
            let mut changed = world.clone();
            assert!(changed.set_number(&parameter.path, value), "{}", parameter.path);
            let read = World::read(&source, &[format!("{}={value}", parameter.path)]);
            if let Ok(read) = read {
                let written = World::read(&Source::from_text("w.toml", changed.to_toml()), &[]);
                assert_eq!(written.as_ref().ok(), Some(&read), "{}", parameter.path);
                assert_eq!(changed, read, "{}", parameter.path);
                assert_ne!(changed, world, "{}", parameter.path);
                set += 1;
            }
        }
        assert!(set > 40, "{set}");
    }

    /// The torque that follows from a compensation is no number of the file, and that of another coupling stays as it is.
    #[test]
    fn a_number_of_the_device_moves_its_compensation_only() {
        let mut world = World::read(&Source::from_text("w.toml", FILE), &[]).unwrap();
        let (before, own) = (world.couplings.clone(), world.couplings.len() - world.compensations.len());
        assert!(!world.set_number(&format!("couplings.{own}.torque"), 1.0));
        assert!(world.set_number("device.gravity.torque", 0.3));
        for (i, (old, new)) in before.iter().zip(&world.couplings).enumerate() {
            assert_eq!(old == new, i + 1 < before.len(), "{i}");
        }
        let [old, new] = [&before, &world.couplings].map(|all| *all.last().unwrap());
        let torque = |coupling: Coupling| {
            let Law::Detent { torque, .. } = coupling.law else { panic!("{coupling:?}") };
            torque
        };
        assert!((torque(new) - 3.0 * torque(old)).abs() < 1e-12);
        // A world whose coupling was made by hand keeps it.
        world.couplings.pop();
        let kept = world.couplings.clone();
        assert!(world.set_number("device.gravity.torque", 0.4));
        assert_eq!(world.couplings, kept);
    }

    /// What is no number changes nothing: a compensation keeps its coupling, which follows the device afterwards as before.
    #[test]
    fn no_number_takes_what_is_not_finite() {
        let source = Source::from_text("w.toml", FILE);
        let world = World::read(&source, &[]).unwrap();
        for parameter in parameters(&source, &[]).unwrap() {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut changed = world.clone();
                assert!(!changed.set_number(&parameter.path, value), "{} = {value}", parameter.path);
                assert_eq!(changed, world, "{} = {value}", parameter.path);
            }
        }
        let [mut once, mut tried] = [world.clone(), world];
        assert!(
            !tried.set_number("compensation.2.share", f64::NAN) && !tried.set_number("device.gravity.torque", f64::NAN)
        );
        for world in [&mut once, &mut tried] {
            assert!(world.set_number("device.gravity.torque", 0.3) && world.set_number("compensation.2.share", 0.5));
        }
        assert_eq!(once, tried);
    }

    #[test]
    fn a_whole_number_takes_no_half() {
        let mut world = World::read(&Source::from_text("w.toml", FILE), &[]).unwrap();
        let before = world.clone();
        assert!(!world.set_number("loop.window", 2.5));
        assert!(!world.set_number("loop.method", 1.0));
        assert!(!world.set_number("couplings.9.stiffness", 1.0));
        assert!(!world.set_number("", 1.0));
        assert_eq!(world, before);
    }

    /// Every quantity of the table of keys has its slot, under some kind.
    #[test]
    fn no_number_of_the_table_is_forgotten() {
        let source = Source::from_text("w.toml", FILE);
        let world = World::read(&source, &[]).unwrap();
        let paths: Vec<String> = parameters(&source, &[]).unwrap().into_iter().map(|p| p.path).collect();
        let star = |path: &str| {
            let names: Vec<&str> = path.split('.').collect();
            let named = |i: usize| i == 1 && ["bodies", "couplings", "scenarios"].contains(&names[0]);
            names.iter().enumerate().map(|(i, n)| if named(i) { "*" } else { *n }).collect::<Vec<_>>().join(".")
        };
        for key in KEYS {
            let number = matches!(key.takes, Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::Whole { .. });
            let seen = paths.iter().filter(|path| star(path) == key.path);
            if number {
                assert!(seen.clone().any(|path| world.key(path).is_some()) || seen.count() == 0, "{}", key.path);
            }
        }
    }
}
