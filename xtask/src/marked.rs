//! The parts of a page that a command makes: the text between `<!-- command -->` and `<!-- end -->`.

use std::fs;

use anyhow::{Context, Result};

const END: &str = "<!-- end -->";

/// The line that begins the part of a command.
pub fn begin(command: &str) -> String {
    format!("<!-- {command} -->")
}

/// The page with the part after `<!-- command -->` made anew.
pub fn replaced(page: &str, command: &str, text: &str) -> Result<String> {
    let begin = begin(command);
    let (head, rest) = page.split_once(&begin).with_context(|| format!("the page has no {begin}"))?;
    let (_, tail) = rest.split_once(END).with_context(|| format!("{begin} has no {END}"))?;
    Ok(format!("{head}{begin}\n\n{text}\n{END}{tail}"))
}

/// Prints the output of a command; with `write`, puts it into its place in a page.
pub fn publish(page: &str, command: &str, text: &str, write: bool) -> Result<()> {
    println!("{text}");
    if write {
        let old = fs::read_to_string(page).context(page.to_string())?;
        fs::write(page, replaced(&old, command, text.trim_end())?).context(page.to_string())?;
    }
    Ok(())
}
