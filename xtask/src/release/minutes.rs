//! A newcomer's minutes: from the archive to the wheel in a browser, from the wheel of Python to a plot.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result};

use super::{archive, done, emptied, folder};
use crate::marked;

const PAGE: &str = "docs/install.md";
const MARK: &str = "cargo xtask release minutes --write";
/// A newcomer's input to Python: a run of the notes' wheel as a picture.
const PLOT: &str = "\
import matplotlib
matplotlib.use('Agg')
import hapt
hapt.load('@notes/euler').simulate().plot()
matplotlib.pyplot.savefig('wheel.png')
";

/// The rows of the table, of the archive and the wheel that stand in target/packages.
fn measured() -> Result<String> {
    let mut rows = String::from("| from | to | time |\n| --- | --- | --- |\n");
    let home = folder()?.join("newcomer");
    emptied(&home)?;
    let file = archive::file()?;
    done(Command::new("tar").arg("--extract").arg("--file").arg(&file).arg("--directory").arg(&home))?;
    let hapt = home.join(archive::folder_of_this_machine()).join("hapt");
    // The browser is started before, as a reader has one open.
    let printed = done(Command::new("node").arg("first.mjs").current_dir("web/test").env("HAPT", &hapt))?;
    let started: f64 = printed.trim().parse().context("first.mjs prints seconds")?;
    rows += &format!("| the archive, unpacked | the wheel turns in a browser (`hapt live`) | {started:.1} s |\n");
    let wheel = super::only(&folder()?.join("wheels/x86_64-unknown-linux-gnu"))?;
    let environment = home.join("python");
    let since = Instant::now();
    done(Command::new("python3").args(["-m", "venv"]).arg(&environment))?;
    let python = environment.join("bin/python");
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "matplotlib"];
    done(Command::new(&python).args(pip).arg(wheel))?;
    done(Command::new(&python).args(["-c", PLOT]).current_dir(&home))?;
    let picture: PathBuf = home.join("wheel.png");
    fs::metadata(&picture).context("no picture")?;
    rows += &format!(
        "| `pip install` of the wheel, with matplotlib, into a new environment | a plot as PNG | {:.0} s |\n",
        since.elapsed().as_secs_f64()
    );
    Ok(rows)
}

/// Measures, and with `write` puts the table into its page.
pub fn publish(write: bool) -> Result<()> {
    marked::publish(PAGE, MARK, &measured()?, write)
}
