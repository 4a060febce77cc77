//! A link to another station's loop: two rings, and what becomes of them at a sample.

use hapt_core::{Heard, LinkEnd};
use hapt_model::Link;
use hapt_wire::link::{Incoming, Outgoing};
use rtrb::{Consumer, Producer, RingBuffer};

/// Capacity of the rings.
const ROOM: usize = 64;

/// What a sample has made of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkSample {
    /// What the other station is to know.
    pub outgoing: Outgoing,
    /// How old the other's position is at most at the end of the coming hold, in s; infinite without one.
    pub age: f64,
    /// How often this end has let go.
    pub let_go: u64,
}

/// The loop's side of a link. It reads the newest position from a ring, and waits for nobody.
pub struct LinkPort {
    link: Link,
    first: bool,
    hold: f64,
    end: LinkEnd,
    incoming: Consumer<Incoming>,
    samples: Producer<LinkSample>,
    newest: Option<Incoming>,
}

/// The network's side of it.
pub struct LinkWire {
    /// What the other station has said, in the order of its sending. Instants are by the loop's clock, as those of the samples.
    pub incoming: Producer<Incoming>,
    /// One a sample; those without room are lost.
    pub samples: Consumer<LinkSample>,
}

/// A link's end at its first or second station, whose torques act for at most `hold` seconds after their samples
/// ([`hapt_model::Station::hold`]).
pub fn link(link: &Link, first: bool, hold: f64) -> (LinkPort, LinkWire) {
    let (coming, incoming) = RingBuffer::new(ROOM);
    let (samples, going) = RingBuffer::new(ROOM);
    let end = LinkEnd::new(first, link.age_max, hold);
    let port = LinkPort { link: link.clone(), first, hold, end, incoming, samples, newest: None };
    (port, LinkWire { incoming: coming, samples: going })
}

impl LinkPort {
    /// The torque on the puck at `position` in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, ready: bool, now: u64, position: f64) -> f64 {
        for _ in 0..ROOM {
            match self.incoming.pop() {
                Ok(incoming) => self.newest = Some(incoming),
                Err(_) => break,
            }
        }
        // From the future is from no clock of this loop.
        let age = |since: u64| now.checked_sub(since).map(|age| age as f64 * 1e-9);
        let heard = self.newest.and_then(|newest| {
            let Incoming { position, hears, acts, .. } = newest;
            Some(Heard { age: age(newest.since?)?, position, hears, acts })
        });
        let LinkPort { link, first, .. } = self;
        let torque = self.end.sample(ready, heard, |other| link.torque_at(*first, position, other));
        let outgoing = Outgoing {
            sampled: now,
            position,
            hears: self.end.hears(),
            acts: self.end.acts(),
            heard: self.newest.map(|newest| newest.number),
        };
        let age = heard.map_or(f64::INFINITY, |heard| heard.age + self.hold);
        let _ = self.samples.push(LinkSample { outgoing, age, let_go: self.end.let_go() });
        torque
    }
}
