//! The parts of a page that a command makes: what stands between `<!-- command -->` and `<!-- end -->`.

use anyhow::{Context, Result};

const END: &str = "<!-- end -->";

/// The line that begins the part of a command.
pub fn begin(command: &str) -> String {
    format!("<!-- {command} -->")
}

/// The page with what stands behind `<!-- command -->` made anew.
pub fn replaced(page: &str, command: &str, text: &str) -> Result<String> {
    let begin = begin(command);
    let (head, rest) = page.split_once(&begin).with_context(|| format!("the page has no {begin}"))?;
    let (_, tail) = rest.split_once(END).with_context(|| format!("{begin} has no {END}"))?;
    Ok(format!("{head}{begin}\n\n{text}\n{END}{tail}"))
}
