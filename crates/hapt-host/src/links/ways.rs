//! What a simulated network does to the messages of a link.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_model::Link;
use hapt_sim::uniform;

/// What happens to the messages of this station on their way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Whatever the network does.
    Real,
    /// They take the time of the links' `delay` and `delay_max`, and are lost as their `loss` says, before the network has them.
    AsWritten,
}

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

/// The way of a simulated network.
pub struct Held<B> {
    pub numbers: Arc<WayNumbers>,
    random: u64,
    /// In the order of their sending: when each is to go, by the thread's clock, and the message.
    messages: VecDeque<(u64, B)>,
}

impl<B: Copy> Held<B> {
    pub fn new(link: &Link, side: usize) -> Self {
        let random = u64::from(link.seed) << 1 | side as u64;
        let delay = [link.delay, link.delay_max].map(|delay| AtomicU64::new((delay * 1e9) as u64));
        let numbers = Arc::new(WayNumbers { delay, loss: AtomicU64::new(link.loss.to_bits()) });
        Held { numbers, random, messages: VecDeque::new() }
    }

    pub fn take(&mut self, now: u64, bytes: B) {
        let [least, most] = self.numbers.delay.each_ref().map(|end| end.load(Ordering::Relaxed));
        if uniform(&mut self.random) >= f64::from_bits(self.numbers.loss.load(Ordering::Relaxed)) {
            let way = least + (uniform(&mut self.random) * most.saturating_sub(least) as f64) as u64;
            self.messages.push_back((now + way, bytes));
        }
    }

    /// Sends what is due. Messages overtake each other.
    pub fn send(&mut self, now: u64, mut send: impl FnMut(B)) {
        self.messages.retain(|(due, bytes)| {
            if *due <= now {
                send(*bytes);
            }
            *due > now
        });
    }
}
