//! MATLAB's files, written here byte by byte after the format's description.

use std::io::Write as _;

use fastrand::Rng;
use hapt_identify::{is_mat, mat_table};

struct Writer {
    is_big: bool,
}

impl Writer {
    fn word(&self, word: u32) -> [u8; 4] {
        if self.is_big { word.to_be_bytes() } else { word.to_le_bytes() }
    }

    fn element(&self, kind: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = [self.word(kind), self.word(data.len() as u32)].concat();
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }

    /// A name of up to four bytes in its tag.
    fn small(&self, kind: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = self.word(kind | (data.len() as u32) << 16).to_vec();
        bytes.extend(data);
        bytes.resize(8, 0);
        bytes
    }

    fn words(&self, kind: u32, words: &[u32]) -> Vec<u8> {
        self.element(kind, &words.iter().flat_map(|word| self.word(*word)).collect::<Vec<u8>>())
    }

    fn doubles(&self, values: &[f64]) -> Vec<u8> {
        let of = |x: &f64| if self.is_big { x.to_be_bytes() } else { x.to_le_bytes() };
        self.element(9, &values.iter().flat_map(of).collect::<Vec<u8>>())
    }

    fn array(&self, name: &str, class: u32, rows: u32, width: u32, data: &[u8]) -> Vec<u8> {
        let name = if name.len() <= 4 && !name.is_empty() {
            self.small(1, name.as_bytes())
        } else {
            self.element(1, name.as_bytes())
        };
        self.element(14, &[&self.words(6, &[class, 0])[..], &self.words(5, &[rows, width]), &name, data].concat())
    }

    fn file(&self, arrays: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = b"MATLAB 5.0 MAT-file, made for a test".to_vec();
        bytes.resize(124, b' ');
        bytes.extend(if self.is_big { *b"\x01\x00MI" } else { *b"\x00\x01IM" });
        bytes.extend(arrays.concat());
        bytes
    }
}

fn zipped(writer: &Writer, array: &[u8]) -> Vec<u8> {
    let mut to = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    to.write_all(array).unwrap();
    let data = to.finish().unwrap();
    [&writer.word(15)[..], &writer.word(data.len() as u32), &data].concat()
}

#[test]
fn arrays_of_one_length_are_a_table_of_either_byte_order() {
    for is_big in [false, true] {
        let w = Writer { is_big };
        let whole: Vec<u8> =
            [3i16, -4, 5].iter().flat_map(|x| if is_big { x.to_be_bytes() } else { x.to_le_bytes() }).collect();
        let fields = w.element(1, b"q_rad\0\0\0u_Nm\0\0\0\0");
        let inner = [
            w.small(5, &w.word(8)),
            fields,
            w.array("", 6, 3, 1, &w.doubles(&[0.5, 1e-9, 3.0])),
            w.array("", 10, 1, 3, &w.element(3, &whole)),
        ];
        let file = w.file(&[
            w.array("note", 4, 1, 2, &w.element(4, &[0, 65, 0, 66])),
            zipped(&w, &w.array("t_s", 6, 3, 1, &w.doubles(&[0.0, 0.1, 0.25]))),
            w.array("k", 6, 1, 1, &w.doubles(&[7.0])),
            w.array("log", 2, 1, 1, &inner.concat()),
            w.array("both", 6, 3, 2, &w.doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            w.array("rows", 6, 2, 3, &w.doubles(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0])),
        ]);
        assert!(is_mat(&file));
        let table = mat_table(&file).unwrap().text;
        let expected = "t_s,log.q_rad,log.u_Nm,both:1,both:2,rows:1,rows:2\n0,0.5,3,1,4,1,4\n0.1,0.000000001,-4,2,5,2,5\n0.25,3,5,3,6,3,6\n";
        assert_eq!(table, expected);
        // However it is cut or changed, it gives an error or a table, and no panic.
        for end in 0..file.len() {
            let _ = mat_table(&file[..end]);
        }
        let mut rng = Rng::with_seed(1);
        for _ in 0..2000 {
            let mut broken = file.clone();
            broken[rng.usize(124..file.len())] = rng.u8(..);
            let _ = mat_table(&broken);
        }
    }
}

/// Simulink's scopes write a struct with a time and an array of signals, each with its values and a label.
#[test]
fn the_signals_of_a_scope_are_columns_with_their_labels() {
    for is_big in [false, true] {
        let w = Writer { is_big };
        let names = |names: &[&str]| {
            let padded = names.iter().flat_map(|name| format!("{name:\0<8}").into_bytes());
            [w.small(5, &w.word(8)), w.element(1, &padded.collect::<Vec<u8>>())].concat()
        };
        let wide: Vec<u8> = "angle\nof both"
            .encode_utf16()
            .flat_map(|x| if is_big { x.to_be_bytes() } else { x.to_le_bytes() })
            .collect();
        let signal = |values: &[f64], width: u32, label: Vec<u8>, letters: u32| {
            let values = w.array("", 6, 3, width, &w.doubles(values));
            [values, w.array("", 4, 1, letters, &label)].concat()
        };
        let signals = [
            names(&["values", "label"]),
            signal(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 2, w.element(4, &wide), 13),
            signal(&[7.0, 8.0, 9.0], 1, w.element(16, "torque in N·m".as_bytes()), 13),
            signal(&[0.5, 0.5, 0.75], 1, w.element(16, b""), 0),
        ];
        let scope = |times: &[f64]| {
            let parts = [
                names(&["time", "signals"]),
                w.array("", 6, 3, 1, &w.doubles(times)),
                w.array("", 2, 1, 3, &signals.concat()),
            ];
            parts.concat()
        };
        let file = w.file(&[
            w.array("scope", 2, 1, 1, &scope(&[0.0, 0.1, 0.2])),
            w.array("again", 6, 3, 1, &w.doubles(&[0.0, 0.1, 0.2])),
        ]);
        let table = mat_table(&file).unwrap();
        let header = "scope.time_s,scope.signals:1.values:1,scope.signals:1.values:2,scope.signals:2.values,scope.signals:3.values,again";
        assert_eq!(
            table.text.lines().collect::<Vec<_>>(),
            [header, "0,1,4,7,0.5,0", "0.1,2,5,8,0.5,0.1", "0.2,3,6,9,0.75,0.2"]
        );
        let labels = [("scope.signals:1", "angle of both"), ("scope.signals:2", "torque in N·m")];
        assert_eq!(table.labels, labels.map(|(name, label)| (name.to_string(), label.to_string())));
        for end in 0..file.len() {
            let _ = mat_table(&file[..end]);
        }
    }
}

#[test]
fn what_is_no_record_is_refused_with_what_would_be_right() {
    // HDF5, with MATLAB's header of level 7.3 before it and without.
    let mut header = format!("{:<124}", "MATLAB 7.3 MAT-file, Platform: GLNXA64").into_bytes();
    header.extend([0x00, 0x02, b'I', b'M']);
    for bytes in [header, b"\x89HDF\r\n\x1a\n and so on".to_vec()] {
        assert!(is_mat(&bytes));
        let words = mat_table(&bytes).unwrap_err().to_string();
        assert!(["HDF5", "7.3", "save('file.mat', '-v7')"].iter().all(|part| words.contains(part)), "{words}");
    }
    let w = Writer { is_big: false };
    let error = |file: &[u8]| mat_table(file).unwrap_err().to_string();
    let none = w.file(&[w.array("note", 4, 1, 2, &w.element(4, &[65, 0, 66, 0]))]);
    assert!(error(&none).contains("no two numeric arrays of one length"), "{}", error(&none));
    let mut newer = none.clone();
    newer[124..126].copy_from_slice(&[0, 2]);
    assert!(error(&newer).contains("-v7"), "{}", error(&newer));
    assert!(error(&none[..100]).contains("cut short"));
}
