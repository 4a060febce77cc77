//! The arrows between the modules of a crate: of two modules at its top at most one uses the other, directly or through others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use syn::visit::{self, Visit};
use syn::{Attribute, ItemMod, ItemUse, Meta, UseTree};

/// Which modules at the top of a crate use which.
type Arrows = BTreeMap<String, BTreeSet<String>>;

/// No crate has a circle of modules.
pub fn are_acyclic() -> Result<()> {
    let mut crates: Vec<PathBuf> = fs::read_dir("crates")?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    crates.extend(["bench", "fmi", "fuzz", "python", "web/core", "xtask"].map(PathBuf::from));
    crates.sort();
    let mut found = Vec::new();
    for folder in &crates {
        let circles = circles(&arrows(&folder.join("src"))?);
        found.extend(circles.iter().map(|circle| format!("{}: {}", folder.display(), circle.join(", "))));
    }
    ensure!(found.is_empty(), "modules that use each other:\n{}", found.join("\n"));
    Ok(())
}

fn arrows(source: &Path) -> Result<Arrows> {
    let mut files = Vec::new();
    collect(source, &mut files)?;
    let top = |path: &Path| -> Option<String> {
        let first = path.strip_prefix(source).ok()?.components().next()?;
        let name = Path::new(first.as_os_str()).file_stem()?.to_string_lossy().into_owned();
        (!matches!(name.as_str(), "lib" | "main" | "bin")).then_some(name)
    };
    let names: BTreeSet<String> = files.iter().filter_map(|file| top(file)).collect();
    let mut arrows = Arrows::new();
    for file in &files {
        let Some(own) = top(file) else { continue };
        // The module's depth: `a.rs` and `a/mod.rs` are 1, `a/b.rs` is 2.
        let inside = file.strip_prefix(source)?;
        let depth = inside.components().count() - usize::from(inside.file_name().is_some_and(|name| name == "mod.rs"));
        let text = fs::read_to_string(file)?;
        let tree = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let mut uses = Uses { depth, names: &names, found: BTreeSet::new() };
        uses.visit_file(&tree);
        uses.found.remove(&own);
        arrows.entry(own).or_default().extend(uses.found);
    }
    Ok(arrows)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

/// The modules at the top of the crate that a file names.
struct Uses<'n> {
    depth: usize,
    names: &'n BTreeSet<String>,
    found: BTreeSet<String>,
}

impl Uses<'_> {
    /// A path from the crate's top, or as many `super` as lead there.
    fn path(&mut self, path: &[String]) {
        let up = path.iter().take_while(|part| *part == "super").count();
        let first = match path.first().map(String::as_str) {
            Some("crate") => path.get(1),
            Some("super") if up == self.depth => path.get(up),
            _ => None,
        };
        self.found.extend(first.filter(|name| self.names.contains(*name)).cloned());
    }

    fn tree(&mut self, tree: &UseTree, before: &mut Vec<String>) {
        match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.tree(&path.tree, before);
                before.pop();
            }
            UseTree::Group(group) => group.items.iter().for_each(|item| self.tree(item, before)),
            UseTree::Name(name) => self.path(&[&before[..], &[name.ident.to_string()]].concat()),
            UseTree::Rename(name) => self.path(&[&before[..], &[name.ident.to_string()]].concat()),
            UseTree::Glob(_) => self.path(before),
        }
    }
}

fn is_of_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        matches!(&attribute.meta, Meta::List(list) if list.path.is_ident("cfg") && list.tokens.to_string() == "test")
    })
}

impl<'t> Visit<'t> for Uses<'_> {
    fn visit_item_mod(&mut self, module: &'t ItemMod) {
        // Tests may use anything.
        if !is_of_tests(&module.attrs) {
            self.depth += 1;
            visit::visit_item_mod(self, module);
            self.depth -= 1;
        }
    }

    fn visit_item_use(&mut self, item: &'t ItemUse) {
        self.tree(&item.tree, &mut Vec::new());
    }

    fn visit_path(&mut self, path: &'t syn::Path) {
        let parts: Vec<String> = path.segments.iter().map(|part| part.ident.to_string()).collect();
        self.path(&parts);
        visit::visit_path(self, path);
    }
}

/// The sets of modules that reach each other.
fn circles(arrows: &Arrows) -> BTreeSet<Vec<String>> {
    let reached = |from: &String| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(at) = next.pop() {
            for to in arrows.get(&at).into_iter().flatten() {
                if seen.insert(to.clone()) {
                    next.push(to.clone());
                }
            }
        }
        seen
    };
    let all: BTreeMap<&String, BTreeSet<String>> = arrows.keys().map(|module| (module, reached(module))).collect();
    let circle = |(module, reaches): (&&String, &BTreeSet<String>)| {
        let back = |to: &&String| all.get(to).is_some_and(|back| back.contains(*module));
        let circle: Vec<String> = reaches.iter().filter(back).cloned().collect();
        (!circle.is_empty()).then_some(circle)
    };
    all.iter().filter_map(circle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_found_by_any_way_of_naming_a_module_and_tests_do_not_count() {
        let folder = tempfile::TempDir::new().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("lib.rs", "mod a; mod b; mod c; mod d;");
        write("a/mod.rs", "mod inner; use crate::{b::{Y, Z as W}, d};");
        write("a/inner.rs", "use super::Own;");
        write("b.rs", "fn f(x: super::c::T) {}");
        write("c.rs", "fn f() { crate::a::inner::g() }");
        write("d.rs", "#[cfg(test)]\nmod tests { use crate::a; }");
        let found = circles(&arrows(folder.path()).unwrap());
        assert_eq!(found, BTreeSet::from([["a", "b", "c"].map(String::from).to_vec()]));
    }
}
