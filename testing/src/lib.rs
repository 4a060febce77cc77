//! What the tests of several crates share.

use proptest::test_runner::{Config, RngSeed};

/// In the contributor's loop a random test runs this part of its cases.
const PART: u32 = 8;
/// But no fewer than this, if it has so many.
const FEWEST: u32 = 8;

/// A random test of `all` cases: all of them where `HAPT_CASES` is set, as by `cargo xtask test`, else an eighth.
#[must_use]
pub fn cases(all: u32) -> Config {
    let some = (all / PART).max(FEWEST.min(all));
    let cases = if std::env::var_os("HAPT_CASES").is_some() { all } else { some };
    Config { cases, failure_persistence: None, ..Config::default() }
}

/// The same with the same random numbers every time.
#[must_use]
pub fn cases_from(seed: u64, all: u32) -> Config {
    Config { rng_seed: RngSeed::Fixed(seed), ..cases(all) }
}
