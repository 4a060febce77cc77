//! The zero set of a function on the square, traced by the change of its sign.
//!
//! The square is [`INSET`] smaller than the frame on each side: the end of a key's range, such as no damping, may be a special case. A
//! function is above 0 on one side of its edge, and may be discontinuous there, have a corner, or be infinite.
//!
//! From a point on the edge the next one is where a circle about it changes its sign, near the direction that the last steps
//! predict. Where the circle leaves the square, the square's side takes its place, so that an edge ends there by the same rule. The
//! circle shrinks until the edge turns little between two points, and grows again behind a corner.

use std::f64::consts::PI;

use rayon::prelude::*;

/// The margin along each side of the frame.
pub(crate) const INSET: f64 = 1e-6;
/// The longest and the shortest step, in parts of the frame.
const MAX_STEP: f64 = 0.02;
const MIN_STEP: f64 = 1e-5;
/// The largest angle between the edge and a step, in rad, except for the shortest step.
const MAX_TURN_RAD: f64 = 0.12;
/// The accuracy of a point.
const ON_EDGE: f64 = 1e-13;
/// The largest number of points of an edge.
const MAX_POINTS: usize = 20_000;
/// Intervals of each side of the square, and of each line through it, that are searched for a change of sign.
const STRETCHES: usize = 48;
/// The distance from their ends.
const NEAR_ENDS: [f64; 3] = [1e-5, 1e-4, 2e-3];
/// Lines through the square, each way.
const LINES: usize = 5;

/// A point of the frame: 0 to 1 to the right, and up.
pub type Place = [f64; 2];

/// An edge, beyond which the function is above 0: on the left in the direction of the points.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Trace {
    pub points: Vec<Place>,
    /// Whether it is closed.
    pub closed: bool,
}

pub(crate) fn distance(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Whether a place is on a side of the square, or beyond it.
pub(crate) fn on_frame(p: Place) -> bool {
    p.iter().any(|x| *x <= 1.01 * INSET || *x >= 1.0 - 1.01 * INSET)
}

/// Finds a change of the function's sign on a path over [0, 1] with known values at its ends: regula falsi with the Illinois
/// correction, and bisection where a value is infinite. Returns the last two parameters, the one above 0 last.
fn crossing<E>(
    f: &impl Fn(Place) -> Result<f64, E>,
    path: impl Fn(f64) -> Place,
    [low, high]: [f64; 2],
) -> Result<Place, E> {
    let (mut a, mut b) = ((0.0, low), (1.0, high));
    let rising = high > 0.0;
    for step in 0..100 {
        let middle = 0.5 * (a.0 + b.0);
        if middle <= a.0 || middle >= b.0 || distance(path(a.0), path(b.0)) < ON_EDGE {
            break;
        }
        let secant = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let x = if step % 4 < 3 && secant > a.0 && secant < b.0 { secant } else { middle };
        let y = f(path(x))?;
        if (y > 0.0) == rising {
            b = (x, y);
            a.1 *= 0.5;
        } else {
            a = (x, y);
            b.1 *= 0.5;
        }
    }
    Ok(path(0.5 * (a.0 + b.0)))
}

/// From `p` in the direction of `angle`, by `step` or to the square's side.
fn star(p: Place, angle: f64, step: f64) -> Place {
    let (sin, cos) = angle.sin_cos();
    // The rounded sine of π is not 0. A direction along a side does not leave the square.
    let room = |x: f64, d: f64| match d {
        d if d > 1e-12 => (1.0 - INSET - x) / d,
        d if d < -1e-12 => (INSET - x) / d,
        _ => f64::INFINITY,
    };
    let r = step.min(room(p[0], cos)).min(room(p[1], sin)).max(0.0);
    [p[0] + r * cos, p[1] + r * sin].map(|x| x.clamp(INSET, 1.0 - INSET))
}

/// A place on an edge where a trace begins.
#[derive(Clone, Copy, Debug)]
struct Seed {
    at: Place,
    /// The direction in which the function is above 0; in the opposite one it is not.
    beyond: f64,
    /// Inwards, on a side of the square.
    inward: Option<f64>,
}

impl Trace {
    /// Whether both begin and end at the same places on the sides of the square.
    fn has_the_ends_of(&self, other: &Trace) -> bool {
        let ends = |trace: &Trace| Some([*trace.points.first()?, *trace.points.last()?]);
        let (Some(own), Some(others)) = (ends(self), ends(other)) else { return false };
        let same = own.iter().zip(&others).all(|(a, b)| on_frame(*a) && distance(*a, *b) < 2.0 * MIN_STEP);
        same && !self.closed && !other.closed
    }

    /// The places at which the edge continues, but turns or narrows within the shortest step: ends that are not on a side of the square, or the only point.
    pub fn lost(&self) -> impl Iterator<Item = Place> {
        let only = self.points.len() == 1;
        let ends = match (self.closed, only) {
            (true, _) => [None, None],
            (false, true) => [self.points.first(), None],
            (false, false) => [self.points.first(), self.points.last()],
        };
        ends.into_iter().flatten().copied().filter(move |end| only || !on_frame(*end))
    }
}

/// Every edge that intersects a side of the square, or one of a few lines through it, except those along `known`. An island that
/// fits between the lines is not found. An edge on which no step succeeds has one point.
pub(crate) fn trace<E: Send>(f: &(impl Fn(Place) -> Result<f64, E> + Sync), known: &[Trace]) -> Result<Vec<Trace>, E> {
    let mut found: Vec<Trace> = Vec::new();
    for seed in seeds(f)? {
        if known.iter().chain(&found).any(|trace| lies_on(trace, seed.at)) {
            continue;
        }
        let new = from_seed(f, seed)?;
        // A seed at a corner that the first trace has cut begins the same edge again.
        if !known.iter().chain(&found).any(|trace| trace.has_the_ends_of(&new)) {
            found.push(new);
        }
    }
    Ok(found)
}

/// The places at which the sides of the square and the lines through it cross an edge, the sides first.
fn seeds<E: Send>(f: &(impl Fn(Place) -> Result<f64, E> + Sync)) -> Result<Vec<Seed>, E> {
    let mut along: Vec<f64> = (0..=STRETCHES).map(|i| i as f64 / STRETCHES as f64).collect();
    along.extend(NEAR_ENDS.iter().flat_map(|x| [*x, 1.0 - x]));
    along.iter_mut().for_each(|x| *x = x.clamp(INSET, 1.0 - INSET));
    along.sort_by(f64::total_cmp);
    let mut lines: Vec<(usize, f64, Option<f64>)> = Vec::new();
    for axis in 0..2 {
        // Across a side that runs along the axis, inwards.
        let inward = 0.5 * PI * (1 - axis) as f64;
        lines.push((axis, INSET, Some(inward)));
        lines.push((axis, 1.0 - INSET, Some(inward + PI)));
    }
    lines.extend((0..2 * LINES).map(|i| (i % 2, (i / 2 + 1) as f64 / (LINES + 1) as f64, None)));
    let on_line = |&(axis, at, inward): &(usize, f64, Option<f64>)| -> Result<Vec<Seed>, E> {
        let place = |x: f64| if axis == 0 { [x, at] } else { [at, x] };
        let values = along.iter().map(|x| f(place(*x))).collect::<Result<Vec<f64>, E>>()?;
        let mut seeds = Vec::new();
        for (ends, values) in along.windows(2).zip(values.windows(2)) {
            let (&[a, b], &[low, high]) = (ends, values) else { continue };
            if (low > 0.0) == (high > 0.0) {
                continue;
            }
            let at = crossing(f, |x| place(a + (b - a) * x), [low, high])?;
            let beyond = 0.5 * PI * axis as f64 + if high > 0.0 { 0.0 } else { PI };
            seeds.push(Seed { at, beyond, inward });
        }
        Ok(seeds)
    };
    let all = lines.par_iter().map(on_line).collect::<Result<Vec<_>, E>>()?;
    Ok(all.into_iter().flatten().collect())
}

/// Whether a place is on the polygon's line, within the accuracy of the polygon.
fn lies_on(trace: &Trace, at: Place) -> bool {
    let last = trace.points.len().saturating_sub(1);
    let closing = trace.closed.then(|| [trace.points[last], trace.points[0]]);
    trace.points.windows(2).filter_map(|w| <[Place; 2]>::try_from(w).ok()).chain(closing).any(|[a, b]| {
        let length = distance(a, b);
        let along = ((at[0] - a[0]) * (b[0] - a[0]) + (at[1] - a[1]) * (b[1] - a[1])) / (length * length).max(1e-300);
        let along = along.clamp(0.0, 1.0);
        let foot = [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])];
        distance(foot, at) < (0.06 * length).clamp(2.0 * MIN_STEP, 1e-3)
    })
}

fn from_seed<E>(f: &impl Fn(Place) -> Result<f64, E>, seed: Seed) -> Result<Trace, E> {
    let Seed { at, beyond, inward } = seed;
    if let Some(inward) = inward {
        // Inwards, beyond to the left or to the right.
        let left = (beyond - inward).sin() > 0.0;
        let mut trace = follow(f, at, inward, left, false)?;
        if !left {
            trace.points.reverse();
        }
        return Ok(trace);
    }
    let ahead = follow(f, at, beyond - 0.5 * PI, true, true)?;
    if ahead.closed {
        return Ok(ahead);
    }
    let mut back = follow(f, at, beyond + 0.5 * PI, false, false)?;
    back.points.reverse();
    back.points.pop();
    back.points.extend(ahead.points);
    Ok(back)
}

/// Traces from `start`, initially near the direction of `heading`, with the region beyond the edge to the left or to the right, to the
/// square's side, or back to the start where that is allowed.
fn follow<E>(
    f: &impl Fn(Place) -> Result<f64, E>,
    start: Place,
    mut heading: f64,
    left: bool,
    may_close: bool,
) -> Result<Trace, E> {
    let mut points = vec![start];
    let (mut p, mut step, mut length) = (start, 10.0 * MIN_STEP, 0.0);
    // The direction of the last step; initially, and after a corner, only a half plane is known.
    let mut last: Option<f64> = None;
    while points.len() < MAX_POINTS {
        if may_close && length > 4.0 * step && distance(p, start) <= step {
            return Ok(Trace { points, closed: true });
        }
        let is_shortest = step <= 1.01 * MIN_STEP;
        // Arcs: the middle of each, relative to the heading, and half its width. After a step slightly past a corner, the edge crosses the
        // heading, and continues to one side.
        let arcs: &[(f64, f64)] = match (last, is_shortest) {
            (None, _) => &[(0.0, 0.5 * PI)],
            (_, false) => &[(0.0, 0.06), (0.0, 0.3)],
            (_, true) => &[(0.0, 0.3), (0.0, 1.0), (0.0, 2.0), (0.0, 2.8), (0.5 * PI, 0.5 * PI), (-0.5 * PI, 0.5 * PI)],
        };
        let mut next = None;
        for (aside, width) in arcs {
            let path = |x: f64| star(p, heading + aside + width * (2.0 * x - 1.0), step);
            let ends = [f(path(0.0))?, f(path(1.0))?];
            // Above 0 only at the end of the arc on its side.
            let [right, left_of_it] = ends.map(|value| value > 0.0);
            if right != left_of_it && left_of_it == left {
                next = Some(crossing(f, path, ends)?);
                break;
            }
        }
        // A step's direction, and the turn of the edge since the last one.
        let step_to = |q: Place| {
            let towards = (q[1] - p[1]).atan2(q[0] - p[0]);
            (q, towards, last.map_or(0.0, |last| (towards - last + PI).rem_euclid(2.0 * PI) - PI))
        };
        match next.map(step_to) {
            Some((q, towards, turn)) if is_shortest || turn.abs() <= MAX_TURN_RAD => {
                length += distance(p, q);
                points.push(q);
                if on_frame(q) {
                    break;
                }
                // The curvature continues, except at a corner.
                heading = if turn.abs() <= MAX_TURN_RAD { towards + turn } else { towards };
                if turn.abs() < 0.3 * MAX_TURN_RAD {
                    step = (2.0 * step).min(MAX_STEP);
                }
                (p, last) = (q, Some(towards));
            }
            _ if is_shortest => break,
            _ => step = (0.5 * step).max(MIN_STEP),
        }
    }
    Ok(Trace { points, closed: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(f: impl Fn(Place) -> f64 + Sync) -> Vec<Trace> {
        trace(&|p| Ok::<f64, ()>(f(p)), &[]).unwrap()
    }

    #[test]
    fn a_circle_is_one_closed_edge_with_the_inside_on_its_left() {
        let circle = |p: Place| 0.09 - (p[0] - 0.5).powi(2) - (p[1] - 0.4).powi(2);
        let found = all(circle);
        assert!(found.len() == 1 && found[0].closed, "{found:?}");
        let points = &found[0].points;
        assert!(points.iter().all(|p| circle(*p).abs() < 1e-12));
        // Shoelace: the area inside is to the left.
        let area: f64 = (0..points.len())
            .map(|i| (points[i], points[(i + 1) % points.len()]))
            .map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1]))
            .sum();
        assert!((area / (PI * 0.09) - 1.0).abs() < 2e-3, "{area}");
    }

    #[test]
    fn a_corner_is_followed_also_with_an_infinite_side() {
        // Beyond a right angle at (0.3, 0.6), with a finite and with an infinite function.
        for beyond in [1.0, f64::INFINITY] {
            let f = |p: Place| if p[0] > 0.3 && p[1] < 0.6 { beyond } else { -1.0 };
            let found = all(f);
            assert_eq!(found.len(), 1);
            let points = &found[0].points;
            assert!(points.iter().all(|p| (p[0] - 0.3).abs() < 2e-5 || (p[1] - 0.6).abs() < 2e-5), "{points:?}");
            assert!(points.iter().any(|p| distance(*p, [0.3, 0.6]) < 3e-5));
            assert!(on_frame(points[0]) && on_frame(*points.last().unwrap()));
            assert!(points.len() < 300, "{}", points.len());
        }
    }

    #[test]
    fn a_step_past_a_corner_does_not_end_the_edge() {
        // Stairs of all heights, above 0 to their upper right.
        for flight in 2..40 {
            let stairs = |p: Place| p[1] - 1.0 / (1.0 + (f64::from(flight) * p[0]).floor());
            for f in [&stairs as &(dyn Fn(Place) -> f64 + Sync), &|p| stairs(p).signum()] {
                let found = all(f);
                assert!(found.len() == 1 && found[0].lost().count() == 0, "{flight} {}", found.len());
            }
        }
    }

    #[test]
    fn several_edges_are_all_found_and_none_twice() {
        // Three stripes.
        let found = all(|p: Place| (9.0 * PI * (p[0] + 0.3 * p[1] * p[1])).sin() - 0.2);
        let starts = found.iter().filter(|t| !t.closed && on_frame(t.points[0])).count();
        assert_eq!(starts, found.len());
        for (i, a) in found.iter().enumerate() {
            for b in &found[..i] {
                assert!(!lies_on(b, a.points[a.points.len() / 2]));
            }
        }
        // (x, y) = (1, 0) is at 9 half periods, (1, 1) at 11.7: every one of sin = 0.2 before it is crossed.
        let crossings =
            (0..12).flat_map(|n| [n as f64 * 2.0 + 0.2f64.asin() / PI, n as f64 * 2.0 + 1.0 - 0.2f64.asin() / PI]);
        assert_eq!(found.len(), crossings.filter(|x| *x < 9.0 * 1.3).count());
    }

    #[test]
    fn a_straight_edge_is_found_once_wherever_it_crosses_the_square() {
        for i in 0..40 {
            let (sin, cos) = (0.1 + 2.0 * PI * f64::from(i) / 40.0).sin_cos();
            for j in 0..30 {
                let away = 0.02 + f64::from(j) / 43.0;
                let f = |p: Place| cos * (p[0] - 0.5) + sin * (p[1] - 0.5) - away;
                let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(f);
                if corners.iter().all(|value| *value < 0.005) {
                    continue;
                }
                let found = all(f);
                assert_eq!(found.len(), 1, "{i} {j}");
                let ends = [found[0].points[0], found[0].points[found[0].points.len() - 1]];
                assert!(ends.iter().all(|end| on_frame(*end)), "{i} {j}: {ends:?}");
            }
        }
    }

    #[test]
    fn an_edge_too_small_to_follow_is_reported_as_lost() {
        // A disc of a third of the shortest step, where a side is searched.
        let found = all(|p| MIN_STEP / 3.0 - distance(p, [0.5, INSET]));
        let lost: Vec<Place> = found.iter().flat_map(Trace::lost).collect();
        assert!(!lost.is_empty() && lost.iter().all(|p| distance(*p, [0.5, INSET]) < MIN_STEP), "{found:?}");
        // A complete edge has no such place.
        assert_eq!(all(|p| p[0] - 0.4 + 0.1 * p[1]).iter().flat_map(Trace::lost).count(), 0);
    }

    #[test]
    fn a_function_of_one_sign_has_no_edge() {
        assert!(all(|_| -1.0).is_empty() && all(|_| f64::INFINITY).is_empty());
    }
}
