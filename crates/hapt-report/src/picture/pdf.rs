//! A figure as a page of PDF: paths as paths, text as text in embedded fonts.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Ref, Str, TextStr};
use usvg::tiny_skia_path::{PathSegment, Point, Rect, Transform};
use usvg::{FillRule, LineCap, LineJoin, Opacity, Path, Text};

use super::fonts::Fonts;
use super::{Canvas, Picture, colour, draw, read};

/// Points in one of an SVG's pixels, of which CSS has 96 in an inch.
const POINTS: f32 = 0.75;

/// A separate drawing ([`crate::figure::Figure::svg`]) as PDF, in the colours of paper, in the drawing's size. The file has the title and
/// no time: the same figure gives the same bytes.
///
/// # Errors
/// SVG that usvg refuses, which would be a defect.
pub fn pdf(svg: &str, title: &str) -> Result<Picture, String> {
    let (tree, mut missing) = read(svg)?;
    let (width, height) = (POINTS * tree.size().width(), POINTS * tree.size().height());
    let mut page =
        Page { content: Content::new(), clip: None, opacities: Vec::new(), fonts: Fonts::new(tree.fontdb()) };
    // Upwards from the lower edge.
    draw(tree.root(), Transform::from_row(POINTS, 0.0, 0.0, -POINTS, 0.0, height), None, &mut page);
    page.clip(None);
    let Page { content, opacities, fonts, .. } = page;

    let mut numbers = (1..).map(Ref::new);
    let [catalog, pages, sheet, stream, info] = std::array::from_fn(|_| next(&mut numbers));
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([sheet]).count(1);
    pdf.document_info(info).title(TextStr(title)).creator(TextStr("hapt"));
    let in_file = fonts.write(&mut pdf, &mut numbers, &mut missing);
    let mut page = pdf.page(sheet);
    page.parent(pages).media_box(pdf_writer::Rect::new(0.0, 0.0, width, height)).contents(stream);
    let mut resources = page.resources();
    let mut named = resources.fonts();
    for (name, font) in &in_file {
        named.pair(Name(name.as_bytes()), *font);
    }
    named.finish();
    let mut states = resources.ext_g_states();
    for opacity in &opacities {
        let part = f32::from(*opacity) / 255.0;
        let mut state =
            states.insert(Name(state_name(*opacity).as_bytes())).start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        state.non_stroking_alpha(part).stroking_alpha(part);
    }
    states.finish();
    resources.finish();
    page.finish();
    pdf.stream(stream, &deflated(&content.finish())).filter(Filter::FlateDecode);
    Ok(Picture { bytes: pdf.finish(), missing })
}

/// The next object's number.
pub(super) fn next(numbers: &mut impl Iterator<Item = Ref>) -> Ref {
    numbers.next().expect("numbers without an end")
}

pub(super) fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to a vector does not fail.
    encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default()
}

/// A number in thousandths of a point.
fn short(x: f32) -> f32 {
    (1e3 * x).round() / 1e3
}

fn state_name(opacity: u8) -> String {
    format!("A{opacity}")
}

struct Page<'a> {
    content: Content,
    /// The present clip.
    clip: Option<Rect>,
    /// The opacities below 1, in 255ths.
    opacities: Vec<u8>,
    fonts: Fonts<'a>,
}

impl Page<'_> {
    /// Sets the rectangle to which drawing is clipped.
    fn clip(&mut self, clip: Option<Rect>) {
        if self.clip == clip {
            return;
        }
        if self.clip.is_some() {
            self.content.restore_state();
        }
        if let Some(rect) = clip {
            let [x, y, width, height] = [rect.x(), rect.y(), rect.width(), rect.height()].map(short);
            self.content.save_state().rect(x, y, width, height).clip_nonzero().end_path();
        }
        self.clip = clip;
    }

    /// Draws with an opacity.
    fn through(&mut self, opacity: Opacity, draw: impl FnOnce(&mut Content)) {
        let opacity = opacity.to_u8();
        if opacity == 255 {
            return draw(&mut self.content);
        }
        if !self.opacities.contains(&opacity) {
            self.opacities.push(opacity);
        }
        self.content.save_state().set_parameters(Name(state_name(opacity).as_bytes()));
        draw(&mut self.content);
        self.content.restore_state();
    }
}

impl Canvas for Page<'_> {
    fn path(&mut self, path: &Path, to: Transform, clip: Option<Rect>) {
        self.clip(clip);
        let bounds = path.data().bounds();
        // A straight line has nothing to fill.
        if let Some(fill) = path.fill().filter(|_| bounds.width() > 0.0 && bounds.height() > 0.0) {
            self.through(fill.opacity(), |content| {
                let [r, g, b] = rgb(fill.paint());
                content.set_fill_rgb(r, g, b);
                outline(content, path.data(), to);
                match fill.rule() {
                    FillRule::NonZero => content.fill_nonzero(),
                    FillRule::EvenOdd => content.fill_even_odd(),
                };
            });
        }
        if let Some(stroke) = path.stroke() {
            self.through(stroke.opacity(), |content| {
                let ([r, g, b], scale) = (rgb(stroke.paint()), scale(to));
                content.set_stroke_rgb(r, g, b).set_line_width(short(scale * stroke.width().get()));
                content.set_line_cap(match stroke.linecap() {
                    LineCap::Butt => LineCapStyle::ButtCap,
                    LineCap::Round => LineCapStyle::RoundCap,
                    LineCap::Square => LineCapStyle::ProjectingSquareCap,
                });
                content.set_line_join(match stroke.linejoin() {
                    LineJoin::Miter | LineJoin::MiterClip => LineJoinStyle::MiterJoin,
                    LineJoin::Round => LineJoinStyle::RoundJoin,
                    LineJoin::Bevel => LineJoinStyle::BevelJoin,
                });
                content.set_miter_limit(stroke.miterlimit().get());
                let dashes = stroke.dasharray().unwrap_or_default();
                content.set_dash_pattern(
                    dashes.iter().map(|dash| short(scale * dash)),
                    short(scale * stroke.dashoffset()),
                );
                outline(content, path.data(), to);
                content.stroke();
            });
        }
    }

    fn text(&mut self, text: &Text, to: Transform, clip: Option<Rect>) {
        self.clip(clip);
        for span in text.layouted().iter().filter(|span| span.visible) {
            let Some(fill) = &span.fill else { continue };
            let size = scale(to) * span.font_size.get();
            let runs = self.fonts.runs(&span.positioned_glyphs, to, size);
            self.through(fill.opacity(), |content| {
                let [r, g, b] = rgb(fill.paint());
                content.begin_text().set_fill_rgb(r, g, b);
                for run in &runs {
                    content.set_font(Name(run.font.as_bytes()), short(size)).set_text_matrix(run.at);
                    let mut positioned = content.show_positioned();
                    let mut items = positioned.items();
                    for (space, codes) in &run.letters {
                        if *space != 0.0 {
                            items.adjust(*space);
                        }
                        items.show(Str(codes));
                    }
                }
                content.end_text();
            });
        }
    }
}

fn rgb(paint: &usvg::Paint) -> [f32; 3] {
    let colour = colour(paint);
    [colour.red, colour.green, colour.blue].map(|part| short(f32::from(part) / 255.0))
}

/// The factor of lengths under a transform.
fn scale(to: Transform) -> f32 {
    (to.sx * to.sy - to.kx * to.ky).abs().sqrt()
}

/// The current path.
fn outline(content: &mut Content, path: &usvg::tiny_skia_path::Path, to: Transform) {
    let at = |mut point: Point| {
        to.map_point(&mut point);
        (short(point.x), short(point.y))
    };
    let mut from = Point::zero();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(p) => {
                let (x, y) = at(p);
                content.move_to(x, y);
                from = p;
            }
            PathSegment::LineTo(p) => {
                let (x, y) = at(p);
                content.line_to(x, y);
                from = p;
            }
            PathSegment::QuadTo(c, p) => {
                // The same curve of the third degree.
                let third =
                    |end: Point| Point::from_xy(end.x + 2.0 / 3.0 * (c.x - end.x), end.y + 2.0 / 3.0 * (c.y - end.y));
                let [(x1, y1), (x2, y2), (x, y)] = [third(from), third(p), p].map(at);
                content.cubic_to(x1, y1, x2, y2, x, y);
                from = p;
            }
            PathSegment::CubicTo(c1, c2, p) => {
                let [(x1, y1), (x2, y2), (x, y)] = [c1, c2, p].map(at);
                content.cubic_to(x1, y1, x2, y2, x, y);
                from = p;
            }
            PathSegment::Close => {
                content.close_path();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::io::Read as _;

    use flate2::read::ZlibDecoder;

    use super::*;
    use crate::picture::testing::figure;
    use crate::{Paper, Width};

    fn page(title: &str, width: Width) -> Picture {
        let figure = figure(title);
        pdf(&figure.svg(width, true), &figure.title).unwrap()
    }

    /// The packed streams of a file, in its order.
    fn streams(bytes: &[u8]) -> Vec<Vec<u8>> {
        let find = |from: usize, what: &[u8]| {
            bytes[from..].windows(what.len()).position(|part| part == what).map(|at| from + at)
        };
        let (mut at, mut found) = (0, Vec::new());
        while let Some(start) = find(at, b"stream\n").map(|at| at + 7) {
            let end = find(start, b"\nendstream").unwrap();
            let mut stream = Vec::new();
            ZlibDecoder::new(&bytes[start..end]).read_to_end(&mut stream).unwrap();
            found.push(stream);
            at = end + 10;
        }
        found
    }

    /// The bytes of a string in parentheses, and where it ends.
    fn literal(text: &[u8]) -> (Vec<u8>, usize) {
        let (mut bytes, mut at, mut open) = (Vec::new(), 0, 1);
        loop {
            match text[at] {
                b'\\' if text[at + 1].is_ascii_digit() => {
                    let octal = std::str::from_utf8(&text[at + 1..at + 4]).unwrap();
                    bytes.push(u8::from_str_radix(octal, 8).unwrap());
                    at += 3;
                }
                b'\\' => {
                    at += 1;
                    let escapes = [(b'n', b'\n'), (b'r', b'\r'), (b't', b'\t'), (b'b', 8), (b'f', 12)];
                    bytes.push(escapes.iter().find(|(name, _)| *name == text[at]).map_or(text[at], |(_, byte)| *byte));
                }
                b')' if open == 1 => return (bytes, at),
                byte => {
                    open += i32::from(byte == b'(') - i32::from(byte == b')');
                    bytes.push(byte);
                }
            }
            at += 1;
        }
    }

    /// The selectable text of each font, by the file's own maps from codes to characters.
    fn selected(bytes: &[u8]) -> String {
        let streams = streams(bytes);
        let map = |stream: &Vec<u8>| -> Option<HashMap<u16, String>> {
            let text = std::str::from_utf8(stream).ok()?;
            let lines =
                text.split("beginbfchar\n").skip(1).flat_map(|part| part.split("endbfchar").next().unwrap().lines());
            let pairs: HashMap<u16, String> = lines
                .map(|line| {
                    let hex: Vec<&str> = line.split(['<', '>']).collect();
                    let units = |hex: &str| -> Vec<u16> {
                        hex.as_bytes()
                            .chunks(4)
                            .map(|unit| u16::from_str_radix(std::str::from_utf8(unit).unwrap(), 16).unwrap())
                            .collect()
                    };
                    (units(hex[1])[0], String::from_utf16(&units(hex[3])).unwrap())
                })
                .collect();
            (!pairs.is_empty()).then_some(pairs)
        };
        let maps: Vec<_> = streams.iter().filter_map(map).collect();
        let content = streams.iter().find(|stream| stream.windows(3).any(|part| part == b" Tf")).unwrap();
        let (mut text, mut font, mut at) = (String::new(), 0, 0);
        while at < content.len() {
            match &content[at..] {
                [b'/', b'F', number, b' ', ..] => font = usize::from(number - b'0'),
                [b'<', rest @ ..] => {
                    let end = rest.iter().position(|byte| *byte == b'>').unwrap();
                    for code in rest[..end].chunks(4) {
                        let code = u16::from_str_radix(std::str::from_utf8(code).unwrap(), 16).unwrap();
                        text += &maps[font][&code];
                    }
                    at += end;
                }
                [b'(', rest @ ..] => {
                    let (codes, end) = literal(rest);
                    for code in codes.chunks(2) {
                        text += &maps[font][&u16::from_be_bytes([code[0], code[1]])];
                    }
                    at += end;
                }
                [b'E', b'T', ..] => text.push('\n'),
                _ => (),
            }
            at += 1;
        }
        text
    }

    #[test]
    fn a_page_is_as_wide_as_the_figure_and_the_same_bytes_twice() {
        for mm in [88.0, 180.0] {
            let width = Width::Paper(Paper::new(mm, 8.0).unwrap());
            let picture = page("Of a run", width);
            assert!(picture.bytes.starts_with(b"%PDF-") && picture.missing.is_empty());
            let text = String::from_utf8_lossy(&picture.bytes);
            let page = text.split("/MediaBox [").nth(1).unwrap().split(']').next().unwrap();
            let page: Vec<f64> = page.split_whitespace().map(|number| number.parse().unwrap()).collect();
            assert!((page[2] / 72.0 * 25.4 - mm).abs() < 0.01, "{page:?}");
            assert!(!text.contains("Date"));
            assert_eq!(picture, super::tests::page("Of a run", width));
        }
    }

    /// Axis, legend and title are selectable text in embedded fonts.
    #[test]
    fn the_text_of_a_page_is_text_in_embedded_fonts() {
        let picture = page("Σ of the wheel (45°, ½ µs)", Width::Wide);
        let text = selected(&picture.bytes);
        for part in ["time (s)", "torque (N·mm)", "asked for", "Σ of the wheel (45°, ½ µs)", "0.5"] {
            assert!(text.lines().any(|line| line == part), "{part}: {text}");
        }
        let file = String::from_utf8_lossy(&picture.bytes);
        assert_eq!(file.matches("/FontFile2").count(), 2);
        assert!(file.contains("/BaseFont /HAPTAA+DejaVuSans-Bold") && !file.contains("/Type3"));
    }

    /// A letter of another script is in a font of the machine, or it is named.
    #[test]
    fn a_character_that_no_font_has_is_reported() {
        let picture = page("轮 轮", Width::Wide);
        let is_drawn = String::from_utf8_lossy(&picture.bytes).contains("/Type3");
        assert!(is_drawn || picture.missing == "轮", "{}", picture.missing);
        assert_eq!(page("a\u{10fffd}b", Width::Wide).missing, "\u{10fffd}", "of nobody's script");
        let paper = Width::Paper(Paper::new(88.0, 8.0).unwrap());
        assert_eq!(page("\u{10fffd}", paper).missing, "", "a title that is not drawn");
    }
}
