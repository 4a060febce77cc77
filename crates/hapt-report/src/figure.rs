//! What is drawn, before it is drawn: panels with axes, curves, bands and marks.

use crate::extremes::Point;
use crate::map::Map;

/// One figure: panels that belong together, with what they show in words.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The caption, without a full stop.
    pub title: String,
    /// What is seen, for who cannot see it.
    pub alt: String,
    /// Side by side where there is room, else below each other.
    pub panels: Vec<Panel>,
    /// Panels beside each other in the wide drawing; the narrow one has one column.
    pub columns: usize,
}

/// A pair of axes and what stands in them.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Said above it, before its vertical axis; may be empty.
    pub title: String,
    /// Horizontal.
    pub x: Axis,
    /// Vertical.
    pub y: Axis,
    /// A plane of values, over the whole frame, behind everything.
    pub map: Option<Map>,
    /// Parts of the plane, drawn first to last, behind all curves.
    pub regions: Vec<Region>,
    /// Drawn first to last.
    pub series: Vec<Series>,
    /// Behind the curves.
    pub bands: Option<Bands>,
    /// Single points.
    pub marks: Vec<Mark>,
    /// One unit is as long on both axes.
    pub round: bool,
}

/// An axis; its limits are where the panel ends.
#[derive(Clone, Debug)]
pub struct Axis {
    /// "time"
    pub name: String,
    /// "s"; empty for a plain number.
    pub unit: String,
    /// Where it begins, in its unit.
    pub low: f64,
    /// Where it ends.
    pub high: f64,
    /// By powers of ten.
    pub logarithmic: bool,
}

/// How a curve is drawn: colours that every eye tells apart, and for what is no signal a dash as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// The n-th signal.
    Signal(usize),
    /// A signal that another one mostly covers: broad, and drawn first.
    Beneath,
    /// A bound that the device sets, dashed.
    Limit,
    /// What theory says, dotted.
    Predicted,
    /// A line to compare with, such as the unit circle.
    Guide,
    /// The n-th edge between regions, seen on every colour.
    Edge(usize),
}

/// What holds in a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// All that was asked.
    Good,
    /// Some of it.
    Fair,
    /// The least of it not.
    Bad,
}

/// A part of the plane that is filled: the even-odd sum of its polygons.
#[derive(Clone, Debug)]
pub struct Region {
    /// In the legend; empty: not there.
    pub name: String,
    /// Its colour.
    pub fill: Fill,
    /// In the axes' units.
    pub polygons: Vec<Vec<Point>>,
}

/// A curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// In the legend; empty: not there.
    pub name: String,
    /// Its look.
    pub style: Style,
    /// In the axes' units.
    pub points: Vec<Point>,
}

/// Stretches of the horizontal axis that are marked.
#[derive(Clone, Debug)]
pub struct Bands {
    /// In the legend.
    pub name: String,
    /// From and to.
    pub list: Vec<(f64, f64)>,
}

/// The look of a single point.
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
    /// In the legend; empty: not there.
    pub name: String,
    /// Its look.
    pub shape: Shape,
    /// Its colour.
    pub style: Style,
    /// Where; all of one name.
    pub points: Vec<Point>,
}

impl Axis {
    /// Around these values, with a little room.
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
        // What varies by rounding alone is drawn flat.
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

    /// From `low` to `high` exactly.
    pub fn from_to(name: &str, unit: &str, low: f64, high: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Axis { name: name.into(), unit: unit.into(), low, high, logarithmic: false }
    }

    /// By powers of ten; both ends above 0.
    pub fn logarithmic(name: &str, unit: &str, low: f64, high: f64) -> Self {
        Axis { logarithmic: true, ..Axis::from_to(name, unit, low, high) }
    }

    /// "time (s)"
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    /// Where a value stands: 0 at the low end, 1 at the high one.
    pub fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

impl Panel {
    /// Empty, with these axes.
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

    /// With a curve more.
    pub fn curve(&mut self, name: &str, style: Style, points: Vec<Point>) {
        self.series.push(Series { name: name.into(), style, points });
    }

    /// With a region more.
    pub fn region(&mut self, name: &str, fill: Fill, polygons: Vec<Vec<Point>>) {
        self.regions.push(Region { name: name.into(), fill, polygons });
    }

    /// With marks of one name more.
    pub fn mark(&mut self, name: &str, shape: Shape, style: Style, points: Vec<Point>) {
        self.marks.push(Mark { name: name.into(), shape, style, points });
    }
}
