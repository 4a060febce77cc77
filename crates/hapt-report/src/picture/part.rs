//! A subset of a TrueType font: the omitted letters are empty, and the numbers of the glyphs stay.

use std::collections::BTreeSet;

use skrifa::raw::types::Tag;
use skrifa::{FontRef, raw::TableProvider as _};

/// The tables that a PDF requires of a font's file, in the order of the file's directory.
const TABLES: [&[u8; 4]; 9] = [b"cvt ", b"fpgm", b"glyf", b"head", b"hhea", b"hmtx", b"loca", b"maxp", b"prep"];
/// The place of a font's own checksum in `head`; readers of PDFs ignore it.
const ADJUSTMENT: std::ops::Range<usize> = 8..12;

/// The file of a font with the glyphs of these numbers and their components; `None` for a font without such tables.
pub(super) fn part(font: &FontRef<'_>, glyphs: impl IntoIterator<Item = u16>) -> Option<Vec<u8>> {
    let table = |name: &[u8; 4]| font.table_data(Tag::new(name)).map(|data| data.as_bytes());
    let (loca, glyf) = (table(b"loca")?, table(b"glyf")?);
    let is_long = font.head().ok()?.index_to_loc_format() != 0;
    let places: Vec<usize> = match is_long {
        true => loca.chunks_exact(4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize).collect(),
        false => loca.chunks_exact(2).map(|b| 2 * usize::from(u16::from_be_bytes([b[0], b[1]]))).collect(),
    };
    let outline = |glyph: u16| {
        let at = usize::from(glyph);
        glyf.get(*places.get(at)?..*places.get(at + 1)?)
    };
    let mut kept: BTreeSet<u16> = BTreeSet::new();
    let mut open: Vec<u16> = glyphs.into_iter().collect();
    while let Some(glyph) = open.pop() {
        if kept.insert(glyph) {
            open.extend(outline(glyph).map(components).unwrap_or_default());
        }
    }
    let (mut outlines, mut index) = (Vec::new(), Vec::new());
    for glyph in 0..places.len().checked_sub(1)? {
        index.push(outlines.len());
        if let Some(bytes) = u16::try_from(glyph).ok().filter(|glyph| kept.contains(glyph)).and_then(outline) {
            outlines.extend_from_slice(bytes);
            // Short places are even.
            outlines.resize(outlines.len().next_multiple_of(4), 0);
        }
    }
    index.push(outlines.len());
    let index: Vec<u8> = match is_long {
        true => index.iter().flat_map(|at| (*at as u32).to_be_bytes()).collect(),
        false => index.iter().flat_map(|at| ((*at / 2) as u16).to_be_bytes()).collect(),
    };
    let content = |name: &[u8; 4]| match name {
        b"glyf" => Some(outlines.clone()),
        b"loca" => Some(index.clone()),
        b"head" => table(name).map(|head| {
            let mut head = head.to_vec();
            if let Some(sum) = head.get_mut(ADJUSTMENT) {
                sum.fill(0);
            }
            head
        }),
        _ => table(name).map(<[u8]>::to_vec),
    };
    let tables: Vec<_> = TABLES.into_iter().filter_map(|name| Some((name, content(name)?))).collect();
    Some(file(&tables))
}

/// The components of a composite glyph.
fn components(outline: &[u8]) -> Vec<u16> {
    const WORDS: u16 = 1;
    const SCALE: u16 = 8;
    const MORE: u16 = 0x20;
    const TWO_SCALES: u16 = 0x40;
    const MATRIX: u16 = 0x80;
    let word = |at: usize| Some(u16::from_be_bytes([*outline.get(at)?, *outline.get(at + 1)?]));
    let mut found = Vec::new();
    // A number of contours below 0, and a box.
    if word(0).is_none_or(|contours| contours < 0x8000) {
        return found;
    }
    let mut at = 10;
    while let (Some(flags), Some(glyph)) = (word(at), word(at + 2)) {
        found.push(glyph);
        at += if flags & WORDS != 0 { 8 } else { 6 };
        at += match flags {
            _ if flags & SCALE != 0 => 2,
            _ if flags & TWO_SCALES != 0 => 4,
            _ if flags & MATRIX != 0 => 8,
            _ => 0,
        };
        if flags & MORE == 0 {
            break;
        }
    }
    found
}

/// A font file of these tables.
fn file(tables: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let count = tables.len() as u16;
    let power = count.max(1).ilog2() as u16;
    let search = 16 << power;
    let mut directory = vec![0, 1, 0, 0];
    [count, search, power, 16 * count - search].iter().for_each(|word| directory.extend(word.to_be_bytes()));
    let (mut content, start) = (Vec::new(), directory.len() + 16 * tables.len());
    for (name, bytes) in tables {
        let mut padded = bytes.clone();
        padded.resize(bytes.len().next_multiple_of(4), 0);
        let sum =
            padded.chunks_exact(4).fold(0_u32, |sum, b| sum.wrapping_add(u32::from_be_bytes([b[0], b[1], b[2], b[3]])));
        directory.extend_from_slice(*name);
        for number in [sum, (start + content.len()) as u32, bytes.len() as u32] {
            directory.extend(number.to_be_bytes());
        }
        content.extend(padded);
    }
    directory.extend(content);
    directory
}

#[cfg(test)]
mod tests {
    use skrifa::instance::{LocationRef, Size};
    use skrifa::outline::{DrawSettings, OutlinePen};
    use skrifa::{GlyphId, MetadataProvider};

    use super::*;
    use crate::picture::FONTS;

    /// All points of an outline.
    #[derive(Default, PartialEq, Debug)]
    struct Points(Vec<(f32, f32)>);

    impl OutlinePen for Points {
        fn move_to(&mut self, x: f32, y: f32) {
            self.0.push((x, y));
        }
        fn line_to(&mut self, x: f32, y: f32) {
            self.0.push((x, y));
        }
        fn quad_to(&mut self, cx: f32, cy: f32, x: f32, y: f32) {
            self.0.extend([(cx, cy), (x, y)]);
        }
        fn curve_to(&mut self, ax: f32, ay: f32, bx: f32, by: f32, x: f32, y: f32) {
            self.0.extend([(ax, ay), (bx, by), (x, y)]);
        }
        fn close(&mut self) {}
    }

    fn points(font: &FontRef<'_>, glyph: u16) -> Points {
        let mut points = Points::default();
        let outline = font.outline_glyphs().get(GlyphId::from(glyph)).unwrap();
        outline.draw(DrawSettings::unhinted(Size::unscaled(), LocationRef::default()), &mut points).unwrap();
        points
    }

    #[test]
    fn a_subset_of_a_font_has_only_the_requested_letters() {
        for font in FONTS {
            let whole = FontRef::new(font).unwrap();
            let glyph = |c: char| whole.charmap().map(c).unwrap().to_u32() as u16;
            // Some are composed of others.
            let kept: Vec<u16> = "aÄé°½ s(".chars().map(glyph).collect();
            let bytes = part(&whole, kept.iter().copied()).unwrap();
            assert!(bytes.len() < font.len() / 6, "{} of {}", bytes.len(), font.len());
            let few = FontRef::new(&bytes).unwrap();
            let widths = |font: &FontRef<'_>, glyph: u16| {
                font.glyph_metrics(Size::unscaled(), LocationRef::default()).advance_width(GlyphId::from(glyph))
            };
            for glyph in kept {
                assert_eq!(points(&few, glyph), points(&whole, glyph));
                assert_eq!(widths(&few, glyph), widths(&whole, glyph));
            }
            assert_eq!(points(&few, glyph('Z')), Points::default());
        }
    }
}
