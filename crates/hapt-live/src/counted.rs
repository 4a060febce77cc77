//! Counts the frames of a websocket below its messages: a frame that ends no message counts as a message. Otherwise a message in endless
//! empty fragments would never be limited.

use std::io::{self, ErrorKind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Instant;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use crate::allowance::{Allowance, Quota};

/// A connection that counts the frames it reads.
pub struct Counted<S> {
    io: S,
    frames: Frames,
    allowance: Arc<Mutex<Allowance>>,
}

impl<S> Counted<S> {
    /// Frames that end no message count in `allowance`; far beyond it, reading fails with [`ErrorKind::QuotaExceeded`].
    pub fn new(io: S, allowance: Arc<Mutex<Allowance>>) -> Self {
        Counted { io, frames: Frames::default(), allowance }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Counted<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let Counted { io, frames, allowance } = &mut *self;
        let read = Pin::new(io).poll_read(context, buffer);
        let parts = frames.take(buffer.filled().get(before..).unwrap_or_default());
        if parts > 0 {
            let now = Instant::now();
            let mut allowance = allowance.lock().unwrap_or_else(PoisonError::into_inner);
            if (0..parts).any(|_| allowance.spend(now) == Quota::Exhausted) {
                return Poll::Ready(Err(ErrorKind::QuotaExceeded.into()));
            }
        }
        read
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Counted<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(context)
    }
}

/// Parses the heads of frames in a stream of bytes (RFC 6455, section 5.2).
#[derive(Debug, Default)]
struct Frames {
    head: [u8; 14],
    length: usize,
    /// The bytes of the payload that are missing.
    payload: u64,
}

impl Frames {
    /// The number of frames that begin in these bytes and are fragments.
    fn take(&mut self, mut bytes: &[u8]) -> u32 {
        let mut parts = 0;
        while let Some((first, rest)) = bytes.split_first() {
            if self.payload > 0 {
                let skipped = self.payload.min(bytes.len() as u64);
                self.payload -= skipped;
                bytes = bytes.get(skipped as usize..).unwrap_or_default();
                continue;
            }
            bytes = rest;
            if let Some(place) = self.head.get_mut(self.length) {
                *place = *first;
            }
            self.length += 1;
            if let Some(payload) = payload(self.head.get(..self.length).unwrap_or_default()) {
                let (ends, continues) = (self.head[0] & 0x80 != 0, self.head[0] & 0x0f == 0);
                parts += u32::from(!ends || continues);
                (self.payload, self.length) = (payload, 0);
            }
        }
        parts
    }
}

/// The payload's length, once the head is complete.
fn payload(head: &[u8]) -> Option<u64> {
    let second = *head.get(1)?;
    let more = match second & 0x7f {
        126 => 2,
        127 => 8,
        _ => 0,
    };
    let mask = if second & 0x80 != 0 { 4 } else { 0 };
    let length = head.get(2..2 + more)?;
    (head.len() >= 2 + more + mask).then(|| match more {
        0 => u64::from(second & 0x7f),
        _ => length.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte)),
    })
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    fn frame(first: u8, length: usize, mask: bool) -> Vec<u8> {
        let masked = if mask { 0x80 } else { 0 };
        let mut bytes = vec![first];
        match length {
            0..126 => bytes.push(masked | length as u8),
            126..65536 => {
                bytes.push(masked | 126);
                bytes.extend((length as u16).to_be_bytes());
            }
            _ => {
                bytes.push(masked | 127);
                bytes.extend((length as u64).to_be_bytes());
            }
        }
        bytes.extend(vec![0x81; if mask { 4 } else { 0 } + length]);
        bytes
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(64))]

        #[test]
        fn every_frame_that_is_no_complete_message_is_counted_however_the_bytes_are_split(
            frames in prop::collection::vec((prop::sample::select(vec![0x81_u8, 0x82, 0x01, 0x00, 0x80, 0x89]), 0_usize..300, any::<bool>()), 1..30),
            long in 0_usize..70_000,
            cut in 1_usize..50,
        ) {
            let mut bytes: Vec<u8> = frames.iter().flat_map(|&(first, length, mask)| frame(first, length, mask)).collect();
            bytes.extend(frame(0x81, long, true));
            bytes.extend(frame(0x00, 0, true));
            let parts = 1 + frames.iter().filter(|(first, ..)| first & 0x80 == 0 || first & 0x0f == 0).count() as u32;
            let mut counter = Frames::default();
            prop_assert_eq!(bytes.chunks(cut).map(|some| counter.take(some)).sum::<u32>(), parts);
        }
    }
}
