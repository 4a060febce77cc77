//! The time that the host of a virtual machine takes from it: samples are then missed at any priority of the thread.

use std::time::Duration;

/// Where `/proc/stat` has it, after the name: user, nice, system, idle, iowait, irq, softirq, steal.
const STEAL: usize = 7;
/// The kernel's unit in `/proc/stat` on every architecture that Linux runs programs on.
const TICKS_PER_S: f64 = 100.0;

/// The mean steal time of a core so far; `None` where the system does not report it.
#[derive(Clone, Copy, Debug)]
pub struct Stolen(Option<Duration>);

impl Stolen {
    pub fn until_now() -> Self {
        Stolen(std::fs::read_to_string("/proc/stat").ok().as_deref().and_then(mean))
    }

    /// The steal time since then; `None` where it is 0 or unknown.
    pub fn since(self) -> Option<Duration> {
        let taken = Stolen::until_now().0?.checked_sub(self.0?)?;
        (!taken.is_zero()).then_some(taken)
    }
}

/// The first line is the sum of all cores, each of which has a line after it.
fn mean(stat: &str) -> Option<Duration> {
    let cores = stat.lines().skip(1).take_while(|line| line.starts_with("cpu")).count();
    let ticks: f64 = stat.lines().next()?.strip_prefix("cpu ")?.split_whitespace().nth(STEAL)?.parse().ok()?;
    (cores > 0).then(|| Duration::from_secs_f64(ticks / TICKS_PER_S / cores as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stolen_time_is_the_mean_over_the_cores() {
        let stat = "cpu  5 5 5 5 5 0 8 40 0 0\ncpu0 1 1 1 1 1 0 4 30 0 0\ncpu1 4 4 4 4 4 0 4 10 0 0\nintr 7\n";
        assert_eq!(mean(stat), Some(Duration::from_millis(200)));
        assert_eq!(mean(""), None);
        assert_eq!(mean("cpu  1 2 3\ncpu0 1 2 3\n"), None);
    }
}
