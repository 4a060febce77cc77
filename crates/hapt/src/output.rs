//! Outputs: files that appear complete or not at all, devices that are written directly, and the formats of file endings.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

use hapt_log::{RECORDED, is_recorded};
use tempfile::{Builder, TempPath};

use crate::failure::Failure;

/// What a command has begun: its unfinished files, and the folders that it has created, each behind the one around it.
struct Begun {
    drafts: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

static BEGUN: Mutex<Begun> = Mutex::new(Begun { drafts: Vec::new(), folders: Vec::new() });

fn begun() -> MutexGuard<'static, Begun> {
    BEGUN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what a command that failed or was interrupted has begun: the unfinished files, and of the folders that it has created those
/// that are empty. Nothing new appears: the list stays locked.
pub fn remove_unfinished() {
    // The list may be locked during a call to the file system, which may block.
    for _ in 0..100 {
        let list = match BEGUN.try_lock() {
            Ok(list) => list,
            Err(TryLockError::Poisoned(list)) => list.into_inner(),
            Err(TryLockError::WouldBlock) => {
                std::thread::sleep(Duration::from_millis(10));
                continue;
            }
        };
        for draft in &list.drafts {
            let _ = fs::remove_file(draft);
        }
        // On Windows `remove_dir` also takes a link to a folder, which may have come in place of the folder.
        let is_folder = |path: &&PathBuf| fs::symlink_metadata(path).is_ok_and(|there| there.is_dir());
        for folder in list.folders.iter().rev().filter(is_folder) {
            let _ = fs::remove_dir(folder);
        }
        std::mem::forget(list);
        return;
    }
}

/// The output to a target: a file under another name until [`Draft::finish`] moves it to its place; dropped earlier it is removed and an
/// older file is unchanged; or a device, a pipe or a FIFO, which takes the bytes as they come.
#[derive(Debug)]
pub struct Draft {
    file: BufWriter<File>,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Temporary { path: TempPath, target: PathBuf, named: PathBuf },
    Through(PathBuf),
}

impl Draft {
    /// Starts `target`, whose folder exists. A link is followed to the file that it names.
    pub fn new(named: PathBuf) -> io::Result<Self> {
        if let Some(file) = through(&named)? {
            return Ok(Draft { file: BufWriter::with_capacity(1 << 16, file), place: Place::Through(named) });
        }
        let target = followed(&named)?;
        let there = protected(&target)?;
        if is_recorded(&target) {
            return Err(io::Error::other(RECORDED));
        }
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let prefix = draft_prefix(&target);
        let mut builder = Builder::new();
        builder.prefix(&prefix).suffix(DRAFT);
        #[cfg(unix)]
        {
            // The permissions of the umask, as for any other file.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        // Held while the file appears, so that a signal finds it in the list or not on the disk.
        let mut list = begun();
        let (file, path) = builder.tempfile_in(folder).map_err(plain)?.into_parts();
        list.drafts.push(path.to_path_buf());
        drop(list);
        if let Some(there) = there {
            // The new file has the permissions of the old one. It fails on a file system without permissions, which has none to keep.
            let _ = file.set_permissions(there);
        }
        Ok(Draft { file: BufWriter::with_capacity(1 << 16, file), place: Place::Temporary { path, target, named } })
    }

    /// The file, for writing after it is in its place.
    pub fn handle(&self) -> io::Result<File> {
        self.file.get_ref().try_clone()
    }

    /// Moves the file to its place; returns its name.
    pub fn finish(self) -> io::Result<PathBuf> {
        let Draft { file, place } = self;
        file.into_inner().map_err(io::IntoInnerError::into_error)?;
        match place {
            Place::Through(named) => Ok(named),
            Place::Temporary { path, target, named } => {
                let mut list = begun();
                list.drafts.retain(|draft| *draft != *path);
                path.persist(&target).map_err(|error| error.error)?;
                Ok(named)
            }
        }
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Starts a log for `named` with `start`, which takes its draft and holds it: refused where another run has its log there, or still its
/// draft. If two start at once, one is first.
pub fn recorded<T>(named: &Path, start: impl FnOnce(Draft) -> io::Result<T>) -> io::Result<T> {
    let target = followed(named)?;
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let _lock = locked(folder);
    let prefix = draft_prefix(&target);
    let drafts = fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        name.starts_with(&prefix) && name.ends_with(DRAFT)
    });
    if drafts.into_iter().any(|draft| is_recorded(&draft.path())) {
        return Err(io::Error::other(RECORDED));
    }
    start(Draft::new(named.to_path_buf())?)
}

/// Locks a folder's files against other runs of hapt that request the same, where the system has locks for folders, until it is dropped.
pub fn locked(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok().filter(|_| cfg!(unix))?;
    folder.lock().ok().map(|()| folder)
}

/// The ending of a draft's name.
const DRAFT: &str = ".partial";

/// How the name of a target's drafts begins.
fn draft_prefix(target: &Path) -> String {
    format!(".{}.", target.file_name().unwrap_or_default().to_string_lossy())
}

/// An error without the path of the draft, which the user did not name.
fn plain(error: io::Error) -> io::Error {
    let text = error.to_string();
    text.split_once(" at path ").map_or(error, |(cause, _)| io::Error::other(cause))
}

/// The permissions of the existing file; an error where it is write-protected.
pub fn protected(target: &Path) -> io::Result<Option<fs::Permissions>> {
    match fs::metadata(target) {
        Ok(there) if there.permissions().readonly() => Err(io::Error::other("the file is write-protected")),
        Ok(there) => Ok(Some(there.permissions())),
        Err(_) => Ok(None),
    }
}

/// The file that a path names behind its links, which need not exist yet.
pub fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    // As many as Linux follows.
    for _ in 0..40 {
        if !fs::symlink_metadata(&path).is_ok_and(|there| there.is_symlink()) {
            return Ok(path);
        }
        let to = fs::read_link(&path)?;
        path = path.parent().unwrap_or(Path::new("")).join(to);
    }
    Err(io::Error::other("too many links"))
}

/// Opens a target at `path` that is not a regular file, such as a device; `None` where a regular file is or may be created.
#[cfg(unix)]
fn through(path: &Path) -> io::Result<Option<File>> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
    use std::time::Instant;

    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use rustix::io::Errno;

    /// The time that a FIFO waits for a reader.
    const READER_TIMEOUT: Duration = Duration::from_secs(2);

    if [Path::new("/dev/stdout"), Path::new("/dev/fd/1")].contains(&path) {
        // The same open file, so that it continues at its offset.
        return Ok(Some(io::stdout().as_fd().try_clone_to_owned()?.into()));
    }
    let Ok(there) = fs::metadata(path) else { return Ok(None) };
    let kind = there.file_type();
    if kind.is_file() {
        return Ok(None);
    }
    if kind.is_dir() {
        return Err(io::Error::other("it is a folder; expected a file"));
    }
    if kind.is_block_device() || kind.is_socket() {
        let what = if kind.is_socket() { "a socket" } else { "a disk" };
        return Err(io::Error::other(format!("it is {what}, not a place for a file")));
    }
    // Opened without blocking, neither for a FIFO's reader nor for a serial port's line.
    let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits() as i32;
    let start = Instant::now();
    let file = loop {
        match OpenOptions::new().write(true).custom_flags(flags).open(path) {
            Err(error) if error.raw_os_error() == Some(Errno::NXIO.raw_os_error()) && kind.is_fifo() => {
                if start.elapsed() > READER_TIMEOUT {
                    return Err(io::Error::other("it is a FIFO without a reader"));
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            opened => break opened?,
        }
    };
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(Some(file))
}

#[cfg(not(unix))]
fn through(path: &Path) -> io::Result<Option<File>> {
    if is_null(path) {
        return OpenOptions::new().write(true).open(path).map(Some);
    }
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(io::Error::other("it is a folder; expected a file")),
        Ok(there) if !there.is_file() => OpenOptions::new().write(true).open(path).map(Some),
        _ => Ok(None),
    }
}

/// Whether a path is Windows' null device, which is in every folder and has no metadata.
fn is_null(path: &Path) -> bool {
    cfg!(windows) && path.file_name().is_some_and(|name| name.eq_ignore_ascii_case("nul"))
}

/// Refuses a target that is not a regular file, next to which a partial file cannot be kept and resumed: a device, a FIFO, a folder.
pub fn regular(flag: &str, path: &Path) -> Result<(), Failure> {
    match fs::metadata(path) {
        Ok(there) if !there.is_file() => {
            let what = if there.is_dir() { "a folder" } else { "a device or a FIFO" };
            Err(Failure::input(format!("{flag} {}: it is {what}; expected a file", path.display())))
        }
        _ if is_null(path) => {
            Err(Failure::input(format!("{flag} {}: it is a device; expected a file", path.display())))
        }
        _ => protected(path).map(drop).map_err(|error| Failure::write(path.display(), error)),
    }
}

/// Refuses two outputs in one file, and an output in a file that is read: one would destroy the other. Outputs are named by their flags,
/// inputs by their kind.
pub fn apart(outputs: &[(&str, &Path)], inputs: &[(&str, PathBuf)]) -> Result<(), Failure> {
    let read: Vec<_> = inputs.iter().filter_map(|(what, path)| Some((what, place(path)?))).collect();
    let written: Vec<_> =
        outputs.iter().filter_map(|(flag, path)| Some((flag, path.display(), place(path)?))).collect();
    for (i, (flag, name, here)) in written.iter().enumerate() {
        if let Some((what, _)) = read.iter().find(|(_, there)| there == here) {
            return Err(Failure::input(format!("{flag} {name}: that is {what} itself; expected another name")));
        }
        if let Some((other, ..)) = written[..i].iter().find(|(.., there)| there == here) {
            return Err(Failure::input(format!("{other} and {flag} are the same file, {name}; use two files")));
        }
    }
    Ok(())
}

/// The requested outputs.
pub fn given<'a>(outputs: &[(&'a str, &'a Option<PathBuf>)]) -> Vec<(&'a str, &'a Path)> {
    outputs.iter().filter_map(|(flag, path)| Some((*flag, path.as_deref()?))).collect()
}

/// The canonical place of a file, existing or not; `None` of a target that is not a file.
fn place(path: &Path) -> Option<PathBuf> {
    let path = followed(path).ok()?;
    if is_null(&path) || fs::metadata(&path).is_ok_and(|there| !there.is_file()) {
        return None;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
}

/// Endings of files, which no folder of a command has.
const ENDINGS: [&str; 10] = ["csv", "parquet", "mcap", "svg", "png", "pdf", "html", "json", "toml", "txt"];

/// The format of a file's ending, of those that `flag` writes; the first of them without an ending. Refuses a folder too, before the work.
pub fn format<'a>(flag: &str, path: &Path, formats: &[&'a str]) -> Result<&'a str, Failure> {
    if path.is_dir() {
        return Err(Failure::input(format!("{flag} {}: it is a folder; expected a file", path.display())));
    }
    let Some(ending) = path.extension() else { return Ok(formats[0]) };
    let ending = ending.to_string_lossy().to_lowercase();
    let found = formats.iter().find(|format| **format == ending).copied().ok_or_else(|| {
        let wanted: Vec<String> = formats.iter().map(|format| format!("FILE.{format}")).collect();
        let wanted = match &wanted[..] {
            [all @ .., last] if !all.is_empty() => format!("{} or {last}", all.join(", ")),
            _ => wanted.concat(),
        };
        Failure::input(format!("{flag} {}: expected {wanted}", path.display()))
    })?;
    built(flag, path)?;
    Ok(found)
}

/// Refuses a file whose format is a feature that this program was built without.
pub fn built(flag: &str, path: &Path) -> Result<(), Failure> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    built_with(&format!("{flag} {}", path.display()), &ending)
}

/// The same for a format; `requested` is the request in words.
pub fn built_with(requested: &str, format: &str) -> Result<(), Failure> {
    let features =
        [("parquet", cfg!(feature = "parquet")), ("pdf", cfg!(feature = "pdf")), ("png", cfg!(feature = "png"))];
    match features.into_iter().find(|(feature, is_built)| !is_built && *feature == format) {
        None => Ok(()),
        Some((feature, _)) => Err(Failure::input(format!(
            "{requested}: this hapt was built without its feature {feature}; expected another format, or a build with --features {feature}"
        ))),
    }
}

/// A draft of these bytes for `target`.
pub fn draft(target: &Path, bytes: &[u8]) -> Result<Draft, Failure> {
    let failed = |error| Failure::write(target.display(), error);
    let mut draft = Draft::new(target.to_path_buf()).map_err(failed)?;
    draft.write_all(bytes).and_then(|()| draft.flush()).map_err(failed)?;
    Ok(draft)
}

/// The folder for a command's files, created if missing, as by [`make`].
pub fn folder(flag: &str, path: &Path) -> Result<(), Failure> {
    if let Some(file) = path.ancestors().find(|at| at.exists() && !at.is_dir()) {
        let message = format!("{flag} {}: {} is a file; expected a folder", path.display(), file.display());
        return Err(Failure::input(message));
    }
    if path.is_symlink() && !path.exists() {
        let message = format!("{flag} {}: it is a broken link; expected a folder", path.display());
        return Err(Failure::input(message));
    }
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    if ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) && !path.exists() {
        let message = format!("{flag} {}: expected a folder, and this is the name of a file", path.display());
        return Err(Failure::input(message));
    }
    make(path)
}

/// Creates a folder and those around it that are missing. [`remove_unfinished`] removes those of them that stay empty.
pub fn make(path: &Path) -> Result<(), Failure> {
    let mut missing: Vec<&Path> =
        path.ancestors().take_while(|at| !at.as_os_str().is_empty() && !at.exists()).collect();
    missing.reverse();
    for folder in missing {
        // Held while the folder appears, so that a signal finds it in the list or not on the disk.
        let mut list = begun();
        match fs::create_dir(folder) {
            Ok(()) => list.folders.push(folder.to_path_buf()),
            // Another program was faster, or it is `new/..`: not this command's to remove.
            Err(_) if folder.is_dir() => {}
            Err(error) => return Err(Failure::System(format!("cannot make {}: {error}", path.display()))),
        }
    }
    Ok(())
}
