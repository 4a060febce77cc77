//! The energy that a world stores, and the work that a delay makes available at the start.

use hapt_model::World;

use crate::Row;

/// The energy that the world stores in J, at the puck's true position and the bodies' state: bodies J v²/2, springs k (q - rest)²/2, walls
/// k (q - at)²/2 inside, detents torque · pitch/2π · (1 - cos 2π(q - phase)/pitch), constants -torque · q, bristles σ0 s²/2; a
/// clamped spring or wall k x²/2 up to the x at which it reaches its limit, and limit · x from there on.
pub fn world_energy(world: &World, puck: f64, bodies: &[(f64, f64)], bristles: &[f64]) -> f64 {
    hapt_plant::stored_energy(&world.bodies, &world.couplings, puck, bodies, bristles)
}

/// The largest work that a hand gains from a delay and a lag of the motor at the start of a run. Until the first command arrives the motor
/// holds 0 instead of the world's τ_0, and then lacks τ_0 e^{-t/lag} of it, so that the hand saves at most that times the length of the
/// puck's path. The path of a sample, on which the puck may reverse, is taken as the larger of its displacement and T times the speeds at
/// its two ends. It is 0 for a loop that begins without torque.
#[derive(Clone, Copy, Debug)]
pub struct DelayWork {
    /// Samples until the first command arrives.
    left: u64,
    /// The part of τ_0 that the motor lacks, and that part a sample later once the command has arrived.
    lacks: f64,
    decay: f64,
    /// T in s.
    period: f64,
    /// |τ_0| in N·m (linear: N), and the puck's position and velocity at the last row.
    from: Option<(f64, [f64; 2])>,
    /// The work so far, in J.
    pub work: f64,
}

impl DelayWork {
    /// Before the first row.
    pub fn new(world: &World) -> Self {
        let (period, lag) = (world.sampling.period, world.device.lag);
        // A delay within 1e-6 of a whole number of samples is that number.
        let samples = (world.sampling.delay_s() / period - 1e-6).ceil().max(0.0) as u64;
        let decay = if lag > 0.0 { libm::exp(-period / lag) } else { 0.0 };
        DelayWork { left: samples, lacks: 1.0, decay, period, from: None, work: 0.0 }
    }

    /// The next row, from the first on.
    pub fn add(&mut self, row: &Row) {
        let torque = match self.from {
            None => row.command.abs(),
            Some((torque, [position, velocity])) => {
                if self.left == 0 && self.decay == 0.0 {
                    return;
                }
                let path = self.period * (velocity.abs() + row.puck_velocity.abs());
                self.work += self.lacks * torque * (row.puck - position).abs().max(path);
                match self.left {
                    0 => self.lacks *= self.decay,
                    _ => self.left -= 1,
                }
                torque
            }
        };
        self.from = Some((torque, [row.puck, row.puck_velocity]));
    }
}
