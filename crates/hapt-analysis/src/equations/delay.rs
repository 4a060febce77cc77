//! The delay of the loop in samples.

use hapt_model::Sampling;

use crate::error::Error;

/// Largest number of commands in flight. Each is a row of the dense matrix of the free loop.
pub const MAX_IN_FLIGHT: usize = 500;

/// A delay of (samples + fraction) periods, 0 ≤ fraction < 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Delay {
    pub samples: usize,
    pub fraction: f64,
}

impl Delay {
    /// A delay in s. Within 1e-6 of a whole sample it is that sample, as in the loop.
    ///
    /// # Errors
    /// [`Error::InFlight`] when more than [`MAX_IN_FLIGHT`] commands are in flight.
    pub fn of(seconds: f64, period: f64) -> Result<Self, Error> {
        let ratio = seconds / period;
        if ratio > MAX_IN_FLIGHT as f64 {
            return Err(Error::InFlight { delay: seconds, period, limit: MAX_IN_FLIGHT });
        }
        let whole = ratio.round();
        let near = (ratio - whole).abs() <= 1e-6;
        let samples = if near { whole } else { ratio.floor() };
        Ok(Delay { samples: samples as usize, fraction: if near { 0.0 } else { ratio - samples } })
    }

    /// The delay of a loop.
    ///
    /// # Errors
    /// As [`Delay::of`].
    pub fn of_loop(sampling: &Sampling) -> Result<Self, Error> {
        Delay::of(sampling.delay_s(), sampling.period)
    }

    /// Number of earlier commands that the motor still holds or has yet to receive.
    pub fn in_flight(self) -> usize {
        self.samples + usize::from(self.fraction > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_near_a_whole_sample_is_that_sample() {
        let of = |seconds: f64| Delay::of(seconds, 1e-3).unwrap();
        assert_eq!(of(3e-3), Delay { samples: 3, fraction: 0.0 });
        assert_eq!(of(3e-3 + 0.9e-9), Delay { samples: 3, fraction: 0.0 });
        assert_eq!(of(3e-3 - 0.9e-9), Delay { samples: 3, fraction: 0.0 });
        let more = of(3e-3 + 2e-9);
        assert!(more.samples == 3 && (more.fraction - 2e-6).abs() < 1e-12);
        assert_eq!(of(2.5e-3).in_flight(), 3);
        assert_eq!(of(0.0).in_flight(), 0);
        assert!(Delay::of(0.5001, 1e-3).is_err());
    }
}
