//! Real-time scheduling of a thread: priority, locked memory, a stack that is paged in.

use crate::Settings;

/// The scheduling that the system granted to the loop's thread.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Realtime {
    /// Its priority under SCHED_FIFO, from 1 to 99; `None`: normal scheduling.
    pub priority: Option<u8>,
    /// Whether the process's memory is locked, so that no page fault occurs.
    pub locked: bool,
    /// The settings that the system refused, with remedies.
    pub warnings: Vec<String>,
}

/// More stack, in bytes, than the loop's deepest call uses.
const STACK: usize = 256 << 10;

/// Prepares the calling thread.
pub(crate) fn prepare(settings: &Settings) -> Realtime {
    let realtime = system::prepare(settings);
    touch_the_stack();
    realtime
}

/// Writes to every page of the stack that the loop may reach, so that the system maps it now.
#[inline(never)]
fn touch_the_stack() {
    let mut pages = [0_u8; STACK];
    for byte in pages.iter_mut().step_by(4096) {
        // Keeps the write from being optimised away.
        *std::hint::black_box(byte) = 1;
    }
}

#[cfg(target_os = "linux")]
mod system {
    use std::num::NonZeroU64;

    use rustix::mm::{MlockAllFlags, mlockall};
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{
        CapabilitySet, CpuSet, capabilities, sched_getaffinity, sched_setaffinity, set_current_timer_slack,
    };

    use super::Realtime;
    use crate::Settings;

    pub fn prepare(settings: &Settings) -> Realtime {
        // The default timer slack of normal threads delays wake-ups by 50 us.
        let _ = set_current_timer_slack(NonZeroU64::new(1));
        let mut realtime = Realtime::default();
        if let Some(priority) = settings.priority
            && (!settings.leave_a_core || leave_a_core())
        {
            match set_fifo(priority) {
                Ok(()) => realtime.priority = Some(priority),
                Err(error) => realtime.warnings.push(no_fifo(priority, &error)),
            }
        }
        if settings.lock {
            match lock() {
                Ok(()) => realtime.locked = true,
                Err(why) => realtime.warnings.push(no_lock(&why)),
            }
        }
        realtime
    }

    /// Excludes the first core from this thread's affinity; false where there is no other.
    fn leave_a_core() -> bool {
        let Ok(mut cores) = sched_getaffinity(None) else { return false };
        let first = (0..CpuSet::MAX_CPU).find(|core| cores.is_set(*core));
        if let Some(first) = first.filter(|_| cores.count() > 1) {
            cores.unset(first);
        } else {
            return false;
        }
        sched_setaffinity(None, &cores).is_ok()
    }

    /// SCHED_FIFO for this thread. No crate wraps this call for all of Linux's C libraries.
    #[allow(unsafe_code)]
    fn set_fifo(priority: u8) -> std::io::Result<()> {
        // SAFETY: sched_param is plain integers, for which zeros are values; musl has more of them than glibc.
        let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
        parameters.sched_priority = priority.into();
        // SAFETY: pthread_self() is a running thread, and the parameters outlive the call, which only reads them.
        let error = unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &parameters) };
        if error == 0 { Ok(()) } else { Err(std::io::Error::from_raw_os_error(error)) }
    }

    /// Locks present and future memory. Under a limit on locked memory any later allocation beyond the limit would fail, so that a limit
    /// is a refusal.
    fn lock() -> Result<(), String> {
        let limit = getrlimit(Resource::Memlock).current;
        let is_free = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
        if let Some(limit) = limit
            && !is_free
        {
            return Err(format!("this user may lock {} kB only", limit >> 10));
        }
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string())
    }

    fn no_fifo(priority: u8, error: &std::io::Error) -> String {
        format!(
            "no real-time priority: the system refuses SCHED_FIFO {priority} ({error}), so that any other process may delay the \
             loop; to allow it, write `@realtime - rtprio {priority}` and `@realtime - memlock unlimited` into \
             /etc/security/limits.d/realtime.conf, run `sudo groupadd -f realtime && sudo usermod -aG realtime $USER`, and log in anew \
             (or, for this program alone: sudo setcap cap_sys_nice,cap_ipc_lock=ep \"$(command -v hapt)\")"
        )
    }

    fn no_lock(why: &str) -> String {
        format!(
            "memory is not locked: {why}, so that a page fault may delay the loop; to allow it, \
             write `@realtime - memlock unlimited` into /etc/security/limits.d/realtime.conf, with your user in the group realtime, and \
             log in anew (or, for this program alone: sudo setcap cap_sys_nice,cap_ipc_lock=ep \"$(command -v hapt)\")"
        )
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use super::Realtime;
    use crate::Settings;

    pub fn prepare(settings: &Settings) -> Realtime {
        let is_requested = settings.priority.is_some() || settings.lock;
        let warning = "no real-time priority: on this system the loop runs as an ordinary thread with larger jitter; Linux offers real-time \
                       scheduling";
        Realtime { warnings: is_requested.then(|| warning.into()).into_iter().collect(), ..Realtime::default() }
    }
}
