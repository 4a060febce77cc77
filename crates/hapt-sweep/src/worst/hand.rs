//! A hand and its initial kick.

use hapt_analysis::{Grip, felt_at};
use hapt_model::{Coupling, Drive, End, Hand as Model, Motion, Scenario, Shape, Switching, World};
use serde::Serialize;

/// A passive hand whose spring is stretched at once, to a fixed intended position from then on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hand {
    /// Its mass, damper and spring.
    pub grip: Grip,
    /// The rest position of its spring: rad (linear: m).
    pub to: f64,
    /// A hand that alternately opens and closes: its closed and open times, s; `None`: it stays closed.
    pub hold_and_open: Option<(f64, f64)>,
}

impl Hand {
    /// A hand that comes to rest with the puck at `target` if it stays closed. Its spring has to hold there against the world; a hand without
    /// a spring stays where it is.
    pub fn toward(world: &World, grip: Grip, target: f64, hold_and_open: Option<(f64, f64)>) -> Hand {
        // Also against twice the device's friction, which could hold the puck.
        let force = -torque(world, target) + 2.0 * world.device.largest_friction() * target.signum();
        let to = if grip.stiffness > 0.0 { target + force / grip.stiffness } else { 0.0 };
        Hand { grip, to, hold_and_open }
    }

    /// The initial energy of its spring, J.
    pub fn energy(&self) -> f64 {
        0.5 * self.grip.stiffness * self.to * self.to
    }

    /// The scenario that shows it; its spring is stretched at `begins`, in s.
    pub fn scenario(&self, name: &str, duration: f64, begins: f64) -> Scenario {
        let Grip { inertia, damping, stiffness } = self.grip;
        let drive = Drive::Grip {
            inertia,
            damping,
            stiffness,
            moves: Shape::Step { to: self.to, at: begins },
            switching: self.hold_and_open.map(|(hold, open)| Switching { hold, open }),
        };
        Scenario { name: name.into(), duration, hand: Model { drive, release: None }, timing: Default::default() }
    }
}

/// The torque of what is between puck and ground on a puck at rest at q, within the motor's limit: N·m (linear: N).
fn torque(world: &World, q: f64) -> f64 {
    let limit = world.device.limit.unwrap_or(f64::INFINITY);
    let spec = world.spec();
    // A coupling's torque acts on its first end.
    let of = |(i, c): (usize, &Coupling)| match (c.first, c.second) {
        (End::Puck, End::Ground) => spec.coupling_torque(i, (q, 0.0), &[]),
        (End::Ground, End::Puck) => -spec.coupling_torque(i, (q, 0.0), &[]),
        _ => 0.0,
    };
    world.couplings.iter().enumerate().map(of).sum::<f64>().clamp(-limit, limit)
}

/// A tenth of a radian (linear: 1 cm).
pub(super) fn plain(motion: Motion) -> f64 {
    match motion {
        Motion::Rotary => 0.1,
        Motion::Linear => 0.01,
    }
}

/// The largest displacement by a kick, rad (linear: m): to a quarter of the motor's limit, or a tenth of a radian (linear: 1 cm), but
/// by ten counts at least.
pub(super) fn reach(world: &World, stiffness: f64) -> f64 {
    let within = world.device.limit.map_or(f64::INFINITY, |limit| 0.25 * limit / stiffness);
    plain(world.motion).min(within).max(world.count().map_or(0.0, |count| 10.0 * count))
}

/// The targets of hands, at least one: near the start, and where each law is felt. `stiffness` is that at the puck.
pub(crate) fn targets(world: &World, stiffness: f64) -> Vec<f64> {
    let reach = reach(world, stiffness);
    let mut all = vec![reach];
    for c in &world.couplings {
        let sign = match (c.first, c.second) {
            (End::Puck, _) => 1.0,
            (_, End::Puck) => -1.0,
            _ => continue,
        };
        all.extend(felt_at(&c.law, reach).into_iter().map(|q| sign * q));
    }
    all.retain(|q| *q != 0.0 && q.is_finite());
    all.dedup();
    if all.is_empty() {
        all.push(plain(world.motion));
    }
    // In a world of many walls only the first targets count.
    all.truncate(5);
    all
}
