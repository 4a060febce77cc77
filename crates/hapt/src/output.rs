//! Files that are there whole or not at all, and signals that leave nothing behind.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

use tempfile::{Builder, TempPath};

use crate::failure::Failure;
use crate::people;

/// The unfinished files, to be removed when a signal ends the program.
static DRAFTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn drafts() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    DRAFTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file under another name until [`Draft::finish`] puts it in its place; dropped before, it is gone.
#[derive(Debug)]
pub struct Draft {
    file: BufWriter<File>,
    path: TempPath,
    target: PathBuf,
}

impl Draft {
    /// Starts `target`, whose folder is there.
    pub fn new(target: PathBuf) -> io::Result<Self> {
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let prefix = format!(".{name}.");
        let mut builder = Builder::new();
        builder.prefix(&prefix).suffix(".partial");
        #[cfg(unix)]
        {
            // As any other file: what the umask allows.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        // Held while the file appears, so that a signal finds it in the list or not on the disk.
        let mut list = drafts();
        let (file, path) = builder.tempfile_in(folder)?.into_parts();
        list.push(path.to_path_buf());
        drop(list);
        Ok(Draft { file: BufWriter::with_capacity(1 << 16, file), path, target })
    }

    /// Puts the file in its place.
    pub fn finish(self) -> io::Result<PathBuf> {
        let Draft { file, path, target } = self;
        file.into_inner().map_err(io::IntoInnerError::into_error)?;
        let mut list = drafts();
        list.retain(|draft| *draft != *path);
        path.persist(&target).map_err(|error| error.error)?;
        Ok(target)
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

/// A file that an interruption leaves where it is, so that the work can be taken up again, and what is said of it then.
static KEPT: Mutex<Option<String>> = Mutex::new(None);

/// From now on an interruption says `words`; with `None` it has nothing to say.
pub fn when_interrupted(words: Option<String>) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = words;
}

/// The folder for a command's files, made when it is not there.
pub fn folder(path: &Path) -> Result<(), Failure> {
    if let Some(file) = path.ancestors().find(|at| at.exists() && !at.is_dir()) {
        let message = format!("--out {}: {} is a file; a folder is wanted", path.display(), file.display());
        return Err(Failure::input(message));
    }
    fs::create_dir_all(path).map_err(|error| Failure::System(format!("cannot make {}: {error}", path.display())))
}

/// Whether a command ends in order by itself when a signal comes, and the exit code that the signal asks for.
static IN_ORDER: AtomicBool = AtomicBool::new(false);
static SIGNALLED: AtomicU8 = AtomicU8::new(0);

/// From now on the first signal shows in [`signalled`] and does nothing else: the command takes the torque off, finishes its files, and
/// ends. A second one ends the program at once.
pub fn end_in_order() {
    IN_ORDER.store(true, Ordering::SeqCst);
}

/// The exit code that a signal has asked for.
pub fn signalled() -> Option<u8> {
    Some(SIGNALLED.load(Ordering::SeqCst)).filter(|code| *code != 0)
}

/// SIGINT ends the program with 130, SIGTERM with 143; unfinished files are removed.
pub fn watch_for_signals() {
    fn end(code: u8) {
        if IN_ORDER.load(Ordering::SeqCst) && SIGNALLED.swap(code, Ordering::SeqCst) == 0 {
            return;
        }
        exit(code.into())
    }
    fn exit(code: i32) -> ! {
        // Never let go of again: no new draft appears while the program ends.
        let list = drafts();
        for draft in list.iter() {
            let _ = fs::remove_file(draft);
        }
        if let Some(words) = &*KEPT.lock().unwrap_or_else(PoisonError::into_inner) {
            people::say(format_args!("hapt: {words}"));
        }
        std::process::exit(code)
    }
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGINT, SIGTERM};
        // Where signals cannot be watched they end the program all the same, with their own code.
        if let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]) {
            std::thread::spawn(move || {
                for signal in signals.forever() {
                    end(128 + signal as u8);
                }
            });
        }
    }
    #[cfg(windows)]
    {
        let _ = ctrlc::set_handler(|| end(130));
    }
}
