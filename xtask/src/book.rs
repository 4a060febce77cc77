//! The book under docs/: its pages show the present outputs.
//!
//! - A line of a `sh` block is run by sh, in a scratch folder with copies of worlds/, networks/ and docs/course/, and ends with 0, or with the N of a
//!   comment `# exit N` on it. Installing and cargo's other commands are left out.
//! - A `toml` block with a `[loop]` is a world file: it is read, checked and run, and the lines after it find it as
//!   wheel.toml, or by the name in its first line, `# knob.toml`.
//! - A `toml` block that begins with `# answer.toml` is that file.
//! - A line of a `console` block that is followed by a link starts a server: it is started on any free port, prints the link, answers a
//!   browser, and ends by Ctrl-C.
//! - A `python` block of README.md is run by Python with the package that its first line imports, in the folder of the `sh` block's files.
//! - A `text` block below `<!-- output -->` is the output of the `sh` block before it.
//! - What stands between `<!-- made: NAME -->` and `<!-- end -->` is made by [`reference::tables`].
//! - Every page is in the table of contents. [`crate::links`] checks the links.

mod scratch;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::{links, programs, python, reference};
use scratch::Scratch;

const README: &str = "README.md";
const CONTENTS: &str = "docs/SUMMARY.md";
const OUTPUT: &str = "<!-- output -->";
/// The beginnings of lines that are not run.
const NOT_RUN: [&str; 7] = ["cargo ", "cd ", "git ", "mdbook ", "pip ", "rustup ", "sudo "];

/// The pages: README.md and all of docs/.
pub fn pages() -> Result<Vec<PathBuf>> {
    let mut pages = vec![PathBuf::from(README)];
    for entry in fs::read_dir("docs")? {
        pages.extend(Some(entry?.path()).filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    pages.sort();
    Ok(pages)
}

/// Checks all pages.
pub fn check() -> Result<()> {
    links::hold()?;
    build()?;
    let mut failed = 0;
    for page in pages()? {
        if let Err(error) = is_current(&page) {
            failed += 1;
            println!("FAILED  {}: {error:#}", page.display());
        }
    }
    ensure!(failed == 0, "{failed} pages do not show what happens");
    Ok(())
}

/// Makes the pages' outputs and tables anew.
pub fn write() -> Result<()> {
    build()?;
    for page in pages()? {
        let made = made(&page).with_context(|| page.display().to_string())?;
        if made != fs::read_to_string(&page)? {
            fs::write(&page, made)?;
            println!("wrote {}", page.display());
        }
    }
    Ok(())
}

/// Builds the command line and the Python package that the pages run.
fn build() -> Result<()> {
    programs::cargo(&format!("build --quiet --workspace --bins --profile {}", programs::PROFILE), "")?;
    python::is_built()
}

/// Whether a page shows the present output of its commands, and is in the table of contents.
pub fn is_current(page: &Path) -> Result<()> {
    let text = fs::read_to_string(page)?;
    let contents = fs::read_to_string(CONTENTS)?;
    let name = page.file_name().and_then(|name| name.to_str()).context("no name")?;
    ensure!(
        page.parent() == Some(Path::new("")) || page == Path::new(CONTENTS) || contents.contains(&format!("]({name})")),
        "not in {CONTENTS}"
    );
    if !cfg!(unix) {
        return Ok(());
    }
    let made = made(page)?;
    if let Some((number, (old, new))) = text.lines().zip(made.lines()).enumerate().find(|(_, (old, new))| old != new) {
        bail!("line {}: {old:?} is {new:?} today; cargo xtask book --write", number + 1);
    }
    ensure!(made == text, "not current: cargo xtask book --write");
    Ok(())
}

/// The page with its outputs and tables made anew; an error where a command or a world file does not do what it should.
fn made(page: &Path) -> Result<String> {
    let scratch = Scratch::new(page)?;
    let text = fs::read_to_string(page)?;
    let (mut out, mut printed, mut shows_output) = (String::new(), String::new(), false);
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        out += &format!("{line}\n");
        if let Some(name) = line.strip_prefix("<!-- made: ").and_then(|rest| rest.strip_suffix(" -->")) {
            lines.find(|(_, line)| *line == "<!-- end -->").context("a table without an end")?;
            out += &format!("\n{}\n<!-- end -->\n", reference::tables(name)?);
        }
        let Some(language) = line.strip_prefix("```") else {
            shows_output = line == OUTPUT || (shows_output && line.is_empty());
            continue;
        };
        let block: Vec<&str> =
            lines.by_ref().map(|(_, line)| line).take_while(|line| !line.starts_with("```")).collect();
        let body = block.iter().map(|line| format!("{line}\n")).collect::<String>();
        let at = || format!("the block at line {}", number + 1);
        match language {
            "sh" => printed = scratch.run_all(&body).with_context(at)?,
            "console" => scratch.serve_all(&body).with_context(at)?,
            // Those of other pages need the code around them.
            "python" if page == Path::new(README) => scratch.python(&body).with_context(at)?,
            "toml" if block.iter().any(|line| line.starts_with("[loop]")) => scratch.world(&body).with_context(at)?,
            "toml" if block.first().is_some_and(|line| line.starts_with("# answer.toml")) => {
                fs::write(scratch.file("answer.toml"), &body).with_context(at)?;
            }
            _ => {}
        }
        out += if shows_output && language == "text" { &printed } else { &body };
        out += "```\n";
        shows_output = false;
    }
    Ok(out)
}
