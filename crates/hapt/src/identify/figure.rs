//! The fit over the positions, and its residuals.

use hapt_identify::{Comparison, Identified, Lattice};
use hapt_model::Motion;
use hapt_report::figure::{Axis, Figure, Panel, Style};

use super::Given;
use crate::format;

/// Points of a curve; of more, the extremes of as many stretches as half of them.
const MOST: usize = 1200;

/// A fit, and what it leaves.
pub struct Drawn {
    fitted: Vec<(f64, f64)>,
    residuals: Vec<(f64, f64)>,
    lattice: Option<Lattice>,
    rms: f64,
}

impl Drawn {
    pub fn of(given: &Given, found: &Identified) -> Self {
        let (fitted, residuals) = (found.fitted(&given.record), found.residuals(&given.record));
        Drawn { fitted, residuals, lattice: found.lattice, rms: found.residual.rms }
    }

    pub fn of_best(found: &Comparison) -> Self {
        let (fitted, residuals) = (found.fitted.clone(), found.residuals.clone());
        Drawn { fitted, residuals, lattice: found.lattice, rms: found.residual.rms }
    }
}

pub fn figure(given: &Given, found: &Drawn) -> Figure {
    let (unit, factor) = match given.motion {
        Motion::Rotary => ("deg", 1f64.to_degrees()),
        Motion::Linear => ("mm", 1e3),
    };
    let (fine, finer) = match (found.lattice, given.motion) {
        (Some(lattice), _) => ("counts", lattice.step.recip()),
        (None, Motion::Rotary) => ("mdeg", 1e3 * factor),
        (None, Motion::Linear) => ("um", 1e6),
    };
    let (effort, per_si) = if given.motion == Motion::Linear { ("N", 1.0) } else { ("N mm", 1e3) };
    let record = &given.record;
    let (times, positions) = (record.times(), record.positions());
    let scaled = |points: Vec<(f64, f64)>, factor: f64| -> Vec<(f64, f64)> {
        thinned(&points.into_iter().map(|(t, x)| (t, factor * x)).collect::<Vec<_>>())
    };
    let pairs = |values: &[f64]| times.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let measured = scaled(pairs(positions), factor);
    let fitted = scaled(found.fitted.clone(), factor);
    let left = scaled(found.residuals.clone(), finer);
    let torques = scaled(pairs(record.torques()), per_si);
    let panel = |name: &str, unit: &str, points: &[(f64, f64)]| {
        let time = Axis::from_to("time", "s", times[0], times[times.len() - 1]);
        Panel::new("", time, Axis::around(name, unit, points.iter().map(|point| point.1)))
    };
    let mut above = panel("position", unit, &measured);
    above.curve("measured", Style::Beneath, measured);
    above.curve("fit", Style::Signal(0), fitted);
    let mut middle = panel("residual", fine, &left);
    middle.curve("", Style::Signal(1), left);
    let mut below = panel("commanded torque", effort, &torques);
    below.curve("", Style::Signal(2), torques);
    let alt = format!(
        "Positions over {} and the fit, the residuals ({} {fine} rms), and the commanded torque.",
        format::time(times[times.len() - 1] - times[0]),
        format::number((found.rms * finer * 1e3).round() / 1e3)
    );
    Figure {
        title: format!("{}: the fit and its residuals", given.name),
        alt,
        panels: vec![above, middle, below],
        columns: 1,
    }
}

/// Few enough points that look the same.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST {
        return points.to_vec();
    }
    let mut thin = Vec::with_capacity(MOST);
    for stretch in points.chunks(points.len().div_ceil(MOST / 2)) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (Some(low), Some(high)) = (stretch.iter().min_by(by), stretch.iter().max_by(by)) else { continue };
        let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        thin.extend([*first, *second]);
    }
    thin
}
