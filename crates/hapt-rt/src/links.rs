//! A link to another station's loop: two rings, and the torque at each sample.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_core::{ExternalTorqueInput, LinkEnd, LinkTerms, RemoteState};
use hapt_model::Link;
use hapt_wire::link::{Incoming, Outgoing};
use rtrb::{Consumer, Producer, RingBuffer};

/// Capacity of the rings.
const ROOM: usize = 64;

/// A link at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkSample {
    /// The message for the other station.
    pub outgoing: Outgoing,
    /// Whether its torque acts.
    pub acts: bool,
    /// A bound on the age of the position that acts, else of the newest, at the end of the coming hold, in s; infinite without one.
    pub age: f64,
    /// The greatest age at which a position acts, in s.
    pub age_max: f64,
    /// The number of releases of this end.
    pub releases: u64,
}

/// The numbers of a link's end that a simulation may change while it runs: the link's stiffness, and the end's terms, in SI.
#[derive(Clone, Debug)]
pub struct LinkTuning(Arc<[AtomicU64; 5]>);

impl LinkTuning {
    /// With these numbers.
    pub fn new(stiffness: f64, terms: LinkTerms) -> Self {
        let tuning = LinkTuning(Arc::default());
        tuning.set(stiffness, terms);
        tuning
    }

    /// Changes all numbers from the next sample on.
    pub fn set(&self, stiffness: f64, terms: LinkTerms) {
        let LinkTerms { age_max, hold, period, soft } = terms;
        for (number, value) in self.0.iter().zip([stiffness, age_max, hold, period, soft]) {
            number.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    /// The stiffness, and the terms.
    pub fn get(&self) -> (f64, LinkTerms) {
        let [stiffness, age_max, hold, period, soft] =
            self.0.each_ref().map(|number| f64::from_bits(number.load(Ordering::Relaxed)));
        (stiffness, LinkTerms { age_max, hold, period, soft })
    }
}

/// The loop's side of a link. It reads the newest position from a ring, and never blocks.
pub struct LinkPort {
    link: Link,
    first: bool,
    end: LinkEnd,
    /// The time between two consecutive numbers of the other end's messages, in s of its clock.
    tick: f64,
    /// The time of the previous sample, in ns by the loop's clock.
    before: Option<u64>,
    incoming: Consumer<Incoming>,
    samples: Producer<LinkSample>,
    newest: Option<Incoming>,
    tuning: Option<LinkTuning>,
}

/// The network's side of it.
pub struct LinkWire {
    /// The other station's messages, in the order of their sending. Instants are by the loop's clock, as those of the samples.
    pub incoming: Producer<Incoming>,
    /// One per sample; samples that find the ring full are lost.
    pub samples: Consumer<LinkSample>,
}

/// A link's end at its first or second station, on its terms ([`hapt_model::System::end`]). The other end takes its positions `tick`
/// seconds apart for each 1 by which the numbers of its messages differ.
pub fn link(link: &Link, first: bool, terms: LinkTerms, tick: f64) -> (LinkPort, LinkWire) {
    let (pushed, incoming) = RingBuffer::new(ROOM);
    let (samples, taken) = RingBuffer::new(ROOM);
    let end = LinkEnd::new(first, terms);
    let link = link.clone();
    let port = LinkPort { link, first, end, tick, before: None, incoming, samples, newest: None, tuning: None };
    (port, LinkWire { incoming: pushed, samples: taken })
}

impl LinkPort {
    /// The same, with numbers that may be changed while it runs.
    pub fn tuned(self, tuning: LinkTuning) -> Self {
        LinkPort { tuning: Some(tuning), ..self }
    }

    /// The torque on the puck in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, own: &ExternalTorqueInput<f64>, now: u64) -> f64 {
        for _ in 0..ROOM {
            match self.incoming.pop() {
                Ok(incoming) => self.newest = Some(incoming),
                Err(_) => break,
            }
        }
        if let Some((stiffness, terms)) = self.tuning.as_ref().map(LinkTuning::get) {
            if stiffness != self.link.stiffness() {
                self.link = self.link.with_stiffness(stiffness);
            }
            self.end.set_terms(terms);
        }
        // A position from the future is by another clock, and is ignored.
        let age = |since: u64| now.checked_sub(since).map(|age| age as f64 * 1e-9);
        let remote = self.newest.and_then(|newest| {
            let Incoming { number, since, position, strength } = newest;
            let taken = number.sequence as f64 * self.tick;
            Some(RemoteState { age: age(since?)?, session: number.session, taken, position, strength })
        });
        let elapsed = self.before.replace(now).map_or(0.0, |before| now.saturating_sub(before) as f64 * 1e-9);
        let LinkPort { link, first, .. } = self;
        let ExternalTorqueInput { ready, position, velocity, .. } = *own;
        let torque = self
            .end
            .sample(elapsed, ready, remote, |other, at| link.torque_at(*first, [position, velocity], other, at));
        let outgoing = Outgoing {
            sampled: now,
            position,
            strength: self.end.sent_strength(),
            received: self.newest.map(|newest| newest.number),
        };
        let LinkTerms { age_max, hold, .. } = self.end.terms();
        let age = self.end.age().or(remote.map(|remote| remote.age + hold)).unwrap_or(f64::INFINITY);
        let acts = self.end.strength().acts();
        let _ = self.samples.push(LinkSample { outgoing, acts, age, age_max, releases: self.end.releases() });
        torque
    }
}
