//! How soon the page shows the verdict of a slider that moves, as a part of the page about `hapt live`.

use std::fmt::Write;
use std::fs;
use std::process::Command;

use anyhow::{Context, Result};

use super::checks::stated;
use super::{Bench, output};

const PAGE: &str = "docs/live.md";
const BLOCK: &str = "cargo xtask bench page";
const SCRIPT: &str = "web/test/latency.mjs";
const KEY: &str = "couplings.0.stiffness";

/// Measures and prints only this part, and with `write` puts it into its place on the page.
pub fn measure(write: bool) -> Result<()> {
    let text = Bench::of_one("page")?.page()?;
    println!("{text}");
    if write {
        let page = fs::read_to_string(PAGE).context(PAGE)?;
        fs::write(PAGE, crate::marked::replaced(&page, BLOCK, text.trim_end())?).context(PAGE)?;
        println!("wrote {PAGE}");
    }
    Ok(())
}

impl Bench {
    fn page(&self) -> Result<String> {
        let hapt = self.shipped()?;
        let mut text = String::from("| world | half are at most, ms | 90 % | longest |\n| --- | --- | --- | --- |\n");
        let mut row = |name: &str, file: &str| -> Result<()> {
            let mut command = Command::new("node");
            let said = output(command.args([SCRIPT, file, KEY]).env("HAPT", &hapt))?;
            let mut times: Vec<f64> = serde_json::from_str(&said)?;
            times.sort_by(f64::total_cmp);
            let at = |part: f64| times.get((part * times.len() as f64) as usize).context("the page shows no verdict");
            let longest = times.last().context("the page shows no verdict")?;
            Ok(writeln!(text, "| {name} | {:.1} | {:.1} | {longest:.1} |", at(0.5)?, at(0.9)?)?)
        };
        row("the notes' wheel", "worlds/notes/wheel.toml")?;
        for bodies in [1, 8] {
            let path = self.folder.join(format!("page{bodies}.toml"));
            // A late sample of this machine ends no measurement.
            fs::write(&path, stated(bodies) + "[safety]\nlate = \"count\"\n")?;
            let plural = if bodies == 1 { "body" } else { "bodies" };
            row(&format!("{bodies} {plural} with times and a tolerance"), path.to_str().context("a path in UTF-8")?)?;
        }
        Ok(text)
    }
}
