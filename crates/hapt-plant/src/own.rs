//! The torques of the device itself on the puck other than inertia and viscous damping: friction, torques by position, and end stops.
//!
//! Between the events of its pieces the motion is linear, but for the torques by position ([`crate::field`]).

use crate::exponential::Square;
use crate::field::{Field, Fielded, Series};
use crate::friction::Levels;
use crate::ledger::Ledger;
use crate::spec::{DeviceSpec, DeviceTorque, FrictionByPosition, Stops, Stribeck};
use crate::stop::{Line, Stop, Touch};
use crate::trajectory::Piece;

/// In the device's coordinate, which does not depend on the puck's 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Kind {
    /// Coulomb friction: that of a fast slide, in the mean of all positions.
    friction: Levels,
    by_position: Option<FrictionByPosition>,
    stribeck: Option<Stribeck>,
    torque: DeviceTorque,
    stops: Option<Stops>,
}

/// In the puck's coordinate.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Own {
    /// In the mean of all positions.
    pub friction: Levels,
    /// How it changes with the position, for a mean of 1.
    changes: Option<Field>,
    stribeck: Option<Stribeck>,
    /// Gravity and cogging, where there are any.
    pub field: Option<Field>,
    /// Toward larger positions, and toward smaller ones.
    stops: [Option<Stop>; 2],
}

/// A piece of a motion: its addition to the puck's torque, torque - damping v - stiffness x, and its end.
pub(crate) struct Regime {
    pub torque: f64,
    damping: f64,
    stiffness: f64,
    /// Friction's part of `torque`: against the slide, less its decrease with the speed, in the mean of all positions.
    pub friction: f64,
    falls: f64,
    /// The additional torque on the puck by friction's changes with the position.
    pub changes: Field,
    /// The stop that the puck is in.
    stop: Option<(Stop, Touch)>,
    events: [Option<Event>; 6],
}

/// An event occurs where the line becomes positive.
#[derive(Clone, Copy)]
struct Event {
    at: Line,
    /// The puck has come to rest.
    rests: bool,
}

impl Kind {
    pub fn new(spec: &DeviceSpec) -> Self {
        let &DeviceSpec { friction, friction_backward, friction_by_position, stribeck, torque, stops, .. } = spec;
        let friction = Levels { forward: friction, backward: friction_backward.unwrap_or(friction) };
        let by_position = friction_by_position.filter(|_| !friction.is_none());
        Kind { friction, by_position, stribeck: stribeck.filter(|stribeck| stribeck.torque > 0.0), torque, stops }
    }

    /// The same in the puck's coordinate, whose 0 is `origin` in the device's.
    pub fn at(&self, origin: f64) -> Own {
        let stops = self.stops.map_or([None; 2], |stops| Stop::both(&stops, origin));
        let changes = self.by_position.and_then(|by_position| Field::of_friction(&by_position, origin));
        Own {
            friction: self.friction,
            changes,
            stribeck: self.stribeck,
            field: Field::new(&self.torque, origin),
            stops,
        }
    }

    /// Whether it depends on the puck's position.
    pub fn has_place(&self) -> bool {
        !self.torque.is_none() || self.by_position.is_some() || self.stops.is_some()
    }
}

impl Own {
    /// Coulomb friction and nothing else.
    #[cfg(test)]
    pub fn of(friction: Levels) -> Self {
        Own { friction, changes: None, stribeck: None, field: None, stops: [None; 2] }
    }

    /// Whether there is none of it.
    pub fn is_nothing(&self) -> bool {
        self.is_coulomb() && self.friction.is_none()
    }

    /// Whether it is Coulomb friction, or nothing.
    pub fn is_coulomb(&self) -> bool {
        let is_even = self.changes.is_none() && self.stribeck.is_none();
        is_even && self.field.is_none() && self.stops.iter().all(Option::is_none)
    }

    /// The levels that hold a puck at rest at x.
    pub fn rest(&self, x: f64) -> Levels {
        // Rounding may put a level of 0 below it.
        let part = self.changes.map_or(1.0, |changes| (1.0 + changes.at(x)).max(0.0));
        let more = self.stribeck.map_or(0.0, |stribeck| stribeck.torque);
        Levels { forward: self.friction.forward * part + more, backward: self.friction.backward * part + more }
    }

    /// Whether nothing ever rubs.
    pub fn is_frictionless(&self) -> bool {
        self.friction.is_none() && self.stribeck.is_none()
    }

    /// The sizes of the torques at rest at x whose sums are the level, where it is a sum, and the device's own torque: rounding is relative
    /// to these.
    pub fn rounded(&self, x: f64) -> f64 {
        let level = self.changes.map_or(0.0, |_| self.friction.forward.max(self.friction.backward));
        let field = self.field.map_or(0.0, |field| field.size());
        self.stops.iter().flatten().fold(level + field, |size, stop| size + stop.rounded(x))
    }

    /// The torque on a puck that rests at x, friction aside.
    pub fn torque_at(&self, x: f64) -> f64 {
        let field = self.field.map_or(0.0, |field| field.at(x));
        self.stops.iter().flatten().fold(field, |torque, stop| torque + stop.torque_at(x))
    }

    /// The energy that the stops store with the puck at x, in J.
    pub fn stored(&self, x: f64) -> f64 {
        self.stops.iter().flatten().map(|stop| stop.stored(x)).sum()
    }

    /// Adds the works of a prescribed motion to the ledger; returns the energy that the hand supplies for them, in J.
    pub fn prescribe(&self, motion: &Piece, from: f64, to: f64, ledger: &mut Ledger) -> f64 {
        let (_, path) = motion.travel(from, to);
        let (start, end) = (motion.at(from).0, motion.at(to).0);
        let coulomb = self.friction.lost(path, end - start) + self.changed(motion, from, to);
        let falls = self.stribeck;
        let friction = coulomb + falls.map_or(0.0, |falls| falls.torque * motion.slow_travel(from, to, falls.velocity));
        let lost: f64 = self.stops.iter().flatten().map(|stop| stop.lost(motion, from, to)).sum();
        ledger.friction += friction;
        ledger.stops += lost;
        friction + lost + self.stored(end) - self.stored(start)
    }

    /// The energy that friction dissipates in a prescribed motion beyond that of its mean levels, in J.
    fn changed(&self, motion: &Piece, from: f64, to: f64) -> f64 {
        let Some(changes) = self.changes else { return 0.0 };
        let lost = |(times, start, end): (f64, f64, f64)| {
            times * self.friction.against((end - start).signum()) * changes.work(start, end)
        };
        motion.runs(from, to).into_iter().map(lost).sum()
    }

    /// The piece of a slide in `direction` that continues from x and v; without a direction there is no friction.
    pub fn regime(&self, [x, v]: [f64; 2], direction: Option<f64>) -> Regime {
        let (torque, damping, stiffness) = (0.0, 0.0, 0.0);
        let (friction, falls, changes) = (0.0, 0.0, Field::default());
        let mut regime = Regime { torque, damping, stiffness, friction, falls, changes, stop: None, events: [None; 6] };
        if let Some(direction) = direction {
            self.rub(&mut regime, v, direction);
        }
        for stop in self.stops.iter().flatten() {
            let (touch, ends) = stop.touch(x, v);
            ends.into_iter().flatten().for_each(|at| regime.end(at, false));
            match touch {
                Touch::Beyond => {}
                Touch::Pressed => {
                    regime.torque += stop.stiffness() * stop.at();
                    regime.damping += stop.damping();
                    regime.stiffness += stop.stiffness();
                    regime.stop = Some((*stop, touch));
                }
                Touch::Left => regime.stop = Some((*stop, touch)),
            }
        }
        regime
    }

    /// Friction's part of a piece.
    fn rub(&self, regime: &mut Regime, v: f64, direction: f64) {
        let speed = |sign: f64, constant: f64| Line { velocity: sign * direction, position: 0.0, constant };
        let falling = self.stribeck.filter(|stribeck| direction * v <= stribeck.velocity);
        let coulomb = self.friction.against(direction);
        regime.friction = coulomb + falling.map_or(0.0, |falling| falling.torque * direction);
        regime.torque -= regime.friction;
        regime.changes = self.changes.map_or(regime.changes, |changes| changes.times(-coulomb));
        match (self.stribeck, falling) {
            (_, Some(falling)) => {
                regime.falls = falling.slope();
                regime.damping -= regime.falls;
                regime.end(speed(-1.0, 0.0), true);
                regime.end(speed(1.0, -falling.velocity), false);
            }
            (Some(stribeck), None) => regime.end(speed(-1.0, stribeck.velocity), false),
            (None, None) => regime.end(speed(-1.0, 0.0), true),
        }
    }
}

impl Regime {
    fn end(&mut self, at: Line, rests: bool) {
        if let Some(free) = self.events.iter_mut().find(|event| event.is_none()) {
            *free = Some(Event { at, rests });
        }
    }

    /// The linear motion in it, from the linear motion without it.
    pub fn linear<const K: usize>(&self, n: &Square<K>, mass: f64, (v, x): (usize, usize)) -> Square<K> {
        let mut n = *n;
        n[v][v] -= self.damping / mass;
        n[v][x] -= self.stiffness / mass;
        n
    }

    /// The fastest rate in 1/s that it adds.
    pub fn rate(&self, mass: f64) -> f64 {
        self.damping.abs() / mass + libm::sqrt(self.stiffness / mass)
    }

    /// The first event within the length of a series, and whether the puck comes to rest there.
    pub fn first_event<const K: usize>(&self, of: &Fielded<'_, K>, series: &Series<K>) -> Option<(f64, bool)> {
        let at = |event: &Event| Some((of.first_above(series, &event.at)?, event.rests));
        self.events.iter().flatten().filter_map(at).reduce(|first, next| if next.0 < first.0 { next } else { first })
    }

    /// Adds the losses from x to `end` to the ledger, except those of friction's constant torque. `speed` is the integral of v².
    pub fn account(&self, [x, end]: [f64; 2], speed: f64, ledger: &mut Ledger) {
        ledger.friction -= self.falls * speed;
        match self.stop {
            Some((stop, Touch::Pressed)) => ledger.stops += stop.damping() * speed,
            Some((stop, Touch::Left)) => ledger.stops += stop.stored(x) - stop.stored(end),
            Some((_, Touch::Beyond)) | None => {}
        }
    }
}
