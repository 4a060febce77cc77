//! A lever on a cable, in small steps of its own equation, which shares nothing with the fit.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::Record;

use crate::rig::counted;

/// The sensor's value for a torque of 1 N·m.
pub const SCALE: f64 = -0.25;

/// A lever on a cable, with the usual effects in addition to inertia, damping and friction.
#[derive(Clone, Copy, Debug)]
pub struct Lever {
    pub inertia: f64,
    pub damping: f64,
    /// The Coulomb friction toward one side and toward the other.
    pub friction: [f64; 2],
    pub cable: f64,
    pub cogging: f64,
    pub gravity: f64,
    /// The delay of the torque, in s.
    pub delay: f64,
    pub sign: f64,
    /// A loop that controls it: stiffness and damping of a virtual spring to a moving target; 0: open.
    pub loop_stiffness: f64,
    /// The size of a hand's torque, which a sensor measures; 0: none.
    pub hand: f64,
    /// The decrease of friction within 0.6 rad/s of rest.
    pub stribeck: f64,
    /// The amplitude of friction that changes with the position, 11 times a turn.
    pub rubbing: f64,
}

pub const PERIOD: f64 = 5e-4;

impl Lever {
    pub fn new(rng: &mut Rng) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        Lever {
            inertia: 1e-3 * between(0.5, 3.0),
            damping: 1e-3 * between(1.0, 8.0),
            friction: [between(0.015, 0.03), between(0.015, 0.03)],
            cable: between(0.0, 0.1),
            cogging: between(0.0, 4e-3),
            gravity: between(0.0, 0.01),
            delay: between(0.0, 2e-3),
            sign: if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 },
            loop_stiffness: if between(0.0, 1.0) < 0.5 { 0.0 } else { between(0.5, 2.0) },
            hand: 0.0,
            stribeck: 0.0,
            rubbing: 0.0,
        }
    }

    /// Torques and positions over a time in s, in small steps of the exact equation.
    pub fn record(&self, duration: f64, rng: &mut Rng) -> Record {
        let (mut z, mut v, mut drift) = (0.1, 0.0, 0.0);
        let samples = (duration / PERIOD) as usize;
        let (mut seen, mut torques, mut hands) = (Vec::new(), Vec::new(), Vec::new());
        let (mut level, mut left) = (0.0, 0);
        let late = (self.delay / PERIOD) as usize;
        let phases: Vec<f64> = (0..4).map(|_| TAU * rng.f64()).collect();
        for k in 0..samples {
            let t = k as f64 * PERIOD;
            if left == 0 {
                left = rng.usize(60..240);
                level = 0.1 * (2.0 * rng.f64() - 1.0);
            }
            left -= 1;
            drift = 0.999 * drift + 3e-4 * (rng.f64() - 0.5);
            let target: f64 = phases
                .iter()
                .enumerate()
                .map(|(i, p)| 0.25 * (6.0 * (i as f64 + 1.0) * t + p).sin() / (i as f64 + 1.0))
                .sum();
            let command = if self.loop_stiffness > 0.0 {
                self.loop_stiffness * (target - z) - 0.02 * v
            } else {
                level - 0.15 * z
            };
            let hand: f64 =
                (0..3).map(|i| (TAU * (1.3 + 1.9 * f64::from(i)) * t + 2.0 * phases[i as usize]).sin()).sum();
            hands.push(self.hand * hand);
            seen.push(z);
            torques.push(self.sign * command);
            let motor = self.sign * torques[k.saturating_sub(late)];
            for _ in 0..10 {
                let dt = 0.1 * PERIOD;
                let other = motor + self.hand * hand + drift + self.cogging * (11.0 * z).sin()
                    - self.gravity * z.sin()
                    - self.cable * z;
                let coulomb = if v > 0.0 { self.friction[0] } else { self.friction[1] };
                let friction =
                    coulomb + self.stribeck * (-(v / 0.6).powi(2)).exp() + self.rubbing * (11.0 * z + 0.4).sin();
                let free = v + dt * (other - self.damping * v) / self.inertia;
                let brake = dt * friction / self.inertia;
                v = if free.abs() <= brake { 0.0 } else { free - brake * free.signum() };
                z += dt * v;
            }
        }
        let seen = counted(&seen, 20_000.0, 0.3, rng);
        let record = Record::new((0..samples).map(|k| k as f64 * PERIOD).collect(), seen, torques).unwrap();
        if self.hand > 0.0 {
            record.with_force(hands.iter().map(|hand| SCALE * hand).collect()).unwrap()
        } else {
            record
        }
    }
}
