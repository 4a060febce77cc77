//! The fit over the positions, and its residuals.

use hapt_identify::{Comparison, Identified, Lattice, PREDICTION_S, TorqueFit, Window};
use hapt_model::Motion;
use hapt_report::figure::{Axis, Figure, Panel, Style};

use super::Given;
use crate::format;

/// Most points of a curve; of more, the extremes of half as many stretches.
const MAX_POINTS: usize = 1200;

/// Stretches of an axis over which residuals are summed up.
const STRETCHES: usize = 60;

/// A fit, and its residuals.
pub struct Drawn {
    fitted: Vec<(f64, f64)>,
    residuals: Vec<(f64, f64)>,
    lattice: Option<Lattice>,
    rms: f64,
    /// The motion that the fit to the torque predicts.
    predicted: Vec<(f64, f64)>,
    /// The fit to the torque.
    windows: Vec<Window>,
}

impl Drawn {
    pub fn of(given: &Given, found: &Identified, by_torque: Option<&TorqueFit>) -> Self {
        let (fitted, residuals) = (found.fitted(&given.record), found.residuals(&given.record));
        // The torque's equation has no terms of the motion's fit.
        let windows = by_torque.filter(|_| found.terms.is_empty()).map_or(Vec::new(), |fit| fit.windows.clone());
        Drawn { fitted, residuals, lattice: found.lattice, rms: found.residual.rms, predicted: Vec::new(), windows }
    }

    pub fn of_best(found: &Comparison) -> Self {
        let (fitted, residuals) = (found.fitted.clone(), found.residuals.clone());
        Drawn {
            fitted,
            residuals,
            lattice: found.lattice,
            rms: found.residual.rms,
            predicted: Vec::new(),
            windows: Vec::new(),
        }
    }

    pub fn of_torque(fit: &TorqueFit) -> Self {
        Drawn {
            fitted: Vec::new(),
            residuals: Vec::new(),
            lattice: fit.lattice,
            rms: 0.0,
            predicted: fit.motion.clone(),
            windows: fit.windows.clone(),
        }
    }
}

pub fn figure(given: &Given, found: &Drawn) -> Figure {
    let (unit, factor) = match given.motion {
        Motion::Rotary => ("deg", 1f64.to_degrees()),
        Motion::Linear => ("mm", 1e3),
    };
    let speed = if given.motion == Motion::Linear { "mm/s" } else { "deg/s" };
    let (fine, finer) = match (found.lattice, given.motion) {
        (Some(lattice), _) => ("counts", lattice.step.recip()),
        (None, Motion::Rotary) => ("mdeg", 1e3 * factor),
        (None, Motion::Linear) => ("um", 1e6),
    };
    let (effort, per_si) = if given.motion == Motion::Linear { ("N", 1.0) } else { ("N mm", 1e3) };
    let record = &given.record;
    let (times, positions) = (record.times(), record.positions());
    let scaled = |points: &[(f64, f64)], factor: f64| -> Vec<(f64, f64)> {
        points.iter().map(|(t, x)| (*t, factor * x)).collect()
    };
    let around = |name: &str, unit: &str, points: &[(f64, f64)]| Axis::around(name, unit, points.iter().map(|x| x.0));
    let pairs = |values: &[f64]| times.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let over = |name: &str, unit: &str, points: &[(f64, f64)]| {
        let time = Axis::from_to("time", "s", times[0], times[times.len() - 1]);
        Panel::new("", time, Axis::around(name, unit, points.iter().map(|point| point.1)))
    };
    let measured = thinned(&scaled(&pairs(positions), factor));
    let mut motion = over("position", unit, &measured);
    motion.curve("measured", Style::Beneath, measured);
    let mut panels = Vec::new();
    let mut alt = format!("Positions over {}", format::time(times[times.len() - 1] - times[0]));
    if !found.fitted.is_empty() {
        motion.curve("fit", Style::Signal(0), thinned(&scaled(&found.fitted, factor)));
        let torques = thinned(&scaled(&pairs(record.torques()), per_si));
        let mut commanded = over("commanded torque", effort, &torques);
        commanded.curve("", Style::Signal(2), torques);
        let residuals = scaled(&found.residuals, finer);
        panels = vec![
            motion,
            commanded,
            summed("residual", fine, Axis::from_to("time", "s", times[0], times[times.len() - 1]), &residuals),
        ];
        if found.windows.is_empty() {
            let [place, velocity] = along(&found.fitted, &residuals).map(|points| scaled_across(&points, factor));
            panels.push(summed("residual", fine, around("position", unit, &place), &place));
            panels.push(summed("residual", fine, around("velocity", speed, &velocity), &velocity));
        }
        let also = if found.windows.is_empty() { " over time, position and velocity" } else { "" };
        alt += &format!(
            " and the fit, the residuals ({} {fine} rms){also}, and the commanded torque",
            format::number((found.rms * finer * 1e3).round() / 1e3)
        );
    } else {
        if !found.predicted.is_empty() {
            let name = format!("predicted, {} s each", format::number(PREDICTION_S));
            motion.curve(&name, Style::Signal(0), thinned(&scaled(&found.predicted, factor)));
        }
        panels.push(motion);
        let of = |value: &dyn Fn(&Window) -> f64| -> Vec<(f64, f64)> {
            thinned(&found.windows.iter().map(|window| (window.time, per_si * value(window))).collect::<Vec<_>>())
        };
        let (measured, fitted) = (of(&|window| window.torque), of(&|window| window.fitted));
        let mut torque = over("torque", effort, &measured);
        torque.curve("measured", Style::Beneath, measured);
        torque.curve("fit", Style::Signal(0), fitted);
        panels.push(torque);
        alt += ", the torque and its fit by the equation of motion";
    }
    if !found.windows.is_empty() {
        let left = |value: &dyn Fn(&Window) -> f64| -> Vec<(f64, f64)> {
            let of = |window: &Window| (value(window), per_si * (window.torque - window.fitted));
            found.windows.iter().map(of).collect()
        };
        let (time, place) = (left(&|window| window.time), left(&|window| factor * window.position));
        let velocity = left(&|window| factor * window.velocity);
        panels.push(summed("residual torque", effort, around("time", "s", &time), &time));
        panels.push(summed("residual torque", effort, around("position", unit, &place), &place));
        panels.push(summed("residual torque", effort, around("velocity", speed, &velocity), &velocity));
        alt += ", and what is left of the torque over time, position and velocity";
    }
    let columns = if panels.len() > 3 { 2 } else { 1 };
    Figure { title: format!("{}: the fit and its residuals", given.name), alt: alt + ".", panels, columns }
}

/// Residuals over time as those over position and velocity of the fit.
fn along(fitted: &[(f64, f64)], residuals: &[(f64, f64)]) -> [Vec<(f64, f64)>; 2] {
    let mut residuals = residuals.iter().peekable();
    let mut both = [Vec::new(), Vec::new()];
    for pair in fitted.windows(2) {
        let [(before, from), (time, to)] = [pair[0], pair[1]];
        while residuals.next_if(|(at, _)| *at < time).is_some() {}
        if let Some((_, left)) = residuals.next_if(|(at, _)| *at == time) {
            both[0].push((to, *left));
            both[1].push(((to - from) / (time - before), *left));
        }
    }
    both
}

/// The same points with the axis in other units.
fn scaled_across(points: &[(f64, f64)], factor: f64) -> Vec<(f64, f64)> {
    points.iter().map(|(x, y)| (factor * x, *y)).collect()
}

/// Residuals over an axis: the middle and the range of nine tenths of them in each stretch.
fn summed(name: &str, unit: &str, x: Axis, points: &[(f64, f64)]) -> Panel {
    let mut stretches: Vec<Vec<f64>> = vec![Vec::new(); STRETCHES];
    let width = (x.high - x.low) / STRETCHES as f64;
    for (at, value) in points.iter().filter(|point| point.1.is_finite()) {
        let place = ((at - x.low) / width).max(0.0) as usize;
        stretches[place.min(STRETCHES - 1)].push(*value);
    }
    let at = |part: f64| -> Vec<(f64, f64)> {
        let of = |(i, values): (usize, &Vec<f64>)| {
            let mut values = values.clone();
            values.sort_by(f64::total_cmp);
            let value = values.get((part * values.len().saturating_sub(1) as f64).round() as usize)?;
            Some((x.low + (i as f64 + 0.5) * width, *value))
        };
        stretches.iter().enumerate().filter_map(of).collect()
    };
    let (low, middle, high) = (at(0.05), at(0.5), at(0.95));
    let y = Axis::around(name, unit, low.iter().chain(&high).map(|point| point.1).chain([0.0]));
    let mut panel = Panel::new("", x, y);
    panel.curve("nine tenths", Style::Limit, low);
    panel.curve("", Style::Limit, high);
    panel.curve("median", Style::Signal(1), middle);
    panel
}

/// Fewer points with the same look.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MAX_POINTS {
        return points.to_vec();
    }
    let mut thin = Vec::with_capacity(MAX_POINTS);
    for stretch in points.chunks(points.len().div_ceil(MAX_POINTS / 2)) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (Some(low), Some(high)) = (stretch.iter().min_by(by), stretch.iter().max_by(by)) else { continue };
        let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        thin.extend([*first, *second]);
    }
    thin
}
