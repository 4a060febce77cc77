//! `hapt boundary`: where in the plane of two keys a loop stops being stable or passive, or a network passive.

mod plot;

pub use plot::own_name;

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_model::World;
use hapt_sweep::boundary::{Boundary, Edge, EdgeMethod, Piece, Point};
use hapt_sweep::table;

use crate::args::BoundaryArgs;
use crate::axis::{DisplayedAxis, within};
use crate::failure::Failure;
use crate::messages;
use crate::output;
use crate::picture::FigureFile;
use crate::progress;
use crate::world::{inputs, read_system, source};

pub fn run(args: &BoundaryArgs) -> Result<ExitCode, Failure> {
    let claims = claims(&args.claims)?;
    if let Some(out) = &args.out {
        output::format("--out", out, &["csv"])?;
    }
    let file = FigureFile::of("--plot", args.plot.as_deref(), &args.figure)?;
    let source = source(&args.world.path)?;
    let outputs = [("--out", &args.out), ("--plot", &args.plot)];
    let system = read_system(&source, &args.world.sets)?;
    output::apart(&output::given(&outputs), &inputs(&args.world.path, &system))?;
    let boundary = progress::during("boundary", "searching the edges", || {
        Boundary::new(&source, &args.world.sets, &args.axes, &claims)
    })?;
    let [x, y] = [0, 1].map(|i| within(&boundary.plane.axes[i], system.number(&boundary.plane.axes[i].key)));
    let own = x.zip(y).map(|(x, y)| [x, y]);
    let typed = |i: usize| args.axes.get(i).map_or("", String::as_str);
    let axes = [0, 1].map(|i| DisplayedAxis::new(&boundary.plane.system, &boundary.plane.axes[i], typed(i)));
    let title = system.title.as_deref().unwrap_or("edges").to_string();
    let summary = summary(&boundary, &axes);

    let csv = csv(&boundary);
    let mut files = Vec::new();
    if let Some(target) = &args.out {
        files.push((output::draft(target, csv.as_bytes())?, target));
    }
    if let Some(target) = &args.plot {
        let figure = plot::figure(&boundary, &axes, own, &title, &summary);
        files.push((file.draft(target, &figure)?, target));
    }
    // Both are written before either is moved to its place.
    let mut wrote = Vec::new();
    for (draft, target) in files {
        wrote.push(draft.finish().map_err(|error| Failure::write(target.display(), error))?);
    }
    let summary = format!("{title}\n\n{summary}");
    let result = if args.out.is_some() { &summary } else { &csv };
    let mut out = stdout().lock();
    out.write_all(result.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    if args.out.is_none() {
        messages::say(summary.trim_end());
    }
    for path in wrote {
        messages::say(format_args!("wrote {}", path.display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn claims(names: &[String]) -> Result<Vec<Edge>, Failure> {
    let mut claims = Vec::new();
    for name in names {
        let edge = Edge::from_name(name.trim()).ok_or_else(|| {
            let names = Edge::ALL.map(Edge::name).join(", ");
            Failure::input(format!("--of: there is no {name:?}; there are {names}"))
        })?;
        if !claims.contains(&edge) {
            claims.push(edge);
        }
    }
    Ok(claims)
}

/// The side beyond the edge: the most significant key, and whether larger or smaller.
fn toward(point: &Point) -> (usize, bool) {
    let axis = usize::from(point.beyond[1].abs() > point.beyond[0].abs());
    (axis, point.beyond[axis] > 0.0)
}

fn csv(boundary: &Boundary) -> String {
    let [x, y] = &boundary.plane.axes;
    let mut text = format!("edge,piece,{},{},hz,beyond\n", x.key, y.key);
    for claim in &boundary.claims {
        for (number, piece) in claim.pieces.iter().enumerate() {
            for point in &piece.points {
                let (axis, larger) = toward(point);
                let mut numbers = String::new();
                table::line(&[Some(point.values[0]), Some(point.values[1]), point.hz], &mut numbers);
                let sign = if larger { '+' } else { '-' };
                let key = &boundary.plane.axes[axis].key;
                let _ = writeln!(text, "{},{},{},{sign}{key}", claim.edge.name(), number + 1, numbers.trim_end());
            }
        }
    }
    text
}

/// The result as text.
fn summary(boundary: &Boundary, axes: &[DisplayedAxis; 2]) -> String {
    let mut text = format!("plane     {}\n          {}\n", axes[0].range(), axes[1].range());
    for claim in &boundary.claims {
        let _ = match claim.everywhere {
            Some(is_beyond) if claim.edge == Edge::Certified => {
                writeln!(text, "certified {}", if is_beyond { "nowhere" } else { "everywhere" })
            }
            Some(true) => writeln!(text, "{:<9} {} everywhere", claim.edge.name(), claim.edge.beyond()),
            Some(false) => writeln!(text, "{:<9} nowhere {}", claim.edge.name(), claim.edge.beyond()),
            None => Ok(()),
        };
        if let Some(reason) = &claim.undecided {
            let _ = writeln!(text, "{:<9} no verdict: {reason}", claim.edge.name());
        }
        for (i, piece) in claim.pieces.iter().enumerate() {
            let name = if i == 0 { claim.edge.name() } else { "" };
            let _ = writeln!(text, "{name:<9} {}", about(piece, axes));
        }
        for (i, values) in claim.lost.iter().enumerate() {
            let name = if i == 0 && claim.pieces.is_empty() { claim.edge.name() } else { "" };
            let [x, y] = [axes[0].value(values[0]), axes[1].value(values[1])];
            let _ = writeln!(
                text,
                "{name:<9} lost at ({x}, {y}): the edge goes on there, within a hundred-thousandth of the plane; the picture does not\n          \
                 shade what is {}; vary the keys over a smaller plane around this point",
                claim.edge.beyond()
            );
        }
    }
    let world = boundary.plane.system.world();
    if world.is_some_and(is_more_than_linear) {
        text += "note      held, free and passive are edges of the linear loop, of laws at their slopes, at even samples, without the device's\n          \
                 friction; certified counts all that the file states, so it may be wider or narrower\n";
    }
    let pieces = || boundary.claims.iter().flat_map(|claim| &claim.pieces);
    let (points, failed) = pieces().fold((0, 0), |(p, f), piece| (p + piece.points.len(), f + piece.failed));
    if points + failed > 0 {
        let _ = match failed {
            0 => writeln!(text, "checked   {points} points: beside each, the verdicts on its two sides differ"),
            _ => writeln!(
                text,
                "checked   {} points: beside {failed} of them the verdicts do not differ, and these are left out",
                points + failed
            ),
        };
    }
    text
}

/// Whether the certificate counts effects that the linear loop at even samples does not have.
fn is_more_than_linear(world: &World) -> bool {
    let is_stated = hapt_analysis::uneven(world).is_ok_and(|uneven| uneven.is_stated);
    let is_nonlinear = world.couplings.iter().any(|coupling| coupling.linear().is_none());
    is_stated || is_nonlinear || world.device.largest_friction() > 0.0
}

/// A sentence about a connected edge: its place, its method, and its sides.
fn about(piece: &Piece, axes: &[DisplayedAxis; 2]) -> String {
    let place = |point: &Point| format!("({}, {})", axes[0].value(point.values[0]), axes[1].value(point.values[1]));
    let method = match piece.method {
        EdgeMethod::Equation => "by its equation",
        EdgeMethod::Continuation => "by continuation",
    };
    let (Some(first), Some(last), Some(middle)) =
        (piece.points.first(), piece.points.last(), piece.points.get(piece.points.len() / 2))
    else {
        return String::new();
    };
    let (axis, larger) = toward(middle);
    let side = if larger { "larger" } else { "smaller" };
    let ends = match piece.closed {
        true => format!("closed, through {}", place(first)),
        false => format!("from {} to {}", place(first), place(last)),
    };
    let count = piece.points.len();
    format!(
        "{ends}, {count} points {method}\n          seen from {}, {} toward {side} {}",
        place(middle),
        piece.edge.beyond(),
        axes[axis].key
    )
}
