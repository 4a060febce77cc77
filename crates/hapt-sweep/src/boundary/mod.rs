//! The exact edge of stability and of passivity in the plane of two keys.
//!
//! Where the keys are a stiffness and a damping at one place the edge of stability comes from its equation
//! ([`hapt_analysis::boundary::d_decomposition`]), point by point in closed form; elsewhere, and for passivity, it is traced by the change
//! of the verdict. The verdict is computed on both sides of every point.

mod continuation;
mod equation;
mod outline;
mod plane;

use hapt_analysis::Decomposition;
use hapt_model::Source;
use rayon::prelude::*;

use crate::error::Error;
use continuation::{Trace, trace};
use equation::{Side, TracedEdge, VERDICT_OFFSET, edges, normal, side};

pub use continuation::Place;
pub use plane::{Edge, Plane};

/// The method that found an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeMethod {
    /// By its equation.
    Equation,
    /// Traced by the change of the verdict.
    Continuation,
}

/// A point of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// 0 to 1 to the right, and up.
    pub place: Place,
    /// The keys' values, in SI.
    pub values: [f64; 2],
    /// Frequency in Hz of the eigenvalue that crosses the unit circle here, or of the largest required damping; `None` where there is none.
    pub hz: Option<f64>,
    /// The direction beyond the edge, of length 1, in parts of the frame.
    pub beyond: [f64; 2],
}

/// A connected edge: the region beyond it is on the left in the direction of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// The claim.
    pub edge: Edge,
    /// The method that found it.
    pub method: EdgeMethod,
    /// The points in their order.
    pub points: Vec<Point>,
    /// Whether it is closed; else both ends are at the frame, or [lost](Claim::lost).
    pub closed: bool,
    /// The number of points with the same verdict on both sides, which are omitted.
    pub failed: usize,
}

/// One claim in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// The claim.
    pub edge: Edge,
    /// The pieces of its edge.
    pub pieces: Vec<Piece>,
    /// The region beyond the edge as polygons: even-odd, in parts of the frame. None where a part of the edge is lost.
    pub beyond: Vec<Vec<Place>>,
    /// The values of the keys at which the edge continues, but turns or narrows within a hundred-thousandth of the frame, and is not followed.
    pub lost: Vec<[f64; 2]>,
    /// Whether the whole plane is beyond it, or nothing; `None` where there is an edge, or no verdict.
    pub everywhere: Option<bool>,
    /// The reason that there is no verdict in the whole plane; `None` where there is one.
    pub undecided: Option<String>,
}

/// The edges of the claims about a world or network in the plane of two keys.
///
/// ```
/// use hapt_model::Source;
/// use hapt_sweep::boundary::{Boundary, Edge};
///
/// let file = r#"
/// loop.period = "1 ms"
/// device = { inertia = "6.4e-4 kg m^2", damping = "1.2e-3 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "1 N m/rad"
/// [[couplings]]
/// kind = "damper"
/// between = ["puck", "ground"]
/// damping = 0
/// "#;
/// let axes = ["couplings.0.stiffness=0.1..10".to_string(), "device.damping=0..0.01".to_string()];
/// let found = Boundary::new(&Source::from_text("spring.toml", file), &[], &axes, &[Edge::Passive])?;
/// // A spring is passive up to b = K T/2.
/// for point in &found.claims[0].pieces[0].points {
///     let [stiffness, damping] = point.values;
///     assert!((damping - 0.5e-3 * stiffness).abs() < 1e-5);
/// }
/// # Ok::<(), hapt_sweep::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    /// The plane.
    pub plane: Plane,
    /// The claims in the requested order.
    pub claims: Vec<Claim>,
}

impl Boundary {
    /// Finds the edges of `claims` in the plane of the axes, each `KEY=FROM..TO[:log]`, of the world or network in `source` with
    /// the overrides `sets`. An empty list stands for all claims about the file.
    ///
    /// Work: about a thousand verdicts for each edge, on rayon's current pool. An island of a claim between the searched lines, five in each
    /// direction and the frame, is not found.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn new(source: &Source, sets: &[String], axes: &[String], claims: &[Edge]) -> Result<Boundary, Error> {
        Boundary::until(source, sets, axes, claims, &|| false)
    }

    /// As [`Boundary::new`]; `stop` is called before each verdict of an edge that is followed, and ends the work when true.
    ///
    /// # Errors
    /// As [`Boundary::new`]; [`Error::Interrupted`].
    pub fn until(
        source: &Source,
        sets: &[String],
        axes: &[String],
        claims: &[Edge],
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Boundary, Error> {
        let plane = Plane::new(source, sets, axes)?;
        let claims = if claims.is_empty() { Edge::of(&plane.system) } else { claims };
        let claims = claims.par_iter().map(|edge| claim(&plane, *edge, stop)).collect::<Result<Vec<_>, _>>()?;
        Ok(Boundary { plane, claims })
    }
}

fn claim(plane: &Plane, edge: Edge, stop: &(dyn Fn() -> bool + Sync)) -> Result<Claim, Error> {
    if !Edge::of(&plane.system).contains(&edge) {
        return Err(Plane::foreign(edge, &plane.system));
    }
    let undecided = plane.undecided(edge)?;
    if undecided.is_some() {
        return Ok(Claim {
            edge,
            pieces: Vec::new(),
            beyond: Vec::new(),
            lost: Vec::new(),
            everywhere: None,
            undecided,
        });
    }
    let middle = [0.5, 0.5];
    let failed = |error| plane.failed(middle, error);
    let equations = match (plane.system.world(), edge) {
        (Some(world), Edge::Held) => Decomposition::held(world, plane.keys()).map_err(failed)?,
        (Some(world), Edge::Free) => Decomposition::free(world, plane.keys()).map_err(failed)?,
        (None, _) | (_, Edge::Passive | Edge::Certified | Edge::Fixed) => None,
    };
    let known = match &equations {
        Some(equations) => edges(plane, edge, equations)?.unwrap_or_default(),
        None => Vec::new(),
    };
    let traces: Vec<Trace> = known.iter().map(|found| found.trace.clone()).collect();
    let beyond = |place| if stop() { Err(Error::Interrupted) } else { plane.beyond(edge, place) };
    let more = trace(&beyond, &traces)?;
    let all: Vec<Trace> = traces.iter().chain(&more).cloned().collect();
    let corner = plane.beyond(edge, Plane::inside([0.0, 0.0]))? > 0.0;
    let mut pieces: Vec<Piece> = Vec::new();
    for found in known {
        pieces.extend(piece(plane, edge, EdgeMethod::Equation, found)?);
    }
    for trace in more.into_iter().filter(|trace| trace.points.len() > 1) {
        pieces.extend(piece(plane, edge, EdgeMethod::Continuation, TracedEdge { trace, known: Vec::new() })?);
    }
    let lost: Vec<[f64; 2]> = all.iter().flat_map(Trace::lost).map(|place| plane.values(place)).collect();
    let everywhere = all.is_empty().then_some(corner);
    let beyond = if lost.is_empty() { outline::beyond(&all, corner) } else { Vec::new() };
    Ok(Claim { edge, pieces, beyond, lost, everywhere, undecided })
}

/// A trace with the data of its points. At each point of a traced edge the verdict is computed on both sides, across both neighbours, or
/// across one of them near a corner; points of an equation have been checked.
fn piece(plane: &Plane, edge: Edge, method: EdgeMethod, found: TracedEdge) -> Result<Option<Piece>, Error> {
    let TracedEdge { trace: Trace { points, closed }, known } = found;
    let n = points.len();
    let point = |i: usize| -> Result<Option<Point>, Error> {
        let here = points[i];
        let made = |hz, beyond| Some(Point { place: here, values: plane.values(here), hz, beyond });
        if let Some(&(hz, beyond)) = known.get(i) {
            return Ok(made(Some(hz), beyond));
        }
        let (before, after) = match closed {
            true => (points[(i + n - 1) % n], points[(i + 1) % n]),
            false => (points[i.saturating_sub(1)], points[(i + 1).min(n - 1)]),
        };
        for (a, b) in [(before, after), (here, after), (before, here)] {
            let along = [b[0] - a[0], b[1] - a[1]];
            if side(plane, edge, here, along)? == Some(Side::Left) {
                let beyond = normal(along, Side::Left);
                let offset = Plane::inside([0, 1].map(|j| here[j] + VERDICT_OFFSET * beyond[j]));
                return Ok(made(plane.hz(edge, offset)?, beyond));
            }
        }
        Ok(None)
    };
    let looked = (0..n).into_par_iter().map(point).collect::<Result<Vec<_>, Error>>()?;
    let points: Vec<Point> = looked.into_iter().flatten().collect();
    let failed = n - points.len();
    Ok((!points.is_empty()).then_some(Piece { edge, method, points, closed, failed }))
}
