//! Reads MCAP files from the beginning, record by record: <https://mcap.dev/spec>.
//!
//! A log may have been cut by a full disk or a killed process, and a file may contain any bytes. So every length is checked. A chunk is
//! valid when it is complete and its checksum is right; everything after the first invalid one is ignored. Of a chunk in which the file
//! ends, the complete records are valid.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Read};
use std::ops::Range;

/// The first and last bytes of every MCAP file.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Opcodes.
pub(crate) const CHANNEL: u8 = 0x04;
pub(crate) const MESSAGE: u8 = 0x05;
pub(crate) const CHUNK: u8 = 0x06;
pub(crate) const ATTACHMENT: u8 = 0x09;
pub(crate) const METADATA: u8 = 0x0c;
pub(crate) const FOOTER: u8 = 0x02;
pub(crate) const DATA_END: u8 = 0x0f;

/// The longest accepted record, far beyond those of a log: its chunks have a quarter of a MiB.
const MAX_RECORD_BYTES: u64 = 1 << 26;

/// The end of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It is complete.
    Whole,
    /// It was cut off after this many bytes.
    Cut(u64),
    /// It is damaged after this many bytes.
    Damaged(u64, String),
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Ending::Whole => f.write_str("whole"),
            Ending::Cut(at) => write!(f, "cut off behind {at} bytes, before its writer ended it"),
            Ending::Damaged(at, what) => write!(f, "damaged behind byte {at}: {what}"),
        }
    }
}

/// A record that is used here.
#[derive(Debug)]
pub(crate) enum Item {
    Channel(Channel),
    Message(Message),
    Attachment { name: String, data: Vec<u8> },
    Metadata { name: String, values: BTreeMap<String, String> },
}

/// A channel of messages.
#[derive(Debug)]
pub(crate) struct Channel {
    pub id: u16,
    pub topic: String,
    pub encoding: String,
    pub metadata: BTreeMap<String, String>,
}

/// A message; its data are in [`Container::data`].
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub channel: u16,
    pub log_time: u64,
    pub data: Range<usize>,
}

/// A reader of a file's records.
pub(crate) struct Container<R> {
    from: R,
    /// Bytes read.
    read: u64,
    /// Bytes up to the end of the last valid record of the file.
    good: u64,
    checksum: crc32fast::Hasher,
    /// The present record.
    body: Vec<u8>,
    /// The unread part of it, where it is a chunk.
    chunk: Range<usize>,
    /// Whether the file ends in it.
    cut: bool,
    ending: Option<Ending>,
}

impl<R: Read> Container<R> {
    /// Reads the first bytes. `None` where they are not those of MCAP.
    pub fn new(from: R) -> io::Result<Option<Self>> {
        let mut container = Container {
            from,
            read: 0,
            good: 0,
            checksum: crc32fast::Hasher::new(),
            body: Vec::new(),
            chunk: 0..0,
            cut: false,
            ending: None,
        };
        container.fill(MAGIC.len() as u64)?;
        if container.body != MAGIC {
            return Ok(None);
        }
        container.checksum.update(&MAGIC);
        container.good = container.read;
        Ok(Some(container))
    }

    /// The end of the file, once it is reached.
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// The content of the last message.
    pub fn data(&self, message: &Message) -> &[u8] {
        self.body.get(message.data.clone()).unwrap_or_default()
    }

    /// The next used record; `None` at the end of the file.
    pub fn next(&mut self) -> io::Result<Option<Item>> {
        while self.ending.is_none() {
            let (opcode, range) = if !self.chunk.is_empty() {
                let Some((opcode, range)) = self.inside() else {
                    match self.cut {
                        true => self.chunk = 0..0,
                        false => self.damaged("a chunk holds something that is not a record"),
                    }
                    continue;
                };
                self.chunk.start = range.end;
                (opcode, range)
            } else if self.cut {
                self.ending = Some(Ending::Cut(self.read));
                continue;
            } else {
                self.good = self.read;
                let Some(opcode) = self.record()? else { continue };
                (opcode, 0..self.body.len())
            };
            match opcode {
                CHUNK if range.start == 0 => self.open_chunk(),
                DATA_END if range.start == 0 => self.end()?,
                CHANNEL | MESSAGE | ATTACHMENT | METADATA => match self.item(opcode, range) {
                    Some(item) => return Ok(Some(item)),
                    None => self.damaged("a record does not have its stated type"),
                },
                _ => {}
            }
        }
        Ok(None)
    }

    /// Ends the reading with this damage.
    pub fn damaged(&mut self, what: &str) {
        self.ending = Some(Ending::Damaged(self.good, what.into()));
    }

    /// Reads this many bytes, or fewer at the end.
    fn fill(&mut self, length: u64) -> io::Result<bool> {
        self.body.clear();
        // It allocates no more memory than there are bytes, for any length field.
        let read = (&mut self.from).take(length).read_to_end(&mut self.body)? as u64;
        self.read += read;
        Ok(read == length)
    }

    /// Reads the next record of the file: its opcode. `None`: the file ends here.
    fn record(&mut self) -> io::Result<Option<u8>> {
        self.cut = !self.fill(9)?;
        if self.cut {
            return Ok(None);
        }
        let head: [u8; 9] = self.body[..].try_into().unwrap_or_default();
        let (opcode, length) = (head[0], Bytes(&head[1..]).u64().unwrap_or(0));
        if length > MAX_RECORD_BYTES {
            self.damaged("a record is longer than any of a log");
            return Ok(None);
        }
        self.cut = !self.fill(length)?;
        if self.cut {
            return Ok(Some(opcode).filter(|opcode| *opcode == CHUNK));
        }
        // The checksum of the data section is of all records before its end.
        if opcode != DATA_END {
            self.checksum.update(&head);
            self.checksum.update(&self.body);
        }
        Ok(Some(opcode))
    }

    /// The next record of the chunk.
    fn inside(&self) -> Option<(u8, Range<usize>)> {
        let (&opcode, rest) = self.body.get(self.chunk.clone())?.split_first()?;
        let length = usize::try_from(Bytes(rest).u64()?).ok()?;
        let start = self.chunk.start + 9;
        let end = start.checked_add(length).filter(|end| *end <= self.chunk.end)?;
        Some((opcode, start..end))
    }

    /// Enters the present chunk.
    fn open_chunk(&mut self) {
        let mut head = Bytes(&self.body);
        let header = (|| {
            head.take(24)?; // its first and last time, and its size before compression
            Some((head.u32()?, head.text()?, head.u64()?))
        })();
        let start = self.body.len() - head.0.len();
        match header {
            // Without its end neither size nor checksum can be checked.
            Some((_, compression, _)) if self.cut && compression.is_empty() => self.chunk = start..self.body.len(),
            None if self.cut => {}
            Some((checksum, compression, size)) if size == head.0.len() as u64 => {
                if !compression.is_empty() {
                    let what =
                        format!("its chunks are compressed ({compression}); hapt reads plain ones: mcap decompress");
                    self.damaged(&what);
                } else if checksum != 0 && checksum != crc32fast::hash(head.0) {
                    self.damaged("the checksum of a chunk is wrong");
                } else {
                    self.chunk = start..self.body.len();
                }
            }
            _ => self.damaged("a chunk is not as long as it says"),
        }
    }

    /// The end of the data: an index follows. The file of a killed recorder ends without one.
    fn end(&mut self) -> io::Result<()> {
        let wanted = Bytes(&self.body).u32().unwrap_or(0);
        if wanted != 0 && wanted != self.checksum.clone().finalize() {
            self.damaged("the checksum of the whole is wrong");
        } else if wanted == 0 && self.fill(17)? && self.body[0] == FOOTER && self.body[9..] == [0; 8] {
            self.ending = Some(Ending::Cut(self.good));
        } else {
            self.ending = Some(Ending::Whole);
        }
        Ok(())
    }

    fn item(&self, opcode: u8, range: Range<usize>) -> Option<Item> {
        let body = self.body.get(range.clone())?;
        let mut from = Bytes(body);
        Some(match opcode {
            CHANNEL => {
                let id = from.u16()?;
                from.u16()?;
                Item::Channel(Channel { id, topic: from.text()?, encoding: from.text()?, metadata: from.map()? })
            }
            MESSAGE => {
                let channel = from.u16()?;
                from.u32()?;
                let log_time = from.u64()?;
                from.u64()?;
                Item::Message(Message { channel, log_time, data: range.end - from.0.len()..range.end })
            }
            ATTACHMENT => {
                from.take(16)?;
                let (name, _kind) = (from.text()?, from.text()?);
                let length = usize::try_from(from.u64()?).ok()?;
                let data = from.take(length)?.to_vec();
                let sum = crc32fast::hash(&body[..body.len() - from.0.len()]);
                let wanted = from.u32()?;
                if wanted != 0 && wanted != sum {
                    return None;
                }
                Item::Attachment { name, data }
            }
            _ => Item::Metadata { name: from.text()?, values: from.map()? },
        })
    }
}

/// Bytes, taken from the front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(head)
    }

    fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        String::from_utf8(self.take(length)?.to_vec()).ok()
    }

    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()? as usize;
        let mut pairs = Bytes(self.take(length)?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}
