//! A run of a system: stations on their exact devices, each at its own times, and the messages between them.

use std::ops::ControlFlow;

use hapt_core::{LinkEnd, Puck, RemoteState, Strength};
use hapt_model::{Drive, Hand, Link, Scenario, Shape, System, Timing};

use crate::channel::Channel;
use crate::row::{Column, Row, SIGNALS, Signal, columns};
use crate::run::{Error, Simulation};

/// A scenario of a system, sample by sample, in the order of the stations' sample times. The rows of a world file's one station are
/// bit-identical to those of its [`Simulation`].
///
/// A station with links sends its position at its samples, and with it the part of its torque that acts: see [`LinkEnd`]. An end ignores a
/// position that is older than the newest one received. The links act when the scenario begins: before it all wheels have been at rest at 0,
/// and their messages have reported that.
///
/// ```
/// use hapt_model::{System, Source};
/// use hapt_sim::Run;
///
/// let mut source = Source::from_text("pair.toml", r#"
/// stations.left.world = "push.toml"
/// stations.right.world = "wheel.toml"
/// links = [{ kind = "spring", between = ["left", "right"], stiffness = 0.5, age_max = "20 ms" }]
/// "#);
/// let wheel = "loop.period = '1 ms'\ndevice = { inertia = '6.4e-4 kg m^2', damping = '0.02 N m s/rad' }\n";
/// let push = "[scenarios.push]\nduration = '1 s'\nhand = { kind = 'step', to = '10 deg', at = '0.1 s' }\n";
/// source.files.insert("wheel.toml".into(), wheel.into());
/// source.files.insert("push.toml".into(), format!("{wheel}{push}"));
/// let network = System::read(&source, &[])?;
/// let mut run = Run::new(&network, "push")?;
/// let mut right = 0.0;
/// while let Some(row) = run.next() {
///     let row = row?;
///     if row.station == 1 {
///         right = row.row.puck;
///     }
/// }
/// // The spring pulls the other wheel along.
/// assert!((right - 10f64.to_radians()).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Run {
    stations: Vec<Station>,
    /// Messages round positions to multiples of this; 0: exact positions.
    step: f64,
    joints: Vec<Joint>,
    /// Whether the system is a world file: one station without links.
    is_world: bool,
}

/// A sample of one station.
#[derive(Clone, Copy, Debug)]
pub struct StationRow<'a> {
    /// The station's index.
    pub station: usize,
    /// Its row, with the time of the system's clock.
    pub row: &'a Row,
    /// The torque of the links on the puck, before levels and limit: the command is that of the sum of this and the world's torque. 0 in a world file.
    pub link: f64,
    /// Whether its system is a network, so that there is a column for the torque of the links.
    pub is_linked: bool,
}

impl StationRow<'_> {
    /// Replaces `values` by its numbers in the order of [`station_columns`].
    pub fn numbers(&self, values: &mut Vec<f64>) {
        values.clear();
        values.extend(SIGNALS.iter().map(|signal| (signal.get)(self.row)));
        values.extend(self.row.pairs().flat_map(|(position, velocity)| [position, velocity]));
        values.extend(self.is_linked.then_some(self.link));
    }
}

/// The columns of a station's run: those of its world, and in a network the torque of its links. Empty for an index without a station.
pub fn station_columns(system: &System, at: usize) -> Vec<Column> {
    let own = system.stations.get(at).map(|station| columns(&station.world)).unwrap_or_default();
    let link = system.world().is_none().then(|| Signal::LINK.column(system.motion));
    own.into_iter().chain(link).collect()
}

#[derive(Clone, Debug)]
struct Station {
    run: Simulation,
    phase: f64,
    period: f64,
    drift: f64,
}

/// A link with its messages in flight.
#[derive(Clone, Debug)]
struct Joint {
    link: Link,
    random: u64,
    ends: [End; 2],
}

/// One station's end of a link.
#[derive(Clone, Debug)]
struct End {
    /// The messages in flight to this end.
    incoming: Channel<Message>,
    /// Messages that have arrived but were sampled at the same instant as this end's sample, which does not use them yet.
    just_sent: Vec<Message>,
    /// The other end's messages of the time before its first sample.
    at_rest: AtRest,
    /// The message with the latest sample of those that have arrived.
    newest: Option<Message>,
    /// The time between two messages of this end, and between two of its samples, in s of the network's clock.
    period: f64,
    sample: f64,
    /// The relative rate by which its clock is fast.
    drift: f64,
    /// The time of its next message.
    next: f64,
    /// The time of its last sample.
    last: f64,
    link: LinkEnd,
}

#[derive(Clone, Copy, Debug)]
struct Message {
    sampled: f64,
    position: f64,
    strength: Strength,
}

/// The true times of samples whose clock is fast by `drift`. Delays of the motor are true times.
fn drifting(timing: &Timing, drift: f64) -> Timing {
    match timing {
        timing if drift == 0.0 => timing.clone(),
        Timing::Even => Timing::Pattern { intervals: vec![1.0 / (1.0 + drift)], delays: Vec::new() },
        Timing::Pattern { intervals, delays } => {
            let intervals = intervals.iter().map(|interval| interval / (1.0 + drift)).collect();
            Timing::Pattern { intervals, delays: delays.clone() }
        }
        Timing::Recorded { file, samples } => {
            let samples = samples.iter().map(|(time, delay)| (time / (1.0 + drift), *delay)).collect();
            Timing::Recorded { file: file.clone(), samples }
        }
        // The reader refuses these together with a drift.
        Timing::Random { .. } | Timing::Worst => timing.clone(),
    }
}

/// The scenario of a station that does not define this one: hands-off.
fn hands_off(name: &str, duration: f64) -> Scenario {
    let hand = Hand { drive: Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), release: None };
    Scenario { name: name.into(), duration, hand, timing: Timing::Even }
}

/// The messages of a wheel at rest at 0 before its first sample, one in each period.
#[derive(Clone, Copy, Debug)]
struct AtRest {
    /// The number of these messages that have not arrived, counted back from the last.
    left: f64,
    /// The time of the wheel's first sample, the time between two messages, and their delay, in s.
    phase: f64,
    period: f64,
    delay: f64,
}

impl AtRest {
    /// Those of `sender` on this link: the one that has arrived by t = 0, and those that have not.
    fn new(link: &Link, sender: &Station) -> Self {
        let period = link.period.unwrap_or(sender.period) / (1.0 + sender.drift);
        let left = ((sender.phase + link.delay) / period).floor() + 1.0;
        AtRest { left, phase: sender.phase, period, delay: link.delay }
    }

    /// The next of them that has arrived by `now` and was sent before `before`.
    fn receive(&mut self, now: f64, before: f64) -> Option<Message> {
        let sampled = self.phase - self.left * self.period;
        let has_arrived = self.left > 0.0 && sampled + self.delay <= now && sampled < before;
        self.left -= f64::from(u8::from(has_arrived));
        has_arrived.then_some(Message { sampled, position: 0.0, strength: Strength::WHOLE })
    }
}

impl Run {
    /// The scenario `name` of a system. Errors where a station's loop or timing cannot be run.
    pub fn new(system: &System, name: &str) -> Result<Self, Error> {
        let scenarios = system.scenario(name);
        let duration = scenarios.iter().flatten().map(|scenario| scenario.duration).next().unwrap_or(0.0);
        let mut stations = Vec::new();
        for (station, scenario) in system.stations.iter().zip(scenarios) {
            let mut scenario = scenario.cloned().unwrap_or_else(|| hands_off(name, duration));
            scenario.timing = drifting(&scenario.timing, station.drift);
            // The reader has checked the file's own timing.
            if station.drift != 0.0
                && let Some((_, reason)) = scenario.timing.fault(&station.world.sampling, scenario.duration)
            {
                return Err(Error::Clock { station: station.name.clone(), reason });
            }
            stations.push(Station {
                run: Simulation::new(&station.world, &scenario)?,
                phase: station.phase,
                period: station.world.sampling.period,
                drift: station.drift,
            });
        }
        let sender = |index: usize, side: usize| &stations[system.links[index].between[side]];
        let end = |index: usize, side: usize| End {
            incoming: Channel::new(&system.links[index]),
            just_sent: Vec::new(),
            at_rest: AtRest::new(&system.links[index], sender(index, 1 - side)),
            newest: None,
            period: system.links[index].period.unwrap_or(sender(index, side).period)
                / (1.0 + sender(index, side).drift),
            sample: sender(index, side).period,
            drift: sender(index, side).drift,
            next: f64::NEG_INFINITY,
            last: 0.0,
            link: LinkEnd::holding(side == 0, system.end(index, side)),
        };
        let joints = system.links.iter().enumerate().map(|(index, link)| Joint {
            random: u64::from(link.seed),
            ends: [end(index, 0), end(index, 1)],
            link: link.clone(),
        });
        Ok(Run { joints: joints.collect(), stations, step: 0.0, is_world: system.world().is_some() })
    }

    /// The same with positions that messages round to the nearest multiple of `step`, in rad (linear: m), as frames on a CAN bus do.
    pub fn rounding(self, step: f64) -> Self {
        Run { step, ..self }
    }

    /// The number of rows of all stations together.
    pub fn rows(&self) -> u64 {
        self.stations.iter().map(|station| station.run.rows()).sum()
    }

    /// The run of each station's world, in file order.
    pub fn stations(&self) -> impl Iterator<Item = &Simulation> {
        self.stations.iter().map(|station| &station.run)
    }

    /// The number of releases of each end of each link.
    pub fn releases(&self) -> impl Iterator<Item = [u64; 2]> {
        self.joints.iter().map(|joint| [joint.ends[0].link.releases(), joint.ends[1].link.releases()])
    }

    /// The next sample of all; `None` after the last. An error ends the run.
    #[allow(clippy::should_implement_trait)] // The row is borrowed, as that of a simulation.
    #[inline]
    pub fn next(&mut self) -> Option<Result<StationRow<'_>, Error>> {
        if self.is_world {
            let row = self.stations.first_mut()?.run.next()?;
            return Some(row.map(|row| StationRow { station: 0, row, link: 0.0, is_linked: false }));
        }
        self.next_of_network()
    }

    /// Calls `each` with each row until the end, or until it returns a break. An error ends the run.
    ///
    /// # Errors
    /// [`Error::NotFinite`].
    #[inline]
    pub fn try_for_each<B>(
        &mut self,
        mut each: impl FnMut(&StationRow<'_>) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B>, Error> {
        // Specialised, so that a world file runs as fast as its `Simulation`.
        if let ([station], true) = (self.stations.as_mut_slice(), self.is_world) {
            while let Some(row) = station.run.next() {
                let flow = each(&StationRow { station: 0, row: row?, link: 0.0, is_linked: false });
                if flow.is_break() {
                    return Ok(flow);
                }
            }
            return Ok(ControlFlow::Continue(()));
        }
        while let Some(row) = self.next_of_network() {
            let flow = each(&row?);
            if flow.is_break() {
                return Ok(flow);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    fn next_of_network(&mut self) -> Option<Result<StationRow<'_>, Error>> {
        let due = |station: &Station| station.run.next_time().map(|time| time + station.phase);
        let times = self.stations.iter().enumerate().filter_map(|(at, station)| Some((at, due(station)?)));
        let (at, time) = times.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (joints, station, step) = (&mut self.joints, &mut self.stations[at], self.step);
        let mut sum = 0.0;
        let result = station.run.next_with(|seen| {
            sum = joints.iter_mut().filter_map(|joint| joint.torque(at, time, seen, step)).sum();
            sum
        })?;
        if let Err(error) = result {
            return Some(Err(error));
        }
        let row = station.run.row_at(time);
        if !sum.is_finite() {
            return Some(Err(Error::NotFinite { time }));
        }
        Some(Ok(StationRow { station: at, row, link: sum, is_linked: true }))
    }
}

impl Joint {
    /// The torque on the puck of station `at`, whose sample at `time` is `seen`; `None` where the station is no end of this link.
    fn torque(&mut self, at: usize, time: f64, seen: Puck<f64>, step: f64) -> Option<f64> {
        let side = self.link.between.iter().position(|end| *end == at)?;
        let Joint { link, random, ends } = self;
        let [first, second] = ends;
        let (own, other) = if side == 0 { (first, second) } else { (second, first) };
        // An instant within a millionth of a sample is that sample.
        let near = 1e-6 * own.sample;
        let was_sent = |message: &Message| message.sampled < time - near;
        let mut arrived = std::mem::take(&mut own.just_sent);
        arrived.extend(std::iter::from_fn(|| own.at_rest.receive(time + near, time - near)));
        arrived.extend(std::iter::from_fn(|| own.incoming.receive(time + near)));
        for message in arrived.iter().filter(|message| was_sent(message)) {
            if own.newest.is_none_or(|newest| newest.sampled < message.sampled) {
                own.newest = Some(*message);
            }
        }
        arrived.retain(|message| !was_sent(message));
        own.just_sent = arrived;
        let remote = own.newest.map(|newest| RemoteState {
            age: (time - newest.sampled) * (1.0 + own.drift),
            session: 0,
            taken: newest.sampled * (1.0 + other.drift),
            position: newest.position,
            strength: newest.strength,
        });
        let elapsed = (time - own.last) * (1.0 + own.drift);
        let torque = own.link.sample(elapsed, true, remote, |other, velocity| {
            link.torque_at(side == 0, [seen.position, seen.velocity], other, velocity)
        });
        own.last = time;
        if time >= own.next - near {
            own.next = own.next.max(time) + own.period;
            let position = if step > 0.0 { (seen.position / step).round() * step } else { seen.position };
            let message = Message { sampled: time, position, strength: own.link.sent_strength() };
            other.incoming.send(random, time, message);
        }
        Some(torque)
    }
}
