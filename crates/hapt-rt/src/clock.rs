//! The loop's clock: it never goes back, nobody can set it, and it wakes the thread at an instant, not after a while.

use std::time::Duration;

/// So long at most is slept at once, so that the end of a loop with a long period is seen.
const NAP: u64 = 100_000_000;

/// A monotonic clock in ns, and how early to wake up and watch it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    origin: Origin,
    spin: u64,
}

impl Clock {
    /// A clock that stands at 0 now, and watches the time for the last `spin` before each instant instead of sleeping.
    pub fn new(spin: Duration) -> Self {
        Clock { origin: Origin::new(), spin: u64::try_from(spin.as_nanos()).unwrap_or(u64::MAX) }
    }

    /// The same clock, watched for so long before each instant.
    pub fn spinning(self, spin: Duration) -> Self {
        Clock { spin: u64::try_from(spin.as_nanos()).unwrap_or(u64::MAX), ..self }
    }

    /// ns since the clock was made.
    #[inline]
    pub fn now(&self) -> u64 {
        self.origin.elapsed()
    }

    /// Waits until `due`; before that it looks every tenth of a second whether it `ends`.
    pub fn wait(&self, due: u64, ends: impl Fn() -> bool) {
        let wake = due.saturating_sub(self.spin);
        let mut now = self.now();
        while now < wake && !ends() {
            self.origin.sleep_until(wake.min(now + NAP));
            now = self.now();
        }
        while now < due && !ends() {
            std::hint::spin_loop();
            now = self.now();
        }
    }
}

#[cfg(target_os = "linux")]
use linux::Origin;
#[cfg(not(any(target_os = "linux", target_family = "wasm")))]
use other::Origin;
#[cfg(target_family = "wasm")]
use wasm::Origin;

#[cfg(target_os = "linux")]
mod linux {
    use rustix::thread::{ClockId, clock_nanosleep_absolute};
    use rustix::time::{Timespec, clock_gettime};

    /// Where CLOCK_MONOTONIC stood, in ns.
    #[derive(Clone, Copy, Debug)]
    pub struct Origin(u64);

    fn monotonic() -> u64 {
        let Timespec { tv_sec, tv_nsec } = clock_gettime(rustix::time::ClockId::Monotonic);
        // Since the machine was started: neither is negative.
        tv_sec as u64 * 1_000_000_000 + tv_nsec as u64
    }

    impl Origin {
        pub fn new() -> Self {
            Origin(monotonic())
        }

        #[inline]
        pub fn elapsed(&self) -> u64 {
            monotonic().saturating_sub(self.0)
        }

        /// One system call; a signal may end it early.
        pub fn sleep_until(&self, at: u64) {
            let at = self.0 + at;
            let request = Timespec { tv_sec: (at / 1_000_000_000) as i64, tv_nsec: (at % 1_000_000_000) as _ };
            let _ = clock_nanosleep_absolute(ClockId::Monotonic, &request);
        }
    }
}

/// Where there is no sleep until an instant, one that is as long as the way there.
#[cfg(not(any(target_os = "linux", target_family = "wasm")))]
mod other {
    use std::time::{Duration, Instant};

    #[derive(Clone, Copy, Debug)]
    pub struct Origin(Instant);

    impl Origin {
        pub fn new() -> Self {
            Origin(Instant::now())
        }

        pub fn elapsed(&self) -> u64 {
            self.0.elapsed().as_nanos() as u64
        }

        pub fn sleep_until(&self, at: u64) {
            std::thread::sleep(Duration::from_nanos(at.saturating_sub(self.elapsed())));
        }
    }
}

/// In a page there is no clock and no thread: its samples are taken by a [`crate::Stepper`].
#[cfg(target_family = "wasm")]
mod wasm {
    #[derive(Clone, Copy, Debug)]
    pub struct Origin;

    impl Origin {
        pub fn new() -> Self {
            Origin
        }

        pub fn elapsed(&self) -> u64 {
            0
        }

        pub fn sleep_until(&self, _at: u64) {}
    }
}
