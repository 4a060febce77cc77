//! The summary of a run: peaks, clipping, energy, growth.

use hapt_model::{Coupling, End, World};

use hapt_plant::Ledger;

use crate::energy::world_energy;
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
    /// The device's works over the run.
    pub ledger: Ledger,
    limit: f64,
    /// The puck, bodies and bristles of the last row.
    last: (f64, Vec<(f64, f64)>, Vec<f64>),
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
            ledger: Ledger::default(),
            limit: world.device.limit.unwrap_or(f64::INFINITY),
            last: Default::default(),
            growth: run.still_from().filter(|_| run.is_even()).and_then(|from| Growth::new(world, from, run.rows())),
        }
    }

    /// Adds the next row.
    pub fn add(&mut self, row: &Row) {
        if row.torque.abs() > self.peak_torque {
            (self.peak_torque, self.peak_time) = (row.torque.abs(), row.time);
        }
        if row.torque.abs() > self.limit {
            self.clipped += 1;
            self.first_clipped.get_or_insert((self.rows, row.time));
        }
        if let Some(growth) = &mut self.growth {
            growth.add(self.world, row);
        }
        self.rows += 1;
        self.last.0 = row.puck;
        self.last.1.clone_from(&row.bodies);
        self.last.2.clone_from(&row.bristles);
        self.ledger = row.ledger;
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

/// Fits e^{growth t} to the bodies' steps.
///
/// With the puck still, x_{k+1} - x_k obeys the world's map without its equilibrium, so that the energy of these steps,
/// Σ J Δv²/2 + Σ k Δq²/2, swings little and grows with twice the exponent: the fit is the least-squares slope of half its
/// logarithm. The second half of the stretch counts, where only the slowest motion is left, unless it has decayed by then; its
/// ends count little, so that a swing of the energy within each turn does not tilt the line.
#[derive(Clone, Debug)]
struct Growth {
    from: f64,
    half: u64,
    rows: u64,
    last: Option<Vec<(f64, f64)>>,
    first_energy: f64,
    index: u64,
    all: Line,
    late: Line,
}

impl Growth {
    fn new(world: &World, from: f64, rows: u64) -> Option<Self> {
        let linear = |coupling: &Coupling| !coupling.is_at_body() || coupling.linear().is_some();
        if world.bodies.is_empty() || !world.couplings.iter().all(linear) {
            return None;
        }
        let first = (from / world.sampling.period).round() as u64;
        let half = first + rows.saturating_sub(first) / 2;
        let (all, late) = (Line::default(), Line::default());
        Some(Growth { from, half, rows, last: None, first_energy: 0.0, index: 0, all, late })
    }

    fn add(&mut self, world: &World, row: &Row) {
        let index = self.index;
        self.index += 1;
        if row.time < self.from {
            return;
        }
        let Some(last) = &mut self.last else {
            self.last = Some(row.bodies.clone());
            return;
        };
        // The last row's place becomes the step, and then the last row again.
        for (last, now) in last.iter_mut().zip(&row.bodies) {
            *last = (now.0 - last.0, now.1 - last.1);
        }
        let energy = step_energy(world, last);
        last.clone_from(&row.bodies);
        if self.first_energy == 0.0 {
            self.first_energy = energy;
        }
        // Ten digits below the start, the steps are rounding.
        if energy > 1e-20 * self.first_energy && energy.is_finite() {
            let y = 0.5 * energy.ln();
            self.all.add(row.time - self.from, y, 1.0);
            if index >= self.half {
                let place = (index - self.half) as f64 / (self.rows - self.half) as f64;
                self.late.add(row.time - self.from, y, (std::f64::consts::PI * place).sin().powi(4));
            }
        }
    }

    fn slope(&self) -> Option<f64> {
        if self.late.points >= ENOUGH { self.late.slope() } else { self.all.slope() }
    }
}

/// The least number of points of a fit.
const ENOUGH: u64 = 8;

/// The energy of a difference of two states, the puck held.
fn step_energy(world: &World, step: &[(f64, f64)]) -> f64 {
    let moving: f64 = world.bodies.iter().zip(step).map(|(body, (_, v))| 0.5 * body.inertia * v * v).sum();
    let at = |end: End| match end {
        End::Body(i) => step.get(i).map_or(0.0, |x| x.0),
        End::Puck | End::Ground => 0.0,
    };
    let stored: f64 = world
        .couplings
        .iter()
        .map(|coupling| {
            let q = at(coupling.first) - at(coupling.second);
            coupling.linear().map_or(0.0, |linear| 0.5 * linear.stiffness * q * q)
        })
        .sum();
    moving + stored
}

/// A weighted least-squares line, by running means.
#[derive(Clone, Debug, Default)]
struct Line {
    points: u64,
    weight: f64,
    mean_x: f64,
    mean_y: f64,
    xx: f64,
    xy: f64,
}

impl Line {
    fn add(&mut self, x: f64, y: f64, weight: f64) {
        self.points += 1;
        if weight <= 0.0 {
            return;
        }
        self.weight += weight;
        let dx = x - self.mean_x;
        self.mean_x += dx * weight / self.weight;
        self.mean_y += (y - self.mean_y) * weight / self.weight;
        self.xx += weight * dx * (x - self.mean_x);
        self.xy += weight * dx * (y - self.mean_y);
    }

    fn slope(&self) -> Option<f64> {
        (self.points >= ENOUGH && self.xx > 0.0).then(|| self.xy / self.xx)
    }
}
