//! The puck under a held torque: its positions at given times, and their sensitivities to each parameter.
//!
//! Stops, starts and reversals under Coulomb friction are located, not stepped over. Across an event at t* the sensitivity S of the state
//! jumps by (f₋ - f₊) dt*/dθ, f being the state's rate before and after it (Rozenvasser; Hiskens and Pai, IEEE Trans. Circuits Syst. I 47
//! (2000) 204): at rest the velocity's sensitivity is 0, and the delay acts through the steps of the torque.
//!
//! A motor that lags has a torque of its own: the command that is held plus a gap, which decays with the lag. A step of the command changes
//! both, but not their sum.

use crate::arrivals::Arrivals;
use crate::lagging::Lagging;
use crate::stretch::{Stretch, stopping_time};

/// The parameters on which the motion depends: everything per unit of inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Puck {
    /// α = 1/J in 1/(kg·m²) (linear: 1/kg); negative for a motor of the other sign.
    pub gain: f64,
    /// β = b/J in 1/s.
    pub damping: f64,
    /// γ = f/J in rad/s² (linear: m/s²).
    pub friction: f64,
    /// The delay from the sample to the change of the torque, in s.
    pub delay: f64,
    /// δ in rad/s² (m/s²): a constant torque that was not commanded, over J; a motor's offset, a tilted table.
    pub offset: f64,
    /// The position at the start, in rad (m).
    pub position: f64,
    /// The velocity at the start, in rad/s (m/s).
    pub velocity: f64,
    /// The time constant in s with which the torque follows its command; 0: without delay.
    pub lag: f64,
}

/// How many parameters there are.
pub(crate) const PARAMETERS: usize = 8;

/// The derivatives of a position by gain, damping, friction, mean time to the torque, offset, first position, first velocity, squared lag.
pub type Sensitivity = [f64; PARAMETERS];

pub(crate) const GAIN: usize = 0;
pub(crate) const DAMPING: usize = 1;
pub(crate) const FRICTION: usize = 2;
pub(crate) const DELAY: usize = 3;
pub(crate) const OFFSET: usize = 4;
const POSITION: usize = 5;
const VELOCITY: usize = 6;
pub(crate) const LAG: usize = 7;

/// The most stops and starts of the puck between two changes of torque; the true number is at most two.
const MOST_EVENTS: usize = 8;

/// The present state of the motion.
#[derive(Clone, Debug)]
struct SimulatedPuck {
    puck: Puck,
    z: f64,
    v: f64,
    /// The motor's torque less the command that is held; 0 without a lag.
    gap: f64,
    /// 1 or -1 while it moves, 0 at rest.
    direction: f64,
    torque: f64,
    /// Sensitivities of position, velocity and gap; at [`DELAY`] and [`LAG`] to the delay and the lag themselves.
    dz: Sensitivity,
    dv: Sensitivity,
    dgap: Sensitivity,
}

impl Puck {
    /// As an array, in the order of [`Sensitivity`]. Delay and lag enter as the mean and the variance of the time from a command to its
    /// torque, d + λ and λ²: a record of slow changes determines only the first.
    pub fn parameters(&self) -> Sensitivity {
        let Puck { gain, damping, friction, delay, offset, position, velocity, lag } = *self;
        [gain, damping, friction, delay + lag, offset, position, velocity, lag * lag]
    }

    /// The puck of such an array.
    pub fn from_parameters(p: Sensitivity) -> Self {
        let [gain, damping, friction, mean, offset, position, velocity, variance] = p;
        let lag = variance.max(0.0).sqrt();
        Puck { gain, damping, friction, delay: mean - lag, offset, position, velocity, lag }
    }

    /// Positions at `times` under torques commanded at the same times and held; the first command also holds before its time.
    pub fn positions(&self, times: &[f64], torques: &[f64]) -> Vec<f64> {
        let mut positions = Vec::with_capacity(times.len());
        self.follow(times, torques, 0, |_, z, _| positions.push(z));
        positions
    }

    /// Passes each time's index from `first` on, the position there and its sensitivities to `see`; the motion starts at `first`.
    pub fn follow(&self, times: &[f64], torques: &[f64], first: usize, mut see: impl FnMut(usize, f64, &Sensitivity)) {
        let (Some(&start), Some(&held)) = (times.get(first), torques.first()) else { return };
        let mut motion = SimulatedPuck::new(*self, held);
        // The commands that arrived before the start; their effect remains in the gap of a motor that lags.
        let (mut arrivals, mut now) = (Arrivals::new(times, torques, self.delay), f64::NEG_INFINITY);
        while let Some((at, torque)) = arrivals.change(start, motion.torque) {
            motion.relax(at - now);
            now = at;
            motion.command(torque);
        }
        motion.relax(start - now);
        motion.set_out();
        now = start;
        for (i, &to) in times.iter().enumerate().skip(first) {
            while let Some((at, torque)) = arrivals.change(to, motion.torque) {
                motion.pass(at - now);
                now = at;
                motion.switch(torque);
            }
            motion.pass(to - now);
            now = to;
            if self.lag > 0.0 {
                let mut dz = motion.dz;
                dz[LAG] = (dz[LAG] - dz[DELAY]) / (2.0 * self.lag);
                see(i, motion.z, &dz);
            } else {
                see(i, motion.z, &motion.dz);
            }
        }
    }
}

impl SimulatedPuck {
    fn new(puck: Puck, torque: f64) -> Self {
        let none = [0.0; PARAMETERS];
        let (z, v) = (puck.position, puck.velocity);
        let mut motion = SimulatedPuck { puck, z, v, gap: 0.0, direction: 0.0, torque, dz: none, dv: none, dgap: none };
        (motion.dz[POSITION], motion.dv[VELOCITY]) = (1.0, 1.0);
        motion
    }

    /// The direction in which it goes, or that it rests.
    fn set_out(&mut self) {
        let push = self.push();
        self.direction = match self.v {
            v if v != 0.0 => v.signum(),
            _ if push.abs() <= self.puck.friction || push == 0.0 => 0.0,
            _ => push.signum(),
        };
        if self.direction == 0.0 {
            self.dv = [0.0; PARAMETERS];
        }
    }

    /// The acceleration that the motor's torque and the offset give together.
    fn push(&self) -> f64 {
        self.puck.gain * (self.torque + self.gap) + self.puck.offset
    }

    /// The acceleration that the command, offset and friction give together, without the contribution of the gap.
    fn drive(&self) -> f64 {
        let Puck { gain, friction, offset, .. } = self.puck;
        if self.direction == 0.0 { 0.0 } else { gain * self.torque + offset - friction * self.direction }
    }

    /// Another command arrives, at a time that moves with the delay; the torque of a motor that lags does not step.
    fn command(&mut self, torque: f64) {
        if self.puck.lag > 0.0 {
            let step = self.torque - torque;
            self.gap += step;
            self.dgap[DELAY] += step / self.puck.lag;
        }
        self.torque = torque;
    }

    /// Only the gap decays, over `length` s.
    fn relax(&mut self, length: f64) {
        if self.gap == 0.0 && self.dgap == [0.0; PARAMETERS] {
            return;
        }
        let rate = self.puck.lag.recip();
        let decay = (-rate * length).exp();
        self.dgap[LAG] += self.gap * rate * rate * length;
        self.dgap.iter_mut().for_each(|s| *s *= decay);
        self.gap *= decay;
    }

    /// The command of the torque steps during the motion.
    fn switch(&mut self, torque: f64) {
        if self.puck.lag > 0.0 {
            return self.command(torque);
        }
        let before = self.drive();
        self.command(torque);
        if self.v == 0.0 {
            self.set_out();
        }
        self.dv[DELAY] += before - self.drive();
    }

    /// Advances by `length` s under the command that is held.
    fn pass(&mut self, length: f64) {
        let mut rest = length;
        for _ in 0..MOST_EVENTS {
            if rest.is_nan() || rest <= 0.0 {
                return;
            }
            if self.direction == 0.0 {
                let Some(wait) = self.breaks_away(rest) else { return self.relax(rest) };
                self.relax(wait);
                self.direction = (self.puck.gain * self.torque + self.puck.offset).signum();
                rest -= wait;
                continue;
            }
            let a = self.drive();
            let Some(t) = self.stops(a, rest) else { return self.advance(rest, a) };
            self.advance(t, a);
            let before = a + self.puck.gain * self.gap;
            self.v = 0.0;
            self.set_out();
            let after = if self.direction == 0.0 { 0.0 } else { self.push() - self.puck.friction * self.direction };
            self.dv.iter_mut().for_each(|s| *s *= after / before);
            rest -= t;
        }
    }

    /// When the rising torque exceeds the friction, within `rest` s.
    fn breaks_away(&self, rest: f64) -> Option<f64> {
        if self.gap == 0.0 {
            return None;
        }
        let friction = self.puck.friction;
        let end = self.puck.gain * self.torque + self.puck.offset;
        if end == 0.0 || end.abs() <= friction {
            return None;
        }
        let part = (friction * end.signum() - end) / (self.puck.gain * self.gap);
        let wait = if part >= 1.0 { 0.0 } else { -self.puck.lag * part.ln() };
        (wait < rest).then_some(wait)
    }

    /// When the puck comes to rest within `rest` s.
    fn stops(&self, a: f64, rest: f64) -> Option<f64> {
        let damping = self.puck.damping;
        if self.gap == 0.0 {
            let (_, end) = Stretch::new(damping, rest).travel(self.v, a);
            let stops = end * self.direction < 0.0;
            return stops.then(|| stopping_time(self.v, a, damping).clamp(0.0, rest));
        }
        let speed = Lagging { beta: damping, rate: self.puck.lag.recip() };
        speed.first_rest(self.direction * self.v, self.direction * a, self.direction * self.puck.gain * self.gap, rest)
    }

    /// Advances by `length` s without an event.
    fn advance(&mut self, length: f64, a: f64) {
        let stretch = Stretch::new(self.puck.damping, length);
        let (mut travel, mut end) = stretch.travel(self.v, a);
        let (z_of_v, v_of_v) = stretch.of_velocity();
        for (dz, dv) in self.dz.iter_mut().zip(&mut self.dv) {
            *dz += z_of_v * *dv;
            *dv *= v_of_v;
        }
        let (z_of_a, v_of_a) = stretch.of_drive();
        self.dz[GAIN] += self.torque * z_of_a;
        self.dv[GAIN] += self.torque * v_of_a;
        self.dz[FRICTION] -= self.direction * z_of_a;
        self.dv[FRICTION] -= self.direction * v_of_a;
        self.dz[OFFSET] += z_of_a;
        self.dv[OFFSET] += v_of_a;
        let (z_of_beta, v_of_beta) = stretch.of_beta(self.v, a, self.puck.damping);
        self.dz[DAMPING] += z_of_beta;
        self.dv[DAMPING] += v_of_beta;
        if self.puck.lag > 0.0 {
            let (z, v) = self.advance_gap(length, &stretch);
            (travel, end) = (travel + z, end + v);
        }
        self.z += travel;
        self.v = end;
    }

    /// The contribution of the gap to position and velocity over a stretch, with its sensitivities, and its own decay.
    fn advance_gap(&mut self, length: f64, stretch: &Stretch) -> (f64, f64) {
        let Puck { gain, damping, lag, .. } = self.puck;
        let by = Lagging { beta: damping, rate: lag.recip() }.over(length, stretch);
        let gap = self.gap;
        for ((dz, dv), dgap) in self.dz.iter_mut().zip(&mut self.dv).zip(&self.dgap) {
            *dz += gain * by.travel * dgap;
            *dv += gain * by.speed * dgap;
        }
        self.dz[GAIN] += gap * by.travel;
        self.dv[GAIN] += gap * by.speed;
        self.dz[DAMPING] += gain * gap * by.travel_of_beta;
        self.dv[DAMPING] += gain * gap * by.speed_of_beta;
        // The rate is 1/λ.
        self.dz[LAG] -= gain * gap * by.travel_of_rate / (lag * lag);
        self.dv[LAG] -= gain * gap * by.speed_of_rate / (lag * lag);
        self.relax(length);
        (gain * gap * by.travel, gain * gap * by.speed)
    }
}
