//! A world file's text, and the folder that its path files are relative to.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::error::{Error, ErrorKind, Location};

/// A world file larger than this is refused: 1 MiB.
pub const LARGEST_SOURCE: u64 = 1 << 20;

/// The text of a world file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// What errors call it.
    pub name: String,
    /// TOML.
    pub text: String,
    /// What the path files in it are relative to, and must stay inside of.
    pub folder: PathBuf,
}

impl Source {
    /// Reads a file; its folder is the one that it is in.
    ///
    /// # Errors
    /// [`ErrorKind::Unreadable`] for a file that is missing, unreadable or larger than 1 MiB, [`ErrorKind::Syntax`] for
    /// one that is not UTF-8.
    pub fn open(path: impl AsRef<Path>) -> Result<Source, Error> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| unreadable(&name, &error))?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        Ok(Source { text: read(&name, file)?, name, folder })
    }

    /// Reads standard input; its folder is the current one.
    ///
    /// # Errors
    /// As [`Source::open`].
    pub fn stdin() -> Result<Source, Error> {
        let name = "<stdin>";
        Ok(Source { name: name.to_string(), text: read(name, std::io::stdin().lock())?, folder: PathBuf::from(".") })
    }

    /// A text that is there already; its folder is the current one.
    pub fn from_text(name: impl Into<String>, text: impl Into<String>) -> Source {
        Source { name: name.into(), text: text.into(), folder: PathBuf::from(".") }
    }
}

fn read(name: &str, from: impl Read) -> Result<String, Error> {
    let mut bytes = Vec::new();
    from.take(LARGEST_SOURCE + 1).read_to_end(&mut bytes).map_err(|error| unreadable(name, &error))?;
    if bytes.len() as u64 > LARGEST_SOURCE {
        return Err(too_large(name));
    }
    String::from_utf8(bytes).map_err(|error| {
        let text = String::from_utf8_lossy(error.as_bytes());
        // Up to the first bad byte both texts are the same.
        let start = error.utf8_error().valid_up_to();
        Error {
            kind: ErrorKind::Syntax,
            key: String::new(),
            message: "the file is not UTF-8 text".to_string(),
            location: Some(Box::new(Location::new(name, &text, start..start + 1))),
        }
    })
}

fn unreadable(name: &str, error: &std::io::Error) -> Error {
    Error {
        kind: ErrorKind::Unreadable,
        key: String::new(),
        message: format!("cannot read {name}: {error}"),
        location: None,
    }
}

pub(crate) fn too_large(name: &str) -> Error {
    let message = format!("{name} is larger than 1 MiB, the most that a world file may have");
    Error { kind: ErrorKind::Unreadable, key: String::new(), message, location: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_brings_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.toml");
        std::fs::write(&path, "a = 1").unwrap();
        let source = Source::open(&path).unwrap();
        assert_eq!((source.text.as_str(), source.folder.as_path()), ("a = 1", folder.path()));
    }

    #[test]
    fn files_that_cannot_be_read_say_why() {
        let error = Source::open("no/such/file.toml").unwrap_err();
        assert_eq!(error.kind, ErrorKind::Unreadable);
        assert_eq!(error.to_string(), "cannot read no/such/file.toml: No such file or directory (os error 2)");
        assert!(Source::open("/").is_err());
    }

    #[test]
    fn more_than_a_mebibyte_is_refused_without_reading_it_all() {
        assert_eq!(read("w", &[b'#'; 1 << 20][..]).map(|text| text.len()), Ok(1 << 20));
        assert_eq!(
            read("w", std::io::repeat(b'#')).unwrap_err().to_string(),
            "w is larger than 1 MiB, the most that a world file may have"
        );
    }

    #[test]
    fn bytes_that_are_not_utf8_are_shown_where_they_stand() {
        assert_eq!(
            read("w", &b"a = 1\nb = \"\xff\"\n"[..]).unwrap_err().to_string(),
            "the file is not UTF-8 text\n --> w:2:6\n  |\n2 | b = \"\u{fffd}\"\n  |      ^"
        );
    }
}
