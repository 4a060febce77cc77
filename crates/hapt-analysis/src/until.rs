//! Ends an analysis whose result is no longer needed.
//!
//! The searches nest, and their innermost steps are few: an eigenvalue problem, a bound of the damping curve, a certificate. Each checks
//! [`is_over`], and fails at once when it is true; the searches around it then end by their own rules.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

thread_local! {
    static STOP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// The result of `work` on this thread, or `None` where `stop` was set before its end: its result is then meaningless.
///
/// ```
/// use std::sync::{Arc, atomic::{AtomicBool, Ordering}};
/// use hapt_analysis::until;
///
/// let stop = Arc::new(AtomicBool::new(false));
/// assert_eq!(until(&stop, || 42), Some(42));
/// stop.store(true, Ordering::Relaxed);
/// assert_eq!(until(&stop, || 42), None);
/// ```
pub fn until<T>(stop: &Arc<AtomicBool>, work: impl FnOnce() -> T) -> Option<T> {
    /// Restores the previous flag, after a panic too.
    struct Before(Option<Arc<AtomicBool>>);
    impl Drop for Before {
        fn drop(&mut self) {
            STOP.with(|now| *now.borrow_mut() = self.0.take());
        }
    }
    let _before = Before(STOP.with(|now| now.borrow_mut().replace(Arc::clone(stop))));
    let result = work();
    (!stop.load(Relaxed)).then_some(result)
}

/// Whether the caller of [`until`] has set its flag.
pub(crate) fn is_over() -> bool {
    STOP.with(|stop| stop.borrow().as_ref().is_some_and(|stop| stop.load(Relaxed)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_holds_inside_its_own_call_only() {
        let [outer, inner] = [true, false].map(|set| Arc::new(AtomicBool::new(set)));
        let seen = until(&inner, || {
            let within = until(&outer, is_over);
            (within, is_over())
        });
        assert_eq!(seen, Some((None, false)));
        assert!(!is_over());
    }
}
