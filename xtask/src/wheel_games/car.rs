//! A small game: a car on two wheels, whose tyre turns the steering by its self-aligning torque.

use fastrand::Rng;

use crate::random::log_between;

/// kg, kg·m², m, m, m
const MASS: f64 = 1200.0;
const YAW_INERTIA: f64 = 1800.0;
const FRONT: f64 = 1.2;
const REAR: f64 = 1.4;
/// The step between frames, s.
const STEP: f64 = 1e-3;

/// The single-track model: lateral velocity and yaw rate, with tyres whose force saturates and whose pneumatic trail falls with the slip.
pub struct Car {
    /// m/s
    speed: f64,
    /// N/rad
    cornering: f64,
    /// The largest force of an axle, N.
    grip: f64,
    /// Turns of the steering wheel for one of the tyre.
    ratio: f64,
    /// Trail at no slip, m, and the slip at which it vanishes, rad; the part of it that is the axle's geometry.
    trail: f64,
    slip: f64,
    mechanical: f64,
    /// From the torque at the tyre to that at the wheel.
    gain: f64,
    /// Whether the car turns, which reduces the tyre's slip again; else the torque is a law of only the angle.
    answers: bool,
    /// State: m/s, rad/s.
    lateral: f64,
    yaw: f64,
}

impl Car {
    /// One whose torque rises by `stiffness`, N·m/rad, where the wheel is turned quickly from straight ahead.
    pub fn random(stiffness: f64, answers: bool, rng: &mut Rng) -> Self {
        let mut car = Car {
            speed: log_between(rng, 10.0, 60.0),
            cornering: log_between(rng, 5e4, 1e5),
            grip: log_between(rng, 5e3, 1e4),
            ratio: log_between(rng, 8.0, 16.0),
            trail: log_between(rng, 0.02, 0.06),
            slip: log_between(rng, 0.1, 0.3),
            mechanical: 0.2 + 0.3 * rng.f64(),
            gain: 1.0,
            answers,
            lateral: 0.0,
            yaw: 0.0,
        };
        car.gain = stiffness * car.ratio / (car.cornering * car.trail);
        car
    }

    /// The force of an axle at a slip angle.
    fn force(&self, slip: f64) -> f64 {
        -self.grip * (self.cornering * slip / self.grip).tanh()
    }

    fn front_slip(&self, steering: f64) -> f64 {
        (self.lateral + FRONT * self.yaw) / self.speed - steering / self.ratio
    }

    /// Drives on for this time with the wheel at this angle, rad; the torque at the wheel, N·m, before any limit.
    pub fn drive(&mut self, steering: f64, seconds: f64) -> f64 {
        let steps = (seconds / STEP).ceil().max(1.0);
        let step = seconds / steps;
        for _ in 0..if self.answers { steps as usize } else { 0 } {
            let front = self.force(self.front_slip(steering));
            let rear = self.force((self.lateral - REAR * self.yaw) / self.speed);
            self.lateral += step * ((front + rear) / MASS - self.speed * self.yaw);
            self.yaw += step * (FRONT * front - REAR * rear) / YAW_INERTIA;
        }
        let slip = self.front_slip(steering);
        let falls = (1.0 - slip.abs() / self.slip).max(0.0);
        let trail = self.trail * ((1.0 - self.mechanical) * falls + self.mechanical);
        -self.gain / self.ratio * self.force(slip) * trail
    }
}
