//! The content of a figure: panels with axes, curves, bands and marks.

use crate::extremes::Point;
use crate::map::Map;

/// A figure: panels, with a caption and an alternative text.
///
/// ```
/// use hapt_report::Width;
/// use hapt_report::figure::{Axis, Figure, Panel, Style};
///
/// let mut panel = Panel::new("", Axis::from_to("time", "s", 0.0, 1.0), Axis::from_to("torque", "N m", -1.0, 1.0));
/// panel.curve("puck", Style::Signal(0), vec![(0.0, 0.0), (1.0, 0.5)]);
/// let figure = Figure { title: "A ramp".into(), alt: "The torque rises.".into(), panels: vec![panel], columns: 1 };
/// let svg = figure.svg(Width::Wide, true);
/// assert!(svg.starts_with("<svg") && svg.contains("torque (N·m)"));
/// ```
#[derive(Clone, Debug)]
pub struct Figure {
    /// The caption, without a full stop.
    pub title: String,
    /// The alternative text.
    pub alt: String,
    /// The panels: in a row where there is room, else below each other.
    pub panels: Vec<Panel>,
    /// The number of panels in a row of the wide drawing; the narrow one has one column.
    pub columns: usize,
}

/// A pair of axes and their content.
#[derive(Clone, Debug)]
pub struct Panel {
    /// The title above it; may be empty.
    pub title: String,
    /// Horizontal.
    pub x: Axis,
    /// Vertical.
    pub y: Axis,
    /// A plane of values, over the whole frame, behind everything.
    pub map: Option<Map>,
    /// Parts of the plane, drawn first to last, behind all curves.
    pub regions: Vec<Region>,
    /// The curves, drawn first to last.
    pub series: Vec<Series>,
    /// Behind the curves.
    pub bands: Option<Bands>,
    /// Single points.
    pub marks: Vec<Mark>,
    /// Whether a unit has the same length on both axes.
    pub round: bool,
}

/// An axis; its limits are where the panel ends.
#[derive(Clone, Debug)]
pub struct Axis {
    /// "time"
    pub name: String,
    /// "s"; empty for a plain number.
    pub unit: String,
    /// Its start, in its unit.
    pub low: f64,
    /// Its end.
    pub high: f64,
    /// Whether it is logarithmic.
    pub logarithmic: bool,
}

/// The style of a curve: colours that are safe for colour blindness, and a dash for curves that are no signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// The n-th signal.
    Signal(usize),
    /// A signal that another one mostly covers: broad, and drawn first.
    Beneath,
    /// A bound of the device, dashed.
    Limit,
    /// A prediction of theory, dotted.
    Predicted,
    /// A line to compare with, such as the unit circle.
    Guide,
    /// The n-th edge between regions, visible on every colour.
    Edge(usize),
}

/// The claims that hold in a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// All claims hold.
    Good,
    /// No claim is refuted, and not all of them are proved.
    Open,
    /// Some claims hold.
    Fair,
    /// Not even the weakest claim holds.
    Bad,
}

/// A part of the plane that is filled: the even-odd sum of its polygons.
#[derive(Clone, Debug)]
pub struct Region {
    /// The name in the legend; empty: none.
    pub name: String,
    /// Its colour.
    pub fill: Fill,
    /// The points, in the axes' units.
    pub polygons: Vec<Vec<Point>>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// The name in the legend; empty: none.
    pub name: String,
    /// Its style.
    pub style: Style,
    /// The points, in the axes' units.
    pub points: Vec<Point>,
}

/// Marked intervals of the horizontal axis.
#[derive(Clone, Debug)]
pub struct Bands {
    /// The name in the legend.
    pub name: String,
    /// The intervals, from and to.
    pub list: Vec<(f64, f64)>,
}

/// The shape of a single point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A cross.
    Cross,
    /// A ring.
    Ring,
    /// A vertical line through the panel.
    Line,
}

/// A single point, or place on the horizontal axis.
#[derive(Clone, Debug)]
pub struct Mark {
    /// The name in the legend; empty: none.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Its colour.
    pub style: Style,
    /// The places of all marks of this name.
    pub points: Vec<Point>,
}

impl Axis {
    /// An axis around these values, with a small margin.
    pub fn around(name: &str, unit: &str, values: impl IntoIterator<Item = f64>) -> Self {
        // Beyond this the arithmetic of an axis would overflow.
        let bound = |x: f64| x.clamp(-1e300, 1e300);
        let (low, high) = values
            .into_iter()
            .filter(|x| x.is_finite())
            .map(bound)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let size = low.abs().max(high.abs());
        // Variation that is only rounding is drawn flat.
        let (low, high) = if high - low > 1e-9 * size {
            let room = 0.06 * (high - low);
            (low - room, high + room)
        } else if size > 0.0 {
            (low - 0.5 * size, high + 0.5 * size)
        } else {
            (-1.0, 1.0)
        };
        Axis { name: name.into(), unit: unit.into(), low, high, logarithmic: false }
    }

    /// An axis from `low` to `high` exactly.
    pub fn from_to(name: &str, unit: &str, low: f64, high: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Axis { name: name.into(), unit: unit.into(), low, high, logarithmic: false }
    }

    /// A logarithmic axis; both ends are above 0.
    pub fn logarithmic(name: &str, unit: &str, low: f64, high: f64) -> Self {
        Axis { logarithmic: true, ..Axis::from_to(name, unit, low, high) }
    }

    /// "stiffness (N·mm/°)", with the unit in typographic form.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, written(&self.unit)) }
    }

    /// The position of a value: 0 at the low end, 1 at the high one.
    pub fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// A unit of a world file in typographic form: "N mm/deg^2" as "N·mm/°²".
fn written(unit: &str) -> String {
    let word = |word: &str| match word {
        "deg" => "°".to_string(),
        "um" | "us" => word.replace('u', "µ"),
        "Nm" | "Ncm" | "Nmm" | "mNm" | "mNmm" => word.replace('N', "N·"),
        _ => word.to_string(),
    };
    let mut text = String::new();
    for part in unit.split_inclusive(|c: char| !c.is_alphabetic()) {
        let (name, end) = part.split_at(part.trim_end_matches(|c: char| !c.is_alphabetic()).len());
        text += &(word(name) + end);
    }
    text.replace("^2", "²").replace("^3", "³").replace(' ', "·")
}

impl Panel {
    /// An empty panel with these axes.
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Panel {
            title: title.into(),
            x,
            y,
            map: None,
            regions: Vec::new(),
            series: Vec::new(),
            bands: None,
            marks: Vec::new(),
            round: false,
        }
    }

    /// Adds a curve.
    pub fn curve(&mut self, name: &str, style: Style, points: Vec<Point>) {
        self.series.push(Series { name: name.into(), style, points });
    }

    /// Adds a region.
    pub fn region(&mut self, name: &str, fill: Fill, polygons: Vec<Vec<Point>>) {
        self.regions.push(Region { name: name.into(), fill, polygons });
    }

    /// Adds marks of one name.
    pub fn mark(&mut self, name: &str, shape: Shape, style: Style, points: Vec<Point>) {
        self.marks.push(Mark { name: name.into(), shape, style, points });
    }
}
