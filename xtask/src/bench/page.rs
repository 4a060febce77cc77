//! How soon the page shows the verdict of a slider that moves, as a part of the page about `hapt live`.

use std::fmt::Write;
use std::fs;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::checks::stated;
use super::{Bench, output};
use crate::random::quantile;

const SCRIPT: &str = "web/test/latency.mjs";
const KEY: &str = "couplings.0.stiffness";

impl Bench {
    pub(super) fn page(&self) -> Result<String> {
        let hapt = self.programs.join("hapt");
        let mut text = String::from("| world | half are at most, ms | 90 % | longest |\n| --- | --- | --- | --- |\n");
        let mut row = |name: &str, file: &str| -> Result<()> {
            let mut command = Command::new("node");
            let json = output(command.args([SCRIPT, file, KEY]).env("HAPT", &hapt))?;
            let times: Vec<f64> = serde_json::from_str(&json)?;
            ensure!(!times.is_empty(), "the page shows no verdict");
            let [half, most, longest] = [0.5, 0.9, 1.0].map(|share| quantile(times.iter().copied(), share));
            Ok(writeln!(text, "| {name} | {half:.1} | {most:.1} | {longest:.1} |")?)
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
