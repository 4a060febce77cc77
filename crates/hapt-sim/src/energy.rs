//! The energy that a world stores, and the work that a delay makes available at the start.

use hapt_model::World;

use crate::Row;

/// The energy that the world stores in J, at the puck's true position and the bodies' state: bodies J v²/2, springs k (q - rest)²/2, walls
/// k (q - at)²/2 inside, detents torque · pitch/2π · (1 - cos 2π(q - phase)/pitch), constants -torque · q, bristles σ0 s²/2; a
/// clamped spring or wall k x²/2 up to the x at which it reaches its limit, and limit · x from there on.
pub fn world_energy(world: &World, puck: f64, bodies: &[(f64, f64)], bristles: &[f64]) -> f64 {
    hapt_plant::stored_energy(&world.bodies, &world.couplings, puck, bodies, bristles)
}

/// The largest work that a hand gains from a delay at the start of a run. Until the first command arrives the motor holds 0 instead of the
/// world's τ_0, so that the hand saves at most |τ_0| times the length of the puck's path. The path of a sample, on which the puck may
/// reverse, is taken as the larger of its displacement and T times the speeds at its two ends. It is 0 for a loop that begins without
/// torque.
#[derive(Clone, Copy, Debug)]
pub struct DelayWork {
    /// Samples until the first command arrives.
    left: u64,
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
        // A delay within 1e-6 of a whole number of samples is that number.
        let samples = (world.sampling.delay_s() / world.sampling.period - 1e-6).ceil();
        DelayWork { left: samples.max(0.0) as u64, period: world.sampling.period, from: None, work: 0.0 }
    }

    /// The next row, from the first on.
    pub fn add(&mut self, row: &Row) {
        let torque = match self.from {
            None => row.command.abs(),
            Some((torque, [position, velocity])) if self.left > 0 => {
                self.left -= 1;
                let path = self.period * (velocity.abs() + row.puck_velocity.abs());
                self.work += torque * (row.puck - position).abs().max(path);
                torque
            }
            Some(_) => return,
        };
        self.from = Some((torque, [row.puck, row.puck_velocity]));
    }
}
