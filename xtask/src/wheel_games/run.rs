//! One game on one wheel: steered, kicked and released, under each remedy.

use fastrand::Rng;
use hapt_core::wheel::game_loop::{GameLoop, HostLevel, Rotor};
use hapt_core::wheel::{Device, Effect, Refused, Timing, Wheel};
use hapt_plant::{VirtualDevice, spec::DeviceSpec};

use super::car::Car;
use crate::random::log_between;

/// The duration of a run, and when the hands release the wheel, s.
pub const DURATION: f64 = 10.0;
pub const LET_GO: f64 = 4.0;
/// The kick that they give, rad/s, and its duration, s.
pub const KICK: f64 = 2.0;
const KICKING: f64 = 0.05;
/// From here on the hands' torque is compared, s.
const COMPARED: f64 = 1.0;

/// The torque that is added to a game's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Remedy {
    Nothing,
    /// A damper, N·m·s/rad.
    Always(f64),
    /// One beyond a velocity, rad/s.
    Beyond(f64, f64),
    Hapt,
}

/// A wheel and a game.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub seed: u64,
    spec: DeviceSpec,
    count: f64,
    limit: f64,
    pub stiffness: f64,
    /// s
    frame: f64,
    pub late: f64,
    kerbs: bool,
    pauses: bool,
    grip: [f64; 2],
    /// Whether the car answers the steering.
    answers: bool,
}

/// The result of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// The largest speeds in the second after the kick and in the last one, rad/s.
    pub first: f64,
    pub last: f64,
    /// The torque that hands felt in addition to the game's, relative to it, as root mean squares.
    pub felt: f64,
    /// The same, relative to the motor's largest torque.
    pub extra_torque: f64,
    /// The mean part of the level that was held back hands-off.
    pub held_back: f64,
}

impl Pair {
    /// Of belts and direct drives, with games of 60 to 400 frames a second, up to 60 ms late.
    pub fn random(seed: u64, answers: bool) -> Self {
        let mut rng = Rng::with_seed(seed);
        let rng = &mut rng;
        let period = log_between(rng, 5e-4, 2e-3);
        let frame = match rng.u8(0..4) {
            0 => 1.0 / 60.0,
            1 => 1e-2,
            2 => 1.0 / 333.0,
            _ => 1.0 / log_between(rng, 60.0, 400.0),
        };
        // One to three frames, and on the way from and to the wheel.
        let late = (frame * f64::from(rng.u8(1..4)) + log_between(rng, 1e-3, 1e-2)).min(0.06);
        let friction = if rng.bool() { 0.0 } else { log_between(rng, 1e-2, 0.3) };
        let delay = 0.5 * rng.f64() * period;
        let inertia = log_between(rng, 5e-3, 0.1);
        let spec =
            DeviceSpec { delay, damping: log_between(rng, 1e-2, 0.2), friction, ..DeviceSpec::new(period, inertia) };
        Pair {
            seed,
            spec,
            count: std::f64::consts::TAU / log_between(rng, 4e3, 4e6).round(),
            limit: log_between(rng, 2.0, 25.0),
            stiffness: log_between(rng, 0.5, 40.0),
            frame,
            late,
            kerbs: rng.bool(),
            pauses: rng.u8(0..4) == 0,
            grip: [log_between(rng, 10.0, 60.0), log_between(rng, 0.8, 2.0)],
            answers,
        }
    }

    fn device(&self) -> Device {
        let timing = Timing { delay: self.spec.delay, ..Timing::even(self.spec.period) };
        let ideal = Device::ideal(timing, self.spec.damping, self.limit);
        Device { friction: self.spec.friction, count: self.count, ..ideal }
    }
}

/// The wheel under this remedy.
pub fn run(pair: &Pair, remedy: Remedy) -> Result<Outcome, Refused> {
    let mut rng = Rng::with_seed(pair.seed ^ 0x5eed);
    let mut car = Car::random(pair.stiffness, pair.answers, &mut rng);
    let mut wheel = VirtualDevice::without_works(&pair.spec);
    let device = pair.device();
    let effects = Wheel::<f64>::new(&device)?;
    let rotor = Rotor { inertia: pair.spec.inertia, damping: pair.spec.damping, friction: pair.spec.friction };
    let game_loop = GameLoop::<f64>::new(&device, &rotor, remedy == Remedy::Hapt)?;
    let (mut playing, mut plain, mut watched) = (effects.start(), effects.start(), game_loop.start());
    let period = pair.spec.period;
    let (mut level, mut revision, mut sent, mut frames) = (0.0, 0, Vec::new(), 0_u32);
    let (mut kerb, mut kerb_end, mut kerb_at) = (0.0, 0.0, 1.0 + rng.f64());
    let (mut last, mut filtered) = (0.0, 0.0);
    let (mut outcome, mut felt, mut all, mut compared, mut held) = (Outcome::default(), 0.0, 0.0, 0.0, 0.0);
    let samples = (DURATION / period) as usize;
    for k in 0..samples {
        let t = k as f64 * period;
        let (z, v) = wheel.puck();
        while t >= f64::from(frames) * pair.frame {
            frames += 1;
            if pair.pauses && (2.0..2.5).contains(&t) {
                continue;
            }
            if pair.kerbs && t > kerb_at && t < LET_GO - 0.5 {
                (kerb_end, kerb_at) = (t + 0.3, t + 0.5 + 2.0 * rng.f64());
            }
            kerb = if t < kerb_end { -kerb + (kerb == 0.0) as u8 as f64 * 0.1 * pair.limit } else { 0.0 };
            let engine = 0.002 * pair.limit * (rng.f64() - 0.5);
            let torque = car.drive(z, pair.frame) + kerb + engine;
            // As a report has it.
            let torque = (torque / pair.limit).clamp(-1.0, 1.0);
            sent.push((t + pair.late, (torque * 32_767.0).round() / 32_767.0 * pair.limit));
        }
        let before = level;
        while sent.first().is_some_and(|(arrives, _)| *arrives <= t) {
            level = sent.remove(0).1;
        }
        let changed = level != before;
        revision += u32::from(changed);
        let counted = (z / pair.count).round() * pair.count;
        filtered += 0.2 * ((counted - last) / period - filtered);
        last = counted;
        let added = match remedy {
            Remedy::Nothing => 0.0,
            Remedy::Always(damping) => -damping * filtered,
            Remedy::Beyond(speed, damping) => -damping * (filtered - filtered.clamp(-speed, speed)),
            Remedy::Hapt => game_loop.step(&mut watched, counted, HostLevel { level, changed, torque: level }),
        };
        let both = [Effect::Torque(level), Effect::Torque(added)];
        let given = effects.step(&mut playing, counted, &both, revision).torque;
        let requested = effects.step(&mut plain, counted, &both[..1], revision).torque;
        if remedy == Remedy::Hapt {
            game_loop.commanded(&mut watched, given);
        }
        let hand = if t < LET_GO {
            if t > COMPARED {
                felt += (given - requested) * (given - requested);
                all += requested * requested;
                compared += 1.0;
            }
            let wanted = 0.6 * (4.0 * t).sin() + 0.1 * (13.0 * t).sin();
            pair.grip[0] * (wanted - z) - pair.grip[1] * v
        } else if t < LET_GO + KICKING {
            pair.spec.inertia * KICK / KICKING
        } else {
            if t < LET_GO + KICKING + 1.0 {
                outcome.first = outcome.first.max(v.abs());
            } else if t > DURATION - 1.0 {
                outcome.last = outcome.last.max(v.abs());
            }
            held += watched.report().held_back;
            0.0
        };
        wheel.command(given + hand);
        wheel.travel();
    }
    outcome.extra_torque = (felt / f64::max(compared, 1.0)).sqrt() / pair.limit;
    outcome.felt = (felt / all.max(1e-12)).sqrt();
    outcome.held_back = held * period / (DURATION - LET_GO);
    Ok(outcome)
}
