//! A simulated channel for messages: with delay, reordering, loss and duplicates.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use hapt_model::Link;

use crate::schedule::{between, uniform};

/// The messages in flight on a link, in one direction. Sending and receiving take logarithmic time, and memory is proportional to the messages
/// in flight.
#[derive(Clone, Debug)]
pub struct Channel<T> {
    /// The shortest and the longest delay of a message, in s.
    pub delay: [f64; 2],
    /// The part of the messages that is lost, from 0 to 1.
    pub loss: f64,
    /// The part that arrives a second time, with its own delay.
    pub duplicate: f64,
    in_flight: BinaryHeap<Reverse<Message<T>>>,
    sent: u64,
}

/// A message in flight.
#[derive(Clone, Copy, Debug)]
struct Message<T> {
    arrival: f64,
    /// The order of sending, which orders messages with the same arrival time.
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
    /// An empty channel with the parameters of the link.
    pub fn new(link: &Link) -> Self {
        let delay = [link.delay, link.delay_max_s()];
        Channel { delay, loss: link.loss, duplicate: link.duplicate, in_flight: BinaryHeap::new(), sent: 0 }
    }

    /// Sends a message at `now`, in s. Its loss, duplicate and delays are drawn from `random` ([`uniform`]).
    pub fn send(&mut self, random: &mut u64, now: f64, content: T) {
        let (is_lost, travel_time) = (uniform(random) < self.loss, between(self.delay, uniform(random)));
        let is_copied = self.duplicate > 0.0 && uniform(random) < self.duplicate;
        if is_lost {
            return;
        }
        self.push(now + travel_time, content);
        if is_copied {
            let travel_time = between(self.delay, uniform(random));
            self.push(now + travel_time, content);
        }
    }

    fn push(&mut self, arrival: f64, content: T) {
        self.in_flight.push(Reverse(Message { arrival, number: self.sent, content }));
        self.sent += 1;
    }

    /// Takes out the next message that has arrived by `now`, in s, in the order of arrival.
    pub fn receive(&mut self, now: f64) -> Option<T> {
        let Reverse(first) = self.in_flight.peek()?;
        if first.arrival > now {
            return None;
        }
        self.in_flight.pop().map(|Reverse(message)| message.content)
    }

    /// The number of messages that are in flight, or have arrived and not been received.
    pub fn len(&self) -> usize {
        self.in_flight.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.in_flight.is_empty()
    }
}
