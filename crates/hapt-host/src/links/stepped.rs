//! Links between stations that one thread runs ([`crate::Machine::stepped`]): no sockets and no key.

use std::sync::Arc;

use hapt_model::{Station, System};
use hapt_rt::{LinkPort, LinkWire, link};
use hapt_wire::link::{Incoming, Number, Outgoing};

use super::way::Held;
use super::{Counters, LinkStatus, WayNumbers};

/// The links of all stations of a network. Ages count as over a real network, by the round trip. Each station has its own clock
/// ([`Station::shown`]), and messages take the time of the network's.
pub struct SteppedLinks {
    /// Both ends of each link, one after the other.
    ends: Vec<End>,
}

struct End {
    station: usize,
    /// Whose clock the samples are by.
    sender: Station,
    wire: LinkWire,
    held: Held<Outgoing>,
    /// Between two messages, in ns, and when the next one is due.
    period: u64,
    next: u64,
    /// The newest sample of the other end that has arrived, by its instant in ns.
    newest: Option<u64>,
    counters: Arc<Counters>,
}

impl SteppedLinks {
    /// The second are the loops' ends, by station.
    pub fn new(network: &System) -> (Self, Vec<Vec<LinkPort>>) {
        let mut ports: Vec<Vec<LinkPort>> = network.stations.iter().map(|_| Vec::new()).collect();
        let mut ends = Vec::new();
        for (at, joint) in network.links.iter().enumerate() {
            for (side, station) in joint.between.into_iter().enumerate() {
                let (port, wire) = link(joint, side == 0, network.end(at, side), 1e-9);
                ports[station].push(port);
                let sample = network.stations[station].world.sampling.period;
                let period = joint.period.map_or(0.0, |_| joint.between_messages(sample) - 0.5 * sample);
                let to = &network.stations[joint.between[1 - side]].name;
                ends.push(End {
                    station,
                    sender: network.stations[station].clone(),
                    wire,
                    held: Held::new(joint, side),
                    period: (period * 1e9) as u64,
                    next: 0,
                    newest: None,
                    counters: Arc::new(Counters::new(to, joint.age_max)),
                });
            }
        }
        (SteppedLinks { ends }, ports)
    }

    /// What happens to the messages of each end.
    pub fn ways(&self) -> Vec<Arc<WayNumbers>> {
        self.ends.iter().map(|end| end.held.numbers()).collect()
    }

    /// What the links of a station have done so far, whenever it is called.
    pub fn status(&self, station: usize) -> impl Fn() -> Vec<LinkStatus> + Send + 'static {
        let own = self.ends.iter().filter(|end| end.station == station);
        let counters: Vec<Arc<Counters>> = own.map(|end| Arc::clone(&end.counters)).collect();
        move || counters.iter().map(|counters| counters.status()).collect()
    }

    /// Sends what the loops have sampled, and passes on what has arrived at `now`, in ns by the network's clock.
    pub fn carry(&mut self, now: u64) {
        for pair in self.ends.chunks_exact_mut(2) {
            let [one, other] = pair else { continue };
            one.send();
            other.send();
            one.pass_on(now, other);
            other.pass_on(now, one);
        }
    }
}

impl End {
    fn send(&mut self) {
        let mut newest = None;
        while let Ok(sample) = self.wire.samples.pop() {
            self.counters.count(&sample);
            newest = Some(sample.outgoing);
        }
        if let Some(outgoing) = newest.filter(|outgoing| outgoing.sampled >= self.next) {
            self.next = outgoing.sampled + self.period;
            self.held.take(self.sender.time_of(outgoing.sampled), outgoing);
        }
    }

    /// Passes on what has arrived at the other end at `now`.
    fn pass_on(&mut self, now: u64, to: &mut End) {
        while let Some(message) = self.held.arrived(now) {
            to.receive(&message);
        }
    }

    fn receive(&mut self, message: &Outgoing) {
        let Outgoing { sampled, position, strength, heard } = *message;
        if self.newest.is_some_and(|newest| sampled <= newest) {
            return;
        }
        self.newest = Some(sampled);
        self.counters.take();
        // A message is named by the instant of its sample: its answer says when the receiver took it.
        let number = Number { session: 1, sequence: sampled };
        let since = heard.map(|heard| heard.sequence);
        // Without room the loop stands still, and has no use for it.
        let _ = self.wire.incoming.push(Incoming { number, since, position, strength });
    }
}
