//! Files that are read.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Opens a file, a device or a FIFO for reading. A FIFO without a writer is an error within seconds; simply opening it would wait for ever.
///
/// # Errors
/// Those of the system, and a FIFO without a writer.
pub fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if std::fs::metadata(path)?.file_type().is_fifo() {
            return fifo::open(path);
        }
    }
    Ok(Box::new(File::open(path)?))
}

#[cfg(unix)]
mod fifo {
    use std::fs::OpenOptions;
    use std::io::{self, Cursor, Read};
    use std::os::unix::fs::OpenOptionsExt;
    use std::path::Path;
    use std::time::{Duration, Instant};

    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

    /// The time that a FIFO waits for a writer.
    const WRITER_TIMEOUT: Duration = Duration::from_secs(2);
    /// The polling period for it.
    const LOOK: Duration = Duration::from_millis(10);

    pub fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
        let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits() as i32;
        let mut file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
        let start = Instant::now();
        let mut first = vec![0; 4096];
        // Without data, a read ends if there is no writer, and would block if there is one.
        let length = loop {
            match file.read(&mut first) {
                Ok(0) if start.elapsed() > WRITER_TIMEOUT => {
                    return Err(io::Error::other("it is a FIFO without a writer"));
                }
                Ok(0) => std::thread::sleep(LOOK),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break 0,
                read => break read?,
            }
        };
        first.truncate(length);
        fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
        Ok(Box::new(Cursor::new(first).chain(file)))
    }
}
