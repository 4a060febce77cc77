//! The channel of a simulated network, whose numbers pages change.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_model::Link;
use hapt_sim::Channel;

/// How long the messages of an end take, and how many are lost: changed from any thread.
#[derive(Debug)]
pub struct ChannelNumbers {
    /// In s, as bits: shortest and longest.
    delay: [AtomicU64; 2],
    loss: AtomicU64,
}

impl ChannelNumbers {
    /// From now on every message takes this long, in s.
    pub fn set_delay(&self, delay: f64) {
        self.delay.iter().for_each(|end| end.store(delay.to_bits(), Ordering::Relaxed));
    }

    /// From now on this part of them is lost.
    pub fn set_loss(&self, loss: f64) {
        self.loss.store(loss.to_bits(), Ordering::Relaxed);
    }
}

/// Messages on their way, at instants in ns.
pub(crate) struct InFlight<T> {
    numbers: Arc<ChannelNumbers>,
    random: u64,
    channel: Channel<T>,
}

impl<T: Copy> InFlight<T> {
    /// From the link's first station, `side` 0, or its second.
    pub fn new(link: &Link, side: usize) -> Self {
        let random = u64::from(link.seed) << 1 | side as u64;
        let number = |value: f64| AtomicU64::new(value.to_bits());
        let numbers = ChannelNumbers { delay: [link.delay, link.delay_max_s()].map(number), loss: number(link.loss) };
        InFlight { numbers: Arc::new(numbers), random, channel: Channel::new(link) }
    }

    /// What may be changed of it.
    pub fn numbers(&self) -> Arc<ChannelNumbers> {
        Arc::clone(&self.numbers)
    }

    /// A message that is sent at `now`.
    pub fn take(&mut self, now: u64, message: T) {
        let number = |of: &AtomicU64| f64::from_bits(of.load(Ordering::Relaxed));
        self.channel.delay = self.numbers.delay.each_ref().map(number);
        self.channel.loss = number(&self.numbers.loss);
        self.channel.send(&mut self.random, seconds(now), message);
    }

    /// The next message that has arrived at `now`, which counts whole ns.
    pub fn arrived(&mut self, now: u64) -> Option<T> {
        self.channel.receive(seconds(now) + 0.5e-9)
    }
}

/// Of an instant in ns.
fn seconds(instant: u64) -> f64 {
    instant as f64 * 1e-9
}
