//! A figure as PNG or PDF: its SVG, read by usvg with the program's own fonts, so that it looks the same on every machine.

#[cfg(feature = "pdf")]
mod fonts;
#[cfg(feature = "pdf")]
mod part;
#[cfg(feature = "pdf")]
mod pdf;
#[cfg(feature = "png")]
mod png;
#[cfg(test)]
mod testing;

use std::sync::Arc;

use fontdb::{Database, ID, Source};
use skrifa::{FontRef, MetadataProvider};
use usvg::tiny_skia_path::{Rect, Transform};
use usvg::{Color, Group, Node, Options, Paint, Path, Text, Tree};

use crate::style::STYLE;

#[cfg(feature = "pdf")]
pub use pdf::pdf;
#[cfg(feature = "png")]
pub use png::png;

const FONTS: [&[u8]; 2] =
    [include_bytes!("../../fonts/DejaVuSans.ttf"), include_bytes!("../../fonts/DejaVuSans-Bold.ttf")];
/// The smallest weight of bold letters.
const BOLD: u16 = 600;
/// The characters of the fonts.
const COVERED: [(char, char); 11] = [
    (' ', '~'),
    ('\u{a0}', '\u{17f}'),
    ('\u{370}', '\u{3ff}'),
    ('\u{400}', '\u{45f}'),
    ('\u{2010}', '\u{2027}'),
    ('\u{2030}', '\u{203a}'),
    ('\u{2070}', '\u{209f}'),
    ('\u{20ac}', '\u{20ac}'),
    ('\u{2190}', '\u{2199}'),
    ('\u{2200}', '\u{22ff}'),
    ('\n', '\n'),
];

/// A figure's file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// The file's content.
    pub bytes: Vec<u8>,
    /// The characters that no font has, each once; they are left out.
    pub missing: String,
}

/// Reads a separate drawing ([`crate::figure::Figure::svg`]) in the colours of paper; returns also the characters that no font has.
fn read(svg: &str) -> Result<(Tree, String), String> {
    // No dark colours.
    let paper = STYLE.split("@media").next().unwrap_or_default();
    let svg = svg.replacen(STYLE, paper, 1);
    let mut options = Options { font_family: "DejaVu Sans".into(), ..Options::default() };
    let fonts = options.fontdb_mut();
    let [regular, bold] = FONTS.map(|font| fonts.load_font_source(Source::Binary(Arc::new(font))).first().copied());
    let foreign = foreign(&svg);
    if !foreign.is_empty() {
        // A title in another script uses the machine's fonts, where there are any.
        fonts.load_system_fonts();
    }
    let missing = foreign.chars().filter(|c| !fonts.faces().any(|face| has(fonts, face.id, *c))).collect();
    // Takes precedence over a font of the machine with the same name.
    options.font_resolver.select_font = Box::new(move |font, _| if font.weight() < BOLD { regular } else { bold });
    let tree = Tree::from_str(&svg, &options).map_err(|error| format!("the figure cannot be drawn: {error}"))?;
    Ok((tree, missing))
}

/// Whether the program's fonts have a character.
fn covered(c: char) -> bool {
    COVERED.iter().any(|&(from, to)| (from..=to).contains(&c))
}

/// The characters of a drawing's texts that the program's fonts do not have, each once.
fn foreign(svg: &str) -> String {
    let mut foreign = String::new();
    for text in svg.split("<text ").skip(1).filter_map(|part| part.split_once('>')?.1.split_once("</text>")) {
        for c in text.0.chars().filter(|c| !covered(*c) && !c.is_whitespace() && !c.is_control()) {
            if !foreign.contains(c) {
                foreign.push(c);
            }
        }
    }
    foreign
}

/// Whether a font has a character.
fn has(fonts: &Database, id: ID, c: char) -> bool {
    let mapped =
        |data: &[u8], index| FontRef::from_index(data, index).is_ok_and(|font| font.charmap().map(c).is_some());
    fonts.with_face_data(id, mapped).unwrap_or(false)
}

/// The target of a drawing.
trait Canvas {
    /// A path, by a transform from its own coordinates to the drawing's, within a rectangle of the drawing.
    fn path(&mut self, path: &Path, to: Transform, clip: Option<Rect>);
    /// A text.
    fn text(&mut self, text: &Text, to: Transform, clip: Option<Rect>);
}

/// Draws the parts of a group, first to last. All clips of a figure are rectangles.
fn draw(group: &Group, to: Transform, clip: Option<Rect>, canvas: &mut dyn Canvas) {
    for node in group.children() {
        match node {
            Node::Group(inner) => {
                let to = to.pre_concat(inner.transform());
                let own = inner.clip_path().and_then(|path| {
                    let shape = path.root().bounding_box().to_non_zero_rect()?;
                    shape.to_rect().transform(to.pre_concat(path.transform()))
                });
                let clip = match (clip, own) {
                    (Some(outer), Some(own)) => outer.intersect(&own),
                    (outer, own) => own.or(outer),
                };
                draw(inner, to, clip, canvas);
            }
            Node::Path(path) if path.is_visible() => canvas.path(path, to, clip),
            Node::Text(text) => canvas.text(text, to, clip),
            Node::Path(_) | Node::Image(_) => (),
        }
    }
}

/// The colour of a fill or a stroke. Gradients are those of coloured letters, in their first colour.
fn colour(paint: &Paint) -> Color {
    let stops = match paint {
        Paint::Color(colour) => return *colour,
        Paint::LinearGradient(gradient) => gradient.stops(),
        Paint::RadialGradient(gradient) => gradient.stops(),
        Paint::Pattern(_) => &[],
    };
    stops.first().map_or(Color::black(), usvg::Stop::color)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fonts_have_the_characters_of_the_table() {
        for characters in ["Ω·m ± 20 %, ∞ → ≤", "Ж", "Колесо"] {
            assert!(characters.chars().all(covered));
        }
        assert!(!covered('轮'));
    }

    #[test]
    fn only_texts_are_drawn_with_letters() {
        let svg = "<svg aria-label=\"轮\"><title>轮</title><text x=\"0\">a轮b轮</text><text y=\"1\" class=\"soft\">Ж ж</text></svg>";
        assert_eq!(foreign(svg), "轮");
    }
}
