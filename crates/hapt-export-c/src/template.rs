//! The parts of the C file, as they are next to the core's sources: lines of C, some for certain worlds only.
//!
//! ```text
//! //if NAME    or //if !NAME: what follows stands in the file where the world has this, or has it not
//! //else
//! //end
//! @name@       a text or a number of the world
//! //parts NAME here stand the parts of this name of all laws that the world has
//! //part NAME  in a law's file: its part of this name begins; before the first are its functions
//! ```

use std::collections::{BTreeMap, BTreeSet};

/// The features of a world, and its texts.
#[derive(Debug, Default)]
pub(crate) struct Facts {
    has: BTreeSet<String>,
    texts: BTreeMap<String, String>,
}

impl Facts {
    /// Records that the world has `name`, if `is_so`.
    pub fn set(&mut self, name: impl Into<String>, is_so: bool) {
        if is_so {
            self.has.insert(name.into());
        }
    }

    /// Whether the world has it.
    pub fn has(&self, name: &str) -> bool {
        self.has.contains(name)
    }

    /// The text that replaces `@name@`.
    pub fn text(&mut self, name: impl Into<String>, text: impl ToString) {
        self.texts.insert(name.into(), text.to_string());
    }

    /// A part with those of the laws in it. Couplings within the matrices store energy too, so that every law's `potential` is included.
    pub fn with_laws(&self, part: &str, laws: &[(&str, &str)]) -> String {
        let mut lines = String::new();
        for line in part.lines() {
            let Some(name) = line.strip_prefix("//parts ") else {
                lines.extend([line, "\n"]);
                continue;
            };
            for (_, text) in laws.iter().filter(|(law, _)| self.has(law) || name == "potential") {
                lines.push_str(own_part(text, name));
            }
        }
        lines
    }

    /// A part for this world.
    pub fn fill(&self, part: &str) -> String {
        let mut lines = String::new();
        let mut open: Vec<bool> = Vec::new();
        for line in part.lines() {
            if let Some(name) = line.strip_prefix("//if ") {
                open.push(match name.strip_prefix('!') {
                    Some(name) => !self.has(name),
                    None => self.has(name),
                });
            } else if line == "//else" {
                if let Some(last) = open.last_mut() {
                    *last = !*last;
                }
            } else if line == "//end" {
                open.pop();
            } else if open.iter().all(|holds| *holds) {
                lines.push_str(line);
                lines.push('\n');
            }
        }
        let mut filled = lines;
        for (name, text) in &self.texts {
            filled = filled.replace(&format!("@{name}@"), text);
        }
        filled
    }
}

/// The functions of a law's file.
pub(crate) fn functions(law: &str) -> &str {
    law.split(PART).next().unwrap_or("")
}

/// The part of this name of a law's file; empty where it has none.
fn own_part<'t>(law: &'t str, name: &str) -> &'t str {
    law.split(PART).skip(1).find_map(|part| part.strip_prefix(name)?.strip_prefix('\n')).unwrap_or("")
}

const PART: &str = "//part ";
