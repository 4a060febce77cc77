//! The exponent of a held world's motion, fitted to a run.

use hapt_model::{Coupling, End, World};

/// The smallest number of rows of a fit.
const MIN_ROWS: u64 = 8;
/// The number of rows that count one by one; further ones count in blocks. A fast motion has decayed within the first rows.
const SINGLE_ROWS: u64 = 64;
/// The number of rows of a block.
const BLOCK_ROWS: u64 = 16;
/// Factors from 1 / `IN_RANGE` to `IN_RANGE` are multiplied without a check for overflow.
const IN_RANGE: f64 = 1e100;

/// Fits e^{growth t} to the bodies' steps.
///
/// With the puck still, x_{k+1} - x_k obeys the world's map without its equilibrium, so that the energy of these steps,
/// Σ J Δv²/2 + Σ k Δq²/2, oscillates little and grows with twice the exponent: the fit is the least-squares slope of half its
/// logarithm. The second half of the stretch is fitted, where the slowest motion dominates, unless it has decayed by then; its
/// ends have small weights, so that the energy's oscillation within each turn does not tilt the line. Neighbouring rows are averaged in
/// blocks: the logarithm of their product is the sum of their logarithms.
#[derive(Clone, Debug)]
pub(crate) struct Growth {
    from: f64,
    half: u64,
    rows: u64,
    /// J/2 of each body.
    inertias: Vec<f64>,
    /// The bodies at the ends of each spring, and k/2.
    springs: Vec<([Option<usize>; 2], f64)>,
    first_energy: Option<f64>,
    index: u64,
    block: Block,
    all: Line,
    late: Line,
}

impl Growth {
    /// For a run whose puck is held still from the time `from` on; `None` where a nonlinear coupling is at a body.
    pub fn new(world: &World, from: f64, rows: u64) -> Option<Self> {
        let linear = |coupling: &Coupling| !coupling.is_at_body() || coupling.linear().is_some();
        if world.bodies.is_empty() || !world.couplings.iter().all(linear) {
            return None;
        }
        let body = |end| match end {
            End::Body(i) => Some(i),
            End::Puck | End::Ground => None,
        };
        let spring = |coupling: &Coupling| {
            let stiffness = coupling.linear().map_or(0.0, |linear| linear.stiffness);
            (stiffness != 0.0).then(|| ([body(coupling.first), body(coupling.second)], 0.5 * stiffness))
        };
        let first = (from / world.sampling.period).round() as u64;
        Some(Growth {
            from,
            half: first + rows.saturating_sub(first) / 2,
            rows,
            inertias: world.bodies.iter().map(|body| 0.5 * body.inertia).collect(),
            springs: world.couplings.iter().filter_map(spring).collect(),
            first_energy: None,
            index: 0,
            block: Block::default(),
            all: Line::default(),
            late: Line::default(),
        })
    }

    /// The next row: its time, and the bodies at the last one and at it.
    pub fn add(&mut self, time: f64, last: &[(f64, f64)], now: &[(f64, f64)]) {
        let index = self.index;
        self.index += 1;
        if time < self.from {
            return;
        }
        let Some(first_energy) = self.first_energy else {
            self.first_energy = Some(0.0);
            return;
        };
        let energy = self.step_energy(last, now);
        let first_energy = if first_energy == 0.0 { energy } else { first_energy };
        self.first_energy = Some(first_energy);
        if index == self.half {
            self.end_block(index);
        }
        // Steps that are ten digits smaller than the first ones are rounding.
        if energy > 1e-20 * first_energy && energy.is_finite() {
            self.block.add(index, time - self.from, energy);
            if self.block.rows == BLOCK_ROWS || self.all.rows < SINGLE_ROWS {
                self.end_block(index + 1);
            }
        }
    }

    /// The exponent in 1/s.
    pub fn slope(&self) -> Option<f64> {
        if self.late.rows >= MIN_ROWS { self.late.slope() } else { self.all.slope() }
    }

    /// The energy of the difference of two states, the puck held.
    fn step_energy(&self, last: &[(f64, f64)], now: &[(f64, f64)]) -> f64 {
        let change = |end: Option<usize>| match end.map(|i| (last.get(i), now.get(i))) {
            Some((Some(last), Some(now))) => now.0 - last.0,
            _ => 0.0,
        };
        let mut energy = 0.0;
        for ((half, last), now) in self.inertias.iter().zip(last).zip(now) {
            let v = now.1 - last.1;
            energy += half * v * v;
        }
        for ([first, second], half) in &self.springs {
            let q = change(*first) - change(*second);
            energy += half * q * q;
        }
        energy
    }

    /// Adds the rows before `index` to the lines as one point.
    fn end_block(&mut self, index: u64) {
        let block = std::mem::take(&mut self.block);
        if block.rows == 0 {
            return;
        }
        let rows = block.rows as f64;
        let (x, y) = (block.times / rows, 0.5 * block.logarithm() / rows);
        self.all.add(x, y, 1.0, block.rows);
        if index > self.half {
            let place = (block.indices / rows - self.half as f64) / (self.rows - self.half) as f64;
            self.late.add(x, y, (std::f64::consts::PI * place).sin().powi(4), block.rows);
        }
    }
}

/// Neighbouring rows.
#[derive(Clone, Debug)]
struct Block {
    rows: u64,
    indices: f64,
    times: f64,
    /// The energies are `product` · e^`logarithms`.
    product: f64,
    logarithms: f64,
}

impl Default for Block {
    fn default() -> Self {
        Block { rows: 0, indices: 0.0, times: 0.0, product: 1.0, logarithms: 0.0 }
    }
}

impl Block {
    fn add(&mut self, index: u64, time: f64, energy: f64) {
        self.rows += 1;
        self.indices += index as f64;
        self.times += time;
        let is_in_range = |x: f64| x > 1.0 / IN_RANGE && x < IN_RANGE;
        if !is_in_range(energy) {
            self.logarithms += energy.ln();
            return;
        }
        self.product *= energy;
        if !is_in_range(self.product) {
            self.logarithms += self.product.ln();
            self.product = 1.0;
        }
    }

    /// Of the product of the energies.
    fn logarithm(&self) -> f64 {
        self.logarithms + self.product.ln()
    }
}

/// A weighted least-squares line, by running means.
#[derive(Clone, Debug, Default)]
struct Line {
    rows: u64,
    weight: f64,
    mean_x: f64,
    mean_y: f64,
    xx: f64,
    xy: f64,
}

impl Line {
    /// A point of `rows` rows, each of this weight.
    fn add(&mut self, x: f64, y: f64, weight: f64, rows: u64) {
        self.rows += rows;
        let weight = weight * rows as f64;
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
        (self.rows >= MIN_ROWS && self.xx > 0.0).then(|| self.xy / self.xx)
    }
}
