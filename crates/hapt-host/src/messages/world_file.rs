//! A world as a page carries it: its text, and the texts of the files that it names.

use std::collections::BTreeMap;

use hapt_model::Source;
use serde::{Deserialize, Serialize};

use crate::config::WorldConfig;
use crate::rule;

/// A world as a page without a server carries it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorldFile {
    /// The name of its file.
    pub name: String,
    /// TOML.
    pub text: String,
    /// The texts of the files that it names, by those names.
    pub files: BTreeMap<String, String>,
    /// Overrides, `KEY=VALUE`.
    pub sets: Vec<String>,
}

impl WorldFile {
    /// The world of `source` under `sets`, with all files that it names.
    ///
    /// # Errors
    /// In a sentence: as [`hapt_model::World::read`].
    pub fn new(source: &Source, sets: Vec<String>) -> Result<Self, String> {
        let Source { name, text, files, .. } = source.with_files(&sets).map_err(|error| error.to_string())?;
        Ok(WorldFile { name, text, files, sets })
    }

    /// The world for a session behind a page ([`rule::check`]); it is read from nothing but this.
    ///
    /// # Errors
    /// In a sentence: as [`WorldConfig::checked`].
    pub fn config(self) -> Result<WorldConfig, String> {
        let WorldFile { name, text, files, sets } = self;
        WorldConfig::checked(Source { files, ..Source::from_text(name, text) }, sets, rule::check)
    }
}
