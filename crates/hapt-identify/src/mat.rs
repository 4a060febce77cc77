//! MATLAB's files of level 5 (`save -v6`, `-v7`): the numeric arrays of one length as a table.
//!
//! The format is that of MathWorks, "MAT-File Format", 2021. Real numeric arrays of any class are read, also those in structs and in arrays of
//! structs, also compressed ones; other contents of a file are left out. Files of level 7.3 are HDF5 and are not read.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;

use flate2::read::ZlibDecoder;

use crate::Error;

const HEADER: usize = 128;
/// The largest total size of compressed arrays after decompression, bytes.
const LARGEST: u64 = 64 << 20;
/// The deepest nesting of structs.
const DEEPEST: usize = 4;
/// The most columns or rows of a matrix that are read one by one.
const WIDEST: usize = 64;

/// The longest label, in characters.
const LABEL: usize = 80;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const UTF8: u32 = 16;
const UTF16: u32 = 17;
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
/// The numeric classes of arrays: double, single, and whole numbers of 8 to 64 bits.
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;
const COMPLEX: u32 = 0x0800;

/// A table of a MATLAB file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MatTable {
    /// As text with commas, for [`crate::Columns::read_all`].
    pub text: String,
    /// The labels of its signals: the name with which their columns begin, and what the file says of them.
    pub labels: Vec<(String, String)>,
}

/// A column with its name.
type Column = (String, Vec<f64>);

/// What the arrays of a file have.
#[derive(Default)]
struct Found {
    columns: Vec<Column>,
    labels: Vec<(String, String)>,
}

/// The first bytes of an HDF5 file without a header of MATLAB.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Whether bytes are those of a MATLAB file, of any level that has a header, or of an HDF5 file.
pub fn is_mat(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB ") || bytes.starts_with(HDF5)
}

/// The table of a MATLAB file: the arrays of one length, of which there are two or more, with most of its numbers. A column of a matrix, or a
/// row of one that is wider than long, is `name:1`, a field of a struct `name.field`, and one of the second struct of an array of them
/// `name:2.field`. The time of a struct with `time` and `signals`, as Simulink's scopes write it, is in seconds.
///
/// # Errors
/// [`Error::Columns`] for a file of another level, one that is cut short, and one without two numeric arrays of one length.
pub fn mat_table(bytes: &[u8]) -> Result<MatTable, Error> {
    let wrong = |what: &str| Error::Columns(format!("the .mat file {what}"));
    if bytes.starts_with(HDF5) {
        return Err(Error::Columns(
            "the file is HDF5, as .mat files of level 7.3 are; expected a .mat file of level 5: save('file.mat', '-v7') in MATLAB or \
             scipy.io.savemat in Python writes it, or a table as text"
                .into(),
        ));
    }
    let Some(header) = bytes.get(..HEADER) else { return Err(wrong("is cut short: its header alone has 128 bytes")) };
    let is_big = match &header[126..] {
        b"MI" => true,
        b"IM" => false,
        _ => return Err(wrong("has no mark of its byte order; expected one of level 5, as save -v7 writes it")),
    };
    let version = if is_big { header[124] } else { header[125] };
    if version != 1 {
        return Err(wrong(
            "is of level 7.3 (HDF5); expected level 5: save('file.mat', '-v7') in MATLAB writes it, scipy.io.savemat in Python too",
        ));
    }
    let mut found = Found::default();
    let mut reader = Reader { bytes: &bytes[HEADER..], is_big };
    let mut room = LARGEST;
    while !reader.bytes.is_empty() {
        let (kind, data) = reader.element().ok_or_else(|| wrong("is cut short in the middle of an array"))?;
        match kind {
            MATRIX => array(data, is_big, None, 0, &mut found),
            COMPRESSED => {
                let mut inflated = Vec::new();
                let read = ZlibDecoder::new(data).take(room + 1).read_to_end(&mut inflated);
                read.map_err(|_| wrong("has a compressed array that is broken"))?;
                room = match room.checked_sub(inflated.len() as u64) {
                    Some(room) => room,
                    None => return Err(wrong("has more than 64 MiB of compressed arrays; expected a shorter record")),
                };
                let mut inner = Reader { bytes: &inflated, is_big };
                if let Some((MATRIX, data)) = inner.element() {
                    array(data, is_big, None, 0, &mut found);
                }
            }
            _ => {}
        }
    }
    let Found { mut columns, mut labels } = found;
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    columns.iter().for_each(|column| *counts.entry(column.1.len()).or_default() += 1);
    let lengths = counts.into_iter().filter(|(length, count)| *length > 1 && *count > 1);
    // The record has most of the file's numbers: two lists of a reference may be longer than its signals.
    let Some((length, _)) = lengths.max_by_key(|(length, count)| length * count) else {
        return Err(wrong(
            "has no two numeric arrays of one length; expected a time, a position and a torque, each an array of its own or a column of one",
        ));
    };
    columns.retain(|column| column.1.len() == length);
    let parents: BTreeSet<&str> =
        columns.iter().flat_map(|column| column.0.match_indices('.').map(|(end, _)| &column.0[..end])).collect();
    labels.retain(|(name, _)| parents.contains(name.as_str()));
    let names: Vec<&str> = columns.iter().map(|column| column.0.as_str()).collect();
    let mut text = names.join(",") + "\n";
    for i in 0..length {
        let line: Vec<String> = columns.iter().map(|column| column.1[i].to_string()).collect();
        text += &line.join(",");
        text.push('\n');
    }
    Ok(MatTable { text, labels })
}

/// Reads elements from the front.
struct Reader<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

impl<'a> Reader<'a> {
    fn word(&self, at: usize) -> Option<u32> {
        let word: [u8; 4] = self.bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) })
    }

    /// The kind of the next element and its data; `None` where it is cut short.
    fn element(&mut self) -> Option<(u32, &'a [u8])> {
        let (first, second) = (self.word(0)?, self.word(4)?);
        // Up to four bytes are in the tag itself.
        if first >> 16 != 0 {
            let data = self.bytes.get(4..4 + (first >> 16) as usize).filter(|data| data.len() <= 4)?;
            self.bytes = self.bytes.get(8..)?;
            return Some((first & 0xffff, data));
        }
        let size = second as usize;
        let data = self.bytes.get(8..)?.get(..size)?;
        let padded = if first == COMPRESSED { size } else { size.next_multiple_of(8) };
        self.bytes = &self.bytes[(8 + padded).min(self.bytes.len())..];
        Some((first, data))
    }

    /// Whole numbers of 32 bits.
    fn words(&mut self) -> Option<Vec<u32>> {
        let is_big = self.is_big;
        let (_, bytes) = self.element()?;
        let inner = Reader { bytes, is_big };
        (0..bytes.len() / 4).map(|i| inner.word(4 * i)).collect()
    }
}

/// Adds the columns of an array, or of the arrays in a struct; other elements add none.
fn array(data: &[u8], is_big: bool, parent: Option<&str>, depth: usize, found: &mut Found) {
    let mut reader = Reader { bytes: data, is_big };
    let Some((flags, dimensions, name)) = head(&mut reader) else { return };
    let name = match parent {
        Some(parent) => parent.to_string(),
        None => name,
    };
    let class = flags & 0xff;
    if class == STRUCT && depth < DEEPEST {
        structs(&mut reader, &dimensions, &name, depth, found);
        return;
    }
    if class == CHAR {
        if let (Some(name), Some(label)) = (name.strip_suffix(".label"), letters(&mut reader, is_big)) {
            found.labels.push((name.to_string(), label));
        }
        return;
    }
    let is_numeric = NUMERIC.contains(&class) && flags & COMPLEX == 0;
    let (Some((kind, data)), true, [rows, width]) = (reader.element(), is_numeric, &dimensions[..]) else { return };
    // A line of numbers a quantity is a column, as a column of numbers is.
    let is_across = width > rows;
    let (length, count) = if is_across { (*width, *rows) } else { (*rows, *width) };
    let Some(values) = numbers(kind, data, is_big) else { return };
    if count == 0 || count > WIDEST || length.checked_mul(count) != Some(values.len()) {
        return;
    }
    for i in 0..count {
        let column = match is_across {
            true => values.iter().skip(i).step_by(count).copied().collect(),
            false => values[i * length..(i + 1) * length].to_vec(),
        };
        found.columns.push((if count == 1 { name.clone() } else { format!("{name}:{}", i + 1) }, column));
    }
}

/// The arrays in the fields of a struct, or of an array of structs, each with all of its fields.
fn structs(reader: &mut Reader<'_>, dimensions: &[usize], name: &str, depth: usize, found: &mut Found) {
    let Some(length) = reader.words().and_then(|words| words.first().map(|length| *length as usize)) else { return };
    let Some((_, names)) = reader.element() else { return };
    let count = dimensions.iter().fold(1, |product: usize, size| product.saturating_mul(*size));
    if length == 0 || count > WIDEST {
        return;
    }
    let fields: Vec<String> = names.chunks(length).map(word_of).collect();
    let is_of_simulink = ["time", "signals"].iter().all(|name| fields.iter().any(|field| field == name));
    for i in 0..count {
        let name = if count == 1 { name.to_string() } else { format!("{name}:{}", i + 1) };
        for field in &fields {
            let Some((MATRIX, data)) = reader.element() else { return };
            let unit = if is_of_simulink && field == "time" { "_s" } else { "" };
            array(data, reader.is_big, Some(&format!("{name}.{field}{unit}")), depth + 1, found);
        }
    }
}

/// A text; `None` of an empty one.
fn letters(reader: &mut Reader<'_>, is_big: bool) -> Option<String> {
    let (kind, data) = reader.element()?;
    let text = match kind {
        // Text in UTF-8.
        1 | 2 | UTF8 => String::from_utf8_lossy(data).into_owned(),
        _ => numbers(if kind == UTF16 { 4 } else { kind }, data, is_big)?
            .into_iter()
            .map(|x| char::from_u32(x as u32).unwrap_or('?'))
            .collect(),
    };
    let words: Vec<&str> = text.split_whitespace().collect();
    (!words.is_empty()).then(|| words.join(" ").chars().take(LABEL).collect())
}

/// An array's flags, dimensions and name.
fn head(reader: &mut Reader<'_>) -> Option<(u32, Vec<usize>, String)> {
    let flags = *reader.words()?.first()?;
    let dimensions = reader.words()?.into_iter().map(|size| size as usize).collect();
    let (_, name) = reader.element()?;
    Some((flags, dimensions, word_of(name)))
}

/// A name up to its end, without characters that would end a column of a table.
fn word_of(bytes: &[u8]) -> String {
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(bytes).replace([',', '\n', '\r'], " ")
}

/// Numbers of any of the format's types.
fn numbers(kind: u32, data: &[u8], is_big: bool) -> Option<Vec<f64>> {
    let size = match kind {
        1 | 2 => 1,
        3 | 4 => 2,
        5..=7 => 4,
        9 | 12 | 13 => 8,
        _ => return None,
    };
    let of = |bytes: &[u8]| {
        let mut word = [0; 8];
        // Little-endian.
        for (i, byte) in bytes.iter().enumerate() {
            word[if is_big { size - 1 - i } else { i }] = *byte;
        }
        let word = u64::from_le_bytes(word);
        match kind {
            1 => f64::from(word as i8),
            3 => f64::from(word as i16),
            5 => f64::from(word as i32),
            7 => f64::from(f32::from_bits(word as u32)),
            9 => f64::from_bits(word),
            12 => word as i64 as f64,
            _ => word as f64,
        }
    };
    Some(data.chunks_exact(size).map(of).collect())
}
