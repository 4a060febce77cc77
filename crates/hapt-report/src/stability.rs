//! The loop's figures: its eigenvalues, and its growth at other periods.

use std::f64::consts::TAU;

use hapt_analysis::{Check, Stability, free_growth, held_world_growth};
use hapt_model::World;

use crate::extremes::Point;
use crate::figure::{Axis, Figure, Panel, Shape, Style};
use crate::ticks::number;
use crate::units;

/// Growth below this counts as zero.
const NONE: f64 = hapt_analysis::MARGINAL;

/// The two halves of a certificate's stability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// The bodies, with the puck held; with a handle on a shaft the loop, with the handle held.
    Held,
    /// The whole loop, with the puck free.
    Free,
}

impl Half {
    /// Its description, as a sentence.
    fn name(self) -> &'static str {
        match self {
            Half::Held => "the held world",
            Half::Free => "the loop hands-off",
        }
    }

    /// The name of its file for the figure `name`.
    pub fn file(self, name: &str) -> String {
        match self {
            Half::Held => name.to_string(),
            Half::Free => format!("free-{name}"),
        }
    }

    /// Its part of the certificate.
    pub fn of(self, check: &Check) -> &Stability {
        match self {
            Half::Held => &check.held,
            Half::Free => &check.free,
        }
    }

    /// Its growth at another period, with unchanged delays in seconds.
    fn growth(self, world: &World, period: f64) -> Option<f64> {
        let mut world = world.clone();
        world.sampling.period = period;
        match self {
            Half::Held => held_world_growth(&world).ok()?,
            Half::Free => free_growth(&world).ok()?,
        }
    }
}

fn or_none(growth: f64) -> f64 {
    if growth.abs() < NONE { 0.0 } else { growth }
}

/// Eigenvalues with the unit circle, and magnified near 1, where ln λ/T is growth and frequency; `None` where there are none.
pub fn eigenvalues(half: Half, check: &Check) -> Option<Figure> {
    let stability = half.of(check);
    let list = &stability.eigenvalues;
    if list.is_empty() {
        return None;
    }
    let reach = list.iter().map(|e| e.abs).fold(1.0, f64::max) * 1.15;
    let axis = |name: &str| Axis::from_to(name, "", -reach, reach);
    let mut circle = Panel::new("unit circle", axis("real part of λ"), axis("imaginary part of λ"));
    circle.round = true;
    circle.curve("|λ| = 1", Style::Guide, (0..=180).map(|i| (TAU * i as f64 / 180.0).sin_cos()).collect());
    circle.mark("eigenvalues", Shape::Cross, Style::Signal(0), list.iter().map(|e| (e.re, e.im)).collect());

    // Near 1, λ = e^{sT}: growth and frequency separate there, where λ itself differs in the sixth digit.
    let period = check.period_s * f64::from(check.bodies_every);
    let near: Vec<Point> = list
        .iter()
        .filter(|e| (e.re - 1.0).hypot(e.im) < 0.5)
        .map(|e| (or_none(e.abs.ln() / period), e.im.atan2(e.re) / (TAU * period)))
        .collect();
    let mut panels = vec![circle];
    if !near.is_empty() {
        let growths = near.iter().map(|point| point.0).chain([0.0]);
        let size = near.iter().map(|point| point.0.abs()).fold(0.0, f64::max);
        let reach = if size > 0.0 { 1.3 * size } else { 1.0 };
        let growth = Axis::around("growth", "1/s", growths.chain([-reach, reach]));
        let frequency = Axis::around("frequency", "Hz", near.iter().flat_map(|point| [1.2 * point.1, -1.2 * point.1]));
        let (low, high) = (frequency.low, frequency.high);
        let mut lens = Panel::new("lens near 1: ln λ / T", growth, frequency);
        lens.curve("|λ| = 1", Style::Guide, vec![(0.0, low), (0.0, high)]);
        lens.mark("eigenvalues", Shape::Cross, Style::Signal(0), near.clone());
        lens.round = true;
        panels.push(lens);
    }
    let outside = list.iter().filter(|e| or_none(e.abs.ln() / period) > 0.0).count();
    let mut alt = format!(
        "{} eigenvalues of {} in the complex plane with the unit circle; {}; the largest modulus is {}.",
        list.len(),
        half.name(),
        match outside {
            0 => "none lies outside".to_string(),
            n => format!("{n} outside"),
        },
        number(stability.spectral_radius, 9),
    );
    if panels.len() == 2 {
        let all: Vec<String> =
            near.iter().take(6).map(|p| format!("{} per second at {} Hz", number(p.0, 4), number(p.1, 4))).collect();
        alt += &format!(" The lens near 1 shows {} of them as growth and frequency: {}.", near.len(), all.join(", "));
    }
    Some(Figure { title: format!("Eigenvalues of {}", half.name()), alt, panels, columns: 2 })
}

/// The range of periods, in s: around the present one, and up to the critical one.
fn periods_of_interest(half: Half, check: &Check) -> (f64, f64) {
    let present = check.period_s;
    let critical =
        half.of(check).critical_period_s.filter(|critical| *critical < 1e4 * present && *critical > 1e-4 * present);
    let low = critical.map_or(0.1 * present, |critical| (0.3 * critical).min(0.1 * present));
    let high = critical.map_or(10.0 * present, |critical| (3.0 * critical).max(10.0 * present));
    (low, high)
}

/// (period in s, growth in 1/s) from one period to another; empty where there is nothing to grow.
pub fn growth_by_period(half: Half, world: &World, check: &Check, (low, high): (f64, f64)) -> Vec<Point> {
    let stability = half.of(check);
    if stability.eigenvalues.is_empty() {
        return Vec::new();
    }
    let inside = |period: &f64| (low..=high).contains(period);
    let points = if world.bodies.len() > 8 { 24 } else { 96 };
    let mut periods: Vec<f64> =
        (0..=points).map(|i| low * (high / low).powf(f64::from(i) / f64::from(points))).collect();
    periods.extend([Some(check.period_s), stability.critical_period_s].into_iter().flatten().filter(inside));
    periods.sort_by(f64::total_cmp);
    periods.into_iter().filter_map(|period| Some((period, or_none(half.growth(world, period)?)))).collect()
}

/// Growth against period, the present period marked; `None` where there is nothing to grow.
pub fn periods(half: Half, world: &World, check: &Check) -> Option<Figure> {
    let stability = half.of(check);
    let curve = growth_by_period(half, world, check, periods_of_interest(half, check));
    let present = check.period_s;
    let growth = or_none(stability.growth_per_s?);
    let mut panel = period_panel(&[("growth", &curve)])?;
    panel.mark(
        &format!("present period, {}", units::say_time(present)),
        Shape::Ring,
        Style::Signal(1),
        vec![(1e3 * present, growth)],
    );
    if let Some(critical) = stability.critical_period_s {
        let name = format!("critical period, {}", units::say_time(critical));
        panel.mark(&name, Shape::Line, Style::Limit, vec![(1e3 * critical, 0.0)]);
    }
    let say = |point: Option<&Point>| {
        point.map_or(String::new(), |p| format!("{} per second at {}", number(p.1, 4), units::say_time(p.0)))
    };
    let mut alt = format!(
        "Growth of {} against the sampling period: {}, {}. The present period, {}, has {} per second.",
        half.name(),
        say(curve.first()),
        say(curve.last()),
        units::say_time(present),
        number(growth, 4),
    );
    if let Some(critical) = stability.critical_period_s {
        alt += &format!(" Beyond the critical period, {}, the growth is positive.", units::say_time(critical));
    }
    Some(Figure { title: format!("Growth of {} against period", half.name()), alt, panels: vec![panel], columns: 1 })
}

/// Curves of (s, 1/s), each under its name, on one pair of axes; `None` when there is nothing to draw.
pub(crate) fn period_panel(curves: &[(&str, &[Point])]) -> Option<Panel> {
    let all = || curves.iter().flat_map(|(_, curve)| curve.iter().copied());
    let low = all().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let high = all().map(|p| p.0).fold(0.0, f64::max);
    if low >= high {
        return None;
    }
    let x = Axis::logarithmic("sampling period", "ms", 1e3 * low, 1e3 * high);
    let name = "growth";
    // For loops that grow at every period: straight lines on logarithmic axes.
    let y = if all().all(|p| p.1 > NONE) {
        let least = all().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let most = all().map(|p| p.1).fold(0.0, f64::max);
        Axis::logarithmic(name, "1/s", 0.7 * least, 1.4 * most)
    } else {
        Axis::around(name, "1/s", all().map(|p| p.1).chain([0.0]))
    };
    let mut panel = Panel::new("", x, y);
    for (i, (name, curve)) in curves.iter().enumerate() {
        panel.curve(name, Style::Signal(i), curve.iter().map(|p| (1e3 * p.0, p.1)).collect());
    }
    Some(panel)
}
