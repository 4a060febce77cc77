//! The documents' pictures: drawn from the runs' CSV, one row of [`FIGURES`] each, those of [`DRAWN`], which commands draw, and those of the
//! campaigns of wheels.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use hapt_report::figure::{self, Panel, Style};
use hapt_report::{Extremes, Width};

use crate::programs::{PROFILE, binary, program};

/// One picture: docs/images/NAME.svg.
struct Figure {
    name: &'static str,
    title: &'static str,
    y: Axis,
    /// The stretch of the run that is shown, in s.
    span: (f64, f64),
    curves: &'static [PlottedCurve],
    /// Whether the motor's limit of the course's wheel, [`LIMIT`] to either side, is shown.
    limit: bool,
}

/// The quantity of the vertical axis, and its value per SI unit.
struct Axis {
    name: &'static str,
    unit: &'static str,
    per_si: f64,
}

/// A column of the run of a world: FOLDER/NAME under worlds/, or the NAME.toml of docs/FOLDER.md.
struct PlottedCurve {
    legend: &'static str,
    /// Which of the palette's colours.
    signal: usize,
    world: &'static str,
    scenario: &'static str,
    sets: &'static [&'static str],
    column: &'static str,
}

const BLUE: usize = 0;
const RED: usize = 1;
const GREEN: usize = 2;
/// Of the course's motor, N·mm.
const LIMIT: f64 = 822.25;

const TORQUE: Axis = Axis { name: "torque asked of the motor", unit: "N·mm", per_si: 1e3 };
const ANGLE: Axis = Axis { name: "angle", unit: "deg", per_si: 180.0 / std::f64::consts::PI };
const WHEEL_ANGLE: Axis = Axis { name: "virtual wheel", ..ANGLE };

const fn curve(legend: &'static str, signal: usize, world: &'static str, column: &'static str) -> PlottedCurve {
    PlottedCurve { legend, signal, world, scenario: "step", sets: &[], column }
}

const FIGURES: &[Figure] = &[
    Figure {
        name: "step",
        title: "A step of 45°, held",
        y: ANGLE,
        span: (0.0, 3.0),
        curves: &[
            curve("haptic wheel", GREEN, "notes/wheel", "puck_rad"),
            curve("virtual wheel", BLUE, "notes/wheel", "wheel_rad"),
        ],
        limit: false,
    },
    Figure {
        name: "growth",
        title: "The notes' virtual wheel: a step of 45°, held",
        y: TORQUE,
        span: (0.0, 10.0),
        curves: &[
            curve("forward Euler", RED, "notes/euler", "torque_Nm"),
            curve("forward Euler, b = Tk", BLUE, "notes/damped", "torque_Nm"),
        ],
        limit: true,
    },
    Figure {
        name: "damped",
        title: "The same step after eight seconds",
        y: WHEEL_ANGLE,
        span: (8.0, 10.0),
        curves: &[
            curve("forward Euler", RED, "notes/euler", "wheel_rad"),
            curve("forward Euler, b = Tk", BLUE, "notes/damped", "wheel_rad"),
        ],
        limit: false,
    },
    Figure {
        name: "released",
        title: "Stepped to 45°, released after a quarter of a second",
        y: ANGLE,
        span: (0.0, 1.5),
        curves: &[
            PlottedCurve { scenario: "release", ..curve("haptic wheel", RED, "notes/released", "puck_rad") },
            PlottedCurve { scenario: "release", ..curve("virtual wheel", BLUE, "notes/released", "wheel_rad") },
        ],
        limit: false,
    },
    Figure {
        name: "hold",
        title: "Let go after a quarter of a second, exact hold at 1 ms",
        y: TORQUE,
        span: (0.0, 3.0),
        curves: &[
            PlottedCurve {
                sets: &["device.damping=0", RELEASE],
                ..curve("no device damping", RED, "notes/wheel", "torque_Nm")
            },
            PlottedCurve { sets: &[RELEASE], ..curve("the course's damping", BLUE, "notes/wheel", "torque_Nm") },
        ],
        limit: true,
    },
    Figure {
        name: "resonance",
        title: "Turned by 5° back and forth at 1 Hz, from rest",
        y: ANGLE,
        span: (0.0, 10.0),
        curves: &[
            PlottedCurve { scenario: "excite", ..curve("virtual wheel", BLUE, "notes/resonance", "wheel_rad") },
            PlottedCurve { scenario: "excite", ..curve("haptic wheel", GREEN, "notes/resonance", "puck_rad") },
        ],
        limit: false,
    },
    Figure {
        name: "phase",
        title: "A swinging wheel, turned by 5° at 1 Hz",
        y: WHEEL_ANGLE,
        span: (0.0, 3.0),
        curves: &[
            PlottedCurve { scenario: "pump", ..curve("it lags the hand", RED, "notes/pumped-and-damped", "wheel_rad") },
            PlottedCurve {
                scenario: "damp",
                sets: &["scenarios.damp.duration=3s"],
                ..curve("it leads the hand", GREEN, "notes/pumped-and-damped", "wheel_rad")
            },
        ],
        limit: false,
    },
    Figure {
        name: "late",
        title: "Released at 10°, hands-off",
        y: ANGLE,
        span: (0.0, 4.0),
        curves: &[
            PlottedCurve {
                scenario: "late",
                ..curve("one sample in four 1.5 ms late", RED, "realtime/late", "puck_rad")
            },
            PlottedCurve {
                scenario: "late",
                sets: &["scenarios.late.timing.intervals=[1]"],
                ..curve("even samples", BLUE, "realtime/late", "puck_rad")
            },
        ],
        limit: false,
    },
];
/// Pictures that the command line draws by itself: docs/images/NAME.svg, and the command.
const DRAWN: &[(&str, &[&str])] = &[
    ("impedance", &["impedance", "worlds/notes/default.toml"]),
    ("z-width", &["impedance", "worlds/devices/eth-wall.toml", "--z-width"]),
    (
        "edge-wall",
        &[
            "boundary",
            "worlds/devices/eth-wall.toml",
            "--set=loop.estimator=difference",
            "--vary=couplings.0.damping=0..0.02",
            "--vary=couplings.0.stiffness=0..12",
        ],
    ),
    (
        "edge-euler",
        &[
            "boundary",
            "worlds/notes/damped-to-ground.toml",
            "--vary=couplings.1.damping=0.001..10:log",
            "--vary=loop.period=1 ms..1 s:log",
            "--of=held",
        ],
    ),
];
const RELEASE: &str = "scenarios.step.hand.release=0.25s";

/// Values over time in s.
type Points = Vec<(f64, f64)>;

/// Runs the curve's scenario with the command line and reads back its column within the span.
fn points(curve: &PlottedCurve, figure: &Figure) -> Result<Points> {
    let folder = Path::new("target/figure").join(figure.name);
    let out = folder.join(curve.world);
    let mut world = Path::new("worlds").join(curve.world).with_extension("toml");
    if !world.exists() {
        let text = of_page(curve.world)?;
        world = out.with_extension("toml");
        fs::create_dir_all(&out)?;
        fs::write(&world, text)?;
    }
    let status = binary(PROFILE)
        .arg("sim")
        .arg(&world)
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

/// The world PAGE/NAME that a page shows: the block of docs/PAGE.md that begins with `# NAME.toml`.
fn of_page(world: &str) -> Result<String> {
    let (page, name) = world.split_once('/').context("no folder")?;
    let path = Path::new("docs").join(page).with_extension("md");
    let text = fs::read_to_string(&path).with_context(|| format!("{world}: {}", path.display()))?;
    let block = text.split("```toml\n").find(|block| block.starts_with(&format!("# {name}.toml\n")));
    let block = block.with_context(|| format!("{} shows no {name}.toml", path.display()))?;
    Ok(block.split("```").next().unwrap_or(block).into())
}

/// The picture as an SVG: the page's own colours, dark where the reader's screen is.
fn picture(figure: &Figure) -> Result<String> {
    let reduced = |points: Points| {
        let mut extremes = Extremes::new(Width::Wide.stretches());
        points.into_iter().for_each(|(t, y)| extremes.add(t, y));
        extremes.points(Width::Wide.stretches())
    };
    let (from, to) = figure.span;
    let limits = if figure.limit { vec![-LIMIT, LIMIT] } else { Vec::new() };
    let mut curves = Vec::new();
    for curve in figure.curves {
        curves.push((curve, reduced(points(curve, figure)?)));
    }
    let values = curves.iter().flat_map(|(_, points)| points.iter().map(|(_, y)| *y)).chain(limits.iter().copied());
    let y = figure::Axis::around(figure.y.name, figure.y.unit, values);
    let mut panel = Panel::new("", figure::Axis::from_to("time", "s", from, to), y);
    let mut seen = Vec::new();
    for (curve, points) in curves {
        let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.1), h.max(p.1)));
        seen.push(format!("{} from {low:.0} to {high:.0} {}", curve.legend, figure.y.unit));
        panel.curve(curve.legend, Style::Signal(curve.signal), points);
    }
    for side in limits {
        panel.curve("motor's limit", Style::Limit, vec![(from, side), (to, side)]);
    }
    let alt = format!("{} over {from} to {to} s: {}.", figure.y.name, seen.join(", "));
    let drawn = figure::Figure { title: figure.title.into(), alt, panels: vec![panel], columns: 1 };
    Ok(drawn.svg(Width::Wide, true) + "\n")
}

/// The picture that a command of [`DRAWN`] draws.
fn drawn(name: &str, command: &[&str]) -> Result<String> {
    let plot = Path::new("target/figure").join(format!("{name}.svg"));
    fs::create_dir_all("target/figure")?;
    let status = binary(PROFILE).args(command).arg("--plot").arg(&plot).output()?;
    ensure!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    Ok(fs::read_to_string(plot)?)
}

/// Every picture, each with its path.
fn pictures() -> impl Iterator<Item = (String, Result<String>)> {
    let path = |name: &str| format!("docs/images/{name}.svg");
    let of_runs = FIGURES.iter().map(move |figure| (path(figure.name), picture(figure)));
    let by_commands = DRAWN.iter().map(move |(name, command)| (path(name), drawn(name, command)));
    let of_wheels = [("hands-off", crate::wheel::picture as fn() -> _), ("games", crate::wheel_games::picture)];
    of_runs.chain(by_commands).chain(of_wheels.into_iter().map(move |(name, draw)| (path(name), draw())))
}

pub fn write() -> Result<()> {
    program("hapt")?;
    fs::create_dir_all("docs/images")?;
    for (path, picture) in pictures() {
        fs::write(&path, picture?).with_context(|| path.clone())?;
        println!("wrote {path}");
    }
    Ok(())
}

/// Whether the pictures are those that today's code draws.
pub fn is_current() -> Result<()> {
    for (path, picture) in pictures() {
        let drawn = fs::read_to_string(&path).with_context(|| path.clone())?;
        ensure!(drawn == picture?, "{path} is not current: run cargo xtask figure");
    }
    Ok(())
}
