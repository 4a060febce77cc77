//! A torque that depends on the position, searched for in the residuals: gravity on an eccentric weight, a motor's cogging, an unknown
//! spring.
//!
//! Each shape of such a torque moves the puck in its own way. The residuals are projected onto that motion, beyond what the fitted
//! parameters can absorb. Without such a torque, the squares that the projection removes, over the residuals' mean square, are χ²
//! distributed with as many degrees of freedom as the shape has amplitudes (the score test; Rao 1948).

use nalgebra::{Matrix2, SMatrix, Vector2};

use crate::factor::Square;
use crate::fit::Fit;
use crate::identified::PositionTorque;
use crate::multiples::multiples;
use crate::puck::PARAMETERS;
use crate::record::Record;
use crate::stretch::Stretch;

/// The most periods a turn of a shape; faster ones average out while the puck turns.
const MOST_TIMES: u32 = 48;
/// χ² of two degrees of freedom exceeds this once in 10^8 times. Quantisation noise does not quite follow that distribution: of a thousand
/// random devices without such a torque two were reported to have one (docs/identify.md).
const SURELY: f64 = 40.0;
/// A shape that explains less than this part of the residuals' squares is not reported.
const LEAST: f64 = 0.02;

/// One shape: the weights sin nz and cos nz of the position z, or only z.
struct Shape {
    times_a_turn: u32,
    /// The position and velocity per unit of each weight.
    dz: Vector2<f64>,
    dv: Vector2<f64>,
    /// Their products with the parameters' sensitivities, with themselves and with the residuals.
    across: SMatrix<f64, PARAMETERS, 2>,
    own: Matrix2<f64>,
    right: Vector2<f64>,
}

impl Shape {
    fn new(times_a_turn: u32) -> Self {
        let (dz, dv, right) = (Vector2::zeros(), Vector2::zeros(), Vector2::zeros());
        Shape { times_a_turn, dz, dv, across: SMatrix::zeros(), own: Matrix2::zeros(), right }
    }

    /// Integrates over a stretch of constant torque.
    fn pass(&mut self, stretch: &Stretch, weights: Vector2<f64>) {
        let ((z_of_v, v_of_v), (z_of_a, v_of_a)) = (stretch.of_velocity(), stretch.of_drive());
        self.dz += z_of_v * self.dv + z_of_a * weights;
        self.dv = v_of_v * self.dv + v_of_a * weights;
    }

    fn add(&mut self, row: &[f64; PARAMETERS], right: f64) {
        for i in 0..2 {
            for (j, x) in row.iter().enumerate() {
                self.across[(j, i)] += x * self.dz[i];
            }
            self.right[i] += right * self.dz[i];
        }
        self.own += self.dz * self.dz.transpose();
    }

    /// The squares that the shape removes in addition to the parameters, whose inverse information matrix is given, and its amplitudes.
    fn takes(&self, inverse: &Square) -> (f64, Vector2<f64>) {
        let marginal = self.own - self.across.transpose() * inverse * self.across;
        let eigen = marginal.symmetric_eigen();
        let mut taken = (0.0, Vector2::zeros());
        for (i, value) in eigen.eigenvalues.iter().enumerate() {
            // Directions in the span of the parameters are left out.
            if *value > 1e-6 * self.own.trace() {
                let axis = eigen.eigenvectors.column(i);
                let along = axis.dot(&self.right);
                taken.0 += along * along / value;
                taken.1 += axis * (along / value);
            }
        }
        taken
    }
}

/// The shape that explains most of the residuals; `None` where none is significant.
pub(crate) fn position_torque(record: &Record, fit: &Fit, is_linear: bool) -> Option<PositionTorque> {
    let inverse = fit.inverse()?;
    let most = if is_linear { 0 } else { MOST_TIMES };
    let mut shapes: Vec<Shape> = (0..=most).map(Shape::new).collect();
    let mut before: Option<(f64, f64)> = None;
    fit.puck.follow(record.times(), record.torques(), fit.first, |i, z, dz| {
        let (t, left) = (record.times()[i], record.positions()[i] - z);
        if let Some((then, from)) = before {
            let stretch = Stretch::new(fit.puck.damping, t - then);
            if z == from {
                // A puck at rest stays at rest.
                shapes.iter_mut().for_each(|shape| shape.dv = Vector2::zeros());
            } else {
                let middle = 0.5 * (from + z);
                let mut weights = multiples(middle, most);
                weights[0] = Vector2::new(-middle, 0.0);
                shapes.iter_mut().zip(weights).for_each(|(shape, weights)| shape.pass(&stretch, weights));
            }
        }
        before = Some((t, z));
        if record.is_news(i) {
            shapes.iter_mut().for_each(|shape| shape.add(dz, left));
        }
    });
    let of = |shape: &Shape| {
        let (squares, amplitudes) = shape.takes(&inverse);
        (squares, shape.times_a_turn, amplitudes.norm())
    };
    let (squares, times_a_turn, acceleration) = shapes.iter().map(of).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let explains = squares / fit.factor.squares;
    let is_sure = squares > SURELY * fit.variance() && explains > LEAST;
    let size = acceleration / fit.puck.gain.abs();
    (is_sure && size.is_finite()).then_some(PositionTorque { times_a_turn, size, explains })
}
