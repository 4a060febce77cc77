//! Edges, closed along the frame to polygons.

use crate::boundary::continuation::{Place, Trace};

/// The corners of the frame, counterclockwise from the lower left.
const CORNERS: [Place; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// The position of a place along the frame, counterclockwise from the lower left corner: 0 to 4.
fn around([x, y]: Place) -> f64 {
    let sides = [(y, x), (1.0 - x, 1.0 + y), (1.0 - y, 3.0 - x), (x, 4.0 - y)];
    sides.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, at)| at)
}

/// The region on the left of all edges, as polygons with the even-odd rule. From the end of an edge at the frame its outline continues
/// along the frame, counterclockwise, to the start of the next edge. `all`: whether the frame itself is in the region, where no edge
/// reaches it.
pub(crate) fn beyond(edges: &[Trace], all: bool) -> Vec<Vec<Place>> {
    let closed = edges.iter().filter(|edge| edge.closed).map(|edge| edge.points.clone());
    let mut polygons: Vec<Vec<Place>> = closed.collect();
    let mut open: Vec<&Trace> = edges.iter().filter(|edge| !edge.closed && edge.points.len() > 1).collect();
    if open.is_empty() && all {
        polygons.push(CORNERS.to_vec());
    }
    let start = |edge: &Trace| edge.points.first().map_or(0.0, |p| around(*p));
    let end = |edge: &Trace| edge.points.last().map_or(0.0, |p| around(*p));
    while let Some(first) = open.pop() {
        let mut polygon = first.points.clone();
        let mut at = end(first);
        loop {
            // The start of an edge along the frame.
            let ahead = |edge: &Trace| (start(edge) - at).rem_euclid(4.0);
            let next = (0..open.len()).min_by(|&a, &b| ahead(open[a]).total_cmp(&ahead(open[b])));
            let next = next.filter(|&i| ahead(open[i]) < ahead(first));
            let reach = next.map_or(ahead(first), |i| ahead(open[i]));
            let corners = (1..=4).map(|i| (at.floor() + f64::from(i)).rem_euclid(4.0));
            let passed = corners.filter(|corner| (corner - at).rem_euclid(4.0) < reach);
            polygon.extend(passed.map(|corner| CORNERS[corner as usize % 4]));
            let Some(i) = next else { break };
            let edge = open.swap_remove(i);
            polygon.extend(&edge.points);
            at = end(edge);
        }
        polygons.push(polygon);
    }
    polygons
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shoelace, in absolute terms.
    fn area(polygon: &[Place]) -> f64 {
        let n = polygon.len();
        let cross = |i: usize| {
            let (a, b) = (polygon[i], polygon[(i + 1) % n]);
            0.5 * (a[0] * b[1] - b[0] * a[1])
        };
        (0..n).map(cross).sum::<f64>()
    }

    fn edge(points: &[Place]) -> Trace {
        Trace { points: points.to_vec(), closed: false }
    }

    #[test]
    fn the_left_of_an_edge_reaches_to_the_frame() {
        // Up the middle: the left half; down: the right one.
        let up = beyond(&[edge(&[[0.3, 0.0], [0.3, 1.0]])], true);
        assert!((area(&up[0]) - 0.3).abs() < 1e-12, "{up:?}");
        let down = beyond(&[edge(&[[0.3, 1.0], [0.3, 0.0]])], false);
        assert!((area(&down[0]) - 0.7).abs() < 1e-12, "{down:?}");
        // An edge around the upper left corner, in both directions.
        let corner = beyond(&[edge(&[[0.0, 0.8], [0.2, 1.0]])], false);
        assert!((area(&corner[0]) - 0.02).abs() < 1e-12, "{corner:?}");
        let rest = beyond(&[edge(&[[0.2, 1.0], [0.0, 0.8]])], true);
        assert!((area(&rest[0]) - 0.98).abs() < 1e-12, "{rest:?}");
    }

    #[test]
    fn two_edges_bound_a_stripe_or_its_complement() {
        let stripe = [edge(&[[0.2, 1.0], [0.2, 0.0]]), edge(&[[0.5, 0.0], [0.5, 1.0]])];
        let inside = beyond(&stripe, false);
        assert!(inside.len() == 1 && (area(&inside[0]) - 0.3).abs() < 1e-12, "{inside:?}");
        let outside = [edge(&[[0.2, 0.0], [0.2, 1.0]]), edge(&[[0.5, 1.0], [0.5, 0.0]])];
        let polygons = beyond(&outside, true);
        let sum: f64 = polygons.iter().map(|p| area(p)).sum();
        assert!(polygons.len() == 2 && (sum - 0.7).abs() < 1e-12, "{polygons:?}");
    }

    #[test]
    fn without_an_edge_it_is_all_or_nothing() {
        assert!(beyond(&[], false).is_empty());
        assert!((area(&beyond(&[], true)[0]) - 1.0).abs() < 1e-12);
    }
}
