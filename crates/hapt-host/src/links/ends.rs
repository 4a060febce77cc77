//! The thread between a loop's rings and a network or bus.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hapt_core::Strength;
use hapt_rt::LinkWire;
use hapt_wire::link::{Codec, Outgoing, Refusal, SIZE, Session};

use super::Counters;
use super::channel::InFlight;

/// The largest number of messages that are read at a time. Further ones wait in the socket or are lost there.
const MESSAGES_AT_ONCE: usize = 64;
/// The number of times that an end sends its last message, which reports the release: a message may be lost.
const LAST_MESSAGES: usize = 3;

/// The result of reading a medium.
pub enum Arrived {
    /// A message of this number of bytes.
    Message(usize),
    /// A message that belongs to no link, or the failure of an earlier message.
    Other,
    /// There is no message.
    Nothing,
}

/// The medium of the messages of a station's links. Neither function blocks.
pub trait Medium: Send + 'static {
    /// The codec of the messages.
    type Codec: Codec + Send + 'static;
    /// The address of a link's other end.
    type To: Copy + Send + 'static;

    /// The next received message.
    fn receive(&mut self, into: &mut [u8]) -> Arrived;

    /// Sends a message. A network that is down loses it, and the link releases.
    fn send(&mut self, to: Self::To, bytes: &[u8]);
}

/// One link's end.
pub struct End<M: Medium> {
    pub wire: LinkWire,
    pub session: Session<M::Codec>,
    pub to: M::To,
    /// The time between two messages, in ns, less half a sample, since samples may be late.
    pub period: u64,
    /// The time at which the next message is due, in ns by the loop's clock.
    pub next: u64,
    pub last: Option<Outgoing>,
    /// The simulated channel of messages before they are sent, where there is one.
    pub in_flight: Option<InFlight<<M::Codec as Codec>::Bytes>>,
    pub counters: Arc<Counters>,
}

/// Carries messages until it is stopped; reads the medium after each `nap`.
pub fn run<M: Medium>(mut medium: M, mut ends: Vec<End<M>>, stop: &AtomicBool, nap: Duration) {
    let begin = Instant::now();
    // One byte more than a message, so that a longer one is detected.
    let mut buffer = [0; SIZE + 1];
    while !stop.load(Ordering::Relaxed) {
        let now = u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
        for _ in 0..MESSAGES_AT_ONCE {
            match medium.receive(&mut buffer) {
                Arrived::Message(length) => receive(&mut ends, &buffer[..length], now),
                Arrived::Other => {}
                Arrived::Nothing => break,
            }
        }
        for end in &mut ends {
            end.send(&mut medium, now);
        }
        std::thread::sleep(nap);
    }
    for end in &mut ends {
        end.send(&mut medium, 0);
        let Some(last) = end.last else { continue };
        for _ in 0..LAST_MESSAGES {
            if let Some(bytes) = end.session.send(&Outgoing { strength: Strength::NONE, ..last }) {
                medium.send(end.to, bytes.as_ref());
            }
        }
    }
}

/// Passes a message to the link that it belongs to. One that belongs to none is counted at the link whose refusal is the most specific.
fn receive<M: Medium>(ends: &mut [End<M>], bytes: &[u8], now: u64) {
    let mut refused: Option<(usize, Refusal)> = None;
    for (at, end) in ends.iter_mut().enumerate() {
        match end.session.receive(bytes, now) {
            Ok(None) => return,
            Ok(Some(incoming)) => {
                end.counters.take();
                // A full ring means that the loop has stopped: the message is dropped.
                let _ = end.wire.incoming.push(incoming);
                return;
            }
            Err(refusal) => {
                if refused.is_none_or(|(_, before)| before == Refusal::Link) {
                    refused = Some((at, refusal));
                }
            }
        }
    }
    if let Some((at, refusal)) = refused {
        ends[at].counters.refuse(refusal);
    }
}

impl<M: Medium> End<M> {
    /// Counts the loop's samples, and sends the newest of them where a message is due.
    fn send(&mut self, medium: &mut M, now: u64) {
        if let Some(in_flight) = &mut self.in_flight {
            while let Some(bytes) = in_flight.arrived(now) {
                medium.send(self.to, bytes.as_ref());
            }
        }
        let mut newest = None;
        while let Ok(sample) = self.wire.samples.pop() {
            self.counters.count(&sample);
            newest = Some(sample.outgoing);
        }
        let Some(outgoing) = newest else { return };
        self.last = Some(outgoing);
        if outgoing.sampled < self.next {
            return;
        }
        self.next = outgoing.sampled + self.period;
        let Some(bytes) = self.session.send(&outgoing) else { return };
        match &mut self.in_flight {
            Some(in_flight) => in_flight.take(now, bytes),
            None => medium.send(self.to, bytes.as_ref()),
        }
    }
}
