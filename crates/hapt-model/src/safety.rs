//! The `[safety]` table: what the supervisor holds a live loop to, and what it holds it to where the file says nothing.
//!
//! The defaults come from the device and the world. They are meant never to trip on a certified world in a hand, however
//! rough, and to be no wider than that asks for.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_core::{Heat, Limits, SafetyProfile};

use crate::error::Error;
use crate::fields::Fields;
use crate::keys::{LINK_LOST, WORLD_LEDGER};
use crate::world::{Motion, World};
use crate::{Coupling, Damping, End};

/// The `[safety]` table as the file has it, in SI; `None` where it says nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// How long a fade takes, in s.
    pub fade: f64,
    /// The largest speed of the device in rad/s (linear: m/s).
    pub velocity: Option<f64>,
    /// The largest change of the displacement from sample to sample, in rad (m).
    pub jump: Option<f64>,
    /// The largest speed with the motor on, in rad/s (m/s).
    pub overspeed: Option<f64>,
    /// How long the position may stand still under torque, in s; 0: for ever.
    pub stuck: Option<f64>,
    /// The largest command in N·m (N).
    pub torque: Option<f64>,
    /// The largest change of torque from sample to sample, in N·m (N).
    pub slew: Option<f64>,
    /// What the motor holds for ever, in N·m (N).
    pub rms: Option<f64>,
    /// The motor's thermal time constant in s.
    pub heating: f64,
    /// What the driver holds for ever, in N·m (N).
    pub driver_rms: Option<f64>,
    /// The driver's thermal time constant in s.
    pub driver_heating: f64,
    /// How late a sample may come, in s; 0: any.
    pub late: Option<f64>,
    /// From the last heartbeat to torque 0, the fade included, in s; 0: any.
    pub link: Option<f64>,
    /// Whether a lost link is a fault; else the torque fades out.
    pub link_faults: bool,
    /// The most that the ledgers let pass, in J.
    pub energy: Option<f64>,
    /// Whether the world's own ledger trips.
    pub world_trips: Option<bool>,
    /// The sign test's torque in N·m (N); 0: no test.
    pub pulse: Option<f64>,
    /// Damping after a fault, in N·m·s/rad (N·s/m); 0: none.
    pub brake: f64,
}

impl Default for Safety {
    fn default() -> Self {
        Safety {
            fade: 0.1,
            velocity: None,
            jump: None,
            overspeed: None,
            stuck: None,
            torque: None,
            slew: None,
            rms: None,
            heating: 30.0,
            driver_rms: None,
            driver_heating: 1.0,
            late: None,
            link: None,
            link_faults: false,
            energy: None,
            world_trips: None,
            pulse: None,
            brake: 0.0,
        }
    }
}

impl Safety {
    pub(crate) fn read(fields: &Fields<'_>) -> Result<Safety, Error> {
        Ok(Safety {
            fade: fields.number("fade")?,
            velocity: fields.optional_number("velocity")?,
            jump: fields.optional_number("jump")?,
            overspeed: fields.optional_number("overspeed")?,
            stuck: fields.optional_number("stuck")?,
            torque: fields.optional_number("torque")?,
            slew: fields.optional_number("slew")?,
            rms: fields.optional_number("rms")?,
            heating: fields.number("heating")?,
            driver_rms: fields.optional_number("driver_rms")?,
            driver_heating: fields.number("driver_heating")?,
            late: fields.optional_number("late")?,
            link: fields.optional_number("link")?,
            link_faults: fields.name("link_lost") == Some(LINK_LOST[1]),
            energy: fields.optional_number("energy")?,
            world_trips: fields.name("world_ledger").map(|name| name == WORLD_LEDGER[1]),
            pulse: fields.optional_number("pulse")?,
            brake: fields.number("brake")?,
        })
    }

    /// The keys that take names, where the file has them.
    pub(crate) fn names(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let link = self.link_faults.then_some(("link_lost", LINK_LOST[1]));
        let ledger = self.world_trips.map(|trips| ("world_ledger", WORLD_LEDGER[usize::from(trips)]));
        link.into_iter().chain(ledger)
    }
}

/// The sign test wants to see this many counts, and without an encoder so much, in rad or m; its pulse should take no longer, in s.
const SEEN_COUNTS: f64 = 12.0;
const SEEN: f64 = 1e-3;
const TEST: f64 = 0.25;
/// A hand turns no knob faster, rad/s, and moves no handle faster, m/s.
const FASTEST: [f64; 2] = [50.0, 2.5];
/// And hits none so hard that its speed changes by more than this part of that within a sample.
const HIT: f64 = 0.5;
/// So far a hand winds it up against the motor's limit: half a turn in rad, and in m.
const WOUND: [f64; 2] = [std::f64::consts::PI, 0.1];
/// Over so much of its travel the motor's limit does the work that the ledgers let pass, in rad and m.
const TRAVEL: [f64; 2] = [0.05, 2.5e-3];
/// The same without a limit, in J.
const WORK: f64 = 0.05;
/// How long a heartbeat may be absent, in s, from its last to torque 0.
const LINK: f64 = 0.3;

/// What the supervisor must know of a world's couplings.
struct Reach {
    /// The sum of the steepest rises at the puck, and of the damping there.
    stiffness: f64,
    damping: f64,
    /// What frictions at the puck may change their torque by.
    friction: f64,
    /// The largest angle by which a body's own swing goes on in a sample.
    angle: f64,
}

impl World {
    /// What the supervisor holds this world to on its device: the file's `[safety]`, and its defaults.
    pub fn limits(&self, profile: SafetyProfile) -> Limits {
        let Safety { fade, heating, driver_heating, link_faults, brake, .. } = self.safety;
        let (device, safety, period) = (&self.device, &self.safety, self.sampling.period);
        let real = profile != SafetyProfile::Simulated;
        let motion = usize::from(self.motion == Motion::Linear);
        let limit = device.limit.unwrap_or(f64::INFINITY);
        let reach = self.reach();
        let or_never = |key: Option<f64>, default: f64| match key {
            None if real => default,
            None | Some(0.0) => f64::INFINITY,
            Some(time) => time,
        };

        // As fast as the motor's limit throws a puck that a hand has wound up and released.
        let thrown = (2.0 * limit * WOUND[motion] / device.inertia).sqrt();
        // A simulated encoder does not fail, and a pointer moves a simulated hand as no hand moves.
        let or_any = |key: Option<f64>, default: f64| key.unwrap_or(if real { default } else { f64::INFINITY });
        let fastest = thrown.max(FASTEST[motion]);
        let overspeed = or_any(safety.overspeed, fastest);
        let velocity = or_any(safety.velocity, 2.0 * safety.overspeed.unwrap_or(fastest));
        // A hit by the hand, and what the motor adds to it.
        let change =
            HIT * FASTEST[motion] + (limit * period / device.inertia).min(2.0 * safety.overspeed.unwrap_or(fastest));
        let nudge = 2.0 * device.friction + if limit.is_finite() { 0.05 * limit } else { 0.0 };
        // On a device with much damping and coarse counts that would not show which way the puck went.
        let seen = self.count().map_or(SEEN, |count| SEEN_COUNTS * count);
        let moves = device.friction + (device.damping + 2.0 * device.inertia / TEST) * seen / TEST;
        let pulse = nudge.max(moves.min(0.5 * limit));
        // An explicit method makes energy even in a certified world, and its dampers take it: the certificate has weighed both.
        let trips = match profile {
            SafetyProfile::Certified => !self.sampling.method.is_explicit(),
            SafetyProfile::Uncertified => true,
            SafetyProfile::Simulated => false,
        };
        // From the last heartbeat on: what is longer than the fade, a period and the delay takes is patience.
        let gone = if link_faults { 0.0 } else { fade } + period + self.sampling.delay_s();
        let work = safety.energy.unwrap_or(if limit.is_finite() { limit * TRAVEL[motion] } else { WORK });
        Limits {
            fade,
            velocity,
            jump: or_any(safety.jump, change * period),
            overspeed,
            stuck: or_never(safety.stuck, 1.0),
            stuck_torque: nudge,
            torque: safety.torque.unwrap_or(limit),
            slew: or_any(safety.slew, self.slew(&reach, velocity, limit)),
            motor: Heat { rms: safety.rms.unwrap_or(f64::INFINITY), time: heating },
            driver: Heat { rms: safety.driver_rms.unwrap_or(f64::INFINITY), time: driver_heating },
            late: or_never(safety.late, 5.0 * period),
            link: or_never(safety.link, LINK.max(2.0 * gone)),
            link_faults,
            energy: if profile == SafetyProfile::Uncertified { 0.1 * work } else { work },
            world_trips: safety.world_trips.unwrap_or(trips),
            port_trips: real || safety.world_trips == Some(true),
            pulse: safety.pulse.unwrap_or(if real { pulse } else { 0.0 }),
            brake,
            zero_where_armed: device.drive.home.is_none(),
            announcements: !real,
            inertia: device.inertia,
            damping: device.damping,
            friction: device.friction,
            delay: self.sampling.delay_s(),
        }
    }

    /// The most that this world changes its torque by in a sample: its springs and dampers between ends that run against each other at
    /// the largest speed, frictions that turn over, what a body's own swing turns by, a level, and the fades. From twice the limit on it
    /// is none.
    fn slew(&self, reach: &Reach, velocity: f64, limit: f64) -> f64 {
        let period = self.sampling.period;
        let count = self.count().unwrap_or(0.0);
        let way = 2.0 * (velocity * period + count);
        let slew = (reach.stiffness + reach.damping / period) * way
            + 2.0 * reach.friction
            + if reach.angle > 0.0 { reach.angle * limit } else { 0.0 }
            + self.device.levels.map_or(0.0, |levels| 2.0 * limit / f64::from(levels))
            + 2.0 * limit * period / self.safety.fade;
        if slew < 2.0 * limit { slew } else { f64::INFINITY }
    }

    fn reach(&self) -> Reach {
        let mut reach = Reach { stiffness: 0.0, damping: 0.0, friction: 0.0, angle: 0.0 };
        let mut at_bodies = vec![0.0; self.bodies.len()];
        for coupling in &self.couplings {
            let (stiffness, damping, friction) = self.steepest(coupling);
            for end in [coupling.first, coupling.second] {
                match end {
                    End::Puck => {
                        reach.stiffness += stiffness;
                        reach.damping += damping;
                        reach.friction += friction;
                    }
                    End::Body(i) => at_bodies[i] += stiffness,
                    End::Ground => {}
                }
            }
        }
        for (stiffness, body) in at_bodies.iter().zip(&self.bodies) {
            reach.angle = reach.angle.max(self.sampling.period * (stiffness / body.inertia).sqrt());
        }
        reach
    }

    /// The steepest rise of a coupling's torque, by position and by velocity, and the largest torque of its friction.
    fn steepest(&self, coupling: &Coupling) -> (f64, f64, f64) {
        let slopes = coupling.law.slopes();
        let damping = match slopes.damping {
            Damping::Fixed(damping) => damping,
            Damping::Compensating => {
                let springs = self.couplings.iter().filter_map(|other| other.law.spring());
                self.sampling.period * springs.sum::<f64>()
            }
        };
        (slopes.stiffness, damping, slopes.friction)
    }
}
