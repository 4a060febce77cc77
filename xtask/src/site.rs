//! The book as a site: mdbook over a copy of docs/, into book/.
//!
//! The site begins with the notes' wheel itself, as [`first_page`] makes it. Two things change in the copy. `<!-- live: @notes/euler -->` becomes the interactive page of that world, which `hapt report`
//! writes and which needs no server; in a lesson of docs/course it names a file of the lesson. A link out of docs/ becomes one into the
//! repository on the web, so that the site needs nothing else. Afterwards every link and anchor of the built pages is checked.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::{links, programs};

const COPY: &str = "target/site";
pub const SITE: &str = "book";
/// The folder for mdbook when none is on the path.
const TOOLS: &str = "target/mdbook";
const LIVE: &str = "<!-- live: ";
/// The worlds' reports, and below them the pages on which they run; in a folder of their own, for a world may be called as a page of the book.
const REPORTS: &str = "report";
/// The world of the first page, and its links: pages of the book, with their subjects.
const FIRST: &str = "@notes/default";
const ABOUT: &str = "Haptic rendering for one-axis devices";
const LEADS: [(&str, &str); 3] =
    [("course.html", "The lecture"), ("devices.html", "Your device"), ("wheel.html", "For games")];
/// The lessons, below docs/.
const LESSONS: &str = "course";

/// Builds the site and checks it.
pub fn build() -> Result<()> {
    let mdbook = mdbook()?;
    let mut report = programs::program("hapt")?;
    for folder in [COPY, SITE] {
        if Path::new(folder).exists() {
            fs::remove_dir_all(folder)?;
        }
    }
    let worlds = copy()?;
    let reports = Path::new(COPY).join("src").join(REPORTS);
    ensure!(
        report.arg("report").args(&worlds).arg("--out").arg(&reports).status()?.success(),
        "no report of {worlds:?}"
    );
    let status = Command::new(mdbook)
        .args(["build", &format!("{COPY}/src"), "--dest-dir"])
        .arg(std::path::absolute(SITE)?)
        .status()?;
    ensure!(status.success(), "mdbook failed");
    first_page(Path::new(SITE))?;
    check()?;
    println!("{SITE}/index.html");
    Ok(())
}

/// The mdbook on the path, or one that is built into target/.
fn mdbook() -> Result<PathBuf> {
    let own = Path::new(TOOLS).join("bin/mdbook");
    for candidate in [Path::new("mdbook"), &own] {
        if Command::new(candidate).arg("--version").output().is_ok_and(|output| output.status.success()) {
            return Ok(candidate.to_path_buf());
        }
    }
    println!("cargo install mdbook, into {TOOLS}");
    let status = Command::new(env!("CARGO"))
        .args(["install", "mdbook", "--locked", "--root", TOOLS, "--target-dir"])
        .arg(Path::new(TOOLS).join("build"))
        .status()?;
    ensure!(status.success(), "mdbook does not build");
    Ok(own)
}

/// Copies docs/ with its pages adapted to the site. Returns the worlds of the interactive pages.
fn copy() -> Result<Vec<String>> {
    let (source, target) = (Path::new("docs"), Path::new(COPY).join("src"));
    for folder in ["images", "notebooks"] {
        fs::create_dir_all(target.join(folder))?;
        for entry in fs::read_dir(source.join(folder))? {
            let path = entry?.path();
            fs::copy(&path, target.join(folder).join(path.file_name().context("no name")?))?;
        }
    }
    fs::copy(source.join("book.toml"), target.join("book.toml"))?;
    let mut worlds = vec![FIRST.to_string()];
    for entry in fs::read_dir(source)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "md") {
            let page = framed(&fs::read_to_string(&path)?, "", |world| Ok(world.to_string()), &mut worlds)?;
            fs::write(target.join(path.file_name().context("no name")?), absolute(&page, "../"))?;
        }
    }
    for entry in fs::read_dir(source.join(LESSONS))? {
        let folder = entry?.path();
        let name = folder.file_name().context("no name")?.to_string_lossy().into_owned();
        let (files, pages) = (Path::new(COPY).join("lessons").join(&name), target.join(LESSONS).join(&name));
        fs::create_dir_all(&files)?;
        fs::create_dir_all(&pages)?;
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            fs::copy(&path, files.join(path.file_name().context("no name")?))?;
        }
        // Every lesson has a starter.toml: on the site its page has the lesson's name.
        let named = |world: &str| -> Result<String> {
            let own = files.join(format!("lesson-{name}.toml"));
            fs::copy(files.join(world), &own).with_context(|| format!("{world} of {name}"))?;
            Ok(own.to_string_lossy().into_owned())
        };
        let page = framed(&fs::read_to_string(folder.join("lesson.md"))?, "../../", named, &mut worlds)?;
        fs::write(pages.join("lesson.md"), absolute(&page, "../../../"))?;
    }
    Ok(worlds)
}

/// The page with its interactive worlds in frames, from where `top` leads to the site's root; `named` gives the world to report for the
/// name there. A frame loads when it comes into view.
fn framed(page: &str, top: &str, named: impl Fn(&str) -> Result<String>, worlds: &mut Vec<String>) -> Result<String> {
    let mut out = String::new();
    for line in page.lines() {
        match line.strip_prefix(LIVE).and_then(|rest| rest.strip_suffix(" -->")) {
            Some(world) => {
                let reported = named(world)?;
                let name = reported.rsplit('/').next().unwrap_or(&reported).trim_end_matches(".toml");
                out += &format!(
                    "<iframe src=\"{top}{REPORTS}/live/{name}.html\" title=\"{world}, interactive\" loading=\"lazy\" \
                     style=\"width: 100%; height: 720px; border: 1px solid #8886\"></iframe>\n\n\
                     [The same world on its own page]({top}{REPORTS}/live/{name}.html)\n"
                );
                if !worlds.contains(&reported) {
                    worlds.push(reported);
                }
            }
            None => out += &format!("{line}\n"),
        }
    }
    ensure!(!out.contains(LIVE), "{LIVE}WORLD --> stands on a line of its own");
    Ok(out)
}

/// The page with its links out of docs/, which begin with `out`, made links into the repository on the web.
fn absolute(page: &str, out: &str) -> String {
    let repository = env!("CARGO_PKG_REPOSITORY");
    page.replace(&format!("]({out}"), &format!("]({repository}/blob/main/"))
}

/// Makes the site's first page of the one on which [`FIRST`] runs: the same page, from where the site begins, with a line that leads into the book.
fn first_page(site: &Path) -> Result<()> {
    let name = FIRST.rsplit('/').next().unwrap_or(FIRST);
    let live = format!("{REPORTS}/live");
    let read =
        |file: String| fs::read_to_string(site.join(&live).join(&file)).with_context(|| format!("{live}/{file}"));
    let (page, data) = (read(format!("{name}.html"))?, read(format!("{name}.js"))?);
    let replaced = |text: &str, from: &str, to: &str| -> Result<String> {
        ensure!(text.contains(from), "the page of {FIRST} has no {from}");
        Ok(text.replace(from, to))
    };
    let data = replaced(&data, &format!("\"../{name}.html\""), &format!("\"{REPORTS}/{name}.html\""))?;
    let leads: String = LEADS.iter().map(|(page, what)| format!("<a href=\"{page}\">{what}</a> ")).collect();
    let line = format!("<nav id=\"site\" aria-label=\"hapt\"><p><strong>hapt</strong> {ABOUT}</p><p>{leads}</p></nav>");
    let page = replaced(&page, &format!("src=\"./{name}.js\""), "src=\"index.js\"")?;
    let page = replaced(&page, "=\"./", &format!("=\"{live}/"))?;
    let page = replaced(&page, "<body>", &format!("<body>\n    {line}"))?;
    fs::write(site.join("index.js"), data)?;
    Ok(fs::write(site.join("index.html"), page)?)
}

/// Whether every link and picture of the built pages leads to a file of the site, and every anchor to an element.
fn check() -> Result<()> {
    let mut broken = Vec::new();
    for page in html(Path::new(SITE))? {
        let text = fs::read_to_string(&page)?;
        for link in attributes(&text, &["href", "src"]).filter(|link| !links::is_outside(link) && !link.is_empty()) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            let target = if target.is_dir() { target.join("index.html") } else { target };
            let known =
                || Ok::<_, std::io::Error>(attributes(&fs::read_to_string(&target)?, &["id"]).any(|id| id == anchor));
            if !target.exists() || !(anchor.is_empty() || known()?) {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    if broken.is_empty() { Ok(()) } else { bail!("links of the site that lead nowhere:\n{}", broken.join("\n")) }
}

/// The pages of the book itself: the site's root and the lessons, without the printable page, which repeats all of them.
fn html(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut pages = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let skipped = ["print.html", "404.html", "toc.html"].iter().any(|name| path.ends_with(name));
        if path.is_dir() && path.starts_with(Path::new(SITE).join(LESSONS)) {
            pages.extend(html(&path)?);
        }
        if path.extension().is_some_and(|extension| extension == "html") && !skipped {
            pages.push(path);
        }
    }
    Ok(pages)
}

/// The values of attributes, as `name="value"`.
fn attributes<'a>(text: &'a str, names: &'a [&str]) -> impl Iterator<Item = &'a str> {
    names.iter().flat_map(move |name| {
        text.split('<').filter_map(move |tag| {
            let tag = tag.split('>').next()?;
            tag.split_once(&format!(" {name}=\"")).and_then(|(_, rest)| rest.split('"').next())
        })
    })
}
