//! An FMU as a file: model description, world and libraries in a ZIP archive, with the same bytes for the same content.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::{Compression, write::DeflateEncoder};
use hapt_model::{Parameter, World};
use rawzip::{CompressionMethod, ZipArchiveWriter};

use crate::Kind;
use crate::description::{IDENTIFIER, description};
use crate::model::{Model, WORLD};
use crate::variable::{Role, Value, Variable};

/// The versions of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0
    Two,
    /// FMI 3.0
    Three,
}

impl Version {
    /// As in a model description.
    pub fn number(self) -> &'static str {
        match self {
            Version::Two => "2.0",
            Version::Three => "3.0",
        }
    }

    /// Whether its model description lists the variable. In FMI 2.0 whole numbers have 32 bits, and time is optional: the FMI Library
    /// demands a start value of it, which the standard forbids.
    pub(crate) fn takes(self, variable: &Variable) -> bool {
        match (self, &variable.start) {
            (Version::Two, _) if variable.role == Role::Time => false,
            (Version::Two, Value::Whole(start)) => i32::try_from(*start).is_ok(),
            (Version::Two, Value::Real(_) | Value::Text(_)) | (Version::Three, _) => true,
        }
    }
}

/// The platform of a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Platform {
    /// The processor's name in FMI 3.0.
    processor: &'static str,
    /// The system's name in FMI 3.0.
    system: &'static str,
}

impl Platform {
    /// The platform of a library, from its header.
    ///
    /// # Errors
    /// In a sentence: no library, or not hapt's.
    pub fn of(library: &[u8]) -> Result<Platform, String> {
        let word = |at: usize| Some(u16::from_le_bytes(library.get(at..at + 2)?.try_into().ok()?));
        let long = |at: usize| Some(u32::from_le_bytes(library.get(at..at + 4)?.try_into().ok()?));
        let (system, machine) = match library {
            [0x7f, b'E', b'L', b'F', 2, ..] => ("linux", word(0x12).map(u32::from)),
            [b'M', b'Z', ..] => {
                let header = long(0x3c).map(|at| at as usize).filter(|at| library.get(*at..at + 4) == Some(b"PE\0\0"));
                ("windows", header.and_then(|at| word(at + 4)).map(u32::from))
            }
            [0xcf, 0xfa, 0xed, 0xfe, ..] => ("darwin", long(4)),
            _ => return Err("it is no library for Linux, Windows or macOS of 64 bits".into()),
        };
        let processor = match (system, machine) {
            ("linux", Some(0x3e)) | ("windows", Some(0x8664)) | ("darwin", Some(0x0100_0007)) => "x86_64",
            ("linux", Some(0xb7)) | ("windows", Some(0xaa64)) | ("darwin", Some(0x0100_000c)) => "aarch64",
            _ => return Err("it is for a processor that is neither x86-64 nor aarch64".into()),
        };
        if !library.windows(10).any(|bytes| bytes == b"fmi3DoStep") {
            return Err(format!("it has no fmi3DoStep: it is not {IDENTIFIER}"));
        }
        Ok(Platform { processor, system })
    }

    /// The folder of its libraries below `binaries`.
    pub fn folder(self, version: Version) -> String {
        match (version, self.system, self.processor) {
            (Version::Two, "linux", "x86_64") => "linux64".into(),
            (Version::Two, "windows", "x86_64") => "win64".into(),
            (Version::Two, "darwin", _) => "darwin64".into(),
            _ => format!("{}-{}", self.processor, self.system),
        }
    }

    fn suffix(self) -> &'static str {
        match self.system {
            "windows" => "dll",
            "darwin" => "dylib",
            _ => "so",
        }
    }
}

/// The library's file as cargo builds it here.
pub const LIBRARY: &str = match (DLL_PREFIX.is_empty(), DLL_SUFFIX.as_bytes()) {
    (true, _) => "hapt_fmi.dll",
    (false, [b'.', b'd', ..]) => "libhapt_fmi.dylib",
    (false, _) => "libhapt_fmi.so",
};

/// The possible places of the library for a program at `program`: in its folder, where cargo builds it, where it is installed.
pub fn places(program: &Path) -> [PathBuf; 3] {
    ["", "deps", "../lib/hapt"].map(|place| program.parent().unwrap_or(Path::new("")).join(place).join(LIBRARY))
}

/// An FMU called `name` of a world, with libraries for at least one platform. `written` are the keys as in the world's file, for their
/// units.
///
/// # Errors
/// In a sentence: the core refuses the world, a file is no library, or two are for one platform.
pub fn write(
    world: &World,
    written: &[Parameter],
    name: &str,
    kind: Kind,
    version: Version,
    libraries: &[(PathBuf, Vec<u8>)],
) -> Result<Vec<u8>, String> {
    let model = Model::new(kind, version, world)?;
    let mut files = vec![
        ("modelDescription.xml".to_string(), description(&model, name, written, version)),
        (format!("resources/{WORLD}"), model.source.text.clone().into_bytes()),
    ];
    if libraries.is_empty() {
        return Err("an FMU needs a library for at least one platform".into());
    }
    for (path, library) in libraries {
        let platform = Platform::of(library).map_err(|why| format!("{}: {why}", path.display()))?;
        let file = format!("binaries/{}/{IDENTIFIER}.{}", platform.folder(version), platform.suffix());
        if files.iter().any(|(other, _)| *other == file) {
            return Err(format!("{}: there is another library for {}", path.display(), platform.folder(version)));
        }
        files.push((file, library.clone()));
    }
    archive(&files).map_err(|error| format!("cannot pack the FMU: {error}"))
}

fn archive(files: &[(String, Vec<u8>)]) -> Result<Vec<u8>, rawzip::Error> {
    let mut archive = ZipArchiveWriter::new(Vec::new());
    for (name, bytes) in files {
        // Without a time every file has the same one: 1980-01-01.
        let file = archive.new_file(name).compression_method(CompressionMethod::DEFLATE).unix_permissions(0o644);
        let (mut entry, data) = file.start()?;
        let mut data = data.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
        data.write_all(bytes)?;
        let (encoder, sums) = data.finish()?;
        encoder.finish()?;
        entry.finish(sums)?;
    }
    archive.finish()
}
