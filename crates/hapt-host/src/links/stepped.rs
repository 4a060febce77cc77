//! Links between stations that one thread runs ([`crate::Machine::stepped`]): no sockets and no key.

use std::sync::Arc;

use hapt_model::{Station, System};
use hapt_rt::{LinkPort, LinkWire, link};
use hapt_wire::link::{Incoming, Number, Outgoing};

use super::channel::InFlight;
use super::{ChannelNumbers, Counters, LinkStatus};

/// The links of all stations of a network. Ages count as over a real network, by the round trip. Each station has its own clock
/// ([`Station::shown`]), and messages take the time of the network's.
pub struct SteppedLinks {
    /// Both ends of each link, one after the other.
    ends: Vec<End>,
}

struct End {
    station: usize,
    /// The station whose clock times the samples.
    sender: Station,
    wire: LinkWire,
    in_flight: InFlight<Outgoing>,
    /// The time between two messages, in ns, and the time at which the next one is due.
    period: u64,
    next: u64,
    /// The newest sample of the other end that has arrived, by its instant in ns.
    newest: Option<u64>,
    counters: Arc<Counters>,
}

impl SteppedLinks {
    /// The links, and the loops' ends by station.
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
                    in_flight: InFlight::new(joint, side),
                    period: (period * 1e9) as u64,
                    next: 0,
                    newest: None,
                    counters: Arc::new(Counters::new(to, joint.age_max)),
                });
            }
        }
        (SteppedLinks { ends }, ports)
    }

    /// The channels of the messages, one for each end.
    pub fn channels(&self) -> Vec<Arc<ChannelNumbers>> {
        self.ends.iter().map(|end| end.in_flight.numbers()).collect()
    }

    /// A function that returns the present status of the links of a station.
    pub fn status(&self, station: usize) -> impl Fn() -> Vec<LinkStatus> + Send + 'static {
        let own = self.ends.iter().filter(|end| end.station == station);
        let counters: Vec<Arc<Counters>> = own.map(|end| Arc::clone(&end.counters)).collect();
        move || counters.iter().map(|counters| counters.status()).collect()
    }

    /// Sends the loops' samples, and passes on messages that have arrived by `now`, in ns by the network's clock.
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
            self.in_flight.take(self.sender.time_of(outgoing.sampled), outgoing);
        }
    }

    /// Passes on the messages that have arrived at the other end by `now`.
    fn pass_on(&mut self, now: u64, to: &mut End) {
        while let Some(message) = self.in_flight.arrived(now) {
            to.receive(&message);
        }
    }

    fn receive(&mut self, message: &Outgoing) {
        let Outgoing { sampled, position, strength, received } = *message;
        if self.newest.is_some_and(|newest| sampled <= newest) {
            return;
        }
        self.newest = Some(sampled);
        self.counters.take();
        // The number of a message is the instant of its sample, so that an answer to it gives that instant.
        let number = Number { session: 1, sequence: sampled };
        let since = received.map(|received| received.sequence);
        // A full ring means that the loop has stopped: the message is dropped.
        let _ = self.wire.incoming.push(Incoming { number, since, position, strength });
    }
}
