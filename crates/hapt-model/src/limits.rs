//! The supervisor's limits for a world: its `[safety]` table, and the defaults.
//!
//! The defaults depend on the device and the couplings. A certified world in a hand, however rough, does not reach them, and they are no
//! wider than this requires.

#![warn(clippy::wildcard_enum_match_arm)]

use hapt_core::{CertifiedTime, Heat, Limits, SafetyProfile, WhenLate};

use crate::kinds::Motion;
use crate::safety::Safety;
use crate::world::World;
use crate::{Coupling, Damping, End, Law};

/// The sign test moves the puck by this many counts, or without an encoder by this displacement, in rad or m.
const SEEN_COUNTS: f64 = 12.0;
const SEEN: f64 = 1e-3;
/// The longest pulse of the sign test, in s.
const TEST: f64 = 0.25;
/// The largest speed of a hand, in rad/s and m/s.
const FASTEST: [f64; 2] = [50.0, 2.5];
/// The largest change of the puck's speed that a hit of the hand causes within a sample, as a part of [`FASTEST`].
const HIT: f64 = 0.5;
/// The displacement over which a hand winds up a puck against the motor's limit: half a turn in rad, and in m.
const WOUND: [f64; 2] = [std::f64::consts::PI, 0.1];
/// The travel, in rad and m, over which the motor's limit does the work at which the ledgers trip.
const TRAVEL: [f64; 2] = [0.05, 2.5e-3];
/// That work without a limit, in J.
const WORK: f64 = 0.05;
/// The longest stall, in periods.
const STALL: f64 = 5.0;
/// From the last heartbeat to torque 0, in s.
const LINK: f64 = 0.3;

/// The contribution of a world's couplings to the limits.
struct Reach {
    /// The sum of the steepest rises at the puck, and of the damping there.
    stiffness: f64,
    damping: f64,
    /// The sum of the torques at the puck that may turn over within a sample, in N·m (linear: N).
    turning: f64,
    /// The largest phase angle by which a body's own oscillation advances in a step, in rad.
    angle: f64,
}

impl World {
    /// The supervisor's limits for this world on its device: the file's `[safety]`, and the defaults where a key is absent.
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

        // The speed to which the motor's limit accelerates a puck that a hand has wound up and released.
        let thrown = (2.0 * limit * WOUND[motion] / device.inertia).sqrt();
        // A simulated encoder does not fail, and a pointer can move a simulated hand faster than any hand.
        let or_any = |key: Option<f64>, default: f64| key.unwrap_or(if real { default } else { f64::INFINITY });
        let fastest = thrown.max(FASTEST[motion]);
        let overspeed = or_any(safety.overspeed, fastest);
        // A speed that the file states may be what the certificate rests on: beyond it no torque, however small.
        let velocity = or_any(safety.velocity.or(safety.overspeed), 2.0 * fastest);
        // A hit by the hand, and the motor's contribution.
        let change =
            HIT * FASTEST[motion] + (limit * period / device.inertia).min(2.0 * safety.overspeed.unwrap_or(fastest));
        // The torques that may hold the puck, or push it the other way.
        let holds = device.largest_friction() + device.torque.most();
        let nudge = 2.0 * holds + if limit.is_finite() { 0.05 * limit } else { 0.0 };
        // On a device with much damping and coarse counts this would not show the direction of the motion.
        let seen = self.count().map_or(SEEN, |count| SEEN_COUNTS * count);
        let moves = holds + (device.damping + 2.0 * device.inertia / TEST) * seen / TEST;
        let pulse = nudge.max(moves.min(0.5 * limit)).min(limit);
        // An explicit method generates energy even in a certified world, and its dampers dissipate it: the certificate accounts for both.
        let trips = match profile {
            SafetyProfile::Certified => !self.sampling.method.is_explicit(),
            SafetyProfile::Uncertified => true,
            SafetyProfile::Simulated => false,
        };
        // The time from the last heartbeat to torque 0 includes the fade, a period and the delay; the rest is the time allowed for a heartbeat.
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
            // An interval that the certificate covers is no stall.
            stall: or_never(safety.stall, (STALL * period).max(self.sampling.interval_max_s() - period)),
            time: self.certified_time(safety.late.unwrap_or(WhenLate::Fade)),
            link: or_never(safety.link, LINK.max(2.0 * gone)),
            link_faults,
            energy: if profile == SafetyProfile::Uncertified { 0.1 * work } else { work },
            world_trips: safety.world_trips.unwrap_or(trips),
            port_trips: real || safety.world_trips == Some(true),
            pulse: safety.pulse.unwrap_or(if real { pulse } else { 0.0 }),
            brake,
            recentre: self.sampling.recentre.unwrap_or(0.0),
            zero_where_armed: device.drive.home.is_none() && !self.counts_from_device(),
            announcements: !real,
            inertia: device.inertia,
            damping: device.damping,
            friction: device.least_friction(),
            delay: self.sampling.delay_s(),
        }
    }

    /// The same on a board, where a late sample is a fault unless the file says otherwise.
    pub fn board_limits(&self, profile: SafetyProfile) -> Limits {
        let time = self.certified_time(self.safety.late.unwrap_or(WhenLate::Fault));
        Limits { time, ..self.limits(profile) }
    }

    /// The times that the file states, as the certificate covers them; a time that it does not state is not enforced.
    fn certified_time(&self, when_late: WhenLate) -> CertifiedTime {
        let sampling = &self.sampling;
        let stated = |is_stated: bool, time: f64| if is_stated { time } else { f64::INFINITY };
        CertifiedTime {
            interval: stated(sampling.interval_max.is_some(), sampling.interval_max_s()),
            delay: stated(sampling.delay_max.is_some(), sampling.delay_max_s()),
            when_late,
        }
    }

    /// The largest change of this world's torque in a sample: springs and dampers between ends that move against each other at the
    /// largest speed, frictions and assists that reverse, the bodies' own oscillation, a level, and the fades. From twice the limit on: none.
    fn slew(&self, reach: &Reach, velocity: f64, limit: f64) -> f64 {
        let period = self.sampling.period;
        let count = self.count().unwrap_or(0.0);
        let travel = 2.0 * (velocity * period + count);
        let slew = (reach.stiffness + reach.damping / period) * travel
            + 2.0 * reach.turning
            + if reach.angle > 0.0 { reach.angle * limit } else { 0.0 }
            + self.device.levels.map_or(0.0, |levels| 2.0 * limit / f64::from(levels))
            + 2.0 * limit * period / self.safety.fade;
        if slew < 2.0 * limit { slew } else { f64::INFINITY }
    }

    fn reach(&self) -> Reach {
        let mut reach = Reach { stiffness: 0.0, damping: 0.0, turning: 0.0, angle: 0.0 };
        let mut at_bodies = vec![0.0; self.bodies.len()];
        for coupling in &self.couplings {
            let (stiffness, damping, turning) = self.steepest(coupling);
            for end in [coupling.first, coupling.second] {
                match end {
                    End::Puck => {
                        reach.stiffness += stiffness;
                        reach.damping += damping;
                        reach.turning += turning;
                    }
                    End::Body(i) => at_bodies[i] += stiffness,
                    End::Ground => {}
                }
            }
        }
        for (stiffness, body) in at_bodies.iter().zip(&self.bodies) {
            reach.angle = reach.angle.max(self.sampling.step() * (stiffness / body.inertia).sqrt());
        }
        reach
    }

    /// The steepest rise of a coupling's torque, by position and by velocity, and the largest torque that may turn over within a sample: that
    /// of friction, of an assist, and of an integral term with a limit.
    fn steepest(&self, coupling: &Coupling) -> (f64, f64, f64) {
        let slopes = coupling.law.slopes();
        let damping = match slopes.damping {
            Damping::Fixed(damping) => damping,
            Damping::Compensating => {
                let springs = self.couplings.iter().filter_map(|other| other.law.spring());
                let over = if coupling.is_at_body() { self.sampling.step() } else { self.sampling.period };
                over * springs.sum::<f64>()
            }
        };
        // A torque along the acceleration changes with the velocity as a damper of inertia/τ does, at most.
        let of_acceleration = if let Law::Acceleration { inertia, cutoff } = coupling.law {
            std::f64::consts::TAU * cutoff * inertia
        } else {
            0.0
        };
        let turning = if let Law::Assist { torque, .. } = coupling.law {
            torque
        } else if coupling.law.integrates() {
            coupling.limit.unwrap_or(0.0)
        } else {
            slopes.friction
        };
        (slopes.stiffness, damping + of_acceleration, turning)
    }
}
