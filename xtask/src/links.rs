//! Links of the documents: each leads to a file of the repository and, where it names one, to a heading of that file.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Folders that hold no document of the repository.
const SKIPPED: [&str; 5] = ["target", "node_modules", "book", "out", ".git"];

/// Checks every Markdown file of the repository. Lists all broken links.
pub fn hold() -> Result<()> {
    let mut broken = Vec::new();
    for page in documents(Path::new("."))? {
        let text = fs::read_to_string(&page)?;
        for link in links(&text).filter(|link| !is_outside(link)) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.with_file_name(file) };
            if !target.exists() {
                broken.push(format!("{}: {link}: there is no such file", page.display()));
            } else if !anchor.is_empty() && !anchors(&fs::read_to_string(&target)?).contains(&anchor.to_string()) {
                broken.push(format!("{}: {link}: there is no such heading", page.display()));
            }
        }
    }
    if broken.is_empty() { Ok(()) } else { bail!("broken links:\n{}", broken.join("\n")) }
}

/// The Markdown files below a folder.
fn documents(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && !path.is_symlink() && !SKIPPED.contains(&&*name) {
            files.extend(documents(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "md") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// The targets of a page's links and images, code left out.
pub fn links(text: &str) -> impl Iterator<Item = &str> {
    outside_code(text).flat_map(|prose| prose.split("](").skip(1)).filter_map(|rest| rest.split(')').next())
}

/// Whether a link leads out of the repository.
pub fn is_outside(link: &str) -> bool {
    link.contains("://") || link.starts_with("mailto:")
}

/// The anchors of a page's headings, as GitHub and mdbook name them: the second of two equal ones ends in `-1`.
pub fn anchors(text: &str) -> Vec<String> {
    let mut seen: HashMap<String, usize> = HashMap::new();
    let headings = outside_code(text).flat_map(str::lines).filter(|line| line.starts_with('#'));
    headings
        .map(|heading| {
            let name = slug(heading);
            let count = seen.entry(name.clone()).or_default();
            *count += 1;
            if *count == 1 { name } else { format!("{name}-{}", *count - 1) }
        })
        .collect()
}

/// The parts of a page between its fenced blocks.
fn outside_code(text: &str) -> impl Iterator<Item = &str> {
    text.split("\n```").step_by(2)
}

/// The name of a heading in links.
fn slug(heading: &str) -> String {
    let words = heading.trim_start_matches('#').trim().to_lowercase();
    words
        .chars()
        .filter(|&c| c.is_alphanumeric() || " -_".contains(c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{anchors, links};

    #[test]
    fn links_in_code_do_not_count_and_equal_headings_are_numbered() {
        let page = "# Why `b = Tk`\n[a](x.md#y)\n```sh\n# no heading [b](z)\n```\n![c](d.svg)\n## Tests\n## Tests\n";
        assert_eq!(links(page).collect::<Vec<_>>(), ["x.md#y", "d.svg"]);
        assert_eq!(anchors(page), ["why-b--tk", "tests", "tests-1"]);
    }
}
