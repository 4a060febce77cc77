//! The record of a motion: times, positions and the torques that were commanded.

use std::ops::Range;

use crate::Error;
use crate::counts::{Lattice, lattice};
use crate::noise::noise;

/// The longest delay that is searched, in s. The part of a record that is fitted first begins this long after its beginning: by then every
/// torque that can still arrive has been recorded.
pub const LONGEST_DELAY: f64 = 0.05;
/// Smaller torques, in N·m (N), are none: their squares would be lost to rounding.
const LEAST_TORQUE: f64 = 1e-100;
/// The earliest action of a command before its time, in s: delays below 0 are searched down to here.
pub(crate) const EARLIEST: f64 = 0.2 * LONGEST_DELAY;

/// The fewest samples of a record.
const FEWEST_SAMPLES: usize = 200;
const SHORTEST: f64 = 0.5;
/// Samples farther apart, s, do not determine a device.
const SPARSEST: f64 = 0.5;
const FEWEST_VALUES: usize = 8;

/// This many consecutive equal positions are one measurement: a puck at rest on one count, without noise.
const AT_REST: usize = 100;

/// A record, with a test of whether its analysis was cancelled.
#[derive(Clone, Copy)]
pub(crate) struct CancellableRecord<'a> {
    pub record: &'a Record,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl std::ops::Deref for CancellableRecord<'_> {
    type Target = Record;

    fn deref(&self) -> &Record {
        self.record
    }
}

/// A motion, sampled; in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    times: Vec<f64>,
    positions: Vec<f64>,
    torques: Vec<f64>,
    /// Whether a position was measured; else it is interpolated.
    measured: Vec<bool>,
    /// A second torque on the puck, measured.
    forces: Option<Vec<f64>>,
    /// Whether a position is new information, not a repetition of the one before it.
    news: Vec<bool>,
    /// The noise of the positions, rms.
    noise: f64,
    /// The standard deviation of the positions, and the torques' root mean square.
    spread: f64,
    effort: f64,
    lattice: Option<Lattice>,
}

impl Record {
    /// Times in s, increasing; positions in rad (linear: m); torques in N·m (N), each commanded at its sample and held until the next.
    ///
    /// # Errors
    /// Numbers that are not finite, times that do not increase, fewer than 200 samples, less than half a second, samples more than half a
    /// second apart, a puck that does not move, a torque that is always the same and not 0.
    pub fn new(times: Vec<f64>, positions: Vec<f64>, torques: Vec<f64>) -> Result<Self, Error> {
        if let Some((sample, value)) = positions.iter().enumerate().find(|(_, value)| value.is_nan()) {
            return Err(Error::NotFinite { sample, what: "position", value: *value });
        }
        Record::with_gaps(times, positions, torques)
    }

    /// The same, where some positions were not measured: these are NaN. Their torques act, and no fit compares them with a motion.
    ///
    /// # Errors
    /// As [`Record::new`], but for such positions.
    pub fn with_gaps(times: Vec<f64>, mut positions: Vec<f64>, torques: Vec<f64>) -> Result<Self, Error> {
        let lengths = (times.len(), positions.len(), torques.len());
        if lengths.0 != lengths.1 || lengths.0 != lengths.2 {
            return Err(Error::Lengths { times: lengths.0, positions: lengths.1, torques: lengths.2 });
        }
        for (what, values) in [("time", &times), ("position", &positions), ("torque", &torques)] {
            let is_gap = |value: &f64| what == "position" && value.is_nan();
            if let Some((sample, value)) =
                values.iter().enumerate().find(|(_, value)| !value.is_finite() && !is_gap(value))
            {
                return Err(Error::NotFinite { sample, what, value: *value });
            }
        }
        if let Some(i) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(Error::Times { sample: i + 1, time: times[i + 1], before: times[i] });
        }
        let duration = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
        // Times that were subtracted differ by rounding.
        if times.len() < FEWEST_SAMPLES || duration < SHORTEST * (1.0 - 1e-9) {
            return Err(Error::Short { samples: times.len(), duration });
        }
        let apart = duration / (times.len() - 1) as f64;
        if apart > SPARSEST {
            return Err(Error::Sparse { apart });
        }
        let measured: Vec<bool> = positions.iter().map(|z| !z.is_nan()).collect();
        let (seen_at, seen): (Vec<f64>, Vec<f64>) =
            times.iter().zip(&positions).filter(|(_, z)| !z.is_nan()).map(|(t, z)| (*t, *z)).unzip();
        let mut values = seen.clone();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.len() < FEWEST_VALUES {
            return Err(Error::Still { values: values.len() });
        }
        let torque = torques[0];
        if torque != 0.0 && torques.iter().all(|t| *t == torque) {
            return Err(Error::Constant { torque });
        }
        interpolate(&times, &mut positions);
        let news = positions
            .chunk_by(|a, b| a == b)
            .flat_map(|equal| (0..equal.len()).map(|i| i == 0 || equal.len() < AT_REST));
        let news = news.zip(&measured).map(|(is_news, is_measured)| is_news && *is_measured).collect();
        let noise = noise(&seen_at, &seen);
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / times.len() as f64;
        let middle = mean(&mut positions.iter().copied());
        let spread = mean(&mut positions.iter().map(|z| (z - middle).powi(2))).sqrt();
        let effort = mean(&mut torques.iter().map(|torque| torque * torque)).sqrt();
        if effort < LEAST_TORQUE && torques.iter().any(|torque| *torque != 0.0) {
            return Err(Error::Constant { torque: torques.iter().fold(0.0, |a: f64, b| a.max(b.abs())) });
        }
        let lattice = lattice(&seen);
        Ok(Record { news, noise, spread, effort, lattice, forces: None, measured, times, positions, torques })
    }

    /// The same with a second torque that acts on the puck, from a sensor: one value a sample, in N·m (N) or any multiple of it, of either
    /// sign. [`crate::fit_torque`] finds the factor.
    ///
    /// # Errors
    /// As many values as samples are needed, all finite, and not all the same.
    pub fn with_force(mut self, forces: Vec<f64>) -> Result<Self, Error> {
        if let Some((sample, value)) = forces.iter().enumerate().find(|(_, value)| !value.is_finite()) {
            return Err(Error::NotFinite { sample, what: "force", value: *value });
        }
        if forces.len() != self.times.len() {
            return Err(Error::Forces { forces: forces.len(), samples: self.times.len() });
        }
        if forces.iter().all(|force| *force == forces[0]) {
            return Err(Error::StillForce { force: forces[0] });
        }
        self.forces = Some(forces);
        Ok(self)
    }

    /// The first part of it, 1: all; `None` where that is too short, or moves too little, for a fit.
    pub(crate) fn beginning(&self, part: f64) -> Option<Record> {
        self.part(0..(part * self.times.len() as f64) as usize)
    }

    /// The samples of a range, without a second torque; `None` where that is too short or too still for a fit.
    fn part(&self, range: Range<usize>) -> Option<Record> {
        let [times, torques] = [&self.times, &self.torques].map(|x| x.get(range.clone()).map(<[f64]>::to_vec));
        let all = self.positions.iter().zip(&self.measured);
        let positions = all.map(|(z, is_measured)| if *is_measured { *z } else { f64::NAN });
        let positions = positions.skip(range.start).take(range.len()).collect();
        Record::with_gaps(times?, positions, torques?).ok()
    }

    /// A stretch of about this many s, or of twice as long and so on up to half of the record, with the longest path of the puck; `None`
    /// where all move too little for a fit.
    pub(crate) fn liveliest(&self, duration: f64) -> Option<Record> {
        let n = self.times.len();
        let shortest = ((duration / self.period()).ceil() as usize).max(FEWEST_SAMPLES);
        let lengths = std::iter::successors(Some(shortest), |length| Some(2 * length));
        let travel = |from: usize, length: usize| {
            self.positions[from..from + length].windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>()
        };
        lengths.take_while(|length| 2 * length <= n).find_map(|length| {
            let starts = (0..=n - length).step_by(length.div_ceil(2));
            let best = starts.max_by(|a, b| travel(*a, length).total_cmp(&travel(*b, length)))?;
            self.part(best..best + length)
        })
    }

    /// The times, in s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The positions, in rad (m).
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// The commanded torques, in N·m (N).
    pub fn torques(&self) -> &[f64] {
        &self.torques
    }

    /// The second torque, where one was measured.
    pub fn forces(&self) -> Option<&[f64]> {
        self.forces.as_deref()
    }

    /// Whether the position of a sample is a measurement, or repeats the one before it while the puck rests on a count.
    pub fn is_news(&self, sample: usize) -> bool {
        self.news.get(sample).copied().unwrap_or(false)
    }

    /// Whether the position of a sample was measured; else it is interpolated.
    pub(crate) fn is_measured(&self, sample: usize) -> bool {
        self.measured.get(sample).copied().unwrap_or(false)
    }

    /// The mean time from sample to sample, in s.
    pub fn period(&self) -> f64 {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        (last - first) / (self.times.len() - 1) as f64
    }

    /// The noise of the positions, rms, in rad (m), estimated without a fit.
    pub(crate) fn noise(&self) -> f64 {
        self.noise
    }

    /// The standard deviation of the positions, in rad (m).
    pub(crate) fn spread(&self) -> f64 {
        self.spread
    }

    /// The root mean square of the torques, in N·m (N).
    pub(crate) fn effort(&self) -> f64 {
        self.effort
    }

    /// The lattice of the positions, where they are on one.
    pub(crate) fn lattice(&self) -> Option<Lattice> {
        self.lattice
    }

    /// Whether there is any torque.
    pub fn is_driven(&self) -> bool {
        self.torques.iter().any(|torque| *torque != 0.0)
    }

    /// The first sample by which every torque that arrives after a delay of up to `delay` s has been recorded.
    pub fn first_after(&self, delay: f64) -> usize {
        let begin = self.times[0] + delay.clamp(0.0, LONGEST_DELAY);
        self.times.iter().position(|t| *t >= begin).unwrap_or(0)
    }

    /// The same for the longest delay that is searched.
    pub fn first(&self) -> usize {
        if self.is_driven() { self.first_after(LONGEST_DELAY) } else { 0 }
    }
}

/// Replaces each NaN by the straight line between its neighbours, at the ends by the nearest number.
fn interpolate(times: &[f64], positions: &mut [f64]) {
    let mut before: Option<usize> = None;
    for i in 0..positions.len() {
        if positions[i].is_nan() {
            continue;
        }
        let from = before.unwrap_or(i);
        let (start, slope) = match i - from {
            0 => (positions[i], 0.0),
            _ => (positions[from], (positions[i] - positions[from]) / (times[i] - times[from])),
        };
        let gap = before.map_or(0, |before| before + 1);
        for k in gap..i {
            positions[k] = start + slope * (times[k] - times[from]);
        }
        before = Some(i);
    }
    if let Some(last) = before {
        let value = positions[last];
        positions[last + 1..].fill(value);
    }
}
