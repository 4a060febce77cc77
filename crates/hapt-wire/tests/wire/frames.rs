//! After any noise the next frame is read, and noise never passes as a frame.

use hapt_testing::prelude::*;
use hapt_wire::{Error, Reader, frame};
use postcard::ser_flavors::crc::{CrcModifier, to_slice_u16};
use postcard::ser_flavors::{Cobs, Slice};
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Message<'a> {
    Number(u32, f32),
    Bytes(&'a [u8]),
    Nothing,
}

fn framed(message: &Message) -> Vec<u8> {
    frame(message, &mut [0; 1024]).unwrap().to_vec()
}

fn read(bytes: &[u8]) -> (Vec<String>, u32) {
    let mut reader = Reader::<600>::default();
    let mut messages = Vec::new();
    for &byte in bytes {
        if let Some(message) = reader.push::<Message>(byte) {
            messages.push(format!("{message:?}"));
        }
    }
    (messages, reader.refused)
}

proptest! {
    #[test]
    fn a_framed_message_is_read_and_has_one_zero(bytes in prop::collection::vec(0..3u8, 0..520), number in any::<(u32, f32)>()) {
        for message in [Message::Bytes(&bytes), Message::Number(number.0, number.1), Message::Nothing] {
            let framed = framed(&message);
            prop_assert_eq!(framed.iter().position(|&byte| byte == 0), Some(framed.len() - 1));
            prop_assert_eq!(read(&framed), (vec![format!("{message:?}")], 0));
        }
    }

    #[test]
    fn frames_are_stuffed_as_by_other_implementations(bytes in prop::collection::vec(prop_oneof![1 => Just(0), 200 => 1..=255u8], 0..520)) {
        let message = Message::Bytes(&bytes);
        let crc = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);
        // As postcard's own flavours, byte for byte; a buffer shorter by one byte is refused.
        let ours = framed(&message);
        let mut room = [0; 1024];
        let stuffed = Cobs::try_new(Slice::new(&mut room)).unwrap();
        let theirs = postcard::serialize_with_flavor(&message, CrcModifier::new(stuffed, crc.digest())).unwrap();
        prop_assert_eq!(&ours[..], theirs);
        let mut small = vec![0; ours.len() - 1];
        prop_assert_eq!(frame(&message, &mut small), Err(Error::NoRoom));
        // The crate cobs leaves out an empty last block: its frames are read too.
        let mut room = [0; 1024];
        let checked = to_slice_u16(&message, &mut room, crc.digest()).unwrap();
        let mut theirs = [0; 1024];
        let length = cobs::encode(checked, &mut theirs);
        // The bytes after it in the buffer are not part of it.
        theirs[length] = 0;
        prop_assert_eq!(read(&theirs[..=length]), (vec![format!("{message:?}")], 0));
    }

    #[test]
    fn after_any_noise_the_next_frame_is_read(noise in prop::collection::vec(any::<u8>(), 0..1500), number in any::<(u32, f32)>()) {
        let message = Message::Number(number.0, number.1);
        // Two frames: the first may end a frame that the noise started.
        let stream = [noise, framed(&message), framed(&message)].concat();
        let (messages, _) = read(&stream);
        prop_assert_eq!(messages.last(), Some(&format!("{message:?}")));
    }

    #[test]
    fn a_flipped_bit_loses_only_its_frame(number in any::<(u32, f32)>(), at in any::<prop::sample::Index>(), bit in 0..8u8) {
        let message = Message::Number(number.0, number.1);
        let mut flipped = framed(&message);
        let at = at.index(flipped.len());
        flipped[at] ^= 1 << bit;
        // A 0 ends a frame whose own end was corrupted.
        let stream = [flipped, vec![0], framed(&message)].concat();
        let (messages, refused) = read(&stream);
        prop_assert_eq!(messages, vec![format!("{message:?}")]);
        prop_assert!(refused > 0);
    }
}

#[test]
fn a_frame_that_does_not_fit_is_refused_on_both_sides() {
    let bytes = [7; 700];
    assert_eq!(frame(&Message::Bytes(&bytes), &mut [0; 100]), Err(Error::NoRoom));
    let long = framed(&Message::Bytes(&bytes));
    let (messages, refused) = read(&[long, framed(&Message::Nothing)].concat());
    assert_eq!((messages, refused), (vec!["Nothing".to_string()], 1));
}
