//! The covariance of a fit's estimates.
//!
//! For independent residuals the information gives it. Residuals of counts without noise are correlated with the motion, and so are those
//! of effects that the model lacks: their correlation widens each interval (Newey and West, Econometrica 55 (1987) 703), and never narrows
//! one.

use nalgebra::Vector2;

use super::fit::{Fit, least_variance};
use super::motion::ACCURACY;
use super::parameters::PARAMETERS;
use super::slopes::{Column, Normal, OfShot, Square, scaled};
use crate::long_run::long_run;
use crate::quantile::student;
use crate::record::Record;

impl Fit {
    /// The covariance of the estimates, in halves of 95 % intervals: their squares are on its diagonal. 0 for parameters that are not
    /// fitted, `None` where two numbers cannot be separated at all.
    pub fn covariance(&self, record: &Record) -> Option<Square> {
        let normal = Normal::of(&self.slopes, 0.0, [0.0; 2]);
        let (matrix, scale) = scaled(&normal.information, self.free, 0.0);
        let inverse = matrix.cholesky()?.inverse();
        let inverse = Square::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
        let least = (ACCURACY * record.spread()).powi(2);
        let variance = self.variance().max(least);
        let correlated = self.correlated(&normal, &inverse);
        let wider = Column::from_fn(|i, _| {
            let plain = variance * inverse[(i, i)];
            if plain > 0.0 { (correlated[i] / plain).sqrt().max(1.0) } else { 1.0 }
        });
        let unit = student(self.freedom()).powi(2) * variance;
        let mut all = Square::from_fn(|i, j| unit * inverse[(i, j)] * wider[i] * wider[j]);
        // In a valley that bends, a fit ends before the least squares: half an interval is then at least as long as the step that is left.
        if let Some(left) = self.step(&normal.information, &normal.right, 0.0, least_variance(record)) {
            all += left * left.transpose();
        }
        all.iter().all(|x| x.is_finite()).then_some(all)
    }

    /// The variances of the estimates where neighbouring residuals are correlated.
    fn correlated(&self, normal: &Normal, inverse: &Square) -> Column {
        let mut scores = vec![Vec::new(); PARAMETERS];
        let mut left = self.left.iter();
        for (slopes, OfShot { inverse: of_state, across, .. }) in self.slopes.iter().zip(&normal.shots) {
            // The effect of a number beyond what a change of the shot's initial state can do.
            let of_state = of_state * across * inverse;
            for (row, left) in slopes.rows.iter().zip(&mut left) {
                let own = inverse.tr_mul(&Column::from_column_slice(&row[..PARAMETERS]));
                let moved = own - of_state.tr_mul(&Vector2::new(row[PARAMETERS], row[PARAMETERS + 1]));
                scores.iter_mut().zip(&moved).for_each(|(scores, moved)| scores.push(moved * left));
            }
        }
        Column::from_fn(|i, _| long_run(&scores[i]))
    }
}
