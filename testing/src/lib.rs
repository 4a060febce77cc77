//! Helpers for the tests of several crates.

pub mod laws;
pub mod property;

/// proptest's, with [`proptest!`] of this crate.
pub mod prelude {
    pub use proptest::prelude::*;

    pub use crate::proptest;
}

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use proptest::test_runner::{Config, RngSeed};

/// A random test runs one case of this many, unless `HAPT_ONE_IN` has another number.
const ONE_IN: u32 = 8;
/// The least number of cases that a test runs, if it has that many.
const MIN_CASES: u32 = 2;

/// The world file of a wheel on a spring.
pub const WHEEL: &str = r#"title = "wheel"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[scenarios.step]
duration = "0.5 s"
hand = { kind = "step", to = "45 deg" }
"#;

/// A random test of `all` cases: one in [`HAPT_ONE_IN`](one_in) of them.
///
/// Its random numbers are those of `PROPTEST_RNG_SEED`, which `.cargo/config.toml` sets.
#[must_use]
pub fn cases(all: u32) -> Config {
    let cases = (all / one_in()).max(MIN_CASES.min(all));
    Config { cases, failure_persistence: None, ..Config::default() }
}

/// The seeds of a test that draws its own numbers and takes long over each: the first of 0 to `all`, one in [`HAPT_ONE_IN`](one_in) of them.
#[must_use]
pub fn seeds(all: u64) -> Range<u64> {
    0..all.div_ceil(u64::from(one_in()))
}

/// Of how many cases a random test runs one: 8, or what `HAPT_ONE_IN` says; 1 runs all of them, as the scheduled run does.
///
/// # Panics
/// Where `HAPT_ONE_IN` is no whole number above 0.
#[must_use]
pub fn one_in() -> u32 {
    let Ok(text) = std::env::var("HAPT_ONE_IN") else { return ONE_IN };
    text.parse()
        .ok()
        .filter(|n| *n > 0)
        .unwrap_or_else(|| panic!("HAPT_ONE_IN is {text:?}, not a whole number above 0"))
}

/// The same with random numbers of its own, which are the same every time.
#[must_use]
pub fn cases_from(seed: u64, all: u32) -> Config {
    Config { rng_seed: RngSeed::Fixed(seed), ..cases(all) }
}

/// Where a thread that sleeps 1 ms wakes up later by this time, or threads wait longer for a processor, the machine is too busy for tests by
/// the clock.
const MAX_LATENESS: Duration = Duration::from_millis(5);
/// The most attempts of a test on such a machine.
const MAX_ATTEMPTS: u32 = 8;
/// The pause before the second attempt; each further one is twice as long. Other programs may end meanwhile.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Runs a test that depends on the clock, such as that of a drive's watchdog. Where it fails while the machine was too busy to keep time,
/// it runs again, eight times in all: a defect fails on a machine that keeps time too.
///
/// # Panics
/// As the test, where the machine kept time or the last attempt failed.
pub fn in_time(test: impl Fn()) {
    for attempt in 1.. {
        let waited_before = waited();
        let runs = AtomicBool::new(true);
        let (ended, latest) = thread::scope(|scope| {
            let watch = scope.spawn(|| {
                let mut latest = Duration::ZERO;
                while runs.load(Ordering::Relaxed) {
                    let asleep = Instant::now();
                    thread::sleep(Duration::from_millis(1));
                    latest = latest.max(asleep.elapsed());
                }
                latest
            });
            let ended = catch_unwind(AssertUnwindSafe(&test));
            runs.store(false, Ordering::Relaxed);
            (ended, watch.join().unwrap_or_default())
        });
        match ended {
            Ok(()) => return,
            Err(_) if latest.max(waited().saturating_sub(waited_before)) > MAX_LATENESS && attempt < MAX_ATTEMPTS => {
                eprintln!("the machine was too busy: attempt {attempt} does not count");
                thread::sleep(FIRST_PAUSE * 2_u32.pow(attempt - 1));
            }
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// The time in which some thread of the machine waited for a processor, since its start; 0 where the kernel does not count it.
fn waited() -> Duration {
    let pressure = std::fs::read_to_string("/proc/pressure/cpu").unwrap_or_default();
    let total = pressure.split_whitespace().find_map(|field| field.strip_prefix("total="));
    Duration::from_micros(total.and_then(|total| total.parse().ok()).unwrap_or(0))
}
