//! The puck under a held torque: where it is at given times, and what each parameter does to that.
//!
//! Stops, starts and reversals under Coulomb friction are located, not stepped over. Across an event at t* the sensitivity S of the
//! state jumps by (f₋ - f₊) dt*/dθ, f being the state's rate before and after it (Rozenvasser; Hiskens and Pai, IEEE Trans. Circuits
//! Syst. I 47 (2000) 204): at rest nothing of the velocity's is left, and the delay acts through the steps of the torque.

use crate::stretch::{Stretch, stopping_time};

/// The parameters as the motion shows them: everything per unit of inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Puck {
    /// α = 1/J in 1/(kg·m²) (linear: 1/kg); negative for a motor of the other sign.
    pub gain: f64,
    /// β = b/J in 1/s.
    pub damping: f64,
    /// γ = f/J in rad/s² (linear: m/s²).
    pub friction: f64,
    /// From the sample to the change of the torque, in s.
    pub delay: f64,
    /// δ in rad/s² (m/s²): a constant torque that nobody asked for, over J; a motor's offset, a tilted table.
    pub offset: f64,
    /// At the start, in rad (m).
    pub position: f64,
    /// At the start, in rad/s (m/s).
    pub velocity: f64,
}

/// How many parameters there are.
pub(crate) const PARAMETERS: usize = 7;

/// Of a position by gain, damping, friction, delay, offset, first position, first velocity.
pub type Sensitivity = [f64; PARAMETERS];

pub(crate) const GAIN: usize = 0;
pub(crate) const DAMPING: usize = 1;
pub(crate) const FRICTION: usize = 2;
pub(crate) const DELAY: usize = 3;
pub(crate) const OFFSET: usize = 4;
const POSITION: usize = 5;
const VELOCITY: usize = 6;

/// So often the puck may stop and start between two changes of torque; in truth it is twice at most.
const MOST_EVENTS: usize = 8;

/// The motion under way.
#[derive(Clone, Debug)]
struct Motion {
    puck: Puck,
    z: f64,
    v: f64,
    /// 1 or -1 while it moves, 0 at rest.
    way: f64,
    torque: f64,
    dz: Sensitivity,
    dv: Sensitivity,
}

impl Puck {
    /// As an array, in the order of [`Sensitivity`].
    pub fn parameters(&self) -> Sensitivity {
        [self.gain, self.damping, self.friction, self.delay, self.offset, self.position, self.velocity]
    }

    /// From such an array.
    pub fn from_parameters(p: Sensitivity) -> Self {
        let [gain, damping, friction, delay, offset, position, velocity] = p;
        Puck { gain, damping, friction, delay, offset, position, velocity }
    }

    /// Positions at `times` under torques commanded at the same times and held; before the first command there is the first.
    pub fn positions(&self, times: &[f64], torques: &[f64]) -> Vec<f64> {
        let mut positions = Vec::with_capacity(times.len());
        self.follow(times, torques, 0, |_, z, _| positions.push(z));
        positions
    }

    /// Gives each time's index from `first` on, the position there and its sensitivities to `see`; the motion starts at `first`.
    pub fn follow(&self, times: &[f64], torques: &[f64], first: usize, mut see: impl FnMut(usize, f64, &Sensitivity)) {
        let (Some(&start), Some(&torque)) = (times.get(first), torques.first()) else { return };
        // The command that is held at the start: the last that has arrived.
        let mut next = times.iter().take(torques.len()).take_while(|t| **t + self.delay <= start).count();
        let torque = if next > 0 { torques[next - 1] } else { torque };
        let mut motion = Motion::new(*self, torque);
        let mut now = start;
        for (i, &to) in times.iter().enumerate().skip(first) {
            while let (Some(&at), Some(&torque)) = (times.get(next), torques.get(next)) {
                let at = at + self.delay;
                if at > to {
                    break;
                }
                next += 1;
                if torque != motion.torque {
                    motion.pass(at - now);
                    now = at;
                    motion.switch(torque);
                }
            }
            motion.pass(to - now);
            now = to;
            see(i, motion.z, &motion.dz);
        }
    }
}

impl Motion {
    fn new(puck: Puck, torque: f64) -> Self {
        let (z, v) = (puck.position, puck.velocity);
        let mut motion = Motion { puck, z, v, way: 0.0, torque, dz: [0.0; PARAMETERS], dv: [0.0; PARAMETERS] };
        (motion.dz[POSITION], motion.dv[VELOCITY]) = (1.0, 1.0);
        motion.set_out();
        motion
    }

    /// Which way it goes, or that it rests.
    fn set_out(&mut self) {
        let drive = self.puck.gain * self.torque + self.puck.offset;
        self.way = match self.v {
            v if v != 0.0 => v.signum(),
            _ if drive.abs() <= self.puck.friction || drive == 0.0 => 0.0,
            _ => drive.signum(),
        };
        if self.way == 0.0 {
            self.dv = [0.0; PARAMETERS];
        }
    }

    /// The acceleration that torque, offset and friction give together.
    fn drive(&self) -> f64 {
        let Puck { gain, friction, offset, .. } = self.puck;
        if self.way == 0.0 { 0.0 } else { gain * self.torque + offset - friction * self.way }
    }

    /// The torque steps, at an instant that moves with the delay.
    fn switch(&mut self, torque: f64) {
        let before = self.drive();
        self.torque = torque;
        if self.v == 0.0 {
            self.set_out();
        }
        self.dv[DELAY] += before - self.drive();
    }

    /// `length` s go by under the torque that is held.
    fn pass(&mut self, length: f64) {
        let mut rest = length;
        for _ in 0..MOST_EVENTS {
            if rest.is_nan() || rest <= 0.0 || self.way == 0.0 {
                return;
            }
            let a = self.drive();
            let stretch = Stretch::new(self.puck.damping, rest);
            let (_, end) = stretch.travel(self.v, a);
            if end * self.way >= 0.0 {
                return self.advance(&stretch, a);
            }
            let t = stopping_time(self.v, a, self.puck.damping).clamp(0.0, rest);
            self.advance(&Stretch::new(self.puck.damping, t), a);
            self.v = 0.0;
            self.set_out();
            let after = self.drive();
            self.dv.iter_mut().for_each(|s| *s *= after / a);
            rest -= t;
        }
    }

    /// The same without an event in it.
    fn advance(&mut self, stretch: &Stretch, a: f64) {
        let (travel, end) = stretch.travel(self.v, a);
        let (z_of_v, v_of_v) = stretch.of_velocity();
        for (dz, dv) in self.dz.iter_mut().zip(&mut self.dv) {
            *dz += z_of_v * *dv;
            *dv *= v_of_v;
        }
        let (z_of_a, v_of_a) = stretch.of_drive();
        self.dz[GAIN] += self.torque * z_of_a;
        self.dv[GAIN] += self.torque * v_of_a;
        self.dz[FRICTION] -= self.way * z_of_a;
        self.dv[FRICTION] -= self.way * v_of_a;
        self.dz[OFFSET] += z_of_a;
        self.dv[OFFSET] += v_of_a;
        let (z_of_beta, v_of_beta) = stretch.of_beta(self.v, a, self.puck.damping);
        self.dz[DAMPING] += z_of_beta;
        self.dv[DAMPING] += v_of_beta;
        self.z += travel;
        self.v = end;
    }
}
