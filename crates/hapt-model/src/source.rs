//! A world file's text, and the folder that its path files are relative to.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::error::{Error, ErrorKind, Location, visible};

/// The name of standard input in errors.
pub(crate) const STDIN: &str = "<stdin>";
/// A world file larger than this is refused: 1 MiB.
pub const LARGEST_SOURCE: u64 = 1 << 20;

/// The text of a world file.
///
/// ```
/// use hapt_model::{Source, World};
///
/// let source = Source::from_text("wheel.toml", "loop.period = \"1 kg\"");
/// let error = World::read(&source, &[]).unwrap_err().to_string();
/// assert!(error.contains("expected a time (s)") && error.contains("wheel.toml:1:"), "{error}");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Its name in errors.
    pub name: String,
    /// TOML.
    pub text: String,
    /// The folder that its path files are relative to, and must be inside.
    pub folder: PathBuf,
    /// The texts of files that come with the world, by its names for them. They are not searched in the folder.
    pub files: BTreeMap<String, String>,
}

impl Source {
    /// Reads a file; its folder is the one that it is in.
    ///
    /// # Errors
    /// [`ErrorKind::Unreadable`] for a file that is missing or unreadable, and as [`Source::from_bytes`].
    pub fn open(path: impl AsRef<Path>) -> Result<Source, Error> {
        let path = path.as_ref();
        // A name may contain a line break, or characters that move the cursor.
        let name: String = path.display().to_string().chars().map(visible).collect();
        let file = crate::input::open(path).map_err(|error| unreadable(&name, &error))?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        Ok(Source { folder, ..read(&name, file)? })
    }

    /// Reads standard input; its folder is the current one.
    ///
    /// # Errors
    /// As [`Source::open`].
    pub fn stdin() -> Result<Source, Error> {
        read(STDIN, std::io::stdin().lock())
    }

    /// The bytes of a file that is there already; its folder is the current one.
    ///
    /// # Errors
    /// [`ErrorKind::Unreadable`] for more than 1 MiB, [`ErrorKind::Syntax`] for what is not UTF-8.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<Source, Error> {
        let name = name.into();
        if bytes.len() as u64 > LARGEST_SOURCE {
            return Err(too_large(&name));
        }
        Ok(Source::from_text(name.clone(), decoded(&name, bytes)?))
    }

    /// A text that is there already; its folder is the current one.
    pub fn from_text(name: impl Into<String>, text: impl Into<String>) -> Source {
        Source { name: name.into(), text: text.into(), folder: PathBuf::from("."), files: BTreeMap::new() }
    }
}

fn read(name: &str, from: impl Read) -> Result<Source, Error> {
    let mut bytes = Vec::new();
    from.take(LARGEST_SOURCE + 1).read_to_end(&mut bytes).map_err(|error| unreadable(name, &error))?;
    Source::from_bytes(name, bytes)
}

/// The text of a file, or the kind of its bytes.
pub(crate) fn decoded(name: &str, bytes: Vec<u8>) -> Result<String, Error> {
    let error = |message, location| Err(Error { kind: ErrorKind::Syntax, key: String::new(), message, location });
    if let Some(encoding) = other_encoding(&bytes) {
        return error(format!("{name} is {encoding}, not UTF-8; save it as UTF-8"), None);
    }
    String::from_utf8(bytes).or_else(|failure| {
        let text = String::from_utf8_lossy(failure.as_bytes());
        // Up to the first bad byte both texts are the same.
        let start = failure.utf8_error().valid_up_to();
        let location = Location::new(name, &text, start..start + 1);
        error("the file is not UTF-8 text; save it as UTF-8".to_string(), Some(Box::new(location)))
    })
}

/// The encoding that a byte order mark names, or that the NULs next to the first two characters show.
fn other_encoding(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => Some("UTF-32"),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Some("UTF-16"),
        [1..=127, 0, 1..=127, 0, ..] | [0, 1..=127, 0, 1..=127, ..] => Some("UTF-16"),
        _ => None,
    }
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
        assert_eq!(read("w", &[b'#'; 1 << 20][..]).map(|source| source.text.len()), Ok(1 << 20));
        assert_eq!(
            read("w", std::io::repeat(b'#')).unwrap_err().to_string(),
            "w is larger than 1 MiB, the most that a world file may have"
        );
    }

    #[test]
    fn bytes_that_are_not_utf8_are_shown_where_they_stand() {
        assert_eq!(
            read("w", &b"a = 1\nb = \"\xff\"\n"[..]).unwrap_err().to_string(),
            "the file is not UTF-8 text; save it as UTF-8\n --> w:2:6\n  |\n2 | b = \"\u{fffd}\"\n  |      ^"
        );
    }

    #[test]
    fn a_file_in_another_encoding_is_told_so() {
        let utf16 = |order: fn(u16) -> [u8; 2], mark: &str| {
            format!("{mark}[loop]\n").encode_utf16().flat_map(order).collect::<Vec<u8>>()
        };
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            for mark in ["\u{feff}", ""] {
                assert_eq!(
                    Source::from_bytes("w.toml", utf16(order, mark)).unwrap_err().to_string(),
                    "w.toml is UTF-16, not UTF-8; save it as UTF-8"
                );
            }
        }
        let utf32 = "\u{feff}a".chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
        assert!(Source::from_bytes("w", utf32).is_err_and(|error| error.message.contains("is UTF-32")));
        for fine in ["", "a", "\u{feff}[loop]", "\u{1}\0"] {
            assert_eq!(Source::from_bytes("w", fine.into()).map(|source| source.text), Ok(fine.to_string()));
        }
    }
}
