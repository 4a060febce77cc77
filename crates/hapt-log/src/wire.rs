//! The part of Protocol Buffers that a log needs: varints, doubles and nested bytes.
//! <https://protobuf.dev/programming-guides/encoding/>

/// An encoded field's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    /// Wire type 0.
    Varint(u64),
    /// Wire type 1.
    Double(f64),
    /// Wire types 2 and 5, which samples do not use.
    Other,
}

fn varint(out: &mut Vec<u8>, mut x: u64) {
    while x >= 0x80 {
        out.push(x as u8 | 0x80);
        x >>= 7;
    }
    out.push(x as u8);
}

fn tag(out: &mut Vec<u8>, field: u32, wire: u64) {
    varint(out, u64::from(field) << 3 | wire);
}

/// A whole number.
pub(crate) fn count(out: &mut Vec<u8>, field: u32, x: u64) {
    tag(out, field, 0);
    varint(out, x);
}

/// A double, 0 too: an omitted field would read as 0 and lose the sign of -0.
pub(crate) fn number(out: &mut Vec<u8>, field: u32, x: f64) {
    tag(out, field, 1);
    out.extend_from_slice(&x.to_le_bytes());
}

/// A string, a message, or packed numbers.
pub(crate) fn bytes(out: &mut Vec<u8>, field: u32, bytes: &[u8]) {
    tag(out, field, 2);
    varint(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// Whole numbers, packed.
pub(crate) fn counts(out: &mut Vec<u8>, field: u32, numbers: &[u64]) {
    let mut packed = Vec::new();
    numbers.iter().for_each(|x| varint(&mut packed, *x));
    bytes(out, field, &packed);
}

/// Removes the first field of a message: its number and its content. `None` where the bytes are not a field.
pub(crate) fn take(message: &mut &[u8]) -> Option<(u64, Value)> {
    let tag = take_varint(message)?;
    let value = match tag & 7 {
        0 => Value::Varint(take_varint(message)?),
        1 => Value::Double(f64::from_le_bytes(*take_array(message)?)),
        2 => {
            let length = usize::try_from(take_varint(message)?).ok()?;
            *message = message.get(length..)?;
            Value::Other
        }
        5 => {
            take_array::<4>(message)?;
            Value::Other
        }
        _ => return None,
    };
    Some((tag >> 3, value))
}

fn take_array<'a, const N: usize>(message: &mut &'a [u8]) -> Option<&'a [u8; N]> {
    let (head, rest) = message.split_first_chunk()?;
    *message = rest;
    Some(head)
}

fn take_varint(message: &mut &[u8]) -> Option<u64> {
    let mut x = 0;
    for place in 0..10 {
        let (&byte, rest) = message.split_first()?;
        *message = rest;
        x |= u64::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            return Some(x);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn encoded_fields_read_back(fields in proptest::collection::vec((1u32..1000, any::<u64>(), any::<bool>()), 0..20)) {
            let mut message = Vec::new();
            for &(field, bits, double) in &fields {
                match double {
                    true => number(&mut message, field, f64::from_bits(bits)),
                    false => count(&mut message, field, bits),
                }
            }
            let mut rest = &message[..];
            for (field, bits, double) in fields {
                let (number, value) = take(&mut rest).unwrap();
                prop_assert_eq!(number, u64::from(field));
                match value {
                    Value::Double(x) => prop_assert!(double && x.to_bits() == bits),
                    Value::Varint(x) => prop_assert!(!double && x == bits),
                    Value::Other => prop_assert!(false),
                }
            }
            prop_assert!(rest.is_empty());
        }

        #[test]
        fn bytes_that_are_no_message_end_it(message in proptest::collection::vec(any::<u8>(), 0..60)) {
            let mut rest = &message[..];
            let mut before = rest.len() + 1;
            while rest.len() < before {
                before = rest.len();
                if take(&mut rest).is_none() {
                    break;
                }
            }
        }
    }
}
