//! The residuals of a fit to a record.

use crate::explained::explained;
use crate::fit::Fit;
use crate::identified::Residual;
use crate::puck::Puck;
use crate::record::Record;

/// The best accuracy of positions as a part of their standard deviation, by the arithmetic of a fit and the digits of a record.
pub(crate) const RESOLUTION: f64 = 1e-9;

/// The variance of the positions' errors in a fit, and at least that of their resolution: a smaller one is rounding.
pub(crate) fn error_variance(record: &Record, fit: &Fit) -> f64 {
    fit.variance().max((RESOLUTION * spread(record, fit)).powi(2))
}

/// Whether counts and noise explain the residuals of a fit.
pub(crate) fn is_right(record: &Record, fit: &Fit) -> bool {
    explained(record, &left(record, fit), record.lattice(), spread(record, fit))
}

/// The standard deviation of the positions that are fitted.
pub(crate) fn spread(record: &Record, fit: &Fit) -> f64 {
    variance(&record.positions()[fit.first..]).sqrt()
}

/// The positions of a fit, from sample `first` on.
pub(crate) fn fitted(record: &Record, puck: &Puck, first: usize) -> Vec<f64> {
    let mut fitted = Vec::new();
    puck.follow(record.times(), record.torques(), first, |_, z, _| fitted.push(z));
    fitted
}

pub(crate) fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64
}

/// The residuals of a fit at the samples with a new position.
pub(crate) fn left(record: &Record, fit: &Fit) -> Vec<f64> {
    let at = |(i, z): (usize, f64)| record.is_news(fit.first + i).then(|| record.positions()[fit.first + i] - z);
    fitted(record, &fit.puck, fit.first).into_iter().enumerate().filter_map(at).collect()
}

pub(crate) fn residual(left: &[f64]) -> Residual {
    let squares: f64 = left.iter().map(|r| r * r).sum();
    let neighbours: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = if squares > 0.0 { neighbours / squares } else { 0.0 };
    Residual { rms: (squares / left.len() as f64).sqrt(), correlation }
}

impl Puck {
    /// The positions at the samples of a record from one on, with their times.
    pub(crate) fn positions_from(&self, record: &Record, first: usize) -> Vec<(f64, f64)> {
        record.times()[first..].iter().copied().zip(fitted(record, self, first)).collect()
    }

    /// The differences of the record's positions from these.
    pub(crate) fn left_from_sample(&self, record: &Record, first: usize) -> Vec<(f64, f64)> {
        let rows = self.positions_from(record, first).into_iter().zip(&record.positions()[first..]);
        rows.map(|((t, z), y)| (t, y - z)).collect()
    }
}
