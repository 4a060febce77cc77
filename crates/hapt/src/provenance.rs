//! The origin of the files of runs in a folder: a list next to them, since a CSV has no field for it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use hapt_model::Source;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::output;

/// The list's name.
const NAME: &str = ".hapt-runs.json";

/// The origin of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// The world's file, absolute; `-` for standard input, `@NAME` for a built-in world.
    world: String,
    /// Its title.
    title: Option<String>,
    /// Its overrides.
    set: Vec<String>,
}

impl Made {
    /// Of the world, or the network, at `path` on the command line.
    pub fn by(path: &Path, source: &Source, title: Option<&str>, sets: &[String]) -> Self {
        let is_file = path.as_os_str() != "-" && !source.name.starts_with('@');
        let world = match fs::canonicalize(path) {
            Ok(whole) if is_file && whole.is_file() => whole.display().to_string(),
            // A pipe has another name each time.
            _ if is_file => "-".into(),
            _ => path.display().to_string(),
        };
        Made { world, title: title.map(str::to_string), set: sets.to_vec() }
    }

    /// Whether both are runs of one world, with any overrides: of one file, or of one title where neither has a file.
    fn is_of(&self, other: &Made) -> bool {
        self.world == other.world && (self.world != "-" || self.title == other.title)
    }
}

/// The list of a folder.
pub struct Provenance {
    folder: PathBuf,
    made: Made,
}

fn read(path: &Path) -> Result<BTreeMap<String, Made>, Failure> {
    if !path.is_file() {
        return Ok(BTreeMap::new());
    }
    let bad = |error: String| {
        Failure::input(format!(
            "{}: not a list of what made the files beside it ({error}); give another folder, or remove the list",
            path.display()
        ))
    };
    let text = fs::read_to_string(path).map_err(|error| bad(error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| bad(error.to_string()))
}

impl Provenance {
    /// Refuses to replace files in `folder` that another world has made, unless `force` allows it. A file that is not in the list may be
    /// replaced.
    pub fn check<'a>(
        folder: &Path,
        made: Made,
        targets: impl IntoIterator<Item = &'a PathBuf>,
        force: bool,
    ) -> Result<Self, Failure> {
        let list = read(&folder.join(NAME))?;
        let other = targets.into_iter().find_map(|target| {
            let before = list.get(&name(target)?)?;
            (target.exists() && !before.is_of(&made)).then_some((target, before))
        });
        match other {
            Some((target, before)) if !force => {
                let title = before.title.as_deref().map(|title| format!(", {title:?}")).unwrap_or_default();
                let world = if before.world == "-" { "standard input" } else { &before.world };
                Err(Failure::input(format!(
                    "--out {}: {} is a run of another world ({world}{title}); give another folder, or --force to replace it",
                    folder.display(),
                    target.display()
                )))
            }
            _ => Ok(Provenance { folder: folder.to_path_buf(), made }),
        }
    }

    /// Adds files that are now in their places.
    pub fn add<'a>(&self, targets: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Failure> {
        let _lock = output::locked(&self.folder);
        let path = self.folder.join(NAME);
        let mut list = read(&path)?;
        let before = list.clone();
        list.extend(targets.into_iter().filter_map(|target| Some((name(target)?, self.made.clone()))));
        if list == before {
            return Ok(());
        }
        let text = serde_json::to_string_pretty(&list).map_err(|error| Failure::System(error.to_string()))? + "\n";
        output::draft(&path, text.as_bytes())?.finish().map(drop).map_err(|error| Failure::write(path.display(), error))
    }
}

/// The name of a regular file, without its folder.
fn name(target: &Path) -> Option<String> {
    target.is_file().then(|| target.file_name()).flatten().map(|name| name.to_string_lossy().into_owned())
}
