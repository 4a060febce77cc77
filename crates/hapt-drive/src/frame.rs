//! A CAN frame, classic or FD, of fixed size in memory.

/// The data lengths of CAN FD frames, in bytes.
const SIZES: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// A frame on a CAN bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The identifier: 11 bits, or 29 where it is extended.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    /// CAN FD: up to 64 bytes, sent at the faster rate; else 8 at most.
    pub fd: bool,
    /// A remote frame, the request for a frame with its identifier: it has a length but no data.
    pub remote: bool,
    length: u8,
    data: [u8; 64],
}

impl Frame {
    /// A classic frame with an 11-bit identifier and the first 8 bytes of `data`.
    pub fn classic(id: u32, data: &[u8]) -> Self {
        Frame::filled(id, false, false, data, 8)
    }

    /// A remote frame for `length` bytes.
    pub fn remote(id: u32, length: u8) -> Self {
        Frame { length: length.min(8), remote: true, ..Frame::classic(id, &[]) }
    }

    /// A CAN FD frame with the first 64 bytes of `data`; its identifier has 29 bits where 11 are too few.
    pub fn fd(id: u32, data: &[u8]) -> Self {
        Frame::filled(id, id > 0x7ff, true, data, 64)
    }

    /// The same with an identifier of 29 bits, or of 11.
    pub fn with_extended(self, extended: bool) -> Self {
        Frame { extended, ..self }
    }

    fn filled(id: u32, extended: bool, fd: bool, data: &[u8], most: usize) -> Self {
        let mut frame = Frame { id, extended, fd, remote: false, length: 0, data: [0; 64] };
        for byte in data.iter().take(most) {
            frame.push(*byte);
        }
        frame
    }

    /// Appends a byte; `false` where the frame is full.
    pub fn push(&mut self, byte: u8) -> bool {
        let most = if self.fd { 64 } else { 8 };
        let at = usize::from(self.length);
        if at >= most {
            return false;
        }
        self.data[at] = byte;
        self.length += 1;
        true
    }

    /// Its data; a remote frame has none.
    pub fn data(&self) -> &[u8] {
        if self.remote { &[] } else { &self.data[..usize::from(self.length)] }
    }

    /// The length of its data or of its request, in bytes.
    pub fn length(&self) -> u8 {
        self.length
    }

    /// The same frame, padded with `with` to the next valid length.
    pub fn padded(mut self, with: u8) -> Self {
        let length = usize::from(self.length);
        let wanted = SIZES.into_iter().find(|size| *size >= length).unwrap_or(64);
        while usize::from(self.length) < wanted && self.push(with) {}
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_one_of_the_lengths_that_a_bus_can_carry() {
        for length in 0..=64 {
            let frame = Frame::fd(1, &vec![7; length]).padded(0x50);
            assert!(SIZES.contains(&frame.data().len()) && frame.data().len() >= length);
            assert!(frame.data()[..length].iter().all(|byte| *byte == 7));
            assert!(frame.data()[length..].iter().all(|byte| *byte == 0x50));
        }
    }

    #[test]
    fn a_full_frame_takes_no_more() {
        let mut classic = Frame::classic(1, &[1; 9]);
        assert_eq!(classic.data().len(), 8);
        assert!(!classic.push(1));
        assert_eq!(Frame::fd(1, &[1; 70]).data().len(), 64);
    }
}
