//! Truncated and damaged logs, and other files.

use std::sync::LazyLock;

use crate::common::{self, WHEEL, bits, header, logged, rows, world};
use hapt_log::{Ending, Error, Log, LogWriter, Origin};
use hapt_sim::Row;
use hapt_testing::prelude::*;

/// A log of three chunks, and all of its samples.
static THREE_CHUNKS: LazyLock<(Vec<u8>, Vec<Vec<u64>>)> = LazyLock::new(|| {
    let rows = rows(&world(WHEEL));
    let mut writer = LogWriter::new(Vec::new(), &world(WHEEL), &header(WHEEL), Origin::Run).unwrap();
    for (i, row) in rows.iter().enumerate() {
        writer.write_row(row).unwrap();
        if i % 20 == 19 {
            writer.flush().unwrap();
        }
    }
    let bytes = writer.finish().unwrap();
    let samples = bits(&mut Log::read(&bytes[..]).unwrap());
    assert_eq!(samples.len(), rows.len());
    (bytes, samples)
});

fn three_chunks() -> (Vec<u8>, Vec<Vec<u64>>) {
    THREE_CHUNKS.clone()
}

/// The readable samples of these bytes, and their ending; `None` where nothing can be read.
fn read(bytes: &[u8]) -> Option<(Vec<Vec<u64>>, Ending)> {
    let mut log = Log::read(bytes).ok()?;
    let mut all = Vec::new();
    while let Ok(Some(sample)) = log.next() {
        all.push(sample.values.iter().map(|x| x.to_bits()).collect());
    }
    Some((all, log.ending().clone()))
}

#[test]
fn a_log_cut_at_any_byte_gives_its_first_samples_and_reports_the_cut() {
    let (bytes, samples) = three_chunks();
    let mut longest = 0;
    for length in 0..bytes.len() {
        let cut = &bytes[..length];
        match read(cut) {
            None => {
                assert_eq!(longest, 0, "at {length} nothing, and something before");
                let error = Log::read(cut).err().unwrap();
                let words = error.to_string();
                assert!(matches!(error, Error::Foreign(_)) && !words.is_empty(), "{words}");
            }
            Some((read, ending)) => {
                assert!(read.len() >= longest && samples.starts_with(&read), "at {length}");
                assert!(ending == Ending::Cut(length as u64) || read.len() == samples.len(), "at {length}: {ending}");
                longest = read.len();
            }
        }
    }
    assert_eq!(longest, samples.len());
}

/// A cut loses the sample in which it lies, and none before it.
#[test]
fn a_cut_within_a_chunk_keeps_the_chunks_whole_samples() {
    let (bytes, samples) = three_chunks();
    let counts: Vec<usize> = (0..bytes.len()).filter_map(|length| Some(read(&bytes[..length])?.0.len())).collect();
    for count in 1..=samples.len() {
        assert!(counts.contains(&count), "no cut leaves {count} samples");
    }
}

/// Every sample that is read was written, in its order; and where one is missing the log is not reported as complete.
fn is_honest(bytes: &[u8], samples: &[Vec<u64>]) -> Result<(), TestCaseError> {
    let Some((read, ending)) = read(bytes) else { return Ok(()) };
    let mut rest = samples.iter();
    for sample in &read {
        prop_assert!(rest.any(|written| written == sample), "a sample that nobody wrote");
    }
    prop_assert!(ending != Ending::Whole || read.len() == samples.len(), "{} samples pass for whole", read.len());
    Ok(())
}

proptest! {
    #![proptest_config(hapt_testing::cases(4000))]

    #[test]
    fn a_flipped_bit_is_detected_and_loses_only_the_following_samples(at in any::<prop::sample::Index>(), bit in 0u8..8) {
        let (mut bytes, samples) = three_chunks();
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        is_honest(&bytes, &samples)?;
    }

    #[test]
    fn no_damage_makes_the_reader_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        cut in any::<prop::sample::Index>(),
    ) {
        let (mut bytes, _) = three_chunks();
        for (at, byte) in flips {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(cut.index(bytes.len()) + 1);
        read(&bytes);
    }

    #[test]
    fn random_bytes_after_the_magic_are_no_log(rest in prop::collection::vec(any::<u8>(), 0..300)) {
        let bytes = [&b"\x89MCAP0\r\n"[..], &rest].concat();
        prop_assert!(read(&bytes).is_none());
    }
}

#[test]
fn other_files_are_refused_with_a_reason() {
    let message = |bytes: &[u8]| Log::read(bytes).err().unwrap().to_string();
    for none in [&b""[..], b"\x89MCAP", b"time_s,puck_rad\n0,0\n", b"\x89PNG\r\n\x1a\n"] {
        assert_eq!(message(none), "it is not a log: it does not begin as an MCAP file does");
    }
    let mut foreign = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let channel = foreign.add_channel(0, "/odom", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    foreign.write_to_known_channel(&header, b"{}").unwrap();
    foreign.finish().unwrap();
    assert_eq!(
        message(&foreign.into_inner().into_inner()),
        "it is an MCAP file, but not a log of hapt: its topics are [\"/odom\"], expected \"/hapt/sample\""
    );
    let empty = LogWriter::new(Vec::new(), &world(WHEEL), &common::header(WHEEL), Origin::Run).unwrap();
    assert_eq!(message(&empty.finish().unwrap()), "it holds no sample");
}

/// Metadata may follow the samples, as in logs rewritten by other programs: the samples do not need it.
#[test]
fn a_log_without_its_metadata_is_replayed() {
    let (bytes, samples) = three_chunks();
    let mut without = bytes[..8].to_vec();
    let mut at = 8;
    while bytes[at] != 0x0f {
        let end = at + 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if !matches!(bytes[at], 0x09 | 0x0c) {
            without.extend_from_slice(&bytes[at..end]);
        }
        at = end;
    }
    // The end of the data, without a checksum of the whole.
    without.extend_from_slice(&[0x0f, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(read(&without), Some((samples.clone(), Ending::Whole)));
    let again = hapt_log::replay(&mut Log::read(&without[..]).unwrap()).unwrap();
    assert_eq!((again.compared, again.first), (samples.len() as u64, None));
}

#[test]
fn a_cut_log_is_complete_after_its_samples_are_rewritten() {
    let all = rows(&world(WHEEL));
    let bytes = logged(WHEEL, &all);
    let mut log = Log::read(&bytes[..bytes.len() * 2 / 3]).unwrap();
    let (mut row, mut kept) = (Row::default(), Vec::new());
    while let Some(sample) = log.next().unwrap() {
        sample.fill(&mut row);
        kept.push(row.clone());
    }
    assert!(kept.len() > 3 && kept.len() < all.len(), "{}", kept.len());
    let again = logged(WHEEL, &kept);
    assert_eq!(read(&again).unwrap().1, Ending::Whole);
    assert_eq!(again, logged(WHEEL, &all[..kept.len()]));
}
