//! The loop's clock: monotonic, cannot be set, and wakes the thread at an absolute instant.

use std::time::Duration;

/// The longest single sleep in ns, so that a loop with a long period notices its end.
const MAX_SLEEP_NS: u64 = 100_000_000;

/// A monotonic clock in ns. It polls for the last part of a wait instead of sleeping.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    origin: Origin,
    spin: u64,
}

impl Clock {
    /// A clock that starts at 0 now, and polls for the last `spin` ns before each instant instead of sleeping.
    pub fn new(spin: Duration) -> Self {
        Clock { origin: Origin::new(), spin: u64::try_from(spin.as_nanos()).unwrap_or(u64::MAX) }
    }

    /// The same clock with this polling time before each instant.
    pub fn spinning(self, spin: Duration) -> Self {
        Clock { spin: u64::try_from(spin.as_nanos()).unwrap_or(u64::MAX), ..self }
    }

    /// ns since the clock was made.
    #[inline]
    pub fn now(&self) -> u64 {
        self.origin.elapsed()
    }

    /// Waits until `due`, and checks every tenth of a second whether the loop `ends`.
    pub fn wait(&self, due: u64, ends: impl Fn() -> bool) {
        let wake = due.saturating_sub(self.spin);
        let mut now = self.now();
        while now < wake && !ends() {
            self.origin.sleep_until(wake.min(now + MAX_SLEEP_NS));
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

    /// The value of CLOCK_MONOTONIC at the start, in ns.
    #[derive(Clone, Copy, Debug)]
    pub struct Origin(u64);

    fn monotonic() -> u64 {
        let Timespec { tv_sec, tv_nsec } = clock_gettime(rustix::time::ClockId::Monotonic);
        // Times since boot: neither is negative.
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

/// Systems without an absolute sleep: a relative one of the remaining time.
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
