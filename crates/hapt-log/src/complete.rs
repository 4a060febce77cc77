//! A file that is complete at every moment: the end of an MCAP file follows the last flush, and the next flush replaces it.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

use crate::container::{DATA_END, FOOTER, MAGIC};

/// The end of a file without an index: DataEnd without a checksum, a Footer without a summary, and the magic bytes. Readers that start at
/// the end then read from the beginning.
fn end() -> Vec<u8> {
    let mut end = Vec::new();
    for (opcode, length) in [(DATA_END, 4_u64), (FOOTER, 20)] {
        end.push(opcode);
        end.extend(length.to_le_bytes());
        end.resize(end.len() + length as usize, 0);
    }
    end.extend(MAGIC);
    end
}

/// Writes each flush together with the end of the file in one system call.
pub(crate) struct Complete {
    file: File,
    /// Bytes since the last flush.
    waiting: Vec<u8>,
    /// Bytes of the file before its end.
    length: u64,
}

impl Complete {
    /// A writer on an empty file.
    pub fn new(file: File) -> Self {
        Complete { file, waiting: Vec::new(), length: 0 }
    }
}

impl Write for Complete {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.waiting.extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let added = self.waiting.len();
        if added == 0 {
            return Ok(());
        }
        // The final end with its index is longer and overwrites this one.
        if !self.waiting.ends_with(&MAGIC) {
            self.waiting.extend(end());
        }
        self.file.seek(SeekFrom::Start(self.length))?;
        let written = self.file.write_all(&self.waiting);
        self.waiting.clear();
        if written.is_ok() {
            self.length += added as u64;
        } else {
            // A full disk: the file stays complete up to the last flush.
            self.file.set_len(self.length)?;
            self.file.seek(SeekFrom::Start(self.length))?;
            let _ = self.file.write_all(&end());
        }
        written
    }
}
