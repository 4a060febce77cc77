//! A torque that goes with the position, looked for in what the fit leaves: gravity on a weight beside the axis, a motor's cogging, a
//! spring that nobody knows of.
//!
//! Each shape of such a torque moves the puck in its own way. Where the residuals go along with that, beyond what the fitted parameters
//! can take up, the squares that it would take away over their mean are χ² distributed, with as many degrees of freedom as the shape has
//! amplitudes, if there is no such torque (the score test; Rao 1948).

use nalgebra::{Matrix2, SMatrix, Vector2};

use crate::estimate::Known;
use crate::fit::{Fit, Square};
use crate::puck::PARAMETERS;
use crate::record::Record;
use crate::stretch::Stretch;

/// Of torques that come again so many times a turn and fewer; more average out while the puck turns.
const MOST_TIMES: u32 = 48;
/// χ² of two degrees of freedom is above this once in 10^8 times. Counted noise is not quite what that supposes: of a thousand random
/// devices without such a torque two were taken to have one (docs/identify.md).
const SURELY: f64 = 40.0;
/// What explains less than this part of the residuals' squares matters to nobody.
const LEAST: f64 = 0.02;

/// A torque that goes with the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionTorque {
    /// How often it comes again in a turn; 0: it grows with the position as a spring's does.
    pub times_a_turn: u32,
    /// Its amplitude in N·m of commanded torque; of a spring the stiffness in N·m/rad (linear: N/m).
    pub size: f64,
    /// The part of the residuals' squares that it explains.
    pub explains: f64,
}

/// One shape: of the position z the weights sin nz and cos nz, or z alone.
struct Shape {
    times_a_turn: u32,
    /// What a unit of each weight has done to position and velocity.
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

    fn weights(&self, z: f64) -> Vector2<f64> {
        if self.times_a_turn == 0 {
            return Vector2::new(-z, 0.0);
        }
        let (sin, cos) = (f64::from(self.times_a_turn) * z).sin_cos();
        Vector2::new(sin, cos)
    }

    /// The torque holds for a stretch; a puck at rest stays so.
    fn pass(&mut self, stretch: &Stretch, z: f64, moves: bool) {
        if !moves {
            self.dv = Vector2::zeros();
            return;
        }
        let ((z_of_v, v_of_v), (z_of_a, v_of_a)) = (stretch.of_velocity(), stretch.of_drive());
        let weights = self.weights(z);
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

    /// The squares that the shape takes away beside the parameters, whose inverse information this is, and its amplitudes.
    fn takes(&self, inverse: &Square) -> (f64, Vector2<f64>) {
        let alone = self.own - self.across.transpose() * inverse * self.across;
        let eigen = alone.symmetric_eigen();
        let mut taken = (0.0, Vector2::zeros());
        for (i, value) in eigen.eigenvalues.iter().enumerate() {
            // What the parameters do too is theirs.
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

/// The shape that explains most of what a fit leaves; `None` where none surely does.
pub(crate) fn of_position(record: &Record, fit: &Fit, known: &Known) -> Option<PositionTorque> {
    let inverse = fit.inverse()?;
    let most = if known.is_linear { 0 } else { MOST_TIMES };
    let mut shapes: Vec<Shape> = (0..=most).map(Shape::new).collect();
    let mut before: Option<(f64, f64)> = None;
    fit.puck.follow(record.times(), record.torques(), fit.first, |i, z, dz| {
        let (t, left) = (record.times()[i], record.positions()[i] - z);
        if let Some((then, from)) = before {
            let stretch = Stretch::new(fit.puck.damping, t - then);
            shapes.iter_mut().for_each(|shape| shape.pass(&stretch, 0.5 * (from + z), z != from));
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
    let explains = squares / fit.normal.squares;
    let is_sure = squares > SURELY * fit.variance() && explains > LEAST;
    let size = acceleration / fit.puck.gain.abs();
    (is_sure && size.is_finite()).then_some(PositionTorque { times_a_turn, size, explains })
}
