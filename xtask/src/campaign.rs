//! The arguments of the campaigns on random devices and loops.

use std::fs;
use std::time::Instant;

use anyhow::{Context, Result};

use crate::{marked, text};

/// How many, from which seed, for how long, and whether the page is written.
pub struct Campaign {
    pub n: u64,
    pub seed: u64,
    /// Infinite: without a limit of time.
    pub minutes: f64,
    write: bool,
    started: Instant,
}

impl Campaign {
    /// `[--n N] [--seed S] [--minutes M] [--write]`, of which a campaign that ends by itself takes no minutes.
    pub fn parse(words: &[&str], takes_minutes: bool) -> Result<Self> {
        let started = Instant::now();
        let (mut n, mut seed, mut minutes) = (1000.0, 1.0, f64::INFINITY);
        let mut places = vec![("--n", &mut n), ("--seed", &mut seed)];
        if takes_minutes {
            places.push(("--minutes", &mut minutes));
        }
        let write = text::numbers(words, &mut places)?;
        Ok(Campaign { n: n as u64, seed: seed as u64, minutes, write, started })
    }

    /// Prints the result of `cargo xtask` with this word. Writes it into the page if requested and if the page has a place for it.
    pub fn publish(&self, word: &str, page: &str, text: &str) -> Result<()> {
        println!("{text}");
        eprintln!("{:.0} s", self.started.elapsed().as_secs_f64());
        if self.write {
            let (old, command) = (fs::read_to_string(page).context(page.to_string())?, format!("cargo xtask {word}"));
            if old.contains(&marked::begin(&command)) {
                fs::write(page, marked::replaced(&old, &command, text)?).context(page.to_string())?;
            } else {
                eprintln!("{page} has no place for {command}");
            }
        }
        Ok(())
    }
}
