//! The effects that a host has created, and their playback.

use hapt_core::Number;
use hapt_core::wheel::{Effect, Sides};

use super::descriptor::{EFFECTS, FULL, INFINITE, id};
use super::report::{Common, Condition, Control, Envelope, Kind, Operation, Periodic, Report};

/// The full scale of the reports on this wheel, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Of every torque, N·m.
    pub torque: f32,
    /// Of a spring's offset and dead band, rad; a coefficient of full scale gives the whole torque at this angle.
    pub angle: f32,
    /// The same of a damper, rad/s.
    pub velocity: f32,
    /// The same of inertia, rad/s².
    pub acceleration: f32,
}

impl Scale {
    /// Of a wheel that is turned by `half` rad to either side and gives `limit` N·m: a damper of full scale gives the whole torque in a quick turn,
    /// at 10 rad/s, inertia at 200 rad/s².
    #[must_use]
    pub fn of_wheel(limit: f64, half: f64) -> Self {
        Scale { torque: limit as f32, angle: half as f32, velocity: 10.0, acceleration: 200.0 }
    }
}

#[derive(Clone, Copy, Debug)]
struct Playing {
    /// µs
    since: u64,
    loops: u8,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    common: Common,
    envelope: Envelope,
    condition: Condition,
    periodic: Periodic,
    magnitude: i16,
    ramp: (i16, i16),
    playing: Option<Playing>,
    /// The time of its last start by a button, µs.
    triggered: u64,
}

/// The effects, managed by the device. Times are in µs, on any clock that does not go back.
#[derive(Clone, Copy, Debug)]
pub struct Pool {
    slots: [Option<Slot>; EFFECTS],
    /// The answer to the last request for a place.
    loaded: (u8, u8),
    gain: i16,
    enabled: bool,
    paused: Option<u64>,
    pressed: u16,
    /// The time of the last report, µs.
    received_at: u64,
    /// Whether the time since then exceeds [`SILENCE`].
    silent: bool,
    revision: u32,
}

/// In µs: effects that can do unlimited work on the wheel (a torque, a damper with an offset) pause when the host has sent nothing for this time,
/// until its next report. A game that hangs leaves no torque on. Springs, frictions and inertia stay: no hand draws energy from them.
pub const SILENCE: u64 = 10_000_000;

const SUCCESS: u8 = 1;
const FULL_POOL: u8 = 2;
const FAILED: u8 = 3;

impl Default for Pool {
    fn default() -> Self {
        Self::new()
    }
}

impl Pool {
    /// Without effects, actuators enabled, at full gain.
    #[must_use]
    pub const fn new() -> Self {
        Pool {
            slots: [None; EFFECTS],
            loaded: (0, FAILED),
            gain: FULL,
            enabled: true,
            paused: None,
            pressed: 0,
            received_at: 0,
            silent: false,
            revision: 0,
        }
    }

    /// A number that differs after every change of the playing effects.
    #[must_use]
    pub fn revision(&self) -> u32 {
        self.revision
    }

    /// Takes a report. A report on an effect that is not in the pool changes nothing, and returns false; but an effect's own report creates it:
    /// a reset that was sent before the effect was created may arrive after its creation.
    pub fn take(&mut self, report: &Report, now: u64) -> bool {
        self.received_at = now;
        self.revision = self.revision.wrapping_add(1);
        match *report {
            Report::Create(kind) => self.create(kind),
            Report::Free { block } => self.slots.get_mut(block).and_then(Option::take).is_some(),
            Report::Gain(gain) => {
                self.gain = gain;
                true
            }
            Report::Control(control) => {
                self.control(control, now);
                true
            }
            Report::Operation { block, operation, loops } => self.operate(block, operation, loops, now),
            Report::Effect { block, common } => {
                if let Some(empty @ None) = self.slots.get_mut(block) {
                    *empty = Some(Slot::new(common.kind));
                }
                self.change(block, |slot| slot.common = common)
            }
            Report::Envelope { block, envelope } => self.change(block, |slot| slot.envelope = envelope),
            Report::Condition { axis: 0, block, condition } => self.change(block, |slot| slot.condition = condition),
            Report::Condition { block, .. } => self.change(block, |_| {}),
            Report::Periodic { block, periodic } => self.change(block, |slot| slot.periodic = periodic),
            Report::Constant { block, magnitude } => self.change(block, |slot| slot.magnitude = magnitude),
            Report::Ramp { block, start, end } => self.change(block, |slot| slot.ramp = (start, end)),
        }
    }

    fn change(&mut self, block: usize, with: impl FnOnce(&mut Slot)) -> bool {
        let slot = self.slots.get_mut(block).and_then(Option::as_mut);
        slot.map(with).is_some()
    }

    fn create(&mut self, kind: Kind) -> bool {
        let free = self.slots.iter_mut().enumerate().find(|(_, slot)| slot.is_none());
        let Some((block, slot)) = free else {
            self.loaded = (0, FULL_POOL);
            return false;
        };
        *slot = Some(Slot::new(kind));
        self.loaded = (block as u8 + 1, SUCCESS);
        true
    }

    fn operate(&mut self, block: usize, operation: Operation, loops: u8, now: u64) -> bool {
        let exists = self.slots.get(block).is_some_and(Option::is_some);
        if exists && operation == Operation::StartSolo {
            self.stop_all();
        }
        let since = self.paused.unwrap_or(now);
        self.change(block, |slot| {
            slot.playing = (operation != Operation::Stop).then_some(Playing { since, loops: loops.max(1) });
        })
    }

    fn control(&mut self, control: Control, now: u64) {
        match control {
            Control::Enable => self.enabled = true,
            Control::Disable => self.enabled = false,
            Control::StopAll => self.stop_all(),
            Control::Reset => {
                *self = Pool { revision: self.revision, pressed: self.pressed, ..Pool::new() };
            }
            Control::Pause => self.paused = self.paused.or(Some(now)),
            Control::Continue => {
                if let Some(paused) = self.paused.take() {
                    let by = now.saturating_sub(paused);
                    for playing in self.slots.iter_mut().flatten().filter_map(|slot| slot.playing.as_mut()) {
                        playing.since = playing.since.saturating_add(by);
                    }
                }
            }
        }
    }

    /// Stops all effects: the host has suspended or released the device, or has requested it.
    pub fn stop_all(&mut self) {
        self.revision = self.revision.wrapping_add(1);
        for slot in self.slots.iter_mut().flatten() {
            slot.playing = None;
        }
    }

    /// Sets the pressed buttons, the first in the lowest bit: they start the effects that they trigger.
    pub fn press(&mut self, buttons: u16, now: u64) {
        let before = self.pressed;
        self.pressed = buttons;
        for slot in self.slots.iter_mut().flatten() {
            let bit =
                u32::from(slot.common.button).checked_sub(1).and_then(|shift| 1_u16.checked_shl(shift)).unwrap_or(0);
            let repeats = !matches!(slot.common.repeat, 0 | INFINITE)
                && now.saturating_sub(slot.triggered) >= 1000 * u64::from(slot.common.repeat);
            if buttons & bit != 0 && (before & bit == 0 || repeats) {
                slot.playing = Some(Playing { since: now, loops: 1 });
                slot.triggered = now;
                self.revision = self.revision.wrapping_add(1);
            }
        }
    }

    /// A feature report to the host, with its id: the answer to the last request for a place, or the pool. `None` for other ids.
    #[must_use]
    pub fn feature(&self, report: u8) -> Option<[u8; 5]> {
        let free = self.slots.iter().filter(|slot| slot.is_none()).count() as u8;
        match report {
            id::LOAD => Some([id::LOAD, self.loaded.0, self.loaded.1, free, 0]),
            id::POOL => Some([id::POOL, EFFECTS as u8, 0, EFFECTS as u8, 1]),
            _ => None,
        }
    }

    /// The effects that play now, for [`hapt_core::wheel::Wheel::step`], and their number. Effects that have ended are removed.
    pub fn effects(&mut self, now: u64, scale: &Scale) -> ([Effect<f32>; EFFECTS], usize) {
        let mut all = [Effect::Torque(0.0); EFFECTS];
        let mut count = 0;
        if !self.enabled || self.paused.is_some() {
            return (all, count);
        }
        let gain = share(self.gain);
        let silent = now.saturating_sub(self.received_at) > SILENCE;
        if silent != self.silent {
            self.silent = silent;
            self.revision = self.revision.wrapping_add(1);
        }
        for slot in self.slots.iter_mut().flatten() {
            let Some(time) = slot.time(now) else { continue };
            let Some(time) = time else {
                slot.playing = None;
                self.revision = self.revision.wrapping_add(1);
                continue;
            };
            if silent && slot.can_work() {
                continue;
            }
            if let (Some(effect), Some(place)) = (slot.effect(time, gain, scale), all.get_mut(count)) {
                *place = effect;
                count += 1;
            }
        }
        (all, count)
    }

    /// Whether an effect is started and has not ended, for any torque.
    #[must_use]
    pub fn plays(&self, now: u64) -> bool {
        let goes_on = |slot: &Slot| slot.time(now).is_some_and(|time| time.is_some());
        self.enabled && self.paused.is_none() && self.slots.iter().flatten().any(goes_on)
    }

    /// Whether an effect would play if the host were not silent, at the time of the last [`Pool::effects`].
    #[must_use]
    pub fn pauses(&self) -> bool {
        self.silent && self.slots.iter().flatten().any(|slot| slot.playing.is_some() && slot.can_work())
    }
}

/// A level as a part of full scale.
fn share(level: i16) -> f32 {
    f32::from(level) / f32::from(FULL)
}

impl Slot {
    fn new(kind: Kind) -> Self {
        let common = Common { kind, duration: INFINITE, repeat: 0, delay: 0, gain: FULL, button: 0, direction: None };
        Slot {
            common,
            envelope: Envelope::default(),
            condition: Condition::default(),
            periodic: Periodic::default(),
            magnitude: 0,
            ramp: (0, 0),
            playing: None,
            triggered: 0,
        }
    }

    /// Whether it can do work on the wheel for as long as it plays.
    fn can_work(&self) -> bool {
        match self.common.kind {
            Kind::Spring | Kind::Inertia | Kind::Friction => false,
            Kind::Damper => self.condition.offset != 0,
            Kind::Constant | Kind::Ramp | Kind::Square | Kind::Sine => true,
            Kind::Triangle | Kind::SawtoothUp | Kind::SawtoothDown => true,
        }
    }

    /// `None` when it does not play, `Some(None)` when it has ended; else the µs since its turn began, and -1 before its delay is over.
    fn time(&self, now: u64) -> Option<Option<i64>> {
        let playing = self.playing?;
        let delay = 1000 * u64::from(self.common.delay);
        let Some(time) = now.saturating_sub(playing.since).checked_sub(delay) else { return Some(Some(-1)) };
        let time = i64::try_from(time).unwrap_or(i64::MAX);
        let Some(length) = self.length() else { return Some(Some(time)) };
        if playing.loops != 255 && time >= length * i64::from(playing.loops) {
            return Some(None);
        }
        Some(Some(time % length))
    }

    /// µs, where it ends.
    fn length(&self) -> Option<i64> {
        let duration = self.common.duration;
        (duration != INFINITE && duration != 0).then_some(1000 * i64::from(duration))
    }

    /// The level of a torque of `magnitude` under the envelope.
    fn enveloped(&self, magnitude: f32, time: i64) -> f32 {
        let Envelope { attack_level, fade_level, attack_time, fade_time } = self.envelope;
        let (attack, fade) = (1000 * i64::from(attack_time), 1000 * i64::from(fade_time));
        let sign = if magnitude < 0.0 { -1.0 } else { 1.0 };
        let between = |level: i16, at: i64, of: i64| {
            let from = sign * share(level);
            from + (magnitude - from) * (at as f32 / of as f32)
        };
        if time < attack {
            return between(attack_level, time, attack);
        }
        match self.length() {
            Some(length) if length - time < fade => between(fade_level, length - time, fade),
            _ => magnitude,
        }
    }

    fn effect(&self, time: i64, device_gain: f32, scale: &Scale) -> Option<Effect<f32>> {
        if time < 0 {
            return None;
        }
        let gain = device_gain * share(self.common.gain);
        let sides = |unit: f32| Sides {
            offset: share(self.condition.offset) * unit,
            dead_band: share(self.condition.dead_band) * unit,
            above: gain * share(self.condition.positive) * scale.torque / unit,
            below: gain * share(self.condition.negative) * scale.torque / unit,
            most_above: gain * share(self.condition.positive_saturation) * scale.torque,
            most_below: gain * share(self.condition.negative_saturation) * scale.torque,
        };
        let level = match self.common.kind {
            Kind::Spring => return Some(Effect::Spring(sides(scale.angle))),
            Kind::Damper => return Some(Effect::Damper(sides(scale.velocity))),
            Kind::Inertia => return Some(Effect::Inertia(sides(scale.acceleration))),
            Kind::Friction => return Some(Effect::Friction(sides(1.0))),
            Kind::Constant => self.enveloped(share(self.magnitude), time),
            Kind::Ramp => {
                let (start, end) = (share(self.ramp.0), share(self.ramp.1));
                let passed = self.length().map_or(0.0, |length| time as f32 / length as f32);
                self.enveloped(start + (end - start) * passed, time)
            }
            Kind::Square | Kind::Sine | Kind::Triangle | Kind::SawtoothUp | Kind::SawtoothDown => {
                let magnitude = self.enveloped(share(self.periodic.magnitude), time);
                share(self.periodic.offset) + magnitude * self.wave(time)
            }
        };
        // The direction is the origin of the force: 90° is from the right, and pushes to the left, as with Linux, where 0x4000 is left, and DirectInput.
        let right = self
            .common
            .direction
            .map_or(1.0, |angle| Number::sin(f32::from(angle) * (core::f32::consts::PI / 18_000.0)));
        Some(Effect::Torque(-gain * level * right * scale.torque))
    }

    /// Within ±1. A sine and a triangle begin at 0 and rise, a square is 1 first, a rising sawtooth begins at -1.
    fn wave(&self, time: i64) -> f32 {
        let period = 1000 * i64::from(self.periodic.period);
        if period == 0 {
            return 0.0;
        }
        let turns = (time % period) as f32 / period as f32 + f32::from(self.periodic.phase) / 36_000.0;
        let x = if turns >= 1.0 { turns - 1.0 } else { turns };
        match self.common.kind {
            Kind::Square => {
                if x < 0.5 {
                    1.0
                } else {
                    -1.0
                }
            }
            Kind::Triangle => {
                if x < 0.25 {
                    4.0 * x
                } else if x < 0.75 {
                    2.0 - 4.0 * x
                } else {
                    4.0 * x - 4.0
                }
            }
            Kind::SawtoothUp => 2.0 * x - 1.0,
            Kind::SawtoothDown => 1.0 - 2.0 * x,
            Kind::Sine => Number::sin(x * core::f32::consts::TAU),
            Kind::Constant | Kind::Ramp | Kind::Spring | Kind::Damper | Kind::Inertia | Kind::Friction => 0.0,
        }
    }
}
