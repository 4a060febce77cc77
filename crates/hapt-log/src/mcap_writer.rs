//! Writes MCAP files: <https://mcap.dev/spec>. Records that `container.rs` reads, and the index that other readers begin with. Chunks are
//! not compressed.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crate::container::{ATTACHMENT, CHANNEL, CHUNK, DATA_END, FOOTER, MAGIC, MESSAGE, METADATA};

/// Opcodes of records that only other readers use.
const HEADER: u8 = 0x01;
const SCHEMA: u8 = 0x03;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const ATTACHMENT_INDEX: u8 = 0x0a;
const STATISTICS: u8 = 0x0b;
const METADATA_INDEX: u8 = 0x0d;
const SUMMARY_OFFSET: u8 = 0x0e;

/// The content of a record.
#[derive(Default)]
struct Fields(Vec<u8>);

impl Fields {
    fn u16(mut self, value: u16) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn u32(mut self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    /// Bytes preceded by their number, which is below 2³² in every log.
    fn bytes(self, bytes: &[u8]) -> Self {
        let mut fields = self.u32(bytes.len() as u32);
        fields.0.extend(bytes);
        fields
    }

    fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    fn map(self, values: &BTreeMap<String, String>) -> Self {
        let pairs = values.iter().fold(Fields::default(), |pairs, (key, value)| pairs.text(key).text(value));
        self.bytes(&pairs.0)
    }

    /// Pairs of a channel's number and a value.
    fn by_channel(self, values: &BTreeMap<u16, u64>) -> Self {
        let pairs = values.iter().fold(Fields::default(), |pairs, (id, value)| pairs.u16(*id).u64(*value));
        self.bytes(&pairs.0)
    }

    /// The record.
    fn record(&self, opcode: u8) -> Vec<u8> {
        let mut record = Vec::with_capacity(9 + self.0.len());
        put(&mut record, opcode, &self.0);
        record
    }
}

fn put(to: &mut Vec<u8>, opcode: u8, content: &[u8]) {
    to.push(opcode);
    to.extend((content.len() as u64).to_le_bytes());
    to.extend(content);
}

/// The first and the last of some times.
#[derive(Clone, Copy, Default)]
struct Span(Option<(u64, u64)>);

impl Span {
    fn add(&mut self, time: u64) {
        let (first, last) = self.0.unwrap_or((time, time));
        self.0 = Some((first.min(time), last.max(time)));
    }

    fn put(self, fields: Fields) -> Fields {
        let (first, last) = self.0.unwrap_or_default();
        fields.u64(first).u64(last)
    }
}

/// The present chunk.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    times: Span,
    /// Of each channel's messages: their times and places in the chunk.
    messages: BTreeMap<u16, Fields>,
}

/// Writes a file, a chunk in one write.
pub(crate) struct McapWriter<W> {
    out: W,
    /// Bytes written.
    written: u64,
    /// The checksum of these bytes.
    checksum: crc32fast::Hasher,
    chunk: Chunk,
    /// The contents of schemas and channels without their numbers, which count from 1.
    schemas: Vec<Vec<u8>>,
    channels: Vec<Vec<u8>>,
    /// Messages of each channel.
    counts: BTreeMap<u16, u64>,
    times: Span,
    /// The records of the index.
    chunks: Vec<Vec<u8>>,
    attachments: Vec<Vec<u8>>,
    metadata: Vec<Vec<u8>>,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(out: W, library: &str) -> io::Result<Self> {
        let mut mcap = McapWriter {
            out,
            written: 0,
            checksum: crc32fast::Hasher::new(),
            chunk: Chunk::default(),
            schemas: Vec::new(),
            channels: Vec::new(),
            counts: BTreeMap::new(),
            times: Span::default(),
            chunks: Vec::new(),
            attachments: Vec::new(),
            metadata: Vec::new(),
        };
        mcap.write(&MAGIC)?;
        mcap.write(&Fields::default().text("").text(library).record(HEADER))?;
        Ok(mcap)
    }

    /// Appends bytes. Returns their position and their length.
    fn write(&mut self, bytes: &[u8]) -> io::Result<Fields> {
        self.out.write_all(bytes)?;
        self.checksum.update(bytes);
        let at = self.written;
        self.written += bytes.len() as u64;
        Ok(Fields::default().u64(at).u64(bytes.len() as u64))
    }

    /// Writes an attachment.
    pub fn attach(&mut self, time: u64, name: &str, media_type: &str, data: &[u8]) -> io::Result<()> {
        self.end_chunk()?;
        let mut content = Fields::default().u64(time).u64(time).text(name).text(media_type).u64(data.len() as u64);
        content.0.extend(data);
        let checksum = crc32fast::hash(&content.0);
        let place = self.write(&content.u32(checksum).record(ATTACHMENT))?;
        let index = place.u64(time).u64(time).u64(data.len() as u64).text(name).text(media_type);
        self.attachments.push(index.record(ATTACHMENT_INDEX));
        Ok(())
    }

    /// Writes pairs of a key and its value.
    pub fn metadata(&mut self, name: &str, values: &BTreeMap<String, String>) -> io::Result<()> {
        self.end_chunk()?;
        let place = self.write(&Fields::default().text(name).map(values).record(METADATA))?;
        self.metadata.push(place.text(name).record(METADATA_INDEX));
        Ok(())
    }

    /// The number of a schema; a new one is written.
    pub fn schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> io::Result<u16> {
        let content = Fields::default().text(name).text(encoding).bytes(data);
        numbered(&mut self.schemas, content, SCHEMA, &mut self.chunk.records)
    }

    /// The number of a channel; a new one is written.
    pub fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        values: &BTreeMap<String, String>,
    ) -> io::Result<u16> {
        let content = Fields::default().u16(schema).text(topic).text(encoding).map(values);
        numbered(&mut self.channels, content, CHANNEL, &mut self.chunk.records)
    }

    /// Adds a message to the chunk.
    pub fn message(&mut self, channel: u16, sequence: u32, time: u64, data: &[u8]) {
        let chunk = &mut self.chunk;
        let index = std::mem::take(chunk.messages.entry(channel).or_default());
        chunk.messages.insert(channel, index.u64(time).u64(chunk.records.len() as u64));
        chunk.times.add(time);
        self.times.add(time);
        *self.counts.entry(channel).or_default() += 1;
        let mut head = Fields(std::mem::take(&mut chunk.records));
        head.0.push(MESSAGE);
        head = head.u64(22 + data.len() as u64).u16(channel).u32(sequence).u64(time).u64(time);
        head.0.extend(data);
        chunk.records = head.0;
    }

    /// Ends the chunk, and flushes `out`.
    pub fn flush(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        self.out.flush()
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, times, messages } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let size = records.len() as u64;
        let head = times.put(Fields::default()).u64(size).u32(crc32fast::hash(&records)).text("").u64(size);
        let mut all = Fields([head.0, records].concat()).record(CHUNK);
        let length = all.len() as u64;
        let mut places = BTreeMap::new();
        for (channel, index) in &messages {
            places.insert(*channel, self.written + all.len() as u64);
            put(&mut all, MESSAGE_INDEX, &Fields::default().u16(*channel).bytes(&index.0).0);
        }
        let index = times.put(Fields::default()).u64(self.written).u64(length).by_channel(&places);
        let index = index.u64(all.len() as u64 - length).text("").u64(size).u64(size);
        self.chunks.push(index.record(CHUNK_INDEX));
        self.write(&all).map(drop)
    }

    /// Writes the index and the end; returns the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.end_chunk()?;
        let data_end = Fields::default().u32(self.checksum.clone().finalize()).record(DATA_END);
        let start = self.written + data_end.len() as u64;
        let with_number = |contents: &[Vec<u8>], opcode: u8| -> Vec<Vec<u8>> {
            let numbered = |(id, content): (u16, &Vec<u8>)| Fields([&id.to_le_bytes(), &content[..]].concat());
            (1..).zip(contents).map(|one| numbered(one).record(opcode)).collect()
        };
        let statistics = Fields::default()
            .u64(self.counts.values().sum())
            .u16(self.schemas.len() as u16)
            .u32(self.channels.len() as u32)
            .u32(self.attachments.len() as u32)
            .u32(self.metadata.len() as u32)
            .u32(self.chunks.len() as u32);
        let statistics = self.times.put(statistics).by_channel(&self.counts);
        let groups = [
            (SCHEMA, with_number(&self.schemas, SCHEMA)),
            (CHANNEL, with_number(&self.channels, CHANNEL)),
            (STATISTICS, vec![statistics.record(STATISTICS)]),
            (CHUNK_INDEX, std::mem::take(&mut self.chunks)),
            (ATTACHMENT_INDEX, std::mem::take(&mut self.attachments)),
            (METADATA_INDEX, std::mem::take(&mut self.metadata)),
        ];
        let (mut summary, mut offsets) = (Vec::new(), Vec::new());
        for (opcode, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let (at, group) = (start + summary.len() as u64, records.concat());
            let offset = Fields(vec![opcode]).u64(at).u64(group.len() as u64);
            put(&mut offsets, SUMMARY_OFFSET, &offset.0);
            summary.extend(group);
        }
        let footer = Fields::default().u64(start).u64(start + summary.len() as u64);
        // The last checksum is of all before it, the head of its own record included.
        let mut all = [summary, offsets].concat();
        all.push(FOOTER);
        all.extend(20_u64.to_le_bytes());
        all.extend(footer.0);
        let checksum = crc32fast::hash(&all);
        let end = [&data_end[..], &all, &checksum.to_le_bytes(), &MAGIC].concat();
        self.out.write_all(&end)?;
        self.out.flush()?;
        Ok(self.out)
    }
}

/// The number of this content; new content is written with the next number.
fn numbered(contents: &mut Vec<Vec<u8>>, content: Fields, opcode: u8, to: &mut Vec<u8>) -> io::Result<u16> {
    let (id, is_new) = match contents.iter().position(|known| *known == content.0) {
        Some(place) => (place + 1, false),
        None => (contents.len() + 1, true),
    };
    let id = u16::try_from(id).map_err(|_| io::Error::other("a log has at most 65535 worlds"))?;
    if is_new {
        put(to, opcode, &[&id.to_le_bytes(), &content.0[..]].concat());
        contents.push(content.0);
    }
    Ok(id)
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;
    use mcap::records::{MessageHeader, Metadata};
    use mcap::write::NoSeek;
    use mcap::{Attachment, WriteOptions, Writer};

    use super::*;

    #[derive(Clone, Debug)]
    enum Entry {
        Attachment(u64, String, Vec<u8>),
        Metadata(String, BTreeMap<String, String>),
        /// Messages from here on are of this one.
        Channel(u8, BTreeMap<String, String>),
        Message(u64, Vec<u8>),
        Flush,
    }

    fn entries() -> impl Strategy<Value = Vec<Entry>> {
        let bytes = || prop::collection::vec(any::<u8>(), 0..40);
        let map = || prop::collection::btree_map("[a-zµ]{0,3}", "[a-z.]{0,3}", 0..3);
        let entry = prop_oneof![
            1 => (any::<u64>(), "[a-zµ]{0,5}", bytes()).prop_map(|(time, name, data)| Entry::Attachment(time, name, data)),
            1 => ("[a-z]{0,5}", map()).prop_map(|(name, values)| Entry::Metadata(name, values)),
            2 => (0..3_u8, map()).prop_map(|(schema, values)| Entry::Channel(schema, values)),
            8 => (any::<u64>(), bytes()).prop_map(|(time, data)| Entry::Message(time, data)),
            2 => Just(Entry::Flush),
        ];
        prop::collection::vec(entry, 0..40)
    }

    /// The file as written by the crate of MCAP's authors.
    fn expected(entries: &[Entry]) -> Vec<u8> {
        let options = WriteOptions::new().compression(None).chunk_size(None).disable_seeking(true).library("l");
        let mut writer = Writer::with_options(NoSeek::new(Vec::new()), options).unwrap();
        let (mut channel, mut sequence) = (0, 0);
        for entry in entries {
            match entry {
                Entry::Attachment(time, name, data) => writer
                    .attach(&Attachment {
                        log_time: *time,
                        create_time: *time,
                        name: name.clone(),
                        media_type: "m".into(),
                        data: data.into(),
                    })
                    .unwrap(),
                Entry::Metadata(name, metadata) => {
                    writer.write_metadata(&Metadata { name: name.clone(), metadata: metadata.clone() }).unwrap();
                }
                Entry::Channel(schema, values) => {
                    let schema = writer.add_schema("s", "protobuf", &[*schema]).unwrap();
                    channel = writer.add_channel(schema, "/t", "protobuf", values).unwrap();
                }
                Entry::Message(time, data) if channel > 0 => {
                    let header = MessageHeader { channel_id: channel, sequence, log_time: *time, publish_time: *time };
                    writer.write_to_known_channel(&header, data).unwrap();
                    sequence += 1;
                }
                Entry::Message(..) => {}
                Entry::Flush => writer.flush().unwrap(),
            }
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    fn written(entries: &[Entry]) -> io::Result<Vec<u8>> {
        let mut writer = McapWriter::new(Vec::new(), "l")?;
        let (mut channel, mut sequence) = (0, 0);
        for entry in entries {
            match entry {
                Entry::Attachment(time, name, data) => writer.attach(*time, name, "m", data)?,
                Entry::Metadata(name, values) => writer.metadata(name, values)?,
                Entry::Channel(schema, values) => {
                    let schema = writer.schema("s", "protobuf", &[*schema])?;
                    channel = writer.channel(schema, "/t", "protobuf", values)?;
                }
                Entry::Message(time, data) if channel > 0 => {
                    writer.message(channel, sequence, *time, data);
                    sequence += 1;
                }
                Entry::Message(..) => {}
                Entry::Flush => writer.flush()?,
            }
        }
        writer.finish()
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(400))]

        #[test]
        fn a_file_has_the_bytes_that_the_authors_of_mcap_write(entries in entries()) {
            let (written, expected) = (written(&entries).unwrap(), expected(&entries));
            prop_assert!(written == expected, "they differ at byte {:?} of {}",
                written.iter().zip(&expected).position(|(a, b)| a != b), expected.len());
        }
    }
}
