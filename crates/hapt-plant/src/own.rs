//! What the device itself does to the puck beyond inertia and viscous damping: friction, and torques by position.
//!
//! Between the events of its pieces the motion is linear, but for the torques by position ([`crate::field`]).

use crate::exponential::Square;
use crate::field::{Field, Fielded, Series};
use crate::friction::Levels;
use crate::spec::{DeviceSpec, DeviceTorque, Stribeck};
use crate::trajectory::Piece;

/// As the device has it, wherever the puck's 0 is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Kind {
    /// Coulomb friction: that of a fast slide.
    friction: Levels,
    stribeck: Option<Stribeck>,
    torque: DeviceTorque,
}

/// By the puck's 0.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Own {
    pub friction: Levels,
    stribeck: Option<Stribeck>,
    /// Gravity and cogging, where there are any.
    pub field: Option<Field>,
}

/// A piece of a motion: what it adds to the puck's torque, torque - damping v, and where it ends.
pub(crate) struct Regime {
    pub torque: f64,
    pub damping: f64,
    events: [Option<Event>; 2],
}

/// It comes where velocity · v + constant becomes positive.
#[derive(Clone, Copy)]
struct Event {
    velocity: f64,
    constant: f64,
    /// The puck has come to rest.
    stops: bool,
}

impl Kind {
    pub fn new(spec: &DeviceSpec) -> Self {
        let &DeviceSpec { friction, friction_backward, stribeck, torque, .. } = spec;
        let friction = Levels { forward: friction, backward: friction_backward.unwrap_or(friction) };
        Kind { friction, stribeck: stribeck.filter(|stribeck| stribeck.torque > 0.0), torque }
    }

    /// Where the puck's 0 is `origin` by the device's.
    pub fn at(&self, origin: f64) -> Own {
        Own { friction: self.friction, stribeck: self.stribeck, field: Field::new(&self.torque, origin) }
    }

    /// Whether it depends on the puck's position.
    pub fn has_place(&self) -> bool {
        !self.torque.is_none()
    }
}

impl Own {
    /// Coulomb friction and nothing else.
    #[cfg(test)]
    pub fn of(friction: Levels) -> Self {
        Own { friction, stribeck: None, field: None }
    }

    /// Whether there is none of it.
    pub fn is_nothing(&self) -> bool {
        self.is_coulomb() && self.friction.is_none()
    }

    /// Whether it is Coulomb friction, or nothing.
    pub fn is_coulomb(&self) -> bool {
        self.stribeck.is_none() && self.field.is_none()
    }

    /// The levels that hold a puck at rest.
    pub fn rest(&self) -> Levels {
        let more = self.stribeck.map_or(0.0, |stribeck| stribeck.torque);
        Levels { forward: self.friction.forward + more, backward: self.friction.backward + more }
    }

    /// The torque on a puck that rests at x, friction aside.
    pub fn torque_at(&self, x: f64) -> f64 {
        self.field.map_or(0.0, |field| field.torque(x))
    }

    /// What friction takes of a motion that a hand prescribes, in J.
    pub fn lost(&self, motion: &Piece, from: f64, to: f64) -> f64 {
        let (_, path) = motion.travel(from, to);
        let coulomb = self.friction.lost(path, motion.at(to).0 - motion.at(from).0);
        let more =
            self.stribeck.map_or(0.0, |stribeck| stribeck.torque * motion.slow_travel(from, to, stribeck.velocity));
        coulomb + more
    }

    /// The piece of a slide in `direction` that goes on from v; without a direction there is no friction.
    pub fn regime(&self, v: f64, direction: Option<f64>) -> Regime {
        let Some(direction) = direction else { return Regime { torque: 0.0, damping: 0.0, events: [None; 2] } };
        let stop = Some(Event { velocity: -direction, constant: 0.0, stops: true });
        let coulomb = Regime { torque: -self.friction.against(direction), damping: 0.0, events: [stop, None] };
        let Some(stribeck) = self.stribeck else { return coulomb };
        let velocity = stribeck.velocity;
        if direction * v <= velocity {
            let faster = Some(Event { velocity: direction, constant: -velocity, stops: false });
            let torque = -self.rest().against(direction);
            return Regime { torque, damping: -stribeck.slope(), events: [stop, faster] };
        }
        let slower = Some(Event { velocity: -direction, constant: velocity, stops: false });
        Regime { events: [slower, None], ..coulomb }
    }
}

impl Regime {
    /// The linear motion in it, of that without it.
    pub fn linear<const K: usize>(&self, n: &Square<K>, mass: f64, v: usize) -> Square<K> {
        let mut n = *n;
        n[v][v] -= self.damping / mass;
        n
    }

    /// The fastest rate in 1/s that it adds.
    pub fn rate(&self, mass: f64) -> f64 {
        self.damping.abs() / mass
    }

    /// The first event within the length of a series, and whether the puck comes to rest there.
    pub fn first_event<const K: usize>(&self, of: &Fielded<'_, K>, series: &Series<K>) -> Option<(f64, bool)> {
        let at = |event: &Event| Some((of.first_above(series, event.velocity, event.constant)?, event.stops));
        self.events.iter().flatten().filter_map(at).reduce(|first, next| if next.0 < first.0 { next } else { first })
    }
}
