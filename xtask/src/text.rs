//! The words after a campaign's name: `--n 1000 --seed 2 --write`.

use anyhow::{Context, Result, bail};

/// Reads numbers by their names, each into its place; returns whether `--write` is among them.
pub fn numbers(words: &[&str], places: &mut [(&str, &mut f64)]) -> Result<bool> {
    let (mut words, mut write) = (words.iter(), false);
    while let Some(word) = words.next() {
        if *word == "--write" {
            write = true;
        } else if let Some((_, place)) = places.iter_mut().find(|(name, _)| name == word) {
            let text = words.next().with_context(|| format!("{word} takes a number"))?;
            **place = text.parse().with_context(|| format!("{text} is not a number"))?;
        } else {
            let known: Vec<String> = places.iter().map(|(name, _)| format!("{name} NUMBER")).collect();
            bail!("there is {} and --write, not {word}", known.join(", "));
        }
    }
    Ok(write)
}
