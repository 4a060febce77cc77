//! The text of a table's bytes. Most programs write UTF-8, a spreadsheet's "Unicode text" is UTF-16, and a degree sign or a µ of an older
//! Windows program is one byte of Latin-1.

use crate::Error;

/// The text of a file: UTF-16 behind its byte order mark, else UTF-8, else Latin-1.
///
/// # Errors
/// [`Error::Columns`] for a byte of 0, which other files have and no text has, and for UTF-16 that is cut short.
pub fn text_of(bytes: Vec<u8>) -> Result<String, Error> {
    let text = match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => Some(
            String::from_utf8(bytes)
                .unwrap_or_else(|error| error.as_bytes().iter().map(|&byte| char::from(byte)).collect()),
        ),
    };
    text.filter(|text| !text.contains('\0')).ok_or_else(|| {
        Error::Columns(
            "this is not text (UTF-8, UTF-16 or Latin-1); expected a table with a header, such as CSV, or a .mat file"
                .into(),
        )
    })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (units, rest) = bytes.as_chunks::<2>();
    if !rest.is_empty() {
        return None;
    }
    char::decode_utf16(units.iter().map(|&pair| unit(pair))).collect::<Result<_, _>>().ok()
}
