//! When stations take their samples, and which of the other's positions each of them uses, where both repeat.

use hapt_model::{Link, Station, System};

use crate::equations::delay::Delay;
use crate::error::Error;

/// An instant within this part of a period of another is that one, as in the loop.
const NEAR: f64 = 1e-6;
/// The largest denominator of a ratio of two periods.
const DENOMINATOR: u64 = 64;

/// The times of one station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock {
    pub period: f64,
    pub phase: f64,
    /// From the sample to the change of the torque.
    pub delay: f64,
    fraction: f64,
    /// Samples in the common period.
    pub samples: i64,
}

/// The times of all stations, which repeat after `common`, s.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Schedule {
    pub common: f64,
    pub clocks: Vec<Clock>,
}

/// The positions of `sender` that `receiver` has of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MessageTiming {
    /// Between two messages, s.
    period: f64,
    /// The delay of a message, s.
    delay: f64,
    sender: Clock,
    receiver: Clock,
}

/// x as p/q with the least q up to [`DENOMINATOR`].
fn ratio(x: f64) -> Option<(u64, u64)> {
    let near = |q: &u64| {
        let p = x * *q as f64;
        p.round() >= 1.0 && p.round() < 1e6 && (p - p.round()).abs() <= 1e-9 * p
    };
    (1..=DENOMINATOR).find(near).map(|q| ((x * q as f64).round() as u64, q))
}

fn common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

impl Clock {
    fn of(station: &Station, common: f64) -> Result<Clock, Error> {
        let sampling = &station.world.sampling;
        let period = sampling.period;
        let delay = Delay::of_loop(sampling)?;
        Ok(Clock {
            period,
            phase: station.phase,
            delay: (delay.samples as f64 + delay.fraction) * period,
            fraction: delay.fraction,
            samples: (common / period).round() as i64,
        })
    }

    /// Stretches of time in the common period in which the torque does not change and no sample is taken.
    pub fn segments(&self) -> i64 {
        if self.fraction > 0.0 { 2 * self.samples } else { self.samples }
    }

    /// When the stretch of a number begins; any whole number.
    pub fn start(&self, segment: i64) -> f64 {
        if self.fraction > 0.0 {
            let part = if segment.rem_euclid(2) == 1 { self.fraction } else { 0.0 };
            return self.phase + (segment.div_euclid(2) as f64 + part) * self.period;
        }
        self.phase + segment as f64 * self.period
    }

    pub fn length(&self, segment: i64) -> f64 {
        self.start(segment + 1) - self.start(segment)
    }

    /// The stretch that an instant is in.
    pub fn segment_at(&self, time: f64) -> i64 {
        let samples = (time - self.phase) / self.period;
        let whole = samples.floor();
        if self.fraction > 0.0 {
            return 2 * whole as i64 + i64::from(samples - whole >= self.fraction);
        }
        whole as i64
    }

    /// The number of the sample whose torque acts at an instant at which the torque does not change.
    pub fn acting(&self, time: f64) -> i64 {
        ((time - self.phase - self.delay) / self.period).floor() as i64
    }

    pub fn sample(&self, number: i64) -> f64 {
        self.phase + number as f64 * self.period
    }
}

impl Schedule {
    /// `None` where the periods have no common multiple of few samples.
    pub fn of(network: &System) -> Result<Option<Schedule>, Error> {
        let Some(first) = network.stations.first().map(|station| station.world.sampling.period) else {
            return Ok(None);
        };
        // Every period in parts of the first, and their least common multiple.
        let (mut above, mut below) = (1u64, DENOMINATOR.pow(2) * DENOMINATOR);
        let messages = network
            .links
            .iter()
            .flat_map(|link| link.between.map(|at| link.between_messages(network.stations[at].world.sampling.period)));
        for period in network.stations.iter().map(|station| station.world.sampling.period).chain(messages) {
            let Some((p, q)) = ratio(period / first) else { return Ok(None) };
            // lcm(a/b, p/q) = lcm(a, p)/gcd(b, q) of reduced fractions
            above = match above.checked_mul(p / common_divisor(above, p)) {
                Some(above) if above <= 1 << 20 => above,
                _ => return Ok(None),
            };
            below = if below == DENOMINATOR.pow(3) { q } else { common_divisor(below, q) };
        }
        let common = first * above as f64 / below as f64;
        let clocks = network.stations.iter().map(|station| Clock::of(station, common)).collect::<Result<_, _>>()?;
        Ok(Some(Schedule { common, clocks }))
    }

    /// When the station `to` receives the positions of the other end of a link.
    pub fn message_timing(&self, link: &Link, to: usize) -> MessageTiming {
        let from = link.between[usize::from(link.between[0] == to)];
        let sender = self.clocks[from];
        MessageTiming {
            period: link.between_messages(sender.period),
            delay: link.delay,
            sender,
            receiver: self.clocks[to],
        }
    }
}

impl MessageTiming {
    /// The instant of the other's position that is used at the sample of a number.
    pub fn used(&self, sample: i64) -> f64 {
        let time = self.receiver.sample(sample);
        let near = NEAR * self.receiver.period;
        let number = ((time + near - self.delay - self.sender.phase) / self.period).floor();
        let sent = self.sender.phase + number * self.period;
        // A position of the same instant is of no use: its message leaves when this sample is taken.
        if sent > time - near { sent - self.period } else { sent }
    }

    /// The greatest age at a sample.
    pub fn age(&self) -> f64 {
        (0..self.receiver.samples).map(|sample| self.receiver.sample(sample) - self.used(sample)).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_of_periods_are_found_or_are_none() {
        assert_eq!(ratio(1.0), Some((1, 1)));
        assert_eq!(ratio(0.75), Some((3, 4)));
        assert_eq!(ratio(2e-3 / 3e-3), Some((2, 3)));
        assert_eq!(ratio(std::f64::consts::PI), None);
        assert_eq!(ratio(1e-9), None);
    }

    #[test]
    fn a_stretch_holds_the_instants_from_its_start_to_the_next() {
        let clock = Clock { period: 2e-3, phase: 0.3e-3, delay: 2.5e-3, fraction: 0.25, samples: 3 };
        assert_eq!(clock.segments(), 6);
        for segment in -7..9 {
            let (start, length) = (clock.start(segment), clock.length(segment));
            assert_eq!(clock.segment_at(start + 0.5 * length), segment);
            assert!((length - if segment.rem_euclid(2) == 0 { 0.5e-3 } else { 1.5e-3 }).abs() < 1e-15);
        }
        // The torque of sample 0 acts from 2.8 ms to 4.8 ms.
        assert_eq!([2.7e-3, 2.9e-3, 4.7e-3, 4.9e-3].map(|time| clock.acting(time)), [-1, 0, 0, 1]);
    }
}
