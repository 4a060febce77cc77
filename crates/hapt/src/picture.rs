//! Figures as files: their formats, sizes and looks.

use std::io::{IsTerminal, stdout};
use std::path::Path;

use clap::ValueEnum;
use hapt_model::Dimension;
use hapt_report::figure::Figure;
use hapt_report::{Paper, Width};

use crate::args::{FigureArgs, FigureFormat, FigureStyle};
use crate::failure::Failure;
use crate::format::positive;
use crate::messages;
use crate::output::{self, Draft};

/// The formats of figures, by their files' endings.
const FIGURES: [&str; 3] = ["svg", "png", "pdf"];

/// How a figure becomes a file.
#[derive(Clone, Copy, Debug)]
pub struct FigureFile {
    format: FigureFormat,
    pub width: Width,
    /// Of a PNG.
    dpi: f64,
}

/// The values of a style without flags.
struct Defaults {
    mm: f64,
    points: f64,
    dpi: f64,
    width: fn(Paper) -> Width,
}

/// A column of a journal, with its required pixels per inch.
const PAPER: Defaults = Defaults { mm: 88.0, points: 8.0, dpi: 300.0, width: Width::Paper };
/// A slide 10 inches wide, and as many pixels as a projector has.
const SLIDE: Defaults = Defaults { mm: 254.0, points: 14.0, dpi: 192.0, width: Width::Slide };
/// For a screen's figure: two pixels of a PNG for one of the drawing.
const SCREEN_DPI: f64 = 192.0;

impl FigureFile {
    /// From these flags, for the figure that `flag` writes to `path`; before the work.
    pub fn of(flag: &str, path: Option<&Path>, args: &FigureArgs) -> Result<Self, Failure> {
        let FigureArgs { format, style, width, font_size, dpi } = args;
        let given = [
            ("--format", format.is_some()),
            ("--style", style.is_some()),
            ("--width", width.is_some()),
            ("--font-size", font_size.is_some()),
            ("--dpi", dpi.is_some()),
        ];
        let first = given.into_iter().find_map(|(flag, is_given)| is_given.then_some(flag));
        if let (Some(first), "--plot", None) = (first, flag, path) {
            return Err(Failure::input(format!(
                "{first}: there is no figure without --plot FILE.svg, FILE.png or FILE.pdf"
            )));
        }
        let format = chosen(flag, path, *format)?;
        let of_style = match (style, width) {
            (Some(FigureStyle::Slide), _) => SLIDE,
            (Some(FigureStyle::Paper), _) | (None, Some(_)) => PAPER,
            (None, None) if font_size.is_some() => {
                return Err(Failure::input("--font-size needs --width or --style: a screen's figure has its own"));
            }
            (None, None) => {
                return Ok(FigureFile { format, width: Width::Wide, dpi: dpi.map_or(SCREEN_DPI, f64::from) });
            }
        };
        let mm = match width {
            Some(width) => 1e3 * positive("--width", width, Dimension::LENGTH)?,
            None => of_style.mm,
        };
        let paper = Paper::new(mm, font_size.unwrap_or(of_style.points))
            .map_err(|reason| Failure::input(format!("--width and --font-size: {reason}")))?;
        Ok(FigureFile { format, width: (of_style.width)(paper), dpi: dpi.map_or(of_style.dpi, f64::from) })
    }

    /// The figure's bytes, for the file that messages call `target`.
    pub fn bytes(self, figure: &Figure, target: &str) -> Result<Vec<u8>, Failure> {
        let svg = figure.svg(self.width, true) + "\n";
        let picture = match self.format {
            FigureFormat::Svg => return Ok(svg.into_bytes()),
            FigureFormat::Png => png(&svg, self.dpi),
            FigureFormat::Pdf => pdf(&svg, &figure.title),
        };
        let (bytes, missing) = picture.map_err(|error| Failure::write(target, error))?;
        if !missing.is_empty() {
            messages::say(format_args!(
                "warning: no font of this machine has {missing:?}, and {target} goes without: install a font that has it, or write SVG"
            ));
        }
        Ok(bytes)
    }

    /// A figure's draft.
    pub fn draft(self, target: &Path, figure: &Figure) -> Result<Draft, Failure> {
        output::draft(target, &self.bytes(figure, &target.display().to_string())?)
    }
}

/// A picture's bytes and the characters that no font has.
type Drawn = Result<(Vec<u8>, String), String>;

#[cfg(feature = "png")]
fn png(svg: &str, dpi: f64) -> Drawn {
    hapt_report::png(svg, dpi).map(|picture| (picture.bytes, picture.missing))
}

#[cfg(not(feature = "png"))]
fn png(_: &str, _: f64) -> Drawn {
    Err("this hapt was built without its feature png".into())
}

#[cfg(feature = "pdf")]
fn pdf(svg: &str, title: &str) -> Drawn {
    hapt_report::pdf(svg, title).map(|picture| (picture.bytes, picture.missing))
}

#[cfg(not(feature = "pdf"))]
fn pdf(_: &str, _: &str) -> Drawn {
    Err("this hapt was built without its feature pdf".into())
}

/// The format by flag or ending; SVG without either.
fn chosen(flag: &str, path: Option<&Path>, requested: Option<FigureFormat>) -> Result<FigureFormat, Failure> {
    let by_ending = match path {
        Some(path) => {
            let name = output::format(flag, path, &FIGURES)?;
            path.extension().and_then(|_| FigureFormat::from_str(name, true).ok())
        }
        None => None,
    };
    let format = match (by_ending, requested) {
        (Some(ending), Some(requested)) if ending != requested => {
            let path = path.unwrap_or(Path::new("")).display();
            let (ending, requested) = (ending.name(), requested.name());
            return Err(Failure::input(format!(
                "--format {requested}: {flag} {path} is the name of a file in {ending}; expected one of the two"
            )));
        }
        (ending, requested) => requested.or(ending).unwrap_or(FigureFormat::Svg),
    };
    output::built_with(&format!("--format {}", format.name()), format.name())?;
    if path.is_none() && flag == "--out" && format != FigureFormat::Svg && stdout().is_terminal() {
        return Err(Failure::input(format!(
            "--format {}: standard output is a terminal; expected --out FILE, or > FILE",
            format.name()
        )));
    }
    Ok(format)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_is_honoured_or_refused_and_none_is_the_first_format() {
        let requested = |name: &str| {
            let path = Path::new(name);
            output::format("--plot", path, &FIGURES).map_err(|failure| format!("{failure:?}"))
        };
        match cfg!(feature = "png") {
            true => assert_eq!(requested("a/e.png"), Ok("png")),
            false => assert!(requested("a/e.png").unwrap_err().contains("without its feature png")),
        }
        match cfg!(feature = "pdf") {
            true => assert_eq!(requested("a/e.PDF"), Ok("pdf")),
            false => assert!(requested("a/e.pdf").unwrap_err().contains("without its feature pdf")),
        }
        assert_eq!(requested("E.SVG"), Ok("svg"));
        assert_eq!(requested("figure"), Ok("svg"));
        assert_eq!(requested("/dev/null"), Ok("svg"));
        for name in ["e.csv", "e.png.gif", "e.", "e.svg.gz", "a.b/e.svgz"] {
            let refused = requested(name).unwrap_err();
            assert!(refused.contains("expected FILE.svg, FILE.png or FILE.pdf"), "{refused}");
        }
        assert!(output::format("--log", Path::new("x.csv"), &["mcap"]).is_err());
    }
}
