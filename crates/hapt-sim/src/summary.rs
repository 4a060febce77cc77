//! The summary of a run: peaks, clipping, energy, growth.

use hapt_model::World;

use hapt_plant::Ledger;

use crate::energy::world_energy;
use crate::growth::Growth;
use crate::row::Row;
use crate::run::Simulation;

/// A run in a few numbers, gathered row by row.
#[derive(Clone, Debug)]
pub struct Summary<'w> {
    world: &'w World,
    /// The number of rows.
    pub rows: u64,
    /// The largest |torque| in N·m (linear: N), before levels and limit.
    pub peak_torque: f64,
    /// The time of that torque, in s.
    pub peak_time: f64,
    /// The number of samples whose torque exceeds the motor's limit.
    pub clipped: u64,
    /// The first of them, k, and its time in s.
    pub first_clipped: Option<(u64, f64)>,
    /// The number of steps of the bodies that found no nonlinear torques that agree: such a step loses energy.
    pub unsettled: u32,
    /// The device's works over the run.
    pub ledger: Ledger,
    limit: f64,
    /// The puck, bodies and bristles of the last row.
    last: (f64, Vec<(f64, f64)>, Vec<f64>),
    has_bristles: bool,
    growth: Option<Growth>,
}

impl<'w> Summary<'w> {
    /// Before the first row of `run`, a run of this world.
    pub fn new(world: &'w World, run: &Simulation) -> Self {
        Summary {
            world,
            rows: 0,
            peak_torque: 0.0,
            peak_time: 0.0,
            clipped: 0,
            first_clipped: None,
            unsettled: 0,
            ledger: Ledger::default(),
            limit: world.device.limit.unwrap_or(f64::INFINITY),
            last: (0.0, vec![(0.0, 0.0); world.bodies.len()], vec![0.0; world.couplings.len()]),
            has_bristles: world.couplings.iter().any(|coupling| coupling.law.has_bristle()),
            growth: run.still_from().filter(|_| run.is_even()).and_then(|from| Growth::new(world, from, run.rows())),
        }
    }

    /// Adds the next row.
    #[inline]
    pub fn add(&mut self, row: &Row) {
        if row.torque.abs() > self.peak_torque {
            (self.peak_torque, self.peak_time) = (row.torque.abs(), row.time);
        }
        if row.torque.abs() > self.limit {
            self.clipped += 1;
            self.first_clipped.get_or_insert((self.rows, row.time));
        }
        if let Some(growth) = &mut self.growth {
            growth.add(row.time, &self.last.1, &row.bodies);
        }
        self.rows += 1;
        self.last.0 = row.puck;
        self.last.1.clone_from(&row.bodies);
        if self.has_bristles {
            self.last.2.clone_from(&row.bristles);
        }
        (self.ledger, self.unsettled) = (row.ledger, row.unsettled);
    }

    /// The energy that the world stores at the last row, in J.
    pub fn final_energy(&self) -> f64 {
        if self.rows == 0 { 0.0 } else { world_energy(self.world, self.last.0, &self.last.1, &self.last.2) }
    }

    /// The exponent of the bodies' motion in 1/s, fitted to the run while the puck is held still; `None` if it never is, if
    /// nothing moves, or if a nonlinear coupling is at a body (then there is no single exponent).
    pub fn fitted_growth(&self) -> Option<f64> {
        self.growth.as_ref().and_then(Growth::slope)
    }
}
