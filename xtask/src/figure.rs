//! The documents' pictures, drawn from the runs' CSV: one row of [`FIGURES`] each.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use kuva::prelude::*;

/// One picture: docs/images/NAME.svg.
struct Figure {
    name: &'static str,
    title: &'static str,
    y: Axis,
    /// The stretch of the run that is shown, in s.
    span: (f64, f64),
    curves: &'static [Curve],
    /// Whether the motor's limit of the course's wheel, 822.25 N·mm to either side, is shown.
    limit: bool,
}

/// What stands on the upright axis, and how much of it one SI unit is.
struct Axis {
    label: &'static str,
    per_si: f64,
}

/// A column of the run of a world of the notes.
struct Curve {
    legend: &'static str,
    color: &'static str,
    world: &'static str,
    scenario: &'static str,
    sets: &'static [&'static str],
    column: &'static str,
}

// Okabe and Ito's vermillion, blue and bluish green: told apart by every eye.
const RED: &str = "#d55e00";
const BLUE: &str = "#0072b2";
const GREEN: &str = "#009e73";
const GREY: &str = "#555555";

const TORQUE: Axis = Axis { label: "torque asked of the motor (N·mm)", per_si: 1e3 };
const ANGLE: Axis = Axis { label: "angle (deg)", per_si: 180.0 / std::f64::consts::PI };
const WHEEL_ANGLE: Axis = Axis { label: "virtual wheel (deg)", ..ANGLE };

const fn curve(legend: &'static str, color: &'static str, world: &'static str, column: &'static str) -> Curve {
    Curve { legend, color, world, scenario: "step", sets: &[], column }
}

const FIGURES: &[Figure] = &[
    Figure {
        name: "step",
        title: "A step of 45°, held",
        y: ANGLE,
        span: (0.0, 3.0),
        curves: &[curve("haptic wheel", GREY, "wheel", "puck_rad"), curve("virtual wheel", BLUE, "wheel", "wheel_rad")],
        limit: false,
    },
    Figure {
        name: "growth",
        title: "The notes' virtual wheel: a step of 45°, held",
        y: TORQUE,
        span: (0.0, 10.0),
        curves: &[
            curve("forward Euler", RED, "euler", "torque_Nm"),
            curve("forward Euler, b = Tk", BLUE, "damped", "torque_Nm"),
        ],
        limit: true,
    },
    Figure {
        name: "damped",
        title: "The same step after eight seconds",
        y: WHEEL_ANGLE,
        span: (8.0, 10.0),
        curves: &[
            curve("forward Euler", RED, "euler", "wheel_rad"),
            curve("forward Euler, b = Tk", BLUE, "damped", "wheel_rad"),
        ],
        limit: false,
    },
    Figure {
        name: "released",
        title: "Stepped to 45°, let go after a quarter of a second",
        y: ANGLE,
        span: (0.0, 1.5),
        curves: &[
            Curve { scenario: "release", ..curve("haptic wheel", RED, "released", "puck_rad") },
            Curve { scenario: "release", ..curve("virtual wheel", BLUE, "released", "wheel_rad") },
        ],
        limit: false,
    },
    Figure {
        name: "hold",
        title: "Let go after a quarter of a second, exact hold at 1 ms",
        y: TORQUE,
        span: (0.0, 3.0),
        curves: &[
            Curve { sets: &["device.damping=0", LET_GO], ..curve("no device damping", RED, "wheel", "torque_Nm") },
            Curve { sets: &[LET_GO], ..curve("the course's damping", BLUE, "wheel", "torque_Nm") },
        ],
        limit: true,
    },
    Figure {
        name: "resonance",
        title: "Turned by 5° back and forth at 1 Hz, from rest",
        y: ANGLE,
        span: (0.0, 10.0),
        curves: &[
            Curve { scenario: "excite", ..curve("virtual wheel", BLUE, "resonance", "wheel_rad") },
            Curve { scenario: "excite", ..curve("haptic wheel", GREY, "resonance", "puck_rad") },
        ],
        limit: false,
    },
    Figure {
        name: "phase",
        title: "A swinging wheel, turned by 5° at 1 Hz",
        y: WHEEL_ANGLE,
        span: (0.0, 3.0),
        curves: &[
            Curve { scenario: "pump", ..curve("it lags the hand", RED, "pumped-and-damped", "wheel_rad") },
            Curve {
                scenario: "damp",
                sets: &["scenarios.damp.duration=3s"],
                ..curve("it leads the hand", GREEN, "pumped-and-damped", "wheel_rad")
            },
        ],
        limit: false,
    },
];
const LET_GO: &str = "scenarios.step.hand.release=0.25s";

/// Values over time in s.
type Points = Vec<(f64, f64)>;

/// Runs the curve's scenario with the command line and reads back its column within the span.
fn points(curve: &Curve, figure: &Figure) -> Result<Points> {
    let out = Path::new("target/figure").join(figure.name).join(curve.world);
    let status = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--release", "--package", "hapt", "--", "sim"])
        .arg(format!("worlds/notes/{}.toml", curve.world))
        .args(["--scenario", curve.scenario, "--out"])
        .arg(&out)
        .args(curve.sets.iter().flat_map(|set| ["--set", set]))
        .output()?;
    ensure!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    let text = fs::read_to_string(out.join(format!("{}.csv", curve.scenario)))?;
    let mut lines = text.lines();
    let header: HashMap<&str, usize> =
        lines.next().context("no header")?.split(',').enumerate().map(|(i, name)| (name, i)).collect();
    let column = |name: &str| header.get(name).copied().with_context(|| format!("no column {name}"));
    let (time, value) = (column("time_s")?, column(curve.column)?);
    let point = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        Ok((
            fields.get(time).context("short line")?.parse()?,
            figure.y.per_si * fields.get(value).context("short line")?.parse::<f64>()?,
        ))
    };
    let all: Result<Points> = lines.map(point).collect();
    Ok(all?.into_iter().filter(|(t, _)| (figure.span.0..=figure.span.1).contains(t)).collect())
}

/// What a picture 8 cm wide can show of 10 000 samples: the smallest and the largest of each stretch, in their order.
fn extremes(points: &Points, stretches: usize) -> Points {
    let length = points.len().div_ceil(stretches);
    let extremes = |part: &[(f64, f64)]| {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut ends: Points =
            [part.iter().min_by(by), part.iter().max_by(by)].into_iter().flatten().copied().collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends
    };
    points.chunks(length).flat_map(extremes).collect()
}

fn picture(figure: &Figure) -> Result<String> {
    let line = |points: Points, color: &str, width: f64| {
        LinePlot::new().with_data(points).with_color(color).with_stroke_width(width)
    };
    let mut plots: Vec<Plot> = Vec::new();
    for curve in figure.curves {
        let points = extremes(&points(curve, figure)?, 400);
        plots.push(line(points, curve.color, 1.2).with_legend(curve.legend).into());
    }
    if figure.limit {
        let (from, to) = figure.span;
        let limit = |side: f64| line(vec![(from, side * 822.25), (to, side * 822.25)], GREY, 1.0).with_dashed();
        plots.extend([limit(1.0).with_legend("motor's limit").into(), limit(-1.0).into()]);
    }
    let layout = Layout::auto_from_plots(&plots)
        .with_title(figure.title)
        .with_x_label("time (s)")
        .with_y_label(figure.y.label)
        .with_width(820.0)
        .with_height(380.0);
    let svg = kuva::render_to_svg(plots, layout);
    // kuva counts the clip paths of a whole process: the one of this picture is 0, in whatever order they are drawn.
    let mut parts = svg.split("kuva-clip-");
    let head = parts.next().unwrap_or_default().to_string();
    Ok(parts.fold(head, |svg, part| svg + "kuva-clip-0" + part.trim_start_matches(|c: char| c.is_ascii_digit())))
}

fn path(figure: &Figure) -> String {
    format!("docs/images/{}.svg", figure.name)
}

pub fn write() -> Result<()> {
    fs::create_dir_all("docs/images")?;
    for figure in FIGURES {
        fs::write(path(figure), picture(figure)?).with_context(|| path(figure))?;
        println!("wrote {}", path(figure));
    }
    Ok(())
}

/// Whether the pictures are those that today's code draws.
pub fn is_current() -> Result<()> {
    for figure in FIGURES {
        let path = path(figure);
        let drawn = fs::read_to_string(&path).with_context(|| path.clone())?;
        ensure!(drawn == picture(figure)?, "{path} is not current: run cargo xtask figure");
    }
    Ok(())
}
