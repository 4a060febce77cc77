//! A link between the pucks of two stations.

use hapt_core::{Law, LinkTerms, Side};

use crate::document::Place;
use crate::error::{Error, ErrorKind};
use crate::fields::Fields;
use crate::fields::{kind, one_of};
use crate::kinds::Motion;
use crate::words;

use super::{Station, System, no_longer};

/// An instant within this part of a period of another is that one, as in the loop.
const SAME_INSTANT: f64 = 1e-6;
/// The most messages that may be in flight on a link, in each direction: a run keeps them.
const MAX_MESSAGES: f64 = 1e6;
/// The torque that brings ends together is this part of the largest torque of motors and links.
const SOFT: f64 = 0.1;

/// A coupling between the pucks of two stations, of which each computes its own end.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// The two stations: q is the first one's puck relative to the second's.
    pub between: [usize; 2],
    /// A spring or a wall: its torque at rest. Its own damping is 0.
    pub law: Law,
    /// D in N·m·s/rad (linear: N·s/m), of a wall inside.
    pub damping: f64,
    /// The largest torque in N·m (linear: N); `None`: any.
    pub limit: Option<f64>,
    /// Between two messages in s; `None`: the sender's period.
    pub period: Option<f64>,
    /// The least delay of a message, in s.
    pub delay: f64,
    /// The largest delay, in s; not less than `delay`. `None`: `delay`.
    pub delay_max: Option<f64>,
    /// The part of the messages that a simulation loses, from 0 to 1.
    pub loss: f64,
    /// The part of the messages that arrive twice in a simulation, from 0 to 1.
    pub duplicate: f64,
    /// The seed of the losses, copies and times that a simulation draws.
    pub seed: u32,
    /// The greatest age in s of a position at any time that its torque acts.
    pub age_max: f64,
}

impl Link {
    /// K in N·m/rad (linear: N/m): the steepest slope.
    pub fn stiffness(&self) -> f64 {
        let (Law::Spring { stiffness, .. } | Law::Wall { stiffness, .. }) = self.law else { return 0.0 };
        stiffness
    }

    /// Whether it has any torque.
    pub fn acts(&self) -> bool {
        self.stiffness() > 0.0 || self.damping > 0.0
    }

    /// The same link with this stiffness.
    pub fn with_stiffness(&self, stiffness: f64) -> Link {
        let mut link = self.clone();
        if let Law::Spring { stiffness: own, .. } | Law::Wall { stiffness: own, .. } = &mut link.law {
            *own = stiffness;
        }
        link
    }

    /// Between two messages of a sender that takes a sample every `sample` s, in s: a whole number of them, `period` at least.
    pub fn between_messages(&self, sample: f64) -> f64 {
        self.period.map_or(1.0, |own| (own / sample - SAME_INSTANT).ceil().max(1.0)) * sample
    }

    /// The largest delay of a message, in s.
    pub fn delay_max_s(&self) -> f64 {
        self.delay_max.unwrap_or(self.delay)
    }

    /// The torque on the first station's puck at q and q̇; the second's has the opposite sign. A wall never pulls.
    pub fn torque(&self, q: f64, rate: f64) -> f64 {
        let drag = -self.damping * rate;
        let torque = match self.law {
            Law::Spring { stiffness, rest } => -stiffness * (q - rest) + drag,
            Law::Wall { side: Side::Above, at, stiffness, .. } if q > at => (-stiffness * (q - at) + drag).min(0.0),
            Law::Wall { side: Side::Below, at, stiffness, .. } if q < at => (-stiffness * (q - at) + drag).max(0.0),
            _ => 0.0,
        };
        self.limit.map_or(torque, |limit| torque.clamp(-limit, limit))
    }

    /// The torque on the puck of one of the stations, the first or the second, with position and velocity of its own and of the other's puck. Where
    /// that velocity is not known there is no damping.
    pub fn torque_at(&self, first: bool, own: [f64; 2], other: f64, velocity: Option<f64>) -> f64 {
        let [q, rate] = [own[0] - other, velocity.map_or(0.0, |velocity| own[1] - velocity)];
        if first { self.torque(q, rate) } else { -self.torque(-q, -rate) }
    }
}

impl System {
    /// The terms of a link's end, at its first station (`side` 0) or its second: the largest age, how long a torque is held there, how often the
    /// other end sends, and the torque with which ends that are apart are brought together: a tenth of the link's `limit` and of both
    /// motors', and no more than the link's stiffness times 0.05 rad (linear: 5 mm).
    ///
    /// # Panics
    /// There is no such link.
    pub fn end(&self, link: usize, side: usize) -> LinkTerms {
        let link = &self.links[link];
        let [own, other] = [side, 1 - side].map(|side| &self.stations[link.between[side]]);
        let apart = match self.motion {
            Motion::Rotary => 0.05,
            Motion::Linear => 5e-3,
        };
        let limits = [link.limit, own.world.device.limit, other.world.device.limit];
        let soft = limits.into_iter().flatten().map(|limit| SOFT * limit).fold(apart * link.stiffness(), f64::min);
        LinkTerms {
            age_max: link.age_max,
            hold: own.hold(),
            period: link.period.unwrap_or(other.world.sampling.period),
            soft,
        }
    }
}

pub(super) fn read(fields: &Fields<'_>, stations: &[Station]) -> Result<Link, Error> {
    let ends = fields.ends("between")?;
    let station = |(name, place): (&str, &Place)| {
        stations.iter().position(|station| station.name == name).ok_or_else(|| {
            let known = || stations.iter().map(|station| station.name.as_str());
            let hint = match words::did_you_mean(name, known()) {
                hint if hint.is_empty() => format!("; a station is {}", words::alternatives(known())),
                hint => hint,
            };
            let message = format!("{} is not a station of this network{hint}", words::quoted(name));
            fields.error_at(ErrorKind::Name, "between", message, place)
        })
    };
    let between = [station(ends[0])?, station(ends[1])?];
    if between[0] == between[1] {
        let message = format!("both ends are {}; a link is between two different stations", words::quoted(ends[0].0));
        return Err(fields.error(ErrorKind::Value, "between", message));
    }
    let stiffness = fields.number("stiffness")?;
    let law = match kind(fields, |name| ["spring", "wall"].into_iter().find(|known| *known == name))? {
        "spring" => Law::Spring { stiffness, rest: fields.number("rest")? },
        _ => Law::Wall {
            side: one_of(fields, "side", &[Side::Above, Side::Below], Side::name)?
                .ok_or_else(|| fields.missing("side"))?,
            at: fields.number("at")?,
            stiffness,
            damping: 0.0,
        },
    };
    let delay = fields.number("delay")?;
    let link = Link {
        between,
        law,
        damping: fields.number("damping")?,
        limit: fields.optional_number("limit")?,
        period: fields.optional_number("period")?,
        delay,
        delay_max: fields.optional_number("delay_max")?,
        loss: fields.number("loss")?,
        duplicate: fields.number("duplicate")?,
        seed: fields.whole("seed")?,
        age_max: fields.number("age_max")?,
    };
    let combination = |name, message: String| Err(fields.error(ErrorKind::Combination, name, message));
    let times = [
        ("period", link.period),
        ("delay", Some(delay)),
        ("delay_max", link.delay_max),
        ("age_max", Some(link.age_max)),
    ];
    for (key, time) in times {
        no_longer(fields, key, time)?;
    }
    if link.delay_max_s() < delay {
        return combination(
            "delay_max",
            format!(
                "{:?} s is below delay, {delay:?} s, which is the least; expected {delay:?} s or more",
                link.delay_max_s()
            ),
        );
    }
    for (key, part) in [("loss", link.loss), ("duplicate", link.duplicate)] {
        if part > 1.0 {
            let message = format!("{part:?} is more than 1, which is every message; expected a number from 0 to 1");
            return combination(key, message);
        }
    }
    for sender in between {
        let (name, period) = (&stations[sender].name, stations[sender].world.sampling.period);
        if let Some(own) = link.period.filter(|own| *own < period) {
            return combination(
                "period",
                format!(
                    "{own:?} s is below the period of {name}, {period:?} s, which sends at its samples; expected {period:?} s or more"
                ),
            );
        }
        let between_two = link.between_messages(period);
        let under_way = link.delay_max_s() / between_two;
        if under_way > MAX_MESSAGES {
            let key = if link.delay_max.is_some() { "delay_max" } else { "delay" };
            let most = MAX_MESSAGES * between_two;
            let message = format!(
                "{name} sends every {between_two:?} s, so that {under_way:.0} messages are under way; at most {MAX_MESSAGES:.0} can be; \
                 expected {most:?} s or less, or a longer period"
            );
            return combination(key, message);
        }
        if between_two > link.age_max {
            let key = if link.period.is_some() { "period" } else { "age_max" };
            return combination(
                key,
                format!(
                    "{name} sends every {between_two:?} s, and a position is used up to an age of {:?} s: the link would let go between two messages; expected an age_max above the period",
                    link.age_max
                ),
            );
        }
    }
    for [from, to] in [between, [between[1], between[0]]] {
        let (sender, receiver) = (&stations[from], &stations[to]);
        let least = delay + receiver.hold();
        if least > link.age_max {
            let message = format!(
                "a position of {} acts at {} up to {least:?} s after its sample at least (its way, a period, the delay of the loop), and only {:?} s are allowed; expected an age_max of that or more",
                sender.name, receiver.name, link.age_max
            );
            return combination("age_max", message);
        }
    }
    Ok(link)
}
