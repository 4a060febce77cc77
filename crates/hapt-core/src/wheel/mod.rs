//! The effects of a force-feedback wheel, as couplings and bodies: the loop stays passive for any request of a host.
//!
//! Springs are static laws on the wheel's position. Dampers and frictions act on a slider without mass, inertia acts on a virtual
//! body; each hangs on the wheel by a spring, so that neither the difference of two positions nor of two velocities is ever taken. Under
//! backward Euler such an element requires no more damping of the device than its spring does ([`Timing::element_cost`]), for any damping,
//! friction or inertia behind it. The device's damping therefore bounds a sum of stiffnesses, which is known at every sample, and requests
//! of the host beyond that sum are scaled to it.
//!
//! Constant, ramp and periodic effects have levels that the host sets. Held, they do work of at most their torque times the path, and
//! without them every motion of the free wheel has bounded energy. A game that computes a level from the wheel's position closes a loop of
//! its own, which is late: [`game_loop`] has its requirement on the device.
//!
//! ```
//! use hapt_core::wheel::{Device, Effect, Sides, Timing, Wheel};
//!
//! let wheel = Wheel::<f32>::new(&Device::ideal(Timing::even(1e-3), 0.01, 5.0))?;
//! let mut state = wheel.start();
//! // 2 b/T = 20 N·m/rad is passive; a host asks for 100.
//! let spring = Effect::Spring(Sides::even(100.0, 5.0));
//! wheel.step(&mut state, 0.0, &[spring], 1);
//! let given = wheel.step(&mut state, 0.1, &[spring], 1);
//! assert!((given.torque + 2.0).abs() < 1e-3 && given.requested == -5.0);
//! # Ok::<(), hapt_core::wheel::Refused>(())
//! ```

mod bound;
mod effect;
mod element;
pub mod game_loop;

use core::fmt;

use crate::Real;
use crate::contact::within;

use bound::Budget;
pub use bound::{REST_SPEED, Timing};
use effect::floored;
pub use effect::{Effect, Sides};
use element::{Drag, Mass};

/// The time constant, in s, with which a jump of the requested torque fades when effects change.
const BLEND: f64 = 2e-3;

/// The largest share of the stiffness that springs take while dampers, frictions or inertias play.
const SPRINGS_SHARE: f64 = 0.5;

/// The part of a device that effects may use. The wheel's end stops and base feel, without any host, are a world in addition to the effects
/// ([`Wheel::step_with`]), which has taken its part of the damping and the friction. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Device {
    /// The loop's time.
    pub timing: Timing,
    /// The device's own damping, N·m·s/rad, zero or more: certainly not less than this.
    pub damping: f64,
    /// Its own Coulomb friction, N·m, zero or more: certainly not less than this.
    pub friction: f64,
    /// The angle of a count of its encoder, rad; 0: its position is exact.
    pub count: f64,
    /// The largest torque, N·m, positive.
    pub limit: f64,
}

impl Device {
    /// One without friction, whose position is exact.
    pub const fn ideal(timing: Timing, damping: f64, limit: f64) -> Self {
        Device { timing, damping, friction: 0.0, count: 0.0, limit }
    }

    /// The stiffness of springs that requires all damping and friction of the device, N·m/rad.
    pub fn stiffness(&self) -> f64 {
        Budget::of(self).springs
    }
}

/// Why a device cannot be a wheel: a number out of its range, by its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refused(pub &'static str);

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the wheel's {} is out of range", self.0)
    }
}

impl core::error::Error for Refused {}

/// Why less torque is given than requested, the first reason that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// A coefficient is negative: such a law drives the wheel; it counts as 0.
    Drives,
    /// Springs are scaled to the stiffness that the device's damping allows.
    Stiffness,
    /// The torque is beyond the device's limit.
    Limit,
}

/// The result of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Given<F> {
    /// The torque to command, N·m, within the device's limit.
    pub torque: F,
    /// The torque of all effects with springs as requested, within the limit, N·m.
    pub requested: F,
    /// The factor by which springs are scaled, 0 to 1.
    pub scale: F,
    /// All stiffness at the wheel, weighted by its required damping, relative to the stiffness that the device's damping allows: 0 to 1.
    pub used: F,
    /// Why less torque is given than requested.
    pub shortfall: Option<Shortfall>,
}

impl<F: Real> Given<F> {
    /// The result without effects.
    pub const NOTHING: Self =
        Given { torque: F::ZERO, requested: F::ZERO, scale: F::ONE, used: F::ZERO, shortfall: None };
}

/// A wheel, compiled from a [`Device`].
#[derive(Clone, Copy, Debug)]
pub struct Wheel<F> {
    period: F,
    limit: F,
    /// The stiffness of springs that would take the whole damping.
    stiffness: F,
    /// The factor by which the stiffness of a slider and of a body is smaller for the same required damping.
    drag: F,
    mass: F,
    fade: F,
}

/// The state, which changes from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelState<F> {
    last: Option<F>,
    /// The static torque of the last sample with the jump that was fading then.
    direct: F,
    fading: F,
    revision: u32,
    drag: Drag<F>,
    mass: Mass<F>,
}

/// How the stiffness is shared out at a sample.
struct Shares<F> {
    scale: F,
    drag: F,
    mass: F,
    used: F,
}

impl<F: Real> Wheel<F> {
    /// Checks the device's numbers.
    ///
    /// # Errors
    /// Names the number that is out of range.
    pub fn new(device: &Device) -> Result<Self, Refused> {
        if !device.timing.is_possible() {
            return Err(Refused("timing"));
        }
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let zero_or_more = |x: f64| x.is_finite() && x >= 0.0;
        let numbers = [
            ("damping", zero_or_more(device.damping)),
            ("friction", zero_or_more(device.friction)),
            ("count", zero_or_more(device.count)),
            ("limit", positive(device.limit)),
        ];
        if let Some((name, _)) = numbers.iter().find(|(_, holds)| !holds) {
            return Err(Refused(name));
        }
        let Budget { springs, drag, mass } = Budget::of(device);
        let of = F::from_f64;
        Ok(Wheel {
            period: of(device.timing.period),
            limit: of(device.limit),
            stiffness: of(springs),
            drag: of(drag),
            mass: of(mass),
            fade: of(libm::exp(-device.timing.period / BLEND)),
        })
    }

    /// At rest, before the first sample.
    pub fn start(&self) -> WheelState<F> {
        WheelState { last: None, direct: F::ZERO, fading: F::ZERO, revision: 0, drag: Drag::SLACK, mass: Mass::SLACK }
    }

    /// One sample: the torque for the position, in rad. `revision` differs from the last sample's where the host has changed the effects;
    /// the jump of the torque that the change would make fades within milliseconds. A position that is not finite gives no torque.
    pub fn step(&self, state: &mut WheelState<F>, position: F, effects: &[Effect<F>], revision: u32) -> Given<F> {
        self.step_with(state, position, F::ZERO, effects, revision)
    }

    /// The same in addition to a torque that acts on the wheel already, in N·m: the result is to be added to it, and the sum is within the
    /// limit. The device's damping has to pay for both: [`Device::damping`] is then the part that that torque's law leaves.
    pub fn step_with(
        &self,
        state: &mut WheelState<F>,
        position: F,
        external: F,
        effects: &[Effect<F>],
        revision: u32,
    ) -> Given<F> {
        if !position.is_finite() {
            *state = self.start();
            return Given { scale: F::ZERO, ..Given::NOTHING };
        }
        let travel = state.last.map_or(F::ZERO, |last| position - last);
        state.last = Some(position);
        let shares = self.shares(effects);
        let (wanted, scaled) = direct(effects, position, shares.scale);
        let before = state.direct - state.fading;
        state.fading = state.fading * self.fade;
        if state.revision != revision {
            // The earlier jump also continues to fade: a host that changes its level at every sample does not stop the fading.
            state.fading = (state.fading + before - scaled).finite_or_zero();
            state.revision = revision;
        }
        state.direct = scaled + state.fading;
        // The world comes last: the host's torque is limited before the world's is added.
        let external = external.finite_or_zero();
        let statics = within(within(state.direct, -self.limit, self.limit) + external, -self.limit, self.limit);
        // Elements yield where the motor cannot hold them, on both their ends.
        let room = (statics - self.limit, statics + self.limit);
        let velocity = travel / self.period;
        let drag =
            state.drag.step(shares.drag, travel, room, |travel| resistance(effects, travel / self.period), self.period);
        let room = (room.0 - drag, room.1 - drag);
        let (inertia, most) = inertia(effects);
        let mass = state.mass.step(shares.mass, travel, room, inertia, most, self.period);
        let torque = (statics - drag - mass).finite_or_zero().within(self.limit) - external;
        let plain = wanted + external - resistance(effects, velocity).moving(velocity) - mass;
        let requested = plain.finite_or_zero().within(self.limit) - external;
        let shortfall = if effects.iter().any(drives) {
            Some(Shortfall::Drives)
        } else if shares.scale < F::ONE {
            Some(Shortfall::Stiffness)
        } else if plain.abs() > self.limit {
            Some(Shortfall::Limit)
        } else {
            None
        };
        Given { torque, requested, scale: shares.scale, used: shares.used, shortfall }
    }

    /// The static torque of effects at a position, N·m: springs as they are given, and levels.
    pub fn level(&self, position: F, effects: &[Effect<F>]) -> F {
        direct(effects, position, self.shares(effects).scale).1
    }

    /// Springs take the stiffness, or half of it where elements play; elements share the rest.
    fn shares(&self, effects: &[Effect<F>]) -> Shares<F> {
        let (mut springs, mut drags, mut masses) = (F::ZERO, false, false);
        for effect in effects {
            match effect {
                Effect::Spring(sides) => springs += sides.steepest(),
                Effect::Damper(sides) | Effect::Friction(sides) => drags |= sides.steepest() > F::ZERO,
                Effect::Inertia(sides) => masses |= sides.gentlest() > F::ZERO,
                Effect::Torque(_) => {}
            }
        }
        let elements = drags || masses;
        let most = if elements { self.stiffness * F::from_f64(SPRINGS_SHARE) } else { self.stiffness };
        let scale = if springs > most { most / springs } else { F::ONE };
        let rest = floored(self.stiffness - springs * scale);
        let each = if drags && masses { rest * F::HALF } else { rest };
        let of = |plays: bool, ratio: F| if plays { each * ratio } else { F::ZERO };
        let taken = if elements { self.stiffness } else { springs * scale };
        let used = if self.stiffness > F::ZERO { taken / self.stiffness } else { F::ONE };
        Shares { scale, drag: of(drags, self.drag), mass: of(masses, self.mass), used }
    }
}

/// The torque of springs as requested and of levels that the host sets; the same with springs scaled.
fn direct<F: Real>(effects: &[Effect<F>], position: F, scale: F) -> (F, F) {
    let (mut wanted, mut scaled) = (F::ZERO, F::ZERO);
    for effect in effects {
        match effect {
            Effect::Spring(sides) => {
                wanted += -sides.resistance(position, F::ONE).0;
                scaled += -sides.resistance(position, scale).0;
            }
            Effect::Torque(torque) => {
                wanted += torque.finite_or_zero();
                scaled += torque.finite_or_zero();
            }
            Effect::Damper(_) | Effect::Friction(_) | Effect::Inertia(_) => {}
        }
    }
    (wanted.finite_or_zero(), scaled.finite_or_zero())
}

/// The torque with which dampers and frictions resist a velocity.
fn resistance<F: Real>(effects: &[Effect<F>], velocity: F) -> Resistance<F> {
    let mut all = Resistance { viscous: F::ZERO, slope: F::ZERO, dry_above: F::ZERO, dry_below: F::ZERO };
    for effect in effects {
        match effect {
            Effect::Damper(sides) => {
                let (torque, slope) = sides.resistance(velocity, F::ONE);
                all.viscous += torque;
                all.slope += slope;
            }
            Effect::Friction(sides) => {
                let least = |a: F, b: F| if a < b { a } else { b };
                all.dry_above += least(floored(sides.above), sides.most_above);
                all.dry_below += least(floored(sides.below), sides.most_below);
            }
            Effect::Spring(_) | Effect::Inertia(_) | Effect::Torque(_) => {}
        }
    }
    all
}

/// A resistance to a velocity, and its derivative.
#[derive(Clone, Copy)]
pub(crate) struct Resistance<F> {
    viscous: F,
    slope: F,
    dry_above: F,
    dry_below: F,
}

impl<F: Real> Resistance<F> {
    /// With the friction of the velocity's direction; without friction at 0.
    pub(crate) fn moving(&self, velocity: F) -> F {
        if velocity > F::ZERO {
            self.viscous + self.dry_above
        } else if velocity < F::ZERO {
            self.viscous - self.dry_below
        } else {
            self.viscous
        }
    }

    /// The torques that it holds at rest.
    pub(crate) fn at_rest(&self) -> (F, F) {
        (self.viscous - self.dry_below, self.viscous + self.dry_above)
    }

    pub(crate) fn slope(&self) -> F {
        self.slope
    }
}

/// The inertia of all effects, and its largest torque.
fn inertia<F: Real>(effects: &[Effect<F>]) -> (F, F) {
    effects.iter().fold((F::ZERO, F::ZERO), |(inertia, most), effect| match effect {
        Effect::Inertia(sides) if sides.gentlest() > F::ZERO => {
            let least = if sides.most_above < sides.most_below { sides.most_above } else { sides.most_below };
            (inertia + sides.gentlest(), most + floored(least))
        }
        Effect::Inertia(_) | Effect::Spring(_) | Effect::Damper(_) | Effect::Friction(_) | Effect::Torque(_) => {
            (inertia, most)
        }
    })
}

fn drives<F: Real>(effect: &Effect<F>) -> bool {
    match effect {
        Effect::Spring(sides) | Effect::Damper(sides) | Effect::Friction(sides) | Effect::Inertia(sides) => {
            sides.drives()
        }
        Effect::Torque(_) => false,
    }
}
