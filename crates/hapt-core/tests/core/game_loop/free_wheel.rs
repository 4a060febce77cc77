//! A free wheel, exactly between the steps of a fine grid, and a game that computes a torque from its position.

/// The grid, s.
pub const STEP: f64 = 1e-4;

/// Random numbers in [0, 1).
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly distributed in its logarithm.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.roll())
    }

    /// A random number of steps, both ends included.
    pub fn steps(&mut self, least: usize, most: usize) -> usize {
        least + (self.roll() * (most - least + 1) as f64) as usize
    }
}

/// J z̈ + b ż = u.
#[derive(Clone, Copy)]
pub struct Wheel {
    pub inertia: f64,
    pub damping: f64,
    pub z: f64,
    pub v: f64,
}

impl Wheel {
    /// A step with this torque, (T20).
    pub fn go(&mut self, torque: f64) {
        let rate = self.damping / self.inertia;
        let factor = -(-rate * STEP).exp_m1() / rate;
        let end = torque / self.damping;
        self.z += factor * (self.v - end) + end * STEP;
        self.v = end + (self.v - end) * (-rate * STEP).exp();
    }
}

/// A resisting torque of the position with slopes within ±K, and an energy that has a least value.
#[derive(Clone, Copy, Debug)]
pub enum Law {
    Line(f64),
    /// Bounded: K c tanh(z/c).
    Bounded(f64, f64),
    /// It falls beyond c: K z/(1 + (z/c)²).
    Falling(f64, f64),
    /// K c sin(z/c)
    Wave(f64, f64),
}

impl Law {
    pub fn random(stiffness: f64, dice: &mut Dice) -> Self {
        let c = dice.between(0.03, 3.0);
        match dice.steps(0, 3) {
            0 => Law::Line(stiffness),
            1 => Law::Bounded(stiffness, c),
            2 => Law::Falling(stiffness, c),
            _ => Law::Wave(stiffness, c),
        }
    }

    pub fn torque(&self, z: f64) -> f64 {
        match *self {
            Law::Line(k) => k * z,
            Law::Bounded(k, c) => k * c * (z / c).tanh(),
            Law::Falling(k, c) => k * z / (1.0 + (z / c) * (z / c)),
            Law::Wave(k, c) => k * c * (z / c).sin(),
        }
    }

    pub fn energy(&self, z: f64) -> f64 {
        match *self {
            Law::Line(k) => 0.5 * k * z * z,
            Law::Bounded(k, c) => k * c * c * (z / c).cosh().ln(),
            Law::Falling(k, c) => 0.5 * k * c * c * (1.0 + (z / c) * (z / c)).ln(),
            Law::Wave(k, c) => k * c * c * (1.0 - (z / c).cos()),
        }
    }
}

/// A game: it samples the position, and the torque arrives later, in order.
pub struct Game {
    pub law: Law,
    /// Steps from one sample to the next, at least and at most.
    pub holds: [usize; 2],
    /// Steps from a sample to its torque, at least and at most.
    pub late: [usize; 2],
    next: usize,
    sent: Vec<(usize, f64)>,
    torque: f64,
}

impl Game {
    pub fn new(law: Law, holds: [usize; 2], late: [usize; 2]) -> Self {
        Game { law, holds, late, next: 0, sent: Vec::new(), torque: 0.0 }
    }

    /// The torque in force from this step on, where the wheel is at z.
    pub fn torque(&mut self, step: usize, z: f64, dice: &mut Dice) -> f64 {
        if step == self.next {
            let last = self.sent.last().map_or(0, |(arrives, _)| *arrives);
            let arrives = (step + dice.steps(self.late[0], self.late[1])).max(last);
            self.sent.push((arrives, -self.law.torque(z)));
            self.next += dice.steps(self.holds[0], self.holds[1]);
        }
        while self.sent.first().is_some_and(|(arrives, _)| *arrives <= step) {
            self.torque = self.sent.remove(0).1;
        }
        self.torque
    }
}
