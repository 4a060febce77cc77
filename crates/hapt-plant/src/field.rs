//! The torques of the device that depend on the puck's position, gravity, cogging and the changes of friction, and the motion under them.
//!
//! ```text
//! ẏ = N y + e_v τ(x)/m,    τ(x) = Σ (a sin rx + b cos rx) = -V'(x)
//! ```
//!
//! N is the linear motion without them ([`crate::plant`], [`crate::shaft`]). A step is the Taylor series of the solution: the coefficients of
//! sin rx and cos rx follow from those of x, by s' = r x' c and c' = -r x' s. A step is so short that its last terms are rounding: it is as
//! exact as the linear motion, and stops are located on the series.

use core::f64::consts::TAU;

use hapt_core::{HARMONICS, Waveform};

use crate::exponential::{GAUSS, Square};
use crate::root::root;
use crate::spec::{DeviceTorque, FrictionByPosition};
use crate::stop::Line;

/// Sines: gravity's, the harmonics of cogging, and those of friction.
const WAVES: usize = 1 + 2 * HARMONICS;
/// Terms of a step's series.
const TERMS: usize = 19;
/// Radians of the fastest rate in a step at most.
const STEP: f64 = 0.5;
/// The least factor by which a series is shortened at once.
const SHORTEST: f64 = 0.05;
/// The most times that a series is shortened.
const TRIES: usize = 40;
/// The shortest part of a series that is searched for an event: a shorter visit beyond a line is rounding.
const SHORTEST_RISE: f64 = 1e-12;
/// The largest phase, in rad, that the puck may pass of a wave in one stretch; beyond it the wave counts by its mean, which is 0.
const MAX_WAVE_RAD: f64 = 1e4;

/// a sin rx + b cos rx
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Wave {
    rate: f64,
    sine: f64,
    cosine: f64,
}

/// A sum of sines of the position. In N·m and rad (linear: N, m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Field {
    waves: [Wave; WAVES],
}

impl Wave {
    /// torque · sin(rx + angle), or the same of cos.
    fn new(rate: f64, angle: f64, sine: f64, cosine: f64) -> Self {
        let (s, c) = libm::sincos(angle);
        Wave { rate, sine: sine * c - cosine * s, cosine: sine * s + cosine * c }
    }

    fn size(&self) -> f64 {
        libm::hypot(self.sine, self.cosine)
    }
}

impl Field {
    /// The field of a device whose coordinate is `origin` at the puck's 0; `None` without such torques.
    pub fn new(torque: &DeviceTorque, origin: f64) -> Option<Self> {
        let mut waves = [Wave::default(); WAVES];
        if let Some(gravity) = &torque.gravity {
            waves[0] = Wave::new(1.0, origin + gravity.phase, gravity.torque, 0.0);
        }
        if let Some(cogging) = &torque.cogging {
            let from = origin - cogging.phase;
            set_harmonics(&mut waves[1..], cogging.torque, cogging.pitch, from, &cogging.waveform);
        }
        Field { waves }.if_any()
    }

    /// The changes of a friction whose mean is 1, likewise; `None` where it does not change.
    pub fn of_friction(friction: &FrictionByPosition, origin: f64) -> Option<Self> {
        let mut waves = [Wave::default(); WAVES];
        let from = origin - friction.phase;
        // No level is below 0, whatever rounding has made of the harmonics.
        let share = friction.share / friction.most().max(1.0);
        set_harmonics(&mut waves[1 + HARMONICS..], share, friction.pitch, from, &friction.waveform);
        Field { waves }.if_any()
    }

    fn if_any(self) -> Option<Self> {
        self.waves.iter().any(|wave| wave.size() > 0.0).then_some(self)
    }

    /// `factor` times as much.
    pub fn times(&self, factor: f64) -> Field {
        Field { waves: self.waves.map(|wave| Wave { sine: factor * wave.sine, cosine: factor * wave.cosine, ..wave }) }
    }

    /// Together with the changes of friction, which this field does not contain.
    pub fn and(&self, friction: &Field) -> Field {
        let mut both = *self;
        both.waves[1 + HARMONICS..].copy_from_slice(&friction.waves[1 + HARMONICS..]);
        both
    }

    /// The waves that are not 0.
    fn waves(&self) -> impl Iterator<Item = &Wave> {
        self.waves.iter().filter(|wave| wave.sine != 0.0 || wave.cosine != 0.0)
    }

    /// Its value with the puck at x: of gravity and cogging the torque on the puck.
    pub fn at(&self, x: f64) -> f64 {
        let of = |wave: &Wave| {
            let (s, c) = libm::sincos(wave.rate * x);
            wave.sine * s + wave.cosine * c
        };
        self.waves().map(of).sum()
    }

    /// Its largest value at most.
    pub fn size(&self) -> f64 {
        self.waves().map(Wave::size).sum()
    }

    /// Its integral over the position: the work on a puck that moves from `from` to `to`.
    pub fn work(&self, from: f64, to: f64) -> f64 {
        let of = |wave: &Wave| {
            let half_phase = 0.5 * wave.rate * (to - from);
            let (s, c) = libm::sincos(0.5 * wave.rate * (to + from));
            (wave.sine * s + wave.cosine * c) * 2.0 * libm::sin(half_phase) / wave.rate
        };
        self.waves().map(of).sum()
    }

    /// The fastest rate in 1/s that it adds to a puck of this mass and velocity.
    fn rate(&self, mass: f64, velocity: f64) -> f64 {
        let stiffness: f64 = self.waves().map(|wave| wave.rate * wave.size()).sum();
        let fastest = self.waves().map(|wave| wave.rate).fold(0.0, f64::max);
        libm::sqrt(stiffness / mass) + fastest * velocity.abs()
    }

    /// The field without the waves of which a puck of this velocity passes more than [`MAX_WAVE_RAD`] in `dt` s: their mean is 0.
    pub fn felt(&self, velocity: f64, dt: f64) -> Field {
        // A NaN velocity removes every wave.
        let is_felt = |wave: &Wave| wave.rate * velocity.abs() * dt <= MAX_WAVE_RAD;
        Field { waves: self.waves.map(|wave| if is_felt(&wave) { wave } else { Wave::default() }) }
    }
}

/// The waves of this many times a waveform that begins at -`from`.
fn set_harmonics(waves: &mut [Wave], size: f64, pitch: f64, from: f64, waveform: &Waveform) {
    // Within a pitch: over many pitches the rounding of the product with the rate is large, or it overflows.
    let from = libm::fmod(from, pitch);
    for (wave, (n, sine, cosine)) in waves.iter_mut().zip(waveform.harmonics()) {
        let rate = TAU * n / pitch;
        *wave = Wave::new(rate, rate * from, size * sine, size * cosine);
    }
}

/// A puck in a field: its linear motion, the fastest rate in that, its mass, and the indices of its velocity and position.
pub(crate) struct Fielded<'a, const K: usize> {
    pub field: &'a Field,
    pub n: &'a Square<K>,
    pub rate: f64,
    pub mass: f64,
    pub v: usize,
    pub x: usize,
}

/// The series of a motion from a state on, in parts of its length.
pub(crate) struct Series<const K: usize> {
    terms: [[f64; K]; TERMS],
    /// In s.
    pub length: f64,
}

impl<const K: usize> Fielded<'_, K> {
    /// From `y` on, for `left` s at most.
    pub fn series(&self, y: &[f64; K], left: f64) -> Series<K> {
        let rate = self.rate + self.field.rate(self.mass, y[self.v]);
        let mut series = self.terms(y, if rate * left > STEP { STEP / rate } else { left });
        // The rate is that at its start: a puck that speeds up may pass many periods of a wave, so many that the terms overflow.
        for _ in 0..TRIES {
            if series.is_finite(self.v) {
                break;
            }
            series = self.terms(y, SHORTEST * series.length);
        }
        series.shorten(self.v);
        series
    }

    /// The terms of a series of this length in s.
    fn terms(&self, y: &[f64; K], h: f64) -> Series<K> {
        let mut terms = [[0.0; K]; TERMS];
        terms[0] = *y;
        let mut sines = [[(0.0, 0.0); TERMS]; WAVES];
        for (series, wave) in sines.iter_mut().zip(self.field.waves()) {
            series[0] = libm::sincos(wave.rate * y[self.x]);
        }
        for j in 1..TERMS {
            let part = h / j as f64;
            let before = terms[j - 1];
            for (x, row) in terms[j].iter_mut().zip(self.n) {
                *x = row.iter().zip(&before).map(|(n, y)| n * y).sum::<f64>() * part;
            }
            let torque: f64 = sines
                .iter()
                .zip(self.field.waves())
                .map(|(series, wave)| wave.sine * series[j - 1].0 + wave.cosine * series[j - 1].1)
                .sum();
            terms[j][self.v] += torque / self.mass * part;
            for (series, wave) in sines.iter_mut().zip(self.field.waves()) {
                let (mut s, mut c) = (0.0, 0.0);
                for i in 1..=j {
                    let turn = i as f64 * terms[i][self.x];
                    s += turn * series[j - i].1;
                    c -= turn * series[j - i].0;
                }
                let factor = wave.rate / j as f64;
                series[j] = (factor * s, factor * c);
            }
        }
        Series { terms, length: h }
    }

    /// The first instant in (0, length] at which a line, not positive at 0, becomes positive.
    pub fn first_above(&self, series: &Series<K>, line: &Line) -> Option<f64> {
        let mut terms = series.terms.map(|y| line.velocity * y[self.v] + line.position * y[self.x]);
        terms[0] += line.constant;
        let course = |t: f64| {
            let y = series.after(t);
            line.value(y[self.v], y[self.x])
        };
        let [from, to] = first_rise(&terms, [0.0, 1.0], &|part| course(part * series.length))?;
        Some(root(from * series.length, to * series.length, course))
    }
}

/// The first part of `[from, to]` in which a polynomial rises, and is positive at its end by `course`, its value at a place there. The terms are those
/// of u from 0 at `from` to 1 at `to`. Halves are searched until each is negative, or rises or falls throughout: so a motion that begins at
/// rest, or turns twice, is searched too.
fn first_rise(terms: &[f64; TERMS], [from, to]: [f64; 2], course: &impl Fn(f64) -> f64) -> Option<[f64; 2]> {
    let becomes_positive = || (course(to) > 0.0).then_some([from, to]);
    // Halves of what has overflowed are never decided.
    if !terms.iter().all(|term| term.is_finite()) {
        return becomes_positive();
    }
    let [value, higher @ ..] = terms;
    if value + higher.iter().map(|term| term.max(0.0)).sum::<f64>() <= 0.0 {
        return None;
    }
    let slope = |bound: fn(f64, f64) -> f64| -> f64 {
        let of = |(j, term): (usize, &f64)| if j == 0 { *term } else { (j + 1) as f64 * bound(*term, 0.0) };
        higher.iter().enumerate().map(of).sum()
    };
    if slope(f64::max) <= 0.0 {
        return None;
    }
    if slope(f64::min) >= 0.0 || to - from < SHORTEST_RISE {
        return becomes_positive();
    }
    let mut half = *terms;
    let mut power = 1.0;
    for term in &mut half {
        *term *= power;
        power *= 0.5;
    }
    let middle = 0.5 * (from + to);
    first_rise(&half, [from, middle], course).or_else(|| {
        // From u to u + 1: the second half.
        for from in 0..TERMS {
            for j in (from..TERMS - 1).rev() {
                half[j] += half[j + 1];
            }
        }
        first_rise(&half, [middle, to], course)
    })
}

impl<const K: usize> Series<K> {
    /// Whether its terms have not overflowed; a state that is not finite has no finite terms.
    fn is_finite(&self, v: usize) -> bool {
        !self.terms[0][v].is_finite() || self.terms[1..].iter().all(|term| term[v].is_finite())
    }

    /// Shortens it until the last terms of the velocity are rounding, compared with the largest of the shortened series.
    fn shorten(&mut self, v: usize) {
        // Once is enough where the largest terms are the first.
        let mut slack = 1.0;
        for _ in 0..TRIES {
            let last = self.terms[TERMS - 1][v].abs().max(self.terms[TERMS - 2][v].abs());
            let most = self.terms[1..].iter().map(|term| term[v].abs()).fold(0.0, f64::max);
            let allowed = f64::EPSILON * 0.25 * most;
            if allowed == 0.0 || last.is_nan() || last <= slack * allowed {
                break;
            }
            self.scale(libm::pow(allowed / last, 1.0 / (TERMS - 2) as f64).clamp(SHORTEST, 1.0));
            slack = 1.0 / SHORTEST;
        }
    }

    /// To this part of its length.
    fn scale(&mut self, part: f64) {
        self.length *= part;
        let mut power = 1.0;
        for term in &mut self.terms[1..] {
            power *= part;
            term.iter_mut().for_each(|x| *x *= power);
        }
    }

    /// The state after `t` s.
    pub fn after(&self, t: f64) -> [f64; K] {
        let part = t / self.length;
        let mut y = [0.0; K];
        for term in self.terms.iter().rev() {
            for (y, x) in y.iter_mut().zip(term) {
                *y = *y * part + x;
            }
        }
        y
    }

    /// The integrals of powers over `t` s.
    pub fn works<const N: usize>(&self, t: f64, powers: impl Fn(&[f64; K]) -> [f64; N]) -> [f64; N] {
        let mut works = [0.0; N];
        for (node, weight) in GAUSS {
            for (work, power) in works.iter_mut().zip(powers(&self.after(node * t))) {
                *work += weight * t * power;
            }
        }
        works
    }
}
