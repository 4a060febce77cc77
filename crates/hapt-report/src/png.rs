//! A figure as PNG: its SVG rendered by resvg with the program's own fonts, so that it looks the same on every machine.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

use crate::svg::STYLE;

const FONTS: [&[u8]; 2] = [include_bytes!("../fonts/DejaVuSans.ttf"), include_bytes!("../fonts/DejaVuSans-Bold.ttf")];
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
/// Pixels of an SVG in an inch, by CSS.
const SVG_DPI: f64 = 96.0;

/// A drawing of a file of its own ([`crate::figure::Figure::svg`]) as PNG, in the colours of paper, with so many pixels in an inch; a
/// drawing for a screen has 96 in an inch.
///
/// # Errors
/// SVG that resvg refuses, which would be a defect.
pub fn png(svg: &str, dpi: f64) -> Result<Vec<u8>, String> {
    // No dark colours.
    let paper = STYLE.split("@media").next().unwrap_or_default();
    let svg = svg.replacen(STYLE, paper, 1);
    let mut options = Options { font_family: "DejaVu Sans".into(), ..Options::default() };
    let fonts = options.fontdb_mut();
    FONTS.iter().for_each(|font| fonts.load_font_data(font.to_vec()));
    fonts.set_sans_serif_family("DejaVu Sans");
    if !svg.chars().all(|c| COVERED.iter().any(|&(from, to)| (from..=to).contains(&c))) {
        // A title in another script uses the machine's fonts, where there are any.
        fonts.load_system_fonts();
    }
    let tree = Tree::from_str(&svg, &options).map_err(|error| format!("the figure cannot be drawn: {error}"))?;
    let size = tree.size();
    let scale = (dpi / SVG_DPI) as f32;
    let (width, height) = ((scale * size.width()).ceil() as u32, (scale * size.height()).ceil() as u32);
    let mut pixels = Pixmap::new(width, height).ok_or("the figure has no size")?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Width;
    use crate::figure::{Axis, Figure, Panel, Style};

    fn figure(title: &str) -> Figure {
        let mut panel =
            Panel::new("", Axis::from_to("time", "s", 0.0, 1.0), Axis::from_to("torque", "N mm", -1.0, 1.0));
        panel.curve("asked for", Style::Signal(0), vec![(0.0, -0.9), (1.0, 0.9)]);
        Figure { title: title.into(), alt: String::new(), panels: vec![panel], columns: 1 }
    }

    fn drawn(svg: &str) -> Pixmap {
        Pixmap::decode_png(&png(svg, 192.0).unwrap()).unwrap()
    }

    /// Title and labels are drawn without any font of the machine, on white paper, and the curve in its colour.
    #[test]
    fn a_figure_has_paper_its_curves_colour_and_text() {
        let with = drawn(&figure("Σ of the wheel: 45°, ½ µs").svg(Width::Wide, true));
        let without = drawn(&figure("").svg(Width::Wide, true));
        assert_eq!((with.width(), with.height()), (without.width(), without.height()));
        assert_eq!(with.width(), 1520);
        let has = |pixels: &Pixmap, rgb: (u8, u8, u8)| {
            pixels.pixels().iter().filter(|p| (p.red(), p.green(), p.blue()) == rgb).count()
        };
        assert!(has(&with, (255, 255, 255)) > 500_000, "paper");
        assert!(has(&with, (0x00, 0x72, 0xb2)) > 1000, "the curve");
        let dark = |pixels: &Pixmap| pixels.pixels().iter().filter(|p| p.red() < 80 && p.blue() < 80).count();
        assert!(dark(&without) > 300, "labels: {}", dark(&without));
        assert!(dark(&with) > dark(&without) + 1000, "the title: {} {}", dark(&with), dark(&without));
    }

    #[test]
    fn the_fonts_have_the_characters_that_they_are_said_to_have() {
        for characters in ["Ω·m ± 20 %, ∞ → ≤", "Ж", "Колесо"] {
            assert!(characters.chars().all(|c| COVERED.iter().any(|&(from, to)| (from..=to).contains(&c))));
        }
        assert!(!COVERED.iter().any(|&(from, to)| (from..=to).contains(&'轮')));
    }
}
