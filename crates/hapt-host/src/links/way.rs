//! The way of a simulated network: what is on it takes time, and is lost.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_model::Link;
use hapt_sim::uniform;

/// How long the messages of an end take, and how many are lost.
#[derive(Debug)]
pub struct WayNumbers {
    /// In ns, shortest and longest.
    delay: [AtomicU64; 2],
    loss: AtomicU64,
}

impl WayNumbers {
    /// From now on every message takes this long, in s.
    pub fn set_delay(&self, delay: f64) {
        self.delay.iter().for_each(|end| end.store((delay * 1e9) as u64, Ordering::Relaxed));
    }

    /// From now on this part of them is lost.
    pub fn set_loss(&self, loss: f64) {
        self.loss.store(loss.to_bits(), Ordering::Relaxed);
    }
}

/// Messages on their way, in the order of their sending.
pub(crate) struct Held<T> {
    numbers: Arc<WayNumbers>,
    random: u64,
    /// When each arrives, in ns.
    messages: VecDeque<(u64, T)>,
}

impl<T: Copy> Held<T> {
    /// From the link's first station, `side` 0, or its second.
    pub fn new(link: &Link, side: usize) -> Self {
        let random = u64::from(link.seed) << 1 | side as u64;
        let delay = [link.delay, link.delay_max_s()].map(|delay| AtomicU64::new((delay * 1e9) as u64));
        let numbers = Arc::new(WayNumbers { delay, loss: AtomicU64::new(link.loss.to_bits()) });
        Held { numbers, random, messages: VecDeque::new() }
    }

    /// What may be changed of it.
    pub fn numbers(&self) -> Arc<WayNumbers> {
        Arc::clone(&self.numbers)
    }

    /// A message that is sent at `now`, in ns.
    pub fn take(&mut self, now: u64, message: T) {
        let [least, most] = self.numbers.delay.each_ref().map(|end| end.load(Ordering::Relaxed));
        if uniform(&mut self.random) >= f64::from_bits(self.numbers.loss.load(Ordering::Relaxed)) {
            let way = least + (uniform(&mut self.random) * most.saturating_sub(least) as f64) as u64;
            self.messages.push_back((now + way, message));
        }
    }

    /// Passes on what has arrived at `now`. Messages overtake each other.
    pub fn arrived(&mut self, now: u64, mut each: impl FnMut(T)) {
        self.messages.retain(|(due, message)| {
            if *due <= now {
                each(*message);
            }
            *due > now
        });
    }
}
