//! The status of a link.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use hapt_rt::LinkSample;
use hapt_wire::link::Refusal;

/// The status of a link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkStatus {
    /// The station at its other end.
    pub to: String,
    /// The greatest age of a position at any time that its torque acts, in s.
    pub age_max: f64,
    /// Samples of this loop.
    pub samples: u64,
    /// Those of them in which the link's torque acted.
    pub acted: u64,
    /// Whether it acted in the last one.
    pub acts: bool,
    /// The number of releases of this end.
    pub releases: u64,
    /// The age of the other's position at the end of the last sample's hold, in s; infinite without one.
    pub age: f64,
    /// The greatest such age that has acted.
    pub oldest: f64,
    /// Messages taken.
    pub taken: u64,
    /// Messages refused, by [`Refusal::code`].
    pub refused: [u64; Refusal::ALL.len()],
}

impl LinkStatus {
    /// A sentence with the reason of a release, where the link has released.
    pub fn warning(&self) -> Option<String> {
        let LinkStatus { to, acts, age, age_max, samples, .. } = self;
        let oldest = 1e3 * age_max;
        match (acts, age) {
            (true, _) => None,
            (false, _) if *samples == 0 => None,
            (false, age) if age.is_infinite() => {
                Some(format!("The link to {to} has let go: nothing comes from there."))
            }
            (false, age) if age > age_max => Some(format!(
                "The link to {to} has let go: its position is {:.0} ms old, and {oldest:.0} ms are allowed.",
                1e3 * age
            )),
            (false, _) => {
                Some(format!("The link to {to} has let go. It takes hold when the other station is ready, too."))
            }
        }
    }
}

/// The same numbers while they change.
pub(crate) struct Counters {
    to: String,
    samples: AtomicU64,
    acted: AtomicU64,
    acts: AtomicBool,
    releases: AtomicU64,
    age: AtomicU64,
    age_max: AtomicU64,
    oldest: AtomicU64,
    taken: AtomicU64,
    refused: [AtomicU64; Refusal::ALL.len()],
}

impl Counters {
    /// Of a link to this station.
    pub fn new(to: &str, age_max: f64) -> Self {
        Counters {
            to: to.into(),
            samples: AtomicU64::default(),
            acted: AtomicU64::default(),
            acts: AtomicBool::default(),
            releases: AtomicU64::default(),
            age: AtomicU64::new(f64::INFINITY.to_bits()),
            age_max: AtomicU64::new(age_max.to_bits()),
            oldest: AtomicU64::default(),
            taken: AtomicU64::default(),
            refused: std::array::from_fn(|_| AtomicU64::default()),
        }
    }

    /// Counts a sample of the loop.
    pub fn count(&self, sample: &LinkSample) {
        let Counters { samples, acted, acts, releases, age, age_max, oldest, .. } = self;
        age_max.store(sample.age_max.to_bits(), Ordering::Relaxed);
        samples.fetch_add(1, Ordering::Relaxed);
        acts.store(sample.acts, Ordering::Relaxed);
        releases.store(sample.releases, Ordering::Relaxed);
        age.store(sample.age.to_bits(), Ordering::Relaxed);
        if sample.acts {
            acted.fetch_add(1, Ordering::Relaxed);
            // The bits of numbers that are not negative have the order of the numbers.
            oldest.fetch_max(sample.age.to_bits(), Ordering::Relaxed);
        }
    }

    /// Counts a message that was taken.
    pub fn take(&self) {
        self.taken.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a message that was refused.
    #[cfg(not(target_family = "wasm"))]
    pub fn refuse(&self, refusal: Refusal) {
        self.refused[refusal.code()].fetch_add(1, Ordering::Relaxed);
    }

    /// The present status.
    pub fn status(&self) -> LinkStatus {
        let number = |count: &AtomicU64| count.load(Ordering::Relaxed);
        LinkStatus {
            to: self.to.clone(),
            age_max: f64::from_bits(number(&self.age_max)),
            samples: number(&self.samples),
            acted: number(&self.acted),
            acts: self.acts.load(Ordering::Relaxed),
            releases: number(&self.releases),
            age: f64::from_bits(number(&self.age)),
            oldest: f64::from_bits(number(&self.oldest)),
            taken: number(&self.taken),
            refused: std::array::from_fn(|code| number(&self.refused[code])),
        }
    }
}
