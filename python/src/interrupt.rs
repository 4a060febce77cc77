//! Long computations with the interpreter's lock released, which Ctrl-C ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::Builder;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

use crate::error::internal;

/// The time between two checks of Python's signals.
const SIGNAL_PERIOD: Duration = Duration::from_millis(50);

/// The stack of a thread that computes, in bytes.
const STACK: usize = 8 << 20;

/// A flag that is set when the call is interrupted. The computation checks it and ends early; its result is not used.
#[derive(Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Whether the call has been interrupted.
    pub fn is_set(&self) -> bool {
        self.0.load(Relaxed)
    }

    /// The flag, for [`hapt_analysis::until`].
    pub fn flag(&self) -> &Arc<AtomicBool> {
        &self.0
    }
}

/// The error for a computation without a result. Only an interrupted call stops its computation, and it has already raised an exception.
pub fn unwanted() -> PyErr {
    internal("a computation was stopped while its result was still wanted")
}

/// Runs `work` on its own thread.
///
/// # Errors
/// The exception of a signal's handler, KeyboardInterrupt by default, within [`SIGNAL_PERIOD`]; RuntimeError when the work panics.
pub fn interruptible<T: Send + 'static>(py: Python<'_>, work: impl FnOnce(&Stop) -> T + Send + 'static) -> PyResult<T> {
    let stop = Stop::default();
    let (give, mut take) = sync_channel(1);
    let theirs = stop.clone();
    let run = move || drop(give.send(work(&theirs)));
    Builder::new().name("hapt".into()).stack_size(STACK).spawn(run).map_err(internal)?;
    loop {
        let (back, answer) = py.detach(move || {
            let answer = take.recv_timeout(SIGNAL_PERIOD);
            (take, answer)
        });
        take = back;
        match answer {
            Ok(value) => return Ok(value),
            Err(RecvTimeoutError::Disconnected) => return Err(internal("a computation panicked")),
            Err(RecvTimeoutError::Timeout) => py.check_signals().inspect_err(|_| stop.0.store(true, Relaxed))?,
        }
    }
}

/// Runs `work` on this thread, so that short work does not start another. `work` has to call its argument at least every few milliseconds;
/// that function checks Python's signals and returns whether the call has been interrupted.
///
/// # Errors
/// The exception of a signal's handler.
pub fn asking<T: Send>(py: Python<'_>, work: impl FnOnce(&mut dyn FnMut() -> bool) -> T + Send) -> PyResult<T> {
    py.detach(|| {
        let (mut next, mut raised) = (Instant::now() + SIGNAL_PERIOD, Ok(()));
        let value = work(&mut || {
            if raised.is_ok() && Instant::now() >= next {
                raised = Python::attach(|py| py.check_signals());
                next = Instant::now() + SIGNAL_PERIOD;
            }
            raised.is_err()
        });
        raised.map(|()| value)
    })
}

/// The same as [`interruptible`] with a new thread pool of `threads` threads (0: all cores): a forked process has no threads of its parent.
pub fn in_parallel<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce(&Stop) -> T + Send + 'static,
) -> PyResult<T> {
    interruptible(py, move |stop| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build().map_err(internal)?;
        Ok(pool.install(|| work(stop)))
    })?
}
