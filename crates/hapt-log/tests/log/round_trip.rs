//! A log is read back bit-identically, and replayed through the core.

use crate::common::{WHEEL, bits, header, logged, rows, world, worlds};
use hapt_log::{Ending, Header, Log, LogWriter, Origin, columns, descriptor, replay};
use hapt_sim::{CsvWriter, Row};
use hapt_testing::prelude::*;

proptest! {
    #![proptest_config(hapt_testing::cases(96))]

    #[test]
    fn a_log_keeps_every_bit_of_a_run_and_its_csv_is_the_runs_own(text in worlds()) {
        let world = world(&text);
        let rows = rows(&world);
        prop_assume!(!rows.is_empty());
        let bytes = logged(&text, &rows);

        let mut log = Log::read(&bytes[..]).unwrap();
        prop_assert_eq!(&log.header.world_text, &text);
        let names: Vec<String> = log.plan().columns.iter().map(|column| column.name.clone()).collect();
        let mut converted = CsvWriter::with_columns(Vec::new(), &names).unwrap();
        let (mut row, mut all) = (Row::default(), rows.iter());
        while let Some(sample) = log.next().unwrap() {
            converted.write_numbers(sample.values).unwrap();
            sample.fill(&mut row);
            let wanted = all.next().unwrap();
            prop_assert_eq!(sample.log_time, (wanted.time * 1e9).round() as u64);
            prop_assert_eq!((&row.bodies, row.handle), (&wanted.bodies, wanted.handle));
            prop_assert_eq!((row.puck, row.torque, row.applied), (wanted.puck, wanted.torque, wanted.applied));
        }
        prop_assert!(all.next().is_none());
        prop_assert_eq!(log.ending(), &Ending::Whole);
        let mut direct = CsvWriter::new(Vec::new(), &world).unwrap();
        rows.iter().for_each(|row| direct.write(row).unwrap());
        prop_assert!(converted.finish().unwrap() == direct.finish().unwrap());
    }

    #[test]
    fn the_replay_of_every_run_is_bit_identical(text in worlds()) {
        let rows = rows(&world(&text));
        prop_assume!(!rows.is_empty());
        let bytes = logged(&text, &rows);
        let again = replay(&mut Log::read(&bytes[..]).unwrap()).unwrap();
        prop_assert_eq!((again.compared, again.different, again.first), (rows.len() as u64, 0, None));
    }

    #[test]
    fn a_torque_changed_in_its_last_bit_is_detected_at_its_sample(at in 0usize..51, command in any::<bool>()) {
        let mut rows = rows(&world(WHEEL));
        let torque = if command { &mut rows[at].command } else { &mut rows[at].torque };
        let changed = f64::from_bits(torque.to_bits() ^ 1);
        let right = std::mem::replace(torque, changed);
        let bytes = logged(WHEEL, &rows);
        let again = replay(&mut Log::read(&bytes[..]).unwrap()).unwrap();
        let first = again.first.unwrap();
        prop_assert_eq!((again.compared, again.different, first.sample), (51, 1, at as u64));
        prop_assert_eq!((first.logged.to_bits(), first.replayed.to_bits()), (changed.to_bits(), right.to_bits()));
        prop_assert_eq!(first.column, if command { "command_Nm" } else { "torque_Nm" });
        prop_assert_eq!(first.time, rows[at].time);
    }
}

#[test]
fn nan_and_negative_zero_keep_their_bits() {
    let mut rows = rows(&world(WHEEL));
    rows[3].torque = -0.0;
    rows[4].puck = f64::NAN;
    rows[5].command = f64::NEG_INFINITY;
    rows[6].applied = f64::from_bits(1);
    let bytes = logged(WHEEL, &rows);
    let all = bits(&mut Log::read(&bytes[..]).unwrap());
    assert_eq!(all[3][5], (-0.0f64).to_bits());
    assert_eq!(all[4][1], f64::NAN.to_bits());
    assert_eq!(all[5][6], f64::NEG_INFINITY.to_bits());
    assert_eq!(all[6][7], 1);
}

#[test]
fn the_header_of_the_samples_reads_back() {
    let header = Header {
        overrides: vec!["loop.period=2ms".into(), "title='''two\nlines'''".into()],
        certificate_json: Some("{}".into()),
        scenario: Some("step".into()),
        ..header(WHEEL)
    };
    let mut writer = LogWriter::new(Vec::new(), &world(WHEEL), &header, Origin::Run).unwrap();
    writer.write_row(&rows(&world(WHEEL))[0]).unwrap();
    let bytes = writer.finish().unwrap();
    assert_eq!(Log::read(&bytes[..]).unwrap().header, header);
}

#[test]
fn two_bodies_whose_names_differ_in_a_dash_are_two_fields() {
    let text =
        WHEEL.replace("[bodies.wheel]", "[bodies.a-b]\ninertia = 1\n[bodies.a_b]").replace("\"wheel\"", "\"a_b\"");
    let world = world(&text);
    let descriptor = descriptor(&columns(&world, false, false));
    let descriptor = String::from_utf8_lossy(&descriptor);
    for name in ["a-b_rad", "a_b_rad", "a_b_rad_2", "a_b_rad_per_s_2"] {
        assert!(descriptor.contains(name), "{name}");
    }
    let rows = rows(&world);
    let bytes = logged(&text, &rows);
    let all = bits(&mut Log::read(&bytes[..]).unwrap());
    assert_eq!(all[20][10], rows[20].bodies[1].0.to_bits());
    assert_ne!(all[20][8], all[20][10]);
}

#[test]
fn a_log_of_a_longer_run_has_many_chunks_of_bounded_size() {
    let text = WHEEL.replace("0.05 s", "20 s");
    let rows = rows(&world(&text));
    let bytes = logged(&text, &rows);
    // Opcode 6 and a length: between the attachments' end and the index there are only chunks and their indexes.
    let mut at = 8;
    let mut chunks = Vec::new();
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == 6 {
            chunks.push(length);
        }
        at += 9 + length;
    }
    assert!(chunks.len() > 8, "{chunks:?}");
    assert!(chunks.iter().all(|length| *length < (256 << 10) + 4096), "{chunks:?}");
    assert_eq!(bits(&mut Log::read(&bytes[..]).unwrap()).len(), rows.len());
}
