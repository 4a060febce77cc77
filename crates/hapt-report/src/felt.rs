//! Figures of the rendered impedance against frequency, and of the Z-width of a device.

use hapt_analysis::impedance::rendered::{Elements, Resonance, Row};
use hapt_analysis::z_width::{Edge, ZWidth};
use hapt_model::Motion;
use hapt_model::keys::Measure;

use crate::extremes::Point;
use crate::figure::{Axis, Figure, Fill, Panel, Shape, Style};
use crate::ticks::number;

/// The largest ratio of values on an axis, from the largest down.
const DECADES: f64 = 1e8;

/// The parts of a rendered impedance and of its ideal: sizes by powers of ten, above 0 and below 0 each in a colour, or a dash, of
/// its own.
///
/// `device` is its own inertia and damping in SI.
pub fn impedance(title: &str, rows: &[Row], resonances: &[Resonance], device: [f64; 2], motion: Motion) -> Figure {
    type Part = (&'static str, Measure, f64, fn(&Elements) -> f64);
    let parts: [Part; 3] = [
        ("stiffness", Measure::Stiffness, 0.0, |e| e.stiffness),
        ("damping", Measure::Damping, device[1], |e| e.damping),
        ("inertia", Measure::Inertia, device[0], |e| e.inertia),
    ];
    let low = rows.first().map_or(1.0, |row| row.frequency_hz);
    let high = rows.last().map_or(10.0, |row| row.frequency_hz);
    let mut alt = format!(
        "Rendered and ideal impedance from {} to {} Hz, as equivalent stiffness, damping and inertia.",
        number(low, 4),
        number(high, 4)
    );
    let undamped: Vec<f64> =
        resonances.iter().filter(|r| r.damping_ratio <= 0.0).map(|r| r.frequency_hz).filter(|hz| *hz < high).collect();
    let mut panels = Vec::new();
    for (name, measure, own, part) in parts {
        let unit = measure.dimension(motion).symbol();
        let values = |of: fn(&Row) -> Option<Elements>| -> Vec<Point> {
            rows.iter().filter_map(|row| Some((row.frequency_hz, part(&of(row)?)))).collect()
        };
        let (rendered, ideal) = (values(|row| row.rendered), values(|row| row.ideal));
        let x = Axis::logarithmic("frequency", "Hz", low, high);
        let mut panel = Panel::new("", x, sizes(name, &unit, rendered.iter().chain(&ideal).map(|p| p.1)));
        if own > panel.y.low && own < panel.y.high {
            panel.curve("the device's own", Style::Guide, vec![(low, own), (high, own)]);
        }
        for (points, of, above, below) in [
            (&rendered, "rendered", Style::Signal(0), Style::Signal(1)),
            (&ideal, "ideal", Style::Predicted, Style::Limit),
        ] {
            for run in points.chunk_by(|a, b| (a.1 > 0.0) == (b.1 > 0.0)).filter(|run| run[0].1 != 0.0) {
                let (sign, style) = if run[0].1 > 0.0 { ("above 0", above) } else { ("below 0", below) };
                panel.curve(&format!("{of}, {sign}"), style, run.iter().map(|p| (p.0, p.1.abs())).collect());
            }
        }
        if !undamped.is_empty() {
            panel.mark(
                "resonance that nothing damps",
                Shape::Line,
                Style::Guide,
                undamped.iter().map(|hz| (*hz, 0.0)).collect(),
            );
        }
        if let (Some(first), Some(last)) = (rendered.first(), rendered.last()) {
            alt += &format!(" Rendered {name}: {} to {} {unit}.", number(first.1, 4), number(last.1, 4));
        }
        panels.push(panel);
    }
    Figure { title: format!("{title}: what the hand feels"), alt, panels, columns: 1 }
}

/// An axis for the magnitudes, with outliers cut off.
fn sizes(name: &str, unit: &str, values: impl Iterator<Item = f64>) -> Axis {
    let mut sizes: Vec<f64> = values.map(f64::abs).filter(|size| *size > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    let most = sizes.get(sizes.len() * 97 / 100).or(sizes.last()).map_or(1.0, |size| 3.0 * size);
    let least = sizes.first().map_or(0.1, |size| 0.7 * size).max(most / DECADES);
    Axis::logarithmic(name, unit, least, most)
}

/// The springs and dampers that a device can render: near 0, at the limit of passivity, and over their full range.
pub fn z_width(title: &str, found: &ZWidth, motion: Motion) -> Figure {
    let stiffness = Measure::Stiffness.dimension(motion).symbol();
    let damping = Measure::Damping.dimension(motion).symbol();
    let passive = found.edges.first().and_then(|edge| edge.passive).unwrap_or(0.0);
    let stiffest = found.edges.iter().filter_map(|edge| edge.stable).fold(passive, f64::max);
    let mut panels = Vec::new();
    if passive > 0.0 {
        let x = Axis::from_to("damper", &damping, 0.0, 1.6 * found.passive_damping);
        let most = found.counts.map_or(0.0, |counts| counts.min(2.0 * passive)).max(1.3 * passive);
        let mut panel = Panel::new("Close to 0", x, Axis::from_to("spring", &stiffness, 0.0, 1.4 * most));
        plane(&mut panel, found, 0.0, 0.0);
        panels.push(panel);
    }
    if stiffest > 0.0 {
        let low = if passive > 0.0 { 0.1 * found.passive_damping } else { 1e-3 * found.stable_damping };
        let bottom = if passive > 0.0 { 0.1 * passive } else { 1e-4 * stiffest };
        let x = Axis::logarithmic("damper", &damping, low, 1.5 * found.stable_damping);
        let mut panel = Panel::new("All of it", x, Axis::logarithmic("spring", &stiffness, bottom, 2.0 * stiffest));
        plane(&mut panel, found, low, bottom);
        panels.push(panel);
    }
    let alt = format!(
        "Springs over dampers between puck and ground. Passive: up to {} {stiffness} without a damper, up to {} {damping} without a \
         spring. Stable hands-off: up to {} {stiffness}, up to {} {damping} without a spring.{}",
        number(passive, 4),
        number(found.passive_damping, 4),
        number(stiffest, 4),
        number(found.stable_damping, 4),
        found
            .counts
            .map_or(String::new(), |counts| format!(" The encoder's counts allow {} {stiffness}.", number(counts, 4))),
    );
    Figure { title: format!("{title}: Z-width"), alt, columns: panels.len(), panels }
}

/// Both edges, filled below, and the encoder's line; the axes begin at `left` and `bottom`.
fn plane(panel: &mut Panel, found: &ZWidth, left: f64, bottom: f64) {
    let edge = |of: fn(&Edge) -> Option<f64>, last: f64| -> Vec<Point> {
        let inside = found.edges.iter().filter_map(|edge| Some((edge.damping, of(edge)?)));
        inside.chain([(last, 0.0)]).map(|(b, k)| (b.max(left), k.max(0.1 * bottom))).collect()
    };
    let below = |edge: &[Point]| -> Vec<Point> {
        let corners = [edge.last(), edge.first()].into_iter().flatten().map(|point| (point.0, 0.1 * bottom));
        edge.iter().copied().chain(corners).collect()
    };
    let stable = edge(|edge| edge.stable, found.stable_damping);
    let passive = edge(|edge| edge.passive, found.passive_damping);
    panel.region("stable hands-off", Fill::Fair, vec![below(&stable)]);
    if found.passive_damping > 0.0 {
        panel.region("passive", Fill::Good, vec![below(&passive)]);
    }
    panel.curve("", Style::Signal(0), stable);
    panel.curve("", Style::Signal(2), if found.passive_damping > 0.0 { passive } else { Vec::new() });
    if let Some(counts) = found.counts.filter(|counts| *counts > bottom) {
        panel.curve("encoder's counts", Style::Limit, vec![(panel.x.low, counts), (panel.x.high, counts)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(frequency_hz: f64, stiffness: f64) -> Row {
        let square = (std::f64::consts::TAU * frequency_hz).powi(2);
        let all = Some(Elements { stiffness, damping: 0.0, inertia: -stiffness / square });
        Row { frequency_hz, rendered: all, ideal: None, whole: all }
    }

    #[test]
    fn a_curve_that_changes_its_sign_changes_its_colour_and_is_not_joined() {
        let rows = [row(1.0, -1.0), row(2.0, -4.0), row(4.0, 3.0), row(8.0, 2.0)];
        let figure = impedance("a wheel", &rows, &[], [1.0, 1.0], Motion::Rotary);
        let curves = |panel: usize| -> Vec<(&str, usize)> {
            figure.panels[panel].series.iter().map(|s| (s.name.as_str(), s.points.len())).collect()
        };
        assert_eq!(curves(0), [("rendered, below 0", 2), ("rendered, above 0", 2)]);
        assert_eq!(curves(1), []);
        assert_eq!(curves(2)[..2], [("rendered, above 0", 2), ("rendered, below 0", 2)]);
    }

    #[test]
    fn a_device_without_damping_is_drawn_without_a_passive_part() {
        let edge = |damping, stable| Edge { damping, passive: None, stable: Some(stable) };
        let edges = vec![Edge { passive: Some(0.0), ..edge(0.0, 0.0) }, edge(0.5, 3.0), edge(1.0, 0.0)];
        let found = ZWidth { edges, passive_damping: 0.0, stable_damping: 1.0, counts: None };
        let figure = z_width("a wheel", &found, Motion::Linear);
        assert_eq!(figure.panels.len(), 1);
        assert_eq!(
            figure.panels[0].regions.iter().map(|region| region.name.as_str()).collect::<Vec<_>>(),
            ["stable hands-off"]
        );
        let svg = figure.svg(crate::Width::Narrow, true);
        assert!(svg.contains("damper (N·s/m)") && !svg.contains("NaN"), "{svg}");
    }
}
