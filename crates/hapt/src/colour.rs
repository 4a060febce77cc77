//! Verdicts in colour, on a terminal and nowhere else: not in files, not in pipes, not where NO_COLOR is set.

use std::borrow::Cow;
use std::io::{IsTerminal, stdout};

/// The colour of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colour {
    Green,
    Yellow,
    Red,
}

/// Prefixes of a line's value, and their colours. The first match counts.
const ANSWERS: &[(&str, Colour)] = &[
    ("not certified", Colour::Red),
    ("certified", Colour::Green),
    ("unstable", Colour::Red),
    ("stable", Colour::Green),
    ("marginal", Colour::Yellow),
    ("not passive", Colour::Red),
    ("passive", Colour::Green),
    ("not proved", Colour::Yellow),
    ("broken", Colour::Red),
    ("survived", Colour::Green),
];

/// Beginnings of an answer's first line.
const HEADLINES: &[(&str, Colour)] = &[
    ("Not certified, for want of a theorem", Colour::Yellow),
    ("Not certified", Colour::Red),
    ("Certified", Colour::Green),
];

/// The lines that hold an answer: `verdict   certified`.
const LINES: &[&str] = &["verdict", "held", "free", "passive", ""];

impl Colour {
    const fn code(self) -> &'static str {
        match self {
            Colour::Green => "32",
            Colour::Yellow => "33",
            Colour::Red => "31",
        }
    }
}

/// The text as standard output should show it.
pub fn for_stdout(text: &str) -> Cow<'_, str> {
    let variable = |name| std::env::var(name).unwrap_or_default();
    if wanted(stdout().is_terminal(), &variable("NO_COLOR"), &variable("TERM")) && shows_colours() {
        Cow::Owned(coloured(text))
    } else {
        Cow::Borrowed(text)
    }
}

/// <https://no-color.org>: any value but the empty one turns colours off.
fn wanted(is_terminal: bool, no_color: &str, term: &str) -> bool {
    is_terminal && no_color.is_empty() && term != "dumb"
}

/// A console of Windows shows them on request; one before Windows 10 cannot.
#[cfg(windows)]
fn shows_colours() -> bool {
    anstyle_query::windows::enable_ansi_colors().unwrap_or(true)
}

#[cfg(not(windows))]
fn shows_colours() -> bool {
    true
}

/// The answers of the lines that hold one, in bold colour.
fn coloured(text: &str) -> String {
    text.split_inclusive('\n').map(line).collect()
}

fn line(line: &str) -> String {
    let plain = || line.to_string();
    if let Some((answer, colour)) = HEADLINES.iter().find(|(answer, _)| line.starts_with(answer)) {
        return format!("\x1b[1;{}m{answer}\x1b[0m{}", colour.code(), &line[answer.len()..]);
    }
    let Some((name, rest)) = line.split_at_checked(10) else { return plain() };
    if !LINES.contains(&name.trim()) {
        return plain();
    }
    let Some((answer, colour)) = ANSWERS.iter().find(|(answer, _)| rest.starts_with(answer)) else { return plain() };
    format!("{name}\x1b[1;{}m{answer}\x1b[0m{}", colour.code(), &rest[answer.len()..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_terminal_that_wants_colours_gets_them() {
        assert!(wanted(true, "", "xterm"));
        assert!(!wanted(false, "", "xterm"));
        assert!(!wanted(true, "1", "xterm"));
        assert!(!wanted(true, "", "dumb"));
    }

    #[test]
    fn an_answer_is_coloured_and_nothing_else_changes() {
        let text = "Not certified: not safe\nverdict   not certified: it is unstable\nheld      marginal: it swings\nnote      stable\n\
                    per second\n";
        let shown = coloured(text);
        assert_eq!(
            shown,
            "\x1b[1;31mNot certified\x1b[0m: not safe\nverdict   \x1b[1;31mnot certified\x1b[0m: it is unstable\nheld      \x1b[1;33mmarginal\x1b[0m: it swings\n\
             note      stable\nper second\n"
        );
        let mut plain = shown;
        for code in ["\x1b[1;31m", "\x1b[1;33m", "\x1b[0m"] {
            plain = plain.replace(code, "");
        }
        assert_eq!(plain, text);
    }
}
