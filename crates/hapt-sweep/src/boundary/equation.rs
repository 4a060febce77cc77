//! The parts of the D-decomposition's curves that are the edge: those at which the verdict differs on the two sides.
//!
//! The curves are followed by their parameter, φ or the position on a line, which is halved until the chords lie on the curve. The
//! ends of a stretch, at the frame or where two curves cross, are found by bisection too; stretches that meet there are joined.

use std::f64::consts::{PI, TAU};

use hapt_analysis::Decomposition;
use hapt_analysis::Line;

use crate::boundary::continuation::{INSET, Place, Trace, distance, on_frame};
use crate::boundary::plane::{Edge, Plane};
use crate::error::Error;

/// The distance of the verdicts on both sides of a point, in parts of the frame.
pub(crate) const VERDICT_OFFSET: f64 = 1e-6;
/// The largest distance of a chord from the curve, and its largest length, in parts of the frame.
const CHORD: f64 = 1e-4;
const MAX_STEP: f64 = 0.01;
/// The largest distance of joined ends.
const MEETS: f64 = 1e-3;
/// The smallest φ, and the smallest distance of φ from π or of a place from its line's end, relative to the range.
const MIN_PARAMETER: f64 = 1e-7;
/// The largest number of halvings between neighbouring parameters.
const MAX_HALVINGS: usize = 24;

/// An edge, and at each of its points the frequency in Hz and the direction beyond it, of length 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct TracedEdge {
    pub trace: Trace,
    pub known: Vec<(f64, [f64; 2])>,
}

/// The side of a curve beyond the edge, in its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

/// A curve of the plane, over its parameter from 0 to 1.
struct BoundaryCurve<'a> {
    plane: &'a Plane,
    edge: Edge,
    at: Box<dyn Fn(f64) -> Option<[f64; 2]> + 'a>,
    hz: Box<dyn Fn(f64) -> f64 + 'a>,
}

impl BoundaryCurve<'_> {
    fn place(&self, t: f64) -> Option<Place> {
        (self.at)(t).map(|values| self.plane.place(values)).filter(|p| p.iter().all(|x| x.is_finite()))
    }

    /// The edge at a parameter; `None` where the curve is no edge.
    fn side(&self, t: f64) -> Result<Option<Side>, Error> {
        let inside = |p: &Place| p.iter().all(|x| *x >= INSET && *x <= 1.0 - INSET);
        let Some(p) = self.place(t).filter(inside) else { return Ok(None) };
        let Some(along) = self.along(t) else { return Ok(None) };
        side(self.plane, self.edge, p, along)
    }

    /// Its direction there, from a chord below the resolution.
    fn along(&self, t: f64) -> Option<[f64; 2]> {
        let mut directions = (5..12).step_by(2).filter_map(|power| {
            let dt = 10f64.powi(-power) * t.min(1.0 - t);
            let (a, b) = (self.place(t - dt)?, self.place(t + dt)?);
            (distance(a, b) < CHORD).then_some([b[0] - a[0], b[1] - a[1]])
        });
        directions.next()
    }

    /// The parameters of a polygon that lies on the curve wherever that comes near the frame.
    fn parameters(&self, base: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        for pair in base.windows(2) {
            let &[t, u] = pair else { continue };
            all.push(t);
            self.refine((t, self.place(t)), (u, self.place(u)), MAX_HALVINGS, &mut all);
        }
        all.extend(base.last());
        all
    }

    fn refine(&self, a: (f64, Option<Place>), b: (f64, Option<Place>), depth: usize, all: &mut Vec<f64>) {
        let t = 0.5 * (a.0 + b.0);
        let middle = (t, self.place(t));
        let fine = match (a.1, middle.1, b.1) {
            (Some(a), Some(m), Some(b)) => {
                // The chord lies to one side of the frame.
                let apart = |i: usize| {
                    let (low, high) = (a[i].min(m[i]).min(b[i]), a[i].max(m[i]).max(b[i]));
                    let room = high - low;
                    high + room < 0.0 || low - room > 1.0
                };
                let chord = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                apart(0) || apart(1) || (distance(chord, m) < CHORD && distance(a, b) < MAX_STEP)
            }
            (None, None, None) => true,
            _ => false,
        };
        if !fine && depth > 0 {
            self.refine(a, middle, depth - 1, all);
            all.push(t);
            self.refine(middle, b, depth - 1, all);
        }
    }

    /// The parts that are the edge, with the region beyond it on their left.
    fn stretches(&self, base: &[f64]) -> Result<Vec<TracedEdge>, Error> {
        let parameters = self.parameters(base);
        let mut all: Vec<TracedEdge> = Vec::new();
        let mut stretch: Vec<f64> = Vec::new();
        let mut before: Option<(f64, Option<Side>)> = None;
        for t in parameters {
            let here = self.side(t)?;
            if let Some((last, side)) = before.filter(|(_, side)| *side != here) {
                if side.is_some() {
                    stretch.push(self.end(last, t, side)?);
                    all.extend(self.found(std::mem::take(&mut stretch), side));
                }
                if here.is_some() {
                    stretch.push(self.end(t, last, here)?);
                }
            }
            if here.is_some() {
                stretch.push(t);
            }
            before = Some((t, here));
        }
        all.extend(self.found(stretch, before.and_then(|(_, side)| side)));
        Ok(all)
    }

    /// The last parameter from `here` toward `there` with the same edge as here.
    fn end(&self, mut here: f64, mut there: f64, side: Option<Side>) -> Result<f64, Error> {
        for _ in 0..60 {
            let middle = 0.5 * (here + there);
            if middle == here || middle == there {
                break;
            }
            if self.side(middle)? == side { here = middle } else { there = middle }
        }
        Ok(here)
    }

    fn found(&self, stretch: Vec<f64>, side: Option<Side>) -> Option<TracedEdge> {
        let side = side?;
        let points = stretch.iter().map(|t| self.place(*t)).collect::<Option<Vec<Place>>>()?;
        let known = |t: &f64| Some(((self.hz)(*t), normal(self.along(*t)?, side)));
        let known = stretch.iter().map(known).collect::<Option<Vec<_>>>()?;
        let mut found = TracedEdge { trace: Trace { points, closed: false }, known };
        if side == Side::Right {
            found.trace.points.reverse();
            found.known.reverse();
        }
        (found.trace.points.len() > 1).then_some(found)
    }
}

/// The unit vector across a direction, to its left or right.
pub(crate) fn normal(along: [f64; 2], side: Side) -> [f64; 2] {
    let length = along[0].hypot(along[1]) * if side == Side::Left { 1.0 } else { -1.0 };
    [-along[1] / length, along[0] / length]
}

/// Compares the verdicts on both sides of a place on a curve with this direction; `None` where they agree.
pub(crate) fn side(plane: &Plane, edge: Edge, p: Place, along: [f64; 2]) -> Result<Option<Side>, Error> {
    let is_beyond = |side: Side| -> Result<Option<bool>, Error> {
        let to = normal(along, side);
        if !to.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        let offset = Plane::inside([0, 1].map(|i| p[i] + VERDICT_OFFSET * to[i]));
        Ok(Some(plane.beyond(edge, offset)? > 0.0))
    };
    Ok(match (is_beyond(Side::Left)?, is_beyond(Side::Right)?) {
        (Some(true), Some(false)) => Some(Side::Left),
        (Some(false), Some(true)) => Some(Side::Right),
        _ => None,
    })
}

/// The edge by the equations; `None` where the parts do not close it, so that it has to be traced.
pub(crate) fn edges(plane: &Plane, edge: Edge, equations: &[Decomposition]) -> Result<Option<Vec<TracedEdge>>, Error> {
    let mut stretches = Vec::new();
    for equation in equations {
        let period = plane.system.number("loop.period").unwrap_or(f64::NAN);
        let curve = BoundaryCurve {
            plane,
            edge,
            at: Box::new(move |t| equation.at(PI * t)),
            hz: Box::new(move |t| PI * t / (TAU * period)),
        };
        stretches.extend(curve.stretches(&base(&equation.angles()))?);
        for (line, hz) in equation.lines().into_iter().zip([0.0, 0.5 / period]) {
            let Some([from, to]) = line.and_then(|line| through(plane, line)) else { continue };
            // Slightly beyond both ends, so that the line crosses the frame.
            let at = move |t: f64| Some([0, 1].map(|i| from[i] + (1.02 * t - 0.01) * (to[i] - from[i])));
            let curve = BoundaryCurve { plane, edge, at: Box::new(at), hz: Box::new(move |_| hz) };
            stretches.extend(curve.stretches(&base(&[]))?);
        }
    }
    Ok(together(stretches))
}

/// Parameters from which to halve, dense toward the ends and about the angles near which a curve may turn.
fn base(angles: &[(f64, f64)]) -> Vec<f64> {
    let mut all: Vec<f64> = (1..128).map(|i| f64::from(i) / 128.0).collect();
    let near = |centre: f64, least: f64| {
        let steps = (0.1 / least).log10().max(0.0) * 6.0;
        (0..=steps as u32)
            .map(move |i| least * 10f64.powf(f64::from(i) / 6.0))
            .flat_map(move |x| [centre - x, centre + x])
    };
    all.extend(near(0.0, MIN_PARAMETER).chain(near(1.0, MIN_PARAMETER)));
    for (angle, width) in angles {
        all.extend(near(angle / PI, (0.1 * width / PI).max(MIN_PARAMETER)));
    }
    all.retain(|t| *t >= MIN_PARAMETER && *t <= 1.0 - MIN_PARAMETER);
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The points at which a line enters and leaves the plane's ranges; `None` where it does not cross them.
fn through(plane: &Plane, line: Line) -> Option<[[f64; 2]; 2]> {
    let ranges = plane.axes.each_ref().map(|axis| [axis.from, axis.to]);
    let [a, b] = line.normal;
    let mut ends: Vec<[f64; 2]> = Vec::new();
    for x in ranges[0] {
        ends.push([x, (line.offset - a * x) / b]);
    }
    for y in ranges[1] {
        ends.push([(line.offset - b * y) / a, y]);
    }
    let inside = |p: &[f64; 2]| {
        p.iter().zip(&ranges).all(|(x, [from, to])| {
            let room = 1e-12 * (to - from);
            *x >= from - room && *x <= to + room
        })
    };
    ends.retain(inside);
    let far = |p: &[f64; 2], q: &[f64; 2]| {
        (0..2).map(|i| ((p[i] - q[i]) / (ranges[i][1] - ranges[i][0])).abs()).fold(0.0, f64::max)
    };
    let first = *ends.first()?;
    let last = *ends.iter().max_by(|p, q| far(&first, p).total_cmp(&far(&first, q)))?;
    (far(&first, &last) > VERDICT_OFFSET).then_some([first, last])
}

/// Joins adjacent parts; `None` where the result ends neither at the frame nor at its start.
fn together(mut stretches: Vec<TracedEdge>) -> Option<Vec<TracedEdge>> {
    let mut whole = Vec::new();
    while let Some(mut chain) = stretches.pop() {
        loop {
            let (start, end) = (*chain.trace.points.first()?, *chain.trace.points.last()?);
            if on_frame(start) && on_frame(end) {
                break;
            }
            // A part that continues at the end, or before the start.
            let gap = |found: &TracedEdge| {
                let ends = found.trace.points.first().zip(found.trace.points.last());
                let (first, last) = ends.map_or((f64::INFINITY, f64::INFINITY), |(first, last)| {
                    let behind = if on_frame(end) { f64::INFINITY } else { distance(end, *first) };
                    (behind, if on_frame(start) { f64::INFINITY } else { distance(start, *last) })
                });
                (first.min(last), first <= last)
            };
            let nearest = (0..stretches.len()).min_by(|&a, &b| gap(&stretches[a]).0.total_cmp(&gap(&stretches[b]).0));
            let nearest = nearest.map(|i| (i, gap(&stretches[i]))).filter(|(_, (gap, _))| *gap < MEETS);
            let own = if on_frame(start) || on_frame(end) { f64::INFINITY } else { distance(start, end) };
            match nearest {
                Some((i, (gap, behind))) if gap < own => {
                    let mut other = stretches.swap_remove(i);
                    if !behind {
                        std::mem::swap(&mut chain, &mut other);
                    }
                    chain.trace.points.extend(other.trace.points);
                    chain.known.extend(other.known);
                }
                _ if own < MEETS => {
                    chain.trace.closed = true;
                    break;
                }
                _ => return None,
            }
        }
        whole.push(chain);
    }
    Some(whole)
}
