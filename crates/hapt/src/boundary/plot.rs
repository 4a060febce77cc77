//! The picture of a boundary: the plane of two keys, each side of each edge in its colour.

use hapt_model::System;
use hapt_report::Point;
use hapt_report::figure::{Figure, Fill, Panel, Shape, Style};
use hapt_sweep::boundary::{Boundary, Edge, Place};

use crate::axis::DisplayedAxis;

/// The name of the mark at the file's own values.
const OWN: &str = "the file's own world";
const OWN_NETWORK: &str = "the file's own network";

/// The name of a mark at the file's own values.
pub fn own_name(system: &System) -> &'static str {
    if system.world().is_some() { OWN } else { OWN_NETWORK }
}

/// The name of the region in which all claims hold, and the regions beyond edges.
type Regions = (String, Vec<(Edge, Fill, String)>);

fn world_regions(is_requested: impl Fn(Edge) -> bool) -> Regions {
    let stability = match (is_requested(Edge::Held), is_requested(Edge::Free)) {
        (true, true) => ["stable", "unstable"],
        (true, false) => ["stable held", "unstable held"],
        (false, true) => ["stable free", "unstable free"],
        (false, false) => ["", ""],
    };
    let all = match (stability[0], is_requested(Edge::Passive)) {
        ("", true) => "passive".to_string(),
        (stable, true) => format!("{stable} and passive"),
        (stable, false) => stable.into(),
    };
    // The edges of the linear loop prove nothing of a nonlinear one.
    let all = if is_requested(Edge::Certified) {
        "not refuted, not certified".into()
    } else {
        format!("{all} in the linear loop")
    };
    let not_passive =
        if stability[0].is_empty() { "not passive".into() } else { format!("{}, not passive", stability[0]) };
    let unstable = || stability[1].to_string();
    let worse = vec![
        (Edge::Passive, Fill::Fair, not_passive),
        (Edge::Held, Fill::Bad, unstable()),
        (Edge::Free, Fill::Bad, unstable()),
    ];
    (all, worse)
}

/// Passive for any clocks is passive at fixed times too.
fn network_regions(is_requested: impl Fn(Edge) -> bool) -> Regions {
    let (all, between) = match (is_requested(Edge::Passive), is_requested(Edge::Fixed)) {
        (true, true) => ("passive for any clocks", "passive at fixed times only"),
        (true, false) => ("passive for any clocks", "not passive for any clocks"),
        (false, _) => ("passive at fixed times", ""),
    };
    let worse =
        vec![(Edge::Passive, Fill::Fair, between.to_string()), (Edge::Fixed, Fill::Bad, "not passive".to_string())];
    (all.to_string(), worse)
}

/// The whole figure.
/// `own` is where the file's own world is, in SI; `None` where it is elsewhere.
pub fn figure(
    boundary: &Boundary,
    axes: &[DisplayedAxis; 2],
    own: Option<[f64; 2]>,
    title: &str,
    summary: &str,
) -> Figure {
    let point = |place: Place| -> Point {
        let [x, y] = boundary.plane.values(place);
        (x / axes[0].size, y / axes[1].size)
    };
    let mut panel = Panel::new("", axes[0].figure(0.0), axes[1].figure(0.0));
    let is_requested = |edge: Edge| boundary.claims.iter().any(|claim| claim.edge == edge && claim.undecided.is_none());
    let (all, worse) = match boundary.plane.system.world() {
        Some(_) => world_regions(is_requested),
        None => network_regions(is_requested),
    };
    // Worse regions cover better ones.
    let frame = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let polygons = |polygons: &[Vec<Place>]| polygons.iter().map(|p| p.iter().map(|&q| point(q)).collect()).collect();
    let fill = if boundary.plane.system.world().is_none() { Fill::Good } else { Fill::Open };
    panel.region(&all, fill, polygons(std::slice::from_ref(&frame)));
    for (edge, fill, name) in &worse {
        for claim in boundary.claims.iter().filter(|claim| claim.edge == *edge && !claim.beyond.is_empty()) {
            panel.region(name, *fill, polygons(&claim.beyond));
        }
    }
    // Theorems may count what the linear loop lacks, such as friction. By the even-odd rule, the frame and the region beyond leave the
    // region within.
    for claim in boundary.claims.iter().filter(|claim| claim.edge == Edge::Certified && claim.lost.is_empty()) {
        let within: Vec<Vec<Place>> = std::iter::once(frame.clone()).chain(claim.beyond.clone()).collect();
        panel.region("certified", Fill::Good, polygons(&within));
    }
    for claim in &boundary.claims {
        let (name, style) = match claim.edge {
            Edge::Held => ("edge of stability, held", Style::Edge(2)),
            Edge::Free => ("edge of stability, free", Style::Edge(0)),
            Edge::Passive => ("edge of passivity", Style::Edge(1)),
            Edge::Certified => ("edge of certification", Style::Edge(3)),
            Edge::Fixed => ("edge of passivity at fixed times", Style::Edge(2)),
        };
        for piece in &claim.pieces {
            let closing = piece.closed.then(|| piece.points.first()).flatten();
            let places = piece.points.iter().chain(closing).map(|p| point(p.place));
            panel.curve(name, style, places.collect());
        }
    }
    if let Some([x, y]) = own {
        panel.mark(
            own_name(&boundary.plane.system),
            Shape::Ring,
            Style::Edge(0),
            vec![(x / axes[0].size, y / axes[1].size)],
        );
    }
    let alt = summary.lines().map(str::trim).collect::<Vec<_>>().join("; ");
    Figure { title: title.into(), alt, panels: vec![panel], columns: 1 }
}
