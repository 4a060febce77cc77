//! The parts of the C file, as they stand beside the core's sources: lines of C, some for certain worlds only.
//!
//! ```text
//! //if NAME    or //if !NAME: what follows stands in the file where the world has this, or has it not
//! //else
//! //end
//! @name@       a text or a number of the world
//! ```

use std::collections::{BTreeMap, BTreeSet};

/// What a world has, and its texts.
#[derive(Debug, Default)]
pub(crate) struct Facts {
    has: BTreeSet<&'static str>,
    texts: BTreeMap<String, String>,
}

impl Facts {
    /// The world has this, where it is so.
    pub fn set(&mut self, name: &'static str, is_so: bool) {
        if is_so {
            self.has.insert(name);
        }
    }

    /// Whether it has.
    pub fn has(&self, name: &str) -> bool {
        self.has.contains(name)
    }

    /// What stands for `@name@`.
    pub fn text(&mut self, name: impl Into<String>, text: impl ToString) {
        self.texts.insert(name.into(), text.to_string());
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
