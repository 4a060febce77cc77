//! A figure as SVG.
//!
//! Pages have dark colours and have to be readable on a phone, which plotting libraries do not support. Colours are therefore classes,
//! which one style sheet ([`STYLE`]) sets for light, dark and paper, and a figure is laid out for each width instead of being scaled.

use std::borrow::Cow;
use std::fmt::Write as _;

use crate::extremes::Point;
use crate::figure::{Axis, Figure, Fill, Panel, Shape, Style};
use crate::style::{HEAVY, STYLE, THIN};
use crate::ticks;

/// The width of a figure's layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Width {
    /// A desktop screen.
    Wide,
    /// A phone.
    Narrow,
    /// A column of a paper, which prints the caption: thin lines, and no title.
    Paper(Paper),
    /// A slide: heavy lines, 16:9.
    Slide(Paper),
}

/// The size of a figure in a paper or on a slide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paper {
    mm: f64,
    points: f64,
}

impl Paper {
    /// Millimetres in a point of text, the 72nd part of an inch.
    const POINT: f64 = 25.4 / 72.0;
    /// The narrowest layout, in its own pixels: axes with their numbers, and a legend of one column.
    const MIN_WIDTH_PX: f64 = 240.0;

    /// A width in mm, and the size of the text in points.
    ///
    /// # Errors
    /// In a sentence: text outside of 4 to 24 points, a width above 300 mm, or a width too small for this text.
    pub fn new(mm: f64, points: f64) -> Result<Self, String> {
        if !(4.0..=24.0).contains(&points) {
            return Err(format!("text of {points} points; expected 4 to 24"));
        }
        let paper = Paper { mm, points };
        let least = Paper::MIN_WIDTH_PX * paper.mm_per_pixel();
        if !(least..=300.0).contains(&mm) {
            return Err(format!(
                "a width of {} mm; with text of {points} points, expected {} to 300 mm",
                ticks::number(mm, 3),
                least.ceil()
            ));
        }
        Ok(paper)
    }

    fn mm_per_pixel(self) -> f64 {
        self.points * Paper::POINT / FONT
    }
}

/// The size of the text in the layout's pixels; [`STYLE`] has it too.
const FONT: f64 = 12.0;
/// A narrower drawing has its panels below each other.
const ONE_COLUMN: f64 = 500.0;

const COLOURS: usize = 7;
/// Above a panel's frame: a line of text, and below it: ticks and the axis's name.
const LINE: f64 = 17.0;
const BELOW: f64 = 40.0;
const RIGHT: f64 = 12.0;
/// The gaps between panels of a row, and below a row.
const PANEL_GAP: f64 = 14.0;
const GAP: f64 = 8.0;
/// Above and left of everything, and the line of a file's title.
const EDGE: f64 = 4.0;
const TITLE: f64 = 24.0;
/// The lowest frame on a slide, which is taller than 16:9 for it.
const LOWEST: f64 = 60.0;

impl Width {
    fn pixels(self) -> f64 {
        match self {
            Width::Wide => 760.0,
            Width::Narrow => 344.0,
            Width::Paper(paper) | Width::Slide(paper) => paper.mm / paper.mm_per_pixel(),
        }
    }

    /// The width and height attributes of an SVG of this size in pixels.
    fn size(self, w: f64, h: f64) -> String {
        match self {
            Width::Wide | Width::Narrow => format!("width=\"{w}\" height=\"{h}\""),
            Width::Paper(paper) | Width::Slide(paper) => {
                let scale = paper.mm / w;
                format!("width=\"{}mm\" height=\"{:.2}mm\"", (1e3 * paper.mm).round() / 1e3, scale * h)
            }
        }
    }

    /// The line widths, where they are not those of [`STYLE`].
    fn weights(self) -> &'static str {
        match self {
            Width::Wide | Width::Narrow => "",
            Width::Paper(_) => THIN,
            Width::Slide(_) => HEAVY,
        }
    }

    /// The number of intervals of a reduced curve for this width.
    pub fn stretches(self) -> usize {
        match self {
            Width::Wide | Width::Paper(_) | Width::Slide(_) => 400,
            Width::Narrow => 160,
        }
    }
}

/// Escapes text for content and for attributes.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An upper estimate of a text's width at 12 px, for the fonts of [`STYLE`].
pub(crate) fn text_width(text: &str) -> f64 {
    7.6 * text.chars().count() as f64
}

/// The opening of an SVG, with its alternative text.
pub(crate) fn open(on: Width, width: f64, height: f64, title: &str, alt: &str, own_file: bool) -> String {
    let (w, h) = (width.ceil(), height.ceil());
    // Scaled down further the text would be unreadable; pages scroll instead.
    let least = match on {
        Width::Wide | Width::Narrow => format!(" style=\"min-width:{:.0}px\"", 0.74 * w),
        Width::Paper(_) | Width::Slide(_) => String::new(),
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"hapt\"{least} viewBox=\"0 0 {w} {h}\" {} role=\"img\" aria-label=\"{}\">",
        on.size(w, h),
        escaped(alt)
    );
    if own_file {
        let _ = write!(
            svg,
            "<title>{}</title><desc>{}</desc><style>{STYLE}{}</style>",
            escaped(title),
            escaped(alt),
            on.weights()
        );
        svg += "<rect class=\"paper\" width=\"100%\" height=\"100%\"/>";
    }
    svg
}

/// A text; `class` and `anchor` as in SVG.
pub(crate) fn text(svg: &mut String, x: f64, y: f64, anchor: &str, class: &str, content: &str) {
    let anchor = if anchor == "start" { String::new() } else { format!(" text-anchor=\"{anchor}\"") };
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\"{anchor}{class}>{}</text>", escaped(content));
}

impl Figure {
    /// The figure as SVG: for a separate file, with its styles, or for a page that includes them.
    pub fn svg(&self, width: Width, own_file: bool) -> String {
        let has_title = own_file && !matches!(width, Width::Paper(_));
        let top = EDGE + if has_title { TITLE } else { 0.0 };
        let (columns, layouts) = match width {
            Width::Slide(_) => self.slide(width.pixels(), top),
            Width::Wide | Width::Narrow | Width::Paper(_) => {
                let columns = if width.pixels() < ONE_COLUMN { 1 } else { self.columns.max(1) };
                (columns, self.layouts(width.pixels(), columns))
            }
        };
        let mut body = String::new();
        let mut y = top;
        for row in layouts.chunks(columns) {
            let above = row.iter().map(|layout| layout.above).fold(0.0, f64::max);
            let tall = row.iter().map(|layout| layout.height).fold(0.0, f64::max);
            let mut x = 0.0;
            for layout in row {
                layout.draw(&mut body, x, y, y + above);
                x += layout.total + PANEL_GAP;
            }
            y += above + tall + BELOW + GAP;
        }
        let mut svg = open(width, width.pixels(), y, &self.title, &self.alt, own_file);
        if has_title {
            text(&mut svg, 2.0, 18.0, "start", "bold", &self.title);
        }
        svg += &body;
        svg += "</svg>";
        svg
    }

    /// The panels in this number of columns.
    fn layouts(&self, width: f64, columns: usize) -> Vec<Layout<'_>> {
        let each = (width + PANEL_GAP) / columns as f64 - PANEL_GAP;
        // Frames below each other are aligned, so that their times coincide.
        let left = self.panels.iter().map(|panel| Layout::new(panel, each, columns, 0.0).left).fold(0.0, f64::max);
        self.panels.iter().map(|panel| Layout::new(panel, each, columns, left)).collect()
    }

    /// The panels in a height of 9/16 of the width, from `top` on: in as many columns as leave the frames most room.
    fn slide(&self, width: f64, top: f64) -> (usize, Vec<Layout<'_>>) {
        let fitted = |columns: usize| {
            let mut layouts = self.layouts(width, columns);
            let rows = layouts.len().div_ceil(columns);
            let above = |row: &[Layout<'_>]| row.iter().map(|layout| layout.above).fold(0.0, f64::max);
            let taken: f64 = layouts.chunks(columns).map(|row| above(row) + BELOW + GAP).sum();
            let height = (width * 9.0 / 16.0 - top - taken) / rows as f64;
            for layout in &mut layouts {
                layout.height = height.max(LOWEST);
                if layout.panel.round {
                    layout.width = layout.width.min(layout.height);
                    layout.height = layout.width;
                }
            }
            let room = layouts.iter().map(|layout| layout.height.min(0.6 * layout.width)).fold(f64::INFINITY, f64::min);
            (room.min(height), columns, layouts)
        };
        // Of equal ones the first: fewer columns are wider.
        let best =
            (1..=self.panels.len().max(1)).map(fitted).reduce(|best, next| if next.0 > best.0 { next } else { best });
        best.map_or((1, Vec::new()), |(_, columns, layouts)| (columns, layouts))
    }
}

/// A panel with the sizes of its parts, in pixels.
struct Layout<'a> {
    panel: &'a Panel,
    /// The sizes of the panel and of its frame.
    total: f64,
    left: f64,
    width: f64,
    height: f64,
    /// Title, vertical axis's name and legend, above the frame.
    above: f64,
    legend: Vec<Entry<'a>>,
    x_ticks: Vec<f64>,
    y_ticks: Vec<f64>,
}

/// A legend's entry, its place relative to the panel's top left.
struct Entry<'a> {
    name: Cow<'a, str>,
    symbol: LegendSymbol,
    x: f64,
    line: usize,
}

#[derive(Clone)]
enum LegendSymbol {
    /// A map's or a region's colour, by its class.
    Cell(String),
    Line(Style),
    Mark(Shape, Style),
    Band,
}

impl<'a> Layout<'a> {
    /// `least` is the room for the vertical ticks' labels that other panels need.
    fn new(panel: &'a Panel, total: f64, columns: usize, least: f64) -> Self {
        let ticks = |axis: &Axis, wanted: usize| match axis.logarithmic {
            true => ticks::logarithmic(axis.low, axis.high, wanted),
            false => ticks::linear(axis.low, axis.high, wanted),
        };
        let y_ticks = ticks(&panel.y, 5);
        let widest = tick_labels(&panel.y, &y_ticks).iter().map(|l| text_width(l)).fold(0.0, f64::max);
        let left = (widest + 10.0).max(least).clamp(34.0, 0.4 * total);
        let width = total - left - RIGHT;
        let height = match (panel.round, columns) {
            (true, _) => width,
            (false, _) if panel.map.is_some() || !panel.regions.is_empty() => (0.55 * total).clamp(240.0, 420.0),
            (false, 1) => (0.27 * total).clamp(170.0, 220.0),
            (false, _) => (0.62 * width).clamp(170.0, 330.0),
        };
        let mut x_ticks = ticks(&panel.x, (width / 80.0).clamp(2.0, 10.0) as usize);
        // Labels that would touch are omitted.
        let need = tick_labels(&panel.x, &x_ticks).iter().map(|l| text_width(l) + 8.0).fold(0.0, f64::max);
        while x_ticks.len() > 2 && need * x_ticks.len() as f64 > 1.15 * width {
            x_ticks = x_ticks.into_iter().step_by(2).collect();
        }
        let (legend, lines) = legend(panel, total);
        let titles = if panel.title.is_empty() { 1.0 } else { 2.0 };
        Layout {
            panel,
            total,
            left,
            width,
            height,
            above: (titles + lines as f64) * LINE + 6.0,
            legend,
            x_ticks,
            y_ticks,
        }
    }

    /// Draws it with its texts at `start` and its frame at `top`.
    fn draw(&self, svg: &mut String, x0: f64, start: f64, top: f64) {
        let Layout { panel, left, width, height, .. } = self;
        let (left, right, bottom) = (x0 + left, x0 + left + width, top + height);
        let x = |value: f64| left + (panel.x.place(value) * width).clamp(-1e4, 1e4);
        let y = |value: f64| bottom - (panel.y.place(value) * height).clamp(-1e4, 1e4);

        let mut line = start + LINE - 4.0;
        if !panel.title.is_empty() {
            text(svg, x0 + 2.0, line, "start", "bold", &panel.title);
            line += LINE;
        }
        text(svg, x0 + 2.0, line, "start", if panel.title.is_empty() { "bold" } else { "soft" }, &panel.y.label());
        for entry in &self.legend {
            entry.draw(svg, x0, line + entry.line as f64 * LINE);
        }

        let mut grid = String::new();
        for &tick in &self.x_ticks {
            let _ = write!(grid, "M{:.1} {top:.1}V{bottom:.1}", x(tick));
        }
        for &tick in &self.y_ticks {
            let _ = write!(grid, "M{left:.1} {:.1}H{right:.1}", y(tick));
        }
        let _ = write!(svg, "<path class=\"grid\" d=\"{grid}\"/>");
        if !panel.y.logarithmic && panel.y.low < 0.0 && panel.y.high > 0.0 {
            let _ = write!(svg, "<path class=\"zero\" d=\"M{left:.1} {:.1}H{right:.1}\"/>", y(0.0));
        }
        for (tick, label) in self.x_ticks.iter().zip(tick_labels(&panel.x, &self.x_ticks)) {
            // Clamped to the panel.
            let half = 0.5 * text_width(&label);
            let at = x(*tick).min(x0 + self.total - half).max(x0 + half);
            text(svg, at, bottom + 15.0, "middle", "soft", &label);
        }
        for (tick, label) in self.y_ticks.iter().zip(tick_labels(&panel.y, &self.y_ticks)) {
            text(svg, left - 6.0, y(*tick) + 4.0, "end", "soft", &label);
        }
        text(svg, right, bottom + 31.0, "end", "soft", &panel.x.label());

        // Clipped at the frame.
        let view = format!("<svg x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\">");
        *svg += &view;
        let to = |(a, b): Point| (x(a) - left, y(b) - top);
        if let Some(map) = &panel.map {
            map.draw(svg, *width, *height);
        }
        if let Some(bands) = &panel.bands {
            let mut d = String::new();
            for &(from, until) in &bands.list {
                let (a, b) = (x(from) - left, x(until) - left);
                let (a, wide) = if b - a < 1.0 { (0.5 * (a + b) - 0.5, 1.0) } else { (a, b - a) };
                let _ = write!(d, "M{a:.1} 0h{wide:.1}v{height:.1}h-{wide:.1}z");
            }
            let _ = write!(svg, "<path class=\"band\" d=\"{d}\"/>");
        }
        for region in &panel.regions {
            let d: String = region.polygons.iter().map(|p| path(p.iter().map(|&point| to(point))) + "z").collect();
            let _ = write!(svg, "<path class=\"cell {}\" fill-rule=\"evenodd\" d=\"{d}\"/>", fill(region.fill));
        }
        for series in &panel.series {
            let d = path(series.points.iter().map(|&point| to(point)));
            if matches!(series.style, Style::Edge(_)) {
                let _ = write!(svg, "<path class=\"halo\" d=\"{d}\"/>");
            }
            let _ = write!(svg, "<path class=\"line {}\" d=\"{d}\"/>", class(series.style));
        }
        for mark in &panel.marks {
            let mut d = String::new();
            for &point in &mark.points {
                let (a, b) = to(point);
                let _ = if mark.shape == Shape::Line {
                    write!(d, "M{a:.1} 0v{height:.1}")
                } else {
                    write!(d, "{}", symbol(mark.shape, a, b))
                };
            }
            if matches!(mark.style, Style::Edge(_)) {
                let _ = write!(svg, "<path class=\"halo\" d=\"{d}\"/>");
            }
            let _ = write!(svg, "<path class=\"mark {}\" d=\"{d}\"/>", class(mark.style));
        }
        *svg += "</svg>";
        let _ = write!(
            svg,
            "<rect class=\"frame\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        );
    }
}

fn tick_labels(axis: &Axis, at: &[f64]) -> Vec<String> {
    match axis.logarithmic {
        true => at.iter().map(|&tick| ticks::number(tick, 3)).collect(),
        false => ticks::labels(at),
    }
}

/// The legend's entries after the vertical axis's name and on as many further lines as they need.
fn legend(panel: &Panel, total: f64) -> (Vec<Entry<'_>>, usize) {
    let cells =
        panel.map.iter().flat_map(|map| map.legend()).map(|(class, name)| (Cow::from(name), LegendSymbol::Cell(class)));
    let regions = panel.regions.iter().filter(|region| !region.polygons.is_empty());
    let cells = cells.chain(regions.map(|r| (Cow::from(&r.name), LegendSymbol::Cell(fill(r.fill).into()))));
    let lines = panel.series.iter().map(|s| (Cow::from(&s.name), LegendSymbol::Line(s.style)));
    let bands =
        panel.bands.iter().filter(|bands| !bands.list.is_empty()).map(|b| (Cow::from(&b.name), LegendSymbol::Band));
    let marks = panel.marks.iter().map(|m| (Cow::from(&m.name), LegendSymbol::Mark(m.shape, m.style)));
    let mut entries: Vec<Entry<'_>> = Vec::new();
    let (mut x, mut line) = (text_width(&panel.y.label()) + 14.0, 0);
    for (name, symbol) in cells.chain(lines).chain(bands).chain(marks) {
        if name.is_empty() || entries.iter().any(|entry| entry.name == name) {
            continue;
        }
        let wide = 22.0 + text_width(&name) + 12.0;
        if x + wide > total + 12.0 && x > 2.0 {
            (x, line) = (2.0, line + 1);
        }
        entries.push(Entry { name, symbol, x, line });
        x += wide;
    }
    (entries, line)
}

impl Entry<'_> {
    fn draw(&self, svg: &mut String, x0: f64, y: f64) {
        let (x, middle) = (x0 + self.x, y - 4.0);
        let _ = match self.symbol {
            LegendSymbol::Cell(ref class) => {
                write!(
                    svg,
                    "<rect class=\"cell {class}\" x=\"{x:.1}\" y=\"{:.1}\" width=\"18\" height=\"11\"/>",
                    middle - 5.5
                )
            }
            LegendSymbol::Line(style @ Style::Edge(_)) => {
                let d = format!("d=\"M{x:.1} {middle:.1}h18\"");
                write!(svg, "<path class=\"halo\" {d}/><path class=\"line {}\" {d}/>", class(style))
            }
            LegendSymbol::Line(style) => {
                write!(svg, "<path class=\"line {}\" d=\"M{x:.1} {middle:.1}h18\"/>", class(style))
            }
            LegendSymbol::Mark(Shape::Line, style) => {
                write!(svg, "<path class=\"mark {}\" d=\"M{:.1} {:.1}v12\"/>", class(style), x + 9.0, middle - 6.0)
            }
            LegendSymbol::Mark(shape, style) => {
                write!(svg, "<path class=\"mark {}\" d=\"{}\"/>", class(style), symbol(shape, x + 9.0, middle))
            }
            LegendSymbol::Band => {
                write!(svg, "<rect class=\"band\" x=\"{x:.1}\" y=\"{:.1}\" width=\"18\" height=\"11\"/>", middle - 5.5)
            }
        };
        text(svg, x + 22.0, y, "start", "", &self.name);
    }
}

fn symbol(shape: Shape, x: f64, y: f64) -> String {
    match shape {
        Shape::Cross => format!("M{:.1} {:.1}l9 9m0 -9l-9 9", x - 4.5, y - 4.5),
        Shape::Ring => format!("M{:.1} {y:.1}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z", x - 5.0),
        Shape::Line => String::new(),
    }
}

pub(crate) fn class(style: Style) -> String {
    match style {
        Style::Signal(n) if n < COLOURS => format!("s{n}"),
        // A repeated colour has another dash.
        Style::Signal(n) => format!("s{} d{}", n % COLOURS, (n / COLOURS).min(3)),
        Style::Beneath => "beneath".into(),
        Style::Limit => "limit".into(),
        Style::Predicted => "predicted".into(),
        Style::Guide => "guide".into(),
        Style::Edge(0) => "edge".into(),
        Style::Edge(n) => format!("edge d{}", n.min(3)),
    }
}

/// The colours of a map of signed values: good, and increasingly bad.
fn fill(fill: Fill) -> &'static str {
    match fill {
        Fill::Good => "n1",
        Fill::Open => "n0",
        Fill::Fair => "p0",
        Fill::Bad => "p2",
    }
}

/// Straight lines between the points, in tenths of a pixel, as steps from each to the next; a point on the way from its
/// neighbour to the next, straight across or straight up, is left out.
fn path(points: impl Iterator<Item = Point>) -> String {
    let mut kept: Vec<(i64, i64)> = Vec::new();
    for (x, y) in points {
        let point = ((10.0 * x).round() as i64, (10.0 * y).round() as i64);
        if kept.last() == Some(&point) {
            continue;
        }
        if let [.., a, b] = kept[..] {
            let between = |a: i64, b: i64, c: i64| (a <= b && b <= c) || (a >= b && b >= c);
            let across = a.1 == b.1 && b.1 == point.1 && between(a.0, b.0, point.0);
            let up = a.0 == b.0 && b.0 == point.0 && between(a.1, b.1, point.1);
            if across || up {
                kept.pop();
            }
        }
        kept.push(point);
    }
    let mut d = String::new();
    let tenth = |n: i64| {
        let text = format!("{}{}", n / 10, if n % 10 == 0 { String::new() } else { format!(".{}", n.abs() % 10) });
        if n < 0 && n > -10 { format!("-{text}") } else { text }
    };
    let mut last: Option<(i64, i64)> = None;
    for point in kept {
        let _ = match last {
            None => write!(d, "M{} {}", tenth(point.0), tenth(point.1)),
            Some(last) => write!(d, "l{} {}", tenth(point.0 - last.0), tenth(point.1 - last.1)),
        };
        last = Some(point);
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_takes_steps_and_omits_points_on_a_line() {
        let points = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, -0.5), (3.25, -0.4)];
        assert_eq!(path(points.into_iter()), "M0 0l2 0l0 -0.5l1.3 0.1");
    }

    #[test]
    fn a_reversal_on_the_same_line_is_kept() {
        let points = [(0.0, 0.0), (0.0, 9.0), (0.0, 1.0)];
        assert_eq!(path(points.into_iter()), "M0 0l0 9l0 -8");
    }

    /// The text of a paper's figure has the requested size for every width.
    #[test]
    fn a_figure_on_paper_has_the_requested_width_and_text_size() {
        for (mm, points) in [(88.0, 7.0), (88.0, 8.0), (180.0, 9.5), (60.0, 5.0)] {
            let width = Width::Paper(Paper::new(mm, points).unwrap());
            let mut panel =
                Panel::new("", Axis::from_to("time", "s", 0.0, 1.0), Axis::from_to("torque", "N mm", -1.0, 1.0));
            panel.curve("applied", Style::Signal(0), vec![(0.0, 0.0), (1.0, 0.5)]);
            let figure = Figure { title: "Of a run".into(), alt: String::new(), panels: vec![panel], columns: 1 };
            let svg = figure.svg(width, true);
            assert!(svg.contains(&format!(" width=\"{mm}mm\"")) && !svg.contains(">Of a run</text>"), "{svg}");
            let pixels: f64 = svg.split("viewBox=\"0 0 ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
            let text = FONT * mm / pixels / Paper::POINT;
            assert!((text / points - 1.0).abs() < 5e-3, "{text} points for {points}");
        }
        for (mm, points) in
            [(20.0, 8.0), (88.0, 3.0), (88.0, 24.5), (301.0, 8.0), (1e300, 8.0), (f64::NAN, 8.0), (88.0, f64::NAN)]
        {
            let error = Paper::new(mm, points).unwrap_err();
            assert!(error.contains("expected") && error.len() < 120, "{error}");
        }
    }

    #[test]
    fn a_name_cannot_break_out_of_the_drawing() {
        let mut svg = String::new();
        text(&mut svg, 0.0, 0.0, "start", "", "<script>&\"");
        assert_eq!(svg, "<text x=\"0.0\" y=\"0.0\">&lt;script&gt;&amp;&quot;</text>");
    }
}
