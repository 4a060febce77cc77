//! The `[loop]` table of a world.

use hapt_core::{Estimator, Method, Output};

use crate::keys::default_number;
use crate::kinds::EstimatorKind;

/// The delay, in periods.
const MAX_DELAY_PERIODS: f64 = 1e6;

/// The `[loop]` table: the sampled program that runs the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// T in s, positive.
    pub period: f64,
    /// The integrator.
    pub method: Method,
    /// Which state gives the torque.
    pub output: Output,
    /// Further steps ahead for the torque, with `output = "end"`.
    pub advance: u32,
    /// The bodies step at every such sample, by as many periods; 1 or more.
    pub bodies_every: u32,
    /// The longest true time between two samples in s, no shorter than the period; `None`: always the period.
    pub interval_max: Option<f64>,
    /// From the sample to the moment the motor torque changes; the least where it varies.
    pub delay: Delay,
    /// The largest delay, where it varies; no shorter than `delay`. `None`: always the delay.
    pub delay_max: Option<Delay>,
    /// The cutoff in Hz of the one pole behind which bodies and couplings see the puck's position; `None`: they see it as measured.
    pub filter: Option<f64>,
    /// For how long in s the puck rests before the world's origin slips to where its torque is 0, and the time constant of the slip; two
    /// periods or more. `None`: it stays.
    pub recentre: Option<f64>,
    /// The velocity estimator's name.
    pub estimator: EstimatorKind,
    /// The cutoff in Hz of the low-pass and the Kalman filter; always there with these, kept when given with another estimator.
    pub cutoff: Option<f64>,
    /// The largest acceleration that Levant's differentiator follows exactly, rad/s² (linear: m/s²); always there with it.
    pub acceleration: Option<f64>,
    /// The samples over which the estimator `difference` takes the velocity, 1 or more; kept when given with another.
    pub every: u32,
    /// The largest FOAW window in samples.
    pub window: u32,
}

/// From the sample to the moment the motor torque changes, as the file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delay {
    /// In s, zero or more.
    Seconds(f64),
    /// In periods, zero or more: it follows the period.
    Samples(f64),
}

impl Delay {
    /// The delay in s at this period.
    pub fn seconds(self, period: f64) -> f64 {
        match self {
            Delay::Seconds(seconds) => seconds,
            Delay::Samples(samples) => samples * period,
        }
    }
}

impl Sampling {
    /// The table of a file that has only `loop.period`, in s.
    pub fn new(period: f64) -> Self {
        Sampling {
            period,
            method: Method::Zoh,
            output: Output::End,
            advance: const { default_number("loop.advance") as u32 },
            bodies_every: const { default_number("loop.bodies_every") as u32 },
            interval_max: None,
            delay: Delay::Seconds(const { default_number("loop.delay") }),
            delay_max: None,
            filter: None,
            recentre: None,
            estimator: EstimatorKind::Exact,
            cutoff: None,
            acceleration: None,
            every: const { default_number("loop.every") as u32 },
            window: const { default_number("loop.window") as u32 },
        }
    }

    /// The time in s over which the bodies step: `bodies_every` periods.
    pub fn step(&self) -> f64 {
        f64::from(self.bodies_every) * self.period
    }

    /// Why a file with these times is refused: the key that would have to change, and what is wrong with it; `None` where it is not. A world
    /// that was changed without its file is checked by this again.
    pub fn fault(&self) -> Option<(&'static str, String)> {
        let period = self.period;
        for (key, delay) in [("delay", Some(self.delay)), ("delay_max", self.delay_max)] {
            match delay {
                Some(Delay::Seconds(delay)) if delay > MAX_DELAY_PERIODS * period => {
                    return Some((key, format!("{delay:?} s is more than a million periods of {period:?} s")));
                }
                Some(Delay::Samples(samples)) if samples > MAX_DELAY_PERIODS => {
                    return Some((key, format!("{samples:?} samples are more than a million")));
                }
                Some(Delay::Seconds(_) | Delay::Samples(_)) | None => {}
            }
        }
        let (least, largest) = (self.delay_s(), self.delay_max.map(|delay| delay.seconds(period)));
        if let Some(largest) = largest.filter(|largest| *largest < least) {
            let message = format!(
                "{largest:?} s is below loop.delay, {least:?} s, which is the least delay; expected {least:?} s or more"
            );
            return Some(("delay_max", message));
        }
        if let Some(longest) = self.interval_max.filter(|longest| *longest < period) {
            let message = format!(
                "{longest:?} s is below loop.period, {period:?} s, which the samples have on average; expected {period:?} s or more"
            );
            return Some(("interval_max", message));
        }
        if let Some(time) = self.recentre.filter(|time| *time < 2.0 * period) {
            let least = 2.0 * period;
            let message = format!(
                "{time:?} s is below two periods, and the origin slips in many samples; expected {least:?} s or more"
            );
            return Some(("recentre", message));
        }
        None
    }

    /// The delay in s, at this loop's period.
    pub fn delay_s(&self) -> f64 {
        self.delay.seconds(self.period)
    }

    /// The longest true time between two samples in s. Never below the period, which the samples have on average.
    pub fn interval_max_s(&self) -> f64 {
        self.interval_max.map_or(self.period, |longest| longest.max(self.period))
    }

    /// The shortest interval in s that analysis and random timing take: as far below the period as the longest is above, a hundredth of the
    /// period at least, and never shorter than the delay. After a late sample the next one comes sooner by as much.
    pub fn interval_min_s(&self) -> f64 {
        let shortest = (2.0 * self.period - self.interval_max_s()).max(0.01 * self.period);
        shortest.max(self.delay_s().min(self.interval_max_s()))
    }

    /// The largest delay in s, at this loop's period. Never below the delay.
    pub fn delay_max_s(&self) -> f64 {
        let least = self.delay_s();
        self.delay_max.map_or(least, |largest| largest.seconds(self.period).max(least))
    }

    /// Whether the file states how uneven its intervals or delays may be: what it states is enforced at run time.
    pub fn states_times(&self) -> bool {
        self.interval_max.is_some() || self.delay_max.is_some()
    }

    /// Whether all intervals are the period, and all delays the same.
    pub fn is_even(&self) -> bool {
        self.interval_max_s() == self.period && self.delay_max_s() == self.delay_s()
    }

    /// Whether the velocity is the difference over more than one sample.
    pub fn takes_several_samples(&self) -> bool {
        self.estimator == EstimatorKind::Difference && self.every > 1
    }

    /// The key that the estimator requires, and its number.
    pub(crate) fn required(&self) -> Option<(&'static str, Option<f64>)> {
        match self.estimator {
            EstimatorKind::LowPass | EstimatorKind::Kalman => Some(("cutoff", self.cutoff)),
            EstimatorKind::Levant => Some(("acceleration", self.acceleration)),
            EstimatorKind::Exact | EstimatorKind::Difference | EstimatorKind::Foaw | EstimatorKind::FoawBest => None,
        }
    }

    /// Whether the velocity is a linear function of the positions: FOAW changes its window, and Levant's differentiator follows no more than
    /// its acceleration.
    pub fn has_linear_estimator(&self) -> bool {
        match self.estimator {
            EstimatorKind::Foaw | EstimatorKind::FoawBest => self.window <= 1,
            EstimatorKind::Levant => false,
            EstimatorKind::Exact | EstimatorKind::Difference | EstimatorKind::LowPass | EstimatorKind::Kalman => true,
        }
    }

    /// The estimator with its parameters.
    pub fn velocity_estimator(&self) -> Estimator {
        match self.estimator {
            EstimatorKind::Exact => Estimator::Exact,
            EstimatorKind::Difference if self.every > 1 => Estimator::DifferenceOver { every: self.every },
            EstimatorKind::Difference => Estimator::Difference,
            // The reader refuses low-pass without a cutoff; an infinite one is the plain difference.
            EstimatorKind::LowPass => Estimator::LowPass { cutoff: self.cutoff.unwrap_or(f64::INFINITY) },
            EstimatorKind::Foaw => Estimator::Foaw { window: self.window },
            EstimatorKind::FoawBest => Estimator::FoawBest { window: self.window },
            // The reader refuses these without their key.
            EstimatorKind::Kalman => Estimator::Kalman { cutoff: self.cutoff.unwrap_or(f64::INFINITY) },
            EstimatorKind::Levant => Estimator::Levant { acceleration: self.acceleration.unwrap_or(f64::INFINITY) },
        }
    }
}
