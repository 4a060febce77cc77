//! What a hand intends: a position or torque as a function of time, in pieces.

use hapt_model::Shape;

/// A shape laid on the loop's samples: straight pieces, or a sine.
#[derive(Clone, Debug)]
pub(crate) enum Curve {
    /// At least one piece, the first from 0 on, their starts not decreasing.
    Straight(Vec<Piece>),
    Sine {
        amplitude: f64,
        omega: f64,
        phase: f64,
    },
}

/// value + slope · (t - from), from `from` on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub from: f64,
    pub value: f64,
    pub slope: f64,
}

impl Piece {
    pub fn at(&self, t: f64) -> f64 {
        self.value + self.slope * (t - self.from)
    }
}

/// An instant within 1e-6 T of a whole sample is that sample, t_k = k·T in one multiplication.
pub(crate) fn snap(t: f64, period: f64) -> f64 {
    let sample = (t / period).round() * period;
    if (t - sample).abs() <= 1e-6 * period { sample } else { t }
}

impl Curve {
    pub fn new(shape: &Shape, period: f64) -> Self {
        let rest = Piece { from: 0.0, value: 0.0, slope: 0.0 };
        match *shape {
            Shape::Step { to, at } => {
                Curve::Straight(vec![rest, Piece { from: snap(at, period), value: to, slope: 0.0 }])
            }
            Shape::Ramp { to, at, over } => {
                let (from, end) = (snap(at, period), snap(at + over, period));
                // A ramp within one sample's snap keeps its own length.
                let end = if end > from { end } else { from + over };
                Curve::Straight(vec![
                    rest,
                    Piece { from, value: 0.0, slope: to / (end - from) },
                    Piece { from: end, value: to, slope: 0.0 },
                ])
            }
            Shape::Sine { amplitude, frequency, phase } => {
                Curve::Sine { amplitude, omega: std::f64::consts::TAU * frequency, phase }
            }
            Shape::Path { ref points, .. } => {
                let first = points.first().map_or(0.0, |point| point.1);
                let mut pieces = vec![Piece { value: first, ..rest }];
                let mut points = points.iter().map(|&(t, value)| (snap(t, period), value)).peekable();
                while let Some((from, value)) = points.next() {
                    // Two points may fall on one sample; the later one counts from there on.
                    let slope = match points.peek() {
                        Some(&(end, next)) if end > from => (next - value) / (end - from),
                        _ => 0.0,
                    };
                    pieces.push(Piece { from, value, slope });
                }
                Curve::Straight(pieces)
            }
        }
    }

    /// Value and slope at t; where they jump, those after it.
    pub fn at(&self, t: f64) -> (f64, f64) {
        match self {
            Curve::Straight(pieces) => {
                let piece = piece(pieces, pieces.partition_point(|piece| piece.from <= t));
                (piece.at(t), piece.slope)
            }
            &Curve::Sine { amplitude, omega, phase } => sine(amplitude, omega, phase, t),
        }
    }

    /// Value and slope at t; where they jump, those before it.
    pub fn before(&self, t: f64) -> (f64, f64) {
        match self {
            Curve::Straight(pieces) => {
                let piece = piece(pieces, pieces.partition_point(|piece| piece.from < t));
                (piece.at(t), piece.slope)
            }
            &Curve::Sine { .. } if t <= 0.0 => (0.0, 0.0),
            &Curve::Sine { amplitude, omega, phase } => sine(amplitude, omega, phase, t),
        }
    }

    /// The first instant after t at which a new piece begins.
    pub fn next_break(&self, t: f64) -> Option<f64> {
        match self {
            Curve::Straight(pieces) => {
                pieces.get(pieces.partition_point(|piece| piece.from <= t)).map(|piece| piece.from)
            }
            Curve::Sine { .. } => None,
        }
    }

    /// The last instant at which something happens; 0 for a sine.
    pub fn last_event(&self) -> f64 {
        match self {
            Curve::Straight(pieces) => pieces.last().map_or(0.0, |piece| piece.from),
            Curve::Sine { .. } => 0.0,
        }
    }

    /// ∫ v² dt and ∫ |v| dt of the curve as a motion over [from, to], with no break in between.
    pub fn travel(&self, from: f64, to: f64) -> (f64, f64) {
        match *self {
            Curve::Straight(_) => {
                let slope = self.at(from).1;
                (slope * slope * (to - from), slope.abs() * (to - from))
            }
            Curve::Sine { amplitude, omega, phase } => {
                let (a, b) = (omega * from + phase, omega * to + phase);
                // ∫ cos² = (b - a)/2 + sin(b - a) cos(b + a)/2, a product, so that short spans keep their digits.
                let square = 0.5 * ((b - a) + libm::sin(b - a) * libm::cos(b + a));
                (amplitude * amplitude * omega * square, amplitude.abs() * (path_of_sine(b) - path_of_sine(a)))
            }
        }
    }
}

/// The piece before the one at `index`, or the first.
fn piece(pieces: &[Piece], index: usize) -> Piece {
    pieces[index.saturating_sub(1)]
}

fn sine(amplitude: f64, omega: f64, phase: f64, t: f64) -> (f64, f64) {
    let (sin, cos) = libm::sincos(omega * t + phase);
    (amplitude * sin, amplitude * omega * cos)
}

/// ∫₀^θ |cos|: two for each half turn, and the rest from the nearest.
fn path_of_sine(theta: f64) -> f64 {
    let halves = (theta / std::f64::consts::PI).round();
    let rest = libm::sin(theta);
    2.0 * halves + if halves.rem_euclid(2.0) == 0.0 { rest } else { -rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_on_a_sample_has_happened_at_it_and_not_before() {
        let curve = Curve::new(&Shape::Step { to: 2.0, at: 0.3 }, 0.1);
        let t3 = 3.0 * 0.1;
        assert_ne!(t3, 0.3);
        assert_eq!(curve.at(t3), (2.0, 0.0));
        assert_eq!(curve.before(t3), (0.0, 0.0));
        assert_eq!(curve.next_break(0.0), Some(t3));
        assert_eq!(curve.next_break(t3), None);
    }

    #[test]
    fn a_ramp_runs_straight_and_ends_where_it_should() {
        let curve = Curve::new(&Shape::Ramp { to: 3.0, at: 0.25, over: 0.5 }, 0.1);
        assert_eq!(curve.at(0.2), (0.0, 0.0));
        assert_eq!(curve.at(0.5), (1.5, 6.0));
        assert_eq!(curve.before(0.75).1, 6.0);
        assert_eq!(curve.at(0.75), (3.0, 0.0));
    }

    #[test]
    fn a_path_stays_before_its_first_point_and_after_its_last() {
        let shape = Shape::Path { file: String::new(), points: vec![(1.0, 4.0), (2.0, 6.0), (4.0, 0.0)] };
        let curve = Curve::new(&shape, 1e-3);
        for (t, value) in [(0.0, 4.0), (0.5, 4.0), (1.5, 5.0), (2.0, 6.0), (3.0, 3.0), (9.0, 0.0)] {
            assert!((curve.at(t).0 - value).abs() < 1e-12);
        }
        assert_eq!(curve.last_event(), 4.0);
    }

    #[test]
    fn the_path_of_a_sine_is_four_amplitudes_a_turn() {
        let curve = Curve::Sine { amplitude: -0.5, omega: std::f64::consts::TAU, phase: 0.3 };
        let (square, path) = curve.travel(0.125, 3.125);
        assert!((path - 3.0 * 4.0 * 0.5).abs() < 1e-12);
        let mean_square = 0.5 * (0.5 * std::f64::consts::TAU).powi(2);
        assert!((square - 3.0 * mean_square).abs() < 1e-12);
    }
}
