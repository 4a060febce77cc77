//! A world or a network embedded in a page: its text, and the texts of the files that it names.

use std::collections::BTreeMap;

use hapt_analysis::{NetworkCheck, StationFindings};
use hapt_model::{Source, System};
use serde::{Deserialize, Serialize};

use crate::config::WorldConfig;
use crate::rule;

/// A world embedded in a page without a server.
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

    /// The world for a session behind a page ([`rule::check`]), read only from these texts.
    ///
    /// # Errors
    /// In a sentence: as [`WorldConfig::checked`].
    pub fn config(self) -> Result<WorldConfig, String> {
        let WorldFile { name, text, files, sets } = self;
        WorldConfig::checked(Source { files, ..Source::from_text(name, text) }, sets, rule::check)
    }
}

/// A network embedded in a page without a server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NetworkFile {
    /// The network's file, with those of its stations' worlds.
    pub file: WorldFile,
    /// The certificate of each station without its links.
    pub alone: Vec<StationFindings>,
}

impl NetworkFile {
    /// The network that was read from `source` under `sets`, with its certificate and all files that it names.
    ///
    /// # Errors
    /// In a sentence: two different files have one name, or as [`System::read_network`].
    pub fn new(source: &Source, sets: Vec<String>, network: &System, check: &NetworkCheck) -> Result<Self, String> {
        let mut files = source.files.clone();
        for station in &network.stations {
            let own = station.source.with_files(&station.sets).map_err(|error| error.to_string())?;
            for (name, text) in own.files.into_iter().chain([(station.file.clone(), own.text)]) {
                if files.insert(name.clone(), text.clone()).is_some_and(|other| other != text) {
                    return Err(format!("its stations name two different files {name}, in different folders"));
                }
            }
        }
        let file = WorldFile { name: source.name.clone(), text: source.text.clone(), files, sets };
        Ok(NetworkFile { file, alone: check.station_findings() })
    }

    /// The network, read only from these texts.
    ///
    /// # Errors
    /// In a sentence: as [`System::read_network`].
    pub fn network(&self) -> Result<System, String> {
        let WorldFile { name, text, files, sets } = &self.file;
        let source = Source { files: files.clone(), ..Source::from_text(name, text) };
        System::read_network(&source, sets).map_err(|error| error.to_string())
    }
}
