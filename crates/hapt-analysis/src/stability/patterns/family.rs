//! The maps of the hands-off loop from one sample to the next, one for each interval and delay.
//!
//! World and estimator step by the nominal period whatever the true interval is, so that only the puck knows of it. With
//! X(h, d) the change of (z, ż, τ) over an interval h whose command arrives after d,
//!
//! ```text
//! s_{k+1} = s_k + (F + G X(h, d)) s_k
//! ```
//!
//! In units of a time r, q = (z, r ż, r² τ/J) obeys q' = A q + B c, c = r² command/J. With s = (h - d)/r, the new command c and the old one c₀,
//!
//! ```text
//! ∂²q/∂h² = A e^{As} (e^{Ad/r} (A q + B c₀) + B (c - c₀))/r²,    ∂²q/∂d² = -A e^{As} B (c₀ - c)/r²
//! ```
//!
//! The symmetric part of A has no eigenvalue above 1/√2, so that |e^{As}| ≤ e^{s/√2} for s ≥ 0.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{DMatrix, DVector, RowDVector};

use crate::equations::closed_loop::{ClosedLoop, Hold, PuckChange};

/// What follows on a sample, both in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// To the next sample.
    pub interval: f64,
    /// To the arrival of its command.
    pub delay: f64,
}

/// See the module documentation.
pub(crate) struct Family<'a> {
    parts: &'a ClosedLoop<'a>,
    damping: f64,
    inertia: f64,
    lag: f64,
    /// Whether a command may arrive after its sample, so that the one before is part of the state.
    late: bool,
    /// F.
    fixed: DMatrix<f64>,
    /// G.
    effect: DMatrix<f64>,
}

/// Intervals and delays between two of each, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub interval: [f64; 2],
    pub delay: [f64; 2],
}

/// Bounds of the second derivatives of a family in one norm.
pub(crate) struct Curvature {
    reference: f64,
    /// How fast e^{-As} may grow.
    back: f64,
    gain: f64,
    before: f64,
    switch: f64,
}

impl<'a> Family<'a> {
    pub fn new(parts: &'a ClosedLoop<'a>, damping: f64, inertia: f64, lag: f64, late: bool) -> Self {
        let none = || RowDVector::zeros(parts.order);
        let still = PuckChange { position: none(), velocity: none(), motor: none() };
        let fixed = parts.map(&still);
        // Affine in the change: its column is what one unit changes.
        let mut effect = DMatrix::zeros(parts.order, 3);
        let unit = || RowDVector::from_fn(parts.order, |_, j| if j == parts.velocity { 1.0 } else { 0.0 });
        let moved = [
            PuckChange { position: unit(), ..still.clone() },
            PuckChange { velocity: unit(), ..still.clone() },
            PuckChange { motor: unit(), ..still.clone() },
        ];
        for (i, change) in moved.iter().enumerate() {
            effect.set_column(i, &(parts.map(change) - &fixed).column(parts.velocity));
        }
        let lag = if parts.motor.is_some() { lag } else { 0.0 };
        Family { parts, damping, inertia, lag, late, fixed, effect }
    }

    /// The number of states.
    pub fn order(&self) -> usize {
        self.parts.order
    }

    /// The change of the state over a step: the map less 1.
    pub fn at(&self, step: Step) -> DMatrix<f64> {
        let before = if self.late { step.delay } else { 0.0 };
        let change = self.parts.puck(self.damping, Hold { interval: step.interval, before, age: 0 });
        let rows = [&change.position, &change.velocity, &change.motor];
        let mut d = self.fixed.clone();
        for (i, row) in rows.into_iter().enumerate() {
            d += self.effect.column(i) * row;
        }
        d
    }

    /// The bounds in the norm |C s|, with the longest interval as reference.
    pub fn curvature(&self, c: &DMatrix<f64>, inverse: &DMatrix<f64>, reference: f64) -> Curvature {
        let r = reference;
        let [loss, rate] = [self.damping * r / self.inertia, if self.lag > 0.0 { r / self.lag } else { 0.0 }];
        let torque = r * r / self.inertia;
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, -loss, 1.0, 0.0, 0.0, -rate]);
        let b = match self.lag > 0.0 {
            true => DVector::from_row_slice(&[0.0, 0.0, rate]),
            false => DVector::from_row_slice(&[0.0, 1.0, 0.0]),
        };
        // Without a lag there is no third row.
        let lagged = if self.lag > 0.0 { 1.0 / torque } else { 0.0 };
        let outer = DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, 1.0 / r, lagged]));
        let mut q = DMatrix::zeros(3, self.order());
        q[(1, self.parts.velocity)] = r;
        if let Some(motor) = self.parts.motor {
            q[(2, motor)] = torque;
        }
        let new = self.parts.command(0) * torque;
        let old = if self.late { self.parts.command(1) * torque } else { new.clone() };
        Curvature {
            reference: r,
            back: FRAC_1_SQRT_2 + loss.max(rate),
            gain: (c * &self.effect * outer * &a).norm(),
            before: ((&a * q + &b * &old) * inverse).norm(),
            switch: (b * (new - old) * inverse).norm(),
        }
    }
}

impl Cell {
    pub fn corners(&self) -> [Step; 4] {
        let [[h0, h1], [d0, d1]] = [self.interval, self.delay];
        [[h0, d0], [h1, d0], [h0, d1], [h1, d1]].map(|[interval, delay]| Step { interval, delay })
    }
}

impl Curvature {
    /// How far the maps of a cell lie from the mean of its corners at most: along the intervals and along the delays.
    pub fn error(&self, cell: &Cell) -> [f64; 2] {
        let r = self.reference;
        let grown = |s: f64| if s >= 0.0 { (FRAC_1_SQRT_2 * s).exp() } else { (self.back * -s).exp() };
        let [s0, s1] = [(cell.interval[0] - cell.delay[1]) / r, (cell.interval[1] - cell.delay[0]) / r];
        let most = grown(s0).max(grown(s1));
        let along = (FRAC_1_SQRT_2 * cell.delay[1] / r).exp() * self.before + self.switch;
        let part = |[from, to]: [f64; 2]| ((to - from) / r).powi(2) / 8.0;
        [part(cell.interval) * self.gain * most * along, part(cell.delay) * self.gain * most * self.switch]
    }
}
