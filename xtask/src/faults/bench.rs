//! Random certified worlds on plausible devices, and rough hands.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_analysis::{is_certified, passivity, required_damping};
use hapt_model::{Body, Coupling, End, EstimatorKind, Law, Method, Output, World};
use hapt_sim::{Grip, VirtualDevice};

use crate::truth::worlds;

fn log(rng: &mut Rng, from: f64, to: f64) -> f64 {
    from * (to / from).powf(rng.f64())
}

/// The largest damping of a device that a hand can turn, in N·m·s/rad.
const DAMPED: f64 = 0.2;

/// A world that is certified on a real device: a motor with a limit, mostly an encoder, friction, whole delays. Half of them are nonlinear.
pub fn world(rng: &mut Rng) -> World {
    loop {
        let is_nonlinear = rng.bool();
        let mut world = worlds::random(rng, is_nonlinear);
        let sampling = &mut world.sampling;
        let whole = (sampling.delay_s() / sampling.period).round().min(3.0);
        sampling.delay = hapt_model::Delay::Seconds(whole * sampling.period);
        if sampling.estimator == EstimatorKind::Exact {
            sampling.estimator = EstimatorKind::Difference;
        }
        let device = &mut world.device;
        device.friction = if rng.bool() { log(rng, 1e-4, 5e-3) } else { 0.0 };
        // A puck that is pressed against a stop stands still, as behind a dead encoder.
        device.stops = None;
        device.limit = Some(log(rng, 0.05, 5.0));
        device.encoder = (rng.u8(..4) > 0).then(|| log(rng, 2e3, 1e6).round());
        // The motor moves its device.
        if 2.0 * device.largest_friction() > 0.5 * device.limit.unwrap_or(f64::INFINITY) {
            continue;
        }
        let Ok(Some(damping)) = required_damping(&world) else { continue };
        world.device.damping = (damping * (1.0 + rng.f64())).max(1e-5);
        if world.couplings.len() <= 8 && world.device.damping < DAMPED && is_certified(&world) && is_proved(&world) {
            return world;
        }
    }
}

/// Whether its passivity is proved except for counts and levels: otherwise a hand may draw energy, and the fault is right.
fn is_proved(world: &World) -> bool {
    let mut ideal = world.clone();
    (ideal.device.encoder, ideal.device.levels) = (None, None);
    passivity(&ideal).is_ok_and(|found| found.proved.holds())
}

/// A certified world whose undamped body oscillates and pulls at the puck with more than `stuck_torque`.
pub fn swinging(rng: &mut Rng) -> World {
    loop {
        let mut world = world(rng);
        let device = &world.device;
        let (limit, count) = (device.limit.unwrap_or(1.0), world.count().unwrap_or(1e-4));
        let least = 2.0 * device.largest_friction() + 0.05 * limit;
        let torque = least * log(rng, 1.5, 8.0);
        let (rate, travel) = (log(rng, 0.5, 100.0), log(rng, 0.1, 3.0));
        let inertia = device.inertia * log(rng, 5.0, 100.0);
        // While the puck stands still the body oscillates on both springs.
        let stiffness = torque / travel;
        let grounded = inertia * rate * rate - stiffness;
        // Under the least torque that counts a free puck moves four counts within a push, and the oscillation makes it no faster than a
        // hand does.
        let (net, push) = (0.5 * (least - device.least_friction()), (1.0 / rate).min(0.1));
        let quick = 4.0 * count < net * push * (0.5 * push / device.inertia).min(0.5 / device.damping)
            && push > 10.0 * world.sampling.period;
        if grounded < 0.0 || torque > limit || !quick || torque > 10.0 * device.inertia * rate {
            continue;
        }
        (world.sampling.method, world.sampling.output, world.sampling.advance) = (Method::Zoh, Output::End, 0);
        world.sampling.delay = hapt_model::Delay::Seconds(0.0);
        world.names = vec!["b0".into()];
        world.bodies = vec![Body { inertia, position: 0.0, velocity: travel * rate }];
        world.couplings = [(End::Ground, grounded), (End::Puck, stiffness)]
            .map(|(first, stiffness)| Coupling {
                first,
                second: End::Body(0),
                law: Law::Spring { stiffness, rest: 0.0 },
                limit: None,
            })
            .to_vec();
        if is_certified(&world) {
            return world;
        }
    }
}

/// A hand on the puck, which changes its motion now and then.
pub struct Hand {
    grip: Option<Grip>,
    /// Its intended position.
    intended: f64,
    /// Where its present motion begins, and the motion.
    from: f64,
    motion: HandMotion,
    /// Samples since it began, and until the next motion.
    sample: u32,
    last: u32,
    /// In rad.
    tremor: f64,
    /// Tremor in rad per sample.
    rate: f64,
}

#[derive(Clone, Copy, Debug)]
enum HandMotion {
    Still,
    /// To another place, as fast as it can.
    Bang(f64),
    Sine {
        amplitude: f64,
        /// rad per sample
        rate: f64,
    },
}

/// A hand's largest speed, in rad/s.
const MAX_SPEED: f64 = 20.0;

/// The largest natural frequency of hand and puck on the grip's stiffness, in rad/s.
const MAX_GRIP_RATE: f64 = 300.0;

impl Hand {
    pub fn new() -> Self {
        Hand {
            grip: None,
            intended: 0.0,
            from: 0.0,
            motion: HandMotion::Still,
            sample: 0,
            last: 0,
            tremor: 0.0,
            rate: 0.0,
        }
    }

    /// One sample.
    pub fn act(&mut self, rng: &mut Rng, world: &World, device: &mut VirtualDevice) {
        if self.sample >= self.last {
            self.change(rng, world, device);
        }
        self.sample += 1;
        if self.grip.is_some() {
            let t = f64::from(self.sample);
            let place = match self.motion {
                HandMotion::Still => 0.0,
                HandMotion::Bang(to) => to,
                HandMotion::Sine { amplitude, rate } => amplitude * (rate * t).sin(),
            };
            let wanted = self.from + place + self.tremor * (self.rate * t).sin();
            let most = MAX_SPEED * world.sampling.period;
            self.intended += (wanted - self.intended).clamp(-most, most);
            device.intend(self.intended);
        }
    }

    fn change(&mut self, rng: &mut Rng, world: &World, device: &mut VirtualDevice) {
        let period = world.sampling.period;
        // A hand does not grip a faster puck.
        let flies = self.grip.is_none() && device.puck().1.abs() > MAX_SPEED;
        let open = flies || rng.u8(..4) == 0;
        // The same grip continues, or another one begins.
        if open || self.grip.is_none() || rng.u8(..3) == 0 {
            let inertia = log(rng, 1e-5, 3e-3);
            // The natural frequency on the grip is at most 0.3 rad a sample and `MAX_GRIP_RATE`.
            let stiffest = (0.3 / period).min(MAX_GRIP_RATE).powi(2) * (inertia + world.device.inertia);
            let stiffness = log(rng, 0.3, 30.0).min(stiffest);
            let damping = 2.0 * (0.3 + 0.7 * rng.f64()) * (stiffness * (inertia + world.device.inertia)).sqrt();
            self.grip = (!open).then_some(Grip { inertia, damping, stiffness });
            device.hold(self.grip);
            self.intended = device.puck().0;
        }
        self.from = device.puck().0;
        (self.sample, self.last) = (0, log(rng, 5.0, 5000.0) as u32);
        let Some(grip) = self.grip else { return };
        // The tremor is larger than a count and than the friction hides.
        let count = world.count().unwrap_or(1e-5);
        self.tremor = 3.0 * count + 4.0 * world.device.largest_friction() / grip.stiffness;
        self.rate = TAU * (8.0 + 4.0 * rng.f64()) * period;
        let inertia = grip.inertia + world.device.inertia;
        let farthest = MAX_SPEED * (inertia / grip.stiffness).sqrt();
        self.motion = match rng.u8(..4) {
            0 => HandMotion::Still,
            1 | 2 => HandMotion::Bang(farthest.min(3.0) * (2.0 * rng.f64() - 1.0)),
            _ => {
                let frequency = log(rng, 0.1, (0.25 / period).min(100.0));
                let amplitude = (MAX_SPEED / (TAU * frequency)).min(3.0) * rng.f64();
                HandMotion::Sine { amplitude, rate: TAU * frequency * period }
            }
        };
    }
}
