//! The kinds of lines, and the meaning of their bytes.

use crate::frame::Frame;

/// The kinds by their letters. The first byte of a line's data is its number, which its answer returns.
pub mod kind {
    /// Version, unit and limit.
    pub const VERSION: u8 = b'V';
    /// Position; feeds no watchdog.
    pub const QUERY: u8 = b'Q';
    /// The largest target from now on, while it is off.
    pub const LIMIT: u8 = b'L';
    /// Switches the motor on, with this watchdog in units of 0.1 ms.
    pub const ENABLE: u8 = b'E';
    /// The target; the only line that feeds the watchdog.
    pub const TARGET: u8 = b'T';
    /// Switches the motor off, and clears a latched state.
    pub const STOP: u8 = b'S';
}

/// The states by their numbers. After 2, 3 and 4 only a stop switches to 0, and after 4 none.
pub mod state {
    /// Since its start, or after a stop.
    pub const OFF: u8 = 0;
    /// The motor renders the target.
    pub const ON: u8 = 1;
    /// No target arrived in time.
    pub const EXPIRED: u8 = 2;
    /// A target or limit was not a number, or too large.
    pub const REFUSED: u8 = 3;
    /// SimpleFOC's own start failed, the driver is off, or its type of control is another than at its start.
    pub const FAILED: u8 = 4;
}

/// The answer to every line but that for the version.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The kind and the number of the answered line.
    pub kind: u8,
    /// See `kind`.
    pub number: u8,
    /// One of [`state`].
    pub state: u8,
    /// The number of the target in use, or of the line that switched the motor on.
    pub last: u8,
    /// Whole turns of the shaft; at the ends of the range they are not counted further.
    pub turns: i16,
    /// The angle from there in rad.
    pub angle: f32,
    /// Volts in use or amperes measured.
    pub measured: f32,
}

impl Answer {
    /// As a frame.
    pub fn frame(&self) -> Frame {
        let mut data = [0; 13];
        data[..3].copy_from_slice(&[self.number, self.state, self.last]);
        data[3..5].copy_from_slice(&self.turns.to_be_bytes());
        data[5..9].copy_from_slice(&self.angle.to_be_bytes());
        data[9..].copy_from_slice(&self.measured.to_be_bytes());
        Frame::fd(self.kind.into(), &data)
    }

    /// From a frame of this length.
    pub fn read(frame: &Frame) -> Option<Answer> {
        let data: &[u8; 13] = frame.data().try_into().ok()?;
        let [number, state, last, t0, t1, a0, a1, a2, a3, m0, m1, m2, m3] = *data;
        Some(Answer {
            kind: u8::try_from(frame.id).ok()?,
            number,
            state,
            last,
            turns: i16::from_be_bytes([t0, t1]),
            angle: f32::from_be_bytes([a0, a1, a2, a3]),
            measured: f32::from_be_bytes([m0, m1, m2, m3]),
        })
    }
}

/// The answer about the version.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct About {
    /// The number of the answered line.
    pub number: u8,
    /// The version of the line.
    pub version: u8,
    /// `V` or `A`; `E` for an estimated current, any other for no torque.
    pub unit: u8,
    /// One of [`state`].
    pub state: u8,
    /// The largest target that the sketch takes.
    pub limit: f32,
}

impl About {
    /// As a frame.
    pub fn frame(&self) -> Frame {
        let mut data = [self.number, self.version, self.unit, self.state, 0, 0, 0, 0];
        data[4..].copy_from_slice(&self.limit.to_be_bytes());
        Frame::fd(kind::VERSION.into(), &data)
    }

    /// From a frame. Of another version only its number is read.
    pub fn read(frame: &Frame) -> Option<About> {
        let data = frame.data();
        let (number, version) = (*data.first()?, *data.get(1)?);
        if frame.id != u32::from(kind::VERSION) {
            return None;
        }
        if version != super::VERSION {
            return Some(About { number, version, unit: 0, state: state::FAILED, limit: 0.0 });
        }
        let [_, _, unit, state, l0, l1, l2, l3] = *<&[u8; 8]>::try_from(data).ok()?;
        Some(About { number, version, unit, state, limit: f32::from_be_bytes([l0, l1, l2, l3]) })
    }
}

/// A line to the board.
pub fn line(kind: u8, number: u8, data: &[u8]) -> Frame {
    let mut frame = Frame::fd(kind.into(), &[number]);
    for byte in data {
        frame.push(*byte);
    }
    frame
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn an_answer_reads_back_and_no_frame_of_another_length_is_one(
            bytes in any::<[u8; 13]>(), kind in b'A'..=b'Z', length in 0_usize..16,
        ) {
            let [.., a, b, c, d] = bytes;
            let answer = Answer {
                kind,
                number: bytes[0],
                state: bytes[1],
                last: bytes[2],
                turns: i16::from_be_bytes([bytes[3], bytes[4]]),
                angle: f32::from(bytes[5]),
                measured: f32::from_be_bytes([a & 0x3f, b, c, d]),
            };
            prop_assert_eq!(Answer::read(&answer.frame()), Some(answer));
            let about = About { number: bytes[0], version: super::super::VERSION, unit: b'A', state: bytes[1], limit: answer.angle };
            prop_assert_eq!(About::read(&about.frame()), Some(about));
            let other = Frame::fd(kind.into(), &vec![bytes[0]; length]);
            prop_assert_eq!(Answer::read(&other).is_some(), length == 13);
        }
    }
}
