//! A hand's intended position or torque as a function of time, in pieces.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_2, PI};

use crate::spec::Shape;

/// A shape aligned with the loop's samples: at least one piece, the first from 0 on, with starts that do not decrease.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Trajectory(Vec<Piece>);

/// A trajectory from `from` on, until the next piece starts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Piece {
    pub(crate) from: f64,
    pub(crate) form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Form {
    /// value + slope · (t - from)
    Straight { value: f64, slope: f64 },
    /// amplitude · sin(omega t + phase)
    Sine { amplitude: f64, omega: f64, phase: f64 },
}

impl Piece {
    pub(crate) fn straight(from: f64, value: f64, slope: f64) -> Self {
        Piece { from, form: Form::Straight { value, slope } }
    }

    /// Value and slope at t.
    pub fn at(&self, t: f64) -> (f64, f64) {
        match self.form {
            Form::Straight { value, slope } => (value + slope * (t - self.from), slope),
            Form::Sine { amplitude, omega, phase } => {
                let (sin, cos) = libm::sincos(omega * t + phase);
                (amplitude * sin, amplitude * omega * cos)
            }
        }
    }

    /// Amplitude, ω in rad/s and the phase at t = 0 of a sine.
    pub(crate) fn sine(&self) -> Option<(f64, f64, f64)> {
        match self.form {
            Form::Sine { amplitude, omega, phase } => Some((amplitude, omega, phase)),
            Form::Straight { .. } => None,
        }
    }

    /// Whether it stays at one value.
    pub fn is_flat(&self) -> bool {
        matches!(self.form, Form::Straight { slope: 0.0, .. })
    }

    /// ∫ v² dt and ∫ |v| dt of the piece as a motion over [from, to].
    pub(crate) fn travel(&self, from: f64, to: f64) -> (f64, f64) {
        match self.form {
            Form::Straight { slope, .. } => (slope * slope * (to - from), slope.abs() * (to - from)),
            Form::Sine { amplitude, omega, phase } => {
                let (a, b) = (omega * from + phase, omega * to + phase);
                // ∫ cos² = (b - a)/2 + sin(b - a) cos(b + a)/2, a product, so that short spans keep their digits.
                let square = 0.5 * ((b - a) + libm::sin(b - a) * libm::cos(b + a));
                (amplitude * amplitude * omega * square, amplitude.abs() * (path_of_sine(b) - path_of_sine(a)))
            }
        }
    }
}

impl Piece {
    /// ∫ |v| max(0, 1 - |v|/slow) dt of the piece as a motion over [from, to].
    pub(crate) fn slow_travel(&self, from: f64, to: f64, slow: f64) -> f64 {
        match self.form {
            Form::Straight { slope, .. } => slope.abs() * (1.0 - slope.abs() / slow).max(0.0) * (to - from),
            Form::Sine { amplitude, omega, phase } => {
                // With u = θ - π/2 it is ∫ (A |sin u| - A²ω/slow sin² u) du where |sin u| is below slow/(Aω): within w of every half turn.
                let size = amplitude.abs();
                let part = slow / (size * omega);
                let w = if part < 1.0 { libm::asin(part) } else { FRAC_PI_2 };
                let from_half_turn = |x: f64| {
                    let half = libm::sin(0.5 * x);
                    size * (2.0 * half * half - (0.5 * x - 0.25 * libm::sin(2.0 * x)) / part)
                };
                let until = |t: f64| {
                    let u = omega * t + phase - FRAC_PI_2;
                    let halves = libm::round(u / PI);
                    let rest = u - halves * PI;
                    2.0 * halves * from_half_turn(w) + from_half_turn(rest.abs().min(w)).copysign(rest)
                };
                if size * omega > 0.0 { until(to) - until(from) } else { 0.0 }
            }
        }
    }

    /// The motion over [from, to] as runs without a turning point, each with its number of occurrences, its start and its end.
    pub(crate) fn runs(&self, from: f64, to: f64) -> [(f64, f64, f64); 4] {
        let (start, end) = (self.at(from).0, self.at(to).0);
        let none = (0.0, start, start);
        let Form::Sine { amplitude, omega, phase } = self.form else { return [(1.0, start, end), none, none, none] };
        // Half turns begin where cos is 0; after an even number of them the sine rises.
        let half = |t: f64| libm::floor((omega * t + phase + FRAC_PI_2) / PI);
        let (first, last) = (half(from), half(to));
        if first == last {
            return [(1.0, start, end), none, none, none];
        }
        let top = |half: f64| if half % 2.0 == 0.0 { amplitude } else { -amplitude };
        // Those between alternate, beginning and ending with what follows the first.
        let between = last - first - 1.0;
        let (turn, back) = (top(first), -top(first));
        let (odd, even) = (libm::ceil(0.5 * between), libm::floor(0.5 * between));
        [(1.0, start, turn), (odd, turn, back), (even, back, turn), (1.0, -top(last), end)]
    }

    /// ∫ v e^(-(t - from)/lag) dt of the piece as a motion over [from, to].
    pub(crate) fn decaying_travel(&self, from: f64, to: f64, lag: f64) -> f64 {
        let length = to - from;
        match self.form {
            Form::Straight { slope, .. } => -slope * lag * libm::expm1(-length / lag),
            Form::Sine { amplitude, omega, phase } => {
                // The real part of A ω e^(iθ) (e^(λ length) - 1)/λ, λ = iω - 1/lag; the difference with its digits.
                let (a, b) = (-length / lag, omega * length);
                let (half, (sin, cos)) = (libm::sin(0.5 * b), libm::sincos(b));
                let (re, im) = (libm::expm1(a) * cos - 2.0 * half * half, libm::exp(a) * sin);
                let turn = omega * lag;
                let scale = lag / (1.0 + turn * turn);
                let (re, im) = (scale * (im * turn - re), -scale * (im + re * turn));
                let (sin, cos) = libm::sincos(omega * from + phase);
                amplitude * omega * (cos * re - sin * im)
            }
        }
    }
}

/// An instant within 1e-6 T of a whole sample is that sample, t_k = k·T in one multiplication.
pub(crate) fn snap(t: f64, period: f64) -> f64 {
    let sample = libm::round(t / period) * period;
    if (t - sample).abs() <= 1e-6 * period { sample } else { t }
}

impl Trajectory {
    pub fn new(shape: &Shape, period: f64) -> Self {
        let rest = Piece::straight(0.0, 0.0, 0.0);
        Trajectory(match *shape {
            Shape::Step { to, at } => vec![rest, Piece::straight(snap(at, period), to, 0.0)],
            Shape::Ramp { to, at, over } => {
                let (from, end) = (snap(at, period), snap(at + over, period));
                // A ramp within one sample's snap keeps its own length.
                let end = if end > from { end } else { from + over };
                vec![rest, Piece::straight(from, 0.0, to / (end - from)), Piece::straight(end, to, 0.0)]
            }
            Shape::Sine { amplitude, frequency, phase } => {
                let omega = core::f64::consts::TAU * frequency;
                vec![rest, Piece { from: 0.0, form: Form::Sine { amplitude, omega, phase } }]
            }
            Shape::Path { ref points, .. } => {
                let first = points.first().map_or(0.0, |point| point.1);
                let mut pieces = vec![Piece::straight(0.0, first, 0.0)];
                let mut points = points.iter().map(|&(t, value)| (snap(t, period), value)).peekable();
                while let Some((from, value)) = points.next() {
                    // Two points may snap to one sample; the later one counts from there on.
                    let slope = match points.peek() {
                        Some(&(end, next)) if end > from => (next - value) / (end - from),
                        _ => 0.0,
                    };
                    pieces.push(Piece::straight(from, value, slope));
                }
                pieces
            }
        })
    }

    /// The first piece, before any event at 0.
    pub fn first(&self) -> Piece {
        self.0[0]
    }

    /// Whether every piece stays at one value.
    pub fn is_steady(&self) -> bool {
        self.0.iter().all(Piece::is_flat)
    }

    /// The last piece.
    pub fn last(&self) -> Piece {
        self.0[self.0.len() - 1]
    }

    /// The piece at t; at a boundary the later piece.
    pub fn piece(&self, t: f64) -> Piece {
        self.0[self.0.partition_point(|piece| piece.from <= t).saturating_sub(1)]
    }

    /// The first instant after t at which a new piece begins.
    pub fn next_break(&self, t: f64) -> Option<f64> {
        self.0.get(self.0.partition_point(|piece| piece.from <= t)).map(|piece| piece.from)
    }
}

/// ∫₀^θ |cos|: two for each half turn, and the rest from the nearest.
fn path_of_sine(theta: f64) -> f64 {
    let halves = libm::round(theta / core::f64::consts::PI);
    let rest = libm::sin(theta);
    2.0 * halves + if halves % 2.0 == 0.0 { rest } else { -rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_on_a_sample_has_happened_at_it_and_not_before() {
        let trajectory = Trajectory::new(&Shape::Step { to: 2.0, at: 0.3 }, 0.1);
        let t3 = 3.0 * 0.1;
        assert_ne!(t3, 0.3);
        assert_eq!(trajectory.piece(t3).at(t3), (2.0, 0.0));
        assert_eq!(trajectory.piece(0.999 * t3).at(t3), (0.0, 0.0));
        assert_eq!(trajectory.next_break(0.0), Some(t3));
        assert_eq!(trajectory.next_break(t3), None);
    }

    #[test]
    fn a_ramp_runs_straight_and_ends_where_it_should() {
        let trajectory = Trajectory::new(&Shape::Ramp { to: 3.0, at: 0.25, over: 0.5 }, 0.1);
        let at = |t: f64| trajectory.piece(t).at(t);
        assert_eq!(at(0.2), (0.0, 0.0));
        assert_eq!(at(0.5), (1.5, 6.0));
        assert_eq!(at(0.74).1, 6.0);
        assert_eq!(at(0.75), (3.0, 0.0));
    }

    #[test]
    fn a_path_stays_before_its_first_point_and_after_its_last() {
        let shape =
            Shape::Path { file: alloc::string::String::new(), points: vec![(1.0, 4.0), (2.0, 6.0), (4.0, 0.0)] };
        let trajectory = Trajectory::new(&shape, 1e-3);
        for (t, value) in [(0.0, 4.0), (0.5, 4.0), (1.5, 5.0), (2.0, 6.0), (3.0, 3.0), (9.0, 0.0)] {
            assert!((trajectory.piece(t).at(t).0 - value).abs() < 1e-12);
        }
        assert_eq!(trajectory.last().from, 4.0);
    }

    #[test]
    fn the_path_of_a_sine_is_four_amplitudes_a_turn() {
        let sine = Trajectory::new(&Shape::Sine { amplitude: -0.5, frequency: 1.0, phase: 0.3 }, 1e-3);
        let (square, path) = sine.last().travel(0.125, 3.125);
        assert!((path - 3.0 * 4.0 * 0.5).abs() < 1e-12);
        let mean_square = 0.5 * (0.5 * core::f64::consts::TAU) * (0.5 * core::f64::consts::TAU);
        assert!((square - 3.0 * mean_square).abs() < 1e-12);
    }

    #[test]
    fn the_runs_of_a_sine_join_and_have_its_path() {
        for (amplitude, phase) in [(0.5, 0.3), (-2.0, -1.1), (0.01, 2.0)] {
            let sine = Trajectory::new(&Shape::Sine { amplitude, frequency: 1.0, phase }, 1e-3).last();
            for length in [0.01, 0.3, 0.6, 1.1, 1.6, 2.77] {
                let runs = sine.runs(0.31, 0.31 + length);
                let sum = |of: fn(f64) -> f64| runs.iter().map(|run| run.0 * of(run.2 - run.1)).sum::<f64>();
                let (path, travel) = (sine.travel(0.31, 0.31 + length).1, sine.at(0.31 + length).0 - sine.at(0.31).0);
                assert!((sum(f64::abs) - path).abs() < 1e-12 * (1.0 + path), "{runs:?} {path}");
                assert!((sum(|length| length) - travel).abs() < 1e-12 * (1.0 + path), "{runs:?} {travel}");
            }
        }
    }

    #[test]
    fn slow_travel_is_its_integral() {
        for (amplitude, frequency, phase) in [(0.5, 1.0, 0.3), (-2.0, 0.7, -1.1), (0.01, 3.0, 2.0)] {
            let sine = Trajectory::new(&Shape::Sine { amplitude, frequency, phase }, 1e-3).last();
            for slow in [0.05, 1.0, 3.0, 100.0] {
                let (from, to, steps) = (0.31, 2.77, 200_000);
                let h = (to - from) / f64::from(steps);
                let at = |i: i32| {
                    let speed = sine.at(from + h * (f64::from(i) + 0.5)).1.abs();
                    h * speed * (1.0 - speed / slow).max(0.0)
                };
                let sum: f64 = (0..steps).map(at).sum();
                let found = sine.slow_travel(from, to, slow);
                assert!((found - sum).abs() < 1e-8 * (1.0 + sum), "{found} {sum} of {amplitude} below {slow}");
            }
        }
        let ramp = Piece::straight(0.0, 0.0, -0.5);
        assert_eq!((ramp.slow_travel(1.0, 3.0, 1.0), ramp.slow_travel(1.0, 3.0, 0.4)), (0.5, 0.0));
    }
}
