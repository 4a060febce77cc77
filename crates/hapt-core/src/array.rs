//! Arrays of any length as tuples: serde itself supports at most 32 entries.

use core::fmt;
use core::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

use crate::Number;

pub fn serialize<F: Serialize, S: Serializer, const N: usize>(array: &[F; N], to: S) -> Result<S::Ok, S::Error> {
    let mut tuple = to.serialize_tuple(N)?;
    array.iter().try_for_each(|x| tuple.serialize_element(x))?;
    tuple.end()
}

pub fn deserialize<'de, F: Number + Deserialize<'de>, D: Deserializer<'de>, const N: usize>(
    from: D,
) -> Result<[F; N], D::Error> {
    from.deserialize_tuple(N, Array(PhantomData))
}

struct Array<F, const N: usize>(PhantomData<F>);

impl<'de, F: Number + Deserialize<'de>, const N: usize> Visitor<'de> for Array<F, N> {
    type Value = [F; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{N} numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<[F; N], A::Error> {
        let mut array = [F::ZERO; N];
        for (i, place) in array.iter_mut().enumerate() {
            *place = from.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
        }
        Ok(array)
    }
}
