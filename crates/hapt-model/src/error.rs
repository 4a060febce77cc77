//! Mistakes in a world, and their places.

use std::fmt;
use std::ops::Range;

/// How many characters of a line are shown around the caret.
const WINDOW: usize = 120;
/// The byte order mark that some editors begin UTF-8 with.
const MARK: char = '\u{feff}';

/// The first thing found wrong while reading a world.
///
/// ```text
/// loop.period: "1 kg" is a mass (kg); expected a time (s), such as "1 ms"
///  --> wheel.toml:12:13
///    |
/// 12 | period    = "1 kg"
///    |             ^^^^^^
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The sort of mistake.
    pub kind: ErrorKind,
    /// The dotted path of the key; empty where none is concerned.
    pub key: String,
    /// The given value, and a right one.
    pub message: String,
    /// Its place; `None` for a file that could not be read and for a lookup in a world already read.
    pub location: Option<Box<Location>>,
}

/// The sorts of mistakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file is missing, unreadable, too large, or not to be read from here.
    Unreadable,
    /// Not TOML, not `KEY=VALUE`, or not the CSV of a path.
    Syntax,
    /// A key, name or end that does not exist here, or one that is missing.
    Name,
    /// A value of the wrong type, dimension or range.
    Value,
    /// Values that are right each by itself and do not go together, or are more than the limits allow.
    Combination,
    /// A coupling that the method does not take.
    Unsupported,
}

/// A place in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file, `<stdin>`, or `--set`.
    pub source: String,
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// How many characters are meant, at least 1, none beyond the line.
    pub width: usize,
    /// The line.
    pub text: String,
}

impl Location {
    /// The place of the bytes `span` of `text`; a span beyond the end, or inside a character, is moved back.
    pub fn new(source: &str, text: &str, span: Range<usize>) -> Location {
        // A byte order mark is no column.
        let mark = if text.starts_with(MARK) { MARK.len_utf8() } else { 0 };
        let (text, span) = (&text[mark..], span.start.saturating_sub(mark)..span.end.saturating_sub(mark));
        let start = boundary(text, span.start);
        let end = boundary(text, span.end.max(start));
        let (before, after) = text.split_at(start);
        let (head, tail) =
            (before.rsplit('\n').next().unwrap_or_default(), after.split('\n').next().unwrap_or_default());
        let tail = tail.strip_suffix('\r').unwrap_or(tail);
        let meant = text.get(start..end).unwrap_or_default().chars().count();
        Location {
            source: source.chars().map(visible).collect(),
            line: before.matches('\n').count() + 1,
            column: head.chars().count() + 1,
            width: meant.min(tail.chars().count()).max(1),
            text: format!("{head}{tail}"),
        }
    }
}

/// The start of the character that the byte `index` is in, the text's end at most.
fn boundary(text: &str, index: usize) -> usize {
    (0..=index.min(text.len())).rev().find(|&index| text.is_char_boundary(index)).unwrap_or(0)
}

/// A character as a message or a table shows it: one that moves the cursor, turns the direction of the text around it, or is not to be seen, is replaced.
///
/// ```
/// assert_eq!("5\u{202e}mN 3\u{200b}°".chars().map(hapt_model::visible).collect::<String>(), "5\u{fffd}mN 3\u{fffd}°");
/// ```
pub fn visible(c: char) -> char {
    let hidden = c.is_control()
        || matches!(c,
            // Joiners and marks of width 0, and the marks, embeddings, overrides and isolates of direction.
            '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
            // Fillers without a glyph.
            | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{3164}' | '\u{ffa0}');
    if hidden { '\u{fffd}' } else { c }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.key.is_empty() {
            // An unknown name may be a megabyte long.
            write!(f, "{}: ", self.key.chars().take(WINDOW).map(visible).collect::<String>())?;
        }
        f.write_str(&self.message)?;
        match &self.location {
            Some(location) => write!(f, "\n{location}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Location { source, line, column, width, text } = self;
        let first = if *column > WINDOW * 3 / 4 { column - 1 - WINDOW / 2 } else { 0 };
        let shown: Vec<char> = text.chars().skip(first).take(WINDOW + 1).collect();
        let cut = shown.len() > WINDOW;
        let shown = &shown[..shown.len().min(WINDOW)];

        let mut excerpt = String::from(if first > 0 { "…" } else { "" });
        let (mut indent, mut underline) = (excerpt.chars().count(), 0);
        for (index, &c) in (first + 1..).zip(shown) {
            // The width of a tab and the effect of a control character depend on the terminal: both get a fixed width.
            let cells = if c == '\t' { 4 } else { 1 };
            match c {
                '\t' => excerpt.push_str("    "),
                c => excerpt.push(visible(c)),
            }
            if index < *column {
                indent += cells;
            } else if index < column + width {
                underline += cells;
            }
        }
        if cut {
            excerpt.push('…');
        }

        let number = line.to_string();
        let gutter = " ".repeat(number.len());
        writeln!(f, " --> {source}:{line}:{column}")?;
        writeln!(f, "{gutter} |")?;
        writeln!(f, "{}", format!("{number} | {excerpt}").trim_end())?;
        write!(f, "{gutter} | {}{}", " ".repeat(indent), "^".repeat(underline.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn shown(text: &str, meant: &str) -> String {
        let start = text.find(meant).unwrap();
        Location::new("w.toml", text, start..start + meant.len()).to_string()
    }

    #[test]
    fn the_caret_stands_below_the_value() {
        assert_eq!(
            shown("a\nperiod = \"1 kg\"\nb", "\"1 kg\""),
            " --> w.toml:2:10\n  |\n2 | period = \"1 kg\"\n  |          ^^^^^^"
        );
    }

    #[test]
    fn columns_count_characters_and_tabs_are_four_wide() {
        assert_eq!(shown("µ\t= 5", "5"), " --> w.toml:1:5\n  |\n1 | µ    = 5\n  |        ^");
    }

    #[test]
    fn a_byte_order_mark_is_no_column() {
        assert_eq!(shown("\u{feff}a = 5\nb", "5"), " --> w.toml:1:5\n  |\n1 | a = 5\n  |     ^");
        assert_eq!(shown("\u{feff}a = 5\nb", "b"), " --> w.toml:2:1\n  |\n2 | b\n  | ^");
        assert_eq!(Location::new("", "\u{feff}", 0..3).column, 1);
    }

    #[test]
    fn a_value_of_several_lines_is_underlined_to_the_end_of_its_first() {
        assert_eq!(shown("a = [\r\n1]", "[\r\n1]"), " --> w.toml:1:5\n  |\n1 | a = [\n  |     ^");
    }

    #[test]
    fn a_long_line_is_shown_around_the_caret() {
        let text = format!("{}X{}", "a".repeat(500), "b".repeat(500));
        let shown = shown(&text, "X");
        let lines: Vec<&str> = shown.lines().collect();
        assert_eq!(lines[0], " --> w.toml:1:501");
        assert_eq!(lines[2].chars().count(), 4 + 1 + WINDOW + 1);
        assert_eq!(lines[2].chars().position(|c| c == 'X'), lines[3].chars().position(|c| c == '^'));
    }

    proptest! {
        #[test]
        fn no_span_panics(text in "(\\PC|\n|\t){0,40}", start in 0usize..200, length in 0usize..200) {
            let location = Location::new("", &text, start..start + length);
            prop_assert!(location.line <= text.matches('\n').count() + 1);
            let _ = location.to_string();
        }
    }
}
