//! A table in parts, for several machines.

use std::ops::Range;
use std::str::FromStr;

/// Part `index` of a table in `count` parts, written `I/N`, such as `0/4` to `3/4`.
///
/// ```
/// use hapt_sweep::Shard;
///
/// let shards = ["0/3", "1/3", "2/3"].map(|text| text.parse::<Shard>().unwrap().cells(10));
/// assert_eq!(shards, [0..3, 3..6, 6..10]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Shard {
    /// The whole table.
    pub const WHOLE: Shard = Shard { index: 0, count: 1 };

    /// Its cells of a table of `cells`: floor(I cells/N) up to floor((I + 1) cells/N). Empty where there are more shards than cells.
    pub fn cells(self, cells: u64) -> Range<u64> {
        // At most `cells`.
        let at = |index: u64| (u128::from(index) * u128::from(cells) / u128::from(self.count)) as u64;
        at(self.index)..at(self.index + 1)
    }

    /// Whether the table begins with it.
    pub fn is_first(self) -> bool {
        self.index == 0
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Shard { index, count }),
            Some((_, count)) if count > 0 => Err(format!("of {count} shards the last is {}/{count}", count - 1)),
            _ => Err("expected I/N, such as 0/4 for the first of four".into()),
        }
    }
}
