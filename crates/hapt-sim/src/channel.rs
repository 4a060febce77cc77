//! A simulated way of messages: they take time, overtake each other, are lost, and arrive twice.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use hapt_model::Link;

use crate::schedule::{between, uniform};

/// The messages under way on a link, in one direction. A message costs the time of a search among those under way, and the memory is theirs.
#[derive(Clone, Debug)]
pub struct Channel<T> {
    /// How long a message takes, in s: shortest and longest.
    pub delay: [f64; 2],
    /// The part of the messages that is lost, from 0 to 1.
    pub loss: f64,
    /// The part that arrives a second time, after a time of its own.
    pub duplicate: f64,
    under_way: BinaryHeap<Reverse<Message<T>>>,
    sent: u64,
}

/// A message under way.
#[derive(Clone, Copy, Debug)]
struct Message<T> {
    arrival: f64,
    /// Of messages that arrive together the one that was sent first comes first.
    number: u64,
    content: T,
}

impl<T> Ord for Message<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.arrival.total_cmp(&other.arrival).then(self.number.cmp(&other.number))
    }
}

impl<T> PartialOrd for Message<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> PartialEq for Message<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<T> Eq for Message<T> {}

impl<T: Copy> Channel<T> {
    /// As the link's keys say, empty.
    pub fn new(link: &Link) -> Self {
        let delay = [link.delay, link.delay_max_s()];
        Channel { delay, loss: link.loss, duplicate: link.duplicate, under_way: BinaryHeap::new(), sent: 0 }
    }

    /// Sends a message at `now`, in s. What happens to it is drawn from `random` ([`uniform`]).
    pub fn send(&mut self, random: &mut u64, now: f64, content: T) {
        let (is_lost, way) = (uniform(random) < self.loss, between(self.delay, uniform(random)));
        let is_copied = self.duplicate > 0.0 && uniform(random) < self.duplicate;
        if is_lost {
            return;
        }
        self.push(now + way, content);
        if is_copied {
            let way = between(self.delay, uniform(random));
            self.push(now + way, content);
        }
    }

    fn push(&mut self, arrival: f64, content: T) {
        self.under_way.push(Reverse(Message { arrival, number: self.sent, content }));
        self.sent += 1;
    }

    /// Takes out the next message that has arrived by `now`, in s; first those that arrived first.
    pub fn receive(&mut self, now: f64) -> Option<T> {
        let Reverse(first) = self.under_way.peek()?;
        if first.arrival > now {
            return None;
        }
        self.under_way.pop().map(|Reverse(message)| message.content)
    }

    /// How many messages are under way, or have arrived and not been received.
    pub fn len(&self) -> usize {
        self.under_way.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.under_way.is_empty()
    }
}
