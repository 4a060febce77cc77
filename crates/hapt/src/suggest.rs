//! The file, world or device that was probably meant.

use std::path::Path;

use hapt_model::did_you_mean;

use hapt_model::builtin;

/// `; did you mean "wheel.toml"?`: a file in the folder of the missing one, or a built-in world.
pub fn file(missing: &Path) -> String {
    if missing.exists() {
        return String::new();
    }
    let Some(name) = missing.file_name().and_then(|name| name.to_str()) else { return String::new() };
    let folder = missing.parent().unwrap_or(Path::new(""));
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(here).into_iter().flatten().flatten().take(1000);
    // A similar name of another kind of file is not suggested.
    let names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    match nearest(name, names.iter().map(String::as_str)) {
        Some(near) => format!("; did you mean {:?}?", folder.join(near).display().to_string()),
        None => builtin::meant(&missing.display().to_string()),
    }
}

/// The name with this stem and any ending; else the nearest.
fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let stem = |name: &str| Path::new(name).file_stem().map(|stem| stem.to_string_lossy().to_lowercase());
    let same = |other: &&str| stem(other) == stem(name) || other.eq_ignore_ascii_case(name);
    names.clone().find(same).or_else(|| names.into_iter().find(|other| !did_you_mean(name, [*other]).is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_is_answered_with_its_neighbour_or_with_a_world_that_is_built_in() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("wheel.toml"), "").unwrap();
        let hint = |name: &str| file(&folder.path().join(name));
        for name in ["weehl.toml", "wheel", "WHEEL.TOML", "wheel.tom"] {
            // Where case does not matter, as on Windows, WHEEL.TOML is the file itself.
            let is_there = folder.path().join(name).exists();
            assert_eq!(hint(name).contains("wheel.toml\"?"), !is_there, "{name}: {}", hint(name));
        }
        assert_eq!(hint("wheel.toml"), "");
        assert_eq!(hint("entirely-else.toml"), "");
        for name in ["notes/euler", "euler.toml", "notes/eulr", "worlds/notes/euler.toml"] {
            assert!(builtin::meant(name).contains("@notes/euler"), "{name}");
        }
    }
}
