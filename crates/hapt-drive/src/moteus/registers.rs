//! Registers in a frame: subframes that write, read and answer, as bytes.
//!
//! A subframe is a byte for its operation and the type of its values, the count of registers (in that byte's last two bits, or after it),
//! the number of the first register, and for writing and answering the values. Numbers are varuints, values little-endian.

use super::NOP;
use crate::frame::Frame;

hapt_core::named! {
    /// The type of a register's value in a frame, by the code of its subframe.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Resolution {
        /// 8 bits.
        Int8 => "int8",
        /// 16 bits.
        Int16 => "int16",
        /// 32 bits.
        Int32 => "int32",
        /// An f32.
        Float => "float",
    }
}

/// A register's value in a frame. The smallest number of an integer type stands for NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// An integer in 8 bits.
    Int8(i8),
    /// In 16 bits.
    Int16(i16),
    /// In 32 bits.
    Int32(i32),
    /// A float.
    Float(f32),
}

/// One register's part of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Subframe {
    /// Writes the register.
    Write(u32, Value),
    /// Requests the register in this type.
    Read(u32, Resolution),
    /// Answers with the register's value.
    Reply(u32, Value),
    /// The register could not be written or read, with the drive's error number.
    Error(u32, u32),
    /// Bytes of the diagnostic stream on this channel, or a request for them.
    Stream(u32),
}

impl Value {
    /// The value in its register's unit, whose integer steps are `scales` for 8, 16 and 32 bits.
    pub fn scaled(self, scales: [f32; 3]) -> f32 {
        match self {
            Value::Int8(i8::MIN) | Value::Int16(i16::MIN) | Value::Int32(i32::MIN) => f32::NAN,
            Value::Int8(x) => f32::from(x) * scales[0],
            Value::Int16(x) => f32::from(x) * scales[1],
            Value::Int32(x) => x as f32 * scales[2],
            Value::Float(x) => x,
        }
    }

    /// `x` in the type of `resolution`, held within its range.
    pub fn from_scaled(x: f32, scales: [f32; 3], resolution: Resolution) -> Self {
        let steps = |scale: f32, most: f32| (x / scale).clamp(-most, most);
        // NaN is the smallest number; floats are truncated to integers, as in the drive.
        match resolution {
            Resolution::Int8 if x.is_nan() => Value::Int8(i8::MIN),
            Resolution::Int16 if x.is_nan() => Value::Int16(i16::MIN),
            Resolution::Int32 if x.is_nan() => Value::Int32(i32::MIN),
            Resolution::Int8 => Value::Int8(steps(scales[0], 127.0) as i8),
            Resolution::Int16 => Value::Int16(steps(scales[1], 32767.0) as i16),
            Resolution::Int32 => {
                Value::Int32((f64::from(x) / f64::from(scales[2])).clamp(-2147483647.0, 2147483647.0) as i32)
            }
            Resolution::Float => Value::Float(x),
        }
    }

    /// As an integer; a float is truncated.
    pub fn whole(self) -> i32 {
        match self {
            Value::Int8(x) => x.into(),
            Value::Int16(x) => x.into(),
            Value::Int32(x) => x,
            Value::Float(x) => x as i32,
        }
    }

    /// An integer in the type of `resolution`, clamped to its range.
    pub fn from_whole(x: i32, resolution: Resolution) -> Self {
        match resolution {
            Resolution::Int8 => Value::Int8(x as i8),
            Resolution::Int16 => Value::Int16(x as i16),
            Resolution::Int32 => Value::Int32(x),
            Resolution::Float => Value::Float(x as f32),
        }
    }

    fn resolution(self) -> Resolution {
        match self {
            Value::Int8(_) => Resolution::Int8,
            Value::Int16(_) => Resolution::Int16,
            Value::Int32(_) => Resolution::Int32,
            Value::Float(_) => Resolution::Float,
        }
    }
}

/// The subframes of a frame, register by register. It ends at the first invalid byte.
#[derive(Clone, Debug)]
pub struct Parser<'a> {
    rest: &'a [u8],
    /// The present subframe: its operation, its type, its next register, and the remaining count.
    within: Option<(u8, Resolution, u32, u32)>,
}

impl<'a> Parser<'a> {
    /// The parser of a frame's data.
    pub fn new(data: &'a [u8]) -> Self {
        Parser { rest: data, within: None }
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn number(&mut self) -> Option<u32> {
        let mut number = 0;
        for i in 0..5 {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f).checked_shl(7 * i)?;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(*bytes)
    }

    fn value(&mut self, resolution: Resolution) -> Option<Value> {
        Some(match resolution {
            Resolution::Int8 => Value::Int8(i8::from_le_bytes(self.bytes()?)),
            Resolution::Int16 => Value::Int16(i16::from_le_bytes(self.bytes()?)),
            Resolution::Int32 => Value::Int32(i32::from_le_bytes(self.bytes()?)),
            Resolution::Float => Value::Float(f32::from_le_bytes(self.bytes()?)),
        })
    }

    fn next_in(&mut self) -> Option<Subframe> {
        let (does, resolution, register, left) = self.within.take()?;
        if left > 1 {
            self.within = Some((does, resolution, register.checked_add(1)?, left - 1));
        }
        Some(match does {
            WRITE => Subframe::Write(register, self.value(resolution)?),
            READ => Subframe::Read(register, resolution),
            _ => Subframe::Reply(register, self.value(resolution)?),
        })
    }
}

const WRITE: u8 = 0x00;
const READ: u8 = 0x10;
const ANSWER: u8 = 0x20;
const ERRORS: [u8; 2] = [0x30, 0x31];
/// Codes of the stream to and from the drive, and of the request: a channel and a count follow.
const STREAM: [u8; 3] = [0x40, 0x41, 0x42];

impl Iterator for Parser<'_> {
    type Item = Subframe;

    fn next(&mut self) -> Option<Subframe> {
        while self.within.is_none() {
            let first = self.byte()?;
            match first {
                NOP => {}
                _ if ERRORS.contains(&first) => return Some(Subframe::Error(self.number()?, self.number()?)),
                _ if STREAM.contains(&first) => {
                    let (channel, count) = (self.number()?, self.number()?);
                    if first != STREAM[2] {
                        self.rest = self.rest.get(count as usize..)?;
                    }
                    return Some(Subframe::Stream(channel));
                }
                _ if first < 0x30 => {
                    let resolution = Resolution::ALL[usize::from(first >> 2 & 3)];
                    let count = match first & 3 {
                        0 => self.number()?,
                        count => count.into(),
                    };
                    let register = if count == 0 { continue } else { self.number()? };
                    self.within = Some((first & 0xf0, resolution, register, count));
                }
                _ => {
                    self.rest = &[];
                    return None;
                }
            }
        }
        let next = self.next_in();
        if next.is_none() {
            (self.rest, self.within) = (&[], None);
        }
        next
    }
}

/// Builds a frame's data, subframe by subframe. A subframe that does not fit is omitted.
#[derive(Clone, Copy, Debug)]
pub struct Writer {
    frame: Frame,
    fits: bool,
}

impl Writer {
    /// A frame with this identifier.
    pub fn new(id: u32) -> Self {
        Writer { frame: Frame::fd(id, &[]), fits: true }
    }

    /// Writes registers from `register` on, with values of one type.
    pub fn write(self, register: u32, values: &[Value]) -> Self {
        self.values(WRITE, register, values)
    }

    /// Answers with registers from `register` on, with values of one type.
    pub fn reply(self, register: u32, values: &[Value]) -> Self {
        self.values(ANSWER, register, values)
    }

    /// Requests `count` registers from `register` on.
    pub fn read(self, register: u32, count: u8, resolution: Resolution) -> Self {
        self.whole(|frame| frame.header(READ, resolution, register, count))
    }

    /// Reports an error of writing (0) or reading (1) a register.
    pub fn error(self, which: usize, register: u32, code: u32) -> Self {
        self.whole(|frame| {
            frame.push(ERRORS[which.min(1)]);
            frame.number(register);
            frame.number(code);
        })
    }

    /// Answers that the stream of `channel` is empty.
    pub fn empty_stream(self, channel: u32) -> Self {
        self.whole(|frame| {
            frame.push(STREAM[1]);
            frame.number(channel);
            frame.number(0);
        })
    }

    /// The frame, padded to a valid length.
    pub fn frame(self) -> Frame {
        self.frame.padded(NOP)
    }

    /// Whether it is empty.
    pub fn is_empty(&self) -> bool {
        self.frame.data().is_empty()
    }

    fn values(self, does: u8, register: u32, values: &[Value]) -> Self {
        let Some(resolution) = values.first().map(|value| value.resolution()) else { return self };
        self.whole(|frame| {
            frame.header(does, resolution, register, u8::try_from(values.len()).unwrap_or(u8::MAX));
            for value in values {
                match value {
                    Value::Int8(x) => x.to_le_bytes().into_iter().for_each(|byte| frame.push(byte)),
                    Value::Int16(x) => x.to_le_bytes().into_iter().for_each(|byte| frame.push(byte)),
                    Value::Int32(x) => x.to_le_bytes().into_iter().for_each(|byte| frame.push(byte)),
                    Value::Float(x) => x.to_le_bytes().into_iter().for_each(|byte| frame.push(byte)),
                }
            }
        })
    }

    /// Appends the bytes of `fill`, or nothing if they do not fit.
    fn whole(self, fill: impl FnOnce(&mut Writer)) -> Self {
        let mut next = Writer { fits: true, ..self };
        fill(&mut next);
        if next.fits { next } else { self }
    }

    fn header(&mut self, does: u8, resolution: Resolution, register: u32, count: u8) {
        let kind = does | (resolution as u8) << 2;
        if (1..4).contains(&count) {
            self.push(kind | count);
        } else {
            self.push(kind);
            self.push(count);
        }
        self.number(register);
    }

    fn number(&mut self, mut number: u32) {
        while number >= 0x80 {
            self.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.push(number as u8);
    }

    fn push(&mut self, byte: u8) {
        self.fits &= self.frame.push(byte);
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    /// The reference's own example of a frame: a read of three floats from register 1.
    #[test]
    fn a_read_of_three_floats_is_two_bytes() {
        let frame = Writer::new(0x8001).read(1, 3, Resolution::Float).frame();
        assert_eq!(frame.data(), [0x1f, 0x01]);
        let read = |register| Subframe::Read(register, Resolution::Float);
        assert!(Parser::new(frame.data()).eq([read(1), read(2), read(3)]));
    }

    #[test]
    fn a_subframe_that_does_not_fit_is_omitted_completely() {
        let full = Writer::new(1).write(0x20, &[Value::Float(1.0); 14]);
        assert_eq!(Parser::new(full.write(0x30, &[Value::Float(1.0); 3]).frame().data()).count(), 14);
        assert_eq!(Parser::new(full.write(0, &[Value::Int8(1)]).frame().data()).count(), 15);
    }

    fn a_value() -> impl Strategy<Value = Value> {
        prop_oneof![
            any::<i8>().prop_map(Value::Int8),
            any::<i16>().prop_map(Value::Int16),
            any::<i32>().prop_map(Value::Int32),
            (-1e6_f32..1e6).prop_map(Value::Float),
        ]
    }

    proptest! {
        #[test]
        fn written_registers_read_back(register in 0_u32..100_000, value in a_value(), count in 1_usize..12) {
            let written = Writer::new(1).write(register, &vec![value; count]).reply(register, &[value]).frame();
            let wanted = (0..count as u32).map(|i| Subframe::Write(register + i, value));
            let wanted: Vec<_> = wanted.chain([Subframe::Reply(register, value)]).collect();
            prop_assert_eq!(Parser::new(written.data()).collect::<Vec<_>>(), wanted);
        }

        /// Parsing random bytes ends, with no more subframes than bytes.
        #[test]
        fn random_bytes_are_parsed_without_a_panic(data in proptest::collection::vec(any::<u8>(), 0..=64)) {
            let answers = Parser::new(&data).take(1 << 17).filter(|part| !matches!(part, Subframe::Read(..)));
            prop_assert!(answers.count() <= data.len());
        }

        #[test]
        fn a_number_in_steps_is_the_number_to_a_step(x in -1.2_f32..1.2) {
            let scales = [0.01, 1e-4, 1e-5];
            for (resolution, step) in [(Resolution::Int8, 0.01), (Resolution::Int16, 1e-4), (Resolution::Int32, 1e-5), (Resolution::Float, 0.0)] {
                let back = Value::from_scaled(x, scales, resolution).scaled(scales);
                prop_assert!((back - x).abs() <= step + 1e-6);
                prop_assert!(Value::from_scaled(f32::NAN, scales, resolution).scaled(scales).is_nan());
            }
        }
    }
}
