//! A figure as pixels.

use tiny_skia::{FillRule, Mask, Paint, PathBuilder, Pixmap};
use usvg::tiny_skia_path::{Rect, Transform};
use usvg::{Path, Text};

use super::{Canvas, Picture, colour, draw, read};

/// Pixels of an SVG in an inch, by CSS.
const SVG_DPI: f64 = 96.0;

/// A separate drawing ([`crate::figure::Figure::svg`]) as PNG, in the colours of paper, with `dpi` pixels per inch; a drawing for a
/// screen has 96.
///
/// # Errors
/// SVG that usvg refuses, which would be a defect.
pub fn png(svg: &str, dpi: f64) -> Result<Picture, String> {
    let (tree, missing) = read(svg)?;
    let size = tree.size();
    let scale = (dpi / SVG_DPI) as f32;
    let (width, height) = ((scale * size.width()).ceil() as u32, (scale * size.height()).ceil() as u32);
    let pixels = Pixmap::new(width, height).ok_or("the figure has no size")?;
    let mut canvas = Pixels { pixels, mask: None };
    draw(tree.root(), Transform::from_scale(scale, scale), None, &mut canvas);
    let bytes = canvas.pixels.encode_png().map_err(|error| error.to_string())?;
    Ok(Picture { bytes, missing })
}

struct Pixels {
    pixels: Pixmap,
    /// The mask of the latest clip.
    mask: Option<(Rect, Mask)>,
}

impl Canvas for Pixels {
    fn path(&mut self, path: &Path, to: Transform, clip: Option<Rect>) {
        if self.mask.as_ref().map(|(rect, _)| *rect) != clip {
            self.mask = clip.and_then(|rect| {
                let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
                mask.fill_path(&PathBuilder::from_rect(rect), FillRule::Winding, true, Transform::identity());
                Some((rect, mask))
            });
        }
        let mask = self.mask.as_ref().map(|(_, mask)| mask);
        let paint = |of: &usvg::Paint, opacity: usvg::Opacity| {
            let (colour, mut paint) = (colour(of), Paint::default());
            paint.set_color_rgba8(colour.red, colour.green, colour.blue, opacity.to_u8());
            paint
        };
        let bounds = path.data().bounds();
        // A straight line has nothing to fill.
        if let Some(fill) = path.fill().filter(|_| bounds.width() > 0.0 && bounds.height() > 0.0) {
            let rule = match fill.rule() {
                usvg::FillRule::NonZero => FillRule::Winding,
                usvg::FillRule::EvenOdd => FillRule::EvenOdd,
            };
            self.pixels.fill_path(path.data(), &paint(fill.paint(), fill.opacity()), rule, to, mask);
        }
        if let Some(stroke) = path.stroke() {
            let paint = paint(stroke.paint(), stroke.opacity());
            self.pixels.stroke_path(path.data(), &paint, &stroke.to_tiny_skia(), to, mask);
        }
    }

    fn text(&mut self, text: &Text, to: Transform, clip: Option<Rect>) {
        draw(text.flattened(), to, clip, self);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Width;
    use crate::picture::testing::figure;

    fn drawn(svg: &str) -> Pixmap {
        Pixmap::decode_png(&png(svg, 192.0).unwrap().bytes).unwrap()
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
}
