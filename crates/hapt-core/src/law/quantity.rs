//! A number of a law: its key in world files, and its range.

/// The range of a number of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or more, finite.
    ZeroOrMore,
    /// More than zero, finite.
    Positive,
}

/// A number of a law.
#[derive(Debug, PartialEq)]
pub struct Quantity<'a> {
    /// Its key in world files.
    pub name: &'static str,
    /// Its range.
    pub range: Range,
    /// In SI.
    pub value: &'a mut f64,
}

/// The most numbers that a law has.
const NUMBERS: usize = 6;

/// The numbers of a law, in an array of one length for all laws.
pub(super) fn padded<const N: usize>(numbers: [Quantity<'_>; N]) -> [Option<Quantity<'_>>; NUMBERS] {
    const { assert!(N <= NUMBERS) };
    let mut numbers = numbers.into_iter();
    core::array::from_fn(|_| numbers.next())
}
