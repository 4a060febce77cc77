//! The channel of a simulated network, whose numbers pages can change.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_model::Link;
use hapt_sim::Channel;

/// Delay and loss of the messages of an end, which any thread may change.
#[derive(Debug)]
pub struct ChannelNumbers {
    /// The shortest and the longest delay in s, as bits.
    delay: [AtomicU64; 2],
    loss: AtomicU64,
}

impl ChannelNumbers {
    /// Sets the delay of every message from now on, in s.
    pub fn set_delay(&self, delay: f64) {
        self.delay.iter().for_each(|end| end.store(delay.to_bits(), Ordering::Relaxed));
    }

    /// Sets the part of the messages that is lost from now on.
    pub fn set_loss(&self, loss: f64) {
        self.loss.store(loss.to_bits(), Ordering::Relaxed);
    }
}

/// Messages in flight, at instants in ns.
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

    /// Its numbers, which may be changed.
    pub fn numbers(&self) -> Arc<ChannelNumbers> {
        Arc::clone(&self.numbers)
    }

    /// Takes a message that is sent at `now`.
    pub fn take(&mut self, now: u64, message: T) {
        let number = |of: &AtomicU64| f64::from_bits(of.load(Ordering::Relaxed));
        self.channel.delay = self.numbers.delay.each_ref().map(number);
        self.channel.loss = number(&self.numbers.loss);
        self.channel.send(&mut self.random, seconds(now), message);
    }

    /// The next message that has arrived by `now`, in ns.
    pub fn arrived(&mut self, now: u64) -> Option<T> {
        self.channel.receive(seconds(now) + 0.5e-9)
    }
}

/// An instant in ns, converted to s.
fn seconds(instant: u64) -> f64 {
    instant as f64 * 1e-9
}
