//! The thread between a loop's rings and a network or bus.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hapt_core::Strength;
use hapt_rt::LinkWire;
use hapt_wire::link::{Codec, Outgoing, Refusal, SIZE, Session};

use super::Counters;
use super::channel::InFlight;

/// Messages that are read at a time. More is a flood, and waits in the socket or is lost there.
const AT_ONCE: usize = 64;
/// How often an end says at its end that it has let go: a message may be lost.
const FAREWELLS: usize = 3;

/// What a look at a medium gives.
pub enum Arrived {
    /// A message of so many bytes.
    Message(usize),
    /// What is no link's, or the failure of an earlier message.
    Other,
    /// Nothing waits.
    Nothing,
}

/// What carries the messages of a station's links. Neither function waits.
pub trait Medium: Send + 'static {
    /// How the messages are written.
    type Codec: Codec + Send + 'static;
    /// Where the other end of a link is.
    type To: Copy + Send + 'static;

    /// The next message that has come.
    fn receive(&mut self, into: &mut [u8]) -> Arrived;

    /// Sends a message. A network that is down loses it, and the link lets go.
    fn send(&mut self, to: Self::To, bytes: &[u8]);
}

/// One link's end.
pub struct End<M: Medium> {
    pub wire: LinkWire,
    pub session: Session<M::Codec>,
    pub to: M::To,
    /// Between two messages, in ns; half a sample less, since samples are late now and then.
    pub period: u64,
    /// When the next message is due, in ns by the loop's clock.
    pub next: u64,
    pub last: Option<Outgoing>,
    /// Where messages are on their way before they are sent.
    pub in_flight: Option<InFlight<<M::Codec as Codec>::Bytes>>,
    pub counters: Arc<Counters>,
}

/// Carries messages until it is stopped, and looks for them after each `nap`.
pub fn run<M: Medium>(mut medium: M, mut ends: Vec<End<M>>, stop: &AtomicBool, nap: Duration) {
    let begin = Instant::now();
    // One byte more than a message: what is longer is seen to be.
    let mut buffer = [0; SIZE + 1];
    while !stop.load(Ordering::Relaxed) {
        let now = u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
        for _ in 0..AT_ONCE {
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
        for _ in 0..FAREWELLS {
            if let Some(bytes) = end.session.send(&Outgoing { strength: Strength::NONE, ..last }) {
                medium.send(end.to, bytes.as_ref());
            }
        }
    }
}

/// Gives a message to the link whose it is. One that is of none is counted at the one that knows best why.
fn receive<M: Medium>(ends: &mut [End<M>], bytes: &[u8], now: u64) {
    let mut refused: Option<(usize, Refusal)> = None;
    for (at, end) in ends.iter_mut().enumerate() {
        match end.session.receive(bytes, now) {
            Ok(None) => return,
            Ok(Some(incoming)) => {
                end.counters.take();
                // Without room the loop stands still, and has no use for it.
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
    /// Counts what the loop's samples have made of the link, and sends the newest of them where one is due.
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
