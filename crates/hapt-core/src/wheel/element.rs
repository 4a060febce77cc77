//! The elements that a spring joins to the wheel: a slider without mass, and a virtual body. Both are stepped by backward Euler.
//!
//! A state is the spring's stretch, not a position: a spring that changes its stiffness keeps its torque or loses energy, and one that
//! slips where its torque is bounded only loses energy.

use super::Resistance;
use crate::Real;
use crate::contact::within;

/// Steps of the search for a slider's displacement; a step that leaves the bracket halves it.
const SEARCH: usize = 40;

/// A spring to the wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Link<F> {
    stiffness: F,
    stretch: F,
}

impl<F: Real> Link<F> {
    /// A stiffer spring keeps its torque, with less energy; a softer one keeps its stretch.
    fn become_as_stiff(&mut self, stiffness: F) {
        if stiffness > self.stiffness {
            self.stretch = self.stretch * (self.stiffness / stiffness);
        }
        self.stiffness = stiffness;
    }

    /// Limits the torque to bounds that contain 0, and the stretch with it.
    fn slip(&mut self, least: F, most: F) -> F {
        let straight = self.stiffness * self.stretch;
        let torque = within(straight, least, most);
        if torque != straight {
            self.stretch = torque / self.stiffness;
        }
        torque
    }
}

/// A slider whose motion dampers and frictions resist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag<F> {
    link: Link<F>,
}

impl<F: Real> Drag<F> {
    pub const SLACK: Self = Drag { link: Link { stiffness: F::ZERO, stretch: F::ZERO } };

    /// The wheel moves by `travel`; returns the torque that resists it, within `room`. `resistance` is that to a displacement of the slider in
    /// a period.
    pub fn step(
        &mut self,
        stiffness: F,
        travel: F,
        room: (F, F),
        resistance: impl Fn(F) -> Resistance<F>,
        period: F,
    ) -> F {
        if stiffness <= F::ZERO {
            *self = Self::SLACK;
            return F::ZERO;
        }
        self.link.become_as_stiff(stiffness);
        let stretch = self.link.stretch + travel;
        let slides = slide(stiffness, stretch, resistance, period);
        self.link.stretch = stretch - slides;
        self.link.slip(room.0, room.1)
    }
}

/// The displacement d at which the resistance to d/T is K (e - d). The resistance never falls with d, so that there is one.
fn slide<F: Real>(stiffness: F, stretch: F, resistance: impl Fn(F) -> Resistance<F>, period: F) -> F {
    let pull = stiffness * stretch;
    let (least, most) = resistance(F::ZERO).at_rest();
    if least <= pull && pull <= most {
        return F::ZERO;
    }
    // Beyond its rest, the slider moves towards the pull, at most to where the spring's torque is the one that holds it at rest.
    let edge = if pull > most { most } else { least };
    let end = (pull - edge) / stiffness;
    let (mut low, mut high) = if end > F::ZERO { (F::ZERO, end) } else { (end, F::ZERO) };
    // A Newton step from the end at which one step solves a linear law.
    let mut travel = end;
    for _ in 0..SEARCH {
        let found = resistance(travel);
        let excess = found.moving(travel) + stiffness * travel - pull;
        if excess > F::ZERO {
            high = travel;
        } else {
            low = travel;
        }
        let next = travel - excess / (stiffness + found.slope() / period);
        let next = if low < next && next < high { next } else { F::HALF * (low + high) };
        if next == travel {
            break;
        }
        travel = next;
    }
    travel
}

/// A virtual body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mass<F> {
    link: Link<F>,
    velocity: F,
    inertia: F,
}

impl<F: Real> Mass<F> {
    pub const SLACK: Self =
        Mass { link: Link { stiffness: F::ZERO, stretch: F::ZERO }, velocity: F::ZERO, inertia: F::ZERO };

    /// The wheel moves by `travel`; returns the torque that resists it, within `room` and ±`most`. A body that becomes heavier keeps its
    /// momentum, one that becomes lighter its velocity: neither gains energy.
    pub fn step(&mut self, stiffness: F, travel: F, room: (F, F), inertia: F, most: F, period: F) -> F {
        if stiffness <= F::ZERO || inertia <= F::ZERO {
            *self = Self::SLACK;
            return F::ZERO;
        }
        self.link.become_as_stiff(stiffness);
        if inertia > self.inertia {
            self.velocity = self.velocity * (self.inertia / inertia);
        }
        self.inertia = inertia;
        // e' = e + dz - T u', u' = u + T K e'/M
        let rate = period / inertia;
        let stretch = self.link.stretch + travel - period * self.velocity;
        self.link.stretch = stretch / (F::ONE + period * rate * stiffness);
        let least = if room.0 > -most { room.0 } else { -most };
        let greatest = if room.1 < most { room.1 } else { most };
        let torque = self.link.slip(least, greatest);
        self.velocity += rate * torque;
        torque
    }
}
