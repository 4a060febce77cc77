//! The times of a run's samples, and the delays of their commands.

use hapt_model::{Sampling, Timing, of_pattern};

/// The true times of a run's samples, one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    timing: Timing,
    period: f64,
    /// The smallest and the largest delay, in s.
    delay: [f64; 2],
    /// The shortest and the longest interval, in s.
    interval: [f64; 2],
    sample: u64,
    /// t_k in s; for a pattern in periods, so that whole periods have no rounding.
    time: f64,
    random: u64,
}

/// The delay and the interval after a sample, in s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick {
    /// From the sample to the arrival of its command, no longer than the interval.
    pub delay: f64,
    /// To the next sample.
    pub interval: f64,
}

impl Schedule {
    /// The schedule from t = 0 on, of a timing that suits the loop ([`Timing::fault`]).
    pub fn new(timing: &Timing, sampling: &Sampling) -> Self {
        let seed = if let Timing::Random { seed, .. } = timing { u64::from(*seed) } else { 0 };
        Schedule {
            period: sampling.period,
            delay: [sampling.delay_s(), sampling.delay_max_s()],
            interval: [timing.shortest(sampling), sampling.interval_max_s()],
            timing: timing.clone(),
            sample: 0,
            time: 0.0,
            random: seed,
        }
    }

    /// t_k in s.
    pub fn time(&self) -> f64 {
        match self.timing {
            Timing::Even | Timing::Worst => self.sample as f64 * self.period,
            Timing::Pattern { .. } => self.time * self.period,
            Timing::Random { .. } | Timing::Recorded { .. } => self.time,
        }
    }

    /// The delay and the interval after this sample; the schedule advances to the next.
    pub fn advance(&mut self) -> Tick {
        let k = self.sample;
        self.sample += 1;
        match &self.timing {
            Timing::Even | Timing::Worst => Tick { delay: self.delay[0], interval: self.period },
            Timing::Pattern { intervals, delays } => {
                let i = (k % intervals.len().max(1) as u64) as usize;
                let interval = intervals.get(i).copied().unwrap_or(1.0);
                self.time += interval;
                let delay = of_pattern(delays, i).map_or(self.delay[0], |delay| delay * self.period);
                Tick { delay, interval: interval * self.period }
            }
            Timing::Random { .. } => {
                let delay = between(self.delay, uniform(&mut self.random));
                // A sample is taken only after the previous sample's command has arrived.
                let [shortest, longest] = self.interval;
                let interval = between([shortest.max(delay).min(longest), longest], uniform(&mut self.random));
                self.time += interval;
                Tick { delay, interval }
            }
            Timing::Recorded { samples, .. } => {
                let at = |k: u64| samples.get(k as usize).copied();
                let Some(((from, delay), (to, _))) = at(k).zip(at(k + 1)) else {
                    // After the end of the recording; runs end before.
                    self.time = f64::INFINITY;
                    return Tick { delay: self.delay[0], interval: self.period };
                };
                self.time = to - samples.first().map_or(0.0, |first| first.0);
                Tick { delay: delay.unwrap_or(self.delay[0]), interval: to - from }
            }
        }
    }

    /// The number of samples from t = 0 to `end` s inclusive, with a tolerance of a millionth of a period.
    pub fn samples_until(mut self, end: f64) -> u64 {
        let end = end + 1e-6 * self.period;
        let mut samples = 0;
        while self.time() <= end {
            samples += 1;
            self.advance();
        }
        samples
    }
}

pub(crate) fn between([from, to]: [f64; 2], part: f64) -> f64 {
    from + (to - from) * part
}

/// The next random number in [0, 1) by SplitMix64 (Steele, Lea and Flood, 2014): the same on every machine and in every version.
pub fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
