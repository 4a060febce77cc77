//! The fonts of a PDF, with the letters of its text: the program's own as TrueType, and those of the machine as outlines.

use std::collections::BTreeMap;

use fontdb::{Database, ID, Source};
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str};
use skrifa::instance::{LocationRef, Size};
use skrifa::metrics::{GlyphMetrics, Metrics};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider};
use usvg::layout::PositionedGlyph;
use usvg::tiny_skia_path::Transform;

use super::part::part;
use super::pdf::{deflated, next};

/// The letters of a drawn font, which has codes of one byte.
const LETTERS: usize = 256;
const IDENTITY: SystemInfo<'_> = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
/// The prefix of a name in a PDF that marks a subset of a font.
const PART: &str = "HAPTAA+";

/// The fonts in use, with their letters.
pub(super) struct Fonts<'a> {
    all: &'a Database,
    used: Vec<Face>,
}

struct Face {
    id: ID,
    /// Whether it is the program's, and in the file as TrueType.
    is_own: bool,
    units: f32,
    /// The letters in use: their glyphs, text and widths in units.
    letters: Vec<Letter>,
}

struct Letter {
    glyph: u32,
    text: String,
    width: f32,
}

/// Letters of one font on one line.
pub(super) struct Run {
    pub font: String,
    /// From the line to the page.
    pub at: [f32; 6],
    /// Codes, each with the space that is removed before it, in thousandths of the font's size.
    pub letters: Vec<(f32, Vec<u8>)>,
}

/// The start of a font's file, where its numbers are.
fn opened<T>(all: &Database, id: ID, read: impl FnOnce(&FontRef<'_>) -> Option<T>) -> Option<T> {
    all.with_face_data(id, |data, index| read(&FontRef::from_index(data, index).ok()?))?
}

fn metrics(font: &FontRef<'_>) -> Metrics {
    font.metrics(Size::unscaled(), LocationRef::default())
}

fn widths<'f>(font: &FontRef<'f>) -> GlyphMetrics<'f> {
    font.glyph_metrics(Size::unscaled(), LocationRef::default())
}

impl<'a> Fonts<'a> {
    pub fn new(all: &'a Database) -> Self {
        Fonts { all, used: Vec::new() }
    }

    /// A glyph's font in the file, its code there, its width in units of its font, and the number of units in an em.
    fn letter(&mut self, glyph: &PositionedGlyph) -> Option<(String, Vec<u8>, f32, f32)> {
        let (id, number) = (glyph.font, glyph.id.0);
        let face = match self.used.iter().position(|face| face.id == id) {
            Some(face) => face,
            None => {
                let units = opened(self.all, id, |font| Some(f32::from(metrics(font).units_per_em)))?;
                let is_own = matches!(self.all.face(id)?.source, Source::Binary(_));
                self.used.push(Face { id, is_own, units, letters: Vec::new() });
                self.used.len() - 1
            }
        };
        let Face { is_own, units, letters, .. } = &mut self.used[face];
        let place = match letters.iter().position(|letter| letter.glyph == number && letter.text == glyph.text) {
            Some(place) => place,
            None => {
                let width =
                    opened(self.all, id, |font| widths(font).advance_width(GlyphId::new(number))).unwrap_or(0.0);
                letters.push(Letter { glyph: number, text: glyph.text.clone(), width });
                letters.len() - 1
            }
        };
        let (name, code) = match is_own {
            true => (format!("F{face}"), (number as u16).to_be_bytes().to_vec()),
            false => (part_name(face, place / LETTERS), vec![(place % LETTERS) as u8]),
        };
        Some((name, code, letters[place].width, *units))
    }

    /// The letters of a text as runs, in points of this size.
    pub fn runs(&mut self, glyphs: &[PositionedGlyph], to: Transform, size: f32) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        // The position of the next letter of the run by the widths.
        let mut pen = 0.0;
        for glyph in glyphs {
            let Some((font, code, width, units)) = self.letter(glyph) else { continue };
            let em = to.pre_concat(glyph.outline_transform()).pre_scale(units / size, units / size);
            let round = |x: f32| (1e4 * x).round() / 1e4;
            let at = [em.sx, em.ky, em.kx, em.sy, em.tx, em.ty].map(round);
            let wide = width / units;
            match runs.last_mut() {
                // On the same line, level and as large.
                Some(run)
                    if run.font == font
                        && run.at[..4] == at[..4]
                        && at[1] == 0.0
                        && (run.at[5] - at[5]).abs() < 1e-3 =>
                {
                    let here = (em.tx - run.at[4]) / (em.sx * size);
                    let space = (1e3 * (pen - here)).round();
                    match run.letters.last_mut() {
                        Some((_, codes)) if space == 0.0 => codes.extend(code),
                        _ => run.letters.push((space, code)),
                    }
                    pen += wide - 1e-3 * space;
                }
                _ => {
                    runs.push(Run { font, at, letters: vec![(0.0, code)] });
                    pen = wide;
                }
            }
        }
        runs
    }

    /// Writes them; returns their names. Adds the characters of letters that cannot be drawn.
    pub fn write(
        self,
        pdf: &mut Pdf,
        numbers: &mut impl Iterator<Item = Ref>,
        missing: &mut String,
    ) -> Vec<(String, Ref)> {
        let mut written = Vec::new();
        for (i, face) in self.used.iter().enumerate() {
            let name = self.all.face(face.id).map_or(String::new(), |face| face.post_script_name.clone());
            if face.is_own {
                let font = next(numbers);
                self.truetype(face, &name, font, pdf, numbers);
                written.push((format!("F{i}"), font));
                continue;
            }
            for (part, letters) in face.letters.chunks(LETTERS).enumerate() {
                let font = next(numbers);
                self.drawn(face, letters, font, pdf, numbers, missing);
                written.push((part_name(i, part), font));
            }
        }
        written
    }

    /// A font of the program, by the numbers of its glyphs.
    fn truetype(&self, face: &Face, name: &str, font: Ref, pdf: &mut Pdf, numbers: &mut impl Iterator<Item = Ref>) {
        let [of_glyphs, about, file, unicode] = std::array::from_fn(|_| next(numbers));
        let (name, thousandth) = (format!("{PART}{name}"), 1e3 / face.units);
        let mut by_glyph: BTreeMap<u16, &Letter> = BTreeMap::new();
        let mut text = UnicodeCmap::new(Name(b"Text"), IDENTITY);
        for letter in &face.letters {
            by_glyph.entry(letter.glyph as u16).or_insert(letter);
        }
        for (glyph, letter) in &by_glyph {
            text.pair_with_multiple(*glyph, letter.text.chars());
        }
        let mut composite = pdf.type0_font(font);
        composite.base_font(Name(name.as_bytes())).encoding_predefined(Name(b"Identity-H"));
        composite.descendant_font(of_glyphs).to_unicode(unicode);
        composite.finish();
        let mut glyphs = pdf.cid_font(of_glyphs);
        glyphs.subtype(CidFontType::Type2).base_font(Name(name.as_bytes())).system_info(IDENTITY);
        glyphs.font_descriptor(about).default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = glyphs.widths();
        for (glyph, letter) in &by_glyph {
            widths.consecutive(*glyph, [thousandth * letter.width]);
        }
        widths.finish();
        glyphs.finish();
        let numbers = opened(self.all, face.id, |font| Some(metrics(font)));
        let mut described = pdf.font_descriptor(about);
        described
            .name(Name(name.as_bytes()))
            .flags(FontFlags::SYMBOLIC)
            .italic_angle(0.0)
            .stem_v(80.0)
            .font_file2(file);
        if let Some(of) = numbers {
            let bounds = of.bounds.unwrap_or_default();
            let [x0, y0, x1, y1] = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(|x| thousandth * x);
            described.bbox(Rect::new(x0, y0, x1, y1)).ascent(thousandth * of.ascent).descent(thousandth * of.descent);
            described.cap_height(thousandth * of.cap_height.unwrap_or(of.ascent));
        }
        described.finish();
        let bytes = opened(self.all, face.id, |font| part(font, by_glyph.keys().copied())).unwrap_or_default();
        let packed = deflated(&bytes);
        let mut program = pdf.stream(file, &packed);
        program.filter(Filter::FlateDecode).pair(Name(b"Length1"), bytes.len() as i32);
        program.finish();
        pdf.stream(unicode, &deflated(&text.finish())).filter(Filter::FlateDecode);
    }

    /// Letters of the machine's font, each drawn.
    fn drawn(
        &self,
        face: &Face,
        letters: &[Letter],
        font: Ref,
        pdf: &mut Pdf,
        numbers: &mut impl Iterator<Item = Ref>,
        missing: &mut String,
    ) {
        let unicode = next(numbers);
        let procedures: Vec<Ref> = letters.iter().map(|_| next(numbers)).collect();
        let mut text = UnicodeCmap::<u8>::new(Name(b"Text"), IDENTITY);
        for (code, letter) in letters.iter().enumerate() {
            text.pair_with_multiple(code as u8, letter.text.chars());
        }
        let names: Vec<String> = (0..letters.len()).map(|code| format!("g{code}")).collect();
        let mut described = pdf.type3_font(font);
        // A box of zeros: viewers use the letters' own extents.
        described.bbox(Rect::new(0.0, 0.0, 0.0, 0.0)).to_unicode(unicode);
        described.matrix([1.0 / face.units, 0.0, 0.0, 1.0 / face.units, 0.0, 0.0]);
        described.first_char(0).last_char((letters.len() - 1) as u8).widths(letters.iter().map(|letter| letter.width));
        described.encoding_custom().differences().consecutive(0, names.iter().map(|name| Name(name.as_bytes())));
        let mut named = described.char_procs();
        for (name, procedure) in names.iter().zip(&procedures) {
            named.pair(Name(name.as_bytes()), *procedure);
        }
        named.finish();
        described.resources();
        described.finish();
        for (letter, procedure) in letters.iter().zip(procedures) {
            let mut pen = Pen { content: Content::new(), at: (0.0, 0.0), is_empty: true };
            opened(self.all, face.id, |font| {
                let outline = font.outline_glyphs().get(GlyphId::new(letter.glyph))?;
                let bounds = widths(font).bounds(GlyphId::new(letter.glyph)).unwrap_or_default();
                pen.content.start_shape_glyph(letter.width, bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max);
                outline.draw(DrawSettings::unhinted(Size::unscaled(), LocationRef::default()), &mut pen).ok()
            });
            match pen.is_empty {
                true => missing.extend(letter.text.chars().find(|c| !c.is_whitespace() && !missing.contains(*c))),
                false => drop(pen.content.fill_nonzero()),
            }
            pdf.stream(procedure, &deflated(&pen.content.finish())).filter(Filter::FlateDecode);
        }
        pdf.stream(unicode, &deflated(&text.finish())).filter(Filter::FlateDecode);
    }
}

fn part_name(face: usize, part: usize) -> String {
    format!("F{face}.{part}")
}

/// Writes a letter's outline.
struct Pen {
    content: Content,
    at: (f32, f32),
    is_empty: bool,
}

impl OutlinePen for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.content.move_to(x, y);
        (self.at, self.is_empty) = ((x, y), false);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.content.line_to(x, y);
        self.at = (x, y);
    }

    fn quad_to(&mut self, cx: f32, cy: f32, x: f32, y: f32) {
        let third = |a: f32, c: f32| a + 2.0 / 3.0 * (c - a);
        let (x0, y0) = self.at;
        self.content.cubic_to(third(x0, cx), third(y0, cy), third(x, cx), third(y, cy), x, y);
        self.at = (x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.content.cubic_to(x1, y1, x2, y2, x, y);
        self.at = (x, y);
    }

    fn close(&mut self) {
        self.content.close_path();
    }
}
