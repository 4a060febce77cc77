//! The theorems that make claims about a loop. Nothing else makes a claim.
//!
//! "Passive", "proved" and "certified" are [`Claimed`]: a type that only this module makes, and only from a theorem whose assumptions hold for
//! the world. `claim` takes the least of the dampings that the theorems of `demands` require. Where none covers the world
//! the number is a linear estimate, the worst over flat and steep slopes, and nothing is claimed: the world is open.
//!
//! Two lists name the properties that a theorem does not cover. `assumptions::outside`: couplings, delay, estimator, times; they keep a
//! world from being certified. `assumptions::beyond`: encoder, levels, the motor's limit and the device's friction; they may stay unproved.

pub(crate) mod assumptions;
pub(crate) mod claim;
mod demands;
pub(crate) mod free;
pub(crate) mod passivity;
pub(crate) mod stable;
pub(crate) mod uneven;
pub(crate) mod witness;

use std::fmt;

use serde::{Serialize, Serializer};

pub use free::{FreePatterns, PatternVerdict};
pub use passivity::{Passivity, passivity};
pub use uneven::{Uneven, uneven, uneven_damping};

/// A theorem of docs/theory.md.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Theorem {
    /// Its name, as in `hapt check --json` and in the headings of docs/theory.md.
    pub id: &'static str,
    /// Its equations there.
    pub equations: &'static str,
    /// Its assumptions on the world, one sentence each.
    pub assumes: &'static [&'static str],
}

/// Puck held: the eigenvalues of the linear step.
pub static HELD_LINEAR: Theorem = Theorem {
    id: "held-eigenvalues",
    equations: "(T8), (T12)",
    assumes: &["the couplings at bodies are springs, dampers and constants"],
};

/// Puck held: a step that does not raise the energy.
pub static HELD_ENERGY: Theorem = Theorem {
    id: "held-energy",
    equations: "(T22), (T23)",
    assumes: &[
        "the method is zoh, trapezoidal or backward-euler, whose discrete-gradient step does not raise the energy",
        "the couplings at bodies have an energy, or only take energy",
    ],
};

/// Hands-off: the eigenvalues of the linear loop.
pub static FREE_LINEAR: Theorem = Theorem {
    id: "free-eigenvalues",
    equations: "(T27)",
    assumes: &[
        "every coupling is a spring, a damper, an integral term or a torque along the acceleration without a limit, or a constant",
        "samples are even, the delay is one number",
    ],
};

/// Hands-off: one quadratic form that shrinks at every sample.
pub static FREE_FORM: Theorem = Theorem {
    id: "free-common-form",
    equations: "(T48), (T49)",
    assumes: &["samples are even", "nonlinear couplings are static laws or damped walls between puck and ground"],
};

/// Hands-off: a hand that does nothing is a passive hand.
pub static FREE_PASSIVE: Theorem =
    Theorem { id: "free-passive", equations: "(T31)", assumes: &["the loop is passive against every passive hand"] };

/// Linear loop, even samples.
pub static LINEAR: Theorem = Theorem {
    id: "linear",
    equations: "(T29) to (T33), (T44)",
    assumes: &[
        "every coupling is a spring, a damper, a torque along the acceleration without a limit, or a constant",
        "samples are even, delay and lag are one number each",
        "a velocity at the puck is a difference or a low-pass of it",
    ],
};

/// Linear loop without delay, any intervals.
pub static LINEAR_UNEVEN: Theorem = Theorem {
    id: "linear-uneven",
    equations: "(T40)",
    assumes: &[
        "every coupling is a spring, a damper, a torque along the acceleration without a limit, or a constant",
        "the torque comes at once: no delay, no lag",
    ],
};

/// Linear loop, even samples, a delay that varies.
pub static LINEAR_LATE: Theorem = Theorem {
    id: "linear-late",
    equations: "(T43)",
    assumes: &[
        "every coupling is a spring, a damper, a torque along the acceleration without a limit, or a constant",
        "samples are even, and the largest delay is no longer than the period",
        "the motor does not lag",
    ],
};

/// Linear loop, even samples, a lag within bounds.
pub static LINEAR_LAG: Theorem = Theorem {
    id: "linear-lag",
    equations: "(T47)",
    assumes: &[
        "every coupling is a spring, a damper, a torque along the acceleration without a limit, or a constant",
        "samples are even, the delay is one number",
    ],
};

/// Laws at the puck, any times.
pub static LAWS: Theorem = Theorem {
    id: "laws",
    equations: "(T35), (T39), (T41), (T42), (T45), (T46)",
    assumes: &[
        "the couplings that it is about join puck and ground, with bounded slopes, and dampings that only take energy; friction with bristles is a hysteresis of the way",
        "every velocity is a mean of earlier displacements",
    ],
};

/// No damping makes an integral term passive.
pub static INTEGRAL: Theorem = Theorem {
    id: "integral",
    equations: "(T72)",
    assumes: &["an integral term of some gain acts between puck and ground"],
};

/// The energy theorem.
pub static ENERGY: Theorem = Theorem {
    id: "energy",
    equations: "(T23), (T24), (T40)",
    assumes: &[
        "the method is zoh, trapezoidal or backward-euler, and the torque is that of the end of the step",
        "the torque comes at once: no delay, no lag",
        "the couplings have an energy, or only take energy",
    ],
};

/// Bodies that step at every n-th sample.
pub static TWO_RATES: Theorem = Theorem {
    id: "two-rates",
    equations: "(T62)",
    assumes: &[
        "the method is zoh, trapezoidal or backward-euler, and the torque is that of the end of the step, at once",
        "only laws of the position join puck and bodies",
    ],
};

/// An origin that slips while the puck rests.
pub static RECENTRE: Theorem = Theorem {
    id: "recentre",
    equations: "(T80)",
    assumes: &[
        "only laws of the position act on the puck, and the torque comes at once: no delay, no lag, no filter",
        "with bodies the method is zoh, trapezoidal or backward-euler, and the torque is that of the end of the step",
        "the origin slips only where the torque is at least twice what displacement and counts may change it by",
    ],
};

/// Dampers behind a Kalman filter.
pub static BEHIND_KALMAN: Theorem = Theorem {
    id: "kalman",
    equations: "(T84)",
    assumes: &[
        "only dampers between puck and ground take the velocity, by the steady Kalman filter of constant acceleration",
        "the torque comes at once: no delay, no lag",
    ],
};

/// Friction of the device, up to a speed.
pub static FRICTION: Theorem = Theorem {
    id: "friction",
    equations: "(T66)",
    assumes: &[
        "the puck keeps below safety.overspeed, at which the supervisor takes the torque away",
        "the device's Coulomb friction is at least the least of its tolerance",
    ],
};

/// Torques that the device's friction takes.
pub static WITHIN_FRICTION: Theorem = Theorem {
    id: "within-friction",
    equations: "(T76)",
    assumes: &[
        "friction, integral terms, assists and torques along the acceleration between puck and ground have a largest torque each, together no more than the device's Coulomb friction",
        "the device's Coulomb friction is at least the least of its tolerance",
    ],
};

/// Whether a theorem makes a claim. Only [`crate::theorems`] makes one that holds.
#[derive(Clone, Default, PartialEq)]
pub struct Claimed(Option<Vec<&'static Theorem>>);

impl Claimed {
    /// Nothing is claimed.
    pub const NO: Claimed = Claimed(None);

    fn by(theorems: &[&'static Theorem]) -> Claimed {
        Claimed(Some(theorems.to_vec()))
    }

    /// The claim, or none where `holds` is false.
    pub(crate) fn when(self, holds: bool) -> Claimed {
        if holds { self } else { Claimed::NO }
    }

    /// Both claims, or none.
    pub fn and(&self, other: &Claimed) -> Claimed {
        match (&self.0, &other.0) {
            (Some(these), Some(those)) => {
                let mut all = these.clone();
                all.extend(those.iter().filter(|theorem| !these.contains(theorem)));
                Claimed(Some(all))
            }
            _ => Claimed::NO,
        }
    }

    /// Whether it is made.
    pub fn holds(&self) -> bool {
        self.0.is_some()
    }

    /// The theorems that make it together; none where it is not made.
    pub fn theorems(&self) -> &[&'static Theorem] {
        self.0.as_deref().unwrap_or_default()
    }
}

impl fmt::Debug for Claimed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ids: Vec<&str> = self.theorems().iter().map(|theorem| theorem.id).collect();
        if self.holds() { write!(f, "by {}", ids.join(", ")) } else { f.write_str("not claimed") }
    }
}

impl Serialize for Claimed {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bool(self.holds())
    }
}
