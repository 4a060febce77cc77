//! Random laws of couplings: every law that there is, its numbers by their names and ranges.

use std::ops::RangeInclusive;

use hapt_core::spec::Range;
use hapt_core::{Law, Waveform};
use proptest::prelude::*;
use proptest::sample::select;

/// How large the numbers of random laws are, in SI. A number of either sign is as large on both sides of 0.
#[derive(Clone, Debug)]
pub struct Sizes {
    /// N·m/rad
    pub stiffness: RangeInclusive<f64>,
    /// N·m·s/rad
    pub damping: RangeInclusive<f64>,
    /// N·m
    pub torque: RangeInclusive<f64>,
    /// Of a pitch or a width, rad.
    pub length: RangeInclusive<f64>,
    /// Of where a law acts, rad; the largest on either side.
    pub place: f64,
    /// rad/s
    pub velocity: RangeInclusive<f64>,
    /// s
    pub time: RangeInclusive<f64>,
    /// kg·m², of a torque along the acceleration
    pub inertia: RangeInclusive<f64>,
    /// Hz
    pub cutoff: RangeInclusive<f64>,
}

/// Those of a haptic knob.
pub const SIZES: Sizes = Sizes {
    stiffness: 0.1..=20.0,
    damping: 0.0..=0.02,
    torque: 0.01..=0.2,
    length: 0.1..=1.0,
    place: 0.3,
    velocity: 0.01..=5.0,
    time: 0.05..=5.0,
    inertia: 1e-6..=1e-4,
    cutoff: 0.5..=100.0,
};

impl Sizes {
    /// The range of a law's number.
    ///
    /// # Panics
    /// Where no size is that of the name: a law that is new has a row here for a number that no other law has.
    #[must_use]
    pub fn of(&self, name: &str, range: Range) -> RangeInclusive<f64> {
        let size = match name {
            "stiffness" | "bristle_stiffness" => &self.stiffness,
            "damping" | "bristle_damping" | "viscous" => &self.damping,
            "torque" | "coulomb" | "stribeck" => &self.torque,
            "pitch" | "width" => &self.length,
            "rest" | "at" | "phase" => &(-self.place..=self.place),
            "velocity" | "stribeck_velocity" => &self.velocity,
            "time" => &self.time,
            "inertia" => &self.inertia,
            "cutoff" => &self.cutoff,
            _ => panic!("testing/src/laws.rs has no size for the number {name} of a law"),
        };
        if range == Range::Any { -size.end()..=*size.end() } else { size.clone() }
    }

    /// Laws with numbers of these sizes.
    pub fn laws(self, among: impl Fn(&Law) -> bool) -> impl Strategy<Value = Law> + Clone {
        laws(among, move |name, range| self.of(name, range))
    }
}

/// The laws `among` all, each as often as the others, each number from what is given for its name and range. A texture's harmonics are
/// at most 1.
pub fn laws<S: Strategy<Value = f64> + Clone>(
    among: impl Fn(&Law) -> bool,
    number: impl Fn(&str, Range) -> S + Clone,
) -> impl Strategy<Value = Law> + Clone {
    let harmonics = || prop::array::uniform4(-1.0_f32..=1.0);
    let law = select(Law::ALL.into_iter().filter(among).collect::<Vec<_>>());
    law.prop_flat_map(move |mut law| {
        let numbers: Vec<S> = law.quantities().map(|quantity| number(quantity.name, quantity.range)).collect();
        (Just(law), numbers, harmonics(), harmonics()).prop_map(|(mut law, numbers, sine, cosine)| {
            law.quantities().zip(numbers).for_each(|(quantity, number)| *quantity.value = number);
            if let Some(waveform) = law.waveform_mut() {
                *waveform = Waveform { sine, cosine };
            }
            law
        })
    })
}

/// Whether a law's torque depends only on the position, as the slope of an energy, about a q.
#[must_use]
pub fn is_potential(law: &Law) -> bool {
    law.center().is_some() && !law.integrates()
}

/// Whether a law is allowed at a body under the methods that find torques, together with any other coupling.
#[must_use]
pub fn goes_to_bodies(law: &Law) -> bool {
    !law.is_at_puck() && !law.has_bristle() && !law.is_compensating()
}

/// The laws, half of those that take a limit with one.
pub fn some_limited(
    laws: impl Strategy<Value = Law>,
    limit: impl Strategy<Value = f64>,
) -> impl Strategy<Value = (Law, Option<f64>)> {
    (laws, prop::option::of(limit)).prop_map(|(law, limit)| (law, limit.filter(|_| law.takes_limit())))
}

/// The law with another number of this name, where it has one.
#[must_use]
pub fn with(mut law: Law, name: &str, number: f64) -> Law {
    law.quantities().filter(|quantity| quantity.name == name).for_each(|quantity| *quantity.value = number);
    law
}
